/* The PSF of a tile around the network: Tikhonov copy, Richardson-Lucy step, reblurring, support; block by
 * block, all FFTs on one domain, a block with a halo of rx_network_optics.halo pixels.
 *
 * Tikhonov (nn/deblur.h): filters cut to RX_TIKHONOV_REACH, so that blocks never wrap. A varying PSF has them
 * at nodes of a grid on the tile, the outer ones on its border pixels, at most 512 pixels apart and at least
 * 5 x 5: w(x) = sum_n hat_n(x) (T_n * data)(x), hat bilinear. The FWHM between nodes likewise.
 *
 * Step (nn/rl_step.h): K' f = sum_i B'_i * (c_i f) as in restore/blur.h, exact for a varying PSF; the
 * relative PSF is linear in the PSF, hence made basis image by basis image. f = 0 and W = 0 beyond the
 * border.
 *
 * Planes are [height][width] of the tile, in noise units. */
#ifndef RX_RESTORE_NETWORK_OPTICS_H
#define RX_RESTORE_NETWORK_OPTICS_H

#include "nn/deblur.h"
#include "num/fft.h"
#include "restore/network_blocks.h"
#include "restore/network_data.h"

/* The optical transfer function of a PSF by basis images B_i, whose polynomials c_i = cx[x] cy[y] are those of
 * the place in the sky. */
typedef struct rx_otf {
    int n, varies;
    int radius; /* of the stamps */
    float *spectrum[RX_PSF_MAX_BASIS];
    double *inside; /* [2 radius + 2][2 radius + 2], of a PSF that does not vary: network_rows.h */
    float *cx[RX_PSF_MAX_BASIS], *cy[RX_PSF_MAX_BASIS]; /* [width], [height] of the tile */
} rx_otf;

typedef struct rx_network_optics_work rx_network_optics_work; /* planes of one thread */

typedef struct rx_network_optics {
    int width, height, nthreads;
    const rx_blocks *blocks;
    const rx_psf *psf;
    double target_fwhm;
    int halo;
    rx_network_optics_work *work; /* [nthreads] */
    rx_otf relative;              /* K' */
    int nx, ny;                   /* nodes; 1 x 1 for a constant PSF */
    double step_x, step_y;
    float *tikhonov; /* spectrum of the only filter of a constant PSF; NULL: not made */
    float *filters;  /* [ny][nx] Tikhonov filters of 2 RX_TIKHONOV_REACH + 1 pixels a side; NULL: not made */
    float *fwhm;     /* [ny][nx] pixels */
} rx_network_optics;

/* Of the image's size and PSF; the PSF and the blocks must outlive it. epsilon <= 0: no Tikhonov filters.
 * Errors: RX_INPUT (no usable PSF), RX_SYSTEM. */
rx_status rx_network_optics_new(const rx_image *image, double target_fwhm, double epsilon,
                                const rx_blocks *blocks, int nthreads, rx_network_optics **dst,
                                rx_error *err);
void rx_network_optics_free(rx_network_optics *optics); /* NULL is fine */

/* dst[n]: FWHM at tile pixels x .. x + n - 1 of row y, beyond the border that on it. */
void rx_network_optics_fwhm_row(const rx_network_optics *optics, int y, int x, int n, float *dst);

/* w = Tikhonov(x) */
rx_status rx_network_optics_tikhonov(const rx_network_optics *optics, const float *x, float *w,
                                     const rx_blocks_progress *progress, rx_error *err);

/* next = the step from f, whose values are lost: its memory goes as `next` comes. */
rx_status rx_network_optics_step(const rx_network_optics *optics, const rx_network_input *input,
                                 double pedestal, float *f, float *next, const rx_blocks_progress *progress,
                                 rx_error *err);

/* dst = K' f */
rx_status rx_network_optics_reblur(const rx_network_optics *optics, const float *f, float *dst,
                                   const rx_blocks_progress *progress, rx_error *err);

/* support = 1 - K^T (1 at good pixels), K the image's PSF */
rx_status rx_network_optics_support(const rx_network_optics *optics, const uint8_t *mask, float *support,
                                    const rx_blocks_progress *progress, rx_error *err);

#endif
