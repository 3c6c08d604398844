/* The whole stage on a small simulated tile: masks, threads, empty tiles, dual images, gates. */
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../near.h"
#include "../pipeline/scene.h"
#include "../scratch.h"
#include "base/hash.h"
#include "base/memory.h"
#include "base/random.h"
#include "catalog/catalog.h"
#include "config/config_fields.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "stage/stage.h"

typedef struct setting {
    const char *name, *value;
} setting;

static const char columns_text[] =
    "NUMBER\nX_IMAGE\nY_IMAGE\nXWIN_IMAGE\nYWIN_IMAGE\nMAG_AUTO\nFLUX_AUTO\nFLUXERR_AUTO\n"
    "FLUX_APER(2)\nFLUXERR_APER(2)\nFLUX_RADIUS\nALPHA_J2000\nDELTA_J2000\nFLAGS\n"
    "MASKED_FRACTION\nSNR_WIN\nVIGNET(9,9)\n"
    "FLUX_TEMPLATE\nFLUXERR_TEMPLATE\nMAG_TEMPLATE\nMAGERR_TEMPLATE\nSNR_TEMPLATE\nCHI2_TEMPLATE\nBLEND_"
    "TEMPLATE\n"
    "XTEMPLATE_IMAGE\nYTEMPLATE_IMAGE\nALPHATEMPLATE_J2000\nDELTATEMPLATE_J2000\nCLASS_TEMPLATE\nRADIUS_"
    "TEMPLATE\n"
    "ELLIPTICITY_TEMPLATE\nTHETA_TEMPLATE\nGROUP_TEMPLATE\nFLAGS_TEMPLATE\nFLAGS_RESTORE\n";

/* Run on `image` with the outputs in the current folder. */
static rx_status run_stage(const char *image, const setting *settings, rx_error *err)
{
    static const setting common[] = {{"PARAMETERS_NAME", "columns.param"},
                                     {"HEADER_FACTS", "ALL"},
                                     {"PHOT_APERTURES", "6,10"},
                                     {"MAG_ZEROPOINT", "25"},
                                     {"CATALOG_TYPE", "FITS_1.0"},
                                     {"CATALOG_NAME", "out.cat"},
                                     {"PSF_TYPE", "MOFFAT"},
                                     {"PSF_FWHM", "3.5"},
                                     {"RL_NITER", "10"},
                                     {"QA_FIGURES", "N"},
                                     {NULL, NULL}};
    rx_config *config = NULL;
    write_text("columns.param", columns_text);
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    for (const setting *s = common; s->name != NULL; s++)
        assert_int_equal(rx_settings_set(&config->settings, s->name, s->value, NULL, NULL), RX_OK);
    for (const setting *s = settings; s->name != NULL; s++)
        assert_int_equal(rx_settings_set(&config->settings, s->name, s->value, NULL, NULL), RX_OK);
    rx_status status = rx_settings_complete(&config->settings, NULL, err);
    if (status == RX_OK)
        status = rx_stage_run(config, image, stdout, NULL, NULL, err);
    rx_config_free(config);
    return status;
}

