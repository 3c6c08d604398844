/* Settings of all programs: files and command lines read, parts under prefixes, relations, keywords given in vain, copies, dumps. */
#include "../scratch.h"
#include "config/config_fields.h"
#include "config/idle.h"
#include "config/keyword.h"

static rx_config *defaults(void)
{
    rx_config *config = NULL;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    return config;
}

static rx_campaign_config *campaign(void)
{
    rx_campaign_config *config = NULL;
    assert_int_equal(rx_settings_new(rx_keytable_validate(), (rx_settings **)&config, NULL), RX_OK);
    return config;
}

/* Read `text` as a file of these settings. */
static rx_status read_text(void **state, rx_settings *settings, const char *text, rx_error *err)
{
    const char *path = put(state, "test.conf", text);
    *err = RX_ERROR_NONE;
    return rx_settings_read(settings, path, NULL, err);
}

static void expect_read(void **state, rx_settings *settings, const char *text)
{
    rx_error err;
    if (read_text(state, settings, text, &err) != RX_OK)
        fail_msg("line %ld: %s", err.line, err.text);
}

static void syntax_follows_sextractor(void **state)
{
    rx_error err;
    rx_config *c = defaults();
    expect_read(state, &c->settings,
                "# a comment\r\n"
                "\n"
                "  detect_minarea\t7   # five is too few\r\n"
                "PHOT_APERTURES 3,5, 8 ;12.5\n"
                "CATALOG_NAME = \"my catalogue.cat\"# no comment inside an item\n"
                "WEIGHT_IMAGE w.fits[1][1:20,3:40],v.fits\n"
                "CHECKIMAGE_TYPE -background objects\n"
                "CHECKIMAGE_NAME a.fits,b#1.fits #c.fits\n"
                "FILTER n\n"
                "ASSOC_NAME \"a[1][2\" # a ] behind a quoted [\n"
                "SATUR_LEVEL 6.5e4\n"
                "BACK_SIZE 128.0,64\n"
                "FLAG_IMAGE\n"
                "DETECT_THRESH 3\n"
                "DETECT_THRESH 4");
    assert_int_equal(c->detect_minarea, 7);
    assert_int_equal(c->phot_apertures.n, 4);
    assert_true(c->phot_apertures.v[3] == 12.5);
    assert_string_equal(c->catalog_name, "my catalogue.cat#");
    assert_int_equal(c->weight_image.n, 2);
    assert_string_equal(c->weight_image.v[0], "w.fits[1][1:20,3:40]");
    assert_string_equal(c->checkimage_type.v[0], "-BACKGROUND");
    assert_string_equal(c->checkimage_type.v[1], "OBJECTS");
    assert_int_equal(c->checkimage_name.n, 2);
    assert_string_equal(c->checkimage_name.v[1], "b#1.fits");
    assert_false(c->filter);
    assert_string_equal(c->assoc_name, "a[1][2");
    assert_true(c->satur_level == 65000.0);
    assert_int_equal(c->back_size.v[0], 128);
    assert_int_equal(c->flag_image.n, 0);
    assert_true(c->detect_thresh.v[0] == 4.0); /* the last one wins */
    assert_int_equal(rx_settings_was_set((const rx_settings *)c, "DETECT_THRESH"), RX_FROM_FILE);
    assert_int_equal(rx_settings_was_set((const rx_settings *)c, "ANALYSIS_THRESH"), RX_FROM_DEFAULT);
    assert_int_equal(rx_settings_set(&c->settings, "detect_thresh", "5", NULL, &err), RX_OK);
    assert_int_equal(rx_settings_was_set((const rx_settings *)c, "DETECT_THRESH"), RX_FROM_COMMAND);
    rx_config_free(c);
}

static void environment_is_expanded(void **state)
{
    rx_error err;
    rx_config *c = defaults();
    setenv("RX_TEST_FOLDER", "/data/night 3", 1);
    setenv("RX_TEST_X", "x", 1);
    unsetenv("RX_TEST_UNSET");
    assert_int_equal(read_text(state, &c->settings,
                               "CATALOG_NAME ${RX_TEST_FOLDER}/$RX_TEST_X.cat\n"
                               "CHECKIMAGE_NAME $RX_TEST_X$RX_TEST_X,a$$b,\"$RX_TEST_X c\"\n",
                               &err),
                     RX_OK);
    assert_string_equal(c->catalog_name, "/data/night 3/x.cat");
    assert_string_equal(c->checkimage_name.v[0], "xx");
    assert_string_equal(c->checkimage_name.v[1], "a$b");
    assert_string_equal(c->checkimage_name.v[2], "x c");
    assert_int_equal(rx_settings_set(&c->settings, "CATALOG_NAME", "$RX_TEST_X y.cat", NULL, &err), RX_OK);
    assert_string_equal(c->catalog_name, "x y.cat");
    assert_int_equal(read_text(state, &c->settings, "\nCATALOG_NAME $RX_TEST_UNSET/a.cat\n", &err), RX_USAGE);
    assert_int_equal(err.line, 2);
    assert_non_null(strstr(err.text, "RX_TEST_UNSET is not set"));
    assert_int_equal(read_text(state, &c->settings, "CATALOG_NAME ${RX_TEST_X\n", &err), RX_USAGE);
    rx_config_free(c);
}

