/* From objects to pixels: Img = [Obj * PSF]_pixel, the paper's eq. 1 before the noise.
 *
 * Objects are put on a grid of 1/oversampling pixel, stars as band-limited points at their exact position,
 * galaxies and templates by their surface brightness; the grid is convolved with optics (Fourier space,
 * blocks of bounded size that add up linearly) and read at the pixel centres. The same bytes for any
 * nthreads. */
#ifndef RX_SIMULATE_RENDER_H
#define RX_SIMULATE_RENDER_H

#include "base/error.h"
#include "simulate/optics.h"
#include "simulate/scene.h"

/* images[i] [height][width] += scene through optics[i], i < n: the blurred tile and the sharp reference share
 * the grid. Objects partly or wholly outside count with what falls inside. */
rx_status rx_render(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                    int nthreads, rx_error *err);

/* Surface brightness of one galaxy or template, added to a grid of cells: cell (i, j) is centred on pixel
 * position (x0 + i * step, y0 + j * step). What lies outside the grid is lost; over the plane the sum is
 * object->flux. (galaxy.c) */
typedef struct rx_fine_grid {
    int width, height; /* cells */
    double x0, y0, step;
    float *cells;
    size_t stride; /* floats per row */
} rx_fine_grid;
void rx_galaxy_draw(const rx_object *object, rx_fine_grid *grid);
void rx_template_draw(const rx_object *object, const rx_template *source, rx_fine_grid *grid);

/* Half size in pixels of the square around the object that holds all but 1e-3 of its flux (0 for a star). */
double rx_object_reach(const rx_object *object, const rx_templates *templates);

#endif
