/* Rows, pixels and lines side by side. */
#include "survey/replay_compare.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/fits_read.h"

enum { MAX_TEXT_BYTES = 1 << 30 };

/* One element in words. */
static void add_element(rx_text *dst, const rx_column *column, long row, long element)
{
    if (column->type == RX_CELL_TEXT)
        rx_text_printf(dst, "'%.60s'",
                       (const char *)column->data +
                           (row * rx_column_elements(column) + element) * column->text_width);
    else
        rx_text_printf(dst, "%.9g", rx_column_value(column, row, element));
}

/* The first element of row `row` in which two columns of one shape differ, -1: none. */
static long find_element(const rx_column *a, const rx_column *b, long row)
{
    const long n = rx_column_elements(a), size = rx_column_element_size(a);
    for (long e = 0; e < n; e++)
        if (memcmp((const char *)a->data + (row * n + e) * size, (const char *)b->data + (row * n + e) * size,
                   (size_t)size) != 0)
            return e;
    return -1;
}

static int same_columns(const rx_table *a, const rx_table *b)
{
    int same = a->ncolumns == b->ncolumns;
    for (int i = 0; same && i < a->ncolumns; i++)
        same = strcmp(a->columns[i].name, b->columns[i].name) == 0 &&
               a->columns[i].type == b->columns[i].type &&
               rx_column_elements(&a->columns[i]) == rx_column_elements(&b->columns[i]) &&
               rx_column_element_size(&a->columns[i]) == rx_column_element_size(&b->columns[i]);
    return same;
}

static void compare_tables(const rx_table *a, const rx_table *b, rx_text *dst)
{
    if (!same_columns(a, b)) {
        rx_text_printf(dst, ": %d columns here, repeated %d, or others", a->ncolumns, b->ncolumns);
        return;
    }
    for (long row = 0; row < a->nrows && row < b->nrows; row++)
        for (int i = 0; i < a->ncolumns; i++) {
            const long element = find_element(&a->columns[i], &b->columns[i], row);
            if (element < 0)
                continue;
            rx_text_printf(dst, ": first in row %ld, column %s: ", row + 1, a->columns[i].name);
            add_element(dst, &a->columns[i], row, element);
            rx_text_add(dst, " here, repeated ");
            add_element(dst, &b->columns[i], row, element);
            if (a->nrows != b->nrows)
                rx_text_printf(dst, "; %ld rows here, repeated %ld", a->nrows, b->nrows);
            return;
        }
    if (a->nrows != b->nrows)
        rx_text_printf(dst, ": %ld rows here, repeated %ld", a->nrows, b->nrows);
}

static void compare_images(const char *a, const char *b, rx_text *dst)
{
    float *here = NULL, *again = NULL;
    int width[2] = {0}, height[2] = {0};
    if (rx_fits_read_image(a, &here, &width[0], &height[0], NULL) != RX_OK ||
        rx_fits_read_image(b, &again, &width[1], &height[1], NULL) != RX_OK)
        goto exit;
    if (width[0] != width[1] || height[0] != height[1]) {
        rx_text_printf(dst, ": %d x %d pixels here, repeated %d x %d", width[0], height[0], width[1],
                       height[1]);
        goto exit;
    }
    const size_t n = (size_t)width[0] * (size_t)height[0];
    size_t first = n, differ = 0;
    for (size_t i = n; i-- > 0;)
        if (memcmp(&here[i], &again[i], sizeof here[i]) != 0) {
            first = i;
            differ++;
        }
    if (differ > 0)
        rx_text_printf(dst, ": %zu pixels, first (%zu,%zu): %.9g here, repeated %.9g", differ,
                       first % (size_t)width[0] + 1, first / (size_t)width[0] + 1, (double)here[first],
                       (double)again[first]);
exit:
    free(here);
    free(again);
}

static void compare_hdus(const char *here, int here_hdu, const char *again, int again_hdu, rx_text *dst)
{
    rx_text a = {0}, b = {0};
    rx_table *tables[2] = {NULL, NULL};
    rx_text_printf(&a, "%s[%d]", here, here_hdu);
    rx_text_printf(&b, "%s[%d]", again, again_hdu);
    if (a.failed || b.failed)
        goto exit;
    if (rx_fits_read_table(a.data, 0, &tables[0], NULL) == RX_OK &&
        rx_fits_read_table(b.data, 0, &tables[1], NULL) == RX_OK)
        compare_tables(tables[0], tables[1], dst);
    else
        compare_images(a.data, b.data, dst);
exit:
    rx_table_free(tables[0]);
    rx_table_free(tables[1]);
    rx_text_free(&a);
    rx_text_free(&b);
}

/* The next line of the text that is no comment and no head of a VOTable, which becomes a string, NULL at the
 * end. */
static char *next_row(char **text, rx_replay_format format)
{
    while (*text != NULL && **text != '\0') {
        char *line = *text, *end = strchr(line, '\n');
        *text = end != NULL ? end + 1 : NULL;
        if (end != NULL)
            *end = '\0';
        if (format == RX_REPLAY_VOTABLE ? strncmp(line, "   <TR>", 7) == 0 : line[0] != '#')
            return line;
    }
    return NULL;
}

/* Words in which two lines differ, from 1. */
static int differing_word(const char *a, const char *b)
{
    int word = 1;
    for (;; word++) {
        a += strspn(a, " ");
        b += strspn(b, " ");
        const size_t n = strcspn(a, " ");
        if (n != strcspn(b, " ") || strncmp(a, b, n) != 0 || n == 0)
            return word;
        a += n;
        b += n;
    }
}

static void compare_texts(const char *here, const char *again, rx_replay_format format, rx_text *dst)
{
    char *text[2] = {NULL, NULL};
    long row = 0;
    if (rx_text_read_file(here, MAX_TEXT_BYTES, &text[0], NULL, NULL) == RX_OK &&
        rx_text_read_file(again, MAX_TEXT_BYTES, &text[1], NULL, NULL) == RX_OK) {
        char *a = text[0], *b = text[1], *x, *y;
        do {
            x = next_row(&a, format);
            y = next_row(&b, format);
            row++;
        } while (x != NULL && y != NULL && strcmp(x, y) == 0);
        if (x != NULL && y != NULL && format == RX_REPLAY_ASCII)
            rx_text_printf(dst, ": first in row %ld, value %d", row, differing_word(x, y));
        else if (x != NULL || y != NULL)
            rx_text_printf(dst, ": first in row %ld%s", row,
                           x == NULL   ? ", which is not here"
                           : y == NULL ? ", which was not repeated"
                                       : "");
    }
    free(text[0]);
    free(text[1]);
}

void rx_replay_difference(const char *here, const rx_replay_record *here_record, const char *again,
                          const rx_replay_record *again_record, int part, rx_text *dst)
{
    if (here_record->format != again_record->format || part > here_record->nparts ||
        part > again_record->nparts)
        return;
    if (here_record->format == RX_REPLAY_FITS)
        compare_hdus(here, here_record->hdus[part - 1], again, again_record->hdus[part - 1], dst);
    else
        compare_texts(here, again, here_record->format, dst);
}
