/* A tile made ready for Richardson-Lucy: data above a pedestal, weights, noise.
 *
 * Richardson-Lucy needs data that are not negative, and its update does not depend on their scale, only on
 * how far a value stands above the level of the sky. The sky-subtracted data therefore get a pedestal
 * p = RL_PEDESTAL sigma (at least 1 sigma): high enough that d < 0, which has to be cut, is rare and the
 * sky level survives (the cut adds 4e-4 sigma to the mean at p = 3 sigma, 7e-6 at 4), low enough that
 * positivity holds the dark rings around sources down. The sky as it was in electrons, p = gain sigma^2,
 * would make the Poisson likelihood exact, but is 10 sigma and more on survey tiles, where the
 * iteration is all but linear and rings: it costs flux accuracy and detections.
 * One p serves the whole tile, as K p = p only for a constant; where sigma varies, it comes from the 98 %
 * quantile of sigma over good pixels, at most three times the median. The pixels' own sigma enters the
 * relative weights W = min(1, (median sigma / sigma)^2), which decide between neighbours only, as the
 * update is normalised by K^T W.
 *
 * Data and weights of a tile of up to 2^26 pixels are kept; those of a larger one, whose planes weigh more
 * than the time to make them again, are made from the tile whenever they are asked for: the same bits.
 *
 * Working unit: the pedestal. The sky is 1, sources are above it, whatever the unit of the
 * file, so that squares neither overflow nor vanish in single precision. */
#ifndef RX_RESTORE_PREPARED_H
#define RX_RESTORE_PREPARED_H

#include "base/error.h"
#include "data/image.h"
#include "data/map.h"
#include "restore/restore.h"

#define RX_PREPARED_KEPT ((size_t)1 << 26)
#define RX_PREPARED_LARGEST 1e7f /* far above any signal-to-noise; single precision holds the sky beside it */

typedef struct rx_prepared {
    int width, height, nthreads;
    rx_image image;  /* its owners must live as long */
    rx_map level;    /* of the image, ADU */
    float *data;     /* [height][width], NULL: not kept; see rx_prepared_data() */
    float *weight;   /* likewise, rx_prepared_weight() */
    uint8_t *mask;   /* [height][width], the image's bits as far as honoured */
    double pedestal; /* p, ADU */
    double photon;   /* 1 / (gain p), 0 without gain: var = variance + photon max(value - 1, 0) */
    double sigma;    /* median over good pixels, in units of p */
    double median;   /* the same in ADU */
    float peak;      /* largest value of data */
    size_t good;     /* pixels that are not masked */
} rx_prepared;

/* The bits by which the image hides pixels, into mask[height][width], zeroed before; a difference to the sky
 * that is not finite is bad as well. Returns the number of good pixels. */
size_t rx_prepared_mask(const rx_image *image, int nthreads, uint8_t *mask);

/* Stands in for the noise of a tile without any, ADU; mask[height][width]: 0 = good. */
double rx_prepared_noiseless(const rx_image *image, const uint8_t *mask);

/* Errors: RX_SYSTEM without memory. */
rx_status rx_prepared_new(const rx_restore_params *par, const rx_image *image, rx_prepared **dst,
                          rx_error *err);
void rx_prepared_free(rx_prepared *prepared);

/* n pixels of a row of the tile from (x, y) on, in the plane where there is one, else in `room`, the caller's
 * n floats. Data: (pixel - level) / p + 1, cut to 0 .. 1e7; 0 under the mask. Weight: W; 0 under the mask. */
const float *rx_prepared_data(const rx_prepared *prepared, int y, int x, int n, float *room);
const float *rx_prepared_weight(const rx_prepared *prepared, int y, int x, int n, float *room);

/* dst[n]: variance of the sky's noise, (sigma / p)^2; 1 under the mask. */
void rx_prepared_variance(const rx_prepared *prepared, int y, int x, int n, float *dst);

#endif