static void check_bad_lines(void **state, const rx_keytable *table, size_t n, const char *const (*cases)[2])
{
    for (size_t i = 0; i < n; i++) {
        char text[256];
        rx_error err;
        rx_settings *settings = NULL;
        assert_int_equal(rx_settings_new(table, &settings, &err), RX_OK);
        snprintf(text, sizeof text, "# head\nSEED 3\n%s\nSEED 4\n", cases[i][0]);
        assert_int_equal(read_text(state, settings, text, &err), RX_USAGE);
        assert_int_equal(err.status, RX_USAGE);
        assert_int_equal(err.line, 3);
        assert_non_null(strstr(err.where, "/test.conf"));
        if (strstr(err.text, cases[i][1]) == NULL)
            fail_msg("'%s' gives '%s'", cases[i][0], err.text);
        rx_settings_free(settings);
    }
}

static void bad_lines_say_where_and_what(void **state)
{
    static const char *const own[][2] = {
        {"DETECT_TRESH 3", "unknown keyword 'DETECT_TRESH'; did you mean DETECT_THRESH?"},
        {"BLA_BLA_BLA 3", "unknown keyword 'BLA_BLA_BLA'; -dd lists all"},
        {"DETECT_MINAREA five", "DETECT_MINAREA: 'five' is not a number"},
        {"DETECT_MINAREA 5px", "DETECT_MINAREA: '5px' is not a number"},
        {"DETECT_MINAREA 2.5", "DETECT_MINAREA: 2.5 is not a whole number"},
        {"DETECT_MINAREA 0", "DETECT_MINAREA: 0 is out of range, give 1 to 1000000"},
        {"DETECT_MINAREA", "DETECT_MINAREA: has no value"},
        {"DETECT_MINAREA # 5", "DETECT_MINAREA: has no value"},
        {"DETECT_MINAREA \"\"", "DETECT_MINAREA: has an empty value"},
        {"GAIN nan", "GAIN: 'nan' is not a number"},
        {"GAIN inf", "GAIN: 'inf' is not a number"},
        {"GAIN 1e400", "GAIN: '1e400' is not a number"},
        {"GAIN 0x10", "GAIN: '0x10' is not a number"},
        {"GAIN -1", "GAIN: -1 is out of range"},
        {"FILTER maybe", "FILTER: 'maybe' is not Y or N"},
        {"CATALOG_TYPE FITS_LADC",
         "unknown word 'FITS_LADC' (did you mean FITS_LDAC?); give one of NONE, ASCII,"},
        {"PSF_LIBRARY lib", "PSF_LIBRARY is no longer a keyword; give PSF_FWHM"},
        {"PSF_LIBRARY_MAX 1,6", "PSF_LIBRARY_MAX is no longer a keyword"},
        {"PSF_TYPE piff", "PSF_TYPE: PIFF is no longer offered; give FILE, and the file"},
        {"RESTORE_TYPE NONE,CNN", "RESTORE_TYPE: unknown word 'CNN'"},
        {"PHOT_AUTOPARAMS 2.5", "PHOT_AUTOPARAMS: has 1 item(s), needs at least 2"},
        {"PHOT_AUTOPARAMS 2.5,3.5,4.5", "PHOT_AUTOPARAMS: has 3 items, takes at most 2"},
        {"CATALOG_NAME \"my.cat", "a quote is not closed"},
    };
    static const char *const prefixed[][2] = {
        {"SIM.SEED x", "SIM.SEED: 'x' is not a number"},
        {"STAGE.DETECT_MINAREA 0", "STAGE.DETECT_MINAREA: 0 is out of range, give 1 to 1000000"},
        {"SIM.NOISE_TYPE GAUS", "SIM.NOISE_TYPE: unknown word 'GAUS' (did you mean GAUSS?)"},
        {"STAGE.FILTER maybe", "STAGE.FILTER: 'maybe' is not Y or N"},
        {"SIM.STAR_MAG 3", "SIM.STAR_MAG: has 1 item(s), needs at least 2"},
        {"SIM.STAR_CONT 3", "unknown keyword 'SIM.STAR_CONT'; did you mean SIM.STAR_COUNT?"},
        {"STAR_COUNT 3", "unknown keyword 'STAR_COUNT'; did you mean SIM.STAR_COUNT?"},
        {"SIM.CAMPAIGN_TYPE 3", "unknown keyword 'SIM.CAMPAIGN_TYPE'"},
        {"SIM. 3", "unknown keyword 'SIM.'"},
        {"CAMPAIN_TYPE 3", "unknown keyword 'CAMPAIN_TYPE'; did you mean CAMPAIGN_TYPE?"},
        {"SIMU.STAR_COUNT 3", "unknown keyword 'SIMU.STAR_COUNT'; did you mean SIM.STAR_COUNT?"},
        {"DETECT_THRESH 3", "unknown keyword 'DETECT_THRESH'; did you mean STAGE.DETECT_THRESH?"},
        {"SIM.QWERTYUIOP 3", "unknown keyword 'SIM.QWERTYUIOP'; -dd lists all"},
        {"X.Y.Z 3", "unknown keyword 'X.Y.Z'; -dd lists all"},
    };
    check_bad_lines(state, rx_keytable_rextract(), sizeof own / sizeof *own, own);
    check_bad_lines(state, rx_keytable_validate(), sizeof prefixed / sizeof *prefixed, prefixed);
}

