/* Data units as a file has them, from memory, and what a file has against its sums. */
#include "io/fits_digest.h"

#include <endian.h>
#include <stdbool.h>
#include <string.h>

#include "io/fits_file.h"

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

/* n numbers of `size` bytes, the most significant one first. */
static void add_numbers(unit *u, const void *numbers, size_t n, size_t size)
{
    for (const uint8_t *from = numbers; n > 0;) {
        if (ROOM - u->used < size)
            flush(u, false);
        const size_t room = (ROOM - u->used) / size, some = n < room ? n : room;
        uint8_t *to = u->room + u->used;
        for (size_t i = 0; i < some && size == 2; i++) {
            uint16_t number;
            memcpy(&number, from + 2 * i, sizeof number);
            number = htobe16(number);
            memcpy(to + 2 * i, &number, sizeof number);
        }
        for (size_t i = 0; i < some && size == 4; i++) {
            uint32_t number;
            memcpy(&number, from + 4 * i, sizeof number);
            number = htobe32(number);
            memcpy(to + 4 * i, &number, sizeof number);
        }
        for (size_t i = 0; i < some && size == 8; i++) {
            uint64_t number;
            memcpy(&number, from + 8 * i, sizeof number);
            number = htobe64(number);
            memcpy(to + 8 * i, &number, sizeof number);
        }
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

long rx_fits_text_length(const rx_column *column)
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
                add_text(&u, cell + e * size, (size_t)rx_fits_text_length(column));
        }
    return end(&u, dst);
}

/* --- is a file as it was written? --- */

static rx_status damaged(const rx_fits_source *source, const char *what, rx_error *err)
{
    return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                       "%s: the file is damaged or was edited; fetch or make it again", what);
}

/* Where it is; *end: where the next HDU would begin. */
static rx_status verify_hdu(const rx_fits_source *source, LONGLONG *end, rx_error *err)
{
    rx_fits_shape shape;
    int data = 0, all = 0, failed = 0;
    RX_TRY(rx_fits_shape_of(source, &shape, err));
    if (!shape.is_image || shape.naxis > 0)
        RX_TRY(rx_fits_check_size(source, &shape, err));
    fits_get_hduaddrll(source->file, NULL, NULL, end, &failed);
    if (fits_verify_chksum(source->file, &data, &all, &failed))
        return rx_fits_failed(err, RX_INPUT, source->path, source->hdu, failed, "cannot be read to its end");
    if (data == 0 || all == 0)
        return rx_error_at(
            err, RX_INPUT, source->path, source->hdu, 0,
            "has no %s, so that it cannot be checked whether it is whole; fetch or make it again",
            all == 0 ? "CHECKSUM" : "DATASUM");
    return data < 0  ? damaged(source, "DATASUM does not fit the data", err)
           : all < 0 ? damaged(source, "CHECKSUM does not fit the HDU", err)
                     : RX_OK;
}

rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err)
{
    rx_fits_source source = {0};
    LONGLONG end = 0;
    int n = 0, broken = 0;
    rx_status status;
    RX_TRY_EXIT(rx_fits_open(path, &source, err));
    if (source.bytes > 0)
        RX_TRY_EXIT(
            damaged(&source, "is not plain FITS in whole blocks (unpack it if it is compressed)", err));
    RX_TRY_EXIT(rx_fits_count(&source, &n, &broken, err));
    for (int hdu = 0; hdu < n; hdu++) {
        RX_TRY_EXIT(rx_fits_goto(&source, hdu, err));
        RX_TRY_EXIT(verify_hdu(&source, &end, err));
    }
    source.hdu = n;
    if (broken || end != source.file->Fptr->filesize)
        RX_TRY_EXIT(damaged(&source, "no HDU begins where this one should", err));
    if (nhdus > 0 && n != nhdus)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has %d HDUs, %d were written: the file is cut off or was edited; fetch or make "
                             "it again",
                             n, nhdus);
exit:
    rx_fits_done(&source);
    return status;
}
