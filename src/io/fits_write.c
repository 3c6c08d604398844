/* Writing images and tables as FITS. */
#include "io/fits_write.h"

#include <endian.h>
#include <fitsio.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/arena.h"
#include "base/memory.h"
#include "io/cards.h"
#include "io/fits_file.h"
#include "io/fits_read.h"

struct rx_fits_writer {
    fitsfile *file;
    char *path, *shown;
    int hdus; /* made so far */
};

/* Creating, writing, reading back, closing, seeking: the disk's own faults. */
static int is_disk_fault(int failed)
{
    return failed >= FILE_NOT_OPENED && failed <= SEEK_ERROR;
}

static rx_status broken(const rx_fits_writer *writer, int failed, rx_error *err)
{
    if (is_disk_fault(failed))
        fits_clear_errmsg(); /* its lines name the temporary file, and elements of cfitsio's buffers */
    return rx_fits_check(&(rx_fits_source){.path = writer->shown, .hdu = -1}, RX_SYSTEM, failed,
                         is_disk_fault(failed) && failed != FILE_NOT_CREATED
                             ? "cannot be written, perhaps the disk is full"
                             : "cannot be written",
                         err);
}

rx_status rx_fits_create(const char *path, const char *shown, rx_fits_writer **dst, rx_error *err)
{
    rx_status status = RX_OK;
    int failed = 0;
    rx_fits_writer *writer;
    RX_TRY(RX_MAKE(writer, 1, err));
    writer->path = rx_strdup(path);
    writer->shown = rx_strdup(shown);
    if (writer->path == NULL || writer->shown == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (strlen(path) >= FLEN_FILENAME - 1) {
        status = rx_error_at(err, RX_SYSTEM, shown, -1, 0, "the name is too long; give a shorter one");
        goto exit;
    }
    char literal[RX_FITS_LITERAL];
    rx_fits_literal(path, literal);
    fits_clear_errmsg();
    if (fits_create_diskfile(&writer->file, literal, &failed)) {
        writer->file = NULL;
        status = broken(writer, failed, err);
        goto exit;
    }
    *dst = writer;
    writer = NULL;
exit:
    rx_fits_abort(writer);
    return status;
}

static void forget(rx_fits_writer *writer)
{
    free(writer->path);
    free(writer->shown);
    free(writer);
}

void rx_fits_abort(rx_fits_writer *writer)
{
    int ignored = 0;
    if (writer == NULL)
        return;
    if (writer->file != NULL) {
        fits_close_file(writer->file, &ignored);
        unlink(writer->path);
    }
    fits_clear_errmsg();
    forget(writer);
}

rx_status rx_fits_close(rx_fits_writer *writer, rx_error *err)
{
    int failed = 0;
    rx_status status = RX_OK;
    if (writer == NULL)
        return RX_OK;
    rx_error trouble = rx_error_part(err);
    /* the last headers are written while closing, where cfitsio does not look at every result */
    if (fits_close_file(writer->file, &failed))
        status = broken(writer, failed, err);
    else if ((status = rx_fits_verify(writer->path, writer->hdus, &trouble)) == RX_SYSTEM)
        rx_error_at(err, RX_SYSTEM, writer->shown, -1, 0, "cannot be read back: %s", trouble.text);
    else if (status != RX_OK)
        /* what cfitsio says of it would name the temporary file */
        status = rx_error_at(err, RX_SYSTEM, writer->shown, trouble.hdu, 0,
                             "cannot be written, perhaps the disk is full: read back, the file is damaged");
    if (status != RX_OK)
        unlink(writer->path);
    forget(writer);
    return status;
}

/* --- sums ---
 *
 * DATASUM (FITS 4.0, 4.4.2.7 and appendix J), the one's complement sum of the 32-bit words, comes from memory, as cfitsio forms
 * it from what it reads back, so that a write that failed unnoticed would get a sum that fits. */

enum { ROOM = 8192 };

uint32_t rx_fits_sum_bytes(uint32_t sum, const void *bytes, size_t n)
{
    const unsigned char *byte = bytes;
    uint64_t total = sum;
    size_t i = 0;
    for (; i + 4 <= n; i += 4) {
        uint32_t word;
        memcpy(&word, byte + i, sizeof word);
        total += be32toh(word);
    }
    for (unsigned shift = 24; i < n; i++, shift -= 8)
        total += (uint32_t)byte[i] << shift;
    while (total >> 32 != 0)
        total = (total & 0xffffffff) + (total >> 32);
    return (uint32_t)total;
}

/* The bytes of a data unit, one after the other, through a room of whole words. */
typedef struct unit {
    uint8_t room[ROOM];
    size_t used;
    uint32_t sum;
    bool is_hashed;
    rx_hash hash;
} unit;

static void begin(unit *u, const char *dst)
{
    u->used = u->sum = 0;
    u->is_hashed = dst != NULL;
    rx_hash_begin(&u->hash);
}

/* The last bytes stay that are no whole word, unless they are the end. */
static void flush(unit *u, bool at_end)
{
    const size_t rest = at_end ? 0 : u->used % 4, n = u->used - rest;
    u->sum = rx_fits_sum_bytes(u->sum, u->room, n);
    if (u->is_hashed)
        rx_hash_add(&u->hash, u->room, n);
    memmove(u->room, u->room + n, rest);
    u->used = rest;
}

static uint32_t end(unit *u, char *dst)
{
    flush(u, true);
    if (dst != NULL)
        rx_hash_text(&u->hash, dst);
    return u->sum;
}

/* For each size its own loop, which compilers turn into vector code. */
#define SWAP(bits)                                                                                           \
    do {                                                                                                     \
        for (size_t i = 0; i < some; i++) {                                                                  \
            uint##bits##_t number;                                                                           \
            memcpy(&number, from + i * sizeof number, sizeof number);                                        \
            number = htobe##bits(number);                                                                    \
            memcpy(to + i * sizeof number, &number, sizeof number);                                          \
        }                                                                                                    \
    } while (0)

/* n numbers of 2, 4 or 8 bytes, the most significant one first. */
static void add_numbers(unit *u, const void *numbers, size_t n, size_t size)
{
    for (const uint8_t *from = numbers; n > 0;) {
        if (ROOM - u->used < size)
            flush(u, false);
        const size_t room = (ROOM - u->used) / size, some = n < room ? n : room;
        uint8_t *to = u->room + u->used;
        if (size == 2)
            SWAP(16);
        else if (size == 4)
            SWAP(32);
        else
            SWAP(64);
        u->used += some * size;
        from += some * size;
        n -= some;
    }
}

/* A text is filled up with blanks. */
static void add_text(unit *u, const char *text, size_t width)
{
    bool over = false;
    for (size_t i = 0; i < width; i++) {
        if (u->used == ROOM)
            flush(u, false);
        over = over || text[i] == '\0';
        u->room[u->used++] = (uint8_t)(over ? ' ' : text[i]);
    }
}

uint32_t rx_fits_digest_pixels(const void *pixels, size_t n, char dst[RX_HASH_TEXT])
{
    unit u;
    begin(&u, dst);
    add_numbers(&u, pixels, n, 4);
    return end(&u, dst);
}

/* Characters of a text cell in the file: the terminating zero does not go there. */
static long text_length(const rx_column *column)
{
    return column->text_width > 1 ? column->text_width - 1 : 1;
}

uint32_t rx_fits_digest_table(const rx_table *table, char dst[RX_HASH_TEXT])
{
    unit u;
    begin(&u, dst);
    for (long row = 0; row < table->nrows; row++)
        for (int i = 0; i < table->ncolumns; i++) {
            const rx_column *column = &table->columns[i];
            const long n = rx_column_elements(column), size = rx_column_element_size(column);
            const char *cell = (const char *)column->data + row * n * size;
            if (column->type != RX_CELL_TEXT)
                add_numbers(&u, cell, (size_t)n, (size_t)size);
            for (long e = 0; column->type == RX_CELL_TEXT && e < n; e++)
                add_text(&u, cell + e * size, (size_t)text_length(column));
        }
    return end(&u, dst);
}

/* --- headers --- */

static void write_cards(fitsfile *file, const char *cards, size_t n, int filter, int *failed)
{
    int skipped = 0; /* CONTINUE follows what its first card did */
    for (size_t i = 0; cards != NULL && i < n && *failed == 0; i++) {
        char card[RX_CARD + 1];
        memcpy(card, cards + i * RX_CARD, RX_CARD);
        card[RX_CARD] = '\0';
        if (strncmp(card, "END     ", 8) == 0)
            continue;
        if (strncmp(card, "CONTINUE", 8) != 0)
            skipped = filter && !rx_card_is_useful(card);
        if (!skipped)
            fits_write_record(file, card, failed);
    }
}

/* Readers of before FITS 4.0 know by LONGSTRN that CONTINUE goes on with a string. */
static void declare_long_strings(fitsfile *file, int *failed)
{
    int n = 0;
    fits_get_hdrspace(file, &n, NULL, failed);
    for (int i = 1; i <= n && *failed == 0; i++) {
        char card[FLEN_CARD] = "";
        fits_read_record(file, i, card, failed);
        if (strncmp(card, "CONTINUE", 8) == 0) {
            fits_update_key_str(file, "LONGSTRN", "OGIP 1.0", "CONTINUE cards go on with long strings",
                                failed);
            return;
        }
    }
}

static void write_extra(fitsfile *file, const rx_text *extra, int *failed)
{
    if (extra != NULL)
        write_cards(file, extra->data, extra->length / RX_CARD, 0, failed);
    declare_long_strings(file, failed);
}

/* DATASUM and CHECKSUM (FITS 4.0, appendix J) by hand: cfitsio's own way puts the time of day
 * into the comments, and the same input must give the same bytes. datasum: of what should be there. */
static void write_checksum(fitsfile *file, uint32_t datasum, int *failed)
{
    unsigned long found = 0, hdusum = 0;
    char text[32];
    snprintf(text, sizeof text, "%lu", (unsigned long)datasum);
    fits_update_key_str(file, "DATASUM", text, "data unit checksum", failed);
    fits_update_key_str(file, "CHECKSUM", "0000000000000000", "HDU checksum", failed);
    fits_set_hdustruc(file, failed);
    fits_get_chksum(file, &found, &hdusum, failed);
    if (*failed == 0 && found != datasum)
        *failed = WRITE_ERROR; /* cfitsio overlooks some */
    fits_encode_chksum(hdusum, 1, text);
    fits_modify_key_str(file, "CHECKSUM", text, "&", failed);
}

/* The last step of each HDU. */
static rx_status end_hdu(rx_fits_writer *writer, uint32_t datasum, int *failed, rx_error *err)
{
    write_checksum(writer->file, datasum, failed);
    writer->hdus++;
    return *failed ? broken(writer, *failed, err) : RX_OK;
}

static void write_extname(fitsfile *file, const char *name, int *failed)
{
    if (name != NULL && name[0] != '\0')
        fits_update_key_longstr(file, "EXTNAME", name, "name of this extension", failed);
}

/* --- images --- */

rx_fits_plane rx_fits_plane_of(const rx_tile *tile)
{
    return (rx_fits_plane){.extname = tile->extname,
                           .width = tile->width,
                           .height = tile->height,
                           .cards = tile->cards,
                           .ncards = tile->ncards};
}

rx_status rx_fits_image(rx_fits_writer *writer, const rx_fits_plane *plane, const rx_text *extra,
                        rx_error *err)
{
    int failed = 0;
    LONGLONG axes[2] = {plane->width, plane->height};
    union {
        const void *given;
        void *taken; /* cfitsio forgot the const */
    } data = {.given = plane->floats != NULL ? (const void *)plane->floats : plane->integers};
    fits_clear_errmsg();
    fits_create_imgll(writer->file, plane->floats != NULL ? FLOAT_IMG : LONG_IMG, 2, axes, &failed);
    write_extname(writer->file, plane->extname, &failed);
    write_cards(writer->file, plane->cards, plane->ncards, 1, &failed);
    write_extra(writer->file, extra, &failed);
    fits_write_img(writer->file, plane->floats != NULL ? TFLOAT : TINT, 1, axes[0] * axes[1], data.taken,
                   &failed);
    return end_hdu(writer, rx_fits_digest_pixels(data.given, (size_t)(axes[0] * axes[1]), NULL), &failed,
                   err);
}

/* --- tables --- */

rx_status rx_fits_primary(rx_fits_writer *writer, const rx_text *extra, rx_error *err)
{
    int failed = 0;
    fits_clear_errmsg();
    fits_create_imgll(writer->file, BYTE_IMG, 0, NULL, &failed);
    write_extra(writer->file, extra, &failed);
    return end_hdu(writer, 0, &failed, err);
}

/* By rx_cell_type. */
static const int cell_types[] = {TSHORT, TINT, TLONGLONG, TFLOAT, TDOUBLE, TSTRING};

/* FITS display format from a printf one: %11.4f is F11.4, %-8d is I8. Nothing for what has none. */
static void write_display(fitsfile *file, int number, const rx_column *column, int *failed)
{
    static const char kinds[] = "dfeEgG", letters[] = "IFEEGG";
    char key[FLEN_KEYWORD], text[48];
    const char *c = column->format + strspn(column->format, "%-+");
    char *end;
    const long width = strtol(c, &end, 10);
    const bool has_digits = *end == '.';
    const long digits = has_digits ? strtol(end + 1, &end, 10) : 0;
    const char *kind = *end != '\0' ? strchr(kinds, *end) : NULL;
    if (width < 1 || kind == NULL || has_digits != (*kind != 'd'))
        return;
    const int n = snprintf(text, sizeof text, "%c%ld", letters[kind - kinds], width);
    if (has_digits)
        snprintf(text + n, sizeof text - (size_t)n, ".%ld", digits);
    snprintf(key, sizeof key, "TDISP%d", number);
    fits_update_key_str(file, key, text, NULL, failed);
}

/* What fits_create_tbl cannot say: dimensions, UCD, description, display. */
static void write_column_keys(fitsfile *file, int number, const rx_column *column, int *failed)
{
    char key[FLEN_KEYWORD];
    if (column->ndim == 2 || (column->type == RX_CELL_TEXT && column->ndim == 1)) {
        LONGLONG axes[3];
        int n = 0;
        if (column->type == RX_CELL_TEXT)
            axes[n++] = text_length(column);
        for (int i = 0; i < column->ndim; i++)
            axes[n++] = column->dim[i];
        fits_write_tdimll(file, number, n, axes, failed);
    }
    if (column->description[0] != '\0') {
        char comment[FLEN_COMMENT];
        snprintf(comment, sizeof comment, "%.*s", FLEN_COMMENT - 1, column->description);
        snprintf(key, sizeof key, "TTYPE%d", number);
        fits_modify_comment(file, key, comment, failed);
        snprintf(key, sizeof key, "TCOMM%d",
                 number); /* where readers of tables look; 68 characters fit a card */
        snprintf(comment, sizeof comment, "%.68s", column->description);
        fits_update_key_str(file, key, comment, NULL, failed);
    }
    if (column->ucd[0] != '\0') {
        snprintf(key, sizeof key, "TUCD%d", number);
        fits_update_key_str(file, key, column->ucd, NULL, failed);
    }
    write_display(file, number, column, failed);
}

static rx_status write_text_block(fitsfile *file, int number, const rx_column *column, long first, long rows,
                                  int *failed, rx_error *err)
{
    long n = rx_column_elements(column);
    char **list;
    RX_TRY(RX_MAKE(list, (size_t)(rows * n), err));
    for (long i = 0; i < rows * n; i++)
        list[i] = (char *)column->data + (first * n + i) * column->text_width;
    fits_write_col(file, TSTRING, number, first + 1, 1, rows * n, list, failed);
    free(list);
    return RX_OK;
}

/* Row blocks, all columns of a block: cfitsio's buffers then see the file once. */
static rx_status write_rows(rx_fits_writer *writer, const rx_table *table, int *failed, rx_error *err)
{
    long row_bytes = 1;
    for (int i = 0; i < table->ncolumns; i++)
        row_bytes += rx_column_elements(&table->columns[i]) * rx_column_element_size(&table->columns[i]);
    long block = RX_FITS_ROWS / row_bytes + 1;
    for (long first = 0; first < table->nrows && *failed == 0; first += block) {
        long rows = table->nrows - first < block ? table->nrows - first : block;
        for (int i = 0; i < table->ncolumns; i++) {
            const rx_column *column = &table->columns[i];
            long n = rx_column_elements(column), size = rx_column_element_size(column);
            rx_status status = RX_OK;
            if (column->type == RX_CELL_TEXT)
                status = write_text_block(writer->file, i + 1, column, first, rows, failed, err);
            else
                fits_write_col(writer->file, cell_types[column->type], i + 1, first + 1, 1, rows * n,
                               (char *)column->data + first * n * size, failed);
            if (status != RX_OK)
                return status;
        }
    }
    return RX_OK;
}

static rx_status write_table(rx_fits_writer *writer, const rx_table *table, const char *extname,
                             const rx_text *extra, rx_error *err)
{
    int failed = 0, n = table->ncolumns;
    rx_status status;
    rx_arena arena = {0};
    char **names = RX_TAKE(&arena, char *, (size_t)n), **forms = RX_TAKE(&arena, char *, (size_t)n),
         **units = RX_TAKE(&arena, char *, (size_t)n);
    char(*form)[40] = rx_arena_take(&arena, (size_t)n, sizeof *form);
    if (names == NULL || forms == NULL || units == NULL || form == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (int i = 0; i < n; i++) {
        rx_column *column = &table->columns[i];
        const long elements = rx_column_elements(column), width = text_length(column);
        names[i] = column->name;
        units[i] = column->unit;
        forms[i] = form[i];
        if (column->type == RX_CELL_TEXT)
            snprintf(form[i], sizeof form[i], "%ldA%ld", elements * width, width);
        else
            snprintf(form[i], sizeof form[i], "%ld%c", elements, "IJKED"[column->type]);
    }
    fits_clear_errmsg();
    fits_create_tbl(writer->file, BINARY_TBL, table->nrows, n, names, forms, units, NULL, &failed);
    write_extname(writer->file, extname, &failed);
    for (int i = 0; i < n; i++)
        write_column_keys(writer->file, i + 1, &table->columns[i], &failed);
    write_extra(writer->file, extra, &failed);
    fits_set_hdustruc(writer->file, &failed);
    RX_TRY_EXIT(write_rows(writer, table, &failed, err));
    status = end_hdu(writer, rx_fits_digest_table(table, NULL), &failed, err);
exit:
    rx_arena_free(&arena);
    return status;
}

/* An extension cannot come first. */
static rx_status begin_file(rx_fits_writer *writer, rx_error *err)
{
    return writer->hdus > 0 ? RX_OK : rx_fits_primary(writer, NULL, err);
}

rx_status rx_fits_table(rx_fits_writer *writer, const rx_table *table, const rx_text *extra, rx_error *err)
{
    RX_TRY(begin_file(writer, err));
    return write_table(writer, table, table->name, extra, err);
}

/* --- FITS_LDAC --- */

/* The image's header as the only cell of the only row, END included: what SExtractor hands to PSFEx and SCAMP. */
static rx_status write_imhead(rx_fits_writer *writer, const rx_table *table, const rx_text *extra,
                              rx_error *err)
{
    int failed = 0;
    char form[40], end[RX_CARD + 1], *type = "Field Header Card", *forms = form;
    rx_text text = {0};
    if (table->cards != NULL)
        rx_text_add_bytes(&text, table->cards, (size_t)table->ncards * RX_CARD);
    if (extra != NULL && extra->length > 0)
        rx_text_add_bytes(&text, extra->data, extra->length);
    snprintf(end, sizeof end, "%-80s", "END");
    rx_text_add_bytes(&text, end, RX_CARD);
    if (text.failed) {
        rx_text_free(&text);
        return rx_error_memory(err, text.length);
    }
    LONGLONG axes[2] = {RX_CARD, (LONGLONG)(text.length / RX_CARD)};
    snprintf(form, sizeof form, "%zuA", text.length);
    fits_clear_errmsg();
    fits_create_tbl(writer->file, BINARY_TBL, 1, 1, &type, &forms, NULL, NULL, &failed);
    write_extname(writer->file, "LDAC_IMHEAD", &failed);
    fits_write_tdimll(writer->file, 1, 2, axes, &failed);
    fits_set_hdustruc(writer->file, &failed);
    fits_write_tblbytes(writer->file, 1, 1, (LONGLONG)text.length, (unsigned char *)text.data, &failed);
    const rx_status status = end_hdu(writer, rx_fits_sum_bytes(0, text.data, text.length), &failed, err);
    rx_text_free(&text);
    return status;
}

rx_status rx_fits_ldac(rx_fits_writer *writer, const rx_table *table, const rx_text *extra, rx_error *err)
{
    RX_TRY(begin_file(writer, err));
    RX_TRY(write_imhead(writer, table, extra, err));
    return write_table(writer, table, "LDAC_OBJECTS", extra, err);
}
