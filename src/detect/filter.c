/* The detection filter on planes. */
#include "detect/filter.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <omp.h>

#include "base/memory.h"

rx_status rx_filter_new(const float *values, int width, int height, rx_filter *dst, rx_error *err)
{
    *dst = (rx_filter){.sum = 1.0};
    if (values == NULL || width < 1 || height < 1)
        return RX_OK;
    size_t n = (size_t)width * (size_t)height;
    float sum = 0.0f; /* float, as sep adds it up */
    for (size_t i = 0; i < n; i++)
        sum += fabsf(values[i]);
    if (!(sum > 0.0f) || !isfinite(sum))
        return rx_error_set(err, RX_USAGE,
                            "FILTER_NAME: all values of the filter are zero; use FILTER N instead");
    dst->values = RX_NEW(float, n);
    if (dst->values == NULL)
        return rx_error_memory(err, n * sizeof(float));
    for (size_t i = 0; i < n; i++)
        dst->values[i] = values[i] / sum;
    dst->width = width;
    dst->height = height;
    dst->sum = sum;
    return RX_OK;
}

void rx_filter_free(rx_filter *kernel)
{
    free(kernel->values);
    *kernel = (rx_filter){.sum = 1.0};
}

/* line += k * src shifted by dx, inside the image. */
static void add_shifted(float *line, const float *src, int width, int dx, float k)
{
    int first = dx < 0 ? -dx : 0;
    int last = dx > 0 ? width - dx : width;
#pragma omp simd
    for (int x = first; x < last; x++)
        line[x] += k * src[x + dx];
}

/* The same with three neighbouring values of the kernel, k[0] at dx: the line is read and written once. */
static void add_three(float *line, const float *src, int width, int dx, const float *k)
{
    const int first = dx < 0 ? -dx : 0, last = dx + 2 > 0 ? width - dx - 2 : width;
    if (first >= last) {
        for (int i = 0; i < 3; i++)
            add_shifted(line, src, width, dx + i, k[i]);
        return;
    }
    for (int x = 0; x < width; x++) {
        if (x == first)
            x = last;
        for (int i = 0; i < 3 && x < width; i++)
            if (x + dx + i >= 0 && x + dx + i < width)
                line[x] += k[i] * src[x + dx + i];
    }
    const float k0 = k[0], k1 = k[1], k2 = k[2];
#pragma omp simd
    for (int x = first; x < last; x++)
        line[x] = line[x] + k0 * src[x + dx] + k1 * src[x + dx + 1] + k2 * src[x + dx + 2];
}

double rx_filter_norm(const float *values, int n)
{
    double sum = 0, power = 0;
    for (int i = 0; i < n; i++) {
        sum += fabs((double)values[i]);
        power += (double)values[i] * (double)values[i];
    }
    return power > 0 ? sqrt(power) / sum : 1;
}

static void filter_row(const rx_filter *kernel, const float *src, int width, int height, int y, float *line)
{
    memset(line, 0, (size_t)width * sizeof *line);
    for (int j = 0; j < kernel->height; j++) {
        const int v = y + j - kernel->height / 2;
        const float *from = src + (size_t)width * (size_t)v, *k = kernel->values + j * kernel->width;
        if (v < 0 || v >= height)
            continue;
        int i = 0;
        for (; i + 3 <= kernel->width; i += 3)
            add_three(line, from, width, i - kernel->width / 2, k + i);
        for (; i < kernel->width; i++)
            add_shifted(line, from, width, i - kernel->width / 2, k[i]);
    }
}

void rx_filter_plane(const rx_filter *kernel, const float *src, int width, int height, int nthreads,
                     float *dst)
{
    const size_t row = (size_t)width;
    if (kernel->values == NULL) {
        memcpy(dst, src, row * (size_t)height * sizeof(float));
        return;
    }
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int y = 0; y < height; y++)
        filter_row(kernel, src, width, height, y, dst + row * (size_t)y);
}

static double filtered_variance(const rx_filter *kernel, const float *sigma, const uint8_t *hidden, int width,
                                int height, int x, int y)
{
    double sum = 0.0, norm = 0.0;
    for (int j = 0; j < kernel->height; j++)
        for (int i = 0; i < kernel->width; i++) {
            int u = x + i - kernel->width / 2, v = y + j - kernel->height / 2;
            double weight = fabs(kernel->values[j * kernel->width + i]);
            bool inside = u >= 0 && u < width && v >= 0 && v < height;
            size_t k = inside ? (size_t)v * (size_t)width + (size_t)u : 0;
            if (inside && hidden[k])
                continue;
            norm += weight;
            if (inside)
                sum += weight * sigma[k] * sigma[k];
        }
    return norm > 0.0 ? sum / norm : 0.0;
}

/* One row where no pixel that reaches it is hidden: the weights' sum is the same everywhere. */
static void open_row(const rx_filter *kernel, const float *sigma, int width, int height, int y, double *sums,
                     float *line)
{
    double norm = 0.0;
    for (int x = 0; x < width; x++)
        sums[x] = 0.0;
    for (int j = 0; j < kernel->height; j++)
        for (int i = 0; i < kernel->width; i++) {
            const int dx = i - kernel->width / 2, v = y + j - kernel->height / 2;
            const double weight = fabs(kernel->values[j * kernel->width + i]);
            const int first = dx < 0 ? -dx : 0, last = dx > 0 ? width - dx : width;
            const float *from = sigma + (size_t)width * (size_t)v;
            norm += weight;
            if (v < 0 || v >= height)
                continue;
#pragma omp simd
            for (int x = first; x < last; x++)
                sums[x] += weight * from[x + dx] * from[x + dx];
        }
    for (int x = 0; x < width; x++)
        line[x] = (float)sqrt(norm > 0.0 ? sums[x] / norm : 0.0);
}

static bool any_hidden(const rx_filter *kernel, const uint8_t *hidden, int width, int height, int y)
{
    int first = y - kernel->height / 2, last = first + kernel->height;
    first = first > 0 ? first : 0;
    last = last < height ? last : height;
    return memchr(hidden + (size_t)first * (size_t)width, 1, (size_t)(last - first) * (size_t)width) != NULL;
}

rx_status rx_filter_sigma(const rx_filter *kernel, const float *sigma, const uint8_t *hidden, int width,
                          int height, int nthreads, float *dst, rx_error *err)
{
    const int n = nthreads > 0 ? nthreads : 1;
    double *sums = RX_NEW(double, (size_t)n *(size_t)width);
    if (sums == NULL)
        return rx_error_memory(err, (size_t)n * (size_t)width * sizeof *sums);
#pragma omp parallel for schedule(static) num_threads(n)
    for (int y = 0; y < height; y++) {
        const size_t row = (size_t)y * (size_t)width;
        if (kernel->values != NULL && !any_hidden(kernel, hidden, width, height, y)) {
            open_row(kernel, sigma, width, height, y, sums + (size_t)omp_get_thread_num() * (size_t)width,
                     dst + row);
            continue;
        }
        for (int x = 0; x < width; x++)
            dst[row + (size_t)x] =
                hidden[row + (size_t)x] ? 1e30f
                : kernel->values == NULL
                    ? sigma[row + (size_t)x]
                    : (float)sqrt(filtered_variance(kernel, sigma, hidden, width, height, x, y));
    }
    free(sums);
    return RX_OK;
}
