/* Error objects: what they keep and how they look to the user. */
#include "../near.h"

#include <string.h>

#include "base/error.h"

static void format_names_file_hdu_and_line(void **state)
{
    char line[256];
    rx_error err = RX_ERROR_NONE;
    rx_error_at(&err, RX_INPUT, "tile\n.fits", 0, 0, "has 3 axes"); /* the primary HDU is named too */
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: tile?.fits[0]: has 3 axes");
    rx_error_at(&err, RX_USAGE, "default.sex", -1, 17, "unknown keyword");
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: default.sex:17: unknown keyword");
    rx_error_set(&err, RX_USAGE, "no image given");
    rx_error_format(&err, "rextract", line, sizeof line);
    assert_string_equal(line, "rextract: no image given");
}

static void long_names_and_short_buffers_end_early(void **state)
{
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

static bool never(void *user)
{
    return false;
}

/* Whatever is said, and by whom: who may stop the call stays who it was. */
static void the_stop_stays_the_callers(void **state)
{
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(format_names_file_hdu_and_line),
        cmocka_unit_test(long_names_and_short_buffers_end_early),
        cmocka_unit_test(the_stop_stays_the_callers),
        cmocka_unit_test(an_error_without_a_file_is_of_the_one_at_work),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
