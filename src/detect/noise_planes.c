/* Planes for sep with noise that varies. */
#include "detect/noise_planes.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const float NOTHING = 1e30f;         /* noise where there is no pixel */
static const float ROUNDING = 1.0f + 2e-6f; /* of threshold * (limit / threshold) in float */

/* Lowest threshold of the groups that touch (x, y); HUGE_VALF where none does. */
static float lowest_around(const rx_groups *groups, int width, int height, int x, int y)
{
    float lowest = HUGE_VALF;
    for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < height; v++)
        for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < width; u++) {
            int32_t label = groups->label[(size_t)v * (size_t)width + (size_t)u];
            if (label > 0)
                lowest = fminf(lowest, groups->list[label - 1].lowest);
        }
    return lowest;
}

static void fill_noise(const float *sigma, const float *filtered, int width, int height, double threshold,
                       const rx_groups *groups, rx_noise_planes *dst)
{
    for (int y = 0; y < dst->height; y++)
        for (int x = 0; x < dst->width; x++) {
            size_t at = (size_t)y * (size_t)dst->width + (size_t)x;
            size_t k = (size_t)y * (size_t)width + (size_t)x;
            bool inside = x < width && y < height;
            dst->noise[at] = inside ? sigma[k] : NOTHING;
            if (inside && groups->label[k] != 0)
                continue;
            float limit = lowest_around(groups, width, height, x, y);
            if (limit < HUGE_VALF)
                dst->noise[at] = fmaxf(limit, filtered[at]) / (float)threshold * ROUNDING;
        }
}

rx_status rx_noise_planes_make(const float *pixels, const float *sigma, int width, int height,
                               const rx_filter *kernel, double threshold, const rx_groups *groups,
                               rx_noise_planes *dst, rx_error *err)
{
    rx_status status = RX_OK;
    *dst = (rx_noise_planes){.width = width + 1, .height = height + 1};
    size_t n = (size_t)dst->width * (size_t)dst->height, row = (size_t)width;
    float *filtered = RX_NEW(float, n);
    dst->pixels = RX_NEW(float, n);
    dst->noise = RX_NEW(float, n);
    if (filtered == NULL || dst->pixels == NULL || dst->noise == NULL) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    for (size_t y = 0; y < (size_t)height; y++)
        memcpy(dst->pixels + y * (row + 1), pixels + y * row, row * sizeof(float));
    rx_filter_plane(kernel, dst->pixels, dst->width, dst->height, filtered);
    fill_noise(sigma, filtered, width, height, threshold, groups, dst);
exit:
    free(filtered);
    return status;
}

void rx_noise_planes_free(rx_noise_planes *planes)
{
    free(planes->pixels);
    free(planes->noise);
    *planes = (rx_noise_planes){0};
}

void rx_noise_planes_restore(const rx_noise_planes *planes, const float *sigma, double threshold,
                             sep_catalog *cat)
{
    int width = planes->width - 1, height = planes->height - 1;
    for (int i = 0; i < cat->nobj; i++) {
        float lowest = HUGE_VALF;
        for (int k = 0; k < cat->npix[i]; k++) {
            int x = cat->pix[i][k] % planes->width, y = cat->pix[i][k] / planes->width;
            int at = y * width + x;
            cat->pix[i][k] = at;
            lowest = fminf(lowest, (float)threshold * sigma[at]);
            if (x == width - 1 || y == height - 1)
                cat->flag[i] |= SEP_OBJ_TRUNC;
        }
        cat->thresh[i] = lowest;
    }
}
