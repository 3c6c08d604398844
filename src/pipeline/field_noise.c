/* The noise of a tile: correlation, effective noise, gain. */
#include "pipeline/field_noise.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "detect/correlation.h"
#include "detect/photons.h"

/* What is known of the noise beside its width. */
rx_status rx_field_noise_known(const rx_pipeline_params *params, rx_field *field, rx_error *err)
{
    const rx_correlation_params *par = &params->noise;
    const rx_image image = rx_field_restorable(field);
    if (par->origin == RX_NOISE_GIVEN && par->kernel != NULL)
        field->noise = rx_noise_of_kernel(par->kernel, par->kernel_width, par->kernel_height);
    else if (par->origin == RX_NOISE_MEASURED)
        RX_TRY(rx_correlation_measure(&image, NULL, params->nthreads, &field->noise, err));
    else
        field->noise = rx_noise_white(RX_NOISE_WHITE);
    return RX_OK;
}

/* The PSF in the middle of the tile, to be freed. */
static rx_status middle_stamp(const rx_field *field, const rx_psf *psf, float **dst, rx_error *err)
{
    RX_TRY(RX_MAKE(*dst, (size_t)psf->size * (size_t)psf->size, err));
    rx_psf_at(psf, 0.5 * (field->image.width - 1), 0.5 * (field->image.height - 1), *dst);
    return RX_OK;
}

/* The variance of the sky's photons over what was measured of all noise; 0: not known. */
static double photon_share(const rx_field *field, const rx_noise_correlation *noise)
{
    const double variance = pow(field->plain->global_sigma * noise->scale, 2.0);
    return field->image.gain > 0.0 && field->plain->global_level > 0.0 && variance > 0.0
               ? field->plain->global_level / field->image.gain / variance
               : 0.0;
}

rx_status rx_field_noise_measure(const rx_field *field, const unsigned char *used, int nthreads,
                                 rx_noise_correlation *dst, rx_error *err)
{
    const rx_psf *psf = field->psf;
    const rx_image image = used != NULL ? rx_field_observed(field) : rx_field_restorable(field);
    RX_TRY(rx_correlation_measure(&image, used, nthreads, dst, err));
    if (psf == NULL || !dst->correlated)
        return RX_OK;
    float *stamp;
    RX_TRY(middle_stamp(field, psf, &stamp, err));
    rx_noise_without_light(dst, stamp, psf->size, psf->size, photon_share(field, dst));
    free(stamp);
    return RX_OK;
}

/* The sigma of a mesh is that of pixels within 3 of it, as in SExtractor: .985 of the noise or less, more where light fills the
 * sky. Where no map states the noise it is what pixels without sources have, but for light. */
static void take_width(const rx_background_params *par, rx_field *field)
{
    const rx_weight_type weight = field->image.weight_type;
    if (field->noise.origin != RX_NOISE_MEASURED || field->plain->passes < 2 || weight == RX_WEIGHT_MAP_RMS ||
        (weight > RX_WEIGHT_MAP_RMS && par->no_rescale))
        return;
    const double factor = field->noise.scale / (field->widened > 0.0 ? field->widened : 1.0);
    rx_background_widen(field->plain, factor);
    if (field->restored != field->plain)
        rx_background_widen(field->restored, factor);
    field->widened = field->noise.scale;
    field->noise.scale = 1.0;
}

static const double LEAST_FACTOR = 0.7;

/* Of the matched filter, or of wide sums where no PSF serves; `of_light`, or NULL, says what light looks like there. What sharpening
 * leaves, or a correlation that was measured wrongly, is not believed. */
rx_status rx_field_noise_effective(const rx_pipeline_params *params, rx_field *field, const rx_psf *of_light,
                                   rx_log *log, rx_error *err)
{
    const rx_psf *psf = field->psf != NULL ? field->psf : of_light;
    const rx_image *image = &field->image;
    if (psf != NULL && field->noise.correlated) {
        float *stamp;
        RX_TRY(middle_stamp(field, psf, &stamp, err));
        rx_noise_without_light(&field->noise, stamp, psf->size, psf->size,
                               photon_share(field, &field->noise));
        field->noise_factor = rx_noise_factor(&field->noise, stamp, psf->size, psf->size);
        free(stamp);
    }
    if (field->psf == NULL || !field->noise.correlated)
        field->noise_factor = rx_noise_factor_wide(&field->noise);
    if (field->noise.origin == RX_NOISE_MEASURED && field->noise_factor < LEAST_FACTOR) {
        rx_log_warning(
            log,
            "%s[%d]: its noise is finer than any resampling leaves it (a matched filter has %.2f times that "
            "of independent pixels); it is taken as independent, errors and thresholds may be too large",
            image->name, image->hdu, field->noise_factor);
        field->noise = rx_noise_white(RX_NOISE_UNKNOWN);
        field->noise_factor = 1.0;
    }
    take_width(&params->background[0], field);
    rx_map_scaled(&field->effective, rx_background_noise(field->restored), (float)field->noise_factor);
    field->image.correlation = &field->noise;
    return RX_OK;
}

