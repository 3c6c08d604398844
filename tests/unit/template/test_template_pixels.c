/* Canvas, sky, patches, links and the joint fit against sums over pixels written out. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "template/blends.h"
#include "template/fit_image.h"
#include "template/joint.h"
#include "template/patch.h"
#include "template/residual_sky.h"
#include "template/sky_mesh.h"
#include "template/template_chi2.h"
#include "template/windows.h"

enum { W = 290, H = 70, N = 14, LATER = 2, SHEETS = 2 };

static double value_at(const rx_footprint *f, int x, int y)
{
    const int i = x - f->x0, j = y - f->y0;
    return i >= 0 && j >= 0 && i < f->width && j < f->height ? (double)f->values[j * f->width + i] : 0;
}

/* What a canvas should show. */
typedef struct scene {
    field f;
    float level[W * H];
    rx_tphot_input input;
    rx_footprint t[N];
    double flux[N];
    double cells[SHEETS][2 * 7]; /* of 40 pixels */
    double data[W * H], model[W * H], weight[W * H];
} scene;

/* Between the centres of 7 x 2 cells, constant beyond the outermost. */
static double sheet_at(const double *cells, int x, int y)
{
    const double u = fmin(fmax((x + 0.5) * 7 / W - 0.5, 0), 6), v = fmin(fmax((y + 0.5) * 2 / H - 0.5, 0), 1);
    double sum = 0;
    for (int k = 0; k < 14; k++)
        sum += cells[k] * fmax(0, 1 - fabs(u - k % 7)) * fmax(0, 1 - fabs(v - k / 7));
    return sum;
}

static void scene_open(scene *s)
{
    field *f = &s->f;
    field_open(f, W, H, 3, 1, 0);
    for (int k = 0; k < W * H; k++) {
        f->pixels[k] = (float)(30 * rx_random_normal(4, 1, (uint64_t)k));
        f->sigma[k] = k % 19 == 0 ? 0 : (float)(0.5 + rx_random_uniform(4, 2, (uint64_t)k));
        f->mask[k] = k % 13 == 0 ? 4 : 8; /* 8 hides nothing */
        s->level[k] = (float)(10 * rx_random_normal(4, 3, (uint64_t)k));
    }
    f->pixels[40] = s->level[44] = NAN;
    for (int i = 0; i < N; i++) {
        s->t[i] = boxed(19 * i, 4 * i, 20 + i, 15, (uint64_t)i);
        s->flux[i] = i % 5 == 4 ? -3 - i : 7 + i;
    }
    for (int k = 0; k < SHEETS * 14; k++)
        s->cells[k / 14][k % 14] = 5 * rx_random_normal(5, 0, (uint64_t)k);
    s->input = field_input(f);
    s->input.image.gain = 3;
    s->input.image.with_sky = 1;
    s->input.image.level = rx_map_plane(s->level, W);
    for (int k = 0; k < W * H; k++) {
        const int x = k % W, y = k / W, open = k % 13 != 0 && k % 19 != 0 && k != 40 && k != 44;
        double early = 0;
        s->data[k] = open ? (double)f->pixels[k] - s->level[k] : 0;
        for (int i = 0; i < SHEETS && open; i++)
            s->data[k] -= sheet_at(s->cells[i], x, y);
        s->model[k] = 0;
        for (int i = 0; i < N; i++) {
            s->model[k] += s->flux[i] * value_at(&s->t[i], x, y);
            early = i == N - LATER - 1 ? fmax(s->model[k], 0) : early;
        }
        s->weight[k] = open ? 1 / ((double)f->sigma[k] * f->sigma[k] + early / 3 + pow(0.1 * early, 2)) : 0;
    }
}

