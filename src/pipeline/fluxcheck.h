/* Are the fluxes on a restored image those of the tile? Measured on every tile and written to log, header,
 * report and record: the same isolated sources on restored and on untouched pixels. */
#ifndef RX_PIPELINE_FLUXCHECK_H
#define RX_PIPELINE_FLUXCHECK_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/sources.h"
#include "measure/measure.h"

RX_BEGIN_DECLS

typedef struct rx_fluxcheck {
    int n; /* sources compared: FLAGS 0 and S/N above 30 on the restored image, with little light of others; 0 = too few */
    double diameter; /* of the wide aperture, pixels: 5 FWHM of the tile's PSF, at least 10 */
    double
        wide; /* median of wide aperture flux, restored / untouched, both as of all the light of their PSFs */
    double
        wide_error; /* 1 sigma of the median, and a fifth of what a sky off by 0.02 sigma a pixel adds to the median
                          source: 5 errors hold all of that */
    double automatic; /* median of FLUX_AUTO restored / wide aperture flux untouched; NAN without AUTO */
    double automatic_error; /* likewise */
} rx_fluxcheck;

/* How wrong the flux scale is: the distance of the worse ratio from 1, in units of its error (taken as 0.2 % at
 * least); 0 where neither is off. The wide aperture is off by more than 1 % and 5 sigma, FLUX_AUTO by more than 2 %
 * and 5 sigma above 1 (below 1 is the light that FLUX_AUTO leaves out; up to 2 % above is the dark ring that
 * Richardson-Lucy leaves around stars, in which its ellipse ends). */
double rx_fluxcheck_excess(const rx_fluxcheck *check);

/* Is that above 0? */
int rx_fluxcheck_is_off(const rx_fluxcheck *check);

/* `sources` were measured on `restored`; `original`: the untouched pixels of the same tile, with its PSF. Fewer than
 * 5 sources: n = 0. Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_fluxcheck_run(const rx_measure_params *par, const rx_image *restored, const rx_image *original,
                           const rx_sources *sources, rx_log *log, rx_fluxcheck *dst, rx_error *err);

RX_END_DECLS

#endif
