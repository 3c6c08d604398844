/* Drawing more of a tile's noise. */
#include "simulate/sky_noise.h"

#include <math.h>
#include <stdlib.h>

#include "num/fft.h"
#include "simulate/noise.h"

enum {
    LAGS = RX_NOISE_REACH,
    MARGIN = 32 /* pixels that a realisation is wider than the tile: the filter's reach, as FFTs are cyclic */
};

/* Root of the power spectrum on the domain, of mean square 1, over the domain's pixels (rx_fft's inverse has
 * no factor). */
static rx_status filter_spectrum(const rx_noise_correlation *noise, const rx_fft *fft, float *plane,
                                 float *spectrum, rx_error *err)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft), half = w / 2 + 1;
    const size_t stride = (size_t)rx_fft_stride_real(fft), complex = (size_t)rx_fft_stride_complex(fft);
    double power = 0.0;
    for (int dy = -LAGS; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++) {
            int y = (dy + h) % h, x = (dx + w) % w;
            plane[(size_t)y * stride + (size_t)x] = (float)noise->at[dy + LAGS][dx + LAGS];
        }
    rx_fft_forward(fft, plane, spectrum);
    for (int u = 0; u < half; u++)
        for (int v = 0; v < h; v++) {
            float *value = spectrum + 2 * ((size_t)u * complex + (size_t)v);
            /* the half that is not stored holds the same again, but for u = 0 and, of an even width, the last
             */
            double twice = u == 0 || 2 * u == w ? 1.0 : 2.0;
            value[0] = fmaxf(value[0], 0.0f);
            value[1] = 0.0f;
            power += twice * (double)value[0];
        }
    const double cells = (double)w * h;
    if (!(power > 0.0))
        return rx_error_set(err, RX_INPUT, "the correlation of the noise has no power at any frequency");
    for (int u = 0; u < half; u++)
        for (int v = 0; v < h; v++) {
            float *value = spectrum + 2 * ((size_t)u * complex + (size_t)v);
            value[0] = (float)(sqrt((double)value[0] * cells / power) / cells);
        }
    return RX_OK;
}

static void scale_rows(double scale, int width, int height, const rx_map *sigmas, const float *unit,
                       size_t stride, int nthreads, float *dst)
{
#pragma omp parallel for num_threads(nthreads) schedule(static)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            const int n = rx_map_piece(x, width);
            float room[RX_MAP_PIECE];
            const float *sigma = rx_map_row(sigmas, y, x, n, room), *from = unit + (size_t)y * stride + x;
            float *to = dst + (size_t)y * (size_t)width + x;
            for (int k = 0; k < n; k++)
                to[k] = (float)scale * sigma[k] * from[k];
        }
}

static rx_status draw_correlated(const rx_noise_correlation *noise, int width, int height,
                                 const rx_map *sigma, uint64_t seed, uint64_t stream, int nthreads,
                                 float *dst, rx_error *err)
{
    rx_fft *fft = NULL;
    float *plane = NULL, *spectrum = NULL, *half = NULL;
    const int w = rx_fft_good_size(width + MARGIN), h = rx_fft_good_size(height + MARGIN);
    rx_status status = rx_fft_new(w, h, nthreads, &fft, err);
    if (status != RX_OK)
        return status;
    plane = rx_fft_real(fft);
    spectrum = rx_fft_complex(fft);
    half = rx_fft_complex(fft);
    if (plane == NULL || spectrum == NULL || half == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    status = filter_spectrum(noise, fft, plane, spectrum, err);
    if (status != RX_OK)
        goto exit;
    const size_t stride = (size_t)rx_fft_stride_real(fft);
#pragma omp parallel for num_threads(nthreads) schedule(static)
    for (int y = 0; y < h; y++)
        rx_noise_normals(seed, stream, (uint64_t)y * (uint64_t)w, w, plane + (size_t)y * stride);
    rx_fft_filter(fft, plane, spectrum, false, half, plane);
    scale_rows(noise->scale, width, height, sigma, plane, stride, nthreads, dst);
exit:
    free(plane);
    free(spectrum);
    free(half);
    rx_fft_free(fft);
    return status;
}

rx_status rx_sky_noise_draw(const rx_noise_correlation *noise, int width, int height, const rx_map *sigma,
                            uint64_t seed, uint64_t stream, int nthreads, float *dst, rx_error *err)
{
    const int threads = nthreads > 1 ? nthreads : 1;
    if (noise->correlated)
        return draw_correlated(noise, width, height, sigma, seed, stream, threads, dst, err);
#pragma omp parallel for num_threads(threads) schedule(static)
    for (int y = 0; y < height; y++) {
        float *row = dst + (size_t)y * (size_t)width;
        rx_noise_normals(seed, stream, (uint64_t)y * (uint64_t)width, width, row);
    }
    scale_rows(noise->scale, width, height, sigma, dst, (size_t)width, threads, dst);
    return RX_OK;
}
