/* Growth curve in 64 rings out to 6 A, as SExtractor's: rim pixels in 5 x 5 samples. */
#include "measure/growth.h"

#include <math.h>
#include <stdint.h>

#include "base/wide.h"

/* ROOM: for the samples of a pixel, whole vectors of them. */
enum { RINGS = 64, OVERSAMPLING = 5, SAMPLES = OVERSAMPLING * OVERSAMPLING, ROOM = 28 };
static const double EXTENT = 6.0;         /* A's */
static const double MARGIN = 1.5;         /* pixels beyond the last ring that still reach into it */
static const double RIM = 0.75;           /* pixels from it */
static const double MIN_HALF_LIGHT = 0.5; /* pixels */

/* Squared distances of the samples of a pixel from the centre, by row; filled up with some that are in no
 * ring. */
typedef struct samples {
    double distance2[ROOM];
    double nearest2, farthest2;
} samples;

static inline void place_samples(double dx, double dy, samples *dst)
{
    const double step = 1.0 / OVERSAMPLING, start = 0.5 * (step - 1.0);
    double u2[OVERSAMPLING], v2[OVERSAMPLING], near_u = HUGE_VAL, near_v = HUGE_VAL, far_u = 0.0, far_v = 0.0;
    for (int i = 0; i < OVERSAMPLING; i++) {
        const double u = dx + start + i * step, v = dy + start + i * step;
        u2[i] = u * u;
        v2[i] = v * v;
        near_u = u2[i] < near_u ? u2[i] : near_u;
        near_v = v2[i] < near_v ? v2[i] : near_v;
        far_u = u2[i] > far_u ? u2[i] : far_u;
        far_v = v2[i] > far_v ? v2[i] : far_v;
    }
    for (int j = 0; j < OVERSAMPLING; j++)
        for (int i = 0; i < OVERSAMPLING; i++)
            dst->distance2[j * OVERSAMPLING + i] = u2[i] + v2[j];
    for (int i = SAMPLES; i < ROOM; i++)
        dst->distance2[i] = HUGE_VAL;
    dst->nearest2 = near_u + near_v;
    dst->farthest2 = far_u + far_v;
}

static inline int64_t count_within(const samples *pixel, double edge2)
{
    int64_t n = 0;
#pragma omp simd reduction(+ : n)
    for (int i = 0; i < ROOM; i++)
        n += pixel->distance2[i] < edge2;
    return n;
}

/* Spread a pixel over the rings it touches; edge2[i]: squared radius where ring i begins. The samples of each
 * ring are counted, which takes no root for any of them and adds to a ring once. */
RX_WIDE static void add_to_rings(const double *edge2, double *rings, double value, double dx, double dy,
                                 double per_pixel)
{
    const double share = value / SAMPLES;
    samples pixel;
    place_samples(dx, dy, &pixel);
    const double nearest = sqrt(pixel.nearest2) * per_pixel, farthest = sqrt(pixel.farthest2) * per_pixel;
    if (!(nearest < RINGS))
        return;
    const int first = (int)nearest, last = farthest < RINGS ? (int)farthest : RINGS - 1;
    int64_t within = 0;
    for (int ring = first; ring <= last; ring++) {
        const int64_t before = within;
        within = ring == last && farthest < RINGS ? SAMPLES : count_within(&pixel, edge2[ring + 1]);
        rings[ring] += (double)(within - before) * share;
    }
}

/* Cumulated flux in RINGS rings out to `limit` pixels. */
static void grow(const rx_view *view, rx_source *s, double limit, double *curve)
{
    const double reach = limit + MARGIN, width = limit / RINGS, per_pixel = RINGS / limit;
    double edge2[RINGS + 1];
    for (int i = 0; i <= RINGS; i++)
        edge2[i] = i * width * (i * width);
    rx_box box;
    if (rx_view_circle_box(view, s->x, s->y, reach, &box))
        s->flags |= RX_FLAG_APERTURE;
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
