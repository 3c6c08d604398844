/* Tables of a report: rows as they come, then HTML, JSON, ECSV and text of them. */
#include "report/report_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "report/formats.h"

enum { PLAIN = 96, LONG_WORDS = 40 };
static const char LEFT[] = "<th scope=\"col\" class=\"t\">", RIGHT[] = "<th scope=\"col\">";

static bool is_words(rx_report_kind kind)
{
    return kind == RX_REPORT_WORDS || kind == RX_REPORT_VERDICT || kind == RX_REPORT_FILE;
}

static int slots_of(rx_report_kind kind)
{
    return kind == RX_REPORT_ESTIMATE ? 4 : kind == RX_REPORT_MEASURED ? 2 : 1;
}

/* --- rows --- */

void rx_report_table_make(rx_report_table *dst, const char *name, int ncolumns,
                          const rx_report_column *columns, int where)
{
    *dst =
        (rx_report_table){.name = rx_strdup(name), .ncolumns = ncolumns, .columns = columns, .where = where};
    dst->first = RX_NEW(int, (size_t)ncolumns);
    dst->failed = dst->name == NULL || dst->first == NULL;
    for (int i = 0; !dst->failed && i < ncolumns; i++) {
        dst->first[i] = dst->nslots;
        dst->nslots += slots_of(columns[i].kind);
    }
}

void rx_report_table_clear(rx_report_table *t)
{
    for (int i = 0; i < t->ncolumns; i++)
        for (long row = 0; is_words(t->columns[i].kind) && row < t->nrows; row++)
            free(t->slot[row * t->nslots + t->first[i]].words);
    free(t->slot);
    free(t->first);
    free(t->name);
    rx_text_free(&t->fact);
}

void rx_report_row(rx_report_table *t, const rx_cell *values)
{
    if (t == NULL || t->failed)
        return;
    if (t->nrows == t->room) {
        const long room = t->room > 0 ? 2 * t->room : 16;
        if (RX_GROW(t->slot, (size_t)room * (size_t)t->nslots, NULL) != RX_OK) {
            t->failed = true;
            return;
        }
        t->room = room;
    }
    rx_report_slot *slot = t->slot + t->nslots * t->nrows++;
    for (int i = 0; i < t->ncolumns; i++) {
        const rx_estimate *e = &values[i].estimate;
        const double numbers[] = {e->value, e->low, e->high, (double)e->n};
        if (is_words(t->columns[i].kind)) {
            slot->words = rx_strdup(values[i].words != NULL ? values[i].words : "");
            t->failed = t->failed || slot->words == NULL;
            slot++;
        } else {
            for (int k = 0; k < slots_of(t->columns[i].kind); k++)
                (slot++)->number = numbers[k];
        }
    }
}

long rx_report_rows(const rx_report_table *t)
{
    return t != NULL ? t->nrows : 0;
}

void rx_report_table_fact(rx_report_table *t, const char *name, const char *text)
{
    if (t != NULL)
        rx_ecsv_meta(&(rx_ecsv){.text = &t->fact, .in_meta = true}, name, text);
}

static const rx_report_slot *at(const rx_report_table *t, int column, long row)
{
    return &t->slot[row * t->nslots + t->first[column]];
}

static rx_estimate estimate_of(const rx_report_slot *slot)
{
    return (rx_estimate){slot[0].number, slot[1].number, slot[2].number, (long)slot[3].number};
}

static const char *heading_of(const rx_report_column *column)
{
    return column->heading != NULL ? column->heading : column->name;
}

static int column_of(const rx_report_table *t, const char *name)
{
    for (int i = 0; i < t->ncolumns; i++)
        if (strcmp(t->columns[i].name, name) == 0)
            return i;
    return -1;
}

/* --- cells of a page; what is not known is a dash --- */

void rx_report_html_named(rx_text *dst, const char *open, const char *text, const char *unit,
                          const char *close)
{
    rx_text_add(dst, open);
    rx_escape_html(dst, text);
    if (unit != NULL && unit[0] != '\0') {
        rx_text_add(dst, " [");
        rx_escape_html(dst, unit);
        rx_text_add(dst, "]");
    }
    rx_text_add(dst, close);
}

