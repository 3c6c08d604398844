/* PSFs from files: the real PSFEx models evaluated independently here, images made on the spot. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "../near.h"
#include "../scratch.h"
#include "data/table.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "psf/psf.h"
#include "psf/psf_psfex.h"
#include "psf/resample.h"

/* --- small FITS files, written byte by byte ------------------------------------------------- */

static void put_block(FILE *file, char (*cards)[81], int n)
{
    for (int i = 0; i < 36 * ((n + 36) / 36); i++)
        fprintf(file, "%-80s", i < n ? cards[i] : i == n ? "END" : "");
}

static void put_floats(FILE *file, const float *values, long n)
{
    long bytes = 0;
    for (long i = 0; i < n; i++, bytes += 4) {
        uint32_t u;
        memcpy(&u, &values[i], 4);
        for (int shift = 24; shift >= 0; shift -= 8)
            fputc((int)(u >> shift & 255U), file);
    }
    for (; bytes % 2880 != 0; bytes++)
        fputc(0, file);
}

static void write_image(const char *path, const float *pixels, int width, int height)
{
    char cards[5][81];
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    snprintf(cards[0], 81, "%-8s= %20s", "SIMPLE", "T");
    snprintf(cards[1], 81, "%-8s= %20d", "BITPIX", -32);
    snprintf(cards[2], 81, "%-8s= %20d", "NAXIS", 2);
    snprintf(cards[3], 81, "%-8s= %20d", "NAXIS1", width);
    snprintf(cards[4], 81, "%-8s= %20d", "NAXIS2", height);
    put_block(file, cards, 5);
    put_floats(file, pixels, (long)width * height);
    assert_int_equal(fclose(file), 0);
}

typedef struct psfex_spec {
    int polnaxis, groups, degree, side, terms;
    const char *name1, *name2;
    double zero, scale, sampling;
} psfex_spec;

static int merged; /* PSF_SAMP is a column, as in tables that hold many models */

/* One more table at the end of the file. */
static void append_psfex(const char *path, const psfex_spec *s, const float *mask)
{
    char c[40][81];
    long n = (long)s->side * s->side * s->terms;
    FILE *file = fopen(path, "ab");
    assert_non_null(file);
    int k = 0;
    snprintf(c[k++], 81, "%-8s= %-20s", "XTENSION", "'BINTABLE'");
    snprintf(c[k++], 81, "%-8s= %20d", "BITPIX", 8);
    snprintf(c[k++], 81, "%-8s= %20d", "NAXIS", 2);
    snprintf(c[k++], 81, "%-8s= %20ld", "NAXIS1", 4 * n + 4 * merged);
    snprintf(c[k++], 81, "%-8s= %20d", "NAXIS2", 1);
    snprintf(c[k++], 81, "%-8s= %20d", "PCOUNT", 0);
    snprintf(c[k++], 81, "%-8s= %20d", "GCOUNT", 1);
    snprintf(c[k++], 81, "%-8s= %20d", "TFIELDS", 1 + merged);
    snprintf(c[k++], 81, "%-8s= %-20s", "TTYPE1", "'PSF_MASK'");
    snprintf(c[k++], 81, "%-8s= '%ldE'", "TFORM1", n);
    snprintf(c[k++], 81, "%-8s= '(%d,%d,%d)'", "TDIM1", s->side, s->side, s->terms);
    snprintf(c[k++], 81, "%-8s= %20d", "POLNAXIS", s->polnaxis);
    snprintf(c[k++], 81, "%-8s= '%s'", "POLNAME1", s->name1);
    snprintf(c[k++], 81, "%-8s= '%s'", "POLNAME2", s->name2);
    snprintf(c[k++], 81, "%-8s= %20.6f", "POLZERO1", s->zero);
    snprintf(c[k++], 81, "%-8s= %20.6f", "POLSCAL1", s->scale);
    snprintf(c[k++], 81, "%-8s= %20.6f", "POLZERO2", s->zero);
    snprintf(c[k++], 81, "%-8s= %20.6f", "POLSCAL2", s->scale);
    snprintf(c[k++], 81, "%-8s= %20d", "POLNGRP", s->groups);
    snprintf(c[k++], 81, "%-8s= %20d", "POLDEG1", s->degree);
    if (merged) {
        snprintf(c[k++], 81, "%-8s= %-20s", "TTYPE2", "'PSF_SAMP'");
        snprintf(c[k++], 81, "%-8s= '1E'", "TFORM2");
    } else {
        snprintf(c[k++], 81, "%-8s= %20.6f", "PSF_SAMP", s->sampling);
    }
    snprintf(c[k++], 81, "%-8s= %20d", "PSFNAXIS", 3);
    snprintf(c[k++], 81, "%-8s= %20d", "PSFAXIS1", s->side);
    snprintf(c[k++], 81, "%-8s= %20d", "PSFAXIS2", s->side);
    snprintf(c[k++], 81, "%-8s= %20d", "PSFAXIS3", s->terms);
    put_block(file, c, k);
    float *row = malloc(sizeof *row * (size_t)(n + 1));
    assert_non_null(row);
    memcpy(row, mask, sizeof *row * (size_t)n);
    row[n] = (float)s->sampling;
    put_floats(file, row, n + merged);
    free(row);
    assert_int_equal(fclose(file), 0);
}

static void write_psfex(const char *path, const psfex_spec *s, const float *mask)
{
    char c[3][81];
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    snprintf(c[0], 81, "%-8s= %20s", "SIMPLE", "T");
    snprintf(c[1], 81, "%-8s= %20d", "BITPIX", 8);
    snprintf(c[2], 81, "%-8s= %20d", "NAXIS", 0);
    put_block(file, c, 3);
    assert_int_equal(fclose(file), 0);
    append_psfex(path, s, mask);
}

