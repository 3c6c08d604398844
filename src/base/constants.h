/* Numbers that several folders need. (Pi is M_PI.) */
#ifndef RX_BASE_CONSTANTS_H
#define RX_BASE_CONSTANTS_H

#define RX_FWHM_SIGMA 2.3548200450309493  /* FWHM of a Gaussian in sigmas: 2 sqrt(2 ln 2) */
#define RX_MAD_SIGMA 1.4826               /* sigma over the median absolute deviation, normal distribution */
#define RX_MEDIAN_ERROR 1.2533            /* error of a median over that of a mean: sqrt(pi / 2) */
#define RX_DEGREE 0.017453292519943295769 /* in radians */
#define RX_MAG_ERROR 1.0857362 /* error of a magnitude over the relative one of the flux: 2.5 / ln 10 */

#endif
