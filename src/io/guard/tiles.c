/* Damaged compressed images. */
#include "io/guard/guard.h"

#include <limits.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/memory.h"

typedef struct bits {
    const unsigned char *data;
    uint64_t at, end; /* in bits */
} bits;

/* The next n <= 8 bits, zeros behind the end. */
static unsigned peek(const bits *s, unsigned n)
{
    const uint64_t byte = s->at / 8;
    unsigned two = byte < s->end / 8 ? s->data[byte] * 256u : 0;
    if (byte + 1 < s->end / 8)
        two |= s->data[byte + 1];
    return two >> (16 - s->at % 8 - n) & ((1u << n) - 1);
}

static bool skip(bits *s, uint64_t n)
{
    if (s->end - s->at < n)
        return false;
    s->at += n;
    return true;
}

/* -1: the stream is at its end. */
static int take(bits *s, unsigned n)
{
    const unsigned value = peek(s, n);
    return skip(s, n) ? (int)value : -1;
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
    if (length < (size_t)bytes)
        return 0;
    bits stream = {.data = data, .at = 8 * (uint64_t)bytes, .end = 8 * (uint64_t)length};
    for (LONGLONG i = 0; i < n; i += block) {
        LONGLONG count = n - i < block ? n - i : block;
        const int code = take(&stream, (unsigned)code_bits), low = code - 1;
        if (code < 0)
            return 0;
        if (low < 0)
            continue;
        uint64_t fixed = (uint64_t)(low == raw ? 8 * bytes : low);
        for (LONGLONG k = 0; k < count; k++) {
            if (low != raw && !skip_unary(&stream))
                return 0;
            if (!skip(&stream, fixed))
                return 0;
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

/* --- HCOMPRESS (R. L. White 1992, Proc. NASA Space and Earth Science Data Compression Workshop; FITS 4.0, 10.4.4) ---
 *
 * The H-transform's coefficients lie in four quadrants of the plane; each sends its bit planes, from the highest on, as they
 * are or as a quadtree: a word of four bits says which quarters hold a one, and only those are sent at the next level. The
 * signs of all that are not zero follow. The stream is walked through as its reader would, without making the pixels: behind
 * one that is cut off cfitsio reads on. */

enum { HEADER = 2 + 3 * 4 + 8, MAX_PLANES = 64 };

/* Words of a quadtree have codes of 3 to 6 bits: 000 to 011, 1000 to 1100, 11010 to 11110, 111110, 111111. */
static int take_code(bits *s)
{
    static const struct {
        unsigned bits, first, n;
        unsigned char word[5];
    } lengths[] = {{3, 0, 4, {1, 2, 4, 8}},
                   {4, 8, 5, {3, 5, 10, 12, 15}},
                   {5, 26, 5, {6, 7, 9, 11, 13}},
                   {6, 62, 2, {0, 14}}};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        const unsigned code = peek(s, lengths[i].bits) - lengths[i].first;
        if (code < lengths[i].n)
            return skip(s, lengths[i].bits) ? lengths[i].word[code] : -1;
    }
    return -1;
}

/* A rectangle of the plane, and room for the words of two levels of its tree. */
typedef struct quadrant {
    size_t nx, ny;         /* ny: along the rows */
    unsigned char *filled; /* nx * ny: 1 where any bit plane has a one */
    unsigned char *words, *parents;
} quadrant;

static size_t parts(size_t n, size_t size)
{
    return (n + size - 1) / size;
}

/* Has the part at (i, j) of a level a one, by the words of the level above? ny: words in its rows. */
static bool is_filled(const unsigned char *parents, size_t i, size_t j, size_t ny)
{
    return parents[i / 2 * ny + j / 2] >> (3 - 2 * (i % 2) - j % 2) & 1;
}

/* From one word for all down to one for each 2 x 2 coefficients; a level's words come in reverse. */
static bool take_tree(bits *s, quadrant *q)
{
    size_t size = 2;
    while (size < q->nx || size < q->ny)
        size *= 2;
    int word = take_code(s);
    q->words[0] = (unsigned char)word;
    for (size /= 2; size >= 2 && word >= 0; size /= 2) {
        const size_t nx = parts(q->nx, size), ny = parts(q->ny, size);
        unsigned char *parents = q->words;
        q->words = q->parents;
        q->parents = parents;
        for (size_t k = nx * ny; k > 0 && word >= 0; k--) {
            const bool sent = is_filled(parents, (k - 1) / ny, (k - 1) % ny, parts(q->ny, 2 * size));
            word = sent ? take_code(s) : 0;
            q->words[k - 1] = (unsigned char)word;
        }
    }
    return word >= 0;
}

static bool take_plane(bits *s, quadrant *q)
{
    enum { DIRECT = 0, TREE = 15 };
    const int kind = take(s, 4);
    if (kind != DIRECT && (kind != TREE || !take_tree(s, q)))
        return false;
    for (size_t k = 0; kind == DIRECT && k < parts(q->nx, 2) * parts(q->ny, 2); k++) {
        const int word = take(s, 4);
        if (word < 0)
            return false;
        q->words[k] = (unsigned char)word;
    }
    for (size_t i = 0; i < q->nx; i++)
        for (size_t j = 0; j < q->ny; j++)
            q->filled[i * q->ny + j] |= is_filled(q->words, i, j, parts(q->ny, 2));
    return true;
}

/* Four quadrants, a word of zero, and from the next byte on a bit for the sign of each coefficient that is not zero. */
static bool take_all(bits *s, quadrant *q, size_t nx, size_t ny, const unsigned char planes[3])
{
    uint64_t signs = 0;
    for (int k = 0; k < 4; k++) {
        q->nx = k / 2 == 0 ? parts(nx, 2) : nx / 2;
        q->ny = k % 2 == 0 ? parts(ny, 2) : ny / 2;
        memset(q->filled, 0, q->nx * q->ny);
        for (unsigned plane = 0; plane < planes[(k + 1) / 2]; plane++)
            if (!take_plane(s, q))
                return false;
        for (size_t i = 0; i < q->nx * q->ny; i++)
            signs += q->filled[i];
    }
    return take(s, 4) == 0 && skip(s, (8 - s->at % 8) % 8 + signs);
}

/* *holds: the stream has that many pixels and is whole. RX_SYSTEM without memory. */
static rx_status check_hcompress(const unsigned char *data, size_t length, LONGLONG pixels, bool *holds,
                                 rx_error *err)
{
    uint64_t axis[2] = {0, 0};
    *holds = false;
    if (length < HEADER + 3 || data[0] != 0xdd || data[1] != 0x99)
        return RX_OK;
    for (int i = 0; i < 8; i++)
        axis[i / 4] = axis[i / 4] << 8 | data[2 + i];
    const unsigned char *planes = data + HEADER;
    /* quadrants of no pixels would make cfitsio write before its memory */
    if (axis[0] * axis[1] != (uint64_t)pixels || axis[0] < 2 || axis[1] < 2 || planes[0] > MAX_PLANES ||
        planes[1] > MAX_PLANES || planes[2] > MAX_PLANES)
        return RX_OK;
    const size_t nx = parts((size_t)axis[0], 2), ny = parts((size_t)axis[1], 2),
                 words = parts(nx, 2) * parts(ny, 2);
    unsigned char *room;
    RX_TRY(RX_MAKE(room, nx * ny + 2 * words, err));
    quadrant q = {.filled = room, .words = room + nx * ny, .parents = room + nx * ny + words};
    bits s = {.data = data, .at = 8 * (uint64_t)(HEADER + 3), .end = 8 * (uint64_t)length};
    *holds = take_all(&s, &q, (size_t)axis[0], (size_t)axis[1], planes);
    free(room);
    return RX_OK;
}

/* --- the tiles of an image --- */

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
    bool holds = false;
    if (!is_normal || m->type == GZIP_1 || m->type == GZIP_2)
        holds = holds_gzip(m, data, length, pixels, is_normal);
    else if (m->type == HCOMPRESS_1)
        RX_TRY(check_hcompress(data, length, pixels, &holds, err));
    else
        holds = m->type == RICE_1 ? holds_rice(data, length, pixels, m->bytes, m->block)
                                  : m->type == PLIO_1 && holds_plio(data, length);
    return holds ? RX_OK : RX_INPUT;
}

/* The bytes of the cell, words of a line list. RX_INPUT without a text: they are no such tile. */
static rx_status check_cell(const cells *c, const method *m, LONGLONG row, LONGLONG length, LONGLONG pixels,
                            bool is_normal, rx_error *err)
{
    int failed = 0, anynul = 0;
    const bool words = is_normal && m->type == PLIO_1;
    short *data;
    RX_TRY(RX_MAKE(data, (size_t)length, err));
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
