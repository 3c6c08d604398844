/* The pipeline in memory: a caller's arrays, and several tiles at the same time give what each gives alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "bench.h"
#include "data/gaps.h"
#include "io/tile.h"
#include "pipeline/crowd_psf.h"
#include "pipeline/pipeline.h"
#include "psf/psf.h"
#include "scene.h"
#include "stage/coordinates.h"
#include "stage/pipeline.h"

enum { SIDE = 200, TILES = 6 };

static int same(const rx_result *a, const rx_result *b)
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
    rx_result alone[TILES] = {0}, together[TILES] = {0};
    rx_status status[TILES];
    bench b;
    bench_open(&b, settings);
    for (int i = 0; i < TILES; i++) {
        scene s;
        scene_make(&s, SIDE, SIDE, 2 + 60 * i, (uint64_t)(i + 1));
        fields[i] = bench_field(&b, s.pixels, SIDE, SIDE, 2.0);
        scene_free(&s);
        assert_int_equal(rx_field_extract(&b.options->pipeline, kind, fields[i], NULL, NULL, &alone[i], NULL),
                         RX_OK);
        assert_true(alone[i].sources->n > 0);
    }
    for (int threads = 1; threads <= 4; threads += 3) {
#pragma omp parallel for schedule(dynamic, 1) num_threads(threads)
        for (int i = 0; i < TILES; i++)
            status[i] =
                rx_field_extract(&b.options->pipeline, kind, fields[i], NULL, NULL, &together[i], NULL);
        for (int i = 0; i < TILES; i++) {
            assert_int_equal(status[i], RX_OK);
            if (!same(&alone[i], &together[i]))
                fail_msg("%s: tile %d differs with %d threads", kind_name, i, threads);
            rx_result_free(&together[i]);
        }
    }
    for (int i = 0; i < TILES; i++) {
        rx_result_free(&alone[i]);
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

/* Sources of one grid are not to be measured on another. */
static void test_two_grids(void **state)
{
    (void)state;
    bench b;
    rx_field *fields[2];
    rx_result result;
    rx_error err = RX_ERROR_NONE;
    bench_open(&b, NULL);
    for (int i = 0; i < 2; i++) {
        scene s;
        scene_make(&s, SIDE, SIDE - i, 10, 3);
        fields[i] = bench_field(&b, s.pixels, SIDE, SIDE - i, 2.0);
        scene_free(&s);
    }
    assert_int_equal(rx_field_extract(&b.options->pipeline, rx_restorer_find("RL"), fields[0], fields[1],
                                      NULL, &result, &err),
                     RX_INPUT);
    assert_non_null(strstr(err.text, "200 x 199"));
    rx_field_free(fields[0]);
    rx_field_free(fields[1]);
    bench_close(&b);
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
    assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF,
                                      bench_tile(s.pixels, SIDE, SIDE, 0.0), known, NULL, &field, NULL),
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
    rx_result result;
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
    assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &field, NULL),
                     RX_OK);
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("RL"), field, NULL, NULL, &result, NULL),
        RX_OK);
    assert_int_equal(result.sources->n, 0);
    rx_result_free(&result);
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

