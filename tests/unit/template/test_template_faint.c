/* What helps faint sources: what is usual on the tile, averages over shapes, evidence against neighbours. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"
#include "psf/psf.h"
#include "template/fit.h"
#include "template/prior.h"
#include "template/spergel.h"

/* Columns in single precision against the doubles. */
static void test_column(void **state)
{
    (void)state;
    enum { N = 65, FIRST = -20 };
    static const rx_spergel profiles[] = {
        {2.5, 0.2, -0.1, 0.3}, {0.2, 0, 0, -0.7}, {30, -0.5, 0.6, 8}, {9, 0.1, 0, -0.78}};
    float values[5][N];
    float *columns[5];
    for (int k = 0; k < 5; k++)
        columns[k] = values[k];
    for (size_t p = 0; p < sizeof profiles / sizeof *profiles; p++)
        for (int u = 0; u <= 64; u += 8) {
            rx_spergel_form form;
            rx_spergel_set(&profiles[p], &form);
            rx_spergel_column(&form, u / 128.0, 1.0 / 128, FIRST, N, 5, columns);
            for (int v = 0; v < N; v++) {
                double gradient[4];
                const double value = rx_spergel_at(&form, u / 128.0, (FIRST + v) / 128.0, gradient);
                assert_near(values[0][v], value, 1e-6);
                for (int k = 0; k < 4; k++)
                    assert_near(values[k + 1][v], gradient[k], 3e-6 * (1 + fabs(gradient[k])));
            }
            float alone[N];
            columns[0] = alone;
            rx_spergel_column(&form, u / 128.0, 1.0 / 128, FIRST, N, 1, columns);
            columns[0] = values[0];
            for (int v = 0; v < N; v++)
                assert_near(alone[v], values[0][v], 1e-6f);
        }
}

/* 900 sources of S/N 20 to 100, a third of them points; radii follow a law with scatter and are known to
 * +- 0.3. */
static void test_usual(void **state)
{
    (void)state;
    enum { N = 900 };
    rx_prior_sample *cases = RX_NEW(rx_prior_sample, N);
    assert_non_null(cases);
    double pivot = 0;
    for (uint64_t i = 0; i < N; i++) {
        const double flux = 100 * pow(5, rx_random_uniform(3, 1, i)), u = log(flux / 224);
        const int point = i % 3 == 0;
        const double radius = 0.7 + 0.4 * u + 0.5 * rx_random_normal(3, 2, i);
        const double nu = 0.2 + 0.6 * rx_random_normal(3, 3, i);
        cases[i] = (rx_prior_sample){.flux = flux, .snr = flux / 5, .evidence = point ? -20 : 30};
        if (!point) {
            cases[i].radius = (rx_likelihood){radius + 0.3 * rx_random_normal(3, 4, i), 1 / 0.09};
            cases[i].nu = (rx_likelihood){nu + 0.3 * rx_random_normal(3, 5, i), 1 / 0.09};
        }
        pivot += log(flux) / N;
    }
    rx_tile_prior usual = rx_tile_prior_start(4);
    rx_tile_prior_fit(cases, 19, 0, 4, &usual);
    assert_true(usual.star_odds == 1);
    assert_true(usual.radius.mean == log(2.4));
    assert_true(usual.radius.slope == 0);
    rx_tile_prior_fit(cases, N, 0, 4, &usual);
    assert_near(usual.star_odds, 0.5, 0.0025);
    assert_near(usual.pivot, pivot, 1e-12);
    /* 600 sources: means known to 0.025, the slope to 0.05 */
    assert_near(rx_prior_scaling_mean(&usual, &usual.radius, 224), 0.7, 0.004);
    assert_near(usual.radius.slope, 0.4, 0.15);
    assert_near(usual.radius.width / 1.4, 0.5, 0.03); /* used 1.4 times as wide */
    assert_near(usual.nu.mean, 0.2, 0.08);
    assert_near(usual.nu.width, 0.6, 0.015);
    /* a prior goes in and comes out */
    const rx_likelihood word = rx_likelihood_of((4 * 2.0 + 1 * 0.5) / 5, 1 / 5.0, 0.5, 1);
    assert_near(word.mean, 2, 1e-12);
    assert_near(word.precision, 4, 1e-12);
    assert_true(rx_likelihood_of(1, 1, 1, 1).precision == 0);
    free(cases);
}

