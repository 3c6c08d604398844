/* Small images with known sources. */
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "num/convolve.h"
#include "psf/moffat.h"
#include "psf/psf.h"

static const double BETA = 4.765;

void field_open(field *f, int width, int height, double fwhm, double sigma, int n)
{
    const size_t pixels = (size_t)width * (size_t)height;
    *f = (field){.width = width,
                 .height = height,
                 .fwhm = fwhm,
                 .pixels = RX_NEW(float, pixels),
                 .sigma = RX_NEW(float, pixels),
                 .mask = RX_NEW(uint8_t, pixels),
                 .restored = rx_restored_new("NONE", width, height),
                 .sources = RX_NEW(rx_sources, 1)};
    assert_non_null(f->pixels);
    assert_non_null(f->sigma);
    assert_non_null(f->mask);
    assert_non_null(f->restored);
    assert_non_null(f->sources);
    f->sources->width = width;
    f->sources->height = height;
    f->sources->list = RX_NEW(rx_source, n);
    f->sources->segments = RX_NEW(int32_t, pixels);
    assert_non_null(f->sources->list);
    assert_non_null(f->sources->segments);
    for (size_t k = 0; k < pixels; k++)
        f->sigma[k] = (float)sigma;
    assert_int_equal(rx_psf_moffat(fwhm, BETA, 1, 0, 2 * (int)ceil(10 * fwhm) + 1, &f->psf, NULL), RX_OK);
}

void field_close(field *f)
{
    free(f->pixels);
    free(f->sigma);
    free(f->mask);
    rx_psf_free(f->psf);
    rx_restored_free(f->restored);
    rx_sources_free(f->sources);
}

/* Sum of the profile over the plane, in units of its peak. */
static double moffat_sum(double fwhm)
{
    const double alpha = 0.5 * fwhm / sqrt(pow(2, 1 / BETA) - 1);
    return 3.14159265358979323846 * alpha * alpha / (BETA - 1);
}

void field_star(field *f, double x, double y, double flux)
{
    double shape[RX_MOFFAT_SHAPE];
    rx_moffat profile;
    rx_moffat_shape(f->fwhm, BETA, 1, 0, shape);
    rx_moffat_set(&profile, shape);
    const int reach = (int)ceil(10 * f->fwhm), cx = (int)lround(x), cy = (int)lround(y);
    const double scale = flux / moffat_sum(f->fwhm);
    for (int j = cy - reach; j <= cy + reach; j++)
        for (int i = cx - reach; i <= cx + reach; i++)
            if (i >= 0 && j >= 0 && i < f->width && j < f->height)
                f->pixels[(size_t)j * (size_t)f->width + (size_t)i] +=
                    (float)(scale * rx_moffat_pixel(&profile, i - x, j - y, NULL));
}

