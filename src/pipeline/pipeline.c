/* The pipeline in memory. */
#include "pipeline/pipeline.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "data/gaps.h"
#include "detect/filter.h"
#include "fit/hits.h"
#include "fit/lines.h"
#include "pipeline/proposals.h"
#include "pipeline/saturated.h"
#include "restore/noise_map.h"

int rx_pipeline_psf(const rx_pipeline_params *params, const rx_restorer *kind)
{
    return (kind->traits & RX_TRAIT_PSF) != 0 || params->templates.wanted ? RX_FIELD_PSF
           : params->detect.filter_auto                                   ? RX_FIELD_FILTER
                                                                          : 0;
}

/* What one call works on. */
typedef struct work {
    const rx_pipeline_params *params;
    const rx_restorer *kind;
    const rx_field *detect, *measure; /* measure: of the fluxes, the same as detect without dual-image mode */
    int hide;                         /* mask bits that hide a pixel of the detection image */
    rx_detect_params par;             /* of the detection on this image */
    rx_filter filter;                 /* its filter */
    float *kernel;                    /* of the filter, where it follows the PSF; or NULL */
    rx_saturated saturated;           /* stars that stay as they were observed */
    rx_log *log;
    rx_result *result;
} work;

/* Of that field: without a PSF it stays as it is. */
static const rx_restorer *kind_for(const work *w, const rx_field *field)
{
    const int must = rx_restorer_must_have_psf(w->kind, &w->params->restore);
    return must && field->unrestorable ? rx_restorer_find("NONE") : w->kind;
}

static rx_status restore(const work *w, const rx_field *field, int *plain, rx_domain *domain,
                         rx_restored **dst, rx_error *err)
{
    const rx_image *input = &field->image;
    const rx_restorer *kind = kind_for(w, field);
    const char *why = kind != w->kind ? "its PSF is not known" : domain->why;
    rx_restore_params par = w->params->restore;
    rx_image image =
        (kind->traits & RX_TRAIT_WHITE) != 0 ? rx_field_effective(field) : rx_field_restorable(field);
    RX_TRY(rx_domain_obey(&par, field, w->log, &kind, domain, err));
    if (kind != w->kind && !par.fallback)
        return rx_error_at(err, RX_NOT_RESTORED, input->name, input->hdu, 0,
                           "cannot be done by %s: %s; RESTORE_FALLBACK Y lets %s do it", w->kind->name, why,
                           kind->name);
    if (kind != w->kind) {
        rx_log_detail(w->log, "%s[%d]: %s instead of %s: %s", input->name, input->hdu, kind->name,
                      w->kind->name, why);
        if (w->result->by == NULL) {
            w->result->by = kind->name;
            snprintf(w->result->why, sizeof w->result->why, "%s%s",
                     field == w->detect ? "" : "measurement image: ", why);
        }
    }
    *plain = (kind->traits & RX_TRAIT_PLAIN) != 0;
    par.keep_reblurred |= w->params->examine_residual && !w->params->templates.wanted && field == w->detect &&
                          (kind->traits & RX_TRAIT_INVENTS) != 0;
    if (kind != w->kind)
        image = rx_field_restorable(field);
    if (*plain)
        image = rx_field_observed(field);
    else if (!par.mask_saturated)
        image.hide &= ~RX_MASK_SATURATED;
    const rx_status status = kind->run(&par, &image, w->log, dst, err);
    if (status == RX_INPUT || status == RX_SYSTEM)
        rx_error_where(err, status, image.name, image.hdu, 0); /* of many tiles which one */
    return status;
}

/* Of the detection image. */
static int hidden_bits(const rx_pipeline_params *params, int plain)
{
    return plain && !params->saturated_in_none ? RX_HIDE_PLAIN : RX_HIDE_RESTORED;
}

static rx_status restore_image(work *w, rx_error *err)
{
    rx_result *result = w->result;
    RX_TRY(restore(w, w->detect, &result->plain, &result->domain, &result->restored, err));
    w->hide = hidden_bits(w->params, result->plain);
    return RX_OK;
}

