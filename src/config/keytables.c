/* The keyword tables of the programs as data, and what one keyword of a program says about another; what a row says of its own
 * value: keyword.c. */
#include <stdio.h>
#include <string.h>

#include "config/config_fields.h"
#include "config/keyword.h"
#include "data/restorers.h"

/* clang-format off */
#define NOWORDS NULL
#define TEXT NULL, .role = RX_FILE_TEXT
#define READS NULL, .role = RX_FILE_READS
#define SEARCHED READS, .search = RX_SEARCH_FOLDERS
#define SEARCHED_OR_BUILT_IN READS, .search = RX_SEARCH_BUILT_IN
#define SEARCHED_INSTALLED READS, .search = RX_SEARCH_INSTALLED
#define WRITES NULL, .role = RX_FILE_WRITES
#define WRITES_EACH WRITES, .each_restorer = true
#define FOLDER NULL, .role = RX_FILE_FOLDER
#define WORDLIST(...) ((const char *const[]){__VA_ARGS__, NULL})
#define ONCE(...) WORDLIST(__VA_ARGS__), .once = true
#define RANGE NULL, .ordered = true
#define PIPELINE_WORDS WORDLIST
#define STAGE_WORDS WORDLIST
#define W(word, value) word
#define HELP(help_, ...) help_
#define SECOND(help_, needs_, ...) needs_ /* what the keyword fills is for others */
#define NEEDS(text) text
#define PIPELINE(...) NULL
#define BACKGROUNDS(...) NULL
#define STAGE(...) NULL
#define TILES(...) NULL
#define RX_NEEDS_RESTORED "RESTORE_TYPE RL, RL_BLIND, NET, FILE or AUTO"
#define RX_NEEDS_TEMPLATES \
    "column TEMPLATE, PSF, MODEL, SPHEROID, P_REAL, P_BLEND, FLAGS_RESTORE or _INJECTED, PRECISION_TARGET, TEMPLATE_COVAR_NAME, POSITIONS_NAME, QA_MAG MAG_TEMPLATE, " \
    "CHECKIMAGE_TYPE TEMPLATE_MODEL, TEMPLATE_RESIDUAL or TEMPLATE_CHI"
#define RX_NEEDS_PSF \
    RX_NEEDS_RESTORED ", FILTER_TYPE AUTO, SELF_CHECK Y, QA_TYPE TILE, CHECKIMAGE_TYPE PSF, " RX_NEEDS_TEMPLATES
#define RX_NEEDS_ASSOC "column VECTOR_ASSOC or NUMBER_ASSOC"
#define SECTION(id, title) {.kind = RX_KIND_SECTION, .name = (title), .help = ""},
#define KEY(kind_, NAME, field, initial_, low_, high_, nmin_, nmax_, words_, status_, level_, ...)            \
    {.kind = RX_KIND_##kind_, .name = #NAME, .offset = offsetof(struct_of_table, field),                       \
     .initial = (initial_), .low = (low_), .high = (high_), .nmin = (nmin_), .nmax = (nmax_),                  \
     .words = words_, .status = RX_STATUS_##status_, .level = RX_LEVEL_##level_, .help = HELP(__VA_ARGS__, ), \
     .needs = SECOND(__VA_ARGS__, NULL, )},

#define struct_of_table rx_config
static const rx_keyword rextract_rows[] = {
#include "config/keys.def"
};
#undef struct_of_table

#define struct_of_table rx_simulate_config
static const rx_keyword simulate_rows[] = {
#include "config/simulate.def"
};
#undef struct_of_table

#define struct_of_table rx_campaign_config
static const rx_keyword campaign_rows[] = {
#include "config/campaign.def"
};
#undef struct_of_table

#define struct_of_table rx_train_config
static const rx_keyword train_rows[] = {
#include "config/train.def"
};
#undef struct_of_table

#define struct_of_table rx_survey_config
static const rx_keyword survey_rows[] = {
#include "config/survey.def"
};
#undef struct_of_table
/* clang-format on */

/* --- relations --- */

#define REFUSE(NAME, ...) rx_settings_refuse(&config->settings, #NAME, err, __VA_ARGS__)

