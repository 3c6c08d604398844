/* The parameters of restoration. */
#ifndef RX_RESTORE_PARAMS_H
#define RX_RESTORE_PARAMS_H

#include "base/extern.h"
#include "nn/model.h"

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
    double file_fwhm;               /* FILE: FWHM (pixels) of its PSF, a Gaussian; 0: file_psf */
    const char *file_psf;           /* FILE: file of its PSF */
    int keep_reblurred;             /* fill rx_restored.reblurred (check-image RESIDUAL) */
    int keep_support;               /* and .support (check-image SUPPORT) */
    int nthreads;
} rx_restore_params;

RX_END_DECLS

#endif
