/* The library of PSFs: which exposure a header says, which model is taken, and what its error is. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "../near.h"
#include "../scratch.h"
#include "io/fits_write.h"
#include "io/output.h"
#include "psf/psf_library.h"
#include "psf/psf_psfex.h"
#include "stage/provenance.h"

static const char folder[] = ".";

static rx_psf_origin origin_of(const char *const *lines, const char *extname)
{
    char cards[1600] = "", name[40];
    size_t n = 0;
    rx_psf_origin origin;
    for (; lines[n] != NULL; n++)
        snprintf(cards + 80 * n, 81, "%-80s", lines[n]);
    snprintf(name, sizeof name, "%s", extname);
    const rx_tile tile = {.cards = cards, .ncards = n, .extname = name, .width = 200, .height = 100};
    rx_psf_origin_of(&tile, &origin);
    return origin;
}

static void test_origin(void **state)
{
    (void)state;
    const char *const all[] = {"INSTRUME= 'DECam   '",
                               "CCDNUM  =                   31",
                               "DETECTOR= 'S3-119_123'",
                               "FILTER  = 'r DECam'",
                               "MJD-OBS =          56254.17101",
                               "DATE-OBS= '2020-01-01'",
                               NULL};
    rx_psf_origin o = origin_of(all, "N4");
    assert_string_equal(o.ccd, "DECam 31");
    assert_string_equal(o.filter, "r DECam");
    assert_near(o.mjd, 56254.17101, 1e-9);
    assert_int_equal(o.width, 200);
    assert_int_equal(o.height, 100);
    assert_true(isnan(o.alpha));
    const char *const date[] = {"BAND    = 'g'", "DATE-OBS= '2012-11-23T04:06:15.5'", NULL};
    o = origin_of(date, "chip2");
    assert_string_equal(o.ccd, "chip2");
    assert_string_equal(o.filter, "g");
    assert_near(o.mjd, 56254.0 + (4.0 + (6.0 + 15.5 / 60.0) / 60.0) / 24.0, 1e-9);
    const char *const day[] = {"DATE-OBS= '2000-02-29'", NULL}, *const old[] = {"DATE-OBS= '23/11/95'", NULL};
    assert_near(origin_of(day, "").mjd, 51603.0, 1e-9);
    assert_true(isnan(origin_of(old, "").mjd));
    assert_string_equal(origin_of(old, "").ccd, "");
}

/* A model in the folder: a Moffat, with what a tile says of itself. */
static void add_model(const char *name, double fwhm, double mjd, double alpha, const char *ccd, int width,
                      int degree)
{
    rx_error err = {0};
    rx_psf *psf = NULL;
    rx_table *table = NULL;
    rx_text cards = {0};
    rx_record facts = {0};
    rx_fits_writer *file = NULL;
    char path[256];
    rx_psf_origin origin = {.mjd = mjd, .alpha = alpha, .delta = 0.0, .width = width, .height = 300};
    snprintf(origin.ccd, sizeof origin.ccd, "%s", ccd);
    assert_int_equal(rx_psf_moffat(fwhm, 3.5, 1.0, 0.0, 41, &psf, &err), RX_OK);
    psf->nstars = 25;
    psf->quality.radius = 20;
    psf->quality.flux_error = 0.004;
    snprintf(psf->quality.how, sizeof psf->quality.how, "PIXELS");
    rx_psf_origin_facts(&origin, &facts);
    rx_psf_facts(psf, &facts);
    if (degree > 0) {
        rx_psf *varying = rx_psf_new(RX_PSF_AUTO, 41, 2);
        memcpy(varying->basis, psf->basis, sizeof(float) * 41 * 41);
        varying->px[1] = 1;
        rx_psf_free(psf);
        psf = varying;
    }
    assert_int_equal(rx_psf_psfex_table(psf, &table, &cards, &err), RX_OK);
    rx_record_cards(&facts, &cards);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    assert_int_equal(rx_fits_create(path, path, &file, &err), RX_OK);
    assert_int_equal(rx_fits_table(file, table, &cards, &err), RX_OK);
    assert_int_equal(rx_fits_close(file, &err), RX_OK);
    rx_record_free(&facts);
    rx_text_free(&cards);
    rx_table_free(table);
    rx_psf_free(psf);
}

/* What finding a PSF for a tile says, of that CCD and filter. */
static rx_psf *find_aloud(const char *ccd, const char *filter, char *text, size_t room)
{
    const rx_psf_library library = {.folder = folder, .days = 1.0, .degrees = 1.0};
    rx_psf_origin tile = {.mjd = 100.0, .alpha = 10.0, .delta = 0.0, .width = 200, .height = 300};
    rx_error err = {0};
    rx_log log;
    rx_psf *psf = NULL;
    FILE *stream = tmpfile();
    assert_non_null(stream);
    snprintf(tile.ccd, sizeof tile.ccd, "%s", ccd);
    snprintf(tile.filter, sizeof tile.filter, "%s", filter);
    rx_log_init(&log, "test", stream, RX_NORMAL);
    assert_int_equal(rx_psf_library_find(&library, &tile, &log, NULL, &psf, &err), RX_OK);
    rewind(stream);
    text[fread(text, 1, room - 1, stream)] = '\0';
    fclose(stream);
    return psf;
}

