/* Tables with named columns: what goes into a journal comes out, and nothing of other columns. */
#include "../near.h"
#include "../scratch.h"

#include <math.h>

#include "lab/rows.h"

#define THING_COLUMNS(X)                                                                                     \
    X(THING_SNR, "snr", "", "of a thing")                                                                    \
    X(THING_APART, "apart", "FWHM", "from another one")
#define FOUND_COLUMNS(X) X(FOUND_SCORE, "score", "", "of what was found")
enum { THING_COLUMNS(RX_LAB_ID) THING_WIDTH };
enum { FOUND_COLUMNS(RX_LAB_ID) FOUND_WIDTH };
enum { THING, EXACT, TABLES, RUNS = 3 };

static const rx_lab_column THINGS[] = {THING_COLUMNS(RX_LAB_COLUMN)},
                           FOUND[] = {FOUND_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_schema SCHEMAS[TABLES] = {
    [THING] = {"thing", THING_WIDTH, FOUND_WIDTH, THINGS, FOUND, 0},
    [EXACT] = {"exact", 0, FOUND_WIDTH, NULL, FOUND, 1},
};

static void begin(rx_lab_table table[TABLES])
{
    for (int t = 0; t < TABLES; t++)
        rx_lab_table_begin(&SCHEMAS[t], RUNS, &table[t]);
}

/* Four things and one exact row; `third` distinguishes units. */
static void fill(rx_lab_table table[TABLES], double third)
{
    double *row;
    begin(table);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(rx_lab_rows_add(&table[THING], 1, &row, NULL), RX_OK);
        assert_near(row[THING_APART], 0, 0);
        row[THING_SNR] = i + third;
        for (int run = 0; run < RUNS; run++)
            rx_lab_each(&table[THING], i, run)[FOUND_SCORE] = run == 1 ? NAN : 10 * i + run;
    }
    assert_int_equal(rx_lab_rows_add(&table[EXACT], 1, &row, NULL), RX_OK);
    rx_lab_each(&table[EXACT], 0, 2)[FOUND_SCORE] = third;
}

/* Two units one behind the other; floats are floats, exact ones doubles. */
static void rows_come_back(void **state)
{
    rx_lab_table table[TABLES], all[TABLES];
    (void)state;
    begin(all);
    for (int unit = 0; unit < 2; unit++) {
        rx_unit_values values;
        fill(table, 1.0 / (3 + unit));
        assert_int_equal(rx_lab_pack(TABLES, table, &values, NULL), RX_OK);
        assert_int_equal(values.n, 2 + 4 * (THING_WIDTH + RUNS) + RUNS);
        assert_int_equal(rx_lab_unpack(TABLES, all, &values, NULL), RX_OK);
        rx_lab_tables_free(TABLES, table);
        free(values.v);
    }
    assert_int_equal(all[THING].n, 8);
    assert_int_equal(all[EXACT].n, 2);
    assert_near(rx_lab_own(&all[THING], 3)[THING_SNR], (double)(float)(3 + 1.0 / 3), 0);
    assert_near(rx_lab_own(&all[THING], 4)[THING_SNR], 0.25, 0);
    assert_near(rx_lab_each(&all[THING], 7, 2)[FOUND_SCORE], 32, 0);
    assert_true(isnan(rx_lab_each(&all[THING], 7, 1)[FOUND_SCORE]));
    assert_near(rx_lab_each(&all[EXACT], 0, 2)[FOUND_SCORE], 1.0 / 3, 0);
    rx_lab_tables_free(TABLES, all);
}

static void units_of_other_tables_are_refused(void **state)
{
    double wrong[][4] = {{0, 1, 1, 2}, {0, 2, 1, 2}, {-1, 0, 0, 0}, {0, 0, 0, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        rx_lab_table table[TABLES];
        rx_error err = RX_ERROR_NONE;
        begin(table);
        assert_int_equal(rx_lab_unpack(TABLES, table, &(rx_unit_values){4, wrong[i]}, &err), RX_INPUT);
        assert_non_null(strstr(err.text, "the journal holds a unit"));
        rx_lab_tables_free(TABLES, table);
    }
}

/* The names stand in the head of a journal; one that was begun with other columns is refused, and which is said. */
static void journals_hold_the_names(void **state)
{
    static const rx_lab_schema other = {"thing", 1, 0, THINGS, NULL, 0};
    size_t size;
    rx_unit_values values[1] = {{0}};
    rx_journal *journal = NULL;
    rx_error err = RX_ERROR_NONE;
    const char *path = in(state, "names");
    for (int k = 0; k < 2; k++) {
        rx_journal_facts facts = {0};
        rx_lab_schema_fact(k == 0 ? &SCHEMAS[THING] : &other, &facts);
        assert_int_equal(rx_journal_open(path, &facts, 1, values, &journal, &err), k == 0 ? RX_OK : RX_USAGE);
        if (k == 0)
            rx_journal_close(journal);
        rx_journal_facts_free(&facts);
    }
    char *data = file_bytes(path, &size);
    assert_non_null(strstr(data, "\n= TABLE.thing snr apart[FWHM]; each run: score\n"));
    free(data);
    assert_non_null(strstr(err.text, "TABLE.thing snr apart[FWHM]; each run: score, now it is snr"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_come_back),
        cmocka_unit_test(units_of_other_tables_are_refused),
        cmocka_unit_test(journals_hold_the_names),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