static bool is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

/* --- rextract --- */

static rx_status check_config(const rx_settings *settings, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    int images = 0; /* names that check-images need */
    bool maps = false;
    if (!config->restore_fallback && is(config->out_of_domain, "RL"))
        return REFUSE(RESTORE_FALLBACK,
                      "N forbids what OUT_OF_DOMAIN RL asks for; give OUT_OF_DOMAIN WARN or FAIL");
    if (config->net_block % 4 != 0)
        return REFUSE(NET_BLOCK, "%d is no multiple of 4; give %d", config->net_block,
                      (config->net_block + 2) / 4 * 4);
    for (int i = 0; i < config->checkimage_type.n; i++)
        if (!is(config->checkimage_type.v[i], "NONE"))
            images = i + 1;
    if (images > config->checkimage_name.n)
        return REFUSE(CHECKIMAGE_NAME,
                      "names %d file(s) for %d check-image(s) of CHECKIMAGE_TYPE; give one each",
                      config->checkimage_name.n, images);
    for (int i = 0; i < config->weight_type.n; i++)
        maps |= strncmp(config->weight_type.v[i], "MAP_", 4) == 0;
    if (maps && config->weight_image.n == 0)
        return REFUSE(WEIGHT_IMAGE, "is empty; name the weight map that WEIGHT_TYPE asks for");
    if (is(config->detect_type, "PHOTO"))
        return REFUSE(DETECT_TYPE, "PHOTO (photographic plates) is not offered; give CCD");
    if (config->qa_gates[0] != '\0' && config->reference_name[0] == '\0')
        return REFUSE(QA_GATES, "needs a reference catalogue; give REFERENCE_NAME too");
    if (config->reference_columns.n == 1 || config->reference_columns.n == 2)
        return REFUSE(REFERENCE_COLUMNS, "has %d item(s), needs <x>,<y>,<magnitude or flux>[,<error>]",
                      config->reference_columns.n);
    if (config->self_check_galaxies < 0 && config->self_check_galaxies != -1)
        return REFUSE(SELF_CHECK_GALAXIES, "%g is no share; give 0 to 1, or -1 for that of the tile",
                      config->self_check_galaxies);
    if (config->self_check_mag.n == 1)
        return REFUSE(SELF_CHECK_MAG, "has 1 item, needs <from>,<to>, or none");
    return RX_OK;
}

static rx_status take_way(rx_settings *settings, const char *key, char *value, rx_error *err)
{
    const int row = rx_keyword_find(settings->table, key);
    return settings->origin[row] == RX_FROM_DEFAULT
               ? rx_keyword_assign(settings, row, &value, 1, (rx_place){0}, NULL, err)
               : RX_OK;
}

/* A survey's file that does without restoration means SExtractor's thresholds, filter and sky where it does not name its own; and
 * who names a filter, or a threshold, means sigmas of a pixel behind SExtractor's. */
static rx_status take_survey_ways(rx_settings *settings, rx_error *err)
{
    static const char *const sextractors[] = {"FILTER", "FILTER_NAME", "DETECT_THRESH", "THRESH_TYPE"};
    const rx_config *config = (const rx_config *)settings;
    bool conv = false;
    if (settings->repeated.n > 0)
        return RX_OK;
    if (settings->file != NULL && config->restore_type.n == 1 && is(config->restore_type.v[0], "NONE")) {
        RX_TRY(take_way(settings, "THRESH_TYPE", "RELATIVE", err));
        RX_TRY(take_way(settings, "BACK_PASSES", "1", err));
        conv = true;
    }
    for (size_t i = 0; i < sizeof sextractors / sizeof *sextractors; i++)
        conv |= settings->origin[rx_keyword_find(settings->table, sextractors[i])] != RX_FROM_DEFAULT;
    if (conv)
        RX_TRY(take_way(settings, "FILTER_TYPE", "CONV", err));
    if (is(config->filter_type, "CONV"))
        return take_way(settings, "DETECT_THRESH", "1.5", err);
    /* P_REAL decides where the list ends, and is above 0.5 nowhere but in crowds for less */
    return config->precision_target > 0.0 ? take_way(settings, "DETECT_THRESH", "3.0", err) : RX_OK;
}

