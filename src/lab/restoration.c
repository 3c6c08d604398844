/* The restoration campaign: its bins, units and results. */
#include "lab/restoration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/facts.h"
#include "lab/stage_options.h"

/* Restorers whose result depends on a number of iterations (RL_NITER): tuned per bin. */
static const char *const TUNABLE[] = {"RL"};

static int is_tunable(const char *name)
{
    for (size_t i = 0; i < sizeof TUNABLE / sizeof TUNABLE[0]; i++)
        if (strcmp(TUNABLE[i], name) == 0)
            return 1;
    return 0;
}

/* --- open --- */

static rx_status add_method(rx_restoration *state, const char *name, const char *suffix,
                            const rx_restorer *restorer, int tuned, rx_error *err)
{
    if (state->nmethods == RX_METHODS_MAX)
        return rx_error_set(err, RX_USAGE, "RESTORE_TYPE gives more than %d methods; name fewer",
                            RX_METHODS_MAX);
    rx_method *method = &state->method[state->nmethods++];
    *method = (rx_method){.restorer = restorer, .tuned = tuned, .flat = suffix[0] != '\0'};
    snprintf(method->name, sizeof method->name, "%s%s", name, suffix);
    return RX_OK;
}

/* The first of the restorers asked for that can be tuned, or NULL. */
static const rx_restorer *first_tunable(const rx_words *words)
{
    for (int i = 0; i < words->n; i++)
        if (is_tunable(words->v[i]))
            return rx_restorer_find(words->v[i]);
    return NULL;
}

/* NONE is the blurred image, and beside a tuned restorer also the blurred image through a filter, tuned as
 * the restorer's is: what is gained without any deconvolution. */
static rx_status set_methods(rx_restoration *state, rx_error *err)
{
    const rx_words *words = &state->config->restore_type;
    const rx_restorer *tunable = first_tunable(words);
    rx_status status = RX_OK;
    for (int i = 0; status == RX_OK && i < words->n; i++) {
        const rx_restorer *restorer = rx_restorer_find(words->v[i]);
        if (restorer == NULL)
            return rx_error_set(err, RX_USAGE, "RESTORE_TYPE %s is not made here", words->v[i]);
        const int tuned = is_tunable(restorer->name);
        const int none = strcmp(restorer->name, "NONE") == 0;
        for (int m = 0; m < state->nmethods; m++)
            if (state->method[m].restorer == restorer && !state->method[m].smooth)
                return rx_error_set(err, RX_USAGE, "RESTORE_TYPE names %s twice", words->v[i]);
        status = add_method(state, none ? "BLURRED" : restorer->name, "", restorer, tuned, err);
        if (status == RX_OK && none && tunable != NULL) {
            status = add_method(state, "SMOOTHED", "", tunable, 1, err);
            state->method[state->nmethods - 1].smooth = 1;
        }
        if (status == RX_OK && tuned)
            status = add_method(state, restorer->name, "_FLAT", restorer, tuned, err);
        state->ntuned += tuned;
    }
    return status;
}

static int bin_count(const rx_reals *range)
{
    return (int)floor(range->v[1] - range->v[0] + 1e-6) + 1;
}

static long scene_count(const rx_campaign_config *config, const rx_ints *list)
{
    return strcmp(config->size, "PAPER") == 0 ? list->v[list->n - 1] : list->v[0];
}

/* Bins of one quantity, 1 wide, one centre per unit from the first to the last. */
static void add_bins(rx_restoration *state, int by_sigma, const rx_reals *range, const rx_reals *other,
                     const rx_ints *scenes)
{
    for (int i = 0; i < bin_count(range); i++)
        state->bins[state->nbins++] = (rx_restoration_range){.by_sigma = by_sigma,
                                                             .low = fmax(range->v[0] + i - 0.5, 0),
                                                             .high = range->v[0] + i + 0.5,
                                                             .other_low = other->v[0],
                                                             .other_high = other->v[1],
                                                             .nscenes = scene_count(state->config, scenes)};
}

static rx_status set_bins(rx_restoration *state, rx_error *err)
{
    const rx_campaign_config *config = state->config;
    if (config->fwhm_range.v[1] < config->fwhm_range.v[0] ||
        config->sigma_range.v[1] < config->sigma_range.v[0] ||
        config->fwhm_trained.v[1] < config->fwhm_trained.v[0] ||
        config->sigma_trained.v[1] < config->sigma_trained.v[0])
        return rx_error_set(err, RX_USAGE,
                            "FWHM_RANGE, SIGMA_RANGE, FWHM_TRAINED and SIGMA_TRAINED go from low to high");
    const size_t n = (size_t)bin_count(&config->fwhm_range) + (size_t)bin_count(&config->sigma_range);
    state->bins = RX_NEW(rx_restoration_range, n);
    if (state->bins == NULL)
        return rx_error_memory(err, n * sizeof *state->bins);
    add_bins(state, 0, &config->fwhm_range, &config->sigma_trained, &config->scenes_fwhm);
    add_bins(state, 1, &config->sigma_range, &config->fwhm_trained, &config->scenes_sigma);
    return RX_OK;
}

