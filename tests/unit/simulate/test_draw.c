/* Sersic profiles against scipy; galaxies and templates on the grid against brute force, moments and symmetry. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "simulate/render.h"
#include "simulate/sersic.h"
#include "simulate/templates.h"

#define PI 3.14159265358979323846

/* --- profiles --- */

/* n, b, truncation T, I0 (flux 1, r 1), flux within 2 r: scipy.special and brentq,
 *   b0 = gammaincinv(2n, .5); T = min(10, (gammaincinv(2n, .999) / b0)**n); t = T**(1/n)
 *   b = brentq(lambda b: gammainc(2n, b) - .5 * gammainc(2n, b * t), 1e-6, 1.5 * b0)
 *   I0 = b**(2n) / (2 pi n gamma(2n) gammainc(2n, b * t)); gammainc(2n, b * 2**(1/n)) / gammainc(2n, b * t)
 */
static const double profiles[][5] = {
    {0.5, 0.6921375781, 3.156863045, 0.2205370008, 0.9381947711},
    {0.7, 1.083090413, 4.01541875, 0.286839079, 0.896186998},
    {1, 1.676738899, 5.501492559, 0.4479081935, 0.8486467638},
    {1.5, 2.672018605, 8.604931413, 1.013106156, 0.796001608},
    {2.5, 4.64518831, 10, 5.792447043, 0.7389583069},
    {4, 7.516086384, 10, 84.15179517, 0.7000110263},
    {6, 11.22366766, 10, 2967.501598, 0.6759307915},
    {8, 14.84962901, 10, 102099.5427, 0.6630611202},
};

static void test_profiles(void **state)
{
    for (size_t i = 0; i < sizeof profiles / sizeof *profiles; i++) {
        const double *want = profiles[i];
        rx_sersic got;
        rx_sersic_set(want[0], &got);
        assert_true(fabs(got.b / want[1] - 1.0) < 1e-8);
        assert_true(fabs(got.truncation / want[2] - 1.0) < 1e-8);
        assert_true(fabs(got.centre / want[3] - 1.0) < 1e-6);
        assert_true(fabs(rx_sersic_within(&got, 1.0) - 0.5) < 1e-10);
        assert_true(fabs(rx_sersic_within(&got, 2.0) - want[4]) < 1e-8);
        assert_true(rx_sersic_within(&got, 1.0001 * got.truncation) == 1.0);
    }
}

/* --- grids --- */

/* n x n cells of 1/3 pixel around pixel position 0, 0. */
static rx_fine_grid make_grid(int n)
{
    rx_fine_grid grid = {.width = n, .height = n, .step = 1.0 / 3.0, .stride = (size_t)n};
    grid.x0 = grid.y0 = -(n - 1) / 6.0;
    grid.cells = calloc((size_t)n * (size_t)n, sizeof(float));
    assert_non_null(grid.cells);
    return grid;
}

static double grid_sum(const rx_fine_grid *grid)
{
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)grid->width * (size_t)grid->height; i++) {
        assert_true(grid->cells[i] >= 0.0f);
        sum += (double)grid->cells[i];
    }
    return sum;
}

static rx_object spheroid(double n, double radius, double ratio, double angle)
{
    return (rx_object){.type = RX_OBJECT_GALAXY,
                       .flux = 1000.0,
                       .radius = radius,
                       .ratio = ratio,
                       .angle = angle,
                       .bulge_share = 1.0,
                       .bulge_n = n,
                       .bulge_radius = radius,
                       .bulge_ratio = ratio};
}

static rx_object disk(double radius, double ratio, double angle)
{
    return (rx_object){.type = RX_OBJECT_GALAXY,
                       .flux = 1000.0,
                       .radius = radius,
                       .ratio = ratio,
                       .angle = angle,
                       .disk_radius = radius};
}

/* --- flux --- */

