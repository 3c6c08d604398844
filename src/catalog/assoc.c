/* Cross-identification with a list of positions. */
#include "catalog/assoc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "catalog/catalog.h"
#include "io/wcs.h"

/* A list entry in pixels from 0, sorted by y. */
typedef struct entry {
    double x, y, weight;
    long row;
} entry;

typedef struct matcher {
    const rx_assoc_params *par;
    rx_assoc_type type;
    const rx_assoc *list;
    entry *entries;
    long n;
    int ndata;
    int data[RX_ASSOC_COLUMNS]; /* columns to copy, from 0 */
} matcher;

rx_status rx_assoc_read(const char *path, rx_assoc **dst, rx_error *err)
{
    rx_assoc *list;
    rx_status status;
    RX_TRY(RX_MAKE(list, 1, err));
    RX_TRY_EXIT(rx_catalog_read(path, 0, &list->table, err));
    if ((list->path = rx_strdup(path)) == NULL)
        RX_TRY_EXIT(rx_error_memory(err, strlen(path)));
    for (int i = 0; i < list->table->ncolumns; i++)
        for (long e = 0; e < rx_column_elements(&list->table->columns[i]); e++) {
            if (list->columns == RX_ASSOC_COLUMNS)
                RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0,
                                        "has more than %d columns, too many for an ASSOC list",
                                        RX_ASSOC_COLUMNS));
            list->of[list->columns] = i;
            list->element[list->columns++] = e;
        }
    *dst = list;
    list = NULL;
exit:
    rx_assoc_free(list);
    return status;
}

void rx_assoc_free(rx_assoc *list)
{
    if (list == NULL)
        return;
    free(list->path);
    rx_table_free(list->table);
    free(list);
}

static double value_of(const rx_assoc *list, long row, int column)
{
    return rx_column_value(&list->table->columns[list->of[column]], row, list->element[column]);
}

rx_status rx_assoc_check(const rx_assoc_params *par, const rx_assoc *list, rx_error *err)
{
    const int wanted[3] = {par->x, par->y, par->weight};
    if (list->table->nrows == 0) /* an empty list has no columns to check against */
        return RX_OK;
    for (int i = 0; i < (par->weight != 0 ? 3 : 2); i++) {
        if (wanted[i] < 1 || wanted[i] > list->columns)
            return rx_error_at(err, RX_USAGE, list->path, -1, 0,
                               "has %d columns, ASSOC_PARAMS asks for number %d", list->columns, wanted[i]);
        RX_TRY(rx_catalog_need_numbers(list->path, list->table, list->of[wanted[i] - 1], err));
    }
    return RX_OK;
}

/* Columns to copy: those of ASSOC_DATA that the list has, or all when it names none of them. */
static void choose_data(matcher *m, rx_log *log)
{
    const rx_assoc_params *par = m->par;
    for (int i = 0; i < par->ndata; i++) {
        if (par->data[i] > m->list->columns && m->list->table->nrows > 0)
            rx_log_warning(log, "%s has %d columns; number %d of ASSOC_DATA is left out", m->list->path,
                           m->list->columns, par->data[i]);
        else if (par->data[i] > 0)
            m->data[m->ndata++] = par->data[i] - 1;
    }
    for (int i = 0; m->ndata == 0 && i < m->list->columns; i++)
        m->data[i] = i;
    m->ndata = m->ndata > 0 ? m->ndata : m->list->columns;
    for (int i = 0; i < m->ndata; i++) {
        const rx_column *column =
            m->list->table->nrows > 0 ? &m->list->table->columns[m->list->of[m->data[i]]] : NULL;
        if (column != NULL && column->type == RX_CELL_TEXT)
            rx_log_warning(log, "%s: column %d holds words; VECTOR_ASSOC has NaN for it", m->list->path,
                           m->data[i] + 1);
    }
}

static int by_y(const void *a, const void *b)
{
    const entry *p = a, *q = b;
    if (p->y != q->y)
        return p->y < q->y ? -1 : 1;
    return p->row < q->row ? -1 : p->row > q->row;
}

/* Positions in pixels from 0; entries without one are dropped. */
static rx_status make_entries(matcher *m, struct rx_wcs *wcs, rx_log *log, rx_error *err)
{
    const rx_assoc *list = m->list;
    long without = 0;
    RX_TRY(RX_MAKE(m->entries, (size_t)list->table->nrows, err));
    for (long row = 0; row < list->table->nrows; row++) {
        const double x = value_of(list, row, m->par->x - 1), y = value_of(list, row, m->par->y - 1);
        entry e = {x - 1, y - 1, 0, row};
        if (m->par->world)
            rx_wcs_to_pixel(wcs, 1, &x, &y, &e.x, &e.y);
        if (m->par->weight > 0)
            e.weight = value_of(list, row, m->par->weight - 1);
        without += !isfinite(x) || !isfinite(y);
        if (isfinite(e.x) && isfinite(e.y)) /* the sky's other side has no pixels */
            m->entries[m->n++] = e;
    }
    if (without > 0)
        rx_log_warning(log, "%s: %ld of %ld entries have no position and are left out", list->path, without,
                       list->table->nrows);
    qsort(m->entries, (size_t)m->n, sizeof(entry), by_y);
    return RX_OK;
}

