/* One prepared field through one restorer, in memory. */
#include "stage/probe.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/filter.h"
#include "restore/noise_map.h"

/* What one call works on. */
typedef struct work {
    const rx_options *options;
    const rx_restorer *kind;
    const rx_field *detect, *measure; /* measure: of the fluxes, the same as detect without dual-image mode */
    int hide;                         /* mask bits that hide a pixel of the detection image */
    rx_detect_params par;             /* of the detection on this image */
    rx_filter filter;                 /* its filter */
    rx_log *log;
    rx_probe *probe;
} work;

static rx_status restore(const work *w, const rx_field *field, int *plain, rx_domain *domain,
                         rx_restored **dst, rx_error *err)
{
    const rx_restorer *kind = w->kind;
    if (rx_restorer_must_have_psf(kind, &w->options->restore) && field->unrestorable)
        kind = rx_restorer_find("NONE");
    rx_status status = rx_domain_obey(&w->options->restore, field, w->log, &kind, domain, err);
    if (status != RX_OK)
        return status;
    *plain = !kind->needs_psf && strcmp(kind->name, "NONE") == 0;
    rx_restore_params par = w->options->restore;
    if (*plain)
        par.mask_saturated = w->options->saturated_in_none;
    return kind->run(&par, field->tile, *plain ? field->plain : field->restored, field->psf, w->log, dst,
                     err);
}

static double filter_norm(const rx_filter *filter)
{
    return rx_filter_norm(filter->values, filter->width * filter->height);
}

/* noise = factor times what was measured, and with a law times what it holds of it. */
static void scale_noise(const rx_background *measured, int law, float factor, float *noise)
{
    const rx_map map = rx_background_noise(measured);
    const int width = measured->width;
    for (int y = 0; y < measured->height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            const int n = rx_map_piece(x, width);
            float room[RX_MAP_PIECE], *dst = noise + (size_t)y * (size_t)width + x;
            const float *sigma = rx_map_row(&map, y, x, n, room);
            for (int i = 0; i < n; i++)
                dst[i] = sigma[i] * (law ? factor * dst[i] : factor);
        }
}

/* A threshold of k sigmas should mean the same on restored pixels as on raw ones, although their noise is
 * correlated and the filter averages less of it away. So the noise is measured after the filter and divided
 * by the factor that the filter would have had on independent pixels. What a weight map says of the noise
 * from pixel to pixel holds within a mesh, too: `law`, the input's noise, NULL without such a map. */
static rx_status equivalent_noise(const work *w, const rx_background *law, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_probe *probe = w->probe;
    rx_background *measured = NULL;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_background_params par = w->options->background[0];
    rx_status status = RX_OK;
    par.manual = 0;
    float *noise = RX_NEW(float, n), *relative = law != NULL ? RX_NEW(float, n) : NULL;
    if (noise == NULL || (law != NULL && relative == NULL)) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    if (law != NULL) {
        const rx_map input = rx_background_noise(law);
        rx_map_fill(&input, tile->height, par.nthreads, noise);
    }
    for (size_t i = 0; i < n && law != NULL; i++)
        relative[i] = noise[i] > 0.0f ? probe->filtered[i] / noise[i] : 0.0f;
    status = rx_background_measure(&par, tile->width, tile->height, law != NULL ? relative : probe->filtered,
                                   probe->restored->mask, w->hide, NULL, RX_WEIGHT_NONE, &measured, err);
    if (status != RX_OK)
        goto exit;
    const float factor = (float)(1.0 / filter_norm(&w->filter));
    scale_noise(measured, law != NULL, factor, noise);
    probe->own_noise = noise;
    noise = NULL;
    probe->noise = rx_map_plane(probe->own_noise, tile->width);
    probe->global_noise = measured->global_sigma * factor * (law != NULL ? law->global_sigma : 1.0);
exit:
    rx_background_free(measured);
    free(relative);
    free(noise);
    return status;
}

/* Whether thresholds on the restored image refer to the noise of the input. */
static int by_input_noise(const work *w)
{
    const rx_detect_noise wanted = w->options->detect_noise;
    if (w->probe->plain)
        return 0;
    return wanted == RX_DETECT_NOISE_INPUT ||
           (wanted == RX_DETECT_NOISE_AUTO && w->probe->restored->sigma != NULL);
}

static void choose_filter(work *w)
{
    w->par = w->options->detect;
    if (w->probe->plain || w->options->filter_restored)
        return;
    w->par.filter = NULL;
    w->par.filter_width = w->par.filter_height = 0;
    w->par.matched = 0;
}

/* The restorer's own map, or the one that it would have brought. */
static rx_status input_noise(work *w, const rx_background *background, rx_error *err)
{
    rx_probe *probe = w->probe;
    rx_status status = RX_OK;
    if (probe->restored->sigma == NULL)
        status = rx_noise_map(w->detect->tile, background, probe->restored->mask, w->options->nthreads,
                              &probe->own_noise, err);
    probe->noise = rx_map_plane(probe->restored->sigma != NULL ? probe->restored->sigma : probe->own_noise,
                                w->detect->tile->width);
    return status;
}

