/* Tiles that are not what they claim: cut, lying, damaged files are refused with a clear word. */
#include "tile_test.h"

#include <fitsio.h>
#include <time.h>
#include <zlib.h>

#if RX_HAVE_BZIP2
#include <bzlib.h>
#endif

#include "io/fits_read.h"

#define PRIMARY                                                                                              \
    "SIMPLE  =                    T\nBITPIX  =                    8\nNAXIS   =                    0\n"

static void check_list_refused(const char *path, const char *word)
{
    int *hdus = NULL, n = 0;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_tile_list(path, NULL, &hdus, &n, &err), RX_INPUT);
    if (strstr(err.text, word) == NULL)
        print_message("'%s' does not say '%s'\n", err.text, word);
    assert_non_null(strstr(err.text, word));
    assert_int_equal(err.hdu, 1);
}

/* A compressed image with one of its cards (from XTENSION = 0) replaced is refused, and why is said. */
static void check_header_refused(void **state, size_t replaced, const char *card, const char *word)
{
    static const char table[] =
        "XTENSION= 'BINTABLE'\nBITPIX  =                    8\nNAXIS   =                    2\n"
        "NAXIS1  =                    8\nNAXIS2  =                   10\nPCOUNT  =                    0\n"
        "GCOUNT  =                    1\nTFIELDS =                    1\nTTYPE1  = 'COMPRESSED_DATA'\n"
        "TFORM1  = '1PB(0)'\nZIMAGE  =                    T\nZBITPIX =                   16\n"
        "ZNAXIS  =                    2\nZNAXIS1 =                   10\nZNAXIS2 =                   10\n"
        "ZTILE1  =                   10\nZTILE2  =                    1\nZCMPTYPE= 'RICE_1'\n";
    const char *path = in(state, "z.fits.fz");
    char text[81];
    rx_text file = {0};
    add_hdu(&file, PRIMARY, "", 0);
    const size_t begin = file.length;
    add_hdu(&file, table, (char[80]){0}, 80);
    snprintf(text, sizeof text, "%-80s", card);
    memcpy(file.data + begin + 80 * replaced, text, 80);
    write_bytes(path, file.data, file.length);
    rx_text_free(&file);
    check_list_refused(path, word);
}

static void test_headers_that_cfitsio_does_not_survive(void **state)
{
    check_header_refused(state, 16, "ZTILE2  =                0   1", "ZTILE");
    check_header_refused(state, 16, "ZTILE2  =                 1E-5", "ZTILE");
    check_header_refused(state, 16, "ztile2  =                    0", "ZTILE");
    check_header_refused(state, 16, "ZTILE2  =x                  1", "ZTILE");
    check_header_refused(state, 4, "NAXIT2  =                   10", "NAXIS2");
    check_header_refused(state, 7, "TFIELDS =                  'a'", "TFIELDS");
    check_header_refused(state, 7, "TFIELDS =          21474836471", "TFIELDS");
    check_header_refused(state, 3, "NAXIS1  =                  5889223372036854775807", "NAXIS1");
    check_header_refused(state, 7, "END", "TFIELDS");
    check_header_refused(state, 0, "XTENSIONXTENSION= 'BINTABLE'", "XTENSION");
    check_header_refused(state, 11, "ZBITPIX =      LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL / type",
                         "longer than any");
    check_header_refused(state, 13, "ZNAXIS1 =   ( 10 / length of the original image's axis (1)",
                         "longer than any");
    check_header_refused(state, 14, "ZNAXIS2 = '''''''''''''''''''''''''''''''''''''''' 12 '",
                         "longer than any");
    check_header_refused(state, 8,
                         "TTYPE1  = LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL",
                         "longer than any");
}

