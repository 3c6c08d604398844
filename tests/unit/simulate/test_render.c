/* Rendered stars and galaxies against the profile integrated by brute force; blocks, threads, PSFs that vary.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "moffat_theory.h"
#include "psf/psf.h"
#include "simulate/render.h"

/* --- scenes --- */

typedef struct field {
    rx_scene scene;
    float *image;
} field;

static void field_open(field *f, int width, int height, long n)
{
    memset(f, 0, sizeof *f);
    f->scene.width = width;
    f->scene.height = height;
    f->scene.n = n;
    f->scene.objects = calloc((size_t)n, sizeof *f->scene.objects);
    f->image = calloc((size_t)width * (size_t)height, sizeof *f->image);
    assert_non_null(f->scene.objects);
    assert_non_null(f->image);
}

static void field_close(field *f)
{
    free(f->scene.objects);
    free(f->image);
}

static void set_star(rx_object *o, double x, double y, double flux)
{
    *o = (rx_object){.type = RX_OBJECT_STAR, .x = x, .y = y, .flux = flux};
}

static void set_disk(rx_object *o, double x, double y, double flux, double radius)
{
    *o = (rx_object){.type = RX_OBJECT_GALAXY,
                     .x = x,
                     .y = y,
                     .flux = flux,
                     .radius = radius,
                     .ratio = 0.6,
                     .angle = 0.4,
                     .disk_radius = radius};
}

static void render(const field *f, const rx_optics *optics, int block, int threads, float *image)
{
    rx_error err = RX_ERROR_NONE;
    rx_status status = rx_render_blocks(&f->scene, 1, &optics, &image, block, threads, &err);
    if (status != RX_OK)
        print_message("%s\n", err.text);
    assert_int_equal(status, RX_OK);
}

static rx_optics *make_moffat(const theory *t, double variation, int width, int height)
{
    rx_error err = RX_ERROR_NONE;
    rx_optics *optics;
    assert_int_equal(rx_optics_moffat(&(rx_moffat_profile){.fwhm = t->fwhm,
                                                           .beta = t->beta,
                                                           .ratio = t->ratio,
                                                           .angle = t->angle,
                                                           .variation = variation},
                                      width, height, &optics, &err),
                     RX_OK);
    return optics;
}

static double image_sum(const field *f)
{
    double sum = 0.0;
    for (long i = 0; i < (long)f->scene.width * f->scene.height; i++)
        sum += (double)f->image[i];
    return sum;
}

static double draw(int seed, int k)
{
    return rx_random_uniform(5, (uint64_t)seed, (uint64_t)k);
}

/* --- one star --- */

/* Every pixel of stars at random places: the Moffat integrated over the pixel, by brute force. The shift and
 * the flux that fit the differences best are the errors of centroid and flux. */
