/* Units of work: any number of threads, shards and interruptions give the same values. */
#include "../scratch.h"

#include <math.h>

#include "base/random.h"
#include "lab/units.h"

enum { GROUPS = 7, PER_GROUP = 5, UNITS = GROUPS * PER_GROUP };

/* A campaign of random numbers: the first unit of a group gives a factor that the others use. */
typedef struct toy {
    long fails; /* this unit fails; -1 = none */
} toy;

static rx_status toy_unit(const void *state, long unit, const rx_unit_values *done, rx_unit_values *dst,
                          rx_error *err)
{
    const toy *t = state;
    if (unit == t->fails)
        return rx_error_set(err, RX_INPUT, "unit %ld cannot be done", unit);
    const long first = unit - unit % PER_GROUP;
    const double factor = unit == first ? 1.0 : done[first].v[0]; /* ends the test when it is not there */
    dst->n = 1 + unit % 3;
    dst->v = calloc((size_t)dst->n, sizeof *dst->v);
    for (long i = 0; i < dst->n; i++)
        dst->v[i] = factor * rx_random_uniform(1, (uint64_t)unit, (uint64_t)i);
    return RX_OK;
}

static void make_places(rx_unit_place places[UNITS])
{
    for (long u = 0; u < UNITS; u++)
        places[u] = (rx_unit_place){(int)(u / PER_GROUP), u % PER_GROUP != 0};
}

/* One run of shard k of n; the values are what its journal then holds. */
static rx_status run(const char *path, int k, int n, int nthreads, long fails, rx_unit_values **values,
                     rx_error *err)
{
    const toy state = {fails};
    rx_unit_place places[UNITS];
    rx_journal_facts facts = {0};
    rx_journal *journal = NULL;
    make_places(places);
    rx_journal_fact(&facts, "TOY", "1");
    *values = calloc(UNITS, sizeof **values);
    assert_int_equal(rx_journal_open(path, &facts, UNITS, *values, &journal, NULL), RX_OK);
    rx_status status = rx_units_run(&(rx_unit_work){"Toy campaign", UNITS, places, k, n, &state, toy_unit},
                                    nthreads, journal, *values, NULL, err);
    rx_journal_close(journal);
    /* what was said to be done is what the journal says */
    rx_unit_values *read = calloc(UNITS, sizeof *read);
    int found;
    assert_int_equal(rx_journal_read(path, &facts, UNITS, read, &found, NULL), RX_OK);
    for (long u = 0; u < UNITS; u++) {
        assert_int_equal(read[u].v != NULL, (*values)[u].v != NULL);
        for (long i = 0; read[u].v != NULL && i < read[u].n; i++)
            assert_true(read[u].v[i] == (*values)[u].v[i]);
    }
    rx_unit_values_free(UNITS, read);
    rx_journal_facts_free(&facts);
    return status;
}

static double expected(long unit, long i)
{
    const long first = unit - unit % PER_GROUP;
    const double factor = unit == first ? 1.0 : rx_random_uniform(1, (uint64_t)first, 0);
    return factor * rx_random_uniform(1, (uint64_t)unit, (uint64_t)i);
}

static void check_all(const rx_unit_values *values)
{
    for (long u = 0; u < UNITS; u++) {
        assert_int_equal(values[u].n, 1 + u % 3);
        for (long i = 0; i < values[u].n; i++)
            assert_true(values[u].v[i] == expected(u, i));
    }
}

static void threads_do_not_matter(void **state)
{
    for (int nthreads = 1; nthreads <= 3; nthreads++) {
        char name[32];
        rx_unit_values *values;
        snprintf(name, sizeof name, "threads%d", nthreads);
        const char *path = in(state, name);
        assert_int_equal(run(path, 1, 1, nthreads, -1, &values, NULL), RX_OK);
        check_all(values);
        rx_unit_values_free(UNITS, values);
    }
}

/* A unit that fails ends the run with its error; what was done is kept, and the next run does the rest. */
static void failures_keep_what_is_done(void **state)
{
    rx_unit_values *values;
    rx_unit_place places[UNITS];
    rx_error err = RX_ERROR_NONE;
    long missing = 0, all = 0;
    make_places(places);
    const char *path = in(state, "fails");
    assert_int_equal(run(path, 1, 1, 1, 3 * PER_GROUP, &values, &err), RX_INPUT);
    assert_string_equal(err.text, "unit 15 cannot be done");
    rx_units_count(&(rx_unit_work){.n = UNITS, .place = places, .k = 1, .n_shards = 1}, values, &missing,
                   &all);
    assert_int_equal(all, UNITS);
    assert_int_equal(missing, UNITS - 3); /* the three units before it, of the first phase */
    rx_unit_values_free(UNITS, values);
    assert_int_equal(run(path, 1, 1, 2, UNITS - 1, &values, &err), RX_INPUT);
    rx_unit_values_free(UNITS, values);
    assert_int_equal(run(path, 1, 1, 2, -1, &values, &err), RX_OK);
    check_all(values);
    rx_unit_values_free(UNITS, values);
    /* all is done: a unit that would fail is not asked for */
    assert_int_equal(run(path, 1, 1, 2, 0, &values, &err), RX_OK);
    rx_unit_values_free(UNITS, values);
}

/* Each group belongs to one shard; together they are the whole. */
static void shards_share_the_groups(void **state)
{
    rx_unit_place places[UNITS];
    make_places(places);
    for (int n = 1; n <= GROUPS + 1; n++) {
        int owner[GROUPS];
        long sum = 0;
        memset(owner, 0, sizeof owner);
        for (int k = 1; k <= n; k++) {
            rx_unit_values none[UNITS] = {{0}};
            long missing, all;
            const rx_unit_work work = {.n = UNITS, .place = places, .k = k, .n_shards = n};
            rx_units_count(&work, none, &missing, &all);
            assert_int_equal(missing, all);
            assert_true(all % PER_GROUP == 0);
            assert_true(all / PER_GROUP == GROUPS / n || all / PER_GROUP == GROUPS / n + 1); /* even shares */
            sum += all;
            for (long u = 0; u < UNITS; u++) {
                if (!rx_unit_is_mine(&work, u))
                    continue;
                assert_true(owner[places[u].group] == 0 || owner[places[u].group] == k);
                owner[places[u].group] = k;
            }
        }
        assert_int_equal(sum, UNITS);
    }
    rx_unit_values *values, *whole = calloc(UNITS, sizeof *whole);
    for (int k = 1; k <= 3; k++) {
        char name[32];
        snprintf(name, sizeof name, "shard.%d", k);
        const char *path = in(state, name);
        assert_int_equal(run(path, k, 3, 2, -1, &values, NULL), RX_OK);
        for (long u = 0; u < UNITS; u++) {
            if (values[u].v == NULL)
                continue;
            assert_null(whole[u].v);
            whole[u] = values[u];
            values[u].v = NULL;
        }
        rx_unit_values_free(UNITS, values);
    }
    check_all(whole);
    rx_unit_values_free(UNITS, whole);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(failures_keep_what_is_done),
        cmocka_unit_test(shards_share_the_groups),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
