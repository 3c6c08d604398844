/* Error objects: what they keep and how they look to the user. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/error.h"

static void set_fills_status_and_text(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_error_set(&err, RX_INPUT, "sums to %d", 0), RX_INPUT);
    assert_int_equal(err.status, RX_INPUT);
    assert_string_equal(err.text, "sums to 0");
    assert_string_equal(err.where, "");
    assert_int_equal(err.hdu, -1);
    assert_int_equal(err.line, 0);
}

static void a_caller_without_interest_gets_the_status(void **state)
{
    (void)state;
    assert_int_equal(rx_error_set(NULL, RX_USAGE, "x"), RX_USAGE);
    assert_int_equal(rx_error_at(NULL, RX_INPUT, "f", 1, 2, "x"), RX_INPUT);
    assert_int_equal(rx_error_memory(NULL, 8), RX_SYSTEM);
}

static void format_names_file_hdu_and_line(void **state)
{
    (void)state;
    char line[256];
    rx_error err = RX_ERROR_NONE;
    rx_error_at(&err, RX_INPUT, "tile.fits", 2, 0, "has 3 axes");
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: tile.fits[2]: has 3 axes");
    rx_error_at(&err, RX_USAGE, "default.sex", -1, 17, "unknown keyword");
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: default.sex:17: unknown keyword");
    rx_error_set(&err, RX_USAGE, "no image given");
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: no image given");
}

/* The primary HDU counts as 0 and is named too. */
static void format_names_the_primary_hdu(void **state)
{
    (void)state;
    char line[64];
    rx_error err = RX_ERROR_NONE;
    rx_error_at(&err, RX_INPUT, "a.fits", 0, 0, "is empty");
    rx_error_format(&err, "p", line, sizeof line);
    assert_string_equal(line, "p: a.fits[0]: is empty");
}

/* A file name made to drive a terminal, or to look like a second line, cannot. */
static void control_characters_are_shown_as_question_marks(void **state)
{
    (void)state;
    char line[256];
    rx_error err = RX_ERROR_NONE;
    rx_error_at(&err, RX_INPUT, "a\033[2J\nb\x7f.fits", -1, 0, "bad\tvalue\r");
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: a?[2J?b?.fits: bad?value?");
    for (const char *c = line; *c != '\0'; c++) {
        assert_true((unsigned char)*c >= 0x20);
        assert_true((unsigned char)*c != 0x7f);
    }
}

/* UTF-8 in file names is text, not control. */
static void utf8_survives(void **state)
{
    (void)state;
    char line[64];
    rx_error err = RX_ERROR_NONE;
    rx_error_at(&err, RX_INPUT, "b\xc3\xa9ta.fits", -1, 0, "x");
    rx_error_format(&err, "p", line, sizeof line);
    assert_string_equal(line, "p: b\xc3\xa9ta.fits: x");
}

static void long_names_and_short_buffers_end_early(void **state)
{
    (void)state;
    char name[2 * RX_ERROR_WHERE], line[16], none[1] = {'x'};
    memset(name, 'a', sizeof name - 1);
    name[sizeof name - 1] = '\0';
    rx_error err = RX_ERROR_NONE;
    rx_error_at(&err, RX_INPUT, name, 1, 0, "%s", name);
    assert_true(strlen(err.where) < sizeof err.where);
    assert_true(strlen(err.text) < sizeof err.text);
    rx_error_format(&err, "p", line, sizeof line);
    assert_string_equal(line, "p: aaaaaaaaaaaa");
    rx_error_format(&err, "p", none, 0);
    assert_int_equal(none[0], 'x');
}

static void memory_errors_name_the_bytes(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_error_memory(&err, 4096), RX_SYSTEM);
    assert_non_null(strstr(err.text, "4096"));
    assert_int_equal(rx_error_memory(&err, 0), RX_SYSTEM);
    assert_null(strstr(err.text, "bytes"));
}

static bool never(void *user)
{
    (void)user;
    return false;
}

/* Whatever is said, and by whom: who may stop the call stays who it was. */
static void the_stop_stays_the_callers(void **state)
{
    (void)state;
    int mine = 0, other = 0;
    rx_error err = RX_ERROR_NONE;
    assert_null(err.stop);
    assert_null(err.user);
    err.stop = never;
    err.user = &mine;
    rx_error_at(&err, RX_INPUT, "a.fits", 1, 2, "x");
    rx_error_memory(&err, 1);
    rx_error_set(&err, RX_USAGE, "y");
    assert_ptr_equal(err.stop, never);
    assert_ptr_equal(err.user, &mine);
    rx_error part = rx_error_part(&err);
    assert_int_equal(part.status, RX_OK);
    assert_int_equal(part.hdu, -1);
    assert_string_equal(part.text, "");
    assert_ptr_equal(part.stop, never);
    assert_ptr_equal(part.user, &mine);
    rx_error_at(&part, RX_INPUT, "b.fits", 3, 4, "z");
    part.stop = NULL;
    part.user = &other;
    assert_int_equal(rx_error_take(&err, &part), RX_INPUT);
    assert_int_equal(err.status, RX_INPUT);
    assert_string_equal(err.where, "b.fits");
    assert_string_equal(err.text, "z");
    assert_int_equal(err.hdu, 3);
    assert_int_equal(err.line, 4);
    assert_ptr_equal(err.stop, never);
    assert_ptr_equal(err.user, &mine);
}

static void an_error_without_a_file_is_of_the_one_at_work(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_error_where(&err, RX_OK, "a.fits", 1, 0), RX_OK);
    assert_string_equal(err.where, "");
    rx_error_set(&err, RX_INPUT, "x");
    assert_int_equal(rx_error_where(&err, RX_INPUT, "a.fits", 1, 2), RX_INPUT);
    rx_error_where(&err, RX_INPUT, "b.fits", 3, 4);
    assert_string_equal(err.where, "a.fits");
    assert_int_equal(err.hdu, 1);
    assert_int_equal(err.line, 2);
    assert_string_equal(err.text, "x");
    assert_int_equal(rx_error_where(NULL, RX_SYSTEM, "a.fits", 1, 0), RX_SYSTEM);
}

static void a_part_of_nobodys_call_has_no_stop(void **state)
{
    (void)state;
    rx_error part = rx_error_part(NULL);
    assert_null(part.stop);
    assert_int_equal(part.hdu, -1);
    rx_error_set(&part, RX_SYSTEM, "x");
    assert_int_equal(rx_error_take(NULL, &part), RX_SYSTEM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(set_fills_status_and_text),
        cmocka_unit_test(a_caller_without_interest_gets_the_status),
        cmocka_unit_test(format_names_file_hdu_and_line),
        cmocka_unit_test(format_names_the_primary_hdu),
        cmocka_unit_test(control_characters_are_shown_as_question_marks),
        cmocka_unit_test(utf8_survives),
        cmocka_unit_test(long_names_and_short_buffers_end_early),
        cmocka_unit_test(memory_errors_name_the_bytes),
        cmocka_unit_test(the_stop_stays_the_callers),
        cmocka_unit_test(an_error_without_a_file_is_of_the_one_at_work),
        cmocka_unit_test(a_part_of_nobodys_call_has_no_stop),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
