/* Crowds: which cells are, what is measured anew there, and two points against a profile. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "template/unseen.h"

enum { W = 512, H = 320, LEFT = 192 };

enum { HALF = 16, SIDE = 2 * HALF + 1 };

static const double faint[][2] = {{40, 40},   {200, 60}, {60, 170}, {210, 200},
                                  {120, 110}, {30, 220}, {230, 120}};
enum { FAINT = sizeof faint / sizeof *faint };
static const double nothing[2] = {128.3, 20.6};

/* One star each look, and a place where nothing is, until that is said to be known. */
static rx_status show_one(void *user, const rx_tphot_search *look, double (**dst)[2], int *n, rx_error *err)
{
    int *calls = user, known = 0; /* looks; those with `nothing` */
    (void)err;
    for (int i = 0; i < look->n; i++)
        known = known || hypot(look->at[i][0] - nothing[0], look->at[i][1] - nothing[1]) < 3;
    *dst = rx_alloc(2, sizeof **dst);
    assert_non_null(*dst);
    *n = 0;
    if (calls[0] < FAINT)
        memcpy((*dst)[(*n)++], faint[calls[0]], sizeof nothing);
    if (!known)
        memcpy((*dst)[(*n)++], nothing, sizeof nothing);
    calls[0]++;
    calls[1] += !known;
    return RX_OK;
}

/* What did not hold in the first passes is not offered for ever; stars that come one after the other, each fitted with what is
 * near, have their fluxes in the end. */
static void test_passes(void **state)
{
    (void)state;
    field f;
    int calls[2] = {0};
    rx_tphot_params par = rx_tphot_defaults();
    rx_tphot *t = NULL;
    field_open(&f, 256, 256, 4, 1, 1);
    field_noise(&f, 3);
    field_star(&f, 100, 180, 2000);
    for (int i = 0; i < FAINT; i++)
        field_star(&f, faint[i][0], faint[i][1], 500);
    field_list(&f, 100, 180, 6, 1.7, 1.7, 0);
    field_restore_none(&f);
    rx_tphot_input input = field_input(&f);
    input.more = show_one;
    input.user = calls;
    par.passes = 12;
    par.crowding = RX_CROWDING_YES;
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_int_equal(calls[1], 4);
    assert_int_equal(calls[0], FAINT + 1);
    assert_int_equal(t->passes, FAINT + 1);
    assert_int_equal(t->n, FAINT + 1);
    assert_near(t->list[0].flux, 2000, 4 * t->list[0].fluxerr);
    for (int i = 1; i < t->n; i++)
        assert_near(t->list[i].flux, 500, 4 * t->list[i].fluxerr);
    rx_tphot_free(t);
    field_close(&f);
}

/* Only what fits have split. */
static rx_status show_seconds(void *user, const rx_tphot_search *look, double (**dst)[2], int *n,
                              rx_error *err)
{
    int *calls = user;
    (void)err;
    *n = look->nseconds;
    *dst = rx_alloc((size_t)*n, sizeof **dst);
    assert_non_null(*dst);
    memcpy(*dst, look->seconds, (size_t)*n * sizeof **dst);
    calls[0]++;
    return RX_OK;
}

/* A grid of stars half of whose pixels are light is a crowd; where most of what lies on it are artefacts there is none. */
static void test_artefacts_are_no_crowd(void **state)
{
    (void)state;
    for (int artefacts = 0; artefacts < 2; artefacts++) {
        field f;
        rx_tphot_params par = rx_tphot_defaults();
        rx_tphot *t = NULL;
        field_open(&f, 240, 240, 4, 1, 400);
        field_noise(&f, 3);
        for (int i = 0; i < 400; i++) {
            const double x = 6 + 12 * (i % 20) + 0.3 * (i % 3), y = 6.0 + 12 * (double)(i / 20);
            field_star(&f, x, y, 1500);
            field_list(&f, x, y, 5, 1.7, 1.7, 0);
            f.sources->list[i].fit.restore = artefacts && i % 37 != 0 ? RX_RESTORE_SHARP : 0;
        }
        field_restore_none(&f);
        const rx_tphot_input input = field_input(&f);
        par.crowding = RX_CROWDING_AUTO;
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        assert_near(t->crowded, !artefacts, 1e-12);
        rx_tphot_free(t);
        field_close(&f);
    }
}

/* Where it is not crowded: a pair 0.8 FWHM apart is two points, a star, a galaxy and a pair too near to be split are what they
 * were, the latter marked by its class; with CROWDING N all are, and so is a tile without pairs, to the byte. */
