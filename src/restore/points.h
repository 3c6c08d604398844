/* Point-like sources of an image that is being restored: what separates image and PSF.
 *
 * A peak is the highest f within 2 pixels, stands 10 sigma above the sky in the data, has no masked
 * pixel within the radius R = max(2, FWHM) and none of a tenth of its height as neighbour within 2 R. Its
 * flux, centroid and mean square radius are those of f - 1 in the disk of radius R. Point-like are the peaks
 * no larger than 1.3 times the 20 % quantile of radius^2 (galaxies are larger, and a tile in which four
 * fifths of the isolated bright sources are resolved still gives its stars). */
#ifndef RX_RESTORE_POINTS_H
#define RX_RESTORE_POINTS_H

#include "restore/richardson_lucy.h"

typedef struct rx_point {
    int x, y;      /* peak, tile pixels */
    double cx, cy; /* centroid, tile pixels */
    double flux;   /* units of the pedestal */
    double square; /* mean square radius, pixels^2 */
} rx_point;

enum { RX_POINTS_MAX = 300 };

/* Mean of the eight neighbours of a stamp's centre over the centre. */
double rx_points_bluntness(const float *stamp, int size);

/* At most RX_POINTS_MAX, the brightest, into points[]; *n of them, and the disk's radius.
 * fwhm and bluntness: of the PSF as it is known.
 * Errors: RX_SYSTEM without memory. */
rx_status rx_points_find(const rx_rl *rl, double fwhm, double bluntness, rx_point *points, int *n,
                         int *radius, rx_error *err);

#endif