static double worst_flux(double n, double radius, double ratio)
{
    double worst = 0.0;
    rx_fine_grid grid = make_grid(700);
    for (int k = 0; k < 4; k++) {
        rx_object o = spheroid(n, radius, ratio, 0.4 * k);
        o.x = 0.37 * k;
        o.y = 0.2 * k - 0.71;
        memset(grid.cells, 0, sizeof(float) * 700 * 700);
        assert_int_equal(rx_galaxy_draw(&o, &grid, NULL), RX_OK);
        worst = fmax(worst, fabs(grid_sum(&grid) / o.flux - 1.0));
    }
    free(grid.cells);
    return worst;
}

static void test_flux(void **state)
{
    const double indices[] = {0.5, 1.0, 2.0, 4.0}, ratios[] = {1.0, 0.5, 0.15},
                 radii[] = {0.1, 0.3, 1.0, 3.0, 10.0};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 5; k++) {
                double worst = worst_flux(indices[i], radii[k], ratios[j]);
                if (!(worst < 1e-3))
                    print_message("n %g ratio %g radius %g: %g\n", indices[i], ratios[j], radii[k], worst);
                assert_true(worst < 1e-3);
            }
    /* a steeper cusp than galaxies have */
    assert_true(worst_flux(8.0, 3.0, 1.0) < 1e-3);
    assert_true(worst_flux(8.0, 0.3, 0.5) < 1e-3);
}

/* --- brightness of single cells --- */

/* The textbook's profile, integrated over a cell by parts x parts points; fine enough at the cusp because the
 * flux within a part shrinks with its area. */
static double brute_force(const rx_object *o, const double *profile, double x, double y, double step,
                          int parts, int *outside)
{
    *outside = 0;
    double n = profile[0], b = profile[1], t = profile[2], sum = 0.0;
    double scale = o->flux * profile[3] / (o->bulge_radius * o->bulge_radius * o->bulge_ratio);
    double c = cos(o->angle), s = sin(o->angle);
    for (int j = 0; j < parts; j++)
        for (int i = 0; i < parts; i++) {
            double dx = x + ((i + 0.5) / parts - 0.5) * step - o->x,
                   dy = y + ((j + 0.5) / parts - 0.5) * step - o->y;
            double u = (c * dx + s * dy) / o->bulge_radius,
                   v = (c * dy - s * dx) / (o->bulge_radius * o->bulge_ratio);
            double r = sqrt(u * u + v * v);
            sum += r < t ? exp(-b * pow(r, 1.0 / n)) : 0.0;
            *outside += r >= t;
        }
    return scale * sum * step * step / ((double)parts * parts);
}

static void test_cells(void **state)
{
    const double cases[][3] = {{4, 3.0, 0.6}, {4, 0.4, 0.3}, {1, 2.0, 0.5}, {0.5, 3.0, 0.9}, {2.5, 1.0, 1.0}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const double *profile = profiles[0];
        for (size_t i = 0; i < sizeof profiles / sizeof *profiles; i++)
            if (profiles[i][0] == cases[k][0])
                profile = profiles[i];
        rx_object o = spheroid(cases[k][0], cases[k][1], cases[k][2], 0.7);
        o.x = 0.11;
        o.y = -0.05;
        rx_fine_grid grid = make_grid(121);
        assert_int_equal(rx_galaxy_draw(&o, &grid, NULL), RX_OK);
        for (int j = 50; j <= 70; j += 2)
            for (int i = 50; i <= 70; i += 2) {
                double x = grid.x0 + i * grid.step, y = grid.y0 + j * grid.step;
                int near = i > 55 && i < 65 && j > 55 && j < 65, parts = near ? 400 : 40, outside;
                double want = brute_force(&o, profile, x, y, grid.step, parts, &outside);
                double got = (double)grid.cells[j * 121 + i];
                /* Brute force itself is good to 1e-3 in the cell of the cusp; cells that are sampled differ
                 * from means by their curvature; the truncation is a step, which few points see roughly. */
                int cut = outside > 0 && outside < parts * parts;
                double error = 0.02 * want + (cut ? 2e-5 : 2e-6) * o.flux;
                if (!(fabs(got - want) < error))
                    print_message("case %zu cell %d %d: %g instead of %g\n", k, i, j, got, want);
                assert_true(fabs(got - want) < error);
            }
        free(grid.cells);
    }
}

