/* Saturated stars beside a restored image: what RESTORE_TYPE NONE makes of them, under every restorer. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "bench.h"
#include "pipeline/pipeline.h"
#include "scene.h"

/* The star, and a neighbour on its wings. */
enum { SIDE = 200, X = 100, Y = 90, BESIDE_X = 117, BESIDE_Y = 98, FULL = 6000, BLEED = 14 };

typedef struct night {
    bench bench;
    rx_field *field;
    rx_result none, restored;
} night;

/* Pixels stop at FULL, or hold what is drawn beyond it; charge has run along a column. */
static rx_tile *bleeding_tile(double fwhm, uint64_t beyond)
{
    scene s;
    scene_make(&s, SIDE, SIDE, 12, 3);
    scene_star(&s, X, Y, 1.5e6, fwhm);
    scene_star(&s, BESIDE_X, BESIDE_Y, 8000, 3.5);
    for (int y = Y - BLEED; y <= Y + BLEED; y++)
        s.pixels[y * SIDE + X] = FULL;
    rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 2);
    tile->saturation = FULL;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        if (tile->pixels[i] >= FULL) {
            tile->mask[i] = RX_MASK_SATURATED;
            tile->pixels[i] = (float)(FULL + (beyond > 0 ? 3000 * rx_random_uniform(beyond, 0, i) : 0));
        }
    scene_free(&s);
    return tile;
}

static void restore(night *n, const char *kind, double fwhm, uint64_t beyond, const setting *more)
{
    char model[1024];
    snprintf(model, sizeof model, "%s/config/psfnet.fits", getenv("srcdir"));
    setting settings[16] = {
        {"RESTORE_TYPE", kind}, {"NET_MODEL", model}, {"BACK_TYPE", "MANUAL"}, {"BACK_VALUE", "1000"}};
    for (int i = 0; more != NULL && more[i].name != NULL; i++)
        settings[4 + i] = more[i];
    *n = (night){0};
    bench_open(&n->bench, settings);
    assert_int_equal(rx_field_prepare(&n->bench.options->pipeline, RX_FIELD_PSF, bleeding_tile(fwhm, beyond),
                                      NULL, NULL, &n->field, NULL),
                     RX_OK);
    assert_int_equal(rx_field_extract(&n->bench.options->pipeline, rx_restorer_find("NONE"), n->field, NULL,
                                      NULL, &n->none, NULL),
                     RX_OK);
    assert_int_equal(rx_field_extract(&n->bench.options->pipeline, rx_restorer_find(kind), n->field, NULL,
                                      NULL, &n->restored, NULL),
                     RX_OK);
}

static void forget(night *n)
{
    rx_result_free(&n->none);
    rx_result_free(&n->restored);
    rx_field_free(n->field);
    bench_close(&n->bench);
}

/* How many sources lie so near the place; *which is the nearest one. */
static int near_to(const rx_sources *sources, double x, double y, double radius, const rx_source **which)
{
    double least = HUGE_VAL;
    int n = 0;
    for (int i = 0; i < sources->n; i++) {
        const rx_source *s = &sources->list[i];
        const double distance = hypot(s->x - x, s->y - y);
        n += distance < radius;
        if (distance < least)
            *which = s;
        least = fmin(least, distance);
    }
    return n;
}

static double apart(double a, double b)
{
    return fabs(2.5 * log10(a / b));
}

/* fwhm beyond 3.5, that of the PSF: wings that no PSF explains. */
static void check_star(const char *kind, double fwhm, const setting *more)
{
    const rx_source *star = NULL, *none = NULL, *beside = NULL;
    night n;
    restore(&n, kind, fwhm, 0, more);
    assert_string_equal(n.restored.restored->name, kind);
    const int before = near_to(n.none.sources, X, Y, 30, &none);
    if (near_to(n.restored.sources, X, Y, 30, &star) != before)
        fail_msg("%s: %d sources instead of %d", kind, near_to(n.restored.sources, X, Y, 30, &star), before);
    assert_int_equal(none->flags & RX_FLAG_SATURATED, RX_FLAG_SATURATED);
    assert_int_equal(star->flags, none->flags);
    assert_int_equal(star->flags_measure, none->flags_measure | RX_FLAGM_UNTOUCHED);
    assert_memory_equal(&star->flux_auto, &none->flux_auto, sizeof star->flux_auto);
    assert_memory_equal(&star->x, &none->x, sizeof star->x);
    assert_int_equal(star->isoarea, none->isoarea);
    if (n.bench.options->pipeline.templates.wanted && !(apart(star->fit.flux, none->fit.flux) < 0.01))
        fail_msg("%s: template flux %g instead of %g", kind, star->fit.flux, none->fit.flux);
    near_to(n.restored.sources, BESIDE_X, BESIDE_Y, 2, &beside);
    assert_int_equal(hypot(beside->x - BESIDE_X, beside->y - BESIDE_Y) < 1.5, 1);
    assert_int_equal(beside->flags & RX_FLAG_SATURATED, 0);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int32_t segment = n.none.sources->segments[i];
        const float above = n.field->tile->pixels[i] - 1000.0f;
        if (segment != none->segment)
            continue;
        assert_int_equal(n.restored.sources->segments[i], star->segment);
        assert_int_equal(n.restored.restored->mask[i], 0);
        assert_memory_equal(&n.restored.restored->pixels[i], &above, sizeof above);
    }
    forget(&n);
}

