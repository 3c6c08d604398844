/* Injection into real pixels. */
#include "simulate/inject.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "simulate/noise.h"
#include "simulate/render.h"
#include "simulate/sky_noise.h"

/* Light that comes in electrons: a Poisson number of them. What the band-limited image of a sharp source has
 * below zero is no light and has no noise. */
static float collect(float light, double gain, uint64_t seed, uint64_t stream, size_t number)
{
    double electrons = (double)light * gain;
    if (!(electrons > 0.0))
        return light;
    return (float)(rx_noise_poisson(electrons, seed, stream, number) / gain);
}

rx_status rx_inject(const rx_scene *scene, const rx_optics *optics, const rx_inject_params *par, int nthreads,
                    float *pixels, rx_error *err)
{
    const long n = (long)scene->width * scene->height;
    const int threads = nthreads > 1 ? nthreads : 1;
    const int together = par->gain > 0.0 && par->noise != NULL && par->noise->correlated;
    rx_status status = RX_OK;
    float *light = NULL, *noise = NULL;
    RX_TRY_EXIT(RX_MAKE(light, (size_t)n, err));
    RX_TRY_EXIT(rx_render(scene, 1, &optics, &light, nthreads, err));
    if (together) {
        RX_TRY_EXIT(RX_MAKE(noise, (size_t)n, err));
#pragma omp parallel for num_threads(threads) schedule(static)
        for (long i = 0; i < n; i++)
            noise[i] = collect(light[i], par->gain, par->seed, par->stream, (size_t)i) - light[i];
        RX_TRY_EXIT(rx_sky_noise_smooth(par->noise, scene->width, scene->height, threads, noise, err));
    }
#pragma omp parallel for num_threads(threads) schedule(static)
    for (long i = 0; i < n; i++) {
        float before = pixels[i];
        float after =
            before + (together          ? light[i] + noise[i]
                      : par->gain > 0.0 ? collect(light[i], par->gain, par->seed, par->stream, (size_t)i)
                                        : light[i]);
        /* a pixel that was above the level before keeps what it had */
        if ((double)after >= par->saturation)
            after = (double)before > par->saturation ? before : (float)par->saturation;
        pixels[i] = after;
    }
exit:
    free(light);
    free(noise);
    return status;
}

/* Euclidean distance to the next bad pixel, in two passes. First along columns: height[i] = rows to the next
 * bad pixel of that column, no more than `far`. */
static void column_distances(int width, int height, const unsigned char *bad, int far, int *rows)
{
    for (int x = 0; x < width; x++) {
        for (int up = 1; up >= 0; up--)
            for (int k = 0, last = far; k < height; k++) {
                const size_t i = (size_t)(up ? k : height - 1 - k) * (size_t)width + (size_t)x;
                last = bad[i] ? 0 : last < far ? last + 1 : far;
                rows[i] = up || last < rows[i] ? last : rows[i];
            }
    }
}

/* Then along a row: a column whose next bad pixel is d rows away forbids what lies within
 * sqrt(distance^2 - d^2) columns. `change` counts how many such intervals begin and end. */
static void forbid_row(int width, const int *rows, double distance, int *change, unsigned char *allowed)
{
    for (int x = 0; x <= width; x++)
        change[x] = 0;
    for (int x = 0; x < width; x++) {
        if ((double)rows[x] > distance)
            continue;
        double reach = floor(sqrt(distance * distance - (double)rows[x] * rows[x]));
        int first = reach < x ? x - (int)reach : 0;
        int end = reach < width - x ? x + (int)reach + 1 : width;
        change[first]++;
        change[end]--;
    }
    for (int x = 0, covered = 0; x < width; x++) {
        covered += change[x];
        allowed[x] = covered == 0;
    }
}

rx_status rx_inject_allowed(int width, int height, const int32_t *segments, const uint8_t *mask,
                            double distance, unsigned char *allowed, rx_error *err)
{
    const size_t n = (size_t)width * (size_t)height;
    for (size_t i = 0; i < n; i++)
        allowed[i] = !((mask != NULL && mask[i] != 0) || (segments != NULL && segments[i] != 0));
    if (!(distance > 0.0))
        return RX_OK;
    /* no pixel of the tile is farther than that from another */
    const double reach = fmin(distance, (double)width + height);
    int *rows = RX_NEW(int, n), *change = RX_NEW(int, (size_t)width + 1);
    unsigned char *bad = RX_NEW(unsigned char, n);
    rx_status status = RX_OK;
    if (rows == NULL || change == NULL || bad == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(int)));
    for (size_t i = 0; i < n; i++)
        bad[i] = !allowed[i];
    column_distances(width, height, bad, (int)reach + 1, rows);
    for (int y = 0; y < height; y++)
        forbid_row(width, rows + (size_t)y * (size_t)width, reach, change,
                   allowed + (size_t)y * (size_t)width);
exit:
    free(rows);
    free(change);
    free(bad);
    return status;
}
