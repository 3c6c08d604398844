/* The report of a campaign of any kind. */
#include "lab/report.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "report/figure.h"
#include "report/formats.h"

RX_COLUMNS(CELLS, RX_TEXT("scene", "what was on the tiles"),
           RX_TEXT("condition", "seeing, magnitude, or what restorers were given wrong"),
           RX_TEXT("run", "restorer or method"), RX_TEXT("quantity", "what was measured"),
           RX_ESTIMATE("value", 0, "", "of the quantity"),
           RX_TEXT("setting", "the best of several settings: which one it is"));

/* --- groups --- */

rx_status rx_lab_group_open(rx_lab_group *g, const rx_lab *lab, int nconditions, rx_error *err)
{
    g->lab = lab;
    g->nconditions = nconditions;
    g->ncolumns += lab->nruns;
    for (int k = 0; k < lab->nruns; k++)
        g->column[k] = lab->run[k].name;
    const size_t n = (size_t)nconditions, findings = (size_t)g->nquantities * n * (size_t)g->ncolumns;
    RX_TRY(RX_MAKE(g->condition, n, err));
    RX_TRY(RX_MAKE(g->place, n, err));
    return RX_MAKE(g->finding, findings, err);
}

void rx_lab_group_free(rx_lab_group *g)
{
    free(g->condition);
    free(g->place);
    free(g->finding);
    *g = (rx_lab_group){0};
}

rx_finding *rx_lab_group_at(const rx_lab_group *g, int quantity, int condition, int column)
{
    return &g->finding[((size_t)quantity * (size_t)g->nconditions + (size_t)condition) * (size_t)g->ncolumns +
                       (size_t)column];
}

/* A quantity over the conditions, a curve for each column of the page, slightly apart so that bars do not hide each other. */
static void plot(rx_figures *dst, const rx_lab_group *g, const char *id, int q)
{
    const rx_quantity *quantity = &g->quantity[q];
    double low = HUGE_VAL, high = -HUGE_VAL, top = 0;
    for (int c = 0; c < g->nconditions; c++)
        if (!isnan(g->place[c])) {
            low = fmin(low, g->place[c]);
            high = fmax(high, g->place[c]);
        }
    const double step = high > low ? (high - low) / fmax(g->nconditions - 1, 1) : 1;
    rx_axes axes = {.xlabel = g->axis, .x0 = low - 0.5 * step, .x1 = high + 0.5 * step};
    rx_curves curves = {0};
    char of[RX_FIGURE_ID], label[64];
    for (int k = 0; k < g->ncolumns; k++) {
        if (g->hidden[k])
            continue;
        rx_curves_add(&curves, RX_CURVE_BARS, rx_method_color(g->column[k]), g->column[k]);
        for (int c = 0; c < g->nconditions; c++) {
            const rx_estimate *e = &rx_lab_group_at(g, q, c, k)->value;
            rx_curves_put(&curves, g->place[c] + 0.05 * step * (curves.n - 1), e->value, e->low, e->high);
            top = isfinite(e->value) ? fmax(top, e->value) : top;
        }
    }
    if (quantity->unit[0] == '\0' && top <= 1)
        axes.y1 = 1.02; /* a share */
    snprintf(label, sizeof label, quantity->unit[0] != '\0' ? "%.40s (%.16s)" : "%.40s", quantity->name,
             quantity->unit);
    axes.ylabel = label;
    snprintf(of, sizeof of, "%.12s-%.18s", id, quantity->name);
    rx_curves_figure(dst, of, quantity->name, quantity->help, &axes, &curves);
}

/* One quantity as rows of "cells", and as a table of conditions against columns. */
static void show(rx_lab_page *page, const rx_lab_group *g, int q, int in_brief)
{
    const rx_quantity *quantity = &g->quantity[q];
    const rx_report_view view = {.from = rx_report_rows(page->cells),
                                 .title = quantity->name,
                                 .unit = quantity->unit,
                                 .note = quantity->help,
                                 .rows = {"condition"},
                                 .across = {"run"},
                                 .value = "value",
                                 .digits = quantity->digits,
                                 .in_brief = in_brief};
    for (int i = 0; i < g->nconditions * g->ncolumns; i++) {
        const int c = i / g->ncolumns, k = i % g->ncolumns;
        const rx_finding *one = rx_lab_group_at(g, q, c, k);
        if (!g->hidden[k])
            rx_report_put(page->cells, g->name, g->condition[c], g->column[k], quantity->name, one->value,
                          one->setting);
    }
    rx_report_show(page->report, page->cells, &view);
}

