/* The light of training images: the field they are cut from, its scale, the Tikhonov copy to the patch's
 * border, and the relative PSF between sharp and blurred. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "nn/deblur.h"
#include "num/convolve.h"
#include "psf/psf.h"
#include "samples_test.h"
#include "simulate/sky_field.h"

enum { P = 64, N = P * P, WINDOW = 160, FRAME = (WINDOW - P) / 2, K = RX_SAMPLE_KERNEL };

/* As in train/samples.c. */
#define FIELD_SEED 0x6669656c64000000u

/* The whole field of image 0 of a bin. */
static void make_field(const samples_test *t, uint32_t bin, rx_sky_field *dst)
{
    rx_simulate_config *config = NULL;
    rx_simulation *simulation = NULL;
    double sigma[2];
    double fwhm[2];
    assert_int_equal(rx_simulate_config_copy(t->config, &config, NULL), RX_OK);
    config->image_size = (rx_ints){.n = 1, .v = {t->par.field_side + WINDOW - P}};
    config->psf_fwhm = 1.0;
    config->sharp_fwhm = t->par.front.target_fwhm;
    assert_int_equal(rx_simulation_from_config(config, NULL, &simulation, NULL), RX_OK);
    rx_selection_bin(&t->grid, (int)bin, fwhm, sigma);
    const rx_random_stream from = {t->par.seed ^ FIELD_SEED,
                                   rx_samples_field(&t->par, (rx_sample_id){.bin = bin})};
    assert_int_equal(rx_sky_field_make(simulation, &t->par.sky, fwhm, from, dst, NULL), RX_OK);
    rx_simulation_free(simulation);
    rx_simulate_config_free(config);
}

/* Of a plane of the field the part that is place 0 in the sample's units; its largest difference to `seen`
 * over its largest value. */
static double compare(const float *plane, int side, double scale, const float *seen)
{
    double off = 0.0, most = 0.0;
    for (int y = 0; y < P; y++)
        for (int x = 0; x < P; x++) {
            double value = scale * (double)plane[(size_t)(FRAME + y) * (size_t)side + FRAME + (size_t)x];
            off = fmax(off, fabs(value - (double)seen[y * P + x]));
            most = fmax(most, fabs(value));
        }
    return off / most;
}

/* Turns a sample back so that it lies as its field does. */
static void turn_back(const rx_sky_field *field, double scale, rx_sample *s)
{
    rx_sample *copy = samples_test_new(P);
    int found = 0;
    for (int turn = 0; turn < 8 && !found; turn++) {
        memcpy(copy, s, rx_sample_bytes(P));
        rx_sample_attach(copy);
        assert_int_equal(rx_sample_turn(copy, turn, NULL), RX_OK);
        found = compare(field->sharp, field->side, scale, copy->y) < 1e-5;
    }
    assert_true(found);
    memcpy(s, copy, rx_sample_bytes(P));
    rx_sample_attach(s);
    free(copy);
}

/* plane [side][side] = Tikhonov copy of the field's light, mirrored at its borders onto twice the size: what
 * lies beyond is far from place 0. */
static void filter_field(const samples_test *t, const rx_sky_field *field, float *plane)
{
    rx_fft *fft = NULL;
    rx_psf *psf = NULL;
    const int side = field->side, twice = 2 * side;
    assert_int_equal(rx_fft_new(twice, twice, 1, &fft, NULL), RX_OK);
    assert_int_equal(rx_sky_field_psf(field, &psf, NULL), RX_OK);
    float *work = rx_fft_real(fft), *half = rx_fft_complex(fft), *spectrum = rx_fft_complex(fft);
    assert_int_equal(rx_deblur_tikhonov(fft, psf->basis, psf->size,
                                        &(rx_tikhonov){t->par.front.target_fwhm, t->par.front.tikhonov, 0},
                                        spectrum, NULL),
                     RX_OK);
    for (int y = 0; y < twice; y++)
        for (int x = 0; x < twice; x++) {
            int v = y < side ? y : twice - 1 - y, u = x < side ? x : twice - 1 - x;
            work[(size_t)y * (size_t)rx_fft_stride_real(fft) + (size_t)x] =
                field->blurred[(size_t)v * (size_t)side + (size_t)u];
        }
    rx_convolve(fft, spectrum, work, half, work);
    for (int y = 0; y < side; y++)
        memcpy(plane + (size_t)y * (size_t)side, work + (size_t)y * (size_t)rx_fft_stride_real(fft),
               (size_t)side * sizeof *plane);
    free(work);
    free(half);
    free(spectrum);
    rx_psf_free(psf);
    rx_fft_free(fft);
}

