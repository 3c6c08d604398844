/* Records: written, read back, refused, merged. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "survey/tile_record.h"

static const char whole[] = "TILE \"night 1/a %22b%25.fits\" \"a %22b%25\"\n"
                            "VERSION \"0.1.0\"\n"
                            "STATUS 5 \"rextract: a quality gate FAILED%0Aand more\"\n"
                            "EXTENSION 1 2048 1489 150.1 -2.25 nan 1000.5 9.75 2\n"
                            "RUN \"NONE\" 812 1\n"
                            "BIN 96 10 9 11 9 0:1 244:7 489:1\n"
                            "BIN 100 5 0 0 0\n"
                            "RUN \"RL_BLIND\" 900 0\n"
                            "EXTENSION 2 10 10 nan nan 3 0 1 0\n"
                            "END\n";

static void put(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static int enter(void **state)
{
    char *path = strdup("/tmp/rextract-record-XXXXXX");
    *state = path;
    int file = path != NULL ? mkstemp(path) : -1;
    return file >= 0 ? close(file) : -1;
}

static int leave(void **state)
{
    unlink(*state);
    free(*state);
    return 0;
}

static void what_is_written_is_read(void **state)
{
    rx_tile_records records = {0};
    put(*state, whole);
    assert_int_equal(rx_tile_records_read(&records, *state, NULL), RX_OK);
    assert_int_equal(records.n, 1);
    const rx_tile_record *r = records.record;
    assert_string_equal(r->image, "night 1/a \"b%.fits");
    assert_string_equal(r->what, "rextract: a quality gate FAILED\nand more");
    assert_int_equal(r->status, 5);
    assert_int_equal(r->facts.n, 2);
    const rx_extension_facts *e = r->facts.extension;
    assert_true(isnan(e->fwhm));
    assert_float_equal(e->delta, -2.25, 0);
    assert_int_equal(e->verdict, RX_VERDICT_FAIL);
    assert_int_equal(e->nruns, 2);
    assert_int_equal(e->run[0].tally->bin[96].dmag[244], 7);
    assert_null(e->run[0].tally->bin[100].dmag);
    assert_null(e->run[1].tally);
    rx_text text = {0};
    rx_tile_record_print(&text, r);
    assert_string_equal(text.data, whole);
    rx_text_free(&text);
    rx_tile_records_free(&records);
}

/* Every line of `whole` cut away, and every word of it: either refused with a place, or a record all the
 * same. */
static void damage_is_found(void **state)
{
    for (size_t cut = 1; cut + 1 < sizeof whole; cut++) {
        char text[sizeof whole];
        rx_tile_records records = {0};
        rx_error err = RX_ERROR_NONE;
        memcpy(text, whole, cut);
        text[cut] = '\0';
        put(*state, text);
        rx_status status = rx_tile_records_read(&records, *state, &err);
        if (cut < sizeof whole - 2) { /* without END and its line break */
            assert_int_equal(status, RX_INPUT);
            assert_true(err.line > 0);
            assert_string_equal(err.where, *state);
        }
        rx_tile_records_free(&records);
    }
}

static void check_refused(void **state, const char *text, const char *words)
{
    rx_tile_records records = {0};
    rx_error err = RX_ERROR_NONE;
    put(*state, text);
    assert_int_equal(rx_tile_records_read(&records, *state, &err), RX_INPUT);
    assert_non_null(strstr(err.text, words));
    rx_tile_records_free(&records);
}

static void nonsense_is_refused(void **state)
{
    check_refused(state, "hello\n", "TILE does not come first");
    check_refused(state, "TILE a.fits a\nhello\n", "no line of a record");
    check_refused(state, "TILE a.fits a\nTILE b.fits b\n", "has no END");
    check_refused(state, "TILE a.fits a\nEND\n", "VERSION or STATUS is missing");
    check_refused(state, "TILE a.fits a\nRUN NONE 1 0\n", "a run is out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN \"%4C<b>\" 1 0\n",
                  "no name of a restorer");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN A_NAME_OF_16_BYTES 1 0\n",
                  "no name of a restorer");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nBIN 1 1 1 1 1\n",
                  "a bin is out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 9\n", "out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN N 1 1\nBIN 140 1 1 1 1\n",
                  "out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN N 1 1\nBIN 1 1 1 1 1 490:1\n",
                  "out of place");
    check_refused(state,
                  "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN N 1 1\nBIN 1 1 1 1 1 2:99999999999\n",
                  "out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN N 1 1\nBIN 1 1 1 1 1 2\n",
                  "out of place");
    check_refused(state, "TILE \"a.fits\n", "a quote is not closed");
}

static void add(rx_tile_records *records, void **state, const char *image, const char *name, int code)
{
    char text[200];
    snprintf(text, sizeof text, "TILE \"%s\" \"%s\"\nVERSION \"1\"\nSTATUS %d \"\"\nEND\n", image, name,
             code);
    put(*state, text);
    assert_int_equal(rx_tile_records_read(records, *state, NULL), RX_OK);
}

static void records_are_sorted_and_merged(void **state)
{
    rx_tile_records records = {0};
    rx_error err = RX_ERROR_NONE;
    add(&records, state, "n/b.fits", "b", 0);
    add(&records, state, "n/a.fits", "a", 3);
    add(&records, state, "m/b.fits", "b", 0);
    add(&records, state, "n/a.fits", "a", 3);
    assert_int_equal(rx_tile_records_settle(&records, NULL), RX_OK);
    assert_int_equal(records.n, 3);
    assert_string_equal(records.record[0].image, "n/a.fits");
    assert_string_equal(records.record[1].image, "m/b.fits");
    assert_string_equal(records.record[2].image, "n/b.fits");
    add(&records, state, "m/b.fits", "b", 4);
    assert_int_equal(rx_tile_records_settle(&records, &err), RX_INPUT);
    assert_string_equal(err.where, "m/b.fits");
    rx_tile_records_free(&records);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_written_is_read, enter, leave),
        cmocka_unit_test_setup_teardown(damage_is_found, enter, leave),
        cmocka_unit_test_setup_teardown(nonsense_is_refused, enter, leave),
        cmocka_unit_test_setup_teardown(records_are_sorted_and_merged, enter, leave),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
