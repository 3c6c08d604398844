/* What the files of the optics share and no other needs. */
#ifndef RX_SIMULATE_OPTICS_PARTS_H
#define RX_SIMULATE_OPTICS_PARTS_H

#include "simulate/optics.h"

/* Zeroed, one constant term of factor 1; NULL without memory. */
rx_optics *rx_optics_new(int oversampling, int size, int nbasis);

/* Strength of the spectrum at f cycles/pixel, pixel response not included, 1 at f = 0. */
typedef double rx_spectrum(const void *shape, double f);

/* Least odd cells per pixel: of the stamps (their Nyquist frequency is beyond what the spectrum holds), and
 * of the grid that points are put on (see render_stars.c). */
int rx_optics_sampling(rx_spectrum *spectrum, const void *shape);
int rx_optics_grid(rx_spectrum *spectrum, const void *shape);

#endif
