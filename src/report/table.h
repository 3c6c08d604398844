/* The tables of a report: columns, cells, rows, and what a page shows of them. */
#ifndef RX_REPORT_TABLE_H
#define RX_REPORT_TABLE_H

#include <math.h>
#include <stdbool.h>

#include "data/table.h"
#include "report/figure.h"

/* Classes of colour: green, red, amber, grey. */
#define RX_MARK_GOOD "PASS"
#define RX_MARK_BAD "FAIL"
#define RX_MARK_OPEN "INSUFFICIENT"
#define RX_MARK_PALE "pale"

typedef enum rx_report_kind {
    RX_REPORT_WORDS,
    RX_REPORT_COUNT,
    RX_REPORT_NUMBER,
    RX_REPORT_ESTIMATE, /* files: <name>, <name>_low, <name>_high, <name>_n; JSON: an object of the four */
    RX_REPORT_MEASURED, /* value and 1 sigma; files: <name> and <name>_error */
    RX_REPORT_VERDICT,  /* words in colour: RX_MARK_... or the word before a space or comma */
    RX_REPORT_FILE      /* words: a file beside the page, which has a link to it */
} rx_report_kind;

typedef struct rx_report_column {
    const char *name; /* a plain word: key of JSON, column of ECSV */
    rx_report_kind kind;
    int digits; /* on the page: after the point, below 0 significant ones; files have nine significant ones */
    const char *unit, *help; /* "" or NULL where there is nothing to say */
    const char *heading;     /* of the page; NULL: the name */
} rx_report_column;

#define RX_LENGTH(array) ((int)(sizeof(array) / sizeof *(array)))

/* RX_COLUMNS(BINS, RX_TEXT("scene", "binned quantity"), RX_NUMBER("low", 2, "pix", ""), ...): the columns of a table. A
 * heading may follow the help. */
#define RX_COLUMNS(table, ...) static const rx_report_column table[] = {__VA_ARGS__}
/* clang-format off */
#define RX_COLUMN(kind, name, digits, unit, help, heading, ...) {name, kind, digits, unit, help, heading}
#define RX_TEXT(name, ...) RX_COLUMN(RX_REPORT_WORDS, name, 0, "", __VA_ARGS__, NULL, NULL)
#define RX_MARKED(name, ...) RX_COLUMN(RX_REPORT_VERDICT, name, 0, "", __VA_ARGS__, NULL, NULL)
#define RX_LINK(name, ...) RX_COLUMN(RX_REPORT_FILE, name, 0, "", __VA_ARGS__, NULL, NULL)
#define RX_COUNT(name, ...) RX_COLUMN(RX_REPORT_COUNT, name, 0, "", __VA_ARGS__, NULL, NULL)
#define RX_NUMBER(name, digits, unit, ...) RX_COLUMN(RX_REPORT_NUMBER, name, digits, unit, __VA_ARGS__, NULL, NULL)
#define RX_ESTIMATE(name, digits, unit, ...) RX_COLUMN(RX_REPORT_ESTIMATE, name, digits, unit, __VA_ARGS__, NULL, NULL)
#define RX_MEASURED(name, digits, unit, ...) RX_COLUMN(RX_REPORT_MEASURED, name, digits, unit, __VA_ARGS__, NULL, NULL)
/* clang-format on */

/* One cell: words, or numbers: value and low are that of RX_REPORT_MEASURED and its error. */
typedef struct rx_cell {
    const char *words;
    rx_estimate estimate;
} rx_cell;

static inline rx_cell rx_cell_words(const char *words)
{
    return (rx_cell){.words = words};
}

static inline rx_cell rx_cell_number(double number)
{
    return (rx_cell){.estimate.value = number};
}

static inline rx_cell rx_cell_count(long n)
{
    return rx_cell_number((double)n);
}

static inline rx_cell rx_cell_estimate(rx_estimate estimate)
{
    return (rx_cell){.estimate = estimate};
}

static inline rx_cell rx_cell_measured(double value, double error)
{
    return (rx_cell){.estimate = {.value = value, .low = error}};
}

static inline rx_cell rx_cell_itself(rx_cell cell)
{
    return cell;
}

typedef struct rx_report_table rx_report_table;

enum { RX_REPORT_IN_JSON = 1, RX_REPORT_IN_FILE = 2, RX_REPORT_EVERYWHERE = 3 };

void rx_report_row(rx_report_table *table, const rx_cell *values); /* [ncolumns] */
/* rx_report_put(table, words, number, count, estimate, rx_cell_measured(value, error) ...): a row of what each column takes, 24 at
 * the most. */
#define RX_CELL(v)                                                                                           \
    _Generic((v),                                                                                            \
        char *: rx_cell_words,                                                                               \
        const char *: rx_cell_words,                                                                         \
        long: rx_cell_count,                                                                                 \
        rx_estimate: rx_cell_estimate,                                                                       \
        rx_cell: rx_cell_itself,                                                                             \
        default: rx_cell_number)(v)
enum { RX_ROW_CELLS = 24 };
#define RX_CELLS(a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p, q, r, s, t, u, v, w, x, ...)                \
    {                                                                                                        \
        RX_CELL(a), RX_CELL(b), RX_CELL(c), RX_CELL(d), RX_CELL(e), RX_CELL(f), RX_CELL(g), RX_CELL(h),      \
            RX_CELL(i), RX_CELL(j), RX_CELL(k), RX_CELL(l), RX_CELL(m), RX_CELL(n), RX_CELL(o), RX_CELL(p),  \
            RX_CELL(q), RX_CELL(r), RX_CELL(s), RX_CELL(t), RX_CELL(u), RX_CELL(v), RX_CELL(w), RX_CELL(x)   \
    }
#define RX_ROW(...)                                                                                          \
    ((rx_cell[])RX_CELLS(__VA_ARGS__, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0))
#define rx_report_put(table, ...) rx_report_row(table, RX_ROW(__VA_ARGS__))
long rx_report_rows(const rx_report_table *table);
/* Does the column say anything, of any row? */
bool rx_report_knows(const rx_report_table *table, const char *column);
/* An entry in the head of this table's file alone; one a table. */
void rx_report_table_fact(rx_report_table *table, const char *name, const char *text);

enum { RX_BRIEF_ALONE = 2 };
typedef struct rx_report_view {
    long from, to;     /* rows; to 0: all from `from` on */
    long most;         /* of rows as they are: the page says how many there are, and where; 0: all */
    int without_empty; /* columns that say nothing in any row are left out, of a pivot such rows */
    int turned;        /* rows as they are, side by side under the words of the first column: each other
                                 column is a line, with its help */
    const char *title, *unit; /* NULL: none */
    const char *note;         /* words; NULL: none */
    int ncolumns;             /* shown ones; 0: all */
    const char *const *columns;
    /* a pivot: words or numbers of `rows` (one column or two) against words of `across`, and in the middle
     * `value` with so many digits; value NULL: the rows as they are */
    const char *rows[2], *across[1], *value;
    int digits;
    int in_brief;  /* also for the terminal; RX_BRIEF_ALONE: there alone */
    int intervals; /* there: with those of estimates */
} rx_report_view;

#define RX_VIEW(...) (&(rx_report_view){__VA_ARGS__})

#endif
