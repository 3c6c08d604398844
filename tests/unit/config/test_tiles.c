/* Lists of tiles. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "../near.h"
#include "../scratch.h"
#include "config/config_fields.h"
#include "config/tiles.h"

static rx_settings *defaults(void)
{
    rx_settings *settings = NULL;
    assert_int_equal(rx_settings_new(rx_keytable_rextract(), &settings, NULL), RX_OK);
    return settings;
}

static void each_line_is_a_tile(void **state)
{
    rx_tiles *tiles = NULL;
    const char *path =
        put(state, "tiles.list",
            "# a night\n\n"
            "n1/a.fits.fz[1]  -DETECT_THRESH 3 # faint\n"
            "\t\"n 1/b c.fits\",d.fits -CATALOG_NAME \"{tile} of {tile}.cat\" -PHOT_APERTURES 3,5\r\n"
            "last.fits");
    assert_int_equal(rx_tiles_read(path, &tiles, NULL), RX_OK);
    assert_int_equal(tiles->n, 3);
    assert_int_equal(tiles->tile[1].line, 4);
    assert_string_equal(rx_tiles_image(tiles, 0), "n1/a.fits.fz[1]");
    assert_string_equal(rx_tiles_image(tiles, 1), "n 1/b c.fits,d.fits");
    assert_string_equal(tiles->tile[1].name, "b c");
    rx_settings *common = defaults(), *own = NULL;
    assert_int_equal(rx_settings_set(common, "CHECKIMAGE_NAME", "{tile}_r.fits,x", NULL, NULL), RX_OK);
    assert_int_equal(rx_tiles_settings(tiles, 0, common, NULL, &own, NULL), RX_OK);
    assert_near(((rx_config *)own)->detect_thresh.v[0], 3, 0);
    assert_string_equal(((rx_config *)own)->catalog_name, "test.cat");
    assert_string_equal(((rx_config *)own)->checkimage_name.v[0], "a_r.fits");
    rx_settings_free(own);
    assert_int_equal(rx_tiles_settings(tiles, 1, common, NULL, &own, NULL), RX_OK);
    assert_near(((rx_config *)own)->detect_thresh.v[0], 1.5, 0);
    assert_string_equal(((rx_config *)own)->catalog_name, "b c of b c.cat");
    assert_int_equal(((rx_config *)own)->phot_apertures.n, 2);
    rx_settings_free(own);
    rx_settings_free(common);
    rx_tiles_free(tiles);
}

/* The list is refused with these words and this line, by reading or by the check. */
static void check_refused(void **state, const char *text, const char *words, long line)
{
    rx_tiles *tiles = NULL;
    rx_error err = RX_ERROR_NONE;
    rx_settings *common = defaults();
    const char *path = put(state, "bad.list", text);
    rx_status status = rx_tiles_read(path, &tiles, &err);
    if (status == RX_OK)
        status = rx_tiles_check(tiles, common, NULL, NULL, &err);
    assert_int_equal(status, RX_USAGE);
    assert_non_null(strstr(err.text, words));
    assert_string_equal(err.where, path);
    assert_int_equal(err.line, line);
    rx_settings_free(common);
    rx_tiles_free(tiles);
}

static void wrong_lines_are_named(void **state)
{
    check_refused(state, "a.fits\nb.fits -DETECT_TRESH 3\n", "did you mean -DETECT_THRESH?", 2);
    check_refused(state, "a.fits -DETECT_THRESH\n", "has no value", 1);
    check_refused(state, "a.fits b.fits\n", "'b.fits' is no option", 1);
    check_refused(state, "a.fits\n-c x.sex\n", "'-c' names no file", 2);
    check_refused(state, "\n\nn/..fits.gz\n", "names no file", 3);
    check_refused(state, "...fits\n", "names no file", 1);
    check_refused(state, "\"a.fits\n", "a quote is not closed", 1);
    check_refused(state, "a.fits -DETECT_THRESH $NOT_THERE_AT_ALL\n", "is not set", 1);
}

static void files_of_tiles_are_kept_apart(void **state)
{
    check_refused(state, "a.fits\nb.fits\n", "would write test.cat, as would line 1", 2);
    check_refused(state, "a.fits -CATALOG_NAME {tile}.cat\nn/a.fits -CATALOG_NAME {tile}.cat\n",
                  "would write a.cat, as would line 1", 2);
    check_refused(state, "a.fits -CATALOG_NAME b.fits\nb.fits -CATALOG_NAME {tile}.cat\n",
                  "would write b.fits, the tile of line 2", 1);
    check_refused(state, "a.fits -CATALOG_NAME STDOUT\nb.fits -CATALOG_NAME STDOUT\n", "would write STDOUT",
                  2);
    check_refused(
        state, "a.fits -CATALOG_TYPE NONE -REFERENCE_NAME r\nb.fits -CATALOG_TYPE NONE -REFERENCE_NAME r\n",
        "would write rextract_qa", 2);
    check_refused(state, "a.fits -CATALOG_NAME c.cat\nb.fits -CATALOG_NAME ./c.cat\n",
                  "would write ./c.cat, as would line 1", 2);
    check_refused(state, "a.fits -RESTORE_TYPE NONE,RL -CATALOG_NAME c.cat\nb.fits -CATALOG_NAME c_RL.cat\n",
                  "would write c_RL.cat, as would line 1", 2);
    check_refused(state,
                  "a.fits -CATALOG_NAME 1\nb.fits[1],c.fits[2] -CATALOG_NAME 2\nd.fits -CATALOG_NAME c.fits",
                  "would write c.fits, the tile of line 2", 3);
    check_refused(state, "a.fits -CATALOG_NAME 1 -FLAG_IMAGE f.fits\nb.fits -CATALOG_NAME f.fits",
                  "would write f.fits, which is read by line 1", 2);
}

static void the_same_tile_may_be_read_twice(void **state)
{
    rx_tiles *tiles = NULL;
    rx_settings *common = defaults();
    const char *path =
        put(state, "good.list", "a.fits -CATALOG_NAME 1.cat\na.fits -CATALOG_NAME 2.cat -SELF_CHECK Y\n");
    assert_int_equal(rx_tiles_read(path, &tiles, NULL), RX_OK);
    assert_int_equal(rx_tiles_check(tiles, common, NULL, NULL, NULL), RX_OK);
    rx_settings_free(common);
    rx_tiles_free(tiles);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_line_is_a_tile),
        cmocka_unit_test(wrong_lines_are_named),
        cmocka_unit_test(files_of_tiles_are_kept_apart),
        cmocka_unit_test(the_same_tile_may_be_read_twice),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
