/* P_REAL on mixtures whose densities are known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "../near.h"
#include "pipeline/preal.h"

enum { BRIGHT = 400 };
static const double AREA = 1e6, FWHM = 4.0;

static rx_preal bright_tile(int n)
{
    double evidence[BRIGHT + 2];
    for (int i = 0; i < n; i++)
        evidence[i] = 36.1 + i;
    evidence[n] = 35.9;
    evidence[n + 1] = NAN;
    return rx_preal_default(evidence, n + 2, AREA, FWHM);
}

/* Peaks of noise a pixel and sigma, at s. */
static double noise_peaks(double s)
{
    const double w = FWHM / 2.3548;
    return (s * s - 1) * exp(-0.5 * s * s) / (pow(2 * acos(-1.0), 1.5) * 2 * w * w);
}

static void the_curve_is_the_ratio_of_two_densities(void **state)
{
    (void)state;
    const rx_preal preal = bright_tile(BRIGHT);
    assert_int_equal(preal.tile, 0);
    for (double s = 2.6; s < 7; s += 0.2) {
        const double real = 401 / AREA * 6 / (s * s);
        assert_near(rx_preal_of(&preal, s * s), real / (real + noise_peaks(s)), 1e-12);
    }
    assert_near(rx_preal_of(&preal, 1e6), 1, 1e-12);
    assert_near(rx_preal_of(&preal, INFINITY), 1, 1e-12);
    assert_near(rx_preal_of(&preal, 0), 0, 0); /* no light, no source */
    const double odds = rx_preal_of(&preal, 6.25) / (1 - rx_preal_of(&preal, 6.25)), less = odds * exp(-2.0);
    assert_near(rx_preal_of(&preal, 2.25), less / (1 + less), 1e-12);
    assert_true(isnan(rx_preal_of(&preal, NAN)));
    const double limit = rx_preal_limit(&preal);
    assert_near(rx_preal_of(&preal, limit * limit), 0.5, 1e-6);
    assert_int_equal(rx_preal_doubtful(&preal, limit * limit - 0.01), 1);
    assert_int_equal(rx_preal_doubtful(&preal, limit * limit + 0.01), 0);
    const rx_preal empty = bright_tile(0); /* one peak of 4 sigma in a million pixels of nothing is noise */
    assert_true(rx_preal_of(&empty, 16) < 0.05);
    assert_true(rx_preal_of(&empty, 36) > 0.9);
}

/* Of counts N(>s) = 300 * 6 / s without an end, or with one at 6 sigma, and of as many peaks of noise as the tile has. */
static void counts_that_end_do_not_go_on(void **state)
{
    (void)state;
    enum { ROOM = 1000 };
    double evidence[ROOM];
    rx_preal preal[2];
    for (int end = 0; end < 2; end++) {
        int n = 0;
        for (int k = 1; k <= 400; k++) {
            const double s = 6.0 * 300 / k;
            if (!end || s > 6)
                evidence[n++] = s * s;
        }
        double peaks = 0.5;
        for (double s = 4.0; s < 7; s += 0.001)
            for (peaks += noise_peaks(s) * AREA * 0.001; peaks >= 1; peaks--)
                evidence[n++] = s * s;
        preal[end] = rx_preal_default(evidence, n, AREA, FWHM);
        const double law = preal[end].bright;
        rx_preal_complete(&preal[end], evidence, n, AREA);
        print_message("bright per Mpixel %.1f, of it %.1f\n", law * 1e6, preal[end].bright * 1e6);
        assert_between(law * 1e6, 299, 302);
    }
    assert_near(preal[0].bright * 1e6, 300, 10);
    assert_between(preal[1].bright * 1e6, 80, 220); /* those from 6 to 7 sigma are there */
    assert_true(rx_preal_limit(&preal[1]) > rx_preal_limit(&preal[0]));
}

