/* Reference catalogues: which columns are taken, pixel counting, magnitudes and fluxes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "base/text.h"
#include "io/wcs.h"
#include "stage/reference.h"

static rx_table *table_of(int ncolumns, const char *const *names, long nrows, const double *rows)
{
    rx_table *table = rx_table_new(ncolumns);
    assert_non_null(table);
    table->nrows = nrows;
    for (int c = 0; c < ncolumns; c++) {
        rx_column *column = &table->columns[c];
        strcpy(column->name, names[c]);
        column->type = RX_CELL_DOUBLE;
        double *data = RX_NEW(double, (size_t)nrows);
        assert_non_null(data);
        for (long r = 0; r < nrows; r++)
            data[r] = rows[r * ncolumns + c];
        column->data = data;
    }
    return table;
}

static rx_tile plain_tile(void)
{
    return (rx_tile){.name = (char *)"tile.fits", .width = 100, .height = 80, .zeropoint = 25.0};
}

static void known_names_are_found_and_counted_from_zero(void **state)
{
    const double rows[] = {11.0, 21.0, 20.0, 0.02, 5.0, 900.0, 21.0, 0.1, 7.0, 8.0, 99.0, 99.0};
    rx_table *table =
        table_of(4, (const char *const[]){"X_IMAGE", "Y_IMAGE", "MAG_AUTO", "MAGERR_AUTO"}, 3, rows);
    rx_reference_params par = {.name = "ref", .flux_zeropoint = NAN};
    rx_tile tile = plain_tile();
    rx_qa_list list;
    rx_reference_note note = {0};
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, &note, NULL), RX_OK);
    /* the second row is outside, the third is there but has no magnitude */
    assert_int_equal(list.n, 2);
    assert_true(isnan(list.mag[1]));
    assert_near(list.x[0], 10.0, 1e-12);
    assert_near(list.y[0], 20.0, 1e-12);
    assert_near(list.mag[0], 20.0, 1e-12);
    assert_near(list.flux[0], 100.0, 1e-9);
    assert_near(list.flux_error[0], 100.0 * 0.02 / 1.0857362, 1e-6);
    rx_qa_list_free(&list);
    rx_text_free(&note.shown);
    rx_table_free(table);
}

static void fluxes_become_magnitudes(void **state)
{
    const double rows[] = {11.0, 21.0, 100.0};
    rx_table *table = table_of(3, (const char *const[]){"px", "py", "r_psfFlux"}, 1, rows);
    const char *const columns[] = {"px", "py", "r_psfFlux"};
    rx_reference_params par = {.name = "ref", .ncolumns = 3, .columns = columns, .flux_zeropoint = 22.5};
    rx_tile tile = plain_tile();
    rx_qa_list list;
    rx_reference_note note = {0};
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, &note, NULL), RX_OK);
    assert_near(list.mag[0], 17.5, 1e-9);
    assert_near(list.flux[0], 1000.0, 1e-6);
    rx_qa_list_free(&list);
    rx_text_free(&note.shown);
    rx_table_free(table);
}

static void expect_error(rx_reference_params par, const char *const *names, rx_status expected,
                         const char *text)
{
    const double rows[] = {1.0, 2.0, 20.0};
    rx_table *table = table_of(3, names, 1, rows);
    rx_tile tile = plain_tile();
    rx_qa_list list;
    rx_reference_note note = {0};
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, &note, &err), expected);
    assert_non_null(strstr(err.text, text));
    rx_table_free(table);
}

static void what_is_missing_is_named(void **state)
{
    const char *const columns[] = {"X_IMAGE", "Y_IMAGE", "MAGNITUDE"};
    rx_reference_params named = {.name = "ref", .ncolumns = 3, .columns = columns};
    const char *const degrees[] = {"RA", "DEC", "MAG"};
    rx_reference_params plain = {.name = "ref"}, sky = {.name = "ref", .ncolumns = 3, .columns = degrees};
    expect_error(named, (const char *const[]){"X_IMAGE", "Y_IMAGE", "MAG"}, RX_INPUT, "'MAGNITUDE'");
    expect_error(plain, (const char *const[]){"a", "b", "MAG"}, RX_INPUT, "position");
    expect_error(plain, (const char *const[]){"X_IMAGE", "Y_IMAGE", "c"}, RX_INPUT, "magnitude");
    expect_error(sky, (const char *const[]){"RA", "DEC", "MAG"}, RX_INPUT, "no celestial coordinates");
}