static rx_status set_units(rx_restoration *state, rx_error *err)
{
    const long tune = state->ntuned > 0 ? state->config->tune_scenes : 0;
    for (int b = 0; b < state->nbins; b++)
        state->nunits += tune + state->bins[b].nscenes;
    state->units = RX_NEW(rx_restoration_unit, (size_t)state->nunits);
    if (state->units == NULL)
        return rx_error_memory(err, (size_t)state->nunits * sizeof *state->units);
    rx_restoration_unit *unit = state->units;
    for (int b = 0; b < state->nbins; b++) {
        for (long i = 0; i < tune; i++)
            *unit++ = (rx_restoration_unit){b, 1, i};
        for (long i = 0; i < state->bins[b].nscenes; i++)
            *unit++ = (rx_restoration_unit){b, 0, i};
    }
    return RX_OK;
}

/* The population on a scene, without stars unless they were asked for, and with one galaxy at least. */
static rx_status set_simulation(rx_restoration *state, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = state->config;
    rx_simulate_config *sim = NULL;
    char side[32];
    snprintf(side, sizeof side, "%d", config->scene_side);
    rx_status status = rx_simulate_config_copy(config->sim, &sim, err);
    if (status == RX_OK)
        status = rx_settings_set(&sim->settings, "IMAGE_SIZE", side, log, err);
    if (status == RX_OK && sim->inject_image[0] != '\0')
        status = rx_error_set(err, RX_USAGE, "SIM.INJECT_IMAGE has no place in a restoration campaign");
    if (status == RX_OK && strcmp(sim->psf_type, "MOFFAT") != 0)
        status = rx_error_set(err, RX_USAGE,
                              "SIM.PSF_TYPE %s has no FWHM to vary in a restoration campaign; give MOFFAT",
                              sim->psf_type);
    if (status == RX_OK)
        status = rx_simulation_from_config(sim, log, &state->simulation, err);
    rx_simulate_config_free(sim);
    if (status != RX_OK)
        return status;
    rx_simulation *simulation = state->simulation;
    simulation->nthreads = 1;
    if (rx_settings_was_set(&config->settings, "SIM.STAR_COUNT") == RX_FROM_DEFAULT)
        simulation->scene.stars.count = 0;
    if (simulation->scene.galaxies.count + simulation->scene.templates.count < 1)
        *(simulation->templates != NULL && simulation->scene.templates.count > 0
              ? &simulation->scene.templates.count
              : &simulation->scene.galaxies.count) = 1;
    return RX_OK;
}

static void close_state(void *pointer)
{
    rx_restoration *state = pointer;
    if (state == NULL)
        return;
    rx_options_free(state->options);
    rx_config_free(state->stage);
    rx_simulation_free(state->simulation);
    free(state->bins);
    free(state->units);
    free(state);
}

static rx_status open_state(const rx_campaign_config *config, int nthreads, rx_log *log, void **dst,
                            rx_error *err)
{
    (void)nthreads;
    rx_restoration *state = RX_NEW(rx_restoration, 1);
    if (state == NULL)
        return rx_error_memory(err, sizeof *state);
    state->config = config;
    state->side = config->scene_side;
    rx_status status = rx_campaign_options(config, log, &state->stage, &state->options, err);
    if (status == RX_OK)
        status = set_methods(state, err);
    if (status == RX_OK)
        status = set_bins(state, err);
    if (status == RX_OK)
        status = set_units(state, err);
    if (status == RX_OK)
        status = set_simulation(state, log, err);
    if (status != RX_OK) {
        close_state(state);
        return status;
    }
    *dst = state;
    return RX_OK;
}

/* --- facts, plan, units --- */

/* Templates may come from a folder or a list: what was read counts. */
static rx_status facts(const void *pointer, rx_journal_facts *dst, rx_error *err)
{
    const rx_restoration *state = pointer;
    rx_status status = rx_facts_model(state->options->model, dst, err);
    return status == RX_OK ? rx_facts_templates(state->simulation->templates, dst, err) : status;
}

