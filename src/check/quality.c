/* Source lists and pictures for the QA report. */
#include "check/quality.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "io/wcs.h"

rx_status rx_quality_list(const rx_quality_params *par, const rx_tile *tile, const rx_sources *sources,
                          rx_qa_list *dst, rx_error *err)
{
    RX_TRY(rx_qa_list_new(dst, sources->n, 1, err));
    for (long i = 0; i < sources->n; i++) {
        const rx_source *s = &sources->list[i];
        const double fluxes[][2] = {[RX_QUALITY_AUTO] = {s->flux_auto, s->fluxerr_auto},
                                    [RX_QUALITY_APER] = {s->flux_aper[0], s->fluxerr_aper[0]},
                                    [RX_QUALITY_ISO] = {s->flux_iso, s->fluxerr_iso},
                                    [RX_QUALITY_ISOCOR] = {s->flux_isocor, s->fluxerr_isocor},
                                    [RX_QUALITY_PETRO] = {s->flux_petro, s->fluxerr_petro},
                                    [RX_QUALITY_WIN] = {s->flux_win, s->fluxerr_win},
                                    [RX_QUALITY_TEMPLATE] = {s->fit.flux, s->fit.fluxerr}};
        const double flux = fluxes[par->flux][0], error = fluxes[par->flux][1];
        dst->x[i] = s->x;
        dst->y[i] = s->y;
        dst->alpha[i] = s->alpha_j2000;
        dst->delta[i] = s->delta_j2000;
        dst->flux[i] = flux;
        dst->flux_error[i] = error;
        dst->mag[i] = flux > 0.0 ? tile->zeropoint - 2.5 * log10(flux) : NAN;
        dst->mag_error[i] = flux > 0.0 ? RX_MAG_ERROR * error / flux : NAN;
        dst->score[i] = s->detection_snr;
        dst->flags[i] = s->flags;
        dst->restore[i] = s->fit.restore;
        dst->made_up[i] = rx_source_is_spurious(s) != 0;
    }
    return RX_OK;
}

double rx_quality_scale(const rx_tile *tile)
{
    return tile->wcs != NULL
               ? rx_wcs_pixel_scale(tile->wcs, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1))
               : tile->pixel_scale;
}

rx_status rx_quality_radius(const rx_quality_params *par, const rx_tile *tile, double *pixels, rx_error *err)
{
    double scale = rx_quality_scale(tile);
    *pixels = par->match_radius;
    if (!par->match_arcsec)
        return RX_OK;
    if (!(scale > 0.0))
        return rx_error_at(
            err, RX_USAGE, tile->name, tile->hdu, 0,
            "MATCH_UNIT ARCSEC needs the pixel scale, which is not known; give PIXEL_SCALE or PIXEL");
    *pixels = par->match_radius / scale;
    return RX_OK;
}

rx_status rx_quality_picture(const char *title, int width, int height, const float *pixels, double sigma,
                             rx_qa_picture *dst, rx_error *err)
{
    enum { SIDE = 256 };
    int w = width < SIDE ? width : SIDE, h = height < SIDE ? height : SIDE;
    int x0 = (width - w) / 2, y0 = (height - h) / 2;
    float *copy;
    RX_TRY(RX_MAKE(copy, (size_t)w * (size_t)h, err));
    for (int y = 0; y < h; y++)
        memcpy(copy + (size_t)y * (size_t)w, pixels + (size_t)(y0 + y) * (size_t)width + (size_t)x0,
               (size_t)w * sizeof(float));
    *dst = (rx_qa_picture){.title = title, .width = w, .height = h, .pixels = copy, .sigma = (float)sigma};
    return RX_OK;
}
