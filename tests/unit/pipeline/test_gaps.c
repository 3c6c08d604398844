/* Stars that masked pixels cut or hollow: one source each, with the light that the mask has taken or a flag. */
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
#include "bench.h"
#include "pipeline/pipeline.h"
#include "scene.h"

enum { SIDE = 120, STARS = 2, STEP = 40, FIRST = 40, N = STARS * STARS };
static const double FLUX = 20000, FWHM = 3.5;

/* What is masked of the star at (x, y), pixels from it on. */
typedef struct hole {
    const char *name;
    int x, y, width, height, diagonal;
    uint8_t bits;
    double least; /* of the flux of a restored image */
} hole;

static const hole holes[] = {
    {"pixel", 0, 0, 1, 1, 0, RX_MASK_BAD, 0.97},
    {"3 x 3", -1, -1, 3, 3, 0, RX_MASK_BAD, 0.85},
    {"weights", -1, -1, 3, 3, 0, RX_MASK_WEIGHT, 0.85},
    {"5 x 5", -2, -2, 5, 5, 0, RX_MASK_BAD, 0.4},
    {"core of a hole", -3, -3, 7, 7, 0, RX_MASK_BAD, 0.03},
    {"core of no weight", -3, -3, 7, 7, 0, RX_MASK_WEIGHT, 0.03},
    {"bleed", -2, -15, 5, 31, 0, RX_MASK_BAD, 0.03},
    {"flank", 1, 1, 3, 3, 0, RX_MASK_BAD, 0.97},
    {"row", -SIDE, 0, 2 * SIDE, 1, 0, RX_MASK_BAD, 0.95},
    {"rows", -SIDE, 0, 2 * SIDE, 2, 0, RX_MASK_WEIGHT, 0.85},
    {"column", 0, -SIDE, 1, 2 * SIDE, 0, RX_MASK_WEIGHT, 0.95},
    {"diagonal", -12, -12, 2, 25, 1, RX_MASK_BAD, 0.9},
};

static double place(int i)
{
    return FIRST + STEP * i + 0.3;
}

static rx_tile *tile_of(const hole *h)
{
    scene s;
    scene_make(&s, SIDE, SIDE, 0, 5);
    for (int k = 0; k < N; k++)
        scene_star(&s, place(k % STARS), place(k / STARS), FLUX, FWHM);
    rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 0);
    for (int k = 0; k < N && h != NULL; k++)
        for (int j = 0; j < h->height; j++)
            for (int i = 0; i < h->width; i++) {
                const int x = (int)place(k % STARS) + h->x + i + h->diagonal * j,
                          y = (int)place(k / STARS) + h->y + j;
                if (x < 0 || x >= SIDE || y < 0 || y >= SIDE)
                    continue;
                tile->mask[y * SIDE + x] = h->bits;
                tile->pixels[y * SIDE + x] = 0.0f;
            }
    scene_free(&s);
    return tile;
}

typedef struct night {
    bench bench;
    rx_field *field;
    rx_result result;
} night;

static void restore(night *n, const char *kind, rx_tile *tile, const setting *more)
{
    char model[1024];
    snprintf(model, sizeof model, "%s/config/psfnet.fits", getenv("srcdir"));
    setting settings[8] = {{"RESTORE_TYPE", kind}, {"NET_MODEL", model}, {"NTHREADS", "1"}};
    for (int i = 0; more != NULL && more[i].name != NULL; i++)
        settings[3 + i] = more[i];
    *n = (night){0};
    bench_open(&n->bench, settings);
    assert_int_equal(
        rx_field_prepare(&n->bench.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &n->field, NULL),
        RX_OK);
    assert_int_equal(rx_field_extract(&n->bench.options->pipeline, rx_restorer_find(kind), n->field, NULL,
                                      NULL, &n->result, NULL),
                     RX_OK);
}

static void forget(night *n)
{
    rx_result_free(&n->result);
    rx_field_free(n->field);
    bench_close(&n->bench);
}

/* NULL where there is none or are more so near. */
static const rx_source *only_source(const night *n, double x, double y, double reach)
{
    const rx_source *found = NULL;
    for (int i = 0, seen = 0; i < n->result.sources->n; i++) {
        const rx_source *s = &n->result.sources->list[i];
        if (hypot(s->x - x, s->y - y) < reach)
            found = seen++ == 0 ? s : NULL;
    }
    return found;
}

static void test_one_source_with_its_light(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL", "NET"};
    for (size_t i = 0; i < 3 * sizeof holes / sizeof *holes; i++) {
        const hole *h = &holes[i / 3];
        const char *kind = kinds[i % 3];
        if (i % 3 == 2 && i % 2 == 0) /* every other one: a network takes its time */
            continue;
        const double least = i % 3 == 0 ? fmin(0.1, h->least) : h->least;
        night n;
        restore(&n, kind, tile_of(h), NULL);
        for (int k = 0; k < N; k++) {
            const rx_source *s = only_source(&n, place(k % STARS), place(k / STARS), 3 * FWHM);
            const int flagged = RX_FLAG_APERTURE | RX_FLAG_ISOPHOTAL;
            if (s == NULL)
                fail_msg("%s, %s: a star is not one source", kind, h->name);
            if ((s->flags & flagged) != flagged ||
                !(s->flux_auto > least * FLUX && s->flux_auto < 1.1 * FLUX))
                fail_msg("%s, %s: flux %g, FLAGS %d", kind, h->name, s->flux_auto, s->flags);
            assert_int_equal((s->flags_weight & RX_FLAGW_ISO) != 0, h->bits == RX_MASK_WEIGHT);
        }
        forget(&n);
    }
}

