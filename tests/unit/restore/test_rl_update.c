/* Richardson-Lucy by its formulas (restore/richardson_lucy.h), K and its adjoint by restore/blur.h. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "restore/richardson_lucy.h"
#include "sky.h"

enum { W = 600, H = 40, AREA = W * H }; /* rows longer than the pieces they are made in */

typedef struct bench {
    sky s;
    rx_psf *psf;
    rx_prepared *prepared;
    rx_blur *blur;
} bench;

/* Sources, uneven noise, masked pixels and a masked field that the PSF does not cross. */
static bench bench_new(void)
{
    bench b = {.psf = sky_psf_varying(3, 0.2, W)};
    sky_new(&b.s, W, H);
    sky_noise(&b.s, 1, 5);
    for (int i = 0; i < 20; i++)
        b.s.tile.pixels[(i * 1709 + 300) % AREA] += (float)(40 + 200 * i);
    for (int k = 0; k < AREA; k++) {
        const int x = k % W;
        b.s.background.sigma[k] = (float)(1 + rx_random_uniform(1, 1, (uint64_t)k));
        b.s.tile.mask[k] = k % 89 == 7 || (x > 400 && x < 440) ? RX_MASK_BAD : 0;
    }
    b.s.tile.gain = 1.7;
    const rx_image image = sky_image(&b.s, NULL);
    assert_int_equal(rx_prepared_new(&b.s.par, &image, &b.prepared, NULL), RX_OK);
    assert_int_equal(rx_blur_new(b.psf, W, H, 1, &b.blur, NULL), RX_OK);
    return b;
}

static void bench_free(bench *b)
{
    rx_blur_free(b->blur);
    rx_prepared_free(b->prepared);
    rx_psf_free(b->psf);
    sky_free(&b->s);
}

static double sky_variance(const bench *b, int k)
{
    float variance;
    rx_prepared_variance(b->prepared, k / W, k % W, 1, &variance);
    return variance;
}

/* W D (d - m) / m at pixel k */
static double residual(const bench *b, double damping, int k, double model)
{
    const rx_prepared *p = b->prepared;
    const double m = fmax(model, 0.05), r = p->data[k] - m;
    double d = 1;
    if (damping > 0) {
        const double u =
            fmin(1, r * r / (damping * damping * (sky_variance(b, k) + p->photon * fmax(m - 1, 0))));
        d = pow(u, 9) * (10 - 9 * u);
    }
    return p->weight[k] * d * r / m;
}

static double chi2(const bench *b, const float *model)
{
    double sum = 0;
    long n = 0;
    for (int k = 0; k < AREA; k++)
        if (b->prepared->mask[k] == 0) {
            const double variance = sky_variance(b, k) + b->prepared->photon * fmax(model[k] - 1.0, 0);
            sum += pow(b->prepared->data[k] - model[k], 2) / variance;
            n++;
        }
    return sum / (double)n;
}

static void check_updates(int whole, double damping, int accelerate)
{
    bench b = bench_new();
    rx_rl *rl = NULL;
    float *m = calloc(AREA, sizeof *m), *r = calloc(AREA, sizeof *r), line[W];
    float *f = rx_blur_sky(b.blur), *change = rx_blur_sky(b.blur), *norm = rx_blur_sky(b.blur),
          *before = rx_blur_sky(b.blur);
    const size_t n = rx_blur_sky_size(b.blur);
    const rx_restore_params par = {.rl_damping = damping, .rl_accelerate = accelerate};
    assert_int_equal(rx_rl_new(&par, b.prepared, b.blur, whole, &rl, NULL), RX_OK);
    rx_blur_adjoint_plane(b.blur, b.prepared->weight, norm);
    for (size_t k = 0; k < n; k++) {
        f[k] = 1;
        assert_near(rl->object[k], 1, 0);
        assert_near(rl->norm[k], norm[k], 1e-6);
    }
    for (int i = 0; i < 4; i++) {
        rx_blur_plane(b.blur, f, m);
        assert_near(rx_rl_chi2(rl), chi2(&b, m), 1e-5 * chi2(&b, m));
        for (int k = 0; k < AREA; k++)
            r[k] = (float)residual(&b, damping, k, m[k]);
        for (int y = 0; y < H && whole; y++) {
            const int x = 13 * y;
            rx_rl_residual(rl, y, x, W - x, line);
            for (int k = 0; k < W - x; k++)
                assert_near(line[k], r[y * W + x + k], 2e-5 * (1 + fabs(r[y * W + x + k])));
        }
        rx_blur_adjoint_plane(b.blur, r, change);
        for (size_t k = 0; k < n; k++) {
            const float now = norm[k] > 1e-3 ? fmaxf(1e-4f, f[k] * (1 + change[k] / norm[k])) : f[k];
            f[k] = accelerate && i < 3
                       ? fmaxf(now + (float)i / (float)(i + 9) * (now - before[k]), 0.1f * now)
                       : now;
            before[k] = now;
        }
        rx_rl_update(rl, i == 3);
        for (size_t k = 0; k < n; k++)
            if (fabs(norm[k] - 1e-3) > 1e-5) /* is it known or not? */
                assert_near(rl->object[k], f[k], 1e-4 * (1 + f[k]) * fmax(1, 0.03 / norm[k]));
        memcpy(f, rl->object, n * sizeof *f);
    }
    rx_rl_reset(rl);
    assert_near(rl->object[n - 1], 1, 0);
    assert_near(rl->object[0], 1, 0);
    rx_rl_free(rl);
    free(m);
    free(r);
    free(f);
    free(change);
    free(norm);
    free(before);
    bench_free(&b);
}

