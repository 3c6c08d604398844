/* Hostile strings. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "report/formats.h"

#define FFFD "\xEF\xBF\xBD"

static void check(void (*escape)(rx_text *, const char *), const char *in, const char *want)
{
    rx_text text = {0};
    rx_text_add(&text, "");
    escape(&text, in);
    assert_string_equal(text.data, want);
    rx_text_free(&text);
}

static void html(void **state)
{
    (void)state;
    check(rx_escape_html, "<script>alert('a' & \"b\")</script>",
          "&lt;script&gt;alert(&#39;a&#39; &amp; &quot;b&quot;)&lt;/script&gt;");
    check(rx_escape_html,
          "a\nb\x7f"
          "\x01",
          "a" FFFD "b" FFFD FFFD);
    check(rx_escape_html, NULL, "");
}

static void utf8(void **state)
{
    (void)state;
    check(rx_escape_html, "\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x94\xAD", "\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x94\xAD");
    check(rx_escape_html, "\xE9t\xE9", FFFD "t" FFFD);              /* Latin-1 */
    check(rx_escape_html, "\xC0\xBC", FFFD FFFD);                   /* overlong '<' */
    check(rx_escape_html, "\xE0\x80\xBC", FFFD FFFD FFFD);          /* the same in three bytes */
    check(rx_escape_html, "\xED\xA0\x80", FFFD FFFD FFFD);          /* surrogate */
    check(rx_escape_html, "\xF4\x90\x80\x80", FFFD FFFD FFFD FFFD); /* beyond U+10FFFF */
    check(rx_escape_html, "x\xE2\x82", "x" FFFD FFFD);              /* cut off at the end */
}

/* U+0085, U+2028, U+2029 end lines for YAML and Python. */
static void quoted(void **state)
{
    rx_text text = {0};
    rx_json json = rx_json_on(&text);
    rx_ecsv table = {.text = &text};
    (void)state;
    rx_json_string(&json, NULL, "a\"b\\c\td\xC2\x85 \xE2\x80\xA8 \xE2\x80\xA9");
    rx_ecsv_text(&table, "a\"b,c\\\xC2\x85 \xE2\x80\xA8 \xE2\x80\xA9");
    assert_string_equal(text.data, "\"a\\\"b\\\\c" FFFD "d\\u0085 \\u2028 \\u2029\"\"a\"\"b,c\\" FFFD " " FFFD
                                   " " FFFD "\"");
    rx_text_free(&text);
}

static void reduced(void **state)
{
    char dst[12];
    (void)state;
    rx_escape_stem(dst, sizeof dst, "../R L'\xC3");
    assert_string_equal(dst, "___R_L__");
    rx_escape_stem(dst, sizeof dst, "");
    assert_string_equal(dst, "run");
    rx_escape_stem(dst, sizeof dst, "abcdefghijklmnop");
    assert_string_equal(dst, "abcdefghijk");
    rx_escape_plain(dst, sizeof dst, "R'; $x`");
    assert_string_equal(dst, "R?? ?x?");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(html),
        cmocka_unit_test(utf8),
        cmocka_unit_test(quoted),
        cmocka_unit_test(reduced),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
