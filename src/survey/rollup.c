/* Records in, sums and comparisons, and the files of the report. */
#include "survey/rollup.h"

#include <math.h>
#include <search.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/interrupt.h"
#include "base/lines.h"
#include "base/memory.h"
#include "io/output.h"

static const double LEAST_ERROR = 0.001; /* mag: a bias below this never makes a tile bad */

static rx_rollup_cell cell_of(const rx_tally_bin *bin)
{
    rx_rollup_cell cell = {.recall = rx_binomial_interval(bin->found, bin->references, RX_LEVEL),
                           .precision = rx_binomial_interval(bin->right, bin->detections, RX_LEVEL)};
    rx_tally_errors(bin, &cell.pairs, &cell.bias, &cell.scatter);
    return cell;
}

/* The bins that lie in MAG_RANGE, summed. */
static rx_status sum_range(const rx_rollup *r, const rx_tally *tally, rx_rollup_cell *dst, rx_error *err)
{
    const double *range = r->config->mag_range.v;
    rx_tally_bin sum = {0};
    rx_status status = RX_OK;
    for (int b = 0; b < RX_TALLY_BINS && status == RX_OK; b++) {
        const double low = 0.5 * (b + RX_TALLY_LOW);
        if (range[0] == range[1] || (low >= range[0] && low + 0.5 <= range[1]))
            status = rx_tally_add_bin(&sum, &tally->bin[b], err);
    }
    *dst = cell_of(&sum);
    free(sum.dmag);
    return status;
}

/* --- a record --- */

static rx_status digest_of(const rx_tile_record *record, rx_text *text, char digest[RX_HASH_TEXT],
                           rx_error *err)
{
    rx_hash sum;
    rx_tile_record_print(text, record);
    if (text->failed)
        return rx_error_memory(err, text->length);
    rx_hash_begin(&sum);
    rx_hash_add(&sum, text->data, text->length);
    rx_hash_text(&sum, digest);
    return RX_OK;
}

static int by_tile(const void *a, const void *b)
{
    const rx_tile_record *x = &((const rx_rollup_tile *)a)->record, *y = &((const rx_rollup_tile *)b)->record;
    const int order = strcmp(x->name, y->name);
    return order != 0 ? order : strcmp(x->image, y->image);
}

static int by_place(const void *a, const void *b)
{
    return by_tile(*(rx_rollup_tile *const *)a, *(rx_rollup_tile *const *)b);
}

static char *keep_text(rx_rollup *r, const char *text)
{
    char *own = RX_TAKE(&r->arena, char, strlen(text) + 1);
    return own != NULL ? strcpy(own, text) : NULL;
}

/* The run of that name, a new one where there is none; NULL without memory. */
static rx_rollup_run *run_of(rx_rollup *r, const char *name)
{
    rx_rollup_run *run = r->runs;
    while (run != NULL && strcmp(run->name, name) != 0)
        run = run->next;
    if (run != NULL || (run = RX_TAKE(&r->arena, rx_rollup_run, 1)) == NULL)
        return run;
    run->name = keep_text(r, name);
    run->place = -1;
    run->next = r->runs;
    r->runs = run;
    return run->name != NULL ? run : NULL;
}

static rx_status add_row(rx_rollup *r, rx_rollup_row *row, const rx_tally *tally, rx_error *err)
{
    const rx_estimate unknown = {.value = NAN, .low = 0, .high = 1};
    const rx_run_facts *facts = row->facts;
    rx_rollup_run *run = row->run = run_of(r, facts->name);
    if (run == NULL)
        return rx_error_memory(err, sizeof *run);
    run->images++;
    run->sources += facts->sources;
    run->by_others += facts->by[0] != '\0';
    run->outside += facts->outside[0] != '\0';
    run->flux_off += rx_fluxcheck_is_off(&facts->flux);
    run->unexplained += facts->guard.known && rx_residual_is_large(facts->guard.unexplained);
    run->raised += facts->guard.known && facts->guard.raised > 1.0;
    row->off = NAN;
    row->worst = "";
    row->compared = tally != NULL;
    row->cell = (rx_rollup_cell){.recall = unknown, .precision = unknown, .bias = NAN, .scatter = NAN};
    if (tally == NULL)
        return RX_OK;
    RX_TRY(rx_tally_add(&run->tally, tally, err));
    return sum_range(r, tally, &row->cell, err);
}

