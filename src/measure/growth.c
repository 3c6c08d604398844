/* Growth curve in 64 rings out to 6 A, as SExtractor's: rim pixels in 5 x 5 samples. */
#include "measure/view.h"

#include <math.h>
#include <stdint.h>

#include "base/simd.h"

/* ROOM: for the samples of a pixel, whole vectors of them. */
enum { RINGS = 64, SAMPLES = 25, ROOM = 28 };
static const double EXTENT = 6.0;         /* A's */
static const double MARGIN = 1.5;         /* pixels beyond the last ring that still reach into it */
static const double RIM = 0.75;           /* pixels from it */
static const double MIN_HALF_LIGHT = 0.5; /* pixels */

/* Where in a pixel the samples are; the last ones fill up a vector and are in no ring. */
#define NOWHERE 1e100
#define ROW(y) (y), (y), (y), (y), (y)
#define COLUMNS -0.4, -0.2, 0.0, 0.2, 0.4
static const double SAMPLE_X[ROOM] = {COLUMNS, COLUMNS, COLUMNS, COLUMNS, COLUMNS, NOWHERE, NOWHERE, NOWHERE};
static const double SAMPLE_Y[ROOM] = {ROW(-0.4), ROW(-0.2), ROW(0.0), ROW(0.2), ROW(0.4), 0.0, 0.0, 0.0};
static const double OUTERMOST = 0.4;

static inline int64_t count_within(const double *distance2, double edge2)
{
    int64_t n = 0;
#pragma omp simd reduction(+ : n)
    for (int i = 0; i < ROOM; i++)
        n += distance2[i] < edge2;
    return n;
}

/* Spread a pixel over the rings it touches; edge2[i]: squared radius where ring i begins. The samples of each
 * ring are counted, which takes no root for any of them and adds to a ring once. */
RX_SIMD static void add_to_rings(const double *edge2, double *rings, double value, double dx, double dy,
                                 double per_pixel)
{
    const double share = value / SAMPLES, near_x = fmax(fabs(dx) - OUTERMOST, 0.0),
                 near_y = fmax(fabs(dy) - OUTERMOST, 0.0), far_x = fabs(dx) + OUTERMOST,
                 far_y = fabs(dy) + OUTERMOST;
    const double nearest = sqrt(near_x * near_x + near_y * near_y) * per_pixel,
                 farthest = sqrt(far_x * far_x + far_y * far_y) * per_pixel;
    if (!(nearest < RINGS))
        return;
    double distance2[ROOM];
#pragma omp simd
    for (int i = 0; i < ROOM; i++) {
        const double u = dx + SAMPLE_X[i], v = dy + SAMPLE_Y[i];
        distance2[i] = u * u + v * v;
    }
    const int first = (int)nearest, last = farthest < RINGS ? (int)farthest : RINGS - 1;
    int64_t within = 0;
    for (int ring = first; ring <= last; ring++) {
        const int64_t before = within;
        within = ring == last && farthest < RINGS ? SAMPLES : count_within(distance2, edge2[ring + 1]);
        rings[ring] += (double)(within - before) * share;
    }
}

/* Cumulated flux in the first n of RINGS rings out to `limit` pixels. */
static void grow(const rx_view *view, rx_source *s, double limit, int n, double *curve)
{
    const double width = limit / RINGS, per_pixel = RINGS / limit, reach = n * width + MARGIN;
    double edge2[RINGS + 1];
    for (int i = 0; i < RINGS; i++)
        curve[i] = 0.0;
    for (int i = 0; i <= RINGS; i++)
        edge2[i] = i * width * (i * width);
    rx_box box;
    rx_view_circle_box(view, s->x, s->y, reach, &box);
    for (int v = box.y0; v < box.y1; v++)
        for (int u = box.x0; u < box.x1; u++) {
            const double dx = u - s->x, dy = v - s->y, r = sqrt(dx * dx + dy * dy);
            if (r >= reach)
                continue;
            double value, variance;
            rx_view_pixel(view, u, v, s->x, s->y, &value, &variance);
            /* in narrow rings every pixel is at a rim */
            const double within = width > 2.0 * RIM ? fmod(r, width) : 0.0;
            if (within < RIM || within > width - RIM)
                add_to_rings(edge2, curve, value, dx, dy, per_pixel);
            else if (r < limit)
                curve[(int)(r * per_pixel)] += value;
        }
    for (int i = 1; i < n; i++)
        curve[i] += curve[i - 1];
}

/* The first of n rings where the curve reaches `flux`; n: in none. */
static int ring_of(const double *curve, int n, double flux)
{
    int i = 0;
    while (i < n && curve[i] < flux)
        i++;
    return i;
}

/* Radius where the curve reaches `flux`, linear between rings. */
static double radius_of(const double *curve, double flux, double limit)
{
    const int i = ring_of(curve, RINGS - 1, flux);
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
    enum { FEW = RINGS / 4 };
    double curve[RINGS], most = 0.5 * s->flux_auto;
    const double limit = fmax(EXTENT * s->a, par->auto_aper_min);
    rx_box box;
    if (rx_view_circle_box(view, s->x, s->y, limit + MARGIN, &box))
        s->flags |= RX_FLAG_APERTURE;
    for (int i = 0; i < par->nradii; i++)
        most = fmax(most, par->flux_fraction[i] * s->flux_auto);
    /* light is mostly within the first rings: the others are looked at where it is not */
    for (int n = FEW, reached = 0; n <= RINGS && !reached; n *= 2) {
        grow(view, s, limit, n, curve);
        reached = ring_of(curve, n, most) < n;
    }
    for (int i = 0; i < par->nradii; i++)
        s->flux_radius[i] = radius_of(curve, par->flux_fraction[i] * s->flux_auto, limit);
    if (!(s->flux_auto > 0.0))
        s->flags_measure |= RX_FLAGM_RADIUS_FAILED;
    double half = fmin(fabs(radius_of(curve, 0.5 * s->flux_auto, limit)), limit);
    return fmax(half, MIN_HALF_LIGHT);
}
