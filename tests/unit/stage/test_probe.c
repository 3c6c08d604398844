/* The stage in memory: several tiles at the same time give what each gives alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "bench.h"
#include "io/tile.h"
#include "psf/psf.h"
#include "scene.h"
#include "stage/probe.h"

enum { SIDE = 200, TILES = 6 };

static int same(const rx_probe *a, const rx_probe *b)
{
    const size_t n = (size_t)SIDE * SIDE;
    for (int y = 0; y < SIDE; y++) {
        float room[2][SIDE];
        if (memcmp(rx_map_row(&a->noise, y, 0, SIDE, room[0]), rx_map_row(&b->noise, y, 0, SIDE, room[1]),
                   sizeof room[0]) != 0)
            return 0;
    }
    return a->sources->n == b->sources->n &&
           memcmp(a->sources->list, b->sources->list, (size_t)a->sources->n * sizeof(rx_source)) == 0 &&
           memcmp(a->sources->segments, b->sources->segments, n * sizeof(int32_t)) == 0 &&
           memcmp(a->restored->pixels, b->restored->pixels, n * sizeof(float)) == 0;
}

/* Tiles of very different numbers of sources, so that sep's process-wide limits differ from tile to tile. */
static void check_side_by_side(const char *kind_name)
{
    static const setting settings[] = {{"NTHREADS", "2"}, {"MEMORY_PIXSTACK", "1000"}, {NULL, NULL}};
    const rx_restorer *kind = rx_restorer_find(kind_name);
    rx_field *fields[TILES];
    rx_probe alone[TILES] = {0}, together[TILES] = {0};
    rx_status status[TILES];
    bench b;
    bench_open(&b, settings);
    for (int i = 0; i < TILES; i++) {
        scene s;
        scene_make(&s, SIDE, SIDE, 2 + 60 * i, (uint64_t)(i + 1));
        fields[i] = bench_field(&b, s.pixels, SIDE, SIDE, 2.0);
        scene_free(&s);
        assert_int_equal(rx_probe_run(b.options, kind, fields[i], NULL, NULL, &alone[i], NULL), RX_OK);
        assert_true(alone[i].sources->n > 0);
    }
    for (int threads = 1; threads <= 4; threads += 3) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
        for (int i = 0; i < TILES; i++)
            status[i] = rx_probe_run(b.options, kind, fields[i], NULL, NULL, &together[i], NULL);
        for (int i = 0; i < TILES; i++) {
            assert_int_equal(status[i], RX_OK);
            if (!same(&alone[i], &together[i]))
                fail_msg("%s: tile %d differs with %d threads", kind_name, i, threads);
            rx_probe_free(&together[i]);
        }
    }
    for (int i = 0; i < TILES; i++) {
        rx_probe_free(&alone[i]);
        rx_field_free(fields[i]);
    }
    bench_close(&b);
}

static void test_side_by_side_none(void **state)
{
    (void)state;
    check_side_by_side("NONE");
}

static void test_side_by_side_rl(void **state)
{
    (void)state;
    check_side_by_side("RL");
}

static void test_known_psf_is_copied(void **state)
{
    (void)state;
    bench b;
    scene s;
    rx_psf *known = NULL;
    rx_field *field = NULL;
    bench_open(&b, NULL);
    scene_make(&s, SIDE, SIDE, 10, 3);
    assert_int_equal(rx_psf_moffat(5.0, 3.0, 1.0, 0.0, 21, &known, NULL), RX_OK);
    assert_int_equal(
        rx_field_prepare(b.options, 0, bench_tile(s.pixels, SIDE, SIDE, 0.0), known, 1, NULL, &field, NULL),
        RX_OK);
    assert_ptr_not_equal(field->psf, known);
    assert_int_equal(field->psf->size, 21);
    assert_memory_equal(field->psf->basis, known->basis, 21 * 21 * sizeof(float));
    rx_psf_free(known);
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
}

/* A weight map may say that the noise changes within a background mesh: thresholds on restored pixels follow
 * it, and peaks of the noisy patch are no sources. */
