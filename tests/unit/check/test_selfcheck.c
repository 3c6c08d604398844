/* Self check and blank check against what is known of simulated tiles. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../near.h"
#include "../pipeline/bench.h"
#include "../pipeline/scene.h"
#include "../scratch.h"
#include "base/memory.h"
#include "base/random.h"
#include "catalog/catalog.h"
#include "check/checks.h"
#include "check/replica.h"
#include "check/selfcheck.h"
#include "io/fits_write.h"
#include "pipeline/pipeline.h"
#include "quality/match.h"
#include "simulate/render.h"
#include "simulate/scene.h"
#include "stage/stage.h"

enum { SIDE = 400 };

/* --- completeness against the truth --- */

/* A star of scene.c's profile, independent of the renderer of simulate/. */
static void add_star(float *pixels, double x, double y, double flux)
{
    const double fwhm = 3.5, beta = 4.765, alpha = fwhm / (2.0 * sqrt(pow(2.0, 1.0 / beta) - 1.0));
    for (int j = (int)y - 20; j <= (int)y + 20; j++)
        for (int i = (int)x - 20; i <= (int)x + 20; i++) {
            double sum = 0.0;
            if (i < 0 || j < 0 || i >= SIDE || j >= SIDE)
                continue;
            for (int k = 0; k < 25; k++) {
                double dx = i - x + (k % 5 - 2) / 5.0, dy = j - y + (k / 5 - 2) / 5.0;
                sum += pow(1.0 + (dx * dx + dy * dy) / (alpha * alpha), -beta) / 25.0;
            }
            pixels[j * SIDE + i] += (float)(flux * (beta - 1.0) / (acos(-1.0) * alpha * alpha) * sum);
        }
}

enum { BINS = 4 };

typedef struct tally {
    long found[BINS], all[BINS];
} tally;

static void count_found(const rx_qa_list *truth, const rx_qa_list *list, double low, double step, tally *dst)
{
    long *partner = calloc((size_t)truth->n + 1, sizeof *partner);
    long *origin = calloc((size_t)list->n + 1, sizeof *origin);
    assert_true(partner != NULL);
    assert_true(origin != NULL);
    assert_int_equal(rx_match(&(rx_match_list){truth->n, truth->x, truth->y, NULL},
                              &(rx_match_list){list->n, list->x, list->y, NULL}, 2.0, partner, origin, NULL),
                     RX_OK);
    for (long i = 0; i < truth->n; i++) {
        int bin = (int)floor((truth->mag[i] - low) / step);
        if (bin < 0 || bin >= BINS)
            continue;
        dst->all[bin]++;
        dst->found[bin] += partner[i] >= 0;
    }
    free(partner);
    free(origin);
}

/* The truth: fresh tiles with bright stars and, between them on a grid, stars of known magnitudes. */
static void true_tally(const bench *b, const rx_restorer *kind, double low, double high, tally *dst)
{
    enum { GRID = 40, CELLS = (SIDE / GRID) * (SIDE / GRID) };
    for (uint64_t tile = 0; tile < 8; tile++) {
        double x[CELLS], y[CELLS], mag[CELLS];
        rx_result result;
        scene s;
        scene_make(&s, SIDE, SIDE, 20, 100 + tile);
        for (int k = 0; k < CELLS; k++) {
            double u = rx_random_uniform(55, tile, (uint64_t)k);
            x[k] = GRID * (k % (SIDE / GRID)) + GRID / 2 + 10.0 * rx_random_uniform(56, tile, (uint64_t)k);
            y[k] = GRID * (k / (SIDE / GRID)) + GRID / 2 + 10.0 * rx_random_uniform(57, tile, (uint64_t)k);
            mag[k] = low + (high - low) * u;
            add_star(s.pixels, x[k], y[k], pow(10.0, 0.4 * (25.0 - mag[k])));
        }
        rx_field *field = bench_field(b, s.pixels, SIDE, SIDE, 0.0);
        assert_int_equal(rx_field_extract(&b->options->pipeline, kind, field, NULL, NULL, &result, NULL),
                         RX_OK);
        size_t n = (size_t)result.sources->n;
        double *xy = calloc(2 * n + 1, sizeof *xy);
        assert_non_null(xy);
        for (size_t i = 0; i < n; i++) {
            xy[i] = result.sources->list[i].x;
            xy[n + i] = result.sources->list[i].y;
        }
        rx_qa_list truth = {.n = CELLS, .x = x, .y = y, .mag = mag};
        rx_qa_list list = {.n = (long)n, .x = xy, .y = xy + n};
        count_found(&truth, &list, low, (high - low) / BINS, dst);
        free(xy);
        rx_result_free(&result);
        rx_field_free(field);
        scene_free(&s);
    }
}

