/* Lines of files: whole, long, from the middle, and what is none. */
#include "../files.h"

#include "base/lines.h"
#include "base/text.h"

static void check_next(rx_lines *lines, const char *wanted, long number, int64_t at)
{
    char *line = NULL;
    assert_int_equal(rx_lines_next(lines, &line, NULL), RX_OK);
    if (wanted == NULL) {
        assert_null(line);
        return;
    }
    assert_non_null(line);
    assert_string_equal(line, wanted);
    assert_int_equal(lines->number, number);
    assert_int_equal(lines->at, at);
}

static void lines_and_where_they_begin(void **state)
{
    rx_lines lines;
    write_bytes(*state, "one\n\nthree\r\nfour", 16);
    assert_int_equal(rx_lines_open(&lines, *state, 0, NULL), RX_OK);
    check_next(&lines, "one", 1, 0);
    check_next(&lines, "", 2, 4);
    check_next(&lines, "three\r", 3, 5);
    check_next(&lines, "four", 4, 12);
    check_next(&lines, NULL, 0, 0);
    check_next(&lines, NULL, 0, 0);
    rx_lines_close(&lines);
    assert_int_equal(rx_lines_open(&lines, *state, 5, NULL), RX_OK);
    check_next(&lines, "three\r", 1, 5);
    check_next(&lines, "four", 2, 12);
    rx_lines_close(&lines);
    write_bytes(*state, "", 0);
    assert_int_equal(rx_lines_open(&lines, *state, 0, NULL), RX_OK);
    check_next(&lines, NULL, 0, 0);
    rx_lines_close(&lines);
}

/* Some editors put one before a text; a second, or one in the middle, is text. */
static void byte_order_mark(void **state)
{
    static const char text[] = "\xef\xbb\xbfone\n\xef\xbb\xbftwo\n";
    rx_lines lines;
    char *data = NULL;
    size_t length = 0;
    write_bytes(*state, text, sizeof text - 1);
    assert_int_equal(rx_lines_open(&lines, *state, 0, NULL), RX_OK);
    check_next(&lines, "one", 1, 0);
    check_next(&lines, "\xef\xbb\xbftwo", 2, 7);
    rx_lines_close(&lines);
    assert_int_equal(rx_text_read_file(*state, 1000, &data, &length, NULL), RX_OK);
    assert_string_equal(data, text + 3);
    assert_int_equal(length, sizeof text - 4);
    free(data);
}

/* Line k has k * k letters, so that blocks end at every place of a line. */
static void lines_longer_than_a_block(void **state)
{
    enum { LINES = 400 };
    rx_lines lines;
    char *line = NULL;
    FILE *file = fopen(*state, "wb");
    assert_non_null(file);
    for (int k = 0; k < LINES; k++)
        for (int i = 0; i <= k * k; i++)
            assert_true(fputc(i < k * k ? 'a' + k % 26 : '\n', file) >= 0);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(rx_lines_open(&lines, *state, 0, NULL), RX_OK);
    for (int k = 0; k < LINES; k++) {
        const char letter[] = {(char)('a' + k % 26), '\0'};
        assert_int_equal(rx_lines_next(&lines, &line, NULL), RX_OK);
        assert_non_null(line);
        assert_int_equal(strlen(line), k * k);
        assert_int_equal(strspn(line, letter), k * k);
    }
    check_next(&lines, NULL, 0, 0);
    rx_lines_close(&lines);
}

static void what_is_no_text(void **state)
{
    rx_lines lines;
    rx_error err = RX_ERROR_NONE;
    char *line = NULL;
    write_bytes(*state, "one\ntw\0o\n", 9);
    assert_int_equal(rx_lines_open(&lines, *state, 0, NULL), RX_OK);
    assert_int_equal(rx_lines_next(&lines, &line, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "binary"));
    rx_lines_close(&lines);
    assert_int_equal(rx_lines_open(&lines, "/tmp", 0, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "folder"));
    rx_lines_close(&lines);
    assert_int_equal(rx_lines_open(&lines, "/tmp/not-there/at-all", 0, &err), RX_INPUT);
    rx_lines_close(&lines);

    const size_t long_one = (1 << 24) + (1 << 17);
    char *endless = malloc(long_one);
    assert_non_null(endless);
    memset(endless, 'x', long_one);
    write_bytes(*state, endless, long_one);
    free(endless);
    assert_int_equal(rx_lines_open(&lines, *state, 0, NULL), RX_OK);
    assert_int_equal(rx_lines_next(&lines, &line, &err), RX_INPUT);
    assert_int_equal(err.line, 1);
    assert_non_null(strstr(err.text, "longer than a line"));
    rx_lines_close(&lines);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(lines_and_where_they_begin, make_file, remove_file),
        cmocka_unit_test_setup_teardown(byte_order_mark, make_file, remove_file),
        cmocka_unit_test_setup_teardown(lines_longer_than_a_block, make_file, remove_file),
        cmocka_unit_test_setup_teardown(what_is_no_text, make_file, remove_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
