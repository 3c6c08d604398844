/* rextract: what one keyword says about another. */
#include <string.h>

#include "config/config_fields.h"
#include "config/keyword.h"

#define REFUSE(NAME, ...) rx_settings_refuse(&config->settings, #NAME, err, __VA_ARGS__)

static bool is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

static bool has(const rx_words *list, const char *word)
{
    for (int i = 0; i < list->n; i++)
        if (is(list->v[i], word))
            return true;
    return false;
}

static rx_status check_restorers(const rx_config *config, rx_error *err)
{
    const rx_words *list = &config->restore_type;
    for (int i = 0; i < list->n; i++)
        for (int j = 0; j < i; j++)
            if (is(list->v[i], list->v[j]))
                return REFUSE(RESTORE_TYPE, "%s is named twice; name each restorer once", list->v[i]);
    if (!config->restore_fallback && is(config->out_of_domain, "RL"))
        return REFUSE(RESTORE_FALLBACK,
                      "N forbids what OUT_OF_DOMAIN RL asks for; give OUT_OF_DOMAIN WARN or FAIL");
    return RX_OK;
}

static rx_status check_images(const rx_config *config, rx_error *err)
{
    const rx_words *checks = &config->checkimage_type;
    const rx_words *weights = &config->weight_type;
    int wanted = 0;
    for (int i = 0; i < checks->n; i++)
        if (!is(checks->v[i], "NONE"))
            wanted = i + 1;
    if (wanted > config->checkimage_name.n)
        return REFUSE(CHECKIMAGE_NAME,
                      "names %d file(s) for %d check-image(s) of CHECKIMAGE_TYPE; give one each",
                      config->checkimage_name.n, wanted);
    bool maps = has(weights, "MAP_RMS") || has(weights, "MAP_VAR") || has(weights, "MAP_WEIGHT");
    if (maps && config->weight_image.n == 0)
        return REFUSE(WEIGHT_IMAGE, "is empty; name the weight map that WEIGHT_TYPE asks for");
    if (is(config->detect_type, "PHOTO"))
        return REFUSE(DETECT_TYPE, "PHOTO (photographic plates) is not offered; give CCD");
    return RX_OK;
}

static rx_status check_limits(const rx_config *config, rx_error *err)
{
    if (config->memory_pixstack_max < config->memory_pixstack)
        return REFUSE(MEMORY_PIXSTACK_MAX, "%d is below MEMORY_PIXSTACK, %d; give at least that",
                      config->memory_pixstack_max, config->memory_pixstack);
    if (config->net_block % 4 != 0)
        return REFUSE(NET_BLOCK, "%d is no multiple of 4; give %d", config->net_block,
                      (config->net_block + 2) / 4 * 4);
    if (config->deblend_maxobj_max < config->deblend_maxobj)
        return REFUSE(DEBLEND_MAXOBJ_MAX, "%d is below DEBLEND_MAXOBJ, %d; give at least that",
                      config->deblend_maxobj_max, config->deblend_maxobj);
    return RX_OK;
}

static rx_status check_report(const rx_config *config, rx_error *err)
{
    const double *range = config->qa_mag_range.v;
    if (config->qa_gates[0] != '\0' && config->reference_name[0] == '\0')
        return REFUSE(QA_GATES, "needs a reference catalogue; give REFERENCE_NAME too");
    if (config->reference_columns.n == 1 || config->reference_columns.n == 2)
        return REFUSE(REFERENCE_COLUMNS, "has %d item(s), needs <x>,<y>,<magnitude or flux>[,<error>]",
                      config->reference_columns.n);
    if (range[2] <= 0.0)
        return REFUSE(QA_MAG_RANGE, "the step %g must be above 0", range[2]);
    if (range[0] > range[1])
        return REFUSE(QA_MAG_RANGE, "%g is above %g; give <low>,<high>,<step>", range[0], range[1]);
    return RX_OK;
}

static rx_status check_self(const rx_config *config, rx_error *err)
{
    const rx_reals *mag = &config->self_check_mag;
    if (config->self_check_galaxies < 0 && config->self_check_galaxies != -1)
        return REFUSE(SELF_CHECK_GALAXIES, "%g is no share; give 0 to 1, or -1 for that of the tile",
                      config->self_check_galaxies);
    if (mag->n == 1)
        return REFUSE(SELF_CHECK_MAG, "has 1 item, needs <from>,<to>, or none");
    if (mag->n == 2 && mag->v[0] > mag->v[1])
        return REFUSE(SELF_CHECK_MAG, "%g is above %g; give <from>,<to>", mag->v[0], mag->v[1]);
    return RX_OK;
}

rx_status rx_config_relations(const rx_settings *settings, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    RX_TRY(check_restorers(config, err));
    RX_TRY(check_images(config, err));
    RX_TRY(check_limits(config, err));
    RX_TRY(check_report(config, err));
    return check_self(config, err);
}

/* A campaign decides itself which restorers run, on how many threads, and what is written. */
const char *rx_config_idle(const rx_settings *settings, const char *name)
{
    static const char *const outputs[] = {"CATALOG_NAME",
                                          "CATALOG_TYPE",
                                          "RESTORE_TYPE",
                                          "CHECKIMAGE_TYPE",
                                          "CHECKIMAGE_NAME",
                                          "NTHREADS",
                                          "VERBOSE_TYPE",
                                          "REFERENCE_NAME",
                                          "QA_NAME",
                                          "QA_GATES",
                                          "SELF_CHECK",
                                          "BLANK_CHECK",
                                          NULL};
    return settings->prefix[0] != '\0' && rx_keyword_among(outputs, name) ? "in a campaign" : NULL;
}
