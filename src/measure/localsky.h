/* BACKPHOTO_TYPE LOCAL: what is left of the sky in a rectangular annulus around a source. */
#ifndef RX_MEASURE_LOCALSKY_H
#define RX_MEASURE_LOCALSKY_H

#include "measure/view.h"

/* Clipped mode of the good pixels in an annulus `thickness` wide, a quarter of the source's size away
 * from its footprint (SExtractor's geometry, the mesh estimator of the global background). 0 where the
 * annulus leaves the image or holds no pixel. */
rx_status rx_local_sky(const rx_view *view, const rx_source *s, int thickness, double *sky, rx_error *err);

#endif
