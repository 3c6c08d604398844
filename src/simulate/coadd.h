/* Tiles as surveys hand them out: dithered exposures of one scene, each with pixels and noise of its own, put
 * onto one grid. Resampling correlates the noise of the pixels; the truth stays that of the scene.
 *
 *   output(X) = scale^2 sum_k w_k sum_i a_i d_i / sum_k w_k sum_i a_i        w_k = 1 / sky variance of frame k
 *
 * over the pixels d_i of the frames k, scale = output pixel / input pixel. DRIZZLE (Fruchter and Hook 2002,
 * PASP 114, 144): a_i is the area in which the drop of pixel i, a square of side pixfrac, covers the output
 * pixel. LANCZOS: a_i are the weights of Lanczos interpolation of order 3, their sum is 1. */
#ifndef RX_SIMULATE_COADD_H
#define RX_SIMULATE_COADD_H

#include <stdint.h>

#include "base/error.h"
#include "data/noise_correlation.h"
#include "simulate/noise.h"
#include "simulate/optics.h"
#include "simulate/scene.h"

typedef enum rx_coadd_type { RX_COADD_NONE, RX_COADD_DRIZZLE, RX_COADD_LANCZOS } rx_coadd_type;

typedef struct rx_coadd_params {
    rx_coadd_type type;
    int frames;     /* 1 .. RX_COADD_MOST */
    double pixfrac; /* 0.1..1 */
    double scale;   /* output pixel in input pixels, 0.3..1 */
    double uneven;  /* 0: all frames alike; to 1: depths differ by up to 4, edges come to the tile's middle */
} rx_coadd_params;

enum { RX_COADD_MOST = 1000 };

/* The frames of (seed, stream): the sub-pixel part of the dithers is a Latin square: along each axis one frame
 * lies in each of `frames` equal parts of a pixel, anywhere in it, as planned dithers do. The first has depth 1
 * and covers everything; with `uneven` the others have depths of 2^-uneven to 2^uneven, and lack a strip of
 * uneven * (0.1..0.5) of the output along one side in x and one in y.
 *
 * What came out. The planes are given, [height][width] of the scene. */
typedef struct rx_coadd {
    float *image;     /* NAN where no frame has a good pixel */
    float *weight;    /* as the algorithm hands it out, covariances left out, 1/ADU^2: see below */
    uint8_t *defects; /* RX_DEFECT_SATURATED: of any pixel in it; RX_DEFECT_COLUMN: image is NAN */
    /* sky, gain and saturation of the output where all frames are, its type and seed those of the frames */
    rx_noise_params noise;
    double sigma; /* root of the mean variance of the sky in one output pixel, ADU */
    double wide;  /* noise of sums over many pixels, over that of so many independent ones of sigma */
} rx_coadd;

/* The scene (output pixels) as frames of `optics` (pixels of the frames; where it varies, of frames whose
 * pixel (0, 0) is the scene's corner) and `noise` (of a frame of depth 1, its pixels), combined. Pixels of dead
 * columns and cosmic rays are left out, by LANCZOS all output pixels that they would reach. dst->weight is
 *   DRIZZLE: sum_k w_k sum_i a_i / (pixfrac^2 scale^4), drizzle's own map: the inverse variance of independent
 *            pixels whose wide sums are as noisy; single pixels are less noisy, by `wide` (Casertano et al.
 *            2000, AJ 120, 2747: R = r / (1 - 1/(3r)), r = pixfrac / scale >= 1, for many dithers)
 *   LANCZOS: the inverse of each pixel's variance, a_i^2 propagated
 * both from the sky alone; without noise as if of variance 1. The same bytes for any nthreads. Errors:
 * RX_SYSTEM memory; RX_INTERRUPTED. */
rx_status rx_coadd_make(const rx_coadd_params *par, const rx_scene *scene, const rx_optics *optics,
                        const rx_noise_params *noise, int nthreads, rx_coadd *dst, rx_error *err);

/* What resampling leaves of white noise, far from any edge. */
typedef enum rx_resampler {
    RX_RESAMPLER_LINEAR,  /* size: shift, 0..1 pixel; so for the next two */
    RX_RESAMPLER_CUBIC,   /* Keys 1981, a = -1/2 */
    RX_RESAMPLER_LANCZOS, /* of order 3, sum 1 */
    RX_RESAMPLER_DRIZZLE, /* size: side of the drop, at most 2 pixels of the image; mean over all dithers */
} rx_resampler;
rx_noise_correlation rx_resampled_noise(rx_resampler kind, const double size[2] /* x, y */);

/* FWHM (output pixels) of a star on the coadd: a Moffat of that FWHM and exponent over input pixels, drops and
 * output pixels (Lanczos' kernel instead of these two), the mean over all dithers. */
double rx_coadd_fwhm(const rx_coadd_params *par, double fwhm, double beta);

#endif
