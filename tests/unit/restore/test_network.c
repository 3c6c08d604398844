/* The restorer NET: no blocks, threads or masked values in its results, on tiles of any shape. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>
#include <stdio.h>
#include <string.h>

#include "../near.h"
#include "network_model.h"
#include "nn/direct.h"
#include "restore/network.h"
#include "restore/network_data.h"
#include "sky.h"

enum { WIDTH = 230, HEIGHT = 171 };

/* Stars of up to 10^decades sigmas, masked pixels, noise that doubles across the tile. */
static void make_scene(sky *s, int width, int height, double decades)
{
    sky_new(s, width, height);
    for (int i = 0; i < 30; i++) {
        const double x = rx_random_uniform(3, 0, (uint64_t)i) * width,
                     y = rx_random_uniform(3, 1, (uint64_t)i) * height;
        sky_star(s, x, y, 4, pow(10, 1 + (decades - 1) * i / 29));
    }
    sky_noise(s, 1, 5);
    for (int k = 0; k < width * height; k++) {
        s->background.sigma[k] = 1 + (float)(k % width) / (float)width;
        if (rx_random_uniform(9, 0, (uint64_t)k) < 0.01)
            s->tile.mask[k] = RX_MASK_BAD;
        if (hypot(k % width - 0.3 * width, k / width - 0.6 * height) < 9)
            s->tile.mask[k] = RX_MASK_SATURATED;
    }
    s->tile.gain = 2;
    s->par.net_block = 64;
}

static rx_restored *restore(const sky *s, const rx_psf *psf)
{
    rx_restored *restored = NULL;
    rx_error err = RX_ERROR_NONE;
    const rx_image image = sky_image(s, psf);
    if (rx_network_run(&s->par, &image, NULL, &restored, &err) != RX_OK)
        fail_msg("%s", err.text);
    return restored;
}

/* What the restored image brings for detection, to be freed. */
static float *noise_of(const rx_restored *r)
{
    float *noise = calloc((size_t)r->width * (size_t)r->height, sizeof *noise);
    assert_non_null(noise);
    rx_map_fill(&r->noise, r->height, 1, noise);
    return noise;
}

static void assert_sound(const rx_restored *r)
{
    float *noise = noise_of(r);
    for (int k = 0; k < r->width * r->height; k++) {
        assert_true(isfinite(r->pixels[k]));
        assert_true(isfinite(noise[k]));
        assert_true(isfinite(r->support[k]));
        if (r->mask[k] != 0)
            assert_true(r->pixels[k] == 0);
    }
    free(noise);
}

static double difference(const rx_restored *a, const rx_restored *b)
{
    double most = 0;
    float *noise = noise_of(a);
    for (int k = 0; k < a->width * a->height; k++)
        most = fmax(most, fabs((double)a->pixels[k] - b->pixels[k]) / noise[k]);
    free(noise);
    return most;
}

static void assert_same(const rx_restored *a, const rx_restored *b)
{
    const size_t n = (size_t)a->width * (size_t)a->height;
    assert_memory_equal(a->pixels, b->pixels, n * sizeof(float));
    float *first = noise_of(a), *second = noise_of(b);
    assert_memory_equal(first, second, n * sizeof(float));
    free(first);
    free(second);
    assert_memory_equal(a->support, b->support, n * sizeof(float));
    assert_memory_equal(a->mask, b->mask, n);
    if (a->reblurred != NULL)
        assert_memory_equal(a->reblurred, b->reblurred, n * sizeof(float));
}

static void blind_knows_no_blocks(void **state)
{
    static const int sides[] = {512, 32, 72, 100};
    sky s;
    make_scene(&s, WIDTH, HEIGHT, 3);
    rx_model *model = small_model(RX_MODE_BLIND, 1);
    s.par.model = model;
    rx_restored *first = restore(&s, NULL);
    assert_sound(first);
    assert_null(first->blur);
    assert_null(first->reblurred);
    assert_true(isnan(first->chi2));
    for (int i = 0; i < 4; i++) {
        s.par.net_block = sides[i];
        rx_restored *other = restore(&s, NULL);
        assert_memory_equal(first->pixels, other->pixels, WIDTH * HEIGHT * sizeof(float));
        rx_restored_free(other);
    }
    s.par.verify_seams = 1;
    rx_restored *verified = restore(&s, NULL);
    assert_true(verified->seam == 0);
    rx_restored_free(verified);
    rx_restored_free(first);
    rx_model_free(model);
    sky_free(&s);
}

