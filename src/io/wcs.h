/* World coordinates by wcslib (every projection it knows; SIP, TPV, TNX/ZPX where wcslib has them). */
#ifndef RX_IO_WCS_H
#define RX_IO_WCS_H

#include <stddef.h>

#include "base/error.h"
#include "base/extern.h"
#include "io/wcs_notes.h"

RX_BEGIN_DECLS

typedef struct rx_wcs rx_wcs;

/* From header cards (80 characters each). *dst stays NULL, status RX_OK, when the header has no celestial
 * coordinates, or none that can be read as a whole. What is to be said of them is appended to notes (may be NULL). */
rx_status rx_wcs_from_cards(const char *cards, size_t ncards, int width, int height, rx_wcs **dst,
                            rx_wcs_notes *notes, rx_error *err);
void rx_wcs_free(rx_wcs *wcs);

/* n 0-based pixel positions to native sky (deg); what cannot be projected is NAN. */
void rx_wcs_to_native(rx_wcs *wcs, int n, const double *x, const double *y, double *alpha, double *delta);

/* Native sky to J2000/ICRS (deg), in place too; NAN where impossible. */
void rx_wcs_native_to_j2000(const rx_wcs *wcs, int n, const double *alpha, const double *delta,
                            double *alpha_j2000, double *delta_j2000);

/* Both: pixels to J2000/ICRS (deg). */
void rx_wcs_to_sky(rx_wcs *wcs, int n, const double *x, const double *y, double *alpha_j2000,
                   double *delta_j2000);

/* J2000/ICRS (deg) to 0-based pixels; NAN where impossible. */
void rx_wcs_to_pixel(rx_wcs *wcs, int n, const double *alpha_j2000, const double *delta_j2000, double *x,
                     double *y);

/* Local matrix in deg per pixel, native frame: (dalpha cos delta, ddelta) by (dx, dy):
 * m[0] = E/dx, m[1] = E/dy, m[2] = N/dx, m[3] = N/dy */
void rx_wcs_matrix(rx_wcs *wcs, double x, double y, double m[4]);

double rx_wcs_pixel_scale(rx_wcs *wcs, double x, double y); /* arcsec, sqrt of the area */

/* Linear world coordinates (CRVAL, CRPIX, CD or CDELT) of a header that has no celestial ones:
 * x_world = [0] + [1] x + [2] y, y_world = [3] + [4] x + [5] y, x and y 0-based. 0 when there are none. */
int rx_wcs_linear(const char *cards, size_t ncards, double linear[6]);

/* Version of the library (wcslib). */
const char *rx_wcs_library(void);

RX_END_DECLS

#endif
