/* Richardson-Lucy (Richardson 1972, JOSA 62, 55; Lucy 1974, AJ 79, 745) for a tile with masks and
 * borders, by the weight-normalised update
 *
 *   f <- f (1 + K^T (W (d - K f) / K f) / K^T W)
 *
 * which is f K^T(W d / K f) / K^T W, written so that rounding errors scale
 * with the residual. The sky is unknown beyond the border and under masks: f is free there and
 * constrained only through the PSF; where K^T W < 1e-3, nothing is known and f stays
 * at the sky (a sky misjudged by c thus shows at most 1e-3 c at an edge).
 * Hence neither borders nor masks ring, and W = 0 keeps masked values out to the last bit.
 *
 * Flux: the update keeps sum W K f = sum W d. Farther than a PSF radius from border and masks, that is the
 * flux of each source, to 0.15 % (tests/unit/restore/test_rl_flux.c: a Gaussian PSF, S/N 100 and more).
 * Nearer, a part of f lies where there are no data: a star one to two FWHM away is off by up to 3 %, one
 * closer by up to 10 %, and of one on the border itself a part is lost. rx_restored.support shows such
 * pixels. In narrow gaps f is handed on, elsewhere under the mask it is not. It comes up slowly where little of a star
 * is seen: of one with S/N 500 and a hole of 3 x 3 pixels in its core (FWHM 3.5) 0.91 is there after RL_NITER 18, of 5 x
 * 5 0.69; of S/N 50 0.91 and 0.59.
 *
 * Acceleration (RL_ACCELERATE): an update starts from the object carried on along its last step,
 *
 *   y_k = f_k + a_k (f_k - f_k-1),   f_k+1 = update(y_k),   a_k = (k - 1) / (k + 8)
 *
 * (extrapolation of Biggs and Andrews 1997, Appl. Opt. 36, 1766, with the factor of Chambolle and Dossal 2015, J.
 * Optim. Theory Appl. 166, 968, for their (k - 1) / (k + a), a > 2). An iteration costs the same transforms and does
 * the work of two to four: validation/results/iterations. Biggs and Andrews take a_k from the last two steps, which
 * needs fewer iterations still, but medium scales overshoot and with them the noise: 0.2 to 0.4 dB at the same
 * completeness in trials. No pixel falls below a tenth of what it was by being carried on. The last update is not
 * carried on; RL_STOP DISCREPANCY tests, and returns, what was. The flux is kept as without.
 *
 * Memory: besides tile and sky a mask, f and K^T W on the sky and K f on the tile, 13 bytes a pixel, and two
 * planes more of a tile of up to 2^26 pixels (restore/prepared.h); pixels and the planes that are asked for
 * (support, reblurred) take the place of K f and K^T W. Of a tile of more than 2^25 pixels K f is made by
 * strips, each before the part of f is updated that it concerns, unless all of it is asked for (reblurred,
 * RL_STOP DISCREPANCY): 9 bytes a pixel. RL_ACCELERATE adds a plane of the sky, 4 bytes a pixel; RL_BLIND the rest
 * of the image, the points and three planes of a transform of the sky while it seeks the PSF.
 *
 * Sums go row by row and are added in the order of rows: the same bytes for any nthreads. */
#ifndef RX_RESTORE_RICHARDSON_LUCY_H
#define RX_RESTORE_RICHARDSON_LUCY_H

#include "restore/blur.h"
#include "restore/prepared.h"
#include "restore/runs.h"

/* Pixels of a tile whose model is kept as a plane, at most. */
#define RX_RL_WHOLE ((size_t)1 << 25)

/* The restorer RL, rx_rl_run(), on an image that has been prepared, under the name of another restorer, `settings`
 * added to the text. */
rx_status rx_rl_restore(const rx_restore_params *par, const rx_prepared *prepared, const char *name,
                        const char *settings, rx_log *log, rx_restored **dst, rx_error *err);

/* The iteration in pieces (the blind restorer alternates it with updates of the PSF). */
typedef struct rx_rl {
    const rx_prepared *prepared; /* both belong to the caller and must outlive it */
    const rx_blur *blur;
    float bound;   /* f never exceeds it */
    float *object; /* f on the sky (restore/blur.h), units of the pedestal; 1 at the start */
    float *norm;   /* K^T W, likewise */
    float *model;  /* K f, [kept][width]: row y of the tile is row y % kept */
    int kept;      /* rows of the model: all, or those that a strip of the object needs */
    int made;      /* rows of the tile that the model has been made of, for the present object */
    int strip;     /* rows of blocks of the object that are updated at a time */
    double *rows;  /* sums of tile rows */
    float *before; /* f_k-1 on the sky; NULL: not accelerated */
    int updates;   /* k, since the start */
    float carried; /* a_k of the update at work */
} rx_rl;

/* par: acceleration. whole: the model is kept as a plane. The same bytes. */
rx_status rx_rl_new(const rx_restore_params *par, const rx_prepared *prepared, const rx_blur *blur, int whole,
                    rx_rl **dst, rx_error *err);
void rx_rl_free(rx_rl *rl);
void rx_rl_reset(rx_rl *rl);     /* object = 1 */
void rx_rl_normalise(rx_rl *rl); /* norm = K^T W; again after the blur has changed */
void rx_rl_model(rx_rl *rl);     /* model = K object, where it is kept */
double rx_rl_chi2(rx_rl *rl);    /* mean over good pixels of (d - K f)^2 / var(K f) */

/* One update of the object, carried on unless it is the last one. Makes what is missing of the model. */
void rx_rl_update(rx_rl *rl, int last);

/* dst = W (d - model) / model at n tile pixels from (x, y) on, which the model has been made of. */
void rx_rl_residual(const rx_rl *rl, int y, int x, int n, float *dst);

#endif
