/* Noise that hangs together: are errors, evidence and the search for more true on it? */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"

enum { KERNEL = 5, HALF = KERNEL / 2 };

/* A Gaussian of 1 pixel. */
static void kernel_of(float *kernel)
{
    for (int k = 0; k < KERNEL * KERNEL; k++)
        kernel[k] = (float)exp(-0.5 * (pow(k % KERNEL - HALF, 2) + pow(k / KERNEL - HALF, 2)));
}

static rx_noise_correlation correlation(void)
{
    float kernel[KERNEL * KERNEL];
    kernel_of(kernel);
    return rx_noise_of_kernel(kernel, KERNEL, KERNEL);
}

/* White noise under that kernel, of the width sigma in every pixel. */
static void add_noise(field *f, uint64_t seed)
{
    float kernel[KERNEL * KERNEL];
    double power = 0;
    const int w = f->width + 2 * HALF, h = f->height + 2 * HALF;
    float *white = RX_NEW(float, (size_t)w *(size_t)h);
    assert_non_null(white);
    kernel_of(kernel);
    for (int k = 0; k < KERNEL * KERNEL; k++)
        power += (double)kernel[k] * (double)kernel[k];
    for (size_t k = 0; k < (size_t)w * (size_t)h; k++)
        white[k] = (float)rx_random_normal(seed, 0, k);
    for (int y = 0; y < f->height; y++)
        for (int x = 0; x < f->width; x++) {
            double sum = 0;
            for (int j = 0; j < KERNEL; j++)
                for (int i = 0; i < KERNEL; i++)
                    sum += (double)kernel[j * KERNEL + i] * (double)white[(y + j) * w + x + i];
            const size_t k = (size_t)y * (size_t)f->width + (size_t)x;
            f->pixels[k] += (float)((double)f->sigma[k] * sum / sqrt(power));
        }
    free(white);
}

enum { ACROSS = 20, UP = 25, CELL = 48, SKIES = 4, PLACES = ACROSS * UP };

typedef struct pulls {
    int n;
    double pull[2 * PLACES * SKIES];
} pulls;

/* Alone, or with a neighbour 1.5 FWHM away; S/N 8 to 100 under this noise. */
static void make(field *f, int pairs, double *flux)
{
    const rx_noise_correlation noise = correlation();
    double power = 0;
    field_open(f, ACROSS * CELL, UP * CELL, 3, 1, 2 * PLACES);
    for (int k = 0; k < f->psf->size * f->psf->size; k++)
        power += (double)f->psf->basis[k] * f->psf->basis[k];
    const double one = rx_noise_factor(&noise, f->psf->basis, f->psf->size, f->psf->size) / sqrt(power);
    for (uint64_t i = 0; i < PLACES; i++) {
        const double x = (double)(i % ACROSS) * CELL + CELL / 2 + rx_random_uniform(5, 2, i) - 0.5;
        const double y = (double)(i / ACROSS) * CELL + CELL / 2 + rx_random_uniform(5, 3, i) - 0.5;
        const double turn = 6.283 * rx_random_uniform(5, 4, i);
        for (int k = 0; k <= pairs; k++) {
            const double snr = 8 * pow(12, rx_random_uniform(5, 5 + (uint64_t)k, i));
            const double u = x + k * 4.5 * cos(turn), v = y + k * 4.5 * sin(turn);
            flux[f->sources->n] = snr * one;
            field_star(f, u, v, snr * one);
            field_list(f, u, v, f->fwhm, f->fwhm / 2.355, f->fwhm / 2.355, 0);
        }
    }
}

static void check_scatter(int pairs)
{
    const rx_noise_correlation noise = correlation();
    field f;
    pulls *p = RX_NEW(pulls, 1);
    double *flux = RX_NEW(double, 2 * PLACES), sum = 0, square = 0;
    assert_non_null(p);
    assert_non_null(flux);
    make(&f, pairs, flux);
    const size_t pixels = (size_t)f.width * (size_t)f.height;
    float *clean = RX_NEW(float, pixels);
    assert_non_null(clean);
    memcpy(clean, f.pixels, pixels * sizeof(float));
    for (uint64_t sky = 0; (int)sky < (pairs ? SKIES / 2 : SKIES); sky++) {
        memcpy(f.pixels, clean, pixels * sizeof(float));
        add_noise(&f, 7 + sky);
        field_restore_none(&f);
        rx_tphot_params par = rx_tphot_defaults();
        rx_tphot_input input = field_input(&f);
        rx_tphot *t = NULL;
        input.image.correlation = &noise;
        par.extended = 0;
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        for (int i = 0; i < t->n; i++)
            p->pull[p->n++] = (t->list[i].flux - flux[i]) / t->list[i].fluxerr;
        rx_tphot_free(t);
    }
    for (int i = 0; i < p->n; i++) {
        sum += p->pull[i];
        square += p->pull[i] * p->pull[i];
    }
    const double mean = sum / p->n, width = sqrt(square / p->n - mean * mean);
    print_message("%s: %d, mean %.3f, width %.3f\n", pairs ? "pairs" : "alone", p->n, mean, width);
    assert_near(width, 1, 0.05);
    assert_near(mean, 0, 0.1);
    free(clean);
    free(flux);
    free(p);
    field_close(&f);
}

static void test_scatter_alone(void **state)
{
    (void)state;
    check_scatter(0);
}

static void test_scatter_of_pairs(void **state)
{
    (void)state;
    check_scatter(1);
}

/* What says that pixels are independent says nothing that was not known. */
static void test_white(void **state)
{
    (void)state;
    const rx_noise_correlation white = rx_noise_white(RX_NOISE_MEASURED);
    field f;
    rx_tphot *t[2] = {NULL};
    field_open(&f, 90, 90, 3, 1, 3);
    static const double at[3][3] = {{30.2, 30.4, 150}, {34.9, 31.1, 90}, {65.3, 60.7, 400}};
    for (int i = 0; i < 3; i++) {
        field_disk(&f, at[i][0], at[i][1], at[i][2], 1.5, 0.8, 0.3);
        field_list(&f, at[i][0], at[i][1], 3, 1.6, 1.4, 0.3);
    }
    field_noise(&f, 3);
    field_restore_none(&f);
    for (int i = 0; i < 2; i++) {
        const rx_tphot_params par = rx_tphot_defaults();
        rx_tphot_input input = field_input(&f);
        input.image.correlation = i == 0 ? NULL : &white;
        assert_int_equal(rx_tphot_run(&par, &input, &t[i], NULL), RX_OK);
    }
    assert_int_equal(t[0]->n, 3);
    for (int i = 0; i < 3; i++) {
        assert_true(t[0]->list[i].flux == t[1]->list[i].flux);
        assert_true(t[0]->list[i].fluxerr == t[1]->list[i].fluxerr);
        assert_true(t[0]->list[i].evidence == t[1]->list[i].evidence);
    }
    rx_tphot_free(t[0]);
    rx_tphot_free(t[1]);
    field_close(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_scatter_alone),
                                       cmocka_unit_test(test_scatter_of_pairs), cmocka_unit_test(test_white)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
