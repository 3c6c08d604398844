/* How size and ellipse of the stars vary over the tile. Internal to psf/.
 *
 * A stretch (s, g1, g2) makes of the profile that the model is held to
 *   profile(B^-1 u) / det B,  B = (1 + s + g1/2, g2/2; g2/2, 1 + s - g1/2).
 * Each number is a polynomial of the position, sum_k c_k L_k(X, Y). */
#ifndef RX_PSF_STRETCH_H
#define RX_PSF_STRETCH_H

#include "base/log.h"
#include "psf/psf_fit.h"

/* job->variation from the stars that are kept and not reserved, of that degree at most: a higher one is taken where stars that were
 * held out are predicted better, by more than the scatter of that from star to star. The last ones tried have terms that are small
 * unless stars insist: of few stars, they alone can follow a bad corner. Points that are wider are kept where, besides, the other stars
 * are predicted better with them. */
rx_status rx_psf_vary(rx_psf_job *job, int highest, rx_log *log, rx_error *err);

#endif
