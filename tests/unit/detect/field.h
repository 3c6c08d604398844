/* Synthetic fields with known truth: Gaussians on white noise. */
#ifndef TESTS_FIELD_H
#define TESTS_FIELD_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"
#include "base/random.h"
#include "detect/detect.h"

typedef struct field {
    int width, height;
    size_t n;
    float *pixels, *sigma;
    uint8_t *mask;
} field;

static inline field field_new(int width, int height, double noise, uint64_t seed)
{
    field f = {.width = width, .height = height, .n = (size_t)width * (size_t)height};
    f.pixels = RX_NEW(float, f.n);
    f.sigma = RX_NEW(float, f.n);
    f.mask = RX_NEW(uint8_t, f.n);
    assert_non_null(f.mask);
    for (size_t i = 0; i < f.n; i++) {
        f.pixels[i] = (float)(noise * rx_random_normal(seed, 1, i));
        f.sigma[i] = 1.0f;
    }
    return f;
}

static inline void field_free(field *f)
{
    free(f->pixels);
    free(f->sigma);
    free(f->mask);
}

/* Gaussian of total flux `flux`, sampled at pixel centres. */
static inline void field_add(field *f, double x, double y, double sx, double sy, double flux)
{
    int reach = (int)(8.0 * fmax(sx, sy));
    for (int v = (int)y - reach; v <= (int)y + reach; v++)
        for (int u = (int)x - reach; u <= (int)x + reach; u++) {
            if (u < 0 || v < 0 || u >= f->width || v >= f->height)
                continue;
            double dx = (u - x) / sx, dy = (v - y) / sy;
            f->pixels[v * f->width + u] +=
                (float)(flux / (2.0 * 3.14159265358979 * sx * sy) * exp(-0.5 * (dx * dx + dy * dy)));
        }
}

/* Values under the mask become anything. */
static inline void field_scramble(field *f, uint64_t seed)
{
    for (size_t i = 0; i < f->n; i++)
        if (f->mask[i] != 0)
            f->pixels[i] = (float)(1e6 * rx_random_normal(seed, 9, i));
}

static const float field_kernel[9] = {1, 2, 1, 2, 4, 2, 1, 2, 1};

static inline rx_detect_params field_params(void)
{
    return (rx_detect_params){.threshold = 1.5,
                              .analysis_threshold = 1.5,
                              .min_area = 5,
                              .filter = field_kernel,
                              .filter_width = 3,
                              .filter_height = 3,
                              .filter_normalise = 1,
                              .deblend_levels = 32,
                              .deblend_contrast = 0.005,
                              .clean = 1,
                              .clean_param = 1.0,
                              .pixstack = 300000,
                              .pixstack_max = 10000000,
                              .subobjects = 1024,
                              .subobjects_max = 8000};
}

static inline rx_image field_image(const field *f)
{
    return (rx_image){.width = f->width,
                      .height = f->height,
                      .pixels = f->pixels,
                      .noise = rx_map_plane(f->sigma, f->width),
                      .mask = f->mask,
                      .hide = 1,
                      .global_noise = 1.0};
}

static inline rx_sources *field_detect(const field *f, const rx_detect_params *par)
{
    rx_image image = field_image(f);
    rx_sources *sources = NULL;
    assert_int_equal(rx_detect_run(par, &image, NULL, NULL, &sources, NULL), RX_OK);
    return sources;
}

/* The source nearest to a place; NULL beyond two pixels. */
static inline rx_source *field_find(const rx_sources *sources, double x, double y)
{
    rx_source *best = NULL;
    double nearest = 2.0;
    for (int i = 0; i < sources->n; i++) {
        double d = hypot(sources->list[i].x - x, sources->list[i].y - y);
        if (d < nearest) {
            nearest = d;
            best = &sources->list[i];
        }
    }
    return best;
}

/* A crowd: `count` Gaussians at random places. */
static inline void field_crowd(field *f, int count, double flux, uint64_t seed)
{
    for (uint64_t i = 0; i < (uint64_t)count; i++)
        field_add(f, rx_random_uniform(seed, 3, 2 * i) * f->width,
                  rx_random_uniform(seed, 3, 2 * i + 1) * f->height, 1.5, 1.5,
                  flux * (0.2 + rx_random_uniform(seed, 4, i)));
}

#endif
