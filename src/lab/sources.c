/* Sources against the true ones: one tile through every run. */
#include "lab/sources.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/memory.h"
#include "check/quality.h"
#include "pipeline/pipeline.h"
#include "simulate/noise.h"
#include "simulate/render.h"

static const double HALF = 0.5; /* of the FWHM: noise moves faint sources so far, and blends of two */

static const rx_lab_column TILE[] = {RX_SOURCES_TILE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column OBJECT[] = {RX_SOURCES_OBJECT_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column FOUND[] = {RX_SOURCES_FOUND_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column WRONG[] = {RX_SOURCES_FALSE_COLUMNS(RX_LAB_COLUMN)};

const rx_lab_schema rx_sources_tables[RX_SOURCES_TABLES] = {
    [RX_SOURCES_TILE] = {"tile", RX_SOURCES_TILE_WIDTH, 0, TILE, NULL, 0},
    [RX_SOURCES_OBJECT] = {"object", RX_SOURCES_OBJECT_WIDTH, RX_SOURCES_FOUND_WIDTH, OBJECT, FOUND, 0},
    [RX_SOURCES_FALSE] = {"false", RX_SOURCES_FALSE_WIDTH, 0, WRONG, NULL, 0},
};

/* A tile and what the run at work has found on it. */
typedef struct search {
    const rx_lab *lab;
    const rx_lab_sky *sky;
    int pairs;
    rx_lab_tile tile;
    double radius; /* of matching, pixels */
    rx_lab_table *table;
    int run;
    rx_qa_list list;
    rx_matches matches;
} search;

rx_status rx_sources_radius(const rx_lab *lab, const rx_lab_sky *sky, const rx_tile *tile, double *pixels,
                            rx_error *err)
{
    RX_TRY(rx_quality_radius(&lab->options->check.quality, tile, pixels, err));
    *pixels = fmax(*pixels, HALF * sky->fwhm);
    return RX_OK;
}

void rx_lab_tile_free(rx_lab_tile *tile)
{
    rx_field_free(tile->field);
    rx_field_free(tile->blank);
    free(tile->objects.list);
    *tile = (rx_lab_tile){0};
}

rx_status rx_lab_expose(const rx_lab_sky *sky, uint64_t seed, uint64_t stream, rx_scene *scene,
                        rx_tile **tile, rx_error *err)
{
    const rx_optics *const optics[] = {sky->simulation->optics};
    const size_t n = (size_t)scene->width * (size_t)scene->height;
    rx_simulated simulated = {.width = scene->width, .height = scene->height, .scene = scene};
    rx_noise_params noise = sky->simulation->noise;
    rx_status status;
    simulated.noise = noise;
    noise.seed = seed;
    noise.stream = stream;
    RX_TRY_EXIT(RX_MAKE(simulated.image, n, err));
    RX_TRY_EXIT(RX_MAKE(simulated.defects, n, err));
    RX_TRY_EXIT(rx_render(scene, 1, optics, &simulated.image, 1, err));
    rx_noise_expose(&noise, simulated.width, simulated.height, simulated.image, simulated.defects, 1);
    /* world coordinates: not every version of wcslib reads headers in several threads */
#pragma omp critical(rx_campaign_tile)
    status = rx_simulation_tile(sky->simulation, &simulated, "simulated", tile, err);
exit:
    rx_simulated_free(&simulated);
    return status;
}

/* --- right, false, and neither --- */

void rx_matches_free(rx_matches *m)
{
    free(m->found);
    free(m->outcome);
    *m = (rx_matches){0};
}

/* Does what was there before explain a detection. */
static int explained(const rx_lab_objects *o, double x, double y)
{
    const double px = floor(x + 0.5), py = floor(y + 0.5);
    if (o->covered != NULL && px >= 0 && py >= 0 && px < o->width && py < o->height &&
        o->covered[(size_t)py * (size_t)o->width + (size_t)px])
        return 1;
    for (long i = 0; i < o->n; i++)
        if (o->list[i].reach > 0 && hypot(x - o->list[i].x, y - o->list[i].y) <= o->list[i].reach)
            return 1;
    return 0;
}

rx_status rx_lab_match(const rx_lab_objects *o, const rx_match_list *d, double radius, rx_matches *dst,
                       rx_error *err)
{
    const size_t n = (size_t)o->n, m = (size_t)d->n;
    rx_arena memory = {0};
    double *x = RX_TAKE(&memory, double, 2 * n), *y = x + n;
    unsigned char *use = RX_TAKE(&memory, unsigned char, n + m), *left = use + n;
    long *partner = RX_TAKE(&memory, long, n + 2 * m), *excuse = partner + n, *taken = excuse + m;
    rx_status status;
    *dst = (rx_matches){RX_NEW(long, n), RX_NEW(unsigned char, m)};
    if (!x || !use || !partner || !dst->found || !dst->outcome)
        RX_TRY_EXIT(rx_error_memory(err, (4 * n + 2 * m) * sizeof(double)));
    for (size_t i = 0; i < n; i++) {
        x[i] = o->list[i].x;
        y[i] = o->list[i].y;
        use[i] = o->list[i].role != RX_OTHER;
    }
    RX_TRY_EXIT(rx_match(&(rx_match_list){o->n, x, y, use}, d, radius, dst->found, taken, err));
    for (size_t k = 0; k < m; k++)
        left[k] = (d->use == NULL || d->use[k]) && taken[k] < 0;
    for (size_t i = 0; i < n; i++)
        use[i] = o->list[i].role == RX_OTHER && !(o->list[i].reach > 0);
    RX_TRY_EXIT(rx_match(&(rx_match_list){o->n, x, y, use}, &(rx_match_list){d->n, d->x, d->y, left}, radius,
                         partner, excuse, err));
    for (size_t k = 0; k < m; k++) {
        const long i = taken[k];
        if (left[k])
            dst->outcome[k] = excuse[k] >= 0 || explained(o, d->x[k], d->y[k]) ? RX_IS_NEITHER : RX_IS_FALSE;
        else
            dst->outcome[k] = i >= 0 && o->list[i].role == RX_LISTED ? RX_IS_RIGHT : RX_IS_NEITHER;
    }
    for (size_t i = 0; i < n; i++)
        if (o->list[i].role != RX_LISTED)
            dst->found[i] = -1;
exit:
    rx_arena_free(&memory);
    if (status != RX_OK)
        rx_matches_free(dst);
    return status;
}

/* --- rows --- */

static double separation(const search *s, long pair)
{
    const rx_lab_object *a = &s->tile.objects.list[2 * pair];
    return hypot(a[0].x - a[1].x, a[0].y - a[1].y);
}

/* Rows of what is to be found. */
static rx_status add_objects(const search *s, rx_error *err)
{
    const rx_lab_objects *o = &s->tile.objects;
    const rx_field *field = s->tile.field;
    const int stars = s->lab->scene[0].id == RX_SCENE_MAGNITUDE && o->n > 0 && o->list[0].role == RX_LISTED;
    const size_t n = (size_t)field->tile->width * (size_t)field->tile->height;
    size_t good = 0;
    double *row;
    RX_TRY(rx_lab_rows_add(&s->table[RX_SOURCES_TILE], 1, &row, err));
    for (size_t i = 0; i < n; i++)
        good += (field->tile->mask[i] & RX_HIDE_PLAIN) == 0;
    row[RX_TILE_MPIXELS] = 1e-6 * (double)good;
    row[RX_TILE_SNR] = stars ? o->list[0].flux * sqrt(s->sky->power) / field->plain->global_sigma : 0;
    for (long i = 0; i < o->n; i++) {
        if (s->pairs ? i % 2 == 0 : o->list[i].role != RX_LISTED)
            continue;
        RX_TRY(rx_lab_rows_add(&s->table[RX_SOURCES_OBJECT], 1, &row, err));
        row[RX_OBJECT_SNR] = s->pairs ? fmin(o->list[i].snr, o->list[i - 1].snr) : o->list[i].snr;
        row[RX_OBJECT_APART] = s->pairs ? separation(s, i / 2) / s->sky->fwhm : 0;
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

static void fill_objects(const search *s)
{
    const rx_lab_objects *o = &s->tile.objects;
    const rx_qa_list *list = &s->list;
    rx_lab_table *table = &s->table[RX_SOURCES_OBJECT];
    for (long i = 0, n = 0; i < o->n && !s->pairs; i++) {
        const long k = s->matches.found[i];
        if (o->list[i].role != RX_LISTED)
            continue;
        double *row = rx_lab_each(table, n++, s->run);
        const double flux = o->list[i].flux, error = k >= 0 ? list->flux_error[k] : 0;
        row[RX_FOUND_SCORE] = k >= 0 ? list->score[k] : NAN;
        row[RX_FOUND_RATIO] = k >= 0 ? list->flux[k] / flux : NAN;
        row[RX_FOUND_PULL] = error > 0 ? (list->flux[k] - flux) / error : NAN;
        row[RX_FOUND_CROWDED] = k >= 0 && (list->flags[k] & (RX_FLAG_CROWDED | RX_FLAG_MERGED)) != 0;
    }
    for (long p = 0; p < o->n / 2 && s->pairs; p++) {
        const double reach = fmin(s->radius, 0.5 * separation(s, p));
        const long a = nearest_detection(list, &o->list[2 * p], reach),
                   b = nearest_detection(list, &o->list[2 * p + 1], reach);
        double *row = rx_lab_each(table, p, s->run);
        row[RX_FOUND_SCORE] = a >= 0 && b >= 0 && a != b ? fmin(list->score[a], list->score[b]) : NAN;
        row[RX_FOUND_RATIO] = row[RX_FOUND_PULL] = NAN;
    }
}

/* Of a list those with that outcome, NULL: all of it. */
static rx_status add_false(const search *s, const rx_qa_list *list, const unsigned char *outcome,
                           rx_error *err)
{
    for (long k = 0; k < list->n; k++) {
        double *row;
        if (outcome != NULL && outcome[k] != RX_IS_FALSE)
            continue;
        RX_TRY(rx_lab_rows_add(&s->table[RX_SOURCES_FALSE], 1, &row, err));
        row[RX_FALSE_RUN] = s->run;
        row[RX_FALSE_SCORE] = list->score[k];
    }
    return RX_OK;
}

/* One run whose sources are there; blank: what was found on the blank tile. */
static rx_status add_run(search *s, const rx_options *options, const rx_sources *sources,
                         const rx_sources *blank, rx_error *err)
{
    const rx_quality_params *par = &options->check.quality;
    rx_qa_list noise = {0};
    rx_status status;
    RX_TRY_EXIT(rx_quality_list(par, s->tile.field->tile, sources, &s->list, err));
    RX_TRY_EXIT(rx_lab_match(&s->tile.objects, &(rx_match_list){s->list.n, s->list.x, s->list.y, NULL},
                             s->radius, &s->matches, err));
    fill_objects(s);
    if (!s->pairs)
        RX_TRY_EXIT(add_false(s, &s->list, s->matches.outcome, err));
    if (blank != NULL) {
        RX_TRY_EXIT(rx_quality_list(par, s->tile.blank->tile, blank, &noise, err));
        status = add_false(s, &noise, NULL, err);
    }
exit:
    rx_matches_free(&s->matches);
    rx_qa_list_free(&noise);
    rx_qa_list_free(&s->list);
    return status;
}

rx_status rx_sources_unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                          rx_lab_table *dst, rx_error *err)
{
    (void)done;
    search s = {.lab = lab,
                .sky = &lab->sky[unit->condition],
                .pairs = lab->scene[unit->scene].id == RX_SCENE_PAIRS,
                .table = dst};
    RX_TRY(lab->kind->tile(lab, unit, &s.tile, err));
    rx_status status = rx_sources_radius(lab, s.sky, s.tile.field->tile, &s.radius, err);
    if (status == RX_OK)
        status = add_objects(&s, err);
    for (int first = 0; first < lab->nruns && status == RX_OK; first = s.run) {
        const rx_lab_run *run = &lab->run[first];
        const rx_options options = rx_lab_options(lab, s.sky, run);
        rx_result result = {0}, empty = {0};
        status = rx_field_extract(&options.pipeline, run->restorer, s.tile.field, NULL, NULL, &result, err);
        if (status == RX_OK && s.tile.blank != NULL)
            status =
                rx_field_extract(&options.pipeline, run->restorer, s.tile.blank, NULL, NULL, &empty, err);
        /* other fluxes of the same sources follow as runs of their own */
        for (s.run = first; status == RX_OK && s.run < lab->nruns; s.run++) {
            const rx_lab_run *next = &lab->run[s.run];
            const rx_options own = rx_lab_options(lab, s.sky, next);
            if (s.run > first && (next->restorer != run->restorer || next->matched || next->tuned))
                break;
            status = add_run(&s, &own, result.sources, empty.sources, err);
        }
        rx_result_free(&empty);
        rx_result_free(&result);
    }
    rx_lab_tile_free(&s.tile);
    return status;
}