/* Images and runs of a record, of which the tile has a copy: rows, and sums of what the copy does not keep. */
static rx_status add_rows(rx_rollup *r, rx_rollup_tile *tile, const rx_tile_facts *facts, rx_error *err)
{
    rx_extension_facts *own = RX_TAKE(&r->arena, rx_extension_facts, (size_t)facts->n);
    for (int k = 0; k < facts->n; k++)
        tile->nrows += facts->extension[k].nruns;
    rx_rollup_row *row = tile->row = RX_TAKE(&r->arena, rx_rollup_row, (size_t)tile->nrows);
    if (own == NULL || row == NULL)
        return rx_error_memory(err, 0);
    tile->record.facts.extension = own;
    for (int k = 0; k < facts->n; k++, own++) {
        const rx_extension_facts *e = &facts->extension[k];
        *own = *e;
        own->run = RX_TAKE(&r->arena, rx_run_facts, (size_t)e->nruns);
        if (own->run == NULL)
            return rx_error_memory(err, 0);
        for (int i = 0; i < e->nruns; i++, row++) {
            own->run[i] = e->run[i];
            own->run[i].tally = NULL;
            own->run[i].facts = (rx_record){0};
            *row = (rx_rollup_row){.tile = tile, .image = own, .facts = &own->run[i]};
            RX_TRY(add_row(r, row, e->run[i].tally, err));
        }
        r->nimages += e->psf.how[0] != '\0';
        r->lower += rx_psf_account_is_lower(&e->psf);
    }
    r->nrows += tile->nrows;
    return RX_OK;
}

/* A record that is there already does not count again. */
static rx_status add_record(void *user, const rx_tile_record *record, int64_t at, rx_error *err)
{
    rx_rollup *r = user;
    rx_text text = {0};
    rx_rollup_tile wanted = {.record = *record, .path = r->path, .at = at}, *tile;
    const rx_status status = digest_of(record, &text, wanted.digest, err);
    rx_text_free(&text);
    RX_TRY(status);
    rx_rollup_tile *const *known = tfind(&wanted, &r->known, by_tile);
    if (known != NULL && strcmp((*known)->digest, wanted.digest) != 0)
        return rx_error_at(err, RX_INPUT, record->image, -1, 0,
                           "has two records that differ; leave out the older one");
    if (known != NULL)
        return RX_OK;
    tile = RX_TAKE(&r->arena, rx_rollup_tile, 1);
    if (tile == NULL)
        return rx_error_memory(err, sizeof *tile);
    *tile = wanted;
    tile->record.image = keep_text(r, record->image);
    tile->record.name = keep_text(r, record->name);
    tile->record.what = keep_text(r, record->what);
    tile->record.version = NULL;
    if (tile->record.image == NULL || tile->record.name == NULL || tile->record.what == NULL ||
        tsearch(tile, &r->known, by_tile) == NULL)
        return rx_error_memory(err, 0);
    tile->next = r->tiles_read;
    r->tiles_read = tile;
    r->ntiles++;
    r->fine += record->status == RX_OK;
    r->gates += record->status == RX_GATE_FAIL;
    r->undecided += record->status == RX_GATE_INSUFFICIENT;
    RX_TRY(add_rows(r, tile, &record->facts, err));
    return rx_interrupt_check(err);
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
    const double error = RX_MEDIAN_ERROR * fmax(own->scatter, all->scatter) / sqrt((double)own->pairs);
    return own->pairs > 2 && isfinite(own->bias) && isfinite(all->bias) && isfinite(error)
               ? fabs(own->bias - all->bias) / fmax(error, LEAST_ERROR)
               : 0;
}

