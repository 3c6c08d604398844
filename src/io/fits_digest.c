/* Data units as a file has them, from memory and from files. */
#include "io/fits_digest.h"

#include <endian.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <fitsio2.h> /* ffgbyt() */

#include "base/input.h"
#include "io/cards.h"
#include "io/fits_file.h"
#include "io/guard/guard.h"

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

/* Where the data of the current HDU begin, and how many bytes they have without the heap. */
static rx_status find_data(const rx_fits_source *source, LONGLONG *from, LONGLONG *bytes, rx_error *err)
{
    rx_fits_shape shape;
    LONGLONG header, last;
    int failed = 0;
    bool absurd = false;
    RX_TRY(rx_fits_shape_of(source, &shape, err));
    fits_get_hduaddrll(source->file, &header, from, &last, &failed);
    if (!shape.is_image || shape.is_compressed) {
        shape = (rx_fits_shape){.naxis = 2, .bitpix = 8};
        fits_read_key(source->file, TLONGLONG, "NAXIS1", &shape.axes[0], NULL, &failed);
        fits_read_key(source->file, TLONGLONG, "NAXIS2", &shape.axes[1], NULL, &failed);
    }
    *bytes = shape.naxis > 0 ? abs(shape.bitpix) / 8 : 0;
    for (int i = 0; i < shape.naxis && i < RX_FITS_AXES; i++)
        absurd |= shape.axes[i] < 0 || __builtin_mul_overflow(*bytes, shape.axes[i], bytes);
    if (failed)
        return rx_fits_failed(err, RX_INPUT, source->path, source->hdu, failed, "cannot be read");
    if (absurd || *bytes > last - *from)
        return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                           "is cut off or its header claims too much");
    return RX_OK;
}

rx_status rx_fits_digest_hdu(const char *path, int hdu, char dst[RX_HASH_TEXT], rx_error *err)
{
    uint8_t room[ROOM];
    rx_fits_source source = {0};
    LONGLONG from = 0, left = 0;
    int failed = 0;
    rx_hash sum;
    rx_status status;
    rx_hash_begin(&sum);
    RX_TRY_EXIT(rx_fits_open(path, &source, err));
    RX_TRY_EXIT(rx_fits_goto(&source, hdu, err));
    RX_TRY_EXIT(find_data(&source, &from, &left, err));
    if (left > 0)
        ffmbyt(source.file, from, REPORT_EOF, &failed);
    for (LONGLONG some; left > 0 && !failed; left -= some) {
        some = left < ROOM ? left : ROOM;
        ffgbyt(source.file, some, room, &failed);
        rx_hash_add(&sum, room, failed ? 0 : (size_t)some);
    }
    if (failed)
        status = rx_fits_failed(err, RX_INPUT, path, hdu, failed, "cannot be read to its end");
    rx_hash_text(&sum, dst);
exit:
    rx_fits_done(&source);
    return status;
}

rx_status rx_fits_hdus(const char *path, int *n, rx_error *err)
{
    rx_fits_source source = {0};
    *n = 0;
    rx_status status = rx_fits_open(path, &source, err);
    if (status == RX_OK)
        status = rx_fits_count(&source, n, NULL, err);
    rx_fits_done(&source);
    return status;
}

/* --- is a file as it was written? --- */

typedef struct verifier {
    const char *path;
    int file, hdu;
} verifier;

static rx_status damaged(const verifier *v, const char *what, rx_error *err)
{
    return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0,
                       "%s: the file is damaged or was edited; fetch or make it again", what);
}

/* *n: 0 at the end of the file, else a whole block. */
static rx_status read_block(const verifier *v, int64_t place, unsigned char *block, ssize_t *n, rx_error *err)
{
    *n = rx_input_read(v->file, block, RX_FITS_BLOCK, place);
    if (*n < 0)
        return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0, "cannot be read: %s", strerror(errno));
    if (*n != 0 && *n != RX_FITS_BLOCK)
        return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0,
                           "is cut off: its size is no multiple of %d bytes; fetch it again", RX_FITS_BLOCK);
    return RX_OK;
}