typedef struct patch {
    rx_template_otf *lens;
    rx_template_domain *size;
    rx_patch patch;
    rx_psf *psf;
} patch;

/* An exponential of radius 3 behind a Moffat, flux `flux`, noise 1. */
static void open_patch(patch *p, double flux, uint64_t seed)
{
    enum { HALF = 20 };
    const rx_spergel truth = {3, 0, 0, 0.5};
    assert_int_equal(rx_psf_moffat(4, 3.5, 1, 0, 25, &p->psf, NULL), RX_OK);
    assert_int_equal(rx_template_otf_new(p->psf, NULL, &p->lens, NULL), RX_OK);
    assert_int_equal(rx_template_otf_at(p->lens, rx_template_otf_side(p->lens, 15, 0), 0, 0, &p->size, NULL),
                     RX_OK);
    rx_template_domain_render(p->size, &truth, 0, 0, NULL, 1);
    const int side = 2 * HALF + 1, corner = p->size->n / 2 - HALF;
    const size_t stride = (size_t)rx_fft_stride_real(p->size->fft);
    p->patch = (rx_patch){.side = side, .corner = corner};
    p->patch.data = RX_NEW(double, 2 * side * side);
    assert_non_null(p->patch.data);
    p->patch.weight = p->patch.data + side * side;
    for (int k = 0; k < side * side; k++) {
        const size_t at = (size_t)(k / side + corner) * stride + (size_t)(k % side + corner);
        p->patch.data[k] = flux * p->size->plane[0][at] + rx_random_normal(seed, 1, (uint64_t)k);
        p->patch.weight[k] = 1;
    }
}

static void close_patch(patch *p)
{
    rx_patch_clear(&p->patch);
    rx_template_otf_free(p->lens);
    rx_psf_free(p->psf);
}

/* All but flux and radius are held by their priors. */
static rx_fit only_radius(void)
{
    rx_fit fit = {.n = RX_FIT_ALL, .iterations = 30};
    for (int j = 0; j < RX_FIT_ALL; j++)
        fit.width[j] = j == RX_FIT_FLUX ? 0 : j == RX_FIT_RADIUS ? 0.8 : 1e-4;
    fit.p[RX_FIT_RADIUS] = fit.prior[RX_FIT_RADIUS] = log(3);
    fit.p[RX_FIT_NU] = fit.prior[RX_FIT_NU] = log(1.5);
    fit.high[RX_FIT_G1] = 0.8;
    fit.low[RX_FIT_G1] = -0.8;
    return fit;
}

/* The mean flux over the posterior of the radius, summed up over 241 radii. */
static double exact_mean(const rx_fit *best, const patch *p)
{
    const size_t stride = (size_t)rx_fft_stride_real(p->size->fft);
    double sum = 0, flux = 0;
    for (int k = 0; k <= 240; k++) {
        const double r = best->p[RX_FIT_RADIUS] - 3 + 6 * k / 240.0;
        const rx_spergel profile = {exp(r), 0, 0, 0.5};
        double tt = 0, td = 0, dd = 0;
        rx_template_domain_render(p->size, &profile, best->p[RX_FIT_X], best->p[RX_FIT_Y], NULL, 1);
        for (int i = 0; i < p->patch.side * p->patch.side; i++) {
            const double t = p->size->plane[0][(size_t)(i / p->patch.side + p->patch.corner) * stride +
                                               (size_t)(i % p->patch.side + p->patch.corner)];
            tt += t * t;
            td += t * p->patch.data[i];
            dd += p->patch.data[i] * p->patch.data[i];
        }
        const double off = (r - log(3)) / 0.8, chi2 = dd - td * td / tt + off * off;
        const double w = exp(-0.5 * (chi2 - best->chi2)) / sqrt(tt);
        sum += w;
        flux += w * td / tt;
    }
    return flux / sum;
}

