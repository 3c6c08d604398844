/* Optics against the profile integrated by brute force, and against the PSF module. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "moffat_theory.h"
#include "psf/psf.h"
#include "simulate/optics.h"

static rx_optics *make_moffat(const theory *t, double variation, int width, int height)
{
    rx_error err = RX_ERROR_NONE;
    rx_optics *optics;
    rx_status status = rx_optics_moffat(
        &(rx_moffat_profile){
            .fwhm = t->fwhm, .beta = t->beta, .ratio = t->ratio, .angle = t->angle, .variation = variation},
        width, height, &optics, &err);
    if (status != RX_OK)
        print_message("%s\n", err.text);
    assert_int_equal(status, RX_OK);
    return optics;
}

static double cell(const rx_optics *optics, int image, int dx, int dy)
{
    size_t size = (size_t)optics->size, half = size / 2;
    return (double)
        optics->basis[((size_t)image * size + (size_t)((long)half + dy)) * size + (size_t)((long)half + dx)];
}

/* Near the centre, in the wings and at the corner: within 1e-6 of the peak. */
static void test_cells_are_integrals(void **state)
{
    (void)state;
    const theory cases[] = {{2.0, 4.765, 1.0, 0.0}, {4.0, 2.5, 1.0, 0.0},  {14.0, 4.765, 1.0, 0.0},
                            {1.0, 3.0, 1.0, 0.0},   {3.0, 2.5, 0.6, 0.7},  {0.5, 4.765, 1.0, 0.0},
                            {6.0, 1.5, 0.8, -1.1},  {2.0, 1000., 1.0, 0.0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_optics *o = make_moffat(&cases[c], 0.0, 100, 100);
        double peak = cell(o, 0, 0, 0), worst = 0.0;
        int cells = o->oversampling;
        for (int k = 0; k < 60; k++) {
            int dx = k < 49 ? k % 7 - 3 : (k - 49) * (o->size / 2) / 10,
                dy = k < 49 ? k / 7 - 3 : (k - 49) % 3 * dx / 2;
            double want = theory_box(&cases[c], (double)dx / cells, (double)dy / cells, 1.0, 100);
            worst = fmax(worst, fabs(cell(o, 0, dx, dy) - want) / peak);
        }
        assert_true(worst < 1e-6);
        rx_optics_free(o);
    }
}

/* What is beyond the stamp: less than beyond the largest circle in it, more than beyond the smallest around.
 */
static void test_missing_flux(void **state)
{
    (void)state;
    const double fwhms[] = {0.7, 2.0, 4.0, 8.0, 14.0, 60.0}, betas[] = {1.3, 2.0, 2.5, 4.765, 50.0};
    for (int f = 0; f < 6; f++)
        for (int b = 0; b < 5; b++) {
            theory t = {fwhms[f], betas[b], 1.0, 0.0};
            rx_optics *o = make_moffat(&t, 0.0, 100, 100);
            double half = 0.5 * o->size / o->oversampling, sum = 0.0;
            for (int i = 0; i < o->size * o->size; i++)
                sum += (double)o->basis[i];
            assert_true(fabs(1.0 - sum / (o->oversampling * o->oversampling) - o->missing) < 2e-6);
            assert_true(o->missing < 1.0 - theory_within(&t, half - 0.7) + 2e-6);
            assert_true(o->missing > 1.0 - theory_within(&t, (half + 0.7) * M_SQRT2) - 2e-6);
            /* 30 FWHM or 1000 pixels are enough from beta 2.3 on, but for the widest */
            if (betas[b] > 2.3 && !(fwhms[f] > 20.0 && betas[b] < 3.0))
                assert_true(o->missing < 1e-4);
            rx_optics_free(o);
        }
}

static void test_sampling(void **state)
{
    (void)state;
    const struct {
        double fwhm, beta;
        int oversampling, grid;
    } cases[] = {{14.0, 4.765, 1, 3}, {4.0, 4.765, 1, 3}, {2.0, 4.765, 3, 3}, {2.0, 2.5, 3, 3}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_optics *o = make_moffat(&(theory){cases[c].fwhm, cases[c].beta, 1.0, 0.0}, 0.0, 10, 10);
        assert_int_equal(o->oversampling, cases[c].oversampling);
        assert_int_equal(o->grid, cases[c].grid);
        rx_optics_free(o);
    }
    rx_optics *narrow = make_moffat(&(theory){0.5, 4.765, 1.0, 0.0}, 0.0, 10, 10);
    assert_true(narrow->grid >= 5);
    assert_true(narrow->grid % 2 == 1);
    assert_true(narrow->oversampling % 2 == 1);
    rx_optics_free(narrow);
}

/* The polynomial at (x, y), cell (dx, dy). */
static double varying_cell(const rx_optics *o, double x, double y, int dx, int dy)
{
    double sum = 0.0;
    for (int t = 0; t < o->nterms; t++)
        sum += o->terms[t].factor * pow((x - o->x0) / o->xs, o->terms[t].px) *
               pow((y - o->y0) / o->ys, o->terms[t].py) * cell(o, o->terms[t].image, dx, dy);
    return sum;
}

/* Moffats whose FWHM grows towards the corners: every cell as the Moffat of that place has it, and the FWHM
 * within 0.1 %. */
static void test_variation(void **state)
{
    (void)state;
    const struct {
        theory t;
        double variation;
    } cases[] = {{{4.0, 4.765, 1.0, 0.0}, 0.1},
                 {{3.0, 2.5, 0.8, 0.5}, 0.3},
                 {{4.0, 4.765, 1.0, 0.0}, -0.3},
                 {{2.5, 3.0, 1.0, 0.0}, 1.0}};
    const int width = 300, height = 200;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_optics *o = make_moffat(&cases[c].t, cases[c].variation, width, height);
        rx_psf *psf;
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(rx_optics_on_pixels(o, &psf, &err), RX_OK);
        float *stamp = malloc(sizeof(float) * (size_t)psf->size * (size_t)psf->size);
        double worst = 0.0, worst_fwhm = 0.0, worst_sum = 0.0;
        for (int k = 0; k < 12; k++) {
            double x = (width - 1) * (k % 4 / 3.0), y = (height - 1) * (k / 4 / 2.0);
            double s = (pow(x - 149.5, 2) + pow(y - 99.5, 2)) / (149.5 * 149.5 + 99.5 * 99.5), fwhm, e,
                   sum = 0.0;
            theory here = cases[c].t;
            here.fwhm *= 1.0 + cases[c].variation * s;
            rx_psf_at(psf, x, y, stamp);
            double peak = theory_box(&here, 0.0, 0.0, 1.0, 60);
            for (int i = 0; i < psf->size * psf->size; i++)
                sum += (double)stamp[i];
            for (int d = 0; d <= 12; d++) {
                double want = theory_box(&here, d / 2, d % 2 * (d / 4), 1.0, 60);
                double got =
                    varying_cell(o, x, y, d / 2 * o->oversampling, d % 2 * (d / 4) * o->oversampling);
                worst = fmax(worst, fabs(got - want) / peak);
            }
            assert_int_equal(rx_psf_shape(stamp, psf->size, &fwhm, &e, NULL, &err), RX_OK);
            worst_fwhm = fmax(worst_fwhm, fabs(fwhm / here.fwhm - 1.0));
            worst_sum = fmax(worst_sum, fabs(sum - 1.0));
        }
        print_message("%s: %d images, error of a pixel %.1e of the peak, of the FWHM %.1e\n", o->description,
                      o->nbasis, worst, worst_fwhm);
        assert_true(worst < 1.5e-4);
        assert_true(worst_fwhm < 1e-3);
        assert_true(worst_sum < 2e-6);
        free(stamp);
        rx_psf_free(psf);
        rx_optics_free(o);
    }
}

