/* From keywords to params: what depends on more than a row of keys.def, and what SExtractor leaves implicit. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../near.h"
#include "../scratch.h"
#include "../small_net.h"
#include "stage/options.h"

static rx_options *options_with(const char *name, const char *value)
{
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    if (name != NULL)
        assert_int_equal(rx_settings_set(&config->settings, name, value, NULL, NULL), RX_OK);
    if (rx_options_from_config(config, NULL, &options, &err) != RX_OK)
        fail_msg("%s %s: %s", name, value, err.text);
    /* names in options belong to the configuration: only numbers are looked at here */
    rx_config_free(config);
    return options;
}

static const char path[] = "model.fits";

/* A network without weights, as a file. */
static void make_model(void)
{
    rx_model *model = rx_model_new();
    assert_non_null(model);
    model->restore = small_net(rx_front_channels(model->front.mode), 1);
    snprintf(model->name, sizeof model->name, "toy");
    assert_int_equal(rx_model_write(model, path, path, NULL), RX_OK);
    rx_model_free(model);
}

static void every_restorer_of_the_table_is_a_word(void **state)
{
    int n;
    const rx_restorer *kinds = rx_restorers(&n);
    make_model();
    for (int i = 0; i < n; i++) {
        rx_config *config = NULL;
        rx_options *options = NULL;
        assert_int_equal(rx_config_new(&config, NULL), RX_OK);
        assert_int_equal(rx_settings_set(&config->settings, "NET_MODEL", path, NULL, NULL), RX_OK);
        assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", kinds[i].name, NULL, NULL),
                         RX_OK);
        assert_int_equal(rx_settings_set(&config->settings, "RESTORED_NAME", path, NULL, NULL),
                         RX_OK); /* FILE */
        assert_int_equal(rx_settings_set(&config->settings, "RESTORED_PSF", "2", NULL, NULL), RX_OK);
        assert_int_equal(rx_options_from_config(config, NULL, &options, NULL), RX_OK);
        assert_int_equal(options->nrestorers, 1);
        assert_ptr_equal(options->restorers[0], &kinds[i]);
        /* the model is read for the network, and for AUTO, which may take it */
        assert_int_equal(options->pipeline.restore.model != NULL,
                         strcmp(kinds[i].name, "NET") == 0 || rx_restorer_is_auto(&kinds[i]));
        assert_ptr_equal(options->pipeline.restore.model, options->model);
        rx_options_free(options);
        rx_config_free(config);
    }
}

static void a_model_is_looked_for_here_and_among_installed_data(void **state)
{
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", "NET", NULL, NULL), RX_OK);
    assert_int_equal(rx_settings_set(&config->settings, "NET_MODEL", "no-such-model.fits", NULL, NULL),
                     RX_OK);
    assert_int_equal(rx_options_from_config(config, NULL, &options, &err), RX_INPUT);
    assert_string_equal(err.where, "no-such-model.fits");
    assert_non_null(strstr(err.text, RX_DATA_FOLDER));
    assert_int_equal(rx_settings_set(&config->settings, "NET_MODEL", "./no-such-model.fits", NULL, NULL),
                     RX_OK);
    err = RX_ERROR_NONE;
    assert_int_equal(rx_options_from_config(config, NULL, &options, &err), RX_INPUT);
    assert_null(strstr(err.text, RX_DATA_FOLDER));
    rx_config_free(config);
}

static void is_found(const char *name, const char *installed, const char *expected)
{
    rx_text path = {0};
    rx_options_model_path(name, installed, &path);
    assert_false(path.failed);
    assert_string_equal(path.data, expected);
    rx_text_free(&path);
}

/* What lies in the current folder never stands in for an installed model. */
static void an_installed_model_comes_first(void **state)
{
    assert_int_equal(mkdir("data", 0777), 0);
    write_text("net.fits", "");
    is_found("net.fits", "data", "net.fits"); /* none is installed */
    write_text("data/net.fits", "");
    is_found("net.fits", "data", "data/net.fits");
    is_found("./net.fits", "data", "./net.fits");
    const char *full = in(state, "net.fits");
    is_found(full, "data", full);
    is_found("other.fits", "data", "other.fits"); /* nowhere */
}

/* A training that has not ended writes such a model: it is not taken by default. */
static void an_unfinished_model_must_be_named(void **state)
{
    static const char by_default[] = "psfnet.fits";
    rx_error err = RX_ERROR_NONE;
    rx_model *model = NULL;
    rx_config *config = NULL;
    rx_options *options = NULL;
    if (access(RX_DATA_FOLDER "/psfnet.fits", F_OK) == 0)
        skip(); /* it comes first */
    make_model();
    assert_int_equal(rx_model_read(path, &model, NULL), RX_OK);
    model->ended = 0;
    model->epochs = 7;
    model->best = 5;
    assert_int_equal(rx_model_write(model, by_default, by_default, NULL), RX_OK);
    rx_model_free(model);
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", "NET", NULL, NULL), RX_OK);
    assert_int_equal(rx_options_from_config(config, NULL, &options, &err), RX_INPUT);
    assert_non_null(
        strstr(err.text, "its training has not ended, it is of epoch 5 after 7; let it end, or name"));
    rx_config_free(config);
}

static void short_lists_repeat_their_last_item(void **state)
{
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
    rx_options *options = options_with("DETECT_THRESH", "22.5,25");
    assert_true(options->pipeline.detect.absolute);
    assert_near(options->pipeline.detect.threshold, 10.0, 1e-9);
    rx_options_free(options);
}

static void an_unset_pixel_scale_is_unknown(void **state)
{
    rx_options *options = options_with(NULL, NULL);
    assert_near(options->pipeline.stated_scale, 0.0, 0.0);
    rx_options_free(options);
    options = options_with("PIXEL_SCALE", "0.4");
    assert_near(options->pipeline.stated_scale, 0.4, 1e-12);
    rx_options_free(options);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(every_restorer_of_the_table_is_a_word, enter_scratch, leave_scratch),
        cmocka_unit_test(a_model_is_looked_for_here_and_among_installed_data),
        cmocka_unit_test_setup_teardown(an_installed_model_comes_first, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(an_unfinished_model_must_be_named, enter_scratch, leave_scratch),
        cmocka_unit_test(short_lists_repeat_their_last_item),
        cmocka_unit_test(surface_brightness_becomes_adu),
        cmocka_unit_test(an_unset_pixel_scale_is_unknown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
