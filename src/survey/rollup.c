/* Sums and comparisons of a survey. */
#include "survey/rollup.h"

#include <math.h>
#include <search.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

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

/* --- tiles --- */

static int by_tile(const void *a, const void *b)
{
    const rx_rollup_tile *x = a, *y = b;
    const int order = strcmp(x->name, y->name);
    return order != 0 ? order : strcmp(x->image, y->image);
}

static int by_place(const void *a, const void *b)
{
    return by_tile(*(rx_rollup_tile *const *)a, *(rx_rollup_tile *const *)b);
}

static void free_tile(rx_rollup_tile *tile)
{
    if (tile == NULL)
        return;
    free(tile->image);
    free(tile->name);
    free(tile->what);
    free(tile);
}

static rx_status new_tile(const rx_tile_record *record, rx_rollup_tile **dst, rx_error *err)
{
    rx_text text = {0};
    rx_hash sum;
    rx_rollup_tile *tile = RX_NEW(rx_rollup_tile, 1);
    *dst = NULL;
    rx_tile_record_print(&text, record);
    if (tile != NULL) {
        tile->image = rx_strdup(record->image);
        tile->name = rx_strdup(record->name);
        tile->what = rx_strdup(record->what);
        tile->status = record->status;
    }
    if (tile == NULL || tile->image == NULL || tile->name == NULL || tile->what == NULL || text.failed) {
        free_tile(tile);
        rx_text_free(&text);
        return rx_error_memory(err, sizeof *tile);
    }
    rx_hash_begin(&sum);
    rx_hash_add(&sum, text.data, text.length);
    rx_hash_text(&sum, tile->digest);
    rx_text_free(&text);
    *dst = tile;
    return RX_OK;
}

/* Into the tree and the list, which owns it; *known: what stands there already under its name, or itself. */
static rx_status keep_tile(rx_rollup *r, rx_rollup_tile *tile, const rx_rollup_tile **known, rx_error *err)
{
    if (r->ntiles == r->tiles_capacity) {
        const int capacity = 2 * r->tiles_capacity + 64;
        rx_rollup_tile **grown = rx_regrow(r->tile, (size_t)capacity, sizeof(rx_rollup_tile *));
        if (grown == NULL)
            return rx_error_memory(err, (size_t)capacity * sizeof(rx_rollup_tile *));
        r->tile = grown;
        r->tiles_capacity = capacity;
    }
    rx_rollup_tile **node = tsearch(tile, &r->known, by_tile);
    if (node == NULL)
        return rx_error_memory(err, 0);
    *known = *node;
    if (*known == tile)
        r->tile[r->ntiles++] = tile;
    return RX_OK;
}

static rx_status find_missing(rx_rollup *r, rx_error *err)
{
    const int n = r->tiles != NULL ? r->tiles->n : 0;
    RX_TRY(RX_MAKE(r->missing, (size_t)n, err));
    for (int i = 0; i < n; i++) {
        const rx_rollup_tile wanted = {.name = r->tiles->tile[i].name, .image = r->tiles->tile[i].words.v[0]};
        if (tfind(&wanted, &r->known, by_tile) == NULL)
            r->missing[r->nmissing++] = i;
    }
    return RX_OK;
}

/* --- sums --- */

static rx_status run_of(rx_rollup *r, const char *name, int *dst, rx_error *err)
{
    for (*dst = 0; *dst < r->nruns; ++*dst)
        if (strcmp(r->run[*dst].name, name) == 0)
            return RX_OK;
    RX_TRY(RX_GROW(r->run, (size_t)r->nruns + 1, err));
    rx_rollup_run *run = &r->run[r->nruns++];
    memset(run, 0, sizeof *run);
    snprintf(run->name, sizeof run->name, "%s", name);
    return RX_OK;
}

