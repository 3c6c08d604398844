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

/* Blocks of one axis: `n` of `step` pixels from `begin` on, the last one to `end`. */
typedef struct rx_blur_axis {
    int begin, end, step, n;
} rx_blur_axis;

typedef struct rx_blur_work rx_blur_work; /* planes of one thread */

typedef struct rx_blur {
    int width, height; /* of the tile */
    int margin;
    int size; /* of the PSF stamps */
    int nterms;
    int varies; /* 0: one term with c = 1 */
    rx_blur_axis tile_x, tile_y, sky_x, sky_y;
    float *kernel[RX_PSF_MAX_BASIS];                    /* spectra of B_i on a block's domain */
    float *cx[RX_PSF_MAX_BASIS], *cy[RX_PSF_MAX_BASIS]; /* c_i = cx[x + margin] cy[y + margin] */
    int nwork;                                          /* blocks at a time */
    rx_blur_work *work;
    float *plane; /* real, for spectra in the making */
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

/* Another constant PSF stamp[size][size] in place of the present one (which must be constant). */
void rx_blur_replace(rx_blur *blur, const float *stamp);

/* K: reads rows of the sky, writes rows of the tile. */
void rx_blur_apply(const rx_blur *blur, const rx_blur_lines *lines);

/* K^T: reads rows of the tile, writes rows of the sky. */
void rx_blur_adjoint(const rx_blur *blur, const rx_blur_lines *lines);

/* The same of the rows of blocks first .. last - 1 of what is made, tile_y or sky_y. */
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
