/* P_REAL: how probable it is that a source is there, from its evidence (template/template.h).
 *
 *   P = R / (R + F)   densities of sources, of peaks of noise, at the significance s = sqrt(evidence), in the tile
 *   R(s) = real (s / 5)^power                            counts N(>s) ~ 1/s, power -2, through those above 6 sigma
 *   F(s) = (s^2 - 1) exp(-s^2 / 2) / ((2 pi)^1.5 2 w^2)  w = FWHM / 2.355
 *
 * F: maxima above s of white noise behind its matched Gaussian filter are s exp(-s^2 / 2) / ((2 pi)^1.5 2 w^2) a
 * pixel (Adler 1981, The Geometry of Random Fields, ch. 6, for the correlation exp(-r^2 / 4 w^2)). Which of them a
 * list holds does not matter: detection takes from both alike. Below s = 2.5 the value of 2.5 holds.
 * In a crowd the list itself says real, power and the scale of F. Rising in the evidence always. */
#ifndef RX_FIT_PREAL_H
#define RX_FIT_PREAL_H

#include "base/error.h"
#include "base/extern.h"

RX_BEGIN_DECLS

/* How probable sources are, by their evidence. */
typedef struct rx_preal {
    double real, power; /* sources at 5 sigma a pixel and sigma, and how they go on */
    double end;         /* S/N of the faintest of them; -HUGE_VAL: not seen */
    double peaks;       /* of noise: F(s) / ((s^2 - 1) exp(-s^2 / 2)) a pixel */
} rx_preal;

/* Of a tile with that many usable pixels; evidence[n] of its sources, NAN where there is none. */
rx_preal rx_preal_default(const double *evidence, int n, double pixels, double fwhm);

/* Of crowded pixels, all of whose residual is searched down to 3.2 sigma: most sources near that are added, few listed. Real, power
 * and the scale of the peaks are the maximum of the Poisson likelihood of the counts from 3.4 to 7 sigma and their priors. Each source that is fitted
 * takes flux and position from the noise, three of its degrees of freedom, one of which is in each 4 pi w^2 pixels, so the scale
 * is 1 - 12 pi w^2 n / pixels, at least 0.1, within exp(0.2); power -2 +- 2, as
 * neighbours hide faint sources; and real has that of rx_preal_default() with the weight of one source (a gamma distribution).
 * R(s) has the factor (1 + erf((s - end) / sqrt 2)) / 2 where the counts say that no source is fainter than S/N end. */
rx_preal rx_preal_crowd(const double *evidence, int n, double pixels, double fwhm);

/* NAN for NAN. */
double rx_preal_of(const rx_preal *preal, double evidence);

double rx_preal_limit(const rx_preal *preal); /* the significance where P is 0.5, at least 2.5 */

/* The least P that a source of a list may have so that with a probability of 0.95 the share of those that are there is `precision` at
 * least, of the longest list there is: 0.5 at least, HUGE_VAL where no list is. How many are not there follows from P of each, whose
 * odds are known to 0.3 in their logarithm. NAN is left out. Errors: RX_SYSTEM. */
rx_status rx_preal_least(const double *preal, int n, double precision, double *least, rx_error *err);

RX_END_DECLS

#endif
