/* The blur of a tile and its adjoint by FFT, exact for a polynomial PSF. */
#include "restore/blur.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/convolve.h"

static const double NEGLIGIBLE = 1e-6;

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* ((pixel - zero) / scale)^power at domain pixel i, held at its value on the tile's edge. */
static double polynomial(int i, int margin, int n, double zero, double scale, int power)
{
    double t = (clamp(i - margin, 0, n - 1) - zero) / scale, v = 1;
    for (int p = 0; p < power; p++)
        v *= t;
    return v;
}

static double largest(const float *values, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = fmax(max, fabs(values[i]));
    return max;
}

rx_status rx_blur_check(const rx_psf *psf, int width, int height, rx_error *err)
{
    if (psf == NULL)
        return rx_error_set(err, RX_INPUT, "no PSF is known for the restoration; give one by PSF_TYPE");
    if (psf->size < 1 || psf->size % 2 == 0 || psf->nbasis < 1 || psf->nbasis > RX_PSF_MAX_BASIS)
        return rx_error_set(err, RX_INPUT,
                            "a PSF of %d images of %d pixels cannot be used; give odd images, at most %d",
                            psf->nbasis, psf->size, RX_PSF_MAX_BASIS);
    if (psf->size > width || psf->size > height)
        return rx_error_set(
            err, RX_INPUT,
            "the PSF image of %d x %d pixels is larger than the tile of %d x %d; give a smaller PSF or "
            "a larger tile",
            psf->size, psf->size, width, height);
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    for (size_t i = 0; i < n * (size_t)psf->nbasis; i++)
        if (!isfinite(psf->basis[i]))
            return rx_error_set(err, RX_INPUT, "the PSF holds values that are not finite; give another one");
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += psf->basis[i];
    if (!(sum > 0))
        return rx_error_set(err, RX_INPUT, "the PSF has no flux; give one with a positive sum");
    return RX_OK;
}

/* The coefficients of one basis image into blur->cx, cy[nterms]; *peak is the largest product. */
static rx_status set_coefficients(rx_blur *blur, const rx_psf *psf, int basis, double *peak, rx_error *err)
{
    const int w = rx_fft_width(blur->fft), h = rx_fft_height(blur->fft), i = blur->nterms;
    if (blur->cx[i] == NULL)
        blur->cx[i] = RX_NEW(float, (size_t)w);
    if (blur->cy[i] == NULL)
        blur->cy[i] = RX_NEW(float, (size_t)h);
    if (blur->cx[i] == NULL || blur->cy[i] == NULL)
        return rx_error_memory(err, (size_t)(w + h) * sizeof(float));
    for (int x = 0; x < w; x++)
        blur->cx[i][x] = (float)polynomial(x, blur->margin, blur->width, psf->x0, psf->xs, psf->px[basis]);
    for (int y = 0; y < h; y++)
        blur->cy[i][y] = (float)polynomial(y, blur->margin, blur->height, psf->y0, psf->ys, psf->py[basis]);
    *peak = largest(blur->cx[i], (size_t)w) * largest(blur->cy[i], (size_t)h);
    return RX_OK;
}

static rx_status add_terms(rx_blur *blur, const rx_psf *psf, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    const double peak = largest(psf->basis, n);
    rx_status status = RX_OK;
    float *work = rx_fft_real(blur->fft);
    if (work == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < psf->nbasis; i++) {
        const float *stamp = psf->basis + n * (size_t)i;
        double most = 0;
        if ((status = set_coefficients(blur, psf, i, &most, err)) != RX_OK)
            break;
        if (!(most * largest(stamp, n) > NEGLIGIBLE * peak))
            continue;
        if (psf->px[i] != 0 || psf->py[i] != 0 || blur->nterms > 0)
            blur->varies = 1;
        float *kernel = blur->kernel[blur->nterms++] = rx_fft_complex(blur->fft);
        if (kernel == NULL) {
            status = rx_error_memory(err, 0);
            break;
        }
        rx_convolve_spectrum(blur->fft, stamp, psf->size, work, kernel);
    }
    free(work);
    if (status == RX_OK && blur->nterms == 0)
        status = rx_error_set(err, RX_INPUT, "the PSF vanishes on the tile; give another one");
    return status;
}

