/* No restoration. */
#include "restore/none.h"

#include <string.h>

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
    restored->sigma = RX_NEW(float, n);
    restored->psf = psf != NULL ? rx_psf_copy(psf) : NULL;
    if (restored->sigma == NULL || (psf != NULL && restored->psf == NULL)) {
        rx_restored_free(restored);
        return rx_error_memory(err, n * sizeof(float));
    }
    rx_prepared_mask(par, tile, background, restored->mask);
    for (size_t k = 0; k < n; k++)
        restored->pixels[k] = restored->mask[k] != 0 ? 0 : tile->pixels[k] - background->level[k];
    memcpy(restored->sigma, background->sigma, n * sizeof *restored->sigma);
    restored->seconds = rx_seconds() - begun;
    *dst = restored;
    return RX_OK;
}