static void test_weights_within_a_mesh(void **state)
{
    (void)state;
    enum { LOW = 70, HIGH = 110 };
    const double quiet = 5.0, loud = 40.0;
    bench b;
    rx_field *field = NULL;
    rx_probe probe;
    float *pixels = RX_NEW(float, (size_t)SIDE *SIDE), *rms = RX_NEW(float, (size_t)SIDE *SIDE);
    assert_non_null(pixels);
    assert_non_null(rms);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const size_t i = (size_t)y * SIDE + (size_t)x;
            const int patch = x >= LOW && x < HIGH && y >= LOW && y < HIGH;
            rms[i] = (float)(patch ? loud : quiet);
            pixels[i] = 1000.0f + rms[i] * (float)rx_random_normal(7, 1, i);
        }
    bench_open(&b, NULL);
    rx_tile *tile = bench_tile(pixels, SIDE, SIDE, 0.0);
    tile->weight = rms;
    tile->weight_type = RX_WEIGHT_MAP_RMS;
    assert_int_equal(rx_field_prepare(b.options, 0, tile, NULL, 1, NULL, &field, NULL), RX_OK);
    assert_int_equal(rx_probe_run(b.options, rx_restorer_find("RL"), field, NULL, NULL, &probe, NULL), RX_OK);
    assert_int_equal(probe.sources->n, 0);
    rx_probe_free(&probe);
    rx_field_free(field);
    free(pixels);
    bench_close(&b);
}

/* A restorer that brings its noise, as the network does: RL with such a map. */
typedef struct twice {
    rx_map_maker maker;
    rx_map sky;
} twice;

static void make_twice(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    const twice *own = (const twice *)maker;
    for (int i = 0; i < n * rows; i++)
        dst[i] = 2 * rx_map_at(&own->sky, x + i % n, y + i / n);
}

static rx_status run_with_sigma(const rx_restore_params *par, const rx_tile *tile,
                                const rx_background *background, const rx_psf *psf, rx_log *log,
                                rx_restored **dst, rx_error *err)
{
    rx_status status = rx_restorer_find("RL")->run(par, tile, background, psf, log, dst, err);
    if (status == RX_OK) {
        twice *own = RX_NEW(twice, 1);
        assert_non_null(own);
        *own = (twice){{make_twice}, rx_background_noise(background)};
        (*dst)->noise = &own->maker;
    }
    return status;
}

static float *plane_of(const rx_map *map)
{
    float *plane = RX_NEW(float, (size_t)SIDE *SIDE);
    assert_non_null(plane);
    rx_map_fill(map, SIDE, 1, plane);
    return plane;
}

static void check_noise(const char *detect_noise, const rx_restorer *kind, int by_map, int filtered)
{
    const setting settings[] = {{"DETECT_NOISE", detect_noise}, {"DETECT_THRESH", "3"}, {NULL, NULL}};
    bench b;
    scene s;
    rx_probe probe;
    bench_open(&b, settings);
    scene_make(&s, SIDE, SIDE, 12, 5);
    rx_field *field = bench_field(&b, s.pixels, SIDE, SIDE, 2.0);
    const rx_restorer *rl = rx_restorer_find("RL");
    b.options->keep_filtered = 1;
    assert_int_equal(rx_probe_run(b.options, kind, field, NULL, NULL, &probe, NULL), RX_OK);
    const rx_map noise = rx_background_noise(field->restored);
    float *own = NULL, *sky = plane_of(&noise), *used = plane_of(&probe.noise);
    if (probe.restored->noise != NULL) {
        const rx_map brought = rx_map_made(probe.restored->noise, SIDE);
        own = plane_of(&brought);
    }
    long above = 0;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++) {
        const float least = own != NULL ? own[i] : sky[i];
        if (by_map && (own != NULL ? used[i] != least : used[i] < least))
            fail_msg("%s: noise %g at pixel %zu, input %g", detect_noise, (double)used[i], i, (double)least);
        above += used[i] > 1.5f * least;
        if (!filtered && probe.filtered[i] != probe.restored->pixels[i])
            fail_msg("%s: pixel %zu was filtered", detect_noise, i);
    }
    assert_int_equal(memcmp(probe.filtered, probe.restored->pixels, (size_t)SIDE * SIDE * sizeof(float)) != 0,
                     filtered);
    if (by_map && kind == rl)
        assert_true(above > 0 && above < SIDE * SIDE / 4); /* around the stars, not on the sky */
    for (int i = 0; i < probe.sources->n && by_map; i++) {
        const rx_source *source = &probe.sources->list[i];
        const size_t p = (size_t)source->ypeak * SIDE + (size_t)source->xpeak;
        /* the lowest of its pixels */
        assert_true(source->threshold <= 3.001 * (double)used[p]);
        assert_true(source->threshold >= 2.8 * (double)(own != NULL ? own[p] : sky[p]));
        assert_true(source->detection_snr >= 3);
    }
    assert_true(probe.sources->n > 0);
    free(sky);
    free(own);
    free(used);
    rx_probe_free(&probe);
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
}

