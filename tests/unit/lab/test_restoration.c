/* The restoration campaign: scenes, tuning, scores and results. */
#include "../near.h"
#include "../restore/network_model.h"
#include "settings.h"

#include <math.h>

#include "lab/restoration.h"
#include "num/convolve.h"
#include "num/stats.h"
#include "quality/image_metrics.h"

static const char *const SMALL[] = {"SCENE_SIDE",  "64",   "FWHM_RANGE",   "4,5",   "SIGMA_RANGE", "2,2",
                                    "SCENES_FWHM", "2,3",  "SCENES_SIGMA", "3,4",   "TUNE_SCENES", "2",
                                    "TUNE_NITER",  "2,10", "TUNE_FILTER",  "0,0.5", NULL};

static void make_trial(const rx_lab *state, int bin, int tune, long index, rx_trial *dst)
{
    rx_error err = RX_ERROR_NONE;
    const rx_lab_unit unit = {bin, !tune, index};
    if (rx_trial_make(state, &unit, dst, &err) != RX_OK)
        fail_msg("%s", err.text);
}

static double highest(const float *plane, size_t n)
{
    double value = -HUGE_VAL;
    for (size_t i = 0; i < n; i++)
        value = fmax(value, plane[i]);
    return value;
}

/* What 0.1 % exceed. */
static double bright(const float *plane, size_t n)
{
    double *values = calloc(n, sizeof *values);
    for (size_t i = 0; i < n; i++)
        values[i] = (double)plane[i];
    const double value = rx_quantile(values, n, 0.999);
    free(values);
    return value;
}

/* Noise from second differences along rows, in which a well sampled scene hardly shows. */
static double noise_of(const rx_lab *state, const float *image)
{
    const int side = state->config->scene_side;
    double *differences = calloc((size_t)side * (size_t)side, sizeof(double));
    size_t n = 0;
    for (int y = 0; y < side; y++)
        for (int x = 1; x < side - 1; x++) {
            const float *p = image + (size_t)y * (size_t)side + x;
            differences[n++] = ((double)p[-1] - 2.0 * p[0] + p[1]) / sqrt(6.0);
        }
    const double sigma = rx_sigma_mad(differences, n, NULL);
    free(differences);
    return sigma;
}

static void scenes_are_what_bins_say(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_restoration, config, 1);
    const size_t n = (size_t)campaign->config->scene_side * (size_t)campaign->config->scene_side;
    assert_int_equal(campaign->nconditions, 3);
    double sum[2] = {0, 0};
    enum { SCENES = 24 };
    for (int bin = 1; bin <= 2; bin++) { /* FWHM 5, sigma 2 */
        for (long i = 0; i < SCENES; i++) {
            rx_trial trial;
            make_trial(campaign, bin, 0, i, &trial);
            const double binned = bin == 1 ? trial.fwhm : trial.sigma;
            const double other = bin == 1 ? trial.sigma : trial.fwhm;
            assert_between(binned, bin == 1 ? 4.5 : 1.5, bin == 1 ? 5.5 : 2.5);
            assert_between(other, bin == 1 ? 1 : 2, bin == 1 ? 15 : 8);
            sum[bin - 1] += binned / SCENES;
            assert_near(highest(trial.sharp, n), 255.0, 1e-3);
            assert_near(trial.level / (255.0 * trial.sigma / bright(trial.image, n)), 1.0,
                        0.02 + 2.0 * trial.level / 255.0); /* the image has noise */
            assert_true(trial.level > 1.1 * trial.sigma);  /* what is blurred is fainter */
            if (trial.fwhm > 4) /* 3900 differences, of which every third is independent: 3 % and the scene */
                assert_near(noise_of(campaign, trial.image) / trial.sigma, 1.0, 0.1);
            rx_trial_free(&trial);
        }
    }
    assert_near(sum[0], 5.0, 4 * 0.2887 / sqrt(SCENES)); /* mean of a uniform one, 4 sigma */
    assert_near(sum[1], 2.0, 4 * 0.2887 / sqrt(SCENES));
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* The scenes of SMALL are the first ones of PAPER, and none of them is tuned on. */
static void scenes_do_not_depend_on_their_number(void **state)
{
    (void)state;
    rx_campaign_config *small = make_settings(SMALL), *paper = make_settings(SMALL);
    assert_int_equal(rx_settings_set(&paper->settings, "SIZE", "PAPER", NULL, NULL), RX_OK);
    rx_lab *a = open_lab(&rx_kind_restoration, small, 1), *b = open_lab(&rx_kind_restoration, paper, 1);
    const size_t bytes = (size_t)a->config->scene_side * (size_t)a->config->scene_side * sizeof(float);
    assert_int_equal(a->nunits, 2 * (2 + 2) + 2 + 3);
    assert_int_equal(b->nunits, 2 * (2 + 3) + 2 + 4);
    rx_trial one, two, three;
    make_trial(a, 1, 0, 1, &one);
    make_trial(b, 1, 0, 1, &two);
    make_trial(a, 1, 1, 1, &three);
    assert_memory_equal(one.image, two.image, bytes);
    assert_memory_equal(one.sharp, two.sharp, bytes);
    assert_true(memcmp(one.sharp, three.sharp, bytes) != 0);
    assert_true(one.fwhm != three.fwhm);
    rx_trial_free(&one);
    rx_trial_free(&two);
    rx_trial_free(&three);
    rx_lab_close(a);
    rx_lab_close(b);
    rx_campaign_config_free(small);
    rx_campaign_config_free(paper);
}

