/* ASCII, ASCII_HEAD and ASCII_SKYCAT catalogues, laid out as SExtractor does, and regions for DS9. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/printable.h"
#include "catalog/cell.h"
#include "catalog/writers.h"
#include "data/flags.h"
#include "io/fits_read.h"

/* `#   5 FLUX_APER              description          [unit]`; a vector takes as many numbers as
 * it has elements. */
static void add_head(rx_text *dst, const rx_table *table)
{
    long number = 1;
    for (int i = 0; i < table->ncolumns; i++) {
        const rx_column *column = &table->columns[i];
        rx_text_printf(dst, "#%4ld %-22.71s %-58.159s", number, column->name, column->description);
        if (column->unit[0] != '\0')
            rx_text_printf(dst, " [%s]", column->unit);
        rx_text_add(dst, "\n");
        number += rx_column_elements(column);
    }
}

/* Whose work each table is, of its facts. */
static void add_facts(rx_text *dst, rx_table *const *tables, int n)
{
    char key[9] = "", value[512];
    for (int i = 0; i < n; i++)
        for (long k = 0; tables[i]->facts != NULL && k < tables[i]->nfacts; k++) {
            const char *card = tables[i]->facts + 80 * k;
            snprintf(key, sizeof key, "%.*s", (int)strcspn(card, "= "), card);
            if (card[8] != '=' ||
                !rx_cards_text(tables[i]->facts, tables[i]->nfacts, key, value, sizeof value))
                continue;
            rx_text_add(dst, "# ");
            if (n > 1)
                rx_text_printf(dst, "extension %d: ", i + 1);
            rx_text_printf(dst, "%s = ", key);
            rx_printable_add(dst, value);
            rx_text_add(dst, "\n");
        }
}

static double cell(const rx_table *table, const char *name, long row)
{
    const int column = rx_table_find(table, name);
    return column >= 0 ? rx_column_value(&table->columns[column], row, 0) : NAN;
}

/* The Kron ellipse of a source, on the sky where it has a place there: angles of regions count from west over north.
 * Colours are those of the head of the file; each flag is a tag, by which DS9 forms groups. */
static void add_region(const rx_table *table, long row, rx_text *text)
{
    const int flags = (int)cell(table, "FLAGS", row);
    const double restore = cell(table, "FLAGS_RESTORE", row), ra = cell(table, "ALPHA_J2000", row);
    const double kron = cell(table, "KRON_RADIUS", row), scale = kron > 0 ? kron : 3;
    const bool sky = isfinite(ra) && isfinite(cell(table, "A_WORLD", row));
    const double a = scale * cell(table, sky ? "A_WORLD" : "A_IMAGE", row);
    const double b = fmax(scale * cell(table, sky ? "B_WORLD" : "B_IMAGE", row), 0.01 * a);
    if (sky)
        rx_text_printf(text, "icrs;ellipse(%.7f,%.7f,%.4f\",%.4f\",%.2f)", ra,
                       cell(table, "DELTA_J2000", row), 3600 * a, 3600 * b,
                       cell(table, "THETA_J2000", row) + 90);
    else
        rx_text_printf(text, "image;ellipse(%.4f,%.4f,%.3f,%.3f,%.2f)", cell(table, "X_IMAGE", row),
                       cell(table, "Y_IMAGE", row), a, b, cell(table, "THETA_IMAGE", row));
    const int marks = isfinite(restore) ? (int)restore : 0;
    rx_text_printf(text, " # color=%s text={%.0f}",
                   marks & (RX_RESTORE_SPURIOUS | RX_RESTORE_SHRED) ? "magenta"
                   : flags >= RX_FLAG_SATURATED                     ? "red"
                   : flags > 0                                      ? "yellow"
                                                                    : "green",
                   cell(table, "NUMBER", row));
    int n;
    const rx_flag *flag = rx_flags(&n);
    for (int i = 0; i < n; i++)
        if ((strcmp(flag[i].column, "FLAGS") == 0 && (flags & flag[i].bit)) ||
            (strcmp(flag[i].column, "FLAGS_RESTORE") == 0 && (marks & flag[i].bit)))
            rx_text_printf(text, " tag={%s}", flag[i].name);
    rx_text_add(text, "\n");
}

