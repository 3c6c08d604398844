/* Does the restored image explain the pixels it was made of? By cells of 64 x 64 pixels of
 *
 *   d = (input - sky - restored * PSF) / noise,    noise^2 = sigma^2 + photons of the model
 *
 * over the pixels that were used. A cell with a quarter of its pixels or more is not explained where the mean of d^2,
 * without the pixels of stars too bright for any PSF to be right (whose model is above 100 sigma), exceeds 2, or the
 * mean of d 0.3 on either side: a PSF that is wrong, structure that was smoothed away or invented, a sky that is off.
 * Dark cells are those whose own pixels lie 0.3 sigma below the sky: lanes of dust, or a mesh that bright light has
 * lifted, where a network that knows no sky below its mesh cannot be right. */
#ifndef RX_PIPELINE_RESIDUAL_H
#define RX_PIPELINE_RESIDUAL_H

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"
#include "data/restored.h"

RX_BEGIN_DECLS

enum { RX_RESIDUAL_CELL = 64 };

typedef struct rx_residual {
    int nx, ny; /* 0: nothing is known */
    unsigned char
        *cell; /* [ny][nx] bits: 1 not explained; 2, 4, 8, 16 its quarters (x fastest) are dark; owned */
    long cells, unexplained;
    double share; /* unexplained / cells; NAN where there are none */
    double dark;  /* share of boxes of 32 x 32 pixels whose mean lies more than 0.3 sigma below the sky */
} rx_residual;

/* restored->reblurred is given. The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_residual_flag(const rx_image *image, const rx_restored *restored, int nthreads, rx_residual *dst,
                           rx_error *err);
void rx_residual_free(rx_residual *residual); /* content only */

/* Is the pixel in a cell that is not explained; in a dark box? */
int rx_residual_at(const rx_residual *residual, double x, double y);
int rx_residual_dark_at(const rx_residual *residual, double x, double y);

/* So many are not explained that the tile as a whole is in doubt. */
int rx_residual_is_large(double share);

/* So many boxes lie below the sky that it is no chance: noise alone gives 1e-3 of them at the widest correlation. */
int rx_residual_is_dark(double dark);

RX_END_DECLS

#endif