static rx_status run_with_sigma(const rx_restore_params *par, const rx_image *image, rx_log *log,
                                rx_restored **dst, rx_error *err)
{
    rx_status status = rx_restorer_find("RL")->run(par, image, log, dst, err);
    if (status == RX_OK) {
        twice *own = RX_NEW(twice, 1);
        assert_non_null(own);
        *own = (twice){{make_twice}, image->noise};
        (*dst)->noise_maker = &own->maker;
        (*dst)->noise = rx_map_made(&own->maker, image->width);
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
    rx_result result;
    bench_open(&b, settings);
    scene_make(&s, SIDE, SIDE, 12, 5);
    rx_field *field = bench_field(&b, s.pixels, SIDE, SIDE, 2.0);
    const rx_restorer *rl = rx_restorer_find("RL");
    b.options->pipeline.keep_filtered = 1;
    assert_int_equal(rx_field_extract(&b.options->pipeline, kind, field, NULL, NULL, &result, NULL), RX_OK);
    const rx_map noise = rx_background_noise(field->restored);
    float *own = NULL, *sky = plane_of(&noise), *used = plane_of(&result.noise);
    if (rx_map_given(&result.restored->noise))
        own = plane_of(&result.restored->noise);
    long above = 0;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++) {
        const float least = own != NULL ? own[i] : sky[i];
        if (by_map && (own != NULL ? used[i] != least : used[i] < least))
            fail_msg("%s: noise %g at pixel %zu, input %g", detect_noise, (double)used[i], i, (double)least);
        above += used[i] > 1.5f * least;
        if (!filtered && result.filtered[i] != result.restored->pixels[i])
            fail_msg("%s: pixel %zu was filtered", detect_noise, i);
    }
    assert_int_equal(
        memcmp(result.filtered, result.restored->pixels, (size_t)SIDE * SIDE * sizeof(float)) != 0, filtered);
    if (by_map && kind == rl) {
        assert_true(above > 0);
        assert_true(above < SIDE * SIDE / 4);
    } /* around the stars, not on the sky */
    for (int i = 0; i < result.sources->n && by_map; i++) {
        const rx_source *source = &result.sources->list[i];
        const size_t p = (size_t)source->ypeak * SIDE + (size_t)source->xpeak;
        /* the lowest of its pixels */
        assert_true(source->threshold <= 3.001 * (double)used[p]);
        assert_true(source->threshold >= 2.8 * (double)(own != NULL ? own[p] : sky[p]));
        assert_true(source->detection_snr >= 3);
    }
    assert_true(result.sources->n > 0);
    free(sky);
    free(own);
    free(used);
    rx_result_free(&result);
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

/* The sources of the same restored pixels, with Kron factor and least radius; thresholds are of these pixels as well. */
static void measure_with(const rx_restorer *kind, const char *auto_params, scene *s, rx_result *dst)
{
    const setting settings[] = {{"DETECT_NOISE", "MEASURED"}, {"PHOT_AUTOPARAMS", auto_params}, {NULL, NULL}};
    bench b;
    bench_open(&b, settings);
    rx_field *field = bench_field(&b, s->pixels, SIDE, SIDE, 2.0);
    assert_int_equal(rx_field_extract(&b.options->pipeline, kind, field, NULL, NULL, dst, NULL), RX_OK);
    rx_field_free(field);
    bench_close(&b);
}

/* On a network's image 1.2 Kron factors, and the least radius as it is. */
static void test_kron_factor_of_networks(void **state)
{
    (void)state;
    static const char *const params[][2] = {{"2.5,0", "3,0"}, {"0.1,3.5", "0.1,3.5"}};
    const rx_restorer *rl = rx_restorer_find("RL");
    rx_restorer with_sigma = *rl;
    with_sigma.name = "WITH_SIGMA";
    with_sigma.run = run_with_sigma;
    scene s;
    scene_make(&s, SIDE, SIDE, 12, 5);
    for (int i = 0; i < 2; i++) {
        rx_result network = {0}, other = {0};
        measure_with(&with_sigma, params[i][0], &s, &network);
        measure_with(rl, params[i][1], &s, &other);
        assert_true(network.sources->n > 0);
        assert_int_equal(network.sources->n, other.sources->n);
        for (int k = 0; k < network.sources->n; k++) {
            const rx_source *a = &network.sources->list[k], *o = &other.sources->list[k];
            assert_near(a->kron_radius, o->kron_radius, 1e-9);
            assert_near(a->flux_auto, o->flux_auto, 1e-6 * fabs(o->flux_auto));
        }
        rx_result_free(&network);
        rx_result_free(&other);
    }
    scene_free(&s);
}

/* Noise that is all but white: its factor is 1 in single precision, not in double. */
static void test_noise_all_but_white(void **state)
{
    (void)state;
    static const setting settings[] = {{"DETECT_NOISE", "INPUT"}, {NULL, NULL}};
    static const float kernel[] = {1e-9f, 1.0f, 1e-9f};
    bench b;
    scene s;
    rx_result white = {0}, nearly = {0};
    bench_open(&b, settings);
    scene_make(&s, SIDE, SIDE, 12, 5);
    const rx_image image = {.width = SIDE, .height = SIDE, .pixels = s.pixels, .gain = 2.0};
    rx_pipeline_params *params = &b.options->pipeline;
    params->noise = (rx_correlation_params){.origin = RX_NOISE_WHITE};
    assert_int_equal(rx_pipeline_run(params, &image, NULL, &white, NULL), RX_OK);
    params->noise = (rx_correlation_params){RX_NOISE_GIVEN, kernel, 3, 1};
    assert_int_equal(rx_pipeline_run(params, &image, NULL, &nearly, NULL), RX_OK);
    assert_true(nearly.own->noise_factor > 1.0);
    assert_true(same(&white, &nearly));
    rx_result_free(&white);
    rx_result_free(&nearly);
    scene_free(&s);
    bench_close(&b);
}

/* SEEING_FWHM's default is no statement, nor is a given one without a pixel scale. */
/* Aperture errors of untouched pixels: of the noise as it is, of independent pixels where SExtractor's way is asked for
 * or nothing but the rms of pixels. */
static void test_errors_of_correlated_noise(void **state)
{
    (void)state;
    static const float ones[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};
    static const struct {
        const char *thresholds, *calibration;
        int known;
    } cases[] = {
        {"RELATIVE", "N", 0}, {"RELATIVE", "AUTO", 0}, {"SIGNIFICANCE", "N", 0}, {"SIGNIFICANCE", "AUTO", 1}};
    const rx_restorer *none = rx_restorer_find("NONE");
    double first[4] = {0};
    scene s;
    scene_make(&s, SIDE, SIDE, 3, 5);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const setting settings[] = {{"THRESH_TYPE", cases[i].thresholds},
                                    {"ERROR_CALIBRATION", cases[i].calibration},
                                    {"DETECT_THRESH", "5"},
                                    {"PHOT_APERTURES", "8"},
                                    {NULL, NULL}};
        bench b;
        rx_result result = {0};
        bench_open(&b, settings);
        b.options->pipeline.noise = (rx_correlation_params){RX_NOISE_GIVEN, ones, 3, 3};
        rx_field *field = bench_field(&b, s.pixels, SIDE, SIDE, 0.0);
        assert_int_equal(rx_field_extract(&b.options->pipeline, none, field, NULL, NULL, &result, NULL),
                         RX_OK);
        assert_true(result.sources->n > 0);
        const double error = result.sources->list[0].fluxerr_aper[0];
        const rx_noise_law law = rx_noise_law_of(&field->noise);
        first[i] = error;
        assert_near(error / first[0], cases[i].known ? rx_noise_law_factor(&law, 3.14159 * 16) : 1.0, 0.01);
        assert_true(!cases[i].known || error > 2 * first[0]);
        rx_result_free(&result);
        rx_field_free(field);
        bench_close(&b);
    }
    scene_free(&s);
}

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
        b.options->pipeline.stated_scale = scale;
        scene_make(&s, SIDE, SIDE, 10, 3);
        assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF,
                                          bench_tile(s.pixels, SIDE, SIDE, 0.0), NULL, NULL, &field, NULL),
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

