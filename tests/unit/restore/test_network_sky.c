/* What a network does not explain at low frequency is in the restored image. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>

#include "../near.h"
#include "network_model.h"
#include "restore/network.h"
#include "restore/network_sky.h"
#include "sky.h"

enum { SIDE = 512, BOX = 32 };

static double box_mean(const float *plane, int x, int y)
{
    double sum = 0;
    for (int k = 0; k < BOX * BOX; k++)
        sum += (double)plane[(y + k / BOX) * SIDE + x + k % BOX];
    return sum / (BOX * BOX);
}

static double bump(double x, double y, double radius)
{
    return exp(-0.5 * (x * x + y * y) / (radius * radius));
}

/* Dark and bright Gaussians of half a sigma and of two, radius 60, which no model and no mesh knows of; masked
 * pixels, a star of 300 sigmas between them. At the border G has one side only. */
static void faint_structure_comes_back(void **state)
{
    for (int kind = 0; kind < 5; kind++) {
        const int informed = kind > 1, noiseless = kind % 2, known = kind != 0;
        sky s;
        float *light = calloc((size_t)SIDE * SIDE, sizeof *light);
        assert_non_null(light);
        sky_new(&s, SIDE, SIDE);
        for (int k = 0; k < SIDE * SIDE; k++) {
            const int x = k % SIDE, y = k / SIDE;
            light[k] = (float)(0.5 * (bump(x - 384, y - 128, 60) - bump(x - 128, y - 128, 60)) +
                               2 * (bump(x - 384, y - 384, 60) - bump(x - 128, y - 384, 60)));
            s.tile.pixels[k] += light[k];
            if (hypot(x - 100, y - 100) < 4)
                s.tile.mask[k] = RX_MASK_BAD;
        }
        sky_noise(&s, 0.3, 5);
        sky_star(&s, 256, 256, 4, 6000);
        rx_model *model = small_model(informed ? RX_MODE_INFORMED : RX_MODE_BLIND, !noiseless);
        rx_psf *psf = kind == 4 ? sky_psf_varying(4, 0.2, SIDE) : rx_stamp_gauss(4);
        rx_restored *restored = NULL;
        s.par.model = model;
        s.par.net_block = 256;
        const rx_image image = sky_image(&s, known ? psf : NULL);
        assert_int_equal(rx_network_run(&s.par, &image, NULL, &restored, NULL), RX_OK);
        double most = 0;
        for (int y = BOX; y < SIDE - BOX; y += BOX)
            for (int x = BOX; x < SIDE - BOX; x += BOX) {
                const double truth = box_mean(light, x, y), made = box_mean(restored->pixels, x, y);
                const int masked = x == 96 && y == 96, star = hypot(x - 240, y - 240) < 40;
                if (!masked && !star) {
                    most = fmax(most, fabs(made - truth) / fmax(fabs(truth), 0.5));
                    assert_near(made, truth, 0.1 * fmax(fabs(truth), 0.5));
                }
            }
        print_message("kind %d: within %.1f %%\n", kind, 100 * most);
        rx_restored_free(restored);
        rx_psf_free(psf);
        rx_model_free(model);
        sky_free(&s);
        free(light);
    }
}

/* Input of noise 1 in its units, and a model of it. */
typedef struct bench {
    float pixels[SIDE * SIDE], level[SIDE * SIDE], sigma[SIDE * SIDE], m[SIDE * SIDE];
    uint8_t mask[SIDE * SIDE];
    float unit;
    rx_image image;
    rx_network_input input;
} bench;

static bench *bench_new(float unit)
{
    bench *b = calloc(1, sizeof *b);
    assert_non_null(b);
    b->unit = unit;
    for (int k = 0; k < SIDE * SIDE; k++) {
        b->level[k] = 100;
        b->sigma[k] = unit;
        b->pixels[k] = 100 + unit * (float)rx_random_normal(4, 0, (uint64_t)k);
    }
    b->image = (rx_image){.width = SIDE,
                          .height = SIDE,
                          .pixels = b->pixels,
                          .with_sky = 1,
                          .level = rx_map_plane(b->level, SIDE),
                          .noise = rx_map_plane(b->sigma, SIDE)};
    b->input = (rx_network_input){.image = &b->image, .mask = b->mask, .scale = {16, 1, 1, &b->unit}};
    return b;
}

/* Root of the mean of (L - level)^2; *most: largest |L - level|. */
static double spread(const rx_coarse *sky, double level, double *most)
{
    float row[SIDE];
    double sum = 0;
    *most = 0;
    for (int y = 0; y < SIDE; y++) {
        rx_coarse_row(sky, y, 0, SIDE, row);
        for (int x = 0; x < SIDE; x++) {
            const double away = (double)row[x] - level;
            sum += away * away;
            *most = fmax(*most, fabs(away));
        }
    }
    return sqrt(sum) / SIDE;
}

/* Waves of a tenth of the noise are not shown, from a fifth on all is, half of what lies between. */
static void waves_are_not_shown(void **state)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        const float f = (float)sign;
        assert_near(rx_front_shown(0.1f * f), 0, 1e-6);
        assert_near(rx_front_shown(0.15f * f), 0.075 * f, 1e-6);
        assert_near(rx_front_shown(0.2f * f), 0.2 * f, 1e-6);
    }
    assert_near(rx_front_shown(1000), 1000, 1e-3);
    assert_near(rx_front_shown(-3), -0.5, 1e-6);
}

