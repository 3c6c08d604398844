/* The image as one source sees it: neighbours and masked pixels hidden, or replaced by the pixel
 * mirrored at the centre (MASK_TYPE CORRECT). */
#ifndef RX_MEASURE_VIEW_H
#define RX_MEASURE_VIEW_H

#include <stdbool.h>

#include "measure/measure.h"

typedef struct rx_view {
    const rx_image *image;
    const rx_image *radii; /* that radii are measured on */
    int weight_gain;       /* of rx_measure_params */
    const rx_sources *sources;
    rx_mask_type neighbours;
    int32_t segment; /* the source's own */
    double sky;      /* local background above the subtracted one, ADU (BACKPHOTO LOCAL) */
} rx_view;

typedef enum rx_seen { RX_SEEN_GOOD, RX_SEEN_NEIGHBOUR, RX_SEEN_MASKED } rx_seen;

/* These two are asked for every pixel of every aperture: inline. */

/* What the pixel is; inside the image only. */
static inline rx_seen rx_view_state(const rx_view *view, int x, int y)
{
    const rx_image *image = view->image;
    size_t k = (size_t)y * (size_t)image->width + (size_t)x;
    if (rx_image_hides(image, k))
        return RX_SEEN_MASKED;
    if (view->neighbours == RX_NEIGHBOURS_NONE)
        return RX_SEEN_GOOD;
    int fragment = view->sources->fragments != NULL ? view->sources->fragments[k] : 0;
    if (fragment == RX_FRAGMENT_EATEN)
        return RX_SEEN_GOOD;
    int32_t segment = view->sources->segments[k];
    bool other = segment != 0 && segment != view->segment;
    return other || fragment == RX_FRAGMENT_SMALL ? RX_SEEN_NEIGHBOUR : RX_SEEN_GOOD;
}

/* rx_view_value() of pixels with sky: 0 where one is hidden. */
float rx_view_above_sky(const rx_image *image, size_t k);

/* Pixel k, ADU above the sky. */
static inline float rx_view_value(const rx_image *image, size_t k)
{
    return image->with_sky ? rx_view_above_sky(image, k) : image->pixels[k];
}

static inline double rx_view_variance(const rx_image *image, size_t k)
{
    double sigma = image->variable_noise ? image->noise.plane[k] : image->global_noise;
    return sigma * sigma;
}

/* Value (ADU) and noise variance of a pixel for sums about (cx, cy); returns what the pixel itself is.
 * Hidden: the mirrored pixel where that is good, else value 0 (and variance 0 with a weight map,
 * where SExtractor knows the pixel says nothing). */
static inline rx_seen rx_view_pixel(const rx_view *view, int x, int y, double cx, double cy, double *value,
                                    double *variance)
{
    const rx_image *image = view->image;
    rx_seen state = rx_view_state(view, x, y);
    if (state != RX_SEEN_GOOD) {
        int mx = (int)(2.0 * cx + 0.49999 - x), my = (int)(2.0 * cy + 0.49999 - y);
        bool mirrored = view->neighbours == RX_NEIGHBOURS_CORRECT && mx >= 0 && mx < image->width &&
                        my >= 0 && my < image->height && rx_view_state(view, mx, my) == RX_SEEN_GOOD;
        if (!mirrored) {
            *value = 0.0;
            *variance = image->variable_noise ? 0.0 : image->global_noise * image->global_noise;
            return state;
        }
        x = mx;
        y = my;
    }
    size_t k = (size_t)y * (size_t)image->width + (size_t)x;
    *value = rx_view_value(image, k);
    *variance = rx_view_variance(image, k);
    return state;
}

/* Factor on the sigma of a sum over `area` pixels, against independent pixels (noise law). */
double rx_view_noise_factor(const rx_view *view, double area);

/* Inclusive-exclusive pixel box clipped to the image; true when something was cut off. */
typedef struct rx_box {
    int x0, x1, y0, y1;
} rx_box;
bool rx_view_clip(const rx_view *view, rx_box *box);

/* The same for the box around a circle, SExtractor's rounding; any radius. */
bool rx_view_circle_box(const rx_view *view, double x, double y, double radius, rx_box *box);

#endif
