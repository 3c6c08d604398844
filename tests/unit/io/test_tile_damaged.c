/* Tiles that are not what they claim: cut, lying, damaged files are refused with a clear word. */
#include "tile_test.h"

/* cfitsio would divide by a tile of no size as soon as it reaches the HDU. */
/* A compressed image with one of its cards (from XTENSION = 0) replaced is refused, and why is said. */
static void check_header_refused(void **state, size_t replaced, const char *card, const char *word)
{
    static const char *const primary[] = {"SIMPLE  =                    T", "BITPIX  =                    8",
                                          "NAXIS   =                    0", "END"};
    static const char *const table[] = {"XTENSION= 'BINTABLE'",
                                        "BITPIX  =                    8",
                                        "NAXIS   =                    2",
                                        "NAXIS1  =                    8",
                                        "NAXIS2  =                   10",
                                        "PCOUNT  =                    0",
                                        "GCOUNT  =                    1",
                                        "TFIELDS =                    1",
                                        "TTYPE1  = 'COMPRESSED_DATA'",
                                        "TFORM1  = '1PB(0)'",
                                        "ZIMAGE  =                    T",
                                        "ZBITPIX =                   16",
                                        "ZNAXIS  =                    2",
                                        "ZNAXIS1 =                   10",
                                        "ZNAXIS2 =                   10",
                                        "ZTILE1  =                   10",
                                        "ZTILE2  =                    1",
                                        "ZCMPTYPE= 'RICE_1'",
                                        "END"};
    const char *path = in(state, "z.fits.fz");
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    for (size_t i = 0; i < 36; i++)
        fprintf(file, "%-80s", i < sizeof primary / sizeof *primary ? primary[i] : "");
    for (size_t i = 0; i < 36; i++)
        fprintf(file, "%-80s", i == replaced ? card : i < sizeof table / sizeof *table ? table[i] : "");
    for (int i = 0; i < 2880; i++)
        fputc(0, file);
    assert_int_equal(fclose(file), 0);
    int *hdus = NULL, n = 0;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_tile_list(path, NULL, &hdus, &n, &err), RX_INPUT);
    assert_non_null(strstr(err.text, word));
    assert_int_equal(err.hdu, 1);
}

static void test_headers_that_cfitsio_does_not_survive(void **state)
{
    check_header_refused(state, 16, "ZTILE2  =                0   1", "ZTILE");
    check_header_refused(state, 16, "ZTILE2  =                 1E-5", "ZTILE");
    check_header_refused(state, 4, "NAXIT2  =                   10", "NAXIS2");
    check_header_refused(state, 7, "TFIELDS =                  'a'", "TFIELDS");
    check_header_refused(state, 3, "NAXIS1  =                  5889223372036854775807", "NAXIS1");
    check_header_refused(state, 7, "END", "TFIELDS");
    check_header_refused(state, 11, "ZBITPIX =      LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL / type",
                         "longer than any");
    check_header_refused(state, 8,
                         "TTYPE1  = LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL",
                         "longer than any");
}

