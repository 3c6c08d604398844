/* restore: the fluxes, the sky and the extremes of RL as it is shipped, accelerated, RL_NITER 18, RL_DENOISE 0.8 PSF, and plain with 30 iterations. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "../near.h"
#include "psf/psf.h"
#include "sky.h"

static const double FWHM = 3;
static int accelerated; /* set between the two runs of all tests */

static void shipped(sky *s, int width, int height)
{
    sky_new(s, width, height);
    s->par.rl_accelerate = accelerated;
    s->par.rl_niter = accelerated ? 18 : 30;
    s->par.rl_denoise = 0.8;
    s->par.rl_denoise_by_psf = 1;
    s->par.rl_pedestal = 4;
}

static rx_restored *run(const char *kind, const sky *s, const rx_psf *psf)
{
    rx_restored *restored = NULL;
    rx_error err = RX_ERROR_NONE;
    const rx_image image = sky_image(s, psf);
    assert_int_equal(rx_restorer_find(kind)->run(&s->par, &image, NULL, &restored, &err), RX_OK);
    for (int k = 0; k < s->tile.width * s->tile.height; k++)
        assert_true(isfinite(restored->pixels[k]));
    return restored;
}

/* Restored flux of the star within `radius`, in units of `flux`. */
static double share(const sky *s, const rx_psf *psf, double x, double y, double radius, double flux)
{
    rx_restored *r = run("RL", s, psf);
    const double sum = sky_sum(s, r->pixels, x, y, radius);
    rx_restored_free(r);
    return sum / flux;
}

/* An isolated source without noise keeps its flux to 0.15 % in an aperture of 5 FWHM (0.08 % with 30 plain iterations),
 * faint or bright, whatever the gain, and so it does a PSF radius away from a border. */
static void isolated(void **state)
{
    static const double flux[] = {450, 4500, 450000}, gain[] = {0, 2, 1000};
    rx_psf *psf = rx_stamp_gauss(FWHM);
    const double margin = psf->size / 2 + 5;
    for (int f = 0; f < 3; f++)
        for (int g = 0; g < 3; g++)
            for (int i = 0; i < 2; i++) {
                const double x = i == 0 ? 50.3 : margin;
                sky s;
                shipped(&s, 101, 97);
                s.tile.gain = gain[g];
                sky_star(&s, x, 48.6, FWHM, flux[f]);
                assert_near(share(&s, psf, x, 48.6, 5 * FWHM, flux[f]), 1, accelerated ? 1.5e-3 : 1e-3);
                assert_near(share(&s, psf, x, 48.6, 1000, flux[f]), 1, 1e-3);
                sky_free(&s);
            }
    rx_psf_free(psf);
}

/* The same with the wings of a Moffat. */
static void wings(void **state)
{
    sky s;
    rx_psf *psf = NULL;
    assert_int_equal(rx_psf_moffat(3.3, 3, 0.9, 0.5, 61, &psf, NULL), RX_OK);
    shipped(&s, 141, 131);
    for (int k = 0; k < 61 * 61; k++)
        s.tile.pixels[(65 + k / 61 - 30) * 141 + 70 + k % 61 - 30] += 20000 * psf->basis[k];
    assert_near(share(&s, psf, 70, 65, 60, 20000), 1, 1e-3);
    rx_psf_free(psf);
    sky_free(&s);
}

/* In noise: the mean over realisations of restored minus input flux is 0 within its error. */
static void in_noise(void **state)
{
    enum { N = 40 };
    static const double flux[] = {200, 4500}, most[] = {0.012, 8e-4};
    rx_psf *psf = rx_stamp_gauss(FWHM);
    for (int f = 0; f < 2; f++) {
        double sum = 0, squares = 0;
        for (int i = 0; i < N; i++) {
            sky s;
            shipped(&s, 81, 81);
            sky_star(&s, 40.3, 39.6, FWHM, flux[f]);
            sky_noise(&s, 1, 100 + (uint64_t)i);
            rx_restored *plain = run("NONE", &s, psf);
            const double in = sky_sum(&s, plain->pixels, 40.3, 39.6, 5 * FWHM) / flux[f];
            const double off = share(&s, psf, 40.3, 39.6, 5 * FWHM, flux[f]) - in;
            sum += off;
            squares += off * off;
            rx_restored_free(plain);
            sky_free(&s);
        }
        const double mean = sum / N, error = sqrt((squares / N - mean * mean) / N);
        assert_true(fabs(mean) < 3 * error + 1e-4);
        assert_true(3 * error + 1e-4 < most[f]);
    }
    rx_psf_free(psf);
}

/* The level of an empty sky, in sigmas. */
static void empty_sky(void **state)
{
    rx_psf *psf = rx_stamp_gauss(FWHM);
    sky s;
    shipped(&s, 400, 400);
    sky_noise(&s, 1, 9);
    rx_restored *plain = run("NONE", &s, psf), *r = run("RL", &s, psf);
    const double in = sky_sum(&s, plain->pixels, 200, 200, 1000) / 160000;
    const double out = sky_sum(&s, r->pixels, 200, 200, 1000) / 160000;
    assert_true(fabs(out - in) < 0.003);
    rx_restored_free(plain);
    rx_restored_free(r);
    sky_free(&s);
    rx_psf_free(psf);
}

/* Where a part of the light is lost to a border or under a mask, f is free beyond: what is to be expected of
 * the true flux, and that `support` tells it. */
