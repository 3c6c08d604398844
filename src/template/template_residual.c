/* The residual filtered by strips, no plane in between. */
#include "template/template_residual.h"

#include <math.h>
#include <omp.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"
#include "num/maximum_filter.h"
#include "template/windows.h"

enum {
    STRIP = 64,    /* rows of a strip */
    TOGETHER = 64, /* pixels of a row whose sums grow together: a multiple of 4 LANES */
    LANES = 8      /* of them in one vector */
};

/* Floats anywhere. */
typedef float lanes __attribute__((vector_size(LANES * sizeof(float)), aligned(sizeof(float)), may_alias));

static const float SURELY = 0.999f; /* of a threshold, so that rounding does not matter */

/* Rows of a strip and of what its filter reaches, with side / 2 empty pixels at either end of a row; what
 * lies beyond the border is 0, and open. */
typedef struct strip {
    const rx_template_residual *of;
    int top; /* row of the image that is its first */
    size_t stride;
    float *residual, *variance; /* [STRIP + side][stride]; TOGETHER residuals more are read */
    float *open;                /* 1 where visible */
    float *own, *light; /* [STRIP + side + 2 reach][width]: light of each pixel, the largest of a row's */
    float *least;       /* [STRIP + side] smallest variance of a part of each row */
    bool hidden;        /* any pixel is */
} strip;

/* What many threads look at. */
typedef struct looker {
    const rx_template_residual *of;
    rx_template_residual_pixel *spots;
} looker;

/* light[n] of the models in the pixels from (x, y) on. */
static void light_of(const rx_template_residual *of, int y, int x, int n, float *light)
{
    const rx_fit_image *s = of->image;
    const size_t at = rx_fit_image_row(s, y) + (size_t)x;
    const float *pixels = of->pixels + (size_t)y * (size_t)s->width + (size_t)x;
    const float *level = rx_map_row(&of->level, y, x, n, light);
    for (int i = 0; i < n; i++) {
        const size_t k = at + (size_t)i;
        const float value = pixels[i] - level[i] - (s->data[k] - s->model[k]);
        light[i] = s->weight[k] > 0 && value > 0 ? value : 0;
    }
}

static float variance_of(const rx_template_residual *of, int x, int y, float light)
{
    const size_t k = rx_fit_image_row(of->image, y) + (size_t)x;
    const float error = (float)(rx_crowding_at(of->crowd, x, y) ? of->crowd_error : of->model_error) * light;
    const float grain = (float)of->grain;
    return grain * grain / of->image->weight[k] + error * error;
}