/* Cards that cfitsio finds and the standard does not, and keywords that are there twice. */
static void test_disguised_keywords(void **state)
{
    check_header_refused(state, 16, "HIERARCH ZTILE2 = 0", "'HIERARCH ZTILE2 = 0' is ZTILE2 to some");
    check_header_refused(state, 16, "ZTILE2  X= 0", "is ZTILE2 to some");
    check_header_refused(state, 16, "ZTILE2=0", "is ZTILE2 to some");
    check_header_refused(state, 16, "ZTILE2", "is ZTILE2 to some");
    check_header_refused(state, 16, "ZTILE1  =                    9", "ZTILE1 is there twice");
    check_header_refused(state, 16, "TFORM01 = '1PI'", "is TFORM01 to some");
    check_header_refused(state, 16, "THEAPS  =                    9", "is THEAPS to some");
    check_header_refused(state, 16, "HIERARCH EXTVER = (1,22222222222222222222222222222222222)",
                         "longer than any");
    check_header_refused(state, 16,
                         "A=  '''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''''",
                         "longer than any");
    check_header_refused(state, 17, "ZCMPTYPE= 'RICE_1", "ZCMPTYPE = 'RICE_1 is no text");
    check_header_refused(state, 11, "ZBITPIX = -18446744073709551616", "no whole number");
    check_header_refused(state, 10, "ZIMAGE  = TRUE", "neither T nor F");
}

/* cfitsio would go from such an HDU to itself, or one before it, for ever. */
static void test_extension_that_ends_before_it_begins(void **state)
{
    const char *path = in(state, "g.fits");
    rx_text file = {0};
    add_hdu(&file, PRIMARY "EXTEND  =                    T\n", "", 0);
    add_hdu(&file,
            "XTENSION= 'IMAGE   '\nBITPIX  =                   16\nNAXIS   =                    2\n"
            "NAXIS1  =                   12\nNAXIS2  =                   12\nPCOUNT  =                    0\n"
            "GCOUNT  =                  -32\n",
            "", 0);
    write_bytes(path, file.data, file.length);
    rx_text_free(&file);
    check_list_refused(path, "ends before it begins");
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
        write_bytes(in(state, "x.fits"), cases[i].text, strlen(cases[i].text));
        check_refused(&PLAIN, in(state, "x.fits"), cases[i].word);
    }
    char block[5760];
    memset(block, ' ', sizeof block);
    memcpy(block, "SIMPLE  =                    T", 30); /* a header without END */
    write_bytes(in(state, "x.fits"), block, sizeof block);
    check_refused(&PLAIN, in(state, "x.fits"), "cannot be read");
}

/* Files without the padding of their last block are common and complete. */
static void test_missing_padding(void **state)
{
    size_t size = 0;
    make_ramp(in(state, "a.fits"), -32, "");
    char *data = file_bytes(in(state, "a.fits"), &size);
    write_bytes(in(state, "b.fits"), data, 2880 + W * H * 4);
    free(data);
    rx_tile *tile = read_tile(&PLAIN, in(state, "b.fits"), 0, 1);
    assert_true(tile->pixels[W * H - 1] == W * H - 1);
    rx_tile_free(tile);
}

/* --- packed by gzip --- */

static void pack(const char *path, const void *data, size_t size, size_t zeros)
{
    static const char nothing[1 << 16];
    gzFile file = gzopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(gzwrite(file, data, (unsigned)size), size);
    for (size_t i = 0; i < zeros; i += sizeof nothing)
        assert_int_equal(gzwrite(file, nothing, sizeof nothing), sizeof nothing);
    assert_int_equal(gzclose(file), Z_OK);
}

/* The primary header is looked at before cfitsio reads it, and what it does not tell of is not unpacked. */
static void test_packed_files(void **state)
{
    const char *path = in(state, "a.fits"), *packed = in(state, "p.fits.gz");
    size_t size = 0;
    int n = 0;
    rx_tile_shape *shapes = NULL;
    make_ramp(path, -32, "");
    char *data = file_bytes(path, &size);
    pack(packed, data, 2880 + W * H * 4, 0); /* without padding */
    rx_tile *tile = read_tile(&PLAIN, packed, 0, 1);
    assert_true(tile->pixels[W * H - 1] == W * H - 1);
    rx_tile_free(tile);
    pack(packed, data, 2880 + W * H * 4 - 1, 0);
    check_refused(&PLAIN, packed, "cut off");
    pack(packed, data, size, 1 << 28);
    assert_int_equal(rx_tile_shapes(packed, NULL, &shapes, &n, NULL), RX_OK);
    assert_int_equal(n, 1);
    assert_true(shapes[0].held >= size);
    assert_true(shapes[0].held < 1 << 22);
    free(shapes);
    memcpy(data + 80, "BITPIX  =      LLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLLL", 70);
    pack(packed, data, size, 0);
    check_refused(&PLAIN, packed, "longer than any");
    pack(packed, data, 0, 0);
    check_refused(&PLAIN, packed, "");
    memcpy(data + 80, "BITPIX  =                  -32                                                    ",
           80);
    pack(packed, data, size, 0);
    free(data);
    data = file_bytes(packed, &size);
    pack(packed, data, size, 0);
    free(data);
    check_refused(&PLAIN, packed, "does not begin with SIMPLE");
    write_bytes(packed, "PK\3\4 and so on", 15);
    check_refused(&PLAIN, packed, "zip archive");
    write_bytes(packed, "\x1f\x9d\x90 and so on", 13);
    check_refused(&PLAIN, packed, "packed by compress");
}

