/* The parts of template photometry one by one. */
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
#include "num/convolve.h"
#include "num/lsq.h"
#include "psf/moffat.h"
#include "psf/psf.h"
#include "template/blends.h"
#include "template/fit.h"
#include "template/fit_image.h"
#include "template/joint.h"
#include "template/patch.h"
#include "template/residual_sky.h"
#include "template/spergel.h"
#include "template/template_otf.h"
#include "template/template_residual.h"

/* An exponential disk holds half of its light within 1.67835 scale lengths; gradients against differences. */
static void test_spergel(void **state)
{
    (void)state;
    const rx_spergel p = {2.5, 0.2, -0.1, 0.3};
    rx_spergel_form form;
    double slope, gradient[4];
    assert_near(rx_spergel_half_light(0.5, &slope), 1.67834699, 1e-4);
    const double numeric =
        (log(rx_spergel_half_light(1.501, NULL)) - log(rx_spergel_half_light(1.499, NULL))) /
        (log(2.501) - log(2.499));
    rx_spergel_half_light(1.5, &slope);
    assert_near(slope, numeric, 1e-6);
    rx_spergel_set(&p, &form);
    assert_near(rx_spergel_at(&form, 0, 0, NULL), 1, 1e-15);
    rx_spergel_at(&form, 0.11, -0.07, gradient);
    for (int k = 0; k < 4; k++) {
        double at[2];
        for (int side = 0; side < 2; side++) {
            const double step = side ? 1e-5 : -1e-5;
            rx_spergel q = p;
            q.radius *= k == 0 ? exp(step) : 1;
            q.g1 += k == 1 ? step : 0;
            q.g2 += k == 2 ? step : 0;
            q.nu = k == 3 ? expm1(log1p(q.nu) + step) : q.nu;
            rx_spergel_set(&q, &form);
            at[side] = rx_spergel_at(&form, 0.11, -0.07, NULL);
        }
        assert_near(gradient[k], (at[1] - at[0]) / 2e-5, 1e-8);
    }
    /* an exponential of scale h has the transform (1 + (2 pi h k)^2)^-3/2 */
    const rx_spergel disk = {1.67834699 * 2, 0, 0, 0.5};
    rx_spergel_set(&disk, &form);
    const double u = 2 * 3.14159265358979323846 * 2 * 0.1;
    assert_near(rx_spergel_at(&form, 0.06, 0.08, NULL), pow(1 + u * u, -1.5), 1e-4);
}

/* The kernel restored PSF -> tile's PSF, on the restored PSF itself, gives the tile's. */
static void test_kernel(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++) {
        static const double fwhm[3] = {2.5, 4, 6};
        rx_psf *tile = NULL, *narrow = rx_psf_new(RX_PSF_GAUSS, 11, 1);
        rx_template_otf *lens;
        rx_template_domain *size = NULL;
        float weights[11];
        assert_int_equal(rx_psf_moffat(fwhm[k], 3.5, 1, 0, 41, &tile, NULL), RX_OK);
        assert_non_null(narrow);
        rx_gauss_weights(2, 5, weights);
        for (int i = 0; i < 121; i++)
            narrow->basis[i] = weights[i / 11] * weights[i % 11];
        assert_int_equal(rx_template_otf_new(tile, narrow, &lens, NULL), RX_OK);
        assert_int_equal(rx_template_otf_at(lens, rx_template_otf_side(lens, 3, 0), 10, 10, &size, NULL),
                         RX_OK);
        const rx_matching *matching = rx_template_domain_matching(size);
        rx_template_domain_render(size, NULL, 0.3, -0.2, matching, 1);
        rx_template_domain_blur(size, matching);
        const size_t stride = (size_t)rx_fft_stride_real(size->fft), n = (size_t)size->n;
        float *blurred = RX_NEW(float, n *stride);
        assert_non_null(blurred);
        memcpy(blurred, size->plane[0], n * stride * sizeof(float));
        rx_template_domain_render(size, NULL, 0.3, -0.2, NULL, 1);
        double peak = 0, worst = 0, sum = 0;
        for (size_t y = 0; y < n; y++)
            for (size_t x = 0; x < n; x++) {
                peak = fmax(peak, size->plane[0][y * stride + x]);
                worst = fmax(worst, fabs((double)size->plane[0][y * stride + x] - blurred[y * stride + x]));
                sum += blurred[y * stride + x];
            }
        assert_near(sum, 1, 1e-5);
        assert_true(worst < (k == 0 ? 5e-3 : 1e-3) * peak);
        free(blurred);
        rx_template_otf_free(lens);
        rx_psf_free(tile);
        rx_psf_free(narrow);
    }
}

