/* Matching against brute force over all pairs, and its corner cases. */
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "quality/match.h"

enum { N = 400 };

/* Nearest remaining pair of all, again and again. */
static void brute_force(const rx_match_list *a, const rx_match_list *b, double radius, long *a_to_b,
                        long *b_to_a)
{
    for (long i = 0; i < a->n; i++)
        a_to_b[i] = -1;
    for (long j = 0; j < b->n; j++)
        b_to_a[j] = -1;
    for (;;) {
        double best = INFINITY;
        long bi = -1, bj = -1;
        for (long i = 0; i < a->n; i++)
            for (long j = 0; j < b->n && a_to_b[i] < 0; j++) {
                double dx = b->x[j] - a->x[i], dy = b->y[j] - a->y[i], d2 = dx * dx + dy * dy;
                if (b_to_a[j] < 0 && d2 <= radius * radius && d2 < best) {
                    best = d2;
                    bi = i;
                    bj = j;
                }
            }
        if (bi < 0)
            return;
        a_to_b[bi] = bj;
        b_to_a[bj] = bi;
    }
}

/* Positions on a grid of `cell` (0: none), so that equal distances are common. */
static void scatter(uint64_t stream, long n, double size, double cell, double *x, double *y)
{
    for (long i = 0; i < n; i++) {
        x[i] = size * rx_random_uniform(11, stream, (uint64_t)(2 * i)) - 3;
        y[i] = size * rx_random_uniform(11, stream, (uint64_t)(2 * i + 1)) + 50;
        if (cell > 0) {
            x[i] = cell * floor(x[i] / cell);
            y[i] = cell * floor(y[i] / cell);
        }
    }
}

static void as_brute_force(void **state)
{
    static const double cases[][3] = {{200, 0, 3}, {200, 0, 12}, {40, 1, 2},
                                      {40, 1, 1},  {5, 0, 100},  {5000, 0, 0.01}};
    double ax[N], ay[N], bx[N], by[N];
    long got_a[N], got_b[N], want_a[N], want_b[N];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        long na = c == 4 ? 60 : N / 2, nb = c == 4 ? 50 : N - 77;
        scatter(2 * c, na, cases[c][0], cases[c][1], ax, ay);
        scatter(2 * c + 1, nb, cases[c][0], cases[c][1], bx, by);
        rx_match_list a = {na, ax, ay, NULL}, b = {nb, bx, by, NULL};
        assert_int_equal(rx_match(&a, &b, cases[c][2], got_a, got_b, NULL), RX_OK);
        brute_force(&a, &b, cases[c][2], want_a, want_b);
        assert_memory_equal(got_a, want_a, (size_t)na * sizeof *got_a);
        assert_memory_equal(got_b, want_b, (size_t)nb * sizeof *got_b);
    }
}

static void unusable_sources_never_match(void **state)
{
    double ax[] = {0, NAN, 5, 1e300}, ay[] = {0, 0, 5, 0}, bx[] = {0, 0, 5, INFINITY}, by[] = {0, 0, 5, 0};
    unsigned char use[] = {0, 1, 1, 1};
    long a_to_b[4], b_to_a[4];
    assert_int_equal(rx_match(&(rx_match_list){4, ax, ay, NULL}, &(rx_match_list){4, bx, by, use}, 1, a_to_b,
                              b_to_a, NULL),
                     RX_OK);
    assert_int_equal(a_to_b[0], 1); /* b[0] is nearer by index, but not to be used */
    assert_int_equal(a_to_b[1], -1);
    assert_int_equal(a_to_b[2], 2);
    assert_int_equal(a_to_b[3], -1);
    assert_int_equal(b_to_a[0], -1);
    assert_int_equal(b_to_a[3], -1);
}

static void radius_is_inclusive(void **state)
{
    double ax = 0, bx = 3, by = 4, zero = 0;
    long a_to_b, b_to_a;
    rx_match_list a = {1, &ax, &zero, NULL}, b = {1, &bx, &by, NULL};
    assert_int_equal(rx_match(&a, &b, 5, &a_to_b, &b_to_a, NULL), RX_OK);
    assert_int_equal(a_to_b, 0);
    assert_int_equal(rx_match(&a, &b, 4.999999, &a_to_b, &b_to_a, NULL), RX_OK);
    assert_int_equal(a_to_b, -1);
}

/* Empty lists match nothing; a radius that is none is refused, as are all pairs of two large lists. */
static void what_cannot_match(void **state)
{
    enum { MANY = 3000 };
    static const double bad[] = {0, -1, NAN, INFINITY};
    static double x[MANY], y[MANY];
    static long a[MANY], b[MANY];
    rx_error err = RX_ERROR_NONE;
    const rx_match_list none = {0, NULL, NULL, NULL}, one = {1, x, y, NULL}, many = {MANY, x, y, NULL};
    scatter(1, MANY, 10, 0, x, y);
    a[0] = b[0] = 7;
    assert_int_equal(rx_match(&none, &one, 1, NULL, b, NULL), RX_OK);
    assert_int_equal(rx_match(&one, &none, 1, a, NULL, NULL), RX_OK);
    assert_int_equal(a[0] + b[0], -2);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(rx_match(&one, &one, bad[i], a, b, &err), RX_USAGE);
        assert_non_null(strstr(err.text, "give a positive MATCH_RADIUS"));
    }
    assert_int_equal(rx_match(&many, &many, 20, a, b, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "smaller MATCH_RADIUS"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_brute_force),
        cmocka_unit_test(unusable_sources_never_match),
        cmocka_unit_test(radius_is_inclusive),
        cmocka_unit_test(what_cannot_match),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