/* One row into the text that was there. */
static void format_row(const rx_table *table, long row, rx_catalog_type type, rx_text *text)
{
    const char *separator = type == RX_CATALOG_ASCII_SKYCAT ? " \t" : " ";
    text->length = 0;
    if (type == RX_CATALOG_DS9) {
        add_region(table, row, text);
        return;
    }
    for (int i = 0; i < table->ncolumns; i++) {
        long elements = rx_column_elements(&table->columns[i]);
        for (long e = 0; e < elements; e++) {
            if (i > 0 || e > 0)
                rx_text_add(text, separator);
            rx_cell_format(text, &table->columns[i], row, e);
        }
    }
    rx_text_add(text, "\n");
}

rx_status rx_ascii_digest(rx_table *const *tables, int n, rx_catalog_type type, char dst[RX_HASH_TEXT],
                          rx_error *err)
{
    rx_text text = {0};
    rx_hash sum;
    rx_hash_begin(&sum);
    for (int i = 0; i < n; i++)
        for (long row = 0; row < tables[i]->nrows && !text.failed; row++) {
            format_row(tables[i], row, type, &text);
            rx_hash_add(&sum, text.data, text.length);
        }
    rx_status status = text.failed ? rx_error_memory(err, text.capacity) : RX_OK;
    rx_hash_text(&sum, dst);
    rx_text_free(&text);
    return status;
}

/* text is reused as the line's buffer. */
static rx_status write_rows(FILE *file, const rx_table *table, rx_catalog_type type, rx_text *text,
                            rx_error *err)
{
    for (long row = 0; row < table->nrows; row++) {
        format_row(table, row, type, text);
        if (text->failed)
            return rx_error_memory(err, text->capacity);
        fwrite(text->data, 1, text->length, file);
    }
    return RX_OK;
}

rx_status rx_ascii_write(FILE *file, const rx_catalog *catalog, rx_error *err)
{
    rx_status status = RX_OK;
    rx_text text = {0};
    if (catalog->type == RX_CATALOG_DS9)
        rx_text_add(
            &text,
            "# Region file format: DS9 version 4.1\n"
            "# Kron ellipses. Colours: green FLAGS 0, yellow 1 to 3, red 4 and above, magenta spurious\n"
            "# (FLAGS_RESTORE, where that column is chosen); tags: names of flags (rextract -FLAGS)\n");
    if (catalog->type == RX_CATALOG_ASCII_HEAD && catalog->n > 0)
        add_head(&text, catalog->tables[0]);
    if (catalog->type != RX_CATALOG_ASCII && catalog->n > 0) {
        add_facts(&text, catalog->tables, catalog->n);
        for (int i = 0; i < catalog->npairs; i++) {
            const rx_record_pair *pair = &catalog->record[i];
            rx_text_printf(&text, "# %s = ", pair->name);
            rx_printable_add(&text, pair->value != NULL ? pair->value : "");
            rx_text_add(&text, "\n");
        }
    }
    if (text.failed)
        RX_TRY_EXIT(rx_error_memory(err, text.capacity));
    if (text.length > 0)
        fwrite(text.data, 1, text.length, file);
    for (int i = 0; i < catalog->n && status == RX_OK; i++) {
        if (catalog->type == RX_CATALOG_DS9 && catalog->n > 1)
            fprintf(file, "# extension %d\n", i + 1);
        status = write_rows(file, catalog->tables[i], catalog->type, &text, err);
    }
exit:
    rx_text_free(&text);
    return status;
}

/* SkyCat takes the first four columns as identifier, right ascension, declination and magnitude. */
rx_status rx_skycat_write(FILE *file, const rx_catalog *catalog, rx_error *err)
{
    rx_table *const *tables = catalog->tables;
    const int n = catalog->n;
    static const char *const first[] = {"id", "ra", "dec", "mag"};
    rx_status status = RX_OK;
    rx_text text = {0};
    rx_text_add(&text, "QueryResult\n\n# Config entry for original catalog server:\nserv_type: catalog\n"
                       "long_name: Rextract catalog\nshort_name: RxCat\nsymbol: id diamond  8.0\n"
                       "# End config entry\n\n");
    for (int i = 0; n > 0 && i < tables[0]->ncolumns; i++)
        rx_text_printf(&text, "%s%s", i > 0 ? "\t" : "", i < 4 ? first[i] : tables[0]->columns[i].name);
    rx_text_add(&text, "\n------------------\n");
    if (text.failed)
        RX_TRY_EXIT(rx_error_memory(err, text.capacity));
    fwrite(text.data, 1, text.length, file);
    for (int i = 0; i < n && status == RX_OK; i++)
        status = write_rows(file, tables[i], catalog->type, &text, err);
    if (status == RX_OK)
        fputs("[EOD]", file);
exit:
    rx_text_free(&text);
    return status;
}
