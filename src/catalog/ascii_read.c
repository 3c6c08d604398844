/* Reading tables in plain text: SExtractor's ASCII_HEAD and anything like it. Two passes over the
 * file in memory: the first finds the shape and what the cells are, the second fills them in. */
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/text.h"
#include "catalog/formats.h"

/* A cell: `length` bytes at `text`, quotes stripped. */
typedef struct token {
    const char *text;
    size_t length;
} token;

/* What the first pass saw in the n-th value of the lines. */
typedef struct guess {
    bool real, text; /* some cell is not an integer, not a number */
    size_t width;    /* longest cell */
    long row, line;  /* of the first that is not a number */
} guess;

/* One line of SExtractor's head. */
typedef struct head_line {
    long number; /* of the column's first value, from 1 */
    char name[72], unit[48];
} head_line;

typedef struct ascii {
    const char *path;
    char *data;
    size_t length;  /* lines end in 0 bytes */
    token *tokens;  /* [RX_READ_COLUMNS] of the current line */
    guess *guesses; /* [RX_READ_COLUMNS] */
    head_line *head;
    int nhead;
    const char *names; /* the line that may name the values, or NULL */
    bool named;        /* it is no comment, and no comment counts any more */
    int nvalues;       /* in each line of data; 0 before the first */
    bool commas;       /* they separate the values, as in the first line */
    long nrows;
} ascii;

static const char BLANKS[] = " \t\r\v\f";

static const char *skip_blanks(const char *text)
{
    return text + strspn(text, BLANKS);
}

/* One cell from *text on, which is left behind it. */
static token take_token(const char **text, bool commas)
{
    const bool quoted = **text == '"';
    token t = {*text + quoted, strcspn(*text + quoted, quoted ? "\"" : commas ? "," : BLANKS)};
    *text = t.text + t.length;
    if (quoted) {
        *text += **text == '"';
        *text += commas ? strcspn(*text, ",") : 0;
        return t;
    }
    while (t.length > 0 && strchr(BLANKS, t.text[t.length - 1]) != NULL)
        t.length--;
    return t;
}

/* A comma outside of quotes. */
static bool has_comma(const char *line)
{
    bool quoted = false;
    for (; *line != '\0'; line++) {
        if (*line == '"')
            quoted = !quoted;
        else if (*line == ',' && !quoted)
            return true;
    }
    return false;
}

/* Cells of a line, RX_READ_COLUMNS + 1 when there are more than that. Between commas they may be
 * empty. */
static int split(ascii *in, const char *line, bool commas)
{
    int n = 0;
    line = skip_blanks(line);
    while (*line != '\0' || (commas && n > 0)) {
        if (n == RX_READ_COLUMNS)
            return n + 1;
        in->tokens[n++] = take_token(&line, commas);
        line = skip_blanks(line);
        if (commas && *line == '\0')
            break;
        if (commas)
            line = skip_blanks(line + 1);
    }
    return n;
}

static bool is_null(token t)
{
    static const char *const words[] = {"nan", "null", "--"};
    if (t.length == 0)
        return true;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strlen(words[i]) == t.length && strncasecmp(words[i], t.text, t.length) == 0)
            return true;
    return false;
}

/* The whole cell as a number; the byte after it is a blank, a comma, a quote or 0. */
static bool as_real(token t, double *value)
{
    char *end;
    if (is_null(t)) {
        *value = NAN;
        return true;
    }
    *value = strtod(t.text, &end);
    return end == t.text + t.length;
}

static bool as_integer(token t, long long *value)
{
    char *end;
    if (is_null(t))
        return false;
    errno = 0;
    *value = strtoll(t.text, &end, 10);
    return end == t.text + t.length && errno == 0;
}

/* `#   5 NAME   description   [unit]`, numbers rising from 1. */
static bool parse_head_line(const char *line, long before, head_line *out)
{
    char *end;
    const char *text = skip_blanks(line + 1);
    out->number = strtol(text, &end, 10);
    if (end == text || *end == '\0' || strchr(BLANKS, *end) == NULL || out->number <= before ||
        out->number > RX_READ_COLUMNS || (before == 0 && out->number != 1))
        return false;
    text = skip_blanks(end);
    size_t n = strcspn(text, " \t\r");
    if (n == 0)
        return false;
    snprintf(out->name, sizeof out->name, "%.*s", (int)(n < 71 ? n : 71), text);
    const char *open = strrchr(text, '['), *close = strrchr(text, ']');
    out->unit[0] = '\0';
    if (open != NULL && close != NULL && close > open && *skip_blanks(close + 1) == '\0')
        snprintf(out->unit, sizeof out->unit, "%.*s", (int)(close - open - 1), open + 1);
    return true;
}