static void html_head(rx_text *dst, const rx_report_column *c)
{
    rx_report_html_named(dst, is_words(c->kind) ? LEFT : RIGHT, heading_of(c), c->unit, "</th>");
}

void rx_report_html_words(rx_text *dst, const char *words)
{
    const bool known =
        words != NULL && words[0] != '\0'; /* long ones keep some width beside numbers, which do not wrap */
    rx_text_add(dst, known && strlen(words) > LONG_WORDS ? "<td class=\"t l\">" : "<td class=\"t\">");
    if (known)
        rx_escape_html(dst, words);
    else
        rx_text_add(dst, "&ndash;");
    rx_text_add(dst, "</td>");
}

/* A link to a file beside the page. */
static void html_file(rx_text *dst, const char *name)
{
    const char *shown = name;
    rx_text_add(dst, "<td class=\"t\"><a href=\"");
    for (const char *c = name; *c != '\0'; c++) /* what means something in an address */
        if ((unsigned char)*c < 0x20 || (unsigned char)*c > 0x7e || strchr("%#? ", *c) != NULL)
            rx_text_printf(dst, "%%%02X", (unsigned char)*c);
        else if (strchr("&<>\"'", *c) != NULL)
            rx_text_printf(dst, "&#%d;", *c);
        else
            rx_text_add_bytes(dst, c, 1);
    while (strncmp(shown, "../", 3) == 0)
        shown += 3;
    rx_report_html_named(dst, "\">", shown, NULL, "</a></td>");
}

/* A word in bold and in its colour; those that are not listed name their class themselves (PASS, FAIL). */
static void html_verdict(rx_text *dst, const char *words)
{
    static const char *const marks[][2] = {
        {"reproduced", RX_MARK_GOOD},    {"held", RX_MARK_GOOD},
        {"right", RX_MARK_GOOD},         {"off", RX_MARK_BAD},
        {"not reproduced", RX_MARK_BAD}, {"not held", RX_MARK_BAD},
        {"undecided", RX_MARK_OPEN},     {"not yet testable", RX_MARK_OPEN},
        {"not measured", RX_MARK_PALE},  {"not tested here", RX_MARK_PALE},
        {"NONE", RX_MARK_PALE}};
    const char *mark = words;
    for (size_t i = 0; i < sizeof marks / sizeof *marks; i++)
        if (strcmp(words, marks[i][0]) == 0)
            mark = marks[i][1];
    rx_text_printf(dst, "<td class=\"t %s\">", mark);
    rx_report_html_named(dst, "<b>", words, NULL, "</b></td>");
}

static void html_number(rx_text *dst, double value, int digits)
{
    if (isnan(value))
        rx_text_add(dst, "&ndash;");
    else if (isinf(value))
        rx_text_add(dst, value > 0 ? "&infin;" : "&minus;&infin;");
    else if (digits < 0)
        rx_text_printf(dst, "%.*g", -digits, value);
    else if (fabs(value) >= (digits > 0 ? 1e6 : 1e15)) /* whole numbers keep their digits */
        rx_text_printf(dst, "%.3g", value);
    else /* never -0.00 */
        rx_text_printf(dst, "%.*f", digits, fabs(value) < 0.5 * pow(10, -digits) ? 0.0 : value);
}

/* value [low, high] n=... */
static void html_estimate(rx_text *dst, const rx_estimate *e, int digits)
{
    html_number(dst, e->value, digits);
    if (e->n == 0 && isnan(e->value))
        return;
    rx_text_add(dst, " <small>[");
    html_number(dst, e->low, digits);
    rx_text_add(dst, ", ");
    html_number(dst, e->high, digits);
    rx_text_printf(dst, "] n=%ld</small>", e->n);
}