static void test_pixels_of_a_star(void **state)
{
    (void)state;
    const double fwhms[] = {1.0, 2.0, 4.0, 8.0, 14.0}, betas[] = {4.765, 2.5};
    for (int c = 0; c < 10; c++) {
        theory t = {fwhms[c / 2], betas[c % 2], c == 5 ? 0.7 : 1.0, c == 5 ? 0.6 : 0.0};
        rx_optics *o = make_moffat(&t, 0.0, 0, 0);
        double worst = 0.0, worst_shift = 0.0, worst_flux = 0.0;
        for (int trial = 0; trial < 4; trial++) {
            const int side = 41;
            field f;
            field_open(&f, side, side, 1);
            double x = 20.0 + draw(c, 2 * trial) - 0.5, y = 20.0 + draw(c, 2 * trial + 1) - 0.5;
            double peak = theory_box(&t, 0.0, 0.0, 1.0, 30), gx = 0.0, gy = 0.0, g2 = 0.0, m = 0.0, m2 = 0.0;
            set_star(f.scene.objects, x, y, 1.0);
            render(&f, o, RX_RENDER_BLOCK, 1, f.image);
            for (int j = 0; j < side; j++)
                for (int i = 0; i < side; i++) {
                    double want = theory_box(&t, i - x, j - y, 1.0, t.fwhm < 2.0 ? 25 : t.fwhm < 4.0 ? 8 : 4);
                    double by_x = (theory_box(&t, i - x - 0.01, j - y, 1.0, 2) -
                                   theory_box(&t, i - x + 0.01, j - y, 1.0, 2)) /
                                  0.02;
                    double by_y = (theory_box(&t, i - x, j - y - 0.01, 1.0, 2) -
                                   theory_box(&t, i - x, j - y + 0.01, 1.0, 2)) /
                                  0.02;
                    double error = (double)f.image[j * side + i] - want;
                    worst = fmax(worst, fabs(error) / peak);
                    gx += error * by_x, gy += error * by_y, g2 += 0.5 * (by_x * by_x + by_y * by_y);
                    m += error * want, m2 += want * want;
                }
            worst_shift = fmax(worst_shift, hypot(gx, gy) / g2);
            worst_flux = fmax(worst_flux, fabs(m / m2));
            field_close(&f);
        }
        print_message("FWHM %4.1f beta %.3f: pixels to %.1e of the peak, centroid to %.1e px, flux to %.1e\n",
                      t.fwhm, t.beta, worst, worst_shift, worst_flux);
        assert_true(worst < (t.fwhm < 2.0 ? 1e-4 : 3e-5));
        assert_true(worst_shift < 1e-4);
        assert_true(worst_flux < 1e-4);
        rx_optics_free(o);
    }
}

/* All light within reach of the image: 1 - missing; and what falls outside is what falls outside. */
static void test_flux_sum(void **state)
{
    (void)state;
    const double fwhms[] = {2.0, 4.0, 8.0, 14.0}, betas[] = {4.765, 2.5};
    for (int c = 0; c < 8; c++) {
        theory t = {fwhms[c / 2], betas[c % 2], 1.0, 0.0};
        rx_optics *o = make_moffat(&t, 0.0, 0, 0);
        int side = 2 * (o->size / 2 / o->oversampling) + 21;
        field f;
        field_open(&f, side, side, 1);
        set_star(f.scene.objects, side / 2 + draw(9, c), side / 2 - draw(10, c), 1e5);
        render(&f, o, RX_RENDER_BLOCK, 2, f.image);
        assert_true(fabs(image_sum(&f) / 1e5 - (1.0 - o->missing)) < 1e-5);
        assert_true(fabs(image_sum(&f) / 1e5 - 1.0) < 1e-3);
        /* half of it: a star on the left border, light from x = -1/2 on */
        memset(f.image, 0, sizeof(float) * (size_t)side * (size_t)side);
        set_star(f.scene.objects, -0.5, side / 2, 1e5);
        render(&f, o, RX_RENDER_BLOCK, 2, f.image);
        assert_true(fabs(image_sum(&f) / 1e5 - 0.5) < 1e-4);
        field_close(&f);
        rx_optics_free(o);
    }
}

/* A finer picture of the PSF: the same star at dither^2 places, put together. Returns [n][n] samples in steps
 * of 1/dither pixel, the star in the middle. */
static double *dithered(const rx_optics *o, int dither, int side, int *n)
{
    *n = dither * (side - 1) + 1;
    double *fine = calloc((size_t)*n * (size_t)*n, sizeof *fine);
    assert_non_null(fine);
    for (int b = 0; b < dither; b++)
        for (int a = 0; a < dither; a++) {
            field f;
            field_open(&f, side, side, 1);
            /* pixel (i, j) sees the place (i - side/2 + a/dither, ...) of the PSF */
            set_star(f.scene.objects, side / 2 - (double)a / dither, side / 2 - (double)b / dither, 1.0);
            render(&f, o, RX_RENDER_BLOCK, 2, f.image);
            for (int j = 0; j < side; j++)
                for (int i = 0; i < side; i++)
                    if (i * dither + a < *n && j * dither + b < *n)
                        fine[(size_t)(j * dither + b) * (size_t)*n + (size_t)(i * dither + a)] =
                            (double)f.image[j * side + i];
            field_close(&f);
        }
    return fine;
}

