/* The pipeline in memory: arrays in; restored image, sources and facts out. Without files, and without printing
 * but through the log. The programs run it too, as do self checks and campaigns, so that what they learn holds for
 * catalogues.
 *
 *   background -> psf                         rx_field_new(), of pipeline/field.h
 *   restore -> detect -> templates -> measure rx_field_extract()
 *
 * Its parts can be called one by one: rx_background_measure(), rx_psf_make(), rx_restorer.run, rx_detect_run(),
 * rx_template_fit_run(), rx_measure_run(). */
#ifndef RX_PIPELINE_PIPELINE_H
#define RX_PIPELINE_PIPELINE_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/record.h"
#include "data/restored.h"
#include "data/sources.h"
#include "pipeline/domain.h"
#include "pipeline/field.h"
#include "pipeline/params.h"
#include "pipeline/photometry.h"
#include "pipeline/residual.h"
#include "pipeline/template_fit.h"

RX_BEGIN_DECLS

typedef struct rx_result_noise rx_result_noise; /* measured on the restored image */

typedef struct rx_result {
    const rx_restorer *kind;          /* that was asked for */
    const rx_field *detect, *measure; /* what was worked on; the same one without dual-image mode */
    rx_field *own;                    /* made by rx_pipeline_run(), else NULL */
    rx_restored *restored;
    rx_sources *sources;       /* detected and measured; detection_snr ranks them */
    rx_template_fit templates; /* tphot NULL where templates are not wanted */
    rx_photometry photometry;
    const float *filtered; /* detection image after the filter: restored->pixels without one; NULL once none
                              wants it any more (rx_pipeline_params.keep_filtered) */
    float *own_filtered;   /* NULL without one */
    float
        filtered_scale; /* what `filtered` is to be multiplied by, as its filter has unit sum: CONV NONORM */
    rx_map noise; /* noise that thresholds refer to, ADU: of one of these, what was restored or the field */
    rx_result_noise *own_noise;
    rx_scaled_map *significant; /* THRESH_TYPE SIGNIFICANCE */
    rx_map_maker *input_noise;
    struct rx_gaps_map *in_gaps; /* its noise, too */
    double global_noise;
    int plain;    /* nothing was restored */
    int original; /* fluxes are of untouched pixels */
    /* of the detection image, where a network restored it with a PSF; else nx 0, share NAN */
    rx_residual residual;
    rx_domain domain;    /* of the detection image, where a network was asked for */
    int outside;         /* sources with RX_RESTORE_OUTSIDE */
    int sharp;           /* sources with RX_RESTORE_SHARP */
    rx_restored *second; /* restored measurement image, dual-image mode only */
    const char *by; /* restorer that did the tile, or its measurement image, instead of `kind`; NULL: none */
    char why[240];  /* why, or why AUTO chose it */
} rx_result;

/* What was found out on the way, as headers have it (RXREST, RXFWHM, RXSIGMA ...; rextract(1) explains them), added to
 * `facts`, which says in `failed` when memory ran out. */
void rx_result_facts(const rx_result *result, rx_record *facts);

/* What these params ask of a detection image with that restorer: RX_FIELD_PSF, RX_FIELD_FILTER or 0. */
int rx_pipeline_psf(const rx_pipeline_params *params, const rx_restorer *kind);

/* restore -> detect -> templates where wanted -> measure, on a prepared field. `measure`: of the same size, NULL
 * without dual-image mode. A kind that must have a PSF runs as NONE on a field that is `unrestorable`, the network as
 * OUT_OF_DOMAIN says on one that it was not trained for (pipeline/domain.h): dst->by then names what ran, every
 * source is marked RX_RESTORE_OTHER, and the log has a detail of it; without restore.fallback it is RX_NOT_RESTORED.
 * Sources in cells that the network does not explain are marked RX_RESTORE_UNEXPLAINED; those whose brightest pixel
 * is brighter, or whose sky is darker than in its training, and all of a tile outside of it, RX_RESTORE_OUTSIDE; all
 * of a tile whose noise is more correlated than resampling explains RX_RESTORE_STRUCTURE, and what fit/hits.h
 * finds RX_RESTORE_SHARP, whatever restored it. The
 * fields must live as long as the result. May run in several threads at the same time, on params and fields that stay
 * as they are meanwhile, each with a log of its own: the same result as alone. Errors: RX_INPUT (two sizes),
 * RX_NOT_RESTORED, those of the parts, RX_INTERRUPTED. Free with rx_result_free(); nothing is left after an error. */
rx_status rx_field_extract(const rx_pipeline_params *params, const rx_restorer *kind, const rx_field *detect,
                           const rx_field *measure, rx_log *log, rx_result *dst, rx_error *err);

/* Share of the sources with RX_RESTORE_SHARP, 0 without any. */
double rx_result_sharp(const rx_result *result);

/* So many boxes of what a network restored lie below the sky that it is no chance, and it was not trained for dark structure. */
bool rx_result_is_dark(const rx_result *result);

/* How many sources there were if DETECT_THRESH were `factor` times params->detect.threshold: detected again on what was
 * restored and filtered with these params, keep_filtered among them; without templates. Errors: RX_SYSTEM. */
rx_status rx_result_count(const rx_pipeline_params *params, const rx_result *result, double factor, long *n,
                          rx_error *err);
void rx_result_free(rx_result *result);

RX_END_DECLS

#endif