static const char *fact(const rx_record *facts, const char *name)
{
    for (int i = 0; i < facts->n; i++)
        if (strcmp(facts->pairs[i][0], name) == 0)
            return facts->pairs[i][1];
    return NULL;
}

/* A caller's arrays give what the same pixels give as a tile; what the values say is hidden needs no mask. */
static void test_arrays(void **state)
{
    (void)state;
    static const setting settings[] = {{"TEMPLATE_TYPE", "POINT"}, {NULL, NULL}};
    static const char *const names[] = {"NUMBER",   "X_IMAGE",   "FLUX_AUTO",
                                        "MAG_AUTO", "FLUX_APER", "FLUX_TEMPLATE"};
    enum { COLUMNS = sizeof names / sizeof *names, HOLE = 70 * SIDE + 31, FULL = 90 * SIDE + 120 };
    bench b;
    scene s;
    rx_result of_tile = {0}, of_arrays = {0}, none = {0};
    rx_table *table = NULL;
    rx_record facts = {0};
    rx_error err = RX_ERROR_NONE;
    bench_open(&b, settings);
    b.options->pipeline.templates.wanted = 1;
    scene_make(&s, SIDE, SIDE, 40, 8);
    s.pixels[FULL] = 60000.0f;
    rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 2.0);
    tile->mask[HOLE] = RX_MASK_BAD;
    tile->pixels[HOLE] = 0.0f;
    tile->mask[FULL] = RX_MASK_SATURATED;
    tile->saturation = 50000.0;
    rx_field *field = NULL;
    assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &field, NULL),
                     RX_OK);
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("RL"), field, NULL, NULL, &of_tile, NULL),
        RX_OK);
    assert_int_equal(rx_coordinates_fill(&field->image, of_tile.sources, NULL), RX_OK);

    s.pixels[HOLE] = NAN;
    rx_image image = {.width = SIDE,
                      .height = SIDE,
                      .pixels = s.pixels,
                      .gain = 2.0,
                      .saturation = 50000.0,
                      .zeropoint = 25.0};
    assert_int_equal(rx_pipeline_run(&b.options->pipeline, &image, NULL, &of_arrays, NULL), RX_OK);
    assert_true(of_tile.sources->n > 20);
    assert_true(same(&of_tile, &of_arrays));
    assert_int_equal(rx_result_table(&of_arrays, names, COLUMNS, &table, NULL), RX_OK);
    assert_int_equal(table->nrows, of_arrays.sources->n);
    for (int i = 0; i < of_arrays.sources->n; i++) {
        const rx_source *source = &of_arrays.sources->list[i];
        assert_near(rx_column_value(&table->columns[1], i, 0), source->x + 1.0, 1e-3);
        assert_near(rx_column_value(&table->columns[5], i, 0), source->fit.flux,
                    1e-5 * fabs(source->fit.flux));
    }
    rx_result_facts(&of_arrays, &facts);
    assert_false(facts.failed);
    assert_string_equal(fact(&facts, "RXREST"), "RL");
    assert_near(strtod(fact(&facts, "RXSIGMA"), NULL), field->restored->global_sigma, 1e-5);
    assert_null(fact(&facts, "RXINSUM")); /* of a file */

    static const char *const unknown[] = {"X_IMAGF"};
    rx_table *no = table;
    assert_int_equal(rx_result_table(&of_arrays, unknown, 1, &no, &err), RX_USAGE);
    assert_null(no);
    assert_non_null(strstr(err.text, "X_IMAGE"));
    image.width = 0;
    assert_int_equal(rx_pipeline_run(&b.options->pipeline, &image, NULL, &none, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "0 x 200"));
    rx_field *nothing = field;
    assert_int_equal(rx_field_new(&b.options->pipeline, 0, &image, NULL, &nothing, &err), RX_USAGE);
    assert_null(nothing);
    rx_record_free(&facts);
    rx_table_free(table);
    rx_result_free(&of_arrays);
    rx_result_free(&of_tile);
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
}

