/* Measuring the sources of one restorer. */
#include "stage/photometry.h"

#include <stdlib.h>

#include "base/memory.h"
#include "measure/measure.h"

static rx_measure_image image_of(const rx_options *options, const rx_field *detect, const rx_field *field,
                                 const rx_background *background)
{
    const rx_tile *tile = field->tile;
    return (rx_measure_image){.width = tile->width,
                              .height = tile->height,
                              .sigma = background->sigma,
                              .level = rx_background_level(background),
                              .saturated_mask = tile->mask,
                              .gain = tile->gain,
                              .global_sigma = background->global_sigma,
                              .variable_noise = tile->weight_type != RX_WEIGHT_NONE,
                              .weight_gain = options->background[0].weight_gain,
                              .nflagmaps = detect->tile->nflagmaps,
                              .flagmaps = detect->tile->flagmaps,
                              .flag_types = options->flag_types,
                              .law_scale = 1.0,
                              .law_power = 0.5};
}

static rx_measure_image restored_image(const rx_options *options, const rx_field *detect,
                                       const rx_field *field, const rx_restored *restored)
{
    rx_measure_image image = image_of(options, detect, field, field->restored);
    image.pixels = restored->pixels;
    image.mask = restored->mask;
    image.mask_bits = RX_HIDE_RESTORED;
    return image;
}

/* Of a larger tile a plane weighs more than the time to make its pixels one by one, where few are wanted. */
static const size_t WHOLE = (size_t)1 << 25;

/* *pixels is the plane the image points at, the caller's; NULL where that of NONE serves, or that of the tile
 * when few pixels of a large one are wanted. */
static rx_status untouched_image(const rx_options *options, const rx_field *detect, const rx_field *field,
                                 const rx_restored *none, int few, float **pixels, rx_measure_image *dst,
                                 rx_error *err)
{
    const rx_tile *tile = field->tile;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    *dst = image_of(options, detect, field, field->plain);
    if (none != NULL) {
        dst->mask_bits = options->saturated_in_none ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
        dst->pixels = none->pixels;
        dst->mask = none->mask;
        return RX_OK;
    }
    dst->mask_bits = options->saturated_in_none ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    dst->mask = tile->mask;
    dst->pixels = tile->pixels;
    dst->with_sky = few && n > WHOLE;
    if (dst->with_sky)
        return RX_OK;
    *pixels = RX_NEW(float, n);
    if (*pixels == NULL)
        return rx_error_memory(err, n * sizeof(float));
    rx_field_above_sky(tile, field->plain, dst->mask_bits, options->nthreads, *pixels);
    dst->pixels = *pixels;
    return RX_OK;
}

static rx_measure_params params_of(const rx_options *options, const rx_field *detect, const rx_field *field)
{
    rx_measure_params par = options->measure;
    double scale = field->tile->pixel_scale;
    par.pixel_scale = scale > 0.0 ? scale : 1.0;
    par.seeing_fwhm = options->seeing_arcsec / par.pixel_scale;
    if (field != detect) { /* detection's threshold is that of another image */
        par.analysis_threshold = options->detect.analysis_threshold;
        par.analysis_absolute = options->detect.analysis_absolute;
    }
    return par;
}

/* *area = pixels that a matched filter collects a star's light from, 1 / sum PSF^2, in the middle of the
 * tile. */
static rx_status collecting_area(const rx_psf *psf, const rx_tile *tile, double *area, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    float *stamp = RX_NEW(float, n);
    double power = 0;
    if (stamp == NULL)
        return rx_error_memory(err, n * sizeof *stamp);
    rx_psf_at(psf, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1), stamp);
    for (size_t i = 0; i < n; i++)
        power += (double)stamp[i] * stamp[i];
    free(stamp);
    *area = power > 0 ? 1 / power : 0;
    return RX_OK;
}

/* The noise law of restored pixels. A network leaves no noise on empty sky, though the fluxes that it gives
 * to sources have all the noise of the input: then the law is that of the untouched pixels, of apertures
 * wider by what the tile's PSF spreads. */
static rx_status restored_law(const rx_options *options, const rx_restored *restored, const rx_tile *tile,
                              const rx_measure_image *image, const rx_measure_image *untouched,
                              const rx_sources *sources, rx_log *log, rx_noise_law *law, rx_error *err)
{
    const int hides = restored->noise != NULL;
    double area = 0;
    rx_status status = rx_noise_law_fit(hides ? untouched : image, sources, options->error_apertures,
                                        options->seed, law, log, err);
    if (status == RX_OK && hides && restored->blur != NULL)
        status = collecting_area(restored->blur, tile, &area, err);
    if (status == RX_OK)
        rx_noise_law_widen(law, area);
    return status;
}

static rx_status measure_with_law(int calibrate, const rx_noise_law *law, const rx_measure_params *par,
                                  rx_measure_image *image, rx_sources *sources, rx_log *log, rx_error *err)
{
    image->law_scale = sources->law_scale = law->scale;
    image->law_power = sources->law_power = law->power;
    image->law = law->apertures > 0 ? law : NULL;
    sources->law_apertures = law->apertures;
    sources->law_scatter = law->scatter;
    rx_status status = rx_measure_run(par, image, log, sources, err);
    for (int i = 0; i < sources->n && calibrate && law->apertures == 0; i++)
        sources->list[i].flags_measure |= RX_FLAGM_UNCALIBRATED;
    return status;
}

rx_status rx_photometry_run(const rx_options *options, const rx_field *detect, const rx_restored *detected,
                            const rx_field *field, const rx_restored *restored, const rx_restored *none,
                            rx_sources *sources, rx_log *log, rx_photometry *dst, rx_error *err)
{
    rx_measure_params par = params_of(options, detect, field);
    rx_measure_image untouched, image, detection;
    float *pixels = NULL, *detection_pixels = NULL;
    *dst = (rx_photometry){.law = {.scale = 1.0, .power = 0.5}};
    /* beside a restored image only for checks and empty apertures */
    rx_status status =
        untouched_image(options, detect, field, none, restored != NULL, &pixels, &untouched, err);
    if (status != RX_OK)
        return status;
    if (field != detect && detected != NULL)
        detection = restored_image(options, detect, detect, detected);
    else if (field != detect)
        status = untouched_image(options, detect, detect, NULL, 0, &detection_pixels, &detection, err);
    if (status != RX_OK)
        goto exit;
    if (field != detect)
        untouched.radii = &detection;
    if (restored == NULL) {
        const int calibrate = options->calibrate_none;
        if (calibrate)
            status = rx_noise_law_fit(&untouched, sources, options->error_apertures, options->seed, &dst->law,
                                      log, err);
        if (status == RX_OK)
            status = measure_with_law(calibrate, &dst->law, &par, &untouched, sources, log, err);
    } else {
        const int calibrate = options->calibrate_restored;
        image = restored_image(options, detect, field, restored);
        image.radii = untouched.radii;
        if (calibrate)
            status = restored_law(options, restored, field->tile, &image, &untouched, sources, log, &dst->law,
                                  err);
        if (status == RX_OK)
            status = measure_with_law(calibrate, &dst->law, &par, &image, sources, log, err);
        if (status == RX_OK && restored->blur != NULL)
            status = rx_fluxcheck_run(&par, &image, &untouched, restored->blur->fwhm, sources, log,
                                      &dst->check, err);
    }
exit:
    free(detection_pixels);
    free(pixels);
    return status;
}
