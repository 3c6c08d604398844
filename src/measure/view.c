/* The image as one source sees it. */
#include "measure/view.h"

#include <math.h>

float rx_view_above_sky(const rx_image *image, size_t k)
{
    const size_t width = (size_t)image->width;
    if (rx_image_hides(image, k))
        return 0;
    return image->pixels[k] - rx_map_at(&image->level, (int)(k % width), (int)(k / width));
}

double rx_view_noise_factor(const rx_view *view, double area)
{
    const rx_image *image = view->image;
    return image->law != NULL ? rx_noise_law_factor(image->law, area) : 1.0;
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