/* --- shape --- */

typedef struct moments {
    double sum, x, y, xx, yy, xy, ratio, angle, skew; /* skew: third moment along `along` */
} moments;

static moments measure(const rx_fine_grid *grid, double along)
{
    moments m = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int j = 0; j < grid->height; j++)
            for (int i = 0; i < grid->width; i++) {
                double x = grid->x0 + i * grid->step, y = grid->y0 + j * grid->step;
                double value = (double)grid->cells[(size_t)j * grid->stride + (size_t)i];
                if (pass == 0) {
                    m.sum += value;
                    m.x += value * x;
                    m.y += value * y;
                    continue;
                }
                double dx = x - m.x / m.sum, dy = y - m.y / m.sum, u = dx * cos(along) + dy * sin(along);
                m.xx += value * dx * dx / m.sum;
                m.yy += value * dy * dy / m.sum;
                m.xy += value * dx * dy / m.sum;
                m.skew += value * u * u * u / m.sum;
            }
    m.x /= m.sum;
    m.y /= m.sum;
    double half = 0.5 * (m.xx + m.yy), root = hypot(0.5 * (m.xx - m.yy), m.xy);
    m.ratio = sqrt((half - root) / (half + root));
    m.angle = 0.5 * atan2(2.0 * m.xy, m.xx - m.yy);
    return m;
}

static void test_shape(void **state)
{
    const double cases[][4] = {
        {1, 4.0, 0.5, 0.6}, {1, 4.0, 0.8, -1.2}, {4, 3.0, 0.4, 1.5}, {0.5, 5.0, 0.3, 0.1}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        rx_object o = spheroid(cases[k][0], cases[k][1], cases[k][2], cases[k][3]);
        o.x = 0.31;
        o.y = -0.42;
        rx_fine_grid grid = make_grid(301);
        assert_int_equal(rx_galaxy_draw(&o, &grid, NULL), RX_OK);
        moments got = measure(&grid, 0.0);
        assert_true(fabs(got.x - o.x) < 2e-3);
        assert_true(fabs(got.y - o.y) < 2e-3);
        assert_true(fabs(got.ratio - cases[k][2]) < 2e-3);
        assert_true(fabs(remainder(got.angle - cases[k][3], PI)) < 2e-3);
        free(grid.cells);
    }
}

/* Bulge and disk together: what each is alone. */
static void test_components_add(void **state)
{
    rx_fine_grid both = make_grid(201), single = make_grid(201);
    rx_object o = disk(3.0, 0.6, 0.5), bulge = spheroid(2.5, 0.8, 0.8, 0.5), rest = o;
    o.bulge_share = 0.3;
    o.bulge_n = 2.5;
    o.bulge_radius = 0.8;
    o.bulge_ratio = 0.8;
    bulge.flux *= 0.3;
    rest.flux *= 0.7;
    assert_int_equal(rx_galaxy_draw(&o, &both, NULL), RX_OK);
    assert_int_equal(rx_galaxy_draw(&bulge, &single, NULL), RX_OK);
    assert_int_equal(rx_galaxy_draw(&rest, &single, NULL), RX_OK);
    for (int i = 0; i < 201 * 201; i++)
        assert_true(fabsf(both.cells[i] - single.cells[i]) <= 2e-6f * fmaxf(single.cells[i], 1e-6f));
    free(both.cells);
    free(single.cells);
}

/* --- arms and bars --- */

