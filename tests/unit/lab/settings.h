/* Campaign settings for a test, and running the units of a kind without a report. */
#ifndef TESTS_UNIT_CAMPAIGN_SETTINGS_H
#define TESTS_UNIT_CAMPAIGN_SETTINGS_H

#include "../scratch.h"

#include "config/campaign_config.h"
#include "lab/kind.h"
#include "lab/units.h"

/* Names and values, ending with NULL. */
static inline rx_campaign_config *make_settings(const char *const *pairs)
{
    rx_campaign_config *config = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_campaign_config_new(&config, &err), RX_OK);
    for (; *pairs != NULL; pairs += 2)
        if (rx_settings_set(&config->settings, pairs[0], pairs[1], NULL, &err) != RX_OK)
            fail_msg("%s", err.text);
    return config;
}

/* All units of a campaign on nthreads threads, with a journal of that name. */
static inline rx_unit_values *run_units(void **scratch, const char *name, const rx_campaign_kind *kind,
                                        void *state, int nthreads, long *n)
{
    char path[1024];
    rx_error err = RX_ERROR_NONE;
    rx_journal_facts facts = {0};
    rx_journal *journal = NULL;
    rx_unit_place *places = NULL;
    path_in(scratch, name, path);
    assert_int_equal(rx_units_places(kind, state, n, &places, &err), RX_OK);
    assert_int_equal(kind->facts(state, &facts, &err), RX_OK);
    rx_unit_values *values = calloc((size_t)*n, sizeof *values);
    assert_non_null(values);
    assert_int_equal(rx_journal_open(path, &facts, *n, values, &journal, &err), RX_OK);
    if (kind->prepare != NULL)
        assert_int_equal(kind->prepare(state, NULL, &err), RX_OK);
    if (rx_units_run(kind, state, *n, places, 1, 1, nthreads, journal, values, NULL, &err) != RX_OK)
        fail_msg("%s", err.text);
    rx_journal_close(journal);
    rx_journal_facts_free(&facts);
    free(places);
    return values;
}

static inline void assert_same_values(long n, const rx_unit_values *a, const rx_unit_values *b)
{
    for (long u = 0; u < n; u++) {
        assert_int_equal(a[u].n, b[u].n);
        assert_memory_equal(a[u].v, b[u].v, (size_t)a[u].n * sizeof(double));
    }
}

#endif
