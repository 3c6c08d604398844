/* The analytic PSF, and the choice among the kinds. */
#include "psf/psf.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "psf/moffat.h"
#include "psf/psf_stars.h"

enum { HALF_MIN = 2, HALF_MAX = 127 };

static int moffat_half_size(double fwhm, double beta, double ratio)
{
    double radius = fmin(rx_moffat_radius_flux(beta, 1e-3), rx_moffat_radius_level(beta, 1e-5));
    double half = ceil(0.5 * fwhm / sqrt(ratio) * radius), most = fmax(HALF_MAX, 2.0 * fwhm);
    return (int)fmin(fmax(half, HALF_MIN), most);
}

static rx_status check_moffat(double fwhm, double beta, double ratio, double angle, int size, rx_error *err)
{
    if (!(fwhm >= 0.1 && fwhm <= 200.0))
        return rx_error_set(err, RX_INPUT, "a PSF FWHM of %g pixels cannot be used; give PSF_FWHM 0.1 to 200",
                            fwhm);
    if (!(beta >= 1.2 && beta <= 1000.0))
        return rx_error_set(err, RX_INPUT,
                            "a Moffat exponent of %g cannot be used; give PSF_BETA 1.2 to 1000", beta);
    if (!(ratio >= 0.05 && ratio <= 1.0) || !isfinite(angle))
        return rx_error_set(err, RX_INPUT, "a PSF axis ratio of %g cannot be used; give 0.05 to 1", ratio);
    if (size != 0 && (size < 1 || size % 2 == 0 || size > RX_PSF_LARGEST))
        return rx_error_set(err, RX_INPUT,
                            "a PSF size of %d pixels cannot be used; give an odd PSF_SIZE, or 0", size);
    return RX_OK;
}

rx_status rx_psf_moffat(double fwhm, double beta, double ratio, double angle, int size, rx_psf **dst,
                        rx_error *err)
{
    *dst = NULL;
    rx_status status = check_moffat(fwhm, beta, ratio, angle, size, err);
    if (status != RX_OK)
        return status;
    if (size == 0)
        size = 2 * moffat_half_size(fwhm, beta, ratio) + 1;
    const int fine = rx_psf_narrow_samples(fwhm * sqrt(ratio)),
              side = fine * (size - 1) + 1; /* of the minor axis */
    rx_psf *psf = rx_psf_new(RX_PSF_MOFFAT, size, 1);
    double *values = RX_NEW(double, (size_t)side *(size_t)side), sum = 0.0;
    if (psf == NULL || values == NULL || (fine > 1 && !rx_psf_sample(psf, fine))) {
        rx_psf_free(psf);
        free(values);
        return rx_error_memory(err, 0);
    }
    double shape[RX_MOFFAT_SHAPE];
    rx_moffat profile;
    rx_moffat_shape(fwhm, beta, ratio, angle, shape);
    rx_moffat_set(&profile, shape);
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++)
            values[j * side + i] =
                rx_moffat_pixel(&profile, (double)(i - side / 2) / fine, (double)(j - side / 2) / fine, NULL);
    for (int j = 0; j < side; j += fine)
        for (int i = 0; i < side; i += fine)
            sum += values[j * side + i];
    for (int i = 0; i < side * side; i++)
        (fine > 1 ? psf->samples : psf->basis)[i] = (float)(values[i] / sum);
    if (fine > 1)
        rx_psf_pick(psf);
    free(values);
    psf->fwhm = fwhm;
    psf->beta = beta;
    psf->ellipticity = 1.0 - ratio;
    if (ratio < 1.0)
        snprintf(psf->description, sizeof psf->description,
                 "elliptical Moffat FWHM %.3f px, beta %.3g, ellipticity %.3f", fwhm, beta, 1.0 - ratio);
    else
        snprintf(psf->description, sizeof psf->description, "Moffat FWHM %.3f px, beta %.4g", fwhm, beta);
    *dst = psf;
    return RX_OK;
}