#if RX_HAVE_BZIP2
/* --- packed by bzip2 --- */

static void pack_bzip2(const char *path, const char *data, size_t size, size_t zeros)
{
    char *all = calloc(size + zeros, 1), *packed = malloc(size + zeros + 1000);
    unsigned n = (unsigned)(size + zeros + 1000);
    assert_non_null(all);
    assert_non_null(packed);
    memcpy(all, data, size);
    assert_int_equal(BZ2_bzBuffToBuffCompress(packed, &n, all, (unsigned)(size + zeros), 9, 0, 0), BZ_OK);
    write_bytes(path, packed, n);
    free(all);
    free(packed);
}

static void check_packed(const char *path, size_t size)
{
    int n = 0;
    rx_tile_shape *shapes = NULL;
    rx_tile *tile = read_tile(&PLAIN, path, 0, 1);
    assert_true(tile->pixels[W * H - 1] == W * H - 1);
    rx_tile_free(tile);
    assert_int_equal(rx_tile_shapes(path, NULL, &shapes, &n, NULL), RX_OK);
    assert_int_equal(n, 1);
    assert_true(shapes[0].held >= size);
    assert_true(shapes[0].held < 1 << 22);
    free(shapes);
}

/* No further than the headers say, either. */
static void test_packed_otherwise(void **state)
{
    enum { ZEROS = 1 << 24 };
    const char *path = in(state, "a.fits"), *packed = in(state, "p.fits.z");
    size_t size = 0, length = 0;
    make_ramp(path, -32, "");
    char *data = file_bytes(path, &size);
    pack_bzip2(packed, data, size, 0);
    check_packed(packed, size);
    char *bytes = file_bytes(packed, &length);
    write_bytes(packed, bytes, length / 2);
    check_refused(&PLAIN, packed, "cut off");
    bytes[length / 2] = (char)~bytes[length / 2];
    write_bytes(packed, bytes, length);
    check_refused(&PLAIN, packed, "damaged");
    free(bytes);
    pack_bzip2(packed, data, size, ZEROS);
    check_packed(packed, size);
    free(data);
}
#endif

/* --- long headers --- */

/* 999 columns in a header as long as any is read: once through it, not once for each column. */
static void test_header_is_read_once(void **state)
{
    enum { CARDS = 4090 * 36, COLUMNS = 999 };
    const char *path = in(state, "wide.fits");
    FILE *file = fopen(path, "wb");
    char block[2880];
    rx_table *table = NULL;
    assert_non_null(file);
    fprintf(file, "%-80s%-80s%-80s%-2640s", "SIMPLE  =                    T",
            "BITPIX  =                    8", "NAXIS   =                    0", "END");
    fprintf(file, "%-80s%-80s%-80s%-80s%-80s%-80s%-80s%-80s", "XTENSION= 'BINTABLE'",
            "BITPIX  =                    8", "NAXIS   =                    2",
            "NAXIS1  =                  999", "NAXIS2  =                    1",
            "PCOUNT  =                    0", "GCOUNT  =                    1",
            "TFIELDS =                  999");
    for (int i = 1; i <= COLUMNS; i++) {
        snprintf(block, sizeof block, "TFORM%-3d= 'B'", i);
        fprintf(file, "%-80s", block);
    }
    for (int i = 8 + COLUMNS; i < CARDS - 5; i++)
        fprintf(file, "%-80s", "COMMENT");
    fprintf(file, "%-80s%-80s%-80s%-80s%-80s", "TTYPE999= 'LAST' / of all", "TUNIT999= 'pix'", "TNULL999= 0",
            "TTYPE999= 'LAST' / again", "END");
    memset(block, 7, sizeof block);
    assert_int_equal(fwrite(block, 1, sizeof block, file), sizeof block);
    assert_int_equal(fclose(file), 0);
    const clock_t begin = clock();
    assert_int_equal(rx_fits_read_table(path, 0, &table, NULL), RX_OK);
    assert_true((double)(clock() - begin) / CLOCKS_PER_SEC < 20); /* was 80, is 0.3 */
    assert_int_equal(table->ncolumns, COLUMNS);
    assert_string_equal(table->columns[0].name, "COL1");
    assert_string_equal(table->columns[998].name, "LAST");
    assert_string_equal(table->columns[998].description, "of all");
    assert_string_equal(table->columns[998].unit, "pix");
    assert_int_equal(table->columns[998].type, RX_CELL_FLOAT);
    assert_int_equal(table->columns[997].type, RX_CELL_INT16);
    rx_table_free(table);
}