/* With the step, whose quotients amplify what FFTs round, and without; stars of S/N 10,000. */
static void informed_hardly_knows_blocks(void **state)
{
    for (int kind = 0; kind < 6; kind++) {
        const int varying = kind % 2, step = kind / 2 > 0, stages = 1 + kind / 4;
        sky s;
        make_scene(&s, WIDTH, HEIGHT, 4.8);
        rx_model *model = stages == 2 ? small_stages() : small_model(RX_MODE_INFORMED, 1);
        rx_psf *psf = varying ? sky_psf_varying(4, 0.2, WIDTH) : rx_stamp_gauss(4);
        model->front.rl_steps = step;
        s.par.model = model;
        s.par.verify_seams = 1;
        rx_restored *first = restore(&s, psf);
        assert_sound(first);
        assert_true(isfinite(first->chi2));
        print_message("%s PSF, %d step, %d stages: %.2g sigma\n", varying ? "varying" : "constant", step,
                      stages, first->seam);
        assert_true(first->seam < 1e-3);
        assert_true(first->seam > 0);
        s.par.verify_seams = 0;
        for (int side = 32; side < 300; side += 68) {
            s.par.net_block = side;
            rx_restored *other = restore(&s, psf);
            assert_same(first, other);
            rx_restored_free(other);
        }
        rx_restored_free(first);
        rx_psf_free(psf);
        rx_model_free(model);
        sky_free(&s);
    }
}

/* Blind, informed (1 and 2), in two stages. */
static rx_model *model_of(int kind)
{
    return kind == 3 ? small_stages() : small_model(kind > 0 ? RX_MODE_INFORMED : RX_MODE_BLIND, 1);
}

static void threads_change_no_bit(void **state)
{
    for (int kind = 0; kind < 4; kind++) {
        sky s;
        make_scene(&s, WIDTH, HEIGHT, 3);
        rx_model *model = model_of(kind);
        rx_psf *psf = kind >= 2 ? sky_psf_varying(4, 0.2, WIDTH) : rx_stamp_gauss(4);
        s.par.model = model;
        s.par.net_block = 512; /* one block; for several threads there will be more */
        rx_restored *one = restore(&s, psf);
        s.par.nthreads = 5;
        rx_restored *five = restore(&s, psf);
        assert_same(one, five);
        assert_true(one->chi2 == five->chi2);
        rx_restored_free(one);
        rx_restored_free(five);
        rx_psf_free(psf);
        rx_model_free(model);
        sky_free(&s);
    }
}

/* Whatever lies under the mask, not a bit of any output changes. */
static void masked_values_reach_nothing(void **state)
{
    for (int kind = 0; kind < 4; kind++) {
        sky s;
        make_scene(&s, WIDTH, HEIGHT, 3);
        rx_model *model = model_of(kind);
        rx_psf *psf = kind >= 2 ? sky_psf_varying(4, 0.2, WIDTH) : rx_stamp_gauss(4);
        s.par.model = model;
        rx_restored *clean = restore(&s, psf);
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            if (s.tile.mask[k] != 0)
                s.tile.pixels[k] = k % 3 == 0 ? NAN : k % 3 == 1 ? 3e38f : -1e9f;
        rx_restored *dirty = restore(&s, psf);
        assert_same(clean, dirty);
        assert_true(clean->chi2 == dirty->chi2);
        rx_restored_free(clean);
        rx_restored_free(dirty);
        rx_psf_free(psf);
        rx_model_free(model);
        sky_free(&s);
    }
}

static void tiles_of_any_shape(void **state)
{
    static const int shapes[][2] = {{1, 1}, {1, 90}, {90, 1}, {3, 2}, {63, 65}, {7, 130}};
    for (int i = 0; i < 6; i++)
        for (int kind = 0; kind < 4; kind++) {
            const int width = shapes[i][0], height = shapes[i][1];
            sky s;
            make_scene(&s, width, height, 3);
            rx_model *model = model_of(kind);
            rx_psf *psf = kind >= 2 && width > 1 ? sky_psf_varying(4, 0.2, width) : rx_stamp_gauss(4);
            s.par.model = model;
            s.par.verify_seams = 1;
            rx_restored *r = restore(&s, psf);
            assert_sound(r);
            rx_restored_free(r);
            rx_psf_free(psf);
            rx_model_free(model);
            sky_free(&s);
        }
}

static void nothing_good(void **state)
{
    for (int kind = 0; kind < 2; kind++) {
        sky s;
        make_scene(&s, 80, 70, 3);
        rx_model *model = small_model(kind > 0 ? RX_MODE_INFORMED : RX_MODE_BLIND, 1);
        rx_psf *psf = rx_stamp_gauss(4);
        s.par.model = model;
        for (int k = 0; k < 80 * 70; k++) {
            s.tile.pixels[k] = NAN;
            s.tile.mask[k] = kind == 0 ? RX_MASK_BAD : 0; /* not finite is as good as masked */
        }
        rx_restored *r = restore(&s, psf);
        assert_sound(r);
        for (int k = 0; k < 80 * 70; k++) {
            assert_true(r->pixels[k] == 0);
            assert_true(r->support[k] == 1);
        }
        rx_restored_free(r);
        rx_psf_free(psf);
        rx_model_free(model);
        sky_free(&s);
    }
}