static void command_line_values_are_strict(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_config *c = defaults();
    assert_int_equal(rx_settings_set(&c->settings, "DETECT_MINAREA", "5 6", NULL, &err), RX_USAGE);
    assert_string_equal(err.text, "-DETECT_MINAREA: has 2 items, takes at most 1");
    assert_int_equal(rx_settings_set(&c->settings, "DETECT_MINARREA", "5", NULL, &err), RX_USAGE);
    assert_string_equal(err.text, "unknown keyword '-DETECT_MINARREA'; did you mean -DETECT_MINAREA?");
    assert_int_equal(rx_settings_set(&c->settings, "REFERENCE_NAME", "ref.fits[1][MAG < 22, x]", NULL, &err),
                     RX_OK);
    assert_string_equal(c->reference_name, "ref.fits[1][MAG < 22, x]");
    assert_int_equal(rx_settings_set(&c->settings, "REFERENCE_NAME", "none", NULL, &err), RX_OK);
    assert_string_equal(c->reference_name, "");
    assert_int_equal(rx_settings_set(&c->settings, "CATALOG_NAME", "", NULL, &err), RX_USAGE);
    rx_config_free(c);
    rx_campaign_config *campaigns = campaign();
    assert_int_equal(rx_settings_set(&campaigns->settings, "SIM.SEED", "x", NULL, &err), RX_USAGE);
    assert_string_equal(err.text, "-SIM.SEED: 'x' is not a number");
    rx_settings_free(&campaigns->settings);
}

/* Everything logged while the configuration of `text` is checked. */
static void logged(void **state, const char *text, rx_status expected, char *dst, size_t size, rx_error *err)
{
    rx_log log;
    rx_config *c = defaults();
    FILE *stream = tmpfile();
    assert_non_null(stream);
    const char *path = put(state, "test.conf", text);
    *err = RX_ERROR_NONE;
    rx_log_init(&log, "t", stream, RX_NORMAL);
    if (rx_settings_read(&c->settings, path, &log, err) != RX_OK)
        fail_msg("%s", err->text);
    const rx_status status = rx_settings_check(&c->settings, err);
    assert_int_equal(status, expected);
    if (status == RX_OK)
        assert_int_equal(rx_settings_warn_idle(&c->settings, (rx_idle){0}, &log, err), RX_OK);
    rewind(stream);
    size_t n = fread(dst, 1, size - 1, stream);
    dst[n] = '\0';
    fclose(stream);
    rx_config_free(c);
}

static void keywords_without_effect_warn_once(void **state)
{
    char said[4096];
    rx_error err;
    logged(state, "WRITE_XML Y\nWRITE_XML Y\nINTERP_TYPE NONE\nXML_NAME a.xml\nMEMORY_OBJSTACK 9000\n", RX_OK,
           said, sizeof said, &err);
    assert_string_equal(said,
                        "t: warning: INTERP_TYPE NONE has no effect here (interpolation over bad pixels)\n");
    logged(state, "WRITE_XML N\nINTERP_TYPE all\nINTERP_MAXXLAG 16.0\nHEADER_SUFFIX .head\nFILTER_THRESH\n",
           RX_OK, said, sizeof said, &err);
    assert_string_equal(said, "");
    logged(state, "PSF_LIBRARY_MAX 1,5.00\nGAIN 2\nPSF_LIBRARY none\n", RX_OK, said, sizeof said, &err);
    assert_non_null(strstr(
        said,
        "no longer keywords, and without effect at their old defaults: PSF_LIBRARY_MAX, PSF_LIBRARY\n"));
    logged(state, "PIXEL_SCALE 0.4 arcsec\n", RX_OK, said, sizeof said, &err);
    assert_non_null(strstr(said, "test.conf:1: PIXEL_SCALE takes one value, 'arcsec' is ignored"));
}

static void prefixed_names_reach_the_parts(void **state)
{
    rx_error err;
    rx_campaign_config *c = campaign();
    expect_read(state, &c->settings,
                "SEED 3\n"
                "SIM.SEED 4\n"
                "stage.seed 5 # case does not matter\n"
                "Sim.Star_Mag 15,16\n"
                "SIM.TEMPLATE_NAME \"a b\"\n"
                "STAGE.WEIGHT_IMAGE w.fits,v.fits\n");
    assert_int_equal(c->sim->image_size.v[0], 1024); /* its program's default */
    assert_int_equal(c->seed, 3);
    assert_int_equal(c->sim->seed, 4);
    assert_int_equal(c->stage->seed, 5);
    assert_true(c->sim->star_mag.v[1] == 16.0);
    assert_string_equal(c->sim->template_name, "a b");
    assert_string_equal(c->stage->weight_image.v[1], "v.fits");
    assert_int_equal(rx_settings_set(&c->settings, "SIM.GAIN", "2.5", NULL, &err), RX_OK);
    assert_int_equal(rx_settings_set(&c->settings, "stage.CATALOG_NAME", "a b.cat", NULL, &err), RX_OK);
    assert_true(c->sim->gain == 2.5);
    assert_true(c->stage->gain == 0.0);
    assert_string_equal(c->stage->catalog_name, "a b.cat");
    assert_int_equal(rx_settings_was_set(&c->settings, "SIM.GAIN"), RX_FROM_COMMAND);
    assert_int_equal(rx_settings_was_set(&c->settings, "SIM.SEED"), RX_FROM_FILE);
    assert_int_equal(rx_settings_was_set(&c->settings, "STAGE.GAIN"), RX_FROM_DEFAULT);
    assert_int_equal(rx_settings_was_set((const rx_settings *)c->stage, "SEED"), RX_FROM_FILE);
    rx_settings_free(&c->settings);
}

