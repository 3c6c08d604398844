/* The command line, and lists of tiles. */
#include "../near.h"
#include "../scratch.h"
#include "config/arguments.h"
#include "config/config_fields.h"
#include "config/tiles.h"

enum { MAX_WORDS = 16 };

/* Read a command line written with blanks between its words, in the test's folder; its first word names the
 * program. */
static rx_status read_line(void **state, const char *line, rx_arguments *dst, rx_log *log, rx_error *err)
{
    const rx_keytable *table = strncmp(line, "rextract-s", 10) == 0   ? rx_keytable_simulate()
                               : strncmp(line, "rextract-v", 10) == 0 ? rx_keytable_validate()
                               : strncmp(line, "rextract-t", 10) == 0 ? rx_keytable_train()
                                                                      : rx_keytable_rextract();
    char text[512], *argv[MAX_WORDS] = {0}, *rest = NULL;
    int argc = 0;
    snprintf(text, sizeof text, "%s", line);
    for (char *w = strtok_r(text, " ", &rest); w != NULL; w = strtok_r(NULL, " ", &rest))
        argv[argc++] = w;
    *err = RX_ERROR_NONE;
    char *here = getcwd(NULL, 0);
    assert_non_null(here);
    assert_int_equal(chdir(*state), 0);
    rx_status status = rx_arguments_read(table, argc, argv, log, dst, err);
    assert_int_equal(chdir(here), 0);
    free(here);
    return status;
}

static const rx_config *config_of(const rx_arguments *arguments)
{
    return (const rx_config *)arguments->settings;
}

static rx_log quiet(FILE *stream)
{
    rx_log log;
    rx_log_init(&log, "t", stream, RX_QUIET);
    return log;
}

static void images_and_keywords_come_in_any_order(void **state)
{
    static const struct {
        const char *line, *image;
    } cases[] = {
        {"rextract a.fits -VERBOSE_TYPE QUIET -detect_minarea 9", "a.fits"},
        {"rextract -DETECT_MINAREA 3 -VERBOSE_TYPE QUIET -DETECT_MINAREA 9 a.fits,b.fits", "a.fits,b.fits"},
        {"rextract a.fits -DETECT_MINAREA 9 -VERBOSE_TYPE QUIET b.fits", "a.fits,b.fits"},
        {"rextract a.fits[2][1:5,2:6] -DETECT_MINAREA 9 -VERBOSE_TYPE QUIET", "a.fits[2][1:5,2:6]"},
        {"rextract a.fits[1:5,2:6],b.fits[1:5,2:6] -DETECT_MINAREA 9 -VERBOSE_TYPE QUIET",
         "a.fits[1:5,2:6],b.fits[1:5,2:6]"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_error err;
        rx_arguments arguments;
        rx_log log = quiet(stderr);
        if (read_line(state, cases[i].line, &arguments, &log, &err) != RX_OK)
            fail_msg("%s", err.text);
        assert_int_equal(arguments.action, RX_ACTION_RUN);
        assert_string_equal(arguments.image, cases[i].image);
        assert_int_equal(config_of(&arguments)->detect_minarea, 9);
        rx_arguments_free(&arguments);
    }
}

/* Defaults, then default.sex or the file of -c, then the command line. */
static void files_are_found_and_overridden(void **state)
{
    char said[256] = "";
    rx_error err;
    rx_arguments arguments;
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log log;
    rx_log_init(&log, "t", stream, RX_NORMAL);
    assert_int_equal(read_line(state, "rextract a.fits", &arguments, &log, &err), RX_OK);
    assert_int_equal(config_of(&arguments)->detect_minarea, 5);
    rx_arguments_free(&arguments);
    rewind(stream);
    assert_non_null(fgets(said, sizeof said, stream));
    assert_string_equal(said, "t: warning: default.sex not found, using internal defaults\n");
    fclose(stream);

    log = quiet(stderr);
    put(state, "default.sex", "DETECT_MINAREA 11\nSEED 2\n");
    put(state, "other.sex", "DETECT_MINAREA 12\nVERBOSE_TYPE FULL\n");
    assert_int_equal(read_line(state, "rextract a.fits -SEED 3", &arguments, &log, &err), RX_OK);
    assert_int_equal(config_of(&arguments)->detect_minarea, 11);
    assert_int_equal(config_of(&arguments)->seed, 3);
    assert_int_equal(log.level, RX_NORMAL);
    rx_arguments_free(&arguments);
    assert_int_equal(read_line(state, "rextract -SEED 3 -c other.sex a.fits", &arguments, &log, &err), RX_OK);
    assert_int_equal(config_of(&arguments)->detect_minarea, 12);
    assert_int_equal(config_of(&arguments)->seed, 3);
    assert_int_equal(log.level, RX_FULL);
    rx_arguments_free(&arguments);
}

static void campaign_files_are_named_either_way(void **state)
{
    static const char *const lines[] = {
        "rextract-validate -SEED 3 a.conf",
        "rextract-validate a.conf -SEED 3",
        "rextract-validate -c a.conf -SEED 3",
        "rextract-validate -c absent.conf -c a.conf -SEED 3",
    };
    put(state, "a.conf", "SEED 2\nSIM.SEED 5\nVERBOSE_TYPE QUIET\n");
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        rx_error err;
        rx_arguments arguments;
        rx_log log = quiet(stderr);
        if (read_line(state, lines[i], &arguments, &log, &err) != RX_OK)
            fail_msg("%s", err.text);
        const rx_campaign_config *config = (const rx_campaign_config *)arguments.settings;
        assert_null(arguments.image);
        assert_int_equal(config->seed, 3);
        assert_int_equal(config->sim->seed, 5);
        rx_arguments_free(&arguments);
    }
}

/* --- lists --- */

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
    assert_near(((rx_config *)own)->detect_thresh.v[0], 5.0, 0);
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

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_scratch, remove_scratch)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(images_and_keywords_come_in_any_order),
        IN_FOLDER(files_are_found_and_overridden),
        IN_FOLDER(campaign_files_are_named_either_way),
        IN_FOLDER(each_line_is_a_tile),
        IN_FOLDER(wrong_lines_are_named),
        IN_FOLDER(files_of_tiles_are_kept_apart),
        IN_FOLDER(the_same_tile_may_be_read_twice),
    };
    return cmocka_run_group_tests_name("arguments", tests, NULL, NULL);
}
