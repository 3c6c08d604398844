/* Reports: the page as it grows, and the files. */
#include "report/report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "report/escape.h"
#include "report/page.h"
#include "report/report_file.h"
#include "report/report_table.h"

enum { TABLES_MAX = 64, ENTRIES_MAX = 48, PLACES_MAX = 64, PREFIX = 32 };

struct rx_report {
    rx_text head, links, body, brief;
    int nplaces; /* of figures: offset into the body, and the beginning of their ids */
    struct {
        size_t at;
        char prefix[PREFIX];
    } place[PLACES_MAX];
    int nentries;
    rx_report_entry entry[ENTRIES_MAX];
    int ntables;
    rx_report_table table[TABLES_MAX];
    int nrecord;
    const char *const (*record)[2]; /* not owned */
    rx_figures figures;
    bool failed;
};

rx_report *rx_report_new(const char *kind, const char *title)
{
    rx_report *r = RX_NEW(rx_report, 1);
    if (r == NULL)
        return NULL;
    rx_page_begin(&r->head, kind, title);
    rx_figures_begin(&r->figures);
    return r;
}

void rx_report_free(rx_report *r)
{
    if (r == NULL)
        return;
    rx_text_free(&r->head);
    rx_text_free(&r->links);
    rx_text_free(&r->body);
    rx_text_free(&r->brief);
    for (int i = 0; i < r->nentries; i++) {
        free(r->entry[i].text);
        free(r->entry[i].numbers);
    }
    for (int i = 0; i < r->ntables; i++)
        rx_report_table_clear(&r->table[i]);
    rx_figures_free(&r->figures);
    free(r);
}

/* --- facts --- */

static rx_report_entry *entry_new(rx_report *r, const char *name)
{
    if (r->nentries == ENTRIES_MAX) {
        r->failed = true;
        return NULL;
    }
    rx_report_entry *entry = &r->entry[r->nentries++];
    *entry = (rx_report_entry){.name = name};
    return entry;
}

void rx_report_fact(rx_report *r, const char *name, const char *text)
{
    rx_report_entry *entry = entry_new(r, name);
    if (entry == NULL || text == NULL)
        return;
    entry->text = rx_strdup(text);
    r->failed = r->failed || entry->text == NULL;
}

static void put_numbers(rx_report *r, const char *name, long n, const double *values, bool list)
{
    rx_report_entry *entry = entry_new(r, name);
    if (entry == NULL)
        return;
    entry->numbers = RX_NEW(double, (size_t)n);
    entry->list = list;
    if (entry->numbers == NULL) {
        r->failed = true;
        return;
    }
    entry->nnumbers = n;
    memcpy(entry->numbers, values, (size_t)n * sizeof *values);
}

void rx_report_fact_number(rx_report *r, const char *name, double value)
{
    put_numbers(r, name, 1, &value, false);
}

void rx_report_fact_numbers(rx_report *r, const char *name, long n, const double *values)
{
    put_numbers(r, name, n, values, true);
}

/* --- the page --- */

void rx_report_verdict(rx_report *r, const char *mark, const char *word, const char *sentence)
{
    rx_text_printf(&r->head, "<p><b class=\"v %s\">", mark);
    rx_escape_html(&r->head, word);
    rx_text_add(&r->head, "</b> ");
    rx_escape_html(&r->head, sentence);
    rx_text_add(&r->head, "</p>\n");
}

void rx_report_section(rx_report *r, const char *id, const char *title)
{
    rx_page_link(&r->links, true, id, title);
    rx_page_section(&r->body, id, title);
}

void rx_report_heading(rx_report *r, const char *title, const char *unit)
{
    rx_page_heading(&r->body, title, unit);
}

void rx_report_paragraph(rx_report *r, const char *html)
{
    rx_page_paragraph(&r->body, html);
}

void rx_report_sentence(rx_report *r, const char *words)
{
    if (words == NULL)
        return;
    rx_text_add(&r->body, "<p>");
    rx_escape_html(&r->body, words);
    rx_text_add(&r->body, "</p>\n");
}

void rx_report_note(rx_report *r, const char *html)
{
    rx_page_note(&r->body, html);
}

void rx_report_lines(rx_report *r, const char *words)
{
    char *copy = rx_strdup(words), *line = copy;
    r->failed = r->failed || copy == NULL;
    rx_text_add(&r->body, "<pre>");
    while (line != NULL && *line != '\0') {
        char *end = line + strcspn(line, "\n"), *next = *end != '\0' ? end + 1 : end;
        *end = '\0';
        rx_escape_html(&r->body, line);
        rx_text_add(&r->body, "\n");
        line = next;
    }
    rx_text_add(&r->body, "</pre>\n");
    free(copy);
}

void rx_report_fold(rx_report *r, const char *title)
{
    rx_text_add(&r->body, "<details><summary><b>");
    rx_escape_html(&r->body, title);
    rx_text_add(&r->body, "</b></summary>\n");
}

void rx_report_unfold(rx_report *r)
{
    rx_text_add(&r->body, "</details>\n");
}

rx_figures *rx_report_figures_of(rx_report *r)
{
    return &r->figures;
}

void rx_report_place(rx_report *r, const char *prefix)
{
    if (r->nplaces == PLACES_MAX) {
        r->failed = true;
        return;
    }
    r->place[r->nplaces].at = r->body.length;
    snprintf(r->place[r->nplaces++].prefix, PREFIX, "%s", prefix);
}