void field_disk(field *f, double x, double y, double flux, double radius, double ratio, double angle)
{
    enum { CELLS = 3, SIDE = 128 };
    const int big = CELLS * SIDE, cx = (int)lround(x), cy = (int)lround(y);
    const double h = radius / 1.67834699, c = cos(angle), s = sin(angle), q = sqrt(ratio);
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(big, big, 1, &fft, NULL), RX_OK);
    float *grid = rx_fft_real(fft), *half = rx_fft_complex(fft), *kernel = rx_fft_complex(fft);
    float *work = rx_fft_real(fft), *stamp = rx_alloc((size_t)(big - 1) * (size_t)(big - 1), sizeof(float));
    assert_non_null(grid);
    assert_non_null(half);
    assert_non_null(kernel);
    assert_non_null(work);
    assert_non_null(stamp);
    const size_t stride = (size_t)rx_fft_stride_real(fft);
    double sum = 0;
    for (int j = 0; j < big; j++)
        for (int i = 0; i < big; i++) {
            double value = 0;
            for (int k = 0; k < 9; k++) {
                const double u = (i + (k % 3 - 1) / 3.0 - big / 2) / CELLS - (x - cx);
                const double v = (j + (k / 3 - 1) / 3.0 - big / 2) / CELLS - (y - cy);
                value += exp(-hypot((c * u + s * v) * q, (c * v - s * u) / q) / h);
            }
            grid[(size_t)j * stride + (size_t)i] = (float)value;
            sum += value;
        }
    double shape[RX_MOFFAT_SHAPE];
    rx_moffat profile;
    rx_moffat_shape(f->fwhm * CELLS, BETA, 1, 0, shape);
    rx_moffat_set(&profile, shape);
    for (int j = 0; j < big - 1; j++)
        for (int i = 0; i < big - 1; i++) { /* the pixel of the tile is 3 x 3 cells */
            double value = 0;
            for (int k = 0; k < 9; k++)
                value +=
                    rx_moffat_pixel(&profile, i - big / 2 + 1 + k % 3 - 1, j - big / 2 + 1 + k / 3 - 1, NULL);
            stamp[(size_t)j * (size_t)(big - 1) + (size_t)i] =
                (float)(value / moffat_sum(f->fwhm * CELLS) / (sum / flux));
        }
    rx_convolve_spectrum(fft, stamp, big - 1, kernel);
    rx_convolve(fft, kernel, grid, half, grid);
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++) {
            const int px = cx + i - SIDE / 2, py = cy + j - SIDE / 2;
            if (px >= 0 && py >= 0 && px < f->width && py < f->height)
                f->pixels[(size_t)py * (size_t)f->width + (size_t)px] +=
                    grid[(size_t)(CELLS * j) * stride + (size_t)(CELLS * i)];
        }
    free(grid);
    free(half);
    free(kernel);
    free(work);
    free(stamp);
    rx_fft_free(fft);
}

void field_list(field *f, double x, double y, double reach, double a, double b, double theta)
{
    rx_source *s = &f->sources->list[f->sources->n++];
    *s = (rx_source){.number = f->sources->n,
                     .segment = f->sources->n,
                     .x = x,
                     .y = y,
                     .a = a,
                     .b = b,
                     .theta = theta,
                     .xmin = f->width,
                     .ymin = f->height};
    for (int j = (int)(y - reach); j <= (int)(y + reach) + 1; j++)
        for (int i = (int)(x - reach); i <= (int)(x + reach) + 1; i++) {
            if (i < 0 || j < 0 || i >= f->width || j >= f->height || hypot(i - x, j - y) > reach)
                continue;
            int32_t *segment = &f->sources->segments[(size_t)j * (size_t)f->width + (size_t)i];
            if (*segment != 0)
                continue;
            *segment = s->segment;
            s->xmin = i < s->xmin ? i : s->xmin;
            s->xmax = i > s->xmax ? i : s->xmax;
            s->ymin = j < s->ymin ? j : s->ymin;
            s->ymax = j > s->ymax ? j : s->ymax;
        }
}

void field_noise(field *f, uint64_t seed)
{
    for (size_t k = 0; k < (size_t)f->width * (size_t)f->height; k++)
        f->pixels[k] += (float)(f->sigma[k] * rx_random_normal(seed, 0, k));
}

void field_restore_none(field *f)
{
    memcpy(f->restored->pixels, f->pixels, (size_t)f->width * (size_t)f->height * sizeof(float));
    rx_psf_free(f->restored->psf);
    f->restored->psf = rx_psf_copy(f->psf);
    assert_non_null(f->restored->psf);
}

rx_tphot_input field_input(const field *f)
{
    return (rx_tphot_input){.restored = f->restored,
                            .sources = f->sources,
                            .image = {.width = f->width,
                                      .height = f->height,
                                      .pixels = f->pixels,
                                      .noise = rx_map_plane(f->sigma, f->width),
                                      .mask = f->mask,
                                      .hide = 7,
                                      .psf = f->psf}};
}

rx_footprint boxed(int x0, int y0, int w, int h, uint64_t seed)
{
    rx_footprint f = {
        .x0 = x0, .y0 = y0, .width = w, .height = h, .values = RX_NEW(float, (size_t)w *(size_t)h)};
    assert_non_null(f.values);
    for (int k = 0; k < w * h; k++)
        f.values[k] = (float)(0.2 + rx_random_uniform(seed, 8, (uint64_t)k));
    return f;
}