static void take_comment(ascii *in, const char *line)
{
    head_line found;
    if (in->nrows > 0 || in->named)
        return;
    if (in->nhead < RX_READ_COLUMNS &&
        parse_head_line(line, in->nhead > 0 ? in->head[in->nhead - 1].number : 0, &found))
        in->head[in->nhead++] = found;
    else if (*skip_blanks(line + 1) != '\0')
        in->names = line + 1;
}

static void look_at(ascii *in, long line)
{
    double real;
    long long integer;
    for (int i = 0; i < in->nvalues; i++) {
        token t = in->tokens[i];
        guess *g = &in->guesses[i];
        if (t.length > g->width)
            g->width = t.length;
        if (!g->real && !as_integer(t, &integer))
            g->real = true;
        if (g->real && !g->text && !as_real(t, &real)) {
            g->text = true;
            g->row = in->nrows;
            g->line = line;
        }
    }
}

static const char *next_line(const ascii *in, const char *line)
{
    line += strlen(line) + 1;
    return line < in->data + in->length ? line : NULL;
}

static rx_status first_pass(ascii *in, rx_error *err)
{
    long number = 0;
    for (const char *line = in->data; line != NULL; line = next_line(in, line)) {
        number++;
        const char *text = skip_blanks(line);
        if (*text == '\0')
            continue;
        if (*text == '#') {
            take_comment(in, text);
            continue;
        }
        if (in->nvalues == 0)
            in->commas = has_comma(text);
        int n = split(in, text, in->commas);
        if (n > RX_READ_COLUMNS)
            return rx_error_at(err, RX_INPUT, in->path, -1, number, "holds more than %d values in a line",
                               RX_READ_COLUMNS);
        bool names = in->nvalues == 0 && !in->named && in->nhead == 0;
        double value;
        for (int i = 0; i < n && names; i++)
            names = !as_real(in->tokens[i], &value);
        if (names) { /* a first line without any number */
            in->names = text;
            in->named = true;
            continue;
        }
        if (in->nvalues == 0)
            in->nvalues = n;
        if (n != in->nvalues)
            return rx_error_at(err, RX_INPUT, in->path, -1, number,
                               "holds %d values where the lines before hold %d", n, in->nvalues);
        look_at(in, number);
        in->nrows++;
    }
    return RX_OK;
}

/* Columns by SExtractor's head, where a vector reaches to the next number, or of one value each, named by the line of names when
 * it has as many. */
static rx_status make_columns(ascii *in, rx_table **dst, rx_error *err)
{
    const int named = in->nhead == 0 && in->names != NULL ? split(in, in->names, has_comma(in->names)) : 0;
    const int n = in->nhead > 0 ? in->nhead : in->nrows > 0 ? in->nvalues : named;
    const long last = in->nhead > 0 ? in->head[in->nhead - 1].number : 0;
    if (n == 0 || n > RX_READ_COLUMNS)
        return rx_error_at(
            err, RX_INPUT, in->path, -1, 0,
            "holds no table; FITS, FITS_LDAC, ASCII_HEAD, VOTable and columns of text are read");
    if (in->nrows > 0 && in->nvalues < last)
        return rx_error_at(err, RX_INPUT, in->path, -1, 0,
                           "holds %d values in a line, its head numbers %ld; the head is not of this table",
                           in->nvalues, last);
    rx_table *table = rx_table_new(n);
    if (table == NULL)
        return rx_error_memory(err, (size_t)n * sizeof(rx_column));
    for (int i = 0; i < n; i++) {
        rx_column *column = &table->columns[i];
        const token t = in->tokens[i];
        const head_line *head = &in->head[i];
        if (in->nhead > 0) {
            const long end = i + 1 < n ? head[1].number : (in->nrows > 0 ? in->nvalues : last) + 1;
            memcpy(column->name, head->name, sizeof column->name);
            memcpy(column->unit, head->unit, sizeof column->unit);
            column->dim[0] = (int)(end - head->number);
            column->ndim = column->dim[0] > 1;
        } else if (named == n && t.length > 0)
            snprintf(column->name, sizeof column->name, "%.*s", (int)(t.length < 71 ? t.length : 71), t.text);
        else
            snprintf(column->name, sizeof column->name, "col%d", i + 1);
    }
    *dst = table;
    return RX_OK;
}