/* Amplitude and phase of the m-th harmonic on the circle of that radius, bilinear in the grid. */
static void harmonic(const rx_fine_grid *grid, int m, double radius, double *amplitude, double *phase)
{
    const int steps = 720;
    double re = 0.0, im = 0.0, mean = 0.0;
    for (int k = 0; k < steps; k++) {
        double theta = 2.0 * PI * k / steps;
        double x = (radius * cos(theta) - grid->x0) / grid->step,
               y = (radius * sin(theta) - grid->y0) / grid->step;
        int i = (int)x, j = (int)y;
        double fx = x - i, fy = y - j;
        const float *at = grid->cells + (size_t)j * grid->stride + (size_t)i;
        double value = (1.0 - fy) * ((1.0 - fx) * (double)at[0] + fx * (double)at[1]) +
                       fy * ((1.0 - fx) * (double)at[grid->stride] + fx * (double)at[grid->stride + 1]);
        mean += value / steps;
        re += value * cos(m * theta) / steps;
        im += value * sin(m * theta) / steps;
    }
    *amplitude = 2.0 * hypot(re, im) / mean;
    *phase = atan2(im, re);
}

/* Face on, the m-th harmonic is the arms: contrast R^2 / (R^2 + (r/2)^2) strong, and its phase runs with
 * m ln(R / r) / tan(pitch). */
static void test_arms(void **state)
{
    for (int m = 2; m <= 4; m++) {
        rx_object o = disk(18.0, 1.0, 0.0);
        rx_fine_grid plain = make_grid(700), grid = make_grid(700);
        assert_int_equal(rx_galaxy_draw(&o, &plain, NULL), RX_OK);
        o.arms = m;
        o.arm_contrast = 0.6;
        o.arm_pitch = m == 3 ? -0.4 : 0.5;
        o.arm_phase = 0.8;
        assert_int_equal(rx_galaxy_draw(&o, &grid, NULL), RX_OK);
        assert_true(fabs(grid_sum(&grid) / grid_sum(&plain) - 1.0) < 5e-4);
        for (double radius = 9.0; radius < 45.0; radius += 5.1) {
            double amplitude, phase, fade = radius * radius / (radius * radius + 81.0);
            double want = m * log(radius / 18.0) / tan(o.arm_pitch) + o.arm_phase;
            harmonic(&grid, m, radius, &amplitude, &phase);
            assert_true(fabs(amplitude - 0.6 * fade) < 0.01);
            assert_true(fabs(remainder(phase - want, 2.0 * PI)) < 0.02);
            harmonic(&plain, m, radius, &amplitude, &phase);
            assert_true(amplitude < 0.005);
        }
        free(plain.cells);
        free(grid.cells);
    }
}

static void test_bar(void **state)
{
    rx_object o = disk(5.0, 1.0, 0.0);
    rx_fine_grid plain = make_grid(221), grid = make_grid(221);
    assert_int_equal(rx_galaxy_draw(&o, &plain, NULL), RX_OK);
    o.bar_share = 0.2;
    o.bar_radius = 4.0;
    o.arm_phase = 0.7;
    assert_int_equal(rx_galaxy_draw(&o, &grid, NULL), RX_OK);
    assert_true(fabs(grid_sum(&grid) / grid_sum(&plain) - 1.0) < 5e-4);
    /* without the disk's part: a bar along arm_phase of Ferrers' second moment a^2 / 8 */
    for (int i = 0; i < 221 * 221; i++)
        grid.cells[i] -= 0.8f * plain.cells[i];
    moments got = measure(&grid, 0.0);
    assert_true(fabs(got.sum / 200.0 - 1.0) < 2e-3);
    assert_true(fabs(got.angle - 0.7) < 5e-3);
    assert_true(fabs(got.ratio - 1.0 / 3.0) < 0.01);
    double along = 0.0;
    for (int j = 0; j < 221; j++)
        for (int i = 0; i < 221; i++) {
            double x = grid.x0 + i * grid.step, y = grid.y0 + j * grid.step;
            double u = x * cos(0.7) + y * sin(0.7);
            along += (double)grid.cells[j * 221 + i] * u * u / got.sum;
        }
    assert_true(fabs(along / (16.0 / 8.0) - 1.0) < 0.02);
    free(plain.cells);
    free(grid.cells);
}