static rx_status prepare(matcher *m, struct rx_wcs *wcs, rx_log *log, rx_error *err)
{
    const rx_assoc_params *par = m->par;
    if (par->world && wcs == NULL)
        return rx_error_set(
            err, RX_INPUT,
            "ASSOCCOORD_TYPE WORLD needs celestial coordinates in the image's header; use PIXEL");
    m->type = par->type;
    if (par->weight == 0 && (par->type == RX_ASSOC_MEAN || par->type == RX_ASSOC_MAG_MEAN ||
                             par->type == RX_ASSOC_MIN || par->type == RX_ASSOC_MAX)) {
        rx_log_warning(log, "ASSOC_PARAMS has no third column, so ASSOC_TYPE FIRST is used");
        m->type = RX_ASSOC_FIRST;
    }
    choose_data(m, log);
    if (m->list->table->nrows == 0)
        return RX_OK;
    RX_TRY(rx_assoc_check(par, m->list, err));
    return make_entries(m, wcs, log, err);
}

static double flux_of(double mag)
{
    return fabs(mag) < 99 ? pow(10, -0.4 * mag) : 0;
}

static void copy(const matcher *m, long row, double *dst)
{
    for (int i = 0; i < m->ndata; i++)
        dst[i] = value_of(m->list, row, m->data[i]);
}

/* First entry whose y is above the limit. */
static long first_above(const matcher *m, double y)
{
    long low = 0, high = m->n;
    while (low < high) {
        long middle = low + (high - low) / 2;
        if (m->entries[middle].y > y)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* Number of entries of the position, their combined values in dst. */
static int match_one(const matcher *m, double x, double y, double *dst)
{
    double radius = m->par->radius, sum = 0, best = INFINITY;
    int count = 0;
    for (long i = first_above(m, y - radius); i < m->n && m->entries[i].y < y + radius; i++) {
        const entry *e = &m->entries[i];
        double dx = e->x - x, dy = e->y - y, distance = dx * dx + dy * dy;
        if (!(distance < radius * radius))
            continue;
        count++;
        if (m->type == RX_ASSOC_FIRST) {
            copy(m, e->row, dst);
            return 1;
        }
        double rank = m->type == RX_ASSOC_NEAREST ? distance
                      : m->type == RX_ASSOC_MAX   ? -e->weight
                                                  : e->weight;
        double weight = m->type == RX_ASSOC_MAG_MEAN ? flux_of(e->weight)
                        : m->type == RX_ASSOC_MEAN   ? e->weight
                                                     : 1;
        if (m->type == RX_ASSOC_NEAREST || m->type == RX_ASSOC_MIN || m->type == RX_ASSOC_MAX) {
            if (rank < best)
                copy(m, e->row, dst);
            best = rank < best ? rank : best;
        } else {
            for (int k = 0; k < m->ndata; k++) {
                const double value = value_of(m->list, e->row, m->data[k]);
                dst[k] += m->type == RX_ASSOC_MAG_SUM ? flux_of(value) : weight * value;
            }
            sum += weight;
        }
    }
    bool mean = m->type == RX_ASSOC_MEAN || m->type == RX_ASSOC_MAG_MEAN;
    if (mean && !(sum >= 1e-30)) {
        memset(dst, 0, (size_t)m->ndata * sizeof *dst);
        return 0;
    }
    for (int i = 0; i < m->ndata && count > 0; i++) {
        if (mean)
            dst[i] /= sum;
        else if (m->type == RX_ASSOC_MAG_SUM)
            dst[i] = dst[i] > 0 ? -2.5 * log10(dst[i]) : 99;
    }
    return count;
}

rx_status rx_assoc_match(const rx_assoc_params *par, const rx_assoc *list, struct rx_wcs *wcs, rx_log *log,
                         rx_sources *sources, rx_error *err)
{
    matcher m = {.par = par, .list = list};
    double *values = NULL;
    unsigned char *keep = NULL;
    rx_status status;
    RX_TRY_EXIT(prepare(&m, wcs, log, err));
    RX_TRY_EXIT(RX_MAKE(values, (size_t)sources->n * (size_t)m.ndata, err));
    for (int i = 0; i < sources->n; i++) {
        rx_source *s = &sources->list[i];
        s->number_assoc = match_one(&m, s->x, s->y, values + (size_t)i * (size_t)m.ndata);
    }
    free(sources->assoc);
    sources->assoc = values;
    sources->nassoc = m.ndata;
    values = NULL;
    for (int i = 0; i < sources->n; i++)
        sources->list[i].vector_assoc = sources->assoc + (size_t)i * (size_t)m.ndata;
    if (par->select == RX_ASSOC_ALL)
        goto exit;
    RX_TRY_EXIT(RX_MAKE(keep, (size_t)sources->n, err));
    for (int i = 0; i < sources->n; i++)
        keep[i] = (sources->list[i].number_assoc > 0) == (par->select == RX_ASSOC_MATCHED);
    status = rx_sources_select(sources, keep, err);
exit:
    free(keep);
    free(values);
    free(m.entries);
    return status;
}
