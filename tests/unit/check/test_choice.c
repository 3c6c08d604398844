/* Which restorer AUTO takes, on tiles where one of them must win. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "../pipeline/bench.h"
#include "../pipeline/scene.h"
#include "check/choice.h"
#include "data/image.h"
#include "stage/pipeline.h"

enum { SIDE = 300 };

enum { AS_IT_IS, NO_PSF, MASKED, NO_NOISE };

static rx_choice choose(const setting *settings, int how, const char *threads)
{
    rx_choice choice;
    rx_error err = RX_ERROR_NONE;
    bench b;
    scene s;
    bench_open(&b, settings);
    scene_make(&s, SIDE, SIDE, 150, 3);
    rx_field *field = bench_field(&b, s.pixels, SIDE, SIDE, 0.0);
    rx_psf *psf = field->psf;
    if (how == NO_PSF)
        field->psf = NULL;
    if (how == NO_NOISE)
        field->plain->constant = 1;
    if (how == MASKED)
        memset(field->tile->mask, RX_MASK_BAD, SIDE * SIDE);
    assert_int_equal(rx_pipeline_set(&b.options->pipeline, "NTHREADS", threads, NULL), RX_OK);
    if (rx_choice_make(&b.options->pipeline, &b.options->check, field, NULL, &choice, &err) != RX_OK)
        fail_msg("%s", err.text);
    field->psf = psf;
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
    return choice;
}

/* Without a filter a single pixel must stand out of the noise; Richardson-Lucy gathers the light of a star. */
static const setting unfiltered[] = {
    {"SELF_CHECK_COUNT", "300"}, {"FILTER", "N"}, {"DETECT_MINAREA", "3"}, {"RL_NITER", "20"}, {NULL, NULL}};

static void the_better_one_wins(void **state)
{
    const rx_choice c = choose(unfiltered, AS_IT_IS, "1");
    assert_string_equal(c.taken->name, "RL");
    assert_int_equal(c.injected, 300);
    assert_near(c.mpixels, 1e-6 * SIDE * SIDE, 1e-12);
    assert_true(c.of[1].found - c.of[1].spurious > c.of[0].found - c.of[0].spurious);
    assert_string_equal(c.of[2].out, "there is no model");
    assert_int_equal(c.of[2].tried, 0);
    assert_non_null(strstr(c.why, "RL"));
    assert_non_null(strstr(c.why, "300"));
}

/* What is right for a noise that is not known cannot be tried on it. */
static void without_noise_nothing_is_restored(void **state)
{
    const rx_choice c = choose(unfiltered, NO_NOISE, "1");
    assert_string_equal(c.taken->name, "NONE");
    for (int i = 1; i < RX_CHOICE_CANDIDATES; i++) {
        assert_string_equal(c.of[i].out, "the noise is not known");
        assert_int_equal(c.of[i].tried, 0);
    }
}

/* What Richardson-Lucy makes of noise in 60 plain iterations is worse than the noise; a tie is NONE's as well. */
static void a_worse_one_leaves_none(void **state)
{
    static const setting noisy[] = {{"RL_NITER", "60"},
                                    {"RL_ACCELERATE", "N"},
                                    {"RL_DENOISE", "0"},
                                    {"SELF_CHECK_COUNT", "100"},
                                    {NULL, NULL}};
    static const setting same[] = {
        {"RL_NITER", "0"}, {"RL_DENOISE", "0"}, {"SELF_CHECK_COUNT", "100"}, {NULL, NULL}};
    rx_choice c = choose(noisy, AS_IT_IS, "1");
    assert_string_equal(c.taken->name, "NONE");
    assert_non_null(strstr(c.why, "RL"));
    c = choose(same, AS_IT_IS, "1");
    assert_string_equal(c.taken->name, "NONE");
}

/* With a PSF a fifth too wide its fluxes are not those of the pixels, however much it finds. */
static void a_flux_scale_that_is_off_is_a_veto(void **state)
{
    static const setting wide[] = {{"FILTER", "N"},     {"DETECT_MINAREA", "3"},     {"RL_NITER", "20"},
                                   {"PSF_FWHM", "4.2"}, {"SELF_CHECK_COUNT", "100"}, {NULL, NULL}};
    const rx_choice c = choose(wide, AS_IT_IS, "1");
    assert_string_equal(c.taken->name, "NONE");
    assert_non_null(strstr(c.of[1].out, "flux scale"));
    assert_non_null(strstr(c.why, "flux scale"));
    assert_int_equal(c.of[1].tried, 0);
}

static void without_room_it_is_none(void **state)
{
    const rx_choice c = choose(unfiltered, MASKED, "1");
    assert_string_equal(c.taken->name, "NONE");
    assert_int_equal(c.injected, 0);
    assert_true(strlen(c.why) > 10);
}

static void facts_say_all_of_it(void **state)
{
    rx_record facts = {0};
    rx_choice c = {.why = "so"};
    rx_choice_facts(&c, &facts);
    assert_int_equal(facts.n, 0);
    c.taken = rx_restorer_find("RL");
    for (int i = 0; i < RX_CHOICE_CANDIDATES; i++)
        c.of[i] = (rx_choice_candidate){
            .kind = c.taken, .false_rate = NAN, .bias = {.value = 0.5}, .scatter = {.value = NAN}};
    c.of[0].tried = 1;
    c.of[0].found = 7;
    snprintf(c.of[2].out, sizeof c.of[2].out, "too wide");
    rx_choice_facts(&c, &facts);
    const char *found = NULL, *out = NULL;
    for (int i = 0; i < facts.n; i++) {
        found = strcmp(facts.pairs[i][0], "RXAU1F") == 0 ? facts.pairs[i][1] : found;
        out = strcmp(facts.pairs[i][0], "RXAU3O") == 0 ? facts.pairs[i][1] : out;
        assert_int_not_equal(strcmp(facts.pairs[i][0], "RXAU2F"), 0); /* was not tried */
        assert_int_not_equal(strcmp(facts.pairs[i][0], "RXAU1R"), 0); /* is not known */
    }
    assert_string_equal(found, "7");
    assert_string_equal(out, "too wide");
    rx_record_free(&facts);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_better_one_wins),     cmocka_unit_test(without_noise_nothing_is_restored),
        cmocka_unit_test(a_worse_one_leaves_none), cmocka_unit_test(a_flux_scale_that_is_off_is_a_veto),
        cmocka_unit_test(without_room_it_is_none), cmocka_unit_test(facts_say_all_of_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
