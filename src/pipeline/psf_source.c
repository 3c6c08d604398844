/* The PSF of a field: of its stars, or as params and what is stated say. */
#include "pipeline/psf_source.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "detect/filter.h"

/* The detection image after the filter; NULL without one. */
static rx_status filter_pixels(const rx_detect_params *par, int nthreads, const rx_image *image,
                               const float *pixels, float **filtered, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    rx_filter filter;
    rx_status status = RX_OK;
    RX_TRY(rx_filter_new(par->filter, par->filter_width, par->filter_height, &filter, err));
    if (filter.values == NULL)
        return RX_OK;
    *filtered = rx_alloc_filled(n, sizeof **filtered, nthreads);
    if (*filtered == NULL)
        status = rx_error_memory(err, n * sizeof **filtered);
    else
        rx_filter_plane(&filter, pixels, image->width, image->height, nthreads, *filtered);
    rx_filter_free(&filter);
    return status;
}

enum { WIDE = 17 };                  /* pixels, of a filter */
static const double WIDE_FWHM = 8.0; /* pixels */

/* Candidate stars for a PSF that is measured: a plain extraction that never looks at saturated values. */
static rx_status find_stars(const rx_pipeline_params *params, const rx_field *field, rx_log *log,
                            rx_sources **dst, rx_error *err)
{
    const size_t n = (size_t)field->image.width * (size_t)field->image.height;
    const rx_map noise = rx_background_noise(field->restored);
    rx_sources *sources = NULL;
    rx_status status = RX_OK;
    float *pixels = RX_NEW(float, n), *sigma = RX_NEW(float, n), *filtered = NULL;
    if (pixels == NULL || sigma == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 2 * n * sizeof(float)));
    rx_image image = rx_field_restorable(field);
    rx_image_above_sky(&image, params->nthreads, pixels);
    rx_map_fill(&noise, image.height, params->nthreads, sigma);
    image.pixels = pixels;
    image.with_sky = 0;
    image.noise = rx_map_plane(sigma, image.width);
    image.variable_noise = 1;
    image.nflagmaps = 0;
    rx_image detection = image;
    detection.gain = 0.0;
    rx_detect_params detect_params = params->detect;
    detect_params.absolute = 0;
    detect_params.threshold = detect_params.analysis_threshold = 3.0;
    rx_measure_params measure_params = params->measure;
    measure_params.star_net = NULL;
    measure_params.weight_gain = 0;
    measure_params.skip = RX_SKIP_PETRO | RX_SKIP_APER | RX_SKIP_WIN;
    measure_params.vignet_width = measure_params.vignet_height = 0;
    measure_params.nradii = 1;
    measure_params.flux_fraction[0] = 0.5;
    /* where the filter finds nothing, stars may be wide and faint */
    for (int wide = 0; wide < 2 && (sources == NULL || sources->n == 0); wide++) {
        float kernel[WIDE * WIDE];
        if (wide) {
            for (int i = 0; i < WIDE * WIDE; i++)
                kernel[i] = (float)exp2(-(pow(i % WIDE - WIDE / 2, 2) + pow(i / WIDE - WIDE / 2, 2)) * 4.0 /
                                        (WIDE_FWHM * WIDE_FWHM));
            detect_params.filter = kernel;
            detect_params.filter_width = detect_params.filter_height = WIDE;
            /* thresholds are sigmas of a pixel, as SExtractor's; here 5 of the filtered noise */
            detect_params.threshold = detect_params.analysis_threshold =
                5.0 * rx_filter_norm(kernel, WIDE * WIDE);
        }
        rx_sources_free(sources);
        sources = NULL;
        /* hidden pixels are 0 already: detection needs no copy of them, and no filtered ones after it */
        RX_TRY_EXIT(filter_pixels(&detect_params, params->nthreads, &image, pixels, &filtered, err));
        const rx_filtered after = {.pixels = filtered != NULL ? filtered : pixels,
                                   .spare = filtered != NULL ? &filtered : NULL};
        RX_TRY_EXIT(rx_detect_run(&detect_params, &detection, &after, log, &sources, err));
        RX_TRY_EXIT(rx_measure_run(&measure_params, &image, NULL, log, sources, err));
    }
    *dst = sources;
    sources = NULL;