/* --- tiles of a compressed image --- */

/* A file of one tile of 10 x 10 pixels; the table has two columns, cells {length, offset} in elements and
 * bytes of the heap. */
static void put_tile(const char *path, const char *cards, const char *second, const uint32_t cells[4],
                     const void *heap, size_t size)
{
    rx_text file = {0}, header = {0}, body = {0};
    add_hdu(&file, PRIMARY, "", 0);
    rx_text_printf(
        &header,
        "XTENSION= 'BINTABLE'\nBITPIX  =                    8\nNAXIS   =                    2\n"
        "NAXIS1  =                   16\nNAXIS2  =                    1\nPCOUNT  = %20zu\n"
        "GCOUNT  =                    1\nTFIELDS =                    2\n%sTTYPE1  = 'COMPRESSED_DATA'\n"
        "ZIMAGE  =                    T\nZNAXIS  =                    2\nZNAXIS1 =                   10\n"
        "ZNAXIS2 =                   10\nZTILE1  =                   10\nZTILE2  =                   10\n%s",
        size, second, cards);
    for (int i = 0; i < 4; i++)
        for (int shift = 24; shift >= 0; shift -= 8) {
            const char byte = (char)(cells[i] >> shift);
            rx_text_add_bytes(&body, &byte, 1);
        }
    rx_text_add_bytes(&body, heap, size);
    add_hdu(&file, header.data, body.data, body.length);
    write_bytes(path, file.data, file.length);
    rx_text_free(&file);
    rx_text_free(&header);
    rx_text_free(&body);
}

#define BYTES "TFORM1  = '1PB'\n"
#define SECOND "TTYPE2  = 'UNCOMPRESSED_DATA'\nTFORM2  = '1PI'\n"
#define SECOND_GZIP "TTYPE2  = 'GZIP_COMPRESSED_DATA'\nTFORM2  = '1PB'\n"
#define RICE "ZCMPTYPE= 'RICE_1'\nZVAL1   = 32\nZVAL2   = 2\nZBITPIX = 16\n"
#define GZIP "ZCMPTYPE= 'GZIP_1'\nZBITPIX = "

/* Zeros of a heap, packed or not; cfitsio would read or write beyond its memory, fill it all, or go on for
 * ever. The first of each kind is in order. */
