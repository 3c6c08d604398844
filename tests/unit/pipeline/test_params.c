/* What the rows of config/keys.def fill, of all of rx_options at once; and the pipeline's params by keywords. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "../near.h"
#include "base/threads.h"
#include "config/keyword.h"
#include "stage/options.h"
#include "stage/pipeline.h"

#include "config/fill_rows.h"

/* clang-format off */
#define PIPELINE_WORDS RX_FILL_WORDS
#define PIPELINE(how, field) STAGE(how, pipeline.field)
#define BACKGROUNDS(how, field) PIPELINE(how, background[0].field), PIPELINE(how, background[1].field)
#define STAGE_WORDS RX_FILL_WORDS
#define STAGE(how, field) RX_FILL(rx_options, how, field)
#define TILES(how, field) STAGE(how, tile[0].field), STAGE(how, tile[1].field)
static const rx_fill rows[] = {
#include "config/keys.def"
};
/* clang-format on */

enum { ROWS = sizeof rows / sizeof rows[0] };

static const rx_keyword *keyword(const char *name)
{
    const rx_keytable *table = rx_keytable_rextract();
    return &table->rows[rx_keyword_find(table, name)];
}

static bool is_word(const rx_keyword *key)
{
    return key->kind == RX_KIND_WORD || key->kind == RX_KIND_WORDS;
}

static void check_field(const rx_fill *row, const rx_keyword *key, const int *words)
{
    const bool string = row->type == RX_FILLS_STRING, inside = row->offset < sizeof(rx_pipeline_params);
    const bool text = key->kind == RX_KIND_STRING || key->kind == RX_KIND_STRINGS;
    const bool real = key->kind == RX_KIND_REAL || key->kind == RX_KIND_REALS;
    if (is_word(key) ? string == (words != NULL) : string != text)
        fail_msg("%s: its kind does not go with its field, or its words have no values", key->name);
    if (row->how != RX_FILL_COUNT && real != (row->type == RX_FILLS_DOUBLE))
        fail_msg("%s: a real number goes into a double, and nothing else does", key->name);
    if ((row->how == RX_FILL_ITEM || row->how == RX_FILL_GIVEN || row->how == RX_FILL_NOT) &&
        row->arg >= key->nmax)
        fail_msg("%s has no item %d", key->name, row->arg);
    if (row->how == RX_FILL_ALL && row->size < (size_t)key->nmax * (real ? sizeof(double) : sizeof(int)))
        fail_msg("%s: the array is too small for %d items", key->name, key->nmax);
    if (row->how == RX_FILL_BIT && !is_word(key))
        fail_msg("%s has no bits", key->name);
    /* the pipeline's own rows hold no names: rx_pipeline_defaults() has none that would last */
    if (string && inside && strcmp(key->name, "PSF_NAME") != 0 && strcmp(key->name, "PSF_STARS_NAME") != 0)
        fail_msg("%s: names in the pipeline's params are the stage's business", key->name);
}

static void rows_go_with_their_fields(void **state)
{
    (void)state;
    const rx_keyword *key = NULL;
    const int *words = NULL;
    int fields = 0;
    assert_int_equal(offsetof(rx_options, pipeline), 0);
    for (int i = 0; i < ROWS; i++) {
        if (rows[i].keyword != NULL) {
            key = keyword(rows[i].keyword);
            words = rows[i].words;
            continue;
        }
        if (rows[i].type == RX_FILLS_NOTHING) /* NEEDS */
            continue;
        fields++;
        check_field(&rows[i], key, words);
        if (key->status == RX_STATUS_IGNORED || key->status == RX_STATUS_INERT)
            fail_msg("%s is said to have no effect", key->name);
        for (int j = 0; j < i; j++)
            if (rows[j].keyword == NULL && rows[j].offset < rows[i].offset + rows[i].size &&
                rows[i].offset < rows[j].offset + rows[j].size)
                fail_msg("%s fills what another row fills", key->name);
    }
    assert_true(fields > 120);
}