static void compare(rx_rollup_row *row)
{
    const rx_rollup_cell *own = &row->cell, *all = &row->run->whole;
    const struct {
        const char *what;
        double off;
    } each[] = {{"flux scale", rx_fluxcheck_excess(&row->facts->flux)},
                {"recall", below(&own->recall, &all->recall)},
                {"precision", below(&own->precision, &all->precision)},
                {"bias", beside(own, all)}};
    if (!row->compared && each[0].off == 0)
        return;
    row->off = 0;
    for (int i = 0; i < (row->compared ? 4 : 1); i++)
        if (each[i].off > row->off) {
            row->off = each[i].off;
            row->worst = each[i].what;
        }
}

/* Worst first: gates that fail, then by distance; equal ones stay in the order of the tiles. */
static int by_badness(const void *a, const void *b)
{
    const rx_rollup_row *row[2] = {*(rx_rollup_row *const *)a, *(rx_rollup_row *const *)b};
    double off[2];
    int gate[2];
    for (int i = 0; i < 2; i++) {
        off[i] = isfinite(row[i]->off) ? row[i]->off : -1;
        gate[i] = row[i]->image->verdict == RX_VERDICT_FAIL           ? 2
                  : row[i]->image->verdict == RX_VERDICT_INSUFFICIENT ? 1
                                                                      : 0;
    }
    if (gate[0] != gate[1])
        return gate[1] - gate[0];
    if (off[0] != off[1])
        return off[0] < off[1] ? 1 : -1;
    return row[0]->tile != row[1]->tile ? row[0]->tile->place - row[1]->tile->place
                                        : (row[0] > row[1]) - (row[0] < row[1]);
}

/* Tiles, their rows, and runs in the order of the tiles, whatever was read first; tiles without a record. */
static rx_status sort(rx_rollup *r, rx_error *err)
{
    const int listed = r->tiles != NULL ? r->tiles->n : 0;
    rx_rollup_row **row = r->row = rx_arena_take(&r->arena, (size_t)r->nrows, sizeof *row);
    int nruns = 0;
    for (const rx_rollup_run *run = r->runs; run != NULL; run = run->next)
        nruns++;
    r->tile = rx_arena_take(&r->arena, (size_t)r->ntiles, sizeof(rx_rollup_tile *));
    r->run = rx_arena_take(&r->arena, (size_t)nruns, sizeof *r->run);
    r->missing = RX_TAKE(&r->arena, int, (size_t)listed);
    if (row == NULL || r->tile == NULL || r->run == NULL || r->missing == NULL)
        return rx_error_memory(err, 0);
    rx_rollup_tile **to = r->tile;
    for (rx_rollup_tile *tile = r->tiles_read; tile != NULL; tile = tile->next)
        *to++ = tile;
    if (r->ntiles > 1)
        qsort(r->tile, (size_t)r->ntiles, sizeof(rx_rollup_tile *), by_place);
    for (int i = 0; i < r->ntiles; i++) {
        r->tile[i]->place = i;
        for (int k = 0; k < r->tile[i]->nrows; k++) {
            rx_rollup_run *run = (*row++ = &r->tile[i]->row[k])->run;
            if (run->place < 0) {
                run->place = r->nruns;
                r->run[r->nruns++] = run;
            }
        }
    }
    for (int i = 0; i < listed; i++) {
        const rx_listed_tile *tile = &r->tiles->tile[i];
        const rx_rollup_tile wanted = {.record = {.name = tile->name, .image = tile->words.v[0]}};
        if (tfind(&wanted, &r->known, by_tile) == NULL)
            r->missing[r->nmissing++] = i;
    }
    return RX_OK;
}

static rx_status measure_run(const rx_rollup *r, rx_rollup_run *run, rx_error *err)
{
    run->first = RX_TALLY_BINS;
    run->last = -1;
    for (int b = 0; b < RX_TALLY_BINS; b++) {
        const rx_tally_bin *bin = &run->tally.bin[b];
        run->bin[b] = cell_of(bin);
        if (bin->references == 0 && bin->detections == 0)
            continue;
        run->first = b < run->first ? b : run->first;
        run->last = b;
    }
    return sum_range(r, &run->tally, &run->whole, err);
}

