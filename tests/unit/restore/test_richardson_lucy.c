/* restore: NONE, RL and the table of kinds on artificial tiles. */
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

static rx_restored *run(const char *kind, const sky *s, const rx_psf *psf)
{
    rx_restored *restored = NULL;
    rx_error err = RX_ERROR_NONE;
    const rx_image image = sky_image(s, psf);
    assert_int_equal(rx_restorer_find(kind)->run(&s->par, &image, NULL, &restored, &err), RX_OK);
    for (int k = 0; k < s->tile.width * s->tile.height; k++) {
        assert_true(isfinite(restored->pixels[k]));
        if (restored->mask[k] != 0)
            assert_true(restored->pixels[k] == 0);
    }
    return restored;
}

static void same_bytes(const sky *s, const rx_restored *a, const rx_restored *b)
{
    const size_t n = (size_t)s->tile.width * (size_t)s->tile.height;
    assert_memory_equal(a->pixels, b->pixels, n * sizeof(float));
    assert_memory_equal(a->support, b->support, n * sizeof(float));
    assert_memory_equal(a->reblurred, b->reblurred, n * sizeof(float));
    assert_memory_equal(a->mask, b->mask, n);
    assert_memory_equal(&a->chi2, &b->chi2, sizeof a->chi2);
    assert_int_equal(a->iterations, b->iterations);
}

static void table(void **state)
{
    int n = 0;
    const rx_restorer *list = rx_restorers(&n);
    assert_int_equal(n, 6);
    for (int i = 0; i < n; i++) {
        assert_ptr_equal(rx_restorer_find(list[i].name), &list[i]);
        assert_true(strlen(list[i].help) > 10);
        assert_non_null(list[i].run);
    }
    assert_ptr_equal(rx_restorer_find("rl_blind"), &list[2]);
    assert_null(rx_restorer_find("RLX"));
}

static void none(void **state)
{
    sky s;
    sky_new(&s, 20, 10);
    s.hide = RX_HIDE_PLAIN;
    s.tile.pixels[33] = 170;
    s.tile.mask[33] = RX_MASK_SATURATED;
    s.tile.mask[34] = RX_MASK_WEIGHT | RX_MASK_SATURATED;
    s.tile.pixels[34] = 1e6f;
    rx_restored *r = run("NONE", &s, NULL);
    assert_near(r->pixels[33], 70, 0);
    assert_int_equal(r->mask[33], 0);
    assert_int_equal(r->mask[34], RX_MASK_WEIGHT);
    assert_near(r->pixels[34], 0, 0);
    assert_near(r->pixels[0], 0, 0);
    assert_null(r->noise_maker);
    assert_ptr_equal(r->noise.sky, &s.background);
    assert_null(r->psf);
    assert_true(isnan(r->chi2));
    rx_restored_free(r);
    s.hide = RX_HIDE_RESTORED;
    r = run("NONE", &s, NULL);
    assert_near(r->pixels[33], 0, 0);
    assert_int_equal(r->mask[33], RX_MASK_SATURATED);
    rx_restored_free(r);
    sky_free(&s);
}

/* An isolated star of S/N 1000: all of its flux within 0.1 %, for every noise model and
 * denoising; the same in noise, as far as the noise in the aperture goes. */
/* The equations of the header by plain sums in double precision: PSF of no symmetry, a mask, noise that varies,
 * photon noise. */
enum {
    EQ_W = 24,
    EQ_H = 20,
    EQ_R = 2,
    EQ_SIDE = 2 * EQ_R + 1,
    EQ_SW = EQ_W + 2 * EQ_R,
    EQ_SH = EQ_H + 2 * EQ_R
};

static void plain_blur(const float *stamp, double f[EQ_SH][EQ_SW], double m[EQ_H][EQ_W])
{
    for (int y = 0; y < EQ_H; y++)
        for (int x = 0; x < EQ_W; x++) {
            m[y][x] = 0;
            for (int k = 0; k < EQ_SIDE * EQ_SIDE; k++)
                m[y][x] += stamp[k] * f[y + 2 * EQ_R - k / EQ_SIDE][x + 2 * EQ_R - k % EQ_SIDE];
        }
}

