/* The keyword tables of the programs as data. */
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
#define RX_NEEDS_RESTORED "RESTORE_TYPE RL, RL_BLIND, NET or AUTO"
#define RX_NEEDS_TEMPLATES \
    "column TEMPLATE, PSF, MODEL, SPHEROID, P_REAL, P_BLEND, FLAGS_RESTORE or _INJECTED, INVENTED_TYPE DROP, TEMPLATE_COVAR_NAME, POSITIONS_NAME, QA_MAG MAG_TEMPLATE, " \
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
#undef KEY
#undef SECTION
#undef HELP
#undef SECOND
#undef NEEDS
#undef PIPELINE
#undef BACKGROUNDS
#undef STAGE
#undef TILES
#undef W
#undef STAGE_WORDS
#undef PIPELINE_WORDS
/* clang-format on */

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
                                      .check = rx_config_relations};
    return &table;
}

const rx_keytable *rx_keytable_simulate(void)
{
    static const rx_keytable table = {.program = "rextract-simulate",
                                      .title = "rextract-simulate",
                                      ROWS(simulate_rows),
                                      .size = sizeof(rx_simulate_config),
                                      .plain = RX_PLAIN_NONE,
                                      .check = rx_simulate_relations};
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
        .check = rx_campaign_relations};
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
                                      .check = rx_train_relations};
    return &table;
}

const rx_keytable *rx_keytable_survey(void)
{
    static const rx_keytable table = {.program = "rextract-survey",
                                      .title = "rextract-survey",
                                      ROWS(survey_rows),
                                      .size = sizeof(rx_survey_config),
                                      .plain = RX_PLAIN_RECORDS,
                                      .check = rx_survey_relations};
    return &table;
}
