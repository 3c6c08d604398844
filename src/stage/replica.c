/* Copies of a tile in memory. */
#include "stage/replica.h"

#include <string.h>

#include "base/memory.h"
#include "io/tile.h"

/* NULL for NULL, else a copy; *failed when memory is out. */
static void *copy_plane(const void *src, size_t n, size_t size, int *failed)
{
    if (src == NULL)
        return NULL;
    void *dst = rx_alloc(n, size);
    if (dst == NULL)
        *failed = 1;
    else
        memcpy(dst, src, n * size);
    return dst;
}

static void copy_flagmaps(const rx_tile *src, size_t n, rx_tile *dst, int *failed)
{
    if (src->nflagmaps == 0)
        return;
    dst->flagmaps = RX_NEW(uint32_t *, (size_t)src->nflagmaps);
    if (dst->flagmaps == NULL) {
        *failed = 1;
        return;
    }
    dst->nflagmaps = src->nflagmaps;
    for (int i = 0; i < src->nflagmaps; i++)
        dst->flagmaps[i] = copy_plane(src->flagmaps[i], n, sizeof(uint32_t), failed);
}

rx_status rx_replica_new(const rx_tile *src, rx_tile **dst, rx_error *err)
{
    size_t n = (size_t)src->width * (size_t)src->height;
    int failed = 0;
    rx_tile *tile = RX_NEW(rx_tile, 1);
    if (tile == NULL)
        return rx_error_memory(err, sizeof *tile);
    *tile = *src;
    tile->cards = NULL;
    tile->ncards = 0;
    tile->wcs = NULL;
    tile->nflagmaps = 0;
    tile->flagmaps = NULL;
    tile->name = rx_strdup(src->name);
    tile->extname = rx_strdup(src->extname);
    tile->pixels = copy_plane(src->pixels, n, sizeof(float), &failed);
    tile->mask = copy_plane(src->mask, n, sizeof(uint8_t), &failed);
    tile->weight = copy_plane(src->weight, n, sizeof(float), &failed);
    copy_flagmaps(src, n, tile, &failed);
    if (failed || tile->name == NULL || (src->extname != NULL && tile->extname == NULL)) {
        rx_tile_free(tile);
        return rx_error_memory(err, n * sizeof(float));
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