/* late: not looked at before the skies are off. */
static void scene_show(scene *s, int rows, int nthreads, int late, rx_fit_image *canvas)
{
    rx_layer *layers = RX_NEW(rx_layer, N - LATER);
    assert_non_null(layers);
    for (int k = 0; k < N - LATER; k++)
        layers[k] = (rx_layer){s->t[k], s->flux[k]};
    rx_fit_image_open(&s->input, (size_t)rows * W, nthreads, canvas);
    canvas->psf_error = 0.1;
    assert_int_equal(rx_fit_image_rows(canvas), rows);
    rx_fit_image_set(canvas, layers, N - LATER);
    if (!late)
        assert_int_equal(rx_fit_image_load_rows(canvas, 0, rows, NULL), RX_OK);
    for (int i = 0; i < SHEETS; i++) {
        rx_sky_mesh sheet;
        assert_int_equal(rx_sky_mesh_open(W, H, 40, &sheet, NULL), RX_OK);
        assert_int_equal(sheet.nx, 7);
        assert_int_equal(sheet.ny, 2);
        memcpy(sheet.value, s->cells[i], sizeof s->cells[i]);
        assert_int_equal(rx_fit_image_subtract(canvas, &sheet, NULL), RX_OK);
        assert_int_equal(rx_fit_image_add(canvas, &s->t[N - LATER + i], s->flux[N - LATER + i], NULL), RX_OK);
    }
}

static void scene_close(scene *s)
{
    for (int i = 0; i < N; i++)
        free(s->t[i].values);
    field_close(&s->f);
}

static void check_window(const scene *s, rx_fit_image *canvas, rx_window w)
{
    assert_int_equal(rx_fit_image_load(canvas, &w, NULL, 1, NULL), RX_OK);
    for (int y = w.y0; y < w.y1; y++)
        for (int x = w.x0; x < w.x1; x++) {
            const size_t k = rx_fit_image_row(canvas, y) + (size_t)x, p = (size_t)y * W + (size_t)x;
            const double sigma = s->weight[p] > 0 ? (double)s->f.sigma[p] : 0;
            assert_near(canvas->data[k], s->data[p], 3e-5);
            assert_near(canvas->model[k], s->model[p], 1e-4);
            assert_near(canvas->weight[k], s->weight[p], 1e-5 * s->weight[p]);
            assert_near(canvas->sigma[k], sigma, 0);
            assert_near(rx_fit_image_variance(canvas, x, y), sigma * sigma, 1e-6);
        }
}

/* Every pixel by its definition: all in memory, data kept, made anew. */
static void test_definition(void **state)
{
    (void)state;
    static scene s;
    scene_open(&s);
    for (int i = 0; i < 6; i++) {
        rx_fit_image canvas;
        const int rows = (int[3]){H, 33, 17}[i % 3], from = H > rows ? H - rows - 1 : 0;
        scene_show(&s, rows, 1 + i % 3, i / 3, &canvas);
        check_window(&s, &canvas, (rx_window){0, 0, W, rows});
        check_window(&s, &canvas, (rx_window){37, H - 9, 120, H});
        check_window(&s, &canvas, (rx_window){10, from, 60, from + 4});
        check_window(&s, &canvas, (rx_window){100, 17, 131, 26});
        check_window(&s, &canvas, (rx_window){280, 1, W, 8});
        rx_tphot tphot = {0};
        double chi2 = 0, visible = 0;
        assert_int_equal(rx_template_chi2(&canvas, 1, &tphot, NULL), RX_OK);
        for (int k = 0; k < W * H; k++) {
            const double r = s.weight[k] > 0 ? s.data[k] - s.model[k] : 0;
            assert_near(tphot.model[k], s.model[k], 1e-4);
            assert_near(tphot.residual[k], r, 1e-4);
            if (!(s.weight[k] > 0))
                continue;
            chi2 += r * r / (pow(s.f.sigma[k], 2) + fmax(s.model[k], 0) / 3);
            visible++;
        }
        assert_close(tphot.chi2, chi2, 1e-6);
        assert_near(tphot.visible, visible, 0);
        free(tphot.model);
        free(tphot.residual);
        rx_fit_image_clear(&canvas);
    }
    const rx_window window = rx_footprint_window(&(rx_footprint){.x0 = 3, .y0 = 5, .width = 7, .height = 11});
    assert_memory_equal(&window, &((rx_window){3, 5, 10, 16}), sizeof window);
    scene_close(&s);
}

