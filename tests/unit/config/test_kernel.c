/* Detection filters from .conv files. */
#include <dirent.h>

#include "../scratch.h"
#include "config/kernel.h"

static rx_status read_text(void **state, const char *text, rx_kernel **dst, rx_error *err)
{
    const char *path = put(state, "test.conv", text);
    *err = RX_ERROR_NONE;
    *dst = NULL;
    return rx_kernel_read(path, dst, err);
}

static void kernels_are_read(void **state)
{
    rx_error err;
    rx_kernel *k;
    assert_int_equal(read_text(state, "CONV NONORM\n# two rows\n\n1 -2.5\t3 # end\r\n 4 5e1 6", &k, &err),
                     RX_OK);
    assert_int_equal(k->width, 3);
    assert_int_equal(k->height, 2);
    assert_false(k->normalise);
    const float expected[6] = {1, -2.5f, 3, 4, 50, 6};
    assert_memory_equal(k->values, expected, sizeof expected);
    rx_kernel_free(k);
    assert_int_equal(read_text(state, "CONV\n7\n", &k, &err), RX_OK); /* as SExtractor: NORM */
    assert_true(k->normalise);
    rx_kernel_free(k);
}

static void bad_kernels_say_why(void **state)
{
    static const struct {
        const char *text, *error;
        long line;
    } cases[] = {
        {"", "first line must be CONV NORM", 1},
        {"CONV MAYBE\n1\n", "CONV MAYBE: give NORM or NONORM", 1},
        {"CONV NORM\n", "holds no numbers", 0},
        {"CONV NORM\n1 2 1\n2 4 2 1\n", "this row has 4 numbers, those before 3", 3},
        {"CONV NORM\n1 nan 1\n", "'nan' is not a number", 2},
        {"CONV NORM\n1 1e60 1\n", "'1e60' is not a number", 2},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_error err;
        rx_kernel *k;
        assert_int_equal(read_text(state, cases[i].text, &k, &err), RX_USAGE);
        assert_null(k);
        assert_int_equal(err.line, cases[i].line);
        if (strstr(err.text, cases[i].error) == NULL)
            fail_msg("'%s' gives '%s'", cases[i].text, err.text);
    }
}

static void too_large_and_absent(void **state)
{
    rx_error err;
    rx_kernel *k = NULL;
    char *text = malloc(8192);
    assert_non_null(text);
    strcpy(text, "CONV NORM\n");
    for (int i = 0; i <= RX_KERNEL_SIDE; i++)
        strcat(text, "1 ");
    assert_int_equal(read_text(state, text, &k, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "at most 1023"));
    strcpy(text, "CONV NORM\n");
    for (int i = 0; i <= RX_KERNEL_SIDE; i++)
        strcat(text, "1\n");
    assert_int_equal(read_text(state, text, &k, &err), RX_USAGE);
    assert_int_equal(err.line, RX_KERNEL_SIDE + 2);
    free(text);
    const char *path = in(state, "absent.conv");
    assert_int_equal(rx_kernel_read(path, &k, &err), RX_USAGE);
    assert_string_equal(err.where, path);
}

/* config/default.conv and the built-in kernel are the same. */
static void built_in_equals_the_file(void **state)
{
    char path[1024];
    rx_kernel *a = NULL;
    const char *root = getenv("srcdir");
    snprintf(path, sizeof path, "%s/config/default.conv", root != NULL ? root : ".");
    assert_int_equal(rx_kernel_read(path, &a, NULL), RX_OK);
    assert_int_equal(a->width, 3);
    assert_int_equal(a->height, 3);
    assert_true(a->normalise);
    assert_memory_equal(a->values, rx_kernel_built_in, sizeof rx_kernel_built_in);
    rx_kernel_free(a);
}

/* The filters that come with SExtractor. */
static void filters_of_sextractor_are_read(void **state)
{
    const char *folder = "/usr/share/source-extractor";
    char path[1024];
    int n = 0;
    DIR *dir = opendir(folder);
    for (struct dirent *entry = dir != NULL ? readdir(dir) : NULL; entry != NULL; entry = readdir(dir)) {
        rx_error err = RX_ERROR_NONE;
        rx_kernel *k = NULL;
        if (strstr(entry->d_name, ".conv") == NULL)
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        if (rx_kernel_read(path, &k, &err) != RX_OK)
            fail_msg("%s:%ld: %s", path, err.line, err.text);
        assert_true(k->width == k->height);
        assert_true(k->width % 2 == 1);
        rx_kernel_free(k);
        n++;
    }
    if (dir != NULL)
        closedir(dir);
    if (n == 0) {
        print_message("SExtractor's filters are not installed: not tried\n");
        skip();
    }
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_scratch, remove_scratch)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(kernels_are_read),
        IN_FOLDER(bad_kernels_say_why),
        IN_FOLDER(too_large_and_absent),
        cmocka_unit_test(built_in_equals_the_file),
        cmocka_unit_test(filters_of_sextractor_are_read),
    };
    return cmocka_run_group_tests_name("kernel", tests, NULL, NULL);
}
