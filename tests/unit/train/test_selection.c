/* Eq. 4: counts per bin and the order of an epoch, what its test images say; and the settings of a training as text. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "train/setup.h"
#include "train/state.h"

static const double FWHM[2] = {2.0, 8.0}, SIGMA[2] = {1.0, 15.0};

static rx_selection begin(int nfwhm, int nsigma, int total, int active)
{
    rx_selection s;
    assert_int_equal(rx_selection_begin((const int[]){nfwhm, nsigma}, FWHM, SIGMA, total, active, &s, NULL),
                     RX_OK);
    return s;
}

static void test_equation(void **state)
{
    rx_selection s = begin(2, 2, 110, 1);
    for (int b = 0; b < 4; b++) {
        assert_int_equal(s.train[b], 50);
        assert_int_equal(s.test[b], 60);
        assert_true(s.list[b] == 0.5);
        assert_true(isnan(s.loss[b]));
    }
    /* means 0.5, 2.5, 1.5, 0: median 1, lists 0.25, 1, 0.75, 0 */
    const double sum[4] = {5.0, 25.0, 15.0, 0.0};
    const long count[4] = {10, 10, 10, 10};
    rx_selection_update(&s, sum, count);
    const int train[4] = {25, 100, 75, 0}, test[4] = {85, 10, 35, 110};
    for (int b = 0; b < 4; b++) {
        assert_int_equal(s.train[b], train[b]);
        assert_int_equal(s.test[b], test[b]);
    }
    assert_true(fabs(s.list[0] - 0.25) < 1e-15);
    assert_true(s.list[1] == 1.0);
    assert_true(s.loss[2] == 1.5);
}

static void test_bins_without_a_mean_keep_their_list(void **state)
{
    rx_selection s = begin(3, 1, 50, 1);
    rx_selection_update(&s, (const double[]){1.0, 4.0, 2.0}, (const long[]){1, 1, 1});
    rx_selection_update(&s, (const double[]){NAN, 0.0, 3.0}, (const long[]){2, 0, 3});
    assert_true(s.list[0] == 0.25);
    assert_true(s.list[1] == 1.0);
    assert_true(s.list[2] == 0.5);
    assert_true(s.loss[0] == 1.0);
    assert_true(s.loss[1] == 4.0);
    assert_true(s.loss[2] == 1.0);
    rx_selection before = s;
    rx_selection_update(&s, (const double[]){NAN, INFINITY, 1.0}, (const long[]){1, 1, 0});
    assert_memory_equal(s.train, before.train, sizeof s.train);
    rx_selection_update(&s, (const double[]){0.0, 0.0, 0.0}, (const long[]){1, 1, 1});
    for (int b = 0; b < 3; b++) /* nothing is worst where nothing is wrong */
    {
        assert_true(s.list[b] == before.list[b]);
        assert_true(s.loss[b] == 0.0);
    }
}

static void test_uniform(void **state)
{
    rx_selection s = begin(2, 1, 41, 0);
    rx_selection_update(&s, (const double[]){1.0, 9.0}, (const long[]){1, 1});
    assert_true(s.list[0] != s.list[1]); /* the dictionary is kept, it is only not obeyed */
    for (int b = 0; b < 2; b++) {
        assert_int_equal(s.train[b], 28);
        assert_int_equal(s.test[b], 13);
    }
}

static void test_order(void **state)
{
    rx_selection s = begin(3, 2, 60, 1);
    rx_selection_update(&s, (const double[]){1, 2, 3, 4, 5, 0}, (const long[]){1, 1, 1, 1, 1, 1});
    rx_pick *order, *again, *next, *other;
    long n, m, expected = 0;
    int seen[6][60] = {{0}};
    for (int b = 0; b < 6; b++)
        expected += s.train[b];
    assert_int_equal(rx_selection_order(&s, 7, 3, &order, &n, NULL), RX_OK);
    assert_int_equal(n, expected);
    for (long i = 0; i < n; i++) {
        assert_true(order[i].bin < 6);
        assert_true(order[i].index < (uint32_t)s.train[order[i].bin]);
        assert_int_equal(seen[order[i].bin][order[i].index]++, 0);
    }
    assert_int_equal(rx_selection_order(&s, 7, 3, &again, &m, NULL), RX_OK);
    assert_memory_equal(order, again, (size_t)n * sizeof *order);
    assert_int_equal(rx_selection_order(&s, 7, 4, &next, &m, NULL), RX_OK);
    assert_memory_not_equal(order, next, (size_t)n * sizeof *order);
    assert_int_equal(rx_selection_order(&s, 8, 3, &other, &m, NULL), RX_OK);
    assert_memory_not_equal(order, other, (size_t)n * sizeof *order);
    free(order);
    free(again);
    free(next);
    free(other);
}

static void test_errors(void **state)
{
    rx_selection s;
    const double turned[2] = {8.0, 2.0}, negative[2] = {-1.0, 2.0}, nan[2] = {NAN, 2.0};
    assert_int_equal(rx_selection_begin((const int[]){0, 5}, FWHM, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){21, 20}, FWHM, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, FWHM, SIGMA, 11, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, turned, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, FWHM, negative, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, nan, SIGMA, 40, 1, &s, NULL), RX_USAGE);
    assert_int_equal(rx_selection_begin((const int[]){20, 20}, FWHM, SIGMA, 12, 1, &s, NULL), RX_OK);
}