static void check_completeness(const char *kind_name)
{
    static const setting settings[] = {{"SELF_CHECK", "Y"},
                                       {"SELF_CHECK_COUNT", "800"},
                                       {"SELF_CHECK_DENSITY", "500"},
                                       {"RL_NITER", "30"},
                                       {NULL, NULL}};
    const rx_restorer *kind = rx_restorer_find(kind_name);
    rx_selfcheck_plan *plan = NULL;
    rx_selfcheck check;
    rx_result before;
    bench b;
    scene s;
    bench_open(&b, settings);
    scene_make(&s, SIDE, SIDE, 20, 7);
    rx_field *field = bench_field(&b, s.pixels, SIDE, SIDE, 0.0);
    assert_int_equal(rx_field_extract(&b.options->pipeline, kind, field, NULL, NULL, &before, NULL), RX_OK);
    assert_int_equal(
        rx_selfcheck_plan_new(&b.options->pipeline, &b.options->check, field, before.sources, &plan, NULL),
        RX_OK);
    /* 5 sigma sqrt(N), N = 1 / sum P^2 = 38.193 pixels of the pixel-integrated Moffat (numpy: 9-point
     * Gauss-Legendre in every pixel); sigma 5 */
    assert_near(plan->limit, 25.0 - 2.5 * log10(5.0 * 5.0 * sqrt(38.193)), 0.03);
    /* where a matched filter has twice the noise of independent pixels, the limit is that much brighter */
    rx_selfcheck_plan *noisy = NULL;
    field->noise_factor = 2.0;
    assert_int_equal(
        rx_selfcheck_plan_new(&b.options->pipeline, &b.options->check, field, before.sources, &noisy, NULL),
        RX_OK);
    field->noise_factor = 1.0;
    assert_near(plan->limit - noisy->limit, 2.5 * log10(2.0), 1e-6);
    rx_selfcheck_plan_free(noisy);
    assert_int_equal(rx_selfcheck_run(plan, kind, &before, NULL, &check, NULL), RX_OK);
    assert_int_equal(check.injected, 800);
    tally truth = {{0}, {0}}, injected = {{0}, {0}};
    double low = plan->limit - 1.0, high = plan->limit + 1.0;
    true_tally(&b, kind, low, high, &truth);
    count_found(&check.truth, &check.found_list, low, (high - low) / BINS, &injected);
    for (int k = 0; k < BINS; k++) {
        double n = (double)truth.all[k], m = (double)injected.all[k];
        double p = (double)truth.found[k] / n, q = (double)injected.found[k] / m;
        double both = (double)(truth.found[k] + injected.found[k] + 1) / (n + m + 2.0);
        double error = sqrt(both * (1.0 - both) * (1.0 / n + 1.0 / m));
        assert_true(n > 100);
        assert_true(m > 60);
        if (!(fabs(p - q) < 4.0 * error))
            fail_msg("%s, bin %d: %.3f +- %.3f of the truth, %.3f of the injected", kind_name, k, p, error,
                     q);
    }
    assert_true(truth.found[0] > truth.all[0] / 2);
    assert_true(truth.found[BINS - 1] < truth.all[BINS - 1] / 2);
    assert_true(check.injected_share.value > 0.9);
    assert_true(check.injected_share.high <= 1.0);
    assert_true(check.mag90.value < check.mag50.value);
    assert_true(check.aperture_bias.n > 50);
    /* RL of 30 iterations has not gathered every faint star to the last percent */
    double tolerance = strcmp(kind_name, "NONE") == 0 ? 0.002 : 0.02;
    if (!(fabs(check.aperture_bias.value) < tolerance))
        fail_msg("%s: flux scale wrong by %g mag", kind_name, check.aperture_bias.value);
    rx_selfcheck_free(&check);
    rx_selfcheck_plan_free(plan);
    rx_result_free(&before);
    rx_field_free(field);
    scene_free(&s);
    bench_close(&b);
}

