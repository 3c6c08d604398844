/* The PSF of a tile around the network: Tikhonov copy, Richardson-Lucy step, reblurring, support; block by
 * block, on domains of two sizes, a block with a halo of rx_network_tiling.halo pixels.
 *
 * Tikhonov (nn/deblur.h): filters cut to RX_TIKHONOV_REACH, so that blocks never wrap. A varying PSF has them
 * at nodes of a grid on the tile, the outer ones on its border pixels, at most 512 pixels apart and at least
 * 5 x 5: w(x) = sum_n hat_n(x) (T_n * data)(x), hat bilinear. The FWHM between nodes likewise.
 *
 * Step (nn/rl_step.h): K' f by restore/blur.h, exact for a varying PSF; the relative PSF is linear in the PSF,
 * hence made basis image by basis image. f = 0 and W = 0 beyond the border. Rows go from the tile into the
 * transforms and back as they are needed, so that few planes have the domain's size.
 *
 * Planes are [height][width] of the tile, in noise units. */
#ifndef RX_RESTORE_NETWORK_OPTICS_H
#define RX_RESTORE_NETWORK_OPTICS_H

#include "restore/blur.h"
#include "restore/network_blocks.h"
#include "restore/network_data.h"
#include "restore/network_otf.h"

typedef struct rx_network_optics_work rx_network_optics_work; /* planes of one thread */

/* A tile in blocks. */
typedef struct rx_network_tiling {
    rx_blocks blocks;
    int halo, nthreads;
    rx_network_optics_work *work; /* [nthreads] */
} rx_network_tiling;

typedef struct rx_network_optics {
    int width, height;
    const rx_psf *psf;
    rx_otf_grid grid;            /* Tikhonov filters, FWHM */
    rx_network_tiling far, near; /* of Tikhonov's filter and the PSF; of K', in domains that suit the cache */
    rx_blur_kernel relative;     /* K' */
    rx_blur_kernel tikhonov;     /* the only filter of a constant PSF; empty: not made */
    double *inside;              /* rx_stamp_inside() of K' where that does not vary */
} rx_network_optics;

/* Of the image's size and PSF, which must outlive it. blocks: of `far`, their borders shift those of `near`. epsilon <= 0: no Tikhonov filters.
 * Errors: RX_INPUT (no usable PSF), RX_SYSTEM. */
rx_status rx_network_optics_new(const rx_image *image, double target_fwhm, double epsilon,
                                const rx_blocks *blocks, int nthreads, rx_network_optics **dst,
                                rx_error *err);
void rx_network_optics_free(rx_network_optics *optics); /* NULL is fine */

/* w = Tikhonov(x) */
rx_status rx_network_optics_tikhonov(const rx_network_optics *optics, const float *x, float *w,
                                     const rx_blocks_progress *progress, rx_error *err);

/* next = the step from f, whose values are lost: its memory goes as `next` comes. */
rx_status rx_network_optics_step(const rx_network_optics *optics, const rx_network_input *input,
                                 double pedestal, float *f, float *next, const rx_blocks_progress *progress,
                                 rx_error *err);

/* dst = x - K' max(f, 0): what f leaves of the data */
rx_status rx_network_optics_left(const rx_network_optics *optics, const float *x, const float *f, float *dst,
                                 const rx_blocks_progress *progress, rx_error *err);

/* dst = K' f */
rx_status rx_network_optics_reblur(const rx_network_optics *optics, const float *f, float *dst,
                                   const rx_blocks_progress *progress, rx_error *err);

/* support = 1 - K^T (1 at good pixels), K the image's PSF */
rx_status rx_network_optics_support(const rx_network_optics *optics, const uint8_t *mask, float *support,
                                    const rx_blocks_progress *progress, rx_error *err);

#endif