rx_status rx_blur_new(const rx_psf *psf, int width, int height, int nthreads, rx_blur **dst, rx_error *err)
{
    *dst = NULL;
    rx_status status = rx_blur_check(psf, width, height, err);
    if (status != RX_OK)
        return status;
    rx_blur *blur = RX_NEW(rx_blur, 1);
    if (blur == NULL)
        return rx_error_memory(err, sizeof *blur);
    blur->width = width;
    blur->height = height;
    blur->size = psf->size;
    blur->margin = psf->size / 2;
    const int w = rx_fft_good_size(width + 2 * blur->margin), h = rx_fft_good_size(height + 2 * blur->margin);
    status = rx_fft_new(w, h, nthreads, &blur->fft, err);
    if (status == RX_OK)
        status = add_terms(blur, psf, err);
    if (status == RX_OK) {
        blur->half = rx_fft_complex(blur->fft);
        blur->sum = blur->varies ? rx_fft_complex(blur->fft) : NULL;
        if (blur->half == NULL || (blur->varies && blur->sum == NULL))
            status = rx_error_memory(err, 0);
    }
    if (status != RX_OK) {
        rx_blur_free(blur);
        return status;
    }
    *dst = blur;
    return RX_OK;
}

void rx_blur_free(rx_blur *blur)
{
    if (blur == NULL)
        return;
    for (int i = 0; i < RX_PSF_MAX_BASIS; i++) {
        free(blur->kernel[i]);
        free(blur->cx[i]);
        free(blur->cy[i]);
    }
    free(blur->half);
    free(blur->sum);
    rx_fft_free(blur->fft);
    free(blur);
}

void rx_blur_replace(rx_blur *blur, const float *stamp, float *work)
{
    rx_convolve_spectrum(blur->fft, stamp, blur->size, work, blur->kernel[0]);
}

/* dst (+)= c_i src over the whole domain */
static void weigh(const rx_blur *blur, int i, const float *src, int add, float *dst)
{
    const int w = rx_fft_width(blur->fft), h = rx_fft_height(blur->fft);
    const size_t stride = (size_t)rx_fft_stride_real(blur->fft);
    const float *cx = blur->cx[i];
#pragma omp parallel for schedule(static) num_threads(rx_fft_threads(blur->fft))
    for (int y = 0; y < h; y++) {
        const float c = blur->cy[i][y], *s = src + (size_t)y * stride;
        float *d = dst + (size_t)y * stride;
        if (add)
#pragma omp simd
            for (int x = 0; x < w; x++)
                d[x] += c * cx[x] * s[x];
        else
#pragma omp simd
            for (int x = 0; x < w; x++)
                d[x] = c * cx[x] * s[x];
    }
}

void rx_blur_apply(const rx_blur *blur, const float *src, float *dst)
{
    if (!blur->varies) {
        rx_convolve(blur->fft, blur->kernel[0], src, blur->half, dst);
        return;
    }
    for (int i = 0; i < blur->nterms; i++) {
        weigh(blur, i, src, 0, dst);
        rx_fft_forward(blur->fft, dst, blur->half);
        rx_convolve_multiply(blur->fft, blur->kernel[i], blur->half, false, i > 0, blur->sum);
    }
    rx_fft_inverse(blur->fft, blur->sum, dst);
}

void rx_blur_adjoint(const rx_blur *blur, float *src, float *dst)
{
    if (!blur->varies) {
        rx_correlate(blur->fft, blur->kernel[0], src, blur->half, dst);
        return;
    }
    rx_fft_forward(blur->fft, src, blur->sum);
    for (int i = 0; i < blur->nterms; i++) {
        rx_convolve_multiply(blur->fft, blur->kernel[i], blur->sum, true, false, blur->half);
        rx_fft_inverse(blur->fft, blur->half, src);
        weigh(blur, i, src, i > 0, dst);
    }
}

size_t rx_blur_row(const rx_blur *blur, int y)
{
    return (size_t)(y + blur->margin) * (size_t)rx_fft_stride_real(blur->fft) + (size_t)blur->margin;
}