static void at_the_edge(void **state)
{
    static const struct {
        double border, limit; /* pixels from the border; |restored / true - 1| at most */
    } borders[] = {{5.3, 0.01}, {3, 0.03}, {1.5, 0.1}};
    static const struct {
        int mask; /* pixels from the star to the first masked column */
        double limit;
    } masks[] = {{8, 0.003}, {6, 0.01}, {4, 0.05}, {2, 0.1}};
    const double flux = 4500;
    rx_psf *psf = rx_stamp_gauss(FWHM);
    for (size_t i = 0; i < sizeof borders / sizeof *borders; i++) {
        sky s;
        shipped(&s, 101, 97);
        sky_star(&s, borders[i].border, 48.6, FWHM, flux);
        assert_near(share(&s, psf, borders[i].border, 48.6, 15, flux), 1, borders[i].limit);
        sky_free(&s);
    }
    for (size_t i = 0; i < sizeof masks / sizeof *masks; i++) {
        sky s;
        shipped(&s, 101, 97);
        sky_star(&s, 50.3, 48.6, FWHM, flux);
        for (int y = 45; y < 54; y++)
            for (int x = 0; x < 6; x++)
                s.tile.mask[y * 101 + 50 + masks[i].mask + x] = RX_MASK_BAD;
        rx_restored *r = run("RL", &s, psf);
        assert_near(sky_sum(&s, r->pixels, 50.3, 48.6, 15) / flux, 1, masks[i].limit);
        assert_true(masks[i].mask > 6 || r->support[48 * 101 + 51] > 0);
        rx_restored_free(r);
        sky_free(&s);
    }
    rx_psf_free(psf);
}

/* Every shape a tile can have, down to one pixel, at any level, with a PSF of one pixel: what goes in comes
 * out, cut at the pedestal. */
static void smallest(void **state)
{
    static const int sizes[][2] = {{1, 1}, {1, 17}, {17, 1}, {2, 2}};
    static const float shift[] = {0, -50, 5000};
    static const char *const kinds[] = {"RL", "RL_BLIND"};
    rx_psf *psf = rx_stamp_gauss(0);
    for (int k = 0; k < 4 * 3 * 4; k++) {
        const int *size = sizes[k % 4];
        sky s;
        shipped(&s, size[0], size[1]);
        s.par.rl_denoise = 0;
        s.par.rl_stop_discrepancy = k / 24;
        sky_noise(&s, 1, 4);
        for (int i = 0; i < size[0] * size[1]; i++)
            s.tile.pixels[i] += shift[k / 4 % 3];
        rx_restored *r = run(kinds[k / 12 % 2], &s, psf);
        for (int i = 0; i < size[0] * size[1]; i++) {
            const double in = s.tile.pixels[i] - 100.0, cut = fmax(in, -4);
            assert_near(r->pixels[i], cut, 0.005 + 1e-4 * fabs(cut));
        }
        rx_restored_free(r);
        sky_free(&s);
    }
    rx_psf_free(psf);
}

enum extreme { PSF_OF_THE_TILE, HUGE_GAIN, TINY_GAIN, SIGMA_RANGE, SIGMA_NONSENSE, HALF_BLIND, EXTREMES };

static void make_extreme(sky *s, enum extreme kind, int side)
{
    shipped(s, side, side);
    sky_star(s, side / 2, side / 2, FWHM, 2000);
    sky_noise(s, 1, 4);
    s->tile.gain = kind == HUGE_GAIN ? 1e30 : kind == TINY_GAIN ? 1e-30 : 0;
    static const float nonsense[] = {0, NAN, INFINITY, -1, 1};
    for (int k = 0; k < side * side; k++)
        s->background.sigma[k] = kind == SIGMA_RANGE      ? (float)pow(10, k % 41 - 20)
                                 : kind == SIGMA_NONSENSE ? nonsense[k % 5]
                                 : kind == HALF_BLIND     ? (k % side < side / 2 - 8 ? 1000 : 1)
                                                          : 1;
}

/* Gains, noise maps and PSFs that make no sense still give the star, and nothing that was not there. */
static void extremes(void **state)
{
    rx_psf *psf = rx_stamp_gauss(FWHM);
    for (int kind = 0; kind < EXTREMES; kind++)
        for (int how = 0; how < 2; how++) {
            sky s;
            make_extreme(&s, (enum extreme)kind, kind == PSF_OF_THE_TILE ? psf->size : 64);
            s.par.rl_stop_discrepancy = how;
            s.par.rl_niter = kind != PSF_OF_THE_TILE ? 30 : accelerated ? 18 : 300;
            rx_restored *r = run("RL", &s, psf);
            const int c = s.tile.width / 2;
            assert_near(sky_sum(&s, r->pixels, c, c, 6) / 2000, 1, 0.1);
            for (int k = 0; k < s.tile.width * s.tile.height; k++) {
                assert_true(r->pixels[k] > -15);
                assert_true(r->pixels[k] < 400);
            }
            rx_restored_free(r);
            sky_free(&s);
        }
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(isolated),    cmocka_unit_test(wings),
                                       cmocka_unit_test(in_noise),    cmocka_unit_test(empty_sky),
                                       cmocka_unit_test(at_the_edge), cmocka_unit_test(smallest),
                                       cmocka_unit_test(extremes)};
    const int failed = cmocka_run_group_tests_name("plain", tests, NULL, NULL);
    accelerated = 1;
    return failed + cmocka_run_group_tests_name("accelerated", tests, NULL, NULL);
}
