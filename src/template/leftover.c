/* The residual filtered by strips, no plane in between. */
#include "template/leftover.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/wide.h"
#include "num/largest.h"

enum { STRIP = 64, TOGETHER = 64 }; /* rows of a strip; pixels of a row whose sums grow together */

/* Rows of a strip and of what its filter reaches, with side / 2 empty pixels at either end of a row; what
 * lies beyond the border is 0, and open. */
typedef struct strip {
    const rx_leftover *of;
    size_t stride;
    float *residual, *variance; /* [STRIP + side][stride] */
    float *open;                /* 1 where visible */
    float *own, *light; /* [STRIP + side + 2 reach][width]: light of each pixel, the largest of a row's */
    bool hidden;        /* any pixel is */
} strip;

/* light[n] of the models in the pixels from (x, y) on. */
static void light_of(const rx_leftover *of, int y, int x, int n, float *light)
{
    const rx_tphot_state *s = of->state;
    const size_t at = (size_t)y * (size_t)s->width + (size_t)x;
    const float *level = rx_map_row(&of->level, y, x, n, light);
    for (int i = 0; i < n; i++) {
        const size_t k = at + (size_t)i;
        const float value = of->pixels[k] - level[i] - (s->data[k] - s->model[k]);
        light[i] = s->weight[k] > 0 && value > 0 ? value : 0;
    }
}

static float variance_of(const rx_leftover *of, size_t k, float light)
{
    const float error = (float)of->model_error * light;
    return 1 / of->state->weight[k] + error * error;
}

double rx_leftover_light(const rx_leftover *of, int x, int y)
{
    const int width = of->state->width, height = of->state->height;
    const int end = x + of->reach < width ? x + of->reach + 1 : width;
    float most = 0;
    for (int v = y > of->reach ? y - of->reach : 0; v <= y + of->reach && v < height; v++)
        for (int u = x > of->reach ? x - of->reach : 0; u < end; u += RX_MAP_PIECE) {
            const int n = rx_map_piece(u, end);
            float light[RX_MAP_PIECE];
            light_of(of, v, u, n, light);
            for (int i = 0; i < n; i++)
                most = fmaxf(most, light[i]);
        }
    return most;
}

double rx_leftover_sigma(const rx_leftover *of, int x, int y)
{
    const size_t k = (size_t)y * (size_t)of->state->width + (size_t)x;
    return sqrt(variance_of(of, k, (float)rx_leftover_light(of, x, y)));
}

static rx_status open_strip(const rx_leftover *of, strip *s, rx_error *err)
{
    const size_t width = (size_t)of->state->width, rows = STRIP + (size_t)of->side;
    const size_t lit = (rows + 2 * (size_t)of->reach) * width;
    *s = (strip){.of = of, .stride = width + 2 * (size_t)(of->side / 2)};
    s->residual = RX_NEW(float, rows * s->stride);
    s->variance = RX_NEW(float, rows * s->stride);
    s->open = RX_NEW(float, rows * s->stride);
    s->light = RX_NEW(float, lit);
    s->own = RX_NEW(float, lit);
    if (s->residual == NULL || s->variance == NULL || s->open == NULL || s->light == NULL || s->own == NULL)
        return rx_error_memory(err, (3 * rows * s->stride + 2 * lit) * sizeof(float));
    return RX_OK;
}

static void close_strip(strip *s)
{
    free(s->residual);
    free(s->variance);
    free(s->open);
    free(s->light);
    free(s->own);
}

static void fill_row(strip *s, int y, const float *most, size_t at)
{
    const rx_tphot_state *state = s->of->state;
    const size_t width = (size_t)state->width, row = (size_t)y * width;
    for (size_t x = 0; x < width; x++) {
        const bool open = state->weight[row + x] > 0;
        s->residual[at + x] = open ? state->data[row + x] - state->model[row + x] : 0;
        s->variance[at + x] = open ? variance_of(s->of, row + x, most[x]) : 0;
        s->open[at + x] = open;
        s->hidden = s->hidden || !open;
    }
}