/* Types and memory; a vector takes the widest of its values' types. */
static rx_status allocate(ascii *in, rx_table *table, rx_error *err)
{
    size_t total = 0;
    int value = 0;
    table->nrows = in->nrows;
    for (int i = 0; i < table->ncolumns; i++) {
        rx_column *column = &table->columns[i];
        guess all = {0};
        long elements = rx_column_elements(column);
        for (long e = 0; e < elements; e++, value++) {
            all.real |= in->guesses[value].real || in->nrows == 0;
            if (in->guesses[value].text && (!all.text || in->guesses[value].row < column->word.row)) {
                column->word.row = in->guesses[value].row;
                column->word.element = e;
                column->word.line = in->guesses[value].line;
            }
            all.text |= in->guesses[value].text;
            all.width = all.width > in->guesses[value].width ? all.width : in->guesses[value].width;
        }
        column->type = all.text ? RX_CELL_TEXT : all.real ? RX_CELL_DOUBLE : RX_CELL_INT64;
        if (all.text && all.width > RX_READ_TEXT)
            return rx_error_at(err, RX_INPUT, in->path, -1, 0,
                               "holds a cell of %zu characters in column %s; at most %d are read", all.width,
                               column->name, RX_READ_TEXT);
        column->text_width = all.text ? (int)all.width + 1 : 0;
        size_t bytes = (size_t)elements * (size_t)rx_column_element_size(column);
        total += bytes * (size_t)in->nrows;
        if (total > RX_READ_BYTES)
            return rx_error_at(err, RX_INPUT, in->path, -1, 0, "is too large a table; give it as FITS");
        column->data = rx_alloc((size_t)in->nrows, bytes);
        if (column->data == NULL)
            return rx_error_memory(err, bytes * (size_t)in->nrows);
    }
    return RX_OK;
}

static void store(rx_column *column, long i, token t)
{
    double real;
    long long integer;
    if (column->type == RX_CELL_TEXT)
        memcpy((char *)column->data + i * column->text_width, t.text, t.length);
    else if (column->type == RX_CELL_INT64)
        ((int64_t *)column->data)[i] = as_integer(t, &integer) ? integer : 0;
    else
        ((double *)column->data)[i] = as_real(t, &real) ? real : NAN;
}

static void second_pass(ascii *in, rx_table *table)
{
    long row = 0;
    for (const char *line = in->data; line != NULL && row < in->nrows; line = next_line(in, line)) {
        const char *text = skip_blanks(line);
        if (*text == '\0' || *text == '#' || text == in->names)
            continue;
        split(in, text, in->commas);
        int value = 0;
        for (int i = 0; i < table->ncolumns; i++) {
            long elements = rx_column_elements(&table->columns[i]);
            for (long e = 0; e < elements; e++)
                store(&table->columns[i], row * elements + e, in->tokens[value++]);
        }
        row++;
    }
}

rx_status rx_ascii_read(const char *path, rx_table **dst, rx_error *err)
{
    ascii in = {.path = path};
    rx_table *table = NULL;
    rx_status status = RX_OK;
    RX_TRY(rx_text_read_file(path, RX_READ_BYTES / 2, &in.data, &in.length, err));
    RX_TRY_EXIT(RX_MAKE(in.tokens, RX_READ_COLUMNS, err));
    RX_TRY_EXIT(RX_MAKE(in.guesses, RX_READ_COLUMNS, err));
    RX_TRY_EXIT(RX_MAKE(in.head, RX_READ_COLUMNS, err));
    for (size_t i = 0; i < in.length; i++)
        if (in.data[i] == '\n')
            in.data[i] = '\0';
    RX_TRY_EXIT(first_pass(&in, err));
    RX_TRY_EXIT(make_columns(&in, &table, err));
    RX_TRY_EXIT(allocate(&in, table, err));
    second_pass(&in, table);
    *dst = table;
    table = NULL;
exit:
    rx_table_free(table);
    free(in.head);
    free(in.guesses);
    free(in.tokens);
    free(in.data);
    return status;
}
