/* Writing FITS and reading it back: images, tables, FITS_LDAC, cards, checksums. */
#include "io_test.h"

#include <fitsio.h>

#include <math.h>

#include "base/memory.h"
#include "io/fits_read.h"
#include "io/fits_write.h"

/* The HDUs of the file, whose sums are all right as cfitsio has it. */
static int sum_hdus(const char *path)
{
    int failed = 0, hdus = 0, ok = 0;
    fitsfile *file = NULL;
    fits_open_diskfile(&file, path, READONLY, &failed);
    fits_get_num_hdus(file, &hdus, &failed);
    for (int i = 1; i <= hdus; i++) {
        int data_ok = 0, hdu_ok = 0;
        fits_movabs_hdu(file, i, NULL, &failed);
        fits_verify_chksum(file, &data_ok, &hdu_ok, &failed);
        ok += data_ok == 1 && hdu_ok == 1;
    }
    fits_close_file(file, &failed);
    assert_int_equal(failed, 0);
    assert_int_equal(ok, hdus);
    return hdus;
}

/* Header of HDU number hdu (from 1) as one string. */
static char *header_of(const char *path, int hdu)
{
    fitsfile *file = NULL;
    int failed = 0, n = 0;
    char *text = NULL;
    fits_open_diskfile(&file, path, READONLY, &failed);
    fits_movabs_hdu(file, hdu, NULL, &failed);
    fits_hdr2str(file, 0, NULL, 0, &text, &n, &failed);
    fits_close_file(file, &failed);
    assert_int_equal(failed, 0);
    return text;
}

/* --- images --- */

