/* The campaign of fluxes: settings, units and results. */
#include "lab/fluxes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/facts.h"
#include "lab/fluxes_numbers.h"
#include "lab/stage_options.h"

static const char *const SCENES[RX_FLUXES_SCENES] = {"FIELD", "PAIRS",  "BLANK",
                                                     "RINGS", "SHREDS", "INJECTED"};

const char *rx_fluxes_scene_name(rx_fluxes_scene scene)
{
    return SCENES[scene];
}

const char *rx_flux_name(rx_flux_kind kind)
{
    static const char *const names[RX_FLUX_KINDS] = {"AUTO", "APER", "WIDE", "TEMPLATE"};
    return names[kind];
}

long rx_fluxes_units(const rx_fluxes_state *state)
{
    return state->nconditions * state->nscenes * state->ntiles;
}

/* --- open --- */

static rx_status set_runs(rx_fluxes_state *state, rx_error *err)
{
    const rx_words *words = &state->config->restore_type;
    if (words->n > RX_FLUXES_RUNS)
        return rx_error_set(err, RX_USAGE, "RESTORE_TYPE names more than %d restorers; name fewer",
                            RX_FLUXES_RUNS);
    for (int i = 0; i < words->n; i++) {
        state->run[i] = rx_restorer_find(words->v[i]);
        if (state->run[i] == NULL)
            return rx_error_set(err, RX_USAGE, "RESTORE_TYPE %s is not made here", words->v[i]);
        state->nruns = i + 1;
    }
    return RX_OK;
}

static void set_scenes(rx_fluxes_state *state)
{
    const rx_words *words = &state->config->flux_scenes;
    for (int i = 0; i < words->n && state->nscenes < RX_FLUXES_SCENES; i++)
        for (int k = 0; k < RX_FLUXES_SCENES; k++)
            if (strcmp(words->v[i], SCENES[k]) == 0)
                state->scene[state->nscenes++] = (rx_fluxes_scene)k;
}

static void close_state(void *pointer)
{
    rx_fluxes_state *state = pointer;
    if (state == NULL)
        return;
    for (int c = 0; state->sky != NULL && c < state->nconditions; c++)
        rx_detection_sky_close(&state->sky[c]);
    rx_fluxes_ground_close(&state->ground);
    free(state->sky);
    free(state->condition);
    rx_options_free(state->options);
    rx_config_free(state->stage);
    free(state);
}

static rx_status open_skies(rx_fluxes_state *state, rx_log *log, rx_error *err)
{
    rx_status status = rx_conditions_make(state->config, &state->nconditions, &state->condition, err);
    if (status != RX_OK)
        return status;
    state->sky = RX_NEW(rx_detection_sky, (size_t)state->nconditions);
    if (state->sky == NULL)
        return rx_error_memory(err, (size_t)state->nconditions * sizeof *state->sky);
    if (state->scene[0] == RX_FLUXES_INJECTED) /* stands alone */
        return rx_fluxes_ground_open(state, log, err);
    for (int c = 0; c < state->nconditions && status == RX_OK; c++)
        status = rx_detection_sky_open(state->config, &state->condition[c], log, &state->sky[c], err);
    return status;
}

static rx_status open_state(const rx_campaign_config *config, int nthreads, rx_log *log, void **dst,
                            rx_error *err)
{
    rx_fluxes_state *state = RX_NEW(rx_fluxes_state, 1);
    if (state == NULL)
        return rx_error_memory(err, sizeof *state);
    const rx_ints *tiles = &config->scene_tiles;
    state->config = config;
    state->nthreads = nthreads;
    state->ntiles = strcmp(config->size, "PAPER") == 0 ? tiles->v[tiles->n - 1] : tiles->v[0];
    set_scenes(state);
    rx_status status = set_runs(state, err);
    if (status == RX_OK)
        status = rx_campaign_options(config, log, &state->stage, &state->options, err);
    if (status == RX_OK) {
        state->options->pipeline.templates.wanted = 1;
        state->options->pipeline.templates.drop = 0; /* what it would drop is counted */
        state->options->pipeline.measure.skip &= ~(unsigned)(RX_SKIP_AUTO | RX_SKIP_APER);
        status = open_skies(state, log, err);
    }
    if (status == RX_OK)
        *dst = state;
    else
        close_state(state);
    return status;
}

/* --- facts, plan, units --- */

static rx_status facts(const void *pointer, rx_journal_facts *dst, rx_error *err)
{
    const rx_fluxes_state *state = pointer;
    const rx_simulation *simulation = rx_fluxes_sky(state, 0, state->scene[0])->simulation;
    rx_status status = rx_facts_model(state->options->model, dst, err);
    return status == RX_OK ? rx_facts_templates(simulation->templates, dst, err) : status;
}

static long units(const void *state)
{
    return rx_fluxes_units(state);
}

static rx_status prepare(void *pointer, rx_log *log, rx_error *err)
{
    rx_fluxes_state *state = pointer;
    return state->ground.field != NULL ? rx_fluxes_ground_search(state, log, err) : RX_OK;
}

static rx_status do_unit(const void *state, long unit, const rx_unit_values *done, rx_unit_values *dst,
                         rx_error *err)
{
    (void)done;
    return rx_fluxes_unit(state, unit, dst, err);
}

/* --- results --- */

