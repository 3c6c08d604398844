/* The blur K of a tile and its adjoint, for a PSF that may vary over the tile; the one operator of
 * Richardson-Lucy (a whole tile, below) and of what stands around the network (network_optics.h):
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
 * The sky reaches `margin` = PSF radius beyond the tile on each side; beyond the tile's edge the polynomials
 * keep the value they have at the edge.
 *
 * Work goes by blocks of the image that is made, each with `margin` pixels of the other around it on a cyclic
 * domain that is large enough not to wrap (overlap-save): same sums, but planes that stay in the cache, and
 * no plane of the whole tile but the caller's. How the tile is cut follows from its size and the PSF's alone,
 * so that results do not depend on nthreads. Terms that nowhere reach 1e-6 of the PSF's peak are left out.
 *
 * Memory: n complex planes of a block, and two (three of a varying PSF) for each thread; 1 to 5 MB a plane.
 */
#ifndef RX_RESTORE_BLUR_H
#define RX_RESTORE_BLUR_H

#include "data/psf.h"
#include "num/fft.h"

#define RX_SUPPORT_FLOOR 1e-5f /* rounding of the transforms */

/* The operator's terms on one cyclic domain. */
typedef struct rx_blur_kernel {
    int width, height;                                  /* of the tile */
    int margin;                                         /* PSF radius */
    int n, varies;                                      /* terms; 0: one term with c = 1 */
    float *spectrum[RX_PSF_MAX_BASIS];                  /* of B_i */
    float *cx[RX_PSF_MAX_BASIS], *cy[RX_PSF_MAX_BASIS]; /* c_i = cx[x + margin] cy[y + margin] */
} rx_blur_kernel;

/* Planes of one thread, and where they lie: pixel (0, 0) of the domain is tile pixel (x, y). */
typedef struct rx_blur_domain {
    rx_fft *fft;
    int x, y;
    float *half;       /* complex */
    float *sum, *back; /* complex and real, of a varying PSF */
} rx_blur_domain;

/* What goes into a domain and comes out of it, row by row as in num/fft.h, `read` once for each term. Rows
 * top .. bottom - 1 are written, columns left .. right - 1 of them mean something. */
typedef struct rx_blur_rows {
    rx_fft_read read;
    rx_fft_write write;
    void *user;
    int left, right, top, bottom;
} rx_blur_rows;

int rx_psf_varies(const rx_psf *psf); /* 1: the PSF is not the same everywhere */

/* Of that PSF on a tile; fft may be any of the domains' of that size. What is made belongs to *dst even after
 * an error. Errors: RX_INPUT (a PSF that vanishes), RX_SYSTEM. */
rx_status rx_blur_kernel_make(const rx_fft *fft, const rx_psf *psf, int width, int height,
                              rx_blur_kernel *dst, rx_error *err);
void rx_blur_kernel_clear(rx_blur_kernel *kernel); /* of zeros is fine */

/* Of the domains that share `length` pixels out, so many around each one's, the side of the cheapest. */
int rx_blur_side(int length, int margin);

rx_status rx_blur_domain_make(int width, int height, int nthreads, int varies, rx_blur_domain *dst,
                              rx_error *err);
void rx_blur_domain_clear(rx_blur_domain *domain);

/* K and K^T on the domain: what wraps around is the caller's to keep out. What is read is 0 beyond the margin
 * around the tile, and nothing is written beyond it. */
void rx_blur_domain_apply(const rx_blur_kernel *kernel, const rx_blur_domain *domain,
                          const rx_blur_rows *rows);
void rx_blur_domain_adjoint(const rx_blur_kernel *kernel, const rx_blur_domain *domain,
                            const rx_blur_rows *rows);

/* ---- a whole tile ---- */

/* Blocks of one axis: `n` of `step` pixels from `begin` on, the last one to `end`. */
typedef struct rx_blur_axis {
    int begin, end, step, n;
} rx_blur_axis;

typedef struct rx_blur {
    int width, height; /* of the tile */
    int margin;
    rx_blur_axis tile_x, tile_y, sky_x, sky_y;
    rx_blur_kernel kernel;
    int nwork; /* blocks at a time */
    rx_blur_domain *work;
} rx_blur;

/* Pieces of rows, asked for and given by any of the blur's threads, in any order, some asked for twice: n
 * pixels from (x, y) on, in tile pixels, so that the sky begins at -margin. */
typedef struct rx_blur_lines {
    void (*read)(void *user, int y, int x, int n, float *line);
    void (*write)(void *user, int y, int x, int n, const float *line);
    void *user;
} rx_blur_lines;

/* Can this PSF blur such a tile: odd stamps no larger than the tile, finite, with flux? RX_INPUT when not. */
rx_status rx_blur_check(const rx_psf *psf, int width, int height, rx_error *err);

/* Errors: RX_INPUT when the PSF is larger than the tile, not finite or without flux. */
rx_status rx_blur_new(const rx_psf *psf, int width, int height, int nthreads, rx_blur **dst, rx_error *err);
void rx_blur_free(rx_blur *blur);

/* Another constant PSF, of the size of the present one (which must be constant). */
void rx_blur_replace(rx_blur *blur, const float *stamp);

/* K^T: reads rows of the tile, writes rows of the sky. */
void rx_blur_adjoint(const rx_blur *blur, const rx_blur_lines *lines);

/* K, which reads rows of the sky and writes rows of the tile, and K^T: the rows of blocks first .. last - 1 of what is made, tile_y
 * or sky_y. */
void rx_blur_apply_rows(const rx_blur *blur, const rx_blur_lines *lines, int first, int last);
void rx_blur_adjoint_rows(const rx_blur *blur, const rx_blur_lines *lines, int first, int last);

/* The same with planes: sky [height + 2 margin][width + 2 margin], tile [height][width]. */
void rx_blur_plane(const rx_blur *blur, const float *sky, float *tile);
void rx_blur_adjoint_plane(const rx_blur *blur, const float *tile, float *sky);

/* A sky of zeros, to be freed by free(); NULL without memory. Its pixels, and where tile pixel (0, y) is. */
float *rx_blur_sky(const rx_blur *blur);
size_t rx_blur_sky_size(const rx_blur *blur);
size_t rx_blur_row(const rx_blur *blur, int y);

#endif
