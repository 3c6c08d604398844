/* The restoration campaign: its runs, bins and results. */
#include "lab/restoration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const rx_lab_column SCENE[] = {RX_RESTORATION_SCENE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column SCORE[] = {RX_RESTORATION_SCORE_COLUMNS(RX_LAB_COLUMN)};
static const rx_lab_column TUNING[] = {RX_RESTORATION_TUNING_COLUMNS(RX_LAB_COLUMN)};

const rx_lab_schema rx_restoration_tables[RX_RESTORATION_TABLES] = {
    [RX_RESTORATION_SCENE] = {"scene", RX_RESTORATION_SCENE_WIDTH, RX_RESTORATION_SCORE_WIDTH, SCENE, SCORE,
                              1},
    [RX_RESTORATION_TUNING] = {"tuning", RX_RESTORATION_TUNING_WIDTH, 0, TUNING, NULL, 1},
};

/* --- open --- */

/* NONE is the blurred image. RL, whose result depends on a number of iterations, is tuned per bin; beside it NONE is also
 * the blurred image through a filter, tuned as RL's is: what is gained without any deconvolution. Where RL has a flat sky, too, so
 * has NET: both are treated alike. */
static rx_status add_runs(rx_lab *lab, rx_error *err)
{
    const rx_words *words = &lab->config->restore_type;
    for (int i = 0; i < words->n; i++)
        lab->tunes |= strcmp(words->v[i], "RL") == 0;
    for (int i = 0; i < words->n; i++) {
        const int none = strcmp(words->v[i], "NONE") == 0, rl = strcmp(words->v[i], "RL") == 0;
        const int net = strcmp(words->v[i], "NET") == 0;
        rx_lab_run run = {.tuned = rl};
        snprintf(run.name, sizeof run.name, "%s", none ? "BLURRED" : "");
        RX_TRY(rx_lab_add_run(lab, words->v[i], run, err));
        if (none && lab->tunes)
            RX_TRY(rx_lab_add_run(lab, "RL", (rx_lab_run){.name = "SMOOTHED", .tuned = 1, .smooth = 1}, err));
        if (rl)
            RX_TRY(rx_lab_add_run(lab, "RL", (rx_lab_run){.name = "RL_FLAT", .tuned = 1, .flat = 1}, err));
        if (net && lab->tunes)
            RX_TRY(rx_lab_add_run(
                lab, "NET", (rx_lab_run){.name = "NET_FLAT", .tuned = 1, .flat = 1, .network = 1}, err));
    }
    return RX_OK;
}

static int bin_count(const rx_reals *range)
{
    return (int)floor(range->v[1] - range->v[0] + 1e-6) + 1;
}

/* Bins of one quantity, 1 wide, one centre per unit from the first to the last. */
static void add_bins(rx_lab *lab, int by_sigma, const rx_reals *range, const rx_reals *other,
                     const rx_ints *scenes)
{
    for (int i = 0; i < bin_count(range); i++)
        lab->bin[lab->nconditions++] = (rx_lab_bin){.by_sigma = by_sigma,
                                                    .low = fmax(range->v[0] + i - 0.5, 0),
                                                    .high = range->v[0] + i + 0.5,
                                                    .other_low = other->v[0],
                                                    .other_high = other->v[1],
                                                    .nscenes = rx_lab_size(lab, scenes)};
}

static rx_status set_bins(rx_lab *lab, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    if (config->fwhm_range.v[1] < config->fwhm_range.v[0] ||
        config->sigma_range.v[1] < config->sigma_range.v[0] ||
        config->fwhm_trained.v[1] < config->fwhm_trained.v[0] ||
        config->sigma_trained.v[1] < config->sigma_trained.v[0])
        return rx_error_set(err, RX_USAGE,
                            "FWHM_RANGE, SIGMA_RANGE, FWHM_TRAINED and SIGMA_TRAINED go from low to high");
    const size_t n = (size_t)bin_count(&config->fwhm_range) + (size_t)bin_count(&config->sigma_range);
    RX_TRY(RX_MAKE(lab->bin, n, err));
    add_bins(lab, 0, &config->fwhm_range, &config->sigma_trained, &config->scenes_fwhm);
    add_bins(lab, 1, &config->sigma_range, &config->fwhm_trained, &config->scenes_sigma);
    return RX_OK;
}