static void plain_adjoint(const float *stamp, double r[EQ_H][EQ_W], double c[EQ_SH][EQ_SW])
{
    memset(c, 0, sizeof(double[EQ_SH][EQ_SW]));
    for (int y = 0; y < EQ_H; y++)
        for (int x = 0; x < EQ_W; x++)
            for (int k = 0; k < EQ_SIDE * EQ_SIDE; k++)
                c[y + 2 * EQ_R - k / EQ_SIDE][x + 2 * EQ_R - k % EQ_SIDE] += stamp[k] * r[y][x];
}

static void follows_its_equations(void **state)
{
    static double d[EQ_H][EQ_W], w[EQ_H][EQ_W], sky_var[EQ_H][EQ_W], good[EQ_H][EQ_W], m[EQ_H][EQ_W],
        r[EQ_H][EQ_W];
    static double f[EQ_SH][EQ_SW], c[EQ_SH][EQ_SW], norm[EQ_SH][EQ_SW], seen[EQ_SH][EQ_SW];
    const double pedestal = 5, gain = 2, photon = 1 / (gain * pedestal);
    float stamp[EQ_SIDE * EQ_SIDE];
    rx_psf *psf = NULL;
    for (int k = 0; k < EQ_SIDE * EQ_SIDE; k++)
        stamp[k] =
            (float)((1 + k % 4) * exp(-0.5 * (pow(k % EQ_SIDE - 2.3, 2) + pow(k / EQ_SIDE - 1.8, 2))) / 17);
    assert_int_equal(rx_stamp_psf(RX_PSF_FILE, stamp, EQ_SIDE, &psf, NULL), RX_OK);
    for (int run_of = 0; run_of < 2; run_of++) {
        sky s;
        sky_new(&s, EQ_W, EQ_H);
        sky_star(&s, 11.3, 9.6, 3, 900);
        sky_noise(&s, 1, 11);
        s.tile.gain = gain;
        s.tile.mask[9 * EQ_W + 13] = 1;
        for (int k = 0; k < 8; k++) /* too few for the pedestal */
            s.background.sigma[8 * EQ_W + 6 + k] = 1.5;
        s.par.rl_niter = 3;
        for (int y = 0; y < EQ_H; y++)
            for (int x = 0; x < EQ_W; x++) {
                const size_t k = (size_t)(y * EQ_W + x);
                good[y][x] = s.tile.mask[k] == 0;
                d[y][x] = fmax((s.tile.pixels[k] - 100.0) / pedestal + 1, 0);
                w[y][x] = good[y][x] / pow(s.background.sigma[k], 2);
                sky_var[y][x] = pow(s.background.sigma[k] / pedestal, 2);
            }
        plain_adjoint(stamp, w, norm);
        plain_adjoint(stamp, good, seen);
        for (int k = 0; k < EQ_SH * EQ_SW; k++)
            f[k / EQ_SW][k % EQ_SW] = 1;
        for (int i = 0; i < s.par.rl_niter; i++) {
            plain_blur(stamp, f, m);
            for (int y = 0; y < EQ_H; y++)
                for (int x = 0; x < EQ_W; x++) {
                    r[y][x] = w[y][x] * (d[y][x] - m[y][x]) / m[y][x];
                }
            plain_adjoint(stamp, r, c);
            for (int k = 0; k < EQ_SH * EQ_SW; k++)
                if (norm[k / EQ_SW][k % EQ_SW] > 1e-3)
                    f[k / EQ_SW][k % EQ_SW] *= 1 + c[k / EQ_SW][k % EQ_SW] / norm[k / EQ_SW][k % EQ_SW];
        }
        plain_blur(stamp, f, m);
        rx_restored *restored = run("RL", &s, psf);
        double chi2 = 0;
        for (int y = 0; y < EQ_H; y++)
            for (int x = 0; x < EQ_W; x++) {
                const int k = y * EQ_W + x;
                assert_near(restored->pixels[k], pedestal * (f[y + EQ_R][x + EQ_R] - 1),
                            2e-3); /* the gap, too */
                assert_near(restored->reblurred[k], pedestal * (m[y][x] - 1), 2e-3);
                assert_near(restored->support[k], 1 - seen[y + EQ_R][x + EQ_R], 2e-5);
                chi2 += good[y][x] * pow(d[y][x] - m[y][x], 2) /
                        (sky_var[y][x] + photon * fmax(m[y][x] - 1, 0)) / (EQ_W * EQ_H - 1);
            }
        assert_near(restored->chi2, chi2, 1e-4 * chi2);
        rx_restored_free(restored);
        sky_free(&s);
    }
    rx_psf_free(psf);
}