/* In the middle, at corners, and with more asked for than the domain holds. */
static void test_patch(void **state)
{
    (void)state;
    static const struct {
        int cx, cy, half, domain, side;
    } cases[] = {{100, 30, 8, 40, 17},
                 {4, 3, 9, 40, 19},
                 {W - 3, H - 2, 9, 40, 19},
                 {100, 30, 20, 30, 27},
                 {100, 30, 14, 30, 27}};
    static scene s;
    rx_fit_image canvas;
    scene_open(&s);
    scene_show(&s, H, 1, 0, &canvas);
    check_window(&s, &canvas, (rx_window){0, 0, W, H});
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const int half = cases[i].side / 2;
        const rx_footprint *f = &s.t[5], other = boxed(cases[i].cx - 3, cases[i].cy - 2, 5, 9, 3);
        rx_patch patch;
        assert_int_equal(
            rx_patch_cut(&canvas, cases[i].cx, cases[i].cy, cases[i].half, cases[i].domain, &patch, NULL),
            RX_OK);
        rx_patch_add(&patch, f, 9);
        rx_patch_add(&patch, &other, -4);
        assert_int_equal(patch.side, cases[i].side);
        assert_int_equal(patch.x0, cases[i].cx - half);
        assert_int_equal(patch.y0, cases[i].cy - half);
        assert_int_equal(patch.corner, cases[i].domain / 2 - half);
        for (int k = 0; k < patch.side * patch.side; k++) {
            const int x = patch.x0 + k % patch.side, y = patch.y0 + k / patch.side, p = y * W + x;
            const int open = x >= 0 && y >= 0 && x < W && y < H && s.weight[p] > 0;
            assert_near(patch.weight[k], open ? s.weight[p] : 0, 1e-5);
            assert_near(
                patch.data[k],
                open ? s.data[p] - s.model[p] + 9 * value_at(f, x, y) - 4 * value_at(&other, x, y) : 0, 2e-4);
        }
        rx_patch_clear(&patch);
        free(other.values);
    }
    for (int i = 1; i < N; i++) {
        double plain = 0, weighted = 0;
        for (int k = 0; k < W * H; k++) {
            const double product = value_at(&s.t[i - 1], k % W, k / W) * value_at(&s.t[i], k % W, k / W);
            plain += product;
            weighted += product * s.weight[k];
        }
        assert_true(plain > 0);
        assert_close(rx_footprint_product(&s.t[i - 1], &s.t[i], NULL), plain, 1e-9);
        assert_close(rx_footprint_product(&s.t[i], &s.t[i - 1], &canvas), weighted, 1e-5);
    }
    rx_fit_image_clear(&canvas);
    scene_close(&s);
}

/* A few pixels of a plane, two of them negative, the outermost hardly above the level. */
static void test_crop(void **state)
{
    (void)state;
    enum { SIDE = 20, STRIDE = 24, WIDTH = 50, HEIGHT = 40 };
    static const int at[][2] = {{25, 20}, {3, 20}, {25, 2}, {WIDTH - 2, HEIGHT - 3}, {-4, -6}, {80, 20}};
    static float plane[SIDE * STRIDE];
    for (int k = 0; k < SIDE * STRIDE; k++)
        plane[k] = (float)(0.0009 * rx_random_uniform(1, 1, (uint64_t)k));
    plane[4 * STRIDE + 9] = -0.0010005f;
    plane[9 * STRIDE + 3] = 0.0010005f;
    plane[11 * STRIDE + 15] = 0.0010005f;
    plane[17 * STRIDE + 7] = -0.0010005f;
    plane[2 * STRIDE + 9] = plane[18 * STRIDE + 9] = 0.0009995f;
    plane[10 * STRIDE + 10] = 0.7f;
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        const int x0 = at[i][0] - SIDE / 2, y0 = at[i][1] - SIDE / 2;
        rx_window box = {99, 99, -99, -99};
        double outside = 0;
        rx_footprint f;
        for (int k = 0; k < SIDE * SIDE; k++) {
            const int x = x0 + k % SIDE, y = y0 + k / SIDE;
            const float value = plane[k / SIDE * STRIDE + k % SIDE];
            if (x < 0 || y < 0 || x >= WIDTH || y >= HEIGHT) {
                outside += value;
            } else if (fabsf(value) > 0.001) {
                box = (rx_window){x < box.x0 ? x : box.x0, y < box.y0 ? y : box.y0,
                                  x >= box.x1 ? x + 1 : box.x1, y >= box.y1 ? y + 1 : box.y1};
            }
        }
        const rx_template_plane rendered = {plane, SIDE, STRIDE, at[i][0], at[i][1]};
        assert_int_equal(rx_footprint_crop(&rendered, 0.001, WIDTH, HEIGHT, &f, NULL), RX_OK);
        assert_near(f.inside, 1 - outside, 1e-6);
        assert_int_equal(f.width, box.x1 > box.x0 ? box.x1 - box.x0 : 0);
        if (f.width == 0)
            continue;
        assert_int_equal(f.height, box.y1 - box.y0);
        assert_int_equal(f.x0, box.x0);
        assert_int_equal(f.y0, box.y0);
        for (int k = 0; k < f.width * f.height; k++)
            assert_near(f.values[k], plane[(f.y0 - y0 + k / f.width) * STRIDE + f.x0 - x0 + k % f.width], 0);
        free(f.values);
    }
}

