/* Growth curve: radii that hold given shares of FLUX_AUTO. */
#ifndef RX_MEASURE_GROWTH_H
#define RX_MEASURE_GROWTH_H

#include "measure/view.h"

/* Fills flux_radius (pixels) for the shares in par; sets RX_FLAGM_RADIUS_FAILED when the flux is not
 * positive. Returns the half-light radius, at least 0.5 pixel, that windowed measurements start from. */
double rx_measure_radii(const rx_view *view, const rx_measure_params *par, rx_source *s);

#endif