/* Who watches a run, and may stop it. */
typedef struct watch {
    const char *what; /* is being done */
    int asked, stop_at;
    int told;
    double done;
    struct {
        const char *what;
        int first, last; /* questions asked meanwhile, from 1 */
    } parts[8];
    int nparts;
} watch;

static bool ask(void *user)
{
    watch *w = user;
    assert_non_null(w->what);
    w->asked++;
    if (w->nparts == 0 || w->parts[w->nparts - 1].what != w->what) {
        assert_in_range(w->nparts, 0, 7);
        w->parts[w->nparts].what = w->what;
        w->parts[w->nparts++].first = w->asked;
    }
    w->parts[w->nparts - 1].last = w->asked;
    return w->stop_at > 0 && w->asked >= w->stop_at;
}

static void see(void *user, const char *what, double done)
{
    static const char *const parts[] = {"sky and PSF", "restoration", "detection",
                                        "templates",   "measurement", "done"};
    watch *w = user;
    if (w->told++ == 0)
        assert_near(done, 0.0, 0.0);
    assert_true(done >= w->done);
    assert_true(done <= 1.0);
    w->done = done;
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        if (strcmp(parts[i], what) == 0)
            w->what = parts[i];
}

static rx_status watched(const rx_pipeline_params *params, const scene *s, watch *w, rx_result *dst,
                         rx_error *err)
{
    const rx_image image = {.width = s->width, .height = s->height, .pixels = s->pixels, .gain = 2.0};
    rx_log log;
    rx_log_calls(&log, RX_QUIET, NULL, see, w);
    *err = RX_ERROR_NONE;
    err->stop = ask;
    err->user = w;
    return rx_pipeline_run(params, &image, &log, dst, err);
}