static void html_cell(rx_text *dst, const rx_report_table *t, int column, long row, int digits)
{
    const rx_report_kind kind = t->columns[column].kind;
    const rx_report_slot *slot = at(t, column, row);
    if (is_words(kind)) {
        if (kind == RX_REPORT_WORDS || slot->words[0] == '\0')
            rx_report_html_words(dst, slot->words);
        else if (kind == RX_REPORT_FILE)
            html_file(dst, slot->words);
        else
            html_verdict(dst, slot->words);
        return;
    }
    rx_text_add(dst, "<td>");
    if (kind == RX_REPORT_COUNT) {
        rx_text_printf(dst, "%ld", (long)slot->number);
    } else if (kind == RX_REPORT_ESTIMATE) {
        const rx_estimate e = estimate_of(slot);
        html_estimate(dst, &e, digits);
    } else {
        html_number(dst, slot->number, digits);
        if (kind == RX_REPORT_MEASURED && isfinite(slot[0].number) && isfinite(slot[1].number)) {
            rx_text_add(dst, " &plusmn; ");
            html_number(dst, slot[1].number, digits);
        }
    }
    rx_text_add(dst, "</td>");
}

/* A cell as a terminal shows it: nothing that could drive it. */
static void plain_cell(char dst[PLAIN], const rx_report_table *t, int column, long row,
                       const rx_report_view *v, int digits)
{
    const rx_report_kind kind = t->columns[column].kind;
    const rx_report_slot *slot = at(t, column, row);
    snprintf(dst, PLAIN, "-");
    if (is_words(kind)) {
        if (slot->words[0] != '\0')
            snprintf(dst, PLAIN, "%s", slot->words);
        for (char *c = dst; *c != '\0'; c++)
            *c = *c >= ' ' && *c <= '~' ? *c : '?';
    } else if (isfinite(slot->number) && kind == RX_REPORT_ESTIMATE && v->intervals) {
        const rx_estimate e = estimate_of(slot);
        snprintf(dst, PLAIN, "%.4g [%.4g, %.4g] n=%ld", e.value, e.low, e.high, e.n);
    } else if (isfinite(slot->number)) {
        const int shown = kind == RX_REPORT_COUNT ? 0 : digits;
        snprintf(dst, PLAIN, shown < 0 ? "%.*g" : "%.*f", abs(shown), slot->number);
    }
}

/* --- views --- */

typedef struct pivot {
    int nrows, rows[2], across, value; /* columns; nrows: that together name a row */
} pivot;

/* false: the view shows rows as they are. */
static bool pivot_of(const rx_report_table *t, const rx_report_view *v, pivot *dst)
{
    if (v->value == NULL)
        return false;
    *dst = (pivot){.across = column_of(t, v->across[0]), .value = column_of(t, v->value)};
    for (; dst->nrows < 2 && v->rows[dst->nrows] != NULL; dst->nrows++)
        dst->rows[dst->nrows] = column_of(t, v->rows[dst->nrows]);
    return true;
}

static bool same(const rx_report_table *t, int n, const int *columns, long one, long other)
{
    bool equal = true;
    for (int i = 0; i < n && equal; i++) {
        const rx_report_slot *a = at(t, columns[i], one), *b = at(t, columns[i], other);
        equal = is_words(t->columns[columns[i]].kind) ? strcmp(a->words, b->words) == 0
                                                      : memcmp(a, b, sizeof *a) == 0;
    }
    return equal;
}

/* The row from `from` on whose words are new since view->from; view->to: none. */
static long next_new(const rx_report_table *t, const rx_report_view *v, int n, const int *columns, long from)
{
    for (long row = from; row < v->to; row++) {
        long before = v->from;
        while (before < row && !same(t, n, columns, before, row))
            before++;
        if (before == row)
            return row;
    }
    return v->to;
}

/* The row of a pivot's cell; -1: there is none. */
static long row_of(const rx_report_table *t, const rx_report_view *v, const pivot *p, long like, long across)
{
    for (long row = v->from; row < v->to; row++)
        if (same(t, p->nrows, p->rows, row, like) && same(t, 1, &p->across, row, across))
            return row;
    return -1;
}

