/* Making and freeing of the structs that stages exchange. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/gaps.h"
#include "data/psf.h"
#include "data/restored.h"
#include "data/tile.h"

void rx_tile_free(rx_tile *tile)
{
    if (tile == NULL)
        return;
    for (int i = 0; tile->flagmaps != NULL && i < tile->nflagmaps; i++)
        free(tile->flagmaps[i]);
    free(tile->flagmaps);
    free(tile->name);
    free(tile->extname);
    if (!tile->lent)
        free(tile->pixels);
    free(tile->mask);
    free(tile->weight);
    free(tile->restored);
    free(tile->restored_noise);
    free(tile->cards);
    if (tile->wcs != NULL)
        tile->wcs_free(tile->wcs);
    free(tile);
}

static void clear(rx_background *background)
{
    free(background->level);
    free(background->sigma);
    rx_splines_free(&background->levels);
    rx_splines_free(&background->sigmas);
}

void rx_background_free(rx_background *background)
{
    if (background == NULL)
        return;
    clear(background);
    free(background);
}

void rx_background_flatten(rx_background *background, double level, double sigma)
{
    clear(background);
    *background = (rx_background){.width = background->width,
                                  .height = background->height,
                                  .global_level = level,
                                  .global_sigma = sigma,
                                  .levels.value = (float)level,
                                  .sigmas.value = (float)sigma};
}

void rx_background_widen(rx_background *background, double factor)
{
    const float f = (float)factor;
    const rx_splines *sigmas = &background->sigmas;
    const size_t pixels =
                     background->sigma != NULL ? (size_t)background->width * (size_t)background->height : 0,
                 nodes = 2 * (size_t)sigmas->nodes * (size_t)sigmas->height;
    for (size_t i = 0; i < pixels; i++)
        background->sigma[i] *= f;
    for (size_t i = 0; i < nodes; i++)
        sigmas->node[i] *= f;
    background->sigmas.value *= f;
    background->fallback_sigma *= f;
    background->global_sigma *= factor;
}

rx_restored *rx_restored_new(const char *name, int width, int height)
{
    rx_restored *restored = rx_restored_bare(name, width, height);
    if (restored == NULL)
        return NULL;
    restored->pixels = RX_NEW(float, (size_t)width *(size_t)height);
    if (restored->pixels == NULL) {
        rx_restored_free(restored);
        return NULL;
    }
    return restored;
}

rx_restored *rx_restored_bare(const char *name, int width, int height)
{
    const size_t n = (size_t)width * (size_t)height;
    rx_restored *restored = RX_NEW(rx_restored, 1);
    if (restored == NULL)
        return NULL;
    restored->name = name;
    restored->width = width;
    restored->height = height;
    restored->chi2 = restored->seam = NAN;
    restored->mask = RX_NEW(uint8_t, n);
    if (restored->mask == NULL) {
        rx_restored_free(restored);
        return NULL;
    }
    return restored;
}

void rx_restored_free(rx_restored *restored)
{
    if (restored == NULL)
        return;
    free(restored->pixels);
    free(restored->mask);
    rx_gaps_free(restored->gaps);
    free(restored->support);
    free(restored->reblurred);
    free(restored->noise_maker);
    rx_psf_free(restored->psf);
    rx_psf_free(restored->blur);
    free(restored);
}
