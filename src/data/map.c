/* Planes as they are, the sky of a background from its meshes, the rest by its maker. */
#include "data/map.h"

#include <float.h>
#include <string.h>

#include "base/simd.h"

enum { PIECE = 64 }; /* pixels of a row whose noise is held beside their level */
enum { ROWS = 16 };  /* made at a time */

rx_map rx_map_plane(const float *plane, int width)
{
    return (rx_map){.width = width, .plane = plane};
}

rx_map rx_map_made(const rx_map_maker *maker, int width)
{
    return (rx_map){.width = width, .maker = maker};
}

static void make_scaled(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    const rx_scaled_map *scaled = (const rx_scaled_map *)maker;
    for (int row = 0; row < rows; row++, dst += n) {
        const float *from = rx_map_row(&scaled->of, y + row, x, n, dst);
        for (int i = 0; i < n; i++)
            dst[i] = scaled->factor * from[i];
    }
}

rx_map rx_map_scaled(rx_scaled_map *room, rx_map of, float factor)
{
    if (factor == 1.0f || !rx_map_given(&of))
        return of;
    *room = (rx_scaled_map){.maker.make = make_scaled, .of = of, .factor = factor};
    return rx_map_made(&room->maker, of.width);
}

rx_map rx_background_level(const rx_background *sky)
{
    const int plain = sky->level_error == 0;
    return (rx_map){.width = sky->width, .plane = plain ? sky->level : NULL, .sky = sky};
}

rx_map rx_background_noise(const rx_background *sky)
{
    return (rx_map){.width = sky->width, .plane = sky->sigma, .sky = sky, .noise = 1};
}

/* No noise where there is no pixel, some noise where there is one. */
RX_SIMD static void finish_noise(const rx_background *sky, size_t at, int n, float *sigma)
{
    const float fallback = sky->fallback_sigma;
#pragma omp simd
    for (int i = 0; i < n; i++)
        sigma[i] = (sigma[i] > 0.0f) & (sigma[i] <= FLT_MAX) ? sigma[i] : fallback;
    const uint8_t *mask = sky->mask != NULL ? sky->mask + at : NULL;
    const int bits = sky->mask_bits;
    if (mask == NULL)
        return;
#pragma omp simd
    for (int i = 0; i < n; i++)
        sigma[i] = (mask[i] & bits) != 0 ? 0.0f : sigma[i];
}

/* Before any error. */
static void true_noise(const rx_background *sky, int y, int x, int n, float *sigma)
{
    const size_t at = (size_t)y * (size_t)sky->width + (size_t)x;
    if (sky->sigma != NULL) {
        memcpy(sigma, sky->sigma + at, (size_t)n * sizeof *sigma);
        return;
    }
    rx_splines_row(&sky->sigmas, y, x, n, sigma);
    finish_noise(sky, at, n, sigma);
}

static void level_row(const rx_background *sky, int y, int x, int n, float *level)
{
    float sigma[PIECE];
    if (sky->level != NULL)
        memcpy(level, sky->level + (size_t)y * (size_t)sky->width + (size_t)x, (size_t)n * sizeof *level);
    else
        rx_splines_row(&sky->levels, y, x, n, level);
    for (int from = 0; from < n && sky->level_error != 0; from += PIECE) {
        const int count = n - from < PIECE ? n - from : PIECE;
        true_noise(sky, y, x + from, count, sigma);
        for (int i = 0; i < count; i++)
            level[from + i] -= (float)(sky->level_error * (double)sigma[i]);
    }
}

const float *rx_map_row(const rx_map *map, int y, int x, int n, float *room)
{
    if (map->plane != NULL)
        return map->plane + (size_t)y * (size_t)map->width + (size_t)x;
    if (map->maker != NULL)
        map->maker->make(map->maker, x, y, n, 1, room);
    else if (map->sky == NULL)
        memset(room, 0, (size_t)n * sizeof *room);
    else if (map->noise) {
        true_noise(map->sky, y, x, n, room);
        for (int i = 0; i < n && map->sky->sigma_error != 0; i++)
            room[i] = (float)((double)room[i] * (1 + map->sky->sigma_error));
    } else
        level_row(map->sky, y, x, n, room);
    return room;
}

float rx_map_at(const rx_map *map, int x, int y)
{
    float value = 0;
    return *rx_map_row(map, y, x, 1, &value);
}

const float *rx_map_rows(const rx_map *map, int y, int rows, float *dst)
{
    const size_t width = (size_t)map->width;
    if (map->plane != NULL)
        return map->plane + (size_t)y * width;
    if (map->maker != NULL)
        map->maker->make(map->maker, 0, y, map->width, rows, dst);
    for (int i = 0; i < rows && map->maker == NULL; i++)
        (void)rx_map_row(map, y + i, 0, map->width, dst + (size_t)i * width);
    return dst;
}

void rx_map_fill(const rx_map *map, int height, int nthreads, float *dst)
{
    const size_t width = (size_t)map->width;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int y = 0; y < height; y += ROWS) {
        float *own = dst + (size_t)y * width;
        const int rows = height - y < ROWS ? height - y : ROWS;
        const float *values = rx_map_rows(map, y, rows, own);
        if (values != own)
            memcpy(own, values, (size_t)rows * width * sizeof *own);
    }
}
