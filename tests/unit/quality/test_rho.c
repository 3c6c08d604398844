/* Correlations of PSF residuals against sums over all pairs. */
#include <math.h>
#include <stdlib.h>

#include "../near.h"
#include "quality/rho.h"

enum { STARS = 40 };

static double uniform(unsigned *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 8) / 16777216.0;
}

/* Stars of an image of 0.1 deg; each residual has a part that all share. */
static void make_stars(double alpha, double shared, unsigned seed, rx_rho_star *stars)
{
    for (int i = 0; i < STARS; i++)
        stars[i] = (rx_rho_star){.alpha = alpha + 0.1 * (uniform(&seed) - 0.5),
                                 .delta = 0.1 * (uniform(&seed) - 0.5),
                                 .t = rx_rho_units(shared + 0.02 * (uniform(&seed) - 0.5)),
                                 .e1 = rx_rho_units(0.01 * (uniform(&seed) - 0.5)),
                                 .e2 = rx_rho_units(-shared + 0.01 * (uniform(&seed) - 0.5))};
}

static double arcmin(const rx_rho_star *a, const rx_rho_star *b)
{
    const double deg = M_PI / 180.0;
    return 60.0 / deg *
           acos(sin(deg * a->delta) * sin(deg * b->delta) +
                cos(deg * a->delta) * cos(deg * b->delta) * cos(deg * (a->alpha - b->alpha)));
}

static void test_one_image(void **state)
{
    rx_rho_star stars[STARS];
    rx_rho rho = {.alpha = 150.0, .delta = 0.0};
    const rx_rho *images[1] = {&rho};
    rx_rho_bin bins[RX_RHO_BINS];
    rx_error err = {0};
    make_stars(150.0, 0.01, 3, stars);
    assert_int_equal(rx_rho_units(0.01234), 123);
    assert_int_equal(rx_rho_units(7.0), 5000);
    rx_rho_of(STARS, stars, &rho);
    assert_int_equal(rx_rho_all(1, images, bins, &err), RX_OK);
    for (int k = 0; k < RX_RHO_BINS; k++) {
        double n = 0.0, t = 0.0, e = 0.0;
        for (int i = 0; i < STARS; i++)
            for (int j = 0; j < i; j++) {
                const double apart = arcmin(&stars[i], &stars[j]);
                if (apart < 0.25 * pow(2.0, k) || apart >= 0.25 * pow(2.0, k + 1))
                    continue;
                n++;
                t += 1e-8 * stars[i].t * stars[j].t;
                e += 1e-8 * (stars[i].e1 * stars[j].e1 + stars[i].e2 * stars[j].e2);
            }
        assert_near(bins[k].pairs, n, 0);
        if (n > 0) {
            assert_near(bins[k].t, t / n, 1e-15);
            assert_near(bins[k].e, e / n, 1e-15);
        }
        assert_true(isnan(bins[k].t_error)); /* one image says nothing of its scatter */
    }
    assert_int_equal(rho.n, STARS);
    assert_between(rho.reach, 0.03, 0.0708);
}

/* Images 1 deg apart: all their pairs at the angle of their centres; overlapping ones: none. */
static void test_pairs_of_images(void **state)
{
    rx_rho_star a[STARS], b[STARS], c[STARS];
    rx_rho rho[3] = {{.alpha = 150.0}, {.alpha = 151.0}, {.alpha = 150.01}};
    const rx_rho *images[3] = {&rho[0], &rho[1], &rho[2]}, *turned[3] = {&rho[2], &rho[0], &rho[1]};
    rx_rho_bin bins[RX_RHO_BINS], again[RX_RHO_BINS];
    rx_error err = {0};
    make_stars(150.0, 0.02, 1, a);
    make_stars(151.0, 0.02, 2, b);
    make_stars(150.01, 0.0, 3, c);
    rx_rho_of(STARS, a, &rho[0]);
    rx_rho_of(STARS, b, &rho[1]);
    rx_rho_of(STARS, c, &rho[2]);
    assert_int_equal(rx_rho_all(2, images, bins, &err), RX_OK);
    double t = 0.0, e = 0.0;
    for (int i = 0; i < STARS; i++)
        for (int j = 0; j < STARS; j++) {
            t += 1e-8 * a[i].t * b[j].t;
            e += 1e-8 * (a[i].e1 * b[j].e1 + a[i].e2 * b[j].e2);
        }
    assert_near(bins[7].pairs, STARS * STARS, 0); /* 32 to 64 arcmin */
    assert_near(bins[7].t, t / STARS / STARS, 1e-13);
    assert_near(bins[7].e, e / STARS / STARS, 1e-13);
    assert_true(bins[7].t > 3e-4);
    assert_true(isfinite(bins[3].t_error)); /* two images */
    assert_int_equal(rx_rho_all(3, images, bins, &err), RX_OK);
    assert_int_equal(rx_rho_all(3, turned, again, &err), RX_OK);
    assert_near(bins[7].pairs, 2 * STARS * STARS, 0);
    double within = 0.0;
    for (int k = 0; k < 7; k++)
        within += bins[k].pairs;
    assert_true(within <= 3 * STARS * (STARS - 1) / 2);
    for (int k = 0; k < RX_RHO_BINS; k++)
        if (bins[k].pairs > 0) {
            assert_near(again[k].pairs, bins[k].pairs, 0);
            assert_near(again[k].t, bins[k].t, 0);
            assert_near(again[k].e, bins[k].e, 0);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_one_image),
                                       cmocka_unit_test(test_pairs_of_images)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
