/* The image as one source sees it. */
#include "measure/view.h"

#include <math.h>

rx_seen rx_view_state(const rx_view *view, int x, int y)
{
    const rx_measure_image *image = view->image;
    size_t k = (size_t)y * (size_t)image->width + (size_t)x;
    if (image->mask != NULL && (image->mask[k] & image->mask_bits) != 0)
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

static double variance_of(const rx_measure_image *image, size_t k)
{
    double sigma = image->variable_noise ? image->sigma[k] : image->global_sigma;
    return sigma * sigma;
}

rx_seen rx_view_pixel(const rx_view *view, int x, int y, double cx, double cy, double *value,
                      double *variance)
{
    const rx_measure_image *image = view->image;
    rx_seen state = rx_view_state(view, x, y);
    if (state != RX_SEEN_GOOD) {
        int mx = (int)(2.0 * cx + 0.49999 - x), my = (int)(2.0 * cy + 0.49999 - y);
        bool mirrored = view->neighbours == RX_NEIGHBOURS_CORRECT && mx >= 0 && mx < image->width &&
                        my >= 0 && my < image->height && rx_view_state(view, mx, my) == RX_SEEN_GOOD;
        if (!mirrored) {
            *value = 0.0;
            *variance = image->variable_noise ? 0.0 : image->global_sigma * image->global_sigma;
            return state;
        }
        x = mx;
        y = my;
    }
    size_t k = (size_t)y * (size_t)image->width + (size_t)x;
    *value = image->pixels[k];
    *variance = variance_of(image, k);
    return state;
}

double rx_view_noise_factor(const rx_view *view, double area)
{
    const rx_measure_image *image = view->image;
    if (image->law != NULL)
        return rx_noise_law_factor(image->law, area);
    if (image->law_scale == 1.0 && image->law_power == 0.5)
        return 1.0;
    return image->law_scale * pow(fmax(area, 1.0), image->law_power - 0.5);
}

bool rx_view_clip(const rx_view *view, rx_box *box)
{
    rx_box all = *box;
    box->x0 = box->x0 < 0 ? 0 : box->x0;
    box->y0 = box->y0 < 0 ? 0 : box->y0;
    box->x1 = box->x1 > view->image->width ? view->image->width : box->x1;
    box->y1 = box->y1 > view->image->height ? view->image->height : box->y1;
    return all.x0 != box->x0 || all.x1 != box->x1 || all.y0 != box->y0 || all.y1 != box->y1;
}

bool rx_view_circle_box(const rx_view *view, double x, double y, double radius, rx_box *box)
{
    /* more than the image is the image, and an int holds it */
    double r = fmin(radius, 4.0 * ((double)view->image->width + view->image->height));
    *box = (rx_box){(int)(x - r + 0.499999), (int)(x + r + 1.499999), (int)(y - r + 0.499999),
                    (int)(y + r + 1.499999)};
    return rx_view_clip(view, box);
}
