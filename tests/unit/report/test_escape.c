/* Hostile strings. */
#include "../near.h"
#include "report/formats.h"

#define FFFD "\xEF\xBF\xBD"

static void html(void **state)
{
    static const char *const cases[][2] = {
        {"<script>alert('a' & \"b\")</script>",
         "&lt;script&gt;alert(&#39;a&#39; &amp; &quot;b&quot;)&lt;/script&gt;"},
        {"a\nb\x7f\001", "a" FFFD "b" FFFD FFFD},
        {NULL, ""},
        {"\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x94\xAD", "\xC3\xA9 \xE2\x82\xAC \xF0\x9F\x94\xAD"},
        {"\xE9t\xE9", FFFD "t" FFFD},              /* Latin-1 */
        {"\xC0\xBC", FFFD FFFD},                   /* overlong '<' */
        {"\xE0\x80\xBC", FFFD FFFD FFFD},          /* the same in three bytes */
        {"\xED\xA0\x80", FFFD FFFD FFFD},          /* surrogate */
        {"\xF4\x90\x80\x80", FFFD FFFD FFFD FFFD}, /* beyond U+10FFFF */
        {"x\xE2\x82", "x" FFFD FFFD},              /* cut off at the end */
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rx_text text = {0};
        rx_text_add(&text, "");
        rx_escape_html(&text, cases[i][0]);
        assert_string_equal(text.data, cases[i][1]);
        rx_text_free(&text);
    }
}

/* U+0085, U+2028, U+2029 end lines for YAML and Python. */
static void quoted(void **state)
{
    rx_text text = {0};
    rx_json json = rx_json_on(&text);
    rx_ecsv table = {.text = &text};
    rx_json_string(&json, NULL, "a\"b\\c\td\xC2\x85 \xE2\x80\xA8 \xE2\x80\xA9");
    rx_ecsv_text(&table, "a\"b,c\\\xC2\x85 \xE2\x80\xA8 \xE2\x80\xA9");
    assert_string_equal(text.data, "\"a\\\"b\\\\c" FFFD "d\\u0085 \\u2028 \\u2029\"\"a\"\"b,c\\" FFFD " " FFFD
                                   " " FFFD "\"");
    rx_text_free(&text);
}

static void reduced(void **state)
{
    char dst[12];
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
        cmocka_unit_test(quoted),
        cmocka_unit_test(reduced),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