static void test_detection_noise(void **state)
{
    (void)state;
    const rx_restorer *rl = rx_restorer_find("RL");
    rx_restorer with_sigma = *rl;
    with_sigma.name = "WITH_SIGMA";
    with_sigma.run = run_with_sigma;
    check_noise("AUTO", rl, 0, 1);
    check_noise("MEASURED", rl, 0, 1);
    check_noise("INPUT", rl, 1, 1);
    check_noise("AUTO", &with_sigma, 1, 1);
    check_noise("MEASURED", &with_sigma, 0, 1);
}

/* FILTER_RESTORED decides on its own, and nothing of this touches the unrestored image. */
static void test_filter_of_restored(void **state)
{
    (void)state;
    static const struct {
        const char *kind, *filter, *noise;
        int filtered;
    } cases[] = {{"RL", "N", "MEASURED", 0},
                 {"RL", "N", "INPUT", 0},
                 {"RL", "Y", "INPUT", 1},
                 {"NONE", "N", "INPUT", 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const setting settings[] = {
            {"DETECT_NOISE", cases[i].noise}, {"FILTER_RESTORED", cases[i].filter}, {NULL, NULL}};
        bench b;
        scene s;
        rx_probe probe;
        bench_open(&b, settings);
        scene_make(&s, SIDE, SIDE, 12, 5);
        rx_field *field = bench_field(&b, s.pixels, SIDE, SIDE, 2.0);
        b.options->keep_filtered = 1;
        assert_int_equal(
            rx_probe_run(b.options, rx_restorer_find(cases[i].kind), field, NULL, NULL, &probe, NULL), RX_OK);
        assert_int_equal(
            memcmp(probe.filtered, probe.restored->pixels, (size_t)SIDE * SIDE * sizeof(float)) != 0,
            cases[i].filtered);
        rx_probe_free(&probe);
        rx_field_free(field);
        scene_free(&s);
        bench_close(&b);
    }
}

/* SEEING_FWHM's default is no statement, nor is a given one without a pixel scale. */
static void test_moffat_without_fwhm(void **state)
{
    (void)state;
    static const setting nothing[] = {{"PSF_FWHM", "0"}, {NULL, NULL}};
    static const setting seeing[] = {{"PSF_FWHM", "0"}, {"SEEING_FWHM", "1.2"}, {NULL, NULL}};
    for (int i = 0; i < 4; i++) {
        const double scale = i % 2 ? 0.4 : 0.0;
        bench b;
        scene s;
        rx_field *field = NULL;
        bench_open(&b, i < 2 ? nothing : seeing);
        b.options->stated_scale = scale;
        scene_make(&s, SIDE, SIDE, 10, 3);
        assert_int_equal(rx_field_prepare(b.options, 0, bench_tile(s.pixels, SIDE, SIDE, 0.0), NULL, 1, NULL,
                                          &field, NULL),
                         RX_OK);
        assert_int_equal(field->unrestorable, i < 3);
        if (i < 3)
            assert_null(field->psf);
        else
            assert_near(field->psf->fwhm, 3.0, 0.01);
        rx_field_free(field);
        scene_free(&s);
        bench_close(&b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_side_by_side_none),   cmocka_unit_test(test_side_by_side_rl),
        cmocka_unit_test(test_known_psf_is_copied), cmocka_unit_test(test_weights_within_a_mesh),
        cmocka_unit_test(test_detection_noise),     cmocka_unit_test(test_filter_of_restored),
        cmocka_unit_test(test_moffat_without_fwhm)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
