/* What a tile's pixels hold that did not come through its PSF.
 *
 *   z = (pixel - sky) / sigma
 *
 * Sharp pixels: the PSF p puts light on either side of any pixel, so that for every sum of sources, points or not,
 *
 *   z(i) <= R (z(i - k) + z(i + k)) / 2,     R = p(0) / ((p(k) + p(-k)) / 2), its largest on the tile
 *
 * for steps k in x, y and along the diagonals, where pixels sample the PSF (a FWHM of 2.5 pixels). Beyond 1.2 R, and by 6 errors of the noise and the photons, it came to the
 * detector another way: a cosmic ray, a hot pixel or column. */
#ifndef RX_DETECT_ANOMALIES_H
#define RX_DETECT_ANOMALIES_H

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"

RX_BEGIN_DECLS

enum { RX_ANOMALIES_STEPS = 4 };

typedef struct rx_anomalies {
    double ratio[RX_ANOMALIES_STEPS]; /* R; 0: no PSF that is sampled is known */
} rx_anomalies;

/* Of the PSF of an image. Errors: RX_SYSTEM. */
rx_status rx_anomalies_measure(const rx_image *image, rx_anomalies *dst, rx_error *err);

/* Is that pixel, or one that touches it, sharper than the PSF? */
int rx_anomalies_sharp_at(const rx_anomalies *anomalies, const rx_image *image, int x, int y);

RX_END_DECLS

#endif
