/* One's complement sums. */
#include "io/fits_sum.h"

#include <string.h>

static uint64_t fold(uint64_t sum)
{
    while (sum >> 32 != 0)
        sum = (sum & 0xffffffff) + (sum >> 32);
    return sum;
}

/* A word that begins at byte `place` of the data unit. Where that is within a word of the sum its bytes go
 * round: what leaves below comes in above, which is the carry of one's complement. */
static uint64_t at(uint32_t word, size_t place)
{
    const unsigned shift = 8 * (unsigned)(place % 4);
    return shift == 0 ? word : (uint32_t)(word >> shift | word << (32 - shift));
}

uint32_t rx_fits_sum_pixels(const void *pixels, size_t n)
{
    const unsigned char *bytes = pixels;
    uint64_t sum = 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t word;
        memcpy(&word, bytes + 4 * i, sizeof word);
        sum += word; /* at most 2^32 of them before it is too much, and no image has as many */
    }
    return (uint32_t)fold(sum);
}

uint32_t rx_fits_sum_bytes(uint32_t sum, const void *bytes, size_t n)
{
    const unsigned char *byte = bytes;
    uint64_t total = sum;
    size_t i = 0;
    for (; i + 4 <= n; i += 4)
        total +=
            (uint32_t)byte[i] << 24 | (uint32_t)byte[i + 1] << 16 | (uint32_t)byte[i + 2] << 8 | byte[i + 3];
    for (; i < n; i++)
        total += at((uint32_t)byte[i] << 24, i);
    return (uint32_t)fold(total);
}

long rx_fits_text_length(const rx_column *column)
{
    return column->text_width > 1 ? column->text_width - 1 : 1;
}

static uint64_t sum_text(const char *text, long length, size_t place)
{
    uint64_t sum = 0;
    int ended = 0;
    for (long i = 0; i < length; i++) {
        ended |= text[i] == '\0';
        sum += at((uint32_t)(ended ? ' ' : (unsigned char)text[i]) << 24, place + (size_t)i);
    }
    return sum;
}

/* One element; size: its bytes in the file. */
static uint64_t sum_element(const rx_column *column, const char *element, size_t size, size_t place)
{
    uint16_t half;
    uint32_t word;
    uint64_t twin;
    if (column->type == RX_CELL_TEXT)
        return sum_text(element, (long)size, place);
    if (size == 2) {
        memcpy(&half, element, sizeof half);
        return at((uint32_t)half << 16, place);
    }
    if (size == 4) {
        memcpy(&word, element, sizeof word);
        return at(word, place);
    }
    memcpy(&twin, element, sizeof twin);
    return at((uint32_t)(twin >> 32), place) + at((uint32_t)twin, place);
}

static size_t size_in_file(const rx_column *column)
{
    return column->type == RX_CELL_TEXT ? (size_t)rx_fits_text_length(column)
                                        : (size_t)rx_column_element_size(column);
}

uint32_t rx_fits_sum_table(const rx_table *table)
{
    uint64_t sum = 0;
    size_t row_bytes = 0, offset = 0;
    for (int i = 0; i < table->ncolumns; i++)
        row_bytes += (size_t)rx_column_elements(&table->columns[i]) * size_in_file(&table->columns[i]);
    for (int i = 0; i < table->ncolumns; i++) {
        const rx_column *column = &table->columns[i];
        const size_t n = (size_t)rx_column_elements(column), size = size_in_file(column),
                     step = (size_t)rx_column_element_size(column);
        for (long row = 0; row < table->nrows; row++, sum = fold(sum))
            for (size_t k = 0; k < n; k++)
                sum += sum_element(column, (const char *)column->data + ((size_t)row * n + k) * step, size,
                                   (size_t)row * row_bytes + offset + k * size);
        offset += n * size;
    }
    return (uint32_t)fold(sum);
}