/* Would the page have nothing but dashes? */
static bool is_empty(const rx_report_table *t, int column, long from, long to)
{
    const rx_report_kind kind = t->columns[column].kind;
    bool empty = kind != RX_REPORT_COUNT;
    for (long row = from; row < to && empty; row++) {
        const rx_report_slot *slot = at(t, column, row);
        empty = is_words(kind) ? slot->words[0] == '\0'
                               : isnan(slot->number) && (kind != RX_REPORT_ESTIMATE || slot[3].number == 0);
    }
    return empty;
}

bool rx_report_knows(const rx_report_table *t, const char *column)
{
    return !t->failed && rx_report_rows(t) > 0 && !is_empty(t, column_of(t, column), 0, t->nrows);
}

/* The columns that a view of rows as they are shows; their number in *n. To be freed; NULL without memory. */
static int *columns_of(const rx_report_table *t, const rx_report_view *v, long to, int *n)
{
    const int all = v->ncolumns > 0 ? v->ncolumns : t->ncolumns;
    int *columns = RX_NEW(int, (size_t)all);
    *n = 0;
    for (int i = 0; i < all && columns != NULL; i++) {
        columns[*n] = v->ncolumns > 0 ? column_of(t, v->columns[i]) : i;
        *n += !v->without_empty || !is_empty(t, columns[*n], v->from, to);
    }
    return columns;
}

static void html_rows(rx_text *dst, const rx_report_table *t, const rx_report_view *v)
{
    const long to = v->most > 0 && v->to - v->from > v->most ? v->from + v->most : v->to;
    int n, *columns = columns_of(t, v, to, &n);
    dst->failed = dst->failed || columns == NULL;
    rx_text_add(dst, "<tr>");
    for (int i = 0; i < n; i++)
        html_head(dst, &t->columns[columns[i]]);
    for (long k = v->from; k < to; k++) {
        rx_text_add(dst, "</tr>\n<tr>");
        for (int i = 0; i < n; i++)
            html_cell(dst, t, columns[i], k, t->columns[columns[i]].digits);
    }
    rx_text_add(dst, "</tr>\n");
    free(columns);
}

static void html_turned(rx_text *dst, const rx_report_table *t, const rx_report_view *v)
{
    int n, *columns = columns_of(t, v, v->to, &n);
    dst->failed = dst->failed || columns == NULL;
    const char *corner = n > 0 ? heading_of(&t->columns[columns[0]]) : "";
    rx_text_add(dst, "<tr>");
    rx_report_html_named(dst, LEFT, corner[0] != '\0' ? corner : "number", NULL, "</th>");
    rx_report_html_named(dst, LEFT, "what it is", NULL, "</th>");
    for (long k = v->from; k < v->to && n > 0; k++)
        rx_report_html_named(dst, RIGHT, at(t, columns[0], k)->words, NULL, "</th>");
    for (int i = 1; i < n; i++) {
        const rx_report_column *c = &t->columns[columns[i]];
        rx_text_add(dst, "</tr>\n<tr class=\"u\">");
        rx_report_html_named(dst, "<th scope=\"row\" class=\"t\">", heading_of(c), c->unit, "</th>");
        rx_report_html_words(dst, c->help);
        for (long k = v->from; k < v->to; k++)
            html_cell(dst, t, columns[i], k, c->digits);
    }
    rx_text_add(dst, "</tr>\n");
    free(columns);
}

static void html_pivot(rx_text *dst, const rx_report_table *t, const rx_report_view *v, const pivot *p)
{
    char label[PLAIN];
    const long first = next_new(t, v, 1, &p->across, v->from);
    rx_text_add(dst, "<tr>");
    for (int i = 0; i < p->nrows; i++)
        html_head(dst, &t->columns[p->rows[i]]);
    for (long a = first; a < v->to; a = next_new(t, v, 1, &p->across, a + 1)) {
        plain_cell(label, t, p->across, a, v, -6);
        rx_report_html_named(dst, is_words(t->columns[p->value].kind) ? LEFT : RIGHT, label, NULL, "</th>");
    }
    for (long k = next_new(t, v, p->nrows, p->rows, v->from); k < v->to;
         k = next_new(t, v, p->nrows, p->rows, k + 1)) {
        bool empty = v->without_empty; /* no cell of the row says anything */
        for (long row = v->from; row < v->to && empty; row++)
            empty = !same(t, p->nrows, p->rows, row, k) || is_empty(t, p->value, row, row + 1);
        if (empty)
            continue;
        rx_text_add(dst, "</tr>\n<tr>");
        for (int i = 0; i < p->nrows; i++)
            html_cell(dst, t, p->rows[i], k, t->columns[p->rows[i]].digits);
        for (long a = first; a < v->to; a = next_new(t, v, 1, &p->across, a + 1)) {
            const long row = row_of(t, v, p, k, a);
            if (row >= 0)
                html_cell(dst, t, p->value, row, v->digits);
            else
                rx_report_html_words(dst, NULL);
        }
    }
    rx_text_add(dst, "</tr>\n");
}

