/* No restoration. */
#include "restore/none.h"

#include "base/memory.h"
#include "restore/prepared.h"

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
    restored->sigma = background->sigma;
    restored->sigma_lent = 1;
    restored->psf = psf != NULL ? rx_psf_copy(psf) : NULL;
    if (psf != NULL && restored->psf == NULL) {
        rx_restored_free(restored);
        return rx_error_memory(err, 0);
    }
    rx_prepared_mask(par, tile, background, restored->mask);
    float *pixels = restored->pixels;
    const uint8_t *mask = restored->mask;
#pragma omp parallel for simd schedule(static) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (size_t k = 0; k < n; k++)
        pixels[k] = mask[k] != 0 ? 0 : tile->pixels[k] - background->level[k];
    restored->seconds = rx_seconds() - begun;
    *dst = restored;
    return RX_OK;
}