/* One setting after the other, "KEYWORD value;KEYWORD value", then the checks. */
static rx_status check_line(rx_settings *settings, const char *line, rx_log *log, rx_error *err)
{
    char text[512], *rest = NULL;
    *err = RX_ERROR_NONE;
    snprintf(text, sizeof text, "%s", line);
    for (char *word = strtok_r(text, ";", &rest); word != NULL; word = strtok_r(NULL, ";", &rest)) {
        char *value = strchr(word, ' ');
        assert_non_null(value);
        *value++ = '\0';
        if (rx_settings_set(settings, word, value, NULL, err) != RX_OK)
            fail_msg("'%s': %s", line, err->text);
    }
    RX_TRY(rx_settings_check(settings, err));
    return rx_settings_warn_idle(settings, (rx_idle){0}, log, err);
}

static void check_relations(const rx_keytable *table, size_t n, const char *const (*cases)[2])
{
    for (size_t i = 0; i < n; i++) {
        rx_error err;
        rx_settings *settings = NULL;
        assert_int_equal(rx_settings_new(table, &settings, &err), RX_OK);
        rx_status status = check_line(settings, cases[i][0], NULL, &err);
        if (cases[i][1] == NULL && status != RX_OK)
            fail_msg("'%s' gives '%s'", cases[i][0], err.text);
        if (cases[i][1] != NULL && (status != RX_USAGE || strstr(err.text, cases[i][1]) == NULL))
            fail_msg("'%s' gives %d '%s'", cases[i][0], (int)status, err.text);
        rx_settings_free(settings);
    }
}

static void simulations_are_checked(void **state)
{
    static const char *const cases[][2] = {
        {"STAR_MAG 20,20", NULL},
        {"STAR_MAG 20,19", "-STAR_MAG: 20 is above 19; give <from>,<to>"},
        {"SKY_CENTER 10,-91", "-SKY_CENTER: no declination is -91"},
        {"SKY_CENTER -10,-90", NULL},
        {"NOISE_TYPE CCD", "-GAIN: 0 e-/ADU is no gain for NOISE_TYPE CCD"},
        {"NOISE_TYPE CCD;GAIN 1.5", NULL},
        {"SATUR_LEVEL 1000", "-SATUR_LEVEL: 1000 is not above SKY_LEVEL, 1000"},
        {"SATUR_LEVEL 1000;SKY_LEVEL 999", NULL},
        {"SATUR_LEVEL 1000;NOISE_TYPE CCD;INJECT_IMAGE tile.fits", NULL}, /* the tile's own count */
        {"PSF_TYPE AUTO", "-PSF_TYPE: AUTO is measured on a real tile; give INJECT_IMAGE"},
        {"PSF_TYPE AUTO;INJECT_IMAGE tile.fits", NULL},
        {"PSF_TYPE PSFEX;PSF_NAME NONE", "-PSF_NAME: is empty; name the file that PSF_TYPE PSFEX reads"},
        {"INJECT_CONFIG my.sex", "-INJECT_CONFIG: is about a real tile; give INJECT_IMAGE too"},
        {"TEMPLATE_COUNT 5", "-TEMPLATE_NAME: is empty; name the cut-outs that TEMPLATE_COUNT asks for"},
        {"TEMPLATE_COUNT 5;TEMPLATE_NAME cosmos", NULL},
        {"SHARP_NAME NONE;TRUTH_NAME NONE;FLAG_NAME NONE", NULL},
    };
    check_relations(rx_keytable_simulate(), sizeof cases / sizeof cases[0], cases);
}

static void campaigns_are_checked(void **state)
{
    static const char *const cases[][2] = {
        {"SHARD 3/3", NULL},
        {"SHARD 4/3", "-SHARD: there is no part 4 of 3; give 1/3 to 3/3"},
        {"SHARD 0/3", "-SHARD: '0/3' is not k/n"},
        {"SHARD 1/2x", "is not k/n"},
        {"SHARD 1/99999999999999999999", "is not k/n"},
        {"RESTORE_TYPE RL,NONE,RL", "-RESTORE_TYPE: RL is named twice"},
        {"FIELDS SIMULATED,INJECTED", "-TILE_NAME: is empty; name the real tile"},
        {"FIELDS INJECTED;CAMPAIGN_TYPE RESTORATION", NULL},
        {"FIELDS INJECTED;TILE_NAME tile.fits", NULL},
        {"FWHM_RANGE 5,4", "-FWHM_RANGE: 5 is above 4; give <from>,<to>"},
        {"MAGNITUDES 22,21,0.5", "-MAGNITUDES: 22 is above 21; give <from>,<to>,<step>"},
        {"MAGNITUDES 18,22,0", "-MAGNITUDES: the step 0 must be above 0"},
        {"MAGNITUDES 18,22,1e-9", "-MAGNITUDES: more than 1000 sets"},
        {"MAGNITUDES 20,20,1", NULL},
        {"TILES 3", NULL},
        {"TILES 3;SIZE PAPER", "-TILES: has no second number, which SIZE PAPER asks for"},
        {"SIM.INJECT_IMAGE a.fits", "-SIM.INJECT_IMAGE: has no place in a campaign; give FIELDS INJECTED"},
        {"SIM.PSF_TYPE PSFEX", NULL},
        {"SIM.PSF_TYPE PSFEX;CAMPAIGN_TYPE RESTORATION", "-SIM.PSF_TYPE: PSFEX has no FWHM"},
        {"STAGE.CHECKIMAGE_TYPE RESTORED,OBJECTS", "-STAGE.CHECKIMAGE_NAME: names 1 file(s)"},
    };
    check_relations(rx_keytable_validate(), sizeof cases / sizeof cases[0], cases);
}