void rx_lab_group_show(rx_lab_page *page, const rx_lab_group *g, const char *id, const char *title, int drawn,
                       const char *words)
{
    char prefix[RX_FIGURE_ID];
    for (int q = 0; q < g->open && drawn; q++)
        plot(rx_report_figures_of(page->report), g, id, q);
    rx_report_section(page->report, id, title);
    snprintf(prefix, sizeof prefix, "%.12s-", id);
    if (drawn)
        rx_report_place(page->report, prefix);
    if (words != NULL)
        rx_report_sentence(page->report, words);
    for (int q = 0; q < g->nquantities; q++) {
        if (q == g->open)
            rx_report_fold(page->report, "More tables");
        show(page, g, q, q < g->open);
    }
    if (g->nquantities > g->open)
        rx_report_unfold(page->report);
}

/* --- rows.ecsv --- */

/* Columns of all tables, each name once, but the run, which has a column of its own: a row has a value in those of its own
 * table alone. */
typedef struct columns {
    int n;
    rx_lab_column list[64];
} columns;

static int find_column(const char *name, int n, const rx_lab_column *list)
{
    int i = 0;
    while (i < n && strcmp(list[i].name, name) != 0)
        i++;
    return i;
}

static void add_columns(columns *dst, int n, const rx_lab_column *list)
{
    for (int i = 0; i < n; i++)
        if (find_column(list[i].name, dst->n, dst->list) == dst->n && strcmp(list[i].name, RX_LAB_RUN) != 0 &&
            dst->n < (int)(sizeof dst->list / sizeof *dst->list))
            dst->list[dst->n++] = list[i];
}

/* A row for each run, or one where the table is of no run, or of the one that it names. */
static void put_row(rx_ecsv *out, const rx_lab *lab, const rx_lab_table *table, long i, const columns *all,
                    const char *const names[2], long tile)
{
    const rx_lab_schema *schema = table->schema;
    const double *own = rx_lab_own(table, i);
    const int of = find_column(RX_LAB_RUN, schema->nown, schema->own);
    for (int k = 0; k < (schema->neach > 0 ? lab->nruns : 1); k++) {
        const double *each = rx_lab_each(table, i, k);
        rx_ecsv_text(out, schema->name);
        rx_ecsv_text(out, names[0]);
        rx_ecsv_text(out, names[1]);
        rx_ecsv_count(out, tile);
        rx_ecsv_count(out, i + 1);
        rx_ecsv_text(out, schema->neach > 0    ? lab->run[k].name
                          : of == schema->nown ? ""
                                               : lab->run[(int)own[of]].name);
        for (int c = 0; c < all->n; c++) {
            const int a = find_column(all->list[c].name, schema->nown, schema->own),
                      b = find_column(all->list[c].name, schema->neach, schema->each);
            if (a < schema->nown || b < schema->neach)
                rx_ecsv_number(out, a < schema->nown ? own[a] : each[b]);
            else
                rx_ecsv_text(out, "");
        }
        rx_ecsv_row_end(out);
    }
}

