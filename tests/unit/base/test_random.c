/* Philox4x32-10 against the known answers of Random123 (kat_vectors), and the deviates made from it
 * against what their distributions demand. */
#include "../near.h"

#include "base/random.h"

static void check_block(uint64_t seed, uint64_t stream, uint64_t counter, const uint32_t want[4])
{
    uint32_t got[4];
    rx_random_block(seed, stream, counter, got);
    for (int i = 0; i < 4; i++)
        assert_int_equal(got[i], want[i]);
}

static void philox_gives_the_known_answers(void **state)
{
    check_block(0, 0, 0, (const uint32_t[]){0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8});
    check_block(UINT64_MAX, UINT64_MAX, UINT64_MAX,
                (const uint32_t[]){0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd});
    /* digits of pi; words of counter, stream and key in the order of Random123 */
    check_block(0x299f31d0a4093822, 0x0370734413198a2e, 0x85a308d3243f6a88,
                (const uint32_t[]){0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1});
}

/* The first four moments, each within 5 of its own standard errors. */
static void uniform_has_its_moments(void **state)
{
    enum { N = 200000 };
    double s1 = 0, s2 = 0, s4 = 0;
    for (uint64_t i = 0; i < N; i++) {
        double u = rx_random_uniform(7, 1, i);
        assert_true(u > 0.0);
        assert_true(u < 1.0);
        u -= 0.5;
        s1 += u;
        s2 += u * u;
        s4 += u * u * u * u;
    }
    assert_true(fabs(s1 / N) < 5 * sqrt(1.0 / 12 / N));
    assert_true(fabs(s2 / N - 1.0 / 12) < 5 * sqrt(1.0 / 180 / N));
    assert_true(fabs(s4 / N - 1.0 / 80) < 5 * sqrt((1.0 / 2304 - 1.0 / 6400) / N));
}

/* One block has both; neither says anything about the other. */
static void two_at_once_are_independent(void **state)
{
    enum { N = 100000 };
    double sum = 0.0, product = 0.0;
    for (uint64_t i = 0; i < N; i++) {
        double both[2];
        rx_random_two(7, 1, i, both);
        assert_true(both[0] == rx_random_uniform(7, 1, i));
        assert_true(both[1] > 0.0);
        assert_true(both[1] < 1.0);
        sum += both[1] - 0.5;
        product += (both[0] - 0.5) * (both[1] - 0.5);
    }
    assert_true(fabs(sum) < 4.0 * sqrt(N / 12.0));
    assert_true(fabs(product) < 4.0 * sqrt(N / 144.0));
}

static void normal_has_its_moments_and_tails(void **state)
{
    enum { N = 200000 };
    double s1 = 0, s2 = 0, s3 = 0, s4 = 0, beyond = 0;
    for (uint64_t i = 0; i < N; i++) {
        double z = rx_random_normal(7, 2, i);
        s1 += z;
        s2 += z * z;
        s3 += z * z * z;
        s4 += z * z * z * z;
        beyond += fabs(z) > 3.0;
    }
    assert_true(fabs(s1 / N) < 5 * sqrt(1.0 / N));
    assert_true(fabs(s2 / N - 1) < 5 * sqrt(2.0 / N));
    assert_true(fabs(s3 / N) < 5 * sqrt(15.0 / N));
    assert_true(fabs(s4 / N - 3) < 5 * sqrt(96.0 / N));
    double p = erfc(3.0 / sqrt(2.0));
    assert_true(fabs(beyond / N - p) < 5 * sqrt(p * (1 - p) / N));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(philox_gives_the_known_answers),
        cmocka_unit_test(uniform_has_its_moments),
        cmocka_unit_test(two_at_once_are_independent),
        cmocka_unit_test(normal_has_its_moments_and_tails),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