static double filter_norm(const rx_filter *filter)
{
    return rx_filter_norm(filter->values, filter->width * filter->height);
}

/* factor times the noise that was measured, and with a law times what that says. */
struct rx_result_noise {
    rx_map_maker maker;
    rx_background *measured;
    rx_map sigma, law; /* law: or none */
    rx_gaps_map in_gaps;
    float factor;
};

static void make_noise(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    const rx_result_noise *own = (const rx_result_noise *)maker;
    const float factor = own->factor;
    for (int row = 0; row < rows; row++, dst += n)
        for (int from = 0; from < n; from += RX_MAP_PIECE) {
            const int count = rx_map_piece(from, n);
            float room[RX_MAP_PIECE], law_room[RX_MAP_PIECE];
            const float *sigma = rx_map_row(&own->sigma, y + row, x + from, count, room), *law = NULL;
            if (rx_map_given(&own->law))
                law = rx_map_row(&own->law, y + row, x + from, count, law_room);
            for (int i = 0; i < count; i++)
                dst[from + i] = sigma[i] * (law != NULL ? factor * law[i] : factor);
        }
}

/* dst = the filtered image over what the law says of its noise. */
static void divide(const rx_map *law, const float *filtered, int height, int nthreads, float *dst)
{
    const int width = law->width;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            float room[RX_MAP_PIECE];
            const int n = rx_map_piece(x, width);
            const float *noise = rx_map_row(law, y, x, n, room);
            const size_t k = (size_t)y * (size_t)width + (size_t)x;
            for (int i = 0; i < n; i++)
                dst[k + (size_t)i] = noise[i] > 0.0f ? filtered[k + (size_t)i] / noise[i] : 0.0f;
        }
}

/* A threshold of k sigmas should mean the same on restored pixels as on raw ones, although their noise is
 * correlated and the filter averages less of it away. So the noise is measured after the filter and divided
 * by the factor that the filter would have had on independent pixels. What a weight map says of the noise
 * from pixel to pixel holds within a mesh, too: `law`, the input's noise, NULL without such a map. */
static rx_status equivalent_noise(const work *w, const rx_background *law, rx_error *err)
{
    const rx_image *input = &w->detect->image;
    rx_result *result = w->result;
    const size_t n = (size_t)input->width * (size_t)input->height;
    rx_background_params par = w->params->background[0];
    rx_status status = RX_OK;
    par.manual = 0;
    par.passes = 1;
    rx_result_noise *noise = result->own_noise = RX_NEW(rx_result_noise, 1);
    float *relative = law != NULL ? RX_NEW(float, n) : NULL;
    if (noise == NULL || (law != NULL && relative == NULL))
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(float)));
    noise->maker.make = make_noise;
    if (law != NULL) {
        noise->law = rx_gaps_filled(&noise->in_gaps, rx_background_noise(law), result->restored->gaps);
        divide(&noise->law, result->filtered, input->height, par.nthreads, relative);
    }
    const rx_image image = {.width = input->width,
                            .height = input->height,
                            .pixels = law != NULL ? relative : result->filtered,
                            .mask = result->restored->mask,
                            .hide = w->hide};
    RX_TRY_EXIT(rx_background_measure(&par, &image, &noise->measured, err));
    noise->factor = (float)(1.0 / filter_norm(&w->filter));
    noise->sigma = rx_background_noise(noise->measured);
    result->noise = rx_map_made(&noise->maker, input->width);
    result->global_noise =
        noise->measured->global_sigma * noise->factor * (law != NULL ? law->global_sigma : 1.0);
exit:
    free(relative);
    return status;
}

/* Whether thresholds on the restored image refer to the noise of the input. */
static int by_input_noise(const work *w)
{
    const rx_detect_noise wanted = w->params->detect_noise;
    if (w->result->plain)
        return 0;
    return wanted == RX_DETECT_NOISE_INPUT ||
           (wanted == RX_DETECT_NOISE_AUTO && rx_map_given(&w->result->restored->noise));
}