/* A Gaussian of sigma 1.7 around (cx, cy), on width x height pixels. */
static void gaussian(float *pixels, int width, int height, double cx, double cy, double scale)
{
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++)
            pixels[j * width + i] =
                (float)(scale * exp(-0.5 * ((i - cx) * (i - cx) + (j - cy) * (j - cy)) / (1.7 * 1.7)));
}

static double stamp_sum(const float *stamp, int size)
{
    double sum = 0.0;
    for (int i = 0; i < size * size; i++)
        sum += (double)stamp[i];
    return sum;
}

static void centroid(const rx_psf *psf, double *x, double *y)
{
    *x = *y = 0.0;
    for (int i = 0; i < psf->size * psf->size; i++) {
        *x += (double)psf->basis[i] * (i % psf->size - psf->size / 2);
        *y += (double)psf->basis[i] * (i / psf->size - psf->size / 2);
    }
}

/* --- FILE ----------------------------------------------------------------------------------- */

/* Odd, even and oblong frames, with the light off the frame's centre by a known step: what comes out
 * is odd, sums to 1, is a Gaussian of the same width, and its centroid is off by that same step. */
static void test_image_sizes(void **state)
{
    (void)state;
    const int sizes[][2] = {{25, 25}, {24, 24}, {25, 24}, {24, 31}, {40, 21}};
    static float pixels[64 * 64];
    for (size_t k = 0; k < 5; k++) {
        int w = sizes[k][0], h = sizes[k][1];
        rx_psf *psf;
        gaussian(pixels, w, h, 0.5 * (w - 1) + 0.1, 0.5 * (h - 1) - 0.2, 300.0);
        write_image("psf.fits", pixels, w, h);
        assert_int_equal(rx_psf_file(&(rx_psf_params){.file = "psf.fits"}, 100, 80, NULL, &psf, NULL), RX_OK);
        assert_true(psf->size % 2 == 1);
        assert_true(psf->size >= (w > h ? w : h));
        assert_near(stamp_sum(psf->basis, psf->size), 1.0, 1e-6);
        double x, y, worst = 0.0;
        centroid(psf, &x, &y);
        assert_near(x, 0.1, 0.0005);
        assert_near(y, -0.2, 0.001);
        for (int i = 0; i < psf->size * psf->size; i++) {
            double dx = i % psf->size - psf->size / 2 - 0.1, dy = i / psf->size - psf->size / 2 + 0.2;
            double want = exp(-0.5 * (dx * dx + dy * dy) / 2.89) / (2.0 * M_PI * 2.89);
            worst = fmax(worst, fabs(want - (double)psf->basis[i]));
        }
        assert_true(worst < 1e-3 / (2.0 * M_PI * 2.89)); /* of the peak */
        assert_near(psf->fwhm, 1.7 * 2.3548, 0.1);
        assert_true(psf->ellipticity < 0.01);
        rx_psf_free(psf);
    }
}

static void test_image_cut_to_size(void **state)
{
    (void)state;
    static float pixels[64 * 64];
    rx_psf *psf;
    gaussian(pixels, 60, 60, 29.5, 29.5, 1.0);
    write_image("psf.fits", pixels, 60, 60);
    assert_int_equal(rx_psf_file(&(rx_psf_params){.file = "psf.fits", .size = 15}, 50, 50, NULL, &psf, NULL),
                     RX_OK);
    assert_int_equal(psf->size, 15);
    assert_near(stamp_sum(psf->basis, 15), 1.0, 1e-6);
    rx_psf_free(psf);
    /* an even PSF as large as the tile loses half a pixel on each side instead of outgrowing it */
    assert_int_equal(rx_psf_file(&(rx_psf_params){.file = "psf.fits"}, 60, 60, NULL, &psf, NULL), RX_OK);
    assert_int_equal(psf->size, 59);
    rx_psf_free(psf);
}

static void refuse_image(const float *pixels, int w, int h, const char *what)
{
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    write_image("psf.fits", pixels, w, h);
    assert_int_equal(rx_psf_file(&(rx_psf_params){.file = "psf.fits"}, 50, 40, NULL, &psf, &err), RX_INPUT);
    assert_null(psf);
    assert_non_null(strstr(err.where, "psf.fits"));
    if (strstr(err.text, what) == NULL)
        fail_msg("'%s' does not say '%s'", err.text, what);
}

static void test_image_refused(void **state)
{
    (void)state;
    static float pixels[64 * 64];
    gaussian(pixels, 41, 41, 20, 20, 1.0);
    refuse_image(pixels, 41, 41, "larger than the tile");
    static float line[5001];
    refuse_image(line, 5001, 1, "larger than 4095");
    gaussian(pixels, 21, 21, 10, 10, 1.0);
    pixels[3] = NAN;
    refuse_image(pixels, 21, 21, "pixel (4,1)");
    pixels[2 * 21 + 3] = NAN;
    pixels[3] = 0.0F;
    refuse_image(pixels, 21, 21, "pixel (4,3)");
    gaussian(pixels, 21, 21, 10, 10, -1.0);
    refuse_image(pixels, 21, 21, "sums to");
    memset(pixels, 0, sizeof pixels);
    refuse_image(pixels, 21, 21, "sums to 0");
}

