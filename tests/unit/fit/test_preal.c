/* P_REAL on mixtures whose densities are known. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>

#include "../near.h"
#include "fit/preal.h"

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
    const rx_preal empty = bright_tile(0); /* one peak of 4 sigma in a million pixels of nothing is noise */
    assert_true(rx_preal_of(&empty, 16) < 0.05);
    assert_true(rx_preal_of(&empty, 36) > 0.9);
}

/* Of a crowd: peaks of half of the noise, and counts that go on as 1 / s^2, or as s, and how far P is off between 3.4 and 5 sigma. */
static void a_crowd_says_how_its_counts_go_on(void **state)
{
    (void)state;
    enum { ROOM = 40000 };
    static double evidence[ROOM];
    for (int rising = 0; rising < 2; rising++) {
        const double power = rising ? 1 : -2, area = 10 * AREA, real = 1e-4, step = 1e-4;
        int n = 0;
        double sum = 0.5, worst = 0, by_law = 0;
        for (double s = 3.2; s < 12; s += step)
            for (sum += (real * pow(s / 5, power) + 0.8 * noise_peaks(s)) * area * step; sum >= 1; sum--)
                evidence[n++] = s * s;
        assert_between(n, 100, ROOM);
        const rx_preal preal = rx_preal_crowd(evidence, n, area, FWHM),
                       law = rx_preal_default(evidence, n, area, FWHM);
        for (double s = 3.4; s < 5; s += 0.1) {
            const double there = real * pow(s / 5, power), truth = there / (there + 0.8 * noise_peaks(s));
            worst = fmax(worst, fabs(rx_preal_of(&preal, s * s) - truth));
            by_law = fmax(by_law, fabs(rx_preal_of(&law, s * s) - truth));
        }
        print_message("power %g: %g, off by %.3f, default %.3f\n", power, preal.power, worst, by_law);
        assert_near(preal.power, power, 0.25);
        assert_true(worst < 0.03);
        assert_true(!rising || by_law > 0.3);
        for (double e = 6.25, last = 0; e < 100; e += 0.25) { /* never falls */
            assert_true(rx_preal_of(&preal, e) >= last);
            last = rx_preal_of(&preal, e);
        }
    }
    /* no source is fainter than 4.5 sigma, and errors blur that */
    int n = 0;
    double sum = 0.5, worst = 0;
    for (double s = 3.2; s < 12; s += 1e-4)
        for (sum +=
             (1e-4 * pow(s / 5, -2) * 0.5 * erfc((4.5 - s) * M_SQRT1_2) + 0.8 * noise_peaks(s)) * AREA * 1e-3;
             sum >= 1; sum--)
            evidence[n++] = s * s;
    const rx_preal cut = rx_preal_crowd(evidence, n, 10 * AREA, FWHM);
    for (double s = 3.4; s < 5; s += 0.1) {
        const double there = 1e-4 * pow(s / 5, -2) * 0.5 * erfc((4.5 - s) * M_SQRT1_2);
        worst = fmax(worst, fabs(rx_preal_of(&cut, s * s) - there / (there + 0.8 * noise_peaks(s))));
    }
    print_message("an end at 4.5: %g, off by %.3f\n", cut.end, worst);
    assert_near(cut.end, 4.5, 0.5);
    assert_true(worst < 0.05);
    /* bright stars alone, none near the limit: they are there, and a peak of the least S/N of what is added is most probably none */
    double bright[16];
    for (int i = 0; i < 16; i++)
        bright[i] = 1e5 * (i + 1);
    const rx_preal few = rx_preal_crowd(bright, 16, 96 * 96, FWHM);
    assert_true(rx_preal_of(&few, 1e5) > 0.999);
    assert_true(rx_preal_of(&few, 49) > 0.999);
    assert_true(rx_preal_of(&few, 3.2 * 3.2) < 0.5);
    const rx_preal empty = rx_preal_crowd(NULL, 0, AREA, FWHM);
    assert_between(rx_preal_of(&empty, 25), 0, 1);
    const rx_preal nowhere = rx_preal_crowd(NULL, 0, 0, FWHM);
    assert_between(rx_preal_of(&nowhere, 25), 0, 1);
}

/* Of n with that chance each. */
static double binomial(int n, int k, double chance)
{
    return k > n ? 0
                 : exp(lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1) + k * log(chance) +
                       (n - k) * log1p(-chance));
}

/* That at most `most` of a sure and b doubtful sources are none. */
static double at_most(int a, double p, int b, double q, int most)
{
    double sum = 0;
    for (int i = 0; i <= most; i++)
        for (int j = 0; i + j <= most; j++)
            sum += binomial(a, i, p) * binomial(b, j, q);
    return sum;
}

/* A list ends where the binomial distributions of its two kinds say so, whatever the order and what is not known. */
static void a_list_is_as_deep_as_its_precision(void **state)
{
    (void)state;
    enum { SURE = 300, DOUBTFUL = 200, N = SURE + DOUBTFUL + 20 };
    static const double precision[] = {0.9, 0.95, 0.98, 0.995}, more = 1.638; /* exp(1.645 * 0.3) */
    double preal[N], least;
    const double sure = 0.003 * more / (0.997 + 0.003 * more), doubtful = 0.3 * more / (0.7 + 0.3 * more);
    for (int i = 0; i < N; i++)
        preal[(i * 211) % N] = i < SURE              ? 0.997
                               : i < SURE + DOUBTFUL ? 0.7 - 1e-9 * i
                               : i % 2 == 0          ? NAN
                                                     : 0.49;
    int last = DOUBTFUL;
    for (int k = 0; k < 4; k++) {
        const int before = last;
        last = 0;
        for (int b = 1; b <= DOUBTFUL; b++)
            if (at_most(SURE, sure, b, doubtful, (int)((1 - precision[k]) * (SURE + b) + 1e-9)) >= 0.95)
                last = b;
        assert_int_equal(rx_preal_least(preal, N, precision[k], &least, NULL), RX_OK);
        assert_near(least, last > 0 ? 0.7 - 1e-9 * (SURE + last - 1) : 0.997, 1e-12);
        assert_true(k < 3 ? last > 0 && last < before : last == 0);
    }
    assert_int_equal(rx_preal_least(preal, N, 0.999, &least, NULL), RX_OK);
    assert_near(least, 0.997, 0); /* the first few, of which none may be false */
    preal[0] = 0.6;
    assert_int_equal(rx_preal_least(preal, 1, 0.95, &least, NULL), RX_OK);
    assert_true(least > 1); /* nothing is sure enough */
    assert_int_equal(rx_preal_least(preal, 0, 0.95, &least, NULL), RX_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_curve_is_the_ratio_of_two_densities),
        cmocka_unit_test(a_crowd_says_how_its_counts_go_on),
        cmocka_unit_test(a_list_is_as_deep_as_its_precision),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
