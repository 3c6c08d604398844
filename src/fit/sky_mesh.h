/* A sky on a coarse mesh. */
#ifndef RX_TEMPLATE_SKY_MESH_H
#define RX_TEMPLATE_SKY_MESH_H

#include "base/error.h"

/* An image of width x height pixels in nx x ny cells: bilinear between their centres, constant beyond the
 * outermost. */
typedef struct rx_sky_mesh {
    int width, height, cell, nx, ny; /* cell: as it was asked for */
    double *value;                   /* [ny][nx] ADU */
    int *first;                      /* [width] the cell whose centre is left of a pixel */
    double *off;                     /* [width] how far from there, in cells */
} rx_sky_mesh;

/* Cells about `cell` pixels wide and high, at least one; value 0. Free the contents with rx_sky_mesh_clear().
 * Errors: RX_SYSTEM. */
rx_status rx_sky_mesh_open(int width, int height, int cell, rx_sky_mesh *mesh, rx_error *err);
void rx_sky_mesh_clear(rx_sky_mesh *mesh);

/* Its value in pixel (x, y). */
double rx_sky_mesh_at(const rx_sky_mesh *mesh, int x, int y);

/* data -= mesh in the n pixels from (x, y) on, where weight is above 0. */
void rx_sky_mesh_subtract(const rx_sky_mesh *mesh, int y, int x, int n, const float *weight, float *data);

/* values *= mesh in the n pixels from (x, y) on. */
void rx_sky_mesh_multiply(const rx_sky_mesh *mesh, int y, int x, int n, float *values);

#endif
