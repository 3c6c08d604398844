/* The restorer FILE: pixels that were restored elsewhere, with the PSF that they have and, where it is given, their noise.
 *
 * They are in the unit of the tile, above its sky or with it: the sky is taken off where their median is nearer to 0 without it. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"
#include "psf/psf.h"
#include "restore/prepared.h"
#include "restore/runs.h"
#include "restore/stamp.h"

static double median_of(size_t n, const float *pixels, const uint8_t *mask, double *room)
{
    size_t used = 0;
    for (size_t k = 0; k < n; k++)
        if (mask[k] == 0)
            room[used++] = pixels[k];
    return used > 0 ? rx_median(room, used) : 0;
}

static rx_status make_psf(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_psf **dst,
                          rx_error *err)
{
    if (par->file_fwhm > 0) {
        *dst = rx_stamp_gauss(par->file_fwhm);
        return *dst != NULL ? RX_OK : rx_error_memory(err, 0);
    }
    const rx_psf_params psf = {.type = RX_PSF_FILE, .file = par->file_psf};
    return rx_psf_file(&psf, image->width, image->height, log, dst, err);
}

rx_status rx_file_run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                      rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    const double begun = rx_seconds();
    rx_status status;
    *dst = NULL;
    if (image->restored == NULL)
        return rx_error_set(
            err, RX_USAGE,
            "RESTORE_TYPE FILE has no restored pixels of this image, only of one that is read with "
            "RESTORED_NAME; give MEASURE_ON ORIGINAL for a second image");
    rx_restored *restored = rx_restored_new("FILE", image->width, image->height);
    double *room = RX_NEW(double, n);
    if (restored == NULL || room == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof *room));
    RX_TRY_EXIT(make_psf(par, image, log, &restored->psf, err));
    rx_prepared_mask(image, par->nthreads, restored->mask);
    rx_image given = *image; /* as if it held the sky, then as if it did not */
    given.pixels = image->restored;
    given.with_sky = 1;
    rx_image_above_sky(&given, par->nthreads, restored->pixels);
    const double below = median_of(n, restored->pixels, restored->mask, room);
    given.with_sky = 0;
    rx_image_above_sky(&given, par->nthreads, restored->pixels);
    const int with_sky = fabs(below) < fabs(median_of(n, restored->pixels, restored->mask, room));
    given.with_sky = with_sky;
    if (with_sky)
        rx_image_above_sky(&given, par->nthreads, restored->pixels);
    if (image->restored_noise != NULL)
        restored->noise = rx_map_plane(image->restored_noise, image->width);
    snprintf(restored->settings, sizeof restored->settings, "PSF of FWHM %.2f pixels, sky %s, noise %s",
             restored->psf->fwhm, with_sky ? "taken off" : "off before",
             image->restored_noise != NULL ? "given" : "measured");
    restored->seconds = rx_seconds() - begun;
    *dst = restored;
    restored = NULL;
exit:
    free(room);
    rx_restored_free(restored);
    return status;
}