static void threads_do_not_matter(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_restoration, config, 1);
    rx_unit_values *values[3];
    const long n = campaign->nunits;
    for (int t = 0; t < 3; t++) {
        char name[32];
        snprintf(name, sizeof name, "threads%d", t + 1);
        values[t] = run_units(state, name, campaign, t + 1);
    }
    assert_int_equal(n, 2 * (2 + 2) + 2 + 3);
    assert_same_values(n, values[0], values[1]);
    assert_same_values(n, values[0], values[2]);
    for (int t = 0; t < 3; t++)
        rx_unit_values_free(n, values[t]);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Mean score of a candidate over the two tuning scenes of a bin. */
static double mean_of(const rx_lab *campaign, const rx_unit_values *values, int bin, long candidate,
                      int metric)
{
    double sum = 0;
    for (long u = 0; u < campaign->nunits; u++)
        if (campaign->unit[u].condition == bin && campaign->unit[u].scene == 0)
            sum += rx_lab_values(campaign, &values[u],
                                 RX_RESTORATION_TUNING)[RX_RESTORATION_TUNING_WIDTH * candidate +
                                                        RX_TUNING_PSNR + metric] /
                   2;
    return sum;
}

static void tuning_takes_the_best(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_restoration, config, 1);
    const long n = campaign->nunits;
    rx_unit_values *values = run_units(state, "tuning", campaign, 2);
    const long candidates = rx_tuning_count(campaign);
    assert_string_equal(campaign->run[0].name, "BLURRED");
    assert_string_equal(campaign->run[1].name, "SMOOTHED");
    assert_string_equal(campaign->run[2].name, "RL");
    assert_string_equal(campaign->run[3].name, "RL_FLAT");
    for (int bin = 0; bin < campaign->nconditions; bin++) {
        for (int m = 1; m <= 3; m++) {
            for (int metric = 0; metric < 2; metric++) {
                const long best = rx_tuning_choose(campaign, bin, &campaign->run[m], metric, values);
                const double score = mean_of(campaign, values, bin, best, metric);
                rx_tuning tuning;
                rx_tuning_get(campaign, 4.0, best, &tuning);
                assert_int_equal(tuning.threshold >= 0, m == 3);
                assert_int_equal(tuning.niter == 0, m == 1);
                for (long c = 0; c < candidates; c++) {
                    rx_tuning_get(campaign, 4.0, c, &tuning);
                    if ((tuning.threshold >= 0) == (m == 3) && (tuning.niter == 0) == (m == 1))
                        assert_true(mean_of(campaign, values, bin, c, metric) <= score);
                }
            }
        }
    }
    /* filters: of 0, of half the PSF's FWHM, and of the target PSF */
    rx_tuning tuning;
    double widths[3];
    for (int f = 0; f < 3; f++) {
        rx_tuning_get(campaign, 5.0, (3 + f) * candidates / 9, &tuning);
        widths[f] = tuning.filter;
        assert_int_equal(tuning.niter, 2);
    }
    assert_near(widths[0], 0, 0);
    assert_near(widths[1], 2.5, 1e-12);
    assert_near(widths[2], campaign->sky->simulation->sharp_fwhm, 1e-12);
    assert_non_null(strstr(tuning.text, "filter 2 pixels"));
    /* of 2 and 10 iterations both are ends; with 5 between them, the widest filter is one */
    assert_true(rx_tuning_at_end(campaign, candidates / 3));
    assert_true(rx_tuning_at_end(campaign, candidates - 1));
    config->tune_niter.n = 3;
    config->tune_niter.v[2] = 5;
    assert_false(rx_tuning_at_end(campaign, candidates));
    assert_true(rx_tuning_at_end(campaign, candidates + candidates / 9));
    assert_false(rx_tuning_at_end(campaign, candidates + 2 * candidates / 9));
    assert_true(rx_tuning_at_end(campaign, candidates / 3));
    /* the highest threshold, on 5 iterations and no filter */
    assert_true(rx_tuning_at_end(campaign, candidates + 5));
    assert_false(rx_tuning_at_end(campaign, candidates + 4));
    /* nothing is lower than one iteration */
    config->tune_niter.v[0] = 1;
    assert_false(rx_tuning_at_end(campaign, candidates / 3));
    /* without iterations only the filter counts */
    assert_false(rx_tuning_at_end(campaign, 0));
    assert_true(rx_tuning_at_end(campaign, candidates / 9));
    rx_unit_values_free(n, values);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* NET_FLAT is NET's picture with what is below the best threshold set to the sky, nothing else. */
