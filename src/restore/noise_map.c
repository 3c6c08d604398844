/* Noise for detection on a restored image. */
#include "restore/noise_map.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/convolve.h"

static const double SMOOTH_FWHM = 1.5 * 2.3548200450309493; /* pixels */
static const float SHARE = 0.1f;                            /* of the brightness around, in sigmas */

rx_status rx_noise_map(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                       int nthreads, float **dst, rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    float *map = RX_NEW(float, n);
    *dst = NULL;
    if (map == NULL)
        return rx_error_memory(err, n * sizeof *map);
    for (size_t i = 0; i < n; i++) {
        if ((mask != NULL && mask[i] != 0) || !(background->sigma[i] > 0))
            continue;
        const float above = (tile->pixels[i] - background->level[i]) / background->sigma[i];
        map[i] = above > 0 ? above : 0.0f;
    }
    rx_status status = rx_gauss_masked(tile->width, tile->height, SMOOTH_FWHM, mask, nthreads, map, err);
    if (status != RX_OK) {
        free(map);
        return status;
    }
    for (size_t i = 0; i < n; i++)
        map[i] = background->sigma[i] * sqrtf(1.0f + SHARE * SHARE * map[i] * map[i]);
    *dst = map;
    return RX_OK;
}