/* Without masked pixels nothing is flagged, and no gap is looked for in noise. */
static void test_whole_stars(void **state)
{
    (void)state;
    night n;
    restore(&n, "RL", tile_of(NULL), NULL);
    assert_int_equal(n.result.sources->n, N);
    for (int k = 0; k < N; k++)
        assert_int_equal(n.result.sources->list[k].flags, 0);
    assert_null(n.result.restored->gaps);
    forget(&n);
}

/* Two stars on either side of a gap are two. */
static void test_pairs_stay_two(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL", "NET"};
    for (int i = 0; i < 9; i++) {
        const double apart = 6.0 + i / 3 * 1.5;
        scene s;
        night n;
        scene_make(&s, SIDE, SIDE, 0, 5);
        scene_star(&s, 60, 60 - apart / 2, FLUX, FWHM);
        scene_star(&s, 60, 60 + apart / 2, FLUX, FWHM);
        rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 0);
        for (int x = 0; x < SIDE; x++)
            tile->mask[60 * SIDE + x] = tile->mask[59 * SIDE + x] = RX_MASK_BAD;
        scene_free(&s);
        restore(&n, kinds[i % 3], tile, NULL);
        if (only_source(&n, 60, 60 - apart / 2, 2) == NULL || only_source(&n, 60, 60 + apart / 2, 2) == NULL)
            fail_msg("%s: two stars that are %g pixels apart are not two sources", kinds[i % 3], apart);
        forget(&n);
    }
}

/* Noise in gaps is no source: as many as without. */
static void test_noise(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL"};
    for (int i = 0; i < 2; i++) {
        scene s;
        night n;
        scene_make(&s, SIDE, SIDE, 0, 6);
        rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 0);
        for (int k = 0; k < SIDE * SIDE; k++)
            if (k / SIDE % 12 < 3 || (k % SIDE % 12 < 5 && k / SIDE % 12 < 8))
                tile->mask[k] = RX_MASK_BAD;
        scene_free(&s);
        restore(&n, kinds[i], tile, NULL);
        assert_int_equal(n.result.sources->n, 0);
        forget(&n);
    }
}

/* MASK_SATURATED Y: a star whose middle and bled column are masked is one source, measured without them. */
static void test_masked_saturated_star(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL", "NET"};
    static const setting masked[] = {{"MASK_SATURATED", "Y"}, {NULL, NULL}};
    for (int i = 0; i < 6; i++) {
        enum { FULL = 20000 };
        scene s;
        night n;
        scene_make(&s, SIDE, SIDE, 0, 5);
        scene_star(&s, 60, 60, 2e6, FWHM);
        for (int y = 35; y < 85 && i > 2; y++)
            s.pixels[y * SIDE + 60] = s.pixels[y * SIDE + 61] = FULL;
        rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 0);
        for (int k = 0; k < SIDE * SIDE; k++)
            if (tile->pixels[k] >= FULL)
                tile->mask[k] = RX_MASK_SATURATED;
        scene_free(&s);
        restore(&n, kinds[i % 3], tile, masked);
        const rx_source *star = only_source(&n, 60, 60, 3 * FWHM);
        if (star == NULL)
            fail_msg("%s: the star is not one source", kinds[i % 3]);
        assert_near(star->x, 60, 1.5);
        assert_int_equal(star->flags & (RX_FLAG_SATURATED | RX_FLAG_APERTURE),
                         RX_FLAG_SATURATED | RX_FLAG_APERTURE);
        assert_int_equal(n.result.restored->mask[60 * SIDE + 60], RX_MASK_SATURATED);
        forget(&n);
    }
}

/* Its core is 0, as no card and no map says. */
static void test_hollow_star(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL", "NET"};
    static const double flux[] = {3e4, 2e6};
    for (int i = 0; i < 6; i++) {
        enum { FULL = 2000 };
        scene s;
        night n;
        scene_make(&s, SIDE, SIDE, 0, 5);
        scene_star(&s, 60, 60, flux[i / 3], FWHM);
        for (int k = 0; k < SIDE * SIDE; k++)
            if (s.pixels[k] > FULL)
                s.pixels[k] = 0;
        rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 0);
        scene_free(&s);
        restore(&n, kinds[i % 3], tile, NULL);
        const rx_source *star = only_source(&n, 60, 60, 3 * FWHM);
        if (star == NULL)
            fail_msg("%s: the star of %g ADU is not one source", kinds[i % 3], flux[i / 3]);
        assert_near(star->x, 60, 1.5);
        assert_int_equal(star->flags & RX_FLAG_SATURATED, RX_FLAG_SATURATED);
        forget(&n);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_source_with_its_light),
        cmocka_unit_test(test_whole_stars),
        cmocka_unit_test(test_pairs_stay_two),
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_masked_saturated_star),
        cmocka_unit_test(test_hollow_star),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
