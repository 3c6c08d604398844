/* The restorer NONE: the tile as it is, its sky taken off. Hidden pixels are 0; noise is the image's, lent; psf is
 * a copy of the image's, NULL when that is not known. */
#include "base/memory.h"
#include "data/gaps.h"
#include "data/map.h"
#include "restore/prepared.h"
#include "restore/runs.h"

static void subtract(int n, const float *restrict pixels, const float *restrict level,
                     const uint8_t *restrict mask, float *restrict dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++)
        dst[i] = mask[i] != 0 ? 0 : pixels[i] - level[i];
}

rx_status rx_none_run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                      rx_error *err)
{
    (void)log;
    *dst = NULL;
    const double begun = rx_seconds();
    const size_t n = (size_t)image->width * (size_t)image->height;
    rx_restored *restored = rx_restored_new("NONE", image->width, image->height);
    if (restored == NULL)
        return rx_error_memory(err, n * sizeof(float));
    restored->noise = image->noise;
    restored->psf = image->psf != NULL ? rx_psf_copy(image->psf) : NULL;
    if (image->psf != NULL && restored->psf == NULL) {
        rx_restored_free(restored);
        return rx_error_memory(err, 0);
    }
    rx_prepared_mask(image, par->nthreads, restored->mask);
    const rx_status status =
        rx_gaps_find(restored->mask, image->width, image->height, image->psf != NULL ? image->psf->fwhm : 0.0,
                     1, &restored->gaps, err);
    if (status != RX_OK) {
        rx_restored_free(restored);
        return status;
    }
    const rx_map level = rx_image_sky(image);
#pragma omp parallel for schedule(static) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x += RX_MAP_PIECE) {
            float room[RX_MAP_PIECE];
            const int count = rx_map_piece(x, image->width);
            const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
            subtract(count, image->pixels + k, rx_map_row(&level, y, x, count, room), restored->mask + k,
                     restored->pixels + k);
        }
    restored->seconds = rx_seconds() - begun;
    *dst = restored;
    return RX_OK;
}
