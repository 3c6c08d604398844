/* Tables of a report: rows as they come, then HTML, JSON, ECSV and text of them. */
#include "report/report_table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "report/ecsv.h"
#include "report/escape.h"
#include "report/json.h"
#include "report/page.h"

enum { PLAIN = 96 };

/* Columns of the table behind one of the report. */
static int parts_of(rx_report_kind kind)
{
    return kind == RX_REPORT_ESTIMATE ? 4 : kind == RX_REPORT_P || kind == RX_REPORT_MEASURED ? 2 : 1;
}

static bool is_words(rx_report_kind kind)
{
    return kind == RX_REPORT_WORDS || kind == RX_REPORT_VERDICT || kind == RX_REPORT_FILE;
}

static void make_column(rx_column *dst, const rx_report_column *from, int part)
{
    static const char *const ends[] = {"", "_low", "_high", "_n"};
    static const char *const meanings[] = {"", "lower end of the interval", "upper end of the interval",
                                           "sources behind it"};
    const bool logarithm = from->kind == RX_REPORT_P && part == 1;
    const bool error = from->kind == RX_REPORT_MEASURED && part == 1;
    const bool whole = from->kind == RX_REPORT_COUNT || (from->kind == RX_REPORT_ESTIMATE && part == 3);
    snprintf(dst->name, sizeof dst->name, "%s%s%s", logarithm ? "ln_" : "", from->name,
             logarithm ? ""
             : error   ? "_error"
                       : ends[part]);
    if (part < 3 && from->unit != NULL)
        snprintf(dst->unit, sizeof dst->unit, "%s", from->unit);
    snprintf(dst->description, sizeof dst->description, "%s",
             logarithm            ? "its natural logarithm"
             : error              ? "1 sigma"
             : part > 0           ? meanings[part]
             : from->help != NULL ? from->help
                                  : "");
    dst->type = is_words(from->kind) ? RX_CELL_TEXT : whole ? RX_CELL_INT64 : RX_CELL_DOUBLE;
    dst->text_width = 1;
}

void rx_report_table_make(rx_report_table *dst, const char *name, int ncolumns,
                          const rx_report_column *columns, int where)
{
    int n = 0;
    *dst = (rx_report_table){.ncolumns = ncolumns, .columns = columns, .where = where};
    dst->first = RX_NEW(int, (size_t)ncolumns);
    for (int i = 0; dst->first != NULL && i < ncolumns; i++) {
        dst->first[i] = n;
        n += parts_of(columns[i].kind);
    }
    dst->table = dst->first != NULL ? rx_table_new(n) : NULL;
    if (dst->table == NULL) {
        dst->failed = true;
        return;
    }
    free(dst->table->name);
    dst->table->name = rx_strdup(name);
    dst->failed = dst->table->name == NULL;
    for (int i = 0; i < ncolumns; i++)
        for (int part = 0; part < parts_of(columns[i].kind); part++)
            make_column(&dst->table->columns[dst->first[i] + part], &columns[i], part);
}

void rx_report_table_clear(rx_report_table *table)
{
    rx_table_free(table->table);
    free(table->first);
    free(table->fact.text);
}

/* --- rows --- */

static bool grow(rx_report_table *t)
{
    const long room = t->room > 0 ? 2 * t->room : 16;
    for (int i = 0; i < t->table->ncolumns; i++) {
        rx_column *column = &t->table->columns[i];
        void *data = rx_regrow(column->data, (size_t)room, (size_t)rx_column_element_size(column));
        if (data == NULL)
            return false;
        column->data = data;
    }
    t->room = room;
    return true;
}

/* Words longer than all before them: every row becomes wider. */
static bool widen(rx_column *column, long rows, long room, int width)
{
    char *data = rx_alloc((size_t)room, (size_t)width);
    if (data == NULL)
        return false;
    for (long k = 0; k < rows; k++)
        memcpy(data + k * width, (const char *)column->data + k * column->text_width,
               (size_t)column->text_width);
    free(column->data);
    column->data = data;
    column->text_width = width;
    return true;
}