/* L of the pixel (x, y), around which the image is shown. */
static double light_around(const rx_template_residual *of, int x, int y)
{
    const int width = of->image->width, height = of->image->height;
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

static rx_status look_at(void *user, int i, int thread, rx_error *err)
{
    const looker *l = user;
    rx_template_residual_pixel *spot = &l->spots[i];
    const size_t k = rx_fit_image_row(l->of->image, spot->y) + (size_t)spot->x;
    (void)thread;
    (void)err;
    spot->light = light_around(l->of, spot->x, spot->y);
    spot->sigma = sqrt(variance_of(l->of, spot->x, spot->y, (float)spot->light));
    spot->weight = l->of->image->weight[k];
    return RX_OK;
}

rx_status rx_template_residual_at(const rx_template_residual *of, rx_template_residual_pixel *spots, int n,
                                  rx_error *err)
{
    const int width = of->image->width, height = of->image->height, reach = of->reach;
    looker user = {of, spots};
    rx_window *windows = RX_NEW(rx_window, (size_t)n);
    if (windows == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *windows);
    for (int i = 0; i < n; i++) {
        const int x = spots[i].x, y = spots[i].y;
        windows[i] = (rx_window){x > reach ? x - reach : 0, y > reach ? y - reach : 0,
                                 x + reach < width ? x + reach + 1 : width,
                                 y + reach < height ? y + reach + 1 : height};
    }
    const rx_status status = rx_windows_run(of->image, windows, n, 0, look_at, &user, err);
    free(windows);
    return status;
}

static rx_status open_strip(const rx_template_residual *of, strip *s, rx_error *err)
{
    const size_t width = (size_t)of->image->width, rows = STRIP + (size_t)of->side;
    const size_t lit = (rows + 2 * (size_t)of->reach) * width;
    *s = (strip){.of = of, .stride = width + 2 * (size_t)(of->side / 2)};
    s->residual = RX_NEW(float, rows * s->stride + TOGETHER);
    s->variance = RX_NEW(float, rows * s->stride);
    s->open = RX_NEW(float, rows * s->stride);
    s->light = RX_NEW(float, lit);
    s->own = RX_NEW(float, lit);
    s->least = RX_NEW(float, rows);
    if (s->least == NULL || s->residual == NULL || s->variance == NULL || s->open == NULL ||
        s->light == NULL || s->own == NULL)
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
    free(s->least);
}

static void fill_row(strip *s, int y, const float *most, size_t at)
{
    const rx_fit_image *state = s->of->image;
    const size_t width = (size_t)state->width, row = rx_fit_image_row(state, y);
    for (size_t x = 0; x < width; x++) {
        const bool open = state->weight[row + x] > 0;
        s->residual[at + x] = open ? state->data[row + x] - state->model[row + x] : 0;
        s->variance[at + x] = open ? variance_of(s->of, (int)x, y, most[x]) : 0;
        s->open[at + x] = open;
        s->hidden = s->hidden || !open;
    }
}

/* For the rows `from` .. to - 1 of the image. */
static void fill_strip(strip *s, int from, int to)
{
    const rx_template_residual *of = s->of;
    const int width = of->image->width, height = of->image->height, half = of->side / 2;
    const int low = from - half > 0 ? from - half : 0, high = to + half < height ? to + half : height;
    const int dark = low - of->reach > 0 ? low - of->reach : 0;
    const int bright = high + of->reach < height ? high + of->reach : height;
    const size_t cells = (size_t)(STRIP + of->side) * s->stride;
    s->top = from;
    memset(s->residual, 0, cells * sizeof *s->residual);
    memset(s->variance, 0, cells * sizeof *s->variance);
    for (size_t k = 0; k < cells; k++)
        s->open[k] = 1;
    s->hidden = false;
    for (int y = dark; y < bright; y++)
        light_of(of, y, 0, width, s->own + (size_t)(y - dark) * (size_t)width);
    rx_maximum_filter_in_rows(s->own, width, bright - dark, of->reach, 1, s->light);
    float *most = s->own; /* that is needed no more */
    for (int y = low; y < high; y++) {
        rx_maximum_filter_over_rows(s->light, width, bright - dark, of->reach, y - dark, most);
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

/* Where the result goes: planes whose first row is row `first` of the image. */
typedef struct target {
    int first;
    float *filtered, *noise;
    uint8_t *mask;
} target;

/* sums [TOGETHER] = sum k r of the pixels from x on of row y, those beyond the end of the row, too. */
RX_SIMD static void filter_residual(const strip *s, int y, int x, float *sums)
{
    const rx_template_residual *of = s->of;
    for (int m = 0; m < TOGETHER; m += 4 * LANES) {
        const float *row = s->residual + (size_t)(y - s->top) * s->stride + (size_t)(x + m);
        lanes a = {0}, b = {0}, c = {0}, d = {0};
        for (int j = 0; j < of->side; j++, row += s->stride)
            for (int i = 0; i < of->side; i++) {
                const float k = of->filter[j * of->side + i];
                const lanes *r = (const lanes *)(row + i);
                a += k * r[0];
                b += k * r[1];
                c += k * r[2];
                d += k * r[3];
            }
        memcpy(sums + m, (lanes[4]){a, b, c, d}, 4 * sizeof a);
    }
}

/* s->least of each row of the strip where the filter reaches from the TOGETHER pixels from x on. */
RX_SIMD static void find_least(strip *s, int x)
{
    const size_t count = (size_t)(TOGETHER + s->of->side - 1);
    for (int y = 0; y < STRIP + s->of->side; y++) {
        const float *row = s->variance + (size_t)y * s->stride + (size_t)x;
        const size_t n = s->stride - (size_t)x < count ? s->stride - (size_t)x : count;
        float low = HUGE_VALF;
#pragma omp simd reduction(min : low)
        for (size_t i = 0; i < n; i++)
            low = row[i] < low ? row[i] : low;
        s->least[y] = low;
    }
}

/* count pixels from x on of row y. */
RX_SIMD static void filter_piece(const strip *s, int y, int x, int count, const target *dst)
{
    const rx_template_residual *of = s->of;
    const size_t to = (size_t)(y - dst->first) * (size_t)of->image->width + (size_t)x;
    float *filtered = dst->filtered + to, *noise = dst->noise + to, most = 0, least = s->least[y - s->top];
    uint8_t *mask = dst->mask + to;
    float sum[TOGETHER], square[TOGETHER] = {0}, norm[TOGETHER] = {0};
    filter_residual(s, y, x, sum);
    for (int m = 0; m < count; m++)
        most = sum[m] > most ? sum[m] : most;
    for (int j = 1; j < of->side; j++)
        least = s->least[y - s->top + j] < least ? s->least[y - s->top + j] : least;
    const int faint = !s->hidden && of->threshold > 0 && most < SURELY * (float)of->threshold * sqrtf(least);
    for (int j = 0; j < of->side && !faint; j++)
        for (int i = 0; i < of->side; i++) {
            const float k = of->filter[j * of->side + i];
            const size_t at = (size_t)(y - s->top + j) * s->stride + (size_t)(x + i);
            add_row(s->variance + at, count, fabsf(k), square);
            if (s->hidden)
                add_row(s->open + at, count, fabsf(k), norm);
        }
    for (int m = 0; m < count; m++) {
        mask[m] = !(of->image->weight[rx_fit_image_row(of->image, y) + (size_t)(x + m)] > 0);
        filtered[m] = mask[m] ? 0 : sum[m];
        noise[m] = mask[m] ? 0 : sqrtf(faint ? least : square[m] / (s->hidden ? norm[m] : 1));
    }
}

/* Rows from .. to - 1, a multiple of a strip from the first of the planes, which are shown with what reaches
 * them. */
static rx_status filter_rows(const rx_template_residual *of, int from, int to, const target *dst,
                             rx_error *err)
{
    const int width = of->image->width, strips = (to - from + STRIP - 1) / STRIP;
    rx_status failed = RX_OK;
#pragma omp parallel num_threads(of->nthreads < 1 ? 1 : of->nthreads)
    {
        strip s;
        rx_error own = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        const rx_status status = open_strip(of, &s, &own);
        if (status != RX_OK) {
#pragma omp critical(rx_template_residual_failure)
            {
                failed = status;
                rx_error_take(err, &own);
            }
        }
#pragma omp for schedule(dynamic)
        for (int i = 0; i < strips; i++) {
            const int top = from + i * STRIP, end = top + STRIP < to ? top + STRIP : to;
            if (status != RX_OK)
                continue;
            fill_strip(&s, top, end);
            for (int x = 0; x < width; x += TOGETHER) {
                if (!s.hidden && of->threshold > 0)
                    find_least(&s, x);
                for (int y = top; y < end; y++)
                    filter_piece(&s, y, x, x + TOGETHER < width ? TOGETHER : width - x, dst);
            }
        }
        close_strip(&s);
    }
    return failed;
}

rx_status rx_template_residual_filter(const rx_template_residual *of, int from, int to, float *filtered,
                                      float *noise, uint8_t *mask, rx_error *err)
{
    const int height = of->image->height, around = of->side / 2 + of->reach;
    const int room = rx_fit_image_rows(of->image) - 2 * around;
    const int rows = room > STRIP ? room / STRIP * STRIP : STRIP;
    const target dst = {from, filtered, noise, mask};
    rx_status status = RX_OK;
    for (int y = from, end; y < to && status == RX_OK; y = end) {
        end = y + rows < to && rx_fit_image_rows(of->image) < height ? y + rows : to;
        status = rx_fit_image_load_rows(of->image, y > around ? y - around : 0,
                                        end + around < height ? end + around : height, err);
        if (status == RX_OK)
            status = filter_rows(of, y, end, &dst, err);
    }
    return status;
}