/* A plane without noise comes off to the last bit between the outermost centres, also through a hidden cell;
 * what is in segments, and a few wild pixels, have no say. */
static void test_tilted_sky(void **state)
{
    (void)state;
    enum { WIDTH = 400, HEIGHT = 300 };
    field f;
    rx_fit_image canvas;
    double mean;
    field_open(&f, WIDTH, HEIGHT, 3, 1, 3);
    field_list(&f, 49.5, 49.5, 30, 1, 1, 0); /* in the middle of a cell, as all that is hidden */
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        const int x = k % WIDTH, y = k / WIDTH, segment = f.sources->segments[k] != 0;
        f.pixels[k] = (float)(3 + 0.01 * (x - 199.5) - 0.02 * (y - 149.5));
        f.mask[k] = (x >= 100 && x < 200 && y >= 100 && y < 200) || segment;
        f.pixels[k] += segment ? 1000 : 0;
    }
    f.pixels[40 * WIDTH + 340] = 1e4f;
    f.pixels[59 * WIDTH + 359] = -1e5f;
    for (int y = 0; y < HEIGHT; y++) /* but one pixel in 25, too few, is hidden here */
        for (int x = 300; x < WIDTH && y >= 200; x++)
            f.mask[y * WIDTH + x] = x % 5 != 0 || y % 5 != 0;
    rx_tphot_input input = field_input(&f);
    rx_fit_image_open(&input, (size_t)WIDTH * HEIGHT, 2, &canvas);
    assert_int_equal(
        rx_residual_sky_subtract(&canvas, &(rx_residual_sky){.segments = f.sources->segments, .cell = 100},
                                 &mean, NULL),
        RX_OK);
    assert_int_equal(rx_fit_image_load_rows(&canvas, 0, HEIGHT, NULL), RX_OK);
    /* the corner's cell has the mean of its three neighbours: its plane's value + 2/3 of a step in x and y */
    const double corner = (-0.01 + 0.02) * 100 * 2 / 3;
    assert_near(mean, 3 + corner / 12, 1e-5);
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        const int x = k % WIDTH, y = k / WIDTH;
        if (f.mask[k] || fabs((double)f.pixels[k]) > 900 || (x > 249 && y > 149))
            continue;
        const double u = fmin(fmax(x, 49.5), 349.5), v = fmin(fmax(y, 49.5), 249.5);
        assert_near(canvas.data[k], 0.01 * (x - u) - 0.02 * (y - v), 2e-5);
    }
    rx_fit_image_clear(&canvas);
    memset(f.mask, 1, WIDTH * HEIGHT); /* nothing is known: nothing is taken off */
    rx_fit_image_open(&input, (size_t)WIDTH * HEIGHT, 2, &canvas);
    assert_int_equal(
        rx_residual_sky_subtract(&canvas, &(rx_residual_sky){.segments = f.sources->segments, .cell = 100},
                                 &mean, NULL),
        RX_OK);
    assert_near(mean, 0, 0);
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