static void test_image(void **state)
{
    float pixels[6] = {1.5f, -2, NAN, 4, 5, 1e-30f}, *back = NULL;
    int32_t labels[6] = {0, 1, 2, -1, INT32_MAX, 7};
    int width = 0, height = 0;
    rx_text cards = {0}, extra = {0};
    rx_fits_writer *writer = NULL;
    cards_from(
        "SIMPLE  =                    T\nBITPIX  =                   16\nNAXIS   =                    2\n"
        "NAXIS1  =                   99\nBSCALE  = 2.0\nBZERO   = 5.0\nBLANK   = 3\nTTYPE3  = 'A'\nZCMPTYPE= "
        "'RICE_1'\n"
        "DATASUM = '1'\nCHECKSUM= 'x'\nCRPIX1  = 10.5 / reference\nOBJECT  = 'M 31'\n"
        "LONGKEY = 'a string that goes on and on and on and on and on and on and on&'\n"
        "CONTINUE  'and ends here'\nHIERARCH ESO DET GAIN = 2.1\nHISTORY reduced by hand\nESO-LOG 00:00:00> "
        "odd card",
        &cards);
    rx_card_text(&extra, "SOFTNAME", "Rextract", "what made this");
    rx_card_record(&extra, "NOTE", "restored", "");
    assert_int_equal(rx_fits_create(in(state, "i.fits"), "shown", &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_image(writer,
                                   &(rx_fits_plane){.extname = "RESTORED",
                                                    .width = 3,
                                                    .height = 2,
                                                    .floats = pixels,
                                                    .cards = cards.data,
                                                    .ncards = cards.length / 80},
                                   &extra, NULL),
                     RX_OK);
    assert_int_equal(
        rx_fits_image(
            writer, &(rx_fits_plane){.extname = "SEGMENTATION", .width = 2, .height = 3, .integers = labels},
            NULL, NULL),
        RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    assert_int_equal(sum_hdus(in(state, "i.fits")), 2);
    assert_int_equal(rx_fits_read_image(in(state, "i.fits"), &back, &width, &height, NULL), RX_OK);
    assert_int_equal(width, 3);
    assert_int_equal(height, 2);
    for (int i = 0; i < 6; i++)
        assert_true(back[i] == pixels[i] || (isnan(back[i]) && isnan(pixels[i])));
    free(back);
    assert_int_equal(rx_fits_read_image(in(state, "i.fits[SEGMENTATION]"), &back, &width, &height, NULL),
                     RX_OK);
    assert_int_equal(width, 2);
    assert_true(back[3] == -1);
    assert_true(back[5] == 7);
    free(back);
    static const char *const kept[] = {"CRPIX1  = 10.5",
                                       "OBJECT  = 'M 31'",
                                       "LONGKEY = ",
                                       "CONTINUE  'and ends here'",
                                       "HIERARCH ESO DET GAIN = 2.1",
                                       "HISTORY reduced by hand",
                                       "ESO-LOG",
                                       "SOFTNAME= 'Rextract'",
                                       "HISTORY NOTE = restored",
                                       "EXTNAME = 'RESTORED'"};
    static const char *const dropped[] = {"BSCALE", "BZERO",    "BLANK",
                                          "TTYPE3", "ZCMPTYPE", "=                   99"};
    char *header = header_of(in(state, "i.fits"), 1);
    for (size_t i = 0; i < sizeof kept / sizeof kept[0]; i++)
        assert_non_null(strstr(header, kept[i]));
    for (size_t i = 0; i < sizeof dropped / sizeof dropped[0]; i++)
        assert_null(strstr(header, dropped[i]));
    assert_null(strstr(header, "updated")); /* no time of day */
    free(header);
    rx_text_free(&cards);
    rx_text_free(&extra);
}

static void test_read_image(void **state)
{
    float *pixels = NULL;
    int width = 0, height = 0;
    rx_text file = {0};
    rx_error err = RX_ERROR_NONE;
    uint8_t data[30] = {9, 8, 7};
    add_hdu(&file,
            "SIMPLE  =                    T\nBITPIX  =                    8\nNAXIS   =                    1\n"
            "NAXIS1  =                    3",
            data, 3);
    write_bytes(in(state, "line.fits"), file.data, file.length);
    assert_int_equal(rx_fits_read_image(in(state, "line.fits"), &pixels, &width, &height, &err), RX_OK);
    assert_true(width == 3);
    assert_true(height == 1);
    assert_true(pixels[2] == 7);
    free(pixels);
    add_hdu(&file,
            "XTENSION= 'IMAGE   '\nBITPIX  =                    8\nNAXIS   =                    2\n"
            "NAXIS1  =                    2\nNAXIS2  =                    2\nPCOUNT  = 0\nGCOUNT  = 1",
            data, 4);
    write_bytes(in(state, "two.fits"), file.data, file.length);
    assert_int_equal(rx_fits_read_image(in(state, "two.fits"), &pixels, &width, &height, &err), RX_OK);
    assert_true(width == 2);
    assert_true(height == 2);
    assert_true(pixels[1] == 8);
    free(pixels);
    rx_text_free(&file);
    assert_int_equal(rx_fits_read_image(in(state, "two.fits[1][1:3,1:1]"), &pixels, &width, &height, &err),
                     RX_INPUT);
    assert_int_equal(rx_fits_read_image(in(state, "nosuch"), &pixels, &width, &height, &err), RX_INPUT);
    assert_null(pixels);
}

/* --- tables --- */

enum { ROWS = 3 };

static void set_column(rx_column *column, const char *name, rx_cell_type type, int ndim, int d0, int d1,
                       int text)
{
    *column = (rx_column){.type = type, .ndim = ndim, .dim = {d0, d1}, .text_width = text};
    snprintf(column->name, sizeof column->name, "%s", name);
    column->data = rx_alloc(ROWS, (size_t)(rx_column_elements(column) * rx_column_element_size(column)));
    assert_non_null(column->data);
}

static rx_table *make_table(void)
{
    rx_table *table = rx_table_new(7);
    assert_non_null(table);
    table->nrows = ROWS;
    set_column(&table->columns[0], "NUMBER", RX_CELL_INT32, 0, 0, 0, 0);
    set_column(&table->columns[1], "FLAGS", RX_CELL_INT16, 0, 0, 0, 0);
    set_column(&table->columns[2], "ID", RX_CELL_INT64, 0, 0, 0, 0);
    set_column(&table->columns[3], "FLUX_APER", RX_CELL_FLOAT, 1, 2, 0, 0);
    set_column(&table->columns[4], "ALPHA_J2000", RX_CELL_DOUBLE, 0, 0, 0, 0);
    set_column(&table->columns[5], "VIGNET", RX_CELL_FLOAT, 2, 3, 2, 0);
    set_column(&table->columns[6], "BAND", RX_CELL_TEXT, 0, 0, 0, 6);
    for (int i = 0; i < ROWS; i++) {
        ((int32_t *)table->columns[0].data)[i] = i + 1;
        ((int16_t *)table->columns[1].data)[i] = (int16_t)(-i);
        ((int64_t *)table->columns[2].data)[i] = INT64_C(1237666408439939000) + i;
        ((double *)table->columns[4].data)[i] = i == 1 ? NAN : 336.6642573539360 + i;
        snprintf((char *)table->columns[6].data + (size_t)i * 6, 6, "r%d", i * 1111);
        for (int k = 0; k < 2; k++)
            ((float *)table->columns[3].data)[2 * i + k] = 0.1f * (float)(i + 10 * k);
        for (int k = 0; k < 6; k++)
            ((float *)table->columns[5].data)[6 * i + k] = (float)(100 * i + k);
    }
    /* what comes back to the bit, too, which a reader looking for nulls would lose */
    static const float odd[] = {-0.0f, 1e-42f, INFINITY, NAN};
    memcpy(table->columns[3].data, odd, sizeof odd);
    ((double *)table->columns[4].data)[0] = -0.0;
    ((double *)table->columns[4].data)[2] = 5e-324;
    snprintf(table->columns[4].unit, sizeof table->columns[4].unit, "deg");
    snprintf(table->columns[4].ucd, sizeof table->columns[4].ucd, "pos.eq.ra;meta.main");
    snprintf(table->columns[4].description, sizeof table->columns[4].description,
             "Right ascension (J2000), longer than fits behind TTYPE on a card");
    snprintf(table->columns[4].format, sizeof table->columns[4].format, "%%11.7f");
    free(table->name);
    table->name = rx_strdup("OBJECTS");
    return table;
}

static void check_equal(const rx_table *a, const rx_table *b)
{
    assert_int_equal(a->nrows, b->nrows);
    assert_int_equal(a->ncolumns, b->ncolumns);
    for (int i = 0; i < a->ncolumns; i++) {
        const rx_column *x = &a->columns[i], *y = &b->columns[i];
        long n = rx_column_elements(x);
        assert_string_equal(x->name, y->name);
        assert_string_equal(x->unit, y->unit);
        assert_string_equal(x->ucd, y->ucd);
        assert_string_equal(x->description, y->description);
        assert_int_equal(x->type, y->type);
        assert_int_equal(x->ndim, y->ndim);
        assert_int_equal(n, rx_column_elements(y));
        assert_int_equal(x->text_width, y->text_width);
        if (a->nrows > 0)
            assert_memory_equal(x->data, y->data, (size_t)(a->nrows * n * rx_column_element_size(x)));
    }
}

static void test_table(void **state)
{
    rx_table *table = make_table(), *back = NULL;
    rx_text extra = {0};
    rx_fits_writer *writer = NULL;
    char value[40];
    rx_card_integer(&extra, "NSTARS", 12, "stars");
    for (int run = 0; run < 2; run++) {
        const char *name = run == 0 ? "t.fits" : "u.fits";
        assert_int_equal(rx_fits_create(in(state, name), name, &writer, NULL), RX_OK);
        assert_int_equal(rx_fits_table(writer, table, &extra, NULL), RX_OK);
        assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    }
    assert_int_equal(sum_hdus(in(state, "t.fits")), 2);
    size_t n = 0, m = 0;
    char *a = file_bytes(in(state, "t.fits"), &n), *b = file_bytes(in(state, "u.fits"), &m);
    assert_int_equal(n, m);
    assert_memory_equal(a, b, n);
    free(a);
    free(b);
    assert_int_equal(rx_fits_read_table(in(state, "t.fits"), 0, &back, NULL), RX_OK);
    check_equal(table, back);
    assert_string_equal(back->name, "OBJECTS");
    assert_int_equal(rx_cards_text(back->cards, back->ncards, "NSTARS", value, sizeof value), 1);
    assert_string_equal(value, "12");
    assert_int_equal(rx_cards_text(back->cards, back->ncards, "TDISP5", value, sizeof value), 1);
    assert_string_equal(value, "F11.7");
    assert_int_equal(back->columns[5].dim[0], 3);
    rx_table_free(back);
    rx_table_free(table);
    rx_text_free(&extra);
}

/* --- whole files --- */

static void check_verify(void **state, const char *name, int nhdus, int hdu, const char *text)
{
    rx_error err = RX_ERROR_NONE;
    rx_status status = rx_fits_verify(in(state, name), nhdus, &err);
    assert_int_equal(status, text == NULL ? RX_OK : RX_INPUT);
    if (text != NULL && strstr(err.text, text) == NULL)
        fail_msg("'%s' is not in '%s'", text, err.text);
    if (text != NULL)
        assert_int_equal(err.hdu, hdu);
}

/* A header of its own, tables by name, and every kind of damage told with its HDU. */
static void test_whole_file(void **state)
{
    rx_table *table = make_table(), *back = NULL;
    rx_text extra = {0};
    rx_fits_writer *writer = NULL;
    char *cards = NULL, value[40];
    long ncards = 0;
    int hdu = 0;
    rx_card_integer(&extra, "RXMODEL", 1, "version");
    assert_int_equal(rx_fits_create(in(state, "w.fits"), "w", &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_primary(writer, &extra, NULL), RX_OK);
    for (int i = 0; i < 2; i++) {
        free(table->name);
        table->name = rx_strdup(i == 0 ? "ONE" : "TWO");
        table->nrows = ROWS - i;
        assert_int_equal(rx_fits_table(writer, table, NULL, NULL), RX_OK);
    }
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    assert_int_equal(sum_hdus(in(state, "w.fits")), 3);
    assert_int_equal(rx_fits_read_header(in(state, "w.fits"), 0, &cards, &ncards, NULL), RX_OK);
    assert_int_equal(rx_cards_text(cards, ncards, "RXMODEL", value, sizeof value), 1);
    assert_string_equal(value, "1");
    free(cards);
    assert_int_equal(rx_fits_read_header(in(state, "w.fits"), 3, &cards, &ncards, NULL), RX_INPUT);
    assert_null(cards);
    assert_int_equal(rx_fits_read_named(in(state, "w.fits"), "TWO", &back, &hdu, NULL), RX_OK);
    assert_int_equal(hdu, 2);
    check_equal(table, back);
    rx_table_free(back);
    assert_int_equal(rx_fits_read_named(in(state, "w.fits"), "THREE", &back, &hdu, NULL), RX_OK);
    assert_null(back);
    assert_int_equal(hdu, -1);
    check_verify(state, "w.fits", 0, 0, NULL);
    check_verify(state, "w.fits", 3, 0, NULL);
    check_verify(state, "w.fits", 4, -1, "has 3 HDUs, 4 were written");
    check_verify(state, "absent", 0, -1, "cannot be opened");
    size_t n = 0;
    char *data = file_bytes(in(state, "w.fits"), &n);
    assert_int_equal(n % 2880, 0);
    write_bytes(in(state, "d.fits"), data, n - 2880);
    check_verify(state, "d.fits", 0, 2, "is cut off");
    write_bytes(in(state, "d.fits"), data, n - 1);
    check_verify(state, "d.fits", 0, -1, "in whole blocks");
    write_bytes(in(state, "d.fits"), data, 2880 * 2);
    check_verify(state, "d.fits", 0, 1, "is cut off");
    for (size_t i = n - 2 * 2880; i < n - 2880; i += 80)
        if (memcmp(data + i, "END     ", 8) == 0) {
            memcpy(data + i, "COMMENT ", 8);
            write_bytes(in(state, "d.fits"), data, n);
            memcpy(data + i, "END     ", 8);
        }
    check_verify(state, "d.fits", 0, 2, "no HDU begins");
    data[n - 2880] ^= 1;
    write_bytes(in(state, "d.fits"), data, n);
    check_verify(state, "d.fits", 0, 2, "DATASUM does not fit");
    data[n - 2880] ^= 1;
    data[79] ^= 1; /* a comment */
    write_bytes(in(state, "d.fits"), data, n);
    check_verify(state, "d.fits", 0, 0, "CHECKSUM does not fit");
    data[79] ^= 1;
    memcpy(data + 2880, "NOTHING!", 8);
    write_bytes(in(state, "d.fits"), data, n);
    check_verify(state, "d.fits", 0, 1, "no HDU begins");
    free(data);
    rx_table_free(table);
    rx_text_free(&extra);
}

/* No source at all is a table too, in both kinds of file. */
static void test_empty_table(void **state)
{
    rx_table *table = make_table(), *back = NULL;
    rx_fits_writer *writer = NULL;
    table->nrows = 0;
    for (int ldac = 0; ldac < 2; ldac++) {
        assert_int_equal(rx_fits_create(in(state, "e.fits"), "e", &writer, NULL), RX_OK);
        assert_int_equal(
            ldac ? rx_fits_ldac(writer, table, NULL, NULL) : rx_fits_table(writer, table, NULL, NULL), RX_OK);
        assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
        assert_int_equal(sum_hdus(in(state, "e.fits")), 2 + ldac);
        assert_int_equal(rx_fits_read_table(in(state, "e.fits"), 0, &back, NULL), RX_OK);
        check_equal(table, back);
        rx_table_free(back);
        unlink(in(state, "e.fits"));
    }
    rx_table_free(table);
}

static void test_ldac(void **state)
{
    rx_table *table = make_table(), *back = NULL;
    rx_text cards = {0}, extra = {0};
    rx_fits_writer *writer = NULL;
    cards_from("SIMPLE  =                    T\nNAXIS1  =                   20\nEXPTIME = 30.0", &cards);
    rx_card_number(&extra, "SEXBKDEV", 2.5, "noise");
    table->cards = cards.data;
    table->ncards = 3;
    assert_int_equal(rx_fits_create(in(state, "l.fits"), "l", &writer, NULL), RX_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(rx_fits_ldac(writer, table, &extra, NULL), RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    assert_int_equal(sum_hdus(in(state, "l.fits")), 5);
    assert_int_equal(rx_fits_read_table(in(state, "l.fits"), 2, &back, NULL), RX_INPUT);
    assert_int_equal(rx_fits_read_table(in(state, "l.fits"), 1, &back, NULL), RX_OK);
    check_equal(table, back);
    assert_string_equal(back->name, "LDAC_OBJECTS");
    rx_table_free(back);
    back = NULL;
    assert_int_equal(rx_fits_read_table(in(state, "l.fits[1]"), 0, &back, NULL), RX_OK);
    const rx_column *head = &back->columns[0];
    assert_string_equal(back->name, "LDAC_IMHEAD");
    assert_string_equal(head->name, "Field Header Card");
    assert_int_equal(back->nrows, 1);
    char *header = header_of(in(state, "l.fits"), 2);
    assert_non_null(strstr(header, "TDIM1   = '(80,5)"));
    assert_non_null(strstr(header, "TFORM1  = '400A"));
    free(header);
    size_t size = 0;
    char *data = file_bytes(in(state, "l.fits"), &size);
    const char *first = data + 2880 * 2; /* after primary and header */
    assert_memory_equal(first, cards.data, 240);
    assert_memory_equal(first + 240, extra.data, 80);
    assert_memory_equal(first + 320, "END     ", 8);
    free(data);
    rx_error err = RX_ERROR_NONE;
    rx_table *none = NULL;
    assert_int_equal(rx_fits_read_table(in(state, "l.fits"), 2, &none, &err), RX_INPUT);
    assert_null(none);
    rx_table_free(back);
    rx_table_free(table); /* frees the cards too */
    rx_text_free(&extra);
}

/* Every column type cfitsio writes: scaled, unsigned, logical, bits, complex, nulls, text vectors. */
static void test_column_types(void **state)
{
    char *names[] = {"LOG", "BITS", "BYTE", "NULLI", "SCALED", "UNSIGNED", "CPLX", "CUBE", "WORDS", "VAR"};
    char *forms[] = {"2L", "3X", "1B", "1J", "1I", "1J", "1C", "8E", "6A3", "1PE"};
    fitsfile *file = NULL;
    int failed = 0;
    char logical[2] = {1, 0}, bits[3] = {1, 0, 1};
    int values[2] = {5, -99};
    short raw[1] = {10};
    unsigned int big = 4000000000u;
    float complex[2] = {1.5f, -2.5f}, cube[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    LONGLONG axes[3] = {2, 2, 2};
    char *words[] = {"abc", "d"};
    rx_table *t = NULL;
    fits_create_diskfile(&file, in(state, "c.fits"), &failed);
    fits_create_tbl(file, BINARY_TBL, 0, 10, names, forms, NULL, "T", &failed);
    fits_update_key_lng(file, "TNULL4", -99, NULL, &failed);
    fits_update_key_dbl(file, "TSCAL5", 0.5, 10, NULL, &failed);
    fits_update_key_dbl(file, "TZERO5", 100, 10, NULL, &failed);
    fits_update_key_dbl(file, "TZERO6", 2147483648., 15, NULL, &failed);
    fits_set_hdustruc(file, &failed);
    fits_write_tdimll(file, 8, 3, axes, &failed);
    fits_write_col(file, TLOGICAL, 1, 1, 1, 2, logical, &failed);
    fits_write_col_bit(file, 2, 1, 1, 3, bits, &failed);
    fits_write_col(file, TINT, 3, 1, 1, 1, values, &failed);
    fits_write_col(file, TINT, 4, 1, 1, 2, values, &failed);
    fits_set_tscale(file, 5, 1, 0, &failed);
    fits_write_col(file, TSHORT, 5, 1, 1, 1, raw, &failed);
    fits_write_col(file, TUINT, 6, 1, 1, 1, &big, &failed);
    fits_write_col(file, TCOMPLEX, 7, 1, 1, 1, complex, &failed);
    fits_write_col(file, TFLOAT, 8, 1, 1, 8, cube, &failed);
    fits_write_col(file, TSTRING, 9, 1, 1, 2, words, &failed);
    fits_close_file(file, &failed);
    assert_int_equal(failed, 0);
    assert_int_equal(rx_fits_read_table(in(state, "c.fits"), 0, &t, NULL), RX_OK);
    assert_int_equal(t->ncolumns, 9); /* variable length is left out */
    assert_int_equal(t->nrows, 2);
    assert_true(rx_column_value(&t->columns[0], 0, 0) == 1);
    assert_true(rx_column_value(&t->columns[0], 0, 1) == 0);
    assert_true(rx_column_value(&t->columns[1], 0, 0) == 1);
    assert_true(rx_column_value(&t->columns[1], 0, 1) == 0);
    assert_true(rx_column_value(&t->columns[1], 0, 2) == 1);
    assert_true(rx_column_value(&t->columns[2], 0, 0) == 5);
    assert_int_equal(t->columns[3].type, RX_CELL_DOUBLE);
    assert_true(rx_column_value(&t->columns[3], 0, 0) == 5);
    assert_true(isnan(rx_column_value(&t->columns[3], 1, 0)));
    assert_true(rx_column_value(&t->columns[4], 0, 0) == 105);
    assert_true(rx_column_value(&t->columns[5], 0, 0) == 4000000000.);
    assert_true(rx_column_value(&t->columns[6], 0, 0) == 1.5);
    assert_true(rx_column_value(&t->columns[6], 0, 1) == -2.5);
    assert_int_equal(t->columns[7].ndim, 2);
    assert_true(t->columns[7].dim[0] == 2);
    assert_true(t->columns[7].dim[1] == 4);
    assert_true(rx_column_value(&t->columns[7], 0, 5) == 5);
    assert_int_equal(t->columns[8].text_width, 4);
    assert_string_equal((char *)t->columns[8].data, "abc");
    assert_string_equal((char *)t->columns[8].data + 4, "d");
    rx_table_free(t);
}

/* --- errors while writing --- */

/* --- cards --- */

static void test_cards(void **state)
{
    rx_text t = {0};
    char long_text[201], back[300];
    double value = 0;
    memset(long_text, 'a', 200);
    long_text[67] = long_text[68] = '\'';
    long_text[200] = '\0';
    rx_card_text(&t, "SHORT", "it's", "a comment");
    rx_card_text(&t, "LONG", long_text, "");
    rx_card_text(&t, "EMPTY", "", "");
    rx_card_number(&t, "PI", 3.141592653589793, "");
    rx_card_number(&t, "TENTH", 0.1, "");
    rx_card_number(&t, "WHOLE", 4, "");
    rx_card_number(&t, "NOTHING", NAN, "");
    rx_card_integer(&t, "N", -7, "");
    rx_card_text(&t, "ESO DET NAME", "caf\xc3\xa9\n", "");
    rx_card_record(&t, "a",
                   "line that is so long that it must be wrapped into two cards because it has more than "
                   "seventy-two characters",
                   "");
    long n = (long)t.length / 80;
    assert_int_equal(t.length % 80, 0);
    for (size_t i = 0; i < t.length; i++) {
        assert_true(t.data[i] >= 0x20);
        assert_true(t.data[i] <= 0x7e);
    }
    assert_int_equal(rx_cards_text(t.data, n, "SHORT", back, sizeof back), 1);
    assert_string_equal(back, "it's");
    assert_int_equal(rx_cards_text(t.data, n, "LONG", back, sizeof back), 1);
    assert_string_equal(back, long_text);
    assert_int_equal(rx_cards_text(t.data, n, "EMPTY", back, sizeof back), 1);
    assert_string_equal(back, "");
    assert_int_equal(rx_cards_number(t.data, n, "PI", &value), 1);
    assert_true(value == 3.141592653589793);
    assert_int_equal(rx_cards_number(t.data, n, "TENTH", &value), 1);
    assert_true(value == 0.1);
    assert_int_equal(rx_cards_number(t.data, n, "WHOLE", &value), 1);
    assert_true(value == 4);
    assert_int_equal(rx_cards_number(t.data, n, "NOTHING", &value), 0);
    assert_int_equal(rx_cards_number(t.data, n, "SHORT", &value), 0);
    assert_int_equal(rx_cards_number(t.data, n, "NOSUCH", &value), 0);
    assert_int_equal(rx_cards_number(t.data, n, "N", &value), 1);
    assert_true(value == -7);
    assert_int_equal(rx_cards_text(t.data, n, "ESO DET NAME", back, sizeof back), 1);
    assert_string_equal(back, "caf???");
    assert_memory_equal(t.data + (n - 2) * 80, "HISTORY a = line", 16);
    assert_memory_equal(t.data + (n - 1) * 80, "HISTORY ", 8);
    assert_int_equal(rx_cards_text(t.data, n, "LONG", back, 10), 1); /* cut, never beyond the end */
    assert_int_equal(strlen(back), 9);
    rx_text_free(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_image),        cmocka_unit_test(test_read_image), cmocka_unit_test(test_table),
        cmocka_unit_test(test_empty_table),  cmocka_unit_test(test_whole_file), cmocka_unit_test(test_ldac),
        cmocka_unit_test(test_column_types), cmocka_unit_test(test_cards)};
    return cmocka_run_group_tests_name("FITS files", tests, make_scratch, remove_scratch);
}