void rx_report_table_html(rx_text *dst, const rx_report_table *t, const rx_report_view *v)
{
    const bool in_file = t->where & RX_REPORT_IN_FILE;
    pivot p;
    rx_text_add(dst, "<div class=\"w\" tabindex=\"0\"><table>\n");
    const bool is_pivot = pivot_of(t, v, &p);
    if (is_pivot)
        html_pivot(dst, t, v, &p);
    else if (v->turned)
        html_turned(dst, t, v);
    else
        html_rows(dst, t, v);
    rx_text_add(dst, "</table></div>\n");
    if (!is_pivot && v->most > 0 && v->to - v->from > v->most)
        rx_text_printf(dst, "<p class=\"r\">%ld of %ld rows. All are in %s%s.</p>\n", v->most,
                       v->to - v->from, in_file ? t->name : "summary", in_file ? ".ecsv" : ".json");
}

static void brief_pivot(rx_text *dst, const rx_report_table *t, const rx_report_view *v, const pivot *p)
{
    char cell[PLAIN];
    const long first = next_new(t, v, 1, &p->across, v->from);
    rx_text_printf(dst, "%s\n%-28s", v->title != NULL ? v->title : t->name, "");
    for (long a = first; a < v->to; a = next_new(t, v, 1, &p->across, a + 1)) {
        plain_cell(cell, t, p->across, a, v, -6);
        rx_text_printf(dst, " %9s", cell);
    }
    for (long k = next_new(t, v, p->nrows, p->rows, v->from); k < v->to;
         k = next_new(t, v, p->nrows, p->rows, k + 1)) {
        plain_cell(cell, t, p->rows[0], k, v, -6);
        rx_text_printf(dst, "\n%-28s", cell);
        for (long a = first; a < v->to; a = next_new(t, v, 1, &p->across, a + 1)) {
            const long row = row_of(t, v, p, k, a);
            snprintf(cell, PLAIN, "-");
            if (row >= 0)
                plain_cell(cell, t, p->value, row, v, v->digits);
            rx_text_printf(dst, " %9s", cell);
        }
    }
    rx_text_add(dst, "\n");
}

/* A line of headings and one for each row; columns as wide as what they hold. */
static void brief_rows(rx_text *dst, const rx_report_table *t, const rx_report_view *v)
{
    char cell[PLAIN];
    int n, *columns = columns_of(t, v, v->to, &n), *width = RX_NEW(int, (size_t)n + 1);
    dst->failed = dst->failed || columns == NULL || width == NULL;
    for (int pass = 0; pass < 2 && !dst->failed; pass++) /* how wide, then the text */
        for (long k = v->from - 1; k < v->to; k++)
            for (int i = 0; i < n; i++) {
                const rx_report_column *c = &t->columns[columns[i]];
                if (k >= v->from)
                    plain_cell(cell, t, columns[i], k, v, c->digits);
                else
                    snprintf(cell, PLAIN, "%s", heading_of(c));
                if (pass == 0)
                    width[i] = (int)fmax(width[i], (double)strlen(cell));
                else
                    rx_text_printf(dst, "%s%*s%s", i > 0 ? "  " : "",
                                   !is_words(c->kind) ? width[i]
                                   : i + 1 < n        ? -width[i]
                                                      : 0,
                                   cell, i + 1 < n ? "" : "\n");
            }
    free(width);
    free(columns);
}