static void test_tiles_that_cfitsio_does_not_survive(void **state)
{
    static const struct {
        const char *cards, *second;
        uint32_t cells[2]; /* lengths; 0 of the first: all of a stream */
        unsigned packed;   /* zeros in the stream, 0: the heap is zeros as they are */
        int cut;           /* bytes of the stream that are missing */
        const char *word;
    } cases[] = {
        {GZIP "16\n", BYTES SECOND, {0, 0}, 200, 0, NULL},
        {GZIP "16\n", BYTES SECOND, {0, 0}, 200, 1, "damaged"},
        {GZIP "16\n", BYTES SECOND, {0, 0}, 201, 0, "damaged"},
        {GZIP "16\n", BYTES SECOND, {0, 0}, 900, 0, "damaged"},
        {GZIP "16\n", BYTES SECOND, {0, 0}, 1 << 28, 0, "damaged"},
        {GZIP "-32\nZQUANTIZ= 'NONE'\n", BYTES SECOND, {0, 0}, 400, 0, NULL},
        {GZIP "-32\nZQUANTIZ= 'NONE'\n", BYTES SECOND, {0, 0}, 200, 0, "damaged"},
        {GZIP "-32\nZDITHER0= 10000\n", BYTES SECOND, {0, 0}, 400, 0, NULL},
        {GZIP "-32\nZDITHER0= 0\n", BYTES SECOND, {0, 0}, 400, 0, "damaged"},
        {GZIP "-64\nZSCALE  = 1.\n", BYTES SECOND_GZIP, {1, 0}, 800, 0, NULL},
        {GZIP "-64\nZSCALE  = 1.\n", BYTES SECOND_GZIP, {1, 0}, 400, 0, "damaged"},
        {RICE, BYTES SECOND, {6, 0}, 0, 0, NULL},
        {RICE, BYTES SECOND, {3, 0}, 0, 0, "damaged"},
        {RICE "ZQUANTIZ= 'NONE'\n", BYTES SECOND, {6, 0}, 0, 0, "damaged"},
        {RICE "ZNAME1  = 'BYTEPIX'\nZNAME2  = 'BLOCKSIZE'\n", BYTES SECOND, {6, 0}, 0, 0, NULL},
        {GZIP "16\n", BYTES SECOND, {0, 100}, 0, 0, NULL},
        {GZIP "16\n", BYTES SECOND, {0, 101}, 0, 0, "damaged"},
        {GZIP "16\n", BYTES SECOND, {0, 0}, 0, 0, "damaged"},
    };
    enum { HEAP = 400 };
    static char zeros[1 << 16];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *path = in(state, "t.fits.fz"), *packed = in(state, "heap.gz");
        uint32_t cells[4] = {cases[i].cells[0], 0, cases[i].cells[1], 0};
        if (cases[i].packed > 0) {
            size_t size = 0;
            pack(packed, zeros, cases[i].packed % (1 << 16), cases[i].packed / (1 << 16) * (1 << 16));
            char *stream = file_bytes(packed, &size);
            cells[cases[i].cells[0] > 0 ? 2 : 0] = (uint32_t)size - (uint32_t)cases[i].cut;
            cells[0] = cases[i].cells[0] > 0 ? 0 : cells[0];
            put_tile(path, cases[i].cards, cases[i].second, cells, stream, size);
            free(stream);
        } else {
            put_tile(path, cases[i].cards, cases[i].second, cells, zeros, HEAP);
        }
        if (cases[i].word != NULL)
            check_refused(&PLAIN, path, cases[i].word);
        else
            rx_tile_free(read_tile(&PLAIN, path, 1, 1));
    }
}

/* A header that cfitsio could not read is remembered where the file is held in memory, too. */
static void test_missing_settings(void **state)
{
    static const char zeros[400];
    const uint32_t cells[4] = {6, 0, 0, 0};
    size_t size = 0;
    put_tile(in(state, "t.fits.fz"), "ZCMPTYPE= 'RICE_1'\nZBITPIX = 16\n", BYTES SECOND, cells, zeros,
             sizeof zeros);
    char *data = file_bytes(in(state, "t.fits.fz"), &size);
    pack(in(state, "t.fits.gz"), data, size, 0);
    free(data);
    check_refused(&PLAIN, in(state, "t.fits.fz"), "cannot be read");
    check_refused(&PLAIN, in(state, "t.fits.gz"), "cannot be read");
}