static void test_average(void **state)
{
    (void)state;
    double left = 0, before = 0;
    for (uint64_t seed = 1; seed <= 12; seed++) {
        patch p;
        rx_fit fit = only_radius();
        open_patch(&p, 150, seed); /* S/N 12 */
        rx_fit_run(&fit, p.size, &p.patch);
        const rx_fit_mean mean = rx_fit_average(&fit, p.size, &p.patch);
        const double best = fit.p[RX_FIT_FLUX], exact = exact_mean(&fit, &p);
        before += fabs(best - exact);
        left += fabs(mean.flux - exact);
        assert_true(mean.variance > 0.5 * rx_fit_variance(&fit, 0));
        assert_true(mean.variance < 2.5 * rx_fit_variance(&fit, 0));
        close_patch(&p);
    }
    print_message("off the mean: best fit %.2f, average %.2f\n", before / 12, left / 12);
    assert_true(left < 0.4 * before);
    /* a bright one is a Gaussian */
    patch p;
    rx_fit fit = only_radius();
    open_patch(&p, 20000, 5);
    rx_fit_run(&fit, p.size, &p.patch);
    const rx_fit_mean mean = rx_fit_average(&fit, p.size, &p.patch);
    const double variance = rx_fit_variance(&fit, 0);
    assert_near(mean.flux, fit.p[RX_FIT_FLUX], 0.05 * sqrt(variance));
    assert_near(mean.variance / variance, 1, 0.005);
    assert_near(mean.evidence, 0, 0.05);
    close_patch(&p);
}

/* By default, all sources of the list. */
static rx_tphot *fit(field *f)
{
    rx_tphot_params par = rx_tphot_defaults();
    rx_tphot_input input = field_input(f);
    rx_tphot *t = NULL;
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    return t;
}

/* Disks with a star on them, and disks with a source in the list that is not there or is a knot. */
static void test_evidence(void **state)
{
    (void)state;
    enum { CELLS = 12, CELL = 96 };
    field f;
    field_open(&f, CELL * 4, CELL * 3, 3, 1, 2 * CELLS);
    for (int i = 0; i < CELLS; i++) {
        const double x = i % 4 * CELL + 48.3, y = (double)(i / 4) * CELL + 47.8;
        const double away = i < 8 ? 8 : 5;
        field_disk(&f, x, y, 8000, 5, 0.8, 0.3);
        if (i < 4)
            field_star(&f, x + away, y + away, 300);
        else if (i >= 8)
            field_star(&f, x + away, y, 60); /* a knot: S/N 8, a tenth of the disk there */
        field_list(&f, x, y, 9, 4, 3.2, 0.3);
        field_list(&f, x + away, y + (i < 8 ? away : 0), 3, 1.3, 1.3, 0);
    }
    field_noise(&f, 4);
    field_restore_none(&f);
    rx_tphot *t = fit(&f);
    for (int i = 0; i < CELLS; i++) {
        const rx_tphot_source *disk = &t->list[2 * i], *s = &t->list[2 * i + 1];
        print_message("%d: S/N %.1f evidence %.1f, disk %.1f\n", i, s->snr, s->evidence, disk->evidence);
        assert_true(disk->evidence > 1e4);
        assert_true(s->evidence <= 1.05 * pow(s->flux * s->shape_error / s->fluxerr, 2) + 1);
        assert_true(i < 4 ? s->evidence > 49 : s->evidence < 25);
    }
    rx_tphot_free(t);
    field_close(&f);
}

/* A star that stands alone is as certainly there whatever its own photons are said to be; its S/N is not. */
static void test_own_photons(void **state)
{
    (void)state;
    static const double gains[] = {0.0, 1.0, 0.01};
    field f;
    double evidence[3], snr[3];
    field_open(&f, 60, 60, 3.0, 5.0, 1);
    field_star(&f, 30.2, 29.7, 600.0);
    field_noise(&f, 3);
    field_list(&f, 30, 30, 5, 1.5, 1.5, 0);
    field_restore_none(&f);
    for (int k = 0; k < 3; k++) {
        rx_tphot_params par = rx_tphot_defaults();
        rx_tphot_input input = field_input(&f);
        rx_tphot *tphot = NULL;
        input.image.gain = gains[k];
        par.extended = 0;
        par.sky_cell = 0;
        assert_int_equal(rx_tphot_run(&par, &input, &tphot, NULL), RX_OK);
        evidence[k] = tphot->list[0].evidence;
        snr[k] = tphot->list[0].snr;
        rx_tphot_free(tphot);
    }
    assert_near(evidence[1] / evidence[0], 1.0, 0.05);
    assert_near(evidence[2] / evidence[0], 1.0, 0.15); /* weights differ, and with them the flux */
    assert_true(snr[2] < 0.5 * snr[0]);
    field_close(&f);
}