static rx_status new_row(rx_rollup *r, rx_rollup_tile *tile, rx_rollup_row **dst, rx_error *err)
{
    if (r->nrows == r->rows_capacity) {
        const int capacity = 2 * r->rows_capacity + 64;
        RX_TRY(RX_GROW(r->row, (size_t)capacity, err));
        r->rows_capacity = capacity;
    }
    *dst = &r->row[r->nrows++];
    **dst = (rx_rollup_row){.tile = tile, .place = tile->nrows++, .off = NAN, .what = ""};
    return RX_OK;
}

/* What is of the image, whatever restorer. */
static rx_status describe_image(rx_rollup *r, const rx_extension_facts *e, rx_rollup_row *row, rx_error *err)
{
    const int measured = e->psf.how[0] != '\0', judged = measured && e->psf.reserved > 0;
    row->state = e->known ? e->state
                          : (rx_tile_state){.ellipticity = NAN,
                                            .depth = NAN,
                                            .factor = NAN,
                                            .masked = NAN,
                                            .saturated = NAN,
                                            .rows = NAN,
                                            .columns = NAN,
                                            .light = NAN,
                                            .chi2 = NAN,
                                            .wrong = -1,
                                            .look = -1};
    row->psf_growth = measured ? e->psf.growth : NAN;
    row->psf_residual = measured ? e->psf.residual : NAN;
    row->psf_size = judged ? e->psf.off[0] : NAN;
    for (int i = 0; i < RX_RECORD_CARDS; i++)
        row->card[i] = NAN;
    for (int i = 0; i < e->ncards; i++) {
        int k = 0;
        while (k < r->ncards && strcasecmp(r->card[k], e->card[i].name) != 0)
            k++;
        if (k == r->ncards && k < RX_RECORD_CARDS)
            memcpy(r->card[r->ncards++], e->card[i].name, RX_CARD_NAME);
        if (k < RX_RECORD_CARDS)
            row->card[k] = e->card[i].value;
    }
    if (e->page[0] != '\0' && (row->page = rx_strdup(e->page)) == NULL)
        return rx_error_memory(err, 0);
    return RX_OK;
}

static rx_status add_run(rx_rollup *r, rx_rollup_tile *tile, const rx_extension_facts *e,
                         const rx_run_facts *facts, rx_error *err)
{
    rx_rollup_row *row = NULL;
    RX_TRY(new_row(r, tile, &row, err));
    row->leads = facts == e->run;
    RX_TRY(describe_image(r, e, row, err));
    row->hdu = e->hdu;
    row->alpha = e->alpha;
    row->delta = e->delta;
    row->fwhm = e->fwhm;
    row->sky = e->sky;
    row->noise = e->noise;
    row->verdict = e->verdict;
    row->sources = facts->sources;
    row->flux = facts->flux;
    row->guard = facts->guard;
    row->sharp = facts->sharp;
    row->lit = facts->lit;
    memcpy(row->by, facts->by, sizeof row->by);
    memcpy(row->taken, facts->taken, sizeof row->taken);
    if ((row->by[0] != '\0' || row->taken[0] != '\0') && (row->why = rx_strdup(facts->why)) == NULL)
        return rx_error_memory(err, 0);
    if (facts->outside[0] != '\0' && (row->outside = rx_strdup(facts->outside)) == NULL)
        return rx_error_memory(err, 0);
    row->compared = facts->tally != NULL;
    const rx_estimate unknown = {.value = NAN, .low = 0, .high = 1};
    row->cell = (rx_rollup_cell){.recall = unknown, .precision = unknown, .bias = NAN, .scatter = NAN};
    rx_status status = RX_OK;
    RX_TRY(run_of(r, facts->name, &row->run, err));
    rx_rollup_run *run = &r->run[row->run];
    run->tiles++;
    run->sources += facts->sources;
    run->by_others += row->by[0] != '\0';
    run->outside += row->outside != NULL;
    run->flux_off += rx_fluxcheck_is_off(&row->flux);
    run->unexplained += row->guard.known && rx_residual_is_large(row->guard.unexplained);
    run->raised += row->guard.known && row->guard.raised > 1.0;
    if (facts->tally != NULL)
        status = rx_tally_add(&run->tally, facts->tally, err);
    if (status == RX_OK && facts->tally != NULL)
        status = judge_range(r, facts->tally, &row->cell, err);
    return status;
}

