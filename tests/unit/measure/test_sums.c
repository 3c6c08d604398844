/* Every number of a source against the plain sum over pixels that defines it: an elliptical Gaussian on noise, a
 * noise map, masked pixels, a neighbour, photons, a noise law. */
#include <unistd.h>

#include "../detect/field.h"
#include "../files.h"
#include "../near.h"
#include "measure/measure.h"
#include "measure/starclass.h"
#include "measure/view.h"
#include "num/stats.h"

enum { W = 110, H = 100, OWN = 1, OTHER = 2, RINGS = 64 };
static const double PI = 3.14159265358979323846;
static const double X = 51.317, Y = 47.841, A = 4.0, B = 2.5, ANGLE = 0.4;
static const double GAIN = 3.0, GLOBAL = 1.5, THRESHOLD = 12.0, LAW_SCALE = 1.3, LAW_POWER = 0.6;

typedef struct scene {
    field f;
    rx_sources *sources;
    rx_source *s;
    rx_image image;
    rx_noise_law law;
    rx_measure_params par;
} scene;

static void open_scene(scene *t)
{
    *t = (scene){.f = field_new(W, H, 1.0, 5), .sources = RX_NEW(rx_sources, 1)};
    const double c = cos(ANGLE), s = sin(ANGLE);
    rx_sources *list = t->sources;
    list->n = 1;
    list->width = W;
    list->height = H;
    list->list = t->s = RX_NEW(rx_source, 1);
    list->segments = RX_NEW(int32_t, t->f.n);
    *t->s = (rx_source){.segment = OWN,
                        .xmin = W,
                        .ymin = H,
                        .x = X,
                        .y = Y,
                        .a = A,
                        .b = B,
                        .cxx = c * c / (A * A) + s * s / (B * B),
                        .cyy = s * s / (A * A) + c * c / (B * B),
                        .cxy = 2.0 * c * s * (1.0 / (A * A) - 1.0 / (B * B)),
                        .threshold = THRESHOLD,
                        .analysis_threshold = THRESHOLD,
                        .errx2 = 1.0,
                        .erry2 = 1.0};
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const size_t k = (size_t)(y * W + x);
            const double u = (c * (x - X) + s * (y - Y)) / A, v = (c * (y - Y) - s * (x - X)) / B;
            t->f.pixels[k] += (float)(1e4 / (2.0 * PI * A * B) * exp(-0.5 * (u * u + v * v)));
            t->f.sigma[k] = (float)(1.0 + rx_random_uniform(3, 1, k));
            t->f.mask[k] = x == 53 && y >= 49 && y < 52;
            if (x >= 61 && x < 64 && y >= 40 && y < 46)
                list->segments[k] = OTHER;
            else if (t->f.pixels[k] > THRESHOLD && hypot(x - X, y - Y) < 20.0) {
                list->segments[k] = OWN;
                t->s->xmin = x < t->s->xmin ? x : t->s->xmin;
                t->s->xmax = x > t->s->xmax ? x : t->s->xmax;
                t->s->ymin = y < t->s->ymin ? y : t->s->ymin;
                t->s->ymax = y > t->s->ymax ? y : t->s->ymax;
                t->s->npix++;
            }
        }
    t->law = (rx_noise_law){.scale = LAW_SCALE, .power = LAW_POWER};
    t->image = (rx_image){.width = W,
                          .height = H,
                          .pixels = t->f.pixels,
                          .noise = rx_map_plane(t->f.sigma, W),
                          .variable_noise = 1,
                          .mask = t->f.mask,
                          .hide = 1,
                          .gain = GAIN,
                          .global_noise = GLOBAL,
                          .law = &t->law};
    t->par = (rx_measure_params){.naper = 2,
                                 .aperture_diameter = {7.3, 21.7},
                                 .auto_factor = 2.5,
                                 .auto_min_radius = 1.0,
                                 .petro_factor = 2.0,
                                 .petro_min_radius = 1.0,
                                 .nradii = 3,
                                 .flux_fraction = {0.02, 0.5, 0.8},
                                 .neighbours = RX_NEIGHBOURS_CORRECT,
                                 .nthreads = 1};
}