static void keeps_flux(void **state)
{
    static const double gain[] = {0, 1, 30}, denoise[] = {0, 2};
    const double flux = 4500;
    rx_psf *psf = rx_stamp_gauss(3);
    for (int g = 0; g < 3; g++)
        for (int d = 0; d < 2; d++)
            for (int noisy = 0; noisy < 2; noisy++) {
                sky s;
                sky_new(&s, 101, 97);
                sky_star(&s, 48.3, 50.6, 3, flux);
                if (noisy)
                    sky_noise(&s, 1, 5);
                s.tile.gain = gain[g];
                s.par.rl_denoise = denoise[d];
                rx_restored *r = run("RL", &s, psf), *plain = run("NONE", &s, psf);
                const double in = sky_sum(&s, plain->pixels, 48.3, 50.6, 20);
                const double out = sky_sum(&s, r->pixels, 48.3, 50.6, 20);
                assert_near(out / flux, in / flux, noisy ? 5e-3 : 5e-4);
                assert_near(r->psf->fwhm, denoise[d] > 0 ? 2 : 1, 1e-9);
                rx_restored_free(r);
                rx_restored_free(plain);
                sky_free(&s);
            }
    rx_psf_free(psf);
}

static void keeps_sky(void **state)
{
    static const double gain[] = {0, 1, 100};
    rx_psf *psf = rx_stamp_gauss(3.5);
    for (int g = 0; g < 3; g++) {
        sky s;
        sky_new(&s, 300, 300);
        sky_noise(&s, 1, 9);
        s.tile.gain = gain[g];
        rx_restored *r = run("RL", &s, psf);
        const double mean = sky_sum(&s, r->pixels, 150, 150, 1000) / 90000;
        assert_true(fabs(mean) < 0.02);
        assert_near(r->chi2, gain[g] > 0 && gain[g] < 50 ? 0.78 : 0.85, 0.05);
        rx_restored_free(r);
        sky_free(&s);
    }
    rx_psf_free(psf);
}

/* A constant stays one up to the border and around masks; a star at the border and one beside
 * a mask leave no rings there. */
static void no_ringing(void **state)
{
    sky s;
    sky_new(&s, 90, 80);
    for (int k = 0; k < 90 * 80; k++)
        s.tile.pixels[k] += 40;
    for (int k = 0; k < 90 * 80; k++)
        if ((k % 90 >= 60 && k % 90 < 70 && k / 90 > 30 && k / 90 < 38) || k % 90 == 20)
            s.tile.mask[k] = RX_MASK_BAD;
    rx_psf *psf = rx_stamp_gauss(3);
    rx_restored *r = run("RL", &s, psf);
    for (int k = 0; k < 90 * 80; k++) {
        const int x = k % 90, y = k / 90;
        assert_near(r->pixels[k], r->mask[k] ? 0 : 40, 0.04);
        assert_int_equal(r->mask[k] != 0,
                         x > 60 && x < 69 && y > 31 && y < 37 ? 1 : s.tile.mask[k] && r->mask[k]);
        if (x == 20)
            assert_int_equal(r->mask[k], 0);
        if (x > 35 && x < 50 && y > 40 && y < 60)
            assert_true(r->support[k] == 0);
        if (s.tile.mask[k]) {
            assert_true(r->support[k] > 0.3f);
            assert_true(r->support[k] <= 1);
        }
    }
    assert_near(r->support[0], 0.57, 0.01); /* a corner: about a third of the PSF is inside */
    rx_restored_free(r);
    /* what RL itself leaves around a point on a pedestal: the same inside the tile */
    for (int k = 0; k < 90 * 80; k++)
        s.tile.pixels[k] -= 40;
    sky_star(&s, 40, 1, 3, 4000);
    sky_star(&s, 40, 60, 3, 4000);
    sky_star(&s, 58, 34, 3, 4000);
    sky_star(&s, 1.5, 45, 3, 4000);
    r = run("RL", &s, psf);
    static const double at[4][2] = {{40, 60}, {40, 1}, {58, 34}, {1.5, 45}};
    for (int i = 0; i < 4; i++) {
        float inner = 0, outer = 0;
        for (int k = 0; k < 90 * 80; k++) {
            const double d = hypot(k % 90 - at[i][0], k / 90 - at[i][1]);
            if (d > 6 && d < 9)
                inner = fmaxf(inner, fabsf(r->pixels[k]));
            if (d > 9 && d < 16)
                outer = fmaxf(outer, fabsf(r->pixels[k]));
        }
        assert_true(inner < 5);
        assert_true(outer < 1); /* of a peak above 1000 */
    }
    rx_restored_free(r);
    rx_psf_free(psf);
    sky_free(&s);
}