static const setting watched_settings[] = {
    {"NTHREADS", "1"}, {"PSF_TYPE", "AUTO"}, {"RL_NITER", "5"}, {NULL, NULL}};

/* The caller can stop a run in each of its parts, and is left with nothing; whose stop says no gets what he would. */
static void test_stop(void **state)
{
    (void)state;
    bench b;
    scene s;
    rx_error err;
    rx_result result = {0}, stopped = {0};
    watch all = {0};
    bench_open(&b, watched_settings);
    b.options->pipeline.templates.wanted = 1;
    scene_make(&s, SIDE, SIDE, 40, 8);
    assert_int_equal(watched(&b.options->pipeline, &s, &all, &result, &err), RX_OK);
    assert_true(result.sources->n > 20);
    assert_near(all.done, 1.0, 0.0);
    assert_string_equal(all.what, "done");
    assert_int_equal(all.nparts, 5);
    assert_true(all.parts[1].last - all.parts[1].first >= 5);
    assert_true(all.parts[3].last - all.parts[3].first >= 20);
    assert_true(all.parts[4].last > all.parts[4].first);
    for (int i = 0; i < 2 * all.nparts; i++) {
        watch w = {.stop_at = i % 2 == 0 ? all.parts[i / 2].first : all.parts[i / 2].last};
        assert_int_equal(watched(&b.options->pipeline, &s, &w, &stopped, &err), RX_INTERRUPTED);
        assert_string_equal(err.text, "stopped by the caller");
        assert_string_equal(w.what, all.parts[i / 2].what);
        assert_null(stopped.sources);
        assert_null(stopped.restored);
        assert_null(stopped.own);
    }
    rx_result_free(&result);
    scene_free(&s);
    bench_close(&b);
}

/* An array has no header to look a seeing up in: without stars it stays as it is, and the result says so. */
static void test_no_stars(void **state)
{
    (void)state;
    bench b;
    scene s;
    rx_error err;
    rx_result result = {0};
    watch w = {0};
    static const setting nothing_stated[] = {{"PSF_TYPE", "AUTO"}, {"PSF_FWHM", "0"}, {NULL, NULL}};
    bench_open(&b, nothing_stated);
    scene_make(&s, SIDE, SIDE, 0, 8);
    assert_int_equal(watched(&b.options->pipeline, &s, &w, &result, &err), RX_OK);
    assert_string_equal(result.restored->name, "NONE");
    assert_string_equal(result.by, "NONE");
    rx_result_free(&result);
    scene_free(&s);
    bench_close(&b);
}

/* One of two runs at the same time. */
typedef struct job {
    const rx_pipeline_params *params;
    scene s;
    watch w;
    rx_result result;
    rx_status status;
} job;

