/* Flat sky by the largest neighbour, rows first, then columns. */
#include "nn/flat_sky.h"

#include <math.h>
#include <stddef.h>

#include "num/largest.h"

int rx_flat_sky_reach(double fwhm)
{
    return (int)fmin(16, fmax(2, ceil(1.25 * fwhm)));
}

float rx_flat_sky_level(double fwhm)
{
    return (float)(1 + fmin(1, fmax(0, (2.4 - fwhm) / 0.5)));
}

static float share(float m, float level)
{
    const float u = 2 * m / level - 1;
    return u <= 0 ? 0 : u >= 1 ? 1 : u * u * (3 - 2 * u);
}

void rx_flat_sky(int width, int height, double fwhm, int nthreads, float *v, float *scratch)
{
    enum { STRIP = 256 }; /* columns that a thread does at a time, so that m needs no memory of its own */
    const size_t stride = (size_t)width;
    const int reach = rx_flat_sky_reach(fwhm);
    const float level = rx_flat_sky_level(fwhm);
    rx_largest_in_rows(v, width, height, reach, nthreads, scratch);
#pragma omp parallel for num_threads(nthreads) schedule(static)
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x += STRIP) {
            const int n = width - x < STRIP ? width - x : STRIP;
            float m[STRIP], *row = v + (size_t)y * stride + (size_t)x;
            rx_largest_over_rows(scratch, width, height, reach, x, y, n, m);
            for (int i = 0; i < n; i++)
                row[i] *= share(m[i], level);
        }
    }
}