/* Anything a scene may ask for, and more: no cell below 0, the flux kept. */
static void test_extremes(void **state)
{
    rx_fine_grid grid = make_grid(401);
    rx_object o = disk(3.0, 0.05, 1.0);
    o.bulge_share = 0.2;
    o.bulge_n = 5.0;
    o.bulge_radius = 0.01;
    o.bulge_ratio = 0.1;
    o.arms = 6;
    o.arm_contrast = 1.0;
    o.arm_pitch = 0.1;
    o.bar_share = 0.9; /* more than there is */
    o.bar_radius = 2.0;
    assert_int_equal(rx_galaxy_draw(&o, &grid, NULL), RX_OK);
    assert_true(fabs(grid_sum(&grid) / o.flux - 1.0) < 5e-3);
    free(grid.cells);
}

/* The square of rx_object_reach holds everything, a smaller one does not. */
static void test_reach(void **state)
{
    rx_object objects[] = {disk(3.0, 0.4, 0.3), spheroid(4.0, 2.0, 0.6, 0.9), spheroid(0.5, 4.0, 1.0, 0.0)};
    for (int k = 0; k < 3; k++) {
        double reach = rx_object_reach(&objects[k], NULL), inside = 0.0, outer = 0.0;
        rx_fine_grid grid = make_grid(281);
        assert_int_equal(rx_galaxy_draw(&objects[k], &grid, NULL), RX_OK);
        for (int j = 0; j < 281; j++)
            for (int i = 0; i < 281; i++) {
                double d = fmax(fabs(grid.x0 + i * grid.step), fabs(grid.y0 + j * grid.step));
                inside += d <= reach ? (double)grid.cells[j * 281 + i] : 0.0;
                outer += d > 0.9 * reach ? (double)grid.cells[j * 281 + i] : 0.0;
            }
        assert_true(fabs(inside / objects[k].flux - 1.0) < 1e-3);
        assert_true(outer > 0.0);
        free(grid.cells);
    }
    rx_object star = {.type = RX_OBJECT_STAR, .flux = 1.0};
    assert_true(rx_object_reach(&star, NULL) == 0.0);
}

/* --- templates --- */

/* A smooth lopsided template: an elliptical Gaussian with a blob at one end. */
static rx_template synthetic(void)
{
    rx_template t = {.name = "made", .width = 41, .height = 37, .pixel_scale = 0.03, .fwhm = 0.09};
    double sum = 0.0, x1 = 0.0, y1 = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    t.pixels = calloc(41 * 37, sizeof(float));
    for (int pass = 0; pass < 2; pass++)
        for (int y = 0; y < 37; y++)
            for (int x = 0; x < 41; x++) {
                double dx = x - 20.0, dy = y - 18.0, u = dx * cos(0.4) + dy * sin(0.4),
                       v = dy * cos(0.4) - dx * sin(0.4);
                double ex = u - 6.0,
                       value = exp(-0.5 * (u * u / 16.0 + v * v / 4.0)) + exp(-0.25 * (ex * ex + v * v));
                if (pass == 0)
                    sum += value;
                else
                    t.pixels[y * 41 + x] = (float)(value / sum);
                double w = value / (pass == 0 ? 1.0 : sum);
                if (pass == 1) {
                    x1 += w * x;
                    y1 += w * y;
                    xx += w * x * x;
                    yy += w * y * y;
                    xy += w * x * y;
                }
            }
    t.x = x1;
    t.y = y1;
    xx -= x1 * x1;
    yy -= y1 * y1;
    xy -= x1 * y1;
    t.angle = 0.5 * atan2(2.0 * xy, xx - yy);
    double half = 0.5 * (xx + yy), root = hypot(0.5 * (xx - yy), xy);
    t.ratio = sqrt((half - root) / (half + root));
    t.radius = 4.0;
    return t;
}