/* Two words with one meaning are a slip, but for these. */
static void words_differ_in_what_they_mean(void **state)
{
    (void)state;
    for (int i = 0; i < ROWS; i++) {
        if (rows[i].words == NULL)
            continue;
        const rx_keyword *key = keyword(rows[i].keyword);
        for (int a = 0; key->words[a] != NULL; a++)
            for (int b = 0; b < a; b++)
                if (rows[i].words[a] == rows[i].words[b] && strcmp(key->words[a], "FITS") != 0 &&
                    strcmp(key->words[a], "F32") != 0)
                    fail_msg("%s: %s and %s mean the same", key->name, key->words[b], key->words[a]);
    }
}

/* The pipeline by itself stands where the program stands without a configuration. */
static void defaults_are_those_of_the_program(void **state)
{
    (void)state;
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_pipeline_params alone;
    int compared = 0;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_options_from_config(config, NULL, &options, NULL), RX_OK);
    assert_int_equal(rx_pipeline_defaults(&alone, NULL), RX_OK);
    for (int i = 0; i < ROWS; i++) {
        const rx_fill *row = &rows[i];
        if (row->keyword != NULL || row->type == RX_FILLS_STRING || row->offset >= sizeof alone)
            continue;
        compared++;
        assert_memory_equal((char *)&alone + row->offset, (char *)options + row->offset, row->size);
    }
    assert_true(compared > 60);
    assert_null(alone.psf_files[0]);
    assert_int_equal(alone.detect.filter_width, options->pipeline.detect.filter_width);
    assert_int_equal(alone.detect.filter_normalise, options->pipeline.detect.filter_normalise);
    assert_memory_equal(alone.detect.filter, options->pipeline.detect.filter, 9 * sizeof(float));
    assert_near(alone.templates.par.link, rx_tphot_defaults().link, 0); /* no keyword */
    assert_near(alone.detect.threshold, 5.0, 0);                        /* once by hand */
    assert_int_equal(alone.restore.rl_niter, 18);
    assert_int_equal(alone.psf.type, RX_PSF_AUTO);
    assert_int_equal(alone.seed, 1);
    assert_int_equal(alone.measure.naper, 1);
    rx_options_free(options);
    rx_config_free(config);
}

static void threads_go_to_every_stage(void **state)
{
    (void)state;
    rx_pipeline_params params;
    assert_int_equal(rx_pipeline_defaults(&params, NULL), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "NTHREADS", "7", NULL), RX_OK);
    assert_int_equal(params.nthreads, 7);
    assert_int_equal(params.background[0].nthreads, 7);
    assert_int_equal(params.background[1].nthreads, 7);
    assert_int_equal(params.restore.nthreads, 7);
    assert_int_equal(params.detect.nthreads, 7);
    assert_int_equal(params.measure.nthreads, 7);
    assert_int_equal(params.templates.par.nthreads, 7);
    assert_int_equal(params.psf.nthreads, 7);
}

static void params_by_keyword(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    rx_pipeline_params params;
    assert_int_equal(rx_pipeline_defaults(&params, NULL), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "DETECT_THRESH", "2.0", &err), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "PHOT_APERTURES", "3,5,8", &err), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "MASK_SATURATED", "Y", &err), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "TEMPLATE_TYPE", "PROFILE", &err), RX_OK);
    assert_near(params.detect.threshold, 2, 0);
    assert_near(params.detect.analysis_threshold, 1.5, 0);
    assert_int_equal(params.measure.naper, 3);
    assert_near(params.measure.aperture_diameter[2], 8, 0);
    assert_int_equal(params.restore.mask_saturated, 1);
    assert_int_equal(params.saturated_in_none, 1);
    assert_int_equal(params.templates.par.extended, 1);
    assert_int_equal(params.templates.par.substructure, 0);
    assert_int_equal(rx_pipeline_set(&params, "PSF_NAME", "a.psf", &err), RX_USAGE);
    assert_null(params.psf_files[0]);
    assert_int_equal(rx_pipeline_set(&params, "CATALOG_NAME", "a.cat", &err), RX_USAGE);
    assert_int_equal(rx_pipeline_set(&params, "RL_NITER", "-1", &err), RX_USAGE);
    assert_int_equal(params.restore.rl_niter, 18);
}

