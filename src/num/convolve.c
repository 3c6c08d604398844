/* Cyclic convolution by spectra, and normalised Gaussian smoothing. */
#include "num/convolve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

void rx_convolve_spectrum(const rx_fft *fft, const float *stamp, int size, float *work, float *spectrum)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft), centre = size / 2;
    const size_t stride = (size_t)rx_fft_stride_real(fft);
    const double scale = 1.0 / ((double)w * h);
    memset(work, 0, stride * (size_t)h * sizeof *work);
    for (int j = 0; j < size; j++)
        for (int i = 0; i < size; i++) {
            size_t y = (size_t)((j - centre + h) % h), x = (size_t)((i - centre + w) % w);
            work[y * stride + x] = (float)(stamp[(size_t)j * size + i] * scale);
        }
    rx_fft_forward(fft, work, spectrum);
}

/* n complex numbers: d (+)= k s with the sign of Im k given. */
static void multiply_column(int n, const float *k, const float *s, float sign, bool add, float *d)
{
    for (int i = 0; i < n; i++) {
        float kr = k[2 * i], ki = sign * k[2 * i + 1], sr = s[2 * i], si = s[2 * i + 1];
        float re = kr * sr - ki * si, im = kr * si + ki * sr;
        d[2 * i] = add ? d[2 * i] + re : re;
        d[2 * i + 1] = add ? d[2 * i + 1] + im : im;
    }
}

void rx_convolve_multiply(const rx_fft *fft, const float *kernel, const float *src, bool conjugate, bool add,
                          float *dst)
{
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(fft);
#pragma omp parallel for schedule(static) num_threads(rx_fft_threads(fft))
    for (int u = 0; u <= rx_fft_width(fft) / 2; u++)
        multiply_column(rx_fft_height(fft), kernel + u * stride, src + u * stride, conjugate ? -1.0f : 1.0f,
                        add, dst + u * stride);
}

void rx_convolve_divide(const rx_fft *fft, const float *numerator, const float *denominator, double delta,
                        float *dst)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft);
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(fft);
    const double pixels = (double)w * h;
    for (int u = 0; u <= w / 2; u++)
        for (int v = 0; v < h; v++) {
            const size_t k = (size_t)u * stride + 2 * (size_t)v;
            const double re = denominator[k] * pixels, im = denominator[k + 1] * pixels;
            const double nr = numerator[k], ni = numerator[k + 1];
            const double gain = (1 + delta) / (re * re + im * im + delta);
            dst[k] = (float)(gain * (nr * re + ni * im));
            dst[k + 1] = (float)(gain * (ni * re - nr * im));
        }
}

void rx_convolve(const rx_fft *fft, const float *kernel, const float *src, float *half, float *dst)
{
    rx_fft_filter(fft, src, kernel, false, half, dst);
}

void rx_correlate(const rx_fft *fft, const float *kernel, const float *src, float *half, float *dst)
{
    rx_fft_filter(fft, src, kernel, true, half, dst);
}

/* FWHM = 2 sqrt(2 ln 2) sigma */
static double gauss_sigma(double fwhm)
{
    return fwhm / 2.3548200450309493;
}

int rx_gauss_radius(double fwhm)
{
    return (int)ceil(4.5 * gauss_sigma(fwhm) + 0.5);
}

void rx_gauss_weights(double fwhm, int radius, float *weights)
{
    const double unit = 1 / (gauss_sigma(fwhm) * sqrt(2.0));
    double sum = erf((radius + 0.5) * unit);
    for (int i = -radius; i <= radius; i++)
        weights[i + radius] = (float)((erf((i + 0.5) * unit) - erf((i - 0.5) * unit)) / (2 * sum));
}

/* Sums of so many pixels of a row grow together, each in the order of the weights. */
enum { TOGETHER = 64 };

