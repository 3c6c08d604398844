/* Sums in circles and ellipses. Positions are floats where SExtractor's are, so that the same
 * pixels fall inside. */
#include "measure/view.h"

#include <math.h>

#include "base/simd.h"

static const float KRON_EXTENT = 6.0f;   /* rms ellipses searched for the Kron and Petrosian radii */
static const double CROWDED_SHARE = 0.1; /* of hidden pixels from which a source counts as crowded */
static const double PETROSIAN_RATIO = 0.2;
enum { RIM_OVERSAMPLING = 5, PETROSIAN_STEPS = 20 };

/* An ellipse cxx dx^2 + cyy dy^2 + cxy dx dy <= r^2 in SExtractor's sense: whole pixels. */
typedef struct ellipse {
    float x, y, cxx, cyy, cxy, r;
} ellipse;

/* How many of the n^2 points of a pixel are within the circle. A line has room for MOST, so that all its points are compared at once. */
RX_SIMD static int points_inside(float dx, float dy, float r2, int n)
{
    enum { MOST = 16 };
    const float step = 1.0f / (float)n, start = 0.5f * (step - 1.0f);
    float u = dx + start, v = dy + start, u2[MOST];
    int inside = 0;
    for (int i = 0; i < MOST; i++, u += step)
        u2[i] = i < n ? u * u : INFINITY;
    for (int j = 0; j < n; j++, v += step) {
        const float v2 = v * v;
#pragma omp simd reduction(+ : inside)
        for (int i = 0; i < MOST; i++)
            inside += u2[i] + v2 < r2;
    }
    return inside;
}

double rx_pixel_in_circle(float dx, float dy, float radius, int oversampling)
{
    float r2 = dx * dx + dy * dy;
    float inner = radius - 0.75f, outer = radius + 0.75f; /* half a pixel's diagonal, and some */
    if (r2 >= outer * outer)
        return 0.0;
    if (inner > 0.0f && r2 <= inner * inner)
        return 1.0;
    return (double)points_inside(dx, dy, radius * radius, oversampling) / (oversampling * oversampling);
}

/* A sum about (x, y) that is not finished. */
typedef struct running {
    const rx_view *view;
    double x, y;
    double photon_variance;
    rx_sum *sum;
} running;

/* Add a pixel with its share. */
static void add_pixel(running *of, int x, int y, double share)
{
    const rx_view *view = of->view;
    const rx_image *image = view->image;
    rx_sum *sum = of->sum;
    double value, variance;
    rx_seen state = rx_view_pixel(view, x, y, of->x, of->y, &value, &variance);
    sum->pixels++;
    sum->hidden += state != RX_SEEN_GOOD;
    sum->masked += state == RX_SEEN_MASKED;
    sum->area += share;
    sum->flux += share * value;
    sum->error += share * variance;
    if (image->variable_noise && view->weight_gain && value > 0.0 && image->gain > 0.0)
        of->photon_variance += value / image->gain * variance / (image->global_noise * image->global_noise);
}

static void finish_sum(const running *of)
{
    const rx_view *view = of->view;
    const rx_image *image = view->image;
    rx_sum *sum = of->sum;
    double photon_variance = of->photon_variance;
    double factor = rx_view_noise_factor(view, sum->area);
    sum->flux -= sum->area * view->sky;
    if (!(image->variable_noise && view->weight_gain) && image->gain > 0.0 && sum->flux > 0.0)
        photon_variance = sum->flux / image->gain;
    sum->error = sqrt(sum->error * factor * factor + photon_variance);
}

void rx_sum_circle(const rx_view *view, double x, double y, double radius, rx_sum *sum)
{
    float cx = (float)x, cy = (float)y, r = (float)radius;
    running of = {.view = view, .x = cx, .y = cy, .sum = sum};
    rx_box box;
    *sum = (rx_sum){.truncated = rx_view_circle_box(view, cx, cy, r, &box)};
    for (int v = box.y0; v < box.y1; v++)
        for (int u = box.x0; u < box.x1; u++) {
            double share = rx_pixel_in_circle((float)u - cx, (float)v - cy, r, RIM_OVERSAMPLING);
            if (share > 0.0)
                add_pixel(&of, u, v, share);
        }
    finish_sum(&of);
}

