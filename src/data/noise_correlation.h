/* How the noise of neighbouring pixels is correlated: what resampling, stacking and drizzling leave.
 *
 *   at(dx, dy) = <n(x, y) n(x + dx, y + dy)> / <n^2>     1 at (0, 0), at(-dx, -dy) = at(dx, dy); 0 beyond the reach
 *
 * A sum of pixels sum_i h_i n_i has f^2 times the variance that independent pixels of the same width would give it,
 *
 *   f^2 = sum_ij h_i h_j at(i - j) / sum_i h_i^2
 *
 * With h the PSF that is the noise of the matched filter, which is what faint sources are found and measured in; for
 * h much wider than the reach it tends to sqrt(sum at), which resampling leaves alone while it lowers the width of a
 * pixel (Casertano et al. 2000, AJ 120, 2747, appendix A).
 */
#ifndef RX_DATA_NOISE_CORRELATION_H
#define RX_DATA_NOISE_CORRELATION_H

#include "base/extern.h"

RX_BEGIN_DECLS

enum {
    RX_NOISE_REACH = 8,
    RX_NOISE_SIDE = 2 * RX_NOISE_REACH + 1,
    RX_NOISE_QUADRANTS = 4,
    RX_NOISE_NEAR = 3
};

typedef enum rx_noise_origin {
    RX_NOISE_UNKNOWN,  /* too little sky to measure; taken as independent */
    RX_NOISE_WHITE,    /* stated */
    RX_NOISE_MEASURED, /* on pixels without sources */
    RX_NOISE_GIVEN     /* white noise under a kernel that was given */
} rx_noise_origin;

typedef struct rx_noise_correlation {
    rx_noise_origin origin;
    int correlated;                          /* 0: independent within the errors, and `at` says so exactly */
    double at[RX_NOISE_SIDE][RX_NOISE_SIDE]; /* [dy + RX_NOISE_REACH][dx + RX_NOISE_REACH] */
    double measured[RX_NOISE_SIDE]
                   [RX_NOISE_SIDE];  /* with what is within its error of 0; all 0: not measured */
    double error;                    /* 1 sigma of one of them, 0 where not measured */
    double scale;                    /* width of (pixel - sky) / sigma: 1 where sigma is the noise */
    long pixels;                     /* behind the measurement */
    double skewness, skewness_error; /* of their distribution, and 1 sigma; HUGE_VAL: too few to say */
    /* sum at, over lags of 3 pixels, of x low y low, x high y low, x low y high, x high y high; NAN with too little sky; and
     * 1 sigma. Where light was subtracted it may be below 0. */
    double quadrant[RX_NOISE_QUADRANTS], quadrant_error[RX_NOISE_QUADRANTS];
} rx_noise_correlation;

/* Independent pixels. */
rx_noise_correlation rx_noise_white(rx_noise_origin origin);

/* White noise convolved with kernel[height][width], cut at the reach. */
rx_noise_correlation rx_noise_of_kernel(const float *kernel, int width, int height);

/* On a crowded tile a part of the correlation measured is light: that of sources too faint to be found, correlated as
 * the PSF is. Its share, and a constant for the sky subtracted with it, are fitted to the measured correlation at all
 * lags; where they leave nothing at the nearest 8, pixels are independent. Else they are fitted at lags of 3 pixels
 * and more, not along rows and columns, as noise has short lags, and subtracted as far as the rest sums up to no less than independent pixels do.
 * A share below 5 of its errors counts as none, one above 0.85 as smoothed noise, or, where the pixels' distribution is skewed as light is,
 * as stars without end, whose light stays in the noise, independent from star to star. But smoothing that looks like this leaves a
 * pixel a tenth of its noise or less: where `photons`, the variance of the sky's over the one measured (0: not known), is
 * below 0.15 even so, read noise would have 50 times theirs, and all but the photons may be light. psf[height][width]. Returns
 * the share, 0 where nothing was done. */
double rx_noise_without_light(rx_noise_correlation *noise, const float *psf, int width, int height,
                              double photons);

/* Is there more of it 3 to 6 pixels away, by 5 errors, than resampling leaves? */
int rx_noise_reaches_far(const rx_noise_correlation *noise);

/* f of profile[height][width], at least 0.1; 1 for noise NULL, uncorrelated noise, or a profile of zeros. */
double rx_noise_factor(const rx_noise_correlation *noise, const float *profile, int width, int height);

/* Power spectrum: sum at(dx, dy) cos 2 pi (u dx + v dy), u and v in cycles per pixel; its mean over all frequencies,
 * and everywhere of independent pixels, is 1. At 0 it is the square of rx_noise_factor_wide(). */
double rx_noise_power(const rx_noise_correlation *noise, double u, double v);

/* Wide sums of a quadrant, in the noise of independent pixels: the root of `quadrant`, at least 0.1. */
double rx_noise_quadrant_factor(const rx_noise_correlation *noise, int q);

/* Do two quadrants differ by more than 5 errors, and their factors by more than 0.15 of the smaller one? */
int rx_noise_uneven(const rx_noise_correlation *noise);

/* f of a profile much wider than the reach: sqrt(sum at), at least 0.1. */
double rx_noise_factor_wide(const rx_noise_correlation *noise);

/* Was more measured than resampling leaves? Drizzle gives wide sums r / (1 - 1/(3r)) times the noise of independent
 * pixels where drops are r pixels wide (Fruchter & Hook 2002, PASP 114, 144), the most of all: 2.4 for drops of 2
 * pixels, 3.4 for those of 3, which is the limit here. Beyond are fringes, light that fills the tile, or smoothing. */
#define RX_NOISE_RESAMPLED 3.4
int rx_noise_is_structure(const rx_noise_correlation *noise);

RX_END_DECLS

#endif
