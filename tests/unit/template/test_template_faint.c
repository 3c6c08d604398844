/* What helps faint sources: what is usual on the tile, averages over shapes, evidence against neighbours. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "template/fit.h"

typedef struct patch {
    rx_template_otf *renderer;
    rx_template_domain *size;
    rx_patch patch;
    rx_psf *psf;
} patch;

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

/* What chi2 rises by where a star of that flux is left out, photons for a normal distribution of the sky's width. */
static double of_photons(const field *f, double flux, double sigma, double gain)
{
    const int n = f->psf->size * f->psf->size;
    float *stamp = calloc((size_t)n, sizeof *stamp);
    assert_non_null(stamp);
    double rise = 0, normal = 0;
    rx_psf_at(f->psf, 30, 30, stamp);
    for (int i = 0; i < n; i++) {
        const double sky = sigma * sigma * gain * gain, star = fmax(flux * gain * (double)stamp[i], 0);
        rise += 2 * ((sky + star) * log(1 + star / sky) - star);
        normal += star * star / sky;
    }
    free(stamp);
    return rise / normal;
}

/* A star that stands alone is as certainly there whatever its own photons are said to be, but for what few photons of the sky do by
 * chance; its S/N is not. */
static void test_own_photons(void **state)
{
    (void)state;
    enum { FLUX = 600, SIGMA = 5 };
    static const double gains[] = {0.0, 1.0, 0.01};
    field f;
    double evidence[3], snr[3];
    field_open(&f, 60, 60, 3.0, SIGMA, 1);
    field_star(&f, 30.2, 29.7, FLUX);
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
    assert_near(evidence[1] / evidence[0], of_photons(&f, FLUX, SIGMA, 1), 0.05);
    assert_near(evidence[2] / evidence[0], of_photons(&f, FLUX, SIGMA, 0.01), 0.02);
    assert_true(of_photons(&f, FLUX, SIGMA, 1) < 0.8);
    assert_true(of_photons(&f, FLUX, SIGMA, 0.01) < 0.1);
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
                assert_between(s->snr, -3,
                               5); /* the error holds the edge; without it the fluxes are above 7 sigmas */
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

/* Small galaxies among stars, of which there are 4 in 16 around S/N 8 and 12 in 16 around S/N 40: CLASS is their share, and fluxes
 * are right in the mean, within errors that are wide enough for what a source may be. */
static void test_share_of_stars(void **state)
{
    (void)state;
    enum { COLUMNS = 16, ROWS = 16, CELL = 36, N = COLUMNS * ROWS / 2 };
    field f;
    double class[2] = {0}, ratio[2] = {0}, pull[2] = {0}, flux[2 * N];
    field_open(&f, CELL * COLUMNS, CELL * ROWS, 3.5, 1, 2 * N);
    for (int i = 0; i < 2 * N; i++) {
        const int bright = i / COLUMNS % 2;
        const double x = i % COLUMNS * CELL + 17.5 + 0.06 * (i % 17),
                     y = (double)(i / COLUMNS) * CELL + 17.5 + 0.08 * (i % 13);
        flux[i] = (bright ? 210 : 42) * exp(0.1 * (i * 5 % 11 - 5));
        if (i % COLUMNS < (bright ? 12 : 4))
            field_star(&f, x, y, flux[i]);
        else
            field_disk(&f, x, y, flux[i], (bright ? 1.9 : 1.2) * exp(0.09 * (i * 7 % 11 - 5)), 0.8, i);
        field_list(&f, x, y, 4, 1.6, 1.6, 0);
    }
    field_noise(&f, 8);
    field_restore_none(&f);
    rx_tphot *t = fit(&f);
    for (int i = 0; i < 2 * N; i++) {
        const int bright = i / COLUMNS % 2;
        const rx_tphot_source *s = &t->list[i];
        class[bright] += s->star / N;
        ratio[bright] += s->flux / flux[i] / N;
        pull[bright] += pow((s->flux - flux[i]) / s->fluxerr, 2) / N;
    }
    print_message("class %.3f %.3f, flux %.3f %.3f, pulls %.2f %.2f\n", class[0], class[1], ratio[0],
                  ratio[1], sqrt(pull[0]), sqrt(pull[1]));
    assert_near(class[0], 0.25, 0.1);
    assert_near(class[1], 0.75, 0.05);
    assert_near(ratio[0], 1, 0.1);
    assert_near(ratio[1], 1, 0.02);
    assert_near(sqrt(pull[0]), 1, 0.2);
    assert_near(sqrt(pull[1]), 1, 0.2);
    rx_tphot_free(t);
    field_close(&f);
}

/* Stars on a grid, every fifth of them two of half of the flux, 0.6 FWHM apart, and disks, which are no pairs. */
static void test_two(void **state)
{
    (void)state;
    enum { SIDE = 10, CELL = 40, ALL = SIDE * SIDE };
    field f;
    field_open(&f, CELL * SIDE, CELL * SIDE, 4, 1, ALL);
    for (int i = 0; i < ALL; i++) {
        const double x = i % SIDE * CELL + 20.3, y = (double)(i / SIDE) * CELL + 19.8,
                     off = i % 5 == 0 ? 1.2 : 0, flux = 2000.0 / (1 + (i * 7) % 13);
        if (i % 5 == 1)
            field_disk(&f, x, y, flux, 3, 0.7, 0.3);
        else {
            field_star(&f, x - off, y, 0.5 * flux);
            field_star(&f, x + off, y, 0.5 * flux);
        }
        field_list(&f, x, y, 6, 2, 2, 0);
    }
    field_noise(&f, 11);
    field_restore_none(&f);
    rx_tphot *t = fit(&f);
    double mean[3] = {0};
    for (int i = 0; i < ALL; i++) {
        const rx_tphot_source *s = &t->list[i];
        assert_between(s->two, 0, 1);
        assert_between(s->star, 0, 1);
        mean[i % 5 < 2 ? i % 5 : 2] += s->two / (ALL / 5 * (i % 5 < 2 ? 1 : 3));
    }
    print_message("P_BLEND of pairs %.4f, disks %.4f, stars %.4f\n", mean[0], mean[1], mean[2]);
    assert_true(mean[0] > 5 * mean[1]);
    assert_true(mean[0] > 30 * mean[2]);
    assert_true(mean[2] < 0.01);
    rx_tphot_free(t);
    field_close(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_two),
                                       cmocka_unit_test(test_evidence),
                                       cmocka_unit_test(test_structure),
                                       cmocka_unit_test(test_own_photons),
                                       cmocka_unit_test(test_share_of_stars),
                                       cmocka_unit_test(test_beside_cosmic_ray)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