static rx_psf *find(double mjd, double alpha, double days, double degrees)
{
    const rx_psf_library library = {.folder = folder, .days = days, .degrees = degrees};
    const rx_psf_origin tile = {
        .ccd = "cam 7", .mjd = mjd, .alpha = alpha, .delta = 0.0, .width = 200, .height = 300};
    rx_error err = {0};
    rx_psf *psf = NULL;
    assert_int_equal(rx_psf_library_find(&library, &tile, NULL, NULL, &psf, &err), RX_OK);
    return psf;
}

static void test_nearest(void **state)
{
    (void)state;
    add_model("z_late.psf", 3.0, 100.4, 10.0, "cam 7", 200, 0);
    add_model("near.psf", 3.2, 100.1, 10.1, "cam 7", 200, 0);
    add_model("twin.psf", 9.0, 100.1, 10.1, "cam 7", 200, 0); /* as near: the file name decides */
    add_model("other_ccd.psf", 5.0, 100.0, 10.0, "cam 8", 200, 0);
    add_model("other_size.psf", 5.0, 100.0, 10.0, "cam 7", 250, 1);
    add_model("far.psf", 5.0, 100.0, 14.0, "cam 7", 200, 0);
    add_model("old.psf", 5.0, 98.0, 10.0, "cam 7", 200, 0);
    rx_psf *psf = find(100.0, 10.0, 1.0, 2.0);
    assert_non_null(psf);
    assert_string_equal(psf->quality.how, "LIBRARY");
    assert_string_equal(psf->quality.library, "near.psf");
    assert_near(psf->quality.library_days, 0.1, 1e-6);
    assert_near(psf->quality.library_degrees, 0.1, 1e-6);
    assert_int_equal(psf->quality.library_compared, 2);
    assert_int_equal(psf->nstars, 25);
    assert_near(psf->fwhm, 3.2, 0.02);
    rx_psf_free(psf);
    assert_null(find(105.0, 10.0, 1.0, 2.0));
    assert_null(find(100.0, 30.0, 1.0, 2.0));
    psf = find(NAN, 10.0, 1.0, 2.0); /* by place alone: old.psf, z_late.psf at 0 */
    assert_string_equal(psf->quality.library, "old.psf");
    assert_true(isnan(psf->quality.library_days));
    rx_psf_free(psf);
    assert_null(find(NAN, NAN, 1.0, 2.0)); /* nothing says that any of them is near */
}

/* A CCD or filter that neither states is warned of; one that one of them states is no match. */
static void test_not_stated(void **state)
{
    (void)state;
    char text[2000];
    add_model("any.psf", 3.0, 100.0, 10.0, "", 200, 0);
    rx_psf *psf = find_aloud("", "", text, sizeof text);
    assert_non_null(psf);
    if (strstr(text, "any.psf: neither its header nor the tile's states the CCD and filter") == NULL)
        fail_msg("'%s'", text);
    assert_non_null(strstr(psf->description, ", CCD and filter not stated"));
    rx_psf_free(psf);
    assert_null(find_aloud("cam 7", "", text, sizeof text));
    assert_null(find_aloud("", "r", text, sizeof text));
    add_model("of_ccd.psf", 3.5, 100.0, 10.0, "cam 7", 200, 0);
    psf = find_aloud("cam 7", "", text, sizeof text);
    assert_string_equal(psf->quality.library, "of_ccd.psf");
    if (strstr(text, "of_ccd.psf: neither its header nor the tile's states the filter") == NULL)
        fail_msg("'%s'", text);
    rx_psf_free(psf);
    psf = find_aloud("", "", text, sizeof text);
    assert_string_equal(psf->quality.library, "any.psf");
    assert_int_equal(psf->quality.library_compared, 0);
    rx_psf_free(psf);
}

/* A number in a model's header that cannot be right: the model is left out, and the card named. */
static void test_hostile_cards(void **state)
{
    (void)state;
    static const char *const bad[][2] = {{"RXPSFERR", "-1E30"}, {"RXPSFERR", "1.5"},   {"RXPSFERR", "NaN"},
                                         {"RXPSFOUT", "-0.1"},  {"RXPSFOUT", "1E30"},  {"RXPSFDEG", "-1E300"},
                                         {"RXPSFDEG", "9"},     {"ACCEPTED", "1E300"}, {"ACCEPTED", "-1"},
                                         {"RXLNX", "1E300"},    {"RXLNY", "-1E300"}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        char path[256], card[81], text[2000], said[120];
        add_model("a.psf", 3.0, 100.0, 10.0, "", 200, 0);
        snprintf(path, sizeof path, "%s/a.psf", folder);
        FILE *file = fopen(path, "r+b");
        assert_non_null(file);
        do
            assert_int_equal(fread(card, 1, 80, file), 80);
        while (strncmp(card, bad[k][0], strlen(bad[k][0])) != 0);
        fseek(file, -80, SEEK_CUR);
        fprintf(file, "%-8s= %20s%50s", bad[k][0], bad[k][1], "");
        assert_int_equal(fclose(file), 0);
        snprintf(said, sizeof said, "a.psf: left out of PSF_LIBRARY: %s = %s is not in ", bad[k][0],
                 bad[k][1]);
        assert_null(find_aloud("", "", text, sizeof text));
        if (strstr(text, said) == NULL)
            fail_msg("'%s' does not say '%s'", text, said);
        unlink(path);
    }
}

