/* Freeing of the structs that stages exchange. */
#include <stdlib.h>

#include "data/psf.h"
#include "data/restored.h"
#include "data/sources.h"
#include "data/tile.h"

void rx_background_free(rx_background *background)
{
    if (background == NULL)
        return;
    free(background->level);
    free(background->sigma);
    free(background);
}

void rx_restored_free(rx_restored *restored)
{
    if (restored == NULL)
        return;
    free(restored->pixels);
    free(restored->mask);
    free(restored->support);
    free(restored->reblurred);
    free(restored->sigma);
    rx_psf_free(restored->psf);
    rx_psf_free(restored->blur);
    free(restored);
}

void rx_sources_free(rx_sources *sources)
{
    if (sources == NULL)
        return;
    free(sources->list);
    free(sources->segments);
    free(sources->fragments);
    free(sources->assoc);
    free(sources->vignets);
    free(sources);
}