static float ellipse_radius2(const ellipse *e, float dx, float dy)
{
    return e->cxx * dx * dx + e->cyy * dy * dy + e->cxy * dx * dy;
}

/* Bounding box of an ellipse, clipped; true when it leaves the image. */
static bool ellipse_box(const rx_view *view, const ellipse *e, rx_box *box)
{
    float width = e->cxx - e->cxy * e->cxy / (4.0f * e->cyy);
    float height = e->cyy - e->cxy * e->cxy / (4.0f * e->cxx);
    /* never beyond what an int can hold, nor NaN: the image is smaller than that */
    float limit = 4.0f * (float)(view->image->width + view->image->height);
    width = width > 0.0f ? fminf(e->r / sqrtf(width), limit) : 0.0f;
    height = height > 0.0f ? fminf(e->r / sqrtf(height), limit) : 0.0f;
    *box = (rx_box){(int)floor(e->x - width + 0.5), (int)floor(e->x + width + 0.5) + 1,
                    (int)floor(e->y - height + 0.5), (int)floor(e->y + height + 0.5) + 1};
    return rx_view_clip(view, box);
}

/* Sum over it, hidden pixels as the view says. */
static void sum_ellipse(const rx_view *view, const ellipse *e, rx_sum *sum)
{
    rx_box box;
    running of = {.view = view, .x = e->x, .y = e->y, .sum = sum};
    float r2 = e->r * e->r;
    *sum = (rx_sum){.truncated = ellipse_box(view, e, &box)};
    for (int v = box.y0; v < box.y1; v++)
        for (int u = box.x0; u < box.x1; u++)
            if (ellipse_radius2(e, (float)u - e->x, (float)v - e->y) <= r2)
                add_pixel(&of, u, v, 1.0);
    finish_sum(&of);
}

/* The source's ellipse scaled by `factor`, or a circle of `diameter` where that is larger. */
static ellipse source_ellipse(const rx_source *s, double factor, double diameter, bool *circle)
{
    *circle = !(factor * sqrt(s->a * s->b) > diameter / 2.0);
    if (*circle)
        return (ellipse){(float)s->x, (float)s->y, 1.0f, 1.0f, 0.0f, (float)(diameter / 2.0)};
    return (ellipse){(float)s->x, (float)s->y, (float)s->cxx, (float)s->cyy, (float)s->cxy, (float)factor};
}

/* Share of hidden pixels in the searched ellipse, and the first moment of the radius over good ones. */
static double kron_moment(const rx_view *view, const ellipse *e, rx_sum *seen)
{
    rx_box box;
    double moment = 0.0, total = 0.0;
    float r2limit = e->r * e->r;
    *seen = (rx_sum){.truncated = ellipse_box(view, e, &box)};
    for (int v = box.y0; v < box.y1; v++)
        for (int u = box.x0; u < box.x1; u++) {
            float r2 = ellipse_radius2(e, (float)u - e->x, (float)v - e->y);
            if (r2 > r2limit)
                continue;
            seen->pixels++;
            if (rx_view_state(view, u, v) != RX_SEEN_GOOD) {
                seen->hidden++;
                continue;
            }
            double value = rx_view_value(view->image, (size_t)v * (size_t)view->image->width + (size_t)u);
            moment += sqrt(r2) * value;
            total += value;
        }
    return moment > 0.0 && total > 0.0 ? moment / total : 0.0;
}

static void flag_sum(const rx_sum *sum, rx_source *s)
{
    if (sum->truncated)
        s->flags |= RX_FLAG_APERTURE;
    if (sum->hidden > CROWDED_SHARE * sum->pixels)
        s->flags |= RX_FLAG_CROWDED;
}

/* The same source on the image that radii are taken from. */
static rx_view radii_view(const rx_view *view)
{
    rx_view other = *view;
    other.image = view->radii;
    return other;
}