/* A tile of 100 x 80 pixels of 1 arcminute around a place, with a date or without, of a filter or of none. */
static rx_tile sky_tile(double ra, double dec, const char *more, rx_text *cards)
{
    rx_tile tile = plain_tile();
    rx_text_printf(cards, "%-80s%-80s", "CTYPE1  = 'RA---TAN'", "CTYPE2  = 'DEC--TAN'");
    const struct {
        const char *key;
        double value;
    } numbers[] = {{"CRPIX1", 50},  {"CRPIX2", 40},       {"CRVAL1", ra},
                   {"CRVAL2", dec}, {"CDELT1", -1 / 60.}, {"CDELT2", 1 / 60.}};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        rx_text_printf(cards, "%-8s= %20.12f%50s", numbers[i].key, numbers[i].value, "");
    for (; *more != '\0'; more += strlen(more) + 1)
        rx_text_printf(cards, "%-80s", more);
    tile.cards = cards->data;
    tile.ncards = cards->length / 80;
    assert_int_equal(rx_wcs_from_cards(tile.cards, tile.ncards, 100, 80, &tile.wcs, NULL, NULL), RX_OK);
    assert_non_null(tile.wcs);
    return tile;
}

/* Where astropy's SkyCoord.apply_space_motion() takes them from 2016.0 to MJD 60311.25, of a star at 1 pc. */
static void gaia_moves_to_the_epoch_of_the_tile(void **state)
{
    static const double rows[][8] = {{30.0, 85.0, 10000.0, -5000.0, 2016.0, 15.0, 100.0, 14.5},
                                     {0.001, -30.0, -3000.0, 800.0, 2016.0, 15.0, 100.0, 14.5}};
    static const double there[][2] = {{30.2544709694, 84.9888368648}, {359.9933001587, -29.9982215419}};
    const char *const names[] = {"ra",
                                 "dec",
                                 "pmra",
                                 "pmdec",
                                 "ref_epoch",
                                 "phot_g_mean_mag",
                                 "phot_g_mean_flux_over_error",
                                 "phot_rp_mean_mag"};
    const rx_reference_params par = {.name = "gaia", .flux_zeropoint = NAN};
    for (int i = 0; i < 4; i++) { /* the second pair: a tile without a date */
        const int k = i % 2, dated = i < 2;
        rx_text cards = {0};
        rx_tile tile =
            sky_tile(rows[k][0], rows[k][1], dated ? "DATE-OBS= '2024-01-02T06:00:00'\0" : "\0", &cards);
        rx_table *table = table_of(8, names, 1, rows[k]);
        rx_qa_list list;
        rx_reference_note note = {0};
        assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, &note, NULL), RX_OK);
        assert_int_equal(list.n, 1);
        assert_int_equal(note.moved, dated);
        assert_near(list.alpha[0], dated ? there[k][0] : rows[k][0], 5e-9);
        assert_near(list.delta[0], dated ? there[k][1] : rows[k][1], 2e-10);
        assert_near(list.mag[0], 15.0, 1e-12);
        assert_near(list.mag_error[0], 0.010857362, 1e-9);
        assert_non_null(
            strstr(note.shown.data, dated ? "1 positions moved to 2024.002" : "no MJD-OBS or DATE-OBS"));
        rx_qa_list_free(&list);
        rx_text_free(&note.shown);
        rx_table_free(table);
        rx_wcs_free(tile.wcs);
        rx_text_free(&cards);
    }
}

static void count_warnings(void *user, rx_log_kind kind, const char *text)
{
    (void)text;
    *(int *)user += kind == RX_LOG_WARNING;
}

