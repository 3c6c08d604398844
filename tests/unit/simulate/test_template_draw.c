/* Templates drawn on a grid: flux, place, direction, size, no holes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "simulate/render.h"
#include "simulate/templates.h"

#define PI 3.14159265358979323846

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

typedef struct moments {
    double sum, x, y, xx, yy, xy, skew; /* skew: third moment along `along` */
} moments;

static moments measure(const rx_fine_grid *grid, double along)
{
    moments m = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int j = 0; j < grid->height; j++)
            for (int i = 0; i < grid->width; i++) {
                double x = grid->x0 + i * grid->step, y = grid->y0 + j * grid->step;
                double value = (double)grid->cells[(size_t)j * grid->stride + (size_t)i];
                assert_true(value >= 0.0);
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
    return m;
}

static rx_fine_grid make_grid(int n)
{
    rx_fine_grid grid = {.width = n, .height = n, .step = 1.0 / 3.0, .stride = (size_t)n};
    grid.x0 = grid.y0 = -(n - 1) / 6.0;
    grid.cells = calloc((size_t)n * (size_t)n, sizeof(float));
    assert_non_null(grid.cells);
    return grid;
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
    (void)state;
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
            double angle = 0.5 * atan2(2.0 * got.xy, got.xx - got.yy);
            assert_true(fabs(remainder(angle - o.angle, PI)) < 0.02);
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
    (void)state;
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
    (void)state;
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
    (void)state;
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

static void test_draw_clipped(void **state)
{
    (void)state;
    enum { N = 120, X = 40, Y = 55, PART = 30 };
    rx_template t = synthetic();
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 100.0, .stretch = 0.4, .angle = 0.7, .x = -2.0};
    rx_fine_grid whole = make_grid(N), part = make_grid(N);
    part.x0 += X * part.step;
    part.y0 += Y * part.step;
    part.width = part.height = PART;
    rx_template_draw(&o, &t, &whole);
    rx_template_draw(&o, &t, &part);
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
    memset(part.cells, 0, sizeof(float) * N * N);
    rx_template_draw(&o, &t, &part);
    for (int i = 0; i < N * N; i++)
        assert_true(part.cells[i] == 0.0f);
    free(whole.cells);
    free(part.cells);
    free(t.pixels);
}

/* The real ones on the grid of an SDSS tile. */
static void test_draw_cosmos(void **state)
{
    (void)state;
    const char *folder = getenv("RX_SHARED_DATA");
    char path[2048];
    rx_templates *all = NULL;
    snprintf(path, sizeof path, "%s/templates/cosmos", folder != NULL ? folder : "");
    if (rx_templates_read(path, 1.0, 0.0, NULL, &all, NULL) != RX_OK) {
        print_message("no COSMOS templates: skipped\n");
        skip();
        return;
    }
    for (int i = 0; i < all->n; i++) {
        rx_object o = {
            .type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = 0.2, .angle = 0.1 * i, .flip = i & 1};
        rx_fine_grid grid = make_grid(221);
        rx_template_draw(&o, &all->list[i], &grid);
        double sum = measure(&grid, 0.0).sum;
        if (!(fabs(sum - 1.0) < 1e-3))
            print_message("%s: %g\n", all->list[i].name, sum);
        assert_true(fabs(sum - 1.0) < 1e-3);
        free(grid.cells);
    }
    rx_templates_free(all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_draw), cmocka_unit_test(test_draw_symmetry), cmocka_unit_test(test_draw_flat),
        cmocka_unit_test(test_blur), cmocka_unit_test(test_draw_clipped),  cmocka_unit_test(test_draw_cosmos),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
