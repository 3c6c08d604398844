/* The largest value in a square neighbourhood. */
#include "num/maximum_filter.h"

#include <string.h>

/* dst[k] = the larger of both. */
static void raise_line(const float *restrict src, int n, float *restrict dst)
{
#pragma omp simd
    for (int k = 0; k < n; k++)
        dst[k] = src[k] > dst[k] ? src[k] : dst[k];
}

void rx_maximum_filter_in_rows(const float *src, int width, int height, int reach, int nthreads, float *dst)
{
    const size_t stride = (size_t)width;
#pragma omp parallel for num_threads(nthreads) schedule(static) if (nthreads > 1)
    for (int y = 0; y < height; y++) {
        const float *from = src + (size_t)y * stride;
        float *to = dst + (size_t)y * stride;
        memcpy(to, from, stride * sizeof *to);
        for (int d = 1; d <= reach && d < width; d++) {
            raise_line(from, width - d, to + d);
            raise_line(from + d, width - d, to);
        }
    }
}

void rx_maximum_filter_over_rows(const float *rows, int width, int height, int reach, int y, float *dst)
{
    const int first = y > reach ? y - reach : 0, last = height - 1 - y > reach ? y + reach : height - 1;
    memcpy(dst, rows + (size_t)first * (size_t)width, (size_t)width * sizeof *dst);
    for (int k = first + 1; k <= last; k++)
        raise_line(rows + (size_t)k * (size_t)width, width, dst);
}

void rx_maximum_filter(const float *src, int width, int height, int reach, int nthreads, float *scratch,
                       float *dst)
{
    rx_maximum_filter_in_rows(src, width, height, reach, nthreads, scratch);
#pragma omp parallel for num_threads(nthreads) schedule(static) if (nthreads > 1)
    for (int y = 0; y < height; y++)
        rx_maximum_filter_over_rows(scratch, width, height, reach, y, dst + (size_t)y * (size_t)width);
}
