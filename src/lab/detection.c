/* The detection campaign: settings, units and results. */
#include "lab/detection.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/psf.h"
#include "lab/detection_numbers.h"
#include "lab/facts.h"
#include "lab/stage_options.h"
#include "num/convolve.h"

static const char *const SCENES[RX_SCENE_KINDS] = {"STARS", "GALAXIES", "PAIRS",    "BLANK",
                                                   "RINGS", "PLATEAU",  "OUTSKIRTS"};

const char *rx_detection_scene_name(rx_detection_scene scene)
{
    return SCENES[scene];
}

int rx_detection_scene_is_list(rx_detection_scene scene)
{
    return scene == RX_SCENE_STARS || scene == RX_SCENE_GALAXIES;
}

long rx_detection_units(const rx_detection_state *state)
{
    return state->nconditions * state->nscenes * state->ntiles;
}

/* --- open --- */

static rx_status add_method(rx_detection_state *state, const rx_detection_method *method, rx_error *err)
{
    if (state->nmethods == RX_DETECTION_METHODS)
        return rx_error_set(err, RX_USAGE,
                            "RESTORE_TYPE, TUNE_NITER and TUNE_FILTER give more than %d methods; name fewer",
                            RX_DETECTION_METHODS);
    state->method[state->nmethods++] = *method;
    return RX_OK;
}

/* RL with every number of iterations and every filter that is tried. */
static rx_status add_tuned(rx_detection_state *state, const rx_restorer *restorer, rx_error *err)
{
    const rx_ints *niter = &state->config->tune_niter;
    const rx_reals *filter = &state->config->tune_filter;
    rx_status status = RX_OK;
    for (int i = 0; i < niter->n; i++)
        for (int k = 0; k < filter->n && status == RX_OK; k++) {
            rx_detection_method method = {
                .restorer = restorer, .tuned = 1, .niter = niter->v[i], .filter = filter->v[k]};
            snprintf(method.name, sizeof method.name, "RL %d %g", method.niter, method.filter);
            status = add_method(state, &method, err);
        }
    return status;
}

static rx_status set_methods(rx_detection_state *state, rx_error *err)
{
    const rx_words *words = &state->config->restore_type;
    rx_status status = RX_OK;
    for (int i = 0; status == RX_OK && i < words->n; i++) {
        rx_detection_method method = {.restorer = rx_restorer_find(words->v[i])};
        if (method.restorer == NULL)
            return rx_error_set(err, RX_USAGE, "RESTORE_TYPE %s is not made here", words->v[i]);
        if (strcmp(method.restorer->name, "RL") == 0) {
            status = add_tuned(state, method.restorer, err);
            continue;
        }
        snprintf(method.name, sizeof method.name, "%s", method.restorer->name);
        status = add_method(state, &method, err);
        if (status == RX_OK && strcmp(method.name, "NONE") == 0) {
            method.matched = 1;
            snprintf(method.name, sizeof method.name, "MATCHED");
            status = add_method(state, &method, err);
        }
    }
    return status;
}

static void set_scenes(rx_detection_state *state)
{
    const rx_words *words = &state->config->scenes;
    for (int i = 0; i < words->n && state->nscenes < RX_SCENE_KINDS; i++)
        for (int k = 0; k < RX_SCENE_KINDS; k++)
            if (strcmp(words->v[i], SCENES[k]) == 0)
                state->scene[state->nscenes++] = (rx_detection_scene)k;
}

/* Noise of a sky pixel, ADU. */
static double sky_noise(const rx_noise_params *noise)
{
    if (noise->type == RX_NOISE_GAUSS)
        return noise->sigma;
    return noise->type == RX_NOISE_CCD
               ? sqrt(noise->sky * noise->gain + noise->read_noise * noise->read_noise) / noise->gain
               : 0;
}

rx_status rx_detection_area(const rx_psf *psf, int width, int height, double *dst, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    float *stamp = RX_NEW(float, n);
    double power = 0;
    if (stamp == NULL)
        return rx_error_memory(err, n * sizeof *stamp);
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), stamp);
    for (size_t i = 0; i < n; i++)
        power += (double)stamp[i] * (double)stamp[i];
    *dst = 1 / power;
    free(stamp);
    return RX_OK;
}

static rx_status measure_area(const rx_simulation *simulation, rx_detection_sky *dst, rx_error *err)
{
    rx_psf *psf = NULL;
    rx_status status = rx_optics_on_pixels(simulation->optics, &psf, err);
    if (status == RX_OK)
        status = rx_detection_area(psf, simulation->scene.width, simulation->scene.height, &dst->area, err);
    rx_psf_free(psf);
    return status;
}

/* A Gaussian as wide as the PSF. */
static rx_status make_kernel(rx_detection_sky *dst, rx_error *err)
{
    const int radius = rx_gauss_radius(dst->fwhm), side = 2 * radius + 1;
    float *line = RX_NEW(float, (size_t)side);
    dst->side = side;
    dst->kernel = RX_NEW(float, (size_t)side *(size_t)side);
    if (line != NULL && dst->kernel != NULL) {
        rx_gauss_weights(dst->fwhm, radius, line);
        for (int i = 0; i < side * side; i++)
            dst->kernel[i] = line[i / side] * line[i % side];
    }
    free(line);
    return line != NULL && dst->kernel != NULL ? RX_OK : rx_error_memory(err, (size_t)side * sizeof(float));
}