static double trace_of(const rx_template *t)
{
    double sum = 0.0;
    for (int y = 0; y < t->height; y++)
        for (int x = 0; x < t->width; x++)
            sum += (double)t->pixels[y * t->width + x] * ((x - t->x) * (x - t->x) + (y - t->y) * (y - t->y));
    return sum;
}

/* Flux, centroid, angle and size at any stretch, turn and flip. */
static void test_draw(void **state)
{
    rx_template t = synthetic();
    const double stretches[] = {0.03, 0.1, 0.2, 0.33, 0.7, 2.5};
    for (int k = 0; k < 6; k++)
        for (int flip = 0; flip < 2; flip++) {
            rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 500.0, .x = 0.4, .y = -1.3, .flip = flip};
            o.stretch = stretches[k];
            o.angle = 0.9 * k - 2.0;
            rx_fine_grid grid = make_grid(401);
            rx_template_draw(&o, &t, &grid);
            moments got = measure(&grid, o.angle);
            assert_true(fabs(got.sum / 500.0 - 1.0) < 1e-3);
            /* what is smaller than a cell lies in its middle */
            double error = k == 0 ? 0.15 * grid.step : 5e-3;
            assert_true(fabs(got.x - o.x) < error);
            assert_true(fabs(got.y - o.y) < error);
            if (k == 0) {
                free(grid.cells);
                continue;
            }
            assert_true(fabs(remainder(got.angle - o.angle, PI)) < 0.02);
            /* size: the template's and the spline's 1/3 pixel^2 per axis; cells that are means of points add
             * up to their own 2 / 12 of a cell */
            double want = (trace_of(&t) + 2.0 / 3.0) * o.stretch * o.stretch, cell = 2.0 / 12.0 / 9.0;
            assert_true(got.xx + got.yy > want * 0.998);
            assert_true(got.xx + got.yy < want * 1.002 + cell);
            /* everything is in the reach */
            rx_templates all = {1, &t};
            double reach = rx_object_reach(&o, &all), beyond = 0.0;
            for (int j = 0; j < 401; j++)
                for (int i = 0; i < 401; i++)
                    if (fmax(fabs(grid.x0 + i * grid.step - o.x), fabs(grid.y0 + j * grid.step - o.y)) >
                        reach)
                        beyond += (double)grid.cells[j * 401 + i];
            assert_true(beyond < 0.5);
            free(grid.cells);
        }
    free(t.pixels);
}

/* Turned by half a circle the image is upside down; flipped at its own axis' mirror it is mirrored. */
static void test_draw_symmetry(void **state)
{
    enum { N = 101 };
    rx_template t = synthetic();
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = 0.3, .angle = 0.7};
    rx_fine_grid a = make_grid(N), b = make_grid(N), c = make_grid(N);
    rx_template_draw(&o, &t, &a);
    o.angle += PI;
    rx_template_draw(&o, &t, &b);
    o.angle = -0.7;
    o.flip = 1;
    rx_template_draw(&o, &t, &c);
    assert_true(fabs(measure(&a, 0.7).skew) > 0.01);
    for (int j = 0; j < N; j++)
        for (int i = 0; i < N; i++) {
            assert_true(fabsf(a.cells[j * N + i] - b.cells[(N - 1 - j) * N + N - 1 - i]) < 1e-7f);
            assert_true(fabsf(a.cells[j * N + i] - c.cells[j * N + N - 1 - i]) < 1e-7f);
        }
    free(a.cells);
    free(b.cells);
    free(c.cells);
    free(t.pixels);
}

/* A flat template stays flat: no holes between pixels at any stretch, no beat of cells and pixels. */
static void test_draw_flat(void **state)
{
    rx_template t = {.width = 200, .height = 200, .x = 99.5, .y = 99.5, .ratio = 1.0, .pixel_scale = 0.03};
    t.pixels = calloc(200 * 200, sizeof(float));
    for (int i = 0; i < 200 * 200; i++)
        t.pixels[i] = 1.0f / 40000.0f;
    const double stretches[] = {0.07, 0.31, 1.0 / 3.0, 1.7, 6.1};
    for (int k = 0; k < 5; k++) {
        rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = stretches[k], .angle = 0.3 * k};
        rx_fine_grid grid = make_grid(41);
        rx_template_draw(&o, &t, &grid);
        double want = 1.0 / 40000.0 / 9.0 / (o.stretch * o.stretch);
        for (int i = 0; i < 41 * 41; i++)
            assert_true(fabs((double)grid.cells[i] / want - 1.0) < 1e-5);
        free(grid.cells);
    }
    free(t.pixels);
}

