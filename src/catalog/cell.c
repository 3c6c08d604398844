/* One cell as text. */
#include "catalog/formats.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The parts of "%+11.7f"; formats come from tables, so they are taken apart, never handed to printf. */
typedef struct format {
    bool plus;
    int width, precision; /* precision -1: none given */
    char letter;
} format;

static int small_number(const char **text)
{
    int n = 0;
    for (; **text >= '0' && **text <= '9'; (*text)++)
        n = n < 100 ? n * 10 + (**text - '0') : n;
    return n < 100 ? n : 100;
}

static bool is_integer(rx_cell_type type)
{
    return type == RX_CELL_INT16 || type == RX_CELL_INT32 || type == RX_CELL_INT64;
}

static format default_format(rx_cell_type type)
{
    if (is_integer(type))
        return (format){.width = 10, .precision = -1, .letter = 'd'};
    if (type == RX_CELL_FLOAT)
        return (format){.width = 14, .precision = 9, .letter = 'g'};
    return (format){.width = 23, .precision = 17, .letter = 'g'};
}

static format parse_format(const rx_column *column)
{
    const char *text = column->format;
    format f = {.precision = -1};
    if (*text++ != '%')
        return default_format(column->type);
    f.plus = *text == '+';
    text += f.plus;
    f.width = small_number(&text);
    if (*text == '.') {
        text++;
        f.precision = small_number(&text);
    }
    f.letter = *text;
    const char *legal = is_integer(column->type) ? "du" : "feg";
    if (*text == '\0' || text[1] != '\0' || strchr(legal, *text) == NULL)
        return default_format(column->type);
    return f;
}

static void print_real(rx_text *dst, format f, double value)
{
    if (isnan(value)) /* never "-nan" */
        rx_text_printf(dst, "%*s", f.width, "nan");
    else if (f.letter == 'f')
        rx_text_printf(dst, f.plus ? "%+*.*f" : "%*.*f", f.width, f.precision, value);
    else if (f.letter == 'e')
        rx_text_printf(dst, f.plus ? "%+*.*e" : "%*.*e", f.width, f.precision, value);
    else
        rx_text_printf(dst, f.plus ? "%+*.*g" : "%*.*g", f.width, f.precision, value);
}

static long long integer_value(const rx_column *column, long i)
{
    if (column->type == RX_CELL_INT16)
        return ((const int16_t *)column->data)[i];
    if (column->type == RX_CELL_INT32)
        return ((const int32_t *)column->data)[i];
    return ((const int64_t *)column->data)[i];
}

static void print_text(rx_text *dst, const rx_column *column, long i, bool quotes)
{
    const char *text = (const char *)column->data + i * column->text_width;
    const bool quote = quotes && (*text == '\0' || strpbrk(text, " \t\r\n,#\"") != NULL);
    if (quote)
        rx_text_add(dst, "\"");
    for (; *text != '\0'; text++) {
        unsigned char letter = (unsigned char)*text;
        char shown = letter < ' ' || letter == 127 || (quote && letter == '"') ? '?' : *text;
        rx_text_add_bytes(dst, &shown, 1);
    }
    if (quote)
        rx_text_add(dst, "\"");
}

void rx_cell_format(rx_text *dst, const rx_column *column, long row, long element)
{
    long i = row * rx_column_elements(column) + element;
    if (column->type == RX_CELL_TEXT) {
        print_text(dst, column, i, true);
    } else if (is_integer(column->type)) {
        const format f = parse_format(column);
        long long value = integer_value(column, i);
        if (f.letter == 'u' && column->type == RX_CELL_INT32)
            value = (uint32_t)value; /* bit patterns of flags */
        rx_text_printf(dst, f.plus ? "%+*lld" : "%*lld", f.width, value);
    } else {
        print_real(dst, parse_format(column), rx_column_value(column, row, element));
    }
}

void rx_cell_exact(rx_text *dst, const rx_column *column, long row, long element)
{
    char shown[40];
    long i = row * rx_column_elements(column) + element;
    const double value = rx_column_value(column, row, element);
    const bool single = column->type == RX_CELL_FLOAT;
    if (column->type == RX_CELL_TEXT)
        print_text(dst, column, i, false);
    else if (is_integer(column->type))
        rx_text_printf(dst, "%lld", integer_value(column, i));
    else if (!isfinite(value))
        rx_text_add(dst, isnan(value) ? "NaN" : value > 0 ? "+Inf" : "-Inf");
    else {
        for (int digits = single ? 6 : 15; digits <= (single ? 9 : 17); digits++) {
            snprintf(shown, sizeof shown, "%.*g", digits, value);
            if (single ? strtof(shown, NULL) == (float)value : strtod(shown, NULL) == value)
                break;
        }
        rx_text_add(dst, shown);
    }
}