rx_status rx_detection_sky_open(const rx_campaign_config *config, const rx_condition *condition, rx_log *log,
                                rx_detection_sky *dst, rx_error *err)
{
    const rx_simulate_config *sim = config->sim;
    rx_status status = rx_condition_simulation(condition, sim, log, &dst->simulation, err);
    if (status != RX_OK)
        return status;
    dst->fwhm = dst->simulation->optics->fwhm;
    dst->sigma = sky_noise(&dst->simulation->noise);
    if (!(dst->sigma > 0))
        return rx_error_set(err, RX_USAGE,
                            "SIM.NOISE_TYPE, SIM.NOISE_SIGMA: the sky of a %s campaign needs noise",
                            config->campaign_type);
    status = measure_area(dst->simulation, dst, err);
    if (status == RX_OK)
        status = make_kernel(dst, err);
    if (status == RX_OK)
        status = rx_condition_psf(condition, sim, dst->simulation, &dst->told, err);
    return status;
}

void rx_detection_sky_close(rx_detection_sky *sky)
{
    rx_simulation_free(sky->simulation);
    rx_psf_free(sky->told);
    free(sky->kernel);
    *sky = (rx_detection_sky){0};
}

static void close_state(void *pointer)
{
    rx_detection_state *state = pointer;
    if (state == NULL)
        return;
    for (int c = 0; state->sky != NULL && c < state->nconditions; c++)
        rx_detection_sky_close(&state->sky[c]);
    free(state->sky);
    free(state->condition);
    rx_options_free(state->options);
    rx_config_free(state->stage);
    free(state);
}

static rx_status open_state(const rx_campaign_config *config, int nthreads, rx_log *log, void **dst,
                            rx_error *err)
{
    (void)nthreads;
    rx_detection_state *state = RX_NEW(rx_detection_state, 1);
    if (state == NULL)
        return rx_error_memory(err, sizeof *state);
    const rx_ints *tiles = &config->scene_tiles;
    state->config = config;
    state->ntiles = strcmp(config->size, "PAPER") == 0 ? tiles->v[tiles->n - 1] : tiles->v[0];
    set_scenes(state);
    rx_status status = rx_campaign_options(config, log, &state->stage, &state->options, err);
    if (status == RX_OK)
        status = set_methods(state, err);
    if (status == RX_OK)
        status = rx_conditions_make(config, &state->nconditions, &state->condition, err);
    if (status == RX_OK) {
        state->sky = RX_NEW(rx_detection_sky, (size_t)state->nconditions);
        status = state->sky == NULL ? rx_error_memory(err, sizeof *state->sky) : RX_OK;
    }
    for (int c = 0; c < state->nconditions && status == RX_OK; c++)
        status = rx_detection_sky_open(config, &state->condition[c], log, &state->sky[c], err);
    if (status == RX_OK)
        *dst = state;
    else
        close_state(state);
    return status;
}

/* --- facts, plan, units --- */

static rx_status facts(const void *pointer, rx_journal_facts *dst, rx_error *err)
{
    const rx_detection_state *state = pointer;
    rx_status status = rx_facts_model(state->options->model, dst, err);
    return status == RX_OK ? rx_facts_templates(state->sky[0].simulation->templates, dst, err) : status;
}

static long units(const void *state)
{
    return rx_detection_units(state);
}

static rx_status do_unit(const void *state, long unit, const rx_unit_values *done, rx_unit_values *dst,
                         rx_error *err)
{
    (void)done;
    return rx_detection_unit(state, unit, dst, err);
}

/* --- results --- */

/* Room in a set for all its tiles; counts are set back to 0. */
static rx_status size_set(const rx_detection_state *state, const rx_unit_values *tiles, rx_detection_set *set,
                          rx_error *err)
{
    for (long t = 0; t < state->ntiles; t++) {
        const double *v = tiles[t].v;
        const long n = (long)v[0];
        set->n += n;
        v += 2 + RX_DETECTION_PROPS * n;
        for (int m = 0; m < state->nmethods; m++) {
            v += set->columns * n;
            set->run[m].nfalse += (long)*v;
            v += 1 + 2 * (long)*v;
        }
    }
    int failed = (set->prop = RX_NEW(float, RX_DETECTION_PROPS *(size_t)set->n + 1)) == NULL;
    for (int m = 0; m < state->nmethods; m++) {
        rx_detection_tally *run = &set->run[m];
        run->value = RX_NEW(float, (size_t)set->columns *(size_t)set->n + 1);
        run->false_score = RX_NEW(float, (size_t)run->nfalse + 1);
        run->false_distance = RX_NEW(float, (size_t)run->nfalse + 1);
        failed |= run->value == NULL || run->false_score == NULL || run->false_distance == NULL;
        run->nfalse = 0;
    }
    set->n = 0;
    return failed ? rx_error_memory(err, 0) : RX_OK;
}

