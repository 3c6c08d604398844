/* Completeness magnitudes: hand-made bins, limits, and the truth of a simulated error function. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "base/random.h"
#include "near.h"
#include "validate/completeness.h"

static const rx_bins bins = {.n = 5, .edge = {18, 19, 20, 21, 22, 23}};

static void bin_of_a_magnitude(void **state)
{
    (void)state;
    assert_int_equal(rx_bins_index(&bins, 18), 0);
    assert_int_equal(rx_bins_index(&bins, 18.999), 0);
    assert_int_equal(rx_bins_index(&bins, 19), 1);
    assert_int_equal(rx_bins_index(&bins, 22.999), 4);
    assert_int_equal(rx_bins_index(&bins, 23), -1);
    assert_int_equal(rx_bins_index(&bins, 17.999), -1);
    assert_int_equal(rx_bins_index(&bins, NAN), -1);
}

static void interpolates(void **state)
{
    const double total[] = {10, 10, 10, 10, 10}, found[] = {10, 4, 8, 2, 0};
    int beyond;
    (void)state;
    /* from the faint end the bin at 20.5 (0.8) is the first above 0.5; the dip at 19.5 does not matter */
    assert_near(rx_completeness_mag(&bins, found, total, 0.5, &beyond), 20.5 + 0.3 / 0.6, 1e-12);
    assert_int_equal(beyond, 0);
    assert_near(rx_completeness_mag(&bins, found, total, 0.9, &beyond), 18.5 + 0.1 / 0.6, 1e-12);
}

static void limits(void **state)
{
    const double total[] = {10, 10, 10, 10, 4}, all[] = {10, 10, 10, 9, 0}, none[] = {1, 0, 0, 0, 4};
    const double few[] = {4, 4, 4, 4, 4};
    int beyond;
    (void)state;
    /* the last bin holds too few to count: the faintest that counts still has 0.9 */
    assert_near(rx_completeness_mag(&bins, all, total, 0.5, &beyond), 22, 0);
    assert_int_equal(beyond, 1);
    assert_near(rx_completeness_mag(&bins, none, total, 0.5, &beyond), 18, 0);
    assert_int_equal(beyond, -1);
    assert_true(isnan(rx_completeness_mag(&bins, few, few, 0.5, &beyond)));
    assert_int_equal(beyond, 0);
}

/* Found with a probability that falls through one half at 21.3. */
static void finds_the_truth(void **state)
{
    enum { N = 4000 };
    static double mag[N];
    static unsigned char found[N];
    rx_bins fine = {.n = 10};
    rx_estimate e, again;
    (void)state;
    for (int i = 0; i <= 10; i++)
        fine.edge[i] = 18 + 0.5 * i;
    for (int i = 0; i < N; i++) {
        mag[i] = 18 + 5 * rx_random_uniform(1, 0, (uint64_t)i);
        found[i] = rx_random_uniform(1, 1, (uint64_t)i) < 0.5 * erfc((mag[i] - 21.3) / 0.6);
    }
    assert_int_equal(rx_completeness(&fine, N, mag, found, 0.5, 0.95, 3, &e, NULL), RX_OK);
    assert_near(e.value, 21.3, 0.06);
    assert_true(e.low < 21.3 && 21.3 < e.high && e.high - e.low < 0.2);
    assert_int_equal(rx_completeness(&fine, N, mag, found, 0.5, 0.95, 3, &again, NULL), RX_OK);
    assert_memory_equal(&e, &again, sizeof e);
}

/* What is complete to the end of the reference has a lower limit, and no upper one. */
static void open_interval(void **state)
{
    double mag[100];
    unsigned char found[100];
    rx_estimate e;
    (void)state;
    for (int i = 0; i < 100; i++) {
        mag[i] = 18 + 0.05 * i;
        found[i] = 1;
    }
    assert_int_equal(rx_completeness(&bins, 100, mag, found, 0.9, 0.95, 3, &e, NULL), RX_OK);
    assert_near(e.value, 23, 0);
    assert_near(e.low, 23, 0);
    assert_true(isinf(e.high) && e.high > 0);
    for (int i = 0; i < 100; i++)
        found[i] = 0;
    assert_int_equal(rx_completeness(&bins, 100, mag, found, 0.9, 0.95, 3, &e, NULL), RX_OK);
    assert_near(e.value, 18, 0);
    assert_near(e.high, 18, 0);
    assert_true(isinf(e.low) && e.low < 0);
    assert_int_equal(rx_completeness(&bins, 3, mag, found, 0.9, 0.95, 3, &e, NULL), RX_OK);
    assert_true(isnan(e.value));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bin_of_a_magnitude), cmocka_unit_test(interpolates),  cmocka_unit_test(limits),
        cmocka_unit_test(finds_the_truth),    cmocka_unit_test(open_interval),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
