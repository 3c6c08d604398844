/* VOTable 1.4 (IVOA Recommendation 2019-10-21), TABLEDATA: one RESOURCE, one TABLE an extension. */
#include <string.h>

#include "base/text.h"
#include "catalog/formats.h"

/* Text and attribute values; what is not printable ASCII (datatype char) becomes '?'. */
static void add_xml(rx_text *dst, const char *text)
{
    for (; *text != '\0'; text++) {
        char letter = *text;
        if (letter == '&')
            rx_text_add(dst, "&amp;");
        else if (letter == '<')
            rx_text_add(dst, "&lt;");
        else if (letter == '>')
            rx_text_add(dst, "&gt;");
        else if (letter == '"')
            rx_text_add(dst, "&quot;");
        else
            rx_text_add_bytes(dst, letter >= ' ' && letter < 127 ? &letter : "?", 1);
    }
}

/* Nothing where the value is empty. */
static void add_attribute(rx_text *dst, const char *name, const char *value)
{
    if (value == NULL || value[0] == '\0')
        return;
    rx_text_printf(dst, " %s=\"", name);
    add_xml(dst, value);
    rx_text_add(dst, "\"");
}

static void add_description(rx_text *dst, const char *text)
{
    rx_text_add(dst, "<DESCRIPTION>");
    add_xml(dst, text);
    rx_text_add(dst, "</DESCRIPTION>");
}

/* FITS spells "mag * arcsec**(-2)", VOUnits "mag.arcsec**-2". */
static void add_unit(rx_text *dst, const char *unit)
{
    char shown[64];
    size_t n = 0;
    for (; *unit != '\0' && n + 1 < sizeof shown; unit++) {
        if (strncmp(unit, " * ", 3) == 0) {
            shown[n++] = '.';
            unit += 2;
        } else if (*unit != '(' && *unit != ')') {
            shown[n++] = *unit;
        }
    }
    shown[n] = '\0';
    add_attribute(dst, "unit", shown);
}

static void add_field(rx_text *dst, const rx_column *column)
{
    static const char *const datatypes[] = {
        [RX_CELL_INT16] = "short", [RX_CELL_INT32] = "int",     [RX_CELL_INT64] = "long",
        [RX_CELL_FLOAT] = "float", [RX_CELL_DOUBLE] = "double", [RX_CELL_TEXT] = "char"};
    rx_text_add(dst, "  <FIELD");
    add_attribute(dst, "name", column->name);
    add_attribute(dst, "datatype", datatypes[column->type]);
    if (column->type == RX_CELL_TEXT)
        rx_text_add(dst, " arraysize=\"*\"");
    else if (column->ndim == 1)
        rx_text_printf(dst, " arraysize=\"%d\"", column->dim[0]);
    else if (column->ndim == 2)
        rx_text_printf(dst, " arraysize=\"%dx%d\"", column->dim[0], column->dim[1]);
    add_unit(dst, column->unit);
    add_attribute(dst, "ucd", column->ucd);
    rx_text_add(dst, ">");
    if (column->description[0] != '\0')
        add_description(dst, column->description);
    rx_text_add(dst, "</FIELD>\n");
}

static void add_row(rx_text *dst, const rx_table *table, long row)
{
    rx_text_add(dst, "   <TR>");
    for (int i = 0; i < table->ncolumns; i++) {
        const rx_column *column = &table->columns[i];
        const long elements = rx_column_elements(column);
        rx_text_add(dst, "<TD>");
        for (long e = 0; e < elements; e++) {
            rx_text text = {0};
            if (e > 0)
                rx_text_add(dst, " ");
            if (column->type != RX_CELL_TEXT) {
                rx_cell_exact(dst, column, row, e);
                continue;
            }
            rx_text_add(&text, "");
            rx_cell_exact(&text, column, row, e);
            add_xml(dst, text.failed ? "" : text.data);
            dst->failed |= text.failed;
            rx_text_free(&text);
        }
        rx_text_add(dst, "</TD>");
    }
    rx_text_add(dst, "</TR>\n");
}

static void add_param(rx_text *dst, const char *indent, const rx_votable_param *p)
{
    rx_text_printf(dst, "%s<PARAM", indent);
    add_attribute(dst, "name", p->name);
    add_attribute(dst, "datatype", p->datatype);
    add_attribute(dst, "arraysize", strcmp(p->datatype, "char") == 0 ? "*" : NULL);
    add_attribute(dst, "unit", p->unit);
    add_attribute(dst, "ucd", p->ucd);
    rx_text_add(dst, " value=\"");
    add_xml(dst, p->value);
    if (p->help == NULL || p->help[0] == '\0') {
        rx_text_add(dst, "\"/>\n");
        return;
    }
    rx_text_add(dst, "\">");
    add_description(dst, p->help);
    rx_text_add(dst, "</PARAM>\n");
}

