/* The pixels around one source on the domain of its otf: what others leave of the data, and the weights. */
#ifndef RX_TEMPLATE_PATCH_H
#define RX_TEMPLATE_PATCH_H

#include "template/fit_image.h"
#include "template/template_otf.h"

/* Pixel (i, j) of the patch is pixel (x0 + i, y0 + j) of the image and (corner + i, corner + j) of a plane of
 * the domain. */
typedef struct rx_patch {
    int x0, y0, side, corner;
    double *data,
        *weight; /* [side][side] in one block, data's; weight 0 outside the image and where hidden */
} rx_patch;

/* data - model of the pixels within `half` of the whole pixel (cx, cy). Free with rx_patch_clear(). Errors:
 * RX_SYSTEM. */
rx_status rx_patch_cut(const rx_fit_image *image, int cx, int cy, int half, int domain, rx_patch *patch,
                       rx_error *err);
/* Footprint times flux onto the data where there is weight. */
void rx_patch_add(rx_patch *patch, const rx_footprint *footprint, double flux);
/* Noise that many times as wide: what the patch says counts by as much less. */
void rx_patch_dim(rx_patch *patch, double factor);
void rx_patch_clear(rx_patch *patch);

/* A rendered plane, its pixel (n/2, n/2) on (cx, cy) of the image. */
typedef struct rx_template_plane {
    const float *values; /* [n][n] in rows of stride */
    int n;
    size_t stride;
    int cx, cy;
} rx_template_plane;

/* Crop it to where it is above `level` and inside the image of width x height pixels. Errors: RX_SYSTEM. */
rx_status rx_footprint_crop(const rx_template_plane *plane, double level, int width, int height,
                            rx_footprint *dst, rx_error *err);

/* Its largest value, at least 0. */
double rx_footprint_peak(const rx_footprint *footprint);

/* sum over common pixels of a b; with `image` weighted. */
double rx_footprint_product(const rx_footprint *a, const rx_footprint *b, const rx_fit_image *image);

#endif
