/* Reading a catalogue whatever its format, known by its first bytes. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "base/input.h"
#include "base/text.h"
#include "catalog/catalog.h"
#include "catalog/formats.h"
#include "io/fits_read.h"

typedef enum kind { KIND_FITS, KIND_XML, KIND_TEXT } kind;

static rx_status find_kind(const char *path, kind *dst, rx_error *err)
{
    char begin[512] = "";
    FILE *file = rx_input_open(path);
    if (file == NULL) {
        int why = errno;
        *dst = KIND_FITS; /* table.fits[2] is a name for the FITS reader */
        return strchr(path, '[') != NULL
                   ? RX_OK
                   : rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be opened: %s", strerror(why));
    }
    size_t n = fread(begin, 1, sizeof begin - 1, file);
    int failed = ferror(file), why = errno;
    fclose(file);
    if (failed)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be read: %s", strerror(why));
    if (n == 0)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "is empty");
    const char *text = strncmp(begin, RX_BYTE_ORDER_MARK, 3) == 0 ? begin + 3 : begin;
    text += strspn(text, " \t\r\n");
    if (strncmp(begin, "SIMPLE  =", 9) == 0 || strncmp(begin, "\x1f\x8b", 2) == 0)
        *dst = KIND_FITS;
    else
        *dst = *text == '<' ? KIND_XML : KIND_TEXT;
    return RX_OK;
}

bool rx_catalog_find_positions(const rx_table *table, bool sky, int *x, int *y)
{
    /* tried in this order; the last ones are pixels */
    static const char *const names[][2] = {{"ALPHA_J2000", "DELTA_J2000"},
                                           {"ALPHAWIN_J2000", "DELTAWIN_J2000"},
                                           {"RA", "DEC"},
                                           {"RAJ2000", "DEJ2000"},
                                           {"RA_ICRS", "DE_ICRS"},
                                           {"ALPHA_SKY", "DELTA_SKY"},
                                           {"coord_ra", "coord_dec"},
                                           {"X_IMAGE", "Y_IMAGE"},
                                           {"XWIN_IMAGE", "YWIN_IMAGE"},
                                           {"X", "Y"}};
    enum { PIXELS = 7, ALL = sizeof names / sizeof *names };
    for (int i = sky ? 0 : PIXELS; i < (sky ? PIXELS : ALL); i++) {
        *x = rx_table_find(table, names[i][0]);
        *y = rx_table_find(table, names[i][1]);
        if (*x >= 0 && *y >= 0)
            return true;
    }
    return false;
}

rx_status rx_catalog_need_numbers(const char *path, const rx_table *table, int number, rx_error *err)
{
    const rx_column *column = &table->columns[number];
    if (column->type != RX_CELL_TEXT || table->nrows == 0)
        return RX_OK;
    const char *cell =
        (const char *)column->data +
        (column->word.row * rx_column_elements(column) + column->word.element) * column->text_width;
    return rx_error_at(err, RX_INPUT, path, -1, column->word.line,
                       "'%.40s' in column %s is no number; give numbers, with decimal points", cell,
                       column->name);
}

rx_status rx_catalog_read(const char *path, int index, rx_table **dst, rx_error *err)
{
    kind found;
    rx_point_locale locale;
    *dst = NULL;
    RX_TRY(find_kind(path, &found, err));
    if (found == KIND_FITS)
        return rx_fits_read_table(path, index, dst, err);
    if (found == KIND_TEXT && index > 0)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "is a text file of one table, number %d was asked",
                           index + 1);
    RX_TRY(rx_point_locale_begin(&locale, err));
    rx_status status =
        found == KIND_XML ? rx_votable_read(path, index, dst, err) : rx_ascii_read(path, dst, err);
    rx_point_locale_end(&locale);
    return status;
}
