/* The detection campaign: runs, scenes, and one tile through every run. */
#include "lab/detection.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/min_max.h"
#include "check/quality.h"
#include "pipeline/pipeline.h"

static const rx_lab_column TILE[] = {RX_DETECTION_TILE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column OBJECT[] = {RX_DETECTION_OBJECT_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column FOUND[] = {{"score", "",
                                       "of the detection, NAN: not found; PAIRS: the lower of both, NAN "
                                       "unless two detections lie within half the separation "
                                       "(and the match radius) of the two stars"}};
static const rx_lab_column PHASES[] = {RX_DETECTION_PHASES_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column GALAXY[] = {RX_DETECTION_GALAXY_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column GROWTH[] = {RX_DETECTION_GROWTH_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column WRONG[] = {
    RX_WRONG_COLUMNS(RX_LAB_COLUMN){"distance", "FWHM", "RINGS: from the nearest object"}};

const rx_lab_schema rx_detection_tables[RX_DETECTION_TABLES] = {
    [RX_DETECTION_TILE] = {"tile", RX_DETECTION_TILE_WIDTH, 0, TILE, NULL, 0},
    [RX_DETECTION_OBJECT] = {"object", RX_DETECTION_OBJECT_WIDTH, 1, OBJECT, FOUND, 0},
    [RX_DETECTION_PLATEAU] = {"plateau", 0, RX_DETECTION_PHASES_WIDTH, NULL, PHASES, 0},
    [RX_DETECTION_GROWTH] = {"growth", RX_DETECTION_GALAXY_WIDTH, RX_DETECTION_GROWTH_WIDTH, GALAXY, GROWTH,
                             0},
    [RX_DETECTION_FALSE] = {"false", RX_DETECTION_FALSE_WIDTH, 0, WRONG, NULL, 0},
};

int rx_detection_table(rx_scene_id id)
{
    return id == RX_SCENE_PLATEAU     ? RX_DETECTION_PLATEAU
           : id == RX_SCENE_OUTSKIRTS ? RX_DETECTION_GROWTH
                                      : RX_DETECTION_OBJECT;
}

/* RL with every number of iterations and every filter that is tried. */
static rx_status add_runs(rx_lab *lab, const char *word, rx_error *err)
{
    const rx_ints *niter = &lab->config->tune_niter;
    const rx_reals *filter = &lab->config->tune_filter;
    const int tuned = strcmp(word, "RL") == 0;
    if (!tuned)
        RX_TRY(rx_lab_add_run(lab, word, (rx_lab_run){0}, err));
    if (strcmp(word, "NONE") == 0)
        RX_TRY(rx_lab_add_run(lab, word, (rx_lab_run){.name = "MATCHED", .matched = 1}, err));
    for (int k = 0; tuned && k < niter->n * filter->n; k++) {
        rx_lab_run run = {.tuned = 1, .niter = niter->v[k / filter->n], .filter = filter->v[k % filter->n]};
        snprintf(run.name, sizeof run.name, "RL %d %g", run.niter, run.filter);
        RX_TRY(rx_lab_add_run(lab, word, run, err));
    }
    return RX_OK;
}

static rx_status open_runs(rx_lab *lab, rx_log *log, rx_error *err)
{
    /* numbered by their places here */
    static const rx_scene_id scenes[] = {RX_SCENE_STARS, RX_SCENE_GALAXIES, RX_SCENE_PAIRS,    RX_SCENE_BLANK,
                                         RX_SCENE_RINGS, RX_SCENE_PLATEAU,  RX_SCENE_OUTSKIRTS};
    for (int i = 0; i < lab->config->restore_type.n; i++)
        RX_TRY(add_runs(lab, lab->config->restore_type.v[i], err));
    RX_TRY(rx_lab_add_scenes(lab, &lab->config->scenes, sizeof scenes / sizeof *scenes, scenes, err));
    return rx_lab_skies_simulate(lab, log, err);
}

/* --- one tile --- */

static double separation(const rx_lab_search *w, long pair)
{
    const rx_lab_object *a = &w->tile.objects.list[2 * pair];
    return hypot(a[0].x - a[1].x, a[0].y - a[1].y);
}

/* Rows of the objects that are listed. */
static rx_status add_objects(const rx_lab_search *w, rx_error *err)
{
    const rx_lab_objects *o = &w->tile.objects;
    const rx_tile *tile = w->tile.field->tile;
    double *row;
    RX_TRY(rx_lab_rows_add(&w->table[RX_DETECTION_TILE], 1, &row, err));
    row[RX_TILE_MPIXELS] = 1e-6 * (double)tile->width * (double)tile->height;
    if (w->scene == RX_SCENE_PLATEAU)
        return rx_lab_rows_add(&w->table[RX_DETECTION_PLATEAU], 1, &row, err);
    for (long i = 0; i < o->n; i++) {
        const int pair = w->scene == RX_SCENE_PAIRS;
        if (pair ? i % 2 == 0 : w->scene != RX_SCENE_OUTSKIRTS && o->list[i].role != RX_LISTED)
            continue;
        RX_TRY(rx_lab_rows_add(&w->table[rx_detection_table(w->scene)], 1, &row, err));
        row[RX_OBJECT_SNR] = pair ? fmin(o->list[i].snr, o->list[i - 1].snr) : o->list[i].snr;
        if (pair)
            row[RX_OBJECT_APART] = separation(w, i / 2) / w->sky->fwhm;
    }
    return RX_OK;
}

/* The detection nearest to an object, within the radius, or -1. */
static long nearest_detection(const rx_qa_list *list, const rx_lab_object *o, double radius)
{
    long best = -1;
    for (long k = 0; k < list->n; k++) {
        const double d = hypot(list->x[k] - o->x, list->y[k] - o->y);
        if (d <= radius) {
            best = k;
            radius = d;
        }
    }
    return best;
}

static void found(const rx_lab_search *w)
{
    const rx_lab_objects *o = &w->tile.objects;
    const rx_lab_table *table = &w->table[RX_DETECTION_OBJECT];
    long row = 0;
    for (long i = 0; i < o->n; i++) {
        const long k = w->matches.found[i];
        if (o->list[i].role == RX_LISTED)
            rx_lab_each(table, row++, w->run)[RX_LIST_SCORE] = k >= 0 ? w->list.score[k] : NAN;
    }
    for (long p = 0; p < o->n / 2 && w->scene == RX_SCENE_PAIRS; p++) {
        const double reach = fmin(w->radius, 0.5 * separation(w, p));
        const long a = nearest_detection(&w->list, &o->list[2 * p], reach),
                   b = nearest_detection(&w->list, &o->list[2 * p + 1], reach);
        rx_lab_each(table, p, w->run)[RX_LIST_SCORE] =
            a >= 0 && b >= 0 && a != b ? fmin(w->list.score[a], w->list.score[b]) : NAN;
    }
}

/* --- pixels --- */

/* rms of the means of side x side phases about their mean, and their range, in the middle of a plateau. */
static void phases(const rx_tile *tile, const float *pixels, int side, double *rms, double *range)
{
    double sum[16] = {0}, mean = 0, low = HUGE_VAL, high = -HUGE_VAL;
    const int n = side * side, box = rx_min_int(tile->width, tile->height) / 16 * 4;
    const int x0 = (tile->width - box) / 2, y0 = (tile->height - box) / 2;
    for (int y = 0; y < box; y++)
        for (int x = 0; x < box; x++)
            sum[y % side * side + x % side] +=
                (double)pixels[(size_t)(y0 + y) * (size_t)tile->width + (size_t)(x0 + x)];
    for (int i = 0; i < n; i++) {
        sum[i] /= (double)box * box / n;
        mean += sum[i] / n;
        low = fmin(low, sum[i]);
        high = fmax(high, sum[i]);
    }
    *rms = 0;
    for (int i = 0; i < n; i++)
        *rms += (sum[i] - mean) * (sum[i] - mean) / n;
    *rms = sqrt(*rms);
    *range = high - low;
}

/* Sum within a radius; pixels on the edge with the share of 5 x 5 points that are inside. */
static double aperture(const rx_tile *tile, const float *pixels, double x, double y, double radius)
{
    enum { FINE = 5 };
    double sum = 0;
    const int x0 = (int)fmax(floor(x - radius), 0), x1 = (int)fmin(ceil(x + radius), tile->width - 1);
    const int y0 = (int)fmax(floor(y - radius), 0), y1 = (int)fmin(ceil(y + radius), tile->height - 1);
    for (int v = y0; v <= y1; v++)
        for (int u = x0; u <= x1; u++) {
            int inside = 0;
            for (int k = 0; k < FINE * FINE; k++)
                inside += hypot(u - x + (k % FINE + 0.5) / FINE - 0.5,
                                v - y + (k / FINE + 0.5) / FINE - 0.5) <= radius;
            sum += (double)pixels[(size_t)v * (size_t)tile->width + (size_t)u] * inside / (FINE * FINE);
        }
    return sum;
}

static rx_status measure(const rx_lab_search *w, int run, rx_error *err)
{
    const rx_restorer *restorer = w->lab->run[run].restorer;
    const rx_options options = rx_lab_options(w->lab, w->sky, &w->lab->run[run]);
    const rx_tile *tile = w->tile.field->tile;
    const int plain = strcmp(restorer->name, "NONE") == 0;
    rx_restored *restored = NULL;
    rx_image image = plain ? rx_field_observed(w->tile.field) : rx_field_restorable(w->tile.field);
    image.hide = options.pipeline.restore.mask_saturated ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    RX_TRY(restorer->run(&options.pipeline.restore, &image, NULL, &restored, err));
    if (w->scene == RX_SCENE_PLATEAU) {
        double *row = rx_lab_each(&w->table[RX_DETECTION_PLATEAU], 0, run);
        phases(tile, restored->pixels, 2, &row[RX_PHASES_2], &row[RX_PHASES_RANGE]);
        phases(tile, restored->pixels, 4, &row[RX_PHASES_4], &row[RX_PHASES_RANGE]);
        for (int i = 0; i < RX_DETECTION_PHASES_WIDTH; i++)
            row[i] /= w->sky->sigma;
    }
    for (long i = 0; w->scene == RX_SCENE_OUTSKIRTS && i < w->tile.objects.n; i++) {
        const rx_lab_object *o = &w->tile.objects.list[i];
        double *row = rx_lab_each(&w->table[RX_DETECTION_GROWTH], i, run);
        const double r50 = hypot(o->radius, 0.5 * w->sky->fwhm);
        for (int k = 0; k < RX_OUTSKIRT_RADII; k++) {
            row[RX_GROWTH + k] = aperture(tile, restored->pixels, o->x, o->y, r50 * (1 << k)) / o->flux;
            row[RX_GROWTH_TRUE + k] =
                aperture(tile, w->tile.truth[!plain], o->x, o->y, r50 * (1 << k)) / o->flux;
        }
    }
    rx_restored_free(restored);
    return RX_OK;
}

static rx_status unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                      rx_lab_table *dst, rx_error *err)
{
    rx_lab_search w = {
        .lab = lab, .sky = &lab->sky[unit->condition], .scene = lab->scene[unit->scene].id, .table = dst};
    if (w.scene != RX_SCENE_PLATEAU && w.scene != RX_SCENE_OUTSKIRTS)
        return rx_lab_search_unit(lab, unit, done, dst, err);
    RX_TRY(rx_lab_tile_make(lab, unit, &w.tile, err));
    rx_status status = add_objects(&w, err);
    for (int run = 0; run < lab->nruns && status == RX_OK; run++)
        status = measure(&w, run, err);
    rx_lab_tile_free(&w.tile);
    return status;
}

static rx_status describe(rx_lab *lab, rx_error *err)
{
    (void)err;
    const rx_simulate_config *sim = lab->config->sim;
    snprintf(
        lab->about, sizeof lab->about,
        "%d x %d pixels, %ld tiles per scene and condition; Moffat PSF of beta %g, noise %s (sky %g ADU, "
        "sigma %.4g); per Mpixel %g stars of %g to %g mag in STARS, %g galaxies of %g to %g mag in GALAXIES",
        lab->sky[0].width, lab->sky[0].height, lab->ntiles, sim->psf_beta, sim->noise_type, sim->sky_level,
        lab->sky[0].sigma, sim->star_count, sim->star_mag.v[0], sim->star_mag.v[1], sim->galaxy_count,
        sim->galaxy_mag.v[0], sim->galaxy_mag.v[1]);
    rx_lab_add_model(lab, lab->about, sizeof lab->about);
    return RX_OK;
}

RX_LAB_KIND(rx_kind_detection, .name = "DETECTION", .title = "Detection campaign", .tag = 0x6465746563,
            .most = RX_LAB_RUNS, .ntables = RX_DETECTION_TABLES, .tables = rx_detection_tables,
            .objects = RX_DETECTION_OBJECT, .wrong = RX_DETECTION_FALSE, .deep = 1, .open = open_runs,
            .tile = rx_lab_tile_make, .rows = add_objects, .found = found, .unit = unit, .describe = describe,
            .name_set = rx_detection_name_set, .report = rx_detection_report,
            .reading = rx_detection_reading);
