/* Deviates, cosmic rays, and from light to the exposed image. */
#include "simulate/noise.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "base/random.h"

/* --- normal deviates in bulk: every step is a loop that the compiler makes vectors of, with the same roundings on any machine
 * (no library function, no reordering) --- */

enum { BLOCKS = 256 }; /* random blocks at a time, four deviates each */

/* -2 ln u of u = (word + 1/2) / 2^32 to 1e-7; 0 where u rounds to 1. ln m = 2 artanh(s), s = (m-1)/(m+1), of
 * the mantissa m in sqrt(1/2) .. sqrt(2). */
static inline float minus_two_log(uint32_t word)
{
    const int32_t root = 0x3F3504F3; /* bits of sqrt(1/2) */
    float u = ((float)(int32_t)(word >> 16) * 65536.0f + ((float)(int32_t)(word & 0xFFFF) + 0.5f)) * 0x1p-32f;
    int32_t bits;
    memcpy(&bits, &u, sizeof bits);
    int32_t above = bits - root, exponent = above >> 23, mantissa = (above & 0x7FFFFF) + root;
    float m;
    memcpy(&m, &mantissa, sizeof m);
    float s = (m - 1.0f) / (m + 1.0f), z = s * s;
    float log_m = s * (2.0f + z * (2.0f / 3 + z * (2.0f / 5 + z * (2.0f / 7 + z * (2.0f / 9)))));
    return -2.0f * ((float)exponent * 0.693147181f + log_m);
}

/* By Newton's rule from the well-known first guess at 1/sqrt; sqrtf() sets errno, which no vector does. */
static inline float square_root(float x)
{
    uint32_t bits; /* unsigned: x is -0 where u rounds to 1 */
    float y;
    memcpy(&bits, &x, sizeof bits);
    bits = 0x5F3759DFu - (bits >> 1);
    memcpy(&y, &bits, sizeof y);
    for (int k = 0; k < 3; k++)
        y *= 1.5f - 0.5f * x * y * y;
    return x * y;
}

/* Four deviates from each block of words [4][BLOCKS]: two pairs, radius and angle. */
static void make_normals(const uint32_t *words, float *dst)
{
    for (int pair = 0; pair < 2; pair++) {
        const uint32_t *length = words + 2 * pair * BLOCKS, *turn = length + BLOCKS;
        float first[BLOCKS], second[BLOCKS];
#pragma omp simd
        for (int i = 0; i < BLOCKS; i++) {
            float r = square_root(minus_two_log(length[i]));
            /* a quarter turn, and what is left of it: -1/8 .. 1/8 turn */
            uint32_t quarter = (turn[i] + 0x20000000u) >> 30;
            float x = (float)(int32_t)(turn[i] - (quarter << 30)) * 1.4629180792671596e-9f, z = x * x;
            float sine =
                x * (1.0f - z * (1.0f / 6 - z * (1.0f / 120 - z * (1.0f / 5040 - z * (1.0f / 362880)))));
            float cosine = 1.0f - z * (0.5f - z * (1.0f / 24 - z * (1.0f / 720 - z * (1.0f / 40320))));
            float across = quarter & 1 ? sine : cosine, along = quarter & 1 ? cosine : sine;
            float a = quarter == 1 || quarter == 2 ? -across : across;
            float b = quarter >= 2 ? -along : along;
            first[i] = r * a;
            second[i] = r * b;
        }
        for (int i = 0; i < BLOCKS; i++) {
            dst[4 * i + 2 * pair] = first[i];
            dst[4 * i + 2 * pair + 1] = second[i];
        }
    }
}

void rx_noise_normals(uint64_t seed, uint64_t stream, uint64_t first, long n, float *dst)
{
    uint32_t words[4 * BLOCKS];
    float normals[4 * BLOCKS];
    long skip = (long)(first % 4);
    uint64_t block = first / 4;
    while (n > 0) {
        long here = 4 * BLOCKS - skip < n ? 4 * BLOCKS - skip : n;
        rx_random_blocks(seed, stream, block, BLOCKS, words);
        make_normals(words, normals);
        memcpy(dst, normals + skip, sizeof(float) * (size_t)here);
        dst += here;
        n -= here;
        block += BLOCKS;
        skip = 0;
    }
}

/* --- Poisson deviates --- */

#define LARGE 10.0 /* PTRS is valid from here on */
#define HUGE_MEAN 1e12
enum { TRIAL_SHIFT = 48, INVERSION_MOST = 200 }; /* P(k > 200) of a mean of 10 is below 1e-160 */

static double invert(double mean, double u)
{
    double p = exp(-mean);
    int k = 0;
    while (u > p && k < INVERSION_MOST) {
        u -= p;
        p *= mean / ++k;
    }
    return k;
}

