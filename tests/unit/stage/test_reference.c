/* Reference catalogues: which columns are taken, pixel counting, magnitudes and fluxes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
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
    (void)state;
    const double rows[] = {11.0, 21.0, 20.0, 0.02, 5.0, 900.0, 21.0, 0.1, 7.0, 8.0, 99.0, 99.0};
    rx_table *table =
        table_of(4, (const char *const[]){"X_IMAGE", "Y_IMAGE", "MAG_AUTO", "MAGERR_AUTO"}, 3, rows);
    rx_reference_params par = {.name = "ref", .coords = "AUTO", .photometry = "AUTO", .flux_zeropoint = NAN};
    rx_tile tile = plain_tile();
    rx_qa_list list;
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, NULL), RX_OK);
    /* the second row is outside, the third is there but has no magnitude */
    assert_int_equal(list.n, 2);
    assert_true(isnan(list.mag[1]));
    assert_near(list.x[0], 10.0, 1e-12);
    assert_near(list.y[0], 20.0, 1e-12);
    assert_near(list.mag[0], 20.0, 1e-12);
    assert_near(list.flux[0], 100.0, 1e-9);
    assert_near(list.flux_error[0], 100.0 * 0.02 / 1.0857362, 1e-6);
    rx_qa_list_free(&list);
    rx_table_free(table);
}

static void fluxes_become_magnitudes(void **state)
{
    (void)state;
    const double rows[] = {11.0, 21.0, 100.0};
    rx_table *table = table_of(3, (const char *const[]){"px", "py", "FLUX"}, 1, rows);
    const char *const columns[] = {"px", "py", "FLUX"};
    rx_reference_params par = {.name = "ref",
                               .coords = "PIXEL",
                               .photometry = "AUTO",
                               .ncolumns = 3,
                               .columns = columns,
                               .flux_zeropoint = 22.5};
    rx_tile tile = plain_tile();
    rx_qa_list list;
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, NULL), RX_OK);
    assert_near(list.mag[0], 17.5, 1e-9);
    assert_near(list.flux[0], 1000.0, 1e-6);
    rx_qa_list_free(&list);
    rx_table_free(table);
}

static void expect_error(rx_reference_params par, const char *const *names, rx_status expected,
                         const char *text)
{
    const double rows[] = {1.0, 2.0, 20.0};
    rx_table *table = table_of(3, names, 1, rows);
    rx_tile tile = plain_tile();
    rx_qa_list list;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_reference_list(&par, table, &tile, NULL, &list, &err), expected);
    assert_non_null(strstr(err.text, text));
    rx_table_free(table);
}

static void what_is_missing_is_named(void **state)
{
    (void)state;
    const char *const columns[] = {"X_IMAGE", "Y_IMAGE", "MAGNITUDE"};
    rx_reference_params named = {
        .name = "ref", .coords = "AUTO", .photometry = "AUTO", .ncolumns = 3, .columns = columns};
    rx_reference_params plain = {.name = "ref", .coords = "AUTO", .photometry = "AUTO"};
    rx_reference_params sky = {.name = "ref", .coords = "SKY", .photometry = "AUTO"};
    expect_error(named, (const char *const[]){"X_IMAGE", "Y_IMAGE", "MAG"}, RX_INPUT, "'MAGNITUDE'");
    expect_error(plain, (const char *const[]){"a", "b", "MAG"}, RX_INPUT, "position");
    expect_error(plain, (const char *const[]){"X_IMAGE", "Y_IMAGE", "c"}, RX_INPUT, "magnitude");
    expect_error(sky, (const char *const[]){"RA", "DEC", "MAG"}, RX_INPUT, "no celestial coordinates");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_names_are_found_and_counted_from_zero),
        cmocka_unit_test(fluxes_become_magnitudes),
        cmocka_unit_test(what_is_missing_is_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
