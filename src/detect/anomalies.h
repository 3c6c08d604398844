/* What a tile's pixels hold that is neither noise nor light which came through its PSF onto a smooth sky.
 *
 *   z = (pixel - sky) / sigma
 *
 * Rows and columns: medians of z. Half of the mean square of their steps from one to the next, with the robust width for the
 * rms, is what offsets of rows and their noise make; that of the noise is (1.2533 f)^2 over their number of pixels, f the factor
 * of wide sums (rx_noise_factor_wide()). Sources and slow light leave medians or their steps alone.
 *
 * Light: boxes of 16 x 16 pixels none of which exceeds 8, whose median exceeds 0.3, and 5 of its errors 1.2533 f / 16. What falls
 * off from something bright is left out, as a galaxy's outskirts and a star's halo do: a box at a distance of d boxes, 16 at
 * most, whose median is (1 + d)^1.5 times as large. So are groups of fewer than 4 boxes that touch, as galaxies of low surface
 * brightness light them. The rest is light that is no source's and that the mesh does not follow: filaments, ghosts, nebulae.
 *
 * Steps: the smallest difference, but 0, of two pixels side by side, the median over the rows. Of numbers that are as fine as
 * their noise it is a small part of sigma; whole numbers, or a coarse scale of a file, have steps that noise may not reach. Above
 * 1.3 sigma few values are left, and neither the sky nor its noise is what the mesh takes for it.
 *
 * Cut: the share of the pixels that have the lowest value, where it is not more than 3 sigma below the sky; noise leaves hardly one
 * there. Where values below it were cut off, as by numbers without a sign or by a square root, or photons are few, noise is not what
 * its width says. Lone values, more than 10 sigma below the sky, are no part of it: dead pixels, small holes.
 */
#ifndef RX_DETECT_ANOMALIES_H
#define RX_DETECT_ANOMALIES_H

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"

RX_BEGIN_DECLS

enum { RX_ANOMALIES_BOX = 16 };

typedef struct rx_anomalies {
    double rows, columns; /* rms of their offsets beyond the noise, sigmas; NAN: too few of them */
    int nx, ny;
    unsigned char *lit; /* [ny][nx], owned; not 0: light that is no source's */
    double light;       /* share of such boxes among those with a quarter of their pixels; NAN without any */
    double step;        /* between pixel values, ADU; 0: all alike */
    double cut;         /* share of the lowest value */
} rx_anomalies;

/* Of image->pixels with its sky, noise, mask and PSF. wide: f. The same bytes for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_anomalies_measure(const rx_image *image, double wide, int nthreads, rx_anomalies *dst,
                               rx_error *err);
void rx_anomalies_free(rx_anomalies *anomalies); /* content only */

/* Is a faint source with its peak at that pixel of the same image on or beside such light? */
int rx_anomalies_lit_at(const rx_anomalies *anomalies, const rx_image *image, int x, int y);

/* So much of it that results are in doubt: offsets above 0.2 sigma, light on a fiftieth of the tile. */
int rx_anomalies_is_striped(const rx_anomalies *anomalies);
int rx_anomalies_is_lit(const rx_anomalies *anomalies);

/* Do pixel values have steps of more than 1.3 of that sigma, or does a fiftieth of them have the lowest one? */
int rx_anomalies_is_coarse(const rx_anomalies *anomalies, double sigma);
int rx_anomalies_is_cut(const rx_anomalies *anomalies);

RX_END_DECLS

#endif
