/* Conditions of tiles, and what restorers are told. */
#include "../near.h"
#include "settings.h"

#include <math.h>

#include "data/map.h"
#include "lab/conditions.h"

static void one_error_at_a_time(void **state)
{
    static const char *const pairs[] = {"SEEING",  "3,5",         "PSF_ERROR", "-0.1,0,0.1", "SKY_ERROR",
                                        "0.3,0.1", "NOISE_ERROR", "0,0.2",     NULL};
    static const char *const names[] = {"FWHM 3",
                                        "FWHM 3, PSF -10 %",
                                        "FWHM 3, PSF +10 %",
                                        "FWHM 3, sky +0.3 sigma",
                                        "FWHM 3, sky +0.1 sigma",
                                        "FWHM 3, noise +20 %",
                                        "FWHM 5"};
    (void)state;
    rx_campaign_config *config = make_settings(pairs);
    rx_condition *list = NULL;
    int n = 0;
    assert_int_equal(rx_conditions_make(config, &n, &list, NULL), RX_OK);
    assert_int_equal(n, 12);
    for (int i = 0; i < 7; i++) {
        char name[64];
        rx_condition_name(&list[i], name, sizeof name);
        assert_string_equal(name, names[i]);
        assert_int_equal(rx_condition_true(&list[i]), i % 6 == 0);
    }
    free(list);
    rx_campaign_config_free(config);
}

static void without_keywords_there_is_the_truth(void **state)
{
    static const char *const pairs[] = {NULL};
    (void)state;
    rx_campaign_config *config = make_settings(pairs);
    rx_condition *list = NULL;
    char name[64] = "x";
    int n = 0;
    assert_int_equal(rx_conditions_make(config, &n, &list, NULL), RX_OK);
    assert_int_equal(n, 1);
    rx_condition_name(&list[0], name, sizeof name);
    assert_string_equal(name, "");
    assert_true(rx_condition_true(&list[0]));
    free(list);
    rx_campaign_config_free(config);
}

/* The PSF told is a Moffat of the width asked for; the true one stays. */
static void the_told_psf(void **state)
{
    static const char *const pairs[] = {"SIM.IMAGE_SIZE", "128", NULL};
    (void)state;
    rx_campaign_config *config = make_settings(pairs);
    const rx_condition wide = {.fwhm = 4, .psf_error = 0.1}, truth = {.fwhm = 4.4};
    rx_simulation *simulation = NULL, *other = NULL;
    rx_psf *told = NULL, *expected = NULL;
    assert_int_equal(rx_condition_simulation(&wide, config->sim, NULL, &simulation, NULL), RX_OK);
    assert_near(simulation->optics->fwhm, 4, 1e-9);
    assert_int_equal(rx_condition_psf(&wide, config->sim, simulation, &told, NULL), RX_OK);
    assert_int_equal(rx_condition_simulation(&truth, config->sim, NULL, &other, NULL), RX_OK);
    assert_int_equal(rx_condition_psf(&truth, config->sim, other, &expected, NULL), RX_OK);
    assert_near(told->fwhm, 4.4, 1e-9);
    assert_int_equal(told->size, expected->size);
    for (int i = 0; i < told->size * told->size; i++)
        assert_near(told->basis[i], expected->basis[i], 1e-7);
    rx_psf_free(told);
    rx_psf_free(expected);
    rx_simulation_free(simulation);
    rx_simulation_free(other);
    rx_campaign_config_free(config);
}

static float level_of(const rx_background *sky, int x)
{
    const rx_map map = rx_background_level(sky);
    return rx_map_at(&map, x, 0);
}

static float noise_of(const rx_background *sky, int x)
{
    const rx_map map = rx_background_noise(sky);
    return rx_map_at(&map, x, 0);
}

/* A shared background is told once. */
static void told_sky_and_noise(void **state)
{
    float level[2][2] = {{100, 200}, {100, 200}}, sigma[2][2] = {{10, 20}, {30, 40}};
    rx_background one = {.width = 2,
                         .height = 1,
                         .level = level[0],
                         .sigma = sigma[0],
                         .global_level = 150,
                         .global_sigma = 15};
    rx_background two = {.width = 2,
                         .height = 1,
                         .level = level[1],
                         .sigma = sigma[1],
                         .global_level = 150,
                         .global_sigma = 35};
    rx_field shared = {.plain = &one, .restored = &one}, apart = {.plain = &one, .restored = &two};
    (void)state;
    rx_condition_apply(&(rx_condition){.sky_error = 0.5}, &shared);
    assert_near(level_of(&one, 0), 95, 1e-5); /* too low: half a sigma of sky is left in the image */
    assert_near(level_of(&one, 1), 190, 1e-5);
    assert_near(one.global_level, 142.5, 1e-9);
    assert_near(noise_of(&one, 0), 10, 0);
    rx_condition_apply(&(rx_condition){.noise_error = 0.2}, &apart);
    assert_near(level_of(&one, 1), 190, 1e-5);
    assert_near(noise_of(&one, 1), 24, 1e-5);
    assert_near(noise_of(&two, 0), 36, 1e-5);
    assert_near(two.global_sigma, 42, 1e-9);
    assert_near(level_of(&two, 0), 100, 0);
    rx_condition_apply(&(rx_condition){.sky_error = 1}, &apart); /* a sigma as it was told */
    assert_near(level_of(&one, 1), 166, 1e-4);
    assert_near(level_of(&two, 0), 64, 1e-4);
    rx_background flat = {.width = 2, .height = 1};
    rx_field both = {.plain = &flat, .restored = &flat};
    rx_background_flatten(&flat, 100, 10);
    rx_condition_apply(&(rx_condition){.sky_error = 0.5, .noise_error = 0.2}, &both);
    assert_near(level_of(&flat, 1), 95, 1e-5);
    assert_near(noise_of(&flat, 1), 12, 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_error_at_a_time),
                                       cmocka_unit_test(without_keywords_there_is_the_truth),
                                       cmocka_unit_test(the_told_psf), cmocka_unit_test(told_sky_and_noise)};
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
