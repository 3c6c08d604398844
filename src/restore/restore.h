/* Restorers: an image with its sky, noise and PSF in, the restored image with the PSF of the output out.
 *
 * One row per kind in data/restorers.h. All of them take what image->hide hides as masked and hand on ADU above the
 * sky on the input's flux scale, finite everywhere, 0 under the mask but in narrow gaps (data/gaps.h), and no value under the mask
 * reaches any output. What they hand on may read the image's planes, whose owners must live as long. The same bytes for
 * any nthreads. *dst belongs to the caller (rx_restored_free()), NULL after an error. Errors: RX_INPUT (PSF
 * larger than the image or not finite), RX_SYSTEM, RX_INTERRUPTED. */
#ifndef RX_RESTORE_RESTORE_H
#define RX_RESTORE_RESTORE_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "data/restored.h"
#include "restore/params.h"

RX_BEGIN_DECLS

enum { RX_MAX_RUNS = 16 }; /* restorers of one run */

/* What a restorer is. */
enum {
    RX_TRAIT_PLAIN = 1,   /* hands on the pixels as they are */
    RX_TRAIT_PSF = 2,     /* needs the PSF of the tile, or makes use of it */
    RX_TRAIT_WHITE = 4,   /* knows noise of independent pixels only */
    RX_TRAIT_INVENTS = 8, /* may show what the pixels do not */
    RX_TRAIT_TRAINED = 16 /* works by a model, on tiles such as that was trained for */
};

typedef struct rx_restorer {
    const char *name; /* as in RESTORE_TYPE */
    const char *help; /* one line */
    int traits;       /* RX_TRAIT_... */
    rx_status (*run)(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                     rx_error *err);
} rx_restorer;

/* The table of kinds, n of them. */
const rx_restorer *rx_restorers(int *n);
const rx_restorer *rx_restorer_find(const char *name); /* NULL when unknown */

/* Is it AUTO, which stands for one that is chosen for the tile? Its run() is an error. */
int rx_restorer_is_auto(const rx_restorer *kind);

/* Can this kind not do without a PSF? NET makes use of one, but a BLIND model (par->model) works without. */
int rx_restorer_must_have_psf(const rx_restorer *kind, const rx_restore_params *par);

RX_END_DECLS

#endif
