/* Powers of two near the noise, and values beyond all. */
#include "data/unit.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"

enum { MOST = 30 }; /* ordinary tiles are within: they are worked on as they are */
enum { FEW = 4 };   /* a quarter of the pixels: what differs in fewer is marks in a constant, not noise */

double rx_unit_of(double noise)
{
    const int power = noise > 0.0 && isfinite(noise) ? ilogb(noise) : 0;
    return abs(power) > MOST ? ldexp(1.0, power) : 1.0;
}

void rx_unit_divide(float *values, size_t n, double unit)
{
    for (size_t i = 0; values != NULL && i < n; i++)
        values[i] = (float)(values[i] / unit);
}

float *rx_unit_copy(const float *values, size_t n, double unit)
{
    float *copy = RX_NEW(float, n);
    if (copy != NULL) {
        memcpy(copy, values, n * sizeof *copy);
        rx_unit_divide(copy, n, unit);
    }
    return copy;
}

RX_SIMD static float brightest(const float *pixels, size_t n)
{
    float most = 0.0f;
#pragma omp simd reduction(max : most)
    for (size_t i = 0; i < n; i++) {
        const float size = fabsf(pixels[i]);
        most = size <= FLT_MAX && size > most ? size : most;
    }
    return most;
}

double rx_unit_of_pixels(const float *pixels, int width, int height)
{
    enum { LOWEST = -149, POWERS = FLT_MAX_EXP - LOWEST + 1 };
    const size_t pairs = (size_t)(width - 1) * (size_t)height;
    size_t count[POWERS] = {0}, all = 0, below = 0;
    int power = 0;
    if (brightest(pixels, (size_t)width * (size_t)height) < ldexpf(1.0f, MOST))
        return 1.0;
    for (int y = 0; y < height; y++)
        for (int x = 1; x < width; x++) {
            const float *pixel = pixels + (size_t)y * (size_t)width + (size_t)x;
            const double by = fabs((double)pixel[0] - (double)pixel[-1]);
            if (by > 0.0 && by <= 2.0 * (double)FLT_MAX) {
                count[ilogb(by) - LOWEST]++;
                all++;
            }
        }
    while (power < POWERS && (below += count[power]) <= all / 2)
        power++;
    return FEW * all > pairs ? fmax(rx_unit_of(ldexp(1.0, power + LOWEST)), 1.0) : 1.0;
}

float rx_pixel_limit(const float *pixels, int width, int height)
{
    return (float)fmin(RX_PIXEL_MOST * rx_unit_of_pixels(pixels, width, height), FLT_MAX);
}