static void expect_run(const char *image, const setting *settings)
{
    rx_error err = RX_ERROR_NONE;
    if (run_stage(image, settings, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
}

/* What stands for the bytes of the input: its digest, the digests and checksums of what tells it. */
static void blank_digests(char *bytes, size_t n)
{
    static const char checksum[] = "CHECKSUM= '";
    for (size_t i = 0; i < n; i++) {
        size_t run = 0;
        while (i + run < n && strchr("0123456789abcdef", bytes[i + run]) != NULL && bytes[i + run] != '\0')
            run++;
        if (run == RX_HASH_TEXT - 1)
            memset(bytes + i, '0', run);
        i += run;
        if (i + sizeof checksum + 16 < n && memcmp(bytes + i, checksum, sizeof checksum - 1) == 0)
            memset(bytes + i + sizeof checksum - 1, '0', 16);
    }
}

static void assert_same_but_digests(const char *a, const char *b)
{
    size_t na, nb;
    char *first = file_bytes(a, &na), *second = file_bytes(b, &nb);
    blank_digests(first, na);
    blank_digests(second, nb);
    if (na != nb || memcmp(first, second, na) != 0)
        fail_msg("%s and %s differ", a, b);
    free(first);
    free(second);
}

static const char *const products[] = {
    "out_NONE.cat",    "out_RL.cat",      "restored_NONE.fits", "restored_RL.fits", "segment_NONE.fits",
    "segment_RL.fits", "support_RL.fits", "residual_RL.fits",   "qa/bins.ecsv",     "qa/summary.json",
    "qa/report.html",  "left_NONE.fits",  "left_RL.fits",       "model_RL.fits",    "chi_RL.fits",
    "covar_NONE.cat",  "covar_RL.cat"};

static const setting everything[] = {
    {"RESTORE_TYPE", "NONE,RL"},
    {"CHECKIMAGE_TYPE",
     "RESTORED,SEGMENTATION,SUPPORT,RESIDUAL,TEMPLATE_RESIDUAL,TEMPLATE_MODEL,TEMPLATE_CHI"},
    {"CHECKIMAGE_NAME",
     "restored.fits,segment.fits,support.fits,residual.fits,left.fits,model.fits,chi.fits"},
    {"TEMPLATE_COVAR_NAME", "covar.cat"},
    {"WEIGHT_TYPE", "MAP_WEIGHT"},
    {"WEIGHT_IMAGE", "weight.fits"},
    {"MASK_SATURATED", "Y"},
    {"REFERENCE_NAME", "truth.fits"},
    {"QA_NAME", "qa"},
    {NULL, NULL}};

/* The products of this run, kept under another name to be compared with the next. */
static void keep(void)
{
    for (size_t i = 0; i < sizeof products / sizeof products[0]; i++) {
        char kept[256];
        snprintf(kept, sizeof kept, "%s.kept", products[i]);
        for (char *c = kept; *c != '\0'; c++)
            if (*c == '/')
                *c = '+';
        assert_int_equal(rename(products[i], kept), 0);
    }
}

static void compare_with_kept(void (*compare)(const char *, const char *))
{
    for (size_t i = 0; i < sizeof products / sizeof products[0]; i++) {
        char kept[256];
        snprintf(kept, sizeof kept, "%s.kept", products[i]);
        for (char *c = kept; *c != '\0'; c++)
            if (*c == '/')
                *c = '+';
        compare(products[i], kept);
    }
}

/* Put what a detector may leave there into the pixels that must not count. */
static void fill_hidden(scene *s, uint64_t seed)
{
    size_t n = (size_t)s->width * (size_t)s->height;
    for (size_t i = 0; i < n; i++) {
        int x = (int)(i % (size_t)s->width), y = (int)(i / (size_t)s->width);
        double u = rx_random_uniform(seed, 9, i);
        if (x == 60 || (x > 130 && x < 150 && y > 20 && y < 31)) {
            s->weights[i] = 0.0f;
            s->pixels[i] = (float)(1e4 * (2.0 * u - 1.0));
        }
        if (hypot(x - 100, y - 150) < 4.0)
            s->pixels[i] = (float)(20000.0 + 40000.0 * u);
    }
}

static void values_under_the_mask_reach_nothing(void **state)
{
    for (int turn = 0; turn < 2; turn++) {
        scene s;
        scene_make(&s, 200, 220, 60, 5);
        fill_hidden(&s, 100 + (uint64_t)turn);
        scene_write("tile.fits", s.pixels, s.width, s.height);
        scene_write("weight.fits", s.weights, s.width, s.height);
        scene_write_truth("truth.fits", &s);
        scene_free(&s);
        expect_run("tile.fits", everything);
        if (turn == 0)
            keep();
    }
    compare_with_kept(assert_same_but_digests);
}

static double value(const rx_table *table, const char *name, long row)
{
    return rx_column_value(&table->columns[rx_table_find(table, name)], row, 0);
}

/* Positions and shapes of `a`, `scale` times its fluxes: of its very pixels, but photons weigh otherwise. */
static void assert_forced(const rx_table *a, const rx_table *b, double scale)
{
    static const char *const kept[] = {"XTEMPLATE_IMAGE",     "YTEMPLATE_IMAGE", "ALPHATEMPLATE_J2000",
                                       "DELTATEMPLATE_J2000", "RADIUS_TEMPLATE", "CLASS_TEMPLATE"};
    long compared = 0;
    for (long i = 0; i < a->nrows; i++) {
        const double one = value(a, "FLUX_TEMPLATE", i), two = value(b, "FLUX_TEMPLATE", i);
        const double error = value(a, "FLUXERR_TEMPLATE", i);
        const int explained = value(a, "CHI2_TEMPLATE", i) < 2; /* else the weights decide */
        compared += explained;
        if (explained && !(fabs(two / scale - one) < 0.5 * error))
            fail_msg("row %ld: %g of %g +- %g", i, two, one, error);
        for (size_t k = 0; k < sizeof kept / sizeof kept[0]; k++)
            assert_true(value(a, kept[k], i) == value(b, kept[k], i));
    }
    assert_true(compared > 20);
}

static void the_second_image_is_measured(void **state)
{
    scene s;
    scene_make(&s, 200, 200, 40, 8);
    scene_write("detect.fits", s.pixels, s.width, s.height);
    for (size_t i = 0; i < (size_t)s.width * (size_t)s.height; i++)
        s.pixels[i] *= 2.0f;
    scene_write("measure.fits", s.pixels, s.width, s.height);
    scene_free(&s);
    const setting single[] = {{"RESTORE_TYPE", "NONE"}, {"CATALOG_NAME", "single.cat"}, {NULL, NULL}};
    const setting dual[] = {{"RESTORE_TYPE", "NONE"}, {"CATALOG_NAME", "dual.cat"}, {NULL, NULL}};
    expect_run("detect.fits", single);
    expect_run("detect.fits,measure.fits", dual);
    rx_table *a = NULL, *b = NULL;
    assert_int_equal(rx_catalog_read("single.cat", 0, &a, NULL), RX_OK);
    assert_int_equal(rx_catalog_read("dual.cat", 0, &b, NULL), RX_OK);
    assert_true(a->nrows > 20);
    assert_int_equal(a->nrows, b->nrows);
    int flux = rx_table_find(a, "FLUX_APER");
    for (long i = 0; i < a->nrows; i++) {
        double one = rx_column_value(&a->columns[flux], i, 0), two = rx_column_value(&b->columns[flux], i, 0);
        assert_true(fabs(two - 2.0 * one) < 1e-3 * fabs(one) + 1.0);
    }
    assert_forced(a, b, 2.0);
    rx_table_free(a);
    rx_table_free(b);
}

/* Two check-images hold the same pixels but for a factor. */
static void assert_images(const char *path, const char *other, double factor)
{
    float *a = NULL, *b = NULL;
    int width, height, w, h;
    assert_int_equal(rx_fits_read_image(path, &a, &width, &height, NULL), RX_OK);
    assert_int_equal(rx_fits_read_image(other, &b, &w, &h, NULL), RX_OK);
    assert_int_equal(w, width);
    assert_int_equal(h, height);
    for (int i = 0; i < width * height; i++)
        if (isnan(a[i]) || isnan(b[i]))
            assert_int_equal(isnan(a[i]), isnan(b[i]));
        else
            assert_near((double)a[i], factor * (double)b[i], 1e-5 * fabs((double)a[i]));
    free(a);
    free(b);
}

/* Which image a check-image shows is as in SExtractor: the first seven the measurement image. */
static void check_images_of_two_images(void **state)
{
    enum { MEASURED = 7, OBJECTS = 5, KINDS = 11 };
    static const char kinds[] =
        "BACKGROUND,-BACKGROUND,MINIBACKGROUND,MINIBACK_RMS,IDENTICAL,OBJECTS,-OBJECTS,"
        "BACKGROUND_RMS,FILTERED,RESTORED,SEGMENTATION";
    static const char *const images[] = {"d.fits", "m.fits", "d.fits,m.fits"};
    scene s;
    scene_make(&s, 160, 150, 20, 8);
    scene_write("d.fits", s.pixels, s.width, s.height);
    for (size_t i = 0; i < (size_t)s.width * (size_t)s.height; i++)
        s.pixels[i] = 3.0f * s.pixels[i] + 100.0f; /* the same sources at the same S/N */
    s.pixels[75 * s.width + 80] = NAN;
    scene_write("m.fits", s.pixels, s.width, s.height);
    scene_free(&s);
    for (int restored = 0; restored < 2; restored++) {
        for (int run = 0; run < 3; run++) {
            char names[200] = "";
            for (int k = 0; k < KINDS; k++)
                snprintf(names + strlen(names), sizeof names - strlen(names), "%s%d-%d.fits",
                         k > 0 ? "," : "", run, k);
            const setting list[] = {{"RESTORE_TYPE", restored ? "RL" : "NONE"},
                                    {"CHECKIMAGE_TYPE", kinds},
                                    {"CHECKIMAGE_NAME", names},
                                    {"CATALOG_TYPE", "NONE"},
                                    {NULL, NULL}};
            expect_run(images[run], list);
        }
        for (int k = 0; k < KINDS; k++) {
            char two[20], one[20];
            if (restored && (k == OBJECTS || k == OBJECTS + 1))
                continue; /* the footprints of d.fits are not to the pixel those of m.fits */
            snprintf(two, sizeof two, "2-%d.fits", k);
            snprintf(one, sizeof one, "%d-%d.fits", k < MEASURED, k);
            assert_images(two, one, 1.0);
        }
    }
}

/* The filter of CONV NONORM is not divided by its sum, as in SExtractor. */
static void a_filter_that_is_not_normalised(void **state)
{
    scene s;
    setting list[] = {{"RESTORE_TYPE", "NONE"},
                      {"FILTER_NAME", "a.conv"},
                      {"DETECT_THRESH", "40"},
                      {"CHECKIMAGE_TYPE", "FILTERED"},
                      {"CHECKIMAGE_NAME", "a.fits"},
                      {"CATALOG_TYPE", "NONE"},
                      {NULL, NULL}};
    scene_make(&s, 160, 150, 20, 8);
    scene_write("d.fits", s.pixels, s.width, s.height);
    scene_free(&s);
    write_text("a.conv", "CONV NORM\n-1 2 1\n2 9 2\n1 2 1\n");
    write_text("b.conv", "CONV NONORM\n-1 2 1\n2 9 2\n1 2 1\n");
    expect_run("d.fits", list);
    list[1].value = "b.conv";
    list[4].value = "b.fits";
    expect_run("d.fits", list);
    assert_images("b.fits", "a.fits", 21.0);
}

static float *plane(const char *path, int width, int height)
{
    float *pixels = NULL;
    int w = 0, h = 0;
    rx_error err = RX_ERROR_NONE;
    if (rx_fits_read_image(path, &pixels, &w, &h, &err) != RX_OK)
        fail_msg("%s: %s", path, err.text);
    assert_true(w == width);
    assert_true(h == height);
    return pixels;
}

static double header_number(const char *path, const char *key)
{
    char *cards = NULL;
    long n = 0;
    double value = NAN;
    assert_int_equal(rx_fits_read_header(path, 0, &cards, &n, NULL), RX_OK);
    if (!rx_cards_number(cards, n, key, &value))
        fail_msg("%s has no %s", path, key);
    free(cards);
    return value;
}

/* model + residual = input - level - the sky between the templates; chi counts noise and photons. */
static void check_template_images(const scene *s, int with_sky)
{
    const char *names[] = {"left.fits", "model.fits", "chi.fits", "level.fits", "rms.fits"};
    float *p[5];
    double sum = 0;
    long used = 0;
    for (int i = 0; i < 5; i++)
        p[i] = plane(names[i], s->width, s->height);
    for (size_t i = 0; i < (size_t)s->width * (size_t)s->height; i++) {
        assert_true(isfinite(p[1][i]));
        if (s->weights[i] == 0) {
            assert_true(isnan(p[0][i]));
            assert_true(isnan(p[2][i]));
            continue;
        }
        const double left = p[0][i], model = p[1][i], rms = p[4][i];
        const double sky = (double)s->pixels[i] - (double)p[3][i] - model - left;
        if (fabs(sky) > (with_sky ? 1.5 : 1e-6 * fabs((double)s->pixels[i]) + 1e-3))
            fail_msg("pixel %zu: %g more than level, model and residual", i, sky);
        assert_near(p[2][i], left / sqrt(rms * rms + fmax(model, 0) / 2.0), 1e-3);
        sum += sky;
        used++;
    }
    assert_int_equal(used, s->width * s->height - 20 * 10);
    const double told = header_number("left.fits", "RXTPSKY");
    if (with_sky) {
        assert_true(fabs(told) > 1e-4);
        assert_true(fabs(sum / (double)used - told) < 0.1 * fabs(told) + 0.01);
    } else
        assert_true(told == 0);
    for (int i = 0; i < 5; i++)
        free(p[i]);
}

static void template_images_add_up(void **state)
{
    scene s;
    scene_make(&s, 200, 220, 40, 12);
    for (int y = 21; y < 31; y++)
        for (int x = 130; x < 150; x++)
            s.weights[y * s.width + x] = 0;
    scene_write("tile.fits", s.pixels, s.width, s.height);
    scene_write("weight.fits", s.weights, s.width, s.height);
    for (int with_sky = 0; with_sky < 2; with_sky++) {
        const setting settings[] = {
            {"RESTORE_TYPE", with_sky ? "RL" : "NONE"},
            {"TEMPLATE_BACKSIZE", with_sky ? "64" : "0"},
            {"WEIGHT_TYPE", "MAP_WEIGHT"},
            {"WEIGHT_IMAGE", "weight.fits"},
            {"CHECKIMAGE_TYPE", "TEMPLATE_RESIDUAL,TEMPLATE_MODEL,TEMPLATE_CHI,BACKGROUND,BACKGROUND_RMS"},
            {"CHECKIMAGE_NAME", "left.fits,model.fits,chi.fits,level.fits,rms.fits"},
            {NULL, NULL}};
        expect_run("tile.fits", settings);
        check_template_images(&s, with_sky);
    }
    scene_free(&s);
}

/* Two images in one file: each has its own templates, groups and covariances. */
static void every_image_of_a_file_is_fitted(void **state)
{
    scene s[2];
    rx_fits_writer *writer = NULL;
    const setting settings[] = {{"RESTORE_TYPE", "NONE"}, {"CATALOG_TYPE", "FITS_LDAC"},        {"GAIN", "2"},
                                {"GAIN_KEY", "NOGAIN"},   {"TEMPLATE_COVAR_NAME", "covar.cat"}, {NULL, NULL}};
    assert_int_equal(rx_fits_create("both.fits", "both.fits", &writer, NULL), RX_OK);
    for (int k = 0; k < 2; k++) {
        scene_make(&s[k], 150, 140, 60, 13 + (uint64_t)k);
        assert_int_equal(rx_fits_image(writer,
                                       &(rx_fits_plane){.extname = k == 0 ? "" : "TWO",
                                                        .width = 150,
                                                        .height = 140,
                                                        .floats = s[k].pixels},
                                       NULL, NULL),
                         RX_OK);
    }
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    expect_run("both.fits", settings);
    rx_table *together[2], *covariances[2];
    for (int k = 0; k < 2; k++) {
        assert_int_equal(rx_catalog_read("out.cat", k, &together[k], NULL), RX_OK);
        assert_int_equal(rx_catalog_read("covar.cat", k, &covariances[k], NULL), RX_OK);
        assert_true(covariances[k]->nrows > 0);
        for (long i = 0; i < covariances[k]->nrows; i++)
            assert_int_equal(rx_column_value(&covariances[k]->columns[0], i, 0), k + 1);
    }
    for (int k = 0; k < 2; k++) {
        rx_table *alone = NULL, *pairs = NULL;
        char name[32];
        snprintf(name, sizeof name, "both.fits[%d]", k);
        expect_run(name, settings);
        assert_int_equal(rx_catalog_read("out.cat", 0, &alone, NULL), RX_OK);
        assert_int_equal(rx_catalog_read("covar.cat", 0, &pairs, NULL), RX_OK);
        assert_int_equal(alone->nrows, together[k]->nrows);
        assert_int_equal(pairs->nrows, covariances[k]->nrows);
        assert_true(alone->nrows > 10);
        for (long i = 0; i < alone->nrows; i++) {
            const double flux = value(alone, "FLUX_TEMPLATE", i);
            assert_true(isfinite(flux));
            assert_true(flux == value(together[k], "FLUX_TEMPLATE", i));
            assert_true(value(alone, "GROUP_TEMPLATE", i) == value(together[k], "GROUP_TEMPLATE", i));
        }
        rx_table_free(alone);
        rx_table_free(pairs);
        rx_table_free(together[k]);
        rx_table_free(covariances[k]);
        scene_free(&s[k]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(values_under_the_mask_reach_nothing, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(the_second_image_is_measured, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(check_images_of_two_images, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(a_filter_that_is_not_normalised, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(template_images_add_up, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(every_image_of_a_file_is_fitted, enter_scratch, leave_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