/* A network that adds nothing hands its base on: the tile itself (BLIND; with less than a sigma of sky around a
 * star that its PSF does not explain), a star of the target's width and the right flux (INFORMED with its step).
 */
static void network_without_weights(void **state)
{
    const double flux = 5e4, x = 100.3, y = 80.8;
    sky s;
    sky_new(&s, WIDTH, HEIGHT);
    sky_star(&s, x, y, 4, flux);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        s.background.sigma[k] = 3;
    rx_psf *psf = rx_stamp_gauss(4);
    rx_model *blind = small_model(RX_MODE_BLIND, 0), *informed = small_model(RX_MODE_INFORMED, 0);
    s.par.model = blind;
    s.par.net_block = 64;
    rx_restored *same = restore(&s, psf);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        assert_near(same->pixels[k], s.tile.pixels[k] - 100, 3 + 2e-6 * s.tile.pixels[k]);
    s.par.model = informed;
    rx_restored *sharp = restore(&s, psf);
    informed->front.rl_steps = 0;
    rx_restored *copy = restore(&s, psf);
    /* the Tikhonov copy has rings below 0, which the step leaves alone: the light is what it brings right */
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        sharp->pixels[k] = fmaxf(sharp->pixels[k], 0);
        copy->pixels[k] = fmaxf(copy->pixels[k], 0);
    }
    const double before = sky_sum(&s, copy->pixels, x, y, 12) / flux,
                 after = sky_sum(&s, sharp->pixels, x, y, 12) / flux;
    const double width = sky_fwhm(&s, sharp->pixels, 100, 81);
    print_message("light %.4f of the star's before the step, %.4f after it, FWHM %.3f pixels\n", before,
                  after, width);
    assert_near(after, 1, 2e-2);
    assert_true(fabs(after - 1) < 0.3 * fabs(before - 1));
    assert_true(width < 3.7);
    assert_string_equal(sharp->name, "NET");
    assert_near(sharp->psf->fwhm, 2, 1e-9);
    assert_true(strstr(sharp->settings, "INFORMED") != NULL);
    rx_restored_free(same);
    rx_restored_free(sharp);
    rx_restored_free(copy);
    rx_model_free(blind);
    rx_model_free(informed);
    rx_psf_free(psf);
    sky_free(&s);
}

/* The scale of the noise is taken out and put back: a tile of other units gives the same image in them. */
static void units_do_not_matter(void **state)
{
    sky s;
    make_scene(&s, WIDTH, HEIGHT, 3);
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    rx_psf *psf = rx_stamp_gauss(4);
    s.par.model = model;
    rx_restored *a = restore(&s, psf);
    float *noise = noise_of(a);
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        s.tile.pixels[k] *= 1024;
        s.background.level[k] *= 1024;
        s.background.sigma[k] *= 1024;
    }
    s.tile.gain /= 1024;
    rx_restored *b = restore(&s, psf);
    for (int k = 0; k < WIDTH * HEIGHT; k++)
        assert_near(b->pixels[k] / 1024, a->pixels[k], 1e-3 * noise[k]);
    free(noise);
    assert_near(a->chi2, b->chi2, 1e-4 * a->chi2);
    rx_restored_free(a);
    rx_restored_free(b);
    rx_model_free(model);
    rx_psf_free(psf);
    sky_free(&s);
}

static void refusals(void **state)
{
    sky s;
    rx_restored *r = NULL;
    rx_error err = RX_ERROR_NONE;
    make_scene(&s, 80, 70, 3);
    rx_psf *psf = rx_stamp_gauss(4);
    const rx_image image = sky_image(&s, psf), unknown = sky_image(&s, NULL);
    assert_int_equal(rx_network_run(&s.par, &image, NULL, &r, &err), RX_USAGE);
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    s.par.model = model;
    assert_int_equal(rx_network_run(&s.par, &unknown, NULL, &r, &err), RX_INPUT);
    psf->basis[3] = NAN;
    assert_int_equal(rx_network_run(&s.par, &image, NULL, &r, &err), RX_INPUT);
    psf->basis[3] = 0;
    model->restore->params[0] = INFINITY;
    assert_int_equal(rx_network_run(&s.par, &image, NULL, &r, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "small"));
    assert_null(r);
    rx_model_free(model);
    rx_psf_free(psf);
    sky_free(&s);
}