/* Diameter at half the central value along x, by interpolation of the logarithm, which is nearly a
 * parabola. */
static double measure_fwhm(const double *fine, int n, int dither)
{
    const double *row = fine + (size_t)(n / 2) * (size_t)n + n / 2;
    int i = 0;
    while (row[i + 1] > 0.5 * row[0])
        i++;
    double a = log(row[i - 1] / row[0]), b = log(row[i] / row[0]), c = log(row[i + 1] / row[0]), u = 0.5;
    for (int k = 0; k < 20; k++) { /* parabola through three points, u from point i */
        double value = b + 0.5 * (c - a) * u + 0.5 * (a - 2.0 * b + c) * u * u + M_LN2;
        u -= value / (0.5 * (c - a) + (a - 2.0 * b + c) * u);
    }
    return 2.0 * (i + u) / dither;
}

/* Along x, where the Moffat integrated over a pixel has half its central value. */
static double theory_pixel_fwhm(const theory *t)
{
    double low = 0.3 * t->fwhm, high = t->fwhm, half = 0.5 * theory_box(t, 0.0, 0.0, 1.0, 60);
    for (int k = 0; k < 40; k++) {
        double middle = 0.5 * (low + high);
        *(theory_box(t, middle, 0.0, 1.0, 60) > half ? &low : &high) = middle;
    }
    return low + high;
}

/* Light within r of the centre; cells that the circle cuts count with the share that is inside. */
static double measure_within(const double *fine, int n, int dither, double r)
{
    double sum = 0.0;
    for (int j = 0; j < n; j++)
        for (int i = 0; i < n; i++) {
            double d = hypot(i - n / 2, j - n / 2) - r * dither, share = d < -1.0 ? 1.0 : 0.0;
            if (fabs(d) <= 1.0)
                for (int k = 0; k < 400; k++)
                    share += hypot(i - n / 2 + (k % 20 + 0.5) / 20 - 0.5,
                                   j - n / 2 + (k / 20 + 0.5) / 20 - 0.5) < r * dither
                                 ? 1.0 / 400
                                 : 0.0;
            sum += share * fine[(size_t)j * (size_t)n + (size_t)i];
        }
    return sum / dither / dither;
}

/* Encircled energy of the Moffat, 1 - (1 + r^2/alpha^2)^(1 - beta), and what the pixel does to it: it moves
 * light by its second moment, 1/12 in each direction, so E becomes E + (2 pi r dI/dr) / 24; its fourth is
 * small from r = FWHM on. */
static double theory_pixel_within(const theory *t, double r)
{
    double h = 1e-3 * t->fwhm,
           slope = (theory_value(t, r + h, 0.0) - theory_value(t, r - h, 0.0)) / (2.0 * h);
    return theory_within(t, r) + 2.0 * M_PI * r * slope / 24.0;
}

static void test_fwhm_and_encircled_energy(void **state)
{
    (void)state;
    const double fwhms[] = {2.0, 4.0, 8.0, 14.0}, betas[] = {4.765, 2.5};
    for (int c = 0; c < 8; c++) {
        theory t = {fwhms[c / 2], betas[c % 2], 1.0, 0.0};
        const int dither = t.fwhm < 3.0 ? 9 : t.fwhm < 6.0 ? 5 : 2;
        const int side = 2 * (int)ceil(2.2 * t.fwhm) + 3;
        rx_optics *o = make_moffat(&t, 0.0, 0, 0);
        int n;
        double *fine = dithered(o, dither, side, &n), fwhm = measure_fwhm(fine, n, dither);
        double worst = 0.0, wanted = theory_pixel_fwhm(&t);
        for (int k = 0; k < 3; k++) {
            double r = (1.0 + 0.5 * k) * t.fwhm;
            worst = fmax(worst, fabs(measure_within(fine, n, dither, r) / theory_pixel_within(&t, r) - 1.0));
        }
        print_message("FWHM %4.1f beta %.3f: in pixels %.5f, theory %.5f; encircled energy to %.1e\n", t.fwhm,
                      t.beta, fwhm, wanted, worst);
        assert_true(fabs(fwhm / wanted - 1.0) < 1e-3);
        assert_true(worst < 1e-3);
        free(fine);
        rx_optics_free(o);
    }
}

