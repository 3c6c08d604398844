/* Blind Richardson-Lucy (Fish, Brinicombe, Pike, Walker 1995, JOSA A 12, 58): cycles of updates of
 * the image with the PSF held, then of the PSF with the image held,
 *
 *   g(u) <- g(u) (1 + sum_x s(x - u) W (d - m) / m (x) / sum_x s(x - u) W(x)),   m = g * s + b
 *
 * on the stamp of the PSF that is given as a start (at the tile's centre, when it varies). s is the
 * part of the image f more than 5 sigma above the sky, b = K (f - s) the rest, held: a sky
 * of any height says nothing of the PSF and would only slow its update down. g stays positive,
 * sums to 1, is no larger than its stamp and keeps the centroid of the start, so that
 * positions do not drift. A PSF that degenerates (not finite, FWHM below 1 pixel or above three
 * times the start) ends the cycles with the last good one and a warning.
 *
 * The output is Richardson-Lucy from the start with the PSF found, RL_NITER iterations, hence has
 * all properties of richardson_lucy.h. rx_restored.blur is the PSF found. Memory while the PSF is
 * sought: three planes on the domain more than RL. */
#ifndef RX_RESTORE_RL_BLIND_H
#define RX_RESTORE_RL_BLIND_H

#include "restore/restore.h"

rx_status rx_rl_blind_run(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                          const rx_psf *psf, rx_log *log, rx_restored **dst, rx_error *err);

#endif