void rx_report_table_brief(rx_text *dst, const rx_report_table *t, const rx_report_view *v)
{
    pivot p;
    if (pivot_of(t, v, &p))
        brief_pivot(dst, t, v, &p);
    else
        brief_rows(dst, t, v);
}

/* --- files --- */

void rx_report_table_json(rx_json *j, const rx_report_table *t)
{
    rx_json_array(j, t->name, false);
    for (long k = 0; k < t->nrows; k++) {
        rx_json_object(j, NULL, true);
        for (int i = 0; i < t->ncolumns; i++) {
            const rx_report_column *c = &t->columns[i];
            const rx_report_slot *slot = at(t, i, k);
            char second[PLAIN];
            if (is_words(c->kind)) {
                rx_json_string(j, c->name, slot->words[0] != '\0' ? slot->words : NULL);
            } else if (c->kind == RX_REPORT_ESTIMATE) { /* an end that is not bounded is null */
                rx_json_object(j, c->name, true);
                rx_json_number(j, "value", slot[0].number);
                rx_json_number(j, "low", slot[1].number);
                rx_json_number(j, "high", slot[2].number);
                rx_json_number(j, "n", slot[3].number);
                rx_json_end(j);
            } else if (c->kind == RX_REPORT_COUNT && slot->number >= 0) {
                rx_json_count(j, c->name, (uint64_t)slot->number); /* every digit */
            } else {
                rx_json_number(j, c->name, slot->number);
            }
            if (c->kind == RX_REPORT_MEASURED) {
                snprintf(second, PLAIN, "%s_error", c->name);
                rx_json_number(j, second, slot[1].number);
            }
        }
        rx_json_end(j);
    }
    rx_json_end(j);
}

/* One of the columns that an ECSV file has for one of the table. */
static void ecsv_column(rx_ecsv *file, const rx_report_column *c, int part)
{
    static const char *const ends[] = {"", "_low", "_high", "_n"};
    static const char *const meanings[] = {"", "lower end of the interval", "upper end of the interval",
                                           "sources behind it"};
    char name[PLAIN];
    const char *help = part > 0 ? meanings[part] : c->help != NULL ? c->help : "";
    snprintf(name, PLAIN, "%s%s", c->name, ends[part]);
    if (part > 0 && c->kind == RX_REPORT_MEASURED) {
        snprintf(name, PLAIN, "%s_error", c->name);
        help = "1 sigma";
    }
    rx_ecsv_column(file, name,
                   is_words(c->kind)                         ? RX_ECSV_TEXT
                   : c->kind == RX_REPORT_COUNT || part == 3 ? RX_ECSV_LONG
                                                             : RX_ECSV_FLOAT,
                   part < 3 && c->unit != NULL ? c->unit : "", help);
}

void rx_report_table_ecsv(rx_text *dst, const rx_report_table *t, const rx_ecsv *head)
{
    rx_ecsv file = *head;
    file.text = dst;
    rx_text_add(dst, head->text->data);
    if (t->fact.data != NULL)
        rx_text_printf(dst, "%s%s", head->in_meta ? "" : "# meta:\n", t->fact.data);
    dst->failed = dst->failed || t->fact.failed;
    for (int i = 0; i < t->ncolumns; i++)
        for (int part = 0; part < slots_of(t->columns[i].kind); part++)
            ecsv_column(&file, &t->columns[i], part);
    rx_ecsv_columns_end(&file);
    for (long k = 0; k < t->nrows; k++) {
        for (int i = 0; i < t->ncolumns; i++)
            for (int part = 0; part < slots_of(t->columns[i].kind); part++) {
                const rx_report_slot *slot = at(t, i, k) + part;
                if (is_words(t->columns[i].kind))
                    rx_ecsv_text(&file, slot->words);
                else if (t->columns[i].kind == RX_REPORT_COUNT || part == 3)
                    rx_ecsv_count(&file, (long)slot->number);
                else
                    rx_ecsv_number(&file, slot->number);
            }
        rx_ecsv_row_end(&file);
    }
}
