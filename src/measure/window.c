/* Windowed measurements. */
#include "measure/view.h"

#include <math.h>

enum { MAX_STEPS = 16, OVERSAMPLING = 11 };
static const double EXTENT = 4.0; /* sigmas */
static const double STEP_FACTOR = 2.0;
static const double SMALL_STEP = 1e-4; /* pixels */
static const double PIXEL_VARIANCE = 0.0833;
static const double SINGULAR = 0.00694; /* pixel_variance^2 */

/* Weighted sums about the current centre. */
typedef struct window_sums {
    double flux, x, y, x2, y2, xy; /* sum w I, sum w I dx, ... */
    double error, ex2, ey2, exy;   /* sum w^2 variance, ... */
} window_sums;

static double pixel_variance(const rx_view *view, double value, double variance)
{
    const rx_image *image = view->image;
    if (image->gain > 0.0 && value > 0.0) {
        double photons = value / image->gain;
        if (image->variable_noise && view->weight_gain)
            photons *= variance / (image->global_noise * image->global_noise);
        return photons;
    }
    return 0.0;
}

/* The first three alone, or all. */
static inline window_sums sum_window(const rx_view *view, double cx, double cy, double sigma, double law,
                                     bool all, bool *truncated)
{
    window_sums sums = {0};
    double radius = EXTENT * sigma;
    float limit2 = (float)((radius + 0.75) * (radius + 0.75)), fall = (float)(1.0 / (2.0 * sigma * sigma));
    rx_box box;
    if (rx_view_circle_box(view, cx, cy, radius, &box))
        *truncated = true;
    for (int v = box.y0; v < box.y1; v++)
        for (int u = box.x0; u < box.x1; u++) {
            float fx = (float)(u - cx), fy = (float)(v - cy), r2 = fx * fx + fy * fy;
            if (r2 >= limit2)
                continue;
            double value, variance;
            rx_view_pixel(view, u, v, cx, cy, &value, &variance);
            double w = rx_pixel_in_circle(fx, fy, (float)radius, OVERSAMPLING) * expf(-r2 * fall);
            double dx = u - cx, dy = v - cy, flux = w * value;
            sums.flux += flux;
            sums.x += flux * dx;
            sums.y += flux * dy;
            if (!all)
                continue;
            double error = w * w * (variance * law * law + pixel_variance(view, value, variance));
            sums.x2 += flux * dx * dx;
            sums.y2 += flux * dy * dy;
            sums.xy += flux * dx * dy;
            sums.error += error;
            sums.ex2 += error * (dx * dx + PIXEL_VARIANCE);
            sums.ey2 += error * (dy * dy + PIXEL_VARIANCE);
            sums.exy += error * dx * dy;
        }
    return sums;
}

static void revert_to_isophotal(rx_source *s)
{
    s->xwin = s->x;
    s->ywin = s->y;
    s->x2win = s->x2;
    s->y2win = s->y2;
    s->xywin = s->xy;
    s->errx2win = s->errx2;
    s->erry2win = s->erry2;
    s->errxywin = s->errxy;
    s->awin = s->a;
    s->bwin = s->b;
    s->thetawin = s->theta;
    s->cxxwin = s->cxx;
    s->cyywin = s->cyy;
    s->cxywin = s->cxy;
    s->flags_measure |= RX_FLAGM_WIN_FAILED;
}

/* Ellipse of the windowed moments; a pixel's own width is added where they are singular. */
static void set_window_ellipse(double x2, double y2, double xy, rx_source *s)
{
    double det = x2 * y2 - xy * xy;
    if (det < SINGULAR) {
        x2 += 1.0 / 12.0;
        y2 += 1.0 / 12.0;
        det = x2 * y2 - xy * xy;
    }
    double difference = x2 - y2, mean = 0.5 * (x2 + y2);
    double split = sqrt(0.25 * difference * difference + xy * xy);
    s->x2win = x2;
    s->y2win = y2;
    s->xywin = xy;
    s->awin = sqrt(mean + split);
    s->bwin = sqrt(fmax(mean - split, 0.0));
    s->thetawin = difference != 0.0 ? 0.5 * atan2(2.0 * xy, difference) : 0.25 * M_PI;
    s->cxxwin = y2 / det;
    s->cyywin = x2 / det;
    s->cxywin = -2.0 * xy / det;
}

static void set_window_errors(const window_sums *sums, rx_source *s)
{
    double norm = STEP_FACTOR * STEP_FACTOR / (sums->flux * sums->flux);
    double ex2 = sums->ex2 * norm, ey2 = sums->ey2 * norm, exy = sums->exy * norm;
    double floor = sums->error * PIXEL_VARIANCE * norm;
    if ((s->flags_measure & RX_FLAGM_SINGULAR) != 0 && ex2 * ey2 - exy * exy < floor * floor) {
        ex2 += floor;
        ey2 += floor;
    }
    s->errx2win = ex2;
    s->erry2win = ey2;
    s->errxywin = exy;
}

void rx_measure_window(const rx_view *view, double half_light, rx_source *s)
{
    double sigma = half_light * 2.0 / 2.35, cx = s->x, cy = s->y, dx = 0.0, dy = 0.0, at[2] = {cx, cy};
    /* effective area (sum w)^2 / sum w^2 of a Gaussian */
    double law = rx_view_noise_factor(view, 4.0 * M_PI * sigma * sigma);
    bool truncated = false;
    int step = 0;
    for (; step < MAX_STEPS; step++) {
        at[0] = cx;
        at[1] = cy;
        const window_sums sums = sum_window(view, cx, cy, sigma, law, false, &truncated);
        if (!(sums.flux > 0.0))
            break;
        dx = sums.x / sums.flux;
        dy = sums.y / sums.flux;
        cx += dx * STEP_FACTOR;
        cy += dy * STEP_FACTOR;
        if (dx * dx + dy * dy < SMALL_STEP * SMALL_STEP)
            break;
        if (!(fabs(cx) < 1e6 && fabs(cy) < 1e6))
            break; /* far off the image, and an int box could not hold it */
    }
    const window_sums sums = sum_window(view, at[0], at[1], sigma, law, true, &truncated);
    if (truncated)
        s->flags |= RX_FLAG_APERTURE;
    double x2 = sums.x2 / sums.flux - dx * dx, y2 = sums.y2 / sums.flux - dy * dy;
    double xy = sums.xy / sums.flux - dx * dy;
    s->niter_win = step + 1;
    s->flux_win = sums.flux;
    s->fluxerr_win = sqrt(sums.error);
    s->snr_win = sums.error > 0.0 ? s->flux_win / s->fluxerr_win : 0.0;
    s->xwin = cx;
    s->ywin = cy;
    s->flags_win = sums.flux <= 0.0 ? RX_FLAGWIN_FLUX
                                    : (x2 < 0.0 || y2 < 0.0 ? RX_FLAGWIN_VARIANCE : 0) |
                                          (x2 * y2 - xy * xy < 0.0 ? RX_FLAGWIN_SINGULAR : 0);
    dx = cx - s->x;
    dy = cy - s->y;
    if (dx * dx > 1.0 && dy * dy > 1.0 && s->cxx * dx * dx + s->cyy * dy * dy + s->cxy * dx * dy > 1.0)
        s->flags_win |= RX_FLAGWIN_AWAY;
    if (!isfinite(cx) || !isfinite(cy))
        s->flags_win |= RX_FLAGWIN_FLUX;
    if (s->flags_win != 0) {
        revert_to_isophotal(s);
        return;
    }
    set_window_errors(&sums, s);
    set_window_ellipse(x2, y2, xy, s);
}
