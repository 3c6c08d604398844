/* The blur K of a tile and its adjoint, for a PSF that may vary over the tile:
 *
 *   K f   (x) = sum_y PSF_y(x - y) f(y)         = sum_i (B_i * (c_i f))(x)
 *   K^T r (y) = sum_x PSF_y(x - y) r(x)         = sum_i c_i(y) (B_i correlated with r)(y)
 *
 * B_i are the basis images of rx_psf, c_i its polynomials. This is exact: every point of the
 * sky is blurred by its own PSF. The usual alternative, overlapping blocks with one PSF each
 * (Nagy and O'Leary 1998, SIAM J. Sci. Comput. 19, 1063), approximates PSF_y by interpolation,
 * needs an overlap of twice the PSF radius, windows that sum to one, and an adjoint that has
 * to match them or the flux drifts; its seams are what users complain of. Here there is nothing
 * to blend. The price is n+1 transforms for K and for K^T with n terms, instead of 2 each: a
 * PSFEx model of degree 2 (6 terms) takes 3.5 times the transforms of a constant PSF.
 *
 * Domain: the sky reaches `margin` = PSF radius beyond the tile on each side, tile pixel (0,0)
 * being domain pixel (margin, margin), then up to good FFT sizes: on the tile K f never wraps.
 * Beyond the tile's edge the polynomials keep the value they have at the edge.
 *
 * Memory besides the caller's planes: n + 1 complex planes, n + 2 when n > 1 (a complex plane
 * has the size of a real one). Terms that nowhere reach 1e-6 of the PSF's peak are left out. */
#ifndef RX_RESTORE_BLUR_H
#define RX_RESTORE_BLUR_H

#include "data/psf.h"
#include "num/fft.h"

typedef struct rx_blur {
    rx_fft *fft;
    int width, height; /* of the tile */
    int margin;
    int size; /* of the PSF stamps */
    int nterms;
    int varies;                                         /* 0: one term with c = 1 */
    float *kernel[RX_PSF_MAX_BASIS];                    /* spectra of B_i, num/convolve.h */
    float *cx[RX_PSF_MAX_BASIS], *cy[RX_PSF_MAX_BASIS]; /* c_i = cx[x] cy[y] on the domain */
    float *half;                                        /* complex scratch */
    float *sum;                                         /* the same, only when it varies */
} rx_blur;

/* Can this PSF blur such a tile: odd stamps no larger than the tile, finite, with flux? RX_INPUT when not. */
rx_status rx_blur_check(const rx_psf *psf, int width, int height, rx_error *err);

/* Errors: RX_INPUT when the PSF is larger than the tile, not finite or without flux. */
rx_status rx_blur_new(const rx_psf *psf, int width, int height, int nthreads, rx_blur **dst, rx_error *err);
void rx_blur_free(rx_blur *blur);

/* Another constant PSF stamp[size][size] in place of the present one (which must be constant);
 * `work` is a real plane, overwritten. */
void rx_blur_replace(rx_blur *blur, const float *stamp, float *work);

/* dst = K src; real planes of blur->fft, dst not src. */
void rx_blur_apply(const rx_blur *blur, const float *src, float *dst);

/* dst = K^T src; src is destroyed. dst may be src unless the PSF varies. */
void rx_blur_adjoint(const rx_blur *blur, float *src, float *dst);

/* Offset of tile row y, pixel 0, in a real plane. */
size_t rx_blur_row(const rx_blur *blur, int y);

#endif
