/* Digests against what xxh128sum prints. */
#include "../files.h"

#include "base/hash.h"

/* `piece` bytes at a time. */
static void expect(const char *bytes, size_t n, size_t piece, const char *expected)
{
    char text[RX_HASH_TEXT];
    rx_hash sum;
    rx_hash_begin(&sum);
    for (size_t i = 0; i < n; i += piece)
        rx_hash_add(&sum, bytes + i, n - i < piece ? n - i : piece);
    rx_hash_text(&sum, text);
    assert_string_equal(text, expected);
}

enum { LONG = 100000 };

static char *long_text(void)
{
    char *text = malloc(LONG);
    assert_non_null(text);
    for (size_t i = 0; i < LONG; i++)
        text[i] = "rextract\n"[i % 9];
    return text;
}

static void what_xxh128sum_prints(void **state)
{
    static const char zeros[241];
    char *text = long_text();
    expect("", 0, 1, "99aa06d3014798d86001c324468d497f");
    expect("abc", 3, 1, "06b05ab6733a618578af5f94892f3950");
    for (size_t piece = 1; piece <= 241; piece += 16) {
        expect(zeros, 128, piece, "d3c4f706d8fc547f093c29f27ecfcf21");
        expect(zeros, 129, piece, "5dc489d54b6d88d4dd4911635f2c7a91");
        expect(zeros, 241, piece, "b9b45065a364c5b95c5b5d5d40c59ce3");
    }
    for (size_t piece = 1; piece < LONG; piece = 3 * piece + 1)
        expect(text, LONG, piece, "c2b540b648a2100899ad9a8743a822b7");
    free(text);
}

static void files(void **state)
{
    char path[512], digest[RX_HASH_TEXT];
    int there = 1;
    char *text = long_text();
    new_file(path, "");
    write_bytes(path, text, LONG);
    assert_int_equal(rx_hash_file(path, digest, &there, NULL), RX_OK);
    assert_int_equal(there, 1);
    assert_string_equal(digest, "c2b540b648a2100899ad9a8743a822b7");
    unlink(path);
    assert_int_equal(rx_hash_file(path, digest, &there, NULL), RX_OK);
    assert_int_equal(there, 0);
    assert_int_equal(rx_hash_file("/tmp", digest, &there, NULL), RX_OK);
    assert_int_equal(there, 0);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_xxh128sum_prints),
        cmocka_unit_test(files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