static void close_scene(scene *t)
{
    rx_sources_free(t->sources);
    field_free(&t->f);
}

/* 0: good, 1: masked, 2: a neighbour's. */
static int hidden(const scene *t, int x, int y)
{
    return t->f.mask[y * W + x] != 0 ? 1 : t->sources->segments[y * W + x] == OTHER ? 2 : 0;
}

/* A hidden pixel takes the value and noise of the one opposite. */
static void pixel(const scene *t, int x, int y, double cx, double cy, double *value, double *variance)
{
    const int u = hidden(t, x, y) ? (int)lround(2.0 * cx - x) : x,
              v = hidden(t, x, y) ? (int)lround(2.0 * cy - y) : y;
    *value = t->f.pixels[v * W + u];
    *variance = (double)t->f.sigma[v * W + u] * t->f.sigma[v * W + u];
}

static double law(double area)
{
    return LAW_SCALE * pow(area, LAW_POWER - 0.5);
}

static double error_of(double variance, double area, double flux)
{
    return sqrt(variance * law(area) * law(area) + flux / GAIN);
}

/* Share of n x n points of a pixel inside a circle; all or nothing far from the rim. */
static double share_of(double dx, double dy, double radius, int n)
{
    int inside = 0;
    for (int i = 0; i < n * n; i++)
        inside += hypot(dx + (i % n + 0.5) / n - 0.5, dy + (i / n + 0.5) / n - 0.5) < radius;
    return (double)inside / (n * n);
}

static double ellipse_radius(const rx_source *s, int x, int y)
{
    const double dx = x - s->x, dy = y - s->y;
    return sqrt(s->cxx * dx * dx + s->cyy * dy * dy + s->cxy * dx * dy);
}

static void apertures_are_sums_of_shares(void **state)
{
    scene t;
    open_scene(&t);
    for (int weight_gain = 0; weight_gain < 2; weight_gain++) {
        t.par.weight_gain = weight_gain;
        assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
        for (int i = 0; i < 2; i++) {
            double flux = 0.0, variance = 0.0, area = 0.0, photons = 0.0;
            for (int y = 0; y < H; y++)
                for (int x = 0; x < W; x++) {
                    const double share = share_of(x - X, y - Y, t.par.aperture_diameter[i] / 2.0, 5);
                    double value, noise2;
                    if (share == 0.0)
                        continue;
                    pixel(&t, x, y, X, Y, &value, &noise2);
                    flux += share * value;
                    variance += share * noise2;
                    area += share;
                    /* SExtractor takes rim pixels whole here */
                    photons += value > 0.0 ? value / GAIN * noise2 / (GLOBAL * GLOBAL) : 0.0;
                }
            assert_near(t.s->flux_aper[i], flux, 1e-6 * flux);
            const double error = weight_gain ? sqrt(variance * law(area) * law(area) + photons)
                                             : error_of(variance, area, flux);
            assert_near(t.s->fluxerr_aper[i], error, 1e-6 * error);
        }
    }
    close_scene(&t);
}

/* Sum of whole pixels within `radius` of the ellipse. */
static double sum_ellipse(const scene *t, double radius, double *error, double *masked)
{
    double flux = 0.0, variance = 0.0, area = 0.0, n = 0.0;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            double value, noise2;
            if (ellipse_radius(t->s, x, y) > radius)
                continue;
            pixel(t, x, y, X, Y, &value, &noise2);
            flux += value;
            variance += noise2;
            area++;
            n += hidden(t, x, y) == 1;
        }
    *error = error_of(variance, area, flux);
    *masked = n / area;
    return flux;
}

/* Means of the ring of a step, and of the disc to its middle. */
static void ring_and_disc(const scene *t, int step, double *ring, double *disc)
{
    const double low = 0.3 * step, high = 1.2 * low;
    double nring = 0.0, ndisc = 0.0;
    *ring = *disc = 0.0;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const double r = ellipse_radius(t->s, x, y);
            if (hidden(t, x, y))
                continue;
            *ring += r >= low && r <= high ? t->f.pixels[y * W + x] : 0.0;
            nring += r >= low && r <= high;
            *disc += r < 1.1 * low ? t->f.pixels[y * W + x] : 0.0;
            ndisc += r < 1.1 * low;
        }
    *ring /= nring;
    *disc /= ndisc;
}

