/* Growing strings, text files, and the nearest word. */
#include "../scratch.h"

#include "base/text.h"

static void text_grows(void **state)
{
    rx_text text = {0};
    for (int i = 0; i < 1000; i++)
        rx_text_printf(&text, "%04d,", i);
    rx_text_add(&text, "end");
    rx_text_add_bytes(&text, "xyz", 1);
    assert_false(text.failed);
    assert_int_equal(text.length, 5004);
    assert_int_equal(strlen(text.data), 5004);
    assert_memory_equal(text.data, "0000,0001,", 10);
    assert_string_equal(text.data + 4995, "0999,endx");
    rx_text_free(&text);
    assert_null(text.data);
}

/* Reads `size` bytes through a file, then removes it. */
static rx_status read_back(const char *folder, const char *content, size_t size, size_t max, char **data,
                           size_t *length, rx_error *err)
{
    char path[600];
    snprintf(path, sizeof path, "%s/x.txt", folder);
    write_bytes(path, content, size);
    rx_status status = rx_text_read_file(path, max, data, length, err);
    assert_int_equal(unlink(path), 0);
    return status;
}

static void files_come_whole(void **state)
{
    static const size_t sizes[] = {0, 1, 4095, 4096, 4097, 8192, 20000};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        char *content = malloc(sizes[i] + 1), *data = NULL;
        size_t length = 1;
        assert_non_null(content);
        for (size_t j = 0; j < sizes[i]; j++)
            content[j] = (char)('a' + j % 26);
        assert_int_equal(read_back(*state, content, sizes[i], 20000, &data, &length, NULL), RX_OK);
        assert_int_equal(length, sizes[i]);
        assert_memory_equal(data, content, sizes[i]);
        assert_int_equal(data[length], '\0');
        free(data);
        free(content);
    }
}

static void bad_files_are_refused(void **state)
{
    rx_error err = RX_ERROR_NONE;
    char *data = NULL, path[600], large[10000];
    memset(large, 'a', sizeof large);
    assert_int_equal(read_back(*state, "a\0b", 3, 100, &data, NULL, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "binary"));
    assert_int_equal(read_back(*state, large, sizeof large, sizeof large - 1, &data, NULL, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "9999"));
    assert_int_equal(rx_text_read_file(*state, 100, &data, NULL, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "folder"));
    snprintf(path, sizeof path, "%s/absent", (const char *)*state);
    assert_int_equal(rx_text_read_file(path, 100, &data, NULL, &err), RX_INPUT);
    assert_string_equal(err.where, path);
    assert_null(data);
}

static void the_nearest_word_is_found(void **state)
{
    static const char *const words[] = {"DETECT_THRESH", "DETECT_MINAREA", "ANALYSIS_THRESH", "GAIN",
                                        "GAIN_KEY"};
    enum { N = sizeof words / sizeof *words };
    assert_string_equal(rx_text_nearest("DETECT_TRESH", words, N), "DETECT_THRESH");
    assert_string_equal(rx_text_nearest("detect_minarae", words, N), "DETECT_MINAREA");
    assert_string_equal(rx_text_nearest("GAIN", words, N), "GAIN");
    assert_string_equal(rx_text_nearest("GAINKEY", words, N), "GAIN_KEY");
    assert_null(rx_text_nearest("CHECKIMAGE_TYPE", words, N));
    assert_null(rx_text_nearest("X", words, N));
    char endless[4001]; /* more than the table of distances holds */
    memset(endless, 'A', sizeof endless - 1);
    endless[sizeof endless - 1] = '\0';
    assert_null(rx_text_nearest(endless, words, N));
}

static void lines_from_outside_are_tamed(void **state)
{
    char line[] = "a\tb\n\033[2J\x7f \x9b"
                  "31m \xc2\x9b"
                  "31m \xc3\xa9 \xe2\x82\xac \xf0\x9f\x94\xad \xc0\xaf \xed\xa0\x80 \xe2\x82";
    rx_text_tame(line);
    assert_string_equal(line, "a?b??[2J? ?31m ??31m \xc3\xa9 \xe2\x82\xac \xf0\x9f\x94\xad ?? ??? ??");
    assert_int_equal(rx_text_utf8(""), 0);
}

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

static void text_becomes_printable_and_comes_back(void **state)
{
    expect("", "");
    expect("a b  c,d=\"e'f\"&g", "a b  c,d=\"e'f\"&g");
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
    char bad[][8] = {"%", "a%4", "%zz", "%4z", "%00"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(rx_printable_read(bad[i]), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(text_grows),
        cmocka_unit_test_setup_teardown(files_come_whole, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(bad_files_are_refused, make_scratch, remove_scratch),
        cmocka_unit_test(the_nearest_word_is_found),
        cmocka_unit_test(lines_from_outside_are_tamed),
        cmocka_unit_test(text_becomes_printable_and_comes_back),
        cmocka_unit_test(what_is_no_escape_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
