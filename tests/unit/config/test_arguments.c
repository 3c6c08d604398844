/* The command line. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "config/arguments.h"
#include "config/config_fields.h"
#include "folder.h"

enum { MAX_WORDS = 16 };

/* Read a command line written with blanks between its words, in the test's folder. */
static rx_status read_line(void **state, const char *line, rx_arguments *dst, rx_log *log, rx_error *err)
{
    char text[512], *argv[MAX_WORDS] = {0}, *rest = NULL;
    int argc = 0;
    snprintf(text, sizeof text, "%s", line);
    for (char *w = strtok_r(text, " ", &rest); w != NULL; w = strtok_r(NULL, " ", &rest))
        argv[argc++] = w;
    *err = RX_ERROR_NONE;
    char *here = getcwd(NULL, 0);
    assert_non_null(here);
    assert_int_equal(chdir(*state), 0);
    rx_status status = rx_arguments_read(rx_keytable_rextract(), argc, argv, log, dst, err);
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

static void actions_are_told_apart(void **state)
{
    static const struct {
        const char *line;
        rx_action action;
    } cases[] = {
        {"rextract", RX_ACTION_NONE},
        {"rextract -h", RX_ACTION_HELP},
        {"rextract --help", RX_ACTION_HELP},
        {"rextract -v", RX_ACTION_VERSION},
        {"rextract --version", RX_ACTION_VERSION},
        {"rextract -d", RX_ACTION_DUMP},
        {"rextract -dd", RX_ACTION_DUMP_ALL},
        {"rextract -dp", RX_ACTION_DUMP_COLUMNS},
        {"rextract a.fits -h", RX_ACTION_HELP},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_error err;
        rx_arguments arguments;
        rx_log log = quiet(stderr);
        assert_int_equal(read_line(state, cases[i].line, &arguments, &log, &err), RX_OK);
        assert_int_equal(arguments.action, cases[i].action);
        assert_null(arguments.settings);
        rx_arguments_free(&arguments);
    }
}

static void images_and_keywords_come_in_any_order(void **state)
{
    static const struct {
        const char *line, *image;
    } cases[] = {
        {"rextract a.fits -VERBOSE_TYPE QUIET -detect_minarea 9", "a.fits"},
        {"rextract -VERBOSE_TYPE QUIET a.fits -DETECT_MINAREA 9", "a.fits"},
        {"rextract -DETECT_MINAREA 3 -VERBOSE_TYPE QUIET -DETECT_MINAREA 9 a.fits,b.fits", "a.fits,b.fits"},
        {"rextract a.fits b.fits -DETECT_MINAREA 9 -VERBOSE_TYPE QUIET", "a.fits,b.fits"},
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

static void bad_command_lines_say_why(void **state)
{
    static const struct {
        const char *line, *error;
    } cases[] = {
        {"rextract -DETECT_THRESH 3", "no image is named"},
        {"rextract a.fits -DETECT_THRESH", "-DETECT_THRESH has no value"},
        {"rextract a.fits -c", "-c has no value"},
        {"rextract a.fits b.fits c.fits", "'c.fits' is one image too many"},
        {"rextract a.fits,b.fits,c.fits", "is one image too many"},
        {"rextract a.fits,", "an image name is empty"},
        {"rextract a.fits -DETECT_TRESH 3", "did you mean -DETECT_THRESH?"},
        {"rextract a.fits --DETECT_THRESH 3",
         "unknown keyword '--DETECT_THRESH'; did you mean -DETECT_THRESH?"},
        {"rextract a.fits -DETECT_THRESH x", "-DETECT_THRESH: 'x' is not a number"},
        {"rextract a.fits -c absent.sex", "cannot be opened"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_error err;
        rx_arguments arguments;
        rx_log log = quiet(stderr);
        assert_int_equal(read_line(state, cases[i].line, &arguments, &log, &err), RX_USAGE);
        if (strstr(err.text, cases[i].error) == NULL)
            fail_msg("'%s' gives '%s'", cases[i].line, err.text);
        rx_arguments_free(&arguments);
    }
}

/* Defaults, then default.sex or the file of -c, then the command line. */
static void files_are_found_and_overridden(void **state)
{
    char path[1024], said[256] = "";
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
    put(state, "default.sex", "DETECT_MINAREA 11\nSEED 2\n", path);
    put(state, "other.sex", "DETECT_MINAREA 12\nVERBOSE_TYPE FULL\n", path);
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

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(actions_are_told_apart),
        IN_FOLDER(images_and_keywords_come_in_any_order),
        IN_FOLDER(bad_command_lines_say_why),
        IN_FOLDER(files_are_found_and_overridden),
    };
    return cmocka_run_group_tests_name("arguments", tests, NULL, NULL);
}
