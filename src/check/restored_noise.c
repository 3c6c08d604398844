/* Two skies alike, restored. */
#include "check/restored_noise.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "check/blankcheck.h"

enum {
    SIDE = 1024, /* pixels of what is restored again */
    LEVELS = 56, /* of light, ZERO of them below the sky: -27 to 400,000 sigmas */
    ZERO = 14,
    ENOUGH = 200 /* pixels alike, whose variance is known to a tenth */
};
static const double STEPS = 3.0; /* a unit of asinh 2 z */
static const uint64_t STREAM = UINT64_C(0x524d530000000000);

/* Sums over pixels of less light than (i, j) in both images: [LEVELS + 1][LEVELS + 1]. */
typedef struct law {
    double squares[LEVELS + 1][LEVELS + 1], pixels[LEVELS + 1][LEVELS + 1];
    double variance[LEVELS][LEVELS]; /* over that of the observed pixel */
} law;

static int level_of(float light, float sigma)
{
    const double z = asinh(2.0 * (double)light / (double)sigma);
    return rx_max_int(rx_min_int((int)floor(STEPS * z + 0.5) + ZERO, LEVELS - 1), 0);
}

/* Of sky and photons, as a pixel of the tile has it; light: blurred again. */
static double observed(float sigma, float light, double gain)
{
    const double photons = gain > 0.0 && light > 0.0f ? (double)light / gain : 0.0;
    return (double)sigma * (double)sigma + photons;
}

static double within(double sums[LEVELS + 1][LEVELS + 1], int i, int j, int reach)
{
    const int a = rx_max_int(i - reach, 0), b = rx_min_int(i + reach + 1, LEVELS),
              c = rx_max_int(j - reach, 0), d = rx_min_int(j + reach + 1, LEVELS);
    return sums[b][d] - sums[a][d] - sums[b][c] + sums[a][c];
}

/* From sums of each pair of levels, at (i + 1, j + 1). */
static void finish(law *l)
{
    for (int i = 1; i <= LEVELS; i++)
        for (int j = 1; j <= LEVELS; j++) {
            l->squares[i][j] += l->squares[i - 1][j] + l->squares[i][j - 1] - l->squares[i - 1][j - 1];
            l->pixels[i][j] += l->pixels[i - 1][j] + l->pixels[i][j - 1] - l->pixels[i - 1][j - 1];
        }
    for (int i = 0; i < LEVELS; i++)
        for (int j = 0; j < LEVELS; j++) {
            int reach = 0;
            while (reach < LEVELS && within(l->pixels, i, j, reach) < ENOUGH)
                reach++;
            const double n = within(l->pixels, i, j, reach);
            l->variance[i][j] = n > 0.0 ? within(l->squares, i, j, reach) / n : NAN;
        }
}

/* The differences of the two restored images of `part`; sigma: of the tile. */
static void measure(const rx_result *tile, const rx_replica_part *part, const rx_result images[2],
                    const float *sigma, law *l)
{
    const double gain = tile->detect->image.gain;
    const rx_restored *own = tile->restored, *a = images[0].restored, *b = images[1].restored;
    for (int y = 0; y < part->height; y++)
        for (int x = 0; x < part->width; x++) {
            const size_t k = (size_t)y * (size_t)part->width + (size_t)x,
                         at = (size_t)(part->y + y) * (size_t)own->width + (size_t)(part->x + x);
            if (own->mask[at] != 0 || a->mask[k] != 0 || b->mask[k] != 0 || !(sigma[at] > 0.0f))
                continue;
            const double off = (double)(a->pixels[k] - b->pixels[k]);
            const int i = level_of(own->reblurred[at], sigma[at]) + 1,
                      j = level_of(own->pixels[at], sigma[at]) + 1;
            l->squares[i][j] += 0.5 * off * off / observed(sigma[at], own->reblurred[at], gain);
            l->pixels[i][j]++;
        }
}

/* Where another restorer does a replica the law stays empty. */
static rx_status restore_again(const rx_pipeline_params *params, const rx_result *tile, const float *sigma,
                               law *l, rx_error *err)
{
    const rx_tile *pixels = tile->detect->tile;
    const rx_replica_part part =
        rx_replica_window(pixels, &(rx_replica_part){.width = pixels->width, .height = pixels->height}, SIDE);
    const rx_pipeline_params own = rx_replica_params(params);
    const rx_blank_input in = {.kind = rx_restorer_find(tile->restored->name),
                               .field = tile->detect,
                               .noise = &tile->detect->noise,
                               .light = tile->restored->reblurred};
    rx_field *skies[2] = {NULL};
    rx_result images[2] = {{0}};
    rx_status status = RX_OK;
    for (int k = 0; k < 2; k++) {
        RX_TRY_EXIT(rx_interrupt_check(err));
        RX_TRY_EXIT(rx_blankcheck_field(
            &own, &in, &part, (rx_random_stream){params->seed, STREAM + (uint64_t)k}, &skies[k], err));
        RX_TRY_EXIT(rx_field_extract(&own, in.kind, skies[k], NULL, NULL, &images[k], err));
    }
    if (images[0].by == NULL && images[1].by == NULL)
        measure(tile, &part, images, sigma, l);
exit:
    for (int k = 0; k < 2; k++) {
        rx_result_free(&images[k]);
        rx_field_free(skies[k]);
    }
    return status;
}

rx_status rx_restored_noise(const rx_pipeline_params *params, const rx_result *tile, float *dst,
                            rx_error *err)
{
    const rx_restored *own = tile->restored;
    const rx_map noise = rx_background_noise(tile->plain ? tile->detect->plain : tile->detect->restored);
    const double gain = tile->detect->image.gain;
    law *l = NULL;
    rx_map_fill(&noise, own->height, params->nthreads, dst);
    if (!tile->plain) {
        RX_TRY(RX_MAKE(l, 1, err));
        const rx_status status = restore_again(params, tile, dst, l, err);
        if (status != RX_OK) {
            free(l);
            return status;
        }
        finish(l);
    }
    for (size_t at = 0; at < (size_t)own->width * (size_t)own->height; at++) {
        const float sigma = dst[at], light = l != NULL ? own->reblurred[at] : own->pixels[at];
        const bool holds = own->mask[at] == 0 && sigma > 0.0f;
        const double share =
            l != NULL && holds ? l->variance[level_of(light, sigma)][level_of(own->pixels[at], sigma)] : 1.0;
        dst[at] = holds ? (float)sqrt(share * observed(sigma, light, gain)) : NAN;
    }
    free(l);
    return RX_OK;
}
