/* Reports: the page as it grows, in the house style and without scripts, and the files. */
#include "report/report.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "report/formats.h"
#include "report/report_table.h"

enum { TABLES_MAX = 64, PLACES_MAX = 64, PREFIX = 32 };

/* Light and dark by what the reader's system asks for; paper is always light. Text has a contrast of 4.5 at least on
 * its ground, lines of 3 (WCAG 2, AA; tests/pages.py measures it). Figures take --ink and --grid: report/figure.c. */
/* clang-format off */
static const char STYLE[] =
    ":root{color-scheme:light dark;--ink:#222;--soft:#595959;--ground:#fff;--head:#f4f4f4;--rule:#ddd;"
    "--grid:#e4e4e4;--link:#0b5394;--good:#1b7a2b;--bad:#b3261e;--open:#8a5a00}"
    "@media screen and (prefers-color-scheme:dark){:root{--ink:#e4e4e4;--soft:#adadad;--ground:#16181c;"
    "--head:#23262c;--rule:#3a3e46;--grid:#31353c;--link:#8ab4f8;--good:#6fcf7f;--bad:#ff8a80;--open:#e8b54a}"
    "}"
    "body{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--ground);max-width:1100px;"
    "margin:0 auto;padding:1em 1.5em;overflow-wrap:anywhere}"
    "h1{font-size:1.6em;margin:.3em 0;line-height:1.25}"
    "h2{font-size:1.25em;margin:2em 0 .5em;border-bottom:1px solid var(--rule)}h3{font-size:1em}"
    "nav a{margin-right:1em;display:inline-block}a{color:var(--link)}.skip{position:absolute;left:-99em}"
    ".skip:focus{position:static}:focus-visible{outline:2px solid var(--link);outline-offset:2px}"
    "summary{cursor:pointer}pre{white-space:pre-wrap}"
    "table{border-collapse:collapse;margin:.7em 0;font-size:.92em;overflow-wrap:normal}"
    "th,td{padding:.25em .7em;text-align:right;border-bottom:1px solid var(--rule);white-space:nowrap}"
    "th[scope=col]{background:var(--head)}tr:hover>*{background:var(--head)}"
    "tr.u td:nth-child(n+3){text-align:right}td.t,th.t{text-align:left;white-space:normal}"
    "td.l{min-width:15em}table th.t{font-weight:600}td small,.pale{color:var(--soft)}"
    "p.r{color:var(--soft);font-size:.92em;margin:.2em 0 1em;max-width:64em}"
    ".f{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0;flex:1 1 440px;max-width:520px;min-width:0}"
    "figure.p{flex:0 1 300px}figure.l{flex:0 1 1060px;max-width:none}"
    "figure svg{display:block;width:100%;height:auto;fill:none;stroke:currentColor;"
    "font:13px Helvetica,Arial,sans-serif}figure text{fill:currentColor;stroke:none}"
    "figure image{image-rendering:pixelated}svg .gridline{stroke:var(--grid)}"
    "figcaption b{display:block;color:var(--ink)}"
    "figcaption{color:var(--soft);font-size:.9em}.PASS{color:var(--good)}.FAIL{color:var(--bad)}"
    ".INSUFFICIENT{color:var(--open)}b.v{font-size:1.2em}.w{overflow-x:auto}"
    "@media print{body{max-width:none;padding:0;font-size:10pt}nav,.skip{display:none}.w{overflow:visible}"
    "th,td{white-space:normal;padding:.15em .4em}figure,tr{break-inside:avoid}h2,h3,tr:has(th[scope=col]){"
    "break-after:avoid}figure{flex-basis:48%}figure.p{flex-basis:31%}figure.l{flex-basis:100%}a{"
    "color:inherit}}";
/* clang-format on */

struct rx_report {
    rx_text head, links, body, brief;
    int nplaces; /* of figures: offset into the body, and the beginning of their ids */
    struct {
        size_t at;
        char prefix[PREFIX];
    } place[PLACES_MAX];
    rx_text summary, meta; /* summary.json and the head of every ECSV file, as far as the facts go */
    rx_json json;
    rx_ecsv ecsv;
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
    rx_text_add(&r->head, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta "
                          "name=\"viewport\" content=\"width=device-width\">\n<title>");
    rx_escape_html(&r->head, kind);
    rx_escape_html(&r->head, title);
    rx_text_printf(&r->head,
                   "</title>\n<style>%s</style></head>\n<body>\n<a class=\"skip\" href=\"#main\">Skip to the "
                   "content</a>\n<header>\n<h1>",
                   STYLE);
    rx_escape_html(&r->head, kind);
    rx_report_html_named(&r->head, "", title, NULL, "</h1>\n");
    r->json = rx_json_on(&r->summary);
    rx_json_object(&r->json, NULL, false);
    r->ecsv = rx_ecsv_on(&r->meta);
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
    rx_text_free(&r->summary);
    rx_text_free(&r->meta);
    for (int i = 0; i < r->ntables; i++)
        rx_report_table_clear(&r->table[i]);
    rx_figures_free(&r->figures);
    free(r);
}

