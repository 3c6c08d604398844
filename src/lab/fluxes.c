/* The campaign of fluxes: runs, scenes, the real tile, and one tile through every restorer. */
#include "lab/fluxes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/quality.h"
#include "check/selfcheck.h"
#include "pipeline/domain.h"
#include "pipeline/pipeline.h"

static const double STRONG = 7.0, WEAK = 5.0;
/* A detection is a piece of the nearest galaxy within so many half-light radii and FWHM. */
static const double PIECE_RADII = 3.0, PIECE_FWHM = 2.0;

/* What random numbers are for on a real tile. */
enum { DRAW_SCENE = 1, DRAW_NOISE = 2 };

static const rx_lab_column TILE[] = {RX_FLUXES_TILE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column TALLY[] = {RX_FLUXES_TALLY_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column OBJECT[] = {RX_FLUXES_OBJECT_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column FOUND[] = {RX_FLUXES_FOUND_COLUMNS(RX_LAB_COLUMN)};

const rx_lab_schema rx_fluxes_tables[RX_FLUXES_TABLES] = {
    [RX_FLUXES_TILE] = {"tile", RX_FLUXES_TILE_WIDTH, RX_FLUXES_TALLIES, TILE, TALLY, 0},
    [RX_FLUXES_OBJECT] = {"object", RX_FLUXES_PROPS, RX_FLUXES_COLUMNS, OBJECT, FOUND, 0},
};

/* --- the real tile --- */

static rx_status read_tile(rx_lab *lab, rx_log *log, rx_error *err)
{
    rx_simulate_config *own = NULL;
    RX_TRY(RX_MAKE(lab->sky, 1, err));
    lab->nconditions = lab->nskies = 1;
    RX_TRY(rx_lab_sky_read(lab, log, lab->sky, err));
    rx_status status = rx_simulate_config_copy(lab->config->sim, &own, err);
    if (status == RX_OK)
        status = rx_settings_set(&own->settings, "PSF_TYPE", "AUTO", log, err);
    if (status == RX_OK)
        status = rx_simulation_for_tile(own, lab->options, lab->sky->field, log, &lab->sky->simulation, err);
    rx_simulate_config_free(own);
    if (status != RX_OK)
        return status;
    lab->sky->simulation->nthreads = 1;
    lab->sky->simulation->scene.seed = rx_lab_seed(lab, DRAW_SCENE);
    lab->sky->simulation->noise.seed = rx_lab_seed(lab, DRAW_NOISE);
    return RX_OK;
}

static rx_status untouched(const rx_lab *lab, rx_lab_sky *sky, int run, rx_result *result, rx_error *err)
{
    (void)lab;
    rx_sources_free(sky->before[run]);
    sky->before[run] = result->sources;
    result->sources = NULL;
    return run > 0 ? RX_OK : rx_domain_noise(sky->field, 1, &sky->model_noise, err);
}

static rx_status open_runs(rx_lab *lab, rx_log *log, rx_error *err)
{
    /* numbered by their places here */
    static const rx_scene_id scenes[] = {RX_SCENE_FIELD, RX_SCENE_MIXED_PAIRS, RX_SCENE_BLANK,
                                         RX_SCENE_RINGS, RX_SCENE_SHREDS,      RX_SCENE_INJECTED};
    const rx_words *restorers = &lab->config->restore_type;
    for (int i = 0; i < restorers->n; i++)
        RX_TRY(rx_lab_add_run(lab, restorers->v[i], (rx_lab_run){0}, err));
    RX_TRY(rx_lab_add_scenes(lab, &lab->config->flux_scenes, sizeof scenes / sizeof *scenes, scenes, err));
    return lab->scene[0].id == RX_SCENE_INJECTED ? read_tile(lab, log, err)
                                                 : rx_lab_skies_simulate(lab, log, err);
}

/* --- one tile --- */

static rx_status add_props(const rx_lab_search *w, rx_error *err)
{
    const rx_lab_objects *o = &w->tile.objects;
    const rx_tile *tile = w->tile.field->tile;
    long *number = RX_NEW(long, (size_t)o->n), n = 0;
    double *row = NULL;
    rx_status status = number != NULL ? rx_lab_rows_add(&w->table[RX_FLUXES_TILE], 1, &row, err)
                                      : rx_error_memory(err, (size_t)o->n * sizeof *number);
    if (status == RX_OK)
        row[RX_FLUXES_MPIXELS] = 1e-6 * (double)tile->width * (double)tile->height;
    for (long i = 0; status == RX_OK && i < o->n; i++)
        number[i] = o->list[i].role == RX_LISTED ? n++ : -1;
    if (status == RX_OK)
        status = rx_lab_rows_add(&w->table[RX_FLUXES_OBJECT], n, &row, err);
    for (long i = 0; status == RX_OK && i < o->n; i++) {
        const rx_lab_object *one = &o->list[i], *other = one->partner >= 0 ? &o->list[one->partner] : one;
        if (one->role != RX_LISTED)
            continue;
        row[RX_PROP_SNR] = one->snr;
        row[RX_PROP_GALAXY] = one->galaxy;
        row[RX_PROP_BLEND_STATE] = one->company;
        row[RX_PROP_BOUND] = one->bound;
        if (other != one && other->role == RX_LISTED)
            row[RX_PROP_PARTNER] = (double)(number[one->partner] - number[i]);
        row[RX_PROP_APART] = hypot(one->x - other->x, one->y - other->y) / w->sky->fwhm;
        row[RX_PROP_MAGS] = 2.5 * log10(other->flux / one->flux);
        row += w->table[RX_FLUXES_OBJECT].width;
    }
    free(number);
    return status;
}

/* An object and the one that it is blended with, both found, each nearer than half their separation. */
static int resolved(const rx_lab_search *w, long i)
{
    const rx_lab_object *o = w->tile.objects.list;
    const long both[] = {i, o[i].partner};
    int n = 0;
    for (int k = 0; k < 2 && both[1] >= 0; k++) {
        const long found = w->matches.found[both[k]];
        n += found >= 0 && hypot(w->list.x[found] - o[both[k]].x, w->list.y[found] - o[both[k]].y) <=
                               0.5 * hypot(o[i].x - o[both[1]].x, o[i].y - o[both[1]].y);
    }
    return n == 2;
}

/* Detections on a galaxy, all (0) or those without the mark (1): those that it is the nearest object of. */
static void count_pieces(const rx_lab_search *w, long i, double pieces[2])
{
    const rx_lab_objects *o = &w->tile.objects;
    for (int k = 0; k < w->sources->n; k++) {
        long nearest = -1;
        double least = HUGE_VAL;
        for (long j = 0; j < o->n; j++) {
            const double d = hypot(w->list.x[k] - o->list[j].x, w->list.y[k] - o->list[j].y);
            if (d < least) {
                least = d;
                nearest = j;
            }
        }
        if (nearest == i && least <= PIECE_RADII * o->list[i].radius + PIECE_FWHM * w->sky->fwhm) {
            pieces[0]++;
            pieces[1] += !rx_source_is_spurious(&w->sources->list[k]);
        }
    }
}

static void fill_object(const rx_lab_search *w, long i, double *row)
{
    const long found = w->matches.found[i];
    const double truth = w->tile.objects.list[i].flux;
    for (int k = 0; k < RX_BOTH; k++)
        row[k] = NAN;
    if (found >= 0) {
        const rx_source *s = &w->sources->list[found];
        const double flux[] = {s->flux_auto, s->flux_aper[0], s->flux_aper[1], s->fit.flux};
        const double error[] = {s->fluxerr_auto, s->fluxerr_aper[0], s->fluxerr_aper[1], s->fit.fluxerr};
        row[RX_FOUND] = (s->fit.restore & RX_RESTORE_ADDED ? 2 : 0) + (rx_source_is_spurious(s) ? 1 : 0);
        for (int k = 0; k < RX_FLUX_KINDS; k++) {
            row[RX_RATIO + k] = flux[k] / truth;
            row[RX_ERROR + k] = error[k] / truth;
        }
    }
    row[RX_BOTH] = resolved(w, i);
    if (w->scene == RX_SCENE_SHREDS)
        count_pieces(w, i, &row[RX_PIECES]);
}

static void fill_tallies(const rx_lab_search *w, double *tally)
{
    for (int k = 0; k < w->sources->n; k++) {
        const rx_source *s = &w->sources->list[k];
        const int kept = !rx_source_is_spurious(s);
        if (w->matches.outcome[k] == RX_IS_FALSE) {
            tally[RX_TALLY_FALSE]++;
            tally[RX_TALLY_FALSE_KEPT] += kept;
        }
        if (w->matches.outcome[k] != RX_IS_RIGHT)
            continue;
        const double snr = w->tile.objects.list[w->matches.taken[k]].snr;
        tally[RX_TALLY_RIGHT]++;
        tally[RX_TALLY_RIGHT_KEPT] += kept;
        tally[RX_TALLY_ADDED] += (s->fit.restore & RX_RESTORE_ADDED) != 0;
        if (snr >= STRONG) {
            tally[RX_TALLY_STRONG]++;
            tally[RX_TALLY_STRONG_KEPT] += kept;
        } else if (snr >= WEAK) {
            tally[RX_TALLY_WEAK]++;
            tally[RX_TALLY_WEAK_KEPT] += kept;
        }
    }
}

static void found(const rx_lab_search *w)
{
    long row = 0;
    for (long i = 0; i < w->tile.objects.n; i++)
        if (w->tile.objects.list[i].role == RX_LISTED)
            fill_object(w, i, rx_lab_each(&w->table[RX_FLUXES_OBJECT], row++, w->run));
    fill_tallies(w, rx_lab_each(&w->table[RX_FLUXES_TILE], 0, w->run));
}

static rx_status describe(rx_lab *lab, rx_error *err)
{
    (void)err;
    const rx_simulate_config *sim = lab->config->sim;
    const rx_lab_sky *sky = lab->sky;
    const int injected = lab->scene[0].id == RX_SCENE_INJECTED;
    snprintf(
        lab->about, sizeof lab->about,
        "%s %d x %d pixels, %ld tiles per scene and condition; PSF %s, %s%s; sky noise %.4g ADU, gain %g; "
        "per Mpixel %g stars of %g to %g mag and %g galaxies of %g to %g mag",
        injected ? "objects added to a real tile of" : "simulated tiles of", sky->simulation->scene.width,
        sky->simulation->scene.height, lab->ntiles, sky->simulation->optics->description,
        injected ? "measured on it" : "known to the restorers (with the error named, where there is one)",
        injected || strcmp(sim->noise_type, "CCD") == 0 ? "" : ", no photon noise", sky->sigma,
        sky->simulation->noise.gain, sim->star_count, sim->star_mag.v[0], sim->star_mag.v[1],
        sim->galaxy_count, sim->galaxy_mag.v[0], sim->galaxy_mag.v[1]);
    return RX_OK;
}

RX_LAB_KIND(rx_kind_fluxes, .name = "FLUXES", .title = "Campaign of fluxes", .tag = 0x666c757865,
            .most = RX_FLUXES_RUNS, .ntables = RX_FLUXES_TABLES, .tables = rx_fluxes_tables, .deep = 1,
            .fluxes = 1, .open = open_runs, .untouched = untouched, .tile = rx_lab_tile_make,
            .rows = add_props, .found = found, .unit = rx_lab_search_unit, .describe = describe,
            .results = &rx_fluxes_results);