/* The restorer's own map, or the one that it would have brought. */
static rx_status input_noise(work *w, rx_error *err)
{
    rx_result *result = w->result;
    if (rx_map_given(&result->restored->noise))
        return RX_OK;
    const rx_image image = rx_field_effective(w->detect);
    rx_status status =
        rx_noise_map(&image, result->restored->mask, 1, w->par.nthreads, &result->input_noise, err);
    if (status == RX_OK)
        result->noise = rx_map_made(result->input_noise, image.width);
    return status;
}

/* The detection image after its filter, and the noise that thresholds on it refer to. */
static rx_status prepare_detection(work *w, rx_error *err)
{
    const rx_image *input = &w->detect->image;
    const rx_detect_params *par = &w->par;
    rx_result *result = w->result;
    const rx_restored *restored = result->restored;
    const size_t n = (size_t)input->width * (size_t)input->height;
    w->par = w->params->detect;
    if (w->params->detect.filter_auto)
        RX_TRY(rx_proposals_params(w->detect, result->plain, &w->par, &w->kernel, err));
    if (w->params->detect.filter_auto && w->detect->psf == NULL)
        rx_log_detail(
            w->log,
            "%s[%d]: no PSF is known: detected behind FILTER_NAME at %g sigmas of a pixel (FILTER_TYPE CONV)",
            input->name, input->hdu, w->par.threshold);
    RX_TRY(rx_filter_new(par->filter, par->filter_width, par->filter_height, &w->filter, err));
    result->filtered = restored->pixels;
    result->filtered_scale = par->filter_normalise ? 1.0f : (float)w->filter.sum; /* 1 without a filter */
    if (w->filter.values != NULL) {
        float *filtered = result->own_filtered = rx_alloc_filled(n, sizeof *filtered, par->nthreads);
        if (filtered == NULL)
            return rx_error_memory(err, n * sizeof(float));
        rx_filter_plane(&w->filter, restored->pixels, input->width, input->height, par->nthreads, filtered);
        result->filtered = filtered;
    }
    const rx_background *background = result->plain ? w->detect->plain : w->detect->restored;
    result->global_noise = background->global_sigma;
    if (!result->plain && !by_input_noise(w))
        return equivalent_noise(w, input->weight_type >= RX_WEIGHT_MAP_RMS ? background : NULL, err);
    RX_TRY(RX_MAKE(result->in_gaps, 1, err));
    result->noise = rx_map_given(&restored->noise) ? restored->noise : rx_background_noise(background);
    if (by_input_noise(w))
        RX_TRY(input_noise(w, err));
    result->noise = rx_gaps_filled(result->in_gaps, result->noise, restored->gaps);
    if (!result->plain || !w->params->significance)
        return RX_OK;
    /* as many sigmas of the filtered image as they would be of independent pixels */
    static const float one = 1.0f;
    const double factor = w->filter.values != NULL ? rx_noise_factor(&w->detect->noise, w->filter.values,
                                                                     w->filter.width, w->filter.height)
                                                   : rx_noise_factor(&w->detect->noise, &one, 1, 1);
    RX_TRY(RX_MAKE(result->significant, 1, err));
    result->noise = rx_map_scaled(result->significant, result->noise, (float)factor);
    result->global_noise *= factor;
    return RX_OK;
}

/* What sources are detected on. */
static rx_image detection_image(const rx_result *result, int hide)
{
    const rx_image observed = rx_field_observed(result->detect);
    rx_image image = rx_restored_image(result->restored, &observed);
    image.hide = hide;
    image.noise = result->noise;
    image.variable_noise = !result->plain || image.weight_type != RX_WEIGHT_NONE;
    image.global_noise = result->global_noise;
    return image;
}

/* What a restorer makes of noise in a gap is no light: as the sky where it is below the threshold of its own noise. */
static void clear_gaps(const work *w, float *filtered)
{
    const rx_result *result = w->result;
    const rx_gaps *gaps = result->restored->gaps;
    const double norm = w->par.filter_normalise || w->filter.values == NULL ? 1.0 : w->filter.sum;
    for (size_t i = 0; gaps != NULL && i < gaps->n; i++) {
        const rx_gap *gap = &gaps->list[i];
        const double noise =
            w->par.absolute ? 1.0
                            : (double)rx_map_at(&result->noise, gap->at % gaps->width, gap->at / gaps->width);
        if ((double)filtered[gap->at] < w->par.threshold / norm * noise * rx_gap_noise(gaps, gap))
            filtered[gap->at] = 0.0f;
    }
}