static void test_clear_pair(void **state)
{
    (void)state;
    rx_tphot_source before[3];
    for (int turn = 0; turn < 4; turn++) { /* no pair; one, as AUTO, without, and as NO has it */
        field f;
        int calls = 0;
        rx_tphot_params par = rx_tphot_defaults();
        rx_tphot *t = NULL;
        field_open(&f, 256, 256, 4, 1, 4);
        field_noise(&f, 3);
        field_star(&f, 60, 60, 2000);
        field_disk(&f, 190, 60, 6000, 3, 0.7, 30);
        field_star(&f, 60, 190, 2000);
        field_star(&f, 60.4, 190.8, 1500);
        if (turn > 1) {
            field_star(&f, 190, 190, 2000);
            field_star(&f, 192.6, 191.8, 1400);
        }
        field_list(&f, 60, 60, 6, 1.7, 1.7, 0);
        field_list(&f, 190, 60, 9, 3, 2.4, 30);
        field_list(&f, 60, 190.4, 6, 1.8, 1.7, 0);
        if (turn > 1)
            field_list(&f, 191.1, 190.7, 8, 2.2, 1.8, 35);
        field_restore_none(&f);
        rx_tphot_input input = field_input(&f);
        input.more = show_seconds;
        input.user = &calls;
        par.crowding = turn == 1 || turn == 3 ? RX_CROWDING_NO : RX_CROWDING_AUTO;
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        assert_int_equal(calls, 1);
        assert_int_equal(t->n, turn == 0 || turn == 1 ? 3 : turn == 2 ? 5 : 4);
        assert_int_equal(t->list[1].kind, RX_TPHOT_PROFILE);
        if (turn == 0)
            memcpy(before, t->list, sizeof before);
        if (turn == 1)
            for (int i = 0; i < 3; i++)
                assert_memory_equal(&t->list[i].flux, &before[i].flux, sizeof before[i].flux);
        if (turn == 2) {
            assert_near(t->list[3].flux, 2000, 4 * t->list[3].fluxerr);
            assert_near(t->list[4].flux, 1400, 4 * t->list[4].fluxerr);
            assert_near(t->list[4].x, 192.6, 0.3);
            assert_near(t->list[4].y, 191.8, 0.3);
        }
        if (turn == 3)
            assert_int_equal(t->list[3].kind, RX_TPHOT_PROFILE);
        rx_tphot_free(t);
        field_close(&f);
    }
}

static int falling(const void *one, const void *other)
{
    const float a = *(const float *)one, b = *(const float *)other;
    return a < b ? 1 : a > b ? -1 : 0;
}

/* Noise is not less than that of rounding, nor than two millionths of what the brightest thousandth of pairs of pixels has, whatever
 * the noise map says; a few hot pixels say nothing. Without noise fluxes are right all the same, with whole numbers nothing is found beside what is there. */
static void test_least_noise(void **state)
{
    (void)state;
    for (int rounded = 0; rounded < 2; rounded++) {
        field f;
        rx_fit_image image;
        rx_tphot *t = NULL;
        rx_tphot_params par = rx_tphot_defaults();
        field_open(&f, 128, 128, 4, 0.05, 2);
        field_star(&f, 50, 60, 20000);
        field_star(&f, 57, 63, 9000);
        for (int k = 0; k < 128 * 128; k++) {
            f.sigma[k] = 1e-9f;
            f.pixels[k] = rounded ? roundf(f.pixels[k]) : f.pixels[k];
        }
        for (int i = 0; i < 3; i++)
            f.pixels[20 * 128 + 20 + i] = 1e12f;
        field_list(&f, 50, 60, 4, 1.7, 1.7, 0);
        field_list(&f, 57, 63, 4, 1.7, 1.7, 0);
        field_restore_none(&f);
        const rx_tphot_input input = field_input(&f);
        rx_fit_image_open(&input, 128 * 128, 2, &image);
        static float pair[128 * 127];
        for (int k = 0; k < 128 * 127; k++) {
            const float *both = &f.pixels[k / 127 * 128 + k % 127];
            pair[k] = fminf(both[0], both[1]);
        }
        qsort(pair, 128 * 127, sizeof *pair, falling);
        const double bright = (double)pair[16], floor = rounded ? sqrt(1 / 12.0) : (double)image.floor;
        assert_near(image.brightest, pair[0], 1e6);
        assert_near(image.floor, floor, 1e-4 * floor);
        if (!rounded)
            assert_near(image.floor, 1.8e-6 * bright, 0.22e-6 * bright);
        assert_near(sqrt((double)rx_fit_image_variance(&image, 100, 100)), (double)image.floor, 1e-6);
        rx_fit_image_clear(&image);
        for (int i = 0; i < 3; i++)
            f.mask[20 * 128 + 20 + i] = RX_MASK_BAD;
        par.crowding = RX_CROWDING_YES;
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        assert_near(t->list[0].flux, 20000, rounded ? 60 : 40);
        assert_near(t->list[1].flux, 9000, rounded ? 60 : 40);
        assert_near(t->least, floor, 1e-3);
        rx_tphot_free(t);
        field_close(&f);
    }
}

enum { STARS = 16000, SKY = 1024 };

