/* Windowed positions, moments, flux: a Gaussian of the half-light radius iterated onto the source. */
#ifndef RX_MEASURE_WINDOW_H
#define RX_MEASURE_WINDOW_H

#include "measure/view.h"

/* Fills xwin .. snr_win, niter_win, flags_win (SExtractor's bits; RX_FLAGWIN_AWAY: more than a
 * pixel in x and y and an rms ellipse away). `half_light` in pixels:
 * sigma = 2 half_light / 2.35, sums within 4 sigma. Each step moves by twice the offset of the windowed
 * barycentre (exact for a Gaussian). Any of these: the isophotal position, moments and errors, and
 * RX_FLAGM_WIN_FAILED. */
void rx_measure_window(const rx_view *view, double half_light, rx_source *s);

#endif
