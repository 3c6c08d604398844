/* Damaged compressed images. */
#include "io/guard/guard.h"

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/memory.h"

typedef struct bits {
    const unsigned char *data;
    uint64_t at, end; /* in bits */
} bits;

static int take(bits *stream, int n, uint32_t *value)
{
    *value = 0;
    if (stream->end - stream->at < (uint64_t)n)
        return 0;
    for (; n > 0; n--, stream->at++)
        *value = *value << 1 | (stream->data[stream->at / 8] >> (7 - stream->at % 8) & 1u);
    return 1;
}

/* Zeros up to and with the next one. */
static int skip_unary(bits *stream)
{
    while (stream->at < stream->end) {
        if (stream->at % 8 == 0 && stream->data[stream->at / 8] == 0) {
            stream->at += 8;
            continue;
        }
        int one = stream->data[stream->at / 8] >> (7 - stream->at % 8) & 1;
        stream->at++;
        if (one)
            return 1;
    }
    return 0;
}

/* 1 when the stream holds n pixels of `bytes` bytes each: the first pixel, then blocks of a
 * code and its differences (all zero; raw; or unary part and code - 1 low bits). */
static int holds_rice(const unsigned char *data, size_t length, LONGLONG n, int bytes, int block)
{
    int code_bits = bytes == 4 ? 5 : bytes == 2 ? 4 : 3, raw = bytes == 4 ? 25 : bytes == 2 ? 14 : 6;
    uint32_t code;
    if (length < (size_t)bytes)
        return 0;
    bits stream = {.data = data, .at = 8 * (uint64_t)bytes, .end = 8 * (uint64_t)length};
    for (LONGLONG i = 0; i < n; i += block) {
        LONGLONG count = n - i < block ? n - i : block;
        if (!take(&stream, code_bits, &code))
            return 0;
        int low = (int)code - 1;
        if (low < 0)
            continue;
        uint64_t fixed = (uint64_t)(low == raw ? 8 * bytes : low);
        for (LONGLONG k = 0; k < count; k++) {
            if (low != raw && !skip_unary(&stream))
                return 0;
            if (stream.end - stream.at < fixed)
                return 0;
            stream.at += fixed;
        }
    }
    return 1;
}

/* A line list: where its codes begin and end, in its own header of either kind, and a code 1 takes the word
 * behind it. */
static bool holds_plio(const short *words, size_t length)
{
    if (length < 3 || (words[2] <= 0 && length < 5))
        return false;
    const long first = words[2] > 0 ? 3 : words[1];
    const long end = words[2] > 0 ? words[2] : (long)words[4] * 32768 + words[3];
    return first >= 0 && end > 0 && end <= (long)length && (words[end - 1] / 4096 != 1 || end < (long)length);
}

/* Bytes that a gzip stream unpacks to, up to `most`; -1: damaged, cut off, or more than that. */
static LONGLONG gzip_size(const unsigned char *data, size_t length, LONGLONG most)
{
    unsigned char room[1 << 12];
    int state = Z_OK;
    z_stream stream = {.next_in = (unsigned char *)(uintptr_t)data, .avail_in = (uInt)length};
    if (length > INT_MAX || inflateInit2(&stream, 16 + MAX_WBITS) != Z_OK)
        return -1;
    while (state == Z_OK && (LONGLONG)stream.total_out <= most) {
        stream.next_out = room;
        stream.avail_out = sizeof room;
        state = inflate(&stream, Z_NO_FLUSH);
    }
    const LONGLONG size = (LONGLONG)stream.total_out;
    inflateEnd(&stream);
    return state == Z_STREAM_END && size <= most ? size : -1;
}

/* What cfitsio takes of the header, whatever else it says. */
typedef struct method {
    int type;         /* RICE_1 ... */
    int bytes, block; /* Rice's */
    int bitpix, dither;
    bool unquantised; /* floating point as it is: pixels of fewer than 4 bytes would be taken for more */
    LONGLONG tile[MAX_COMPRESS_DIM]; /* nominal shape */
} method;

static method method_of(const fitsfile *file)
{
    enum { NO_QUANTIZE = 9999 };
    const FITSfile *all = file->Fptr;
    method dst = {.type = all->compress_type,
                  .bytes = all->rice_bytepix,
                  .block = all->rice_blocksize,
                  .bitpix = all->zbitpix,
                  .dither = all->dither_seed,
                  .unquantised = (int)all->quantize_level == NO_QUANTIZE};
    for (int i = 0; i < MAX_COMPRESS_DIM; i++)
        dst.tile[i] = i < all->zndim ? all->tilesize[i] : 1;
    return dst;
}

/* ZDITHER0 is where in a table of 10000 numbers cfitsio begins. */
static bool is_possible(const method *m)
{
    for (int i = 0; i < MAX_COMPRESS_DIM; i++)
        if (m->tile[i] < 1)
            return false;
    return m->dither >= 1 && m->dither <= 10000 &&
           (m->type != RICE_1 ||
            (m->block > 0 && (m->bytes == 4 || (!m->unquantised && (m->bytes == 1 || m->bytes == 2)))));
}

/* Pixels of the tile in that row (from 0) of the table; those at the far edges are smaller. */
static LONGLONG tile_pixels(const method *m, int naxis, const LONGLONG *axes, LONGLONG row)
{
    LONGLONG pixels = 1;
    for (int i = 0; i < naxis; i++) {
        const LONGLONG tile = i < MAX_COMPRESS_DIM ? m->tile[i] : 1, across = (axes[i] + tile - 1) / tile;
        const LONGLONG rest = axes[i] - row % across * tile;
        pixels *= rest < tile ? rest : tile;
        row /= across;
    }
    return pixels;
}