static void add_words(rx_text *dst, const char *name, const char *value, const char *comment)
{
    add_param(dst, "  ",
              &(rx_votable_param){.name = name, .datatype = "char", .value = value, .help = comment});
}

static void begin_table(rx_text *dst, const rx_catalog *catalog, int i)
{
    const rx_table *table = catalog->tables[i];
    rx_text_printf(dst, " <TABLE ID=\"table%d\" name=\"", i + 1);
    add_xml(dst, table->name);
    rx_text_printf(dst, "\" nrows=\"%ld\">\n", table->nrows);
    char name[9], value[512];
    for (long k = 0; table->facts != NULL && k < table->nfacts; k++)
        if (rx_table_fact(table, k, name, value))
            add_words(dst, name, value, NULL);
    for (int k = 0; k < table->ncolumns; k++)
        add_field(dst, &table->columns[k]);
    rx_text_add(dst, "  <DATA><TABLEDATA>\n");
}

/* The lines of a record: READ, READ2, READ3, for no name of a PARAM may come twice; text that XML could not
 * hold is escaped as it is in other formats. */
static void add_record(rx_text *dst, const rx_record *record)
{
    for (int i = 0; i < record->n; i++) {
        char *const *pair = record->pairs[i];
        char name[80], number[12] = "";
        rx_text value = {0};
        int count = 1;
        for (int k = 0; k < i; k++)
            count += strcmp(record->pairs[k][0], pair[0]) == 0;
        if (count > 1)
            snprintf(number, sizeof number, "%d", count);
        snprintf(name, sizeof name, "%s%s", pair[0], number);
        rx_printable_add(&value, pair[1]);
        dst->failed |= value.failed;
        if (!value.failed)
            add_words(dst, name, value.data, pair[2]);
        rx_text_free(&value);
    }
}

static void begin_file(rx_text *dst, const rx_catalog *catalog)
{
    rx_text_add(dst, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                     "<VOTABLE version=\"1.4\" xmlns=\"http://www.ivoa.net/xml/VOTable/v1.3\">\n"
                     "<RESOURCE type=\"results\">\n"
                     " <DESCRIPTION>Sources of a Rextract run, one table for each image</DESCRIPTION>\n");
    add_record(dst, catalog->record);
    rx_text_add(dst, " <COOSYS ID=\"J2000\" equinox=\"J2000\" epoch=\"J2000\" system=\"ICRS\"/>\n");
}

const rx_text_format *rx_votable_format(void)
{
    static const rx_text_format format = {.head = begin_file,
                                          .table = begin_table,
                                          .row = add_row,
                                          .table_end = "  </TABLEDATA></DATA>\n </TABLE>\n",
                                          .end = "</RESOURCE>\n</VOTABLE>\n"};
    return &format;
}

/* --- facts of a run --- */

rx_status rx_votable_run_text(const rx_votable_param *params, int nparams, rx_table *const *tables,
                              int ntables, const rx_record *keywords, rx_text *dst, rx_error *err)
{
    rx_text_add(dst, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
                     "<VOTABLE version=\"1.4\" xmlns=\"http://www.ivoa.net/xml/VOTable/v1.3\">\n"
                     "<RESOURCE ID=\"Rextract\" name=\"Rextract\">\n"
                     " <DESCRIPTION>Facts and warnings of a Rextract run</DESCRIPTION>\n"
                     " <RESOURCE ID=\"MetaData\" name=\"MetaData\">\n");
    for (int i = 0; i < nparams; i++)
        add_param(dst, "   ", &params[i]);
    for (int i = 0; i < ntables; i++) {
        const rx_table *table = tables[i];
        rx_text_printf(dst, "  <TABLE ID=\"%s\" name=\"%s\" nrows=\"%ld\">\n", table->name, table->name,
                       table->nrows);
        for (int k = 0; k < table->ncolumns; k++)
            add_field(dst, &table->columns[k]);
        rx_text_add(dst, "   <DATA><TABLEDATA>\n");
        for (long row = 0; row < table->nrows; row++)
            add_row(dst, table, row);
        rx_text_add(dst, "   </TABLEDATA></DATA>\n  </TABLE>\n");
    }
    rx_text_add(dst, " </RESOURCE>\n <RESOURCE ID=\"Config\" name=\"Config\">\n");
    add_record(dst, keywords);
    rx_text_add(dst, " </RESOURCE>\n</RESOURCE>\n</VOTABLE>\n");
    return dst->failed ? rx_error_memory(err, 0) : RX_OK;
}