/* As large as the tile, and no larger; PSF_SIZE cuts what is larger. */
static void test_sizes(void **state)
{
    (void)state;
    static float pixels[64 * 64];
    gaussian(pixels, 41, 41, 20.0, 20.0, 1.0);
    write_image("psf.fits", pixels, 41, 41);
    static const int cases[][4] = {{41, 41, 0, 41},  {40, 41, 0, -1},  {41, 40, 0, -1}, {25, 33, 25, 25},
                                   {33, 25, 25, 25}, {33, 24, 25, -1}, {50, 50, 63, 41}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const rx_image image = {.width = cases[k][0], .height = cases[k][1]};
        const rx_psf_params par = {.type = RX_PSF_FILE, .file = "psf.fits", .size = cases[k][2]};
        rx_psf *psf;
        const rx_status status = rx_psf_make(&par, &image, NULL, NULL, &psf, NULL);
        assert_int_equal(status, cases[k][3] < 0 ? RX_INPUT : RX_OK);
        if (status == RX_OK)
            assert_int_equal(psf->size, cases[k][3]);
        rx_psf_free(psf);
    }
    gaussian(pixels, 60, 60, 29.5, 29.5, 1.0); /* even: one more where the tile has room, else one less */
    write_image("psf.fits", pixels, 60, 60);
    for (int width = 60; width < 63; width++) {
        rx_psf *psf;
        assert_int_equal(rx_psf_file(&(rx_psf_params){.file = "psf.fits"}, width, 62, NULL, &psf, NULL),
                         RX_OK);
        assert_int_equal(psf->size, width < 61 ? 59 : 61);
        rx_psf_free(psf);
        assert_int_equal(rx_psf_file(&(rx_psf_params){.file = "psf.fits"}, 62, width, NULL, &psf, NULL),
                         RX_OK);
        assert_int_equal(psf->size, width < 61 ? 59 : 61);
        rx_psf_free(psf);
    }
    assert_int_equal(rx_psf_check_size("", 4095, 4095, 5000, 5000, NULL), RX_OK);
    assert_int_equal(rx_psf_check_size("", 4096, 1, 5000, 5000, NULL), RX_INPUT);
    assert_int_equal(rx_psf_check_size("", 1, 4096, 5000, 5000, NULL), RX_INPUT);
}

/* The PSF, and what is said while it is made. */
static rx_psf *read_aloud(rx_psf_type type, const char *name, char *text, size_t room)
{
    const rx_image image = {.width = 100, .height = 100};
    const rx_psf_params par = {.type = type, .file = name};
    rx_log log;
    rx_psf *psf;
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log_init(&log, "test", stream, RX_NORMAL);
    assert_int_equal(rx_psf_make(&par, &image, NULL, &log, &psf, NULL), RX_OK);
    rewind(stream);
    text[fread(text, 1, room - 1, stream)] = '\0';
    fclose(stream);
    return psf;
}

/* Light off the frame's centre by more than 0.3 pixels, as far as it is above a fifth of the peak. */
static void test_light_off_centre_is_told(void **state)
{
    (void)state;
    static const double places[][2] = {{0.1, -0.2}, {0.25, 0.1}, {0.25, -0.25}, {0.0, 0.4}, {8.0, -6.0}};
    static float pixels[31 * 31];
    for (size_t k = 0; k < sizeof places / sizeof *places; k++) {
        char text[1000], said[60];
        gaussian(pixels, 31, 31, 15.0 + places[k][0], 15.0 + places[k][1], 1.0);
        write_image("psf.fits", pixels, 31, 31);
        rx_psf *psf = read_aloud(RX_PSF_FILE, "psf.fits", text, sizeof text);
        double peak = 0.0, sum = 0.0, x = 0.0, y = 0.0;
        for (int i = 0; i < 31 * 31; i++)
            peak = fmax(peak, (double)psf->basis[i]);
        for (int i = 0; i < 31 * 31; i++) {
            const double v = (double)psf->basis[i] >= 0.2 * peak ? (double)psf->basis[i] : 0.0;
            sum += v;
            x += v * (i % 31 - 15);
            y += v * (i / 31 - 15);
        }
        snprintf(said, sizeof said, "(%+.2f, %+.2f) pixels off", x / sum, y / sum);
        if ((strstr(text, said) != NULL) != (hypot(x, y) > 0.3 * sum))
            fail_msg("'%s' is said of %s", text, said);
        rx_psf_free(psf);
    }
}

/* --- PSFEX ---------------------------------------------------------------------------------- */

static double lanczos(double d, int order)
{
    double u = M_PI * d;
    return fabs(d) < 1e-9 ? 1.0 : fabs(d) < order ? sin(u) / u * sin(u / order) / (u / order) : 0.0;
}

/* Interpolation with the kernel's sum taken out, by direct summation over the whole image. */
static double interpolate(const double *image, int w, int h, double x, double y, int order)
{
    double value = 0.0, norm = 0.0;
    for (int q = -2 * order; q < h + 2 * order; q++)
        for (int p = -2 * order; p < w + 2 * order; p++) {
            double weight = lanczos(x - p, order) * lanczos(y - q, order);
            norm += weight;
            if (p >= 0 && p < w && q >= 0 && q < h)
                value += weight * image[q * w + p];
        }
    return value / norm;
}