/* One pixel drawn is the spline: variance 1/3 pixel^2, as rx_template_blur() says. */
static void test_blur(void **state)
{
    rx_template t = {.width = 1, .height = 1, .ratio = 1.0, .pixel_scale = 0.05};
    float one = 1.0f;
    t.pixels = &one;
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = 5.0, .x = 0.1};
    rx_fine_grid grid = make_grid(101);
    rx_template_draw(&o, &t, &grid);
    moments got = measure(&grid, 0.0);
    assert_true(fabs(got.sum - 1.0) < 1e-4);
    assert_true(fabs(got.xx / 25.0 - 1.0 / 3.0) < 1e-3);
    assert_true(fabs(got.yy / 25.0 - 1.0 / 3.0) < 1e-3);
    free(grid.cells);
    t.fwhm = 0.15;
    assert_true(fabs(rx_template_blur(&t) - sqrt(9.0 + 8.0 * log(2.0) / 3.0)) < 1e-12);
    t.fwhm = 0.0;
    assert_true(fabs(rx_template_blur(&t) - sqrt(4.0 + 8.0 * log(2.0) / 3.0)) < 1e-12);
}

static void test_clipped(void **state)
{
    enum { N = 120, X = 40, Y = 55, PART = 30 };
    rx_template t = synthetic();
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 100.0, .stretch = 0.4, .angle = 0.7, .x = -2.0},
              arms = disk(4.0, 0.5, 0.3);
    arms.arms = 2;
    arms.arm_contrast = 0.5;
    arms.arm_pitch = 0.3;
    rx_fine_grid whole = make_grid(N), part = make_grid(N);
    part.x0 += X * part.step;
    part.y0 += Y * part.step;
    part.width = part.height = PART;
    rx_template_draw(&o, &t, &whole);
    rx_template_draw(&o, &t, &part);
    assert_int_equal(rx_galaxy_draw(&arms, &whole, NULL), RX_OK);
    assert_int_equal(rx_galaxy_draw(&arms, &part, NULL), RX_OK);
    double sum = 0.0;
    for (int j = 0; j < PART; j++)
        for (int i = 0; i < N; i++) {
            double got = (double)part.cells[j * N + i];
            double want = i < PART ? (double)whole.cells[(j + Y) * N + i + X] : 0.0;
            assert_true(fabs(got - want) <= 1e-5 * want + 1e-9);
            sum += got;
        }
    assert_true(sum > 1.0);
    o.x = -1e7;
    arms.x = 1e6;
    memset(part.cells, 0, sizeof(float) * N * N);
    rx_template_draw(&o, &t, &part);
    assert_int_equal(rx_galaxy_draw(&arms, &part, NULL), RX_OK);
    for (int i = 0; i < N * N; i++)
        assert_true(part.cells[i] == 0.0f);
    free(whole.cells);
    free(part.cells);
    free(t.pixels);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_profiles),
        cmocka_unit_test(test_flux),
        cmocka_unit_test(test_cells),
        cmocka_unit_test(test_shape),
        cmocka_unit_test(test_components_add),
        cmocka_unit_test(test_arms),
        cmocka_unit_test(test_bar),
        cmocka_unit_test(test_extremes),
        cmocka_unit_test(test_reach),
        cmocka_unit_test(test_draw),
        cmocka_unit_test(test_draw_symmetry),
        cmocka_unit_test(test_draw_flat),
        cmocka_unit_test(test_blur),
        cmocka_unit_test(test_clipped),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