static void test_completeness_is_true_none(void **state)
{
    check_completeness("NONE");
}

static void test_completeness_is_true_rl(void **state)
{
    check_completeness("RL");
}

/* --- galaxies as the tile has them --- */

/* Objects of `share` galaxies, `scale` times as large as those of the law, on noise. */
static void draw_galaxies(double share, double scale, float *pixels)
{
    const rx_population population = {.mag_low = 16.0, .mag_high = 18.5};
    rx_scene_params par = {.width = SIDE,
                           .height = SIDE,
                           .zeropoint = 25.0,
                           .pixel_scale = 0.5,
                           .stars = population,
                           .galaxies = population,
                           .galaxy_kind = RX_GALAXY_MIXED,
                           .galaxy_scale = scale,
                           .least_distance = 25.0,
                           .seed = 3};
    rx_scene *objects = NULL;
    rx_optics *optics = NULL;
    par.galaxies.count = 120.0 * share;
    par.stars.count = 120.0 - par.galaxies.count;
    assert_int_equal(rx_optics_moffat(&(rx_moffat_profile){.fwhm = 3.5, .beta = 4.765, .ratio = 1.0}, SIDE,
                                      SIDE, &optics, NULL),
                     RX_OK);
    assert_int_equal(rx_scene_make(&par, NULL, &objects, NULL), RX_OK);
    assert_int_equal(rx_render(objects, 1, &(const rx_optics *){optics}, &(float *const){pixels}, 2, NULL),
                     RX_OK);
    for (uint64_t i = 0; i < SIDE * SIDE; i++)
        pixels[i] += 100.0f + (float)rx_random_normal(5, 1, i);
    rx_scene_free(objects);
    rx_optics_free(optics);
}

/* What a plan makes of them. */
static void plan_of(double share, double scale, const char *asked, double *galaxies, double *found,
                    long *resolved)
{
    const setting settings[] = {
        {"SELF_CHECK", "Y"}, {"SELF_CHECK_GALAXIES", asked}, {"PIXEL_SCALE", "0.5"}, {NULL, NULL}};
    float *pixels = calloc(SIDE * SIDE, sizeof *pixels);
    rx_selfcheck_plan *plan = NULL;
    rx_result before;
    bench b;
    assert_non_null(pixels);
    draw_galaxies(share, scale, pixels);
    bench_open(&b, settings);
    rx_field *field = bench_field(&b, pixels, SIDE, SIDE, 0.0);
    rx_pipeline_params own = b.options->pipeline;
    own.measure.skip = RX_SKIP_APER | RX_SKIP_PETRO | RX_SKIP_WIN;
    own.measure.nradii = 1;
    own.measure.flux_fraction[0] = 0.5;
    assert_int_equal(rx_field_extract(&own, rx_restorer_find("NONE"), field, NULL, NULL, &before, NULL),
                     RX_OK);
    assert_int_equal(
        rx_selfcheck_plan_new(&b.options->pipeline, &b.options->check, field, before.sources, &plan, NULL),
        RX_OK);
    *galaxies = plan->galaxies;
    *found = plan->galaxy_scale;
    *resolved = plan->resolved;
    rx_selfcheck_plan_free(plan);
    rx_result_free(&before);
    rx_field_free(field);
    bench_close(&b);
    free(pixels);
}

static void test_galaxies_are_those_of_the_tile(void **state)
{
    double galaxies, scale;
    long resolved;
    for (int k = 0; k < 3; k++) {
        const double truth = 1.0 + 0.25 * k;
        plan_of(0.7, 1.5 * truth, "-1", &galaxies, &scale, &resolved);
        assert_near(scale, 1.5 * truth, 0.25 * 1.5 * truth);
        assert_near(galaxies, 0.7, 0.16);
        assert_in_range(resolved, 25, 84);
    }
    plan_of(0.7, 2.0, "0.25", &galaxies, &scale, &resolved); /* a share that is asked for stays */
    assert_near(galaxies, 0.25, 0);
    assert_near(scale, 2.0, 0.5);
    plan_of(0.0, 1.0, "-1", &galaxies, &scale, &resolved); /* stars alone */
    assert_int_equal(resolved, 0);
    assert_near(galaxies, 0.0, 0);
    assert_near(scale, 1.0, 0);
    plan_of(0.0, 1.0, "1", &galaxies, &scale, &resolved);
    assert_near(galaxies, 1.0, 0);
    assert_near(scale, 1.0, 0);
}

