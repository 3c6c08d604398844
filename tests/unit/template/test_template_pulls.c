/* Are the errors true? 2000 isolated stars of S/N 5 to 100. */
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
#include "num/stats.h"

enum { STARS = 2000, ACROSS = 40, CELL = 36, SKIES = 3 };

/* The robust width of 2000 pulls is known to 0.026, so three skies are taken together. */
static void pulls_of(const field *f, const rx_tphot_params *par, const double *flux, double *pull)
{
    const rx_tphot_input input = field_input(f);
    rx_tphot *t = NULL;
    assert_int_equal(rx_tphot_run(par, &input, &t, NULL), RX_OK);
    for (int i = 0; i < STARS; i++)
        pull[i] = (t->list[i].flux - flux[i]) / t->list[i].fluxerr;
    rx_tphot_free(t);
}

static void make(field *f, double *flux)
{
    double power = 0;
    field_open(f, ACROSS * CELL, STARS / ACROSS * CELL, 3, 1, STARS);
    for (int k = 0; k < f->psf->size * f->psf->size; k++)
        power += (double)f->psf->basis[k] * f->psf->basis[k];
    for (uint64_t i = 0; i < STARS; i++) {
        const double snr = 5 * pow(20, rx_random_uniform(5, 1, i)), off = 0.6 * f->fwhm / snr;
        const double x = (double)(i % ACROSS) * CELL + CELL / 2 + rx_random_uniform(5, 2, i) - 0.5;
        const double y = (double)(i / ACROSS) * CELL + CELL / 2 + rx_random_uniform(5, 3, i) - 0.5;
        flux[i] = snr / sqrt(power);
        field_star(f, x, y, flux[i]);
        field_list(f, x + off * rx_random_normal(5, 4, i), y + off * rx_random_normal(5, 5, i), f->fwhm,
                   f->fwhm / 2.355, f->fwhm / 2.355, 0);
    }
}

static void test_pulls(void **state)
{
    (void)state;
    field f;
    const size_t pixels = (size_t)ACROSS * CELL * STARS / ACROSS * CELL;
    double *flux = RX_NEW(double, STARS), *pull[2], median;
    float *clean = RX_NEW(float, pixels);
    for (int extended = 0; extended < 2; extended++) {
        pull[extended] = RX_NEW(double, SKIES *STARS);
        assert_non_null(pull[extended]);
    }
    assert_non_null(flux);
    assert_non_null(clean);
    make(&f, flux);
    memcpy(clean, f.pixels, pixels * sizeof(float));
    for (int sky = 0; sky < SKIES; sky++) {
        memcpy(f.pixels, clean, pixels * sizeof(float));
        field_noise(&f, 1 + (uint64_t)sky);
        field_restore_none(&f);
        for (int extended = 0; extended < 2; extended++) {
            rx_tphot_params par = rx_tphot_defaults();
            par.extended = extended;
            pulls_of(&f, &par, flux, pull[extended] + sky * STARS);
        }
    }
    for (int extended = 0; extended < 2; extended++) {
        const double width = rx_sigma_mad(pull[extended], SKIES * STARS, &median);
        print_message("%s: median %.3f, width %.3f\n", extended ? "any shape" : "points", median, width);
        assert_near(width, 1, 0.008);
        assert_near(median, 0, 0.05);
        free(pull[extended]);
    }
    free(flux);
    free(clean);
    field_close(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pulls)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
