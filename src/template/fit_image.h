/* The pixels that are fitted, with what is known of them and what is modelled so far.
 *
 * Only some rows of the tile are in memory at a time, and of these only the blocks that were asked for with
 * rx_fit_image_load() hold what they should: pixels and noise are read from the input again, and the model is
 * drawn again, where rows come back. A pixel has the same bits whenever and with whatever others it is shown.
 */
#ifndef RX_TEMPLATE_FIT_IMAGE_H
#define RX_TEMPLATE_FIT_IMAGE_H

#include "base/error.h"
#include "fit/sky_mesh.h"
#include "template/tphot.h"

/* Part of a template on the image: values[height][width], its first pixel at (x0, y0), inside the image;
 * width 0: nothing of it is. */
typedef struct rx_footprint {
    int x0, y0, width, height;
    float *values; /* owned; NULL when width is 0 */
    double inside; /* share of the template inside the image, cropped wings included */
} rx_footprint;

/* A template with its flux, as it is drawn into the model; the values are somebody else's. */
typedef struct rx_layer {
    rx_footprint footprint;
    double flux;
} rx_layer;

typedef struct rx_fit_image rx_fit_image;

/* Pixels x0 <= x < x1, y0 <= y < y1 inside the image; none where an end is not above its start. */
typedef struct rx_window {
    int x0, y0, x1, y1;
} rx_window;

struct rx_fit_image {
    int width, height; /* of the image */
    int top, rows;     /* in memory: rows top .. top + rows - 1 */
    float *data;       /* [rows][width] pixels - level - meshes; 0 where hidden */
    float *sigma;      /* noise of the sky, ADU; 0 where hidden */
    float *model;      /* sum_i F_i T_i */
    float *weight;     /* 1 / (variance + photons and errors of the model); 0 where hidden */
    double gain;       /* e-/ADU by which a pixel's photon noise goes, 0: none */
    double psf_error;  /* of a template, relative */
    const rx_noise_correlation *correlation; /* of the noise; NULL: independent pixels */
    int nthreads;
    /* its own */
    const rx_tphot_input *input;
    size_t held, room; /* pixels in memory: as many as that, if no window needs more; as many as there are */
    float *planes;     /* [4][room] */
    float *kept;       /* [height][width] data, NAN where hidden; NULL: made anew whenever they are shown */
    uint8_t *state;    /* [lines][columns] of blocks */
    int columns, lines;
    rx_layer *layers; /* [nlayers + nadded] of room for nroom */
    int nlayers, nadded, nroom;
    rx_sky_mesh *meshes;
    int nmeshes;
    rx_sky_mesh scale; /* of sigma; nx 0: 1 */
    float brightest;   /* light of two neighbours, ADU above the level */
    float
        floor; /* sigma at least: pixels in steps have the noise of rounding, and no model is exact to two millionths of the
                       brightest light */
};

/* Of the input, which must live as long; psf_error 0, no model, nothing shown. held: pixels to be held in
 * memory; of images of up to four times as many the data are kept besides, which saves time. Free the
 * contents with rx_fit_image_clear(). */
void rx_fit_image_open(const rx_tphot_input *input, size_t held, int nthreads, rx_fit_image *image);
void rx_fit_image_clear(rx_fit_image *image);

/* So many rows fit in memory, at least one; all of the image where they do. */
int rx_fit_image_rows(const rx_fit_image *image);

/* The windows which[0 .. n - 1] (NULL: the first n) can be read until the next call; more memory than held
 * is taken where they need it. Errors: RX_SYSTEM. */
rx_status rx_fit_image_load(rx_fit_image *image, const rx_window *windows, const int *which, int n,
                            rx_error *err);

/* All of the rows from <= y < to. */
rx_status rx_fit_image_load_rows(rx_fit_image *image, int from, int to, rx_error *err);

/* Where row y begins in the planes. */
static inline size_t rx_fit_image_row(const rx_fit_image *image, int y)
{
    return (size_t)(y - image->top) * (size_t)image->width;
}

/* Variance of the sky in any pixel of the image, ADU^2; 0 where hidden. */
float rx_fit_image_variance(const rx_fit_image *image, int x, int y);

/* Variance of pixel k of those in memory over what it would be without `light` of its model (ADU): what weights rise by where the
 * question is whether that light is there, which then has no photons either. */
double rx_fit_image_quiet(const rx_fit_image *image, size_t k, double light);

rx_window rx_footprint_window(const rx_footprint *footprint);

/* From now on model = sum of n layers, added in their order in every pixel, and the weights that follow from
 * it. The list, from rx_alloc(), is the image's from now on; values of footprints must live as long as
 * anything is shown. */
void rx_fit_image_set(rx_fit_image *image, rx_layer *layers, int n);

/* model += flux * footprint, with the same lifetime; the weights stay as they are. Errors: RX_SYSTEM. */
rx_status rx_fit_image_add(rx_fit_image *image, const rx_footprint *footprint, double flux, rx_error *err);

/* data -= mesh, which is the image's from now on; nothing is shown any more. Errors: RX_SYSTEM; the mesh is cleared then. */
rx_status rx_fit_image_subtract(rx_fit_image *image, rx_sky_mesh *mesh, rx_error *err);

/* sigma *= mesh, which is the image's from now on; nothing is shown any more. */
void rx_fit_image_rescale(rx_fit_image *image, rx_sky_mesh *mesh);

#endif
