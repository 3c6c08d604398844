/* What restorers are given under a condition. */
#include "../near.h"
#include "../scratch.h"

#include "data/map.h"
#include "lab/lab.h"

/* The PSF given is a Moffat of the width asked for; the true one stays. */
static void the_given_psf(void **state)
{
    static const char *const pairs[][2] = {
        {"SEEING", "4,4.4"}, {"PSF_ERROR", "0.1"}, {"SIM.IMAGE_SIZE", "128"}};
    rx_campaign_config *config = NULL;
    rx_lab *lab = NULL;
    assert_int_equal(rx_settings_new(rx_keytable_validate(), (rx_settings **)&config, NULL), RX_OK);
    for (int i = 0; i < 3; i++)
        assert_int_equal(rx_settings_set(&config->settings, pairs[i][0], pairs[i][1], NULL, NULL), RX_OK);
    assert_int_equal(rx_lab_open(&rx_kind_detection, config, 1, NULL, &lab, NULL), RX_OK);
    assert_int_equal(lab->nskies, 4);
    const rx_lab_sky *wide = &lab->sky[1],
                     *expected = &lab->sky[2]; /* 4 and wider by a tenth; the truth of 4.4 */
    assert_near(wide->simulation->optics->fwhm, 4, 1e-9);
    assert_near(wide->given->fwhm, 4.4, 1e-9);
    assert_int_equal(wide->given->size, expected->given->size);
    for (int i = 0; i < wide->given->size * wide->given->size; i++)
        assert_near(wide->given->basis[i], expected->given->basis[i], 1e-7);
    rx_lab_close(lab);
    rx_settings_free(&config->settings);
}

static void check_sky(const rx_background *sky, int x, double level, double noise)
{
    const rx_map levels = rx_background_level(sky), noises = rx_background_noise(sky);
    assert_near(rx_map_at(&levels, x, 0), level, 1e-4);
    assert_near(rx_map_at(&noises, x, 0), noise, 1e-5);
}

/* A background that both share is changed once. */
static void the_given_sky_and_noise(void **state)
{
    float level[2][2] = {{100, 200}, {100, 200}}, sigma[2][2] = {{10, 20}, {30, 40}};
    rx_background back[2], flat = {.width = 2, .height = 1};
    rx_field shared = {.plain = &back[0], .restored = &back[0]},
             apart = {.plain = &back[0], .restored = &back[1]}, both = {.plain = &flat, .restored = &flat};
    for (int i = 0; i < 2; i++)
        back[i] = (rx_background){.width = 2,
                                  .height = 1,
                                  .level = level[i],
                                  .sigma = sigma[i],
                                  .global_level = 150,
                                  .global_sigma = i ? 35 : 15};
    rx_condition_apply(&(rx_condition){.of = RX_GIVEN_SKY, .error = 0.5}, &shared);
    check_sky(&back[0], 0, 95, 10); /* too low: half a sigma of sky is left in the image */
    check_sky(&back[0], 1, 190, 20);
    assert_near(back[0].global_level, 142.5, 1e-9);
    rx_condition_apply(&(rx_condition){.of = RX_GIVEN_NOISE, .error = 0.2}, &apart);
    check_sky(&back[0], 1, 190, 24);
    check_sky(&back[1], 0, 100, 36);
    assert_near(back[1].global_sigma, 42, 1e-9);
    rx_condition_apply(&(rx_condition){.of = RX_GIVEN_SKY, .error = 1}, &apart); /* a sigma as it was given */
    check_sky(&back[0], 1, 166, 24);
    check_sky(&back[1], 0, 64, 36);
    rx_background_flatten(&flat, 100, 10);
    rx_condition_apply(&(rx_condition){.of = RX_GIVEN_SKY, .error = 0.5}, &both);
    check_sky(&flat, 1, 95, 10);
    rx_condition_apply(&(rx_condition){.of = RX_GIVEN_NOISE, .error = 0.2}, &both);
    check_sky(&flat, 1, 95, 12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_given_psf),
                                       cmocka_unit_test(the_given_sky_and_noise)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