/* --- many objects --- */

static void fill_field(field *f, int width, int height)
{
    field_open(f, width, height, 120);
    for (int k = 0; k < 120; k++) {
        double x = (width + 60.0) * draw(20, 3 * k) - 30.0, y = (height + 60.0) * draw(20, 3 * k + 1) - 30.0;
        double flux = 1000.0 * pow(100.0, draw(20, 3 * k + 2));
        if (k % 3)
            set_star(&f->scene.objects[k], x, y, flux);
        else
            set_disk(&f->scene.objects[k], x, y, flux, k == 0 ? 60.0 : 1.0 + 5.0 * draw(21, k));
    }
}

static double worst_difference(const float *a, const float *b, long n, double *peak)
{
    double worst = 0.0;
    *peak = 0.0;
    for (long i = 0; i < n; i++) {
        worst = fmax(worst, fabs((double)a[i] - (double)b[i]));
        *peak = fmax(*peak, fabs((double)a[i]));
    }
    return worst;
}

/* Blocks of any size, oblong tiles, constant and varying optics: the same image to rounding. */
static void test_blocks_add_up(void **state)
{
    (void)state;
    const int blocks[] = {57, 100, 160}, width = 260, height = 190;
    for (int varying = 0; varying < 2; varying++) {
        field f;
        fill_field(&f, width, height);
        float *other = malloc(sizeof(float) * (size_t)width * (size_t)height);
        rx_optics *o = make_moffat(&(theory){3.0, 3.5, 0.8, 0.3}, varying ? 0.2 : 0.0, width, height);
        render(&f, o, RX_RENDER_BLOCK, 1, f.image);
        for (int b = 0; b < 3; b++) {
            double peak;
            memset(other, 0, sizeof(float) * (size_t)width * (size_t)height);
            render(&f, o, blocks[b], 1, other);
            double worst = worst_difference(f.image, other, (long)width * height, &peak);
            assert_true(peak > 1000.0);
            assert_true(worst < (varying ? 4e-6 : 2e-6) * peak);
        }
        free(other);
        rx_optics_free(o);
        field_close(&f);
    }
}

static void test_threads_change_nothing(void **state)
{
    (void)state;
    const int width = 310, height = 207;
    const size_t bytes = sizeof(float) * (size_t)width * (size_t)height;
    rx_error err = RX_ERROR_NONE;
    field f;
    fill_field(&f, width, height);
    rx_optics *o[2] = {make_moffat(&(theory){3.0, 4.765, 1.0, 0.0}, 0.15, width, height), NULL};
    assert_int_equal(rx_optics_gauss(2.0, &o[1], &err), RX_OK);
    float *first[2] = {malloc(bytes), malloc(bytes)}, *again[2] = {malloc(bytes), malloc(bytes)};
    for (int threads = 1; threads <= 3; threads++) {
        float **images = threads == 1 ? first : again;
        for (int i = 0; i < 2; i++)
            memset(images[i], 0, bytes);
        assert_int_equal(
            rx_render_blocks(&f.scene, 2, (const rx_optics *const *)o, images, 128, threads, &err), RX_OK);
        for (int i = 0; i < 2 && threads > 1; i++)
            assert_memory_equal(first[i], again[i], bytes);
    }
    /* each of the two as if it had been alone */
    for (int i = 0; i < 2; i++) {
        double peak;
        memset(again[i], 0, bytes);
        render(&f, o[i], 128, 1, again[i]);
        assert_true(worst_difference(first[i], again[i], (long)width * height, &peak) <= 3e-6 * peak);
        free(first[i]);
        free(again[i]);
        rx_optics_free(o[i]);
    }
    field_close(&f);
}