static bool put_words(rx_report_table *t, rx_column *column, const char *words)
{
    const int needed = words != NULL ? (int)strlen(words) + 1 : 1;
    if (needed > column->text_width) {
        const int twice = 2 * column->text_width;
        if (!widen(column, t->table->nrows, t->room, needed > twice ? needed : twice))
            return false;
    }
    char *cell = (char *)column->data + t->table->nrows * column->text_width;
    memset(cell, 0, (size_t)column->text_width);
    memcpy(cell, words != NULL ? words : "", (size_t)needed);
    return true;
}

static void put_number(rx_column *column, long row, double value)
{
    if (column->type == RX_CELL_INT64)
        ((int64_t *)column->data)[row] = (int64_t)value;
    else
        ((double *)column->data)[row] = value;
}

void rx_report_row(rx_report_table *t, const rx_cell *values)
{
    if (t == NULL || t->failed)
        return;
    if (t->table->nrows == t->room && !grow(t)) {
        t->failed = true;
        return;
    }
    const long row = t->table->nrows;
    for (int i = 0; i < t->ncolumns; i++) {
        rx_column *column = &t->table->columns[t->first[i]];
        const rx_estimate *e = &values[i].estimate;
        switch (t->columns[i].kind) {
        case RX_REPORT_WORDS:
        case RX_REPORT_VERDICT:
        case RX_REPORT_FILE:
            t->failed = !put_words(t, column, values[i].words) || t->failed;
            break;
        case RX_REPORT_ESTIMATE:
            put_number(column, row, e->value);
            put_number(column + 1, row, e->low);
            put_number(column + 2, row, e->high);
            put_number(column + 3, row, (double)e->n);
            break;
        case RX_REPORT_P:
        case RX_REPORT_MEASURED:
            put_number(column + 1, row, e->value);
            put_number(column, row, values[i].number);
            break;
        case RX_REPORT_COUNT:
        case RX_REPORT_NUMBER:
            put_number(column, row, values[i].number);
            break;
        }
    }
    t->table->nrows++;
}

long rx_report_rows(const rx_report_table *t)
{
    return t != NULL && t->table != NULL ? t->table->nrows : 0;
}

void rx_report_table_fact(rx_report_table *t, const char *name, const char *text)
{
    if (t == NULL)
        return;
    t->fact = (rx_report_entry){.name = name, .text = rx_strdup(text)};
    t->failed = t->failed || t->fact.text == NULL;
}

/* --- cells --- */

static const char *words_at(const rx_report_table *t, int column, long row)
{
    const rx_column *c = &t->table->columns[t->first[column]];
    return (const char *)c->data + row * c->text_width;
}

static double number_at(const rx_report_table *t, int column, int part, long row)
{
    return rx_column_value(&t->table->columns[t->first[column] + part], row, 0);
}