/* For the rows `from` .. to - 1 of the image. */
static void fill_strip(strip *s, int from, int to)
{
    const rx_leftover *of = s->of;
    const int width = of->state->width, height = of->state->height, half = of->side / 2;
    const int low = from - half > 0 ? from - half : 0, high = to + half < height ? to + half : height;
    const int dark = low - of->reach > 0 ? low - of->reach : 0;
    const int bright = high + of->reach < height ? high + of->reach : height;
    const size_t cells = (size_t)(STRIP + of->side) * s->stride;
    memset(s->residual, 0, cells * sizeof *s->residual);
    memset(s->variance, 0, cells * sizeof *s->variance);
    for (size_t k = 0; k < cells; k++)
        s->open[k] = 1;
    s->hidden = false;
    for (int y = dark; y < bright; y++)
        light_of(of, y, 0, width, s->own + (size_t)(y - dark) * (size_t)width);
    rx_largest_in_rows(s->own, width, bright - dark, of->reach, 1, s->light);
    float *most = s->own; /* that is needed no more */
    for (int y = low; y < high; y++) {
        rx_largest_over_rows(s->light, width, bright - dark, of->reach, 0, y - dark, width, most);
        fill_row(s, y, most, (size_t)(y - from + half) * s->stride + (size_t)half);
    }
}

/* sums += k * row. */
static inline void add_row(const float *restrict row, int count, float k, float *restrict sums)
{
#pragma omp simd
    for (int x = 0; x < count; x++)
        sums[x] += k * row[x];
}

/* Pixels x .. x + count - 1 of row y, which is the strip's row r. */
RX_WIDE static void filter_piece(const strip *s, int y, int r, int x, int count, float *filtered,
                                 float *noise, uint8_t *mask)
{
    const rx_leftover *of = s->of;
    float sum[TOGETHER] = {0}, square[TOGETHER] = {0}, norm[TOGETHER] = {0};
    for (int j = 0; j < of->side; j++)
        for (int i = 0; i < of->side; i++) {
            const float k = of->filter[j * of->side + i];
            const size_t at = (size_t)(r + j) * s->stride + (size_t)(x + i);
            add_row(s->residual + at, count, k, sum);
            add_row(s->variance + at, count, fabsf(k), square);
            if (s->hidden)
                add_row(s->open + at, count, fabsf(k), norm);
        }
    for (int m = 0; m < count; m++) {
        const size_t k = (size_t)y * (size_t)of->state->width + (size_t)(x + m);
        mask[k] = !(of->state->weight[k] > 0);
        filtered[k] = mask[k] ? 0 : sum[m];
        noise[k] = mask[k] ? 0 : sqrtf(square[m] / (s->hidden ? norm[m] : 1));
    }
}

rx_status rx_leftover_filter(const rx_leftover *of, float *filtered, float *noise, uint8_t *mask,
                             rx_error *err)
{
    const int width = of->state->width, height = of->state->height, strips = (height + STRIP - 1) / STRIP;
    rx_status failed = RX_OK;
#pragma omp parallel num_threads(of->nthreads < 1 ? 1 : of->nthreads)
    {
        strip s;
        rx_error own = RX_ERROR_NONE;
        const rx_status status = open_strip(of, &s, &own);
        if (status != RX_OK) {
#pragma omp critical(rx_leftover_failure)
            {
                failed = status;
                if (err != NULL)
                    *err = own;
            }
        }
#pragma omp for schedule(dynamic)
        for (int i = 0; i < strips; i++) {
            const int from = i * STRIP, to = from + STRIP < height ? from + STRIP : height;
            if (status != RX_OK)
                continue;
            fill_strip(&s, from, to);
            for (int y = from; y < to; y++)
                for (int x = 0; x < width; x += TOGETHER)
                    filter_piece(&s, y, y - from, x, x + TOGETHER < width ? TOGETHER : width - x, filtered,
                                 noise, mask);
        }
        close_strip(&s);
    }
    return failed;
}
