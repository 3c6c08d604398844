/* Copies of a tile in memory. */
#include "check/replica.h"

#include <string.h>

#include "base/memory.h"
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
