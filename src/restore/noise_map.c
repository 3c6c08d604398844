/* Noise for detection on a restored image. */
#include "restore/noise_map.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/convolve.h"

enum { BAND = 256 }; /* rows at a time: little memory besides the map */
static const double SMOOTH_FWHM = 1.5 * 2.3548200450309493; /* pixels */
static const float SHARE = 0.1f;                            /* of the brightness around, in sigmas */

/* How bright rows first .. last - 1 are, smoothed, into the map; `band` holds them and `radius` more on each
 * side. */
static rx_status smooth_band(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                             int first, int last, int radius, int nthreads, float *band, float *map,
                             rx_error *err)
{
    const int from = first > radius ? first - radius : 0;
    const int to = last + radius < tile->height ? last + radius : tile->height;
    const size_t width = (size_t)tile->width, offset = (size_t)from * width, n = (size_t)(to - from) * width;
#pragma omp parallel for simd schedule(static) num_threads(nthreads)
    for (size_t i = 0; i < n; i++) {
        const size_t k = offset + i;
        const float above = (tile->pixels[k] - background->level[k]) / background->sigma[k];
        const int seen = (mask == NULL || mask[k] == 0) & (background->sigma[k] > 0) & (above > 0);
        band[i] = seen ? above : 0.0f;
    }
    rx_status status = rx_gauss_masked(tile->width, to - from, SMOOTH_FWHM,
                                       mask != NULL ? mask + offset : NULL, nthreads, band, err);
    if (status == RX_OK)
        memcpy(map + (size_t)first * width, band + (size_t)(first - from) * width,
               (size_t)(last - first) * width * sizeof *map);
    return status;
}

rx_status rx_noise_map(const rx_tile *tile, const rx_background *background, const uint8_t *mask,
                       int nthreads, float **dst, rx_error *err)
{
    const size_t width = (size_t)tile->width, n = width * (size_t)tile->height;
    const int radius = rx_gauss_radius(SMOOTH_FWHM);
    rx_status status = RX_OK;
    float *map = RX_NEW(float, n), *band = RX_NEW(float, width *(size_t)(BAND + 2 * radius));
    *dst = NULL;
    if (map == NULL || band == NULL) {
        status = rx_error_memory(err, n * sizeof *map);
        goto exit;
    }
    for (int y = 0; y < tile->height && status == RX_OK; y += BAND)
        status = smooth_band(tile, background, mask, y, y + BAND < tile->height ? y + BAND : tile->height,
                             radius, nthreads, band, map, err);
    if (status != RX_OK)
        goto exit;
#pragma omp parallel for simd schedule(static) num_threads(nthreads)
    for (size_t i = 0; i < n; i++)
        map[i] = background->sigma[i] * sqrtf(1.0f + SHARE * SHARE * map[i] * map[i]);
exit:
    free(band);
    if (status != RX_OK) {
        free(map);
        return status;
    }
    *dst = map;
    return RX_OK;
}