rx_status rx_psf_check_size(const char *file, int psf_width, int psf_height, int width, int height,
                            rx_error *err)
{
    if (psf_width > RX_PSF_LARGEST || psf_height > RX_PSF_LARGEST)
        return rx_error_at(err, RX_INPUT, file, -1, 0,
                           "a PSF of %d x %d pixels is larger than %d; give an odd PSF_SIZE", psf_width,
                           psf_height, RX_PSF_LARGEST);
    if (psf_width <= width && psf_height <= height)
        return RX_OK;
    return rx_error_at(
        err, RX_INPUT, file, -1, 0,
        "a PSF of %d x %d pixels is larger than the tile of %d x %d; give a smaller one or an odd PSF_SIZE",
        psf_width, psf_height, width, height);
}

/* A size that is ours to choose never exceeds the tile. */
static rx_status make_moffat(const rx_psf_params *par, const rx_image *image, rx_psf **dst, rx_error *err)
{
    int most = image->width < image->height ? image->width : image->height;
    rx_status status = RX_OK;
    if (par->size > 0)
        status = rx_psf_check_size("", par->size, par->size, image->width, image->height, err);
    if (status == RX_OK)
        status = rx_psf_moffat(par->fwhm, par->beta, 1.0, 0.0, par->size, dst, err);
    if (status != RX_OK || (*dst)->size <= most)
        return status;
    rx_psf_free(*dst);
    return rx_psf_moffat(par->fwhm, par->beta, 1.0, 0.0, most - 1 + most % 2, dst, err);
}

/* Of the stars of the list, on the image in its own unit: variances of pixels are in single precision. */
static rx_status measure(const rx_psf_params *par, const rx_image *image, const rx_sources *stars,
                         rx_log *log, rx_psf **dst, rx_error *err)
{
    rx_psf_params own = *par;
    rx_sources list = *stars;
    rx_image_scaled scaled;
    rx_source *copies = NULL;
    rx_status status = RX_OK;
    if (!rx_image_in_unit(image, &scaled))
        RX_TRY_EXIT(rx_error_memory(err, (size_t)image->width * (size_t)image->height * sizeof(float)));
    if (scaled.unit != 1.0) {
        RX_TRY_EXIT(RX_MAKE(copies, (size_t)stars->n, err));
        memcpy(copies, stars->list, (size_t)stars->n * sizeof *copies);
        list.list = copies;
    }
    own.unit = scaled.unit;
    own.flattened /= scaled.unit;
    for (int i = 0; copies != NULL && i < stars->n; i++) {
        rx_source *s = &copies[i];
        s->peak /= scaled.unit;
        s->flux_auto /= scaled.unit;
        s->fluxerr_auto /= scaled.unit;
    }
    status = rx_psf_measure(&own, &scaled.image, &list, log, dst, err);
    if (status != RX_OK)
        goto exit;
    (*dst)->quality.limit *= scaled.unit;
    for (int i = 0; (*dst)->tested != NULL && i < (*dst)->tested->nstars; i++)
        (*dst)->tested->star[i].flux *= scaled.unit;
exit:
    rx_image_scaled_clear(&scaled);
    free(copies);
    return status;
}

rx_status rx_psf_make(const rx_psf_params *par, const rx_image *image, const rx_sources *stars, rx_log *log,
                      rx_psf **dst, rx_error *err)
{
    *dst = NULL;
    if (par->size != 0 && (par->size < 1 || par->size % 2 == 0))
        return rx_error_set(err, RX_USAGE, "PSF_SIZE %d: a PSF has a middle pixel; give an odd number, or 0",
                            par->size);
    switch (par->type) {
    case RX_PSF_MOFFAT:
        return make_moffat(par, image, dst, err);
    case RX_PSF_FILE:
        return rx_psf_file(par, image->width, image->height, log, dst, err);
    case RX_PSF_PSFEX:
        return rx_psf_psfex(par, image->width, image->height, log, dst, err);
    case RX_PSF_AUTO:
        if (stars == NULL)
            return rx_error_set(err, RX_USAGE, "PSF_TYPE AUTO measures the stars of a list; none was given");
        return measure(par, image, stars, log, dst, err);
    case RX_PSF_GAUSS: /* what restored images have, never a tile */
    case RX_PSF_PIXEL:
        break;
    }
    return rx_error_set(err, RX_USAGE, "PSF_TYPE is none of MOFFAT, FILE, PSFEX and AUTO");
}