/* The image is added to, and an empty scene adds nothing. */
static void test_adds(void **state)
{
    (void)state;
    field f;
    rx_optics *o = make_moffat(&(theory){3.0, 4.765, 1.0, 0.0}, 0.0, 0, 0);
    field_open(&f, 32, 32, 1);
    set_star(f.scene.objects, 15.0, 16.0, 100.0);
    for (int i = 0; i < 32 * 32; i++)
        f.image[i] = 7.0f;
    f.scene.n = 0;
    render(&f, o, RX_RENDER_BLOCK, 1, f.image);
    for (int i = 0; i < 32 * 32; i++)
        assert_true(f.image[i] == 7.0f);
    f.scene.n = 1;
    render(&f, o, RX_RENDER_BLOCK, 1, f.image);
    assert_true(fabs(image_sum(&f) - 7.0 * 32 * 32 - 100.0) < 0.1);
    rx_optics_free(o);
    field_close(&f);
}

/* A disk through a Gaussian: flux, centre and second moments add. */
static void test_moments_of_a_galaxy(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    rx_optics *o;
    field f;
    field_open(&f, 201, 201, 1);
    set_disk(f.scene.objects, 100.3, 99.6, 1e5, 3.0);
    f.scene.objects[0].ratio = 1.0;
    assert_int_equal(rx_optics_gauss(4.0, &o, &err), RX_OK);
    render(&f, o, RX_RENDER_BLOCK, 2, f.image);
    double sum = 0.0, x = 0.0, y = 0.0, r2 = 0.0, alone[3] = {0.0};
    for (int j = 0; j < 201; j++)
        for (int i = 0; i < 201; i++) {
            double v = (double)f.image[j * 201 + i];
            sum += v, x += v * i, y += v * j, r2 += v * (pow(i - 100.3, 2) + pow(j - 99.6, 2));
        }
    /* the galaxy by itself on a much finer grid */
    rx_fine_grid grid = {.width = 1401, .height = 1401, .x0 = 30.3, .y0 = 29.6, .step = 0.1, .stride = 1401};
    grid.cells = calloc(1401 * 1401, sizeof *grid.cells);
    assert_int_equal(rx_galaxy_draw(f.scene.objects, &grid, NULL), RX_OK);
    for (int j = 0; j < 1401; j++)
        for (int i = 0; i < 1401; i++) {
            double v = (double)grid.cells[j * 1401 + i];
            alone[0] += v, alone[1] += v * 0.01 * (pow(i - 700, 2) + pow(j - 700, 2));
        }
    double added = 2.0 * (pow(4.0 / 2.354820045, 2) + 1.0 / 12.0);
    assert_true(fabs(sum / 1e5 - 1.0) < 1e-3);
    assert_true(fabs(sum / alone[0] - 1.0) < 1e-3);
    assert_true(hypot(x / sum - 100.3, y / sum - 99.6) < 2e-3);
    assert_true(fabs(r2 / sum / (alone[1] / alone[0] + added) - 1.0) < 3e-3);
    free(grid.cells);
    rx_optics_free(o);
    field_close(&f);
}

/* --- PSFs that vary --- */

/* A star looks as through constant optics of the FWHM of its place. */
static void test_varying_star(void **state)
{
    (void)state;
    const int width = 220, height = 160;
    const double places[][2] = {{109.5, 79.5}, {20.3, 30.7}, {200.2, 12.9}, {60.6, 140.1}};
    theory t = {3.0, 4.765, 1.0, 0.0};
    rx_optics *varying = make_moffat(&t, 0.25, width, height);
    for (int k = 0; k < 4; k++) {
        field f;
        double x = places[k][0], y = places[k][1], peak;
        double s = (pow(x - 109.5, 2) + pow(y - 79.5, 2)) / (109.5 * 109.5 + 79.5 * 79.5);
        theory here = {3.0 * (1.0 + 0.25 * s), 4.765, 1.0, 0.0};
        rx_optics *constant = make_moffat(&here, 0.0, 0, 0);
        float *want = calloc((size_t)width * height, sizeof *want);
        field_open(&f, width, height, 1);
        set_star(f.scene.objects, x, y, 1e4);
        render(&f, varying, 100, 2, f.image);
        render(&f, constant, 100, 2, want);
        double worst = worst_difference(want, f.image, (long)width * height, &peak);
        assert_true(worst < 2e-4 * peak);
        free(want);
        rx_optics_free(constant);
        field_close(&f);
    }
    rx_optics_free(varying);
}

