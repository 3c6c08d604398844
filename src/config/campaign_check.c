/* rextract-validate: its parts, and what one keyword says about another. */
#include <stdlib.h>
#include <string.h>

#include "config/campaign_config.h"
#include "config/keyword.h"

#define REFUSE(NAME, ...) rx_settings_refuse(&config->settings, #NAME, err, __VA_ARGS__)

enum { MAX_SHARDS = 10000 };

static bool is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

void rx_campaign_complete(rx_settings *settings)
{
    rx_campaign_config *config = (rx_campaign_config *)settings;
    config->sim = (rx_simulate_config *)settings->part[0];
    config->stage = (rx_config *)settings->part[1];
}

/* A whole number of 1 to MAX_SHARDS at *text, which moves behind it; 0 when there is none. */
static int read_count(const char **text)
{
    int value = 0;
    const char *c = *text;
    for (; *c >= '0' && *c <= '9' && value <= MAX_SHARDS; c++)
        value = 10 * value + (*c - '0');
    *text = c;
    return value <= MAX_SHARDS ? value : 0;
}

rx_status rx_campaign_config_shard(const rx_campaign_config *config, int *k, int *n, rx_error *err)
{
    const char *text = config->shard;
    *k = read_count(&text);
    *n = 0;
    if (*k > 0 && *text == '/') {
        text++;
        *n = read_count(&text);
    }
    if (*n < 1 || *text != '\0')
        return REFUSE(SHARD, "'%.40s' is not k/n; give for instance 2/3, n at most %d", config->shard,
                      MAX_SHARDS);
    if (*k > *n)
        return REFUSE(SHARD, "there is no part %d of %d; give 1/%d to %d/%d", *k, *n, *n, *n, *n);
    return RX_OK;
}

/* Each word once. */
static rx_status check_words(const rx_campaign_config *config, const char *name, const rx_words *list,
                             rx_error *err)
{
    for (int i = 0; i < list->n; i++)
        for (int j = 0; j < i; j++)
            if (is(list->v[i], list->v[j]))
                return rx_settings_refuse(&config->settings, name, err, "%s is named twice; name each once",
                                          list->v[i]);
    return RX_OK;
}

static rx_status check_ranges(const rx_campaign_config *config, rx_error *err)
{
    const struct {
        const char *name;
        const rx_reals *range;
    } ranges[] = {
        {"FWHM_RANGE", &config->fwhm_range},     {"SIGMA_RANGE", &config->sigma_range},
        {"FWHM_TRAINED", &config->fwhm_trained}, {"SIGMA_TRAINED", &config->sigma_trained},
        {"MAGNITUDES", &config->magnitudes},     {"SHRED_SNR", &config->shred_snr},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        if (ranges[i].range->v[0] > ranges[i].range->v[1])
            return rx_settings_refuse(&config->settings, ranges[i].name, err,
                                      "%g is above %g; give <from>,<to>%s", ranges[i].range->v[0],
                                      ranges[i].range->v[1], ranges[i].range->n > 2 ? ",<step>" : "");
    const double *mag = config->magnitudes.v;
    if (mag[2] <= 0.0)
        return REFUSE(MAGNITUDES, "the step %g must be above 0", mag[2]);
    if ((mag[1] - mag[0]) / mag[2] > 1000.0)
        return REFUSE(MAGNITUDES, "more than 1000 sets of stars; give a larger step");
    return RX_OK;
}

static bool errors_told(const rx_reals *list)
{
    for (int i = 0; i < list->n; i++)
        if (list->v[i] != 0.0)
            return true;
    return false;
}

static rx_status check_fields(const rx_campaign_config *config, rx_error *err)
{
    const bool fluxes = is(config->campaign_type, "FLUXES");
    const rx_words *where = fluxes ? &config->flux_scenes : &config->fields;
    bool injects = false;
    if (is(config->campaign_type, "RESTORATION"))
        return RX_OK;
    for (int i = 0; i < where->n; i++)
        injects |= is(where->v[i], "INJECTED");
    if (injects && config->tile_name[0] == '\0')
        return REFUSE(TILE_NAME, "is empty; name the real tile that %s are added to (%s INJECTED)",
                      fluxes ? "objects" : "stars", fluxes ? "FLUX_SCENES" : "FIELDS");
    if (fluxes && injects &&
        (where->n > 1 || config->seeing.n > 0 || errors_told(&config->psf_error) ||
         errors_told(&config->sky_error) || errors_told(&config->noise_error)))
        return REFUSE(FLUX_SCENES, "INJECTED stands alone: SEEING, PSF_ERROR, SKY_ERROR, NOISE_ERROR and the "
                                   "other scenes are of simulated tiles; leave them out, or INJECTED");
    return RX_OK;
}

/* What the simulator cannot do as part of a campaign. */
static rx_status check_simulator(const rx_campaign_config *config, rx_error *err)
{
    const rx_simulate_config *sim = config->sim;
    if (sim->inject_image[0] != '\0')
        return rx_settings_refuse(&sim->settings, "INJECT_IMAGE", err,
                                  "has no place in a campaign; give FIELDS INJECTED and TILE_NAME");
    if (is(config->campaign_type, "RESTORATION") && !is(sim->psf_type, "MOFFAT"))
        return rx_settings_refuse(&sim->settings, "PSF_TYPE", err,
                                  "%s has no FWHM that a RESTORATION campaign could vary; give MOFFAT",
                                  sim->psf_type);
    return RX_OK;
}

static rx_status check_small_and_paper(const rx_campaign_config *config, rx_error *err)
{
    const struct {
        const char *name;
        int n;
    } sizes[] = {
        {"SCENES_FWHM", config->scenes_fwhm.n},
        {"SCENES_SIGMA", config->scenes_sigma.n},
        {"TILES", config->tiles.n},
    };
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        if (is(config->size, "PAPER") && sizes[i].n < 2)
            return rx_settings_refuse(
                &config->settings, sizes[i].name, err,
                "has no second number, which SIZE PAPER asks for; give <small>,<paper>");
    return RX_OK;
}

rx_status rx_campaign_relations(const rx_settings *settings, rx_error *err)
{
    const rx_campaign_config *config = (const rx_campaign_config *)settings;
    int k, n;
    RX_TRY(rx_campaign_config_shard(config, &k, &n, err));
    RX_TRY(check_words(config, "RESTORE_TYPE", &config->restore_type, err));
    RX_TRY(check_words(config, "FIELDS", &config->fields, err));
    RX_TRY(check_words(config, "FLUX_SCENES", &config->flux_scenes, err));
    RX_TRY(check_words(config, "FLUXES", &config->fluxes, err));
    RX_TRY(check_ranges(config, err));
    RX_TRY(check_fields(config, err));
    RX_TRY(check_simulator(config, err));
    return check_small_and_paper(config, err);
}