/* The model of `file` at a FITS position, straight from the table, normalised, on size x size tile pixels. */
static void reference(const char *file, double xf, double yf, int size, double *stamp)
{
    rx_table *t;
    double zero[2] = {0, 0}, scale[2] = {1, 1}, sampling, axis[2], degree = 0.0, sum = 0.0;
    assert_int_equal(rx_fits_read_table(file, 0, &t, NULL), RX_OK);
    const char *keys[] = {"POLZERO1", "POLZERO2", "POLSCAL1", "POLSCAL2",
                          "POLDEG1",  "PSF_SAMP", "PSFAXIS1", "PSFAXIS2"};
    double *to[] = {&zero[0], &zero[1], &scale[0], &scale[1], &degree, &sampling, &axis[0], &axis[1]};
    for (int i = 0; i < 8; i++)
        if (!rx_cards_number(t->cards, t->ncards, keys[i], to[i]) && rx_table_find(t, keys[i]) >= 0)
            *to[i] = rx_column_value(&t->columns[rx_table_find(t, keys[i])], 0, 0);
    const rx_column *mask = &t->columns[rx_table_find(t, "PSF_MASK")];
    int w = (int)axis[0], h = (int)axis[1], d = (int)degree, term = 0;
    double x = (xf - zero[0]) / scale[0], y = (yf - zero[1]) / scale[1];
    double *model = calloc((size_t)w * (size_t)h, sizeof *model);
    assert_non_null(model);
    for (int b = 0; b <= d; b++)
        for (int a = 0; a + b <= d; a++, term++)
            for (int i = 0; i < w * h; i++)
                model[i] += pow(x, a) * pow(y, b) * rx_column_value(mask, 0, (long)term * w * h + i);
    for (int i = 0; i < size * size; i++) {
        stamp[i] = interpolate(model, w, h, w / 2 + (i % size - size / 2) / sampling,
                               h / 2 + (i / size - size / 2) / sampling, 4);
        sum += stamp[i];
    }
    for (int i = 0; i < size * size; i++)
        stamp[i] /= sum;
    free(model);
    rx_table_free(t);
}

static void test_resample(void **state)
{
    (void)state;
    enum { WIDTH = 9, HEIGHT = 7, SIZE = 13 };
    static const double cases[][4] = {/* step, centre, order */
                                      {1.0, 4.0, 3.0, 12},
                                      {1.0, 4.0, 3.5, 12},
                                      {1.25, 4.3, 2.8, 4},
                                      {0.4, 4.0, 3.0, 4}};
    float pixels[WIDTH * HEIGHT];
    double image[WIDTH * HEIGHT], dst[SIZE * SIZE];
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        image[i] = (double)(pixels[i] = (float)((i * 37 % 23) - 4));
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        const double *c = cases[k];
        const rx_psf_raster src = {
            .pixels = pixels, .width = WIDTH, .height = HEIGHT, .centre_x = c[1], .centre_y = c[2]};
        assert_int_equal(rx_psf_resample(&src, c[0], (int)c[3], dst, SIZE, NULL), RX_OK);
        for (int i = 0; i < SIZE * SIZE; i++)
            assert_near(dst[i],
                        interpolate(image, WIDTH, HEIGHT, c[1] + (i % SIZE - SIZE / 2) * c[0],
                                    c[2] + (i / SIZE - SIZE / 2) * c[0], (int)c[3]),
                        1e-11);
    }
}

/* A box of a whole number of pixels is binning, where it begins and ends between pixels. */
static void test_box(void **state)
{
    (void)state;
    enum { BINS = 5 };
    static float pixels[36 * 36];
    static double dst[BINS * BINS];
    for (int step = 2; step <= 5; step++) {
        const int side = step * (BINS + 2);
        for (int i = 0; i < side * side; i++)
            pixels[i] = (float)((i * 37 % 23) - 4);
        const rx_psf_raster src = {.pixels = pixels,
                                   .width = side,
                                   .height = side,
                                   .centre_x = 0.5 * (side - 1),
                                   .centre_y = 0.5 * (side - 1),
                                   .box = step};
        assert_int_equal(rx_psf_resample(&src, step, RX_LANCZOS_MAX, dst, BINS, NULL), RX_OK);
        for (int i = 0; i < BINS * BINS; i++) {
            double sum = 0.0;
            for (int k = 0; k < step * step; k++)
                sum += (double)
                    pixels[((1 + i / BINS) * step + k / step) * side + (1 + i % BINS) * step + k % step];
            assert_near(dst[i], sum / (step * step), 1e-10);
        }
    }
}

static void compare_model(const char *file, int width, int height, double tolerance)
{
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    if (rx_psf_psfex(&(rx_psf_params){.file = file}, width, height, NULL, &psf, &err) != RX_OK)
        fail_msg("%s: %s", file, err.text);
    float *stamp = malloc(sizeof *stamp * (size_t)psf->size * (size_t)psf->size);
    double *want = malloc(sizeof *want * (size_t)psf->size * (size_t)psf->size);
    assert_non_null(stamp);
    assert_non_null(want);
    const double at[5][2] = {{0.5, 0.5}, {0.0, 0.0}, {1.0, 0.1}, {0.3, 0.8}, {1.0, 1.0}};
    for (int k = 0; k < 5; k++) {
        double x = at[k][0] * (width - 1), y = at[k][1] * (height - 1), worst = 0.0, peak = 0.0;
        rx_psf_at(psf, x, y, stamp);
        assert_near(stamp_sum(stamp, psf->size), 1.0, 1e-5);
        reference(file, x + 1.0, y + 1.0, psf->size, want);
        for (int i = 0; i < psf->size * psf->size; i++) {
            peak = fmax(peak, want[i]);
            worst = fmax(worst, fabs(want[i] - (double)stamp[i]));
        }
        if (!(worst < tolerance * peak))
            fail_msg("%s at (%g,%g): off by %g of the peak", file, x, y, worst / peak);
    }
    assert_between(psf->fwhm, 1.0, 10.0);
    double fwhm, ellipticity; /* of the model in the middle of the tile */
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), stamp);
    assert_int_equal(rx_psf_shape(stamp, psf->size, &fwhm, &ellipticity, NULL, NULL), RX_OK);
    assert_near(psf->fwhm, fwhm, 0.0);
    assert_near(psf->ellipticity, ellipticity, 0.0);
    free(stamp);
    free(want);
    rx_psf_free(psf);
}

