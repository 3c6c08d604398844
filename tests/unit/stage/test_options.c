/* From keywords to params: what depends on more than a row of keys.def, and what SExtractor leaves implicit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../near.h"
#include "nn/psfnet.h"
#include "stage/inputs.h"
#include "stage/options.h"

static rx_options *options_with(const char *name, const char *value)
{
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    if (name != NULL)
        assert_int_equal(rx_config_set(config, name, value, NULL, NULL), RX_OK);
    if (rx_options_from_config(config, NULL, &options, &err) != RX_OK)
        fail_msg("%s %s: %s", name, value, err.text);
    /* names in options belong to the configuration: only numbers are looked at here */
    rx_config_free(config);
    return options;
}

/* A network without weights, as a file in a folder of its own. */
static void make_model(char folder[64], char path[96])
{
    const rx_psfnet_shape shape = {.stem = RX_STEM_UNSHUFFLE,
                                   .decoder = RX_DECODER_BILINEAR,
                                   .width = 4,
                                   .blocks = 1,
                                   .stem_kernel = 3,
                                   .kernel = 3};
    rx_model *model = rx_model_new();
    assert_non_null(model);
    assert_int_equal(rx_psfnet_new(&shape, rx_front_channels(model->front.mode), &model->restore, NULL),
                     RX_OK);
    snprintf(model->name, sizeof model->name, "toy");
    snprintf(folder, 64, "%s", "/tmp/rextract-options-XXXXXX");
    assert_non_null(mkdtemp(folder));
    snprintf(path, 96, "%s/model.fits", folder);
    assert_int_equal(rx_model_write(model, path, path, NULL), RX_OK);
    rx_model_free(model);
}

static void every_restorer_of_the_table_is_a_word(void **state)
{
    (void)state;
    int n;
    char folder[64], path[96];
    const rx_restorer *kinds = rx_restorers(&n);
    make_model(folder, path);
    for (int i = 0; i < n; i++) {
        rx_config *config = NULL;
        rx_options *options = NULL;
        assert_int_equal(rx_config_new(&config, NULL), RX_OK);
        assert_int_equal(rx_config_set(config, "NET_MODEL", path, NULL, NULL), RX_OK);
        assert_int_equal(rx_config_set(config, "RESTORE_TYPE", kinds[i].name, NULL, NULL), RX_OK);
        assert_int_equal(rx_options_from_config(config, NULL, &options, NULL), RX_OK);
        assert_int_equal(options->nrestorers, 1);
        assert_ptr_equal(options->restorers[0], &kinds[i]);
        /* the model is read for the network alone, or when a campaign asks for it */
        assert_int_equal(options->pipeline.restore.model != NULL, strcmp(kinds[i].name, "NET") == 0);
        assert_int_equal(rx_options_need_model(options, NULL, NULL), RX_OK);
        assert_ptr_equal(options->pipeline.restore.model, options->model);
        assert_string_equal(options->model->name, "toy");
        rx_options_free(options);
        rx_config_free(config);
    }
    unlink(path);
    rmdir(folder);
}

static void a_model_is_looked_for_here_and_among_installed_data(void **state)
{
    (void)state;
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_config_set(config, "RESTORE_TYPE", "NET", NULL, NULL), RX_OK);
    assert_int_equal(rx_config_set(config, "NET_MODEL", "no-such-model.fits", NULL, NULL), RX_OK);
    assert_int_equal(rx_options_from_config(config, NULL, &options, &err), RX_INPUT);
    assert_string_equal(err.where, "no-such-model.fits");
    assert_non_null(strstr(err.text, RX_DATA_FOLDER));
    assert_int_equal(rx_config_set(config, "NET_MODEL", "./no-such-model.fits", NULL, NULL), RX_OK);
    err = RX_ERROR_NONE;
    assert_int_equal(rx_options_from_config(config, NULL, &options, &err), RX_INPUT);
    assert_null(strstr(err.text, RX_DATA_FOLDER));
    rx_config_free(config);
}

static void put(const char *path)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fclose(file);
}

static void is_found(const char *name, const char *installed, const char *expected)
{
    rx_text path = {0};
    rx_input_model(name, installed, &path);
    assert_false(path.failed);
    assert_string_equal(path.data, expected);
    rx_text_free(&path);
}