/* --- noise, empty tiles, unknown PSF --- */

static void noise_plane(float *pixels, double sigma, uint64_t seed)
{
    for (uint64_t i = 0; i < SIDE * SIDE; i++)
        pixels[i] = (float)(1000.0 + sigma * rx_random_normal(seed, 0, i));
}

/* Checks of a tile of these pixels with restorer `kind_name`; log text and header facts into `said` when not NULL. */
static void run_checks(const setting *settings, const float *pixels, const char *kind_name,
                       rx_check_results *dst, char *said, size_t size)
{
    const rx_restorer *kind = rx_restorer_find(kind_name);
    FILE *stream = tmpfile();
    rx_log log;
    rx_checks *checks = NULL;
    rx_result before;
    bench b;
    assert_non_null(stream);
    rx_log_init(&log, "test", stream, RX_NORMAL);
    bench_open(&b, settings);
    rx_field *field = bench_field(&b, pixels, SIDE, SIDE, 1.0);
    assert_int_equal(rx_checks_new(&b.options->pipeline, &b.options->check, field, &log, &checks, NULL),
                     RX_OK);
    assert_int_equal(rx_field_extract(&b.options->pipeline, kind, field, NULL, NULL, &before, NULL), RX_OK);
    *dst = (rx_check_results){0};
    assert_int_equal(rx_checks_run(checks, &b.options->pipeline, kind, &before, NULL, dst, NULL), RX_OK);
    rx_record facts = {0};
    rx_checks_facts(checks, &b.options->pipeline, dst, &facts);
    for (int i = 0; i < facts.n; i++)
        fprintf(stream, "%s = %s\n", facts.pairs[i][0], facts.pairs[i][1]);
    rx_record_free(&facts);
    rewind(stream);
    if (said != NULL)
        said[fread(said, 1, size - 1, stream)] = '\0';
    fclose(stream);
    rx_result_free(&before);
    rx_checks_free(checks);
    rx_field_free(field);
    bench_close(&b);
}

/* Blends of a crowd look like galaxies: none are injected there, unless they are asked for. */
static void test_crowd_has_no_galaxies(void **state)
{
    static const struct {
        const char *crowding, *asked;
        double low, high;
    } cases[] = {{"N", "-1", 0.5, 0.9}, {"Y", "-1", 0.0, 0.0}, {"Y", "0.3", 0.3, 0.3}};
    float *pixels = calloc(SIDE * SIDE, sizeof *pixels);
    assert_non_null(pixels);
    draw_galaxies(0.7, 1.0, pixels);
    for (int k = 0; k < 3; k++) {
        const setting settings[] = {{"SELF_CHECK", "Y"},
                                    {"SELF_CHECK_COUNT", "20"},
                                    {"SELF_CHECK_GALAXIES", cases[k].asked},
                                    {"PIXEL_SCALE", "0.5"},
                                    {"CHECKIMAGE_TYPE", "TEMPLATE_MODEL"},
                                    {"CROWDING", cases[k].crowding},
                                    {NULL, NULL}};
        rx_check_results results;
        char said[20000];
        run_checks(settings, pixels, "NONE", &results, said, sizeof said);
        const char *share = strstr(said, "RXSCGAL = ");
        assert_non_null(share);
        assert_near(atof(share + 10), 0.5 * (cases[k].low + cases[k].high),
                    0.5 * (cases[k].high - cases[k].low) + 1e-6);
        rx_check_results_free(&results);
    }
    free(pixels);
}

/* On noise alone everything found is what was injected, and blank tiles tell the rate of false detections:
 * that of fresh noise tiles within 4 sigmas. A low threshold makes many. */
