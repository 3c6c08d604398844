/* Which restorers AUTO accepts, on tiles where something speaks against one. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "../pipeline/bench.h"
#include "../pipeline/scene.h"
#include "check/choice.h"
#include "stage/pipeline.h"

enum { SIDE = 300 };
enum { AS_IT_IS, NO_PSF, NO_NOISE };

static const setting plain[] = {{"RL_NITER", "20"}, {NULL, NULL}};

enum { NET, RL, NONE };

/* What speaks against a candidate: before it is tried, after. */
static void ask(const setting *settings, int how, int candidate, char before[200], char after[200])
{
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
    static const char *const names[] = {"NET", "RL", "NONE"};
    const rx_restorer *kind = NULL;
    assert_int_equal(rx_choice_before(&b.options->pipeline, field, candidate, &kind, before, &err), RX_OK);
    assert_string_equal(kind->name, names[candidate]);
    after[0] = '\0';
    if (before[0] == '\0') {
        rx_result result;
        assert_int_equal(rx_field_extract(&b.options->pipeline, kind, field, NULL, NULL, &result, &err),
                         RX_OK);
        rx_choice_after(&result, after);
        rx_result_free(&result);
    }
    field->psf = psf;
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
}

static void what_is_right_is_accepted(void **state)
{
    (void)state;
    char before[200], after[200];
    for (int i = RL; i <= NONE; i++) {
        ask(plain, AS_IT_IS, i, before, after);
        assert_string_equal(before, "");
        assert_string_equal(after, "");
    }
    ask(plain, AS_IT_IS, NET, before, after);
    assert_string_equal(before, "there is no model");
}

/* Nothing is restored where PSF or noise are not known; the pixels as they are need neither. */
static void what_is_not_known_is_not_tried(void **state)
{
    (void)state;
    char before[200], after[200];
    for (int i = NET; i <= NONE; i++) {
        ask(plain, NO_PSF, i, before, after);
        assert_string_equal(before, i == NONE ? "" : "the PSF is not known");
        ask(plain, NO_NOISE, i, before, after);
        assert_string_equal(before, i == NONE ? "" : "the noise is not known");
    }
}

static void too_narrow_a_psf_is_left_alone(void **state)
{
    (void)state;
    static const setting narrow[] = {{"PSF_FWHM", "1.5"}, {NULL, NULL}};
    char before[200], after[200];
    ask(narrow, AS_IT_IS, RL, before, after);
    assert_non_null(strstr(before, "is below 1.8"));
}

/* With a PSF a fifth too wide the fluxes are not those of the pixels. */
static void a_flux_scale_that_is_off_is_not_taken(void **state)
{
    (void)state;
    static const setting wide[] = {{"RL_NITER", "20"}, {"PSF_FWHM", "4.2"}, {NULL, NULL}};
    char before[200], after[200];
    ask(wide, AS_IT_IS, RL, before, after);
    assert_string_equal(before, "");
    assert_non_null(strstr(after, "its flux scale is off"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_right_is_accepted),
        cmocka_unit_test(what_is_not_known_is_not_tried),
        cmocka_unit_test(too_narrow_a_psf_is_left_alone),
        cmocka_unit_test(a_flux_scale_that_is_off_is_not_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
