/* The stage in memory, without outputs: one prepared field through one restorer. Self checks and campaigns
 * use it, and rx_run_extract() does, so that what they learn holds for the catalogue. */
#ifndef RX_STAGE_PROBE_H
#define RX_STAGE_PROBE_H

#include "base/error.h"
#include "base/log.h"
#include "data/map.h"
#include "data/restored.h"
#include "data/sources.h"
#include "stage/domain.h"
#include "stage/field.h"
#include "stage/options.h"
#include "stage/photometry.h"
#include "stage/template_fit.h"

typedef struct rx_probe_noise rx_probe_noise; /* measured on the restored image */

typedef struct rx_probe {
    rx_restored *restored;
    rx_sources *sources;       /* detected and measured; detection_snr ranks them */
    rx_template_fit templates; /* tphot NULL where templates are not wanted */
    rx_photometry photometry;
    const float *filtered; /* detection image after the filter: restored->pixels without one; NULL once nobody
                              wants it any more (rx_options.keep_filtered) */
    float *own_filtered;   /* NULL without one */
    rx_map noise; /* noise that thresholds refer to, ADU: of one of these, what was restored or the field */
    rx_probe_noise *own_noise;
    rx_map_maker *input_noise;
    double global_noise;
    int plain;           /* nothing was restored */
    int original;        /* fluxes are of untouched pixels */
    rx_domain domain;    /* of the detection image, where a network was asked for */
    rx_restored *second; /* restored measurement image, dual-image mode only */
    const char *by; /* restorer that did the tile, or its measurement image, instead of `kind`; NULL: none */
    char why[240];  /* why */
} rx_probe;

/* restore -> detect -> templates where wanted -> measure. `measure` NULL without dual-image mode. A kind that
 * must have a PSF runs as NONE on a field that is `unrestorable`, the network as OUT_OF_DOMAIN says on one
 * that it was not trained for (stage/domain.h): dst->by then names what ran, every source is marked
 * RX_RESTORE_OTHER, and the log has a warning; without restore.fallback it is RX_NOT_RESTORED. May run in
 * several threads at the same time, on options and fields that stay as they are meanwhile: log then NULL; the
 * same result as alone. Free with rx_probe_free(), not after an error: nothing is left then. */
rx_status rx_probe_run(const rx_options *options, const rx_restorer *kind, const rx_field *detect,
                       const rx_field *measure, rx_log *log, rx_probe *dst, rx_error *err);
void rx_probe_free(rx_probe *probe);

#endif