static int ascending(const void *one, const void *other)
{
    const double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

/* Median, and the median distance from it in units of a Gaussian's sigma. */
static void middle_of(double *v, int n, double *median, double *width)
{
    qsort(v, (size_t)n, sizeof *v, ascending);
    *median = v[n / 2];
    for (int i = 0; i < n; i++)
        v[i] = fabs(v[i] - *median);
    qsort(v, (size_t)n, sizeof *v, ascending);
    *width = 1.4826 * v[n / 2];
}

/* So many stars of S/N 5 and more, of which those nearer than 0.8 FWHM to a brighter one are lost in it. Of those of S/N 20 to 100 that
 * remain: median of flux / true - 1 and width of the pulls, [0] as they are and [1] with what is unseen allowed for. */
static void measure_unseen(int stars, double median[2], double pull[2])
{
    const double fwhm = 4, error = 100;
    static double x[STARS], y[STARS], flux[STARS], lifted[STARS], pulls[2][STARS], off[2][STARS];
    static rx_tphot_source list[STARS];
    static int of[STARS];
    uint8_t cells[16 * 16];
    const rx_crowding crowd = {.width = SKY, .height = SKY, .nx = 16, .ny = 16, .cells = cells, .n = 256};
    double none, excess;
    int n = 0, m = 0;
    memset(cells, 1, sizeof cells);
    for (int i = 0; i < stars; i++) {
        x[i] = SKY * rx_random_uniform(5, 1, (uint64_t)i);
        y[i] = SKY * rx_random_uniform(5, 2, (uint64_t)i);
        flux[i] = lifted[i] = 5 * error * pow(1 - 0.997 * rx_random_uniform(5, 3, (uint64_t)i), -1 / 0.9);
    }
    for (int i = 0; i < stars; i++) {
        int lost = 0;
        lifted[i] += error * rx_random_normal(5, 4, (uint64_t)i);
        for (int j = 0; j < stars; j++) {
            const double r = hypot(x[i] - x[j], y[i] - y[j]) / fwhm;
            lost = lost || (r < 0.8 && flux[j] > flux[i]);
            lifted[i] += r < 0.8 && flux[j] < flux[i] ? flux[j] * exp(-2 * log(2) * r * r) : 0;
        }
        of[n] = i;
        list[n] = (rx_tphot_source){.kind = RX_TPHOT_POINT,
                                    .x = x[i],
                                    .y = y[i],
                                    .flux = lifted[i],
                                    .fluxerr = error,
                                    .snr = lifted[i] / error,
                                    .crowded = 1};
        n += !lost;
    }
    assert_int_equal(rx_unseen_allow(&crowd, fwhm, list, n, &excess, NULL), RX_OK);
    assert_between(excess, 0.1, 3);
    for (int k = 0; k < n; k++) {
        const double true_flux = flux[of[k]], before = lifted[of[k]];
        assert_near(list[k].flux + list[k].unseen, before, 1e-6 * before);
        if (true_flux < 20 * error || true_flux > 100 * error)
            continue;
        off[0][m] = before / true_flux - 1;
        off[1][m] = list[k].flux / true_flux - 1;
        pulls[0][m] = (before - true_flux) / error;
        pulls[1][m++] = (list[k].flux - true_flux) / list[k].fluxerr;
    }
    for (int j = 0; j < 2; j++) {
        middle_of(off[j], m, &median[j], &none);
        middle_of(pulls[j], m, &none, &pull[j]);
    }
}

/* Errors hold at any density; stars far apart keep theirs. */
static void test_unseen(void **state)
{
    (void)state;
    static rx_tphot_source list[100];
    uint8_t cells[16 * 16];
    const rx_crowding crowd = {.width = SKY, .height = SKY, .nx = 16, .ny = 16, .cells = cells, .n = 256};
    const double error = 100;
    double median[2], pull[2], excess;
    memset(cells, 1, sizeof cells);
    for (int stars = 4000; stars <= STARS; stars *= 2) {
        measure_unseen(stars, median, pull);
        assert_true(pull[0] > 1.1);
        assert_near(pull[1], 1, 0.12);
        assert_near(median[1], 0, 0.009);
    }
    assert_true(median[0] > 0.015);
    for (int k = 0; k < 100; k++)
        list[k] = (rx_tphot_source){.x = 50 + k % 10 * 90,
                                    .y = 50 + k / 10 * 90,
                                    .flux = 1000,
                                    .fluxerr = error,
                                    .snr = 10,
                                    .crowded = 1};
    assert_int_equal(rx_unseen_allow(&crowd, 4, list, 100, &excess, NULL), RX_OK);
    assert_near(excess, 0, 0);
    assert_near(list[50].flux, 1000, 0);
    assert_near(list[50].fluxerr, error, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_passes), cmocka_unit_test(test_artefacts_are_no_crowd),
        cmocka_unit_test(test_least_noise), cmocka_unit_test(test_unseen), cmocka_unit_test(test_clear_pair)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
