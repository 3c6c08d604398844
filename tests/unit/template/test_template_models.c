/* Points and Sersic's profiles fitted to each source: the transforms against closed forms and numerical integrals, fits against what
 * was drawn. */
#include "../near.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "base/memory.h"
#include "field.h"
#include "template/sersic.h"
#include "template/spergel.h"

static rx_sersic_table *table;

static int open_table(void **state)
{
    (void)state;
    return rx_sersic_table_new(&table, NULL) != RX_OK;
}

static int close_table(void **state)
{
    (void)state;
    free(table);
    return 0;
}

/* The transform at q = 2 pi k R: its value, derivatives by ln R, g1 and g2 of a round profile along x, and by ln n. */
static void transform_of(double n, double q, float value[5])
{
    const rx_spergel profile = {1 / (2 * M_PI), 0, 0, n, table};
    float *columns[5] = {value, value + 1, value + 2, value + 3, value + 4};
    rx_spergel_form form;
    rx_spergel_set(&profile, &form);
    rx_spergel_column(&form, q, 1, 0, 1, 5, columns);
}

static double transform(double n, double q)
{
    float value[5];
    transform_of(n, q, value);
    return (double)value[0];
}

/* A Gaussian is n = 0.5, an exponential disk n = 1. */
static void test_closed_forms(void **state)
{
    (void)state;
    const double b = 1.6783469900166605; /* (1 + b) exp(-b) = 1/2 */
    for (double q = 1e-4; q < 1000; q *= 1.37) {
        assert_near(transform(0.5, q), exp(-0.25 * q * q / log(2)), 1e-5);
        assert_near(transform(1, q), pow(1 + q * q / (b * b), -1.5), 1e-5);
    }
}

/* scipy.integrate.quad of I(r) J0(q r) r over zeros of J0, averaged: n = 4, 2.35 and 0.7. */
static void test_steep_profiles(void **state)
{
    static const double expected[][3] = {
        {4, 0.01, 0.99946328},   {4, 0.1, 0.96266208},   {4, 0.5, 0.72878725},     {4, 2, 0.35536014},
        {4, 8, 0.10001808},      {4, 40, 0.01248142},    {2.35, 0.01, 0.99984868}, {2.35, 0.1, 0.98556129},
        {2.35, 0.5, 0.79162527}, {2.35, 2, 0.32230779},  {2.35, 8, 0.05250623},    {2.35, 40, 0.00278303},
        {0.7, 0.01, 0.99995783}, {0.7, 0.1, 0.99579352}, {0.7, 0.5, 0.90104972},   {0.7, 2, 0.24606461},
        {0.7, 8, 0.00207402},    {0.7, 40, 0.00000713}};
    (void)state;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        assert_near(transform(expected[i][0], expected[i][1]), expected[i][2], 1e-5);
}

/* Derivatives against differences of the transform. */
static void test_derivatives(void **state)
{
    (void)state;
    const double step = 0.02;
    for (double n = 0.35; n < 7.5; n *= 1.3)
        for (double q = 0.01; q < 50; q *= 1.9) {
            float value[5];
            transform_of(n, q, value);
            assert_near(value[1], (transform(n, q * exp(step)) - transform(n, q * exp(-step))) / (2 * step),
                        5e-4);
            assert_near(value[2], value[1], 1e-5); /* g1 stretches along x as R does */
            assert_near(value[3], 0, 1e-6);
            assert_near(value[4], (transform(n * exp(step), q) - transform(n * exp(-step), q)) / (2 * step),
                        5e-4);
        }
}

enum { STAR, DISK, MERGED, SOURCES };

