/* The detection filter on planes. */
#include "detect/filter.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"

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
    RX_TRY(RX_MAKE(dst->values, n, err));
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
RX_SIMD static void add_three(float *line, const float *src, int width, int dx, const float *k)
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

static double filtered_variance(const rx_filter *kernel, const rx_noise_rows *rows, int x, int y)
{
    const int width = rows->width, height = rows->height;
    double sum = 0.0, norm = 0.0;
    for (int j = 0; j < kernel->height; j++)
        for (int i = 0; i < kernel->width; i++) {
            int u = x + i - kernel->width / 2, v = y + j - kernel->height / 2;
            double weight = fabs(kernel->values[j * kernel->width + i]);
            bool inside = u >= 0 && u < width && v >= 0 && v < height;
            size_t k = inside ? (size_t)(v - rows->first) * (size_t)width + (size_t)u : 0;
            if (inside && rows->hidden[k])
                continue;
            norm += weight;
            if (inside)
                sum += weight * rows->sigma[k] * rows->sigma[k];
        }
    return norm > 0.0 ? sum / norm : 0.0;
}

/* One row where no pixel that reaches it is hidden: the weights' sum is the same everywhere. */
RX_SIMD static void open_row(const rx_filter *kernel, const rx_noise_rows *rows, int y, double *sums,
                             float *line)
{
    const int width = rows->width;
    double norm = 0.0;
    for (int x = 0; x < width; x++)
        sums[x] = 0.0;
    for (int j = 0; j < kernel->height; j++)
        for (int i = 0; i < kernel->width; i++) {
            const int dx = i - kernel->width / 2, v = y + j - kernel->height / 2;
            const double weight = fabs(kernel->values[j * kernel->width + i]);
            const int first = dx < 0 ? -dx : 0, last = dx > 0 ? width - dx : width;
            norm += weight;
            if (v < 0 || v >= rows->height)
                continue;
            const float *from = rows->sigma + (size_t)width * (size_t)(v - rows->first);
#pragma omp simd
            for (int x = first; x < last; x++)
                sums[x] += weight * from[x + dx] * from[x + dx];
        }
    for (int x = 0; x < width; x++)
        line[x] = (float)sqrt(norm > 0.0 ? sums[x] / norm : 0.0);
}

static bool any_hidden(const rx_filter *kernel, const rx_noise_rows *rows, int y)
{
    int first = y - kernel->height / 2, last = first + kernel->height;
    first = first > 0 ? first : 0;
    last = last < rows->height ? last : rows->height;
    return memchr(rows->hidden + (size_t)(first - rows->first) * (size_t)rows->width, 1,
                  (size_t)(last - first) * (size_t)rows->width) != NULL;
}

void rx_filter_sigma(const rx_filter *kernel, const rx_noise_rows *rows, int y, double *sums, float *line)
{
    const size_t row = (size_t)(y - rows->first) * (size_t)rows->width;
    if (kernel->values != NULL && !any_hidden(kernel, rows, y)) {
        open_row(kernel, rows, y, sums, line);
        return;
    }
    for (int x = 0; x < rows->width; x++)
        line[x] = rows->hidden[row + (size_t)x] ? FLT_MAX
                  : kernel->values == NULL      ? rows->sigma[row + (size_t)x]
                                                : (float)sqrt(filtered_variance(kernel, rows, x, y));
}