/* Transformed rejection with squeeze (Hormann 1993, Insurance: Mathematics and Economics 12, 39), algorithm
 * PTRS: its constants. */
static double transformed_rejection(double mean, uint64_t seed, uint64_t stream, uint64_t number)
{
    double b = 0.931 + 2.53 * sqrt(mean), a = -0.059 + 0.02483 * b;
    double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4), squeeze = 0.9277 - 3.6224 / (b - 2.0);
    for (uint64_t trial = 0;; trial++) {
        double both[2];
        int sign;
        rx_random_two(seed, stream, number + (trial << TRIAL_SHIFT), both);
        double u = both[0] - 0.5, v = both[1], us = 0.5 - fabs(u);
        double k = floor((2.0 * a / us + b) * u + mean + 0.43);
        if (us >= 0.07 && v <= squeeze)
            return k;
        if (k < 0.0 || (us < 0.013 && v > us))
            continue;
        if (log(v * inverse_alpha / (a / (us * us) + b)) <= k * log(mean) - mean - lgamma_r(k + 1.0, &sign))
            return k;
    }
}

double rx_noise_poisson(double mean, uint64_t seed, uint64_t stream, uint64_t number)
{
    if (!(mean > 0.0))
        return 0.0;
    if (mean < LARGE)
        return invert(mean, rx_random_uniform(seed, stream, number));
    if (mean < HUGE_MEAN)
        return transformed_rejection(mean, seed, stream, number);
    return floor(mean + sqrt(mean) * rx_random_normal(seed, stream, number) + 0.5);
}

/* --- cosmic rays --- */

enum { DRAWS = 8 }; /* counters of one ray */

void rx_cosmic_ray_make(uint64_t seed, uint64_t stream, uint64_t number, int width, int height,
                        rx_cosmic_ray *dst)
{
    const uint64_t first = number * DRAWS;
    double cosine = pow(rx_random_uniform(seed, stream, first), 0.25); /* P(cos < c) = c^4 */
    double azimuth = 2.0 * M_PI * rx_random_uniform(seed, stream, first + 1);
    double tangent = sqrt(fmax(1.0 / (cosine * cosine) - 1.0, 0.0));
    double length = fmin(RX_COSMIC_DEPTH * tangent, RX_COSMIC_LONGEST);
    double path = hypot(length, RX_COSMIC_DEPTH), normal = rx_random_normal(seed, stream, first + 2);
    double moyal = -log(fmax(normal * normal, 1e-300));
    dst->x = width * rx_random_uniform(seed, stream, first + 3) - 0.5;
    dst->y = height * rx_random_uniform(seed, stream, first + 4) - 0.5;
    dst->dx = length * cos(azimuth);
    dst->dy = length * sin(azimuth);
    dst->charge = RX_COSMIC_CHARGE * path * fmax(1.0 + 0.15 * moyal, 0.3);
}

/* Where the track next leaves a pixel along one axis, as a share of its length; 2 = never. */
static double next_border(double start, double step, int pixel)
{
    if (step == 0.0)
        return 2.0;
    return (pixel + (step > 0.0 ? 0.5 : -0.5) - start) / step;
}

void rx_cosmic_ray_add(const rx_cosmic_ray *ray, double gain, int width, int height, float *pixels,
                       uint8_t *defects, uint8_t bit)
{
    int x = (int)floor(ray->x + 0.5), y = (int)floor(ray->y + 0.5);
    double at = 0.0;
    while (at < 1.0) {
        double across = next_border(ray->x, ray->dx, x), up = next_border(ray->y, ray->dy, y);
        double leave = fmin(fmin(across, up), 1.0);
        if (x >= 0 && y >= 0 && x < width && y < height) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            pixels[i] += (float)(ray->charge * fmax(leave - at, 0.0) / gain);
            if (defects != NULL)
                defects[i] |= bit;
        }
        at = leave;
        if (across <= up)
            x += ray->dx > 0.0 ? 1 : -1;
        else
            y += ray->dy > 0.0 ? 1 : -1;
    }
}

/* --- exposures --- */

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
    const float most = (float)par->saturation;
    if (nthreads < 1)
        nthreads = 1;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (size_t first = 0; first < n; first += CHUNK)
        expose_chunk(par, first, n - first < CHUNK ? n - first : CHUNK, pixels + first);
    if (par->type == RX_NOISE_CCD && par->cosmic_rays > 0.0)
        add_cosmic_rays(par, width, height, pixels, defects);
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (size_t i = 0; i < n; i++)
        if (pixels[i] >= most) {
            pixels[i] = most;
            if (defects != NULL)
                defects[i] |= RX_DEFECT_SATURATED;
        }
    if (par->type == RX_NOISE_CCD && par->bad_columns > 0.0)
        kill_columns(par, width, height, pixels, defects);
}
