/* How size and ellipse of the stars vary over the tile. Internal to psf/.
 *
 * A stretch (s, g1, g2) makes of the profile that the model is held to
 *   profile(B^-1 u) / det B,  B = (1 + s + g1/2, g2/2; g2/2, 1 + s - g1/2).
 * Each number is a polynomial of the position, sum_k c_k L_k(X, Y). */
#ifndef RX_PSF_STRETCH_H
#define RX_PSF_STRETCH_H

#include "base/log.h"
#include "psf/psf_fit.h"

/* Which candidates are members and kept, and job->variation from those that are not reserved, of that degree at most. */
rx_status rx_psf_vary(rx_psf_job *job, int highest, rx_log *log, rx_error *err);

#endif
