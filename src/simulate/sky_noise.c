/* Measuring the noise of a tile, and drawing more of it. */
#include "simulate/sky_noise.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/fft.h"
#include "num/stats.h"
#include "simulate/noise.h"

enum {
    LAGS = RX_NOISE_LAGS,
    ENOUGH = 1000,  /* used pixels */
    SAMPLE = 65536, /* of them for a first, robust width */
    PASSES = 3,
    MARGIN = 32 /* pixels that a realisation is wider than the tile: the filter's reach, as FFTs are cyclic */
};

static const double CUT = 4.0;           /* sigmas */
static const double CUT_WIDTH = 0.99946; /* rms of a normal deviate cut at +-CUT: sqrt(1 - 2 CUT phi(CUT)) */
static const double LEAST = 0.02;        /* correlation worth imitating */
static const double FLOOR = 0.05;        /* more than that at the last lags is noise, not sky */

/* --- measuring --- */

/* z of the used pixels, NAN elsewhere; their number. */
static long normalise(int width, int height, const float *pixels, const rx_map *sigmas,
                      const unsigned char *used, float *z)
{
    long count = 0;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            const int n = rx_map_piece(x, width);
            float room[RX_MAP_PIECE];
            const float *sigma = rx_map_row(sigmas, y, x, n, room);
            const size_t at = (size_t)y * (size_t)width + (size_t)x;
            for (int k = 0; k < n; k++) {
                const size_t i = at + (size_t)k;
                z[i] = used[i] && sigma[k] > 0.0f ? pixels[i] / sigma[k] : NAN;
                if (isfinite(z[i]))
                    count++;
                else
                    z[i] = NAN;
            }
        }
    return count;
}

/* Mean and width of the values within CUT widths of the mean, from an even sample's median and MAD on. */
static rx_status clipped_moments(size_t n, const float *z, long count, double *mean, double *width,
                                 rx_error *err)
{
    const long step = count / SAMPLE + 1;
    double *sample = RX_NEW(double, (size_t)(count / step + 1));
    if (sample == NULL)
        return rx_error_memory(err, (size_t)count * sizeof(double));
    size_t taken = 0;
    long seen = 0;
    for (size_t i = 0; i < n; i++)
        if (!isnan(z[i]) && seen++ % step == 0)
            sample[taken++] = (double)z[i];
    double middle, spread = rx_sigma_mad(sample, taken, &middle);
    free(sample);
    for (int pass = 0; pass < PASSES; pass++) {
        double sum = 0.0, squares = 0.0;
        long kept = 0;
        for (size_t i = 0; i < n; i++) {
            double d = (double)z[i] - middle;
            if (isnan(d) || fabs(d) > CUT * spread)
                continue;
            sum += d;
            squares += d * d;
            kept++;
        }
        if (kept == 0)
            break;
        double shift = sum / (double)kept;
        spread = sqrt(fmax(squares / (double)kept - shift * shift, 0.0)) / CUT_WIDTH;
        middle += shift;
    }
    if (!(spread > 0.0))
        return rx_error_set(err, RX_INPUT, "the source-free pixels hold no noise to measure");
    *mean = middle;
    *width = spread;
    return RX_OK;
}

/* Mean product of pixels that lie (dx, dy) apart, both of them kept (z not NAN). */
static double mean_product(int width, int height, const float *z, int dx, int dy)
{
    double sum = 0.0;
    long pairs = 0;
    int first = dx < 0 ? -dx : 0, end = dx > 0 ? width - dx : width;
    for (int y = 0; y + dy < height; y++) {
        const float *a = z + (size_t)y * (size_t)width, *b = a + (size_t)dy * (size_t)width + dx;
        double row = 0.0;
        long count = 0;
        for (int x = first; x < end; x++) {
            float product = a[x] * b[x];
            int good = product == product;
            row += good ? (double)product : 0.0;
            count += good;
        }
        sum += row;
        pairs += count;
    }
    return pairs > 0 ? sum / (double)pairs : 0.0;
}

