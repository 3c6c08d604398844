/* Relative PSF and Tikhonov filter, both by division in the frequency plane. */
#include "nn/deblur.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/convolve.h"

/* nn/deblur.h says what it leaves and why not more or less. */
static const double DELTA = 1e-4;
/* |K'| beyond the stamp that rx_deblur_relative_size() finds */
static const double SHARE = 1e-3;

enum {
    MARGIN = 16,        /* K' reaches hardly farther than O: 2 MARGIN more pixels keep its ends apart */
    RADIUS_LARGEST = 64 /* of the target's weights: FWHM 32 */
};

/* Real spectrum of one dimension of the target: w[0] + 2 sum_i w[i] cos(2 pi u i / n), u < count. */
static void target_spectrum(double fwhm, int n, int count, float *dst)
{
    float weights[2 * RADIUS_LARGEST + 1];
    int radius = rx_gauss_radius(fwhm);
    if (radius > RADIUS_LARGEST)
        radius = RADIUS_LARGEST;
    rx_gauss_weights(fwhm, radius, weights);
    for (int u = 0; u < count; u++) {
        double sum = weights[radius];
        for (int i = 1; i <= radius; i++)
            sum += 2 * weights[radius + i] * cos(2 * M_PI * (((long)u * i) % n) / n);
        dst[u] = (float)sum;
    }
}

static rx_status check_stamp(const float *psf, int size, rx_error *err)
{
    for (size_t k = 0; k < (size_t)size * (size_t)size; k++)
        if (!isfinite(psf[k]))
            return rx_error_set(
                err, RX_INPUT,
                "the PSF has a pixel that is not a number, column %d of row %d; give another one",
                (int)(k % (size_t)size) + 1, (int)(k / (size_t)size) + 1);
    return RX_OK;
}

static rx_status check_sum(const float *psf, int size, rx_error *err)
{
    double sum = 0;
    for (size_t k = 0; k < (size_t)size * (size_t)size; k++)
        sum += psf[k];
    if (sum <= 0) /* what is not finite is found pixel by pixel */
        return rx_error_set(err, RX_INPUT, "the sum of the PSF is %g, not positive; give another one", sum);
    return RX_OK;
}

/* The target's spectra ku[width/2+1] and, after it, kv[height] on the domain of fft; the caller's to free. */
static float *target_spectra(const rx_fft *fft, double fwhm)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft);
    float *ku = RX_NEW(float, (size_t)(w / 2 + 1 + h));
    if (ku == NULL)
        return NULL;
    target_spectrum(fwhm, w, w / 2 + 1, ku);
    target_spectrum(fwhm, h, h, ku + w / 2 + 1);
    return ku;
}

/* *dst: real plane of *fft with K' around the origin; both are the caller's. */
static rx_status make_relative(const float *psf, int size, double target_fwhm, int room, rx_fft **fft,
                               float **dst, rx_error *err)
{
    *fft = NULL;
    *dst = NULL;
    const int side = rx_fft_good_size((size > room ? size : room) + 2 * MARGIN);
    rx_status status = RX_OK;
    RX_TRY(check_stamp(psf, size, err));
    RX_TRY(rx_fft_new(side, side, 1, fft, err));
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(*fft);
    float *plane = rx_fft_real(*fft), *spectrum = rx_fft_complex(*fft),
          *ku = target_spectra(*fft, target_fwhm);
    if (plane == NULL || spectrum == NULL || ku == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    const float *kv = ku + side / 2 + 1;
    rx_convolve_spectrum(*fft, psf, size, spectrum);
    for (int u = 0; u <= side / 2; u++)
        for (int v = 0; v < side; v++) {
            const double k = (double)ku[u] * kv[v], gain = (1 + DELTA) * k / (k * k + DELTA);
            float *z = spectrum + (size_t)u * stride + 2 * (size_t)v;
            z[0] = (float)(z[0] * gain);
            z[1] = (float)(z[1] * gain);
        }
    rx_fft_inverse(*fft, spectrum, plane);
    *dst = plane;
    plane = NULL;
exit:
    free(plane);
    free(spectrum);
    free(ku);
    if (status != RX_OK) {
        rx_fft_free(*fft);
        *fft = NULL;
    }
    return status;
}

static float cyclic(const rx_fft *fft, const float *plane, int x, int y)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft);
    return plane[(size_t)((y + h) % h) * (size_t)rx_fft_stride_real(fft) + (size_t)((x + w) % w)];
}