/* A field with stars, bad pixels, a column without weight and saturated cores. */
static void crowded(sky *s, uint64_t seed_of_masked)
{
    sky_new(s, 128, 120);
    for (int i = 0; i < 25; i++)
        sky_star(s, 128 * rx_random_uniform(2, 1, (uint64_t)i), 120 * rx_random_uniform(2, 2, (uint64_t)i),
                 3.2, 300 * pow(100, rx_random_uniform(2, 3, (uint64_t)i)));
    sky_noise(s, 1, 21);
    s->tile.gain = 2;
    s->par.rl_denoise = 1.5;
    s->par.rl_niter = 12;
    for (int k = 0; k < 128 * 120; k++) {
        if (rx_random_uniform(4, 0, (uint64_t)k) < 0.02)
            s->tile.mask[k] |= RX_MASK_BAD;
        if (k % 128 == 77)
            s->tile.mask[k] |= RX_MASK_WEIGHT;
        if (s->tile.pixels[k] > 900)
            s->tile.mask[k] |= RX_MASK_SATURATED;
        if (k % 128 > 90)
            s->background.sigma[k] = 2.5f;
        if (s->tile.mask[k] != 0 && seed_of_masked != 0)
            s->tile.pixels[k] = (float)(1e6 * rx_random_normal(seed_of_masked, 5, (uint64_t)k));
    }
}

static void mask_is_blind(void **state)
{
    rx_psf *constant = rx_stamp_gauss(3.2), *varying = sky_psf_varying(3.2, 0.1, 128);
    static const char *kinds[] = {"RL", "RL", "RL_BLIND"};
    for (int i = 0; i < 3; i++) {
        sky a, b;
        crowded(&a, 0);
        crowded(&b, 77);
        const rx_psf *psf = i == 1 ? varying : constant;
        rx_restored *ra = run(kinds[i], &a, psf), *rb = run(kinds[i], &b, psf);
        same_bytes(&a, ra, rb);
        rx_restored_free(ra);
        rx_restored_free(rb);
        sky_free(&a);
        sky_free(&b);
    }
    rx_psf_free(constant);
    rx_psf_free(varying);
}

static void threads(void **state)
{
    rx_psf *constant = rx_stamp_gauss(3.2), *varying = sky_psf_varying(3.2, 0.1, 128);
    static const char *kinds[] = {"RL", "RL", "RL_BLIND"};
    for (int i = 0; i < 3; i++) {
        sky s;
        crowded(&s, 0);
        const rx_psf *psf = i == 1 ? varying : constant;
        rx_restored *one = run(kinds[i], &s, psf);
        for (int n = 2; n <= 3; n++) {
            s.par.nthreads = n;
            rx_restored *more = run(kinds[i], &s, psf);
            same_bytes(&s, one, more);
            rx_restored_free(more);
        }
        rx_restored_free(one);
        sky_free(&s);
    }
    rx_psf_free(constant);
    rx_psf_free(varying);
}

/* The core of a star is gone: what is around it stays bounded, and most of its flux is
 * where the mask is not. */