/* A column whose cells lie in the heap. */
typedef struct cells {
    fitsfile *file;
    int column; /* 0: there is none */
    int type, size;
    LONGLONG heap;
} cells;

static cells cells_of(fitsfile *file, int column, LONGLONG heap)
{
    cells dst = {.file = file, .heap = heap, .column = column};
    int failed = 0;
    if (column < 1)
        return (cells){0};
    fits_get_coltype(file, column, &dst.type, NULL, NULL, &failed);
    const int type = -dst.type; /* negative: in the heap */
    dst.size = type == TBYTE                          ? 1
               : type == TSHORT                       ? 2
               : type == TLONG || type == TFLOAT      ? 4
               : type == TLONGLONG || type == TDOUBLE ? 8
                                                      : 0;
    return dst;
}

/* Elements of the cell; -1: it does not lie in the heap. */
static LONGLONG cell_length(const cells *c, LONGLONG row)
{
    LONGLONG length = 0, offset = 0;
    int failed = 0;
    fits_read_descriptll(c->file, c->column, row + 1, &length, &offset, &failed);
    if (failed || c->size == 0 || length < 0 || offset < 0 || length > c->heap / c->size ||
        offset > c->heap - length * c->size)
        return -1;
    return length;
}

/* A gzip stream unpacks to one size of pixels that cfitsio reads rightly from it. */
static bool holds_gzip(const method *m, const unsigned char *data, size_t length, LONGLONG pixels,
                       bool is_normal)
{
    const LONGLONG size = gzip_size(data, length, 8 * pixels), bytes = size / pixels;
    if (size < 0 || size % pixels != 0)
        return false;
    if (!is_normal) /* the cell of a tile that was not made whole numbers */
        return m->bitpix < 0 && bytes == -m->bitpix / 8;
    return m->unquantised ? bytes == 4 || bytes == 8 : bytes == 1 || bytes == 2 || bytes == 4;
}

/* RX_INPUT without a text: it does not. */
static rx_status check_stream(const method *m, const void *data, size_t length, LONGLONG pixels,
                              bool is_normal, rx_error *err)
{
    size_t used = 0;
    if (is_normal && m->type == HCOMPRESS_1) {
        const rx_status status = rx_hcompress_walk(data, length, pixels, &used, err);
        return status != RX_OK || used > 0 ? status : RX_INPUT;
    }
    const bool holds = !is_normal || m->type == GZIP_1 || m->type == GZIP_2
                           ? holds_gzip(m, data, length, pixels, is_normal)
                       : m->type == RICE_1 ? holds_rice(data, length, pixels, m->bytes, m->block)
                                           : m->type == PLIO_1 && holds_plio(data, length);
    return holds ? RX_OK : RX_INPUT;
}

/* The bytes of the cell, words of a line list. RX_INPUT without a text: they are no such tile. */
static rx_status check_cell(const cells *c, const method *m, LONGLONG row, LONGLONG length, LONGLONG pixels,
                            bool is_normal, rx_error *err)
{
    int failed = 0, anynul = 0;
    const bool words = is_normal && m->type == PLIO_1;
    void *data = rx_alloc((size_t)length, sizeof(short));
    if (data == NULL)
        return rx_error_memory(err, (size_t)length * sizeof(short));
    fits_read_col(c->file, words ? TSHORT : TBYTE, c->column, row + 1, 1, length, NULL, data, &anynul,
                  &failed);
    const rx_status status =
        !failed ? check_stream(m, data, (size_t)length, pixels, is_normal, err) : RX_INPUT;
    free(data);
    return status;
}

/* cfitsio takes a tile from the first of these columns that has it. */
static rx_status check_tile(const cells *normal, const cells *plain, const cells *gzip, const method *m,
                            LONGLONG row, LONGLONG pixels, rx_error *err)
{
    LONGLONG length = cell_length(normal, row);
    if (length > 0)
        return check_cell(normal, m, row, length, pixels, true, err);
    if (length == 0 && plain->column > 0)
        return cell_length(plain, row) == pixels ? RX_OK : RX_INPUT;
    length = length == 0 && gzip->column > 0 ? cell_length(gzip, row) : -1;
    return length > 0 ? check_cell(gzip, m, row, length, pixels, false, err) : RX_INPUT;
}

rx_status rx_fits_check_tiles(fitsfile *file, const char *path, int hdu, int naxis, const LONGLONG *axes,
                              rx_error *err)
{
    LONGLONG rows = 0, heap = 0;
    int failed = 0;
    const method m = method_of(file);
    fits_read_key(file, TLONGLONG, "NAXIS2", &rows, NULL, &failed);
    fits_read_key(file, TLONGLONG, "PCOUNT", &heap, NULL, &failed);
    const cells normal = cells_of(file, file->Fptr->cn_compressed, heap),
                plain = cells_of(file, file->Fptr->cn_uncompressed, heap),
                gzip = cells_of(file, file->Fptr->cn_gzip_data, heap);
    rx_status status = !failed && normal.column > 0 && is_possible(&m) ? RX_OK : RX_INPUT;
    for (LONGLONG row = 0; row < rows && status == RX_OK; row++)
        status = check_tile(&normal, &plain, &gzip, &m, row, tile_pixels(&m, naxis, axes, row), err);
    fits_clear_errmsg();
    return status != RX_INPUT ? status
                              : rx_error_at(err, RX_INPUT, path, hdu, 0,
                                            "the compressed image is damaged; fetch the file again");
}