/* A star, an exponential disk and a star beside the disk, nearly without noise. */
static void test_fits(void **state)
{
    (void)state;
    field f;
    field_open(&f, 160, 120, 4, 1, SOURCES);
    field_star(&f, 40.3, 60.6, 30000);
    field_disk(&f, 100.2, 60.4, 60000, 3, 0.5, 0.6);
    field_star(&f, 113.4, 66.1, 20000);
    field_noise(&f, 5);
    field_list(&f, 40.3, 60.6, 8, 1.7, 1.7, 0);
    field_list(&f, 100.2, 60.4, 8, 4, 2.5, 0.6);
    field_list(&f, 113.4, 66.1, 5, 1.7, 1.7, 0);
    field_restore_none(&f);
    rx_tphot_input input = field_input(&f);
    rx_tphot_params par = rx_tphot_defaults();
    rx_tphot *tphot = NULL, *again = NULL;
    par.sky_cell = 0;
    par.point_fits = par.sersic_fits = 1;
    assert_int_equal(rx_tphot_run(&par, &input, &tphot, NULL), RX_OK);
    const rx_tphot_source *star = &tphot->list[STAR], *disk = &tphot->list[DISK],
                          *near = &tphot->list[MERGED];
    assert_near(star->point_fit.flux, 30000, 4 * star->point_fit.fluxerr);
    assert_near(star->point_fit.x, 40.3, 0.01);
    assert_near(star->point_fit.y, 60.6, 0.01);
    assert_near(star->point_fit.chi2, 1, 0.2);
    assert_near(star->point_fit.spread, 0, 4 * star->point_fit.spread_error);
    assert_near(near->point_fit.flux, 20000, 4 * near->point_fit.fluxerr);
    assert_near(near->point_fit.spread, 0, 4 * near->point_fit.spread_error);
    assert_true(disk->point_fit.spread > 20 * disk->point_fit.spread_error);
    assert_true(disk->point_fit.chi2 > 5);
    assert_near(disk->sersic_fit.flux, 60000, 4 * disk->sersic_fit.fluxerr);
    assert_near(disk->sersic_fit.radius[0], 3 / sqrt(0.5), 4 * disk->sersic_fit.radius[1]);
    assert_near(disk->sersic_fit.index[0], 1, 4 * disk->sersic_fit.index[1]);
    assert_near(disk->sersic_fit.ratio[0], 0.5, 4 * disk->sersic_fit.ratio[1]);
    assert_near(disk->sersic_fit.theta[0], 0.6, 4 * disk->sersic_fit.theta[1]);
    assert_true(disk->sersic_fit.radius[1] < 0.05);
    assert_true(disk->sersic_fit.index[1] < 0.1);
    par.nthreads = 4;
    assert_int_equal(rx_tphot_run(&par, &input, &again, NULL), RX_OK);
    for (int i = 0; i < SOURCES; i++) {
        assert_memory_equal(&again->list[i].point_fit, &tphot->list[i].point_fit,
                            sizeof tphot->list[i].point_fit);
        assert_memory_equal(&again->list[i].sersic_fit, &tphot->list[i].sersic_fit,
                            sizeof tphot->list[i].sersic_fit);
    }
    rx_tphot_free(again);
    rx_tphot_free(tphot);
    field_close(&f);
}

/* SPREAD_MODEL of a disk by its definition, from pixels drawn by other means: star, its like blurred by an exponential of a sixteenth of
 * twice its half-light radius, and the disk. */
static void test_spread(void **state)
{
    (void)state;
    enum { SIDE = 100, HALF = 10 };
    const double fwhm = 4, beta = 4.765, alpha = 0.5 * fwhm / sqrt(pow(2, 1 / beta) - 1);
    const double half_light =
        hypot(alpha * sqrt(pow(2, 1 / (beta - 1)) - 1), sqrt(log(2) / 6)); /* the latter of a pixel */
    const double x = 50.3, y = 49.8, scale = 2 * half_light / 16;
    field f[3];
    double a = 0, b = 0, gp = 0, pp = 0;
    for (int i = 0; i < 3; i++)
        field_open(&f[i], SIDE, SIDE, fwhm, 1, 1);
    field_star(&f[0], x, y, 1);
    field_disk(&f[1], x, y, 1, 1.67835 * scale, 1, 0);
    field_disk(&f[2], x, y, 1e5, 2, 1, 0);
    for (int v = 50 - HALF; v <= 50 + HALF; v++)
        for (int u = 50 - HALF; u <= 50 + HALF; u++) {
            const double p = (double)f[0].pixels[v * SIDE + u], g = (double)f[1].pixels[v * SIDE + u],
                         d = (double)f[2].pixels[v * SIDE + u];
            a += p * d;
            b += g * d;
            gp += g * p;
            pp += p * p;
        }
    const double expected = b / a - gp / pp;
    assert_true(expected > 0.01);
    field_list(&f[2], x, y, 8, 2.5, 2.5, 0);
    field_restore_none(&f[2]);
    rx_tphot_input input = field_input(&f[2]);
    rx_tphot_params par = rx_tphot_defaults();
    rx_tphot *tphot = NULL;
    par.sky_cell = 0;
    par.point_fits = 1;
    assert_int_equal(rx_tphot_run(&par, &input, &tphot, NULL), RX_OK);
    assert_near(tphot->list[0].point_fit.spread, expected, 0.02 * expected);
    assert_true(isnan(tphot->list[0].sersic_fit.flux)); /* not asked for */
    rx_tphot_free(tphot);
    for (int i = 0; i < 3; i++)
        field_close(&f[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_forms), cmocka_unit_test(test_steep_profiles),
        cmocka_unit_test(test_derivatives), cmocka_unit_test(test_fits), cmocka_unit_test(test_spread)};
    return cmocka_run_group_tests(tests, open_table, close_table);
}