static void test_real_models(void **state)
{
    (void)state;
    const char *data = getenv("RX_SHARED_DATA");
    const struct {
        const char *name;
        int width, height;
    } files[] = {{"psfex/decam-520206-S16-psfex.fits", 2046, 4094},
                 {"psfex/psfex-decam-00392360-S31.fits", 2046, 4094},
                 {"psfex/c4d_140818_002108_ooi_z_v1.ext27.psf", 2046, 4094},
                 {"sextractor/default.psf", 1024, 1024},
                 {"decam/c4d_171113_060340_ooi_r_ls9-psfex.fits", 280, 375}};
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char path[1024];
        snprintf(path, sizeof path, "%s/%s", data != NULL ? data : "", files[i].name);
        if (data == NULL || access(path, R_OK) != 0) {
            print_message("no real PSFEx models in RX_SHARED_DATA: skipped\n");
            skip();
        }
        compare_model(path, files[i].width, files[i].height, 2e-4);
    }
    /* psfex's POLSCAL is the range of the stars over the tile; so is ours */
    char path[1024];
    rx_table *table, *own;
    rx_text cards = {0};
    rx_psf *psf;
    snprintf(path, sizeof path, "%s/%s", data, files[2].name);
    assert_int_equal(
        rx_psf_psfex(&(rx_psf_params){.file = path}, files[2].width, files[2].height, NULL, &psf, NULL),
        RX_OK);
    assert_int_equal(rx_psf_psfex_table(psf, &own, &cards, NULL), RX_OK);
    assert_int_equal(rx_fits_read_table(path, 0, &table, NULL), RX_OK);
    for (int axis = 0; axis < 2; axis++) {
        const char *key = axis == 0 ? "POLSCAL1" : "POLSCAL2";
        double theirs, ours;
        assert_int_equal(rx_cards_number(table->cards, table->ncards, key, &theirs), 1);
        assert_int_equal(rx_cards_number(cards.data, (long)cards.length / 80, key, &ours), 1);
        assert_near(ours / theirs, 1.0, 0.05);
    }
    rx_table_free(table);
    rx_table_free(own);
    rx_text_free(&cards);
    rx_psf_free(psf);
}

/* Oversampled twice, linear in x and y, terms that do not sum to zero. */
static void test_made_model(void **state)
{
    (void)state;
    enum { SIDE = 41 };
    static float mask[3 * SIDE * SIDE];
    for (int t = 0; t < 3; t++) {
        gaussian(mask + t * SIDE * SIDE, SIDE, SIDE, 20 + 0.3 * t, 20 - 0.5 * t, t == 0 ? 1.0 : 0.05 * t);
    }
    psfex_spec spec = {2, 1, 1, SIDE, 3, "X_IMAGE", "Y_IMAGE", 50.0, 100.0, 0.8};
    write_psfex("model.psf", &spec, mask);
    compare_model("model.psf", 100, 100, 1e-4);
    spec.degree = 0;
    spec.terms = 1;
    write_psfex("model.psf", &spec, mask);
    compare_model("model.psf", 100, 100, 1e-6);
    spec.polnaxis = 0;
    write_psfex("model.psf", &spec, mask);
    compare_model("model.psf", 100, 100, 1e-6);
    /* terms that sum to zero: nothing to normalise, the model itself comes out, however much it varies */
    for (int t = 1; t < 3; t++) {
        static float middle[SIDE * SIDE];
        gaussian(middle, SIDE, SIDE, 20, 20, 1.0);
        gaussian(mask + t * SIDE * SIDE, SIDE, SIDE, 20 + 0.6 * t, 20 - t, 1.0);
        for (int i = 0; i < SIDE * SIDE; i++)
            mask[t * SIDE * SIDE + i] -= middle[i];
    }
    spec = (psfex_spec){2, 1, 1, SIDE, 3, "X_IMAGE", "Y_IMAGE", 30.0, 70.0, 0.8};
    write_psfex("model.psf", &spec, mask);
    compare_model("model.psf", 100, 100, 2e-5);
    spec = (psfex_spec){1, 1, 2, SIDE, 3, "XWIN_IMAGE", "", 50.0, 100.0, 0.8};
    write_psfex("model.psf", &spec, mask);
    rx_psf *across;
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &across, NULL),
                     RX_OK);
    assert_int_equal(across->nbasis, 3);
    assert_int_equal(across->px[2], 2);
    assert_int_equal(across->py[2], 0);
    assert_non_null(strstr(across->description, "degree 2"));
    rx_psf_free(across);
    /* one variable only: y */
    spec = (psfex_spec){1, 1, 2, SIDE, 3, "YWIN_IMAGE", "", 50.0, 100.0, 0.8};
    write_psfex("model.psf", &spec, mask);
    rx_psf *psf;
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &psf, NULL), RX_OK);
    assert_int_equal(psf->nbasis, 3);
    assert_int_equal(psf->px[2], 0);
    assert_int_equal(psf->py[2], 2);
    rx_psf_free(psf);
}

