/* No restoration. */
#include "restore/none.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "restore/stamp.h"

rx_status rx_none_run(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                      const rx_psf *psf, rx_log *log, rx_restored **dst, rx_error *err)
{
    (void)log;
    *dst = NULL;
    const double begun = rx_seconds();
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_restored *restored = RX_NEW(rx_restored, 1);
    if (restored == NULL)
        return rx_error_memory(err, sizeof *restored);
    restored->name = "NONE";
    restored->width = tile->width;
    restored->height = tile->height;
    restored->chi2 = NAN;
    restored->pixels = RX_NEW(float, n);
    restored->mask = RX_NEW(uint8_t, n);
    restored->sigma = RX_NEW(float, n);
    restored->psf = psf != NULL ? rx_psf_copy(psf) : NULL;
    if (restored->pixels == NULL || restored->mask == NULL || restored->sigma == NULL ||
        (psf != NULL && restored->psf == NULL)) {
        rx_restored_free(restored);
        return rx_error_memory(err, 2 * n * sizeof(float));
    }
    const int hide = RX_MASK_BAD | RX_MASK_WEIGHT | (par->mask_saturated ? RX_MASK_SATURATED : 0);
    for (size_t k = 0; k < n; k++) {
        restored->mask[k] = (uint8_t)(tile->mask[k] & hide);
        restored->pixels[k] = restored->mask[k] != 0 ? 0 : tile->pixels[k] - background->level[k];
    }
    memcpy(restored->sigma, background->sigma, n * sizeof *restored->sigma);
    restored->seconds = rx_seconds() - begun;
    *dst = restored;
    return RX_OK;
}