static void test_pure_noise(void **state)
{
    static const setting settings[] = {{"SELF_CHECK", "Y"},           {"SELF_CHECK_COUNT", "200"},
                                       {"SELF_CHECK_DENSITY", "300"}, {"BLANK_CHECK", "6"},
                                       {"DETECT_THRESH", "1.0"},      {"ANALYSIS_THRESH", "1.0"},
                                       {"DETECT_MINAREA", "4"},       {NULL, NULL}};
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels);
    rx_check_results results;
    long fresh = 0;
    bench b;
    assert_non_null(pixels);
    noise_plane(pixels, 5.0, 1);
    run_checks(settings, pixels, "NONE", &results, NULL, 0);
    assert_int_equal(results.blank.realisations, 6);
    assert_near(results.blank.mpixels, 6.0 * SIDE * SIDE / 1e6, 1e-9);
    bench_open(&b, settings);
    for (uint64_t seed = 10; seed < 16; seed++) {
        rx_result result;
        noise_plane(pixels, 5.0, seed);
        rx_field *field = bench_field(&b, pixels, SIDE, SIDE, 1.0);
        assert_int_equal(rx_field_extract(&b.options->pipeline, rx_restorer_find("NONE"), field, NULL, NULL,
                                          &result, NULL),
                         RX_OK);
        fresh += result.sources->n;
        rx_result_free(&result);
        rx_field_free(field);
    }
    assert_true(fresh > 100);
    double difference = (double)(results.blank.false_detections - fresh);
    if (!(fabs(difference) < 4.0 * sqrt((double)(results.blank.false_detections + fresh))))
        fail_msg("%ld false detections on the tile's noise, %ld on fresh noise",
                 results.blank.false_detections, fresh);
    assert_true(results.blank.rate.low < results.blank.rate.value);
    assert_true(results.blank.rate.value < results.blank.upper);
    assert_true(results.blank.upper < results.blank.rate.high);
    assert_int_equal(results.self.injected, 200);
    assert_true(results.self.injected_share.value > 0.9);
    /* what injection made new is pure; of the tile's own detections none is a source */
    assert_true(results.blank.real.n > 10);
    assert_true(results.blank.real.low < 0.15);
    assert_true(results.blank.real.value < 0.3);
    rx_check_results_free(&results);
    bench_close(&b);
    free(pixels);
}

/* 1000 x 1000 pixels, a tenth masked, a fifth of sources: 100 false ones per Mpixel are 70 of 280. */
static void test_share_that_noise_did_not_make(void **state)
{
    enum { WIDE = 1000 };
    bench b;
    uint8_t *mask = calloc(WIDE * WIDE, 1);
    int32_t *segments = calloc(WIDE * WIDE, sizeof *segments);
    assert_non_null(mask);
    assert_non_null(segments);
    memset(mask, RX_MASK_BAD, WIDE * WIDE / 10);
    for (int i = WIDE * WIDE / 10; i < 3 * WIDE * WIDE / 10; i++)
        segments[i] = 1 + i % 280;
    rx_restored restored = {.width = WIDE, .height = WIDE, .mask = mask};
    rx_sources sources = {.n = 280, .segments = segments};
    rx_result result = {.restored = &restored, .sources = &sources};
    rx_blankcheck check = {.realisations = 1, .rate = {.value = 100, .low = 80, .high = 120, .n = 100}};
    bench_open(&b, NULL);
    rx_blankcheck_finish(&b.options->pipeline, &result, &check);
    assert_near(check.sky, 0.7, 1e-12);
    assert_int_equal(check.real.n, 280);
    assert_near(check.real.value, 0.75, 1e-12);
    assert_near(check.real.low, 0.7, 1e-12);
    assert_near(check.real.high, 0.8, 1e-12);
    check.rate.value = check.rate.high = 1e4; /* more than there are */
    rx_blankcheck_finish(&b.options->pipeline, &result, &check);
    assert_near(check.real.value, 0, 0);
    assert_near(check.real.low, 0, 0);
    sources.n = 0; /* of nothing there is no share */
    rx_blankcheck_finish(&b.options->pipeline, &result, &check);
    assert_int_equal(check.real.n, 0);
    assert_true(isnan(check.real.value));
    bench_close(&b);
    free(mask);
    free(segments);
}

