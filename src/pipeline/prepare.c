/* What is found out of a tile before it is restored. */
#include "pipeline/prepare.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/gaps.h"
#include "pipeline/field_mask.h"
#include "pipeline/field_noise.h"
#include "pipeline/psf_source.h"

/* Share of the pixels at SATUR_LEVEL or above. */
static double saturated_share(const rx_image *image)
{
    const size_t width = (size_t)image->width;
    size_t all = 0;
    for (int y = 0; image->mask != NULL && y < image->height; y++) {
        const uint8_t *mask = image->mask + (size_t)y * width;
        unsigned in_row = 0;
#pragma omp simd reduction(+ : in_row)
        for (size_t x = 0; x < width; x++)
            in_row += (mask[x] & RX_MASK_SATURATED) != 0;
        all += in_row;
    }
    return (double)all / ((double)width * (double)image->height);
}

static rx_status measure_background(const rx_pipeline_params *params, int role, const rx_image *input,
                                    int hide, rx_background **dst, rx_error *err)
{
    rx_image image = *input;
    image.hide = hide;
    return rx_error_where(err, rx_background_measure(&params->background[role], &image, dst, err),
                          input->name, input->hdu, 0);
}

static void warn_without_noise(const rx_field *field, rx_log *log)
{
    const rx_image *image = &field->image;
    if (field->plain->constant && !rx_field_has_pixels(field))
        rx_log_warning(log,
                       "%s[%d]: all of its pixels are masked or hold no data, so that no source is found",
                       image->name, image->hdu);
    else if (field->plain->constant)
        rx_log_warning(log,
                       "%s[%d]: it has no noise that could be measured (a map, rounded numbers?): sigma is "
                       "taken for 1, thresholds and errors mean nothing; give the noise (WEIGHT_TYPE "
                       "MAP_RMS)",
                       image->name, image->hdu);
}

/* Both backgrounds. */
static rx_status measure_backgrounds(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                                     rx_error *err)
{
    static const double many = 0.1; /* of the pixels: no sky has so many bright stars */
    const double saturated = saturated_share(&field->image);
    if (saturated > many)
        rx_log_warning(
            log,
            "%s[%d]: %.0f %% of its pixels are at SATUR_LEVEL %g or above, so that their sources "
            "count as saturated (FLAGS 4): give SATUR_LEVEL in the unit of the pixels and, where the "
            "header has SATUR_KEY, a SATUR_KEY that it lacks",
            field->image.name, field->image.hdu, 100.0 * saturated, field->image.saturation);
    int hide_plain = params->saturated_in_none ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    rx_status status = measure_background(params, role, &field->image, hide_plain, &field->plain, err);
    field->restored = field->plain;
    if (status != RX_OK || hide_plain == RX_HIDE_RESTORED || saturated == 0.0)
        return status;
    field->restored = NULL;
    return measure_background(params, role, &field->image, RX_HIDE_RESTORED, &field->restored, err);
}

rx_status rx_field_of_image(const rx_image *image, rx_field **dst, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    *dst = NULL;
    if (image->width < 1 || image->height < 1 || image->pixels == NULL)
        return rx_error_set(err, RX_USAGE, "an image of %d x %d pixels; give width, height and pixels",
                            image->width, image->height);
    rx_field *field = RX_NEW(rx_field, 1);
    if (field != NULL)
        field->mask = RX_NEW(uint8_t, n);
    if (field == NULL || field->mask == NULL) {
        rx_field_free(field);
        return rx_error_memory(err, n);
    }
    rx_field_make_mask(image, field->mask);
    field->image = *image;
    field->image.mask = field->image.saturated = field->mask;
    field->image.hide = 0;
    field->image.with_sky = 1;
    if (image->name == NULL)
        field->image.name = "image";
    if (!(image->saturation > 0.0))
        field->image.saturation = HUGE_VAL;
    *dst = field;
    return RX_OK;
}

rx_status rx_field_begin(const rx_pipeline_params *params, int what, rx_field *field,
                         rx_noise_correlation *noise, rx_log *log, rx_error *err)
{
    const rx_image *image = &field->image;
    const int role = (what & RX_FIELD_MEASURED) != 0;
    rx_lap last = rx_lap_now();
    rx_psf *of_light = NULL;
    rx_status status;
    RX_TRY(rx_field_hide_no_data(params, role, field, log, err));
    RX_TRY(rx_field_find_saturation(field, log, err));
    RX_TRY(measure_backgrounds(params, role, field, log, err));
    RX_TRY(rx_field_hide_hollow(field, log, err));
    rx_field_hide_deep(field, log);
    RX_TRY(rx_field_noise_known(params, field, err));
    RX_TRY(rx_field_gain_check(field, log, err));
    rx_lap_add(&last, &field->background_lap);
    rx_log_detail(log, "%s[%d]: %d x %d pixels, background %g, noise %g, gain %g, pixel scale %g arcsec",
                  image->name, image->hdu, image->width, image->height, field->plain->global_level,
                  field->plain->global_sigma, image->gain, image->pixel_scale);
    if (image->psf != NULL && (field->psf = rx_psf_copy(image->psf)) == NULL)
        return rx_error_memory(err, 0);
    if (image->psf == NULL && (what & (RX_FIELD_PSF | RX_FIELD_FILTER)) != 0)
        RX_TRY(rx_field_psf(params, role, field, (what & RX_FIELD_PSF) != 0 ? log : NULL, err));
    rx_lap_add(&last, &field->psf_lap);
    if (image->psf == NULL && field->psf != NULL)
        rx_log_info(log, "%s[%d]: PSF %s", image->name, image->hdu, field->psf->description);
    if (rx_field_mask(field) != NULL) {
        const rx_image observed = rx_field_observed(field);
        field->cores =
            rx_gaps_mark_cores(&observed, field->psf != NULL ? field->psf->fwhm : 0.0, rx_field_mask(field));
    }
    *noise = field->noise;
    field->image.psf = field->psf;
    if (field->psf == NULL && (what & RX_FIELD_PSF) == 0)
        RX_TRY(rx_field_psf_of_light(params, role, field, &of_light, err));
    status = rx_field_noise_effective(params, field, of_light, log, err);
    rx_psf_free(of_light);
    rx_lap_add(&last, &field->background_lap);
    return status;
}

void rx_field_end(rx_field *field, rx_log *log)
{
    rx_lap last = rx_lap_now();
    rx_field_noise_log(field, log);
    rx_lap_add(&last, &field->background_lap);
    warn_without_noise(field, log);
}