/* --- rextract-simulate --- */

static rx_status check_simulate(const rx_settings *settings, rx_error *err)
{
    const rx_simulate_config *config = (const rx_simulate_config *)settings;
    if (config->sky_center.v[1] < -90.0 || config->sky_center.v[1] > 90.0)
        return REFUSE(SKY_CENTER, "no declination is %g; give one of -90 to 90", config->sky_center.v[1]);
    const bool injects = config->inject_image[0] != '\0';
    if (is(config->psf_type, "AUTO") && !injects)
        return REFUSE(PSF_TYPE, "AUTO is measured on a real tile; give INJECT_IMAGE, or another PSF_TYPE");
    if (!is(config->psf_type, "MOFFAT") && !is(config->psf_type, "AUTO") && config->psf_name[0] == '\0')
        return REFUSE(PSF_NAME, "is empty; name the file that PSF_TYPE %s reads", config->psf_type);
    if (config->inject_config[0] != '\0' && !injects)
        return REFUSE(INJECT_CONFIG, "is about a real tile; give INJECT_IMAGE too");
    if (!injects && is(config->noise_type, "CCD") && config->gain <= 0.0)
        return REFUSE(GAIN, "0 e-/ADU is no gain for NOISE_TYPE CCD; give one above 0");
    if (!injects && config->satur_level > 0.0 && config->satur_level <= config->sky_level)
        return REFUSE(SATUR_LEVEL, "%g is not above SKY_LEVEL, %g: every pixel would be saturated",
                      config->satur_level, config->sky_level);
    if (injects && config->weight_name[0] != '\0')
        return REFUSE(WEIGHT_NAME, "is of simulated fields; a real tile has its own weights");
    const bool coadds = !is(config->coadd_type, "NONE");
    if (coadds && (settings->prefix[0] != '\0' || injects))
        return REFUSE(COADD_TYPE, "%s is for simulated fields of rextract-simulate alone",
                      config->coadd_type);
    if (coadds && config->coadd_scale != 0.0 && config->coadd_scale < 0.3)
        return REFUSE(COADD_SCALE, "%g is too fine; give 0.3 to 1, or 0", config->coadd_scale);
    if (coadds && !is(config->psf_type, "MOFFAT"))
        return REFUSE(PSF_TYPE, "%s is a PSF on pixels of the image, and frames have others; give MOFFAT",
                      config->psf_type);
    if (config->template_count > 0.0 && config->template_name[0] == '\0')
        return REFUSE(TEMPLATE_NAME, "is empty; name the cut-outs that TEMPLATE_COUNT asks for");
    return RX_OK;
}

/* --- rextract-validate --- */

enum { MAX_SHARDS = 10000 };

rx_status rx_campaign_config_shard(const rx_campaign_config *config, int *k, int *n, rx_error *err)
{
    char more;
    if (strspn(config->shard, "0123456789/") != strlen(config->shard) ||
        sscanf(config->shard, "%5d/%5d%c", k, n, &more) != 2 || *k < 1 || *n < 1 || *n > MAX_SHARDS)
        return REFUSE(SHARD, "'%.40s' is not k/n; give for instance 2/3, n at most %d", config->shard,
                      MAX_SHARDS);
    if (*k > *n)
        return REFUSE(SHARD, "there is no part %d of %d; give 1/%d to %d/%d", *k, *n, *n, *n, *n);
    return RX_OK;
}