/* The edge of a chip as a mesh leaves it, a ridge on one side and a trough on the other: what a list has along the ridge is no
 * source, stars elsewhere are as before, and one in the trough is there. */
static void test_structure(void **state)
{
    (void)state;
    enum { FALSE = 4, TRUE = 6, W = 320, H = 240, EDGE = 150 };
    static const double star[TRUE][3] = {{40, 40, 90},  {40, 120, 90},  {60, 200, 140},
                                         {260, 60, 90}, {280, 180, 90}, {EDGE - 12, 120, 200}};
    double left[2][FALSE + TRUE]; /* evidence over (S/N)^2, without and with the edge */
    for (int k = 0; k < 2; k++) {
        field f;
        field_open(&f, W, H, 4, 1, FALSE + TRUE);
        for (int i = 0; i < W * H && k == 1; i++) {
            const int x = i % W - EDGE;
            f.pixels[i] += (float)((x < 0 ? -1 : 1) * exp(-abs(x) / 20.0));
        }
        for (int i = 0; i < TRUE; i++)
            field_star(&f, star[i][0], star[i][1], star[i][2]);
        for (int i = 0; i < FALSE; i++)
            field_list(&f, EDGE + 5, 45 + 50 * i, 6, 3, 3, 0);
        for (int i = 0; i < TRUE; i++)
            field_list(&f, star[i][0], star[i][1], 4, 1.7, 1.7, 0);
        field_noise(&f, 11);
        field_restore_none(&f);
        rx_tphot *t = fit(&f);
        for (int i = 0; i < FALSE + TRUE; i++) {
            const rx_tphot_source *s = &t->list[i];
            left[k][i] = s->evidence / pow(s->snr * s->shape_error, 2);
            print_message("%d %d: S/N %.1f evidence %.1f\n", k, i, s->snr, s->evidence);
            if (k == 1 && i < FALSE) {
                assert_true(s->snr > 7);
                assert_true(s->evidence < 16);
            }
        }
        assert_true(k == 0 || t->list[FALSE + TRUE - 1].evidence > 60);
        rx_tphot_free(t);
        field_close(&f);
    }
    for (int i = FALSE; i < FALSE + TRUE - 1; i++)
        for (int k = 0; k < 2; k++)
            assert_near(left[k][i], 1, 0.1);
}

/* A hot pixel 7 pixels away, listed and without a model that fits it (then there is a trough around it) or not listed, hides no star. */
static void test_beside_cosmic_ray(void **state)
{
    (void)state;
    enum { SIDE = 100, X = 50 };
    for (int listed = 0; listed < 2; listed++) {
        field f;
        field_open(&f, SIDE, SIDE, 2.5, 1, 1 + listed);
        field_star(&f, X, X, 60);
        f.pixels[(X + 1) * SIDE + X - 7] += 150;
        field_list(&f, X, X, 3, 1.2, 1.2, 0);
        if (listed)
            field_list(&f, X - 7, X + 1, 1, 0.5, 0.5, 0);
        field_noise(&f, 12);
        field_restore_none(&f);
        rx_tphot *t = fit(&f);
        const rx_tphot_source *s = &t->list[0];
        print_message("listed %d: S/N %.1f evidence %.1f\n", listed, s->snr, s->evidence);
        assert_true(s->snr > 9);
        assert_true(s->evidence > 40);
        rx_tphot_free(t);
        field_close(&f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_column),           cmocka_unit_test(test_usual),
        cmocka_unit_test(test_average),          cmocka_unit_test(test_evidence),
        cmocka_unit_test(test_structure),        cmocka_unit_test(test_own_photons),
        cmocka_unit_test(test_beside_cosmic_ray)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
