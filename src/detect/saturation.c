/* Do pixels pile up at the top of a tile? */
#include "detect/saturation.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

enum { SAMPLE = 20000 };
static const double FLAT = 0.05, PILE = 0.2, ABOVE = 0.1;
static const double BRIGHT = 20.0; /* sigmas of the sky: FLAT of that is one sigma, below tops are noise */

static rx_status measure_sky(const rx_image *image, const uint8_t *mask, double sky[2], rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height, step = n / SAMPLE + 1;
    double *values;
    size_t count = 0;
    RX_TRY(RX_MAKE(values, n / step + 1, err));
    for (size_t k = 0; k < n; k += step)
        if (mask[k] == 0)
            values[count++] = (double)image->pixels[k];
    sky[1] = rx_sigma_mad(values, count, &sky[0]);
    free(values);
    return RX_OK;
}

/* The highest value that all of 3 x 3 pixels reach; `least` where there is none above it. */
static float top_of(const rx_image *image, const uint8_t *mask, float least)
{
    const size_t width = (size_t)image->width;
    float top = least;
    for (int y = 1; y < image->height - 1; y++)
        for (int x = 1; x < image->width - 1; x++) {
            const size_t middle = (size_t)y * width + (size_t)x;
            float lowest = image->pixels[middle];
            for (int i = 0; i < 9 && lowest > top; i++) {
                const size_t k = middle + (size_t)(i / 3) * width + (size_t)(i % 3) - width - 1;
                lowest = mask[k] != 0 ? least : fminf(lowest, image->pixels[k]);
            }
            top = fmaxf(top, lowest);
        }
    return top;
}

rx_status rx_saturation_find(const rx_image *image, const uint8_t *mask, double *level, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    double sky[2], above = 0, flat = 0, half = 0;
    *level = HUGE_VAL;
    RX_TRY(measure_sky(image, mask, sky, err));
    if (!(sky[1] > 0.0))
        return RX_OK;
    const float least = (float)(sky[0] + BRIGHT * sky[1]), top = top_of(image, mask, least);
    if (!(top > least))
        return RX_OK;
    const double height = (double)top - sky[0];
    const float from = (float)(sky[0] + (1.0 - FLAT) * height), to = (float)(sky[0] + (1.0 + FLAT) * height),
                middle = (float)(sky[0] + 0.5 * height);
#pragma omp simd reduction(+ : above, flat, half)
    for (size_t k = 0; k < n; k++) {
        const float value = mask[k] == 0 ? image->pixels[k] : 0.0f;
        above += value > to;
        flat += value >= from;
        half += value > middle;
    }
    flat -= above;
    if (flat > PILE * half && above < ABOVE * flat)
        *level = (double)from;
    return RX_OK;
}
