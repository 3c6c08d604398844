/* Structure of the sky against skies whose structure is known. */
#include "../near.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/structure.h"

enum { SIDE = 512, HALF = 7, STAMP = 2 * HALF + 1 };
static const double SPREAD = 1.7, NOISE = 2.0; /* rms of a Gaussian T, pixels; sigma of a pixel, ADU */

typedef struct sky {
    float rest[SIDE * SIDE], weight[SIDE * SIDE], values[STAMP * STAMP];
    rx_structure_view view;
    rx_structure found;
    double power; /* sum T^2 */
} sky;

static sky *open_sky(uint64_t seed)
{
    sky *s = calloc(1, sizeof *s);
    assert_non_null(s);
    for (int i = 0; i < SIDE * SIDE; i++) {
        s->rest[i] = (float)(NOISE * rx_random_normal(seed, 0, (uint64_t)i));
        s->weight[i] = (float)(1.0 / (NOISE * NOISE));
    }
    for (int i = 0; i < STAMP * STAMP; i++) {
        const double x = i % STAMP - HALF, y = i / STAMP - HALF;
        s->values[i] =
            (float)(exp(-0.5 * (x * x + y * y) / (SPREAD * SPREAD)) / (2.0 * M_PI * SPREAD * SPREAD));
        s->power += (double)s->values[i] * (double)s->values[i];
    }
    s->view = (rx_structure_view){.width = SIDE,
                                  .height = SIDE,
                                  .nthreads = 1,
                                  .rest = s->rest,
                                  .weight = s->weight,
                                  .values = s->values,
                                  .half = HALF,
                                  .noise = 1.0};
    return s;
}

static void measure(sky *s)
{
    rx_error err = {0};
    rx_structure_clear(&s->found);
    assert_int_equal(rx_structure_measure(&s->view, &s->found, &err), RX_OK);
}

static void close_sky(sky *s)
{
    rx_structure_clear(&s->found);
    free(s);
}

static double mean_of(const rx_sky_mesh *mesh)
{
    double sum = 0.0;
    for (int i = 0; i < mesh->nx * mesh->ny; i++)
        sum += mesh->value[i];
    return sum / (mesh->nx * mesh->ny);
}

static double most_of(const rx_sky_mesh *mesh)
{
    double most = 0.0;
    for (int i = 0; i < mesh->nx * mesh->ny; i++)
        most = fmax(most, fabs(mesh->value[i]));
    return most;
}

/* Noise has none: fluxes keep their errors within 3 %, and levels stay below a tenth of what a flux's error is worth. */
static void noise_is_no_structure(void **state)
{
    (void)state;
    sky *s = open_sky(1);
    measure(s);
    assert_near(mean_of(&s->found.variance), 0.0, 0.06);
    assert_near(mean_of(&s->found.level), 0.0, 0.01 * NOISE);
    close_sky(s);
}

/* A smooth wave is followed: what is left of it is a small part. */
static void waves_are_followed(void **state)
{
    (void)state;
    sky *s = open_sky(2);
    double square = 0.0, before = 0.0;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            s->rest[y * SIDE + x] += (float)(4.0 * sin(x / 16.0) * cos(y / 16.0));
    measure(s);
    for (int y = 32; y < SIDE - 32; y++)
        for (int x = 32; x < SIDE - 32; x++) {
            const double wave = 4.0 * sin(x / 16.0) * cos(y / 16.0),
                         off = wave - rx_sky_mesh_at(&s->found.level, x, y);
            square += off * off;
            before += wave * wave;
        }
    assert_between(square / before, 0.0, 0.1);
    close_sky(s);
}

/* Structure as fine as T cannot be followed, and is in the variance: of white noise of T's own widths, smoothed by T, z is a sum over
 * (T * T)^2, whose variance is known. */
static void fine_structure_is_variance(void **state)
{
    (void)state;
    static float smooth[SIDE * SIDE];
    const double sigma = 20.0; /* ADU, of the field before it is smoothed */
    sky *s = open_sky(3);
    float *white = calloc((size_t)SIDE * SIDE, sizeof *white);
    assert_non_null(white);
    for (int i = 0; i < SIDE * SIDE; i++)
        white[i] = (float)(sigma * rx_random_normal(4, 0, (uint64_t)i));
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double sum = 0.0;
            for (int i = 0; i < STAMP * STAMP; i++) {
                const int u = (x + i % STAMP - HALF + SIDE) % SIDE, v = (y + i / STAMP - HALF + SIDE) % SIDE;
                sum += (double)s->values[i] * (double)white[v * SIDE + u];
            }
            smooth[y * SIDE + x] = (float)sum;
        }
    for (int i = 0; i < SIDE * SIDE; i++)
        s->rest[i] += smooth[i];
    free(white);
    measure(s);
    /* z of the structure: sum T f / (NOISE sqrt(sum T^2)); T * T is a Gaussian of 2 SPREAD^2, T * T * T ... its square sums to
     * 1 / (4 pi 2 SPREAD^2) */
    const double expected = sigma * sigma / (8.0 * M_PI * SPREAD * SPREAD) / (NOISE * NOISE * s->power);
    assert_near(mean_of(&s->found.variance), expected, 0.15 * expected);
    close_sky(s);
}

/* Stars that no model has are of one sign, and no structure of the sky. */
static void stars_are_no_structure(void **state)
{
    (void)state;
    sky *s = open_sky(5);
    for (int k = 0; k < 150; k++) {
        double at[2];
        rx_random_two(6, 0, (uint64_t)k, at);
        const int x0 = HALF + (int)(at[0] * (SIDE - STAMP)), y0 = HALF + (int)(at[1] * (SIDE - STAMP));
        for (int i = 0; i < STAMP * STAMP; i++)
            s->rest[(y0 + i / STAMP - HALF) * SIDE + x0 + i % STAMP - HALF] += 400.0f * s->values[i];
    }
    measure(s);
    assert_near(mean_of(&s->found.variance), 0.0, 0.1);
    close_sky(s);
}

static void hidden_pixels_say_nothing(void **state)
{
    (void)state;
    sky *s = open_sky(7);
    for (int i = 0; i < SIDE * SIDE; i++)
        if (i % SIDE < SIDE / 2) {
            s->weight[i] = 0.0f;
            s->rest[i] = 1e6f;
        }
    measure(s);
    assert_near(mean_of(&s->found.variance), 0.0, 0.06);
    assert_between(most_of(&s->found.level), 0.0, NOISE);
    close_sky(s);
}

static void threads_change_nothing(void **state)
{
    (void)state;
    sky *s = open_sky(8), *t = open_sky(8);
    for (int i = 0; i < SIDE * SIDE; i++)
        s->rest[i] = t->rest[i] += (float)(3.0 * sin(i % SIDE / 20.0));
    t->view.nthreads = 3;
    measure(s);
    measure(t);
    const size_t cells = (size_t)s->found.variance.nx * (size_t)s->found.variance.ny,
                 places = (size_t)s->found.level.nx * (size_t)s->found.level.ny;
    assert_memory_equal(s->found.variance.value, t->found.variance.value, cells * sizeof(double));
    assert_memory_equal(s->found.level.value, t->found.level.value, places * sizeof(double));
    close_sky(s);
    close_sky(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_is_no_structure),      cmocka_unit_test(waves_are_followed),
        cmocka_unit_test(fine_structure_is_variance), cmocka_unit_test(stars_are_no_structure),
        cmocka_unit_test(hidden_pixels_say_nothing),  cmocka_unit_test(threads_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
