/* From light to the exposed image. */
#include "simulate/noise.h"

#include <math.h>
#include <stddef.h>

#include "base/random.h"
#include "simulate/cosmic_rays.h"

enum { CHUNK = 1024 }; /* pixels that a thread takes at a time */

/* Each purpose has its own stream beside the caller's. */
enum { PURPOSE_GAUSS = 0xE1, PURPOSE_PHOTONS, PURPOSE_READ, PURPOSE_COLUMNS, PURPOSE_COSMIC };

static uint64_t purpose_stream(const rx_noise_params *par, int purpose)
{
    return par->stream ^ (uint64_t)purpose << 56;
}

double rx_noise_sigma(const rx_noise_params *par)
{
    if (par->type == RX_NOISE_CCD)
        return sqrt(par->sky / par->gain + par->read_noise * par->read_noise / (par->gain * par->gain));
    return par->type == RX_NOISE_GAUSS ? par->sigma : 0.0;
}

/* Pixels first .. first + n - 1: sky, photons, read noise. */
static void expose_chunk(const rx_noise_params *p, size_t first, size_t n, float *pixels)
{
    float normals[CHUNK];
    const float sky = (float)p->sky, sigma = (float)p->sigma;
    switch (p->type) {
    case RX_NOISE_NONE:
        for (size_t i = 0; i < n; i++)
            pixels[i] += sky;
        break;
    case RX_NOISE_GAUSS:
        rx_noise_normals(p->seed, purpose_stream(p, PURPOSE_GAUSS), first, (long)n, normals);
        for (size_t i = 0; i < n; i++)
            pixels[i] = pixels[i] + sky + sigma * normals[i];
        break;
    case RX_NOISE_CCD:
        rx_noise_normals(p->seed, purpose_stream(p, PURPOSE_READ), first, (long)n, normals);
        for (size_t i = 0; i < n; i++) {
            double mean = ((double)pixels[i] + p->sky) * p->gain;
            double electrons = rx_noise_poisson(mean, p->seed, purpose_stream(p, PURPOSE_PHOTONS), first + i);
            pixels[i] = (float)((electrons + p->read_noise * (double)normals[i]) / p->gain);
        }
        break;
    }
}

/* In order: tracks may cross. */
static void add_cosmic_rays(const rx_noise_params *p, int width, int height, float *pixels, uint8_t *defects)
{
    const uint64_t stream = purpose_stream(p, PURPOSE_COSMIC);
    double mean = p->cosmic_rays * 1e-6 * width * height;
    /* the last counter of the stream belongs to no ray */
    uint64_t hits = (uint64_t)rx_noise_poisson(mean, p->seed, stream, ((uint64_t)1 << 48) - 1);
    for (uint64_t k = 0; k < hits; k++) {
        rx_cosmic_ray ray;
        rx_cosmic_ray_make(p->seed, stream, k, width, height, &ray);
        rx_cosmic_ray_add(&ray, p->gain, width, height, pixels, defects, RX_DEFECT_COSMIC);
    }
}

static void saturate(float most, size_t n, float *pixels, uint8_t *defects)
{
    for (size_t i = 0; i < n; i++)
        if (pixels[i] >= most) {
            pixels[i] = most;
            if (defects != NULL)
                defects[i] |= RX_DEFECT_SATURATED;
        }
}

static void kill_columns(const rx_noise_params *p, int width, int height, float *pixels, uint8_t *defects)
{
    for (int x = 0; x < width; x++) {
        if (rx_random_uniform(p->seed, purpose_stream(p, PURPOSE_COLUMNS), (uint64_t)x) >= p->bad_columns)
            continue;
        for (size_t y = 0; y < (size_t)height; y++) {
            pixels[y * (size_t)width + (size_t)x] = 0.0f;
            if (defects != NULL)
                defects[y * (size_t)width + (size_t)x] = RX_DEFECT_COLUMN;
        }
    }
}

void rx_noise_expose(const rx_noise_params *par, int width, int height, float *pixels, uint8_t *defects,
                     int nthreads)
{
    const size_t n = (size_t)width * (size_t)height;
    if (nthreads < 1)
        nthreads = 1;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (size_t first = 0; first < n; first += CHUNK)
        expose_chunk(par, first, n - first < CHUNK ? n - first : CHUNK, pixels + first);
    if (par->type == RX_NOISE_CCD && par->cosmic_rays > 0.0)
        add_cosmic_rays(par, width, height, pixels, defects);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (size_t first = 0; first < n; first += CHUNK)
        saturate((float)par->saturation, n - first < CHUNK ? n - first : CHUNK, pixels + first,
                 defects != NULL ? defects + first : NULL);
    if (par->type == RX_NOISE_CCD && par->bad_columns > 0.0)
        kill_columns(par, width, height, pixels, defects);
}
