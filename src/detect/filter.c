/* The detection filter on planes. */
#include "detect/filter.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

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
    for (int x = first; x < last; x++)
        line[x] += k * src[x + dx];
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

void rx_filter_plane(const rx_filter *kernel, const float *src, int width, int height, float *dst)
{
    size_t row = (size_t)width;
    if (kernel->values == NULL) {
        memcpy(dst, src, row * (size_t)height * sizeof(float));
        return;
    }
    for (int y = 0; y < height; y++) {
        float *line = dst + row * (size_t)y;
        memset(line, 0, row * sizeof(float));
        for (int j = 0; j < kernel->height; j++) {
            int from = y + j - kernel->height / 2;
            if (from < 0 || from >= height)
                continue;
            for (int i = 0; i < kernel->width; i++)
                add_shifted(line, src + row * (size_t)from, width, i - kernel->width / 2,
                            kernel->values[j * kernel->width + i]);
        }
    }
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

void rx_filter_sigma(const rx_filter *kernel, const float *sigma, const uint8_t *hidden, int width,
                     int height, float *dst)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            size_t k = (size_t)y * (size_t)width + (size_t)x;
            if (hidden[k])
                dst[k] = 1e30f;
            else if (kernel->values == NULL)
                dst[k] = sigma[k];
            else
                dst[k] = (float)sqrt(filtered_variance(kernel, sigma, hidden, width, height, x, y));
        }
}