static rx_status prepare_detection(work *w, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    const rx_detect_params *par = &w->par;
    rx_probe *probe = w->probe;
    choose_filter(w);
    const rx_restored *restored = probe->restored;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_status status = rx_filter_new(par->filter, par->filter_width, par->filter_height, &w->filter, err);
    if (status != RX_OK)
        return status;
    probe->filtered = restored->pixels;
    if (w->filter.values != NULL) {
        float *filtered = probe->own_filtered = rx_alloc_filled(n, sizeof *filtered, par->nthreads);
        if (filtered == NULL)
            return rx_error_memory(err, n * sizeof(float));
        rx_filter_plane(&w->filter, restored->pixels, tile->width, tile->height, par->nthreads, filtered);
        probe->filtered = filtered;
    }
    const rx_background *background = probe->plain ? w->detect->plain : w->detect->restored;
    probe->noise = restored->sigma != NULL ? rx_map_plane(restored->sigma, tile->width)
                                           : rx_background_noise(background);
    probe->global_noise = background->global_sigma;
    if (by_input_noise(w))
        return input_noise(w, background, err);
    if (!probe->plain)
        return equivalent_noise(w, tile->weight_type >= RX_WEIGHT_MAP_RMS ? background : NULL, err);
    return RX_OK;
}

static rx_status detect_sources(const work *w, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_probe *probe = w->probe;
    rx_detect_image image = {.width = tile->width,
                             .height = tile->height,
                             .pixels = probe->restored->pixels,
                             .filtered = probe->filtered,
                             .sigma = probe->noise.plane,
                             .mask = probe->restored->mask,
                             .mask_bits = w->hide,
                             .variable_noise = !probe->plain || tile->weight_type != RX_WEIGHT_NONE,
                             .global_sigma = probe->global_noise,
                             .gain = tile->gain,
                             .noise = probe->noise};
    if (!w->options->templates.wanted && !w->options->keep_filtered && probe->own_filtered != NULL) {
        image.done_with = &probe->own_filtered;
        probe->filtered = NULL;
    }
    return rx_detect_run(&w->par, &image, w->log, &probe->sources, err);
}

/* Added sources rank by the same quantity at their peak. */
static void rank_added(const work *w)
{
    const rx_probe *probe = w->probe;
    const double norm = filter_norm(&w->filter);
    for (int i = 0; i < probe->sources->n; i++) {
        rx_source *s = &probe->sources->list[i];
        const size_t p = (size_t)s->ypeak * (size_t)probe->sources->width + (size_t)s->xpeak;
        const double noise = (double)rx_map_at(&probe->noise, s->xpeak, s->ypeak);
        if ((s->fit.restore & RX_RESTORE_ADDED) != 0 && noise > 0)
            s->detection_snr = fmax(0.0, (double)probe->filtered[p] / (norm * noise));
    }
}

static rx_status fit_templates(const work *w, rx_error *err)
{
    rx_probe *probe = w->probe;
    if (!w->options->templates.wanted)
        return RX_OK;
    rx_status status = rx_template_fit_run(w->options, w->detect, w->measure, probe->restored, probe->sources,
                                           w->log, &probe->templates, err);
    if (status == RX_OK)
        rank_added(w);
    return status;
}

/* Fluxes come from the restored image (of the measurement tile in dual-image mode) or from untouched pixels.
 */
static rx_status measure_sources(const work *w, rx_error *err)
{
    rx_probe *probe = w->probe;
    const rx_restored *restored = probe->restored;
    int plain = probe->plain;
    if (w->options->measure_original || plain) {
        restored = NULL;
    } else if (w->measure != w->detect) {
        rx_domain domain; /* each image by itself; the record speaks of the detection image */
        rx_status status = restore(w, w->measure, &plain, &domain, &probe->second, err);
        if (status != RX_OK)
            return status;
        restored = plain ? NULL : probe->second;
    }
    return rx_photometry_run(w->options, w->detect, restored != NULL ? probe->restored : NULL, w->measure,
                             restored, probe->plain && w->measure == w->detect ? probe->restored : NULL,
                             probe->sources, w->log, &probe->photometry, err);
}

/* The steps of a probe, in their order. */
enum { RESTORE, DETECT, TEMPLATES, MEASURE, STEPS };

static rx_status run_step(work *w, int step, rx_error *err)
{
    rx_probe *probe = w->probe;
    rx_status status = RX_OK;
    switch (step) {
    case RESTORE:
        status = restore(w, w->detect, &probe->plain, &probe->domain, &probe->restored, err);
        w->hide = probe->plain && !w->options->saturated_in_none ? RX_HIDE_PLAIN : RX_HIDE_RESTORED;
        return status;
    case DETECT:
        status = prepare_detection(w, err);
        return status == RX_OK ? detect_sources(w, err) : status;
    case TEMPLATES:
        return fit_templates(w, err);
    default:
        return measure_sources(w, err);
    }
}

rx_status rx_probe_run(const rx_options *options, const rx_restorer *kind, const rx_field *detect,
                       const rx_field *measure, rx_log *log, rx_probe *dst, rx_error *err)
{
    work w = {.options = options,
              .kind = kind,
              .detect = detect,
              .measure = measure != NULL ? measure : detect,
              .log = log,
              .probe = dst};
    *dst = (rx_probe){0};
    rx_status status = RX_OK;
    double seconds[STEPS] = {0};
    for (int step = 0; step < STEPS && status == RX_OK; step++) {
        const double begun = rx_seconds();
        status = run_step(&w, step, err);
        seconds[step] = rx_seconds() - begun;
    }
    if (status == RX_OK)
        rx_log_detail(log, "%s[%d]: %s: seconds: restore %.4f, detect %.4f, templates %.4f, measure %.4f",
                      detect->tile->name, detect->tile->hdu, kind->name, seconds[RESTORE], seconds[DETECT],
                      seconds[TEMPLATES], seconds[MEASURE]);
    rx_filter_free(&w.filter);
    if (status != RX_OK)
        rx_probe_free(dst);
    return status;
}

void rx_probe_free(rx_probe *probe)
{
    rx_restored_free(probe->restored);
    rx_restored_free(probe->second);
    rx_sources_free(probe->sources);
    rx_template_fit_free(&probe->templates);
    free(probe->own_filtered);
    free(probe->own_noise);
    *probe = (rx_probe){0};
}