/* No false detection in A Mpixels: below -ln(0.05) / A at 95 %. */
static void test_upper_limit_of_nothing(void **state)
{
    static const setting settings[] = {{"BLANK_CHECK", "2"}, {"DETECT_THRESH", "8"}, {NULL, NULL}};
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels);
    rx_check_results results;
    assert_non_null(pixels);
    noise_plane(pixels, 5.0, 2);
    run_checks(settings, pixels, "RL", &results, NULL, 0);
    assert_int_equal(results.blank.false_detections, 0);
    assert_near(results.blank.upper, -log(0.05) / results.blank.mpixels, 1e-6);
    assert_int_equal(results.self.injected, 0);
    rx_check_results_free(&results);
    free(pixels);
}

/* A galaxy much larger than a background mesh bends the map of the sky; blank tiles hold none of it. */
static void test_blank_below_a_large_galaxy(void **state)
{
    static const setting settings[] = {{NULL, NULL}};
    const double sigma = 5.0, peak = 100.0, width = 55.0, middle = 0.5 * SIDE;
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels), *rms = malloc(SIDE * SIDE * sizeof *rms);
    int32_t *segments = calloc(SIDE * SIDE, sizeof *segments);
    rx_field *field = NULL, *blank = NULL;
    rx_noise_correlation noise;
    rx_result result;
    bench b;
    assert_true(pixels != NULL);
    assert_true(rms != NULL);
    assert_true(segments != NULL);
    noise_plane(pixels, sigma, 3);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const size_t i = (size_t)y * SIDE + (size_t)x;
            const double r = hypot(x - middle, y - middle) / width;
            rms[i] = (float)sigma;
            pixels[i] += (float)(peak * exp(-0.5 * r * r));
            segments[i] = r < 3.0;
        }
    bench_open(&b, settings);
    rx_tile *tile = bench_tile(pixels, SIDE, SIDE, 0.0);
    tile->weight = rms;
    tile->weight_type = RX_WEIGHT_MAP_RMS;
    assert_int_equal(rx_field_prepare(&b.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &field, NULL),
                     RX_OK);
    const rx_map level = rx_background_level(field->plain);
    assert_true(rx_map_at(&level, SIDE / 2, SIDE / 2) > field->plain->global_level + 2.0 * sigma);
    assert_int_equal(rx_blankcheck_noise(field, segments, 1, &noise, NULL), RX_OK);
    assert_int_equal(rx_blankcheck_field(&b.options->pipeline,
                                         &(rx_blank_input){.field = field, .noise = &noise}, NULL,
                                         (rx_random_stream){1, 1}, &blank, NULL),
                     RX_OK);
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("NONE"), blank, NULL, NULL, &result, NULL),
        RX_OK);
    assert_int_equal(result.sources->n, 0);
    rx_result_free(&result);
    rx_field_free(blank);
    rx_field_free(field);
    free(segments);
    free(pixels);
    bench_close(&b);
}

/* The guard on noise of which half hangs over from pixel to pixel, that NOISE_CORRELATION calls white: the threshold
 * rises until a window holds no more than it may, and the tile then holds about as many. */