static rx_status write_rows(const rx_lab *lab, const char *folder, rx_error *err)
{
    columns all = {0};
    rx_text text = {0};
    rx_ecsv out = rx_ecsv_on(&text);
    rx_ecsv_meta(&out, "type", lab->kind->name);
    rx_ecsv_column(&out, "table", RX_ECSV_TEXT, "", "what the row is of");
    rx_ecsv_column(&out, "scene", RX_ECSV_TEXT, "", CELLS[0].help);
    rx_ecsv_column(&out, "condition", RX_ECSV_TEXT, "", CELLS[1].help);
    rx_ecsv_column(&out, "tile", RX_ECSV_LONG, "", "from 1, of its scene and condition");
    rx_ecsv_column(&out, "number", RX_ECSV_LONG, "", "from 1, of its table on this tile");
    rx_ecsv_column(&out, "run", RX_ECSV_TEXT, "", CELLS[2].help);
    for (int t = 0; t < lab->kind->ntables; t++) {
        add_columns(&all, lab->kind->tables[t].nown, lab->kind->tables[t].own);
        add_columns(&all, lab->kind->tables[t].neach, lab->kind->tables[t].each);
    }
    for (int c = 0; c < all.n; c++)
        rx_ecsv_column(&out, all.list[c].name, RX_ECSV_FLOAT, all.list[c].unit, all.list[c].help);
    rx_ecsv_columns_end(&out);
    for (long u = 0; u < lab->nunits; u++) {
        char names[2][96];
        lab->kind->name_set(lab, &lab->unit[u], names);
        for (int t = 0; t < lab->kind->ntables; t++) {
            const rx_lab_table table = rx_lab_unit_table(lab, &lab->values[u], t);
            for (long i = 0; i < table.n; i++)
                put_row(&out, lab, &table, i, &all, (const char *[]){names[0], names[1]},
                        lab->unit[u].number + 1);
        }
    }
    return rx_report_file(folder, lab->config->output_name, "rows.ecsv", &text, err);
}

/* --- page --- */

/* The heading, with the name of the file of settings, and first facts; NULL without memory. */
static rx_report *begin(const rx_lab *lab, const char *command)
{
    const char *file = lab->config->settings.file, *slash = file != NULL ? strrchr(file, '/') : NULL;
    char seed[32], type[16] = "", title[128], name[64] = "";
    if (file != NULL)
        snprintf(name, sizeof name, "%.*s", (int)strcspn(slash != NULL ? slash + 1 : file, "."),
                 slash != NULL ? slash + 1 : file);
    const int named = name[0] != '\0' && strcmp(name, "default") != 0;
    snprintf(title, sizeof title, "%s%s%s", lab->kind->title, named ? ", " : "", named ? name : "");
    rx_report *r = rx_report_new("Validation: ", title);
    if (r == NULL)
        return NULL;
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)lab->config->seed);
    for (int i = 0; lab->kind->name[i] != '\0'; i++)
        type[i] = (char)tolower((unsigned char)lab->kind->name[i]);
    rx_report_fact(r, "format", "rextract-campaign 3");
    rx_report_fact(r, "type", type);
    rx_report_fact(r, "title", lab->kind->title);
    rx_report_fact(r, "command", command);
    rx_report_fact(r, "seed", seed);
    rx_report_fact_number(r, "interval_level", RX_LEVEL);
    rx_report_fact(r, "about", lab->about[0] != '\0' ? lab->about : NULL);
    if (lab->about[0] != '\0')
        rx_report_sentence(r, lab->about);
    return r;
}

rx_status rx_lab_report(const rx_lab *lab, const char *folder, rx_text *brief, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    const rx_report_files files = {
        .folder = folder, .shown = config->output_name, .figures = config->qa_figures, .log = log};
    const char *(*pairs)[2] = NULL;
    rx_lab_page page = {.lab = lab};
    rx_record keywords = {0};
    rx_text command = {0}, words = {0};
    rx_status status;
    RX_TRY_EXIT(rx_lab_settings(lab, &keywords, &command, err));
    RX_TRY_EXIT(rx_record_list(&keywords, &pairs, err));
    rx_report *r = page.report = begin(lab, command.data);
    if (r == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    page.cells = RX_REPORT_TABLE(r, "cells", CELLS, RX_REPORT_IN_FILE);
    RX_TRY_EXIT(lab->kind->report(&page, err));
    rx_report_section(r, "reading", "How to read this");
    rx_report_paragraph(r, lab->kind->reading);
    rx_report_section(r, "record", "What made this page");
    rx_text_printf(&words, "Seed %llu; %s", (unsigned long long)config->seed, command.data);
    rx_report_sentence(r, words.data);
    rx_report_record(r, keywords.n, (const char *const(*)[2])pairs);
    RX_TRY_EXIT(rx_report_write(r, &files, brief, err));
    status = write_rows(lab, folder, err);
exit:
    rx_report_free(page.report);
    rx_record_free(&keywords);
    rx_text_free(&command);
    rx_text_free(&words);
    free(pairs);
    return status;
}