static long units(const void *state)
{
    return ((const rx_restoration *)state)->nunits;
}

static rx_unit_place place(const void *state, long number)
{
    const rx_restoration_unit *unit = &((const rx_restoration *)state)->units[number];
    return (rx_unit_place){unit->bin, !unit->tune};
}

static rx_status do_unit(const void *pointer, long number, const rx_unit_values *done, rx_unit_values *dst,
                         rx_error *err)
{
    const rx_restoration *state = pointer;
    const rx_restoration_unit *unit = &state->units[number];
    rx_trial trial;
    rx_status status = rx_trial_make(state, unit, &trial, err);
    if (status != RX_OK)
        return status;
    status = unit->tune ? rx_restoration_tune(state, &trial, dst, err)
                        : rx_restoration_score(state, unit->bin, &trial, done, dst, err);
    rx_trial_free(&trial);
    return status;
}

/* --- results --- */

static rx_status collect_bin(const rx_restoration *state, int b, const rx_unit_values *all,
                             rx_restoration_bin *dst, rx_error *err)
{
    const rx_restoration_range *bin = &state->bins[b];
    const size_t n = (size_t)bin->nscenes;
    *dst = (rx_restoration_bin){.by_sigma = bin->by_sigma,
                                .low = bin->low,
                                .high = bin->high,
                                .other_low = bin->other_low,
                                .other_high = bin->other_high,
                                .nscenes = bin->nscenes,
                                .fwhm = RX_NEW(double, n),
                                .sigma = RX_NEW(double, n),
                                .level = RX_NEW(double, n)};
    int failed = dst->fwhm == NULL || dst->sigma == NULL || dst->level == NULL;
    for (int m = 0; m < state->nmethods; m++) {
        const rx_method *method = &state->method[m];
        rx_method_scores *scores = &dst->method[m];
        scores->psnr = RX_NEW(double, n);
        scores->ssim = RX_NEW(double, n);
        failed |= scores->psnr == NULL || scores->ssim == NULL;
        for (int metric = 0; method->tuned && metric < 2; metric++) {
            rx_tuning tuning;
            const long chosen = rx_tuning_choose(state, b, method, metric, all);
            rx_tuning_get(state, 1.0, chosen, &tuning);
            char *text = metric == 0 ? scores->settings_psnr : scores->settings_ssim;
            memcpy(text, tuning.text, sizeof tuning.text);
            *(metric == 0 ? &scores->end_psnr : &scores->end_ssim) = rx_tuning_at_end(state, chosen);
        }
    }
    if (failed)
        return rx_error_memory(err, n * sizeof(double));
    for (long u = 0; u < state->nunits; u++) {
        const rx_restoration_unit *unit = &state->units[u];
        if (unit->bin != b || unit->tune)
            continue;
        const double *v = all[u].v;
        dst->fwhm[unit->index] = v[0];
        dst->sigma[unit->index] = v[1];
        dst->level[unit->index] = v[2];
        for (int m = 0; m < state->nmethods; m++) {
            dst->method[m].psnr[unit->index] = v[3 + 2 * m];
            dst->method[m].ssim[unit->index] = v[4 + 2 * m];
        }
    }
    return RX_OK;
}

/* One plane of an example: title and pixels, which the example owns from then on. */
static float *add_plane(const rx_restoration *state, rx_restoration_example *dst, const char *title)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    float *plane = RX_NEW(float, n);
    if (plane == NULL)
        return NULL;
    snprintf(dst->title[dst->nplanes], RX_METHOD_NAME, "%s", title);
    return dst->planes[dst->nplanes++] = plane;
}

static rx_status make_example(const rx_restoration *state, int bin, long index, const rx_unit_values *all,
                              rx_restoration_example *dst, rx_error *err)
{
    const size_t bytes = (size_t)state->side * (size_t)state->side * sizeof(float);
    const rx_restoration_unit unit = {bin, 0, index};
    rx_trial trial;
    rx_status status = rx_trial_make(state, &unit, &trial, err);
    if (status != RX_OK)
        return status;
    dst->fwhm = trial.fwhm;
    dst->sigma = trial.sigma;
    float *plane = add_plane(state, dst, "BLURRED");
    if (plane != NULL)
        memcpy(plane, trial.image, bytes);
    for (int m = 0; status == RX_OK && plane != NULL && m < state->nmethods; m++)
        if (strcmp(state->method[m].name, "BLURRED") != 0 &&
            (plane = add_plane(state, dst, state->method[m].name)) != NULL)
            status = rx_restoration_picture(state, bin, &trial, &state->method[m], 0, all, plane, err);
    if (status == RX_OK && plane != NULL && (plane = add_plane(state, dst, "SHARP")) != NULL)
        memcpy(plane, trial.sharp, bytes);
    rx_trial_free(&trial);
    return status == RX_OK && plane == NULL ? rx_error_memory(err, bytes) : status;
}