/* PSFEx's model of a real exposure: in the middle of a pixel as rx_psf_at() has it, in between as its sinc
 * interpolation, off the tile's border as on it. */
static void test_psfex_model(void **state)
{
    (void)state;
    const char *shared = getenv("RX_SHARED_DATA");
    char name[4096];
    snprintf(name, sizeof name, "%s/psfex/c4d_140818_002108_ooi_z_v1.ext27.psf",
             shared != NULL ? shared : "");
    FILE *file = shared != NULL ? fopen(name, "rb") : NULL;
    if (file == NULL) {
        print_message("no RX_SHARED_DATA with a PSFEx model: not tested\n");
        skip();
    }
    fclose(file);
    const int width = 2046, height = 600;
    rx_error err = RX_ERROR_NONE;
    rx_psf *psf;
    rx_optics *o;
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = name}, width, height, NULL, &psf, &err), RX_OK);
    assert_int_equal(rx_optics_psf(psf, &o, &err), RX_OK);
    assert_true(psf->nbasis > 1);
    const double stars[][2] = {
        {100.0, 100.0}, {1900.0, 80.0}, {1024.0, 301.0}, {700.4, 450.7}, {1500.25, 333.5}};
    field f;
    field_open(&f, width, height, 5);
    for (int k = 0; k < 5; k++)
        set_star(&f.scene.objects[k], stars[k][0], stars[k][1], 1000.0);
    render(&f, o, RX_RENDER_BLOCK, 2, f.image);
    const int size = psf->size, half = size / 2;
    float *stamp = malloc(sizeof(float) * (size_t)size * (size_t)size);
    for (int k = 0; k < 5; k++) {
        double worst = 0.0, x = stars[k][0], y = stars[k][1];
        rx_psf_at(psf, x, y, stamp);
        double peak = (double)stamp[half * size + half];
        for (int j = -half; j <= half; j++)
            for (int i = -half; i <= half; i++) {
                double want = 0.0, dx = floor(x + 0.5) + i - x, dy = floor(y + 0.5) + j - y;
                for (int b = 0; b < size; b++)
                    for (int a = 0; a < size; a++) {
                        double u = dx - (a - half), v = dy - (b - half);
                        want += (double)stamp[b * size + a] * (u == 0.0 ? 1.0 : sin(M_PI * u) / (M_PI * u)) *
                                (v == 0.0 ? 1.0 : sin(M_PI * v) / (M_PI * v));
                    }
                double got =
                    (double)f.image[(int)(floor(y + 0.5) + j) * width + (int)(floor(x + 0.5) + i)] / 1000.0;
                worst = fmax(worst, fabs(got - want) / peak);
            }
        print_message("PSFEx star %d: within %.1e of the peak\n", k, worst);
        assert_true(worst < 1e-4);
    }
    free(stamp);
    field_close(&f);
    rx_optics_free(o);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pixels_of_a_star),
        cmocka_unit_test(test_flux_sum),
        cmocka_unit_test(test_fwhm_and_encircled_energy),
        cmocka_unit_test(test_blocks_add_up),
        cmocka_unit_test(test_threads_change_nothing),
        cmocka_unit_test(test_adds),
        cmocka_unit_test(test_moments_of_a_galaxy),
        cmocka_unit_test(test_varying_star),
        cmocka_unit_test(test_psfex_model),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
