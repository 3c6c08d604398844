/* ASCII, ASCII_HEAD and ASCII_SKYCAT catalogues, laid out as SExtractor does, and regions for DS9. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "base/text.h"
#include "catalog/formats.h"
#include "data/flags.h"

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
    char name[9], value[512];
    for (int i = 0; i < n; i++)
        for (long k = 0; tables[i]->facts != NULL && k < tables[i]->nfacts; k++) {
            if (!rx_table_fact(tables[i], k, name, value))
                continue;
            rx_text_add(dst, "# ");
            if (n > 1)
                rx_text_printf(dst, "extension %d: ", i + 1);
            rx_text_printf(dst, "%s = ", name);
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
static void add_region(rx_text *text, const rx_table *table, long row)
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

static void add_cells(rx_text *dst, const rx_table *table, long row, const char *separator)
{
    for (int i = 0; i < table->ncolumns; i++) {
        const long elements = rx_column_elements(&table->columns[i]);
        for (long e = 0; e < elements; e++) {
            if (i > 0 || e > 0)
                rx_text_add(dst, separator);
            rx_cell_format(dst, &table->columns[i], row, e);
        }
    }
    rx_text_add(dst, "\n");
}

static void plain_row(rx_text *dst, const rx_table *table, long row)
{
    add_cells(dst, table, row, " ");
}

static void skycat_row(rx_text *dst, const rx_table *table, long row)
{
    add_cells(dst, table, row, " \t");
}

static void add_record(rx_text *dst, const rx_catalog *catalog)
{
    add_facts(dst, catalog->tables, catalog->n);
    for (int i = 0; i < catalog->record->n && catalog->n > 0; i++) {
        rx_text_printf(dst, "# %s = ", catalog->record->pairs[i][0]);
        rx_printable_add(dst, catalog->record->pairs[i][1]);
        rx_text_add(dst, "\n");
    }
}

static void ascii_head(rx_text *dst, const rx_catalog *catalog)
{
    if (catalog->n > 0)
        add_head(dst, catalog->tables[0]);
    add_record(dst, catalog);
}

/* SkyCat takes the first four columns as identifier, right ascension, declination and magnitude. */
static void skycat_head(rx_text *dst, const rx_catalog *catalog)
{
    static const char *const first[] = {"id", "ra", "dec", "mag"};
    rx_text_add(dst, "QueryResult\n\n# Config entry for original catalog server:\nserv_type: catalog\n"
                     "long_name: Rextract catalog\nshort_name: RxCat\nsymbol: id diamond  8.0\n"
                     "# End config entry\n\n");
    for (int i = 0; catalog->n > 0 && i < catalog->tables[0]->ncolumns; i++)
        rx_text_printf(dst, "%s%s", i > 0 ? "\t" : "",
                       i < 4 ? first[i] : catalog->tables[0]->columns[i].name);
    rx_text_add(dst, "\n------------------\n");
}

static void ds9_head(rx_text *dst, const rx_catalog *catalog)
{
    rx_text_add(dst,
                "# Region file format: DS9 version 4.1\n"
                "# Kron ellipses. Colours: green FLAGS 0, yellow 1 to 3, red 4 and above, magenta spurious\n"
                "# (FLAGS_RESTORE, where that column is chosen); tags: names of flags (rextract -FLAGS)\n");
    add_record(dst, catalog);
}

static void ds9_table(rx_text *dst, const rx_catalog *catalog, int i)
{
    if (catalog->n > 1)
        rx_text_printf(dst, "# extension %d\n", i + 1);
}

const rx_text_format *rx_ascii_format(rx_catalog_type type)
{
    static const rx_text_format plain = {.row = plain_row}, head = {.head = ascii_head, .row = plain_row},
                                skycat = {.head = skycat_head, .row = skycat_row, .end = "[EOD]"},
                                ds9 = {.head = ds9_head, .table = ds9_table, .row = add_region};
    return type == RX_CATALOG_ASCII_HEAD     ? &head
           : type == RX_CATALOG_ASCII_SKYCAT ? &skycat
           : type == RX_CATALOG_DS9          ? &ds9
                                             : &plain;
}