/* Keywords that are more than a value in a field. */
static void decisions_by_keyword(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    rx_pipeline_params params;
    assert_int_equal(rx_pipeline_defaults(&params, NULL), RX_OK);
    assert_ptr_equal(params.restorer, rx_restorer_find("RL"));
    assert_int_equal(params.nthreads, rx_threads_count(0));
    assert_int_equal(params.seeing_stated, false);
    assert_near(params.stated_scale, 0, 0);
    assert_int_equal(rx_pipeline_set(&params, "restore_type", "NONE", &err), RX_OK);
    assert_ptr_equal(params.restorer, rx_restorer_find("NONE"));
    assert_int_equal(rx_pipeline_set(&params, "RESTORE_TYPE", "RL,NET", &err), RX_USAGE);
    assert_non_null(strstr(err.text, "2 are named; give one"));
    assert_ptr_equal(params.restorer, rx_restorer_find("NONE"));
    assert_int_equal(params.detect.filter_auto, 1);
    assert_int_equal(rx_pipeline_set(&params, "FILTER", "N", &err), RX_OK);
    assert_null(params.detect.filter);
    assert_int_equal(params.detect.filter_auto, 0); /* SExtractor's detection, at its threshold */
    assert_near(params.detect.threshold, 1.5, 1e-12);
    assert_int_equal(rx_pipeline_set(&params, "FILTER", "Y", &err), RX_OK);
    assert_ptr_equal(params.detect.filter, rx_kernel_built_in);
    assert_int_equal(rx_pipeline_set(&params, "NTHREADS", "3", &err), RX_OK);
    assert_int_equal(params.measure.nthreads, 3);
    assert_int_equal(rx_pipeline_set(&params, "PIXEL_SCALE", "0.4", &err), RX_OK);
    assert_near(params.stated_scale, 0.4, 0);
    assert_int_equal(params.seeing_stated, false);
    assert_int_equal(rx_pipeline_set(&params, "SEEING_FWHM", "0.9", &err), RX_OK);
    assert_int_equal(params.seeing_stated, true);
    assert_near(params.seeing_arcsec, 0.9, 0);
    assert_int_equal(rx_pipeline_set(&params, "DETECT_THRESH", "22.5,25", &err), RX_USAGE);
    assert_near(params.detect.threshold, 1.5, 1e-12);
    assert_int_equal(rx_pipeline_set(&params, "DETECT_THRESH", "2", &err), RX_OK);
    assert_int_equal(params.detect.filter_auto, 0);
    assert_int_equal(rx_pipeline_set(&params, "FILTER_TYPE", "AUTO", &err), RX_OK);
    assert_int_equal(params.detect.filter_auto, 1);
    assert_near(params.detect.significance, 2.0, 0);
    assert_int_equal(rx_pipeline_set(&params, "THRESH_TYPE", "ABSOLUTE", &err), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "FILTER_TYPE", "AUTO", &err), RX_OK);
    assert_int_equal(params.detect.filter_auto, 0); /* ADU are of pixels */
    assert_int_equal(rx_pipeline_set(&params, "THRESH_TYPE", "SIGNIFICANCE", &err), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "DETECT_THRES", "2", &err), RX_USAGE);
    assert_non_null(strstr(err.text, "did you mean"));
}

/* Keywords with one word in two fields, as they were told apart by hand. */
static void words_for_two_fields(void **state)
{
    static const struct {
        const char *word;
        int none, restored;
    } cases[] = {{"AUTO", 0, 1}, {"Y", 1, 1}, {"N", 0, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_pipeline_params params;
        assert_int_equal(rx_pipeline_defaults(&params, NULL), RX_OK);
        assert_int_equal(rx_pipeline_set(&params, "MASK_SATURATED", cases[i].word, NULL), RX_OK);
        assert_int_equal(rx_pipeline_set(&params, "ERROR_CALIBRATION", cases[i].word, NULL), RX_OK);
        assert_int_equal(params.saturated_in_none, cases[i].none);
        assert_int_equal(params.restore.mask_saturated, cases[i].restored);
        assert_int_equal(params.calibrate_none, cases[i].none);
        assert_int_equal(params.calibrate_restored, cases[i].restored);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_go_with_their_fields),
        cmocka_unit_test(words_differ_in_what_they_mean),
        cmocka_unit_test(defaults_are_those_of_the_program),
        cmocka_unit_test(threads_go_to_every_stage),
        cmocka_unit_test(params_by_keyword),
        cmocka_unit_test(decisions_by_keyword),
        cmocka_unit_test(words_for_two_fields),
    };
    return cmocka_run_group_tests_name("params", tests, NULL, NULL);
}
