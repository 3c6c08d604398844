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

/* What becomes of a tile whose seeing or noise the network was not trained for (OUT_OF_DOMAIN). */
typedef enum rx_out_of_domain { RX_DOMAIN_WARN, RX_DOMAIN_RL, RX_DOMAIN_FAIL } rx_out_of_domain;

/* Pedestal under the sky of RL, sky sigmas: high enough that data below 0, which have to be cut, are rare. */
#define RX_RL_PEDESTAL 4.0

typedef struct rx_restore_params {
    int rl_niter;                   /* RL_NITER */
    int rl_accelerate;              /* RL_ACCELERATE */
    int rl_stop_discrepancy;        /* RL_STOP DISCREPANCY: stop when the reduced chi2 falls to 1 */
    double rl_denoise;              /* RL_DENOISE, FWHM of the Gaussian afterwards, 0 = off: in pixels, or */
    int rl_denoise_by_psf;          /* in units of the FWHM of the tile's PSF, as RL_DENOISE is */
    double rl_pedestal;             /* sky sigmas [RX_RL_PEDESTAL] */
    const rx_model *model;          /* NET; not owned, NULL when NET is not wanted */
    int net_block;                  /* NET_BLOCK: width of a block, pixels, a multiple of 4 */
    rx_precision precision;         /* NET_PRECISION */
    int verify_seams;               /* VERIFY_SEAMS */
    rx_out_of_domain out_of_domain; /* obeyed by the pipeline (pipeline/domain.h), not by the restorer */
    int fallback;                   /* RESTORE_FALLBACK, likewise: another restorer may do the tile */
    int mask_saturated;             /* likewise: saturated pixels of its image are hidden */
    int keep_reblurred;             /* fill rx_restored.reblurred (check-image RESIDUAL) */
    int keep_support;               /* and .support (check-image SUPPORT) */
    int nthreads;
} rx_restore_params;

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
