/* Sums and comparisons of a survey. */
#include "survey/rollup.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const double LEVEL = 0.95;
static const double LEAST_ERROR = 0.001; /* mag: a bias below this never makes a tile bad */

/* Magnitude where bin k begins. */
static double edge(int k)
{
    return 0.5 * (k + RX_TALLY_LOW);
}

static rx_rollup_cell judge(const rx_tally_bin *bin)
{
    rx_rollup_cell cell = {.recall = rx_binomial_interval(bin->found, bin->references, LEVEL),
                           .precision = rx_binomial_interval(bin->right, bin->detections, LEVEL)};
    rx_tally_errors(bin, &cell.pairs, &cell.bias, &cell.scatter);
    return cell;
}

/* The bins that lie in MAG_RANGE, summed. */
static rx_status judge_range(const rx_rollup *r, const rx_tally *tally, rx_rollup_cell *dst, rx_error *err)
{
    rx_tally_bin sum = {0};
    rx_status status = RX_OK;
    for (int b = 0; b < RX_TALLY_BINS && status == RX_OK; b++)
        if (r->mag_low == r->mag_high || (edge(b) >= r->mag_low && edge(b + 1) <= r->mag_high))
            status = rx_tally_add_bin(&sum, &tally->bin[b], err);
    *dst = judge(&sum);
    free(sum.dmag);
    return status;
}

static int same_name(const rx_tile_record *record, const rx_listed_tile *tile)
{
    return strcmp(record->name, tile->name) == 0 && strcmp(record->image, tile->words.v[0]) == 0;
}

static rx_status find_missing(rx_rollup *r, rx_error *err)
{
    const int n = r->tiles != NULL ? r->tiles->n : 0;
    r->missing = RX_NEW(int, (size_t)n);
    if (r->missing == NULL)
        return rx_error_memory(err, (size_t)n * sizeof(int));
    for (int i = 0; i < n; i++) {
        int low = 0, high = r->records->n;
        while (low < high) { /* by name, then by image: the order of the records */
            const int middle = (low + high) / 2;
            const rx_tile_record *record = &r->records->record[middle];
            int order = strcmp(record->name, r->tiles->tile[i].name);
            if (order == 0)
                order = strcmp(record->image, rx_tiles_image(r->tiles, i));
            if (order < 0)
                low = middle + 1;
            else
                high = middle;
        }
        if (low == r->records->n || !same_name(&r->records->record[low], &r->tiles->tile[i]))
            r->missing[r->nmissing++] = i;
    }
    return RX_OK;
}

static rx_status run_of(rx_rollup *r, const char *name, rx_rollup_run **dst, rx_error *err)
{
    for (int i = 0; i < r->nruns; i++)
        if (strcmp(r->run[i].name, name) == 0) {
            *dst = &r->run[i];
            return RX_OK;
        }
    rx_rollup_run *grown = rx_regrow(r->run, (size_t)r->nruns + 1, sizeof *grown);
    if (grown == NULL)
        return rx_error_memory(err, ((size_t)r->nruns + 1) * sizeof *grown);
    r->run = grown;
    *dst = &grown[r->nruns++];
    memset(*dst, 0, sizeof **dst);
    snprintf((*dst)->name, sizeof(*dst)->name, "%s", name);
    return RX_OK;
}

static rx_status add_extension(rx_rollup *r, const rx_tile_record *record, const rx_extension_facts *e,
                               rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < e->nruns && status == RX_OK; i++) {
        const rx_run_facts *facts = &e->run[i];
        rx_rollup_run *run = NULL;
        rx_rollup_row *grown = NULL;
        status = run_of(r, facts->name, &run, err);
        if (status != RX_OK)
            break;
        run->tiles++;
        run->sources += facts->sources;
        if (facts->tally != NULL)
            status = rx_tally_add(&run->tally, facts->tally, err);
        if (status == RX_OK && (grown = rx_regrow(r->row, (size_t)r->nrows + 1, sizeof *grown)) == NULL)
            status = rx_error_memory(err, ((size_t)r->nrows + 1) * sizeof *grown);
        if (status != RX_OK)
            break;
        r->row = grown;
        rx_rollup_row *row = &grown[r->nrows++];
        *row = (rx_rollup_row){.record = record, .extension = e, .run = facts, .off = NAN, .what = ""};
        if (facts->tally != NULL)
            status = judge_range(r, facts->tally, &row->cell, err);
    }
    return status;
}

