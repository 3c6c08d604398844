/* The truth catalogue: what a scene has, in the columns' units. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/text.h"
#include "simulate/truth.h"

static rx_template names[1] = {
    {.name = "spiral.fits[0]", .width = 5, .height = 5, .ratio = 0.8, .radius = 2.0}};
static const rx_templates templates = {1, names};

/* A star, a galaxy with bulge and disk, a spheroid, a template, and one that lies outside. */
static rx_scene *make_scene(void)
{
    rx_scene *scene = NULL;
    assert_int_equal(rx_scene_new(100, 80, 5, &scene, NULL), RX_OK);
    scene->templates = &templates;
    rx_object *o = scene->objects;
    o[0] = (rx_object){.type = RX_OBJECT_STAR, .x = 10.25, .y = 20.5, .flux = 100.0, .mag = 20.0};
    o[1] = (rx_object){
        .type = RX_OBJECT_GALAXY, .x = -0.4, .y = 79.4, .flux = 50.0, .mag = 20.75, .radius = 3.5};
    o[1].ratio = 0.5;
    o[1].angle = 2.0;
    o[1].bulge_share = 0.3;
    o[1].bulge_n = 2.5;
    o[1].bulge_ratio = 0.75;
    o[1].disk_radius = 4.0;
    o[2] =
        (rx_object){.type = RX_OBJECT_GALAXY, .x = -20.0, .y = 5.0, .flux = 7.0, .mag = 22.9, .radius = 1.0};
    o[2].ratio = 1.0;
    o[2].disk_radius = 1.0;
    o[3] =
        (rx_object){.type = RX_OBJECT_GALAXY, .x = 30.0, .y = 40.0, .flux = 9.0, .mag = 22.6, .radius = 2.0};
    o[3].bulge_share = 1.0;
    o[3].bulge_n = 4.0;
    o[3].bulge_ratio = 0.8;
    o[3].ratio = 0.3;
    o[3].angle = -0.5;
    o[4] =
        (rx_object){.type = RX_OBJECT_TEMPLATE, .x = 99.0, .y = 0.0, .flux = 3.0, .mag = 23.8, .radius = 5.0};
    o[4].ratio = 0.8;
    o[4].angle = -3.0;
    return scene;
}

static double value(const rx_table *table, const char *name, long row)
{
    int i = rx_table_find(table, name);
    assert_true(i >= 0);
    return rx_column_value(&table->columns[i], row, 0);
}

static const char *text(const rx_table *table, const char *name, long row)
{
    int i = rx_table_find(table, name);
    assert_true(i >= 0);
    assert_true(table->columns[i].type == RX_CELL_TEXT);
    return (const char *)table->columns[i].data + row * table->columns[i].text_width;
}

static void test_columns(void **state)
{
    rx_scene *scene = make_scene();
    rx_table *table = NULL;
    assert_int_equal(rx_truth_table(scene, NULL, 0, &table, NULL), RX_OK);
    assert_int_equal(table->nrows, 4);
    assert_int_equal(rx_table_find(table, "ALPHA_J2000"), -1);
    const double want[4][10] = {/* number, x, y, flux, mag, radius, elongation, theta, bulge, n */
                                {1, 11.25, 21.5, 100, 20.0, 0, 1, 0, 0, 0},
                                {2, 0.6, 80.4, 50, 20.75, 3.5, 2, 114.5916 - 180.0, 0.3, 2.5},
                                {4, 31, 41, 9, 22.6, 2, 1.25, -28.6479, 1, 4},
                                {5, 100, 1, 3, 23.8, 5, 1.25, 180.0 - 171.8873, 0, 0}};
    const char *const columns[10] = {"NUMBER",      "X_IMAGE",    "Y_IMAGE",     "FLUX",        "MAG",
                                     "FLUX_RADIUS", "ELONGATION", "THETA_IMAGE", "BULGE_SHARE", "SERSIC_N"};
    for (int row = 0; row < 4; row++)
        for (int k = 0; k < 10; k++)
            assert_true(fabs(value(table, columns[k], row) - want[row][k]) < 1e-4);
    assert_string_equal(text(table, "TYPE", 0), "STAR");
    assert_string_equal(text(table, "TYPE", 1), "GALAXY");
    assert_string_equal(text(table, "TYPE", 3), "TEMPLATE");
    assert_string_equal(text(table, "TEMPLATE", 3), "spiral.fits[0]");
    assert_string_equal(text(table, "TEMPLATE", 1), "");
    rx_table_free(table);
    assert_int_equal(rx_truth_table(scene, NULL, 1, &table, NULL), RX_OK);
    assert_int_equal(table->nrows, 5);
    assert_true(value(table, "X_IMAGE", 2) == -19.0);
    assert_true(value(table, "SERSIC_N", 2) == 1.0);
    rx_table_free(table);
    scene->n = 0;
    assert_int_equal(rx_truth_table(scene, NULL, 1, &table, NULL), RX_OK);
    assert_int_equal(table->nrows, 0);
    rx_table_free(table);
    scene->n = 5;
    rx_scene_free(scene);
}

/* astropy.wcs of the same cards, all_pix2world(x, y, 0). */
static void test_sky(void **state)
{
    const char *const lines[] = {"CTYPE1  = 'RA---TAN'", "CTYPE2  = 'DEC--TAN'", "CRVAL1  = 150.0",
                                 "CRVAL2  = 2.2",        "CRPIX1  = 50.5",       "CRPIX2  = 40.5",
                                 "CD1_1   = -1.1E-4",    "CD1_2   = 0.0",        "CD2_1   = 0.0",
                                 "CD2_2   = 1.1E-4",     "CUNIT1  = 'deg'",      "CUNIT2  = 'deg'"};
    const double want[4][2] = {{150.0043206786, 2.1979099938},
                               {150.0054930650, 2.2043889899},
                               {150.0021465823, 2.2000549985},
                               {149.9945509995, 2.1956549901}};
    rx_text cards = {0};
    rx_wcs *wcs = NULL;
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        rx_text_printf(&cards, "%-80s", lines[i]);
    assert_int_equal(rx_wcs_from_cards(cards.data, cards.length / 80, 100, 80, &wcs, NULL, NULL), RX_OK);
    assert_non_null(wcs);
    rx_scene *scene = make_scene();
    rx_table *table = NULL;
    assert_int_equal(rx_truth_table(scene, wcs, 0, &table, NULL), RX_OK);
    assert_int_equal(table->ncolumns, 14);
    for (int row = 0; row < 4; row++) {
        assert_true(fabs(value(table, "ALPHA_J2000", row) - want[row][0]) < 1e-8);
        assert_true(fabs(value(table, "DELTA_J2000", row) - want[row][1]) < 1e-8);
    }
    rx_table_free(table);
    rx_scene_free(scene);
    rx_wcs_free(wcs);
    rx_text_free(&cards);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_columns), cmocka_unit_test(test_sky)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