/* Three overlapping templates, a background with a prior and a shift of one of them, against singular values.
 */
static void test_joint(void **state)
{
    (void)state;
    enum { W = 24, H = 20, COLUMNS = 6, ROWS = W * H + 3 };
    field f;
    rx_fit_image canvas;
    field_open(&f, W, H, 3, 1, 0);
    for (int k = 0; k < W * H; k++) {
        f.pixels[k] = (float)(5 * rx_random_normal(3, 1, (uint64_t)k));
        f.sigma[k] = (float)(0.5 + rx_random_uniform(3, 2, (uint64_t)k));
        f.mask[k] = k % 11 == 0;
    }
    const rx_tphot_input input = field_input(&f);
    rx_fit_image_open(&input, (size_t)W * H, 1, &canvas);
    rx_footprint t[3] = {boxed(2, 2, 10, 9, 1), boxed(8, 5, 12, 10, 2), boxed(0, 0, W, H, 3)};
    rx_layer *layers = RX_NEW(rx_layer, 3);
    assert_non_null(layers);
    for (int i = 0; i < 3; i++)
        layers[i] = (rx_layer){t[i], (double[3]){3, -2, 1}[i]};
    rx_fit_image_set(&canvas, layers, 3);
    assert_int_equal(rx_fit_image_load_rows(&canvas, 0, H, NULL), RX_OK);
    rx_joint_member m[3];
    for (int i = 0; i < 3; i++)
        m[i] = (rx_joint_member){.grain = 1, .footprint = &t[i], .before = layers[i].flux};
    m[0].shift_width = 0.4;
    m[0].shift_centre[0] = 0.1;
    m[0].shift_centre[1] = -0.2;
    const rx_joint_params par = {.background_sigma = 0.3};
    double background, covariance[9];
    assert_int_equal(rx_joint_fit(&par, &canvas, 3, m, &background, covariance, NULL), RX_OK);

    double *a = RX_NEW(double, ROWS *COLUMNS), *b = RX_NEW(double, ROWS), *w = RX_NEW(double, ROWS);
    double x[COLUMNS], c[COLUMNS * COLUMNS], sw = 0, n = 0;
    assert_non_null(a);
    assert_non_null(b);
    assert_non_null(w);
    for (int k = 0; k < W * H; k++) {
        for (int i = 0; i < 3; i++) {
            const int u = k % W - t[i].x0, v = k / W - t[i].y0;
            const int in = u >= 0 && v >= 0 && u < t[i].width && v < t[i].height;
            a[k * COLUMNS + i] = in ? t[i].values[v * t[i].width + u] : 0;
            if (i != 0 || !in)
                continue;
            const float *at = t[i].values + v * t[i].width + u;
            a[k * COLUMNS + 3] =
                0.5 * ((u + 1 < t[i].width ? (double)at[1] : 0) - (u > 0 ? (double)at[-1] : 0));
            a[k * COLUMNS + 4] = 0.5 * ((v + 1 < t[i].height ? (double)at[t[i].width] : 0) -
                                        (v > 0 ? (double)at[-t[i].width] : 0));
        }
        a[k * COLUMNS + 5] = 1;
        b[k] = f.mask[k] ? 0 : f.pixels[k];
        w[k] = f.mask[k] ? 0 : 1 / ((double)f.sigma[k] * f.sigma[k]);
        sw += w[k];
        n += w[k] > 0;
    }
    for (int d = 0; d < 2; d++) { /* the priors as equations */
        a[(W * H + d) * COLUMNS + 3 + d] = 1;
        b[W * H + d] = -3 * m[0].shift_centre[d];
        w[W * H + d] = 1 / (1.2 * 1.2);
    }
    a[(W * H + 2) * COLUMNS + 5] = 1;
    w[W * H + 2] = sw / n / (0.3 * 0.3);
    assert_int_equal(rx_lsq_linear(&(rx_lsq_equations){ROWS, COLUMNS, a, b, w}, x, c, NULL, NULL), RX_OK);
    for (int i = 0; i < 3; i++) {
        assert_near(m[i].flux, x[i], 1e-4 * (1 + fabs(x[i])));
        for (int j = 0; j < 3; j++)
            assert_near(covariance[i * 3 + j], c[i * COLUMNS + j],
                        1e-4 * sqrt(c[i * COLUMNS + i] * c[j * COLUMNS + j]));
        assert_near(m[i].variance, c[i * COLUMNS + i], 1e-4 * c[i * COLUMNS + i]);
    }
    assert_near(m[0].shift[0], -x[3] / 3, 1e-4);
    assert_near(m[0].shift[1], -x[4] / 3, 1e-4);
    assert_near(background, x[5], 1e-4);
    for (int i = 0; i < 3; i++)
        free(t[i].values);
    free(a);
    free(b);
    free(w);
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

/* Links against every pair, groups against their definition. */
static void test_blends(void **state)
{
    (void)state;
    enum { N = 80 };
    rx_footprint f[N];
    const rx_footprint *list[N];
    rx_tphot_params par = {.link = 0.2, .group_limit = 100, .nthreads = 1};
    rx_blends blends;
    for (int i = 0; i < N; i++) {
        const int x = (int)(280 * rx_random_uniform(7, 1, (uint64_t)i));
        const int y = (int)(180 * rx_random_uniform(7, 2, (uint64_t)i));
        f[i] = boxed(x, y, 8 + i % 9, 8 + i % 7, (uint64_t)i);
        list[i] = &f[i];
    }
    free(f[5].values);
    f[5] = (rx_footprint){0}; /* wholly outside */
    assert_int_equal(rx_blends_find(&par, list, N, 300, 200, &blends, NULL), RX_OK);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < i; j++) {
            const double norm =
                rx_footprint_product(list[i], list[i], NULL) * rx_footprint_product(list[j], list[j], NULL);
            if (norm > 0 && rx_footprint_product(list[i], list[j], NULL) > 0.2 * sqrt(norm))
                assert_int_equal(blends.group[i], blends.group[j]);
        }
    assert_true(blends.largest > 2);
    assert_true(blends.ngroups > 10);
    assert_true(blends.start[blends.ngroups] == N);
    for (int g = 0; g < blends.ngroups; g++)
        for (int k = blends.start[g]; k < blends.start[g + 1]; k++) {
            assert_int_equal(blends.group[blends.member[k]], g);
            assert_int_equal(blends.cut[blends.member[k]], 0);
        }
    rx_blends_clear(&blends);
    par.group_limit = 2;
    par.nthreads = 3;
    assert_int_equal(rx_blends_find(&par, list, N, 300, 200, &blends, NULL), RX_OK);
    assert_true(blends.largest == 2);
    rx_blends_clear(&blends);
    for (int i = 0; i < N; i++)
        free(f[i].values);
}

