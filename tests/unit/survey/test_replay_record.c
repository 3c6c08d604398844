/* The record of a run, read from outputs that were damaged on purpose. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "../files.h"
#include "survey/replay_record.h"

static const char PATH[] = "test_replay_record.txt";

#define BEGIN "# RECORD = 1, digests XXH3-128\n# VERSION = 0.1.0\n# MACHINE = m\n# IMAGE = a%20b.fits\n"
#define END "# SET = DETECT_THRESH\n# OUTPUT = a.cat\n# END = 0\n"

static rx_status read_config(const char *text, rx_config **config, rx_error *err)
{
    rx_replay_record *record = NULL;
    write_text(PATH, text);
    rx_status status = rx_replay_record_read(PATH, &record, err);
    if (status == RX_OK)
        status = rx_replay_record_config(record, PATH, config, err);
    rx_replay_record_free(record);
    unlink(PATH);
    return status;
}

static void test_config(void **state)
{
    (void)state;
    rx_config *config = NULL;
    assert_int_equal(read_config(BEGIN "# DETECT_THRESH = 2.5\n# DETECT_MINAREA = 7\n" END, &config, NULL),
                     RX_OK);
    assert_int_equal(rx_settings_was_set((const rx_settings *)config, "DETECT_THRESH"), RX_FROM_COMMAND);
    assert_int_equal(rx_settings_was_set((const rx_settings *)config, "DETECT_MINAREA"), RX_FROM_DEFAULT);
    rx_config_free(config);
}

/* A line without a name is none: it would be looked for for ever. */
static void test_no_name(void **state)
{
    (void)state;
    rx_config *config = NULL;
    assert_int_equal(read_config(BEGIN "#  = 2.5\n# DETECT_MINAREA = 7\n" END, &config, NULL), RX_OK);
    rx_config_free(config);
}

static void test_unknown_keywords(void **state)
{
    (void)state;
    rx_config *config = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(read_config(BEGIN "# DETECT_TRESH = 2.5\n" END, &config, &err), RX_INPUT);
    assert_null(config);
    assert_non_null(strstr(err.text, "DETECT_TRESH"));
    assert_int_equal(read_config(BEGIN "# DETECT_THRESH = much\n" END, &config, &err), RX_INPUT);
    assert_null(config);
}

/* The name of a PARAM that ends where it begins. */
static void test_votable_without_name(void **state)
{
    (void)state;
    rx_replay_record *record = NULL;
    write_text(PATH,
               "<?xml version=\"1.0\"?>\n  <PARAM name=\" datatype=\"char\" arraysize=\"*\" value=\"x\"/>\n");
    assert_int_equal(rx_replay_record_read(PATH, &record, NULL), RX_INPUT);
    unlink(PATH);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_config),
        cmocka_unit_test(test_no_name),
        cmocka_unit_test(test_unknown_keywords),
        cmocka_unit_test(test_votable_without_name),
    };
    return cmocka_run_group_tests_name("records of runs", tests, NULL, NULL);
}