/* The population on a scene, without stars unless they were asked for, and with one galaxy at least. */
static rx_status set_simulation(rx_lab *lab, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
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
        status = rx_simulation_from_config(sim, log, &lab->sky->simulation, err);
    rx_simulate_config_free(sim);
    if (status != RX_OK)
        return status;
    rx_simulation *simulation = lab->sky->simulation;
    simulation->nthreads = 1;
    if (rx_settings_was_set(&config->settings, "SIM.STAR_COUNT") == RX_FROM_DEFAULT)
        simulation->scene.stars.count = 0;
    if (simulation->scene.galaxies.count + simulation->scene.templates.count < 1)
        *(simulation->templates != NULL && simulation->scene.templates.count > 0
              ? &simulation->scene.templates.count
              : &simulation->scene.galaxies.count) = 1;
    return RX_OK;
}

static rx_status open_bins(rx_lab *lab, rx_log *log, rx_error *err)
{
    RX_TRY(RX_MAKE(lab->sky, 1, err));
    lab->nskies = 1;
    RX_TRY(add_runs(lab, err));
    RX_TRY(set_bins(lab, err));
    RX_TRY(rx_lab_add_scene(lab, RX_SCENE_TUNING, 0, 0, err));
    RX_TRY(rx_lab_add_scene(lab, RX_SCENE_TEST, 1, 0, err));
    return set_simulation(lab, log, err);
}

static rx_status unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                      rx_lab_table *dst, rx_error *err)
{
    rx_trial trial;
    RX_TRY(rx_trial_make(lab, unit, &trial, err));
    rx_status status = lab->scene[unit->scene].id == RX_SCENE_TUNING
                           ? rx_restoration_tune(lab, &trial, dst, err)
                           : rx_restoration_score(lab, unit->condition, &trial, done, dst, err);
    rx_trial_free(&trial);
    return status;
}

static rx_status describe(rx_lab *lab, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    const rx_simulate_config *sim = config->sim;
    const size_t n = (size_t)lab->nconditions * (size_t)lab->nruns;
    const rx_model *model = lab->options->model;
    const int known = model != NULL && model->bins != NULL;
    char templates[48] = "";
    lab->tuned = rx_alloc(n, sizeof *lab->tuned);
    if (lab->tuned == NULL)
        return rx_error_memory(err, n * sizeof *lab->tuned);
    for (size_t i = 0; i < 2 * n; i++) {
        const int metric = (int)(i % 2), run = (int)(i / 2) % lab->nruns, bin = (int)(i / 2) / lab->nruns;
        rx_lab_tuned *dst = &lab->tuned[i / 2][metric];
        rx_tuning tuning;
        if (!lab->run[run].tuned)
            continue;
        const long chosen = rx_tuning_choose(lab, bin, &lab->run[run], metric, lab->values);
        rx_tuning_get(lab, 1.0, chosen, &tuning);
        dst->at_end = rx_tuning_at_end(lab, chosen);
        snprintf(dst->setting, sizeof dst->setting, "%s%s", tuning.text,
                 dst->at_end ? " (at an end of what was tried)" : "");
    }
    for (int i = 0; i < 2; i++) {
        const size_t last = known && i > 0 ? (size_t)model->nfwhm * (size_t)model->nsigma - 1 : 0;
        lab->fwhm_trained[i] = known ? model->bins[last].fwhm[i] : config->fwhm_trained.v[i];
        lab->level_trained[i] = known ? model->bins[last].sigma[i] : 0;
    }
    if (lab->sky[0].simulation->templates != NULL)
        snprintf(templates, sizeof templates, ", %d templates", lab->sky[0].simulation->templates->n);
    snprintf(lab->about, sizeof lab->about,
             "simulated galaxies (%s%s), the brightest one drawn to fill the scene, its companions at their "
             "own size; Moffat PSF of beta %g, %g arcsec per pixel; the brightest pixel of the sharp "
             "reference (Gaussian PSF of FWHM %g pixels) is %g, the sky 0",
             sim->galaxy_type, templates, sim->psf_beta, sim->pixel_scale, lab->sky[0].simulation->sharp_fwhm,
             config->scene_peak);
    rx_lab_add_model(lab, lab->about, sizeof lab->about);
    return RX_OK;
}

RX_LAB_KIND(rx_kind_restoration, .name = "RESTORATION", .title = "Restoration campaign",
            .tag = 0x726573746f7265, .most = RX_METHODS_MAX, .ntables = RX_RESTORATION_TABLES,
            .tables = rx_restoration_tables, .in_turns = 1, .open = open_bins, .unit = unit,
            .describe = describe, .name_set = rx_restoration_name_set, .report = rx_restoration_report,
            .reading = rx_restoration_reading);
