/* Growth curve in 64 rings out to 6 A, as SExtractor's: rim pixels in 5 x 5 samples. */
#include "measure/growth.h"

#include <math.h>

enum { RINGS = 64, OVERSAMPLING = 5 };
static const double EXTENT = 6.0;         /* A's */
static const double MARGIN = 1.5;         /* pixels beyond the last ring that still reach into it */
static const double MIN_HALF_LIGHT = 0.5; /* pixels */

/* Spread a pixel over the rings it touches. */
static void add_to_rings(double *rings, double value, double dx, double dy, double per_pixel)
{
    double step = 1.0 / OVERSAMPLING, start = 0.5 * (step - 1.0);
    for (int j = 0; j < OVERSAMPLING; j++) {
        double v = dy + start + j * step;
        for (int i = 0; i < OVERSAMPLING; i++) {
            double u = dx + start + i * step;
            double ring = sqrt(u * u + v * v) * per_pixel;
            if (ring < RINGS)
                rings[(int)ring] += value * step * step;
        }
    }
}

/* Cumulated flux in RINGS rings out to `limit` pixels. */
static void grow(const rx_view *view, rx_source *s, double limit, double *curve)
{
    double reach = limit + MARGIN, width = limit / RINGS;
    rx_box box;
    if (rx_view_circle_box(view, s->x, s->y, reach, &box))
        s->flags |= RX_FLAG_APERTURE;
    for (int v = box.y0; v < box.y1; v++)
        for (int u = box.x0; u < box.x1; u++) {
            double dx = u - s->x, dy = v - s->y, r = sqrt(dx * dx + dy * dy);
            if (r >= reach)
                continue;
            double value, variance;
            rx_view_pixel(view, u, v, s->x, s->y, &value, &variance);
            double within = fmod(r, width);
            if (within < 0.75 || within > width - 0.75)
                add_to_rings(curve, value, dx, dy, RINGS / limit);
            else if (r < limit)
                curve[(int)(r * RINGS / limit)] += value;
        }
    for (int i = 1; i < RINGS; i++)
        curve[i] += curve[i - 1];
}

/* Radius where the curve reaches `flux`, linear between rings. */
static double radius_of(const double *curve, double flux, double limit)
{
    int i = 0;
    while (i < RINGS - 1 && curve[i] < flux)
        i++;
    double rings;
    if (i == 0)
        rings = curve[0] != 0.0 ? flux / curve[0] : 0.0;
    else {
        double rise = curve[i] - curve[i - 1];
        rings = rise != 0.0 ? i + (flux - curve[i - 1]) / rise : i;
    }
    return fmin(rings * limit / RINGS, limit);
}

double rx_measure_radii(const rx_view *view, const rx_measure_params *par, rx_source *s)
{
    double curve[RINGS] = {0};
    double limit = fmax(EXTENT * s->a, par->auto_aper_min);
    grow(view, s, limit, curve);
    for (int i = 0; i < par->nradii; i++)
        s->flux_radius[i] = radius_of(curve, par->flux_fraction[i] * s->flux_auto, limit);
    if (!(s->flux_auto > 0.0))
        s->flags_measure |= RX_FLAGM_RADIUS_FAILED;
    double half = fmin(fabs(radius_of(curve, 0.5 * s->flux_auto, limit)), limit);
    return fmax(half, MIN_HALF_LIGHT);
}
