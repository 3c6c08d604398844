/* What restored pixels add to a profile, against the formulas of substructure.h written out. */
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
#include "template/patch.h"
#include "template/substructure.h"
#include "template/template_otf.h"

enum { W = 150, H = 110, CX = 60, CY = 20, HALF = 20, SIDE = 2 * HALF + 1, MOST = 160 };

static const double FWHM = 4, FLUX = 3000;

/* A disk near the lower border with bumps, two neighbours, and noise in between. */
typedef struct scene {
    field f;
    rx_tphot_input input;
    rx_fit_image canvas;
    rx_refine_view view;
    rx_fit_source s;
    uint8_t hidden[W * H];
    float given[W * H]; /* noise of the restored pixels */
    rx_template_otf *lens, *other;
    rx_template_domain *size, *own;
    const rx_matching *matching;
    rx_patch patch;
    float d[MOST * MOST], t[MOST * MOST], kd[MOST * MOST]; /* [n][n]: D, T, K * D */
    double cost;
} scene;

static int by_value(const void *a, const void *b)
{
    return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

static void read_plane(const rx_template_domain *size, float *dst)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft);
    for (int k = 0; k < size->n * size->n; k++)
        dst[k] = size->plane[0][(size_t)(k / size->n) * stride + (size_t)(k % size->n)];
}

static void scene_open(scene *s)
{
    float weights[11];
    field *f = &s->f;
    field_open(f, W, H, FWHM, 1, 2);
    rx_psf *narrow = rx_psf_new(RX_PSF_GAUSS, 11, 1);
    assert_non_null(narrow);
    rx_gauss_weights(2, 5, weights);
    for (int k = 0; k < 121; k++)
        narrow->basis[k] = weights[k / 11] * weights[k % 11];
    rx_psf_free(f->restored->psf);
    f->restored->psf = narrow;
    field_list(f, CX + 0.3, CY - 0.4, 6, 3, 2, 0.3);
    field_list(f, CX + 10, CY + 3, 5, 3, 2, 0.3);
    s->s = (rx_fit_source){.kind = RX_TPHOT_PROFILE,
                           .x = CX + 0.3,
                           .y = CY - 0.4,
                           .profile = {2.5, 0.2, -0.1, 0.6},
                           .flux = FLUX,
                           .segment = 1,
                           .xmin = CX - 6,
                           .xmax = CX + 6,
                           .ymin = CY - 19,
                           .ymax = CY + 5};
    assert_int_equal(rx_template_otf_new(f->psf, narrow, &s->lens, NULL), RX_OK);
    assert_int_equal(rx_template_otf_new(f->psf, narrow, &s->other, NULL), RX_OK);
    assert_int_equal(
        rx_template_otf_at(s->lens, rx_template_otf_side(s->lens, 10, 0), s->s.x, s->s.y, &s->size, NULL),
        RX_OK);
    assert_int_equal(rx_template_otf_at(s->other, s->size->n, s->s.x, s->s.y, &s->own, NULL), RX_OK);
    assert_true(s->size->n <= MOST);
    s->matching = rx_template_domain_matching(s->own);
    rx_template_domain_render(s->own, &s->s.profile, 0.3, -0.4, s->matching, 1);
    read_plane(s->own, s->t);
    rx_layer *layer = RX_NEW(rx_layer, 1);
    float *model = RX_NEW(float, W *H);
    assert_non_null(layer);
    assert_non_null(model);
    for (int k = 0; k < W * H; k++) {
        const int i = k % W - CX + s->size->n / 2, j = k / W - CY + s->size->n / 2;
        const int in = i >= 0 && j >= 0 && i < s->size->n && j < s->size->n;
        const double own = in ? FLUX * s->t[j * s->size->n + i] : 0,
                     any = rx_random_uniform(3, 2, (uint64_t)k);
        f->sigma[k] = (float)(2 + 4 * any);
        /* few pixels between the sources say what the noise is, most of them where the domain ends */
        const int x = k % W, y = k / W, edge = x == CX - s->size->n / 2 || y == CY + s->size->n / 2 - 1;
        const int far = abs(x - CX) > 12 || y > CY + 12;
        f->restored->mask[k] = far && !edge ? k * 7 % 40 != 0 : k % 23 == 0;
        s->hidden[k] = k % 29 == 0 ? 6 : 4;
        s->given[k] = (float)(1.5 + 4.5 * rx_random_uniform(3, 5, (uint64_t)k));
        model[k] = (float)(own * (0.5 + 1.5 * any));
        f->restored->pixels[k] =
            (float)(own + (edge ? 6 : 3) * rx_random_normal(3, 3, (uint64_t)k) +
                    (in && own > 1 ? 0.5 * own * rx_random_normal(3, 4, (uint64_t)k) : 0));
    }
    f->restored->pixels[(CY + 10) * W + CX] += 300; /* beyond the surroundings */
    f->restored->mask[(CY + 10) * W + CX] = s->hidden[(CY + 10) * W + CX] = 0;
    s->input = field_input(f);
    rx_fit_image_open(&s->input, W * H, 1, &s->canvas);
    *layer = (rx_layer){{.width = W, .height = H, .values = model, .inside = 1}, 1};
    rx_fit_image_set(&s->canvas, layer, 1);
    assert_int_equal(rx_fit_image_load_rows(&s->canvas, 0, H, NULL), RX_OK);
    s->view = (rx_refine_view){.canvas = &s->canvas,
                               .restored = f->restored,
                               .shape_mask = s->hidden,
                               .shape_bits = 2,
                               .segments = f->sources->segments,
                               .fwhm = FWHM};
}