/* --- facts --- */

void rx_report_fact(rx_report *r, const char *name, const char *text)
{
    rx_json_string(&r->json, name, text);
    if (text != NULL)
        rx_ecsv_meta(&r->ecsv, name, text);
}

void rx_report_fact_number(rx_report *r, const char *name, double value)
{
    rx_json_number(&r->json, name, value);
    rx_ecsv_meta_number(&r->ecsv, name, value);
}

void rx_report_fact_numbers(rx_report *r, const char *name, long n, const double *values)
{
    rx_json_array(&r->json, name, true);
    for (long i = 0; i < n; i++)
        rx_json_number(&r->json, NULL, values[i]);
    rx_json_end(&r->json);
}

/* --- the page --- */

void rx_report_verdict(rx_report *r, const char *mark, const char *word, const char *sentence)
{
    rx_text_printf(&r->head, "<p><b class=\"v %s\">", mark);
    rx_report_html_named(&r->head, "", word, NULL, "</b> ");
    rx_report_html_named(&r->head, "", sentence, NULL, "</p>\n");
}

void rx_report_section(rx_report *r, const char *id, const char *title)
{
    rx_text_printf(&r->links, "<a href=\"#%s\">", id);
    rx_report_html_named(&r->links, "", title, NULL, "</a>");
    rx_text_printf(&r->body, "<h2 id=\"%s\">", id);
    rx_report_html_named(&r->body, "", title, NULL, "</h2>\n");
}

void rx_report_heading(rx_report *r, const char *title, const char *unit)
{
    rx_report_html_named(&r->body, "<h3>", title, unit, "</h3>\n");
}

void rx_report_paragraph(rx_report *r, const char *html)
{
    rx_text_printf(&r->body, "<p>%s</p>\n", html);
}

void rx_report_sentence(rx_report *r, const char *words)
{
    if (words != NULL)
        rx_report_html_named(&r->body, "<p>", words, NULL, "</p>\n");
}

void rx_report_note(rx_report *r, const char *html)
{
    rx_text_printf(&r->body, "<p class=\"r\">%s</p>\n", html);
}

void rx_report_lines(rx_report *r, const char *words)
{
    rx_text_add(&r->body, "<pre>");
    while (*words != '\0') {
        const size_t n = strcspn(words, "\n");
        rx_text line = {0};
        rx_text_add_bytes(&line, words, n);
        rx_report_html_named(&r->body, "", line.data, NULL, "\n");
        r->failed = r->failed || line.failed;
        rx_text_free(&line);
        words += n + (words[n] == '\n');
    }
    rx_text_add(&r->body, "</pre>\n");
}

void rx_report_fold(rx_report *r, const char *title)
{
    rx_report_html_named(&r->body, "<details><summary><b>", title, NULL, "</b></summary>\n");
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
    rx_text_add(
        &r->body,
        "<details><summary>configuration and inputs</summary>\n<div class=\"w\" tabindex=\"0\"><table>\n");
    for (int i = 0; i < n; i++) {
        rx_report_html_named(&r->body, "<tr><th scope=\"row\" class=\"t\">", pairs[i][0], NULL, "</th>");
        rx_report_html_words(&r->body, pairs[i][1]);
        rx_text_add(&r->body, "</tr>\n");
    }
    rx_text_add(&r->body, "</table></div>\n</details>\n");
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
    rx_report_view shown = *view;
    if (shown.to == 0)
        shown.to = table->nrows;
    if (view->in_brief != 0)
        rx_report_table_brief(&r->brief, table, &shown);
    if (view->in_brief == RX_BRIEF_ALONE)
        return;
    if (view->title != NULL)
        rx_report_heading(r, view->title, view->unit);
    if (view->note != NULL)
        rx_report_html_named(&r->body, "<p class=\"r\">", view->note, NULL, "</p>\n");
    rx_report_table_html(&r->body, table, &shown);
}

/* --- files --- */

rx_status rx_report_file(const char *folder, const char *shown, const char *name, rx_text *text,
                         rx_error *err)
{
    rx_text path = {0}, shown_path = {0};
    rx_text_printf(&path, "%s/%s", folder, name);
    rx_text_printf(&shown_path, "%s/%s", shown, name);
    const rx_status status = path.failed || shown_path.failed
                                 ? rx_error_memory(err, 0)
                                 : rx_text_write_file(text, path.data, shown_path.data, err);
    rx_text_free(&path);
    rx_text_free(&shown_path);
    rx_text_free(text);
    return status;
}