static void a_flat_network_is_the_network_below_a_threshold(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_error err = RX_ERROR_NONE;
    rx_model *model = small_model(RX_MODE_BLIND, 1);
    assert_int_equal(rx_model_write(model, in(state, "small.fits"), "small.fits", &err), RX_OK);
    assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", "NONE,RL,NET", NULL, NULL), RX_OK);
    assert_int_equal(
        rx_settings_set(&config->settings, "STAGE.NET_MODEL", in(state, "small.fits"), NULL, NULL), RX_OK);
    rx_lab *campaign = open_lab(&rx_kind_restoration, config, 1);
    const long n = campaign->nunits, candidates = rx_tuning_count(campaign);
    const size_t pixels = 64 * 64;
    rx_unit_values *values = run_units(state, "flat", campaign, 1);
    float *net = calloc(pixels, sizeof *net), *flat = calloc(pixels, sizeof *flat);
    assert_int_equal(campaign->nruns, 6);
    assert_string_equal(campaign->run[4].name, "NET");
    assert_string_equal(campaign->run[5].name, "NET_FLAT");
    for (int bin = 0; bin < campaign->nconditions; bin++)
        for (int metric = 0; metric < 2; metric++) {
            const long best = rx_tuning_choose(campaign, bin, &campaign->run[5], metric, values);
            const double score = mean_of(campaign, values, bin, best, metric);
            rx_tuning tuning;
            rx_trial trial;
            rx_tuning_get(campaign, 4.0, best, &tuning);
            assert_true(tuning.threshold >= 0);
            assert_int_equal(tuning.niter, 0);
            for (long c = candidates - 5; c < candidates; c++)
                assert_true(mean_of(campaign, values, bin, c, metric) <= score);
            assert_true(rx_tuning_choose(campaign, bin, &campaign->run[3], metric, values) < candidates - 6);
            make_trial(campaign, bin, 0, 0, &trial);
            for (int m = 4; m < 6; m++)
                assert_int_equal(rx_restoration_picture(
                                     campaign, &(rx_picture){bin, &trial, &campaign->run[m], metric, values},
                                     m == 4 ? net : flat, &err),
                                 RX_OK);
            size_t cut = 0;
            for (size_t i = 0; i < pixels; i++) {
                const int below = (double)net[i] < tuning.threshold * trial.sigma;
                cut += (size_t)below;
                assert_near((double)flat[i], below ? 0.0 : (double)net[i], 1e-6);
            }
            assert_between((double)cut, 1, (double)pixels - 1);
            rx_trial_free(&trial);
        }
    free(net);
    free(flat);
    rx_unit_values_free(n, values);
    rx_lab_close(campaign);
    rx_model_free(model);
    rx_campaign_config_free(config);
}