/* Clipping by its definition: one cell of noise with a tail. */
static void test_clipping(void **state)
{
    (void)state;
    enum { SIDE = 100, PIXELS = SIDE * SIDE };
    for (uint64_t seed = 1; seed <= 8; seed++) {
        field f;
        rx_fit_image canvas;
        double mean, middle = 0, limit = HUGE_VAL;
        field_open(&f, SIDE, SIDE, 3, 1, 0);
        for (int k = 0; k < PIXELS; k++)
            f.pixels[k] = (float)(5 * pow(fabs(rx_random_normal(seed, 0, (uint64_t)k)), 1.5) - 3);
        const rx_tphot_input input = field_input(&f);
        rx_fit_image_open(&input, PIXELS, 1, &canvas);
        assert_int_equal(
            rx_residual_sky_subtract(
                &canvas, &(rx_residual_sky){.segments = f.sources->segments, .cell = SIDE}, &mean, NULL),
            RX_OK);
        for (int round = 0, before = -1, n = 0; round < 10 && n != before; round++) {
            double sum = 0, square = 0;
            before = n;
            n = 0;
            for (int pass = 0; pass < 2; pass++)
                for (int k = 0; k < PIXELS; k++) {
                    if (fabs(f.pixels[k] - middle) > limit)
                        continue;
                    n += pass == 0;
                    sum += pass == 0 ? f.pixels[k] : 0;
                    square += pass == 1 ? pow(f.pixels[k] - sum / n, 2) : 0;
                }
            middle = sum / n;
            limit = 3 * sqrt(square / n);
        }
        assert_near(mean, middle, 1e-6);
        rx_fit_image_clear(&canvas);
        for (int less = 0; less < 2; less++) { /* 5 % of the pixels are enough */
            for (int k = 0; k < PIXELS; k++) {
                f.pixels[k] = 2;
                f.mask[k] = k % 20 != 0 || (less && k == 0);
            }
            rx_fit_image_open(&input, PIXELS, 1, &canvas);
            assert_int_equal(
                rx_residual_sky_subtract(
                    &canvas, &(rx_residual_sky){.segments = f.sources->segments, .cell = SIDE}, &mean, NULL),
                RX_OK);
            assert_near(mean, less ? 0 : 2, 1e-12);
            rx_fit_image_clear(&canvas);
        }
        field_close(&f);
    }
}

/* Groups of 500 boxes over any common pixel against a flood over all pairs. */
static void test_groups(void **state)
{
    (void)state;
    enum { BOXES = 500, WIDTH = 900, HEIGHT = 700 };
    static rx_footprint f[BOXES];
    static const rx_footprint *list[BOXES];
    static int group[BOXES];
    rx_blends blends;
    int largest = 0;
    for (int i = 0; i < BOXES; i++) {
        const int w = 10 + i % 23, h = 10 + i % 19;
        f[i] = boxed((int)((WIDTH - w) * rx_random_uniform(8, 1, (uint64_t)i)),
                     (int)((HEIGHT - h) * rx_random_uniform(8, 2, (uint64_t)i)), w, h, (uint64_t)i);
        list[i] = &f[i];
        group[i] = i;
    }
    for (int changed = 1; changed;) {
        changed = 0;
        for (int i = 0; i < BOXES; i++)
            for (int j = 0; j < BOXES; j++)
                if (group[j] < group[i] && f[i].x0 < f[j].x0 + f[j].width && f[j].x0 < f[i].x0 + f[i].width &&
                    f[i].y0 < f[j].y0 + f[j].height && f[j].y0 < f[i].y0 + f[i].height) {
                    group[i] = group[j];
                    changed = 1;
                }
    }
    rx_tphot_params par = {.group_limit = BOXES, .nthreads = 2};
    assert_int_equal(rx_blends_find(&par, list, BOXES, WIDTH, HEIGHT, &blends, NULL), RX_OK);
    for (int i = 0; i < BOXES; i++) {
        assert_int_equal(blends.member[blends.start[blends.group[i]]], group[i]);
        const int size = blends.start[blends.group[i] + 1] - blends.start[blends.group[i]];
        largest = size > largest ? size : largest;
    }
    assert_int_equal(blends.largest, largest);
    assert_true(blends.ngroups > 50);
    rx_blends_clear(&blends);
    par.group_limit = 4;
    assert_int_equal(rx_blends_find(&par, list, BOXES, WIDTH, HEIGHT, &blends, NULL), RX_OK);
    assert_int_equal(blends.largest, 4);
    rx_blends_clear(&blends);
    for (int i = 0; i < BOXES; i++)
        free(f[i].values);
}