static void bins_follow_from_their_images(void **state)
{
    const double fwhm[2] = {2, 8}, sigma[2] = {1, 15};
    rx_selection selection;
    rx_history history = {.nbins = 2};
    rx_model *model = rx_model_new();
    rx_test_image images[40] = {{0}};
    assert_non_null(model);
    assert_int_equal(rx_selection_begin((const int[]){2, 1}, fwhm, sigma, 30, 1, &selection, NULL), RX_OK);
    assert_int_equal(selection.train[0], 10);
    assert_int_equal(selection.test[0], 20);
    for (int i = 0; i < 40; i++) {
        images[i].loss = i < 20 ? 1 : 4;
        images[i].input = 6;
        images[i].check.stars = i < 20 ? 2 : 0;
        images[i].check.found = i < 20 ? 1 : 0;
        if (i < 5) { /* -2 ... 2 per cent */
            images[i].check.ratios = 1;
            images[i].check.error[0] = 0.01 * (i - 2);
        }
    }
    assert_int_equal(rx_history_add(&history, images, &selection, (rx_epoch){.rate = 3}, NULL), RX_OK);
    const rx_epoch *epoch = history.epoch;
    const rx_epoch_bin *bins = history.bin;
    assert_int_equal(history.n, 1);
    assert_true(epoch->rate == 3);
    assert_true(bins[0].loss == 1);
    assert_true(bins[1].loss == 4);
    assert_true(fabs(bins[0].list - 0.2) < 1e-12);
    assert_true(fabs(bins[1].list - 0.8) < 1e-12);
    assert_true(bins[0].train == 10);
    assert_true(bins[0].test == 20);
    assert_true(bins[0].recall == 0.5);
    assert_true(isnan(bins[1].recall));
    assert_true(fabs(bins[0].bias) < 1e-12);
    assert_true(fabs(bins[0].scatter - 0.014826) < 1e-6);
    assert_true(isnan(bins[1].bias));
    assert_true(isnan(bins[1].scatter));
    assert_true(epoch->test_loss == 2.5);
    assert_true(epoch->input_loss == 6);
    assert_true(epoch->recall == 0.5);
    assert_int_equal(selection.train[0], 4); /* Eq. 4: 20 times the list */
    assert_int_equal(selection.test[0], 26);
    assert_int_equal(selection.train[1], 16);
    assert_int_equal(rx_history_dictionary(&history, &selection, 1, model, NULL), RX_OK);
    assert_true(model->nfwhm == 2);
    assert_true(model->nsigma == 1);
    assert_true(model->bins[1].fwhm[0] == 5);
    assert_true(model->bins[0].images == 20);
    assert_true(model->bins[0].recall == 0.5);
    rx_history_free(&history);
    rx_model_free(model);
}

static rx_train_config *make_config(const char *const (*pairs)[2])
{
    rx_train_config *config = NULL;
    assert_int_equal(rx_train_config_new(&config, NULL), RX_OK);
    for (; pairs != NULL && (*pairs)[0] != NULL; pairs++)
        assert_int_equal(rx_settings_set(&config->settings, (*pairs)[0], (*pairs)[1], NULL, NULL), RX_OK);
    return config;
}

static void settings_as_text(void **state)
{
    static const char *const pairs[][2] = {{"EPOCHS", "7"},         {"MODEL_NAME", "/home/somebody/m.fits"},
                                           {"NTHREADS", "2"},       {"RATE", "0.002"},
                                           {"SIM.STAR_COUNT", "5"}, {NULL, NULL}};
    rx_text record = {0}, all = {0}, none = {0};
    rx_train_config *config = make_config(pairs), *defaults = make_config(NULL);
    rx_model *model = NULL;
    assert_int_equal(rx_setup_text(config, RX_SETUP_RECORD, &record, NULL), RX_OK);
    assert_string_equal(record.data, "EPOCHS 7\nSIM.STAR_COUNT 5\n");
    assert_int_equal(rx_setup_text(config, RX_SETUP_ALL, &all, NULL), RX_OK);
    assert_non_null(strstr(all.data, "RATE 0.002\n"));
    assert_non_null(strstr(all.data, "SIM.STAR_COUNT 5\n"));
    assert_null(strstr(all.data, "EPOCHS"));
    assert_null(strstr(all.data, "somebody"));
    assert_null(strstr(all.data, "NTHREADS"));
    assert_int_equal(rx_setup_text(defaults, RX_SETUP_RECORD, &none, NULL), RX_OK);
    assert_string_equal(none.data, "");
    assert_int_equal(rx_setup_model(config, &model, NULL), RX_OK);
    assert_string_equal(model->name, "m");
    assert_string_equal(model->provenance, record.data);
    assert_non_null(model->psf);
    rx_model_free(model);
    rx_text_free(&record);
    rx_text_free(&all);
    rx_text_free(&none);
    rx_train_config_free(config);
    rx_train_config_free(defaults);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_equation),    cmocka_unit_test(test_bins_without_a_mean_keep_their_list),
        cmocka_unit_test(test_uniform),     cmocka_unit_test(test_order),
        cmocka_unit_test(test_errors),      cmocka_unit_test(bins_follow_from_their_images),
        cmocka_unit_test(settings_as_text),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
