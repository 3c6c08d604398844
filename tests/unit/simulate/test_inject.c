/* simulate/inject: flux, photon noise and saturation of added light; where objects may lie. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "simulate/inject.h"
#include "simulate/render.h"

enum { W = 96, H = 80, N = W * H };

/* Two stars and a galaxy, well inside. */
static rx_scene *make_scene(double flux)
{
    rx_scene *scene = NULL;
    assert_int_equal(rx_scene_new(W, H, 3, &scene, NULL), RX_OK);
    scene->objects[0] = (rx_object){.type = RX_OBJECT_STAR, .x = 30.3, .y = 35.8, .flux = flux};
    scene->objects[1] = (rx_object){.type = RX_OBJECT_STAR, .x = 62.9, .y = 44.1, .flux = 0.5 * flux};
    scene->objects[2] = (rx_object){.type = RX_OBJECT_GALAXY,
                                    .x = 48.0,
                                    .y = 25.0,
                                    .flux = 0.7 * flux,
                                    .radius = 2.0,
                                    .ratio = 0.6,
                                    .angle = 0.4,
                                    .disk_radius = 2.0};
    return scene;
}

static rx_optics *make_optics(void)
{
    rx_optics *optics = NULL;
    assert_int_equal(
        rx_optics_moffat(&(rx_moffat_profile){.fwhm = 3.0, .beta = 4.765, .ratio = 1.0}, W, H, &optics, NULL),
        RX_OK);
    return optics;
}

static void inject(const rx_scene *scene, const rx_optics *optics, double gain, double saturation,
                   uint64_t stream, int nthreads, float *pixels)
{
    rx_error err = RX_ERROR_NONE;
    if (rx_inject(scene, optics, &(rx_inject_params){gain, saturation, NULL, 5, stream}, nthreads, pixels,
                  &err) != RX_OK)
        fail_msg("%s", err.text);
}

static double total(const float *pixels)
{
    double sum = 0.0;
    for (int i = 0; i < N; i++)
        sum += (double)pixels[i];
    return sum;
}

/* Without gain the pixels grow by just the rendered scene. */
static void adds_the_scene(void **state)
{
    rx_scene *scene = make_scene(1e5);
    rx_optics *optics = make_optics();
    const rx_optics *through = optics;
    float *pixels = RX_NEW(float, N), *light = RX_NEW(float, N);
    for (int i = 0; i < N; i++)
        pixels[i] = (float)rx_random_normal(3, 0, (uint64_t)i);
    pixels[35 * W + 30] = NAN;
    inject(scene, optics, 0.0, HUGE_VAL, 0, 2, pixels);
    assert_int_equal(rx_render(scene, 1, &through, &light, 1, NULL), RX_OK);
    for (int i = 0; i < N; i++) {
        if (i == 35 * W + 30)
            assert_true(isnan(pixels[i]));
        else
            assert_true(pixels[i] == (float)rx_random_normal(3, 0, (uint64_t)i) + light[i]);
    }
    /* what the light sums to: all flux but what the PSF's stamp and the borders leave out */
    assert_near(total(light) / 2.2e5, 1.0, 5e-3);
    free(pixels);
    free(light);
    rx_optics_free(optics);
    rx_scene_free(scene);
}

/* Over many realisations: mean = the light, variance = light / gain, pixels independent. */
static void photon_noise(void **state)
{
    enum { REALISATIONS = 400 };
    const double gain = 2.5;
    rx_scene *scene = make_scene(2000.0);
    rx_optics *optics = make_optics();
    const rx_optics *through = optics;
    float *light = RX_NEW(float, N), *pixels = RX_NEW(float, N);
    double chi2 = 0.0, deviation = 0.0, neighbours = 0.0;
    long n = 0;
    assert_int_equal(rx_render(scene, 1, &through, &light, 1, NULL), RX_OK);
    for (int k = 0; k < REALISATIONS; k++) {
        memset(pixels, 0, N * sizeof(float));
        inject(scene, optics, gain, HUGE_VAL, (uint64_t)k, 1, pixels);
        for (int i = 0; i < N - 1; i++) {
            if (!(light[i] > 5.0f) || !(light[i + 1] > 5.0f))
                continue;
            double d = (double)(pixels[i] - light[i]) / sqrt((double)light[i] / gain);
            double next = (double)(pixels[i + 1] - light[i + 1]) / sqrt((double)light[i + 1] / gain);
            chi2 += d * d;
            deviation += d;
            neighbours += d * next;
            n++;
            /* whole electrons */
            assert_near(pixels[i] * gain, round((double)pixels[i] * gain), 1e-3);
        }
    }
    assert_true(n > 100 * REALISATIONS);
    assert_near(deviation / (double)n, 0.0, 4.0 / sqrt((double)n));
    assert_near(chi2 / (double)n, 1.0, 5.0 * sqrt(2.0 / (double)n));
    assert_near(neighbours / (double)n, 0.0, 4.0 / sqrt((double)n));
    free(light);
    free(pixels);
    rx_optics_free(optics);
    rx_scene_free(scene);
}

