/* World coordinates of the sources. */
#include "stage/coordinates.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "io/wcs.h"

enum { CENTRE, WINDOWED, PEAK, FITTED, POINT, NPOSITIONS };

typedef struct position {
    double x, y;
    double *sky[4]; /* native and J2000; NULL: no column has it */
} position;

static position position_of(rx_source *s, int kind)
{
    const bool fitted = s->fit.group > 0, point = fitted && isfinite(s->point_fit.x);
    const position all[NPOSITIONS] = {
        [CENTRE] = {s->x, s->y, {&s->alpha, &s->delta, &s->alpha_j2000, &s->delta_j2000}},
        [WINDOWED] = {s->xwin, s->ywin, {&s->alphawin, &s->deltawin, &s->alphawin_j2000, &s->deltawin_j2000}},
        [PEAK] = {s->xpeak,
                  s->ypeak,
                  {&s->alphapeak, &s->deltapeak, &s->alphapeak_j2000, &s->deltapeak_j2000}},
        [FITTED] = {fitted ? s->fit.x : s->x,
                    fitted ? s->fit.y : s->y,
                    {NULL, NULL, &s->fit.alpha, &s->fit.delta}},
        [POINT] = {point ? s->point_fit.x : s->x,
                   point ? s->point_fit.y : s->y,
                   {NULL, NULL, &s->point_fit.alpha, &s->point_fit.delta}}};
    return all[kind];
}

/* Position angle of native north in the J2000 frame at a source (rad): where a small step along native
 * north leads on the J2000 sky. 0 for tiles that are in J2000 themselves. */
static double native_north(const rx_image *image, const rx_source *source)
{
    const double step = 1e-3; /* deg */
    const double *m = source->world_matrix;
    double determinant = m[0] * m[3] - m[1] * m[2], delta = source->delta_j2000 * M_PI / 180.0;
    if (source->alpha == source->alpha_j2000 && source->delta == source->delta_j2000)
        return 0.0;
    double x = source->x - m[1] / determinant * step, y = source->y + m[0] / determinant * step;
    double alpha_j2000, delta_j2000;
    rx_wcs_to_sky(image->wcs, 1, &x, &y, &alpha_j2000, &delta_j2000);
    return atan2((alpha_j2000 - source->alpha_j2000) * cos(delta), delta_j2000 - source->delta_j2000);
}

rx_status rx_coordinates_fill(const rx_image *image, rx_sources *sources, rx_error *err)
{
    size_t n = (size_t)sources->n;
    double *work;
    RX_TRY(RX_MAKE(work, 6 * n + 1, err));
    double *x = work, *y = work + n, *sky = work + 2 * n;
    for (int kind = 0; kind < NPOSITIONS; kind++) {
        for (size_t i = 0; i < n; i++) {
            const position at = position_of(&sources->list[i], kind);
            x[i] = at.x, y[i] = at.y;
        }
        if (image->wcs != NULL) {
            rx_wcs_to_native(image->wcs, (int)n, x, y, sky, sky + n);
            rx_wcs_native_to_j2000(image->wcs, (int)n, sky, sky + n, sky + 2 * n, sky + 3 * n);
        } else
            for (size_t i = 0; i < 4 * n; i++)
                sky[i] = NAN;
        for (size_t i = 0; i < n; i++)
            for (size_t k = 0; k < 4; k++) {
                double *dst = position_of(&sources->list[i], kind).sky[k];
                if (dst != NULL)
                    *dst = sky[k * n + i];
            }
    }
    for (size_t i = 0; i < n; i++) {
        rx_source *source = &sources->list[i];
        for (int k = 0; k < 4; k++)
            source->world_matrix[k] = NAN;
        source->x_world = source->alpha;
        source->y_world = source->delta;
        if (source->fit.group <= 0)
            source->fit.alpha = source->fit.delta = NAN;
        if (source->fit.group <= 0 || !isfinite(source->point_fit.x))
            source->point_fit.alpha = source->point_fit.delta = NAN;
        if (image->linear != NULL) {
            source->x_world = image->linear[0] + image->linear[1] * source->x + image->linear[2] * source->y;
            source->y_world = image->linear[3] + image->linear[4] * source->x + image->linear[5] * source->y;
        }
        if (image->wcs != NULL) {
            rx_wcs_matrix(image->wcs, source->x, source->y, source->world_matrix);
            source->north_j2000 = native_north(image, source);
        }
    }
    free(work);
    return RX_OK;
}