static void a_bleeding_star_is_what_none_finds(void **state)
{
    static const setting settings[][3] = {{{"MASK_SATURATED", "AUTO"}, {NULL, NULL}},
                                          {{"MASK_SATURATED", "N"}, {NULL, NULL}},
                                          {{"MEASURE_ON", "ORIGINAL"}, {NULL, NULL}},
                                          {{"CHECKIMAGE_TYPE", "TEMPLATE_MODEL"}, {NULL, NULL}}};
    (void)state;
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++) {
        check_star("RL", 3.5, settings[i]);
        check_star("NET", 3.5, settings[i]);
    }
}

static void wings_that_no_psf_explains_are_no_sources(void **state)
{
    (void)state;
    check_star("RL", 5.5, NULL);
    check_star("NET", 5.5, NULL);
}

/* Masked for all, it is as NONE finds it, and stays masked. */
static void masked_for_all_it_stays_masked(void **state)
{
    static const setting masked[] = {{"MASK_SATURATED", "Y"}, {NULL, NULL}};
    night n;
    (void)state;
    restore(&n, "RL", 3.5, 0, masked);
    const rx_source *star = NULL, *none = NULL;
    assert_int_equal(n.restored.restored->mask[Y * SIDE + X], RX_MASK_SATURATED);
    assert_int_equal(near_to(n.restored.sources, X, Y, 10, &star), 1);
    assert_int_equal(near_to(n.none.sources, X, Y, 10, &none), 1);
    assert_true(star->untouched > 0);
    assert_memory_equal(&star->flux_auto, &none->flux_auto, sizeof star->flux_auto);
    forget(&n);
}

/* What a full pixel holds decides nothing about others. */
static void values_beyond_saturation_reach_only_the_star(void **state)
{
    static const char *const kinds[] = {"RL", "NET"};
    (void)state;
    for (int k = 0; k < 2; k++) {
        night one, other;
        const rx_source *star = NULL, *again = NULL;
        restore(&one, kinds[k], 3.5, 1, NULL);
        restore(&other, kinds[k], 3.5, 2, NULL);
        near_to(one.restored.sources, X, Y, 30, &star);
        near_to(other.restored.sources, X, Y, 30, &again);
        assert_int_equal(one.restored.sources->n, other.restored.sources->n);
        assert_int_equal(star->flux_auto != again->flux_auto, 1);
        int border = 0; /* the star's own, where the filter sees full pixels */
        for (int i = 0; i < SIDE * SIDE; i++) {
            const int32_t a = one.restored.sources->segments[i], b = other.restored.sources->segments[i];
            if (a != b && a + b == star->segment && border++ < 8)
                continue;
            assert_int_equal(a, b);
            if ((one.field->tile->mask[i] & RX_MASK_SATURATED) == 0)
                assert_memory_equal(&one.restored.restored->pixels[i], &other.restored.restored->pixels[i],
                                    sizeof(float));
        }
        for (int i = 0; i < one.restored.sources->n; i++) {
            const rx_source *own = &one.restored.sources->list[i], *same = &other.restored.sources->list[i];
            if (hypot(own->x - star->x, own->y - star->y) < 40)
                continue; /* masks of neighbours, and the star's fitted light, follow its border */
            assert_close(own->detection_snr, same->detection_snr,
                         1e-2); /* the sky's structure is that of cells */
            assert_near(own->x, same->x, 0);
            assert_near(own->y, same->y, 0);
            assert_near(own->flux_auto, same->flux_auto, 1e-9 * fabs(own->flux_auto));
        }
        forget(&one);
        forget(&other);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_bleeding_star_is_what_none_finds),
                                       cmocka_unit_test(wings_that_no_psf_explains_are_no_sources),
                                       cmocka_unit_test(masked_for_all_it_stays_masked),
                                       cmocka_unit_test(values_beyond_saturation_reach_only_the_star)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