static void trainings_are_checked(void **state)
{
    static const char *const cases[][2] = {
        {"EPOCHS 3", NULL},
        {"KERNELS 7,4", "-KERNELS: 4 is even; give odd numbers"},
        {"PATCH 98", "-PATCH: 98 is no multiple of 4; give 100"},
        {"PATCH 96;PATCH_MARGIN 23", NULL},
        {"PATCH 96;PATCH_MARGIN 24",
         "-PATCH_MARGIN: 24 leaves less than half of an image's side of 96; give at"},
        {"LOSS_IDT 0;LOSS_REC 0;LOSS_REC_PSF 0;LOSS_FFL 0", "-LOSS_IDT: no term of the loss trains RESTORE"},
        {"LOSS_IDT 0", NULL},
        {"SIM.INJECT_IMAGE a.fits", "-SIM.INJECT_IMAGE: has no place in a training"},
        {"SIM.STAR_COUNT 0;SIM.GALAXY_COUNT 0", "-SIM.STAR_COUNT: there are no stars, galaxies or templates"},
    };
    check_relations(rx_keytable_train(), sizeof cases / sizeof cases[0], cases);
}

static void tiles_are_checked(void **state)
{
    static const char *const cases[][2] = {
        {"SELF_CHECK Y;SELF_CHECK_MAG 18,22;SELF_CHECK_NAME report", NULL},
        {"SELF_CHECK_MAG 18", "-SELF_CHECK_MAG: has 1 item, needs <from>,<to>, or none"},
        {"SELF_CHECK_MAG 22,18", "-SELF_CHECK_MAG: 22 is above 18"},
        {"WEIGHT_TYPE MAP_RMS;WEIGHT_IMAGE NONE", NULL},
        {"WEIGHT_TYPE MAP_RMS;WEIGHT_IMAGE ", "-WEIGHT_IMAGE: is empty"},
        {"REFERENCE_COLUMNS x,y", "-REFERENCE_COLUMNS: has 2 item(s)"},
        {"CHECKIMAGE_TYPE RESTORED,NONE;CHECKIMAGE_NAME a.fits;QA_GATES a.qa;REFERENCE_NAME r.fits", NULL},
    };
    check_relations(rx_keytable_rextract(), sizeof cases / sizeof cases[0], cases);
}