static rx_status detect(work *w, rx_error *err)
{
    rx_result *result = w->result;
    RX_TRY(prepare_detection(w, err));
    if (!result->plain)
        clear_gaps(w, result->own_filtered != NULL ? result->own_filtered : result->restored->pixels);
    const rx_image image = detection_image(result, w->hide);
    rx_filtered filtered = {.pixels = result->filtered};
    if (!w->params->keep_filtered && result->own_filtered != NULL) {
        filtered.spare = &result->own_filtered;
        result->filtered = NULL;
    }
    return rx_detect_run(&w->par, &image, &filtered, w->log, &result->sources, err);
}

/* What a gap or saturated pixels cut is one source: RESTORE_TYPE NONE detects on an image without these holes, and
 * measures good pixels only. */
static rx_status detect_plain(work *w, rx_error *err)
{
    rx_restored *restored = w->result->restored;
    rx_gaps_fill(restored->gaps, restored->pixels);
    rx_gaps_mark(restored->gaps, 0, restored->mask);
    const rx_status status = detect(w, err);
    rx_gaps_close(restored->gaps, restored->mask);
    for (size_t i = 0; restored->gaps != NULL && i < restored->gaps->n; i++)
        restored->pixels[restored->gaps->list[i].at] = 0.0f;
    return status;
}

/* Bits of saturated pixels that stay masked where a saturated star is shown: MASK_SATURATED Y. */
static int masked_for_all(const work *w)
{
    return w->params->saturated_in_none ? RX_MASK_SATURATED : 0;
}

/* Saturated stars are hidden from the detection on a restored image, and join its list as they were observed. */
static rx_status find_sources(work *w, rx_error *err)
{
    rx_result *result = w->result;
    if (result->plain)
        return detect_plain(w, err);
    rx_saturated_hide(&w->saturated, result->restored);
    RX_TRY(detect(w, err));
    RX_TRY(rx_saturated_absorb(&w->saturated, result->sources, err));
    rx_saturated_show(&w->saturated, &w->detect->image, w->detect->restored, masked_for_all(w),
                      result->restored);
    return rx_saturated_append(&w->saturated, result->sources, err);
}

static rx_status detect_sources(work *w, rx_error *err)
{
    RX_TRY(find_sources(w, err));
    return rx_proposals_wanted(w->params, w->detect)
               ? rx_proposals_decide(w->params, w->detect, w->result->sources, w->log, err)
               : RX_OK;
}

/* One pixel of the filtered restored image. src, dst: room for the filter's area each. */
static double filtered_at(const work *w, int x, int y, float *src, float *dst)
{
    const rx_restored *restored = w->result->restored;
    const rx_filter *filter = &w->filter;
    const int x0 = x - filter->width / 2, y0 = y - filter->height / 2;
    if (filter->values == NULL)
        return restored->pixels[(size_t)y * (size_t)restored->width + (size_t)x];
    for (int k = 0; k < filter->width * filter->height; k++) {
        const int u = x0 + k % filter->width, v = y0 + k / filter->width;
        const int inside = u >= 0 && u < restored->width && v >= 0 && v < restored->height;
        src[k] = inside ? restored->pixels[(size_t)v * (size_t)restored->width + (size_t)u] : 0.0f;
    }
    rx_filter_plane(filter, src, filter->width, filter->height, 1, dst);
    return dst[(filter->height / 2) * filter->width + filter->width / 2];
}

