/* The truth catalogue of a scene as a table. */
#ifndef RX_SIMULATE_TRUTH_H
#define RX_SIMULATE_TRUTH_H

#include "base/error.h"
#include "data/table.h"
#include "io/wcs.h"
#include "simulate/scene.h"

/* NUMBER (place in the scene, from 1), X_IMAGE, Y_IMAGE (from 1), ALPHA_J2000, DELTA_J2000 (deg, when wcs is
 * not NULL; NAN where it gives no position), FLUX (ADU), MAG, TYPE (STAR, GALAXY, TEMPLATE), FLUX_RADIUS
 * (rx_object.radius: half-light, along the major axis, pixels), ELONGATION (a/b of the disk, of a galaxy
 * without one of its bulge), THETA_IMAGE (deg, -90..90), BULGE_SHARE, SERSIC_N (of the bulge; 1 for a mere
 * disk), TEMPLATE (name, "" for others). Only objects whose centre lies on the tile unless `all`. *dst is
 * freed by rx_table_free(). Errors: RX_SYSTEM memory. */
rx_status rx_truth_table(const rx_scene *scene, rx_wcs *wcs, int all, rx_table **dst, rx_error *err);

#endif