static void correlate(int width, int height, const float *z, rx_sky_noise *dst)
{
    const double variance = mean_product(width, height, z, 0, 0);
    for (int dy = 0; dy <= LAGS; dy++)
        for (int dx = dy == 0 ? 0 : -LAGS; dx <= LAGS; dx++) {
            double value = mean_product(width, height, z, dx, dy) / variance;
            dst->correlation[dy][dx + LAGS] = value;
            if (dy == 0)
                dst->correlation[0][LAGS - dx] = value;
        }
}

/* What does not fade with distance is the sky's, too much or too little of it subtracted, or the light of
 * sources below the threshold. */
static void remove_floor(rx_sky_noise *dst)
{
    double sum = 0.0, lags = 0.0;
    for (int dy = 0; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++)
            if (dy == LAGS || abs(dx) == LAGS) {
                sum += dst->correlation[dy][dx + LAGS];
                lags += 1.0;
            }
    const double floor = sum / lags;
    if (fabs(floor) > FLOOR)
        return;
    dst->scale *= sqrt(1.0 - floor);
    for (int dy = 0; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++)
            dst->correlation[dy][dx + LAGS] = (dst->correlation[dy][dx + LAGS] - floor) / (1.0 - floor);
}

static void judge(rx_sky_noise *dst)
{
    double squares = 1.0, largest = 0.0;
    for (int dy = 0; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++) {
            double value = dst->correlation[dy][dx + LAGS];
            if (dx == 0 && dy == 0)
                continue;
            squares += value * value * (dy == 0 ? 1.0 : 2.0);
            largest = fmax(largest, fabs(value));
        }
    dst->error = sqrt(squares / (double)dst->pixels);
    dst->correlated = largest > fmax(4.0 * dst->error, LEAST);
}

rx_status rx_sky_noise_measure(int width, int height, const float *pixels, const rx_map *sigma,
                               const unsigned char *used, rx_sky_noise *dst, rx_error *err)
{
    const size_t n = (size_t)width * (size_t)height;
    double mean = 0.0, spread = 0.0;
    *dst = (rx_sky_noise){0};
    float *z = RX_NEW(float, n);
    if (z == NULL)
        return rx_error_memory(err, n * sizeof(float));
    rx_status status = RX_OK;
    long count = normalise(width, height, pixels, sigma, used, z);
    if (count < ENOUGH)
        status = rx_error_set(err, RX_INPUT,
                              "%ld source-free pixels are too few to measure the noise; %d are needed", count,
                              (int)ENOUGH);
    if (status == RX_OK)
        status = clipped_moments(n, z, count, &mean, &spread, err);
    if (status != RX_OK)
        goto exit;
    for (size_t i = 0; i < n; i++) {
        double d = (double)z[i] - mean;
        z[i] = fabs(d) <= CUT * spread ? (float)d : NAN;
        dst->pixels += !isnan(z[i]);
    }
    dst->scale = spread;
    correlate(width, height, z, dst);
    remove_floor(dst);
    judge(dst);
exit:
    free(z);
    return status;
}

/* --- drawing --- */

/* Root of the power spectrum on the domain, of mean square 1, over the domain's pixels (rx_fft's inverse has
 * no factor). */
static rx_status filter_spectrum(const rx_sky_noise *noise, const rx_fft *fft, float *plane, float *spectrum,
                                 rx_error *err)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft), half = w / 2 + 1;
    const size_t stride = (size_t)rx_fft_stride_real(fft), complex = (size_t)rx_fft_stride_complex(fft);
    double power = 0.0;
    for (int dy = -LAGS; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++) {
            int y = (dy + h) % h, x = (dx + w) % w;
            plane[(size_t)y * stride + (size_t)x] =
                (float)(dy >= 0 ? noise->correlation[dy][dx + LAGS] : noise->correlation[-dy][LAGS - dx]);
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

static rx_status draw_correlated(const rx_sky_noise *noise, int width, int height, const rx_map *sigma,
                                 uint64_t seed, uint64_t stream, int nthreads, float *dst, rx_error *err)
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

rx_status rx_sky_noise_draw(const rx_sky_noise *noise, int width, int height, const rx_map *sigma,
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