/* A .psf of a multi-extension catalogue has a model for each image; where there is none, the first serves. */
static void test_psfex_of_each_extension(void **state)
{
    (void)state;
    enum { SIDE = 41 };
    static float narrow[SIDE * SIDE], wide[SIDE * SIDE];
    static const double sigma[3] = {2.0, 3.0, 2.0}; /* of extension 1, 2, 3 */
    for (int i = 0; i < SIDE * SIDE; i++) {
        double r2 = pow(i % SIDE - 20, 2) + pow(i / SIDE - 20, 2);
        narrow[i] = (float)exp(-0.5 * r2 / 4.0);
        wide[i] = (float)exp(-0.5 * r2 / 9.0);
    }
    psfex_spec spec = {2, 1, 0, SIDE, 1, "X_IMAGE", "Y_IMAGE", 50.0, 100.0, 1.0};
    write_psfex("model.psf", &spec, narrow);
    append_psfex("model.psf", &spec, wide);
    for (int extension = 1; extension <= 3; extension++) {
        rx_psf *psf;
        const rx_image image = {.width = 100, .height = 100};
        const rx_psf_params par = {.type = RX_PSF_PSFEX,
                                   .file = "model.psf",
                                   .extension = extension,
                                   .size = extension == 2 ? 21 : 0};
        assert_int_equal(rx_psf_make(&par, &image, NULL, NULL, &psf, NULL), RX_OK);
        assert_int_equal(psf->size, extension == 2 ? 21 : SIDE);
        int n = psf->size;
        float centre = psf->basis[n / 2 * n + n / 2], next = psf->basis[n / 2 * n + n / 2 + 1];
        double found = sqrt(-0.5 / log((double)next / (double)centre));
        assert_near(found, sigma[extension - 1], 0.01);
        rx_psf_free(psf);
    }
}

/* A tile that reaches beyond the range of the model's stars by more than half of it is told. */
static void test_extrapolation_is_told(void **state)
{
    (void)state;
    enum { SIDE = 41 };
    static float mask[3 * SIDE * SIDE];
    static const double zero[] = {50.0, 80.0, 20.0, 50.0}, scale[] = {100.0, 60.0, 60.0, 20.0};
    for (int t = 0; t < 3; t++)
        gaussian(mask + t * SIDE * SIDE, SIDE, SIDE, 20, 20, t == 0 ? 1.0 : 0.01);
    for (int k = 0; k < 4; k++) {
        const psfex_spec spec = {2, 1, 1, SIDE, 3, "X_IMAGE", "Y_IMAGE", zero[k], scale[k], 0.8};
        char text[1000], said[80];
        write_psfex("model.psf", &spec, mask);
        rx_psf_free(read_aloud(RX_PSF_PSFEX, "model.psf", text, sizeof text));
        /* pixels are 0.5 to 100.5 */
        const double beyond = fmax(zero[k] - 0.5, 100.5 - zero[k]) / scale[k] - 0.5;
        snprintf(said, sizeof said, "reaches %.1f times", beyond);
        if ((strstr(text, said) != NULL) != (beyond > 0.5))
            fail_msg("'%s' is said of %g", text, beyond);
    }
}

static void write_model(const rx_psf *psf)
{
    rx_table *table;
    rx_text cards = {0};
    rx_fits_writer *writer;
    assert_int_equal(rx_psf_psfex_table(psf, &table, &cards, NULL), RX_OK);
    unlink("model.psf");
    assert_int_equal(rx_fits_create("model.psf", "model.psf", &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_table(writer, table, &cards, NULL), RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    rx_table_free(table);
    rx_text_free(&cards);
}

/* A model that we write says the range of its tile as psfex does: read for a tile of the same size it is not warned of, and
 * is the same. */
static void test_own_range(void **state)
{
    (void)state;
    enum { SIDE = 21, LENGTH = 100 };
    static const double at[][2] = {{0, 0}, {37, 61}, {99, 99}};
    float one[SIDE * SIDE], two[SIDE * SIDE];
    char text[1000];
    double scale;
    rx_table *table;
    rx_psf *psf = rx_psf_new(RX_PSF_AUTO, SIDE, 3), *back;
    assert_non_null(psf);
    psf->x0 = psf->y0 = psf->xs = psf->ys = 0.5 * (LENGTH - 1);
    psf->px[1] = psf->py[1] = psf->px[2] = 1;
    gaussian(psf->basis, SIDE, SIDE, 10, 10, 1.0);
    for (int t = 1; t < 3; t++) {
        gaussian(psf->basis + t * SIDE * SIDE, SIDE, SIDE, 10 + 0.1 * t, 10 - 0.2 * t, 1.0);
        for (int i = 0; i < SIDE * SIDE; i++)
            psf->basis[t * SIDE * SIDE + i] -= psf->basis[i];
    }
    psf->fwhm = 4.0;
    write_model(psf);
    assert_int_equal(rx_fits_read_table("model.psf", 0, &table, NULL), RX_OK);
    assert_int_equal(rx_cards_number(table->cards, table->ncards, "POLSCAL1", &scale), 1);
    assert_near(scale, LENGTH - 1, 1e-9);
    rx_table_free(table);
    back = read_aloud(RX_PSF_PSFEX, "model.psf", text, sizeof text);
    assert_null(strstr(text, "beyond"));
    for (int k = 0; k < 3; k++) {
        double sum = 0.0;
        rx_psf_at(psf, at[k][0], at[k][1], one);
        rx_psf_at(back, at[k][0], at[k][1], two);
        for (int i = 0; i < SIDE * SIDE; i++)
            sum += (double)one[i];
        for (int i = 0; i < SIDE * SIDE; i++)
            assert_near(two[i], (double)one[i] / sum, 1e-6);
    }
    rx_psf_free(psf);
    rx_psf_free(back);
}

static void refuse_model(const psfex_spec *spec, const float *mask, const char *what)
{
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    write_psfex("model.psf", spec, mask);
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &psf, &err),
                     RX_INPUT);
    assert_null(psf);
    assert_non_null(strstr(err.where, "model.psf"));
    if (strstr(err.text, what) == NULL)
        fail_msg("'%s' does not say '%s'", err.text, what);
}