/* Added sources rank by the same quantity at their peak. */
static rx_status rank_added(const work *w, rx_error *err)
{
    const rx_result *result = w->result;
    const double norm = filter_norm(&w->filter);
    const size_t room = (size_t)w->filter.width * (size_t)w->filter.height;
    float *patch;
    RX_TRY(RX_MAKE(patch, 2 * room, err));
    for (int i = 0; i < result->sources->n; i++) {
        rx_source *s = &result->sources->list[i];
        if ((s->fit.restore & RX_RESTORE_ADDED) == 0)
            continue;
        const double noise = (double)rx_map_at(&result->noise, s->xpeak, s->ypeak);
        if (noise > 0)
            s->detection_snr =
                fmax(0.0, filtered_at(w, s->xpeak, s->ypeak, patch, patch + room) / (norm * noise));
    }
    free(patch);
    return RX_OK;
}

static rx_status fit_templates(work *w, rx_error *err)
{
    rx_result *result = w->result;
    rx_pipeline_params par = *w->params;
    const rx_image observed = rx_field_restorable(w->detect);
    if (!par.templates.wanted) {
        RX_TRY(rx_hits_mark(&observed, par.nthreads, 0, result->sources, err));
        return rx_lines_mark(&observed, par.nthreads, result->sources, err);
    }
    par.templates.par.keep_model |= par.examine_residual;
    RX_TRY(rx_template_fit_run(&par, (rx_fields){w->detect, w->measure}, result->restored, result->sources,
                               w->log, &result->templates, err));
    return rank_added(w, err);
}

/* Fluxes come from the restored image (of the measurement tile in dual-image mode) or from untouched pixels.
 */
static rx_status measure_sources(work *w, rx_error *err)
{
    rx_result *result = w->result;
    const rx_restored *restored = result->restored;
    int plain = result->plain;
    if (w->params->measure_original || plain) {
        restored = NULL;
    } else if (w->measure != w->detect) {
        rx_domain domain; /* each image by itself; the record speaks of the detection image */
        RX_TRY(restore(w, w->measure, &plain, &domain, &result->second, err));
        restored = plain ? NULL : result->second;
        if (restored != NULL)
            rx_saturated_show(&w->saturated, &w->measure->image, w->measure->restored, masked_for_all(w),
                              result->second);
    }
    result->original = restored == NULL;
    const rx_photometry_input input = {.detect = w->detect,
                                       .detected = restored != NULL ? result->restored : NULL,
                                       .field = w->measure,
                                       .restored = restored,
                                       .none = result->plain && w->measure == w->detect ? result->restored
                                                                                        : NULL};
    RX_TRY(rx_photometry_run(w->params, &input, result->sources, w->log, &result->photometry, err));
    rx_saturated_restate(&w->saturated, result->sources);
    return RX_OK;
}

/* The steps, in their order; `share`: where each ends, of the time that all take, for a progress bar. */
enum { RESTORE, DETECT, TEMPLATES, MEASURE, STEPS };
static const struct {
    rx_status (*run)(work *w, rx_error *err);
    const char *name;
    double share;
} steps[STEPS] = {[RESTORE] = {restore_image, "restoration", 0.6},
                  [DETECT] = {detect_sources, "detection", 0.7},
                  [TEMPLATES] = {fit_templates, "templates", 0.8},
                  [MEASURE] = {measure_sources, "measurement", 1.0}};

static int same_skies(const rx_field *field)
{
    return field->plain == field->restored && field->cores == 0;
}

/* Where a restorer is at work, what RESTORE_TYPE NONE makes of saturated stars and masked cores; before it runs, for the planes
 * of both are never needed at once. The two skies of a field are one where nothing is saturated, and where
 * saturated pixels are to be masked for all kinds. */
static rx_status find_saturated(work *w, rx_error *err)
{
    const rx_restorer *none = rx_restorer_find("NONE");
    rx_result result = {.detect = w->detect, .measure = w->measure};
    work plain = {
        .params = w->params, .kind = none, .detect = w->detect, .measure = w->measure, .result = &result};
    if (kind_for(w, w->detect) == none ||
        (!w->params->saturated_in_none && same_skies(w->detect) && same_skies(w->measure)))
        return RX_OK;
    rx_status status = RX_OK;
    RX_TRY_EXIT(restore_image(&plain, err));
    RX_TRY_EXIT(find_sources(&plain, err));
    RX_TRY_EXIT(
        rx_saturated_choose(&w->detect->image, &w->measure->image, result.sources, &w->saturated, err));
    RX_TRY_EXIT(measure_sources(&plain, err));
    status = rx_saturated_keep(result.sources, &w->saturated, err);
exit:
    rx_filter_free(&plain.filter);
    free(plain.kernel);
    rx_result_free(&result);
    return status;
}