/* The band of the tile's filter, of REFERENCE_BAND, or the survey's first; colour terms; other names that are alike. */
static void surveys_are_known_by_their_columns(void **state)
{
    static const struct {
        const char *band, *filter, *names[6];
        double mag; /* NAN: refused */
    } cases[] = {
        {"",
         "FILTER  = 'i DECam SDSS c0003'",
         {"RA", "DEC", "MAG_AUTO_R", "MAG_AUTO_I", "MAGERR_AUTO_R", "MAGERR_AUTO_I"},
         20.5},
        {"", "", {"RA", "DEC", "MAG_AUTO_R", "MAG_AUTO_I", "MAGERR_AUTO_R", "MAGERR_AUTO_I"}, 20.0},
        {"g",
         "FILTER  = 'r'",
         {"raMean", "decMean", "rMeanPSFMag", "gMeanPSFMag", "rMeanPSFMagErr", "gMeanPSFMagErr"},
         20.5},
        {"", "FILTER  = 'g'", {"ra", "dec", "psfMag_r", "psfMag_g", "psfMagErr_r", "psfMagErr_g"}, 20.5},
        {"", "FILTER  = 'r'", {"RA_ICRS", "DE_ICRS", "umag", "rmag", "e_umag", "e_rmag"}, 20.5},
        {"", "FILTER  = 'N662'", {"RA_ICRS", "DE_ICRS", "rmag", "umag", "e_rmag", "e_umag"}, 20.0},
        {"BP", "", {"RA_ICRS", "DE_ICRS", "Gmag", "BPmag", "e_Gmag", "e_BPmag"}, 20.5},
        {"", "FILTER  = 'i'", {"RAJ2000", "DEJ2000", "ymag", "imag", "e_ymag", "e_imag"}, 20.5},
        {"K", "", {"ra", "dec", "psfMag_r", "psfMag_g", "psfMagErr_r", "psfMagErr_g"}, NAN},
    };
    const double row[] = {150.0, 2.0, 20.0, 20.5, 0.01, 0.02};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const rx_reference_params par = {.name = "ref", .band = cases[i].band, .flux_zeropoint = NAN};
        char filter[80] = "";
        snprintf(filter, sizeof filter - 1, "%s", cases[i].filter);
        rx_text cards = {0};
        rx_tile tile = sky_tile(150.0, 2.0, filter, &cards);
        rx_table *table = table_of(6, cases[i].names, 1, row);
        rx_qa_list list = {0};
        rx_reference_note note = {0};
        int warnings = 0;
        rx_log log;
        rx_log_calls(&log, RX_NORMAL, count_warnings, NULL, &warnings);
        const rx_status status = rx_reference_list(&par, table, &tile, &log, &list, &note, NULL);
        assert_int_equal(status, isnan(cases[i].mag) ? RX_INPUT : RX_OK);
        if (status == RX_OK) {
            assert_int_equal(warnings, strstr(cases[i].filter, "N662") != NULL);
            assert_near(list.mag[0], cases[i].mag, 1e-12);
            assert_near(list.mag_error[0], cases[i].mag < 20.3 ? 0.01 : 0.02, 1e-12);
            assert_near(list.x[0], 49.0, 1e-6);
        }
        rx_qa_list_free(&list);
        rx_text_free(&note.shown);
        rx_table_free(table);
        rx_wcs_free(tile.wcs);
        rx_text_free(&cards);
    }
}

static void colours_shift_magnitudes(void **state)
{
    const double rows[] = {150.0, 2.0, 20.0, 20.5, 0.01, 0.02, 150.01, 2.01, 19.0, -999.0, 0.01, -999.0};
    const char *const names[] = {"raMean",      "decMean",        "rMeanPSFMag",
                                 "gMeanPSFMag", "rMeanPSFMagErr", "gMeanPSFMagErr"};
    const char *const term[] = {"0.2", "g", "rMeanPSFMag"}, *const absent[] = {"0.2", "g", "i"};
    rx_reference_params par = {
        .name = "ref", .flux_zeropoint = NAN, .ncolour = 3, .colour = term, .colour_term = 0.2};
    rx_text cards = {0};
    rx_tile tile = sky_tile(150.0, 2.0, "\0", &cards);
    rx_table *table = table_of(6, names, 2, rows);
    rx_qa_list list;
    rx_reference_note note = {0};
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, &note, NULL), RX_OK);
    assert_near(list.mag[0], 20.1, 1e-12);
    assert_true(isnan(list.mag[1])); /* without a colour it does not count */
    rx_qa_list_free(&list);
    rx_text_free(&note.shown);
    par.colour = absent;
    assert_int_equal(rx_reference_check(&par, table, &tile, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "'i'"));
    rx_table_free(table);
    rx_wcs_free(tile.wcs);
    rx_text_free(&cards);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_names_are_found_and_counted_from_zero),
        cmocka_unit_test(fluxes_become_magnitudes),
        cmocka_unit_test(what_is_missing_is_named),
        cmocka_unit_test(gaia_moves_to_the_epoch_of_the_tile),
        cmocka_unit_test(surveys_are_known_by_their_columns),
        cmocka_unit_test(colours_shift_magnitudes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
