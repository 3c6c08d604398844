/* Records: written, read back, refused. */
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

#include "../files.h"
#include "../near.h"
#include "survey/tile_record.h"

static const char whole[] = "TILE \"night 1/a %22b%25.fits\" \"a %22b%25\"\n"
                            "VERSION \"0.1.0\"\n"
                            "STATUS 5 \"rextract: a quality gate FAILED%0Aand more\"\n"
                            "EXTENSION 1 2048 1489 150.1 -2.25 nan 1000.5 9.75 2\n"
                            "STATE 0.1 24 1.5 0.02 0.001 nan 1 2\n"
                            "ANOMALIES 0.25 nan 0.03\n"
                            "PSF \"STATED\" 31 8 0.0125 -0.003 0.011 0.001 -0.002 0.003 0.004 0.005 nan\n"
                            "STARS 8 -120 14 2 0.0625\n"
                            "RHO 2 20 -345 1000000000000\n"
                            "RUN \"NONE\" 812 1\n"
                            "BIN 96 10 9 11 9 0:1 244:7 489:1\n"
                            "BIN 100 5 0 0 0\n"
                            "RUN \"RL_BLIND\" 900 0\n"
                            "FLUX 439 10 1.03204 0.00083 1.05893 nan\n"
                            "RUN \"NET\" 700 0\n"
                            "DONE \"RL\" \"FWHM 1.2 is %22narrow%22\"\n"
                            "OUTSIDE \"noise factor 3.2\"\n"
                            "GUARD 9.5 1.25 nan\n"
                            "SHARES nan 0.125\n"
                            "RUN \"AUTO\" 900 0\n"
                            "TOOK \"NET\" \"finds most\"\n"
                            "EXTENSION 2 10 10 nan nan 3 0 1 0\n"
                            "END\n";

/* Reads all of the file; what the last call of rx_record_reader_next() says. */
static rx_status read_all(const char *path, int *n, rx_error *err)
{
    rx_record_reader *reader = NULL;
    const rx_tile_record *record = NULL;
    int64_t at;
    rx_status status = rx_record_reader_open(path, 0, &reader, err);
    *n = 0;
    while (status == RX_OK && (status = rx_record_reader_next(reader, &record, &at, err)) == RX_OK &&
           record != NULL)
        ++*n;
    rx_record_reader_close(reader);
    return status;
}

static void what_is_written_is_read(void **state)
{
    rx_record_reader *reader = NULL;
    const rx_tile_record *r = NULL;
    int64_t at = -1;
    write_text(*state, whole);
    assert_int_equal(rx_record_reader_open(*state, 0, &reader, NULL), RX_OK);
    assert_int_equal(rx_record_reader_next(reader, &r, &at, NULL), RX_OK);
    assert_non_null(r);
    assert_int_equal(at, 0);
    assert_string_equal(r->image, "night 1/a \"b%.fits");
    assert_string_equal(r->what, "rextract: a quality gate FAILED\nand more");
    assert_int_equal(r->status, 5);
    assert_int_equal(r->facts.n, 2);
    const rx_extension_facts *e = r->facts.extension;
    assert_true(isnan(e->fwhm));
    assert_near(e->delta, -2.25, 0);
    assert_int_equal(e->verdict, RX_VERDICT_FAIL);
    assert_near(e->state.light, 0.03, 0);
    assert_near(e->run[2].lit, 0.125, 0);
    assert_true(isnan(e->run[1].lit));
    assert_string_equal(e->psf.how, "STATED");
    assert_int_equal(e->psf.stars, 31);
    assert_int_equal(e->psf.reserved, 8);
    assert_near(e->psf.flux_error, 0.0125, 0);
    assert_near(e->psf.off[2], 0.003, 0);
    assert_true(isnan(e->psf.error[2]));
    assert_int_equal(e->psf.rho.n, 8);
    assert_int_equal(e->psf.rho.t, -120);
    assert_near(e->psf.rho.delta, -2.25, 0);
    assert_int_equal(e->psf.rho.ee[2], 1000000000000);
    assert_int_equal(rx_psf_account_is_lower(&e->psf), 1);
    assert_int_equal(rx_psf_account_is_lower(&e[1].psf), 0);
    assert_int_equal(e->nruns, 4);
    assert_string_equal(e->run[1].by, "");
    assert_int_equal(e->run[1].flux.n, 439);
    assert_near(e->run[1].flux.wide, 1.03204, 1e-12);
    assert_true(isnan(e->run[1].flux.automatic_error));
    assert_true(rx_fluxcheck_is_off(&e->run[1].flux));
    assert_string_equal(e->run[2].by, "RL");
    assert_string_equal(e->run[2].why, "FWHM 1.2 is \"narrow\"");
    assert_int_equal(e->run[2].flux.n, 0);
    assert_string_equal(e->run[3].taken, "NET");
    assert_string_equal(e->run[3].why, "finds most");
    assert_string_equal(e->run[3].by, "");
    assert_int_equal(e->run[0].tally->bin[96].dmag[244], 7);
    assert_null(e->run[0].tally->bin[100].dmag);
    assert_null(e->run[1].tally);
    rx_text text = {0};
    rx_tile_record_print(&text, r);
    assert_string_equal(text.data, whole);
    rx_text_free(&text);
    assert_int_equal(rx_record_reader_next(reader, &r, &at, NULL), RX_OK);
    assert_null(r);
    rx_record_reader_close(reader);
}

