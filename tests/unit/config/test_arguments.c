/* The command line. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "../scratch.h"
#include "config/arguments.h"
#include "config/config_fields.h"

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

static void actions_are_told_apart(void **state)
{
    static const struct {
        const char *line;
        rx_action action;
    } cases[] = {
        {"rextract", RX_ACTION_NONE},
        {"rextract-train -INFO model.fits", RX_ACTION_INFO},
        {"rextract-train -EPOCHS 3 -info model.fits", RX_ACTION_INFO},
        {"rextract -FLAGS 19", RX_ACTION_FLAGS},
        {"rextract -flags", RX_ACTION_FLAGS},
        {"rextract-validate HELP", RX_ACTION_HELP},
        {"rextract a.fits -h", RX_ACTION_HELP},
        {"rextract-simulate", RX_ACTION_NONE},
        {"rextract-simulate -SEED 3 -dd", RX_ACTION_DUMP_ALL},
        {"rextract-simulate -v", RX_ACTION_VERSION},
        {"rextract-validate", RX_ACTION_NONE},
        {"rextract-validate -dd", RX_ACTION_DUMP_ALL},
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

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_scratch, remove_scratch)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(actions_are_told_apart),
        IN_FOLDER(images_and_keywords_come_in_any_order),
        IN_FOLDER(files_are_found_and_overridden),
        IN_FOLDER(campaign_files_are_named_either_way),
    };
    return cmocka_run_group_tests_name("arguments", tests, NULL, NULL);
}
