/* Isophotal quantities: what the pixels of a source's own segment say on the measurement image. */
#ifndef RX_MEASURE_ISOPHOTE_H
#define RX_MEASURE_ISOPHOTE_H

#include "measure/view.h"

/* Fills isoarea, flux_iso, flux_isocor and errors, peak, iso[], fwhm, analysis_threshold, flags_weight
 * and the flags SATURATED and MASKED_CORE.
 *
 * FLUX_ISOCOR: Maddox et al. 1990 as in SExtractor's manual, 1 - 0.196099 t - 0.751208 t^2 with
 * t = area * threshold / flux. FWHM: Gaussian core, log I against r^2 weighted by I^2 over pixels
 * above a fifth of the peak. */
void rx_measure_isophote(const rx_view *view, const rx_measure_params *par, rx_source *s);

#endif