static rx_status check_campaign(const rx_settings *settings, rx_error *err)
{
    const rx_campaign_config *config = (const rx_campaign_config *)settings;
    const rx_simulate_config *sim = config->sim;
    const double *mag = config->magnitudes.v;
    const bool restores = is(config->campaign_type, "RESTORATION");
    const struct {
        const char *name;
        int n;
    } sizes[] = {{"SCENES_FWHM", config->scenes_fwhm.n},
                 {"SCENES_SIGMA", config->scenes_sigma.n},
                 {"TILES", config->tiles.n}};
    int k, n;
    RX_TRY(rx_campaign_config_shard(config, &k, &n, err));
    if (mag[2] <= 0.0)
        return REFUSE(MAGNITUDES, "the step %g must be above 0", mag[2]);
    if ((mag[1] - mag[0]) / mag[2] > 1000.0)
        return REFUSE(MAGNITUDES, "more than 1000 sets of stars; give a larger step");
    for (int i = 0; i < config->fields.n; i++)
        if (is(config->fields.v[i], "INJECTED") && !restores && config->tile_name[0] == '\0')
            return REFUSE(TILE_NAME,
                          "is empty; name the real tile that stars are added to (FIELDS INJECTED)");
    /* what the simulator cannot do as part of a campaign */
    if (sim->inject_image[0] != '\0')
        return rx_settings_refuse(&sim->settings, "INJECT_IMAGE", err,
                                  "has no place in a campaign; give FIELDS INJECTED and TILE_NAME");
    if (restores && !is(sim->psf_type, "MOFFAT"))
        return rx_settings_refuse(&sim->settings, "PSF_TYPE", err,
                                  "%s has no FWHM that a RESTORATION campaign could vary; give MOFFAT",
                                  sim->psf_type);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        if (is(config->size, "PAPER") && sizes[i].n < 2)
            return rx_settings_refuse(
                settings, sizes[i].name, err,
                "has no second number, which SIZE PAPER asks for; give <small>,<paper>");
    return RX_OK;
}

/* --- rextract-train --- */

static rx_status check_train(const rx_settings *settings, rx_error *err)
{
    const rx_train_config *config = (const rx_train_config *)settings;
    const rx_simulate_config *sim = config->sim;
    for (int i = 0; i < config->kernels.n; i++)
        if (config->kernels.v[i] % 2 == 0)
            return REFUSE(KERNELS, "%d is even; give odd numbers", config->kernels.v[i]);
    if (config->loss_idt + config->loss_rec + config->loss_rec_psf + config->loss_light + config->loss_ffl <=
        0)
        return REFUSE(LOSS_IDT, "no term of the loss trains RESTORE; give this one a weight above 0");
    if (config->patch % 4 != 0)
        return REFUSE(PATCH, "%d is no multiple of 4; give %d", config->patch, config->patch / 4 * 4 + 4);
    if (config->field_patches > 16384 / config->patch)
        return REFUSE(FIELD_PATCHES,
                      "fields of %d images of %d pixels are too large; at most %d are possible",
                      config->field_patches, config->patch, 16384 / config->patch);
    if (4 * config->patch_margin >= config->patch)
        return REFUSE(PATCH_MARGIN, "%d leaves less than half of an image's side of %d; give at most %d",
                      config->patch_margin, config->patch, (config->patch - 1) / 4);
    if (config->validation_images > config->bin_images)
        return REFUSE(VALIDATION_IMAGES, "%d is above BIN_IMAGES, %d; give at most that",
                      config->validation_images, config->bin_images);
    if (config->smoothed_noise + config->resampled_noise > 1)
        return REFUSE(RESAMPLED_NOISE, "%g and SMOOTHED_NOISE %g are more than all images; give at most %g",
                      config->resampled_noise, config->smoothed_noise, 1 - config->smoothed_noise);
    if (sim->inject_image[0] != '\0')
        return rx_settings_refuse(&sim->settings, "INJECT_IMAGE", err,
                                  "has no place in a training; its images are simulated");
    if (sim->star_count + sim->galaxy_count + sim->template_count <= 0)
        return rx_settings_refuse(&sim->settings, "STAR_COUNT", err,
                                  "there are no stars, galaxies or templates to train on; give some");
    return RX_OK;
}

/* --- rextract-survey --- */

static rx_status check_survey(const rx_settings *settings, rx_error *err)
{
    const rx_survey_config *config = (const rx_survey_config *)settings;
    const double low = config->mag_range.v[0], high = config->mag_range.v[1];
    if (high < low || (high > low && (2 * low != (int)(2 * low) || 2 * high != (int)(2 * high))))
        return rx_settings_refuse(settings, "MAG_RANGE", err,
                                  "%g,%g is no range of half magnitudes; give two in order, such as 18,21.5",
                                  low, high);
    return RX_OK;
}