static rx_status same_grid(const rx_image *detect, const rx_image *measure, rx_error *err)
{
    if (measure->width == detect->width && measure->height == detect->height)
        return RX_OK;
    return rx_error_at(err, RX_INPUT, measure->name, measure->hdu, 0,
                       "has %d x %d pixels, the detection image %d x %d; dual-image mode needs the same grid",
                       measure->width, measure->height, detect->width, detect->height);
}

/* Where the model is wrong: that of the templates, else that of an image which may be invented, else the sky between the
 * sources. What was kept for it alone is freed. */
static rx_status find_misfits(const work *w, rx_error *err)
{
    rx_result *result = w->result;
    rx_restored *restored = result->restored;
    rx_tphot *tphot = result->templates.tphot;
    if (!w->params->examine_residual)
        return RX_OK;
    const bool invents = (rx_restorer_find(restored->name)->traits & RX_TRAIT_INVENTS) != 0,
               fitted = tphot != NULL && tphot->residual != NULL,
               imaged = !fitted && invents && restored->reblurred != NULL;
    const rx_field *field = imaged ? w->detect : w->measure;
    const rx_image image = rx_field_restorable(field);
    const rx_psf *psf = restored->blur != NULL ? restored->blur : field->psf;
    RX_TRY(rx_residual_measure(
        &(rx_residual_input){.image = &image,
                             .residual = fitted ? tphot->residual : NULL,
                             .light = fitted   ? tphot->model
                                      : imaged ? restored->reblurred
                                               : NULL,
                             .sources = result->sources,
                             .fwhm = psf != NULL ? psf->fwhm : 0.0,
                             .psf_error = fitted && psf != NULL ? rx_psf_flux_error_mean(psf) : 0.0,
                             .nthreads = w->params->nthreads},
        &result->residual, err));
    if (!invents)
        result->residual.dark = NAN;
    if (fitted && !w->params->templates.par.keep_model) {
        free(tphot->model);
        free(tphot->residual);
        tphot->model = tphot->residual = NULL;
    }
    if (imaged && !w->params->restore.keep_reblurred) {
        free(restored->reblurred);
        restored->reblurred = NULL;
    }
    return RX_OK;
}

/* What FLAGS_RESTORE says of the image that each source is on, and of the place. */
static void mark_sources(const work *w)
{
    rx_result *result = w->result;
    const rx_domain *domain = &result->domain;
    const rx_image image = rx_field_effective(w->detect);
    const rx_map sky = rx_image_sky(&image);
    const int net = (rx_restorer_find(result->restored->name)->traits & RX_TRAIT_TRAINED) != 0,
              outside = net && domain->place == RX_DOMAIN_OUTSIDE,
              all = (result->by != NULL ? RX_RESTORE_OTHER : 0) | (outside ? RX_RESTORE_OUTSIDE : 0) |
                    (rx_noise_is_structure(&w->detect->noise) ? RX_RESTORE_STRUCTURE : 0);
    const double brightest = net ? rx_model_peak(domain->model) : HUGE_VAL;
    const int know_dark = net && domain->model->dark > 0.0;
    for (int i = 0; i < result->sources->n; i++) {
        rx_source *s = &result->sources->list[i];
        s->fit.restore |= all | (rx_residual_at(&result->residual, s->x, s->y) ? RX_RESTORE_UNEXPLAINED : 0);
        result->sharp += (s->fit.restore & RX_RESTORE_SHARP) != 0;
        if (!net || s->untouched)
            continue;
        const size_t at = (size_t)s->ypeak * (size_t)image.width + (size_t)s->xpeak;
        const double peak = (image.pixels[at] - (double)rx_map_at(&sky, s->xpeak, s->ypeak)) /
                            (double)rx_map_at(&image.noise, s->xpeak, s->ypeak);
        if (peak > brightest || (!know_dark && rx_residual_dark_at(&result->residual, s->x, s->y)))
            s->fit.restore |= RX_RESTORE_OUTSIDE;
        result->outside += (s->fit.restore & RX_RESTORE_OUTSIDE) != 0;
    }
}