/* The error of fluxes: what two Moffats differ by in a fit, and the model's own. */
static void test_error(void **state)
{
    (void)state;
    rx_error err = {0};
    add_model("a.psf", 3.0, 100.0, 10.0, "cam 7", 200, 0);
    rx_psf *psf = find(100.0, 10.0, 1.0, 2.0), *a = NULL, *b = NULL;
    assert_near(psf->quality.flux_error, hypot(0.004, 0.1), 1e-6); /* no neighbour: assumed */
    assert_near(psf->fwhm_error, 0.3, 0.0015);
    rx_psf_free(psf);
    add_model("b.psf", 3.3, 100.0, 10.5, "cam 7", 200, 0);
    psf = find(100.0, 10.0, 1.0, 2.0);
    assert_int_equal(rx_psf_moffat(3.0, 3.5, 1.0, 0.0, 41, &a, &err), RX_OK);
    assert_int_equal(rx_psf_moffat(3.3, 3.5, 1.0, 0.0, 41, &b, &err), RX_OK);
    double ab = 0.0, aa = 0.0;
    for (int i = 0; i < 41 * 41; i++) {
        ab += (double)a->basis[i] * (double)b->basis[i];
        aa += (double)a->basis[i] * (double)a->basis[i];
    }
    assert_near(psf->quality.flux_error, hypot(0.004, ab / aa - 1.0), 1e-4);
    assert_true(ab / aa < 0.95);
    assert_near(psf->fwhm_error, 0.3, 0.0015);
    rx_psf_free(psf);
    rx_psf_free(a);
    rx_psf_free(b);
}

/* A tile smaller than the model takes what fits into it. */
static void test_small_tile(void **state)
{
    (void)state;
    rx_error err = {0};
    rx_psf *psf = NULL;
    const rx_psf_library library = {.folder = folder, .days = 1.0, .degrees = 1.0};
    const rx_psf_origin tile = {
        .ccd = "cam 7", .mjd = 100.0, .alpha = 10.0, .delta = 0.0, .width = 30, .height = 64};
    add_model("a.psf", 3.0, 100.0, 10.0, "cam 7", 200, 0);
    assert_int_equal(rx_psf_library_find(&library, &tile, NULL, NULL, &psf, &err), RX_OK);
    assert_int_equal(psf->size, 29);
    assert_near(psf->quality.radius, 14.0, 1e-12);
    rx_psf_free(psf);
}

static void test_refused(void **state)
{
    (void)state;
    rx_error err = {0};
    rx_psf *psf = NULL;
    char path[256];
    const rx_psf_library library = {.folder = "/nonexistent", .days = 1.0, .degrees = 1.0};
    const rx_psf_origin tile = {.mjd = 100.0, .alpha = NAN, .delta = NAN, .width = 200, .height = 300};
    assert_int_equal(rx_psf_library_find(&library, &tile, NULL, NULL, &psf, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "PSF_LIBRARY"));
    /* files that are no PSFs are left out */
    snprintf(path, sizeof path, "%s/bad.psf", folder);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs("no FITS", file);
    fclose(file);
    assert_null(find(100.0, 10.0, 1.0, 1.0));
}

static void test_takes(void **state)
{
    (void)state;
    rx_psf psf = {.nstars = 20, .quality = {.how = "PIXELS", .trace = {0.02, 0.005}}};
    assert_int_equal(rx_psf_library_takes(&psf), 1);
    psf.nstars = 19;
    assert_int_equal(rx_psf_library_takes(&psf), 0);
    psf.nstars = 20;
    psf.quality.trace[1] = 0.003;
    assert_int_equal(rx_psf_library_takes(&psf), 0);
    psf.quality.trace[0] = 0.0;
    psf.quality.growth = -0.011;
    assert_int_equal(rx_psf_library_takes(&psf), 0);
    psf.quality.growth = 0.0;
    psf.quality.beyond = 0.011;
    assert_int_equal(rx_psf_library_takes(&psf), 0);
    psf.quality.beyond = 0.0;
    strcpy(psf.quality.how, "MOFFAT");
    assert_int_equal(rx_psf_library_takes(&psf), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_origin),
        cmocka_unit_test_setup_teardown(test_nearest, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_not_stated, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_hostile_cards, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_error, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_small_tile, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_refused, enter_scratch, leave_scratch),
        cmocka_unit_test(test_takes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
