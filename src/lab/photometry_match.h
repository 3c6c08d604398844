/* Which detections are right and which are false, when stars are put among what is there already.
 *
 * Stars and the known objects at least as bright as they are compete for the detections, one to one, nearest
 * first, within the matching radius: a star on top of a brighter object is found only when it is resolved
 * from it. A detection that is left over is false, unless it belongs to a known object, whatever its
 * brightness (it lies within the object's own radius, or where `covered` says so): then it is neither right
 * nor wrong. */
#ifndef RX_LAB_PHOTOMETRY_MATCH_H
#define RX_LAB_PHOTOMETRY_MATCH_H

#include "base/error.h"

/* What is in the sky besides the stars. Pixels from 0, fluxes in ADU. */
typedef struct rx_known {
    long n;
    double *x, *y, *flux, *radius; /* [n]; owned */
    int width, height;
    unsigned char *covered; /* [height][width], 1: belongs to a known object; NULL: no such map; owned */
} rx_known;

/* Room for n, all zero, no map. Errors: RX_SYSTEM. */
rx_status rx_known_new(long n, rx_known *dst, rx_error *err);
void rx_known_free(rx_known *known); /* content only */

typedef struct rx_photometry_stars {
    long n;
    const double *x, *y;
    double flux; /* of every star */
} rx_photometry_stars;

/* n detections at x, y. found[stars->n]: the detection of each star, or -1. is_false[n]: 1 or 0. */
rx_status rx_photometry_match(const rx_photometry_stars *stars, const rx_known *known, long n,
                              const double *x, const double *y, double radius, long *found,
                              unsigned char *is_false, rx_error *err);

#endif
