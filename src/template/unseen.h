/* Neighbours in a crowd that are too near to be resolved: what they add to a star's flux, and to its error. */
#ifndef RX_TEMPLATE_UNSEEN_H
#define RX_TEMPLATE_UNSEEN_H

#include "base/error.h"
#include "template/crowd.h"

/* Positions of stars know nothing of each other, so pairs that are missing from the list at distance r, against as many as the
 * density D within 1.5 cells has by chance, are there and unseen: a share u(r) = 1 - found / expected. D is that of the list and
 * of one hidden source for each pair that is missing. A neighbour of flux f at r lifts a flux by f rho(r), rho = exp(-q),
 * q = r^2 / 4 s^2, the overlap of two PSFs, s = FWHM / 2.355. Where flux and position of the one are fitted, f^2 (1 - rho^2 (1 + 2 q))
 * of it is left: it would show at 6 errors of the noise. Of the fluxes f_j of the m crowded sources of the list those fainter than the
 * star that would not show make a sum of rare and unequal parts, whose rms says little of where most of it lies: each counts
 * by c(f) = min(f rho, 2 E), E the star's error in the end, as in Huber's estimators (1964, Ann. Math. Stat. 35, 73):
 *   mean = D sum_r 2 pi r dr u(r) sum_j c(f_j) / m     variance = D sum_r 2 pi r dr u(r) sum_j c(f_j)^2 / m
 * flux -= mean, E^2 = fluxerr^2 + variance, of points in crowded cells; snr stays that of the noise. Nothing where fewer than 50
 * pairs are expected. *excess: median over these points of sqrt(variance) over the error of the noise; 0 where there are none.
 * Errors: RX_SYSTEM. */
rx_status rx_unseen_allow(const rx_crowding *crowd, double fwhm, rx_tphot_source *list, int n, double *excess,
                          rx_error *err);

#endif