static void updates_by_the_formula(void **state)
{
    (void)state;
    check_updates(1, 0, 0);
    check_updates(0, 0, 0);
    check_updates(1, 3, 0);
    check_updates(1, 0, 1);
    check_updates(0, 3, 1);
}

/* No source is brighter than all the light of the tile's peak in a pixel, ten thousand times over. */
static void bounds(void **state)
{
    (void)state;
    bench b = bench_new();
    rx_rl *rl = NULL;
    assert_int_equal(rx_rl_new(&(rx_restore_params){.rl_damping = 0}, b.prepared, b.blur, 1, &rl, NULL),
                     RX_OK);
    assert_near(rl->bound, 1e4 * b.prepared->peak, 1e-6 * rl->bound);
    for (size_t k = 0; k < rx_blur_sky_size(b.blur); k++)
        rl->object[k] = k % 2 ? 2 * rl->bound : 1e-9f;
    rx_rl_model(rl);
    for (size_t k = 0; k < (size_t)AREA; k++)
        rl->model[k] = b.prepared->data[k] > 0.05f ? b.prepared->data[k] : 1; /* no change */
    rx_rl_update(rl, 0);
    for (int x = 50; x < 300; x++) {
        const float f = rl->object[rx_blur_row(b.blur, 20) + (size_t)x];
        assert_true(f <= rl->bound);
        assert_true(f >= 1e-4f);
    }
    rx_rl_free(rl);
    bench_free(&b);
}

/* What a run gives after one iteration: f, K f and 1 - K^T (good pixels) of the tile, in ADU above the sky. */
static void planes_of_a_run(void **state)
{
    (void)state;
    bench b = bench_new();
    rx_restored *out = NULL;
    rx_rl *rl = NULL;
    float *m = calloc(AREA, sizeof *m), *good = calloc(AREA, sizeof *good), *seen = rx_blur_sky(b.blur);
    b.s.par.rl_niter = 2;
    b.s.par.rl_denoise = 0;
    const rx_image image = sky_image(&b.s, b.psf);
    assert_int_equal(rx_rl_run(&b.s.par, &image, NULL, &out, NULL), RX_OK);
    assert_int_equal(rx_rl_new(&(rx_restore_params){.rl_damping = 0}, b.prepared, b.blur, 1, &rl, NULL),
                     RX_OK);
    rx_rl_update(rl, 0);
    rx_rl_update(rl, 0);
    rx_blur_plane(b.blur, rl->object, m);
    for (int k = 0; k < AREA; k++)
        good[k] = b.s.tile.mask[k] == 0;
    rx_blur_adjoint_plane(b.blur, good, seen);
    assert_int_equal(out->iterations, 2);
    assert_near(out->chi2, chi2(&b, m), 1e-5 * out->chi2);
    for (int k = 0; k < AREA; k++) {
        assert_true(out->mask[k] == 0 || out->mask[k] == b.s.tile.mask[k]);
        const size_t at = rx_blur_row(b.blur, k / W) + (size_t)(k % W);
        const double f = (rl->object[at] - 1.0) * b.prepared->pedestal,
                     reblurred = (m[k] - 1.0) * b.prepared->pedestal;
        assert_near(out->pixels[k], out->mask[k] == 0 ? f : 0, 1e-5 * (1 + fabs(f)));
        assert_near(out->reblurred[k], reblurred, 1e-4 * (1 + fabs(reblurred)));
        assert_near(out->support[k], fmin(1, fmax(0, 1 - seen[at])), 2e-5);
    }
    free(m);
    free(good);
    free(seen);
    rx_rl_free(rl);
    rx_restored_free(out);
    bench_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(updates_by_the_formula), cmocka_unit_test(bounds),
                                       cmocka_unit_test(planes_of_a_run)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
