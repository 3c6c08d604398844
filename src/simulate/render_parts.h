/* What the files of the renderer share and no other needs. */
#ifndef RX_SIMULATE_RENDER_PARTS_H
#define RX_SIMULATE_RENDER_PARTS_H

#include "base/error.h"
#include "num/fft.h"
#include "simulate/optics.h"
#include "simulate/render.h"
#include "simulate/scene.h"

/* --- render_stars.c: points on a grid of cells --- */

/* A sinc in a Kaiser window: a point at any place between the cells becomes RX_STAR_TAPS^2 of them. Its
 * spectrum is flat to 2e-5 up to RX_STAR_BAND cycles per cell, and as low beyond 1 - RX_STAR_BAND; the sum
 * over the cells is 1. */
enum { RX_STAR_TAPS = 20 };
#define RX_STAR_BAND 0.34
typedef struct rx_star_kernel rx_star_kernel;
rx_star_kernel *rx_star_kernel_new(void); /* NULL without memory; free() it */

/* Cells [height][stride], the first at (column, row) of all cells, += flux of a point at (u, v) cells. */
void rx_star_draw(const rx_star_kernel *kernel, double u, double v, double flux, long column, long row,
                  rx_fine_grid *grid);

/* --- render_draw.c: objects on a grid of cells --- */

/* A scene ready to be drawn in parts. */
typedef struct rx_drawing {
    const rx_scene *scene;
    const rx_star_kernel *kernel;
    int cells; /* per pixel; cell (0, 0) is centred on pixel (0, 0) */
    int nthreads;
    double *reach;   /* [scene->n] rx_object_reach(), cells */
    struct box *box; /* [scene->n] room for what is inside a part */
} rx_drawing;

/* The first four are given; the rest is made here, and freed by rx_drawing_close(). Errors: RX_SYSTEM memory.
 */
rx_status rx_drawing_open(rx_drawing *drawing, rx_error *err);
void rx_drawing_close(rx_drawing *drawing);

/* Everything of the scene that falls into the grid, which begins at cell (column, row). */
rx_status rx_drawing_part(const rx_drawing *drawing, long column, long row, rx_fine_grid *grid,
                          rx_error *err);

/* --- render_fold.c: through the optics, from cells to pixels --- */

/* Spectra of all images of the optics on a cyclic domain of width x height pixels (even numbers). */
typedef struct rx_kernels rx_kernels;
/* keep: they will be asked for again and again, and are kept as far as memory is not too large. */
rx_status rx_kernels_new(int n, const rx_optics *const *optics, int width, int height, int keep, int nthreads,
                         rx_kernels **dst, rx_error *err);
void rx_kernels_free(rx_kernels *kernels);

/* half (a complex plane of `native`, width x height) += what pixels see of the grid whose spectrum on `fine`
 * (cells * width, cells * height) is `spectrum` through basis image `image` of optics i. Of the spectrum only
 * the columns to rx_kernels_columns(i) are needed. */
void rx_kernels_fold(rx_kernels *kernels, int i, int image, const rx_fft *fine, const float *spectrum,
                     const rx_fft *native, float *half);
int rx_kernels_columns(const rx_kernels *kernels, int i);

#endif
