/* Noise against aperture area on source-free sky: correlated noise measured by empty apertures. */
#ifndef RX_MEASURE_NOISE_H
#define RX_MEASURE_NOISE_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "data/sources.h"

RX_BEGIN_DECLS

enum { RX_NOISE_RADII = 16 };

/* sigma(A) = ratio(A) * sigma_pixel, A in pixels. `scale`, `power`: the power law ratio = scale A^power
 * (Labbe et al. 2003, AJ 125, 1107) that headers record and readers understand. Errors follow the points
 * themselves: after a deconvolution the noise at the scale of the PSF is amplified and that of large
 * areas is not, which no power law describes. Without points the power law. */
typedef struct rx_noise_law {
    double scale, power;
    int apertures; /* used, 0 = could not be fitted, or from what is known of the noise */
    int nradii;
    double area[RX_NOISE_RADII], ratio[RX_NOISE_RADII]; /* the points, area ascending */
    double scatter;                                     /* rms of the points about the power law, dex */
} rx_noise_law;

/* ratio(A) / sqrt(A), the factor on the sigma of independent pixels: points joined by lines in log-log,
 * the outermost ones beyond them; without points the power law. */
double rx_noise_law_factor(const rx_noise_law *law, double area);

/* The law for an image whose light comes from places `area` pixels larger: ratio(A) becomes ratio(A + area),
 * for an estimate that took the noise of the input with it and hides it on empty sky, as a network's image
 * does. area = 1 / sum PSF^2 of the input: at A = 0 that is the noise of a matched filter. */
void rx_noise_law_widen(rx_noise_law *law, double area);

/* The law that follows from the correlation, apertures 0; that of independent pixels, no points, without one. */
rx_noise_law rx_noise_law_of(const rx_noise_correlation *noise);

/* Empty apertures of each radius. */
typedef struct rx_noise_apertures {
    int count;
    uint64_t seed;
    int nthreads;
} rx_noise_apertures;

/* Fit the law with up to `count` empty apertures at each of several radii, thrown by `seed` where no
 * source, fragment or hidden pixel is near; the same for any nthreads. Too little free sky: apertures = 0, RX_OK.
 * image->law is not used. Errors: RX_SYSTEM without memory. */
rx_status rx_noise_law_fit(const rx_image *image, const rx_sources *sources, const rx_noise_apertures *throws,
                           rx_noise_law *law, rx_log *log, rx_error *err);

RX_END_DECLS

#endif
