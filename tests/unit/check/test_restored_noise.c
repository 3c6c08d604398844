/* CHECKIMAGE_TYPE RESTORED_RMS against the scatter of many exposures of one sky. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "../pipeline/bench.h"
#include "base/random.h"
#include "check/restored_noise.h"

enum { SIDE = 160, N = SIDE * SIDE, STEP = 20, STARS = 49, EXPOSURES = 24 };
static const double SKY = 400.0, GAIN = 1.0, FWHM = 3.5;

/* Moffat stars on a grid, of 10 to 10,000 photons. */
static void draw_sky(float *light)
{
    const double beta = 4.765, a2 = FWHM * FWHM / (4.0 * (pow(2.0, 1.0 / beta) - 1.0));
    memset(light, 0, N * sizeof *light);
    for (int k = 0; k < STARS; k++) {
        const double x = STEP * (k % 7 + 1) + 0.3 * k / STARS, y = STEP * (double)(k / 7 + 1) + 0.2,
                     flux = pow(10.0, 1.0 + 3.0 * k / (STARS - 1));
        for (int i = 0; i < N; i++) {
            const double r2 = pow(i % SIDE - x, 2) + pow((double)(i / SIDE) - y, 2);
            light[i] += (float)(flux * (beta - 1.0) / (M_PI * a2) * pow(1.0 + r2 / a2, -beta));
        }
    }
}

static void expose(const float *light, uint64_t number, float *pixels)
{
    for (int i = 0; i < N; i++) {
        const double mean = SKY + (double)light[i];
        pixels[i] = (float)(mean + sqrt(mean / GAIN) * rx_random_normal(7, number, (uint64_t)i));
    }
}

/* Image and rms that `kind` makes of an exposure; rms may be NULL. */
static void restore(const bench *b, const char *kind, const float *pixels, float *image, float *rms)
{
    rx_result result;
    rx_field *field = bench_field(b, pixels, SIDE, SIDE, GAIN);
    assert_int_equal(
        rx_field_extract(&b->options->pipeline, rx_restorer_find(kind), field, NULL, NULL, &result, NULL),
        RX_OK);
    memcpy(image, result.restored->pixels, N * sizeof *image);
    if (rms != NULL)
        assert_int_equal(rx_restored_noise(&b->options->pipeline, &result, rms, NULL), RX_OK);
    rx_result_free(&result);
    rx_field_free(field);
}

static void *room(size_t size)
{
    void *pixels = calloc(N, size);
    assert_non_null(pixels);
    return pixels;
}

/* In sky, wings and cores: mean variance stated and found, by the light that is there. */
static void it_is_the_scatter_of_exposures(void **state)
{
    (void)state;
    static const double edges[] = {-1.0, 0.5, 10.0, 1e9};
    static const setting settings[] = {{"CHECKIMAGE_TYPE", "RESTORED_RMS"},
                                       {"CHECKIMAGE_NAME", "rms.fits"},
                                       {"NTHREADS", "1"},
                                       {NULL, NULL}};
    float *light = room(sizeof *light), *pixels = room(sizeof *pixels), *image = room(sizeof *image),
          *rms = room(sizeof *rms), *again = room(sizeof *again);
    double *sum = room(sizeof *sum), *squares = room(sizeof *squares);
    draw_sky(light);
    static const char *const kinds[] = {"RL", "NONE"};
    for (int kind = 0; kind < 2; kind++) {
        bench b;
        bench_open(&b, settings);
        for (int k = 0; k < EXPOSURES; k++) {
            expose(light, (uint64_t)k, pixels);
            restore(&b, kinds[kind], pixels, image, k == 0 ? rms : NULL);
            for (int i = 0; i < N; i++) {
                sum[i] = (k > 0 ? sum[i] : 0.0) + (double)image[i];
                squares[i] = (k > 0 ? squares[i] : 0.0) + (double)image[i] * (double)image[i];
            }
        }
        for (int part = 0; part < 3; part++) {
            double stated = 0.0, found = 0.0;
            int n = 0;
            for (int i = 0; i < N; i++) {
                const double z = (double)light[i] / sqrt(SKY / GAIN);
                if (z < edges[part] || z >= edges[part + 1])
                    continue;
                stated += (double)rms[i] * (double)rms[i];
                found += (squares[i] - sum[i] * sum[i] / EXPOSURES) / (EXPOSURES - 1);
                n++;
            }
            print_message("%s, light above %g: rms stated %.2f, found %.2f\n", kinds[kind], edges[part],
                          sqrt(stated / n), sqrt(found / n));
            assert_near(sqrt(stated / found), 1.0, part < 2 ? 0.05 : 0.1);
        }
        expose(light, 0, pixels);
        restore(&b, kinds[kind], pixels, image, again);
        assert_memory_equal(again, rms, N * sizeof *rms);
        bench_close(&b);
    }
    free(light);
    free(pixels);
    free(image);
    free(rms);
    free(again);
    free(sum);
    free(squares);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(it_is_the_scatter_of_exposures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