/* A sky 30 or 60 sigmas below its level is followed, a pixel of 100,000 and a star whose model is wrong by a tenth are
 * not. Of an empty sky hardly more than the wide mean is there. */
static void the_sky_and_not_the_stars(void **state)
{
    bench *b = bench_new(3);
    rx_coarse sky;
    assert_int_equal(rx_network_sky(&b->input, b->m, 4, 2, &sky, NULL), RX_OK);
    double largest = 0;
    const double plain = spread(&sky, 0, &largest);
    rx_coarse_free(&sky);
    double followed = 0, noise = 0;
    for (int depth = 1; depth <= 2; depth++) {
        for (int k = 0; k < SIDE * SIDE; k++)
            b->pixels[k] -= 90;
        assert_int_equal(rx_network_sky(&b->input, b->m, 4, 2, &sky, NULL), RX_OK);
        if (depth == 1) {
            noise = spread(&sky, -30, &followed);
        } else {
            spread(&sky, -60, &largest);
            assert_near(largest, followed, 0.001);
        }
        rx_coarse_free(&sky);
    }
    print_message("L: at most %.3f of a sky that is off; its noise %.4f, %.4f of an empty sky\n", followed,
                  noise, plain);
    assert_true(followed < 0.25);
    assert_true(plain < 0.5 * noise);
    for (int k = 0; k < SIDE * SIDE; k++)
        b->pixels[k] += 180;
    b->pixels[SIDE * 200 + 200] = 3e5f;
    for (int dy = -12; dy <= 12; dy++)
        for (int dx = -12; dx <= 12; dx++) {
            const int k = SIDE * (350 + dy) + 350 + dx;
            b->m[k] = (float)(1e4 * bump(dx, dy, 2));
            b->pixels[k] += 3 * 1.1f * b->m[k];
        }
    assert_int_equal(rx_network_sky(&b->input, b->m, 4, 2, &sky, NULL), RX_OK);
    spread(&sky, 0, &largest);
    print_message("largest |L| with a hot pixel and a star: %.3f\n", largest);
    assert_true(largest < 0.2);
    rx_coarse_free(&sky);
    free(b);
}

/* A galaxy of 0.4 sigma in its middle, none of which the model has, or the inner half of it: its light within three of its
 * radii is that of the data but for what G spreads, and far from it the sky is empty. */
static void outskirts_come_back(void **state)
{
    for (int explained = 0; explained < 2; explained++) {
        bench *b = bench_new(3), *empty = bench_new(3);
        rx_coarse sky, without;
        float row[SIDE], other[SIDE];
        double put = 0, back = 0, far = 0;
        for (int k = 0; k < SIDE * SIDE; k++) {
            const double away = hypot(k % SIDE - 256, k / SIDE - 256), light = 0.4 * exp(-away / 12);
            b->pixels[k] += 3 * (float)light;
            b->m[k] = explained && away < 12 ? (float)light : 0;
        }
        assert_int_equal(rx_network_sky(&b->input, b->m, 4, 2, &sky, NULL), RX_OK);
        assert_int_equal(rx_network_sky(&empty->input, empty->m, 4, 2, &without, NULL), RX_OK);
        for (int y = 0; y < SIDE; y++) {
            rx_coarse_row(&sky, y, 0, SIDE, row);
            rx_coarse_row(&without, y, 0, SIDE, other);
            for (int x = 0; x < SIDE; x++) {
                const double away = hypot(x - 256, y - 256);
                if (away < 36) {
                    const double noise = ((double)b->pixels[SIDE * y + x] - 100) / 3 - 0.4 * exp(-away / 12);
                    put += 0.4 * exp(-away / 12);
                    back += (double)row[x] + (double)b->m[SIDE * y + x] - noise;
                }
                if (away > 200)
                    far = fmax(far, fabs((double)row[x] - (double)other[x]));
            }
        }
        print_message("%s: %.3f of the light\n", explained ? "explained in its middle" : "unexplained",
                      back / put);
        assert_near(back / put, 1, explained ? 0.02 : 0.04);
        assert_near(far, 0, 1e-3);
        rx_coarse_free(&sky);
        rx_coarse_free(&without);
        free(b);
        free(empty);
    }
}

/* The value under the mask is nothing, and the sky beside it is not less for it. */
static void masked_pixels_have_no_weight(void **state)
{
    bench *b = bench_new(3);
    rx_coarse clean, dirty;
    for (int k = 0; k < SIDE * SIDE; k++) {
        b->pixels[k] = 115;
        b->mask[k] = k % SIDE > 240 && k % SIDE < 280;
    }
    assert_int_equal(rx_network_sky(&b->input, b->m, 4, 1, &clean, NULL), RX_OK);
    double away = 0;
    spread(&clean, 5, &away);
    assert_near(away, 0, 1e-5);
    for (int k = 0; k < SIDE * SIDE; k++)
        if (b->mask[k])
            b->pixels[k] = NAN;
    assert_int_equal(rx_network_sky(&b->input, b->m, 4, 3, &dirty, NULL), RX_OK);
    assert_memory_equal(clean.value, dirty.value, sizeof(float) * (size_t)clean.nx * (size_t)clean.ny);
    rx_coarse_free(&clean);
    rx_coarse_free(&dirty);
    free(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(faint_structure_comes_back), cmocka_unit_test(the_sky_and_not_the_stars),
        cmocka_unit_test(outskirts_come_back),        cmocka_unit_test(masked_pixels_have_no_weight),
        cmocka_unit_test(waves_are_not_shown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