static void *run_job(void *user)
{
    job *j = user;
    rx_error err;
    j->status = watched(j->params, &j->s, &j->w, &j->result, &err);
    return NULL;
}

/* Neither knows of the other: the same bytes, questions and progress as alone. */
static void test_two_threads(void **state)
{
    (void)state;
    bench b;
    job alone[2] = {0}, together[2] = {0};
    pthread_t threads[2];
    bench_open(&b, watched_settings);
    b.options->pipeline.templates.wanted = 1;
    for (int i = 0; i < 2; i++) {
        alone[i].params = &b.options->pipeline;
        scene_make(&alone[i].s, SIDE, SIDE, 30 + 30 * i, (uint64_t)(4 + i));
        together[i] = alone[i];
        run_job(&alone[i]);
        assert_int_equal(alone[i].status, RX_OK);
    }
    for (int i = 0; i < 2; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, run_job, &together[i]), 0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(pthread_join(threads[i], NULL), 0);
        assert_int_equal(together[i].status, RX_OK);
        assert_true(same(&alone[i].result, &together[i].result));
        assert_int_equal(together[i].w.asked, alone[i].w.asked);
        assert_int_equal(together[i].w.told, alone[i].w.told);
        rx_result_free(&alone[i].result);
        rx_result_free(&together[i].result);
        scene_free(&alone[i].s);
    }
    bench_close(&b);
}

/* MASK_SATURATED: N for none, AUTO for what is restored, Y for all. */
static void test_saturated_pixels(void **state)
{
    (void)state;
    enum { FULL = 90 * SIDE + 120 }; /* no brighter than the sky: of no source */
    static const char *const words[] = {"N", "AUTO", "Y"}, *const kinds[] = {"NONE", "RL"};
    for (int w = 0; w < 3; w++) {
        const setting settings[] = {{"MASK_SATURATED", words[w]}, {NULL, NULL}};
        bench b;
        scene s;
        rx_field *field = NULL;
        bench_open(&b, settings);
        scene_make(&s, SIDE, SIDE, 10, 8);
        rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 2.0);
        tile->pixels[FULL] = 1000.0f;
        tile->mask[FULL] = RX_MASK_SATURATED;
        assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &field, NULL),
                         RX_OK);
        for (int k = 0; k < 2; k++) {
            rx_result result = {0};
            assert_int_equal(rx_field_extract(&b.options->pipeline, rx_restorer_find(kinds[k]), field, NULL,
                                              NULL, &result, NULL),
                             RX_OK);
            assert_int_equal(result.restored->mask[FULL], w + k > 1 ? RX_MASK_SATURATED : 0);
            rx_result_free(&result);
        }
        rx_field_free(field);
        scene_free(&s);
        bench_close(&b);
    }
}

/* Where nothing states a level, tops that are cut off at one say it; where one is stated it holds. */
static void test_saturation_of_the_pixels(void **state)
{
    (void)state;
    enum { TOP = 60 * SIDE + 60 };
    static const double stated[] = {HUGE_VAL, 50000.0};
    bench b;
    scene s;
    bench_open(&b, NULL);
    scene_make(&s, SIDE, SIDE, 10, 8);
    for (int i = 0; i < 2; i++)
        scene_star(&s, 60 + 50 * i, 60, 1e6, 3.5);
    for (int i = 0; i < SIDE * SIDE; i++)
        s.pixels[i] = fminf(s.pixels[i], 9000.0f);
    for (int k = 0; k < 2; k++) {
        rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 2.0);
        rx_field *field = NULL;
        tile->saturation = stated[k];
        assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &field, NULL),
                         RX_OK);
        assert_near(field->image.saturation, k == 0 ? 9000.0 : 50000.0, 0.0);
        assert_near(field->tile->saturation, field->image.saturation, 0.0);
        assert_int_equal(field->image.saturated[TOP], k == 0 ? RX_MASK_SATURATED : 0);
        assert_int_equal(field->image.saturated[0], 0);
        rx_field_free(field);
    }
    scene_free(&s);
    bench_close(&b);
}