/* Side by side, as each is compared with its neighbours on the sky. */
static rx_status correlate_psfs(rx_rollup *r, rx_error *err)
{
    rx_rho *rho = RX_TAKE(&r->arena, rx_rho, (size_t)r->nimages);
    const rx_rho **images = rx_arena_take(&r->arena, (size_t)r->nimages, sizeof *images);
    int n = 0;
    if (rho == NULL || images == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < r->ntiles; i++)
        for (int k = 0; k < r->tile[i]->record.facts.n; k++) {
            const rx_psf_account *psf = &r->tile[i]->record.facts.extension[k].psf;
            if (psf->how[0] == '\0' || psf->rho.n == 0)
                continue;
            rho[n] = psf->rho;
            images[n] = &rho[n];
            n++;
        }
    return rx_rho_all(n, images, r->rho, err);
}

/* All records are there. */
static rx_status finish(rx_rollup *r, rx_error *err)
{
    r->failed = r->ntiles - r->fine - r->gates - r->undecided;
    RX_TRY(sort(r, err));
    for (int i = 0; i < r->nruns; i++)
        RX_TRY(measure_run(r, r->run[i], err));
    RX_TRY(correlate_psfs(r, err));
    for (int i = 0; i < r->nrows; i++)
        compare(r->row[i]);
    if (r->nrows > 1)
        qsort(r->row, (size_t)r->nrows, sizeof(rx_rollup_row *), by_badness);
    return rx_rollup_outliers(r, err);
}

static void keep_content(void *tile)
{
    (void)tile;
}

static void forget(rx_rollup *r)
{
    tdestroy(r->known, keep_content);
    for (rx_rollup_run *run = r->runs; run != NULL; run = run->next)
        rx_tally_free(&run->tally);
    for (int i = 0; i < r->noutliers; i++)
        free(r->outlier[i].why);
    free(r->outlier);
    rx_arena_free(&r->arena);
}

/* --- files --- */

static rx_status read_records(rx_rollup *r, const char *name, rx_error *err)
{
    struct stat info;
    r->path = keep_text(r, name);
    if (r->path == NULL)
        return rx_error_memory(err, 0);
    if (r->config->merged_name[0] != '\0' && stat(name, &info) == 0 &&
        (S_ISFIFO(info.st_mode) || S_ISCHR(info.st_mode)))
        return rx_error_at(err, RX_INPUT, name, -1, 0,
                           "is no file, and MERGED_NAME has to read it twice; give a file");
    return rx_tile_record_read(name, 0, 0, add_record, r, err);
}

/* The files that a file lists, one a line; blank lines and those that begin with # do not count. */
static rx_status read_list(rx_rollup *r, const char *path, int *n, rx_error *err)
{
    rx_lines lines;
    char *line = NULL;
    rx_status status = rx_lines_open(&lines, path, 0, err);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL) {
        line[strcspn(line, "\r")] = '\0';
        if (line[0] == '#' || line[strspn(line, " \t")] == '\0')
            continue;
        ++*n;
        status = read_records(r, line, err);
    }
    rx_lines_close(&lines);
    return status;
}

/* *n: how many files there were; r->path: the last one. */
static rx_status read_all(rx_rollup *r, const char *given, int *n, rx_error *err)
{
    char *names = keep_text(r, given), *rest = NULL;
    if (names == NULL)
        return rx_error_memory(err, 0);
    for (char *name = strtok_r(names, "\n", &rest); name != NULL; name = strtok_r(NULL, "\n", &rest)) {
        *n += name[0] != '@';
        RX_TRY(name[0] == '@' ? read_list(r, name + 1, n, err) : read_records(r, name, err));
    }
    return RX_OK;
}

/* A record that is read again, as text. */
typedef struct again {
    rx_text text;
    char digest[RX_HASH_TEXT];
} again;