static void test_broken_files(void **state)
{
    static const struct {
        const char *text, *word;
    } cases[] = {{"", "empty"},
                 {"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "Git LFS"},
                 {"<!DOCTYPE html><html>", "web page"},
                 {"hello world", "not a FITS file"},
                 {"SIMPLE  =                    T", "cut off"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        dump(in(state, "x.fits"), cases[i].text, strlen(cases[i].text));
        check_refused(&PLAIN, in(state, "x.fits"), cases[i].word);
    }
    char block[5760];
    memset(block, ' ', sizeof block);
    memcpy(block, "SIMPLE  =                    T", 30); /* a header without END */
    dump(in(state, "x.fits"), block, sizeof block);
    check_refused(&PLAIN, in(state, "x.fits"), "cannot be read");
}

static void make_header_only(const char *path, int bitpix, const char *axes, size_t bytes)
{
    char lines[500], data[100] = {0};
    rx_text file = {0};
    snprintf(lines, sizeof lines, "SIMPLE  =                    T\nBITPIX  = %20d\n%s", bitpix, axes);
    add_hdu(&file, lines, data, bytes);
    dump(path, file.data, file.length);
    rx_text_free(&file);
}

static void test_lying_headers(void **state)
{
    static const struct {
        const char *axes, *word;
    } cases[] = {
        {"NAXIS   =                    2\nNAXIS1  =               400000\nNAXIS2  =               400000",
         "cut off"},
        {"NAXIS   =                    2\nNAXIS1  =           4000000000\nNAXIS2  =           4000000000",
         ""},
        {"NAXIS   =                    2\nNAXIS1  =                    0\nNAXIS2  =                   10",
         "0 x 10"},
        {"NAXIS   =                    2\nNAXIS1  =                  -10\nNAXIS2  =                   10",
         ""},
        {"NAXIS   =                    0", "no 2-D image"},
        {"NAXIS   =                    1\nNAXIS1  =                   10", "1 axis"},
        {"NAXIS   =                    3\nNAXIS1  =                    2\nNAXIS2  =                    2\n"
         "NAXIS3  =                    3",
         "3 axes"},
        {"NAXIS   =                    2\nNAXIS1  =                   60\nNAXIS2  =                  100",
         "cut off"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        make_header_only(in(state, "x.fits"), -32, cases[i].axes, 40);
        check_refused(&PLAIN, in(state, "x.fits"), cases[i].word);
    }
}

/* Real-looking compressed file: cut in the middle, and with a header that claims more. */
static void test_broken_compressed(void **state)
{
    static float noise[200 * 200];
    size_t size = 0;
    for (int i = 0; i < 40000; i++)
        noise[i] = (float)((i * 7919) % 30011);
    compress_to(in(state, "a.fits.fz"), RICE_1, noise, 200, 200, 0);
    char *data = slurp(in(state, "a.fits.fz"), &size);
    for (int part = 1; part < 8; part++) {
        dump(in(state, "cut.fits.fz"), data, size * (size_t)part / 8);
        check_refused(&PLAIN, in(state, "cut.fits.fz"), "");
    }
    char *axis = NULL;
    for (size_t i = 0; i + 80 < size && axis == NULL; i += 80)
        if (memcmp(data + i, "ZNAXIS1 ", 8) == 0)
            axis = data + i;
    assert_non_null(axis);
    memcpy(axis + 10, "           100000000", 20);
    dump(in(state, "huge.fits.fz"), data, size);
    check_refused(&PLAIN, in(state, "huge.fits.fz"), "");
    memcpy(axis + 10, "                 200", 20);
    for (int seed = 1; seed < 40; seed++) { /* a few wrong bytes, up to a hail of them */
        char *hurt = malloc(size);
        assert_non_null(hurt);
        memcpy(hurt, data, size);
        for (size_t i = 5760 + (size_t)seed; i < size; i += (size_t)(40000 / (seed * seed)) + 1)
            hurt[i] = seed % 3 == 0 ? 0 : (char)(i * (size_t)(131 + seed));
        dump(in(state, "bad.fits.fz"), hurt, size);
        free(hurt);
        rx_tile *tile = NULL;
        rx_status status = rx_tile_read(&PLAIN, in(state, "bad.fits.fz"), 1, 1, NULL, &tile, NULL);
        assert_true(status == RX_OK || status == RX_INPUT);
        rx_tile_free(tile);
    }
    free(data);
}

/* Files without the padding of their last block are common and complete. */
static void test_missing_padding(void **state)
{
    size_t size = 0;
    make_ramp(in(state, "a.fits"), -32, "");
    char *data = slurp(in(state, "a.fits"), &size);
    dump(in(state, "b.fits"), data, 2880 + W * H * 4);
    free(data);
    rx_tile *tile = read_tile(&PLAIN, in(state, "b.fits"), 0, 1);
    assert_true(tile->pixels[W * H - 1] == W * H - 1);
    rx_tile_free(tile);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_headers_that_cfitsio_does_not_survive),
        cmocka_unit_test(test_broken_files),
        cmocka_unit_test(test_lying_headers),
        cmocka_unit_test(test_broken_compressed),
        cmocka_unit_test(test_missing_padding),
    };
    return cmocka_run_group_tests_name("damaged tiles", tests, make_scratch, drop_scratch);
}
