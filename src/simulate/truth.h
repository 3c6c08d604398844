/* The truth catalogue of a scene as a table. */
#ifndef RX_SIMULATE_TRUTH_H
#define RX_SIMULATE_TRUTH_H

#include "base/error.h"
#include "data/table.h"
#include "io/wcs.h"
#include "simulate/scene.h"

/* NUMBER, X_IMAGE, Y_IMAGE (from 1), ALPHA_J2000, DELTA_J2000 (deg, when wcs is not NULL), FLUX (ADU), MAG,
 * TYPE (STAR, GALAXY, TEMPLATE), FLUX_RADIUS (half-light, pixels), ELONGATION, THETA_IMAGE (deg),
 * BULGE_SHARE, SERSIC_N, TEMPLATE (name). Only objects whose centre lies on the tile unless `all`. */
rx_status rx_truth_table(const rx_scene *scene, rx_wcs *wcs, int all, rx_table **dst, rx_error *err);

#endif
