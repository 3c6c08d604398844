/* Damaged compressed images. */
#include "io/fits_tiles.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

/* Magic DD99, then the two axes as big-endian 32-bit numbers. */
static int holds_hcompress(const unsigned char *data, size_t length, LONGLONG n)
{
    uint64_t axis[2] = {0, 0};
    if (length < 14 || data[0] != 0xdd || data[1] != 0x99)
        return 0;
    for (int i = 0; i < 8; i++)
        axis[i / 4] = axis[i / 4] << 8 | data[2 + i];
    return axis[0] * axis[1] == (uint64_t)n;
}

typedef struct method {
    int rice, hcompress;
    int bytes, block; /* Rice: ZNAMEi BYTEPIX and BLOCKSIZE */
    LONGLONG tile[2]; /* its nominal shape */
} method;

static method method_of(fitsfile *file, const rx_fits_shape *shape)
{
    method m = {.bytes = 4, .block = 32, .tile = {shape->axes[0], 1}};
    char text[FLEN_VALUE] = "", key[FLEN_KEYWORD];
    int absent = 0;
    fits_read_key(file, TSTRING, "ZCMPTYPE", text, NULL, &absent);
    m.rice = strncmp(text, "RICE_", 5) == 0;
    m.hcompress = strncmp(text, "HCOMPRESS_1", 11) == 0;
    for (int i = 1; i <= 4; i++) {
        int value = 0, failed = 0;
        snprintf(key, sizeof key, "ZNAME%d", i);
        fits_read_key(file, TSTRING, key, text, NULL, &failed);
        snprintf(key, sizeof key, "ZVAL%d", i);
        fits_read_key(file, TINT, key, &value, NULL, &failed);
        if (!failed && strcmp(text, "BYTEPIX") == 0)
            m.bytes = value;
        else if (!failed && strcmp(text, "BLOCKSIZE") == 0)
            m.block = value;
    }
    for (int i = 0; i < 2; i++) {
        absent = 0;
        snprintf(key, sizeof key, "ZTILE%d", i + 1);
        fits_read_key(file, TLONGLONG, key, &m.tile[i], NULL, &absent);
    }
    fits_clear_errmsg();
    return m;
}

/* Pixels of the tile in that row (from 0) of the table; those at the far edges are smaller. */
static LONGLONG tile_pixels(const method *m, const rx_fits_shape *shape, LONGLONG row)
{
    LONGLONG across = (shape->axes[0] + m->tile[0] - 1) / m->tile[0];
    LONGLONG x = row % across * m->tile[0], y = row / across * m->tile[1];
    LONGLONG width = shape->axes[0] - x < m->tile[0] ? shape->axes[0] - x : m->tile[0];
    LONGLONG height = shape->axes[1] - y < m->tile[1] ? shape->axes[1] - y : m->tile[1];
    return width * height;
}

/* One cell: inside the heap, and a stream of the right length. 0 when not, or when
 * memory is out (*no_memory). */
static int check_cell(fitsfile *file, int column, int size, LONGLONG row, LONGLONG heap, LONGLONG pixels,
                      const method *m, int *no_memory)
{
    LONGLONG length = 0, offset = 0;
    int failed = 0, anynul = 0, ok = 1;
    fits_read_descriptll(file, column, row + 1, &length, &offset, &failed);
    if (failed || length < 0 || offset < 0 || length > heap / size || offset > heap - length * size)
        return 0;
    if (length == 0 || m == NULL || (!m->rice && !m->hcompress))
        return 1;
    unsigned char *data = RX_NEW(unsigned char, (size_t)length);
    if (data == NULL) {
        *no_memory = 1;
        return 0;
    }
    fits_read_col(file, TBYTE, column, row + 1, 1, length, NULL, data, &anynul, &failed);
    if (failed)
        ok = 0;
    else if (m->rice)
        ok = holds_rice(data, (size_t)length, pixels, m->bytes, m->block);
    else
        ok = holds_hcompress(data, (size_t)length, pixels);
    free(data);
    return ok;
}

rx_status rx_fits_check_tiles(fitsfile *file, const char *path, int hdu, const rx_fits_shape *shape,
                              rx_error *err)
{
    static const char *const names[] = {"COMPRESSED_DATA", "GZIP_COMPRESSED_DATA", "UNCOMPRESSED_DATA"};
    LONGLONG rows = 0, heap = 0;
    int failed = 0, no_memory = 0, ok = 1;
    method m = method_of(file, shape);
    fits_read_key(file, TLONGLONG, "NAXIS2", &rows, NULL, &failed);
    fits_read_key(file, TLONGLONG, "PCOUNT", &heap, NULL, &failed);
    ok = !failed && m.tile[0] > 0 && m.tile[1] > 0 && m.block > 0 &&
         (m.bytes == 1 || m.bytes == 2 || m.bytes == 4);
    for (int k = 0; k < 3 && ok; k++) {
        char name[32];
        int column = 0, type = 0, absent = 0;
        long width = 1;
        snprintf(name, sizeof name, "%s", names[k]);
        if (fits_get_colnum(file, CASEINSEN, name, &column, &absent) ||
            fits_get_coltype(file, column, &type, NULL, &width, &absent))
            continue;
        int size = type == -TSHORT ? 2 : type == -TBYTE ? 1 : type == -TDOUBLE ? 8 : 4;
        for (LONGLONG row = 0; row < rows && ok; row++)
            ok = check_cell(file, column, size, row, heap, tile_pixels(&m, shape, row), k == 0 ? &m : NULL,
                            &no_memory);
    }
    fits_clear_errmsg();
    if (no_memory)
        return rx_error_memory(err, 0);
    return ok ? RX_OK
              : rx_error_at(err, RX_INPUT, path, hdu, 0,
                            "the compressed image is damaged; fetch the file again");
}