/* Two boxes that have one row or column in common, or none, wherever they are. */
static void test_touch(void **state)
{
    (void)state;
    for (int k = 0; k < 400; k++) {
        const int at = k / 4, apart = 8 + k % 2, down = k / 2 % 2;
        rx_footprint f[2] = {boxed(down ? 5 : at, down ? at : 5, 9, 9, 1),
                             boxed(down ? 7 : at + apart, down ? at + apart : 7, 9, 9, 2)};
        const rx_footprint *list[2] = {&f[0], &f[1]};
        const rx_tphot_params par = {.group_limit = 2};
        rx_blends blends;
        assert_int_equal(rx_blends_find(&par, list, 2, 130, 130, &blends, NULL), RX_OK);
        assert_int_equal(blends.ngroups, 1 + k % 2);
        rx_blends_clear(&blends);
        free(f[0].values);
        free(f[1].values);
    }
}

/* Three in a row: a link holds up to its strength, and of two only the stronger where there is room for one. */
static void test_strength(void **state)
{
    (void)state;
    rx_footprint f[3] = {boxed(10, 10, 9, 9, 1), boxed(14, 12, 9, 9, 2), boxed(21, 14, 9, 9, 3)};
    const rx_footprint *list[3] = {&f[2], &f[1], &f[0]};
    double strength[2];
    rx_blends blends;
    for (int k = 0; k < 2; k++) {
        double ab = 0, aa = 0, bb = 0;
        for (int p = 0; p < 50 * 50; p++) {
            const double a = value_at(&f[k], p % 50, p / 50), b = value_at(&f[k + 1], p % 50, p / 50);
            ab += a * b;
            aa += a * a;
            bb += b * b;
        }
        strength[k] = ab / sqrt(aa * bb);
    }
    assert_true(strength[0] > 2 * strength[1]);
    for (int k = 0; k < 2; k++)
        for (int above = 0; above < 2; above++) {
            const rx_tphot_params par = {.link = strength[k] * (above ? 1.0002 : 0.9998), .group_limit = 3};
            assert_int_equal(rx_blends_find(&par, list, 3, 50, 50, &blends, NULL), RX_OK);
            assert_int_equal(blends.ngroups, 1 + (k == 0) + above);
            assert_int_equal(blends.ntorn, 0);
            rx_blends_clear(&blends);
        }
    const rx_tphot_params two = {.group_limit = 2};
    assert_int_equal(rx_blends_find(&two, list, 3, 50, 50, &blends, NULL), RX_OK);
    assert_int_equal(blends.ngroups, 2);
    assert_int_equal(blends.group[1], blends.group[2]);
    assert_int_equal(blends.cut[0], 1);
    assert_int_equal(blends.cut[1], 1);
    assert_int_equal(blends.cut[2], 0);
    assert_int_equal(blends.ntorn, 2);
    rx_blends_clear(&blends);
    for (int k = 0; k < 3; k++)
        free(f[k].values);
}

/* One source on its background: two unknowns by Cramer's rule. Held at 0 it has the error of its template
 * alone. */
static void test_alone(void **state)
{
    (void)state;
    static scene s;
    rx_fit_image canvas;
    const rx_joint_params par = {.background_sigma = 0.3}, held = {.non_negative = 1};
    scene_open(&s);
    scene_show(&s, H, 1, 0, &canvas);
    check_window(&s, &canvas, (rx_window){0, 0, W, H});
    for (int i = 0; i < N; i++) {
        double tt = 0, t1 = 0, one = 0, td = 0, d = 0, n = 0, background, covariance;
        rx_joint_member m = {.footprint = &s.t[i], .before = s.flux[i]};
        for (int k = 0; k < W * H; k++) {
            const double t = value_at(&s.t[i], k % W, k / W), w = t > 0 ? s.weight[k] : 0;
            const double rest = s.data[k] - s.model[k] + s.flux[i] * t;
            tt += w * t * t;
            t1 += w * t;
            one += w;
            td += w * t * rest;
            d += w * rest;
            n += w > 0;
        }
        const double prior = one / n / (0.3 * 0.3), det = tt * (one + prior) - t1 * t1;
        assert_int_equal(rx_joint_fit(&par, &canvas, 1, &m, &background, &covariance, NULL), RX_OK);
        assert_near(m.flux, (td * (one + prior) - d * t1) / det, 1e-4 * sqrt(m.variance));
        assert_near(background, (d * tt - td * t1) / det, 1e-4 / sqrt(one));
        assert_close(m.variance, (one + prior) / det, 1e-5);
        assert_close(covariance, m.variance, 1e-12);
        assert_close(m.alone, 1 / tt, 1e-5);
        assert_near(m.blend, 0, 0);
        assert_int_equal(rx_joint_fit(&held, &canvas, 1, &m, &background, NULL, NULL), RX_OK);
        assert_near(m.flux, fmax(td / tt, 0), 1e-4 * sqrt(m.variance));
        assert_close(m.variance, 1 / tt, 1e-5);
        assert_int_equal(m.flags, td < 0 ? RX_TPHOT_BOUND : 0);
        assert_near(background, 0, 0);
    }
    rx_fit_image_clear(&canvas);
    scene_close(&s);
}