/* The first step whose ring is fainter than a fifth of its disc. */
static int petrosian_step(const scene *t)
{
    double ring = 1.0, disc = 0.0;
    int step = 0;
    while (ring >= 0.2 * disc)
        ring_and_disc(t, ++step, &ring, &disc);
    return step;
}

/* The ring of one step is set a little above and a little below a fifth of its disc. */
static void petrosian_radius_follows_the_ring(void **state)
{
    scene t;
    open_scene(&t);
    const int at = petrosian_step(&t) - 1;
    for (int side = -1; side <= 1; side += 2) {
        double ring, disc;
        int changed = 0, held = 0;
        ring_and_disc(&t, at, &ring, &disc);
        for (int pass = 0; pass < 2; pass++)
            for (int y = 0; y < H; y++)
                for (int x = 0; x < W; x++) {
                    const double r = ellipse_radius(t.s, x, y) / (0.3 * at);
                    if (hidden(&t, x, y) || r < 1.0 || r > 1.2)
                        continue;
                    held += pass == 0;
                    changed += pass == 0 && r > 1.1; /* in the ring, not in the disc */
                    if (pass == 1 && r > 1.1)
                        t.f.pixels[y * W + x] +=
                            (float)((0.2 * disc * (1.0 + 4e-4 * side) - ring) * held / changed);
                }
        const int step = petrosian_step(&t);
        assert_int_equal(step, side < 0 ? at : at + 1);
        assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
        assert_near(t.s->petro_radius, 2.0 * 1.1 * 0.3 * step, 1e-5);
    }
    close_scene(&t);
}

static void kron_and_petrosian_radii_are_moments_and_rings(void **state)
{
    scene t;
    open_scene(&t);
    assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
    double moment = 0.0, total = 0.0, error, masked;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            if (ellipse_radius(t.s, x, y) <= 6.0 && !hidden(&t, x, y)) {
                moment += ellipse_radius(t.s, x, y) * t.f.pixels[y * W + x];
                total += t.f.pixels[y * W + x];
            }
    const double kron = 2.5 * moment / total;
    assert_near(t.s->kron_radius, kron, 1e-6 * kron);
    const double flux = sum_ellipse(&t, kron, &error, &masked);
    assert_near(t.s->flux_auto, flux, 1e-6 * flux);
    assert_near(t.s->fluxerr_auto, error, 1e-6 * error);
    assert_true(masked > 0.0);
    assert_near(t.s->masked_fraction, masked, 1e-12);

    const double petrosian = 1.1 * 0.3 * petrosian_step(&t);
    assert_near(t.s->petro_radius, 2.0 * petrosian, 1e-5);
    const double petro = sum_ellipse(&t, 2.0 * petrosian, &error, &masked);
    assert_near(t.s->flux_petro, petro, 1e-6 * petro);
    assert_near(t.s->fluxerr_petro, error, 1e-6 * error);
    close_scene(&t);
}

/* Radius at which samples of 1/25 pixel, counted in 64 rings out to 6 A, hold `wanted`. */
static double growth_radius(const scene *t, double wanted)
{
    double rings[RINGS + 1] = {0}, limit = 6.0 * A;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            double value, noise2;
            if (hypot(x - X, y - Y) > limit + 2.0)
                continue;
            pixel(t, x, y, X, Y, &value, &noise2);
            for (int i = 0; i < 25; i++) {
                const double r = hypot(x - X + (i % 5 - 2) / 5.0, y - Y + (i / 5 - 2) / 5.0);
                if (r < limit)
                    rings[1 + (int)(r / limit * RINGS)] += value / 25.0;
            }
        }
    for (int i = 1; i <= RINGS; i++) {
        if (rings[i - 1] + rings[i] >= wanted)
            /* a ring's flux lies at its outer rim */
            return limit / RINGS * (i == 1 ? wanted / rings[1] : i - 1 + (wanted - rings[i - 1]) / rings[i]);
        rings[i] += rings[i - 1];
    }
    return limit;
}

