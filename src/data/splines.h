/* A smooth surface through the values of a grid of meshes, read by rows.
 *
 * Along y, natural cubic splines join the values of each column of the grid; what they have in a row of the
 * image are the nodes of a natural cubic spline along x. Between two nodes v0, v1 with second derivatives
 * over 6 of d0, d1, at the place t from 0 to 1,
 *   (1 - t) (v0 + ((1 - t)^2 - 1) d0) + t (v1 + (t^2 - 1) d1)
 * in single precision, operation by operation what SExtractor's and sep's maps have (Bertin & Arnouts 1996,
 * A&AS 117, 393, section 4.1), and so the same to the bit. Only the nodes are held: 2 / mesh of the plane.
 */
#ifndef RX_DATA_SPLINES_H
#define RX_DATA_SPLINES_H

#include "base/error.h"
#include "base/extern.h"

RX_BEGIN_DECLS

/* nodes 0: `value` everywhere. */
typedef struct rx_splines {
    int width, height;
    int nodes, mesh; /* nodes of a row, and pixels from one to the next */
    float value;
    float *node;  /* [height][2][nodes] value, second derivative over 6 */
    float *place; /* [width] t of a pixel between the nodes around it */
} rx_splines;

/* The meshes: mesh_width x mesh_height pixels each, nx x ny of them; values[ny][nx], and their second
 * derivatives along y over 6. */
typedef struct rx_spline_grid {
    int mesh_width, mesh_height, nx, ny;
    const float *values, *derivatives;
} rx_spline_grid;

/* The surface for width x height pixels; nothing of the grid is kept. The same for any nthreads. Free the
 * contents with rx_splines_free(). Errors: RX_SYSTEM without memory. */
rx_status rx_splines_new(const rx_spline_grid *grid, int width, int height, int nthreads, rx_splines *dst,
                         rx_error *err);
void rx_splines_free(rx_splines *splines);

/* dst[n]: from pixel (x, y) on. */
void rx_splines_row(const rx_splines *splines, int y, int x, int n, float *dst);

RX_END_DECLS

#endif