static void scene_close(scene *s)
{
    rx_patch_clear(&s->patch);
    rx_template_otf_free(s->lens);
    rx_template_otf_free(s->other);
    free(s->canvas.layers[0].footprint.values);
    rx_fit_image_clear(&s->canvas);
    field_close(&s->f);
}

static int seen(const scene *s, int p)
{
    return s->f.restored->mask[p] == 0 && (s->hidden[p] & 2) == 0;
}

/* D, T and K * D by their definitions. */
static void define(scene *s)
{
    const int n = s->size->n;
    const size_t stride = (size_t)rx_fft_stride_real(s->own->fft);
    static double below[W * H];
    int count = 0;
    for (int p = 0; p < W * H; p++) {
        const int i = p % W - CX + n / 2, j = p / W - CY + n / 2;
        if (i >= 0 && j >= 0 && i < n && j < n && s->f.sources->segments[p] == 0 && seen(s, p) &&
            s->f.restored->pixels[p] < 0)
            below[count++] = -(double)s->f.restored->pixels[p];
    }
    qsort(below, (size_t)count, sizeof *below, by_value);
    const double around = 1.4826 * below[(count - 1) / 2];
    rx_template_domain_render(s->own, &s->s.profile, 0.3, -0.4, s->matching, 1);
    s->cost = 4;
    for (int k = 0; k < n * n; k++) {
        const int x = CX - n / 2 + k % n, y = CY - n / 2 + k / n, p = y * W + x;
        float *at = &s->own->plane[0][(size_t)(k / n) * stride + (size_t)(k % n)];
        const double own = FLUX * *at;
        s->d[k] = *at = 0;
        /* the segment's box and a FWHM around it */
        if (x < s->s.xmin - 4 || x > s->s.xmax + 4 || y < s->s.ymin - 4 || y > s->s.ymax + 4 || y < 0 ||
            !seen(s, p))
            continue;
        const int owner = s->f.sources->segments[p];
        const double all = s->canvas.model[p], share = owner == 1               ? 1
                                                       : owner != 0 || own <= 0 ? 0
                                                                                : fmin(1, own / all);
        const double known =
            rx_map_given(&s->f.restored->noise) ? (double)s->given[p] : (double)s->f.sigma[p];
        const double noise = fmax(known, around);
        if (share <= 0)
            continue;
        const double v = s->f.restored->pixels[p] - own / share;
        if (owner != 1 && fabs(v) <= 3 * noise)
            continue;
        const double sure = share * v * v / (v * v + noise * noise);
        s->cost += 2 * sure;
        s->d[k] = *at = (float)(sure * v);
    }
    rx_template_domain_blur(s->own, s->matching);
    read_plane(s->own, s->kd);
    rx_template_domain_render(s->own, &s->s.profile, 0.3, -0.4, NULL, 1);
    read_plane(s->own, s->t);
}