/* n(s) = density(s) * detected(s) sources between 2.8 and 12 sigma, evenly by their own distribution. */
static int draw(double (*density)(double), double pixels, double *evidence)
{
    const double step = 1e-3;
    double sum = 0.5;
    int n = 0;
    for (double s = 2.8; s < 12; s += step) {
        const double detected = 1 / (1 + exp(-(s - 3.7) / 0.3)); /* faint ones are mostly missed */
        for (sum += density(s) * detected * pixels * step; sum >= 1; sum--)
            evidence[n++] = s * s;
    }
    return n;
}

/* Sources end at 5 sigma and scatter below; the noise has three times the peaks, and steeper. */
static double real_sources(double s)
{
    return 4e-4 / (1 + exp(-(s - 4.6) / 0.25)) / (s * s);
}

static double own_noise(double s)
{
    return 3 * noise_peaks(s) * exp(-0.2 * (s * s - 16) / 2);
}

static double both(double s)
{
    return real_sources(s) + own_noise(s);
}

static void noise_of_the_tile_sets_it_right(void **state)
{
    (void)state;
    double *tile = malloc(4000 * sizeof *tile), *noise = malloc(4000 * sizeof *noise);
    assert_true(tile != NULL);
    assert_true(noise != NULL);
    const double pixels = 3e6;
    rx_preal_sample all = {.evidence = tile, .pixels = 4e6}, peaks = {.evidence = noise, .pixels = pixels};
    all.n = draw(both, all.pixels, tile);
    peaks.n = draw(own_noise, pixels, noise);
    assert_true(all.n < 4000);
    assert_true(peaks.n < 4000);
    assert_true(peaks.n > 50);
    rx_preal preal = rx_preal_default(tile, all.n, all.pixels, FWHM);
    double before = 0, after = 0;
    const rx_preal first = preal;
    rx_preal_fit(&preal, &all, &peaks);
    assert_int_equal(preal.tile, 1);
    for (double s = 3.5; s < 6; s += 0.25) {
        const double truth = real_sources(s) / both(s);
        before = fmax(before, fabs(rx_preal_of(&first, s * s) - truth));
        after = fmax(after, fabs(rx_preal_of(&preal, s * s) - truth));
        assert_near(rx_preal_of(&preal, s * s), truth, 0.09);
    }
    if (before <= 2 * after)
        fail_msg("off by %g before and %g after", before, after);
    for (double e = 6.25, last = 0; e < 100; e += 0.25) { /* never falls */
        assert_true(rx_preal_of(&preal, e) >= last);
        last = rx_preal_of(&preal, e);
    }
    free(tile);
    free(noise);
}

/* Nothing on noise, where a third of the tile's faint sources should have been. */
static void little_noise_says_little(void **state)
{
    (void)state;
    double faint[60];
    for (int i = 0; i < 60; i++)
        faint[i] = 14.0 + 0.05 * i;
    const rx_preal first = bright_tile(60);
    rx_preal preal = first;
    const rx_preal_sample tile = {faint, 60, AREA}, nothing = {NULL, 0, AREA}, none = {NULL, 0, 0};
    rx_preal_fit(&preal, &tile, &none);
    assert_int_equal(preal.tile, 0);
    rx_preal_fit(&preal, &tile, &nothing);
    assert_int_equal(preal.tile, 1);
    assert_true(rx_preal_of(&preal, 14) > rx_preal_of(&first, 14) + 0.2);
    rx_preal_fit(&preal, &tile, &(rx_preal_sample){NULL, 0, 1e-3 * AREA}); /* what was not looked at long */
    assert_near(preal.shift, 0, 0.05);
    assert_near(preal.slope, 0, 0.05);
}

static void pieces_owe_their_light(void **state)
{
    (void)state;
    assert_int_equal(rx_preal_owes(12, 5), 1);
    assert_int_equal(rx_preal_owes(13, 5), 0);
    assert_int_equal(rx_preal_owes(0, -5), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_curve_is_the_ratio_of_two_densities),
        cmocka_unit_test(counts_that_end_do_not_go_on),
        cmocka_unit_test(noise_of_the_tile_sets_it_right),
        cmocka_unit_test(little_noise_says_little),
        cmocka_unit_test(pieces_owe_their_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