/* On a tile shifted by half a pixel, bilinearly: the sum over a source scatters by its electrons, as ever; a pixel's
 * variance is the share of it that the kernel leaves, and neighbours go together as the tile's noise does. */
static void photon_noise_of_a_resampled_tile(void **state)
{
    enum { REALISATIONS = 400 };
    static const float kernel[4] = {0.25f, 0.25f, 0.25f, 0.25f};
    const rx_noise_correlation noise = rx_noise_of_kernel(kernel, 2, 2);
    const double gain = 2.5;
    rx_scene *scene = make_scene(2000.0);
    rx_optics *optics = make_optics();
    const rx_optics *through = optics;
    float *light = RX_NEW(float, N), *pixels = RX_NEW(float, N);
    double sums = 0.0, squares = 0.0, across = 0.0, up = 0.0, photons = 0.0;
    assert_int_equal(rx_render(scene, 1, &through, &light, 1, NULL), RX_OK);
    for (int i = 0; i < N; i++)
        photons += fmax((double)light[i], 0.0) / gain;
    for (int k = 0; k < REALISATIONS; k++) {
        const rx_inject_params par = {gain, HUGE_VAL, &noise, 5, (uint64_t)k};
        memset(pixels, 0, N * sizeof(float));
        assert_int_equal(rx_inject(scene, optics, &par, 1, pixels, NULL), RX_OK);
        for (int i = 0; i < N; i++)
            pixels[i] -= light[i];
        sums += total(pixels) * total(pixels);
        for (int i = 0; i < N - W; i++) {
            squares += (double)pixels[i] * (double)pixels[i];
            across += (double)pixels[i] * (double)pixels[i + 1];
            up += (double)pixels[i] * (double)pixels[i + W];
        }
    }
    assert_near(sums / REALISATIONS / photons, 1.0, 4.0 * sqrt(2.0 / REALISATIONS));
    assert_near(squares / REALISATIONS / photons, 0.25, 0.01);
    assert_near(across / squares, 0.5, 0.025);
    assert_near(up / squares, 0.5, 0.008);
    free(light);
    free(pixels);
    rx_optics_free(optics);
    rx_scene_free(scene);
}

static void stops_at_saturation(void **state)
{
    rx_scene *scene = make_scene(1e5);
    rx_optics *optics = make_optics();
    float *pixels = RX_NEW(float, N);
    int stopped = 0;
    for (int i = 0; i < N; i++)
        pixels[i] = 100.0f;
    pixels[36 * W + 30] = 3000.0f; /* was above the level before */
    inject(scene, optics, 0.0, 2000.0, 0, 1, pixels);
    assert_true(pixels[36 * W + 30] == 3000.0f);
    for (int i = 0; i < N; i++) {
        assert_true(i == 36 * W + 30 || pixels[i] <= 2000.0f);
        stopped += pixels[i] == 2000.0f;
    }
    assert_true(stopped > 10);
    free(pixels);
    rx_optics_free(optics);
    rx_scene_free(scene);
}

/* --- where --- */

typedef struct tile {
    int32_t segments[N];
    uint8_t mask[N];
    unsigned char allowed[N];
} tile;

/* A few sources and bad pixels, also at corners and borders. */
static tile *make_tile(void)
{
    tile *dst = RX_NEW(tile, 1);
    assert_non_null(dst);
    for (int k = 0; k < 12; k++)
        dst->segments[(int)(rx_random_uniform(8, 0, (uint64_t)k) * N)] = k + 1;
    dst->segments[0] = 99;
    dst->mask[N - 1] = 4;
    for (int x = 40; x < 60; x++)
        dst->mask[50 * W + x] = 1;
    return dst;
}

static void away_by_brute_force(void **state)
{
    static const double distances[] = {0.0, 1.0, 1.5, 3.7, 5.0, 12.25, 1000.0};
    tile *t = make_tile();
    for (size_t k = 0; k < sizeof distances / sizeof *distances; k++) {
        const double d = distances[k];
        assert_int_equal(rx_inject_allowed(W, H, t->segments, t->mask, d, t->allowed, NULL), RX_OK);
        for (int i = 0; i < N; i++) {
            int near = 0;
            for (int j = 0; j < N; j++) {
                double dx = i % W - j % W, dy = i / W - j / W;
                near |= (t->segments[j] != 0 || t->mask[j] != 0) && dx * dx + dy * dy <= d * d;
            }
            assert_int_equal(t->allowed[i], !near);
        }
    }
    free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(adds_the_scene),
        cmocka_unit_test(photon_noise),
        cmocka_unit_test(photon_noise_of_a_resampled_tile),
        cmocka_unit_test(stops_at_saturation),

        cmocka_unit_test(away_by_brute_force),

    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
