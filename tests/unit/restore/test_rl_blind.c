/* RL_BLIND finds the PSF of a field of stars from a wrong one, and lets well alone. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "restore/prepared.h"
#include "sky.h"

enum { W = 240, H = 220 };
static const double TRUE_FWHM = 3.4;

/* 8 x 7 stars, half a pixel from a grid at random, over noise, one of them masked; some galaxies and cosmic rays. */
static void field(sky *s)
{
    sky_new(s, W, H);
    for (int i = 0; i < 56; i++) {
        const double dx = rx_random_uniform(1, 1, (uint64_t)i) - 0.5,
                     dy = rx_random_uniform(1, 2, (uint64_t)i) - 0.5;
        const double flux = 500 * pow(60, rx_random_uniform(1, 3, (uint64_t)i));
        sky_star(s, 20 + i % 8 * 28 + dx, 22 + i / 8 * 28 + dy, TRUE_FWHM, flux);
        if (i % 5 == 0)
            sky_star(s, 34 + i % 8 * 28, 36 + i / 8 * 28, 6, 6000);
    }
    sky_noise(s, 1, 31);
    for (int i = 0; i < 60; i++)
        s->tile.pixels[(int)(rx_random_uniform(1, 5, (uint64_t)i) * W * H)] += 500;
    s->tile.mask[22 * W + 20] = RX_MASK_BAD;
    s->par.rl_denoise = 2;
    s->par.nthreads = 2;
}

static rx_restored *run(const sky *s, const rx_psf *psf)
{
    rx_restored *restored = NULL;
    rx_error err = RX_ERROR_NONE;
    const rx_image image = sky_image(s, psf);
    assert_int_equal(rx_restorer_find("RL_BLIND")->run(&s->par, &image, NULL, &restored, &err), RX_OK);
    for (int k = 0; k < W * H; k++)
        assert_true(isfinite(restored->pixels[k]));
    return restored;
}

static double seen(double fwhm)
{
    return sqrt(fwhm * fwhm + 5.545177 / 12);
}

static void finds_the_psf(void **state)
{
    static const double start[] = {2.6, TRUE_FWHM, 4.4};
    sky s;
    field(&s);
    for (int i = 0; i < 3; i++) {
        rx_psf *psf = rx_stamp_gauss(start[i]);
        rx_restored *r = run(&s, psf);
        assert_string_equal(r->name, "RL_BLIND");
        assert_near(r->blur->fwhm, seen(TRUE_FWHM), 0.03 * seen(TRUE_FWHM));
        double sum = 0, x, y;
        for (int k = 0; k < r->blur->size * r->blur->size; k++) {
            assert_true(r->blur->basis[k] >= 0);
            sum += r->blur->basis[k];
        }
        assert_near(sum, 1, 1e-5);
        rx_stamp_centroid(r->blur->basis, r->blur->size, TRUE_FWHM, &x, &y);
        assert_true(hypot(x, y) < 0.02);
        assert_true(strstr(r->settings, "RL_BLIND_CYCLES 5, RL_BLIND_NITER 10") != NULL);
        rx_restored_free(r);
        rx_psf_free(psf);
    }
    sky_free(&s);
}

/* Positions do not drift with the PSF that is found. */
static void keeps_positions(void **state)
{
    sky s;
    sky_new(&s, W, H);
    for (int i = 0; i < 42; i++)
        sky_star(&s, 30 + i % 7 * 30 + 0.3, 30 + i / 7 * 30 - 0.2, TRUE_FWHM, 5000 + 500 * i);
    sky_noise(&s, 1, 8);
    rx_psf *psf = rx_stamp_gauss(2.8);
    rx_restored *r = run(&s, psf);
    double drift_x = 0, drift_y = 0;
    for (int i = 0; i < 42; i++) {
        const int x = 30 + i % 7 * 30, y = 30 + i / 7 * 30;
        double sum = 0, sx = 0, sy = 0;
        for (int b = -5; b <= 5; b++)
            for (int a = -5; a <= 5; a++) {
                const float v = r->pixels[(y + b) * W + x + a];
                sum += v;
                sx += v * a;
                sy += v * b;
            }
        drift_x += (sx / sum - 0.3) / 42;
        drift_y += (sy / sum + 0.2) / 42;
    }
    assert_true(hypot(drift_x, drift_y) < 0.03);
    rx_restored_free(r);
    rx_psf_free(psf);
    sky_free(&s);
}

/* Without stars there is nothing to learn from: the PSF that was given is used. */
static void lets_well_alone(void **state)
{
    sky s;
    sky_new(&s, W, H);
    sky_star(&s, 100, 100, 15, 1e5);
    sky_noise(&s, 1, 4);
    rx_psf *psf = rx_stamp_gauss(3);
    rx_restored *r = run(&s, psf), *plain = NULL;
    for (int k = 0; k < psf->size * psf->size; k++)
        assert_near(r->blur->basis[k], psf->basis[k], 1e-7);
    const rx_image image = sky_image(&s, psf);
    assert_int_equal(rx_restorer_find("RL")->run(&s.par, &image, NULL, &plain, NULL), RX_OK);
    for (int k = 0; k < W * H; k++)
        assert_near(r->pixels[k], plain->pixels[k], 1e-3);
    rx_restored_free(r);
    rx_restored_free(plain);
    rx_psf_free(psf);
    sky_free(&s);
}

/* What a large tile asks for row by row is what a small one keeps. */
static void makes_again_what_it_does_not_keep(void **state)
{
    sky s;
    field(&s);
    for (int k = 0; k < W * H; k++)
        s.background.sigma[k] = 0.5f + (float)(k % 7);
    s.background.sigma[5] = -1;
    s.tile.mask[7] = RX_MASK_BAD;
    rx_prepared *prepared = NULL;
    float data[W], weight[W], variance[W];
    const rx_image image = sky_image(&s, NULL);
    assert_int_equal(rx_prepared_new(&s.par, &image, &prepared, NULL), RX_OK);
    rx_prepared small = *prepared;
    prepared->data = prepared->weight = NULL;
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x += 1 + x) { /* pieces of several lengths */
            const int n = W - x;
            const size_t k = (size_t)y * W + (size_t)x;
            assert_ptr_equal(rx_prepared_data(&small, y, x, n, data), small.data + k);
            assert_memory_equal(rx_prepared_data(prepared, y, x, n, data), small.data + k,
                                (size_t)n * sizeof *data);
            assert_memory_equal(rx_prepared_weight(prepared, y, x, n, weight), small.weight + k,
                                (size_t)n * sizeof *weight);
        }
    rx_prepared_variance(prepared, 0, 0, W, variance);
    assert_near(small.data[7], 0, 0);
    assert_near(small.weight[7], 0, 0);
    assert_near(variance[7], 1, 0);
    assert_near(variance[5], pow(prepared->sigma, 2), 1e-6); /* no noise known: the median */
    assert_near(small.weight[5], 1, 0);
    assert_near(variance[6] / variance[1], pow(6.5 / 1.5, 2), 1e-4);
    assert_near(small.weight[6], pow(prepared->median / 6.5, 2), 1e-6);
    prepared->data = small.data;
    prepared->weight = small.weight;
    rx_prepared_free(prepared);
    sky_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(finds_the_psf), cmocka_unit_test(keeps_positions),
                                       cmocka_unit_test(lets_well_alone),
                                       cmocka_unit_test(makes_again_what_it_does_not_keep)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
