/* Copies of a tile in memory. */
#include "check/replica.h"

#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "data/image.h"
#include "io/tile.h"

/* NULL for NULL, else a copy of that part; *failed when memory is out. */
static void *copy_plane(const void *src, const rx_tile *tile, const rx_replica_part *part, size_t size,
                        int *failed)
{
    if (src == NULL)
        return NULL;
    char *dst = rx_alloc((size_t)part->width * (size_t)part->height, size);
    if (dst == NULL)
        *failed = 1;
    for (int y = 0; y < part->height && dst != NULL; y++)
        memcpy(dst + (size_t)y * (size_t)part->width * size,
               (const char *)src + ((size_t)(part->y + y) * (size_t)tile->width + (size_t)part->x) * size,
               (size_t)part->width * size);
    return dst;
}

rx_status rx_replica_new(const rx_tile *src, const rx_replica_part *part, rx_tile **dst, rx_error *err)
{
    const rx_replica_part all = {.width = src->width, .height = src->height};
    int failed = 0;
    rx_tile *tile;
    RX_TRY(RX_MAKE(tile, 1, err));
    if (part == NULL)
        part = &all;
    *tile = *src;
    tile->width = part->width;
    tile->height = part->height;
    tile->cards = NULL;
    tile->ncards = 0;
    tile->wcs = NULL;
    tile->nflagmaps = 0;
    tile->flagmaps = NULL;
    tile->name = rx_strdup(src->name);
    tile->extname = rx_strdup(src->extname);
    tile->lent = false;
    tile->pixels = copy_plane(src->pixels, src, part, sizeof(float), &failed);
    tile->mask = copy_plane(src->mask, src, part, sizeof(uint8_t), &failed);
    tile->weight = copy_plane(src->weight, src, part, sizeof(float), &failed);
    if (src->nflagmaps > 0)
        tile->flagmaps = RX_NEW(uint32_t *, (size_t)src->nflagmaps);
    if (tile->flagmaps != NULL)
        tile->nflagmaps = src->nflagmaps;
    for (int i = 0; i < tile->nflagmaps; i++)
        tile->flagmaps[i] = copy_plane(src->flagmaps[i], src, part, sizeof(uint32_t), &failed);
    if (failed || tile->name == NULL || (src->extname != NULL && tile->extname == NULL) ||
        tile->nflagmaps < src->nflagmaps) {
        rx_tile_free(tile);
        return rx_error_memory(err, (size_t)part->width * (size_t)part->height * sizeof(float));
    }
    *dst = tile;
    return RX_OK;
}

rx_replica_part rx_replica_window(const rx_tile *tile, const rx_replica_part *part, int side)
{
    rx_replica_part best = {.width = rx_min_int(part->width, side), .height = rx_min_int(part->height, side)};
    static const int order[] = {1, 0, 2};
    long most = -1;
    for (int k = 0; k < 9; k++) {
        const int x = part->x + (part->width - best.width) * order[k % 3] / 2,
                  y = part->y + (part->height - best.height) * order[k / 3] / 2;
        long good = 0;
        for (int row = y; row < y + best.height; row++)
            for (int i = x; i < x + best.width; i++)
                good += (tile->mask[(size_t)row * (size_t)tile->width + (size_t)i] & RX_HIDE_RESTORED) == 0;
        if (good > most) {
            most = good;
            best.x = x;
            best.y = y;
        }
    }
    return best;
}

rx_psf *rx_replica_psf(const rx_psf *psf, const rx_replica_part *part)
{
    rx_psf *moved = rx_psf_copy(psf);
    if (moved != NULL && part != NULL) {
        moved->x0 -= part->x;
        moved->y0 -= part->y;
    }
    return moved;
}

rx_pipeline_params rx_replica_params(const rx_pipeline_params *params)
{
    rx_pipeline_params own = *params;
    own.measure.skip = RX_SKIP_APER | RX_SKIP_AUTO | RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN;
    own.measure.star_net = NULL;
    own.measure.vignet_width = own.measure.vignet_height = 0;
    own.calibrate_none = own.calibrate_restored = 0;
    own.restore.keep_reblurred = own.restore.keep_support = 0;
    own.keep_filtered = own.examine_residual = own.templates.wanted = 0;
    own.templates.precision = 0.0;
    return own;
}

void rx_replica_settle(rx_tile *tile)
{
    size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t i = 0; i < n; i++) {
        if (tile->mask[i] & RX_MASK_BAD)
            tile->pixels[i] = 0.0f;
        else if ((double)tile->pixels[i] >= tile->saturation)
            tile->mask[i] |= RX_MASK_SATURATED;
    }
}
