/* Records: written, read back, refused. */
#include "../near.h"
#include "../scratch.h"

#include <math.h>

#include "survey/tile_record.h"

static const char whole[] = "TILE \"night 1/a %22b%25.fits\" \"a %22b%25\"\n"
                            "VERSION \"0.1.0\"\n"
                            "STATUS 5 \"rextract: a quality gate FAILED%0Aand more\"\n"
                            "EXTENSION 1 2048 1489 150.1 -2.25 nan 1000.5 9.75 2\n"
                            "STATE 0.1 24 1.5 0.02 0.001 1 2\n"
                            "CARD \"AIRMASS\" 1.25\n"
                            "CARD \"MJD-OBS\" 60000.123456789\n"
                            "PAGE \"night 1/a_qa/tile.html\"\n"
                            "PSF \"STATED\" 31 8 0.0125 -0.003 0.011 0.001 -0.002 0.003 0.004 0.005 nan\n"
                            "STARS 8 -120 14 2 0.0625\n"
                            "RHO 2 20 -345 1000000000000\n"
                            "RUN \"NONE\" 812 1\n"
                            "FACT RXTPGRP \"12\"\n"
                            "BIN 96 10 9 11 9 0:1 244:7 489:1\n"
                            "BIN 100 5 0 0 0\n"
                            "RUN \"RL_BLIND\" 900 0\n"
                            "FLUX 439 10 1.03204 0.00083 1.05893 nan\n"
                            "RUN \"NET\" 700 0\n"
                            "DONE \"RL\" \"FWHM 1.2 is %22narrow%22\"\n"
                            "OUTSIDE \"noise factor 3.2\"\n"
                            "GUARD 9.5 1.25 0.03\n"
                            "SHARES 0.125\n"
                            "RUN \"AUTO\" 900 0\n"
                            "TOOK \"NET\" \"finds most\"\n"
                            "EXTENSION 2 10 10 nan nan 3 0 1 0\n"
                            "END\n";

/* What is read, one record after the other. */
typedef struct seen {
    int n;
    int64_t at[4];
    rx_text text;
} seen;

static rx_status take(void *user, const rx_tile_record *record, int64_t at, rx_error *err)
{
    seen *s = user;
    (void)err;
    assert_true(s->n < 4);
    s->at[s->n++] = at;
    rx_tile_record_print(&s->text, record);
    return RX_OK;
}

/* The fields of `whole`. */
static rx_status check(void *user, const rx_tile_record *r, int64_t at, rx_error *err)
{
    const rx_extension_facts *e = r->facts.extension;
    ++*(int *)user;
    (void)err;
    assert_int_equal(at, 0);
    assert_string_equal(r->image, "night 1/a \"b%.fits");
    assert_string_equal(r->what, "rextract: a quality gate FAILED\nand more");
    assert_int_equal(r->status, 5);
    assert_int_equal(r->facts.n, 2);
    assert_true(isnan(e->fwhm));
    assert_true(isnan(e->psf.error[2]));
    assert_near(e->delta, -2.25, 0);
    assert_int_equal(e->verdict, RX_VERDICT_FAIL);
    assert_true(e->known);
    assert_true(!e[1].known);
    assert_int_equal(e->ncards, 2);
    assert_near(e->card[1].value, 60000.123456789, 0);
    assert_near(e->psf.off[2], 0.003, 0);
    assert_near(e->psf.rho.delta, -2.25, 0);
    assert_int_equal(e->psf.rho.ee[2], 1000000000000);
    assert_true(rx_psf_account_is_lower(&e->psf));
    assert_true(!rx_psf_account_is_lower(&e[1].psf));
    assert_int_equal(e->nruns, 4);
    assert_string_equal(e->run[1].by, "");
    assert_near(e->run[1].flux.wide, 1.03204, 1e-12);
    assert_true(isnan(e->run[1].flux.automatic_error));
    assert_true(isnan(e->run[1].sharp));
    assert_near(e->run[2].guard.unexplained, 0.03, 0);
    assert_true(rx_fluxcheck_is_off(&e->run[1].flux));
    assert_string_equal(e->run[2].by, "RL");
    assert_string_equal(e->run[2].why, "FWHM 1.2 is \"narrow\"");
    assert_int_equal(e->run[2].flux.n, 0);
    assert_true(e->run[2].guard.known);
    assert_true(!e->run[1].guard.known);
    assert_string_equal(e->run[3].taken, "NET");
    assert_int_equal(e->run[0].tally->bin[96].dmag[244], 7);
    assert_null(e->run[0].tally->bin[100].dmag);
    assert_null(e->run[1].tally);
    return RX_OK;
}

static void what_is_written_is_read(void **state)
{
    const char *path = put(state, "whole", whole);
    int n = 0;
    seen s = {0};
    assert_int_equal(rx_tile_record_read(path, 0, 0, check, &n, NULL), RX_OK);
    assert_int_equal(n, 1);
    assert_int_equal(rx_tile_record_read(path, 0, 0, take, &s, NULL), RX_OK);
    assert_string_equal(s.text.data, whole);
    rx_text_free(&s.text);
}