static void saturated_core(void **state)
{
    sky s;
    sky_new(&s, 81, 81);
    sky_star(&s, 40.2, 39.7, 4, 1e6);
    sky_noise(&s, 1, 3);
    for (int k = 0; k < 81 * 81; k++)
        if (s.tile.pixels[k] > 20000) {
            s.tile.pixels[k] = 20000;
            s.tile.mask[k] = RX_MASK_SATURATED;
        }
    rx_psf *psf = rx_stamp_gauss(4);
    s.par.rl_niter = 200;
    s.tile.gain = 1;
    rx_restored *r = run("RL", &s, psf);
    assert_int_equal(r->mask[40 * 81 + 40], RX_MASK_SATURATED);
    assert_true(r->support[40 * 81 + 40] > 0.3f);
    for (int k = 0; k < 81 * 81; k++)
        if (hypot(k % 81 - 40.2, k / 81 - 39.7) > 12)
            assert_true(fabsf(r->pixels[k]) < 20);
        else {
            assert_between(r->pixels[k], -50, 1e6);
        }
    rx_restored_free(r);
    s.hide = RX_HIDE_PLAIN;
    r = run("RL", &s, psf);
    assert_int_equal(r->mask[40 * 81 + 40], 0);
    assert_true(r->pixels[40 * 81 + 40] > 20000);
    rx_restored_free(r);
    rx_psf_free(psf);
    sky_free(&s);
}

/* Stars as a varying PSF shows them come out alike; with the PSF of the centre they do not. */
static void varying_psf(void **state)
{
    sky s;
    sky_new(&s, 160, 60);
    rx_psf *psf = sky_psf_varying(3.5, 0.25, 160), *centre = rx_stamp_gauss(3.5);
    const int size = psf->size, r = size / 2;
    float *stamp = calloc((size_t)size * (size_t)size, sizeof(float));
    static const int at[3] = {25, 80, 135};
    for (int i = 0; i < 3; i++) {
        rx_psf_at(psf, at[i], 30, stamp);
        for (int k = 0; k < size * size; k++)
            s.tile.pixels[(30 + k / size - r) * 160 + at[i] + k % size - r] += 5000 * stamp[k];
    }
    sky_noise(&s, 1, 8);
    s.par.rl_denoise = 2;
    rx_restored *a = run("RL", &s, psf), *b = run("RL", &s, centre);
    for (int i = 0; i < 3; i++) {
        assert_near(sky_sum(&s, a->pixels, at[i], 30, 10), 5000, 100);
        assert_true(sky_fwhm(&s, a->pixels, at[i], 30) < 3.1);
    }
    assert_true(a->chi2 < 0.4 * b->chi2);
    rx_restored_free(a);
    rx_restored_free(b);
    rx_psf_free(psf);
    rx_psf_free(centre);
    free(stamp);
    sky_free(&s);
}

static void sharpens(void **state)
{
    sky s;
    sky_new(&s, 100, 60);
    sky_star(&s, 25, 30, 4, 20000);
    sky_star(&s, 68, 30, 4, 20000);
    sky_star(&s, 72, 30, 4, 20000); /* one FWHM apart */
    sky_noise(&s, 1, 12);
    rx_psf *psf = rx_stamp_gauss(4);
    rx_restored *before = run("NONE", &s, psf), *after = run("RL", &s, psf);
    assert_true(sky_fwhm(&s, before->pixels, 25, 30) > 3.9);
    assert_true(sky_fwhm(&s, after->pixels, 25, 30) < 2);
    const float *in = before->pixels + 30 * 100, *out = after->pixels + 30 * 100;
    assert_true(in[70] > 0.95f * in[68]);
    assert_true(out[70] < 0.6f * out[68]);
    assert_true(out[70] < 0.6f * out[72]);
    rx_restored_free(before);
    rx_restored_free(after);
    rx_psf_free(psf);
    sky_free(&s);
}

