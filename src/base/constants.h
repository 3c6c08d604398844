/* Numbers that several folders need. (Pi is M_PI.) */
#ifndef RX_BASE_CONSTANTS_H
#define RX_BASE_CONSTANTS_H

#define RX_FWHM_SIGMA 2.3548200450309493 /* FWHM of a Gaussian in sigmas: 2 sqrt(2 ln 2) */
#define RX_MAD_SIGMA 1.4826              /* sigma over the median absolute deviation, normal distribution */
#define RX_MEDIAN_ERROR 1.2533           /* error of a median over that of a mean: sqrt(pi / 2) */

#endif