static rx_status sum_up(rx_rollup *r, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < r->records->n && status == RX_OK; i++) {
        const rx_tile_record *record = &r->records->record[i];
        r->fine += record->status == RX_OK;
        r->gates += record->status == RX_GATE_FAIL;
        r->undecided += record->status == RX_GATE_INSUFFICIENT;
        for (int k = 0; k < record->facts.n && status == RX_OK; k++)
            status = add_extension(r, record, &record->facts.extension[k], err);
    }
    r->failed = r->records->n - r->fine - r->gates - r->undecided;
    for (int i = 0; i < r->nruns && status == RX_OK; i++) {
        rx_rollup_run *run = &r->run[i];
        status = judge_range(r, &run->tally, &run->whole, err);
        run->first = RX_TALLY_BINS;
        run->last = -1;
        for (int b = 0; b < RX_TALLY_BINS; b++) {
            const rx_tally_bin *bin = &run->tally.bin[b];
            run->bin[b] = judge(bin);
            if (bin->references == 0 && bin->detections == 0)
                continue;
            run->first = b < run->first ? b : run->first;
            run->last = b;
        }
    }
    return status;
}

/* How many of its own errors k of n lies below the share p of all. */
static double below(const rx_estimate *own, const rx_estimate *all)
{
    const double p = fmin(fmax(all->value, 0.5 / (double)(own->n + 1)), 1 - 0.5 / (double)(own->n + 1));
    return own->n > 0 && all->n > 0 ? (p - own->value) / sqrt(p * (1 - p) / (double)own->n) : 0;
}

/* The same of a median, whose error is 1.25 sigma / sqrt(n) for normal errors. */
static double beside(const rx_rollup_cell *own, const rx_rollup_cell *all)
{
    const double error = 1.2533 * fmax(own->scatter, all->scatter) / sqrt((double)own->pairs);
    return own->pairs > 2 && isfinite(own->bias) && isfinite(all->bias) && isfinite(error)
               ? fabs(own->bias - all->bias) / fmax(error, LEAST_ERROR)
               : 0;
}

static void compare(rx_rollup *r, rx_rollup_row *row)
{
    const rx_rollup_run *all = NULL;
    for (int i = 0; i < r->nruns; i++)
        if (strcmp(r->run[i].name, row->run->name) == 0)
            all = &r->run[i];
    if (row->run->tally == NULL || all == NULL)
        return;
    const struct {
        const char *what;
        double off;
    } each[] = {{"recall", below(&row->cell.recall, &all->whole.recall)},
                {"precision", below(&row->cell.precision, &all->whole.precision)},
                {"bias", beside(&row->cell, &all->whole)}};
    row->off = 0;
    for (int i = 0; i < 3; i++)
        if (each[i].off > row->off) {
            row->off = each[i].off;
            row->what = each[i].what;
        }
}

static int is_bad(const rx_rollup_row *row)
{
    return row->extension->verdict == RX_VERDICT_FAIL ? 2
                                                      : row->extension->verdict == RX_VERDICT_INSUFFICIENT;
}

/* Worst first: gates that fail, then by distance; equal ones stay in the order of the records. */
static int by_badness(const void *a, const void *b)
{
    const rx_rollup_row *x = a, *y = b;
    const double p = isfinite(x->off) ? x->off : -1, q = isfinite(y->off) ? y->off : -1;
    if (is_bad(x) != is_bad(y))
        return is_bad(y) - is_bad(x);
    if (p != q)
        return p < q ? 1 : -1;
    if (x->record != y->record)
        return x->record < y->record ? -1 : 1;
    if (x->extension != y->extension)
        return x->extension < y->extension ? -1 : 1;
    return (x->run > y->run) - (x->run < y->run);
}

rx_status rx_rollup_make(const rx_survey_config *config, const rx_tile_records *records,
                         const rx_tiles *tiles, rx_rollup *dst, rx_error *err)
{
    *dst = (rx_rollup){.records = records,
                       .tiles = tiles,
                       .mag_low = config->mag_range.v[0],
                       .mag_high = config->mag_range.v[1]};
    rx_status status = find_missing(dst, err);
    if (status == RX_OK)
        status = sum_up(dst, err);
    for (int i = 0; i < dst->nrows && status == RX_OK; i++)
        compare(dst, &dst->row[i]);
    if (dst->nrows > 1)
        qsort(dst->row, (size_t)dst->nrows, sizeof *dst->row, by_badness);
    return status;
}

void rx_rollup_free(rx_rollup *rollup)
{
    for (int i = 0; i < rollup->nruns; i++)
        rx_tally_free(&rollup->run[i].tally);
    free(rollup->run);
    free(rollup->row);
    free(rollup->missing);
    *rollup = (rx_rollup){0};
}
