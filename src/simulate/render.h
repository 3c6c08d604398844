/* From objects to pixels: Img = [Obj * PSF]_pixel, the paper's eq. 1 before the noise.
 *
 * Objects are put on a grid of several cells per pixel, stars as band-limited points at their exact position
 * (position and flux are kept to 1e-5 of a pixel, of the flux), galaxies and templates by their surface
 * brightness; the grid is convolved with optics (Fourier space, blocks of bounded size that add up linearly)
 * and read at the pixel centres. A PSF that varies is that of the place where the light comes from, cell by
 * cell. The same bytes for any nthreads. Single precision: errors of a pixel are about 1e-6 of the brightest
 * pixels of its block, and light that should be 0 may be that much below it. */
#ifndef RX_SIMULATE_RENDER_H
#define RX_SIMULATE_RENDER_H

#include "base/error.h"
#include "simulate/optics.h"
#include "simulate/scene.h"

enum { RX_RENDER_BLOCK = 1024 }; /* pixels: tiles up to this side are one block */

/* images[i] [height][width] += scene through optics[i], i < n: the blurred tile and the sharp reference share
 * the grid. Objects partly or wholly outside count with what falls inside. Memory: about 12 cells^2 bytes per
 * pixel of a block and its margin, the stamp's half side around it. Errors: RX_SYSTEM memory, RX_INTERRUPTED. */
rx_status rx_render(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                    int nthreads, rx_error *err);

/* The same in blocks of about that many pixels on each side. */
rx_status rx_render_blocks(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                           int block, int nthreads, rx_error *err);

/* Surface brightness of one galaxy or template, added to a grid of cells: cell (i, j) is centred on pixel
 * position (x0 + i * step, y0 + j * step). What lies outside the grid is lost; over the plane the sum is
 * object->flux. A cell's value does not depend on where the grid ends: blocks draw their parts. (draw.c) */
typedef struct rx_fine_grid {
    int width, height; /* cells */
    double x0, y0, step;
    float *cells;
    size_t stride; /* floats per row */
} rx_fine_grid;
rx_status rx_galaxy_draw(const rx_object *object, rx_fine_grid *grid, rx_error *err); /* RX_SYSTEM */
void rx_template_draw(const rx_object *object, const rx_template *source, rx_fine_grid *grid);

/* Half size in pixels of the square around the object that holds all but 1e-3 of its flux (0 for a star). */
double rx_object_reach(const rx_object *object, const rx_templates *templates);

#endif