/* Rows that come and go, against a canvas that shows all at once: pixels, sky, models and what was added to
 * them later. */
static void test_canvas(void **state)
{
    (void)state;
    enum { W = 90, H = 200, ROWS = 30, N = 12 };
    field f;
    rx_fit_image all, some;
    rx_fit_image *both[2] = {&all, &some};
    rx_footprint t[N];
    field_open(&f, W, H, 3, 1, 0);
    for (int k = 0; k < W * H; k++) {
        f.pixels[k] = (float)rx_random_normal(4, 1, (uint64_t)k);
        f.sigma[k] = k % 19 == 0 ? 0 : (float)(0.5 + rx_random_uniform(4, 2, (uint64_t)k));
        f.mask[k] = k % 13 == 0;
    }
    f.pixels[40] = NAN;
    for (int i = 0; i < N; i++)
        t[i] = boxed(5 * i, 15 * i, 20 + i, 18, (uint64_t)i);
    rx_tphot_input input = field_input(&f);
    input.image.gain = 3;
    for (int i = 0; i < 2; i++) {
        rx_layer *layers = RX_NEW(rx_layer, N - 2);
        assert_non_null(layers);
        for (int k = 0; k < N - 2; k++)
            layers[k] = (rx_layer){t[k], 2 + k};
        rx_fit_image_open(&input, (size_t)(i == 0 ? H : ROWS) * W, 1 + i, both[i]);
        both[i]->psf_error = 0.1;
        assert_int_equal(rx_fit_image_rows(both[i]), i == 0 ? H : ROWS);
        rx_fit_image_set(both[i], layers, N - 2);
        assert_int_equal(rx_fit_image_load_rows(both[i], 0, ROWS, NULL), RX_OK);
        for (int turn = 0; turn < 2; turn++) {
            rx_sky_mesh sheet;
            assert_int_equal(rx_sky_mesh_open(W, H, 40, &sheet, NULL), RX_OK);
            assert_true(sheet.nx == 2);
            assert_true(sheet.ny == 5);
            for (int k = 0; k < 10; k++)
                sheet.value[k] = rx_random_normal(5, (uint64_t)turn, (uint64_t)k);
            assert_int_equal(rx_fit_image_subtract(both[i], &sheet, NULL), RX_OK);
            assert_int_equal(rx_fit_image_add(both[i], &t[N - 2 + turn], -0.7, NULL), RX_OK);
        }
    }
    assert_int_equal(rx_fit_image_load_rows(&all, 0, H, NULL), RX_OK);
    for (int from = H - ROWS; from >= 0; from -= 17) {
        const rx_window windows[2] = {{0, from, 40, from + 20}, {35, from + 3, W, from + ROWS}};
        assert_int_equal(rx_fit_image_load(&some, windows, NULL, 2, NULL), RX_OK);
        assert_true(some.room == (size_t)ROWS * W);
        for (int y = from; y < from + ROWS; y++)
            for (int x = 0; x < W; x++) {
                const size_t k = rx_fit_image_row(&some, y) + (size_t)x,
                             m = rx_fit_image_row(&all, y) + (size_t)x;
                if ((x >= 40 || y >= from + 20) && (x < 35 || y < from + 3))
                    continue;
                assert_true(some.data[k] == all.data[m]);
                assert_true(some.model[k] == all.model[m]);
                assert_true(some.weight[k] == all.weight[m]);
                assert_true(some.sigma[k] == all.sigma[m]);
            }
    }
    assert_true(all.weight[0] == 0);
    assert_true(all.weight[40] == 0);
    assert_true(all.weight[19] == 0);
    assert_true(rx_fit_image_variance(&some, 40, 0) == 0);
    assert_true(rx_fit_image_variance(&some, 13, 0) == 0);
    assert_true(rx_fit_image_variance(&some, 1, 0) == f.sigma[1] * f.sigma[1]);
    assert_int_equal(rx_fit_image_load_rows(&some, 10, 10 + 3 * ROWS, NULL), RX_OK); /* more than usual */
    assert_memory_equal(some.model + rx_fit_image_row(&some, 10), all.model + 10 * W,
                        sizeof(float) * 3 * ROWS * W);
    for (int i = 0; i < 2; i++)
        rx_fit_image_clear(both[i]);
    for (int i = 0; i < N; i++)
        free(t[i].values);
    field_close(&f);
}

