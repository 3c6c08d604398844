/* Flat sky by the largest neighbour. */
#include "nn/flat_sky.h"

#include <stddef.h>

enum { REACH = 3 };
static const float FAINTEST = 0.5f; /* t */

static float share(float m)
{
    const float u = 2 * m / FAINTEST - 1;
    return u <= 0 ? 0 : u >= 1 ? 1 : u * u * (3 - 2 * u);
}

/* Largest of up to 2 REACH + 1 values around place i of n, `step` floats apart. */
static float largest(const float *line, int i, int n, size_t step)
{
    const int first = i > REACH ? i - REACH : 0, last = i + REACH < n ? i + REACH : n - 1;
    float most = line[(size_t)first * step];
    for (int k = first + 1; k <= last; k++)
        most = line[(size_t)k * step] > most ? line[(size_t)k * step] : most;
    return most;
}

void rx_flat_sky(int width, int height, int nthreads, float *v, float *scratch)
{
    const size_t stride = (size_t)width;
#pragma omp parallel for num_threads(nthreads) schedule(static)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            scratch[(size_t)y * stride + (size_t)x] = largest(v + (size_t)y * stride, x, width, 1);
#pragma omp parallel for num_threads(nthreads) schedule(static)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            v[(size_t)y * stride + (size_t)x] *= share(largest(scratch + (size_t)x, y, height, stride));
}
