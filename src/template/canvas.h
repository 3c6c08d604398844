/* The pixels that are fitted, with what is known of them and what is modelled so far. */
#ifndef RX_TEMPLATE_CANVAS_H
#define RX_TEMPLATE_CANVAS_H

#include "base/error.h"
#include "template/template.h"

/* Part of a template on the image: values[height][width], its first pixel at (x0, y0), inside the image;
 * width 0: nothing of it is. */
typedef struct rx_footprint {
    int x0, y0, width, height;
    float *values; /* owned; NULL when width is 0 */
    double inside; /* share of the template inside the image, cropped wings included */
} rx_footprint;

/* A template with its flux, as it is drawn into the model. */
typedef struct rx_layer {
    const rx_footprint *footprint;
    double flux;
} rx_layer;

typedef struct rx_canvas {
    int width, height;
    float *data;        /* [height][width] pixels - level; 0 where hidden */
    const float *sigma; /* [height][width] noise of the sky, ADU, own or the input's; anything where hidden */
    float *own_sigma;   /* NULL where the input has it as a plane */
    float *model;       /* [height][width] sum_i F_i T_i */
    float *weight;      /* [height][width] 1 / (variance + photons and errors of the model); 0 where hidden */
    double gain;        /* e-/ADU, 0: none */
    double psf_error;   /* of a template, relative */
} rx_canvas;

/* From the input, whose sigma goes on being read where it is a plane, psf_error 0; the model is 0. Free the
 * contents with rx_canvas_clear(). Errors: RX_SYSTEM.
 */
rx_status rx_canvas_fill(const rx_tphot_input *input, int nthreads, rx_canvas *canvas, rx_error *err);
void rx_canvas_clear(rx_canvas *canvas);

/* Variance of the sky in pixel k, ADU^2; 0 where hidden. */
static inline float rx_canvas_variance(const rx_canvas *canvas, size_t k)
{
    return canvas->weight[k] > 0.0f ? canvas->sigma[k] * canvas->sigma[k] : 0.0f;
}

/* model = sum of n layers, added in their order in every pixel, and the weights that follow from it. Errors:
 * RX_SYSTEM. */
rx_status rx_canvas_draw(rx_canvas *canvas, const rx_layer *layers, int n, int nthreads, rx_error *err);

/* model += flux * footprint; the weights stay as they are. */
void rx_canvas_add(rx_canvas *canvas, const rx_footprint *footprint, double flux);

#endif
