/* Counts that add up: against the median and sigma_MAD of the same numbers. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "num/stats.h"
#include "quality/tally.h"

enum { N = 4001 };

/* n pairs of magnitude `mag`, errors `bias` + `sigma` times normal ones, those found first. */
typedef struct made {
    rx_qa_input input;
    rx_qa_run run;
    rx_evaluation e;
    double mag[N], measured[N], dmag[N];
    long origin[N];
    unsigned char truth_role[N], run_role[N];
} made;

static made *make(double mag, double bias, double sigma, uint64_t stream)
{
    made *m = calloc(1, sizeof *m);
    assert_non_null(m);
    for (int i = 0; i < N; i++) {
        m->mag[i] = mag;
        m->dmag[i] = bias + sigma * rx_random_normal(7, stream, (uint64_t)i);
        m->measured[i] = mag + m->dmag[i];
        m->origin[i] = i;
        m->truth_role[i] = m->run_role[i] = i % 4 == 0 ? RX_ROLE_UNMATCHED : RX_ROLE_MATCHED;
    }
    m->truth_role[1] = m->run_role[1] = RX_ROLE_IGNORED;
    m->input.truth.n = m->run.list.n = N;
    m->e = (rx_evaluation){.input = &m->input,
                           .run = &m->run,
                           .origin = m->origin,
                           .truth_role = m->truth_role,
                           .run_role = m->run_role,
                           .truth_mag = m->mag,
                           .run_mag = m->measured,
                           .dmag = m->dmag};
    return m;
}

static void medians_are_those_of_all(void **state)
{
    static const struct {
        double bias, sigma, off; /* off: steps of the histogram are wider farther out */
    } cases[] = {{0.013, 0.1, 0.0015}, {-0.2, 0.004, 0.0015}, {2.2, 0.02, 0.05}, {-24.97, 0.03, 0.5}};
    for (int c = 0; c < 4; c++) {
        made *m = make(20.2, cases[c].bias, cases[c].sigma, (uint64_t)c);
        rx_tally tally = {0};
        assert_int_equal(rx_tally_evaluation(&tally, &m->e, NULL), RX_OK);
        double values[N];
        long n = 0, pairs;
        for (int i = 0; i < N; i++)
            if (m->run_role[i] == RX_ROLE_MATCHED)
                values[n++] = m->dmag[i];
        double median, found, sigma;
        const double scatter = rx_sigma_mad(values, (size_t)n, &median);
        const rx_tally_bin *bin = &tally.bin[40 - RX_TALLY_LOW];
        rx_tally_errors(bin, &pairs, &found, &sigma);
        assert_int_equal(pairs, n);
        assert_near(found, median, cases[c].off);
        assert_near(sigma, scatter, cases[c].off);
        assert_int_equal(bin->references, N - 1);
        assert_int_equal(bin->found, n);
        rx_tally_free(&tally);
        free(m);
    }
}

static void sums_do_not_depend_on_order(void **state)
{
    rx_tally part[3] = {0}, forth = {0}, back = {0};
    long references = 0;
    for (int i = 0; i < 3; i++) {
        made *m = make(18.0 + i, 0.01 * i, 0.1, (uint64_t)(10 + i));
        assert_int_equal(rx_tally_evaluation(&part[i], &m->e, NULL), RX_OK);
        free(m);
    }
    for (int i = 0; i < 3; i++) {
        assert_int_equal(rx_tally_add(&forth, &part[i], NULL), RX_OK);
        assert_int_equal(rx_tally_add(&back, &part[2 - i], NULL), RX_OK);
    }
    for (int b = 0; b < RX_TALLY_BINS; b++) {
        const rx_tally_bin *x = &forth.bin[b], *y = &back.bin[b];
        assert_memory_equal(x, y, offsetof(rx_tally_bin, dmag));
        if (x->dmag != NULL)
            assert_memory_equal(x->dmag, y->dmag, RX_TALLY_STEPS * sizeof(uint32_t));
        references += x->references;
    }
    assert_int_equal(references, 3 * (N - 1));
    for (int i = 0; i < 3; i++)
        rx_tally_free(&part[i]);
    rx_tally_free(&forth);
    rx_tally_free(&back);
}

static void ends_of_the_grid_and_the_histogram(void **state)
{
    made *m = make(-99, 60, 0.01, 3);
    rx_tally tally = {0};
    long n;
    double median, sigma;
    m->mag[2] = 1e300;
    m->mag[3] = NAN;
    assert_int_equal(rx_tally_evaluation(&tally, &m->e, NULL), RX_OK);
    assert_int_equal(tally.bin[0].references, N - 3);
    assert_int_equal(tally.bin[RX_TALLY_BINS - 1].references, 1);
    rx_tally_errors(&tally.bin[0], &n, &median, &sigma);
    assert_true(n > 0);
    assert_true(isnan(median));
    assert_true(isnan(sigma));
    rx_tally_errors(&tally.bin[5], &n, &median, &sigma);
    assert_int_equal(n, 0);
    assert_true(isnan(median));
    assert_true(isnan(sigma));
    rx_tally_free(&tally);
    free(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(medians_are_those_of_all),
        cmocka_unit_test(sums_do_not_depend_on_order),
        cmocka_unit_test(ends_of_the_grid_and_the_histogram),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
