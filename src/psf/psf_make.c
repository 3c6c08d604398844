/* The choice among the kinds of PSF. */
#include "psf/psf.h"

#include "psf/psf_parts.h"

/* A size that is ours to choose never exceeds the tile. */
static rx_status make_moffat(const rx_psf_params *par, const rx_tile *tile, rx_psf **dst, rx_error *err)
{
    int most = tile->width < tile->height ? tile->width : tile->height;
    rx_status status = RX_OK;
    if (par->size > 0)
        status = rx_psf_check_size("", par->size, par->size, tile->width, tile->height, err);
    if (status == RX_OK)
        status = rx_psf_moffat(par->fwhm, par->beta, 1.0, 0.0, par->size, dst, err);
    if (status != RX_OK || (*dst)->size <= most)
        return status;
    rx_psf_free(*dst);
    return rx_psf_moffat(par->fwhm, par->beta, 1.0, 0.0, most - 1 + most % 2, dst, err);
}

rx_status rx_psf_make(const rx_psf_params *par, const rx_tile *tile, const rx_background *background,
                      const rx_sources *stars, rx_log *log, rx_psf **dst, rx_error *err)
{
    *dst = NULL;
    if (par->size != 0 && (par->size < 1 || par->size % 2 == 0))
        return rx_error_set(err, RX_USAGE, "PSF_SIZE %d: a PSF has a middle pixel; give an odd number, or 0",
                            par->size);
    switch (par->type) {
    case RX_PSF_MOFFAT:
        return make_moffat(par, tile, dst, err);
    case RX_PSF_FILE:
        return rx_psf_image(par->file, par->size, tile->width, tile->height, log, dst, err);
    case RX_PSF_PSFEX:
        return rx_psf_psfex(par->file, tile->extension, par->size, tile->width, tile->height, log, dst, err);
    case RX_PSF_AUTO:
        return rx_psf_estimate(par, tile, background, stars, log, dst, err);
    case RX_PSF_GAUSS: /* what restored images have, never a tile */
    case RX_PSF_PIXEL:
        break;
    }
    return rx_error_set(err, RX_USAGE, "PSF_TYPE is none of MOFFAT, FILE, PSFEX and AUTO");
}
