/* rextract-train: its part, and what one keyword says about another. */
#include <string.h>

#include "config/keyword.h"
#include "config/train_config.h"

#define REFUSE(NAME, ...) rx_settings_refuse(&config->settings, #NAME, err, __VA_ARGS__)

static bool is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

void rx_train_complete(rx_settings *settings)
{
    rx_train_config *config = (rx_train_config *)settings;
    config->sim = (rx_simulate_config *)settings->part[0];
}

static rx_status check_network(const rx_train_config *config, rx_error *err)
{
    for (int i = 0; i < config->kernels.n; i++)
        if (config->kernels.v[i] % 2 == 0)
            return REFUSE(KERNELS, "%d is even; give odd numbers", config->kernels.v[i]);
    return RX_OK;
}

static rx_status check_loss(const rx_train_config *config, rx_error *err)
{
    if (config->loss_idt + config->loss_rec + config->loss_rec_psf + config->loss_ffl <= 0)
        return REFUSE(LOSS_IDT, "no term of the loss trains RESTORE; give this one a weight above 0");
    return RX_OK;
}

static rx_status check_images(const rx_train_config *config, rx_error *err)
{
    if (config->patch % 4 != 0)
        return REFUSE(PATCH, "%d is no multiple of 4; give %d", config->patch, config->patch / 4 * 4 + 4);
    if (4 * config->patch_margin >= config->patch)
        return REFUSE(PATCH_MARGIN, "%d leaves less than half of an image's side of %d; give at most %d",
                      config->patch_margin, config->patch, (config->patch - 1) / 4);
    if (config->validation_images > config->bin_images)
        return REFUSE(VALIDATION_IMAGES, "%d is above BIN_IMAGES, %d; give at most that",
                      config->validation_images, config->bin_images);
    const struct {
        const char *name;
        const rx_reals *range;
    } ranges[] = {
        {"FWHM_RANGE", &config->fwhm_range},       {"SIGMA_RANGE", &config->sigma_range},
        {"BETA_RANGE", &config->beta_range},       {"PHOTON_RANGE", &config->photon_range},
        {"SMOOTHED_FWHM", &config->smoothed_fwhm},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (ranges[i].range->v[0] > ranges[i].range->v[1])
            return rx_settings_refuse(&config->settings, ranges[i].name, err,
                                      "%g is above %g; give <from>,<to>", ranges[i].range->v[0],
                                      ranges[i].range->v[1]);
    if (config->smoothed_noise + config->resampled_noise > 1)
        return REFUSE(RESAMPLED_NOISE, "%g and SMOOTHED_NOISE %g are more than all images; give at most %g",
                      config->resampled_noise, config->smoothed_noise, 1 - config->smoothed_noise);
    return RX_OK;
}

static rx_status check_ranks(const rx_train_config *config, rx_error *err)
{
    if (config->batch % config->train_ranks != 0)
        return REFUSE(BATCH, "%d images cannot be shared alike by %d training ranks; give a multiple",
                      config->batch, config->train_ranks);
    const double epoch = (double)config->grid.v[0] * config->grid.v[1] * config->bin_images;
    if (config->images_ahead < epoch)
        return REFUSE(IMAGES_AHEAD,
                      "%d is less than the %.0f images of an epoch; give that at least, better "
                      "twice as many",
                      config->images_ahead, epoch);
    return RX_OK;
}

static rx_status check_outputs(const rx_train_config *config, rx_error *err)
{
    if (is(config->model_name, config->checkpoint_name))
        return REFUSE(CHECKPOINT_NAME, "%.200s is also MODEL_NAME; give each a name of its own",
                      config->checkpoint_name);
    return RX_OK;
}

/* What makes no training images. */
static rx_status check_simulator(const rx_train_config *config, rx_error *err)
{
    const rx_simulate_config *sim = config->sim;
    if (sim->inject_image[0] != '\0')
        return rx_settings_refuse(&sim->settings, "INJECT_IMAGE", err,
                                  "has no place in a training; its images are simulated");
    if (sim->star_count + sim->galaxy_count + sim->template_count <= 0)
        return rx_settings_refuse(&sim->settings, "STAR_COUNT", err,
                                  "there are no stars, galaxies or templates to train on; give some");
    return RX_OK;
}

rx_status rx_train_relations(const rx_settings *settings, rx_error *err)
{
    const rx_train_config *config = (const rx_train_config *)settings;
    RX_TRY(check_network(config, err));
    RX_TRY(check_loss(config, err));
    RX_TRY(check_images(config, err));
    RX_TRY(check_ranks(config, err));
    RX_TRY(check_outputs(config, err));
    return check_simulator(config, err);
}

const char *rx_train_idle(const rx_settings *settings, const char *name)
{
    static const char *const informed[] = {"TIKHONOV", "RL_STEPS", "RL_STEP_PEDESTAL", NULL};
    const rx_train_config *config = (const rx_train_config *)settings;
    if (is(config->mode, "BLIND") && rx_keyword_among(informed, name))
        return "with MODE BLIND";
    if (config->rl_steps == 0 && is(name, "RL_STEP_PEDESTAL"))
        return "with RL_STEPS 0";
    if (!is(config->loss_type, "LINEAR") && is(name, "LOSS_FLOOR"))
        return "without LOSS_TYPE LINEAR";
    return NULL;
}

/* Of the simulator's keywords, those of the population decide; the rest follows from the training's own. */
const char *rx_train_sim_idle(const rx_settings *settings, const char *name)
{
    static const char *const own[] = {
        "IMAGE_NAME", "SHARP_NAME",    "TRUTH_NAME",   "TRUTH_TYPE",   "FLAG_NAME",       "IMAGE_SIZE",
        "SKY_CENTER", "SEED",          "SCENE_NUMBER", "INJECT_PLACE", "INJECT_DISTANCE", "INJECT_CONFIG",
        "PSF_TYPE",   "PSF_NAME",      "PSF_FWHM",     "PSF_BETA",     "PSF_RATIO",       "PSF_ANGLE",
        "SHARP_FWHM", "PSF_VARIATION", "NOISE_TYPE",   "SKY_LEVEL",    "NOISE_SIGMA",     "GAIN",
        "READ_NOISE", "SATUR_LEVEL",   "BAD_COLUMNS",  "COSMIC_RAYS",  "NTHREADS",        "VERBOSE_TYPE",
        NULL};
    (void)settings;
    return rx_keyword_among(own, name) ? "in a training" : NULL;
}
