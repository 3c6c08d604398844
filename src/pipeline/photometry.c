/* Measuring the sources of one restorer. */
#include "pipeline/photometry.h"

#include <stdlib.h>

#include "base/memory.h"
#include "measure/measure.h"

/* Of a larger tile a plane weighs more than the time to make its pixels one by one, where few are wanted. */
static const size_t WHOLE = (size_t)1 << 25;

/* Of the Kron factor, on a network's image, whose galaxies are not as wide as the seeing makes them: with 1 more of their light
 * lies outside the ellipse than on the untouched pixels, with 1.2 no more but at FWHM 8 (AUTO of galaxies in
 * validation/results/fluxes-template). Stars keep the least radius. */
static const double SHARP_KRON = 1.2;

/* One run. */
typedef struct work {
    const rx_pipeline_params *params;
    const rx_photometry_input *in;
    rx_measure_params par;
    rx_image untouched, restored; /* that are measured */
    rx_image radii_image;         /* dual-image mode: that radii come from, */
    const rx_image *radii;        /* else NULL */
    float *planes[2];             /* pixels above the sky that were made here */
    rx_sources *sources;
    rx_log *log;
    rx_photometry *dst;
} work;

/* Flag maps are those of the field that sources were found on. */
static rx_image with_flags(const work *w, rx_image image)
{
    image.nflagmaps = w->in->detect->image.nflagmaps;
    image.flagmaps = w->in->detect->image.flagmaps;
    return image;
}

static rx_image restored_image(const work *w, const rx_field *field, const rx_restored *restored)
{
    const rx_image input = rx_field_restorable(field);
    return with_flags(w, rx_restored_image(restored, &input));
}

/* The plane of pixels above the sky is the caller's, *plane; NULL where that of NONE serves, or that of the tile
 * when `few` pixels of a large one are wanted. */
static rx_status untouched_image(const work *w, const rx_field *field, int few, float **plane, rx_image *dst,
                                 rx_error *err)
{
    const rx_restored *none = field == w->in->field ? w->in->none : NULL;
    *dst = with_flags(w, rx_field_observed(field));
    dst->hide = w->params->saturated_in_none ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    if (none != NULL) {
        dst->pixels = none->pixels;
        dst->mask = none->mask;
        dst->with_sky = 0;
        return RX_OK;
    }
    const size_t n = (size_t)dst->width * (size_t)dst->height;
    if (few && n > WHOLE)
        return RX_OK;
    RX_TRY(RX_MAKE(*plane, n, err));
    rx_image_above_sky(dst, w->params->nthreads, *plane);
    dst->pixels = *plane;
    dst->with_sky = 0;
    return RX_OK;
}

static rx_measure_params params_of(const rx_pipeline_params *params, const rx_photometry_input *in)
{
    rx_measure_params par = params->measure;
    const double scale = in->field->image.pixel_scale;
    par.weight_gain = params->background[0].weight_gain;
    par.flag_types = params->flag_types;
    par.pixel_scale = scale > 0.0 ? scale : 1.0;
    par.seeing_fwhm = params->seeing_arcsec / par.pixel_scale;
    if (in->field != in->detect) { /* detection's threshold is that of another image */
        par.analysis_threshold = params->detect.analysis_threshold;
        par.analysis_absolute = params->detect.analysis_absolute;
    }
    return par;
}

/* *area = pixels that a matched filter collects a star's light from, 1 / sum PSF^2, in the middle of the
 * image. */
static rx_status collecting_area(const rx_psf *psf, const rx_image *image, double *area, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    float *stamp = RX_NEW(float, n);
    double power = 0;
    if (stamp == NULL)
        return rx_error_memory(err, n * sizeof *stamp);
    rx_psf_at(psf, 0.5 * (image->width - 1), 0.5 * (image->height - 1), stamp);
    for (size_t i = 0; i < n; i++)
        power += (double)stamp[i] * stamp[i];
    free(stamp);
    *area = power > 0 ? 1 / power : 0;
    return RX_OK;
}

