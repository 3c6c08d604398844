/* Blind Richardson-Lucy (Fish, Brinicombe, Pike, Walker 1995, JOSA A 12, 58): cycles of updates of
 * the image with the PSF held, then of the PSF with the image held,
 *
 *   g(u) <- g(u) (1 + sum_x s(x - u) W (d - m) / m (x) / sum_x s(x - u) W(x)),   m = g * s + b
 *
 * on the stamp of the PSF that is given as a start (at the tile's centre, when it varies). g stays
 * positive, sums to 1 and keeps the centroid of the start, so that positions do not drift.
 *
 * Taken literally, with s the whole image, the cycles run away: an image that has not converged is
 * too broad, so the PSF gets too narrow, from the true one too (3.6 pixels become 2.5 in five
 * cycles). So s is what is known to be unresolved, the isolated bright point-like sources
 * each gathered into one point at its centroid, and b = K (f - s) the rest, sky and neighbours,
 * held; each cycle makes the image anew with the PSF it has. That finds 3.57 pixels from 2.7, 3.6
 * or 5.1 on a simulated field of stars of 3.59 (defaults). Tiles with fewer than three such sources keep the
 * given PSF, with a warning; so does one whose PSF degenerates (not finite, FWHM below 1 pixel or
 * a factor of 3 from the start): the last good one is used.
 *
 * The output is Richardson-Lucy from the start with the PSF found, RL_NITER iterations, hence has
 * all properties of richardson_lucy.h. rx_restored.blur is the PSF found. Memory while the PSF is
 * sought: six planes of the tile more than RL, less the outputs. */
#ifndef RX_RESTORE_RL_BLIND_H
#define RX_RESTORE_RL_BLIND_H

#include "restore/runs.h"

#endif