/* The first scenes of bins evenly apart. */
static rx_status make_examples(const rx_restoration *state, const rx_unit_values *all,
                               rx_restoration_results *dst, rx_error *err)
{
    const int n = state->config->examples < state->nbins ? state->config->examples : state->nbins;
    rx_status status = RX_OK;
    if (n == 0)
        return RX_OK;
    dst->examples = RX_NEW(rx_restoration_example, (size_t)n);
    if (dst->examples == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *dst->examples);
    dst->nexamples = n;
    for (int e = 0; status == RX_OK && e < n; e++)
        status = make_example(state, (2 * e + 1) * state->nbins / (2 * n), 0, all, &dst->examples[e], err);
    return status;
}

static void describe(const rx_restoration *state, rx_restoration_results *dst)
{
    const rx_campaign_config *config = state->config;
    const rx_simulate_config *sim = config->sim;
    char templates[48] = "";
    if (state->simulation->templates != NULL)
        snprintf(templates, sizeof templates, ", %d templates", state->simulation->templates->n);
    dst->side = state->side;
    dst->peak = config->scene_peak;
    dst->sharp_fwhm = state->simulation->sharp_fwhm;
    dst->tune_scenes = state->ntuned > 0 ? config->tune_scenes : 0;
    const rx_model *model = state->options->model;
    const int known = model != NULL && model->bins != NULL;
    const rx_model_bin *last = known ? &model->bins[(size_t)model->nfwhm * (size_t)model->nsigma - 1] : NULL;
    for (int i = 0; i < 2; i++) {
        const rx_model_bin *bin = i == 0 && known ? model->bins : last;
        dst->fwhm_trained[i] = known ? bin->fwhm[i] : config->fwhm_trained.v[i];
        dst->level_trained[i] = known ? bin->sigma[i] : 0;
    }
    snprintf(dst->about, sizeof dst->about,
             "simulated galaxies (%s%s), the brightest one drawn to fill the scene, its companions at their "
             "own size; Moffat PSF of beta %g, %g arcsec per pixel; the brightest pixel of the sharp "
             "reference (Gaussian PSF of FWHM %g pixels) is %g, the sky 0",
             sim->galaxy_type, templates, sim->psf_beta, sim->pixel_scale, dst->sharp_fwhm, dst->peak);
    const size_t used = strlen(dst->about);
    rx_campaign_model_words(state->options, dst->about + used, sizeof dst->about - used);
}

rx_status rx_restoration_collect(const rx_restoration *state, const rx_unit_values *all,
                                 rx_restoration_results **dst, rx_error *err)
{
    rx_restoration_results *results = RX_NEW(rx_restoration_results, 1);
    if (results == NULL)
        return rx_error_memory(err, sizeof *results);
    rx_status status = RX_OK;
    describe(state, results);
    results->nmethods = state->nmethods;
    for (int m = 0; m < state->nmethods; m++)
        memcpy(results->method[m], state->method[m].name, sizeof results->method[m]);
    results->bins = RX_NEW(rx_restoration_bin, (size_t)state->nbins);
    if (results->bins == NULL)
        status = rx_error_memory(err, (size_t)state->nbins * sizeof *results->bins);
    for (int b = 0; status == RX_OK && b < state->nbins; b++) {
        results->nbins = b + 1;
        status = collect_bin(state, b, all, &results->bins[b], err);
    }
    if (status == RX_OK)
        status = make_examples(state, all, results, err);
    if (status == RX_OK)
        *dst = results;
    else
        rx_restoration_results_free(results);
    return status;
}

static rx_status report(const void *state, const rx_unit_values *all, const rx_campaign_record *record,
                        const char *folder, const char *shown, rx_log *log, rx_text *brief, rx_error *err)
{
    rx_restoration_results *results = NULL;
    rx_status status = rx_restoration_collect(state, all, &results, err);
    if (status == RX_OK)
        status = rx_restoration_report(results, record, folder, shown, log, brief, err);
    rx_restoration_results_free(results);
    return status;
}

const rx_campaign_kind rx_kind_restoration = {.name = "RESTORATION",
                                              .title = "Restoration campaign",
                                              .open = open_state,
                                              .close = close_state,
                                              .facts = facts,
                                              .units = units,
                                              .place = place,
                                              .unit = do_unit,
                                              .report = report};