static void test_model_refused(void **state)
{
    (void)state;
    enum { SIDE = 41 };
    static float mask[3 * SIDE * SIDE];
    for (int t = 0; t < 3; t++)
        gaussian(mask + t * SIDE * SIDE, SIDE, SIDE, 20, 20, t == 0 ? 1.0 : 0.01);
    const psfex_spec good = {2, 1, 1, SIDE, 3, "X_IMAGE", "Y_IMAGE", 50.0, 100.0, 0.8};
    psfex_spec bad = good;
    bad.name2 = "MAG_AUTO";
    refuse_model(&bad, mask, "MAG_AUTO");
    bad = good;
    bad.groups = 2;
    refuse_model(&bad, mask, "PSFVAR_GROUPS");
    bad = good;
    bad.degree = 9;
    refuse_model(&bad, mask, "POLDEG1");
    bad = good;
    bad.degree = 2;
    refuse_model(&bad, mask, "6");
    bad = good;
    bad.sampling = 0.0;
    refuse_model(&bad, mask, "PSF_SAMP");
    bad = good;
    bad.scale = 0.0;
    refuse_model(&bad, mask, "POLSCAL1");
    bad = good;
    bad.sampling = 3.0;
    refuse_model(&bad, mask, "larger than the tile");
    mask[100] = NAN;
    refuse_model(&good, mask, "image 0 of the PSFEx model holds values that are not numbers");
    mask[100] = 0.0F;
    mask[SIDE * SIDE + 100] = NAN;
    refuse_model(&good, mask, "image 1 of");
    gaussian(mask, SIDE, SIDE, 20, 20, 1.0);
    gaussian(mask + SIDE * SIDE, SIDE, SIDE, 20, 20, 3.0);
    refuse_model(&good, mask, "sums to");
}

/* Takes the card of that key out of the file. */
static void forget_key(const char *path, const char *key)
{
    char name[9], card[81] = "";
    FILE *file = fopen(path, "r+b");
    assert_non_null(file);
    snprintf(name, sizeof name, "%-8s", key);
    while (fread(card, 1, 80, file) == 80)
        if (memcmp(card, name, 8) == 0) {
            fseek(file, -80, SEEK_CUR);
            fputs("COMMENT ", file);
            assert_int_equal(fclose(file), 0);
            return;
        }
    fail_msg("no %s in %s", key, path);
}

/* Nothing is missing that the rest of the model does not determine. */
static void test_model_of_a_merged_table(void **state)
{
    (void)state;
    enum { SIDE = 41 };
    static float mask[3 * SIDE * SIDE];
    for (int t = 0; t < 3; t++)
        gaussian(mask + t * SIDE * SIDE, SIDE, SIDE, 20 + 0.3 * t, 20 - 0.5 * t, t == 0 ? 1.0 : 0.05 * t);
    const psfex_spec plane = {2, 1, 1, SIDE, 3, "X_IMAGE", "Y_IMAGE", 50.0, 100.0, 0.8},
                     constant = {2, 1, 0, SIDE, 1, "X_IMAGE", "Y_IMAGE", 50.0, 100.0, 0.8};
    static const char *const lacking[][7] = {{"POLNAXIS", "PSFNAXIS"},
                                             {"POLNAXIS", "POLNGRP", "PSFNAXIS", "PSFAXIS3"},
                                             {"POLNAXIS", "PSFNAXIS", "PSFAXIS1", "PSFAXIS2", "PSFAXIS3"}};
    for (int k = 0; k < 6; k++) {
        rx_psf *whole, *psf;
        write_psfex("model.psf", k < 3 ? &plane : &constant, mask);
        assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &whole, NULL),
                         RX_OK);
        for (int i = 0; lacking[k % 3][i] != NULL; i++)
            forget_key("model.psf", lacking[k % 3][i]);
        assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &psf, NULL),
                         RX_OK);
        assert_int_equal(psf->nbasis, whole->nbasis);
        assert_int_equal(psf->size, whole->size);
        assert_memory_equal(psf->basis, whole->basis,
                            (size_t)psf->nbasis * (size_t)(psf->size * psf->size) * sizeof *psf->basis);
        rx_psf_free(psf);
        rx_psf_free(whole);
    }
    rx_psf *whole, *psf; /* a number of the row */
    write_psfex("model.psf", &plane, mask);
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &whole, NULL),
                     RX_OK);
    merged = 1;
    write_psfex("model.psf", &plane, mask);
    merged = 0;
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &psf, NULL), RX_OK);
    assert_int_equal(psf->size, whole->size);
    for (int i = 0; i < psf->size * psf->size; i++)
        assert_near(psf->basis[i], whole->basis[i], 1e-8);
    rx_psf_free(psf);
    rx_psf_free(whole);
    /* what nothing else tells */
    static const char *const needed[][2] = {{"POLDEG1", "POLNAXIS"},
                                            {"POLZERO1", "POLZERO1"},
                                            {"POLNAME2", "varies with ''"},
                                            {"PSF_SAMP", "PSF_SAMP"}};
    for (size_t k = 0; k < sizeof needed / sizeof *needed; k++) {
        rx_psf *psf;
        rx_error err = RX_ERROR_NONE;
        write_psfex("model.psf", &plane, mask);
        forget_key("model.psf", "POLNAXIS");
        forget_key("model.psf", needed[k][0]);
        assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &psf, &err),
                         RX_INPUT);
        if (strstr(err.text, needed[k][1]) == NULL)
            fail_msg("'%s' does not say '%s'", err.text, needed[k][1]);
    }
}