/* A constant Moffat on pixels is the one that the PSF module makes. */
static void test_on_pixels_is_the_psf(void **state)
{
    (void)state;
    const theory cases[] = {{2.0, 4.765, 1.0, 0.0}, {5.0, 2.5, 0.7, 0.4}, {14.0, 3.0, 1.0, 0.0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_error err = RX_ERROR_NONE;
        rx_optics *o = make_moffat(&cases[c], 0.0, 1000, 1000);
        rx_psf *got, *want;
        assert_int_equal(rx_optics_on_pixels(o, &got, &err), RX_OK);
        assert_int_equal(
            rx_psf_moffat(cases[c].fwhm, cases[c].beta, cases[c].ratio, cases[c].angle, 0, &want, &err),
            RX_OK);
        assert_int_equal(got->size, want->size);
        assert_int_equal(got->nbasis, 1);
        assert_int_equal(got->type, RX_PSF_MOFFAT);
        for (int i = 0; i < got->size * got->size; i++)
            assert_true(fabsf(got->basis[i] - want->basis[i]) <
                        2e-6f * want->basis[got->size * got->size / 2]);
        assert_true(got->fwhm == want->fwhm);
        assert_true(got->beta == want->beta);
        assert_true(got->ellipticity == want->ellipticity);
        rx_psf_free(got);
        rx_psf_free(want);
        rx_optics_free(o);
    }
}

/* Moments of a Gaussian in a pixel: sigma^2 + 1/12 in each direction. */
static void test_gauss(void **state)
{
    (void)state;
    const double fwhms[] = {1.0, 2.0, 3.3, 12.0};
    for (int f = 0; f < 4; f++) {
        rx_error err = RX_ERROR_NONE;
        rx_optics *o;
        assert_int_equal(rx_optics_gauss(fwhms[f], &o, &err), RX_OK);
        double sum = 0.0, xx = 0.0, yy = 0.0, xy = 0.0, want = pow(fwhms[f] / 2.354820045, 2) + 1.0 / 12.0;
        for (int j = -o->size / 2; j <= o->size / 2; j++)
            for (int i = -o->size / 2; i <= o->size / 2; i++) {
                double v = cell(o, 0, i, j), x = (double)i / o->oversampling, y = (double)j / o->oversampling;
                sum += v, xx += v * x * x, yy += v * y * y, xy += v * x * y;
            }
        assert_true(fabs(sum / (o->oversampling * o->oversampling) - 1.0) < 1e-5);
        assert_true(fabs(xx / sum / want - 1.0) < 1e-4);
        assert_true(fabs(yy / sum / want - 1.0) < 1e-4);
        assert_true(fabs(xy / sum) < 1e-6);
        rx_optics_free(o);
    }
}

/* A PSF that varies goes through the optics unharmed. */
static void test_psf_there_and_back(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    rx_psf *psf = rx_psf_new(RX_PSF_PSFEX, 9, 3), *back;
    rx_optics *o;
    assert_non_null(psf);
    for (int b = 0; b < 3; b++) {
        double sum = 0.0;
        for (int i = 0; i < 81; i++) {
            double x = i % 9 - 4, y = i / 9 - 4;
            double v = exp(-0.3 * (x * x + y * y)) * (b == 0 ? 1.0 : b == 1 ? x * x - 1.7 : y * y - 1.7);
            psf->basis[b * 81 + i] = (float)v;
            sum += v;
        }
        for (int i = 0; i < 81; i++)
            psf->basis[b * 81 + i] =
                b == 0 ? psf->basis[i] / (float)sum : psf->basis[b * 81 + i] - (float)(sum / 81.0);
        psf->px[b] = b == 1;
        psf->py[b] = b == 2;
    }
    psf->x0 = 12.0, psf->y0 = 20.0, psf->xs = 100.0, psf->ys = 120.0;
    psf->fwhm = 3.3;
    snprintf(psf->description, sizeof psf->description, "made by hand");
    assert_int_equal(rx_optics_psf(psf, &o, &err), RX_OK);
    assert_int_equal(rx_optics_on_pixels(o, &back, &err), RX_OK);
    assert_int_equal(back->size, 9);
    assert_int_equal(back->nbasis, 3);
    assert_int_equal(back->type, RX_PSF_PSFEX);
    assert_string_equal(back->description, "made by hand");
    for (int k = 0; k < 4; k++) {
        float want[81], got[81];
        rx_psf_at(psf, 30.0 * k, 25.0 * k, want);
        rx_psf_at(back, 30.0 * k, 25.0 * k, got);
        for (int i = 0; i < 81; i++)
            assert_true(fabsf(want[i] - got[i]) < 1e-6f);
    }
    rx_psf_free(psf);
    rx_psf_free(back);
    rx_optics_free(o);
}

static void test_bad_values(void **state)
{
    (void)state;
    const double cases[][5] = {{0.2, 3, 1, 0, 0},  {300, 3, 1, 0, 0}, {4, 1.0, 1, 0, 0},
                               {4, 3, 0.01, 0, 0}, {4, 3, 1.5, 0, 0}, {4, 3, 1, INFINITY, 0},
                               {4, 3, 1, 0, -0.9}, {4, 3, 1, 0, 3},   {NAN, 3, 1, 0, 0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_error err = RX_ERROR_NONE;
        rx_optics *o = (rx_optics *)&err;
        const double *v = cases[c];
        assert_int_equal(rx_optics_moffat(
                             &(rx_moffat_profile){
                                 .fwhm = v[0], .beta = v[1], .ratio = v[2], .angle = v[3], .variation = v[4]},
                             100, 100, &o, &err),
                         RX_USAGE);
        assert_null(o);
        assert_true(strlen(err.text) > 20);
    }
    rx_error err = RX_ERROR_NONE;
    rx_optics *o;
    assert_int_equal(rx_optics_gauss(0.0, &o, &err), RX_USAGE);
    assert_null(o);
    rx_optics_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cells_are_integrals),
        cmocka_unit_test(test_missing_flux),
        cmocka_unit_test(test_sampling),
        cmocka_unit_test(test_variation),
        cmocka_unit_test(test_on_pixels_is_the_psf),
        cmocka_unit_test(test_gauss),
        cmocka_unit_test(test_psf_there_and_back),
        cmocka_unit_test(test_bad_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