static rx_status add_psf(rx_rollup *r, const rx_rollup_tile *tile, int place, const rx_extension_facts *e,
                         rx_error *err)
{
    if (e->psf.how[0] == '\0')
        return RX_OK;
    if (r->npsfs == r->psfs_capacity) {
        const int capacity = 2 * r->psfs_capacity + 64;
        RX_TRY(RX_GROW(r->psf, (size_t)capacity, err));
        r->psfs_capacity = capacity;
    }
    r->psf[r->npsfs++] = (rx_rollup_psf){.tile = tile, .place = place, .hdu = e->hdu, .psf = e->psf};
    r->lower += rx_psf_account_is_lower(&e->psf);
    return RX_OK;
}

static int by_image(const void *a, const void *b)
{
    const rx_rollup_psf *x = a, *y = b;
    return x->tile != y->tile ? x->tile->place - y->tile->place : x->place - y->place;
}

static rx_status correlate(rx_rollup *r, rx_error *err)
{
    const rx_rho **images = rx_alloc((size_t)r->npsfs + 1, sizeof *images);
    int n = 0;
    if (images == NULL)
        return rx_error_memory(err, 0);
    if (r->npsfs > 1)
        qsort(r->psf, (size_t)r->npsfs, sizeof *r->psf, by_image);
    for (int i = 0; i < r->npsfs; i++)
        if (r->psf[i].psf.rho.n > 0)
            images[n++] = &r->psf[i].psf.rho;
    const rx_status status = rx_rho_all(n, images, r->rho, err);
    free(images);
    return status;
}

rx_status rx_rollup_add(rx_rollup *r, const rx_tile_record *record, const char *path, int64_t at,
                        rx_error *err)
{
    rx_rollup_tile *tile = NULL;
    const rx_rollup_tile *known = NULL;
    RX_TRY(new_tile(record, &tile, err));
    rx_status status = keep_tile(r, tile, &known, err);
    if (status == RX_OK && known != tile && strcmp(known->digest, tile->digest) != 0)
        status = rx_error_at(err, RX_INPUT, record->image, -1, 0,
                             "has two records that differ; leave out the older one");
    if (known != tile) {
        free_tile(tile);
        return status;
    }
    tile->path = path;
    tile->at = at;
    tile->first = r->nrows;
    r->fine += record->status == RX_OK;
    r->gates += record->status == RX_GATE_FAIL;
    r->undecided += record->status == RX_GATE_INSUFFICIENT;
    for (int k = 0; k < record->facts.n && status == RX_OK; k++)
        status = add_psf(r, tile, k, &record->facts.extension[k], err);
    for (int k = 0; k < record->facts.n; k++)
        for (int i = 0; i < record->facts.extension[k].nruns && status == RX_OK; i++)
            status = add_run(r, tile, &record->facts.extension[k], &record->facts.extension[k].run[i], err);
    return status;
}

/* By the tile that each comes in first, and there by its row: whatever was added first. */
static rx_status sort_runs(rx_rollup *r, rx_error *err)
{
    rx_rollup_run *sorted = RX_NEW(rx_rollup_run, (size_t)r->nruns);
    int *place = RX_NEW(int, (size_t)r->nruns);
    int n = 0;
    for (int i = 0; sorted != NULL && place != NULL && i < r->ntiles && n < r->nruns; i++)
        for (int k = r->tile[i]->first; k < r->tile[i]->first + r->tile[i]->nrows; k++) {
            const int run = r->row[k].run;
            if (place[run] == 0) {
                sorted[n++] = r->run[run];
                place[run] = n;
            }
        }
    if (sorted == NULL || place == NULL) {
        free(sorted);
        free(place);
        return rx_error_memory(err, (size_t)r->nruns * sizeof *sorted);
    }
    for (int k = 0; k < r->nrows; k++)
        r->row[k].run = place[r->row[k].run] - 1;
    free(r->run);
    r->run = sorted;
    free(place);
    return RX_OK;
}

