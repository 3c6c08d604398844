/* Training scenes for tests: everything as it is ideally, unless a test says otherwise. */
#ifndef RX_TEST_SCENES_TEST_H
#define RX_TEST_SCENES_TEST_H
#include <string.h>

#include "../near.h"
#include "train/samples.h"

typedef struct samples_test {
    rx_samples_params par;
    rx_selection grid;
    rx_simulate_config *config;
} samples_test;

static inline samples_test samples_test_open(double sigma_low, double sigma_high)
{
    const double fwhm[2] = {2.0, 8.0}, sigma[2] = {sigma_low, sigma_high};
    samples_test t = {.par = {.side = 64,
                              .field_side = 128,
                              .uses = 2,
                              .sky = {.beta = {3.0, 5.0}, .ellipticity = 0.1, .density = 1.0},
                              .seed = 11,
                              .front = {.mode = RX_MODE_INFORMED, .target_fwhm = 2.0, .tikhonov = 0.02}}};
    assert_int_equal(rx_selection_begin((const int[]){5, 5}, fwhm, sigma, 40, 1, &t.grid, NULL), RX_OK);
    assert_int_equal(rx_simulate_config_new(&t.config, NULL), RX_OK);
    t.config->star_count = 1500.0;
    t.config->galaxy_count = 600.0;
    t.config->star_mag.v[0] = 13.0;
    return t;
}

static inline rx_samples *samples_test_make(const samples_test *t)
{
    rx_samples *scenes = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_samples_new(&t->par, &t->grid, t->config, 2, NULL, &scenes, &err) != RX_OK)
        fail_msg("%s", err.text);
    return scenes;
}

static inline rx_sample *samples_test_new(int side)
{
    rx_sample *sample;
    assert_int_equal(rx_sample_new(side, &sample, NULL), RX_OK);
    return sample;
}

static inline void samples_test_sample(rx_samples *scenes, rx_sample_id id, rx_sample *dst)
{
    rx_error err = RX_ERROR_NONE;
    rx_sample *made = NULL;
    if (rx_samples_make(scenes, &id, 1, &made, &err) != RX_OK)
        fail_msg("%s", err.text);
    memcpy(dst, made, rx_sample_bytes(dst->side));
    rx_sample_attach(dst);
    free(made);
}

#endif