/* Dead pixels: restorers leave out what is too deep for any cloud, and say how many there are; NONE takes all as it is. */
static void test_deep_pixels(void **state)
{
    (void)state;
    enum { HOLE = 90 * SIDE + 120, N = 3 };
    static const char *const kinds[] = {"NONE", "RL"};
    static const double sigmas[N] = {-290, -310, -1e6};
    bench b;
    scene s;
    rx_field *field = NULL, *clean = NULL;
    bench_open(&b, NULL);
    scene_make(&s, SIDE, SIDE, 10, 8);
    assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF,
                                      bench_tile(s.pixels, SIDE, SIDE, 2.0), NULL, NULL, &clean, NULL),
                     RX_OK);
    assert_int_equal(clean->deep, 0);
    rx_tile *tile = bench_tile(s.pixels, SIDE, SIDE, 2.0);
    for (int i = 0; i < N; i++)
        tile->pixels[HOLE + 20 * i] =
            (float)(clean->plain->global_level + sigmas[i] * clean->plain->global_sigma);
    assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &field, NULL),
                     RX_OK);
    assert_int_equal(field->deep, 2);
    for (int k = 0; k < 2; k++) {
        rx_result result = {0};
        rx_record facts = {0};
        int said = 0;
        assert_int_equal(rx_field_extract(&b.options->pipeline, rx_restorer_find(kinds[k]), field, NULL, NULL,
                                          &result, NULL),
                         RX_OK);
        const rx_gaps *gaps = result.restored->gaps;
        assert_int_equal(gaps != NULL ? gaps->n : 0, k == 1 ? 2 : 0);
        for (size_t i = 0; gaps != NULL && i < gaps->n; i++)
            assert_int_equal(gaps->list[i].at, HOLE + 20 * (int)(i + 1));
        rx_result_facts(&result, &facts);
        for (int i = 0; i < facts.n; i++)
            if (strcmp(facts.pairs[i][0], "RXDEEP") == 0)
                assert_string_equal(facts.pairs[i][1], "2"), said++;
        assert_int_equal(said, 1);
        rx_record_free(&facts);
        rx_result_free(&result);
    }
    rx_field_free(clean);
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
}

/* What of a crowd its PSF is measured on: some 12 squares, in every quarter of the tile; what was hidden stays so. */
static void test_psf_squares(void **state)
{
    (void)state;
    enum { SIDE = 129 }; /* 64 FWHM of 2 pixels and 1 */
    static const int sizes[][3] = {{4, 3, 1}, {4, 4, 2}, {9, 9, 7}, {16, 16, 22}, {40, 3, 10}, {12, 12, 12}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        const int nx = sizes[i][0], ny = sizes[i][1];
        const size_t width = (size_t)nx * SIDE;
        rx_image image = {.width = nx * SIDE, .height = ny * SIDE};
        uint8_t *hidden = rx_alloc(width * (size_t)image.height, 1), *mask = NULL;
        int step, kept = 0, quarters[4] = {0};
        assert_non_null(hidden);
        hidden[5] = RX_MASK_SATURATED;
        image.mask = hidden;
        assert_int_equal(rx_psf_squares(&image, 2.0, &mask, &step, NULL), RX_OK);
        assert_int_equal(step, sizes[i][2]);
        assert_true((mask == NULL) == (step == 1));
        for (int v = 0; v < ny && mask != NULL; v++)
            for (int u = 0; u < nx; u++) {
                const int on =
                    (mask[((size_t)v * SIDE + 64) * width + (size_t)u * SIDE + 64] & RX_MASK_BAD) == 0;
                kept += on;
                quarters[2 * (2 * v >= ny) + (2 * u >= nx)] += on;
            }
        for (int k = 0; k < 4 && mask != NULL; k++)
            assert_true(quarters[k] >= 2);
        assert_true(kept <= 13 && (mask == NULL || kept >= 8));
        if (mask != NULL)
            assert_int_equal(mask[5] & RX_MASK_SATURATED, RX_MASK_SATURATED);
        free(mask);
        free(hidden);
    }
}