rx_text *rx_report_brief_of(rx_report *r)
{
    return &r->brief;
}

void rx_report_record(rx_report *r, int n, const char *const (*pairs)[2])
{
    r->nrecord = n;
    r->record = pairs;
    rx_page_record(&r->body, n, pairs);
}

/* --- tables --- */

rx_report_table *rx_report_table_add(rx_report *r, const char *name, int ncolumns,
                                     const rx_report_column *columns, int where)
{
    if (r->ntables == TABLES_MAX) {
        r->failed = true;
        return NULL;
    }
    rx_report_table *table = &r->table[r->ntables++];
    rx_report_table_make(table, name, ncolumns, columns, where);
    return table;
}

void rx_report_show(rx_report *r, const rx_report_table *table, const rx_report_view *view)
{
    if (table == NULL || table->failed)
        return;
    rx_report_table_html(&r->body, table, view);
    if (view->in_brief)
        rx_report_table_brief(&r->brief, table, view);
}

void rx_report_show_brief(rx_report *r, const rx_report_table *table, const rx_report_view *view)
{
    if (table != NULL && !table->failed)
        rx_report_table_brief(&r->brief, table, view);
}

/* --- files --- */

static void write_json(rx_text *dst, const rx_report *r)
{
    rx_json j = rx_json_on(dst);
    rx_json_object(&j, NULL, false);
    for (int i = 0; i < r->nentries; i++) {
        const rx_report_entry *entry = &r->entry[i];
        if (entry->list)
            rx_json_numbers(&j, entry->name, entry->nnumbers, entry->numbers);
        else if (entry->nnumbers == 1)
            rx_json_number(&j, entry->name, entry->numbers[0]);
        else
            rx_json_string(&j, entry->name, entry->text);
    }
    for (int i = 0; i < r->ntables; i++)
        if (r->table[i].where & RX_REPORT_IN_JSON)
            rx_report_table_json(&j, &r->table[i]);
    rx_json_record(&j, r->nrecord, r->record);
    rx_json_end(&j);
}

/* The body with its figures. */
static void write_html(rx_text *dst, const rx_report *r)
{
    size_t done = 0;
    rx_text_add(dst, r->head.data);
    rx_page_links_begin(dst);
    rx_text_add(dst, r->links.data != NULL ? r->links.data : "");
    rx_page_links_end(dst);
    for (int i = 0; i <= r->nplaces; i++) {
        const size_t end = i < r->nplaces ? r->place[i].at : r->body.length;
        if (end > done)
            rx_text_add_bytes(dst, r->body.data + done, end - done);
        if (i < r->nplaces && (i == 0 || r->figures.note[0] == '\0')) /* why there are none: once */
            rx_page_figures(dst, &r->figures, r->place[i].prefix);
        done = end;
    }
    rx_page_end(dst);
}

static rx_status write_tables(const rx_report *r, const rx_report_files *files, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < r->ntables && status == RX_OK; i++) {
        char name[96];
        rx_text text = {0};
        if (!(r->table[i].where & RX_REPORT_IN_FILE))
            continue;
        status = rx_interrupt_check(err);
        if (status != RX_OK)
            break;
        snprintf(name, sizeof name, "%.*s.ecsv", (int)sizeof name - 6, r->table[i].table->name);
        rx_report_table_ecsv(&text, &r->table[i], r->nentries, r->entry);
        status = rx_report_file(files->folder, files->shown, name, &text, err);
    }
    return status;
}

static bool has_failed(const rx_report *r)
{
    bool failed = r->failed || r->figures.script.failed || r->head.failed || r->links.failed ||
                  r->body.failed || r->brief.failed;
    for (int i = 0; i < r->ntables; i++)
        failed = failed || r->table[i].failed;
    return failed;
}

rx_status rx_report_write(rx_report *r, const rx_report_files *files, rx_text *brief, rx_error *err)
{
    rx_text text = {0};
    rx_status status = RX_OK;
    if (has_failed(r))
        return rx_error_memory(err, sizeof *r);
    const bool draws = files->figures && r->figures.n > 0 && r->figures.script.length > 0;
    if (draws)
        status = rx_figures_start(&r->figures, files->gnuplot, files->folder, files->shown, err);
    else if (!files->figures)
        snprintf(r->figures.note, sizeof r->figures.note, "figures were not asked for");
    if (status == RX_OK) { /* while gnuplot draws */
        write_json(&text, r);
        status = rx_report_file(files->folder, files->shown,
                                files->summary != NULL ? files->summary : "summary.json", &text, err);
    }
    if (status == RX_OK)
        status = write_tables(r, files, err);
    if (status == RX_OK && draws)
        status = rx_figures_finish(&r->figures, files->gnuplot, err);
    if (status != RX_OK)
        return status;
    if (draws && r->figures.note[0] != '\0')
        rx_log_warning(files->log, "report without figures: %s", r->figures.note);
    rx_text_free(&r->figures.script);
    write_html(&text, r);
    status = rx_report_file(files->folder, files->shown, files->page != NULL ? files->page : "report.html",
                            &text, err);
    if (status == RX_OK && brief != NULL && r->brief.data != NULL)
        rx_text_add(brief, r->brief.data);
    return status;
}