/* What a member's template, or its slope along x or y, has in a pixel. */
static double unknown_at(const rx_footprint *f, int what, int x, int y)
{
    const int u = what == 1, v = what == 2;
    if (what == 0 || value_at(f, x, y) <= 0)
        return value_at(f, x, y);
    return 0.5 * (value_at(f, x + u, y + v) - value_at(f, x - u, y - v));
}

/* What is left of the data is at right angles to each template and slope, and to the background, but for what
 * the priors pull. */
static void check_equations(const scene *s, const rx_joint_member *m, double background)
{
    static double rest[W * H];
    double one = 0, n = 0, left = 0;
    for (int k = 0; k < W * H; k++) {
        double any = 0;
        rest[k] = s->data[k] - s->model[k] - background;
        for (int i = 0; i < N; i++) {
            any = fmax(any, value_at(&s->t[i], k % W, k / W));
            rest[k] += (s->flux[i] - m[i].flux) * unknown_at(&s->t[i], 0, k % W, k / W);
            for (int d = 0; d < 2; d++)
                rest[k] += s->flux[i] * m[i].shift[d] * unknown_at(&s->t[i], 1 + d, k % W, k / W);
        }
        if (any > 0 && s->weight[k] > 0) {
            one += s->weight[k];
            left += s->weight[k] * rest[k];
            n++;
        }
    }
    assert_near(left, background * one / n / (0.3 * 0.3), 1e-3 * sqrt(one / n) / 0.3);
    for (int i = 0; i < N; i++)
        for (int what = 0; what < 3; what++) {
            const double width = s->flux[i] * m[i].shift_width;
            double sum = 0, power = 0, prior = 0;
            for (int k = 0; k < W * H; k++) {
                const double t = unknown_at(&s->t[i], what, k % W, k / W);
                sum += s->weight[k] * t * rest[k];
                power += s->weight[k] * t * t;
            }
            if (what > 0 && width <= 0) /* stays */
                continue;
            if (what > 0) {
                prior = s->flux[i] * (m[i].shift_centre[what - 1] - m[i].shift[what - 1]) / width / width;
                power += 1 / width / width;
            }
            assert_near(sum, prior, 1e-4 * sqrt(power));
        }
}