rx_status rx_deblur_relative(const float *psf, int size, double target_fwhm, int out_size, int normalise,
                             float *relative, rx_error *err)
{
    rx_fft *fft = NULL;
    float *plane = NULL;
    double sum = 0;
    rx_status status;
    RX_TRY_EXIT(normalise ? check_sum(psf, size, err) : RX_OK);
    RX_TRY_EXIT(make_relative(psf, size, target_fwhm, out_size, &fft, &plane, err));
    for (int j = 0; j < out_size; j++)
        for (int i = 0; i < out_size; i++) {
            const float value = cyclic(fft, plane, i - out_size / 2, j - out_size / 2);
            relative[(size_t)j * (size_t)out_size + (size_t)i] = value;
            sum += value;
        }
    if (!normalise)
        goto exit;
    if (!(sum > 0) || !isfinite(sum)) {
        status = rx_error_set(err, RX_INPUT,
                              "%d pixels of the PSF relative to the target's sum to %g, not above 0; "
                              "give a better PSF",
                              out_size, sum);
        goto exit;
    }
    for (size_t k = 0; k < (size_t)out_size * (size_t)out_size; k++)
        relative[k] = (float)(relative[k] / sum);
exit:
    free(plane);
    rx_fft_free(fft);
    return status;
}

/* sum of |K'| over the square ring at distance r */
static double ring(const rx_fft *fft, const float *plane, int r)
{
    double sum = r == 0 ? fabsf(cyclic(fft, plane, 0, 0)) : 0;
    for (int i = -r; i < r; i++)
        sum += fabsf(cyclic(fft, plane, i, -r)) + fabsf(cyclic(fft, plane, r, i)) +
               fabsf(cyclic(fft, plane, -i, r)) + fabsf(cyclic(fft, plane, -r, -i));
    return sum;
}

rx_status rx_deblur_relative_size(const float *psf, int size, double target_fwhm, int largest, int *dst,
                                  rx_error *err)
{
    rx_fft *fft = NULL;
    float *plane = NULL;
    *dst = 0;
    rx_status status = make_relative(psf, size, target_fwhm, size, &fft, &plane, err);
    if (status == RX_OK) {
        const int most = (rx_fft_width(fft) - 1) / 2;
        double total = 0, outside = 0;
        for (int r = 0; r <= most; r++)
            total += ring(fft, plane, r);
        int radius = most;
        while (radius > 0 && (outside += ring(fft, plane, radius)) <= SHARE * total)
            radius--;
        *dst = 2 * radius + 1;
        if (*dst > largest)
            *dst = largest - (largest + 1) % 2;
    }
    free(plane);
    rx_fft_free(fft);
    return status;
}

rx_status rx_deblur_tikhonov(const rx_fft *fft, const float *stamp, int size, const rx_tikhonov *filter,
                             float *spectrum, rx_error *err)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft);
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(fft);
    const double pixels = (double)w * h, epsilon = filter->epsilon;
    RX_TRY(check_stamp(stamp, size, err));
    if (size > w || size > h || h < 2 || w < 2)
        return rx_error_set(err, RX_INPUT, "a PSF of %d pixels does not fit into %d x %d; give a smaller one",
                            size, w, h);
    float *ku = target_spectra(fft, filter->target_fwhm);
    if (ku == NULL)
        return rx_error_memory(err, 0);
    const float *kv = ku + w / 2 + 1;
    rx_convolve_spectrum(fft, stamp, size, spectrum);
    for (int u = 0; u <= w / 2; u++)
        for (int v = 0; v < h; v++) {
            float *z = spectrum + (size_t)u * stride + 2 * (size_t)v;
            const double k = (double)ku[u] * kv[v], optics = pixels * (filter->relative ? k : 1);
            const double re = z[0] * optics, im = z[1] * optics;
            const double gain = (1 + epsilon) * k / ((re * re + im * im + epsilon) * pixels);
            z[0] = (float)(re * gain);
            z[1] = (float)(-im * gain);
        }
    free(ku);
    return RX_OK;
}