static void check_discrepancy(int accelerate)
{
    sky s;
    sky_new(&s, 128, 128);
    for (int i = 0; i < 9; i++)
        sky_star(&s, 20 + i % 3 * 40, 20 + i / 3 * 40, 3.5, 3000);
    sky_noise(&s, 1, 2);
    s.par.rl_accelerate = accelerate;
    s.par.rl_stop_discrepancy = 1;
    s.par.rl_niter = 500;
    rx_psf *psf = rx_stamp_gauss(3.5);
    rx_restored *r = run("RL", &s, psf);
    assert_in_range(r->iterations, 2, 300);
    assert_true(r->chi2 <= 1);
    assert_true(r->chi2 > 0.9);
    const int stopped = r->iterations;
    rx_restored_free(r);
    s.par.rl_stop_discrepancy = 0;
    s.par.rl_niter = stopped - 1;
    r = run("RL", &s, psf);
    assert_int_equal(r->iterations, stopped - 1);
    assert_true(r->chi2 > 1);
    /* chi2 is that of the plane that is handed on */
    double sum = 0;
    for (int k = 0; k < 128 * 128; k++)
        sum += pow(s.tile.pixels[k] - 100 - r->reblurred[k], 2);
    assert_near(r->chi2, sum / (128 * 128), 1e-4);
    assert_non_null(strstr(r->settings, "RL_STOP NITER"));
    assert_int_equal(strstr(r->settings, "RL_ACCELERATE Y") != NULL, accelerate);
    rx_restored_free(r);
    rx_psf_free(psf);
    sky_free(&s);
}

static void stops_at_discrepancy(void **state)
{
    check_discrepancy(0);
    check_discrepancy(1);
}

static void hopeless_tiles(void **state)
{
    sky s;
    sky_new(&s, 40, 30);
    memset(s.tile.mask, RX_MASK_BAD, 40 * 30);
    rx_psf *psf = rx_stamp_gauss(3);
    static const char *kinds[] = {"RL", "RL_BLIND"};
    const rx_image without = sky_image(&s, NULL);
    s.par.rl_denoise_by_psf = 1;
    for (int i = 0; i < 2; i++) {
        rx_restored *r = NULL;
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(rx_restorer_find(kinds[i])->run(&s.par, &without, NULL, &r, &err), RX_INPUT);
        assert_null(r);
        assert_non_null(strstr(err.text, "no PSF is known"));
    }
    s.par.rl_denoise_by_psf = 0;
    for (int i = 0; i < 2; i++) {
        rx_restored *r = run(kinds[i], &s, psf);
        assert_true(isnan(r->chi2));
        assert_int_equal(r->iterations, 0);
        for (int k = 0; k < 40 * 30; k++)
            assert_true(r->support[k] == 1);
        rx_restored_free(r);
    }
    sky_free(&s);
    sky_new(&s, 11, 30);
    assert_true(psf->size > 11);
    for (int i = 0; i < 2; i++) {
        rx_restored *r = NULL;
        rx_error err = RX_ERROR_NONE;
        const rx_image image = sky_image(&s, psf);
        assert_int_equal(rx_restorer_find(kinds[i])->run(&s.par, &image, NULL, &r, &err), RX_INPUT);
        assert_null(r);
        assert_non_null(strstr(err.text, "larger than the tile of 11 x 30"));
    }
    sky_free(&s);
    rx_psf_free(psf);
}

/* Outliers of any size, a tile without noise or without anything, extreme units, a PSF with
 * negative wings, many iterations: always finite (run() looks at each pixel) and bounded. */
static void never_runs_away(void **state)
{
    sky s;
    sky_new(&s, 64, 64);
    rx_psf *psf = rx_stamp_gauss(3);
    rx_restored *r = run("RL", &s, psf);
    for (int k = 0; k < 64 * 64; k++)
        assert_near(r->pixels[k], 0, 1e-5);
    rx_restored_free(r);
    for (int k = 0; k < psf->size * psf->size; k++)
        if (hypot(k % psf->size - psf->size / 2, k / psf->size - psf->size / 2) > 4)
            psf->basis[k] -= 2e-4f;
    sky_noise(&s, 1, 6);
    sky_star(&s, 20, 20, 3, 1e7);
    s.tile.pixels[64 * 40 + 40] = 3e38f;
    s.tile.pixels[64 * 50 + 12] = -3e38f;
    s.tile.pixels[64 * 30 + 50] = -1e5f;
    s.par.rl_niter = 30;
    r = run("RL", &s, psf);
    assert_near(r->pixels[64 * 8 + 55], 0, 30);
    rx_restored_free(r);
    /* such a PSF lets rounding errors of the brightest pixels grow: finite all the same */
    s.par.rl_niter = 300;
    r = run("RL", &s, psf);
    for (int k = 0; k < 64 * 64; k++)
        assert_true(isfinite(r->pixels[k]));
    rx_restored_free(r);
    for (int k = 0; k < 64 * 64; k++)
        s.background.sigma[k] = 0;
    r = run("RL", &s, psf);
    rx_restored_free(r);
    rx_psf_free(psf);
    sky_free(&s);
}