static void test_guard_raises_the_threshold(void **state)
{
    static const setting settings[] = {
        {"NOISE_CORRELATION", "WHITE"}, {"DETECT_THRESH", "1.0"}, {"DETECT_MINAREA", "4"}, {NULL, NULL}};
    const rx_restorer *none = rx_restorer_find("NONE");
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels), *white = malloc(SIDE * SIDE * sizeof *white);
    rx_blankcheck check;
    rx_result before, after;
    bench b;
    assert_non_null(pixels);
    assert_non_null(white);
    noise_plane(white, 5.0, 4);
    for (int i = 0; i < SIDE * SIDE; i++)
        pixels[i] = 0.5f * (white[i] + white[(i + 1) % (SIDE * SIDE)]);
    bench_open(&b, settings);
    const double asked = b.options->pipeline.detect.threshold, area = SIDE * SIDE / 1e6;
    rx_field *field = bench_field(&b, pixels, SIDE, SIDE, 1.0);
    assert_int_equal(rx_field_extract(&b.options->pipeline, none, field, NULL, NULL, &before, NULL), RX_OK);
    /* no limit: counted, and left alone */
    rx_pipeline_params params = b.options->pipeline;
    assert_int_equal(rx_blankcheck_guard(&params, none, field, 0.0, &check, NULL), RX_OK);
    assert_true(params.detect.threshold == asked);
    assert_true(check.raised == 1.0);
    assert_int_equal(check.realisations, 1);
    assert_int_equal(check.quick, 1);
    assert_int_equal(check.correlated, 1);
    assert_true(check.rate.value > 100.0);
    assert_near(check.asked, check.rate.value, 0);
    assert_near(check.rate.value * area, before.sources->n, 5.0 * sqrt(2.0 * before.sources->n));
    /* one that a look leaves open is decided by a Mpixel; one that holds changes nothing */
    const double first = check.rate.value;
    assert_int_equal(rx_blankcheck_guard(&params, none, field, 1.02 * first, &check, NULL), RX_OK);
    assert_in_range(check.realisations, 2, 7);
    params.detect.threshold = asked;
    assert_int_equal(rx_blankcheck_guard(&params, none, field, check.asked, &check, NULL), RX_OK);
    assert_int_equal(check.realisations, 7);
    assert_near(check.mpixels, 7 * area, 1e-9);
    const double found = check.asked;
    params.detect.threshold = asked;
    assert_int_equal(rx_blankcheck_guard(&params, none, field, 1.1 * found, &check, NULL), RX_OK);
    assert_true(params.detect.threshold == asked);
    assert_true(check.raised == 1.0);
    /* one that is missed by a hundredth, within the error of the count, is missed */
    assert_int_equal(rx_blankcheck_guard(&params, none, field, 0.99 * found, &check, NULL), RX_OK);
    assert_true(check.raised > 1.0);
    assert_true(check.rate.value <= 0.99 * found);
    params.detect.threshold = asked;
    assert_int_equal(rx_blankcheck_guard(&params, none, field, 20.0, &check, NULL), RX_OK);
    assert_true(check.raised > 1.0);
    assert_near(params.detect.threshold, asked * check.raised, 1e-12);
    assert_near(check.asked, first, 0); /* far above: no more than one look */
    assert_int_equal(check.realisations, 1);
    assert_true(check.rate.value <= 20.0);
    assert_int_equal(rx_field_extract(&params, none, field, NULL, NULL, &after, NULL), RX_OK);
    assert_true(after.sources->n < 12);
    assert_true(before.sources->n > 5 * after.sources->n);
    rx_result_free(&before);
    rx_result_free(&after);
    rx_field_free(field);
    bench_close(&b);
    free(white);
    free(pixels);
}

/* The network alone is guarded, and not where BLANK_CHECK is 0. */
static void test_whom_the_guard_is_for(void **state)
{
    static const setting settings[] = {{NULL, NULL}};
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels);
    rx_blankcheck check;
    bench b;
    assert_non_null(pixels);
    noise_plane(pixels, 5.0, 5);
    bench_open(&b, settings);
    rx_field *field = bench_field(&b, pixels, SIDE, SIDE, 1.0);
    rx_pipeline_params params = b.options->pipeline;
    rx_check_params par = b.options->check;
    assert_int_equal(par.blank_check, -1);
    assert_near(par.false_max, 10.0, 0);
    assert_int_equal(rx_checks_guard(&par, rx_restorer_find("RL"), field, &params, NULL, &check, NULL),
                     RX_OK);
    assert_int_equal(check.realisations, 0);
    par.blank_check = 0;
    assert_int_equal(rx_checks_guard(&par, rx_restorer_find("NET"), field, &params, NULL, &check, NULL),
                     RX_OK);
    assert_int_equal(check.realisations, 0);
    assert_near(check.raised, 1.0, 0);
    rx_field_free(field);
    bench_close(&b);
    free(pixels);
}