static void radii_and_window_follow_from_the_growth_curve(void **state)
{
    scene t;
    open_scene(&t);
    assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
    for (int i = 0; i < 3; i++) {
        const double r = growth_radius(&t, t.par.flux_fraction[i] * t.s->flux_auto);
        assert_near(t.s->flux_radius[i], r, 1e-6 * r);
    }
    const double sigma = 2.0 * t.s->flux_radius[1] / 2.35, reach = 4.0 * sigma;
    const double factor = law(4.0 * PI * sigma * sigma), pixel2 = 0.0833;
    double cx = X, cy = Y, dx = 1.0, dy = 1.0, flux = 0, x2 = 0, y2 = 0, xy = 0, error2 = 0, ex2 = 0, ey2 = 0,
           exy = 0;
    int steps = 0;
    while (hypot(dx, dy) >= 1e-4) {
        flux = dx = dy = x2 = y2 = xy = error2 = ex2 = ey2 = exy = 0.0;
        steps++;
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                const double u = x - cx, v = y - cy;
                double value, noise2;
                if (hypot(u, v) > reach + 0.75)
                    continue;
                pixel(&t, x, y, cx, cy, &value, &noise2);
                const double w = share_of(u, v, reach, 11) * exp(-0.5 * (u * u + v * v) / (sigma * sigma));
                const double e = w * w * (noise2 * factor * factor + fmax(value, 0.0) / GAIN);
                flux += w * value;
                dx += w * value * u;
                dy += w * value * v;
                x2 += w * value * u * u;
                y2 += w * value * v * v;
                xy += w * value * u * v;
                error2 += e;
                ex2 += e * (u * u + pixel2);
                ey2 += e * (v * v + pixel2);
                exy += e * u * v;
            }
        dx /= flux;
        dy /= flux;
        cx += 2.0 * dx;
        cy += 2.0 * dy;
    }
    x2 = x2 / flux - dx * dx;
    y2 = y2 / flux - dy * dy;
    xy = xy / flux - dx * dy;
    const double norm = 4.0 / (flux * flux), det = x2 * y2 - xy * xy;
    assert_int_equal(t.s->flags_win, 0);
    assert_int_equal(t.s->niter_win, steps);
    assert_near(t.s->xwin, cx, 1e-5);
    assert_near(t.s->ywin, cy, 1e-5);
    assert_near(t.s->flux_win, flux, 1e-5 * flux);
    assert_near(t.s->fluxerr_win, sqrt(error2), 1e-5 * sqrt(error2));
    assert_near(t.s->snr_win, flux / sqrt(error2), 1e-5 * flux / sqrt(error2));
    assert_near(t.s->x2win, x2, 1e-5 * x2);
    assert_near(t.s->y2win, y2, 1e-5 * y2);
    assert_near(t.s->xywin, xy, 1e-5 * xy);
    assert_near(t.s->errx2win, ex2 * norm, 1e-5 * ex2 * norm);
    assert_near(t.s->erry2win, ey2 * norm, 1e-5 * ey2 * norm);
    assert_near(t.s->errxywin, exy * norm, 1e-5 * sqrt(ex2 * ey2) * norm);
    /* the ellipse that has these moments */
    const double theta = t.s->thetawin, a2 = t.s->awin * t.s->awin, b2 = t.s->bwin * t.s->bwin;
    assert_near(a2 * cos(theta) * cos(theta) + b2 * sin(theta) * sin(theta), x2, 1e-5 * x2);
    assert_near(a2 * sin(theta) * sin(theta) + b2 * cos(theta) * cos(theta), y2, 1e-5 * y2);
    assert_near((a2 - b2) * sin(theta) * cos(theta), xy, 1e-5 * x2);
    assert_near(t.s->cxxwin, y2 / det, 1e-5 * y2 / det);
    assert_near(t.s->cyywin, x2 / det, 1e-5 * x2 / det);
    assert_near(t.s->cxywin, -2.0 * xy / det, 1e-5 * y2 / det);
    close_scene(&t);
}