/* Warnings of the checks, one for each keyword that is set in vain. */
static void keywords_set_in_vain_warn(void **state)
{
    static const struct {
        const rx_keytable *(*table)(void);
        const char *line, *warning;
    } cases[] = {
        {rx_keytable_simulate, "SKY_LEVEL 5;IMAGE_SIZE 1024", NULL},
        {rx_keytable_simulate, "INJECT_IMAGE a.fits;SKY_LEVEL 5",
         "t: warning: SKY_LEVEL 5 has no effect with INJECT_IMAGE\n"},
        {rx_keytable_simulate, "INJECT_PLACE AWAY",
         "t: warning: INJECT_PLACE AWAY has no effect without INJECT_IMAGE"},
        {rx_keytable_simulate, "IMAGE_NAME a.fits;SEED 5", NULL},
        {rx_keytable_rextract, "PSF_NAME default.psf",
         "t: warning: PSF_NAME default.psf has no effect without PSF_TYPE FILE or PSFEX\n"},
        {rx_keytable_rextract, "PSF_NAME a.psf;PSF_TYPE PSFEX", NULL},
        {rx_keytable_rextract, "WEIGHT_IMAGE w.fits",
         "t: warning: WEIGHT_IMAGE w.fits has no effect without WEIGHT_TYPE MAP_RMS, MAP_VAR, MAP_IVAR or "},
        {rx_keytable_rextract, "WEIGHT_IMAGE w.fits;WEIGHT_TYPE NONE,MAP_RMS", NULL},
        {rx_keytable_rextract, "CHECKIMAGE_NAME a.fits",
         "t: warning: CHECKIMAGE_NAME a.fits has no effect without CHECKIMAGE_TYPE\n"},
        {rx_keytable_rextract, "QA_NAME qa;QA_TYPE TILE;MATCH_RADIUS 3;SELF_CHECK Y", NULL},
        {rx_keytable_rextract, "DETECT_NOISE INPUT;RESTORE_TYPE NONE",
         "t: warning: DETECT_NOISE INPUT has no effect without RESTORE_TYPE RL, RL_BLIND, NET, FILE or "
         "AUTO\n"},
        {rx_keytable_rextract, "FILTER_NAME a.conv;FILTER N",
         "t: warning: FILTER_NAME a.conv has no effect without FILTER Y\n"},
        {rx_keytable_rextract, "PHOT_APERTURES 3;ASSOC_NAME a.list;STARNNW_NAME a.nnw",
         NULL},                                                 /* any column */
        {rx_keytable_validate, "STAGE.NET_MODEL a.fits", NULL}, /* the campaign decides */
        {rx_keytable_simulate, "PSF_NAME a.psf;NOISE_TYPE CCD;GAIN 2;NOISE_SIGMA 3",
         "t: warning: PSF_NAME a.psf has no effect without PSF_TYPE FILE or PSFEX; NOISE_SIGMA 3 has no "},
        {rx_keytable_validate, "SIM.IMAGE_NAME a.fits",
         "t: warning: SIM.IMAGE_NAME a.fits has no effect in a campaign"},
        {rx_keytable_validate, "STAGE.RESTORE_TYPE NONE",
         "t: warning: STAGE.RESTORE_TYPE NONE has no effect in a campaign"},
        {rx_keytable_validate, "STAGE.WRITE_XML Y",
         "t: warning: STAGE.WRITE_XML Y has no effect in a campaign"},
        {rx_keytable_validate, "STAGE.SEED 5;RESTORE_TYPE NONE;SIM.SKY_LEVEL 5", NULL},
        {rx_keytable_rextract, "CATALOG_NAME a.cat;RESTORE_TYPE NONE", NULL},
        {rx_keytable_train, "SIM.STAR_COUNT 5;SIM.GALAXY_MAG 15,20;RL_STEPS 0;TIKHONOV 0.1", NULL},
        {rx_keytable_train, "SIM.SKY_LEVEL 5", "t: warning: SIM.SKY_LEVEL 5 has no effect in a training"},
        {rx_keytable_train, "RL_STEPS 0;RL_STEP_PEDESTAL 2",
         "t: warning: RL_STEP_PEDESTAL 2 has no effect without RL_STEPS"},
        {rx_keytable_train, "MODE BLIND;RL_STEPS 1",
         "t: warning: RL_STEPS 1 has no effect without MODE INFORMED"},
        {rx_keytable_train, "LOSS_TYPE PLAIN;LOSS_FLOOR 3",
         "t: warning: LOSS_FLOOR 3 has no effect without LOSS_TYPE LINEAR"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char said[512] = "", more[512] = "";
        rx_error err;
        rx_settings *settings = NULL;
        FILE *stream = tmpfile();
        rx_log log;
        assert_non_null(stream);
        rx_log_init(&log, "t", stream, RX_NORMAL);
        assert_int_equal(rx_settings_new(cases[i].table(), &settings, &err), RX_OK);
        assert_int_equal(check_line(settings, cases[i].line, &log, &err), RX_OK);
        rewind(stream);
        char *line = fgets(said, sizeof said, stream);
        if ((line != NULL) != (cases[i].warning != NULL) || fgets(more, sizeof more, stream) != NULL)
            fail_msg("'%s' warns '%s' '%s'", cases[i].line, said, more);
        if (line != NULL)
            assert_memory_equal(said, cases[i].warning, strlen(cases[i].warning));
        fclose(stream);
        rx_settings_free(settings);
    }
}

static int only_x_image(const void *columns, const char *part)
{
    (void)columns;
    return strcmp(part, "X_IMAGE") == 0;
}

static void check_idle(const rx_settings *settings, const char *expected)
{
    rx_error err;
    char said[1024] = "";
    FILE *stream = tmpfile();
    rx_log log;
    rx_idle idle = {.has_column = only_x_image};
    assert_non_null(stream);
    rx_log_init(&log, "t", stream, RX_NORMAL);
    assert_int_equal(rx_idle_add(&idle, settings, &err), RX_OK);
    rx_idle_warn(&idle, &log);
    rx_idle_free(&idle);
    rewind(stream);
    said[fread(said, 1, sizeof said - 1, stream)] = '\0';
    assert_string_equal(said, expected);
    fclose(stream);
}

/* A file that states what a keyword depends on holds that ready; dumps state everything. */
static void files_hold_keywords_ready(void **state)
{
    static const char *const cases[][2] = {
        {"CHECKIMAGE_TYPE NONE\nCHECKIMAGE_NAME none.fits\nPHOT_APERTURES 3\nASSOC_NAME a.list\n", ""},
        {"CHECKIMAGE_NAME c.fits\n",
         "t: warning: CHECKIMAGE_NAME c.fits has no effect without CHECKIMAGE_TYPE\n"},
        {"WEIGHT_TYPE NONE\nWEIGHT_IMAGE w.fits\nRESCALE_WEIGHTS N\n", ""},
        {"PSF_TYPE AUTO\nPSF_NAME a.psf\n", /* a dump of ours, edited */
         "t: warning: PSF_NAME a.psf has no effect without PSF_TYPE FILE or PSFEX\n"},
        {"PSF_TYPE MOFFAT\nPSF_NAME a.psf\n", ""},
        {"PSF_NAME default.psf\n", ""},
    };
    rx_error err;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_settings *settings = NULL;
        assert_int_equal(rx_settings_new(rx_keytable_rextract(), &settings, &err), RX_OK);
        assert_int_equal(read_text(state, settings, cases[i][0], &err), RX_OK);
        check_idle(settings, cases[i][1]);
        assert_int_equal(rx_settings_set(settings, "ASSOC_NAME", "b.list", NULL, &err), RX_OK);
        if (cases[i][1][0] == '\0')
            check_idle(
                settings,
                "t: warning: ASSOC_NAME b.list has no effect without column VECTOR_ASSOC or NUMBER_ASSOC\n");
        rx_settings_free(settings);
    }
    const rx_keytable *tables[] = {rx_keytable_rextract(), rx_keytable_simulate(), rx_keytable_validate(),
                                   rx_keytable_train(), rx_keytable_survey()};
    for (size_t t = 0; t < sizeof tables / sizeof tables[0]; t++) {
        rx_text dump = {0};
        rx_settings *settings = NULL;
        assert_int_equal(rx_settings_new(tables[t], &settings, &err), RX_OK);
        rx_settings_dump(&dump, tables[t], NULL, true);
        assert_int_equal(read_text(state, settings, dump.data, &err), RX_OK);
        check_idle(settings, "");
        rx_text_free(&dump);
        rx_settings_free(settings);
    }
}

