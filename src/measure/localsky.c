/* Local sky through sep's mesh estimator on the annulus' pixels as an image of one mesh. */
#include "measure/localsky.h"

#include <stddef.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/unit.h"

#include <sep.h>

static bool inside(const rx_box *box, int x, int y)
{
    return x >= box->x0 && x < box->x1 && y >= box->y0 && y < box->y1;
}

static int gap(int size, int full)
{
    return size < full / 2 ? size / 4 : (full - size) / 4;
}

rx_status rx_local_sky(const rx_view *view, const rx_source *s, int thickness, double *sky, rx_error *err)
{
    const rx_image *image = view->image;
    int gx = gap(s->xmax - s->xmin + 1, image->width), gy = gap(s->ymax - s->ymin + 1, image->height);
    rx_box inner = {s->xmin - gx, s->xmax + 1 + gx, s->ymin - gy, s->ymax + 1 + gy};
    rx_box outer = {inner.x0 - thickness, inner.x1 + thickness, inner.y0 - thickness, inner.y1 + thickness};
    *sky = 0.0;
    if (thickness < 1 || outer.x0 < 0 || outer.y0 < 0 || outer.x1 >= image->width ||
        outer.y1 >= image->height)
        return RX_OK;
    size_t room = (size_t)(outer.x1 - outer.x0) * (size_t)(outer.y1 - outer.y0);
    float *values;
    rx_status status = RX_OK;
    RX_TRY(RX_MAKE(values, room, err));
    int n = 0;
    for (int y = outer.y0; y < outer.y1; y++)
        for (int x = outer.x0; x < outer.x1; x++)
            if (!inside(&inner, x, y) && rx_view_state(view, x, y) == RX_SEEN_GOOD)
                values[n++] = rx_view_value(image, (size_t)y * (size_t)image->width + (size_t)x);
    if (n > 0) {
        const double unit = rx_unit_of(image->global_noise); /* sep takes nothing beyond 1e30 */
        rx_unit_divide(values, unit != 1.0 ? (size_t)n : 0, unit);
        sep_bkg *mesh = NULL;
        sep_image list = {.data = values, .dtype = SEP_TFLOAT, .w = n, .h = 1, .noise_type = SEP_NOISE_NONE};
        if (sep_background(&list, n, 1, 1, 1, 0.0, &mesh) == 0)
            *sky = sep_bkg_global(mesh) * unit;
        else
            status = rx_error_memory(err, (size_t)n * sizeof *values);
        sep_bkg_free(mesh);
    }
    free(values);
    return status;
}
