/* Reading, overriding, checking and dumping configurations. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "../scratch.h"
#include "config/config_fields.h"
#include "config/idle.h"

static rx_config *defaults(void)
{
    rx_config *config = NULL;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    return config;
}

/* Read `text` as a file; the status, and what was said into err. */
static rx_status read_text(void **state, rx_config *config, const char *text, rx_error *err)
{
    const char *path = put(state, "test.sex", text);
    *err = RX_ERROR_NONE;
    return rx_config_read(config, path, NULL, err);
}

static void syntax_follows_sextractor(void **state)
{
    rx_error err;
    rx_config *c = defaults();
    rx_status status = read_text(state, c,
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
                                 "DETECT_THRESH 4",
                                 &err);
    if (status != RX_OK)
        fail_msg("line %ld: %s", err.line, err.text);
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
    assert_int_equal(rx_config_set(c, "detect_thresh", "5", NULL, &err), RX_OK);
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
    assert_int_equal(read_text(state, c,
                               "CATALOG_NAME ${RX_TEST_FOLDER}/$RX_TEST_X.cat\n"
                               "CHECKIMAGE_NAME $RX_TEST_X$RX_TEST_X,a$$b,\"$RX_TEST_X c\"\n",
                               &err),
                     RX_OK);
    assert_string_equal(c->catalog_name, "/data/night 3/x.cat");
    assert_string_equal(c->checkimage_name.v[0], "xx");
    assert_string_equal(c->checkimage_name.v[1], "a$b");
    assert_string_equal(c->checkimage_name.v[2], "x c");
    assert_int_equal(rx_config_set(c, "CATALOG_NAME", "$RX_TEST_X y.cat", NULL, &err), RX_OK);
    assert_string_equal(c->catalog_name, "x y.cat");
    assert_int_equal(read_text(state, c, "\nCATALOG_NAME $RX_TEST_UNSET/a.cat\n", &err), RX_USAGE);
    assert_int_equal(err.line, 2);
    assert_non_null(strstr(err.text, "RX_TEST_UNSET is not set"));
    assert_int_equal(read_text(state, c, "CATALOG_NAME ${RX_TEST_X\n", &err), RX_USAGE);
    rx_config_free(c);
}

static void bad_lines_say_where_and_what(void **state)
{
    static const struct {
        const char *line, *text;
    } cases[] = {
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
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[256];
        rx_error err;
        rx_config *c = defaults();
        snprintf(text, sizeof text, "# head\nSEED 3\n%s\nSEED 4\n", cases[i].line);
        assert_int_equal(read_text(state, c, text, &err), RX_USAGE);
        assert_int_equal(err.status, RX_USAGE);
        assert_int_equal(err.line, 3);
        assert_non_null(strstr(err.where, "/test.sex"));
        if (strstr(err.text, cases[i].text) == NULL)
            fail_msg("'%s' gives '%s'", cases[i].line, err.text);
        assert_int_equal(c->seed, 3); /* lines before count, lines after do not */
        assert_int_equal(c->detect_minarea, 5);
        rx_config_free(c);
    }
}

static void bad_files_are_usage_errors(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_config *c = defaults();
    const char *path = in(state, "absent.sex");
    assert_int_equal(rx_config_read(c, path, NULL, &err), RX_USAGE);
    assert_int_equal(err.status, RX_USAGE);
    assert_string_equal(err.where, path);
    assert_int_equal(rx_config_read(c, *state, NULL, &err), RX_USAGE); /* a folder */
    path = put(state, "empty.sex", "");
    assert_int_equal(rx_config_read(c, path, NULL, &err), RX_OK);
    rx_config_free(c);
}

static void command_line_values_are_strict(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    rx_config *c = defaults();
    assert_int_equal(rx_config_set(c, "DETECT_MINAREA", "5 6", NULL, &err), RX_USAGE);
    assert_string_equal(err.text, "-DETECT_MINAREA: has 2 items, takes at most 1");
    assert_int_equal(rx_config_set(c, "DETECT_MINARREA", "5", NULL, &err), RX_USAGE);
    assert_string_equal(err.text, "unknown keyword '-DETECT_MINARREA'; did you mean -DETECT_MINAREA?");
    assert_int_equal(rx_config_set(c, "REFERENCE_NAME", "ref.fits[1][MAG < 22, x]", NULL, &err), RX_OK);
    assert_string_equal(c->reference_name, "ref.fits[1][MAG < 22, x]");
    assert_int_equal(rx_config_set(c, "REFERENCE_NAME", "none", NULL, &err), RX_OK);
    assert_string_equal(c->reference_name, "");
    assert_int_equal(rx_config_set(c, "CATALOG_NAME", "", NULL, &err), RX_USAGE);
    rx_config_free(c);
}

/* Everything logged while the configuration of `text` is checked. */
static void logged(void **state, const char *text, rx_status expected, char *dst, size_t size, rx_error *err)
{
    rx_log log;
    rx_config *c = defaults();
    FILE *stream = tmpfile();
    assert_non_null(stream);
    const char *path = put(state, "test.sex", text);
    *err = RX_ERROR_NONE;
    rx_log_init(&log, "t", stream, RX_NORMAL);
    if (rx_config_read(c, path, &log, err) != RX_OK)
        fail_msg("%s", err->text);
    const rx_status status = rx_settings_check(&c->settings, err);
    assert_int_equal(status, expected);
    if (status == RX_OK)
        assert_int_equal(rx_settings_warn_idle(&c->settings, &log, err), RX_OK);
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
    assert_non_null(strstr(said, "test.sex:1: PIXEL_SCALE takes one value, 'arcsec' is ignored"));
}