static void who_must_have_a_psf(void **state)
{
    const rx_restorer *net = rx_restorer_find("NET");
    rx_restore_params par = {0};
    rx_model *blind = small_model(RX_MODE_BLIND, 0), *informed = small_model(RX_MODE_INFORMED, 0);
    assert_true((net->traits & RX_TRAIT_PSF) != 0);
    assert_true(rx_restorer_must_have_psf(net, &par));
    par.model = informed;
    assert_true(rx_restorer_must_have_psf(net, &par));
    par.model = blind;
    assert_false(rx_restorer_must_have_psf(net, &par));
    assert_true(rx_restorer_must_have_psf(rx_restorer_find("RL"), &par));
    assert_false(rx_restorer_must_have_psf(rx_restorer_find("NONE"), &par));
    rx_model_free(blind);
    rx_model_free(informed);
}

static void half_precision(void **state)
{
    sky s;
    if (!rx_direct_has_bf16()) {
        print_message("this processor has no bfloat16: not tried\n");
        skip();
    }
    make_scene(&s, WIDTH, HEIGHT, 3);
    rx_model *model = small_model(RX_MODE_INFORMED, 1);
    rx_psf *psf = rx_stamp_gauss(4);
    s.par.model = model;
    rx_restored *full = restore(&s, psf);
    s.par.precision = RX_BF16;
    rx_restored *half = restore(&s, psf);
    float *noise = noise_of(full);
    double square = 0, n = 0;
    for (int k = 0; k < WIDTH * HEIGHT; k++) {
        const double d = (half->pixels[k] - full->pixels[k]) / noise[k];
        square += d * d;
        n++;
    }
    free(noise);
    print_message("bfloat16: rms difference %.3g sigma, largest %.3g\n", sqrt(square / n),
                  difference(full, half));
    assert_true(sqrt(square / n) < 0.05);
    assert_true(square > 0);
    rx_model *blind = small_model(RX_MODE_BLIND, 1);
    s.par.verify_seams = 1;
    rx_restored *verified = restore(&s, psf);
    assert_true(verified->seam < 0.5);
    rx_restored_free(verified);
    s.par.model = blind;
    verified = restore(&s, psf);
    assert_true(verified->seam < 1e-3);
    rx_restored_free(verified);
    rx_model_free(blind);
    rx_restored_free(full);
    rx_restored_free(half);
    rx_model_free(model);
    rx_psf_free(psf);
    sky_free(&s);
}

/* Cells of 16 pixels, bilinear between their centres, held beyond the outer ones; in any pieces. */
static void coarse_maps_are_bilinear(void **state)
{
    enum { NX = 4, NY = 3, CELL = 16 };
    float value[NX * NY], row[NX * CELL], piece[7];
    const rx_coarse coarse = {CELL, NX, NY, value};
    for (int k = 0; k < NX * NY; k++)
        value[k] = (float)(1 + 0.3 * k + 2 * sin(3 * k));
    for (int y = 0; y < NY * CELL; y++) {
        const double v = fmin(fmax((y + 0.5) / CELL - 0.5, 0), NY - 1);
        const int j = v < NY - 2 ? (int)v : NY - 2;
        rx_coarse_row(&coarse, y, 0, NX * CELL, row);
        for (int x = 0; x < NX * CELL; x++) {
            const double u = fmin(fmax((x + 0.5) / CELL - 0.5, 0), NX - 1);
            const int i = u < NX - 2 ? (int)u : NX - 2;
            const float *at = value + j * NX + i;
            const double low = at[0] + (u - i) * (at[1] - at[0]),
                         high = at[NX] + (u - i) * (at[NX + 1] - at[NX]);
            assert_near(row[x], low + (v - j) * (high - low), 1e-5);
        }
        for (int x = 0; x + 7 <= NX * CELL; x += 7) {
            rx_coarse_row(&coarse, y, x, 7, piece);
            for (int k = 0; k < 7; k++)
                assert_near(piece[k], row[x + k], 1e-5);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blind_knows_no_blocks),
        cmocka_unit_test(informed_hardly_knows_blocks),
        cmocka_unit_test(threads_change_no_bit),
        cmocka_unit_test(masked_values_reach_nothing),
        cmocka_unit_test(tiles_of_any_shape),
        cmocka_unit_test(nothing_good),
        cmocka_unit_test(network_without_weights),
        cmocka_unit_test(units_do_not_matter),
        cmocka_unit_test(refusals),
        cmocka_unit_test(who_must_have_a_psf),
        cmocka_unit_test(half_precision),
        cmocka_unit_test(coarse_maps_are_bilinear),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