static const char *const origins[] = {[RX_NOISE_UNKNOWN] = "UNKNOWN",
                                      [RX_NOISE_WHITE] = "WHITE",
                                      [RX_NOISE_MEASURED] = "MEASURED",
                                      [RX_NOISE_GIVEN] = "FILE"};

const char *rx_field_noise_origin(const rx_field *field)
{
    return origins[field->noise.origin];
}

void rx_field_noise_log(const rx_field *field, rx_log *log)
{
    const rx_noise_correlation *noise = &field->noise;
    const rx_image *image = &field->image;
    const int mid = RX_NOISE_REACH;
    double q[RX_NOISE_QUADRANTS];
    for (int i = 0; i < RX_NOISE_QUADRANTS; i++)
        q[i] = rx_noise_quadrant_factor(noise, i);
    const rx_noise_law law = rx_noise_law_of(noise);
    double sums[4], power[2][5];
    static const double radii[] = {1.5, 3.0, 5.0, 10.0};
    for (int i = 0; i < 4; i++)
        sums[i] = rx_noise_law_factor(&law, M_PI * radii[i] * radii[i]);
    for (int i = 0; i < 5; i++) {
        power[0][i] = rx_noise_power(noise, i / 8.0, 0.0);
        power[1][i] = rx_noise_power(noise, 0.0, i / 8.0);
    }
    if (rx_noise_is_structure(noise))
        rx_log_warning(
            log,
            "%s[%d]: its noise is correlated more than any resampling leaves it: wide sums of pixels have "
            "%.1f times that of independent ones (RXNWIDE; limit %g): fringes, light that fills the tile, or "
            "smoothing; thresholds and errors rise with it, every source has FLAGS_RESTORE 128",
            image->name, image->hdu, rx_noise_factor_wide(noise), RX_NOISE_RESAMPLED);
    if (field->noise_factor > 1.1)
        rx_log_info(log,
                    "%s[%d]: noise is correlated: a matched filter has %.2f times that of independent pixels",
                    image->name, image->hdu, field->noise_factor);
    if (rx_noise_uneven(noise))
        rx_log_warning(
            log,
            "%s[%d]: its noise is not correlated alike everywhere: wide sums have %.2f, %.2f, %.2f and %.2f "
            "times that of independent pixels in its quadrants (low left, low right, high left, high "
            "right); errors and thresholds are those of the whole tile",
            image->name, image->hdu, q[0], q[1], q[2], q[3]);
    rx_log_detail(
        log,
        "%s[%d]: noise %s: correlation at lag 1 %.3f in x, %.3f in y, +-%.4f (%ld pixels); noise of the "
        "matched filter %.3f, of circles of radius 1.5, 3, 5 and 10 pixels %.3f %.3f %.3f %.3f, of wide sums "
        "%.3f (quadrants %.2f %.2f %.2f %.2f) times that of independent pixels; power at 0, 1/8, 1/4, 3/8 "
        "and "
        "1/2 cycles per pixel %.3f %.3f %.3f %.3f %.3f in x, %.3f %.3f %.3f %.3f %.3f in y",
        image->name, image->hdu, origins[noise->origin], noise->at[mid][mid + 1], noise->at[mid + 1][mid],
        noise->error, noise->pixels, field->noise_factor, sums[0], sums[1], sums[2], sums[3],
        rx_noise_factor_wide(noise), q[0], q[1], q[2], q[3], power[0][0], power[0][1], power[0][2],
        power[0][3], power[0][4], power[1][0], power[1][1], power[1][2], power[1][3], power[1][4]);
}

/* A gain in another unit than the pixels' claims photon noise that is not there, or none. */
rx_status rx_field_gain_check(rx_field *field, rx_log *log, rx_error *err)
{
    const rx_image image = rx_field_restorable(field);
    const char *card = field->tile != NULL ? field->tile->gain_card : "";
    char why[120];
    rx_photon_test test;
    RX_TRY(rx_photons_test(&image, field->plain->global_level, &field->noise, &test, err));
    if (test.impossible == 0)
        return RX_OK;
    if (test.impossible > 0)
        snprintf(why, sizeof why, "its sky has %.3g times the noise of its photons", sqrt(test.ratio));
    else
        snprintf(why, sizeof why, "%ld of %ld bright pixels scatter by less than half of their photon noise",
                 test.quiet, test.n);
    rx_log_warning(
        log,
        "%s[%d]: %s%s = %g e-/ADU cannot be the gain of its pixels: %s; errors are without the photons "
        "of sources (RXGAIN 0); give their GAIN%s",
        image.name, image.hdu, card[0] != '\0' ? "card " : "", card[0] != '\0' ? card : "GAIN", image.gain,
        why, card[0] != '\0' ? ", and a GAIN_KEY that the header lacks" : "");
    field->image.gain = 0.0;
    if (field->tile != NULL)
        field->tile->gain = 0.0;
    return RX_OK;
}