/* Along x: num = G f, den = G good, for pixels x0 .. x1 - 1 of one row; f and `good` are 0 at masked ones. */
static void smooth_row(int width, int x0, int x1, int radius, const float *g, const float *image,
                       const float *good, float *restrict num, float *restrict den)
{
    float n[TOGETHER] = {0}, d[TOGETHER] = {0};
    for (int i = -radius; i <= radius; i++) {
        const int first = x0 + i < 0 ? -i : x0, last = x1 + i > width ? width - i : x1;
        const float weight = g[i + radius];
#pragma omp simd
        for (int x = first; x < last; x++) {
            n[x - x0] += weight * image[x + i];
            d[x - x0] += weight * good[x + i];
        }
    }
    for (int x = x0; x < x1; x++) {
        num[x] = n[x - x0];
        den[x] = d[x - x0];
    }
}

/* good_stride 0: one row of ones serves all. */
static void smooth_rows(int width, int height, int radius, const float *g, int nthreads, const float *image,
                        const float *good, size_t good_stride, float *num, float *den)
{
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < height; y++) {
        const size_t row = (size_t)y * width;
        for (int x = 0; x < width; x += TOGETHER)
            smooth_row(width, x, x + TOGETHER < width ? x + TOGETHER : width, radius, g, image + row,
                       good + (size_t)y * good_stride, num + row, den + row);
    }
}

/* Along y, then the quotient, at good pixels: `count` of row y, all pointers at the first of them. */
static void smooth_piece(int width, int height, int y, int count, int radius, const float *g,
                         const uint8_t *mask, const float *num, const float *den, float *restrict image)
{
    float n[TOGETHER] = {0}, d[TOGETHER] = {0};
    const int first = y < radius ? -y : -radius;
    const int last = y + radius >= height ? height - 1 - y : radius;
    for (int i = first; i <= last; i++) {
        const float weight = g[i + radius];
        const float *a = num + (ptrdiff_t)i * width, *b = den + (ptrdiff_t)i * width;
#pragma omp simd
        for (int x = 0; x < count; x++) {
            n[x] += weight * a[x];
            d[x] += weight * b[x];
        }
    }
    /* a good pixel counts itself, hence d > 0 there */
    for (int x = 0; x < count; x++)
        image[x] = mask == NULL || mask[x] == 0 ? n[x] / d[x] : 0.0f;
}

static void smooth_columns(int width, int height, int radius, const float *g, const uint8_t *mask,
                           int nthreads, const float *num, const float *den, float *image)
{
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x += TOGETHER) {
            const size_t k = (size_t)y * width + x;
            smooth_piece(width, height, y, x + TOGETHER < width ? TOGETHER : width - x, radius, g,
                         mask != NULL ? mask + k : NULL, num + k, den + k, image + k);
        }
}

rx_status rx_gauss_masked(int width, int height, double fwhm, const uint8_t *mask, int nthreads, float *image,
                          rx_error *err)
{
    const size_t n = (size_t)width * (size_t)height;
    for (size_t k = 0; mask != NULL && k < n; k++)
        if (mask[k] != 0)
            image[k] = 0;
    if (!(fwhm > 0))
        return RX_OK;
    rx_status status = RX_OK;
    const int radius = rx_gauss_radius(fwhm), threads = nthreads < 1 ? 1 : nthreads;
    const size_t ngood = mask != NULL ? n : (size_t)width;
    float *g = RX_NEW(float, 2 * (size_t)radius + 1), *num = RX_NEW(float, n), *den = RX_NEW(float, n);
    float *good = RX_NEW(float, ngood);
    if (g == NULL || num == NULL || den == NULL || good == NULL) {
        status = rx_error_memory(err, 3 * n * sizeof *num);
        goto exit;
    }
    for (size_t k = 0; k < ngood; k++)
        good[k] = mask == NULL || mask[k] == 0 ? 1.0f : 0.0f;
    rx_gauss_weights(fwhm, radius, g);
    smooth_rows(width, height, radius, g, threads, image, good, mask != NULL ? (size_t)width : 0, num, den);
    smooth_columns(width, height, radius, g, mask, threads, num, den, image);
exit:
    free(g);
    free(num);
    free(den);
    free(good);
    return status;
}