/* Where the window holds no light the isophotal numbers stand in its place. */
static void a_dark_window_leaves_the_isophotal_numbers(void **state)
{
    scene t;
    open_scene(&t);
    for (size_t k = 0; k < t.f.n; k++)
        t.f.pixels[k] = -1.0f;
    t.s->x2 = 11.0;
    t.s->y2 = 12.0;
    t.s->xy = 1.5;
    t.s->errxy = 0.5;
    t.s->theta = 0.25;
    assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
    assert_int_equal(t.s->flags_win, 4);
    assert_true((t.s->flags_measure & RX_FLAGM_WIN_FAILED) != 0);
    const double window[] = {t.s->xwin,     t.s->ywin,     t.s->x2win,    t.s->y2win, t.s->xywin,
                             t.s->errx2win, t.s->erry2win, t.s->errxywin, t.s->awin,  t.s->bwin,
                             t.s->thetawin, t.s->cxxwin,   t.s->cyywin,   t.s->cxywin};
    const double isophotal[] = {X,   Y, 11.0, 12.0, 1.5,      1.0,      1.0,
                                0.5, A, B,    0.25, t.s->cxx, t.s->cyy, t.s->cxy};
    for (size_t i = 0; i < sizeof window / sizeof *window; i++)
        assert_near(window[i], isophotal[i], 0);
    assert_near(t.s->fwhm, 0.0, 0);
    close_scene(&t);
}

static void isophotal_numbers_are_sums_over_the_segment(void **state)
{
    scene t;
    open_scene(&t);
    t.par.analysis_threshold = 8.0;
    assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
    double flux = 0.0, variance = 0.0, npix = 0.0, peak = 0.0, lowest = 1e30;
    double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
    int above = 0, iso[RX_NISO] = {0};
    for (size_t k = 0; k < t.f.n; k++) {
        if (t.sources->segments[k] != OWN || t.f.mask[k] != 0)
            continue;
        npix++;
        flux += t.f.pixels[k];
        variance += (double)t.f.sigma[k] * t.f.sigma[k];
        above += t.f.pixels[k] > 8.0 * (double)t.f.sigma[k];
        lowest = fmin(lowest, 8.0 * (double)t.f.sigma[k]);
        peak = fmax(peak, t.f.pixels[k]);
    }
    for (size_t k = 0; k < t.f.n; k++) {
        const double value = t.f.pixels[k], w = value * value;
        if (t.sources->segments[k] != OWN || t.f.mask[k] != 0)
            continue;
        for (int i = 0; i < RX_NISO; i++)
            iso[i] += value > lowest * pow(peak / lowest, i / 8.0);
        if (value <= fmax(peak / 5.0, lowest))
            continue;
        const double r2 = pow((double)(k % W) - X, 2) + pow((double)(k / W) - Y, 2);
        n += w;
        sx += w * r2;
        sy += w * log(value);
        sxx += w * r2 * r2;
        sxy += w * r2 * log(value);
    }
    const double error = error_of(variance, npix, flux), slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    const double core = 1.6651 / sqrt(-slope); /* log I = c - 4 ln 2 r^2 / FWHM^2, digits of SExtractor */
    assert_near(t.s->flux_iso, flux, 1e-9 * flux);
    assert_near(t.s->fluxerr_iso, error, 1e-9 * error);
    assert_near(t.s->peak, peak, 0);
    assert_near(t.s->analysis_threshold, lowest, 1e-9);
    assert_int_equal(t.s->isoarea, above);
    assert_memory_equal(t.s->iso, iso, sizeof iso);
    assert_close(t.s->fwhm, core - 1.0 / (4.0 * core), 1e-6);
    /* Maddox et al. (1990) as SExtractor's manual has it */
    const double share = t.s->npix * THRESHOLD / flux, relative = error / flux;
    const double rise =
        (0.196099 + 2.0 * 0.751208 * share) * share * sqrt(relative * relative + 1.0 / t.s->npix);
    assert_near(t.s->flux_isocor, flux / (1.0 - 0.196099 * share - 0.751208 * share * share), 1e-9 * flux);
    assert_near(t.s->fluxerr_isocor, flux * hypot(relative, rise), 1e-9 * flux);
    close_scene(&t);
}