/* --- tables --- */

#define ROWS(array) .rows = (array), .nrows = (int)(sizeof(array) / sizeof(array)[0])

/* A campaign and a training decide themselves on these. */
static const char *const of_campaign[] = {"CATALOG_TYPE", "RESTORE_TYPE",   "CHECKIMAGE_TYPE", "NTHREADS",
                                          "VERBOSE_TYPE", "REFERENCE_NAME", "QA_TYPE",         "WRITE_XML",
                                          "QA_GATES",     "SELF_CHECK",     "BLANK_CHECK",     NULL};
static const char *const sky_of_campaign[] = {"TRUTH_TYPE",
                                              "SCENE_NUMBER",
                                              "SEED",
                                              "NOISE_SEED",
                                              "COADD_FRAMES",
                                              "COADD_SCALE",
                                              "COADD_PIXFRAC",
                                              "COADD_UNEVEN",
                                              "INJECT_PLACE",
                                              "INJECT_DISTANCE",
                                              "NTHREADS",
                                              "VERBOSE_TYPE",
                                              NULL};
static const char *const sky_of_training[] = {
    "TRUTH_TYPE",  "IMAGE_SIZE",   "SKY_CENTER", "SEED",        "SCENE_NUMBER",    "INJECT_PLACE",
    "PSF_TYPE",    "PSF_NAME",     "PSF_FWHM",   "PSF_BETA",    "INJECT_DISTANCE", "INJECT_CONFIG",
    "PSF_RATIO",   "PSF_ANGLE",    "SHARP_FWHM", "NOISE_TYPE",  "PSF_VARIATION",   "SKY_LEVEL",
    "NOISE_SIGMA", "GAIN",         "READ_NOISE", "SATUR_LEVEL", "BAD_COLUMNS",     "COSMIC_RAYS",
    "NTHREADS",    "VERBOSE_TYPE", NULL};

const rx_keytable *rx_keytable_rextract(void)
{
    static const rx_keytable table = {.program = "rextract",
                                      .title = "Rextract",
                                      ROWS(rextract_rows),
                                      .size = sizeof(rx_config),
                                      .plain = RX_PLAIN_IMAGES,
                                      .default_file = "default.sex",
                                      .settle = take_survey_ways,
                                      .check = check_config};
    return &table;
}

const rx_keytable *rx_keytable_simulate(void)
{
    static const rx_keytable table = {.program = "rextract-simulate",
                                      .title = "rextract-simulate",
                                      ROWS(simulate_rows),
                                      .size = sizeof(rx_simulate_config),
                                      .plain = RX_PLAIN_NONE,
                                      .check = check_simulate};
    return &table;
}

const rx_keytable *rx_keytable_validate(void)
{
    static const rx_keytable table = {
        .program = "rextract-validate",
        .title = "rextract-validate",
        ROWS(campaign_rows),
        .size = sizeof(rx_campaign_config),
        .plain = RX_PLAIN_FILE,
        .part = {{"SIM.", rx_keytable_simulate, offsetof(rx_campaign_config, sim), sky_of_campaign,
                  "in a campaign"},
                 {"STAGE.", rx_keytable_rextract, offsetof(rx_campaign_config, stage), of_campaign,
                  "in a campaign"}},
        .check = check_campaign};
    return &table;
}

const rx_keytable *rx_keytable_train(void)
{
    static const rx_keytable table = {.program = "rextract-train",
                                      .title = "rextract-train",
                                      ROWS(train_rows),
                                      .size = sizeof(rx_train_config),
                                      .plain = RX_PLAIN_FILE,
                                      .describes = true,
                                      .part = {{"SIM.", rx_keytable_simulate, offsetof(rx_train_config, sim),
                                                sky_of_training, "in a training"}},
                                      .check = check_train};
    return &table;
}

const rx_keytable *rx_keytable_survey(void)
{
    static const rx_keytable table = {.program = "rextract-survey",
                                      .title = "rextract-survey",
                                      ROWS(survey_rows),
                                      .size = sizeof(rx_survey_config),
                                      .plain = RX_PLAIN_RECORDS,
                                      .check = check_survey};
    return &table;
}