static rx_status size_set(const rx_fluxes_state *state, const rx_unit_values *tiles, rx_fluxes_set *set,
                          rx_error *err)
{
    long n = 0;
    for (long t = 0; t < state->ntiles; t++)
        n += (long)tiles[t].v[0];
    int failed = (set->prop = RX_NEW(float, RX_FLUXES_PROPS *(size_t)n + 1)) == NULL;
    for (int r = 0; r < state->nruns; r++)
        failed |= (set->run[r] = RX_NEW(float, RX_FLUXES_COLUMNS *(size_t)n + 1)) == NULL;
    return failed ? rx_error_memory(err, (size_t)n * RX_FLUXES_COLUMNS * sizeof(float)) : RX_OK;
}

/* A tile's objects behind those of the tiles before; partners are counted on. */
static void take_tile(const rx_fluxes_state *state, const rx_unit_values *tile, rx_fluxes_set *set)
{
    const double *v = tile->v;
    const long n = (long)v[0];
    set->mpixels += v[1];
    v += 2;
    for (long i = set->n; i < set->n + n; i++) {
        float *prop = set->prop + i * RX_FLUXES_PROPS;
        for (int p = 0; p < RX_FLUXES_PROPS; p++)
            prop[p] = (float)*v++;
        if (prop[RX_PROP_PARTNER] >= 0)
            prop[RX_PROP_PARTNER] += (float)set->n;
    }
    for (int r = 0; r < state->nruns; r++) {
        for (long i = 0; i < RX_FLUXES_COLUMNS * n; i++)
            set->run[r][RX_FLUXES_COLUMNS * set->n + i] = (float)*v++;
        for (int t = 0; t < RX_FLUXES_TALLIES; t++)
            set->tally[r][t] += *v++;
    }
    set->n += n;
}

static void describe(const rx_fluxes_state *state, rx_fluxes_results *dst)
{
    const rx_simulate_config *sim = state->config->sim;
    const rx_detection_sky *sky = rx_fluxes_sky(state, 0, state->scene[0]);
    const rx_scene_params *scene = &sky->simulation->scene;
    const int injected = state->scene[0] == RX_FLUXES_INJECTED;
    snprintf(
        dst->about, sizeof dst->about,
        "%s %d x %d pixels, %ld tiles per scene and condition; PSF %s, %s%s; sky noise %.4g ADU, gain %g; "
        "per Mpixel %g stars of %g to %g mag and %g galaxies of %g to %g mag",
        injected ? "objects added to a real tile of" : "simulated tiles of", scene->width, scene->height,
        state->ntiles, sky->simulation->optics->description,
        injected ? "measured on it" : "known to the restorers (with the error named, where there is one)",
        injected || strcmp(sim->noise_type, "CCD") == 0 ? "" : ", no photon noise", sky->sigma,
        sky->simulation->noise.gain, sim->star_count, sim->star_mag.v[0], sim->star_mag.v[1],
        sim->galaxy_count, sim->galaxy_mag.v[0], sim->galaxy_mag.v[1]);
}

static rx_status collect(const rx_fluxes_state *state, const rx_unit_values *all, rx_fluxes_results *dst,
                         rx_error *err)
{
    const int nsets = state->nconditions * state->nscenes;
    rx_status status = RX_OK;
    dst->nruns = state->nruns;
    for (int r = 0; r < state->nruns; r++)
        snprintf(dst->run[r], sizeof dst->run[r], "%s", state->run[r]->name);
    dst->nscenes = state->nscenes;
    dst->truth_snr = state->config->truth_snr;
    dst->aperture = state->options->pipeline.measure.aperture_diameter[0];
    describe(state, dst);
    dst->condition = RX_NEW(rx_condition, (size_t)state->nconditions);
    dst->set = RX_NEW(rx_fluxes_set, (size_t)nsets);
    if (dst->condition == NULL || dst->set == NULL)
        return rx_error_memory(err, (size_t)nsets * sizeof *dst->set);
    dst->nconditions = state->nconditions;
    memcpy(dst->condition, state->condition, (size_t)state->nconditions * sizeof *dst->condition);
    for (int k = 0; k < nsets && status == RX_OK; k++) {
        const rx_unit_values *tiles = all + k * state->ntiles;
        rx_fluxes_set *set = &dst->set[k];
        set->scene = state->scene[k % state->nscenes];
        set->fwhm = rx_fluxes_sky(state, k / state->nscenes, set->scene)->fwhm;
        set->ntiles = state->ntiles;
        status = size_set(state, tiles, set, err);
        for (long t = 0; t < state->ntiles && status == RX_OK; t++)
            take_tile(state, &tiles[t], set);
    }
    return status;
}

void rx_fluxes_results_free(rx_fluxes_results *results)
{
    if (results == NULL)
        return;
    for (int k = 0; results->set != NULL && k < results->nconditions * results->nscenes; k++) {
        for (int r = 0; r < RX_FLUXES_RUNS; r++)
            free(results->set[k].run[r]);
        free(results->set[k].prop);
    }
    free(results->set);
    free(results->condition);
    free(results);
}

static rx_status report(const void *state, const rx_unit_values *all, const rx_campaign_record *record,
                        const char *folder, const char *shown, rx_log *log, rx_text *brief, rx_error *err)
{
    rx_fluxes_results *results = RX_NEW(rx_fluxes_results, 1);
    if (results == NULL)
        return rx_error_memory(err, sizeof *results);
    rx_status status = collect(state, all, results, err);
    if (status == RX_OK)
        status = rx_fluxes_report(results, record, folder, shown, log, brief, err);
    rx_fluxes_results_free(results);
    return status;
}

const rx_campaign_kind rx_kind_fluxes = {.name = "FLUXES",
                                         .title = "Campaign of fluxes",
                                         .open = open_state,
                                         .close = close_state,
                                         .facts = facts,
                                         .units = units,
                                         .prepare = prepare,
                                         .unit = do_unit,
                                         .report = report};