static rx_status print_again(void *user, const rx_tile_record *record, int64_t at, rx_error *err)
{
    again *a = user;
    (void)at;
    return digest_of(record, &a->text, a->digest, err);
}

static rx_status write_merged(const rx_rollup *r, rx_outputs *outputs, rx_error *err)
{
    const char *path = r->config->merged_name, *temporary = NULL;
    rx_text_file file = {0};
    RX_TRY(rx_outputs_file(outputs, path, &temporary, err));
    rx_status status = rx_text_file_open(&file, temporary, path, err);
    for (int i = 0; i < r->ntiles && status == RX_OK; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        again record = {0};
        status = rx_tile_record_read(tile->path, tile->at, 1, print_again, &record, err);
        if (status == RX_OK && strcmp(record.digest, tile->digest) != 0)
            status = rx_error_at(err, RX_INPUT, tile->path, -1, 0,
                                 "has changed while it was read; give a file that nothing writes to");
        if (status == RX_OK)
            status = rx_text_file_add(&file, &record.text, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
        rx_text_free(&record.text);
    }
    return rx_text_file_close(&file, status, err);
}

static void write_log(const rx_rollup *r, rx_log *log)
{
    rx_log_info(log,
                "%d tiles: %d fine, %d failed, %d without a record, %d with a quality gate that failed, %d "
                "with one that is undecided, %d others stand out",
                r->ntiles + r->nmissing, r->fine, r->failed, r->nmissing, r->gates, r->undecided, r->apart);
    if (r->lower > 0)
        rx_log_info(log, "%d of %d images have a PSF that is not from several stars of their own: psfs.ecsv",
                    r->lower, r->nimages);
    for (int i = 0; i < r->nruns; i++) {
        const rx_rollup_run *run = r->run[i];
        const rx_rollup_cell *cell = &run->whole;
        char bias[40] = ", no bias within 50 mag";
        if (isfinite(cell->bias))
            snprintf(bias, sizeof bias, ", bias %+.4f mag", cell->bias);
        if (cell->recall.n > 0)
            rx_log_info(log, "%-8s %ld sources on %ld images; recall %.3f, precision %.3f%s", run->name,
                        run->sources, run->images, cell->recall.value, cell->precision.value,
                        cell->pairs > 0 ? bias : ", nothing matched");
        else
            rx_log_info(log, "%-8s %ld sources on %ld images, without a reference catalogue", run->name,
                        run->sources, run->images);
    }
}

static rx_status write_all(const rx_rollup *r, rx_log *log, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *folder = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_outputs_new(&outputs, err));
    if (r->config->merged_name[0] != '\0')
        RX_TRY_EXIT(write_merged(r, outputs, err));
    RX_TRY_EXIT(rx_outputs_folder(outputs, r->config->output_name, &folder, err));
    RX_TRY_EXIT(rx_rollup_report(r, folder, log, err));
    RX_TRY_EXIT(rx_outputs_commit(outputs, err));
    write_log(r, log);
    rx_outputs_log(outputs, NULL, log);
exit:
    rx_outputs_free(outputs);
    return status;
}

rx_status rx_rollup_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err)
{
    rx_tiles *tiles = NULL;
    rx_rollup r = {.config = config};
    int n = 0;
    rx_status status;
    RX_TRY_EXIT(read_all(&r, given, &n, err));
    if (config->tiles_name[0] != '\0')
        RX_TRY_EXIT(rx_tiles_read(config->tiles_name, &tiles, err));
    r.tiles = tiles;
    if (r.ntiles == 0 && tiles == NULL)
        RX_TRY_EXIT(
            n == 1 ? rx_error_at(err, RX_INPUT, r.path, -1, 0,
                                 "holds no record of a tile; give what RECORD_NAME of rextract has written")
                   : rx_error_set(err, RX_INPUT,
                                  "none of the %d files holds a record of a tile; give what RECORD_NAME of "
                                  "rextract has written",
                                  n));
    RX_TRY_EXIT(finish(&r, err));
    status = write_all(&r, log, err);
exit:
    forget(&r);
    rx_tiles_free(tiles);
    return status;
}
