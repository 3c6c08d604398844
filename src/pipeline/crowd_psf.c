/* The PSF of a crowd. */
#include "pipeline/crowd_psf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "pipeline/pipeline.h"
#include "pipeline/prepare.h"
#include "pipeline/proposals.h"

enum { PASSES = 3 };
/* Areas of FWHM^2 a source that is detected; the PSF of fewer changes fluxes by less than it changes by noise (crowded.py, seeds 321, 322:
 * 8000-4V of 31 to 33 gains .005 of recall and loses .005 of bias, 8000-2.5 of 63 neither). */
static const double BEAMS = 50.0;
static const double CROWDED = 0.5; /* of the tile */
static const double ALONE = 5.0;   /* FWHM */
/* Of a crowd 8 of them hold 650 detected sources or more, at 8,000 stars per Mpixel and FWHM 4 some 1,700 and 290 candidates for the PSF.
 * Twice or three times as many give no other fluxes (validation/crowded.py 8000-4, sides of 1000 and 2048, seeds 321, 322, 331, 332). */
enum { SQUARES = 12 };
static const double SIDE = 64.0; /* FWHM, of a square */
static const double GOLDEN =
    0.618034; /* rows of squares differ by that share of a step: evenly, and never alike */

rx_status rx_psf_squares(const rx_image *image, double fwhm, uint8_t **mask, int *step, rx_error *err)
{
    const int side = (int)(SIDE * fwhm) + 1, nx = (image->width + side - 1) / side,
              ny = (image->height + side - 1) / side;
    *mask = NULL;
    *step = (nx * ny + SQUARES - 1) / SQUARES;
    if (*step == 1)
        return RX_OK;
    const size_t n = (size_t)image->width * (size_t)image->height;
    RX_TRY(RX_MAKE(*mask, n, err));
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
            const int shift = (int)(GOLDEN * *step * (y / side)), off = (x / side + shift) % *step != 0;
            (*mask)[k] = (uint8_t)((image->mask != NULL ? image->mask[k] : 0) | (off ? RX_MASK_BAD : 0));
        }
    return RX_OK;
}

/* By how much fluxes of points change, relative. */
static rx_status change(const rx_psf *before, const rx_psf *after, const rx_image *image, double *dst,
                        rx_error *err)
{
    const double x = 0.5 * (image->width - 1), y = 0.5 * (image->height - 1);
    const int half = (before->size < after->size ? before->size : after->size) / 2;
    const size_t n[2] = {(size_t)before->size * (size_t)before->size,
                         (size_t)after->size * (size_t)after->size};
    double aa = 0, ab = 0;
    float *a;
    RX_TRY(RX_MAKE(a, n[0] + n[1], err));
    float *const b = a + n[0];
    rx_psf_at(before, x, y, a);
    rx_psf_at(after, x, y, b);
    for (int v = -half; v <= half; v++)
        for (int u = -half; u <= half; u++) {
            const double p = a[(before->size / 2 + v) * before->size + before->size / 2 + u],
                         q = b[(after->size / 2 + v) * after->size + after->size / 2 + u];
            aa += p * p;
            ab += p * q;
        }
    *dst = ab / aa - 1.0;
    free(a);
    return RX_OK;
}

/* On the pixels without the model. */
static rx_status measure(const rx_pipeline_params *params, int role, const rx_field *field,
                         const rx_tphot *fit, rx_psf **dst, double *by, rx_error *err)
{
    const size_t n = (size_t)field->image.width * (size_t)field->image.height;
    rx_image image = field->image;
    rx_pipeline_params par = *params;
    rx_field *between = NULL;
    float *pixels;
    RX_TRY(RX_MAKE(pixels, n, err));
    for (size_t i = 0; i < n; i++)
        pixels[i] = image.pixels[i] - (image.mask != NULL && image.mask[i] != 0 ? 0.0f : fit->model[i]);
    image.pixels = pixels;
    image.hide = RX_HIDE_PLAIN; /* what is saturated still is */
    image.psf = NULL;
    par.templates.wanted = 0;
    par.noise.origin = RX_NOISE_WHITE;
    /* Peaks that pile up are those of the brightest stars here, the others being off. */
    par.psf.flattened = field->psf->quality.limit > 0.0 ? field->psf->quality.limit : HUGE_VAL;
    rx_noise_correlation noise;
    rx_status status = rx_field_of_image(&image, &between, err);
    if (status == RX_OK)
        status = rx_field_begin(&par, role | RX_FIELD_PSF, between, &noise, NULL, err);
    const int found =
        status == RX_OK && between->psf != NULL && between->psf->quality.how == RX_PSF_BY_PIXELS;
    if (found)
        status = change(field->psf, between->psf, &image, by, err);
    if (found && status == RX_OK) {
        *dst = between->psf;
        between->psf = NULL;
        (*dst)->quality.neighbours = fit->modelled;
        (*dst)->quality.limit = fmax((*dst)->quality.limit, field->psf->quality.limit);
    }
    rx_field_free(between);
    free(pixels);
    return status;
}

rx_status rx_psf_between(const rx_pipeline_params *params, int role, const rx_field *field, rx_log *log,
                         rx_psf **dst, double *by, rx_error *err)
{
    const rx_psf *psf = field->psf;
    const double area = (double)field->image.width * (double)field->image.height;
    rx_field some = *field;
    uint8_t *mask;
    int step;
    rx_pipeline_params par = *params;
    rx_result result;
    *dst = NULL;
    *by = 0;
    if (!par.templates.wanted || par.templates.par.crowding == RX_CROWDING_NO ||
        psf->quality.how != RX_PSF_BY_PIXELS || field->nstars * psf->fwhm * psf->fwhm * BEAMS < area)
        return RX_OK;
    par.examine_residual = 0;
    if (par.detect.filter_auto) /* this PSF cannot decide */
        rx_proposals_without_psf(&par.detect);
    par.templates.precision = 0.0;
    /* Points describe galaxies and blends well enough to take them off the stars beside them. */
    par.templates.par.extended = par.templates.par.covariance = par.templates.par.point_fits = 0;
    par.templates.par.keep_model = 1;
    par.templates.par.isolate = ALONE * psf->fwhm;
    par.templates.par.passes = rx_min_int(par.templates.par.passes, PASSES);
    par.measure.skip = RX_SKIP_APER | RX_SKIP_AUTO | RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN;
    par.measure.vignet_width = par.measure.vignet_height = 0;
    RX_TRY(rx_psf_squares(&field->image, psf->fwhm, &mask, &step, err));
    if (mask != NULL)
        some.image.mask = mask;
    rx_status status = rx_field_extract(&par, rx_restorer_find("NONE"), &some, NULL, NULL, &result, err);
    if (status == RX_OK && result.templates.tphot != NULL && result.templates.tphot->crowded >= CROWDED)
        status = measure(params, role, &some, result.templates.tphot, dst, by, err);
    if (*dst != NULL)
        rx_log_info(
            log, "%s[%d]: a crowd: PSF anew from 1/%d of the tile, neighbours taken off, fluxes by %+.4f: %s",
            field->image.name, field->image.hdu, step, *by, (*dst)->description);
    rx_result_free(&result);
    free(mask);
    return status;
}