/* Where nothing is restored and no column, image, check or page needs it, no PSF is made. */
static void keywords_of_a_psf_that_is_not_made(void **state)
{
    static const char *const needs[][2] = {{"RESTORE_TYPE", "NONE,RL"}, {"FILTER_TYPE", "AUTO"},
                                           {"SELF_CHECK", "Y"},         {"QA_TYPE", "TILE"},
                                           {"CHECKIMAGE_TYPE", "PSF"},  {"TEMPLATE_COVAR_NAME", "c.fits"}};
    for (size_t k = 0; k <= sizeof needs / sizeof *needs; k++) {
        rx_settings *settings = NULL;
        rx_idle idle = {.has_column = only_x_image};
        assert_int_equal(rx_settings_new(rx_keytable_rextract(), &settings, NULL), RX_OK);
        assert_int_equal(rx_settings_set(settings, "RESTORE_TYPE", "NONE", NULL, NULL), RX_OK);
        assert_int_equal(rx_settings_set(settings, "FILTER_TYPE", "CONV", NULL, NULL), RX_OK);
        assert_int_equal(rx_settings_set(settings, "PSF_MINSNR", "30", NULL, NULL), RX_OK);
        if (k > 0)
            assert_int_equal(rx_settings_set(settings, needs[k - 1][0], needs[k - 1][1], NULL, NULL), RX_OK);
        assert_int_equal(rx_idle_add(&idle, settings, NULL), RX_OK);
        const char *why = idle.why[rx_keyword_find(settings->table, "PSF_MINSNR")];
        if (k > 0)
            assert_null(why);
        else
            assert_memory_equal(why, "PSF_MINSNR 30 has no effect without RESTORE_TYPE RL", 51);
        rx_idle_free(&idle);
        rx_settings_free(settings);
    }
}

static void relations_of_parts_name_their_line(void **state)
{
    rx_error err;
    rx_campaign_config *c = campaign();
    assert_int_equal(read_text(state, &c->settings, "SEED 1\nSIM.GALAXY_MAG 3,2\n", &err), RX_OK);
    assert_int_equal(rx_settings_check(&c->settings, &err), RX_USAGE);
    assert_int_equal(err.line, 2);
    assert_string_equal(err.text, "SIM.GALAXY_MAG: 3 is above 2; give <from>,<to>");
    rx_settings_free(&c->settings);
}

static void copies_are_equal_and_independent(void **state)
{
    rx_error err;
    rx_text before = {0}, after = {0}, source = {0};
    rx_settings *copy = NULL;
    rx_campaign_config *c = campaign();
    assert_int_equal(
        read_text(state, &c->settings,
                  "OUTPUT_NAME out\nSIM.PSF_NAME a.psf\nSTAGE.FLAG_IMAGE a,b,c\nMAGNITUDES 1,2,3\n", &err),
        RX_OK);
    assert_int_equal(rx_settings_copy(&c->settings, &copy, &err), RX_OK);
    rx_settings_dump(&before, rx_keytable_validate(), &c->settings, true);
    rx_settings_dump(&after, rx_keytable_validate(), copy, true);
    assert_string_equal(before.data, after.data);
    assert_int_equal(rx_settings_was_set(copy, "STAGE.FLAG_IMAGE"), RX_FROM_FILE);
    assert_int_equal(rx_settings_set(copy, "STAGE.FLAG_IMAGE", "d", NULL, &err), RX_OK);
    assert_int_equal(rx_settings_set(copy, "SIM.PSF_NAME", "e", NULL, &err), RX_OK);
    const rx_campaign_config *other = (const rx_campaign_config *)copy;
    assert_string_equal(other->sim->psf_name, "e"); /* the typed parts are those of the copy */
    assert_int_equal(other->stage->flag_image.n, 1);
    rx_settings_dump(&source, rx_keytable_validate(), &c->settings, true);
    assert_string_equal(before.data, source.data);

    rx_config *stage = NULL; /* a part alone keeps its prefix */
    assert_int_equal(rx_config_copy(c->stage, &stage, &err), RX_OK);
    assert_int_equal(stage->flag_image.n, 3);
    assert_int_equal(rx_settings_set(&stage->settings, "SEED", "x", NULL, &err), RX_USAGE);
    assert_string_equal(err.text, "-STAGE.SEED: 'x' is not a number");
    rx_config_free(stage);
    rx_settings_free(copy);
    rx_settings_free(&c->settings);
    rx_text_free(&before);
    rx_text_free(&after);
    rx_text_free(&source);
}

