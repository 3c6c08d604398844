/* Drawing more of a tile's noise. */
#include "simulate/sky_noise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/noise.h"

enum {
    LAGS = RX_NOISE_REACH,
    MARGIN = 32 /* pixels that a realisation is wider than the tile: the filter's reach, as FFTs are cyclic */
};

typedef enum rx_unit { UNIT_PIXEL, UNIT_SUM } rx_unit; /* mean square 1, or value 1 at frequency zero */

/* Root of the power spectrum on the domain, over the domain's pixels (rx_fft's inverse has no factor). */
static rx_status filter_spectrum(const rx_noise_correlation *noise, rx_unit unit, const rx_fft *fft,
                                 float *plane, float *spectrum, rx_error *err)
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
            /* the half that is not stored holds the same again, but for u = 0 and, of an even width, the last */
            double twice = u == 0 || 2 * u == w ? 1.0 : 2.0;
            value[0] = fmaxf(value[0], 0.0f);
            value[1] = 0.0f;
            power += twice * (double)value[0];
        }
    const double cells = (double)w * h, wide = rx_noise_factor_wide(noise);
    const double one = unit == UNIT_SUM ? wide * wide : power / cells;
    if (!(power > 0.0))
        return rx_error_set(err, RX_INPUT, "the correlation of the noise has no power at any frequency");
    for (int u = 0; u < half; u++)
        for (int v = 0; v < h; v++) {
            float *value = spectrum + 2 * ((size_t)u * complex + (size_t)v);
            value[0] = (float)(sqrt((double)value[0] / one) / cells);
        }
    return RX_OK;
}

rx_status rx_sky_noise_filter(const rx_noise_correlation *noise, const rx_fft *fft, float *plane,
                              float *filter, rx_error *err)
{
    memset(plane, 0, (size_t)rx_fft_height(fft) * (size_t)rx_fft_stride_real(fft) * sizeof *plane);
    return filter_spectrum(noise, UNIT_PIXEL, fft, plane, filter, err);
}

static void scale_row(double scale, int width, int y, const rx_map *sigmas, const float *unit, float *dst)
{
    for (int x = 0; x < width; x += RX_MAP_PIECE) {
        const int n = rx_map_piece(x, width);
        float room[RX_MAP_PIECE];
        const float *sigma = rx_map_row(sigmas, y, x, n, room);
        for (int k = 0; k < n; k++)
            dst[x + k] = (float)scale * sigma[k] * unit[x + k];
    }
}

/* What is filtered: rows of the domain, `across` pixels long. */
typedef struct plane {
    float *pixels; /* [height][width] */
    int width, height, across;
    double scale; /* of what is drawn, */
    const rx_map *sigma;
    rx_random_stream from;
} plane;

static int draw_row(void *user, int y, float *line)
{
    const plane *p = user;
    rx_noise_normals(p->from.seed, p->from.stream, (uint64_t)y * (uint64_t)p->across, p->across, line);
    return 1;
}

static void write_scaled(void *user, int y, float *line)
{
    const plane *p = user;
    scale_row(p->scale, p->width, y, p->sigma, line, p->pixels + (size_t)y * (size_t)p->width);
}

static int read_row(void *user, int y, float *line)
{
    const plane *p = user;
    if (y >= p->height)
        return 0;
    memcpy(line, p->pixels + (size_t)y * (size_t)p->width, (size_t)p->width * sizeof *line);
    memset(line + p->width, 0, (size_t)(p->across - p->width) * sizeof *line);
    return 1;
}

static void write_row(void *user, int y, float *line)
{
    const plane *p = user;
    memcpy(p->pixels + (size_t)y * (size_t)p->width, line, (size_t)p->width * sizeof *line);
}

static rx_status filter_rows(const rx_noise_correlation *noise, rx_unit unit, plane *p, rx_fft_read read,
                             rx_fft_write write, int nthreads, rx_error *err)
{
    rx_fft *fft = NULL;
    float *lags = NULL, *spectrum = NULL, *half = NULL;
    rx_status status = RX_OK;
    RX_TRY(rx_fft_new(rx_fft_good_size(p->width + MARGIN), rx_fft_good_size(p->height + MARGIN), nthreads,
                      &fft, err));
    lags = rx_fft_real(fft);
    spectrum = rx_fft_complex(fft);
    half = rx_fft_complex(fft);
    if (lags == NULL || spectrum == NULL || half == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(filter_spectrum(noise, unit, fft, lags, spectrum, err));
    p->across = rx_fft_width(fft);
    rx_fft_filter_rows(fft, &(rx_fft_rows){read, write, p, 0, p->height}, spectrum, false, half);
exit:
    free(lags);
    free(spectrum);
    free(half);
    rx_fft_free(fft);
    return status;
}

rx_status rx_sky_noise_smooth(const rx_noise_correlation *noise, int width, int height, int nthreads,
                              float *pixels, rx_error *err)
{
    plane p = {.pixels = pixels, .width = width, .height = height};
    return noise->correlated ? filter_rows(noise, UNIT_SUM, &p, read_row, write_row, nthreads, err) : RX_OK;
}

rx_status rx_sky_noise_draw(const rx_noise_correlation *noise, const rx_map *sigma, int height,
                            rx_random_stream from, int nthreads, float *dst, rx_error *err)
{
    const int threads = nthreads > 1 ? nthreads : 1, width = sigma->width;
    plane p = {dst, width, height, width, noise->scale, sigma, from};
    if (noise->correlated)
        return filter_rows(noise, UNIT_PIXEL, &p, draw_row, write_scaled, threads, err);
#pragma omp parallel for num_threads(threads) schedule(static)
    for (int y = 0; y < height; y++) {
        float *row = dst + (size_t)y * (size_t)width;
        draw_row(&p, y, row);
        scale_row(p.scale, width, y, sigma, row, row);
    }
    return RX_OK;
}