/* What the journal holds is what the metrics say of the pictures; the results put it in order. */
static void results_are_the_scores(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_restoration, config, 1);
    const int side = campaign->config->scene_side;
    rx_error err = RX_ERROR_NONE;
    const long n = campaign->nunits;
    rx_unit_values *values = run_units(state, "results", campaign, 2);
    assert_int_equal(rx_lab_collect(campaign, values, &err), RX_OK);
    assert_int_equal(campaign->nruns, 4);
    assert_int_equal(campaign->bin[2].by_sigma, 1);
    rx_lab_tuned(*const tuned)[2] = campaign->tuned; /* of the first bin */
    assert_string_equal(tuned[0][0].setting, "");
    assert_int_equal(strncmp(tuned[1][0].setting, "filter", 6), 0);
    assert_non_null(strstr(tuned[2][0].setting, "RL_NITER"));
    assert_non_null(strstr(tuned[3][1].setting, "sky below"));
    for (int b = 0; b < 3; b++) {
        assert_int_equal(tuned[4 * b][0].at_end + tuned[4 * b][1].at_end, 0);
        /* of two numbers of iterations both are ends */
        assert_int_equal(tuned[4 * b + 2][0].at_end + tuned[4 * b + 2][1].at_end, 2);
    }
    float *plane = calloc((size_t)side * (size_t)side, sizeof *plane);
    for (int b = 0; b < 3; b++) {
        const rx_lab_table *scene = &rx_lab_set_of(campaign, b, 1)->table[RX_RESTORATION_SCENE];
        const long i = scene->n - 1;
        rx_trial trial;
        make_trial(campaign, b, 0, i, &trial);
        assert_near(rx_lab_own(scene, i)[RX_SCENE_FWHM], trial.fwhm, 0);
        assert_near(rx_lab_own(scene, i)[RX_SCENE_SIGMA], trial.sigma, 0);
        for (int m = 0; m < 4; m++) {
            double ssim;
            for (int metric = 0; metric < 2; metric++) {
                assert_int_equal(
                    rx_restoration_picture(
                        campaign, &(rx_picture){b, &trial, &campaign->run[m], metric, values}, plane, &err),
                    RX_OK);
                if (m == 1) { /* SMOOTHED: the filter, and nothing else */
                    rx_tuning tuning;
                    rx_tuning_get(campaign, trial.fwhm,
                                  rx_tuning_choose(campaign, b, &campaign->run[m], metric, values), &tuning);
                    assert_int_equal(rx_gauss_masked(side, side, tuning.filter, NULL, 1, trial.image, &err),
                                     RX_OK);
                }
                if (m <= 1)
                    assert_memory_equal(plane, trial.image, (size_t)side * (size_t)side * sizeof *plane);
                if (m == 1) {
                    rx_trial_free(&trial);
                    make_trial(campaign, b, 0, i, &trial);
                }
                rx_image_reference *reference = NULL;
                assert_int_equal(rx_image_reference_new(side, side, trial.sharp, &reference, &err), RX_OK);
                assert_int_equal(rx_reference_ssim(reference, plane, &ssim, &err), RX_OK);
                if (metric == 0)
                    assert_near(rx_lab_each(scene, i, m)[RX_SCORE_PSNR], rx_reference_psnr(reference, plane),
                                0);
                else
                    assert_near(rx_lab_each(scene, i, m)[RX_SCORE_SSIM], ssim, 0);
                rx_image_reference_free(reference);
            }
        }
        /* tuned on other scenes, RL is still better than doing nothing to a blurred and noisy image */
        assert_true(rx_lab_each(scene, i, 2)[RX_SCORE_PSNR] > rx_lab_each(scene, i, 0)[RX_SCORE_PSNR]);
        rx_trial_free(&trial);
    }
    free(plane);
    rx_unit_values_free(n, values);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Restorers without iterations to tune are one method, as the STAGE. keywords have them. */
static void methods_come_from_the_table(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(SMALL);
    assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", "RL_BLIND,NONE", NULL, NULL), RX_OK);
    rx_lab *campaign = open_lab(&rx_kind_restoration, config, 1);
    assert_int_equal(campaign->nruns, 2);
    assert_string_equal(campaign->run[0].name, "RL_BLIND");
    assert_string_equal(campaign->run[1].name, "BLURRED");
    assert_int_equal(campaign->nunits, 2 + 2 + 3); /* nothing is tuned */
    rx_lab_close(campaign);
    /* SMOOTHED comes with NONE, where something is tuned, wherever the two are named */
    assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", "RL", NULL, NULL), RX_OK);
    campaign = open_lab(&rx_kind_restoration, config, 1);
    assert_int_equal(campaign->nruns, 2);
    assert_string_equal(campaign->run[1].name, "RL_FLAT");
    rx_lab_close(campaign);
    assert_int_equal(rx_settings_set(&config->settings, "RESTORE_TYPE", "RL,NONE", NULL, NULL), RX_OK);
    campaign = open_lab(&rx_kind_restoration, config, 1);
    assert_int_equal(campaign->nruns, 4);
    assert_string_equal(campaign->run[2].name, "BLURRED");
    assert_string_equal(campaign->run[3].name, "SMOOTHED");
    assert_int_equal(campaign->tunes, 1);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scenes_are_what_bins_say),
        cmocka_unit_test(scenes_do_not_depend_on_their_number),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(tuning_takes_the_best),
        cmocka_unit_test(results_are_the_scores),
        cmocka_unit_test(methods_come_from_the_table),
        cmocka_unit_test(a_flat_network_is_the_network_below_a_threshold),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