double rx_result_sharp(const rx_result *result)
{
    return result->sharp > 0 ? (double)result->sharp / (double)result->sources->n : 0.0;
}

bool rx_result_is_dark(const rx_result *result)
{
    return rx_residual_is_dark(result->residual.dark) && result->by == NULL &&
           !(result->domain.model->dark > 0.0);
}

rx_status rx_field_extract(const rx_pipeline_params *params, const rx_restorer *kind, const rx_field *detect,
                           const rx_field *measure, rx_log *log, rx_result *dst, rx_error *err)
{
    work w = {.params = params,
              .kind = kind,
              .detect = detect,
              .measure = measure != NULL ? measure : detect,
              .log = log,
              .result = dst};
    *dst = (rx_result){
        .kind = kind, .detect = detect, .measure = w.measure, .residual = {.share = NAN, .dark = NAN}};
    RX_TRY(same_grid(&detect->image, &w.measure->image, err));
    rx_lap laps[STEPS] = {{0}}, last = rx_lap_now();
    rx_status status = find_saturated(&w, err);
    rx_lap_add(&last, &laps[DETECT]);
    for (int step = 0; step < STEPS && status == RX_OK; step++) {
        rx_log_part(log, steps[step].name, step > 0 ? steps[step - 1].share : 0.1, steps[step].share);
        if ((status = rx_interrupt_check(err)) == RX_OK)
            status = steps[step].run(&w, err);
        rx_lap_add(&last, &laps[step]);
    }
    if (status == RX_OK && (status = find_misfits(&w, err)) == RX_OK)
        mark_sources(&w);
    rx_lap_add(&last, &laps[MEASURE]);
    if (status == RX_OK) {
        rx_log_detail(log, "%s[%d]: %s: seconds: restore %.4f, detect %.4f, templates %.4f, measure %.4f",
                      detect->image.name, detect->image.hdu, kind->name, laps[RESTORE].wall,
                      laps[DETECT].wall, laps[TEMPLATES].wall, laps[MEASURE].wall);
        rx_log_detail(log, "%s[%d]: %s: CPU seconds: restore %.4f, detect %.4f, templates %.4f, measure %.4f",
                      detect->image.name, detect->image.hdu, kind->name, laps[RESTORE].cpu, laps[DETECT].cpu,
                      laps[TEMPLATES].cpu, laps[MEASURE].cpu);
    }
    rx_filter_free(&w.filter);
    free(w.kernel);
    rx_saturated_free(&w.saturated);
    if (status != RX_OK)
        rx_result_free(dst);
    return status;
}

rx_status rx_result_count(const rx_pipeline_params *params, const rx_result *result, double factor, long *n,
                          rx_error *err)
{
    rx_detect_params par = params->detect;
    const rx_image image = detection_image(result, hidden_bits(params, result->plain));
    const rx_filtered filtered = {.pixels = result->filtered};
    rx_sources *sources = NULL;
    par.threshold *= factor;
    RX_TRY(rx_detect_run(&par, &image, &filtered, NULL, &sources, err));
    *n = sources->n;
    rx_sources_free(sources);
    return RX_OK;
}

void rx_result_free(rx_result *result)
{
    rx_restored_free(result->restored);
    rx_restored_free(result->second);
    rx_sources_free(result->sources);
    rx_template_fit_free(&result->templates);
    rx_residual_free(&result->residual);
    free(result->own_filtered);
    if (result->own_noise != NULL)
        rx_background_free(result->own_noise->measured);
    free(result->own_noise);
    free(result->input_noise);
    free(result->significant);
    free(result->in_gaps);
    rx_field_free(result->own);
    *result = (rx_result){0};
}