/* dump -> read -> dump is the same text for every program, with odd values too. */
static void dumps_read_back(void **state)
{
    static const char *const odd[][2] = {
        {"CATALOG_NAME", "a b,c;\"d\"#$$e[.cat"},
        {"GAIN", "0.1"},
        {"MAG_ZEROPOINT", "-1.23456789012345e-3"},
        {"PHOT_APERTURES", "1,2.5,3"},
        {"FLAG_IMAGE", ""},
        {"WEIGHT_IMAGE", "w[1][1:2,3:4],v"},
        {"RESTORE_TYPE", "none,RL"},
        {"RESCALE_WEIGHTS", "N,Y"},
        {"QA_FIGURES", "N"},
    };
    const rx_keytable *tables[] = {rx_keytable_rextract(), rx_keytable_simulate(), rx_keytable_validate(),
                                   rx_keytable_train(), rx_keytable_survey()};
    for (int i = 0; i < 10; i++) {
        const rx_keytable *table = tables[i / 2];
        const bool all = i % 2;
        rx_text first = {0}, plain = {0}, second = {0};
        rx_settings *a = NULL, *b = NULL;
        assert_int_equal(rx_settings_new(table, &a, NULL), RX_OK);
        assert_int_equal(rx_settings_new(table, &b, NULL), RX_OK);
        rx_settings_dump(&plain, table, NULL, all);
        expect_read(state, b, plain.data);
        assert_int_equal(strstr(plain.data, "\nSTAGE.DETECT_THRESH ") != NULL, i == 5);
        assert_int_equal(rx_settings_check(b, NULL), RX_OK); /* the defaults suit each other */
        for (size_t k = 0; i == 1 && k < sizeof odd / sizeof odd[0]; k++)
            assert_int_equal(rx_settings_set(a, odd[k][0], odd[k][1], NULL, NULL), RX_OK);
        rx_settings_dump(&first, table, a, all);
        expect_read(state, b, first.data);
        rx_settings_dump(&second, table, b, all);
        assert_string_equal(first.data, second.data);
        if (i == 1)
            assert_string_equal(((const rx_config *)b)->catalog_name, "a b,c;\"d\"#$e[.cat");
        rx_text_free(&first);
        rx_text_free(&plain);
        rx_text_free(&second);
        rx_settings_free(a);
        rx_settings_free(b);
    }
}

/* config/default.sex is what -d prints. */
static void committed_default_is_the_dump(void **state)
{
    char path[1024], *file = NULL;
    rx_text text = {0};
    const char *root = getenv("srcdir");
    snprintf(path, sizeof path, "%s/config/default.sex", root != NULL ? root : ".");
    assert_int_equal(rx_text_read_file(path, 1 << 20, &file, NULL, NULL), RX_OK);
    rx_settings_dump(&text, rx_keytable_rextract(), NULL, false);
    assert_string_equal(file, text.data);
    rx_text_free(&text);
    free(file);
}

/* What the real program prints is taken without a word. */
static void dumps_of_sextractor_are_accepted(void **state)
{
    static const char *const commands[] = {"source-extractor -d 2>/dev/null",
                                           "source-extractor -dd 2>/dev/null"};
    for (int i = 0; i < 2; i++) {
        static char text[1 << 16];
        char said[4096];
        rx_error err;
        FILE *pipe = popen(commands[i], "r");
        assert_non_null(pipe);
        size_t n = fread(text, 1, sizeof text - 1, pipe);
        text[n] = '\0';
        if (pclose(pipe) != 0 || n == 0) {
            print_message("source-extractor is not installed: its dumps are not tried\n");
            skip();
        }
        logged(state, text, RX_OK, said, sizeof said, &err);
        assert_string_equal(said, "");
    }
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_scratch, remove_scratch)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(syntax_follows_sextractor),
        IN_FOLDER(environment_is_expanded),
        IN_FOLDER(bad_lines_say_where_and_what),
        cmocka_unit_test(command_line_values_are_strict),
        IN_FOLDER(keywords_without_effect_warn_once),
        IN_FOLDER(prefixed_names_reach_the_parts),
        cmocka_unit_test(simulations_are_checked),
        cmocka_unit_test(campaigns_are_checked),
        cmocka_unit_test(trainings_are_checked),
        cmocka_unit_test(tiles_are_checked),
        cmocka_unit_test(keywords_set_in_vain_warn),
        IN_FOLDER(files_hold_keywords_ready),
        cmocka_unit_test(keywords_of_a_psf_that_is_not_made),
        IN_FOLDER(relations_of_parts_name_their_line),
        IN_FOLDER(copies_are_equal_and_independent),
        IN_FOLDER(dumps_read_back),
        cmocka_unit_test(committed_default_is_the_dump),
        IN_FOLDER(dumps_of_sextractor_are_accepted),
    };
    return cmocka_run_group_tests_name("settings", tests, NULL, NULL);
}