/* Blank lines between, and each of them from where it begins. */
static void one_of_many_is_read(void **state)
{
    char text[2 * sizeof whole + 200];
    seen all = {0}, one = {0};
    snprintf(text, sizeof text, "\n%s\n\nTILE b b\nVERSION 1\nSTATUS 0 \"\"\nEND\n%s", whole, whole);
    const char *path = put(state, "many", text);
    assert_int_equal(rx_tile_record_read(path, 0, 0, take, &all, NULL), RX_OK);
    assert_int_equal(all.n, 3);
    assert_int_equal(rx_tile_record_read(path, all.at[1], 1, take, &one, NULL), RX_OK);
    assert_int_equal(one.n, 1);
    assert_int_equal(one.at[0], all.at[1]);
    assert_string_equal(one.text.data, "TILE \"b\" \"b\"\nVERSION \"1\"\nSTATUS 0 \"\"\nEND\n");
    rx_text_free(&all.text);
    rx_text_free(&one.text);
}

static void check_refused(void **state, const char *text, const char *words)
{
    const char *path = put(state, "refused", text);
    seen s = {0};
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_tile_record_read(path, 0, 0, take, &s, &err), RX_INPUT);
    assert_true(err.line > 0);
    assert_string_equal(err.where, path);
    if (strstr(err.text, words) == NULL)
        fail_msg("%s: %s", text, err.text);
    rx_text_free(&s.text);
}

/* Cut at every byte. */
static void damage_is_found(void **state)
{
    for (size_t cut = 1; cut < sizeof whole - 2; cut++) { /* up to END and its line break */
        char text[sizeof whole] = "";
        memcpy(text, whole, cut);
        check_refused(state, text, "whole?");
    }
}

static void nonsense_is_refused(void **state)
{
#define EXTENSION "TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 0\n"
#define PSF_W "PSF W 1 0 0 0 0 0 0 0 0 0 0\n"
#define RUN EXTENSION "RUN N 1 1\n"
    static const char *const refused[][2] = {
        {"hello\n", "TILE does not come first"},
        {"TILE a.fits a\nhello\n", "no line of a record"},
        {"TILE a.fits a\nTILE b.fits b\n", "has no END"},
        {"TILE a.fits a\nEND\n", "VERSION or STATUS is missing"},
        {"TILE a.fits a\nRUN NONE 1 0\n", "RUN is out of place"},
        {"TILE a.fits a\nPSF W 1 0 0 0 0 0 0 0 0 0 0\n", "PSF is out of place"},
        {"TILE a.fits a\nGUARD 1 1 0\n", "GUARD is out of place"},
        {"TILE a.fits a\nFACT RXREST NONE\n", "FACT is out of place"},
        {"TILE \"a.fits\n", "a quote is not closed"},
        {"TILE a.fits\n", "a word is missing"},
        {"TILE a.fits a\nEXTENSION 0 1 1 0 0 0 0 0 9\n", "a number is out of place"},
        {EXTENSION "RUN \"%4C<b>\" 1 0\n", "no name"},
        {EXTENSION "RUN A_NAME_OF_16_BYTES 1 0\n", "no name"},
        {EXTENSION "BIN 1 1 1 1 1\n", "a bin is out of place"},
        {EXTENSION "PSF \"<b>\" 1 0 0 0 0 0 0 0 0 0 0\n", "no name"},
        {EXTENSION "PSF W 1 0 0 0 0 0 0 0 0 0\n", "a number is missing"},
        {EXTENSION "STARS 1 0 0 0 0\n", "STARS is out of place"},
        {EXTENSION PSF_W "RHO 0 1 0 0\n", "RHO is out of place"},
        {EXTENSION PSF_W PSF_W, "PSF is out of place"},
        {EXTENSION PSF_W "STARS 2 0 0 0 0\nRHO 11 1 0 0\n", "a number is out of place"},
        {"TILE a.fits a\nVERSION 1\nVERSION 1\n", "twice"},
        {"TILE a.fits a\nSTATUS 0 \"\"\nSTATUS 3 why\n", "twice"},
        {EXTENSION "FLUX 5 1 1 1 1 1\n", "FLUX is out of place"},
        {RUN "DONE \"<b>\" why\n", "no name"},
        {RUN "FLUX 5 1 1 1 1\n", "a number is missing"},
        {RUN "BIN 140 1 1 1 1\n", "a number is out of place"},
        {RUN "BIN 1 1 1 1 1 490:1\n", "a number is out of place"},
        {RUN "BIN 1 1 1 1 1 2:99999999999\n", "a number is out of place"},
        {RUN "BIN 1 1 1 1 1 2\n", "a count is out of place"},
    };
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        check_refused(state, refused[i][0], refused[i][1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_written_is_read),
        cmocka_unit_test(one_of_many_is_read),
        cmocka_unit_test(damage_is_found),
        cmocka_unit_test(nonsense_is_refused),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