/* Blank lines between, and each of them from where it begins. */
static void one_of_many_is_read(void **state)
{
    char text[2 * sizeof whole + 200];
    rx_record_reader *reader = NULL;
    const rx_tile_record *r = NULL;
    int64_t at[3] = {0}, again;
    int n = 0;
    snprintf(text, sizeof text, "\n%s\n\nTILE b b\nVERSION 1\nSTATUS 0 \"\"\nEND\n%s", whole, whole);
    write_text(*state, text);
    assert_int_equal(rx_record_reader_open(*state, 0, &reader, NULL), RX_OK);
    while (rx_record_reader_next(reader, &r, &again, NULL) == RX_OK && r != NULL && n < 3)
        at[n++] = again;
    rx_record_reader_close(reader);
    assert_int_equal(n, 3);
    assert_int_equal(rx_record_reader_open(*state, at[1], &reader, NULL), RX_OK);
    assert_int_equal(rx_record_reader_next(reader, &r, &again, NULL), RX_OK);
    assert_string_equal(r->name, "b");
    assert_int_equal(again, at[1]);
    assert_int_equal(rx_record_reader_next(reader, &r, &again, NULL), RX_OK);
    assert_int_equal(r->status, 5);
    assert_int_equal(again, at[2]);
    rx_record_reader_close(reader);
}

/* Every line of `whole` cut away, and every word of it: either refused with a place, or a record all the
 * same. */
static void damage_is_found(void **state)
{
    for (size_t cut = 1; cut + 1 < sizeof whole; cut++) {
        char text[sizeof whole];
        rx_error err = RX_ERROR_NONE;
        int n;
        memcpy(text, whole, cut);
        text[cut] = '\0';
        write_text(*state, text);
        rx_status status = read_all(*state, &n, &err);
        if (cut < sizeof whole - 2) { /* without END and its line break */
            assert_int_equal(status, RX_INPUT);
            assert_true(err.line > 0);
            assert_string_equal(err.where, *state);
        }
    }
}

static void check_refused(void **state, const char *text, const char *words)
{
    rx_error err = RX_ERROR_NONE;
    int n;
    write_text(*state, text);
    assert_int_equal(read_all(*state, &n, &err), RX_INPUT);
    assert_non_null(strstr(err.text, words));
}

static void nonsense_is_refused(void **state)
{
    check_refused(state, "hello\n", "TILE does not come first");
    check_refused(state, "TILE a.fits a\nhello\n", "no line of a record");
    check_refused(state, "TILE a.fits a\nTILE b.fits b\n", "has no END");
    check_refused(state, "TILE a.fits a\nEND\n", "VERSION or STATUS is missing");
    check_refused(state, "TILE a.fits a\nRUN NONE 1 0\n", "RUN is out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN \"%4C<b>\" 1 0\n", "no name");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN A_NAME_OF_16_BYTES 1 0\n",
                  "no name");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nBIN 1 1 1 1 1\n",
                  "a bin is out of place");
    check_refused(state, "TILE a.fits a\nPSF W 1 0 0 0 0 0 0 0 0 0 0\n", "PSF is out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nPSF \"<b>\" 1 0 0 0 0 0 0 0 0 0 0\n",
                  "no name");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nPSF W 1 0 0 0 0 0 0 0 0 0\n",
                  "a number is missing");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nSTARS 1 0 0 0 0\n",
                  "STARS is out of place");
    check_refused(state,
                  "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nPSF W 1 0 0 0 0 0 0 0 0 0 0\nRHO 0 1 0 0\n",
                  "RHO is out of place");
    check_refused(state,
                  "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nPSF W 1 0 0 0 0 0 0 0 0 0 0\nSTARS 2 0 0 "
                  "0 0\nRHO 11 1 0 0\n",
                  "a number is out of place");
    check_refused(state, "TILE a.fits a\nGUARD 1 1 0\n", "GUARD is out of place");
    check_refused(state, "TILE a.fits a\nDONE RL why\n", "DONE is out of place");
    check_refused(state, "TILE a.fits a\nTOOK RL why\n", "TOOK is out of place");
    check_refused(state, "TILE a.fits a\nOUTSIDE why\n", "OUTSIDE is out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nFLUX 5 1 1 1 1 1\n",
                  "FLUX is out of place");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN N 1 0\nDONE \"<b>\" why\n",
                  "no name");
    check_refused(state, "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\nRUN N 1 0\nFLUX 5 1 1 1 1\n",
                  "a number is missing");
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(what_is_written_is_read, make_file, remove_file),
        cmocka_unit_test_setup_teardown(one_of_many_is_read, make_file, remove_file),
        cmocka_unit_test_setup_teardown(damage_is_found, make_file, remove_file),
        cmocka_unit_test_setup_teardown(nonsense_is_refused, make_file, remove_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