static rx_estimate estimate_at(const rx_report_table *t, int column, long row)
{
    return (rx_estimate){number_at(t, column, 0, row), number_at(t, column, 1, row),
                         number_at(t, column, 2, row), (long)number_at(t, column, 3, row)};
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

/* The colour of a verdict's words; those that are not listed name their class themselves (PASS, FAIL). */
static const char *mark_of(const char *words)
{
    static const char *const marks[][2] = {
        {"reproduced", RX_MARK_GOOD},    {"held", RX_MARK_GOOD},
        {"right", RX_MARK_GOOD},         {"off", RX_MARK_BAD},
        {"not reproduced", RX_MARK_BAD}, {"not held", RX_MARK_BAD},
        {"undecided", RX_MARK_OPEN},     {"not yet testable", RX_MARK_OPEN},
        {"not measured", RX_MARK_PALE},  {"not tested here", RX_MARK_PALE},
        {"NONE", RX_MARK_PALE}};
    for (size_t i = 0; i < sizeof marks / sizeof *marks; i++)
        if (strcmp(words, marks[i][0]) == 0)
            return marks[i][1];
    return words;
}

static void html_cell(rx_text *dst, const rx_report_table *t, int column, long row, int digits)
{
    const rx_report_column *c = &t->columns[column];
    rx_estimate e;
    switch (c->kind) {
    case RX_REPORT_WORDS:
        rx_page_cell_text(dst, words_at(t, column, row));
        break;
    case RX_REPORT_VERDICT:
        if (words_at(t, column, row)[0] == '\0')
            rx_page_cell_text(dst, NULL);
        else
            rx_page_cell_verdict(dst, mark_of(words_at(t, column, row)), words_at(t, column, row));
        break;
    case RX_REPORT_FILE:
        rx_page_cell_file(dst, words_at(t, column, row));
        break;
    case RX_REPORT_COUNT:
        rx_page_cell_count(dst, (long)number_at(t, column, 0, row));
        break;
    case RX_REPORT_MEASURED:
        rx_page_cell_measured(dst, number_at(t, column, 0, row), number_at(t, column, 1, row), digits);
        break;
    case RX_REPORT_NUMBER:
        rx_page_cell_number(dst, number_at(t, column, 0, row), digits);
        break;
    case RX_REPORT_ESTIMATE:
        e = estimate_at(t, column, row);
        rx_page_cell_estimate(dst, &e, digits);
        break;
    case RX_REPORT_P:
        rx_page_cell_p(dst, number_at(t, column, 0, row), number_at(t, column, 1, row));
        break;
    }
}

/* A cell as a terminal shows it: nothing that could drive it. */
static void plain_cell(char dst[PLAIN], const rx_report_table *t, int column, long row,
                       const rx_report_view *v, int digits)
{
    const rx_report_kind kind = t->columns[column].kind;
    const double value = is_words(kind) ? NAN : number_at(t, column, 0, row);
    if (is_words(kind) && words_at(t, column, row)[0] != '\0') {
        snprintf(dst, PLAIN, "%s", words_at(t, column, row));
        for (char *c = dst; *c != '\0'; c++)
            *c = *c >= ' ' && *c <= '~' ? *c : '?';
    } else if (kind == RX_REPORT_ESTIMATE && v->intervals && isfinite(value)) {
        const rx_estimate e = estimate_at(t, column, row);
        snprintf(dst, PLAIN, "%.4g [%.4g, %.4g] n=%ld", e.value, e.low, e.high, e.n);
    } else if (isfinite(value)) {
        snprintf(dst, PLAIN, digits < 0 ? "%.*g" : "%.*f",
                 kind == RX_REPORT_COUNT ? 0
                 : digits < 0            ? -digits
                                         : digits,
                 value);
    } else {
        snprintf(dst, PLAIN, "-");
    }
}

/* --- views --- */

/* Columns whose words together name a row of a pivot, or a column of it. */
typedef struct key {
    int n, column[2];
} key;

typedef struct pivot {
    key rows, across;
    int value;
} pivot;

static bool key_of(const rx_report_table *t, const char *const *names, key *dst)
{
    *dst = (key){0};
    for (int i = 0; i < 2 && names[i] != NULL; i++) {
        dst->column[i] = column_of(t, names[i]);
        if (dst->column[i] < 0)
            return false;
        dst->n++;
    }
    return dst->n > 0;
}

static bool pivot_of(const rx_report_table *t, const rx_report_view *v, pivot *dst)
{
    if (v->value == NULL || !key_of(t, v->rows, &dst->rows) || !key_of(t, v->across, &dst->across))
        return false;
    dst->value = column_of(t, v->value);
    return dst->value >= 0;
}

static bool same(const rx_report_table *t, const key *k, long one, long other)
{
    for (int i = 0; i < k->n; i++) {
        const rx_column *c = &t->table->columns[t->first[k->column[i]]];
        const size_t size = (size_t)rx_column_element_size(c);
        if (memcmp((const char *)c->data + (size_t)one * size, (const char *)c->data + (size_t)other * size,
                   size) != 0)
            return false;
    }
    return true;
}

/* The row from `from` on whose words are new since view->from; view->to: none. */
static long next_new(const rx_report_table *t, const rx_report_view *v, const key *k, long from)
{
    for (long row = from; row < v->to; row++) {
        long before = v->from;
        while (before < row && !same(t, k, before, row))
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
        if (same(t, &p->rows, row, like) && same(t, &p->across, row, across))
            return row;
    return -1;
}

/* The words of both columns, "NET TEMPLATE". */
static void label_of(char dst[PLAIN], const rx_report_table *t, const key *k, long row)
{
    static const rx_report_view as_it_is = {0};
    plain_cell(dst, t, k->column[0], row, &as_it_is, -6);
    if (k->n > 1) {
        const size_t length = strlen(dst);
        char second[PLAIN];
        plain_cell(second, t, k->column[1], row, &as_it_is, -6);
        snprintf(dst + length, PLAIN - length, " %s", second);
    }
}

/* Would the page have nothing but dashes? */
static bool is_empty(const rx_report_table *t, int column, long from, long to)
{
    const rx_report_kind kind = t->columns[column].kind;
    bool empty = kind != RX_REPORT_COUNT;
    for (long row = from; row < to && empty; row++)
        empty = is_words(kind) ? words_at(t, column, row)[0] == '\0'
                               : isnan(number_at(t, column, 0, row)) &&
                                     (kind != RX_REPORT_ESTIMATE || estimate_at(t, column, row).n == 0);
    return empty;
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
    rx_page_row(dst, NULL);
    for (int i = 0; i < n; i++) {
        const rx_report_column *c = &t->columns[columns[i]];
        rx_page_head(dst, is_words(c->kind) ? RX_LEFT : RX_RIGHT, heading_of(c), c->unit);
    }
    rx_page_row_end(dst);
    for (long k = v->from; k < to; k++) {
        rx_page_row(dst, NULL);
        for (int i = 0; i < n; i++)
            html_cell(dst, t, columns[i], k, t->columns[columns[i]].digits);
        rx_page_row_end(dst);
    }
    free(columns);
}

static void html_turned(rx_text *dst, const rx_report_table *t, const rx_report_view *v)
{
    int n, *columns = columns_of(t, v, v->to, &n);
    dst->failed = dst->failed || columns == NULL;
    rx_page_row(dst, NULL);
    const char *corner = n > 0 ? heading_of(&t->columns[columns[0]]) : "";
    rx_page_head(dst, RX_LEFT, corner[0] != '\0' ? corner : "number", NULL);
    rx_page_head(dst, RX_LEFT, "what it is", NULL);
    for (long k = v->from; k < v->to && n > 0; k++)
        rx_page_head(dst, RX_RIGHT, words_at(t, columns[0], k), NULL);
    rx_page_row_end(dst);
    for (int i = 1; i < n; i++) {
        const rx_report_column *c = &t->columns[columns[i]];
        rx_page_row(dst, "u");
        rx_page_cell_title(dst, heading_of(c), c->unit);
        rx_page_cell_text(dst, c->help);
        for (long k = v->from; k < v->to; k++)
            html_cell(dst, t, columns[i], k, c->digits);
        rx_page_row_end(dst);
    }
    free(columns);
}

/* Has no cell of a pivot's row anything to say? */
static bool is_empty_row(const rx_report_table *t, const rx_report_view *v, const pivot *p, long like)
{
    bool empty = true;
    for (long row = v->from; row < v->to && empty; row++)
        empty = !same(t, &p->rows, row, like) || is_empty(t, p->value, row, row + 1);
    return empty;
}

static void html_pivot(rx_text *dst, const rx_report_table *t, const rx_report_view *v, const pivot *p)
{
    char label[PLAIN];
    const long first = next_new(t, v, &p->across, v->from);
    rx_page_row(dst, NULL);
    for (int i = 0; i < p->rows.n; i++) {
        const rx_report_column *c = &t->columns[p->rows.column[i]];
        rx_page_head(dst, is_words(c->kind) ? RX_LEFT : RX_RIGHT, heading_of(c), c->unit);
    }
    for (long a = first; a < v->to; a = next_new(t, v, &p->across, a + 1)) {
        label_of(label, t, &p->across, a);
        rx_page_head(dst, is_words(t->columns[p->value].kind) ? RX_LEFT : RX_RIGHT, label, NULL);
    }
    rx_page_row_end(dst);
    for (long k = next_new(t, v, &p->rows, v->from); k < v->to; k = next_new(t, v, &p->rows, k + 1)) {
        if (v->without_empty && is_empty_row(t, v, p, k))
            continue;
        rx_page_row(dst, NULL);
        for (int i = 0; i < p->rows.n; i++)
            html_cell(dst, t, p->rows.column[i], k, t->columns[p->rows.column[i]].digits);
        for (long a = first; a < v->to; a = next_new(t, v, &p->across, a + 1)) {
            const long row = row_of(t, v, p, k, a);
            if (row >= 0)
                html_cell(dst, t, p->value, row, v->digits);
            else
                rx_page_cell_text(dst, NULL);
        }
        rx_page_row_end(dst);
    }
}

/* The same view with the end of its rows. */
static rx_report_view view_of(const rx_report_table *t, const rx_report_view *v)
{
    rx_report_view view = *v;
    if (view.to == 0)
        view.to = rx_report_rows(t);
    return view;
}

void rx_report_table_html(rx_text *dst, const rx_report_table *t, const rx_report_view *view)
{
    const rx_report_view v = view_of(t, view);
    pivot p;
    if (v.title != NULL)
        rx_page_heading(dst, v.title, v.unit);
    if (v.note != NULL) {
        rx_text_add(dst, "<p class=\"r\">");
        rx_escape_html(dst, v.note);
        rx_text_add(dst, "</p>\n");
    }
    rx_page_table_begin(dst);
    const bool is_pivot = pivot_of(t, &v, &p);
    if (is_pivot)
        html_pivot(dst, t, &v, &p);
    else if (v.turned)
        html_turned(dst, t, &v);
    else
        html_rows(dst, t, &v);
    rx_page_table_end(dst);
    if (!is_pivot && v.most > 0 && v.to - v.from > v.most)
        rx_text_printf(dst, "<p class=\"r\">%ld of %ld rows. All are in %s%s.</p>\n", v.most, v.to - v.from,
                       t->where & RX_REPORT_IN_FILE ? t->table->name : "summary",
                       t->where & RX_REPORT_IN_FILE ? ".ecsv" : ".json");
}

static void brief_pivot(rx_text *dst, const rx_report_table *t, const rx_report_view *v, const pivot *p)
{
    char cell[PLAIN];
    const long first = next_new(t, v, &p->across, v->from);
    rx_text_printf(dst, "%s\n%-28s", v->title != NULL ? v->title : t->table->name, "");
    for (long a = first; a < v->to; a = next_new(t, v, &p->across, a + 1)) {
        label_of(cell, t, &p->across, a);
        rx_text_printf(dst, " %9s", cell);
    }
    for (long k = next_new(t, v, &p->rows, v->from); k < v->to; k = next_new(t, v, &p->rows, k + 1)) {
        label_of(cell, t, &p->rows, k);
        rx_text_printf(dst, "\n%-28s", cell);
        for (long a = first; a < v->to; a = next_new(t, v, &p->across, a + 1)) {
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
    rx_text *lines = RX_NEW(rx_text, (size_t)(v->to - v->from) + 1);
    int n, *columns = columns_of(t, v, v->to, &n);
    dst->failed = dst->failed || columns == NULL || lines == NULL;
    for (int i = 0; i < n && !dst->failed; i++) {
        const rx_report_column *c = &t->columns[columns[i]];
        int width = (int)strlen(heading_of(c));
        for (int pass = 0; pass < 2; pass++) /* how wide, then the text */
            for (long k = v->from - 1; k < v->to; k++) {
                if (k >= v->from)
                    plain_cell(cell, t, columns[i], k, v, c->digits);
                else
                    snprintf(cell, PLAIN, "%s", heading_of(c));
                if (pass == 0 && (int)strlen(cell) > width)
                    width = (int)strlen(cell);
                if (pass == 1)
                    rx_text_printf(&lines[k - v->from + 1], "%s%*s", i > 0 ? "  " : "",
                                   !is_words(c->kind) ? width
                                   : i + 1 < n        ? -width
                                                      : 0,
                                   cell);
            }
    }
    for (long k = 0; lines != NULL && k <= v->to - v->from; k++) {
        rx_text_printf(dst, "%s\n", lines[k].data != NULL ? lines[k].data : "");
        dst->failed = dst->failed || lines[k].failed;
        rx_text_free(&lines[k]);
    }
    free(lines);
    free(columns);
}

void rx_report_table_brief(rx_text *dst, const rx_report_table *t, const rx_report_view *view)
{
    const rx_report_view v = view_of(t, view);
    pivot p;
    if (pivot_of(t, &v, &p))
        brief_pivot(dst, t, &v, &p);
    else
        brief_rows(dst, t, &v);
}

/* --- files --- */

void rx_report_table_json(rx_json *j, const rx_report_table *t)
{
    rx_json_array(j, t->table->name, false);
    for (long k = 0; k < rx_report_rows(t); k++) {
        rx_json_object(j, NULL, true);
        for (int i = 0; i < t->ncolumns; i++) {
            const rx_report_column *c = &t->columns[i];
            const rx_estimate e =
                c->kind == RX_REPORT_ESTIMATE ? estimate_at(t, i, k) : (rx_estimate){NAN, NAN, NAN, 0};
            if (is_words(c->kind))
                rx_json_string(j, c->name, words_at(t, i, k)[0] != '\0' ? words_at(t, i, k) : NULL);
            else if (c->kind == RX_REPORT_ESTIMATE)
                rx_json_estimate(j, c->name, &e);
            else if (c->kind == RX_REPORT_COUNT && number_at(t, i, 0, k) >= 0)
                rx_json_count(j, c->name, (uint64_t)number_at(t, i, 0, k)); /* every digit */
            else
                rx_json_number(j, c->name, number_at(t, i, 0, k));
            if (c->kind == RX_REPORT_P || c->kind == RX_REPORT_MEASURED)
                rx_json_number(j, t->table->columns[t->first[i] + 1].name, number_at(t, i, 1, k));
        }
        rx_json_end(j);
    }
    rx_json_end(j);
}

void rx_report_table_ecsv(rx_text *dst, const rx_report_table *t, int nfacts, const rx_report_entry *facts)
{
    rx_ecsv file = rx_ecsv_on(dst);
    for (int i = 0; i < nfacts; i++)
        if (facts[i].text != NULL)
            rx_ecsv_meta(&file, facts[i].name, facts[i].text);
        else if (facts[i].nnumbers == 1)
            rx_ecsv_meta_number(&file, facts[i].name, facts[i].numbers[0]);
    if (t->fact.name != NULL)
        rx_ecsv_meta(&file, t->fact.name, t->fact.text);
    for (int i = 0; i < t->table->ncolumns; i++) {
        const rx_column *c = &t->table->columns[i];
        rx_ecsv_column(&file, c->name,
                       c->type == RX_CELL_TEXT    ? RX_ECSV_TEXT
                       : c->type == RX_CELL_INT64 ? RX_ECSV_LONG
                                                  : RX_ECSV_FLOAT,
                       c->unit, c->description);
    }
    rx_ecsv_columns_end(&file);
    for (long k = 0; k < t->table->nrows; k++) {
        for (int i = 0; i < t->table->ncolumns; i++) {
            const rx_column *c = &t->table->columns[i];
            if (c->type == RX_CELL_TEXT)
                rx_ecsv_text(&file, (const char *)c->data + k * c->text_width);
            else if (c->type == RX_CELL_INT64)
                rx_ecsv_count(&file, (long)((const int64_t *)c->data)[k]);
            else
                rx_ecsv_number(&file, ((const double *)c->data)[k]);
        }
        rx_ecsv_row_end(&file);
    }
}