/* Units do not matter: a tile in 1e-25 of them gives the same, scaled. */
static void any_unit(void **state)
{
    sky a, b;
    crowded(&a, 0);
    crowded(&b, 0);
    const float unit = 1e-25f;
    for (int k = 0; k < 128 * 120; k++) {
        b.tile.pixels[k] *= unit;
        b.background.level[k] *= unit;
        b.background.sigma[k] *= unit;
    }
    b.tile.gain /= unit;
    rx_psf *psf = rx_stamp_gauss(3.2);
    rx_restored *ra = run("RL", &a, psf), *rb = run("RL", &b, psf);
    for (int k = 0; k < 128 * 120; k++)
        assert_near(rb->pixels[k] / unit, ra->pixels[k], 1e-3 + 1e-3 * fabsf(ra->pixels[k]));
    rx_restored_free(ra);
    rx_restored_free(rb);
    rx_psf_free(psf);
    sky_free(&a);
    sky_free(&b);
}

/* A model that is made by strips, as that of a large tile is, against one that is kept: the same bytes. */
static void strips(void **state)
{
    enum { WIDE = 100, HIGH = 6000, STEPS = 3 };
    sky s;
    sky_new(&s, WIDE, HIGH);
    for (int i = 0; i < 60; i++)
        sky_star(&s, 3 + i * 41 % 95, 4 + i * 99, 3, 2000);
    sky_noise(&s, 1, 3);
    for (int k = 0; k < 40; k++)
        s.tile.mask[k * 14653] = RX_MASK_BAD;
    rx_psf *psf = rx_stamp_gauss(3);
    rx_prepared *prepared = NULL;
    rx_blur *blur = NULL;
    rx_rl *whole = NULL, *parts = NULL;
    const rx_image image = sky_image(&s, NULL);
    assert_int_equal(rx_prepared_new(&s.par, &image, &prepared, NULL), RX_OK);
    for (int threads = 1; threads <= 2; threads++) {
        assert_int_equal(rx_blur_new(psf, WIDE, HIGH, threads, &blur, NULL), RX_OK);
        const rx_restore_params par = {.rl_accelerate = threads == 2};
        assert_int_equal(rx_rl_new(&par, prepared, blur, 1, &whole, NULL), RX_OK);
        assert_int_equal(rx_rl_new(&par, prepared, blur, 0, &parts, NULL), RX_OK);
        assert_true(parts->kept < HIGH);
        assert_true(parts->strip < blur->sky_y.n);
        for (int i = 0; i < STEPS; i++) {
            assert_true(rx_rl_chi2(whole) == rx_rl_chi2(parts));
            rx_rl_update(whole, 0);
            rx_rl_update(parts, 0);
            assert_memory_equal(whole->object, parts->object, rx_blur_sky_size(blur) * sizeof(float));
        }
        rx_rl_free(whole);
        rx_rl_free(parts);
        rx_blur_free(blur);
    }
    rx_prepared_free(prepared);
    rx_psf_free(psf);
    sky_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(table),
                                       cmocka_unit_test(none),
                                       cmocka_unit_test(follows_its_equations),
                                       cmocka_unit_test(keeps_flux),
                                       cmocka_unit_test(keeps_sky),
                                       cmocka_unit_test(no_ringing),
                                       cmocka_unit_test(mask_is_blind),
                                       cmocka_unit_test(threads),
                                       cmocka_unit_test(strips),
                                       cmocka_unit_test(saturated_core),
                                       cmocka_unit_test(varying_psf),
                                       cmocka_unit_test(sharpens),
                                       cmocka_unit_test(stops_at_discrepancy),
                                       cmocka_unit_test(hopeless_tiles),
                                       cmocka_unit_test(never_runs_away),
                                       cmocka_unit_test(any_unit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