static void take_tile(const rx_detection_state *state, const rx_unit_values *tile, rx_detection_set *set)
{
    const double *v = tile->v;
    const long n = (long)v[0];
    set->mpixels += v[1];
    v += 2;
    for (long i = 0; i < RX_DETECTION_PROPS * n; i++)
        set->prop[RX_DETECTION_PROPS * set->n + i] = (float)*v++;
    for (int m = 0; m < state->nmethods; m++) {
        rx_detection_tally *run = &set->run[m];
        for (long i = 0; i < set->columns * n; i++)
            run->value[set->columns * set->n + i] = (float)*v++;
        const long nfalse = (long)*v++;
        for (long i = 0; i < nfalse; i++, v += 2) {
            run->false_score[run->nfalse] = (float)v[0];
            run->false_distance[run->nfalse++] = (float)v[1];
        }
    }
    set->n += n;
}

static void describe(const rx_detection_state *state, rx_detection_results *dst)
{
    const rx_campaign_config *config = state->config;
    const rx_simulate_config *sim = config->sim;
    snprintf(
        dst->about, sizeof dst->about,
        "%d x %d pixels, %ld tiles per scene and condition; Moffat PSF of beta %g, noise %s (sky %g ADU, "
        "sigma %.4g); per Mpixel %g stars of %g to %g mag in STARS, %g galaxies of %g to %g mag in GALAXIES",
        state->sky[0].simulation->scene.width, state->sky[0].simulation->scene.height, state->ntiles,
        sim->psf_beta, sim->noise_type, sim->sky_level, state->sky[0].sigma, sim->star_count,
        sim->star_mag.v[0], sim->star_mag.v[1], sim->galaxy_count, sim->galaxy_mag.v[0],
        sim->galaxy_mag.v[1]);
    dst->truth_snr = config->truth_snr;
    for (int m = 0; m < state->nmethods; m++) {
        snprintf(dst->method[m], sizeof dst->method[m], "%s", state->method[m].name);
        dst->tuned[m] = state->method[m].tuned;
    }
    for (int i = 0; i < config->precisions.n && i < RX_PRECISIONS_MAX; i++)
        dst->precision[dst->nprecisions++] = config->precisions.v[i];
    const size_t used = strlen(dst->about);
    rx_campaign_model_words(state->options, dst->about + used, sizeof dst->about - used);
}

static rx_status collect(const rx_detection_state *state, const rx_unit_values *all,
                         rx_detection_results *dst, rx_error *err)
{
    dst->nmethods = state->nmethods;
    dst->nscenes = state->nscenes;
    describe(state, dst);
    dst->set = RX_NEW(rx_detection_set, (size_t)state->nconditions * (size_t)state->nscenes);
    dst->condition = RX_NEW(rx_condition, (size_t)state->nconditions);
    if (dst->set == NULL || dst->condition == NULL)
        return rx_error_memory(err, 0);
    dst->nconditions = state->nconditions;
    memcpy(dst->condition, state->condition, (size_t)state->nconditions * sizeof *dst->condition);
    rx_status status = RX_OK;
    for (int k = 0; k < state->nconditions * state->nscenes && status == RX_OK; k++) {
        rx_detection_set *set = &dst->set[k];
        const rx_unit_values *tiles = all + k * state->ntiles;
        set->scene = state->scene[k % state->nscenes];
        set->fwhm = state->sky[k / state->nscenes].fwhm;
        set->columns = rx_detection_columns(set->scene);
        set->ntiles = state->ntiles;
        status = size_set(state, tiles, set, err);
        for (long t = 0; t < state->ntiles && status == RX_OK; t++)
            take_tile(state, &tiles[t], set);
    }
    return status;
}

void rx_detection_results_free(rx_detection_results *results)
{
    if (results == NULL)
        return;
    for (int k = 0; results->set != NULL && k < results->nconditions * results->nscenes; k++) {
        for (int m = 0; m < results->nmethods; m++) {
            free(results->set[k].run[m].value);
            free(results->set[k].run[m].false_score);
            free(results->set[k].run[m].false_distance);
        }
        free(results->set[k].prop);
    }
    free(results->set);
    free(results->condition);
    free(results);
}

static rx_status report(const void *state, const rx_unit_values *all, const rx_campaign_record *record,
                        const char *folder, const char *shown, rx_log *log, rx_text *brief, rx_error *err)
{
    rx_detection_results *results = RX_NEW(rx_detection_results, 1);
    if (results == NULL)
        return rx_error_memory(err, sizeof *results);
    rx_status status = collect(state, all, results, err);
    if (status == RX_OK)
        status = rx_detection_report(results, record, folder, shown, log, brief, err);
    rx_detection_results_free(results);
    return status;
}

const rx_campaign_kind rx_kind_detection = {.name = "DETECTION",
                                            .title = "Detection campaign",
                                            .open = open_state,
                                            .close = close_state,
                                            .facts = facts,
                                            .units = units,
                                            .unit = do_unit,
                                            .report = report};
