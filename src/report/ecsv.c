/* Tables as ECSV. */
#include "report/ecsv.h"

#include <math.h>
#include <strings.h>

#include "report/escape.h"

rx_ecsv rx_ecsv_on(rx_text *text)
{
    rx_text_add(text, "# %ECSV 1.0\n# ---\n# delimiter: ','\n");
    return (rx_ecsv){.text = text};
}

/* The line before the first entry, once. */
static void part_begin(rx_ecsv *table, bool *begun, const char *line)
{
    if (!*begun)
        rx_text_add(table->text, line);
    *begun = true;
}

void rx_ecsv_meta(rx_ecsv *table, const char *name, const char *value)
{
    part_begin(table, &table->in_meta, "# meta:\n");
    rx_text_printf(table->text, "#   %s: ", name);
    rx_escape_quoted(table->text, value);
    rx_text_add(table->text, "\n");
}

void rx_ecsv_meta_number(rx_ecsv *table, const char *name, double value)
{
    part_begin(table, &table->in_meta, "# meta:\n");
    rx_text_printf(table->text, "#   %s: %.9g\n", name, value);
}

/* YAML, the language of the header, takes these words for true and false. */
static int is_truth(const char *name)
{
    static const char *const words[] = {"true", "false", "yes", "no", "on", "off"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strcasecmp(name, words[i]) == 0)
            return 1;
    return 0;
}

void rx_ecsv_column(rx_ecsv *table, const char *name, rx_ecsv_type type, const char *unit,
                    const char *description)
{
    static const char *const types[] = {"float64", "int64", "string"};
    part_begin(table, &table->in_columns, "# datatype:\n");
    const char *quote = is_truth(name) ? "'" : "";
    rx_text_printf(table->text, "# - {name: %s%s%s, datatype: %s", quote, name, quote, types[type]);
    if (unit[0] != '\0')
        rx_text_printf(table->text, ", unit: '%s'", unit);
    rx_text_printf(table->text, ", description: \"%s\"}\n", description);
    rx_text_printf(&table->names, "%s%s", table->names.length > 0 ? "," : "", name);
}

void rx_ecsv_columns_end(rx_ecsv *table)
{
    rx_text_printf(table->text, "# schema: astropy-2.0\n%s\n",
                   table->names.data != NULL ? table->names.data : "");
    table->text->failed = table->text->failed || table->names.failed;
    rx_text_free(&table->names);
}

static void next_cell(rx_ecsv *table)
{
    if (table->filled)
        rx_text_add(table->text, ",");
    table->filled = true;
}

void rx_ecsv_number(rx_ecsv *table, double value)
{
    next_cell(table);
    if (isfinite(value))
        rx_text_printf(table->text, "%.9g", value == 0 ? 0 : value);
    else
        rx_text_add(table->text, isnan(value) ? "nan" : value > 0 ? "inf" : "-inf");
}

void rx_ecsv_count(rx_ecsv *table, long value)
{
    next_cell(table);
    rx_text_printf(table->text, "%ld", value);
}

void rx_ecsv_text(rx_ecsv *table, const char *value)
{
    next_cell(table);
    rx_escape_cell(table->text, value);
}

void rx_ecsv_row_end(rx_ecsv *table)
{
    rx_text_add(table->text, "\n");
    table->filled = false;
}