/* Where no one states a PSF, stars alone say it, or nothing does. */
static void test_psf_without_hints(void **state)
{
    (void)state;
    static const setting settings[] = {{"PSF_TYPE", "AUTO"}, {"PSF_FWHM", "0"}, {NULL, NULL}};
    bench b;
    bench_open(&b, settings);
    rx_pipeline_params params[2] = {b.options->pipeline, b.options->pipeline};
    params[1].psf_hints = NULL;
    for (int stars = 0; stars <= 60; stars += 60) {
        scene s;
        rx_field *fields[2];
        scene_make(&s, SIDE, SIDE, stars, 8);
        const rx_image image = {.width = SIDE, .height = SIDE, .pixels = s.pixels};
        for (int i = 0; i < 2; i++) {
            params[i].seeing_stated = true;
            params[i].seeing_arcsec = params[i].stated_scale = 1.5;
            assert_int_equal(rx_field_new(&params[i], RX_FIELD_PSF, &image, NULL, &fields[i], NULL), RX_OK);
        }
        assert_non_null(fields[0]->psf);
        assert_int_equal(fields[1]->unrestorable, stars == 0);
        if (stars == 0)
            assert_null(fields[1]->psf);
        else
            assert_string_equal(fields[1]->psf->description, fields[0]->psf->description);
        rx_field_free(fields[0]);
        rx_field_free(fields[1]);
        scene_free(&s);
    }
    bench_close(&b);
}

/* White noise of sigma 5: what a mesh says of it is clipped, and stays where SExtractor's sky is asked for. */
static void test_noise_of_a_pixel(void **state)
{
    (void)state;
    enum { WIDE = 500 };
    scene s;
    scene_make(&s, WIDE, WIDE, 0, 3);
    for (int passes = 1; passes <= 2; passes++) {
        const setting settings[] = {{"BACK_PASSES", passes == 1 ? "1" : "2"}, {NULL, NULL}};
        bench b;
        bench_open(&b, settings);
        rx_field *field = bench_field(&b, s.pixels, WIDE, WIDE, 0);
        const rx_map noise = rx_background_noise(field->plain);
        double mean = 0;
        for (int y = 0; y < WIDE; y++)
            for (int x = 0; x < WIDE; x++)
                mean += (double)rx_map_at(&noise, x, y) / (WIDE * WIDE);
        print_message("BACK_PASSES %d: noise %.4f\n", passes, mean);
        assert_near(mean, passes == 1 ? 4.925 : 5.0, 0.02);
        assert_near(field->noise.scale, passes == 1 ? 5.0 / 4.925 : 1.0, 0.005);
        rx_field_free(field);
        bench_close(&b);
    }
    scene_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_noise_of_a_pixel),
                                       cmocka_unit_test(test_arrays),
                                       cmocka_unit_test(test_psf_without_hints),
                                       cmocka_unit_test(test_stop),
                                       cmocka_unit_test(test_no_stars),
                                       cmocka_unit_test(test_two_threads),
                                       cmocka_unit_test(test_side_by_side_none),
                                       cmocka_unit_test(test_side_by_side_rl),
                                       cmocka_unit_test(test_two_grids),
                                       cmocka_unit_test(test_known_psf_is_copied),
                                       cmocka_unit_test(test_weights_within_a_mesh),
                                       cmocka_unit_test(test_detection_noise),
                                       cmocka_unit_test(test_kron_factor_of_networks),
                                       cmocka_unit_test(test_noise_all_but_white),
                                       cmocka_unit_test(test_saturated_pixels),
                                       cmocka_unit_test(test_saturation_of_the_pixels),
                                       cmocka_unit_test(test_deep_pixels),
                                       cmocka_unit_test(test_errors_of_correlated_noise),
                                       cmocka_unit_test(test_psf_squares),
                                       cmocka_unit_test(test_moffat_without_fwhm)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