/* CLASS_STAR compares the peak with ANALYSIS_THRESH in sigmas of the image, or with its own number where
 * that is absolute: a network that looks at nothing else says which. */
static void class_star_takes_the_threshold_of_the_image(void **state)
{
    char path[512];
    new_file(path, "NNW\n2 10 1\n0 0 0 0 0 0 0 0 0 0\n1 1 1 1 1 1 1 1 1 1\n"
                   "0 1 0 0 0 0 0 0 0 0 0\n0\n1\n");
    scene t;
    open_scene(&t);
    t.par.seeing_fwhm = 3.0;
    rx_starclass *net = NULL;
    assert_int_equal(rx_starclass_read(path, &net, NULL), RX_OK);
    t.par.star_net = net;
    t.par.analysis_threshold = 8.0;
    for (int absolute = 0; absolute < 2; absolute++) {
        const double threshold = absolute ? 8.0 : 8.0 * GLOBAL;
        t.par.analysis_absolute = absolute;
        assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
        assert_near(t.s->class_star, 1.0 / (1.0 + exp(-log10(t.s->peak / threshold))), 1e-6);
    }
    rx_starclass_free(net);
    unlink(path);
    close_scene(&t);
}

/* Background, local sky, cut-out, and what all rows share. */
static void what_stands_beside_the_sums(void **state)
{
    scene t;
    open_scene(&t);
    float *level = RX_NEW(float, t.f.n);
    assert_non_null(level);
    for (int k = 0; k < W * H; k++) {
        level[k] = (float)(100 + k % W + 7 * (k / W));
        if (t.sources->segments[k] == 0)
            t.f.pixels[k] = 5.0f;
    }
    t.image.level = rx_map_plane(level, W);
    t.par.vignet_width = 7;
    t.par.vignet_height = 5;
    assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
    const double under = 100 + 51 + 7 * 48, raised = t.s->flux_aper[1];
    assert_near(t.s->background, under, 0);
    for (int k = 0; k < 35; k++) {
        const int x = 51 - 3 + k % 7, y = 48 - 2 + k / 7;
        assert_near(t.sources->vignets[k], hidden(&t, x, y) ? (double)-1e30f : t.f.pixels[y * W + x], 0);
    }
    assert_int_equal(t.sources->naper, 2);
    assert_int_equal(t.sources->nradii, 3);
    assert_memory_equal(t.sources->aperture_diameter, t.par.aperture_diameter, 2 * sizeof(double));
    assert_memory_equal(t.sources->flux_fraction, t.par.flux_fraction, 3 * sizeof(double));
    assert_near(t.sources->law_scale, LAW_SCALE, 0);
    assert_near(t.sources->law_power, LAW_POWER, 0);

    double area = 0.0;
    for (int k = 0; k < W * H; k++)
        area += share_of(k % W - X, k / W - Y, t.par.aperture_diameter[1] / 2.0, 5);
    t.par.local_background = 1;
    t.par.local_thickness = 8;
    assert_int_equal(rx_measure_run(&t.par, &t.image, NULL, NULL, t.sources, NULL), RX_OK);
    assert_near(t.s->background, under + 5.0, 1e-4);
    assert_near(raised - t.s->flux_aper[1], 5.0 * area, 1e-4 * area);
    free(level);
    close_scene(&t);
}