void rx_measure_auto(const rx_view *view, const rx_measure_params *par, rx_source *s)
{
    bool circle;
    rx_sum sum;
    rx_view shape = radii_view(view);
    ellipse search = source_ellipse(s, KRON_EXTENT, par->auto_aper_min, &circle);
    double moment = kron_moment(&shape, &search, &sum);
    flag_sum(&sum, s);
    if (moment <= 0.0)
        s->flags_measure |= RX_FLAGM_KRON_FAILED;
    double radius = fmax(par->auto_factor * moment, par->auto_min_radius);
    ellipse aperture = source_ellipse(s, radius, par->auto_aper_max, &circle);
    sum_ellipse(view, &aperture, &sum);
    flag_sum(&sum, s);
    s->flux_auto = sum.flux;
    s->fluxerr_auto = sum.error;
    s->kron_radius = circle || sum.flux <= 0.0 ? 0.0 : radius;
    s->masked_fraction = sum.pixels > 0 ? (double)sum.masked / sum.pixels : 0.0;
}

/* Mean surface brightness in an annulus and inside its middle, good pixels only. */
typedef struct petro_ring {
    double annulus, inside;
    int nannulus, ninside, pixels, hidden;
} petro_ring;

static petro_ring measure_ring(const rx_view *view, const ellipse *e, const rx_box *box, float rmin,
                               float rmax)
{
    petro_ring ring = {0};
    float rmid = (rmin + rmax) / 2.0f;
    for (int v = box->y0; v < box->y1; v++)
        for (int u = box->x0; u < box->x1; u++) {
            float r2 = ellipse_radius2(e, (float)u - e->x, (float)v - e->y);
            if (r2 > rmax * rmax)
                continue;
            ring.pixels++;
            if (rx_view_state(view, u, v) != RX_SEEN_GOOD) {
                ring.hidden++;
                continue;
            }
            double value = rx_view_value(view->image, (size_t)v * (size_t)view->image->width + (size_t)u);
            if (r2 >= rmin * rmin) {
                ring.annulus += value;
                ring.nannulus++;
            }
            if (r2 < rmid * rmid) {
                ring.inside += value;
                ring.ninside++;
            }
        }
    if (ring.nannulus > 0 && ring.ninside > 0) {
        ring.annulus /= ring.nannulus;
        ring.inside /= ring.ninside;
    }
    return ring;
}

/* Petrosian radius in units of the ellipse; 0 when there is none. */
static double petro_search(const rx_view *view, const ellipse *e, rx_source *s)
{
    rx_box box;
    petro_ring ring = {0};
    float middle = 0.0f, step = e->r / PETROSIAN_STEPS;
    if (ellipse_box(view, e, &box))
        s->flags |= RX_FLAG_APERTURE;
    for (float rmin = step; rmin * 1.2f < e->r; rmin += step) {
        float rmax = rmin * 1.2f;
        middle = (rmin + rmax) / 2.0f;
        ring = measure_ring(view, e, &box, rmin, rmax);
        if (ring.nannulus > 0 && ring.ninside > 0 && ring.annulus < ring.inside * PETROSIAN_RATIO)
            break;
    }
    if (ring.hidden > CROWDED_SHARE * ring.pixels)
        s->flags |= RX_FLAG_CROWDED;
    return ring.nannulus > 0 && ring.ninside > 0 && ring.annulus != 0.0 && ring.inside != 0.0 ? middle : 0.0;
}

void rx_measure_petro(const rx_view *view, const rx_measure_params *par, rx_source *s)
{
    bool circle;
    rx_sum sum;
    rx_view shape = radii_view(view);
    ellipse search = source_ellipse(s, KRON_EXTENT, par->auto_aper_min, &circle);
    double radius = fmax(par->petro_factor * petro_search(&shape, &search, s), par->petro_min_radius);
    ellipse aperture = source_ellipse(s, radius, par->auto_aper_max, &circle);
    sum_ellipse(view, &aperture, &sum);
    flag_sum(&sum, s);
    s->flux_petro = sum.flux;
    s->fluxerr_petro = sum.error;
    s->petro_radius = circle || sum.flux <= 0.0 ? 0.0 : radius;
}
