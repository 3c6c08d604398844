/* Objects of a list that a user has, to be drawn or injected: CATALOG_NAME of rextract-simulate. */
#ifndef RX_STAGE_LISTED_OBJECTS_H
#define RX_STAGE_LISTED_OBJECTS_H

#include "base/error.h"
#include "io/wcs.h"
#include "simulate/simulation.h"

/* The list's rows become simulation->listed, and the scene's. Columns: a position, in degrees where wcs is given and the list has them, else in
 * pixels from 1; MAG (of simulation->scene.zeropoint) or FLUX (ADU); and of a galaxy FLUX_RADIUS, its half-light radius along the major axis in
 * pixels, ELONGATION (major over minor axis), THETA_IMAGE (degrees) and SERSIC_N. Without FLUX_RADIUS, or where it is 0, a star; the
 * others have the defaults 1, 0 and 1. Rows without a position near the tile are left out. A truth catalogue of stars and of galaxies of one profile is such a list. Errors: RX_INPUT (no
 * such column, a cell that is no number or out of range, with its row), RX_SYSTEM. */
rx_status rx_listed_objects(const char *path, rx_wcs *wcs, rx_simulation *simulation, rx_error *err);

#endif