/* The points of the noise law are widths of apertures thrown by the seed, in sigmas of their pixels. */
static void noise_law_is_the_width_of_the_apertures_thrown(void **state)
{
    enum { SIDE = 256, COUNT = 400, WHICH = 3 };
    const double radius = 2.5;
    const uint64_t seed = 11;
    field f = field_new(SIDE, SIDE, 1.0, 6);
    rx_sources none = {.width = SIDE, .height = SIDE, .segments = RX_NEW(int32_t, f.n)};
    for (size_t k = 0; k < f.n; k++)
        f.sigma[k] = (float)(1.0 + rx_random_uniform(3, 1, k));
    const rx_noise_law other = {.scale = 3.0, .power = 0.7};
    const rx_image image = {.width = SIDE,
                            .height = SIDE,
                            .pixels = f.pixels,
                            .noise = rx_map_plane(f.sigma, SIDE),
                            .variable_noise = 1,
                            .global_noise = 1.0,
                            .gain = 2.0,
                            .law = &other};
    rx_noise_law law;
    assert_int_equal(rx_noise_law_fit(&image, &none, &(rx_noise_apertures){COUNT, seed, 3}, &law, NULL, NULL),
                     RX_OK);
    double sums[COUNT], areas = 0.0;
    int n = 0;
    for (uint64_t i = 0; n < COUNT; i++) {
        const double x = rx_random_uniform(seed, WHICH, 2 * i) * SIDE - 0.5,
                     y = rx_random_uniform(seed, WHICH, 2 * i + 1) * SIDE - 0.5;
        double flux = 0.0, variance = 0.0, area = 0.0;
        if (floor(x) < 5 || floor(y) < 5 || floor(x) + 7 > SIDE ||
            floor(y) + 7 > SIDE) /* 3 + 2 pixels of margin */
            continue;
        for (int v = (int)y - 4; v <= (int)y + 5; v++)
            for (int u = (int)x - 4; u <= (int)x + 5; u++) {
                const double share = share_of(u - x, v - y, radius, 5);
                flux += share * f.pixels[v * SIDE + u];
                variance += share * f.sigma[v * SIDE + u] * f.sigma[v * SIDE + u];
                area += share;
            }
        sums[n++] = flux / sqrt(variance / area);
        areas += area;
    }
    const double width = rx_sigma_mad(sums, COUNT, NULL);
    assert_near(law.area[WHICH], areas / COUNT, 1e-9 * law.area[WHICH]);
    assert_near(law.ratio[WHICH], width, 1e-5 * width);
    free(none.segments);
    field_free(&f);
}

/* Points about a power law, and the line of Python's statistics:
 *   a = [math.log10(v) for v in (2, 8, 32, 128)]; r = [math.log10(v) for v in (3, 8, 15, 40)]
 *   p, c = statistics.linear_regression(a, r)
 *   10**c, p, math.sqrt(statistics.mean((y - c - p * x)**2 for x, y in zip(a, r))) */
static void power_law_is_a_least_squares_line(void **state)
{
    rx_noise_law law = {.apertures = 400, .nradii = 4, .area = {2, 8, 32, 128}, .ratio = {3, 8, 15, 40}};
    rx_noise_law_widen(&law, 0.0);
    assert_near(law.ratio[1], 8.0, 1e-12);
    assert_near(law.scale, 2.04186547849, 1e-8);
    assert_near(law.power, 0.605889368905, 1e-8);
    assert_near(law.scatter, 0.0342045639372, 1e-8);
    /* between the points a line in log-log */
    assert_near(rx_noise_law_factor(&law, 16.0), sqrt(8.0 / sqrt(8.0) * 15.0 / sqrt(32.0)), 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(apertures_are_sums_of_shares),
                                       cmocka_unit_test(kron_and_petrosian_radii_are_moments_and_rings),
                                       cmocka_unit_test(petrosian_radius_follows_the_ring),
                                       cmocka_unit_test(radii_and_window_follow_from_the_growth_curve),
                                       cmocka_unit_test(a_dark_window_leaves_the_isophotal_numbers),
                                       cmocka_unit_test(isophotal_numbers_are_sums_over_the_segment),
                                       cmocka_unit_test(what_stands_beside_the_sums),
                                       cmocka_unit_test(class_star_takes_the_threshold_of_the_image),
                                       cmocka_unit_test(noise_law_is_the_width_of_the_apertures_thrown),
                                       cmocka_unit_test(power_law_is_a_least_squares_line)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