/* Data of so much of the structure besides the profile. */
static void set_patch(scene *s, double amount)
{
    const int n = s->size->n, corner = n / 2 - HALF;
    rx_patch_clear(&s->patch);
    s->patch = (rx_patch){.x0 = CX - HALF, .y0 = CY - HALF, .side = SIDE, .corner = corner};
    s->patch.data = RX_NEW(double, 2 * SIDE * SIDE);
    assert_non_null(s->patch.data);
    s->patch.weight = s->patch.data + SIDE * SIDE;
    for (int k = 0; k < SIDE * SIDE; k++) {
        const int at = (corner + k / SIDE) * n + corner + k % SIDE;
        s->patch.weight[k] = k % 17 == 0 ? 0 : 4 + 10 * rx_random_uniform(4, 1, (uint64_t)k);
        s->patch.data[k] = FLUX * s->t[at] + amount * s->kd[at];
    }
}

/* Products of T, K * D and the data, in this order: tt, td, dd, tc, dc. */
static void products(const scene *s, double sums[5])
{
    memset(sums, 0, 5 * sizeof *sums);
    for (int k = 0; k < SIDE * SIDE; k++) {
        const int at = (s->patch.corner + k / SIDE) * s->size->n + s->patch.corner + k % SIDE;
        const double w = s->patch.weight[k], t = s->t[at], d = s->kd[at], c = s->patch.data[k];
        const double add[5] = {w * t * t, w * t * d, w * d * d, w * t * c, w * d * c};
        for (int i = 0; i < 5; i++)
            sums[i] += add[i];
    }
}

static int add(scene *s, double *flux)
{
    rx_template_domain_render(s->size, &s->s.profile, 0.3, -0.4, NULL, 1);
    *flux = -1;
    return rx_substructure_add(&s->view, &s->s, CX, CY, s->size, &s->patch, flux);
}

/* Part of it, and more than all, which counts as all. */
static void check_amounts(scene *s)
{
    static float plane[MOST * MOST];
    define(s);
    for (int i = 0; i < 2; i++) {
        double sums[5], sum = 0, flux;
        set_patch(s, i == 0 ? 0.6 : 1.5);
        products(s, sums);
        const double amount = i == 0 ? 0.6 : 1, own = (sums[3] - amount * sums[1]) / sums[0];
        for (int k = 0; k < s->size->n * s->size->n; k++)
            sum += s->kd[k];
        assert_int_equal(add(s, &flux), 1);
        assert_true(fabs(sum) > 50);
        assert_close(flux, own + amount * sum, 5e-7);
        read_plane(s->size, plane);
        for (int k = 0; k < s->size->n * s->size->n; k++)
            assert_near(plane[k], (own * s->t[k] + amount * s->kd[k]) / flux, 1e-7);
    }
    /* it must gain twice what is free in it, and 4 */
    double sums[5];
    products(s, sums);
    const double enough = sqrt(s->cost / (sums[2] - sums[1] * sums[1] / sums[0]));
    assert_true(enough < 0.9);
    for (int i = 0; i < 2; i++) {
        double flux;
        set_patch(s, enough * (i == 0 ? 0.99997 : 1.00003));
        assert_int_equal(add(s, &flux), i);
        if (i == 1)
            continue;
        assert_near(flux, -1, 0);
        read_plane(s->size, plane);
        assert_memory_equal(plane, s->t, (size_t)s->size->n * (size_t)s->size->n * sizeof *plane);
    }
}

static void test_noise_of_tile(void **state)
{
    (void)state;
    static scene s;
    scene_open(&s);
    check_amounts(&s);
    scene_close(&s);
}

static const float *known;

static void make_noise(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    (void)maker;
    for (int j = 0; j < rows; j++)
        memcpy(dst + j * n, known + (y + j) * W + x, (size_t)n * sizeof *dst);
}

static void test_noise_that_is_given(void **state)
{
    (void)state;
    static scene s;
    scene_open(&s);
    known = s.given;
    s.f.restored->noise_maker = RX_NEW(rx_map_maker, 1);
    assert_non_null(s.f.restored->noise_maker);
    s.f.restored->noise_maker->make = make_noise;
    s.f.restored->noise = rx_map_made(s.f.restored->noise_maker, W);
    check_amounts(&s);
    scene_close(&s);
}

static void test_noise_of_sky(void **state)
{
    (void)state;
    static scene s;
    scene_open(&s);
    s.f.restored->noise = rx_map_plane(s.given, W);
    check_amounts(&s);
    scene_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_noise_of_tile),
                                       cmocka_unit_test(test_noise_that_is_given),
                                       cmocka_unit_test(test_noise_of_sky)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