/* The tables and the record after the facts. */
static void finish_json(rx_report *r)
{
    rx_json *j = &r->json;
    for (int i = 0; i < r->ntables; i++)
        if (r->table[i].where & RX_REPORT_IN_JSON)
            rx_report_table_json(j, &r->table[i]);
    rx_json_array(j, "record", false);
    for (int i = 0; i < r->nrecord; i++) {
        rx_json_object(j, NULL, true);
        rx_json_string(j, "name", r->record[i][0]);
        rx_json_string(j, "value", r->record[i][1]);
        rx_json_end(j);
    }
    rx_json_end(j);
    rx_json_end(j);
}

/* Its SVG (or "not drawn"), title and reading. */
static void put_figure(rx_text *dst, const rx_figure *figure)
{
    static const char *const frame[] = {"<figure>", "<figure class=\"p\">", "<figure class=\"l\">"};
    bool picture = figure->kind == RX_FIGURE_PICTURE;
    rx_text_add(dst, frame[figure->kind]);
    rx_text_add(dst, figure->svg != NULL ? figure->svg : "<p>not drawn</p>");
    rx_report_html_named(dst, picture ? "<figcaption>" : "<figcaption><b>", figure->title, NULL,
                         !picture                     ? "</b>"
                         : figure->reading[0] != '\0' ? ": "
                                                      : "");
    rx_report_html_named(dst, "", figure->reading, NULL, "</figcaption></figure>\n");
}

/* All figures whose id begins with `prefix`, side by side, or once why there are none. */
static void put_figures(rx_text *dst, const rx_figures *figures, const char *prefix, bool first)
{
    if (figures->note[0] != '\0') {
        if (first)
            rx_report_html_named(dst, "<p><b>No figures:</b> ", figures->note, NULL,
                                 ". The tables are complete.</p>\n");
        return;
    }
    rx_text_add(dst, "<div class=\"f\">\n");
    for (int i = 0; i < figures->n; i++)
        if (strncmp(figures->figure[i].id, prefix, strlen(prefix)) == 0)
            put_figure(dst, &figures->figure[i]);
    rx_text_add(dst, "</div>\n");
}

/* The body with its figures. */
static void write_html(rx_text *dst, const rx_report *r)
{
    size_t done = 0;
    rx_text_printf(dst, "%s<nav aria-label=\"Sections\">%s</nav>\n</header>\n<main id=\"main\">\n",
                   r->head.data, r->links.data != NULL ? r->links.data : "");
    for (int i = 0; i <= r->nplaces; i++) {
        const size_t end = i < r->nplaces ? r->place[i].at : r->body.length;
        if (end > done)
            rx_text_add_bytes(dst, r->body.data + done, end - done);
        if (i < r->nplaces)
            put_figures(dst, &r->figures, r->place[i].prefix, i == 0);
        done = end;
    }
    rx_text_add(dst, "</main>\n</body></html>\n");
}

static rx_status write_tables(const rx_report *r, const rx_report_files *files, rx_error *err)
{
    for (int i = 0; i < r->ntables; i++) {
        char name[96];
        rx_text text = {0};
        if (!(r->table[i].where & RX_REPORT_IN_FILE))
            continue;
        RX_TRY(rx_interrupt_check(err));
        snprintf(name, sizeof name, "%.*s.ecsv", (int)sizeof name - 6, r->table[i].name);
        rx_report_table_ecsv(&text, &r->table[i], &r->ecsv);
        RX_TRY(rx_report_file(files->folder, files->shown, name, &text, err));
    }
    return RX_OK;
}

rx_status rx_report_write(rx_report *r, const rx_report_files *files, rx_text *brief, rx_error *err)
{
    rx_text text = {0};
    bool failed = r->failed || r->figures.script.failed || r->head.failed || r->links.failed ||
                  r->body.failed || r->brief.failed || r->meta.failed || r->summary.failed;
    for (int i = 0; i < r->ntables; i++)
        failed = failed || r->table[i].failed;
    if (failed)
        return rx_error_memory(err, sizeof *r);
    const bool draws = files->figures && r->figures.n > 0;
    if (draws)
        RX_TRY(rx_figures_start(&r->figures, files->gnuplot, files->folder, files->shown, err));
    else if (!files->figures)
        snprintf(r->figures.note, sizeof r->figures.note, "figures were not asked for");
    finish_json(r); /* while gnuplot draws */
    RX_TRY(rx_report_file(files->folder, files->shown,
                          files->summary != NULL ? files->summary : "summary.json", &r->summary, err));
    RX_TRY(write_tables(r, files, err));
    if (draws)
        RX_TRY(rx_figures_finish(&r->figures, err));
    if (draws && r->figures.note[0] != '\0')
        rx_log_warning(files->log, "report without figures: %s", r->figures.note);
    rx_text_free(&r->figures.script);
    write_html(&text, r);
    RX_TRY(rx_report_file(files->folder, files->shown, files->page != NULL ? files->page : "report.html",
                          &text, err));
    if (brief != NULL && r->brief.data != NULL)
        rx_text_add(brief, r->brief.data);
    return RX_OK;
}
