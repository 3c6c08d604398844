/* Digests of data units. */
#include "io/fits_digest.h"

#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "io/fits_file.h"

enum { WORDS = 2048 };

/* n elements of `size` bytes, the least significant byte of each first or last as the machine has it. */
static void add_swapped(rx_hash *sum, const void *elements, size_t n, size_t size)
{
    uint8_t room[4 * WORDS];
    const uint8_t *from = elements;
    const size_t piece = sizeof room / size;
    const uint16_t probe = 1;
    if (*(const uint8_t *)&probe == 0) { /* as FITS has it */
        rx_hash_add(sum, elements, n * size);
        return;
    }
    while (n > 0) {
        const size_t some = n < piece ? n : piece;
        for (size_t i = 0; i < some; i++)
            for (size_t k = 0; k < size; k++)
                room[i * size + k] = from[i * size + size - 1 - k];
        rx_hash_add(sum, room, some * size);
        from += some * size;
        n -= some;
    }
}

static void digest_pixels(const void *pixels, size_t n, char dst[RX_HASH_TEXT])
{
    rx_hash sum;
    rx_hash_begin(&sum);
    add_swapped(&sum, pixels, n, 4);
    rx_hash_text(&sum, dst);
}

void rx_fits_digest_floats(const float *pixels, size_t n, char dst[RX_HASH_TEXT])
{
    digest_pixels(pixels, n, dst);
}

void rx_fits_digest_ints(const int32_t *pixels, size_t n, char dst[RX_HASH_TEXT])
{
    digest_pixels(pixels, n, dst);
}

/* A text is filled up with blanks; the zero at its end is not in the file. */
static void add_cell_text(rx_hash *sum, const char *text, long width)
{
    const size_t n = strnlen(text, (size_t)width);
    rx_hash_add(sum, text, n);
    for (size_t i = n; i < (size_t)width; i++)
        rx_hash_add(sum, " ", 1);
}

void rx_fits_digest_table(const rx_table *table, char dst[RX_HASH_TEXT])
{
    rx_hash sum;
    rx_hash_begin(&sum);
    for (long row = 0; row < table->nrows; row++)
        for (int i = 0; i < table->ncolumns; i++) {
            const rx_column *column = &table->columns[i];
            const long n = rx_column_elements(column), size = rx_column_element_size(column);
            const char *cell = (const char *)column->data + row * n * size;
            if (column->type != RX_CELL_TEXT)
                add_swapped(&sum, cell, (size_t)n, (size_t)size);
            for (long e = 0; column->type == RX_CELL_TEXT && e < n; e++)
                add_cell_text(&sum, cell + e * size, size > 1 ? size - 1 : 1);
        }
    rx_hash_text(&sum, dst);
}

/* Where the data of an HDU lie in the file: from, and how many bytes. */
static rx_status find_data(const char *path, int hdu, LONGLONG *from, LONGLONG *bytes, rx_error *err)
{
    rx_fits_source source = {0};
    int failed = 0, type = 0, bitpix = 0, naxis = 0;
    bool absurd = false;
    LONGLONG axes[9] = {0}, header, end, rows = 0;
    rx_status status;
    RX_TRY_EXIT(rx_fits_open(path, &source, err));
    RX_TRY_EXIT(rx_fits_goto(source.file, path, hdu, err));
    fits_get_hdu_type(source.file, &type, &failed);
    fits_get_hduaddrll(source.file, &header, from, &end, &failed);
    if (type == IMAGE_HDU) {
        fits_get_img_paramll(source.file, 9, &bitpix, &naxis, axes, &failed);
        *bytes = naxis > 0 ? (bitpix < 0 ? -bitpix : bitpix) / 8 : 0;
        for (int i = 0; i < naxis && i < 9; i++)
            absurd |= axes[i] < 0 || __builtin_mul_overflow(*bytes, axes[i], bytes);
    } else {
        fits_read_key(source.file, TLONGLONG, "NAXIS1", &axes[0], NULL, &failed);
        fits_get_num_rowsll(source.file, &rows, &failed);
        absurd = axes[0] < 0 || __builtin_mul_overflow(axes[0], rows, bytes);
    }
    if (failed)
        status = rx_fits_failed(err, RX_INPUT, path, hdu, failed, "cannot be read");
    else if (absurd || *bytes < 0 || *bytes > end - *from)
        status = rx_error_at(err, RX_INPUT, path, hdu, 0, "is cut off or its header claims too much");
exit:
    rx_fits_done(&source);
    return status;
}

rx_status rx_fits_digest_hdu(const char *path, int hdu, char dst[RX_HASH_TEXT], rx_error *err)
{
    uint8_t room[4 * WORDS];
    LONGLONG from = 0, left = 0;
    rx_hash sum;
    rx_status status = RX_OK;
    RX_TRY(find_data(path, hdu, &from, &left, err));
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    rx_hash_begin(&sum);
    errno = 0;
    int failed = fseeko(file, (off_t)from, SEEK_SET);
    while (!failed && left > 0) {
        const size_t some = left < (LONGLONG)sizeof room ? (size_t)left : sizeof room;
        failed = fread(room, 1, some, file) != some;
        rx_hash_add(&sum, room, some);
        left -= (LONGLONG)some;
    }
    if (failed)
        status = rx_error_at(err, RX_INPUT, path, hdu, 0,
                             "cannot be read to its end%s%s; unpack it where it is compressed",
                             errno != 0 ? ": " : "", errno != 0 ? strerror(errno) : "");
    fclose(file);
    rx_hash_text(&sum, dst);
    return status;
}

rx_status rx_fits_hdus(const char *path, int *n, rx_error *err)
{
    rx_fits_source source = {0};
    *n = 0;
    rx_status status = rx_fits_open(path, &source, err);
    if (status == RX_OK)
        status = rx_fits_count(source.file, path, n, NULL, err);
    rx_fits_done(&source);
    return status;
}