/* Narrow PSFs of files that know them finer than the tile's pixels keep their samples, and are written and read with them;
 * wide ones, and those of whole pixels, have none. */
static void test_samples(void **state)
{
    (void)state;
    enum { SIDE = 61 }; /* 4 samples a pixel */
    static float image[SIDE * SIDE];
    for (int wide = 0; wide < 2; wide++) {
        const double sigma = wide ? 1.3 : 0.65;
        rx_psf *psf, *back;
        for (int i = 0; i < SIDE * SIDE; i++)
            image[i] =
                (float)exp(-(pow(i % SIDE - 30.0, 2.0) + pow(i / SIDE - 30.0, 2.0)) / 32.0 / sigma / sigma);
        write_image("psf.fits", image, SIDE, SIDE);
        const rx_psf_params par = {.file = "psf.fits", .sampling = 4.0, .integrate = RX_PSF_INTERPOLATE};
        assert_int_equal(rx_psf_file(&par, 100, 100, NULL, &psf, NULL), RX_OK);
        assert_int_equal(rx_psf_fine(psf), wide ? 1 : 2);
        const int n = psf->size;
        assert_int_equal(rx_psf_fine_side(psf), wide ? n : 2 * n - 1);
        for (int i = 0; i < 2 * n - 1 && !wide; i++)
            assert_near((double)psf->samples[(n - 1) * (2 * n - 1) + i],
                        exp(-0.125 * pow(i - n + 1, 2.0) / sigma / sigma) / (2.0 * M_PI * sigma * sigma),
                        1e-3);
        write_model(psf);
        assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 100, 100, NULL, &back, NULL),
                         RX_OK);
        assert_int_equal(rx_psf_fine(back), rx_psf_fine(psf));
        assert_int_equal(back->size, n);
        for (int i = 0; i < (2 * n - 1) * (2 * n - 1) && !wide; i++)
            assert_near((double)back->samples[i], (double)psf->samples[i], 1e-6);
        rx_psf *copy = rx_psf_copy(psf);
        assert_int_equal(rx_psf_fine(copy), rx_psf_fine(psf));
        rx_psf_free(copy);
        rx_psf_free(psf);
        rx_psf_free(back);
    }
}

/* A PSF that is written for PSFEx's readers comes back the same; terms that it lacks are images of zeros. */
static void test_written_model(void **state)
{
    (void)state;
    enum { SIDE = 15, TERMS = 4 };
    static const int px[TERMS] = {0, 2, 0, 1}, py[TERMS] = {0, 0, 1, 3};
    rx_psf *psf = rx_psf_new(RX_PSF_AUTO, SIDE, TERMS), *back;
    rx_table *table;
    rx_text cards = {0};
    assert_non_null(psf);
    psf->x0 = 40.0;
    psf->y0 = 30.5;
    psf->xs = 50.0;
    psf->ys = 35.0;
    psf->fwhm = 4.0;
    psf->nstars = 7;
    for (int t = 0; t < TERMS; t++) {
        float *image = psf->basis + t * SIDE * SIDE;
        double sum = 0.0;
        psf->px[t] = px[t];
        psf->py[t] = py[t];
        gaussian(image, SIDE, SIDE, 7 + 0.4 * t, 7 - 0.3 * t, t == 0 ? 1.0 : 0.003);
        for (int i = 0; i < SIDE * SIDE; i++)
            sum += (double)image[i];
        for (int i = 0; i < SIDE * SIDE && t == 0; i++)
            image[i] = (float)((double)image[i] / sum);
        for (int i = 0; i < SIDE * SIDE && t > 0; i++)
            image[i] -= (float)sum * psf->basis[i];
    }
    for (psf->fwhm = 4.0; psf->fwhm > 1.0; psf->fwhm -= 2.0) { /* in pixels, in halves of them */
        write_model(psf);
        assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = "model.psf"}, 90, 70, NULL, &back, NULL),
                         RX_OK);
        assert_int_equal(back->size, SIDE);
        assert_int_equal(back->nbasis, 15);
        for (int k = 0; k < 9; k++) {
            float one[SIDE * SIDE], two[SIDE * SIDE];
            rx_psf_at(psf, 44.5 * (k % 3), 34.5 * (k / 3), one);
            rx_psf_at(back, 44.5 * (k % 3), 34.5 * (k / 3), two);
            for (int i = 0; i < SIDE * SIDE; i++)
                assert_near(two[i], one[i], 1e-6 * (double)one[SIDE / 2 * SIDE + SIDE / 2]);
        }
        rx_psf_free(back);
    }
    psf->px[3] = 6; /* degree 9 */
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_psf_psfex_table(psf, &table, &cards, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "degree 9"));
    rx_text_free(&cards);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_box),
        cmocka_unit_test(test_written_model),
        cmocka_unit_test(test_samples),
        cmocka_unit_test(test_image_sizes),
        cmocka_unit_test(test_image_cut_to_size),
        cmocka_unit_test(test_image_refused),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_resample),
        cmocka_unit_test(test_light_off_centre_is_told),
        cmocka_unit_test(test_extrapolation_is_told),
        cmocka_unit_test(test_own_range),
        cmocka_unit_test(test_real_models),
        cmocka_unit_test(test_made_model),
        cmocka_unit_test(test_model_refused),
        cmocka_unit_test(test_model_of_a_merged_table),
        cmocka_unit_test(test_psfex_of_each_extension),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