/* `sum` goes on over the blocks from .. to - 1 of the file. */
static rx_status sum_blocks(const verifier *v, int64_t from, int64_t to, uint32_t *sum, rx_error *err)
{
    unsigned char block[RX_FITS_BLOCK];
    for (ssize_t n; from < to; from += RX_FITS_BLOCK) {
        RX_TRY(read_block(v, from, block, &n, err));
        if (n == 0)
            return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0,
                               "is cut off: %" PRId64 " bytes are missing; fetch it again", to - from);
        *sum = rx_fits_sum_bytes(*sum, block, RX_FITS_BLOCK);
    }
    return RX_OK;
}

/* *place moves behind the header; *more 0: there is no further HDU. */
static rx_status read_header(const verifier *v, int64_t *place, rx_fits_header *dst, bool *more,
                             rx_error *err)
{
    unsigned char block[RX_FITS_BLOCK];
    ssize_t n;
    bool whole;
    RX_TRY(read_block(v, *place, block, &n, err));
    *more = n > 0;
    if (!*more)
        return RX_OK;
    if (memcmp(block, v->hdu == 0 ? "SIMPLE  = " : "XTENSION= ", 10) != 0)
        return damaged(v,
                       v->hdu == 0 ? "is not plain FITS (unpack it if it is compressed)"
                                   : "no HDU begins where this one should",
                       err);
    RX_TRY(rx_fits_walk_header(v->file, place, dst, &whole, err));
    if (dst->fault[0] != '\0')
        return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0, "%s", dst->fault);
    return whole ? RX_OK : damaged(v, "the header has no END", err);
}

static rx_status verify_hdu(const verifier *v, int64_t *place, rx_fits_header *header, bool *more,
                            rx_error *err)
{
    const int64_t begin = *place;
    uint32_t data = 0;
    char datasum[24], checksum[24], *end;
    RX_TRY(read_header(v, place, header, more, err));
    if (!*more)
        return RX_OK;
    const int64_t from = *place, bytes = rx_fits_layout_bytes(&header->layout);
    if (bytes < 0 || __builtin_add_overflow(from, bytes, place))
        return damaged(v, "the size of its data makes no sense", err);
    RX_TRY(sum_blocks(v, from, *place, &data, err));
    uint32_t sum = data;
    RX_TRY(sum_blocks(v, begin, from, &sum, err));
    const long n = (long)(header->cards.length / RX_CARD);
    const bool has_checksum = rx_cards_text(header->cards.data, n, "CHECKSUM", checksum, sizeof checksum);
    if (!rx_cards_text(header->cards.data, n, "DATASUM", datasum, sizeof datasum) || !has_checksum)
        return rx_error_at(
            err, RX_INPUT, v->path, v->hdu, 0,
            "has no %s, so that it cannot be checked whether it is whole; fetch or make it again",
            has_checksum ? "DATASUM" : "CHECKSUM");
    if (strtoull(datasum, &end, 10) != data || *end != '\0')
        return damaged(v, "DATASUM does not fit the data", err);
    return sum == UINT32_MAX ? RX_OK : damaged(v, "CHECKSUM does not fit the HDU", err);
}

rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err)
{
    rx_status status = RX_OK;
    rx_fits_header header = {0};
    int64_t place = 0;
    verifier v = {.path = path, .file = open(path, O_RDONLY | O_CLOEXEC)};
    if (v.file < 0)
        return rx_error_file(err, path, "cannot be opened");
    for (bool more = true; more && status == RX_OK; v.hdu += more && status == RX_OK)
        status = verify_hdu(&v, &place, &header, &more, err);
    close(v.file);
    rx_text_free(&header.cards);
    if (status == RX_OK && nhdus > 0 && v.hdu != nhdus)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has %d HDUs, %d were written: the file is cut off or was edited; fetch or make "
                             "it again",
                             v.hdu, nhdus);
    if (status == RX_OK && v.hdu == 0)
        status = rx_error_at(err, RX_INPUT, path, -1, 0, "is an empty file; fetch it again");
    return status;
}