static void test_line_lists(void **state)
{
    static const struct {
        short words[8];
        int is_good;
    } cases[] = {
        {{0, 7, -100, 8, 0, 0, 0, 100}, 1},    {{0, 7, -100, 9, 0, 0, 0, 100}, 0},
        {{0, 7, -100, 8, 0, 0, 0, 0x1001}, 0}, {{0, 7, -100, 0, 1, 0, 0, 100}, 0},
        {{0, -7, -100, 8, 0, 0, 0, 100}, 0},   {{0, 7, -100, 0, 0, 0, 0, 100}, 0},
        {{0, 0, 9, 100, 0, 0, 0, 100}, 0},     {{0, 0, 4, 100, 0, 0, 0, 0}, 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const uint32_t cells[4] = {8, 0, 0, 0};
        short words[8];
        memcpy(words, cases[i].words, sizeof words);
        swap(words, 8, 2);
        put_tile(in(state, "p.fits.fz"), "ZCMPTYPE= 'PLIO_1'\nZBITPIX = 16\n", "TFORM1  = '1PI'\n" SECOND,
                 cells, words, sizeof words);
        if (cases[i].is_good)
            rx_tile_free(read_tile(&PLAIN, in(state, "p.fits.fz"), 1, 1));
        else
            check_refused(&PLAIN, in(state, "p.fits.fz"), "damaged");
    }
}

#define HCOMPRESS "ZCMPTYPE= 'HCOMPRESS_1'\nZVAL1   = 1\nZVAL2   = 0\nZBITPIX = 16\n"

/* Cut off anywhere, from its last byte to within its own header. */
static void test_hcompress_streams(void **state)
{
    static char stream[1 << 14];
    int pixels[100], failed = 0;
    long length = sizeof stream;
    for (int i = 0; i < 100; i++)
        pixels[i] = 13 * i % 31;
    fits_hcompress(pixels, 10, 10, 1, stream, &length, &failed); /* leaves other pixels */
    assert_int_equal(failed, 0);
    for (uint32_t cut = 0; cut < (uint32_t)length; cut += 1 + cut / 4) {
        const uint32_t cells[4] = {(uint32_t)length - cut, 0, 0, 0};
        put_tile(in(state, "h.fits.fz"), HCOMPRESS, BYTES SECOND, cells, stream, (size_t)length);
        if (cut > 0) {
            check_refused(&PLAIN, in(state, "h.fits.fz"), "damaged");
            continue;
        }
        rx_tile *tile = read_tile(&PLAIN, in(state, "h.fits.fz"), 1, 1);
        for (int i = 0; i < 100; i++)
            assert_true(tile->pixels[i] == (float)(13 * i % 31));
        rx_tile_free(tile);
    }
    for (uint32_t bit = 8 * 22; bit < 8 * (uint32_t)length;
         bit += 3) { /* flipped behind its header: read, or refused */
        const uint32_t cells[4] = {(uint32_t)length, 0, 0, 0};
        rx_tile *tile = NULL;
        stream[bit / 8] ^= (char)(1 << bit % 8);
        put_tile(in(state, "h.fits.fz"), HCOMPRESS, BYTES SECOND, cells, stream, (size_t)length);
        stream[bit / 8] ^= (char)(1 << bit % 8);
        const rx_status status = rx_tile_read(&PLAIN, in(state, "h.fits.fz"), 1, 1, NULL, &tile, NULL);
        assert_int_equal(status, tile == NULL ? RX_INPUT : RX_OK);
        rx_tile_free(tile);
    }
}

/* The memory of a tile would be asked for by a product that overflows. */
static void test_huge_tiles(void **state)
{
    static const char zeros[400];
    const uint32_t cells[4] = {0, 0, 100, 0};
    put_tile(in(state, "h.fits.fz"), GZIP "16\n", BYTES SECOND, cells, zeros, sizeof zeros);
    size_t size = 0;
    char *data = file_bytes(in(state, "h.fits.fz"), &size), *card = data + 2880;
    while (strncmp(card, "ZTILE1  ", 8) != 0)
        card += 80;
    memcpy(card + 10, "          2147483647", 20);
    memcpy(card + 90, "          2147483647", 20);
    write_bytes(in(state, "h.fits.fz"), data, size);
    free(data);
    check_refused(&PLAIN, in(state, "h.fits.fz"), "bad ZTILE1");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_headers_that_cfitsio_does_not_survive),
        cmocka_unit_test(test_disguised_keywords),
        cmocka_unit_test(test_extension_that_ends_before_it_begins),
        cmocka_unit_test(test_broken_files),
        cmocka_unit_test(test_missing_padding),
        cmocka_unit_test(test_packed_files),
#if RX_HAVE_BZIP2
        cmocka_unit_test(test_packed_otherwise),
#endif
        cmocka_unit_test(test_header_is_read_once),
        cmocka_unit_test(test_tiles_that_cfitsio_does_not_survive),
        cmocka_unit_test(test_missing_settings),
        cmocka_unit_test(test_line_lists),
        cmocka_unit_test(test_hcompress_streams),
        cmocka_unit_test(test_huge_tiles)
    };
    return cmocka_run_group_tests_name("damaged tiles", tests, make_scratch, remove_scratch);
}
