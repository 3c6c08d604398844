/* Template photometry of one restorer's sources: shapes from its restored image, fluxes from the untouched
 * pixels, one more look at what the templates leave, and the verdict on every source. */
#ifndef RX_PIPELINE_TEMPLATE_FIT_H
#define RX_PIPELINE_TEMPLATE_FIT_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/restored.h"
#include "data/sources.h"
#include "fit/preal.h"
#include "pipeline/field.h"
#include "pipeline/params.h"

RX_BEGIN_DECLS

/* What one call found, for header, report and check-images. */
typedef struct rx_template_fit {
    rx_tphot *tphot;   /* owned; sources in the order of the list; NULL: nothing was fitted */
    int added;         /* sources that only the residual showed */
    int invented;      /* sources with a mark of FLAGS_RESTORE, before they are dropped */
    int dropped;       /* by PRECISION_TARGET, */
    double least;      /* of P_REAL below this */
    double per_mpixel; /* invented per 10^6 usable pixels */
    double chi2;       /* reduced, of the residual over usable pixels: noise of sky and photons */
    double fwhm;       /* of the PSF that was fitted, pixels */
    rx_preal preal[2]; /* where it is not crowded, where it is */
    rx_sources *
        forced; /* owned; a row for each listed position, in their order, `fit` filled; NULL: there is no list */
    int unknown_noise; /* pixels have next to none, and models do not explain them to that: no source can be tested */
} rx_template_fit;

/* Fill `fit` of every source of the list, detected on `restored`, from the pixels of fields.measure. The PSF is
 * restored->blur, else that of the field; without one nothing is fitted, with a warning. In dual-image mode
 * positions, shapes and added sources are those of fields.detect (forced photometry). Added sources are appended,
 * those that PRECISION_TARGET has no room for removed. detection_snr of added sources is left at 0. Saturated
 * pixels never take part. Errors: RX_INPUT, RX_USAGE, RX_SYSTEM, RX_INTERRUPTED. Free with rx_template_fit_free(). */
rx_status rx_template_fit_run(const rx_pipeline_params *params, rx_fields fields, const rx_restored *restored,
                              rx_sources *sources, rx_log *log, rx_template_fit *dst, rx_error *err);

void rx_template_fit_free(rx_template_fit *fit); /* content only */

RX_END_DECLS

#endif
