/* Text as printable ASCII, and back. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "base/printable.h"

static void expect(const char *text, const char *printable)
{
    rx_text t = {0};
    rx_printable_add(&t, text);
    assert_false(t.failed);
    assert_string_equal(t.data, printable);
    assert_int_equal(rx_printable_read(t.data), 1);
    assert_string_equal(t.data, text);
    rx_text_free(&t);
}

static void plain_text_stays(void **state)
{
    (void)state;
    expect("", "");
    expect("tile.fits", "tile.fits");
    expect("a b  c,d=\"e'f\"", "a b  c,d=\"e'f\"");
    expect("a & b", "a & b");
}

static void the_rest_is_escaped(void **state)
{
    (void)state;
    expect("100%", "100%25");
    expect("%41", "%2541");
    expect(" a ", "%20a%20");
    expect(" ", "%20");
    expect("a&", "a%26");
    expect("\xc3\xa9\n\x7f\t", "%C3%A9%0A%7F%09");
    char every[256];
    for (int i = 1; i < 256; i++)
        every[i - 1] = (char)i;
    every[255] = '\0';
    rx_text t = {0};
    rx_printable_add(&t, every);
    for (size_t i = 0; i < t.length; i++) {
        assert_true(t.data[i] >= ' ');
        assert_true(t.data[i] <= '~');
    }
    assert_int_equal(rx_printable_read(t.data), 1);
    assert_string_equal(t.data, every);
    rx_text_free(&t);
}

static void what_is_no_escape_is_refused(void **state)
{
    (void)state;
    char bad[][8] = {"%", "a%4", "%zz", "%4z", "%00"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(rx_printable_read(bad[i]), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plain_text_stays),
        cmocka_unit_test(the_rest_is_escaped),
        cmocka_unit_test(what_is_no_escape_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