enum { EMPTY_APERTURES = 300 }; /* per radius, for the noise law */

/* A network's image, which leaves no noise on empty sky and brings a map of it. */
static int by_network(const rx_restored *restored)
{
    return restored != NULL && rx_map_given(&restored->noise);
}

/* The noise law of what is measured, from empty apertures or, without them, from the correlation of the noise of
 * the untouched pixels. Of restored ones that is not the noise, but for a network's: the fluxes that it gives to sources
 * have all the noise of the input. The law is that of the untouched pixels then, of apertures wider by
 * what the tile's PSF spreads. */
static rx_status calibrate(work *w, const rx_image *image, int apertures, rx_error *err)
{
    const rx_restored *restored = w->in->restored;
    const int hides = by_network(restored);
    rx_noise_law *law = &w->dst->law;
    double area = 0;
    if (apertures)
        RX_TRY(rx_noise_law_fit(hides ? &w->untouched : image, w->sources,
                                &(rx_noise_apertures){EMPTY_APERTURES, w->params->seed, w->params->nthreads},
                                law, w->log, err));
    if (law->nradii == 0 && (hides || restored == NULL))
        *law = rx_noise_law_of(image->correlation);
    if (hides && restored->blur != NULL)
        RX_TRY(collecting_area(restored->blur, image, &area, err));
    if (restored != NULL)
        rx_noise_law_widen(law, area);
    return RX_OK;
}

static rx_status measure_sources(work *w, rx_image *image, int calibrated, rx_error *err)
{
    rx_sources *sources = w->sources;
    /* THRESH_TYPE RELATIVE of untouched images is SExtractor's way, which knows independent pixels */
    const int known = w->in->restored == NULL && w->params->significance && w->params->calibrate_restored;
    if (calibrated || known)
        RX_TRY(calibrate(w, image, calibrated, err));
    image->law = &w->dst->law;
    sources->law_apertures = w->dst->law.apertures;
    sources->law_scatter = w->dst->law.scatter;
    const rx_status status = rx_measure_run(&w->par, image, w->radii, w->log, sources, err);
    for (int i = 0; i < sources->n && calibrated && w->dst->law.nradii == 0; i++)
        sources->list[i].flags_measure |= RX_FLAGM_UNCALIBRATED;
    return status;
}

rx_status rx_photometry_run(const rx_pipeline_params *params, const rx_photometry_input *in,
                            rx_sources *sources, rx_log *log, rx_photometry *dst, rx_error *err)
{
    work w = {
        .params = params, .in = in, .par = params_of(params, in), .sources = sources, .log = log, .dst = dst};
    rx_status status = RX_OK;
    *dst = (rx_photometry){.law = {.scale = 1.0, .power = 0.5}};
    /* beside a restored image only for checks and empty apertures */
    RX_TRY_EXIT(untouched_image(&w, in->field, in->restored != NULL, &w.planes[0], &w.untouched, err));
    if (in->field != in->detect) {
        w.radii = &w.radii_image;
        if (in->detected != NULL)
            w.radii_image = restored_image(&w, in->detect, in->detected);
        else
            RX_TRY_EXIT(untouched_image(&w, in->detect, 0, &w.planes[1], &w.radii_image, err));
    }
    if (by_network(w.radii != NULL ? in->detected : in->restored))
        w.par.auto_factor *= SHARP_KRON;
    if (in->restored == NULL) {
        status = measure_sources(&w, &w.untouched, params->calibrate_none, err);
        goto exit;
    }
    w.restored = restored_image(&w, in->field, in->restored);
    RX_TRY_EXIT(measure_sources(&w, &w.restored, params->calibrate_restored, err));
    w.untouched.psf = in->restored->blur;
    if (w.untouched.psf != NULL)
        status = rx_fluxcheck_run(&w.par, &w.restored, &w.untouched, sources, log, &dst->check, err);
exit:
    free(w.planes[0]);
    free(w.planes[1]);
    return status;
}
