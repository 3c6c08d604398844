/* Campaign settings for a test, and running the units of a kind without a report. */
#ifndef TESTS_UNIT_LAB_SETTINGS_H
#define TESTS_UNIT_LAB_SETTINGS_H

#include "../scratch.h"

#include "config/config_fields.h"
#include "lab/lab.h"
#include "lab/sources.h"
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

static inline rx_lab *open_lab(const rx_lab_kind *kind, const rx_campaign_config *config, int nthreads)
{
    rx_lab *lab = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_lab_open(kind, config, nthreads, NULL, &lab, &err) != RX_OK)
        fail_msg("%s", err.text);
    return lab;
}

/* All units of a campaign on nthreads threads, with a journal of that name. */
static inline rx_unit_values *run_units(void **scratch, const char *name, rx_lab *lab, int nthreads)
{
    rx_error err = RX_ERROR_NONE;
    rx_journal_facts facts = {0};
    rx_journal *journal = NULL;
    const char *path = in(scratch, name);
    assert_int_equal(rx_lab_facts(lab, &facts, &err), RX_OK);
    rx_unit_values *values = calloc((size_t)lab->nunits, sizeof *values);
    rx_unit_place *places = calloc((size_t)lab->nunits, sizeof *places);
    assert_non_null(values);
    assert_non_null(places);
    for (long u = 0; u < lab->nunits; u++)
        places[u] = rx_lab_place(lab, u);
    const rx_unit_work work = {lab->kind->title, lab->nunits, places, 1, 1, lab, rx_lab_do_unit};
    assert_int_equal(rx_journal_open(path, &facts, lab->nunits, values, &journal, &err), RX_OK);
    assert_int_equal(rx_sources_prepare(lab, NULL, &err), RX_OK);
    if (rx_units_run(&work, nthreads, journal, values, NULL, &err) != RX_OK)
        fail_msg("%s", err.text);
    rx_journal_close(journal);
    rx_journal_facts_free(&facts);
    free(places);
    return values;
}

/* The tables of one unit; rx_lab_tables_free(). */
static inline void tables_of(const rx_lab *lab, const rx_unit_values *values, long unit,
                             rx_lab_table table[RX_LAB_TABLES])
{
    for (int t = 0; t < lab->kind->ntables; t++)
        rx_lab_table_begin(&lab->kind->tables[t], lab->nruns, &table[t]);
    assert_int_equal(rx_lab_unpack(lab->kind->ntables, table, &values[unit], NULL), RX_OK);
}

static inline void assert_same_values(long n, const rx_unit_values *a, const rx_unit_values *b)
{
    for (long u = 0; u < n; u++) {
        assert_int_equal(a[u].n, b[u].n);
        assert_memory_equal(a[u].v, b[u].v, (size_t)a[u].n * sizeof(double));
    }
}

#endif