/* All together, by one thread and by three: the same, and the coefficients are those of the covariance. */
static void test_together(void **state)
{
    (void)state;
    static scene s;
    rx_fit_image canvas;
    rx_joint_member m[2][N];
    double background[2], covariance[2][N * N];
    scene_open(&s);
    scene_show(&s, H, 1, 0, &canvas);
    check_window(&s, &canvas, (rx_window){0, 0, W, H});
    for (int turn = 0; turn < 2; turn++) {
        const rx_joint_params par = {.background_sigma = 0.3, .nthreads = 1 + 2 * turn};
        for (int i = 0; i < N; i++)
            m[turn][i] = (rx_joint_member){.grain = 1,
                                           .footprint = &s.t[i],
                                           .before = s.flux[i],
                                           .shift_width = (double[]){0, 0.02, 2}[i % 3],
                                           .shift_centre = {0.1, -0.1}};
        assert_int_equal(rx_joint_fit(&par, &canvas, N, m[turn], &background[turn], covariance[turn], NULL),
                         RX_OK);
    }
    assert_memory_equal(m[0], m[1], sizeof m[0]);
    assert_memory_equal(covariance[0], covariance[1], sizeof covariance[0]);
    assert_true(background[0] == background[1]);
    check_equations(&s, m[0], background[0]);
    for (int i = 0; i < N; i++) {
        double most = 0;
        for (int j = 0; j < N; j++)
            if (j != i)
                most = fmax(most, fabs(covariance[0][i * N + j]) /
                                      sqrt(covariance[0][i * N + i] * covariance[0][j * N + j]));
        assert_close(m[0][i].blend, most, 1e-9);
        assert_true(most > 0);
        assert_close(m[0][i].alone, 1 / rx_footprint_product(&s.t[i], &s.t[i], &canvas), 1e-9);
    }
    rx_fit_image_clear(&canvas);
    scene_close(&s);
}

typedef struct visit {
    const rx_fit_image *canvas;
    const rx_window *windows;
    int n, last;
} visit;

static rx_status visit_one(void *user, int i, int thread, rx_error *err)
{
    visit *v = user;
    const rx_fit_image *c = v->canvas;
    (void)err;
    assert_int_equal(thread, 0);
    assert_true(v->windows[i].y0 >= c->top);
    assert_true(v->windows[i].y1 <= c->top + c->rows);
    assert_int_equal(c->rows, rx_fit_image_rows(c)); /* never more than usual */
    assert_true(v->windows[i].y0 >= v->last);
    v->last = v->windows[i].y0;
    v->n++;
    return RX_OK;
}

/* Windows are taken downwards, as many at a time as fit. */
static void test_turns(void **state)
{
    (void)state;
    enum { WINDOWS = 60 };
    static scene s;
    rx_fit_image canvas;
    rx_window windows[WINDOWS];
    scene_open(&s);
    scene_show(&s, 20, 1, 0, &canvas);
    for (int i = 0; i < WINDOWS; i++) {
        const int y = (int)((H - 10) * rx_random_uniform(9, 1, (uint64_t)i));
        windows[i] = (rx_window){i, y, i + 20, y + 1 + i % 10};
    }
    visit v = {&canvas, windows, 0, 0};
    assert_int_equal(rx_windows_run(&canvas, windows, WINDOWS, 0, visit_one, &v, NULL), RX_OK);
    assert_int_equal(v.n, WINDOWS);
    rx_fit_image_clear(&canvas);
    scene_close(&s);
}

static bool at_the_fifth(void *user)
{
    return ++*(int *)user >= 5;
}

/* The caller is asked between the pieces, in any order and one after the other, and by threads, too. */
static void test_turns_stop(void **state)
{
    (void)state;
    enum { WINDOWS = 60 };
    static scene s;
    rx_window windows[WINDOWS];
    scene_open(&s);
    for (int i = 0; i < WINDOWS; i++)
        windows[i] = (rx_window){i, i, i + 20, i + 8};
    for (int in_order = 0; in_order < 2; in_order++) {
        int asked = 0;
        rx_error err = RX_ERROR_NONE;
        rx_fit_image canvas;
        scene_show(&s, 20, 1, 0, &canvas);
        visit v = {&canvas, windows, 0, 0};
        err.stop = at_the_fifth;
        err.user = &asked;
        assert_int_equal(rx_windows_run(&canvas, windows, WINDOWS, in_order, visit_one, &v, &err),
                         RX_INTERRUPTED);
        assert_string_equal(err.text, "stopped by the caller");
        assert_in_range(v.n, 1, 4);
        rx_fit_image_clear(&canvas);
    }
    scene_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_definition), cmocka_unit_test(test_patch),
                                       cmocka_unit_test(test_crop),       cmocka_unit_test(test_tilted_sky),
                                       cmocka_unit_test(test_clipping),   cmocka_unit_test(test_groups),
                                       cmocka_unit_test(test_touch),      cmocka_unit_test(test_strength),
                                       cmocka_unit_test(test_alone),      cmocka_unit_test(test_together),
                                       cmocka_unit_test(test_turns),      cmocka_unit_test(test_turns_stop)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
