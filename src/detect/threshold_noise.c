/* A strip is made with the rows around it that the filter reaches. */
#include "detect/threshold_noise.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

int rx_noise_strip_new(const rx_threshold_noise *noise, int rows, rx_noise_strip *dst)
{
    const size_t width = (size_t)noise->width, area = width * (size_t)(rows + noise->kernel->height);
    *dst = (rx_noise_strip){.rows = {.width = noise->width, .height = noise->height},
                            .sigma = RX_NEW(float, width),
                            .own = RX_NEW(float, area),
                            .hidden = RX_NEW(uint8_t, area),
                            .sums = RX_NEW(double, width)};
    return dst->sigma != NULL && dst->own != NULL && dst->hidden != NULL && dst->sums != NULL;
}

void rx_noise_strip_free(rx_noise_strip *strip)
{
    free(strip->sigma);
    free(strip->own);
    free(strip->hidden);
    free(strip->sums);
    *strip = (rx_noise_strip){0};
}

void rx_noise_strip_make(const rx_threshold_noise *noise, int y0, int y1, rx_noise_strip *strip)
{
    const int below = noise->kernel->height / 2, above = (noise->kernel->height - 1) / 2;
    const int first = y0 > below ? y0 - below : 0,
              last = y1 + above < noise->height ? y1 + above : noise->height;
    const size_t from = (size_t)first * (size_t)noise->width,
                 n = (size_t)(last - first) * (size_t)noise->width;
    const float *pixels = noise->pixels + from;
    for (size_t i = 0; i < n; i++)
        strip->hidden[i] = !isfinite(pixels[i]);
    for (size_t i = 0; i < n && noise->mask != NULL; i++)
        strip->hidden[i] |= (noise->mask[from + i] & noise->mask_bits) != 0;
    strip->rows.first = first;
    strip->rows.hidden = strip->hidden;
    strip->rows.sigma = rx_map_rows(noise->noise, first, last - first, strip->own);
}

void rx_noise_strip_filter(const rx_threshold_noise *noise, int y, rx_noise_strip *strip)
{
    rx_filter_sigma(noise->kernel, &strip->rows, y, strip->sums, strip->sigma);
}

const float *rx_noise_strip_row(const rx_noise_strip *strip, int y)
{
    return strip->rows.sigma + (size_t)(y - strip->rows.first) * (size_t)strip->rows.width;
}