/* A tilted sky comes off, sources in segments and masked pixels have no say. */
static void test_undersky(void **state)
{
    (void)state;
    enum { W = 400, H = 300 };
    field f;
    rx_fit_image canvas;
    double mean;
    field_open(&f, W, H, 3, 1, 3);
    for (int k = 0; k < W * H; k++)
        f.pixels[k] = (float)(0.3 + 0.001 * (k % W - 200));
    field_noise(&f, 5);
    field_list(&f, 100, 100, 30, 1, 1, 0);
    for (int k = 0; k < W * H; k++) {
        f.pixels[k] += f.sources->segments[k] ? 1000 : 0;
        f.mask[k] = k % W > 300 && k / W > 200 ? 1 : 0;
        f.pixels[k] = f.mask[k] ? NAN : f.pixels[k];
    }
    const rx_tphot_input input = field_input(&f);
    rx_fit_image_open(&input, (size_t)W * H, 2, &canvas);
    assert_int_equal(
        rx_residual_sky_subtract(&canvas, &(rx_residual_sky){.segments = f.sources->segments, .cell = 100},
                                 &mean, NULL),
        RX_OK);
    assert_int_equal(rx_fit_image_load_rows(&canvas, 0, H, NULL), RX_OK);
    assert_near(mean, 0.3, 0.02);
    double sum[2] = {0}, n[2] = {0};
    for (int k = 0; k < W * H; k++)
        if (!f.mask[k] && !f.sources->segments[k]) {
            sum[k % W > 200] += canvas.data[k];
            n[k % W > 200]++;
        }
    assert_near(sum[0] / n[0], 0, 0.02);
    assert_near(sum[1] / n[1], 0, 0.02);
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

enum { LW = 200, LH = 75, LSIDE = 5 };

/* What test_leftover() filters: data, model and weight as the canvas should show them. */
typedef struct scene {
    float data[LW * LH], model[LW * LH], weight[LW * LH], sigma[LW * LH], pixels[LW * LH];
    float level[LW * LH], sky[LW * LH];
    uint8_t mask[LW * LH];
} scene;

/* L of one pixel by its definition. */
static double largest_light(const rx_template_residual *of, const scene *s, int x, int y)
{
    double most = 0;
    for (int k = 0; k < LW * LH; k++)
        if (abs(k % LW - x) <= of->reach && abs(k / LW - y) <= of->reach && s->weight[k] > 0)
            most = fmax(most, of->pixels[k] - of->level.plane[k] - (s->data[k] - s->model[k]));
    return most;
}

/* Filtered residual and noise of one pixel, by their definitions. */
static void filter_plainly(const rx_template_residual *of, const scene *s, int x, int y, double *value,
                           double *noise)
{
    double square = 0, norm = 0;
    *value = 0;
    for (int j = 0; j < LSIDE; j++)
        for (int i = 0; i < LSIDE; i++) {
            const int u = x + i - LSIDE / 2, v = y + j - LSIDE / 2, k = v * LW + u;
            const int inside = u >= 0 && v >= 0 && u < LW && v < LH;
            const double f = of->filter[j * LSIDE + i];
            if (inside && !(s->weight[k] > 0))
                continue;
            norm += fabs(f);
            if (!inside)
                continue;
            *value += f * (s->data[k] - s->model[k]);
            square += fabs(f) * (1 / s->weight[k] + pow(of->model_error * largest_light(of, s, u, v), 2));
        }
    *noise = sqrt(square / norm);
}

static void set_scene(scene *s)
{
    for (int k = 0; k < LW * LH; k++) {
        s->model[k] = (float)fmax(0, rx_random_uniform(1, 0, (uint64_t)k) * 8 - 6);
        s->level[k] = 3 + 0.5f * (float)rx_random_uniform(1, 3, (uint64_t)k);
        s->sky[k] = 3.5f;
        s->pixels[k] = s->model[k] + (float)rx_random_uniform(1, 1, (uint64_t)k) + s->sky[k];
        s->data[k] = s->pixels[k] - s->sky[k];
        s->sigma[k] = (float)(0.8 + 0.5 * rx_random_uniform(1, 2, (uint64_t)k));
        s->mask[k] = k / LW > 68 && k % 37 == 0;
        s->weight[k] = s->mask[k] ? 0 : 1 / (s->sigma[k] * s->sigma[k]);
    }
}

/* The scene on a canvas with room for so many rows. */
static void show_scene(const rx_tphot_input *input, scene *s, int rows, int nthreads, rx_fit_image *canvas)
{
    rx_layer *layer = RX_NEW(rx_layer, 1);
    assert_non_null(layer);
    *layer = (rx_layer){{.width = LW, .height = LH, .values = s->model, .inside = 1}, 1};
    rx_fit_image_open(input, (size_t)rows * LW, nthreads, canvas);
    rx_fit_image_set(canvas, layer, 1);
}

/* Strips, borders and hidden pixels against the definition; the same bytes for any number of threads and of
 * rows in memory, and for the rows below a strip alone. */
static void test_leftover(void **state)
{
    (void)state;
    static scene s;
    static float filtered[2][LW * LH], noise[2][LW * LH];
    static uint8_t mask[LW * LH];
    static rx_template_residual_pixel spots[2][LW * LH];
    float filter[LSIDE * LSIDE];
    rx_fit_image canvas[2];
    set_scene(&s);
    for (int i = 0; i < LSIDE * LSIDE; i++)
        filter[i] = (i % 3 == 0 ? -1.0f : 1.0f) / (LSIDE * LSIDE);
    const rx_tphot_input input = {.image = {.width = LW,
                                            .height = LH,
                                            .pixels = s.pixels,
                                            .with_sky = 1,
                                            .level = rx_map_plane(s.sky, LW),
                                            .noise = rx_map_plane(s.sigma, LW),
                                            .mask = s.mask,
                                            .hide = 1}};
    rx_template_residual of = {.grain = 1,
                               .pixels = s.pixels,
                               .level = rx_map_plane(s.level, LW),
                               .reach = 2,
                               .model_error = 0.3,
                               .filter = filter,
                               .side = LSIDE};
    for (int i = 0; i < 2; i++) {
        show_scene(&input, &s, i == 0 ? LH : 20, i == 0 ? 1 : 3, &canvas[i]);
        of.canvas = &canvas[i];
        of.nthreads = canvas[i].nthreads;
        assert_int_equal(rx_template_residual_filter(&of, 0, LH, filtered[i], noise[i], mask, NULL), RX_OK);
        for (int k = 0; k < LW * LH; k++)
            spots[i][k] = (rx_template_residual_pixel){.x = k % LW, .y = k / LW};
        assert_int_equal(rx_template_residual_at(&of, spots[i], LW * LH, NULL), RX_OK);
    }
    assert_memory_equal(filtered[0], filtered[1], sizeof filtered[0]);
    assert_memory_equal(noise[0], noise[1], sizeof noise[0]);
    for (int k = 0; k < LW * LH; k += 3) {
        double value, error;
        assert_int_equal(mask[k], !(s.weight[k] > 0));
        if (mask[k])
            continue;
        filter_plainly(&of, &s, k % LW, k / LW, &value, &error);
        assert_near(filtered[0][k], value, 1e-5);
        assert_near(noise[0][k] / error, 1, 1e-5);
        const double light = largest_light(&of, &s, k % LW, k / LW);
        assert_near(spots[0][k].light, light, 1e-5);
        assert_true(spots[1][k].light == spots[0][k].light);
        assert_near(spots[0][k].sigma, hypot(s.sigma[k], of.model_error * light), 1e-5);
        assert_true(spots[1][k].sigma == spots[0][k].sigma);
        assert_close(spots[0][k].weight, s.weight[k], 1e-6);
    }
    /* the first strip hides nothing: noise is not filtered where nothing can be above the threshold */
    const double thresholds[] = {1e-6, 0.1, 0.3, 5};
    for (int i = 0; i < 4; i++) {
        int least = 0;
        of.threshold = thresholds[i];
        assert_int_equal(rx_template_residual_filter(&of, 0, 64, filtered[1], noise[1], mask, NULL), RX_OK);
        assert_memory_equal(filtered[0], filtered[1], 64 * LW * sizeof(float));
        for (int k = 0; k < 64 * LW; k++) {
            const int found = filtered[0][k] >= of.threshold * (double)noise[0][k];
            assert_true(noise[1][k] == noise[0][k] || (!found && noise[1][k] < noise[0][k]));
            least += noise[1][k] != noise[0][k];
        }
        /* by 64 pixels of a row, but for those that the border reaches into */
        assert_true(i == 0 ? least == 0 : least % 64 == 0 && (i < 3 || least == 62 * 128));
    }
    of.threshold = 0;
    assert_int_equal(rx_template_residual_filter(&of, 64, LH, filtered[1], noise[1], mask, NULL), RX_OK);
    assert_memory_equal(filtered[0] + 64 * LW, filtered[1], (size_t)(LH - 64) * LW * sizeof(float));
    for (int i = 0; i < 2; i++)
        rx_fit_image_clear(&canvas[i]);
    for (int k = 0; k < LW * LH; k += 31) { /* one alone: nothing else has been shown before */
        rx_template_residual_pixel spot = {.x = k % LW, .y = k / LW};
        show_scene(&input, &s, LH, 1, &canvas[0]);
        of.canvas = &canvas[0];
        assert_int_equal(rx_template_residual_at(&of, &spot, 1, NULL), RX_OK);
        assert_true(spot.light == spots[0][k].light);
        rx_fit_image_clear(&canvas[0]);
    }
}

/* A star that its pixels do not sample: with samples between them it is drawn as it is, wherever in a pixel it lies, and
 * what is barely extended as the star; without, parts of a pixel are off by a thirtieth of the peak. */
static void test_narrow_star(void **state)
{
    (void)state;
    rx_psf *psf = NULL;
    double shape[RX_MOFFAT_SHAPE], worst[3] = {0};
    rx_moffat truth;
    assert_int_equal(rx_psf_moffat(1.5, 3.0, 0.9, 0.6, 41, &psf, NULL), RX_OK);
    rx_moffat_shape(1.5, 3.0, 0.9, 0.6, shape);
    rx_moffat_set(&truth, shape);
    assert_int_equal(rx_psf_fine(psf), 2);
    double sum = 0.0;
    for (int i = 0; i < 41 * 41; i++)
        sum += rx_moffat_pixel(&truth, i % 41 - 20, i / 41 - 20, NULL);
    for (int way = 0; way < 3; way++) { /* the star, almost the star, the star without samples */
        rx_template_otf *lens = NULL;
        if (way == 2) {
            free(psf->samples);
            psf->samples = NULL;
        }
        assert_int_equal(rx_template_otf_new(psf, NULL, &lens, NULL), RX_OK);
        for (int k = 0; k < 9; k++) {
            const double dx = -0.45 + 0.3 * (k % 3), dy = 0.4 - 0.35 * (k / 3);
            const rx_spergel dot = {0.01, 0.0, 0.0, 0.5};
            rx_template_domain *size = NULL;
            assert_int_equal(rx_template_otf_at(lens, rx_template_otf_side(lens, 1.0, 0), 0, 0, &size, NULL),
                             RX_OK);
            rx_template_domain_render(size, way == 1 ? &dot : NULL, dx, dy, NULL, 1);
            const int stride = rx_fft_stride_real(size->fft), middle = size->n / 2;
            for (int j = -12; j <= 12; j++)
                for (int i = -12; i <= 12; i++)
                    worst[way] =
                        fmax(worst[way], fabs((double)size->plane[0][(middle + j) * stride + middle + i] -
                                              rx_moffat_pixel(&truth, i - dx, j - dy, NULL) / sum));
        }
        rx_template_otf_free(lens);
    }
    const double peak = (double)psf->basis[20 * 41 + 20];
    assert_near(worst[0] / peak, 0.0, 5e-4);
    assert_near(worst[1] / peak, 0.0, 5e-4);
    assert_true(worst[2] > 0.03 * peak);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_spergel),  cmocka_unit_test(test_kernel),
                                       cmocka_unit_test(test_joint),    cmocka_unit_test(test_blends),
                                       cmocka_unit_test(test_canvas),   cmocka_unit_test(test_undersky),
                                       cmocka_unit_test(test_leftover), cmocka_unit_test(test_narrow_star)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
