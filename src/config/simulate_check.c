/* rextract-simulate: what one keyword says about another. */
#include <string.h>

#include "config/keyword.h"
#include "config/simulate_config.h"

#define REFUSE(NAME, ...) rx_settings_refuse(&config->settings, #NAME, err, __VA_ARGS__)

static bool is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

/* <from>,<to> in this order. */
static rx_status check_range(const rx_simulate_config *config, const char *name, const rx_reals *range,
                             rx_error *err)
{
    if (range->v[0] > range->v[1])
        return rx_settings_refuse(&config->settings, name, err, "%g is above %g; give <from>,<to>",
                                  range->v[0], range->v[1]);
    return RX_OK;
}

static rx_status check_field(const rx_simulate_config *config, rx_error *err)
{
    if (config->sky_center.v[1] < -90.0 || config->sky_center.v[1] > 90.0)
        return REFUSE(SKY_CENTER, "no declination is %g; give one of -90 to 90", config->sky_center.v[1]);
    return RX_OK;
}

static rx_status check_injection(const rx_simulate_config *config, rx_error *err)
{
    bool injects = config->inject_image[0] != '\0';
    if (is(config->psf_type, "AUTO") && !injects)
        return REFUSE(PSF_TYPE, "AUTO is measured on a real tile; give INJECT_IMAGE, or another PSF_TYPE");
    if (!is(config->psf_type, "MOFFAT") && !is(config->psf_type, "AUTO") && config->psf_name[0] == '\0')
        return REFUSE(PSF_NAME, "is empty; name the file that PSF_TYPE %s reads", config->psf_type);
    if (config->inject_config[0] != '\0' && !injects)
        return REFUSE(INJECT_CONFIG, "is about a real tile; give INJECT_IMAGE too");
    return RX_OK;
}

static rx_status check_noise(const rx_simulate_config *config, rx_error *err)
{
    if (config->inject_image[0] != '\0') /* the tile's own */
        return RX_OK;
    if (is(config->noise_type, "CCD") && config->gain <= 0.0)
        return REFUSE(GAIN, "0 e-/ADU is no gain for NOISE_TYPE CCD; give one above 0");
    if (config->satur_level > 0.0 && config->satur_level <= config->sky_level)
        return REFUSE(SATUR_LEVEL, "%g is not above SKY_LEVEL, %g: every pixel would be saturated",
                      config->satur_level, config->sky_level);
    return RX_OK;
}

static rx_status check_coadd(const rx_simulate_config *config, rx_error *err)
{
    bool injects = config->inject_image[0] != '\0';
    if (injects && config->weight_name[0] != '\0')
        return REFUSE(WEIGHT_NAME, "is of simulated fields; a real tile has its own weights");
    if (is(config->coadd_type, "NONE"))
        return RX_OK;
    if (config->settings.prefix[0] != '\0' || injects)
        return REFUSE(COADD_TYPE, "%s is for simulated fields of rextract-simulate alone",
                      config->coadd_type);
    if (config->coadd_scale != 0.0 && config->coadd_scale < 0.3)
        return REFUSE(COADD_SCALE, "%g is too fine; give 0.3 to 1, or 0", config->coadd_scale);
    if (!is(config->psf_type, "MOFFAT"))
        return REFUSE(PSF_TYPE, "%s is a PSF on pixels of the image, and frames have others; give MOFFAT",
                      config->psf_type);
    return RX_OK;
}

static rx_status check_objects(const rx_simulate_config *config, rx_error *err)
{
    const struct {
        const char *name;
        const rx_reals *range;
    } ranges[] = {
        {"STAR_MAG", &config->star_mag},
        {"PAIR_DISTANCE", &config->pair_distance},
        {"GALAXY_MAG", &config->galaxy_mag},
        {"TEMPLATE_MAG", &config->template_mag},
    };
    rx_status status = RX_OK;
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0] && status == RX_OK; i++)
        status = check_range(config, ranges[i].name, ranges[i].range, err);
    if (status == RX_OK && config->template_count > 0.0 && config->template_name[0] == '\0')
        status = REFUSE(TEMPLATE_NAME, "is empty; name the cut-outs that TEMPLATE_COUNT asks for");
    return status;
}

/* Each output has a file of its own. */
static rx_status check_outputs(const rx_simulate_config *config, rx_error *err)
{
    const struct {
        const char *name, *file;
    } outputs[] = {
        {"IMAGE_NAME", config->image_name},   {"SHARP_NAME", config->sharp_name},
        {"TRUTH_NAME", config->truth_name},   {"FLAG_NAME", config->flag_name},
        {"WEIGHT_NAME", config->weight_name},
    };
    for (size_t i = 1; i < sizeof outputs / sizeof outputs[0]; i++)
        for (size_t j = 0; j < i; j++)
            if (outputs[i].file[0] != '\0' && is(outputs[i].file, outputs[j].file))
                return rx_settings_refuse(&config->settings, outputs[i].name, err,
                                          "%.200s is also %s; give each output a name of its own",
                                          outputs[i].file, outputs[j].name);
    return RX_OK;
}

rx_status rx_simulate_relations(const rx_settings *settings, rx_error *err)
{
    const rx_simulate_config *config = (const rx_simulate_config *)settings;
    RX_TRY(check_field(config, err));
    RX_TRY(check_injection(config, err));
    RX_TRY(check_noise(config, err));
    RX_TRY(check_coadd(config, err));
    RX_TRY(check_objects(config, err));
    return check_outputs(config, err);
}

const char *rx_simulate_idle(const rx_settings *settings, const char *name)
{
    static const char *const outputs[] = {
        "IMAGE_NAME",   "SHARP_NAME", "TRUTH_NAME", "TRUTH_TYPE",   "FLAG_NAME", "WEIGHT_NAME",
        "SCENE_NUMBER", "SEED",       "NTHREADS",   "VERBOSE_TYPE", NULL};
    static const char *const field[] = {"IMAGE_SIZE",  "SKY_CENTER", "NOISE_TYPE",  "SKY_LEVEL",
                                        "NOISE_SIGMA", "READ_NOISE", "SATUR_LEVEL", "BAD_COLUMNS",
                                        "COSMIC_RAYS", NULL};
    static const char *const injection[] = {"INJECT_PLACE", "INJECT_DISTANCE", NULL};
    static const char *const coadd[] = {"COADD_FRAMES", "COADD_SCALE", "COADD_PIXFRAC", "COADD_UNEVEN", NULL};
    const rx_simulate_config *config = (const rx_simulate_config *)settings;
    bool injects = config->inject_image[0] != '\0';
    if (settings->prefix[0] != '\0' && rx_keyword_among(outputs, name))
        return "in a campaign";
    if (injects && rx_keyword_among(field, name))
        return "with INJECT_IMAGE";
    if (is(config->coadd_type, "NONE") && rx_keyword_among(coadd, name))
        return "with COADD_TYPE NONE";
    return !injects && rx_keyword_among(injection, name) ? "without INJECT_IMAGE" : NULL;
}