/* What lies in the current folder never stands in for an installed model. */
static void an_installed_model_comes_first(void **state)
{
    (void)state;
    char here[4096], folder[] = "/tmp/rextract-options-XXXXXX", path[64];
    assert_non_null(getcwd(here, sizeof here));
    assert_non_null(mkdtemp(folder));
    assert_int_equal(chdir(folder), 0);
    assert_int_equal(mkdir("data", 0777), 0);
    put("net.fits");
    is_found("net.fits", "data", "net.fits"); /* none is installed */
    put("data/net.fits");
    is_found("net.fits", "data", "data/net.fits");
    is_found("./net.fits", "data", "./net.fits");
    snprintf(path, sizeof path, "%s/net.fits", folder);
    is_found(path, "data", path);
    is_found("other.fits", "data", "other.fits"); /* nowhere */
    assert_int_equal(remove("net.fits") + remove("data/net.fits") + remove("data"), 0);
    assert_int_equal(chdir(here), 0);
    assert_int_equal(rmdir(folder), 0);
}

/* A training that has not ended writes such a model: it is not taken unless NET_MODEL was set. */
static void an_unfinished_model_must_be_named(void **state)
{
    (void)state;
    char folder[64], path[96];
    rx_error err = RX_ERROR_NONE;
    rx_model *model = NULL;
    make_model(folder, path);
    assert_int_equal(rx_model_read(path, &model, NULL), RX_OK);
    model->ended = 0;
    model->epochs = 7;
    model->best = 5;
    unlink(path);
    assert_int_equal(rx_model_write(model, path, path, NULL), RX_OK);
    rx_model_free(model);
    for (int set = 0; set < 2; set++) {
        rx_options *options = options_with("RESTORE_TYPE", "NONE");
        assert_int_equal(options->model_set, 0);
        options->model_name = path;
        options->model_set = set;
        assert_int_equal(rx_options_need_model(options, NULL, &err), set ? RX_OK : RX_INPUT);
        rx_options_free(options);
    }
    assert_non_null(
        strstr(err.text, "its training has not ended, it is of epoch 5 after 7; let it end, or name"));
    rx_options *options = options_with("NET_MODEL", path);
    assert_int_equal(options->model_set, 1);
    rx_options_free(options);
    unlink(path);
    rmdir(folder);
}

static void short_lists_repeat_their_last_item(void **state)
{
    (void)state;
    rx_options *options = options_with("BACK_SIZE", "48");
    assert_int_equal(options->pipeline.background[0].mesh_width, 48);
    assert_int_equal(options->pipeline.background[0].mesh_height, 48);
    rx_options_free(options);
    options = options_with("WEIGHT_TYPE", "MAP_RMS,MAP_VAR");
    assert_int_equal(options->tile[0].weight_type, RX_WEIGHT_MAP_RMS);
    assert_int_equal(options->tile[1].weight_type, RX_WEIGHT_MAP_VAR);
    rx_options_free(options);
}

/* DETECT_THRESH 22.5,25: 22.5 mag/arcsec2 at zero point 25 is 10 ADU/arcsec2, a pixel being 1 arcsec2. */
static void surface_brightness_becomes_adu(void **state)
{
    (void)state;
    rx_options *options = options_with("DETECT_THRESH", "22.5,25");
    assert_true(options->pipeline.detect.absolute);
    assert_near(options->pipeline.detect.threshold, 10.0, 1e-9);
    rx_options_free(options);
}

static void an_unset_pixel_scale_is_unknown(void **state)
{
    (void)state;
    rx_options *options = options_with(NULL, NULL);
    assert_near(options->pipeline.stated_scale, 0.0, 0.0);
    rx_options_free(options);
    options = options_with("PIXEL_SCALE", "0.4");
    assert_near(options->pipeline.stated_scale, 0.4, 1e-12);
    rx_options_free(options);
}

static void gates_need_a_reference(void **state)
{
    (void)state;
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_config_set(config, "QA_GATES", "gates.qa", NULL, NULL), RX_OK);
    assert_int_equal(rx_options_from_config(config, NULL, &options, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "REFERENCE_NAME"));
    rx_config_free(config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_restorer_of_the_table_is_a_word),
        cmocka_unit_test(a_model_is_looked_for_here_and_among_installed_data),
        cmocka_unit_test(an_installed_model_comes_first),
        cmocka_unit_test(an_unfinished_model_must_be_named),
        cmocka_unit_test(short_lists_repeat_their_last_item),
        cmocka_unit_test(surface_brightness_becomes_adu),
        cmocka_unit_test(an_unset_pixel_scale_is_unknown),
        cmocka_unit_test(gates_need_a_reference),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
