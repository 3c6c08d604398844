/* Tables in memory: element counts, look-up by name, values of every type. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "base/memory.h"
#include "data/table.h"

static void cells_have_their_elements(void **state)
{
    rx_column scalar = {.type = RX_CELL_FLOAT};
    rx_column vector = {.type = RX_CELL_DOUBLE, .ndim = 1, .dim = {5, 9}};
    rx_column image = {.type = RX_CELL_INT16, .ndim = 2, .dim = {35, 21}};
    rx_column text = {.type = RX_CELL_TEXT, .text_width = 12};
    assert_int_equal(rx_column_elements(&scalar), 1);
    assert_int_equal(rx_column_elements(&vector), 5);
    assert_int_equal(rx_column_elements(&image), 35 * 21);
    assert_int_equal(rx_column_element_size(&scalar), sizeof(float));
    assert_int_equal(rx_column_element_size(&vector), sizeof(double));
    assert_int_equal(rx_column_element_size(&image), sizeof(int16_t));
    assert_int_equal(rx_column_element_size(&text), 12);
}

static void names_are_found_whatever_their_case(void **state)
{
    rx_table *table = rx_table_new(3);
    assert_non_null(table);
    assert_int_equal(table->ncolumns, 3);
    assert_int_equal(table->nrows, 0);
    assert_string_equal(table->name, "");
    static const char *const names[] = {"X_IMAGE", "Y_IMAGE", "MAG"};
    for (int i = 0; i < 3; i++)
        snprintf(table->columns[i].name, sizeof table->columns[i].name, "%s", names[i]);
    assert_int_equal(rx_table_find(table, "Y_IMAGE"), 1);
    assert_int_equal(rx_table_find(table, "mag"), 2);
    assert_int_equal(rx_table_find(table, "MAG_AUTO"), -1);
    assert_int_equal(rx_table_find(table, ""), -1);
    rx_table_free(table);
    rx_table_free(NULL);
}

/* Element 1 of row 2 in a column of two elements, for every numeric type. */
static void values_come_as_doubles(void **state)
{
    int16_t i16[] = {0, 0, 0, 0, 0, -7};
    int32_t i32[] = {0, 0, 0, 0, 0, -70000};
    int64_t i64[] = {0, 0, 0, 0, 0, -7000000000};
    float f32[] = {0, 0, 0, 0, 0, 0.5f};
    double f64[] = {0, 0, 0, 0, 0, 1e300};
    char text[] = "abcdef";
    const struct {
        rx_cell_type type;
        void *data;
        double want;
    } cases[] = {{RX_CELL_INT16, i16, -7},
                 {RX_CELL_INT32, i32, -70000},
                 {RX_CELL_INT64, i64, -7e9},
                 {RX_CELL_FLOAT, f32, 0.5},
                 {RX_CELL_DOUBLE, f64, 1e300}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rx_column column = {.type = cases[i].type, .ndim = 1, .dim = {2}, .data = cases[i].data};
        assert_true(rx_column_value(&column, 2, 1) == cases[i].want);
        assert_true(rx_column_value(&column, 2, 0) == 0.0);
    }
    rx_column words = {.type = RX_CELL_TEXT, .text_width = 2, .data = text};
    assert_true(isnan(rx_column_value(&words, 0, 0)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_have_their_elements),
        cmocka_unit_test(names_are_found_whatever_their_case),
        cmocka_unit_test(values_come_as_doubles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