exit:
    rx_sources_free(sources);
    free(pixels);
    free(sigma);
    free(filtered);
    return status;
}

/* Where stars give no PSF, or few give one. */
static rx_status stated(const rx_pipeline_params *params, const rx_error *why, rx_field *field, rx_log *log,
                        rx_error *err)
{
    if (params->psf_hints != NULL)
        return params->psf_hints->stated(params, why, field, log, err);
    if (field->psf == NULL)
        rx_log_warning(log, "%s[%d]: %s", field->image.name, field->image.hdu, why->text);
    field->unrestorable = field->psf == NULL;
    return RX_OK;
}

rx_status rx_field_psf(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                       rx_error *err)
{
    rx_psf_params par = params->psf;
    const rx_image image = rx_field_restorable(field);
    par.file = params->psf_files[role];
    par.extension = field->image.extension;
    const bool listed = par.stars_file != NULL && par.stars_file[0] != '\0';
    rx_sources *stars = NULL;
    rx_error why = rx_error_part(err);
    if (listed && par.type != RX_PSF_AUTO)
        rx_log_warning(log, "PSF_STARS_NAME is for PSF_TYPE AUTO, and is not used");
    if (par.type == RX_PSF_MOFFAT && !(par.fwhm > 0.0)) {
        rx_error_set(&why, RX_INPUT,
                     "PSF_TYPE MOFFAT needs the FWHM of stars; give PSF_FWHM in pixels, or "
                     "SEEING_FWHM in arcsec, with PIXEL_SCALE where there is no WCS");
        return stated(params, &why, field, log, err);
    }
    if (par.type != RX_PSF_AUTO)
        return rx_psf_make(&par, &image, NULL, log, &field->psf, err);
    rx_status status = find_stars(params, field, log, &stars, err);
    if (status == RX_OK && listed && params->psf_hints != NULL)
        status = params->psf_hints->mark_stars(params, &field->image, log, stars, err);
    if (status != RX_OK) {
        rx_sources_free(stars);
        return status;
    }
    field->nstars = stars->n;
    status = rx_psf_make(&par, &image, stars, log, &field->psf, &why);
    if (status == RX_INPUT)
        field->psf_bound = rx_psf_bound(&par, &image, stars);
    rx_sources_free(stars);
    /* one source that may be a galaxy says less than whoever stated a width, few say less than PSF_FWHM */
    const int one = status == RX_OK && field->psf->quality.how == RX_PSF_BY_WIDTH;
    if (one || (status == RX_OK && par.fwhm > 0.0 && field->psf->quality.how == RX_PSF_BY_MOFFAT_BETA))
        status = rx_error_set(&why, RX_INPUT,
                              "PSF_TYPE AUTO found only %d star%s; what is stated is believed more",
                              field->psf->nstars, one ? "" : "s");
    if (status == RX_INPUT)
        return stated(params, &why, field, log, err);
    if (status != RX_OK)
        rx_error_take(err, &why);
    return status;
}

rx_status rx_field_psf_of_light(const rx_pipeline_params *params, int role, const rx_field *field,
                                rx_psf **dst, rx_error *err)
{
    const rx_image image = rx_field_restorable(field);
    rx_psf_params par = params->psf;
    rx_sources *stars = NULL;
    rx_error why = rx_error_part(err);
    par.file = params->psf_files[role];
    par.extension = field->image.extension;
    if (field->noise.origin != RX_NOISE_MEASURED || !field->noise.correlated ||
        !rx_noise_reaches_far(&field->noise) || (par.type == RX_PSF_MOFFAT && !(par.fwhm > 0.0)))
        return RX_OK;
    if (par.type == RX_PSF_AUTO)
        RX_TRY(find_stars(params, field, NULL, &stars, err));
    const rx_status status = rx_psf_make(&par, &image, stars, NULL, dst, &why);
    rx_sources_free(stars);
    if (status != RX_OK && status != RX_INPUT)
        return rx_error_take(err, &why);
    return RX_OK;
}