/* At sigma 0.001 there is hardly any noise. */
static void test_cut_from_a_field(void **state)
{
    samples_test t = samples_test_open(0.001, 0.00101);
    t.par.sky.nebulae = 0.3;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(P);
    for (uint32_t bin = 0; bin < 10; bin++) {
        rx_sky_field field;
        make_field(&t, bin, &field);
        float *filtered = calloc((size_t)field.side * (size_t)field.side, sizeof *filtered);
        assert_non_null(filtered);
        samples_test_sample(scenes, (rx_sample_id){.bin = bin}, s);
        const double scale = 255.0 / ((double)s->sigma * field.level);
        turn_back(&field, scale, s);
        assert_true(compare(field.blurred, field.side, scale, s->blurred) < 1e-5);
        filter_field(&t, &field, filtered);
        double off = compare(filtered, field.side, scale, s->w);
        print_message("w of FWHM %.2f, beta %.2f: differs by %.1e of its highest pixel\n", field.fwhm,
                      field.beta, off);
        assert_true(off < 4e-3);
        free(filtered);
        rx_sky_field_clear(&field);
    }
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

/* The level: 0.1 % of the pixels are brighter; more where rare bright stars were added, fewer where it is
 * bounded by the brightest pixel. */
static void test_level(void **state)
{
    samples_test t = samples_test_open(1.0, 15.0);
    int exact = 0, bounded = 0, more = 0;
    for (uint32_t bin = 0; bin < 25; bin++) {
        rx_sky_field field;
        t.config->star_count = bin % 5 == 0 ? 40.0 : 1500.0;
        t.config->galaxy_count = bin % 5 == 0 ? 0.0 : 600.0;
        make_field(&t, bin, &field);
        const long n = (long)field.side * field.side;
        long brighter = 0;
        double peak = 0.0;
        for (long i = 0; i < n; i++) {
            assert_true(field.blurred[i] >= 0.0f);
            assert_true(field.sharp[i] >= 0.0f);
            brighter += (double)field.blurred[i] > field.level;
            peak = fmax(peak, (double)field.blurred[i]);
        }
        assert_true(peak <= 2.0 * RX_NOISE_LEVEL_PEAK * field.level); /* a bright star on another one */
        exact += peak > 0.0 && labs(brighter - n / 1000) <= 1;
        more += brighter > n / 1000 + 1;
        if (peak > 0.0 && brighter < n / 1000 - 1) {
            assert_true(fabs(field.level / peak * RX_NOISE_LEVEL_PEAK - 1.0) < 1e-6);
            bounded++;
        }
        rx_sky_field_clear(&field);
    }
    print_message("level: %d fields exact, %d with bright stars, %d bounded\n", exact, more, bounded);
    assert_true(exact >= 10);
    assert_true(more >= 3);
    assert_true(more <= 14);
    assert_true(bounded > 0);
    rx_simulate_config_free(t.config);
}

/* A model trained from a noise level on knows what is fainter, down to nothing: patches of the noisiest fields of the
 * default model (validation/training/psfnet.train), what the network sees of them. nn/noise_level.h has these numbers. */
static void test_patches_are_fainter_than_fields(void **state)
{
    enum { SIDE = 128, SAMPLES = 200 };
    samples_test t = samples_test_open(12.1, 15.0);
    t.par.side = SIDE;
    t.par.field_side = 2 * SIDE;
    t.par.sky.density = 4.0;
    t.par.sky.nebulae = 0.25;
    t.config->star_count = 1200.0;
    t.config->galaxy_count = 800.0;
    t.config->galaxy_slope = 0.3;
    t.config->pair_share = t.config->clustering = 0.1;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(SIDE);
    int empty = 0, fainter = 0;
    assert_non_null(s);
    for (uint32_t i = 0; i < SAMPLES; i++) {
        samples_test_sample(scenes, (rx_sample_id){.bin = 2 + i % 5 * 5, .index = i / 5 % 40, .epoch = 0}, s);
        const double level = rx_noise_level(rx_brightness(s->blurred, (size_t)SIDE * SIDE, 0));
        empty += level > 130.0;
        fainter += level > 15.0;
    }
    print_message("of %d patches %d are above a noise level of 15, %d above 130\n", SAMPLES, fainter, empty);
    assert_true(fainter > 2 * SAMPLES / 5);
    assert_true(empty > SAMPLES / 20);
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

/* K' * y against blurred where the stamp fits: largest difference as share of the highest pixel of the
 * patch. */
static double check_kernel(const rx_sample *s)
{
    const int side = s->side;
    double worst = 0.0, peak = 0.0;
    for (int y = K / 2; y < side - K / 2; y++)
        for (int x = K / 2; x < side - K / 2; x++) {
            double sum = 0.0;
            for (int j = 0; j < K; j++)
                for (int i = 0; i < K; i++)
                    sum +=
                        (double)s->kernel[j * K + i] * (double)s->y[(y + K / 2 - j) * side + x + K / 2 - i];
            worst = fmax(worst, fabs(sum - (double)s->blurred[y * side + x]));
        }
    for (int k = 0; k < side * side; k++)
        peak = fmax(peak, (double)s->blurred[k]);
    return worst / peak;
}

static void test_relative_psf(void **state)
{
    samples_test t = samples_test_open(1.0, 15.0);
    t.par.side = t.par.field_side = 128;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(128);
    for (uint32_t i = 0; i < 15; i++) {
        samples_test_sample(scenes, (rx_sample_id){.epoch = i % 2, .bin = i % 5, .index = i}, s);
        double off = check_kernel(s);
        print_message("K' * y of FWHM %.2f: differs by %.1e of the highest pixel\n", (double)s->true_fwhm,
                      off);
        /* nn/deblur.h: 1.4 % at 2 pixels, 0.5 % at 2.5, 0.2 % at 3 */
        assert_true(off < (s->true_fwhm < 2.5f ? 0.02 : s->true_fwhm < 3.2f ? 5e-3 : 2e-3));
    }
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

/* A PSF with a halo: what is given of it leads from the true image to the blurred one, within what a stamp of K pixels
 * holds of a halo; and its core has the less light. */
static void test_halos(void **state)
{
    samples_test t = samples_test_open(1.0, 15.0), with;
    t.par.side = t.par.field_side = 128;
    with = t;
    with.par.sky.halos = 1.0;
    rx_samples *scenes = samples_test_make(&with);
    rx_sample *s = samples_test_new(128);
    for (uint32_t bin = 0; bin < 5; bin++) {
        rx_sky_field plain, field;
        make_field(&t, bin, &plain);
        make_field(&with, bin, &field);
        assert_near(plain.halo, 0.0, 0.0);
        assert_true(field.halo >= 0.02);
        assert_true(field.halo <= RX_SKY_HALO);
        assert_true(field.halo_fwhm >= 1.99 * field.fwhm);
        assert_true(field.halo_fwhm <= RX_SKY_HALO_FWHM);
        assert_near(field.fwhm, plain.fwhm, 0.0);
        assert_true(field.peak < (1.0 - 0.75 * field.halo) * plain.peak);
        assert_true(field.peak > (1.0 - field.halo) * plain.peak);
        samples_test_sample(scenes, (rx_sample_id){.bin = bin}, s);
        assert_true(check_kernel(s) < (s->true_fwhm < 2.5f ? 0.02 : 6e-3));
        rx_sky_field_clear(&plain);
        rx_sky_field_clear(&field);
    }
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cut_from_a_field),
        cmocka_unit_test(test_level),
        cmocka_unit_test(test_patches_are_fainter_than_fields),
        cmocka_unit_test(test_relative_psf),
        cmocka_unit_test(test_halos),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