/* A part of a tile is that part, and the PSF of a blank one that of the place. */
static void test_part_of_a_tile(void **state)
{
    static const setting settings[] = {{NULL, NULL}};
    const rx_replica_part part = {.x = 30, .y = 50, .width = 120, .height = 90};
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels);
    rx_tile *copy = NULL;
    rx_field *blank = NULL;
    bench b;
    assert_non_null(pixels);
    noise_plane(pixels, 5.0, 6);
    bench_open(&b, settings);
    rx_field *field = bench_field(&b, pixels, SIDE, SIDE, 1.0);
    field->tile->mask[52 * SIDE + 33] = RX_MASK_BAD;
    assert_int_equal(rx_replica_new(field->tile, &part, &copy, NULL), RX_OK);
    assert_int_equal(copy->width, 120);
    assert_int_equal(copy->height, 90);
    for (int y = 0; y < 90; y++)
        assert_memory_equal(copy->pixels + y * 120, field->tile->pixels + (50 + y) * SIDE + 30,
                            120 * sizeof(float));
    assert_int_equal(copy->mask[2 * 120 + 3], RX_MASK_BAD);
    assert_int_equal(copy->mask[2 * 120 + 4], 0);
    rx_tile_free(copy);
    const double x0 = field->psf->x0, y0 = field->psf->y0;
    assert_int_equal(rx_blankcheck_field(&b.options->pipeline,
                                         &(rx_blank_input){.field = field, .noise = &field->noise}, &part,
                                         (rx_random_stream){1, 1}, &blank, NULL),
                     RX_OK);
    assert_int_equal(blank->image.width, 120);
    assert_near(blank->psf->x0, x0 - 30.0, 0);
    assert_near(blank->psf->y0, y0 - 50.0, 0);
    rx_field_free(blank);
    rx_field_free(field);
    bench_close(&b);
    free(pixels);
}

/* A slope has no noise to speak of, a constant tile no data; the checks come to an end. */
static void test_empty_tile(void **state)
{
    static const setting settings[] = {
        {"SELF_CHECK", "Y"}, {"SELF_CHECK_COUNT", "40"}, {"BLANK_CHECK", "1"}, {NULL, NULL}};
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels);
    rx_check_results results;
    assert_non_null(pixels);
    for (int slope = 0; slope < 2; slope++) {
        for (int i = 0; i < SIDE * SIDE; i++)
            pixels[i] = 1000.0f + 0.001f * (float)(slope * (i % SIDE + i / SIDE));
        run_checks(settings, pixels, "NONE", &results, NULL, 0);
        assert_int_equal(results.self.injected, slope ? 40 : 0);
        assert_int_equal(results.self.found > 0, slope);
        rx_check_results_free(&results);
    }
    free(pixels);
}

static void test_unknown_psf_is_said(void **state)
{
    static const setting settings[] = {
        {"SELF_CHECK", "Y"}, {"PSF_TYPE", "AUTO"}, {"PSF_FWHM", "0"}, {NULL, NULL}};
    float *pixels = malloc(SIDE * SIDE * sizeof *pixels);
    rx_check_results results;
    char said[2000];
    assert_non_null(pixels);
    noise_plane(pixels, 5.0, 3);
    run_checks(settings, pixels, "RL", &results, said, sizeof said);
    assert_non_null(strstr(said, "SELF_CHECK is left out"));
    assert_non_null(strstr(said, "PSF_FWHM"));
    assert_non_null(strstr(said, "\nRXSCWHY = the PSF is not known\n"));
    assert_int_equal(results.self.injected, 0);
    rx_check_results_free(&results);
    free(pixels);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_completeness_is_true_none),
        cmocka_unit_test(test_completeness_is_true_rl),
        cmocka_unit_test(test_galaxies_are_those_of_the_tile),
        cmocka_unit_test(test_crowd_has_no_galaxies),
        cmocka_unit_test(test_pure_noise),
        cmocka_unit_test(test_share_that_noise_did_not_make),
        cmocka_unit_test(test_upper_limit_of_nothing),
        cmocka_unit_test(test_blank_below_a_large_galaxy),
        cmocka_unit_test(test_guard_raises_the_threshold),
        cmocka_unit_test(test_whom_the_guard_is_for),
        cmocka_unit_test(test_part_of_a_tile),
        cmocka_unit_test(test_empty_tile),
        cmocka_unit_test(test_unknown_psf_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
