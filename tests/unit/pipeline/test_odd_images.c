/* A caller's array may be anything: each odd one ends in sources with finite numbers, or in an error that says why. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "stage/pipeline.h"

typedef struct odd {
    const char *name;
    int width, height;
    float value; /* of every pixel */
    float sigma; /* of Gaussian noise on it */
    float one;   /* instead, in the middle; 0: not */
} odd;

static const odd images[] = {
    {"one pixel", 1, 1, 5, 0, 0},
    {"one row", 300, 1, 100, 3, 0},
    {"three columns", 3, 200, 100, 3, 0},
    {"less than a mesh", 20, 17, 100, 3, 900},
    {"all NaN", 64, 64, NAN, 0, 0},
    {"all infinite", 64, 64, INFINITY, 0, 0},
    {"all equal", 80, 60, 7, 0, 0},
    {"all zero", 80, 60, 0, 0, 0},
    {"equal but one", 80, 60, 7, 0, 9000},
    {"noise alone", 128, 100, 100, 3, 0},
    {"an infinite pixel", 128, 100, 100, 3, INFINITY},
    {"as bright as floats go", 64, 64, 3e38f, 1e37f, 0},
    {"as bright as may be", 64, 64, 5e19f, 1e18f, 9e19f},
    {"a pixel of no detector", 128, 100, 100, 3, -1e30f},
    {"denormal", 64, 64, 1e-38f, 1e-39f, 1e-36f},
};

static float *draw(const odd *of)
{
    const size_t n = (size_t)of->width * (size_t)of->height;
    float *pixels = malloc(n * sizeof *pixels);
    assert_non_null(pixels);
    for (size_t i = 0; i < n; i++)
        pixels[i] = of->sigma > 0 ? of->value + of->sigma * (float)rx_random_normal(1, 0, i) : of->value;
    if (of->one != 0)
        pixels[n / 2 + (size_t)of->width / 2] = of->one;
    return pixels;
}

static void check(const odd *of, const char *restorer, const char *psf_type, int templates)
{
    rx_error err = RX_ERROR_NONE;
    rx_pipeline_params params;
    rx_result result = {0};
    float *pixels = draw(of);
    const rx_image image = {.width = of->width, .height = of->height, .pixels = pixels};
    assert_int_equal(rx_pipeline_defaults(&params, &err), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "PSF_TYPE", psf_type, &err), RX_OK);
    if (strcmp(psf_type, "MOFFAT") == 0)
        assert_int_equal(rx_pipeline_set(&params, "PSF_FWHM", "3", &err), RX_OK);
    params.restorer = rx_restorer_find(restorer);
    params.templates.wanted = templates;
    const rx_status status = rx_pipeline_run(&params, &image, NULL, &result, &err);
    if (status != RX_OK) {
        if (status == RX_SYSTEM || status == RX_INTERRUPTED || strlen(err.text) < 10 ||
            result.sources != NULL)
            fail_msg("%s, %s: status %d, \"%s\"", of->name, restorer, status, err.text);
    } else {
        for (int i = 0; i < result.sources->n; i++) {
            const rx_source *s = &result.sources->list[i];
            if (!isfinite(s->x) || !isfinite(s->y) || !isfinite(s->flux_auto))
                fail_msg("%s, %s: source %d at %g, %g with %g", of->name, restorer, i, s->x, s->y,
                         s->flux_auto);
        }
    }
    rx_result_free(&result);
    free(pixels);
}

static void check_all(const char *restorer, const char *psf_type, int templates)
{
    for (size_t i = 0; i < sizeof images / sizeof *images; i++)
        check(&images[i], restorer, psf_type, templates);
}

static void test_none(void **state)
{
    (void)state;
    check_all("NONE", "AUTO", 0);
}

static void test_rl(void **state)
{
    (void)state;
    check_all("RL", "MOFFAT", 0);
    check_all("RL", "AUTO", 0);
}

static void test_rl_blind(void **state)
{
    (void)state;
    check_all("RL_BLIND", "MOFFAT", 0);
}

static void test_templates(void **state)
{
    (void)state;
    check_all("RL", "MOFFAT", 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_none),
        cmocka_unit_test(test_rl),
        cmocka_unit_test(test_rl_blind),
        cmocka_unit_test(test_templates),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