static void relations_between_keywords_are_checked(void **state)
{
    static const struct {
        const char *text, *error;
        long line;
    } cases[] = {
        {"RESTORE_TYPE RL,NONE,rl\n", "RESTORE_TYPE: RL is named twice", 1},
        {"CHECKIMAGE_TYPE RESTORED,OBJECTS\nCHECKIMAGE_NAME a.fits\n", "names 1 file(s) for 2 check-image(s)",
         2},
        {"WEIGHT_TYPE MAP_RMS\nWEIGHT_IMAGE\n", "WEIGHT_IMAGE: is empty", 2},
        {"DETECT_TYPE PHOTO\n", "DETECT_TYPE: PHOTO", 1},
        {"QA_GATES a.qa\n", "QA_GATES: needs a reference catalogue", 1},
        {"REFERENCE_COLUMNS x,y\n", "REFERENCE_COLUMNS: has 2 item(s)", 1},
    };
    char said[4096];
    rx_error err;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        logged(state, cases[i].text, RX_USAGE, said, sizeof said, &err);
        if (strstr(err.text, cases[i].error) == NULL)
            fail_msg("'%s' gives '%s'", cases[i].text, err.text);
        assert_int_equal(err.line, cases[i].line);
    }
    logged(state,
           "CHECKIMAGE_TYPE RESTORED,NONE\nCHECKIMAGE_NAME a.fits\nQA_GATES a.qa\nREFERENCE_NAME r.fits\n",
           RX_OK, said, sizeof said, &err);
}

/* dump -> read -> dump is the same text, with odd values too. */
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
    for (int all = 0; all < 2; all++) {
        rx_error err = RX_ERROR_NONE;
        rx_text first = {0}, second = {0};
        rx_config *a = defaults(), *b = defaults();
        for (size_t i = 0; all && i < sizeof odd / sizeof odd[0]; i++)
            assert_int_equal(rx_config_set(a, odd[i][0], odd[i][1], NULL, &err), RX_OK);
        rx_settings_dump(&first, rx_keytable_rextract(), &a->settings, all);
        if (read_text(state, b, first.data, &err) != RX_OK)
            fail_msg("line %ld: %s", err.line, err.text);
        rx_settings_dump(&second, rx_keytable_rextract(), &b->settings, all);
        assert_string_equal(first.data, second.data);
        assert_string_equal(b->catalog_name, all ? "a b,c;\"d\"#$e[.cat" : "test.cat");
        rx_text_free(&first);
        rx_text_free(&second);
        rx_config_free(a);
        rx_config_free(b);
    }
}

static void default_dump_reads_as_the_defaults(void **state)
{
    char said[4096];
    rx_error err;
    rx_text text = {0}, read = {0}, made = {0};
    rx_config *a = defaults(), *b = defaults();
    rx_settings_dump(&text, rx_keytable_rextract(), NULL, true);
    logged(state, text.data, RX_OK, said, sizeof said, &err);
    assert_string_equal(said, "");
    assert_int_equal(read_text(state, b, text.data, &err), RX_OK);
    rx_settings_dump(&read, rx_keytable_rextract(), &b->settings, true);
    rx_settings_dump(&made, rx_keytable_rextract(), &a->settings, true);
    assert_string_equal(read.data, made.data);
    rx_text_free(&text);
    rx_text_free(&read);
    rx_text_free(&made);
    rx_config_free(a);
    rx_config_free(b);
}

/* config/default.sex is what -d prints. */
static void committed_default_is_the_dump(void **state)
{
    (void)state;
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

static void count_keywords(void *user, const char *name, const char *value, const char *help)
{
    int *n = user;
    assert_non_null(help);
    if (strcmp(name, "PHOT_AUTOPARAMS") == 0)
        assert_string_equal(value, "2.5,3.5");
    if (strcmp(name, "REFERENCE_NAME") == 0)
        assert_string_equal(value, "\"\"");
    ++*n;
}

static void visitor_sees_every_keyword(void **state)
{
    (void)state;
    int n = 0, keys = 0;
    rx_config *c = defaults();
    assert_true(rx_settings_visit(&c->settings, true, count_keywords, &n));
#define SECTION(id, title)
#define KEY(...) keys++;
#include "config/keys.def"
#undef KEY
#undef SECTION
    assert_int_equal(n, keys);
    rx_config_free(c);
}

#define IN_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_scratch, remove_scratch)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_FOLDER(syntax_follows_sextractor),
        IN_FOLDER(environment_is_expanded),
        IN_FOLDER(bad_lines_say_where_and_what),
        IN_FOLDER(bad_files_are_usage_errors),
        cmocka_unit_test(command_line_values_are_strict),
        IN_FOLDER(keywords_without_effect_warn_once),
        IN_FOLDER(relations_between_keywords_are_checked),
        IN_FOLDER(dumps_read_back),
        IN_FOLDER(default_dump_reads_as_the_defaults),
        cmocka_unit_test(committed_default_is_the_dump),
        IN_FOLDER(dumps_of_sextractor_are_accepted),
        cmocka_unit_test(visitor_sees_every_keyword),
    };
    return cmocka_run_group_tests_name("config", tests, NULL, NULL);
}
