/* No restoration. */
#include "restore/none.h"

#include "base/memory.h"
#include "data/map.h"
#include "restore/prepared.h"

enum { PIECE = 1024 }; /* pixels of a row at a time */

static void subtract(int n, const float *restrict pixels, const float *restrict level,
                     const uint8_t *restrict mask, float *restrict dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++)
        dst[i] = mask[i] != 0 ? 0 : pixels[i] - level[i];
}

rx_status rx_none_run(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                      const rx_psf *psf, rx_log *log, rx_restored **dst, rx_error *err)
{
    (void)log;
    *dst = NULL;
    const double begun = rx_seconds();
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_restored *restored = rx_restored_new("NONE", tile->width, tile->height);
    if (restored == NULL)
        return rx_error_memory(err, n * sizeof(float));
    restored->sky = background;
    restored->psf = psf != NULL ? rx_psf_copy(psf) : NULL;
    if (psf != NULL && restored->psf == NULL) {
        rx_restored_free(restored);
        return rx_error_memory(err, 0);
    }
    rx_prepared_mask(par, tile, background, restored->mask);
    const rx_map level = rx_background_level(background);
#pragma omp parallel for schedule(static) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int y = 0; y < tile->height; y++)
        for (int x = 0; x < tile->width; x += PIECE) {
            float room[PIECE];
            const int count = tile->width - x < PIECE ? tile->width - x : PIECE;
            const size_t k = (size_t)y * (size_t)tile->width + (size_t)x;
            subtract(count, tile->pixels + k, rx_map_row(&level, y, x, count, room), restored->mask + k,
                     restored->pixels + k);
        }
    restored->seconds = rx_seconds() - begun;
    *dst = restored;
    return RX_OK;
}