static rx_status judge_run(const rx_rollup *r, rx_rollup_run *run, rx_error *err)
{
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
    return judge_range(r, &run->tally, &run->whole, err);
}

/* --- comparison --- */

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

static void compare(const rx_rollup *r, rx_rollup_row *row)
{
    const rx_rollup_run *all = &r->run[row->run];
    const double flux = rx_fluxcheck_excess(&row->flux);
    if (!row->compared && flux == 0)
        return;
    const struct {
        const char *what;
        double off;
    } each[] = {{"flux scale", flux},
                {"recall", below(&row->cell.recall, &all->whole.recall)},
                {"precision", below(&row->cell.precision, &all->whole.precision)},
                {"bias", beside(&row->cell, &all->whole)}};
    row->off = 0;
    for (int i = 0; i < (row->compared ? 4 : 1); i++)
        if (each[i].off > row->off) {
            row->off = each[i].off;
            row->what = each[i].what;
        }
}

static int is_bad(const rx_rollup_row *row)
{
    return row->verdict == RX_VERDICT_FAIL ? 2 : row->verdict == RX_VERDICT_INSUFFICIENT;
}

/* Worst first: gates that fail, then by distance; equal ones stay in the order of the tiles. */
static int by_badness(const void *a, const void *b)
{
    const rx_rollup_row *x = a, *y = b;
    const double p = isfinite(x->off) ? x->off : -1, q = isfinite(y->off) ? y->off : -1;
    if (is_bad(x) != is_bad(y))
        return is_bad(y) - is_bad(x);
    if (p != q)
        return p < q ? 1 : -1;
    if (x->tile != y->tile)
        return x->tile->place - y->tile->place;
    return x->place - y->place;
}

void rx_rollup_begin(const rx_survey_config *config, rx_rollup *dst)
{
    *dst = (rx_rollup){.mag_low = config->mag_range.v[0], .mag_high = config->mag_range.v[1]};
}

rx_status rx_rollup_end(rx_rollup *r, const rx_tiles *tiles, rx_error *err)
{
    r->tiles = tiles;
    r->failed = r->ntiles - r->fine - r->gates - r->undecided;
    if (r->ntiles > 1)
        qsort(r->tile, (size_t)r->ntiles, sizeof(rx_rollup_tile *), by_place);
    for (int i = 0; i < r->ntiles; i++)
        r->tile[i]->place = i;
    RX_TRY(find_missing(r, err));
    RX_TRY(sort_runs(r, err));
    for (int i = 0; i < r->nruns; i++)
        RX_TRY(judge_run(r, &r->run[i], err));
    RX_TRY(correlate(r, err));
    for (int i = 0; i < r->nrows; i++)
        compare(r, &r->row[i]);
    if (r->nrows > 1)
        qsort(r->row, (size_t)r->nrows, sizeof *r->row, by_badness);
    return rx_rollup_outliers_find(r, err);
}

static void keep_content(void *tile)
{
    (void)tile;
}

void rx_rollup_free(rx_rollup *rollup)
{
    tdestroy(rollup->known, keep_content);
    for (int i = 0; i < rollup->ntiles; i++)
        free_tile(rollup->tile[i]);
    for (int i = 0; i < rollup->nruns; i++)
        rx_tally_free(&rollup->run[i].tally);
    for (int i = 0; i < rollup->nrows; i++) {
        free(rollup->row[i].why);
        free(rollup->row[i].outside);
        free(rollup->row[i].page);
    }
    for (int i = 0; i < rollup->noutliers; i++)
        free(rollup->outlier[i].why);
    free(rollup->outlier);
    free(rollup->tile);
    free(rollup->run);
    free(rollup->row);
    free(rollup->psf);
    free(rollup->missing);
    *rollup = (rx_rollup){0};
}
