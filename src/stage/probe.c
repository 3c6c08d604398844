/* One prepared field through one restorer, in memory. */
#include "stage/probe.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/filter.h"
#include "restore/noise_map.h"
#include "stage/saturated.h"

/* What one call works on. */
typedef struct work {
    const rx_options *options;
    const rx_restorer *kind;
    const rx_field *detect, *measure; /* measure: of the fluxes, the same as detect without dual-image mode */
    int hide;                         /* mask bits that hide a pixel of the detection image */
    rx_detect_params par;             /* of the detection on this image */
    rx_filter filter;                 /* its filter */
    rx_saturated saturated;           /* stars that stay as they were observed */
    rx_log *log;
    rx_probe *probe;
} work;

/* Of that field: without a PSF it stays as it is. */
static const rx_restorer *kind_for(const work *w, const rx_field *field)
{
    const int must = rx_restorer_must_have_psf(w->kind, &w->options->restore);
    return must && field->unrestorable ? rx_restorer_find("NONE") : w->kind;
}

static rx_status restore(const work *w, const rx_field *field, int *plain, rx_domain *domain,
                         rx_restored **dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    const rx_restorer *kind = kind_for(w, field);
    const char *why = kind != w->kind ? "its PSF is not known" : domain->why;
    rx_restore_params par = w->options->restore;
    rx_status status = rx_domain_obey(&par, field, w->log, &kind, domain, err);
    if (status != RX_OK)
        return status;
    if (kind != w->kind && !par.fallback)
        return rx_error_at(err, RX_NOT_RESTORED, tile->name, tile->hdu, 0,
                           "cannot be done by %s: %s; RESTORE_FALLBACK Y lets %s do it", w->kind->name, why,
                           kind->name);
    if (kind != w->kind) {
        rx_log_detail(w->log, "%s[%d]: %s instead of %s: %s", tile->name, tile->hdu, kind->name,
                      w->kind->name, why);
        if (w->probe->by == NULL) {
            w->probe->by = kind->name;
            snprintf(w->probe->why, sizeof w->probe->why, "%s%s",
                     field == w->detect ? "" : "measurement image: ", why);
        }
    }
    *plain = !kind->needs_psf && strcmp(kind->name, "NONE") == 0;
    if (*plain)
        par.mask_saturated = w->options->saturated_in_none;
    return kind->run(&par, tile, *plain ? field->plain : field->restored, field->psf, w->log, dst, err);
}

static double filter_norm(const rx_filter *filter)
{
    return rx_filter_norm(filter->values, filter->width * filter->height);
}

/* factor times the noise that was measured, and with a law times what that says. */
struct rx_probe_noise {
    rx_map_maker maker;
    rx_background *measured;
    rx_map sigma, law; /* law: or none */
    float factor;
};

static void make_noise(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    const rx_probe_noise *own = (const rx_probe_noise *)maker;
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
    const rx_tile *tile = w->detect->tile;
    rx_probe *probe = w->probe;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_background_params par = w->options->background[0];
    rx_status status = RX_OK;
    par.manual = 0;
    rx_probe_noise *noise = probe->own_noise = RX_NEW(rx_probe_noise, 1);
    float *relative = law != NULL ? RX_NEW(float, n) : NULL;
    if (noise == NULL || (law != NULL && relative == NULL)) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    noise->maker.make = make_noise;
    if (law != NULL) {
        noise->law = rx_background_noise(law);
        divide(&noise->law, probe->filtered, tile->height, par.nthreads, relative);
    }
    status =
        rx_background_measure(&par, tile->width, tile->height, law != NULL ? relative : probe->filtered,
                              probe->restored->mask, w->hide, NULL, RX_WEIGHT_NONE, &noise->measured, err);
    if (status != RX_OK)
        goto exit;
    noise->factor = (float)(1.0 / filter_norm(&w->filter));
    noise->sigma = rx_background_noise(noise->measured);
    probe->noise = rx_map_made(&noise->maker, tile->width);
    probe->global_noise =
        noise->measured->global_sigma * noise->factor * (law != NULL ? law->global_sigma : 1.0);
exit:
    free(relative);
    return status;
}

/* Whether thresholds on the restored image refer to the noise of the input. */
static int by_input_noise(const work *w)
{
    const rx_detect_noise wanted = w->options->detect_noise;
    if (w->probe->plain)
        return 0;
    return wanted == RX_DETECT_NOISE_INPUT ||
           (wanted == RX_DETECT_NOISE_AUTO && w->probe->restored->noise != NULL);
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
    if (probe->restored->noise == NULL)
        status = rx_noise_map(w->detect->tile, background, probe->restored->mask, 1, w->par.nthreads,
                              &probe->input_noise, err);
    if (status == RX_OK)
        probe->noise =
            rx_map_made(probe->restored->noise != NULL ? probe->restored->noise : probe->input_noise,
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
    probe->noise =
        restored->noise != NULL ? rx_map_made(restored->noise, tile->width) : rx_background_noise(background);
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
                             .mask = probe->restored->mask,
                             .mask_bits = w->hide,
                             .variable_noise = !probe->plain || tile->weight_type != RX_WEIGHT_NONE,
                             .global_sigma = probe->global_noise,
                             .gain = tile->gain,
                             .noise = probe->noise};
    if (!w->options->keep_filtered && probe->own_filtered != NULL) {
        image.done_with = &probe->own_filtered;
        probe->filtered = NULL;
    }
    return rx_detect_run(&w->par, &image, w->log, &probe->sources, err);
}

/* One pixel of the filtered restored image. src, dst: room for the filter's area each. */
static double filtered_at(const work *w, int x, int y, float *src, float *dst)
{
    const rx_restored *restored = w->probe->restored;
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
    const rx_probe *probe = w->probe;
    const double norm = filter_norm(&w->filter);
    const size_t room = (size_t)w->filter.width * (size_t)w->filter.height;
    float *patch = RX_NEW(float, 2 * room);
    if (patch == NULL)
        return rx_error_memory(err, 2 * room * sizeof *patch);
    for (int i = 0; i < probe->sources->n; i++) {
        rx_source *s = &probe->sources->list[i];
        if ((s->fit.restore & RX_RESTORE_ADDED) == 0)
            continue;
        const double noise = (double)rx_map_at(&probe->noise, s->xpeak, s->ypeak);
        if (noise > 0)
            s->detection_snr =
                fmax(0.0, filtered_at(w, s->xpeak, s->ypeak, patch, patch + room) / (norm * noise));
    }
    free(patch);
    return RX_OK;
}

static rx_status fit_templates(const work *w, rx_error *err)
{
    rx_probe *probe = w->probe;
    if (!w->options->templates.wanted)
        return RX_OK;
    rx_status status = rx_template_fit_run(w->options, w->detect, w->measure, probe->restored, probe->sources,
                                           w->log, &probe->templates, err);
    return status == RX_OK ? rank_added(w, err) : status;
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
        if (restored != NULL)
            rx_saturated_show(&w->saturated, w->measure->tile, w->measure->restored, probe->second);
    }
    probe->original = restored == NULL;
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
        rx_saturated_hide(&w->saturated, probe->restored);
        status = prepare_detection(w, err);
        if (status == RX_OK)
            status = detect_sources(w, err);
        if (status == RX_OK)
            status = rx_saturated_absorb(&w->saturated, probe->sources, err);
        rx_saturated_show(&w->saturated, w->detect->tile, w->detect->restored, probe->restored);
        return status == RX_OK ? rx_saturated_append(&w->saturated, probe->sources, err) : status;
    case TEMPLATES:
        return fit_templates(w, err);
    default:
        status = measure_sources(w, err);
        if (status == RX_OK)
            rx_saturated_restate(&w->saturated, probe->sources);
        return status;
    }
}

/* Where a restorer is at work, what RESTORE_TYPE NONE makes of saturated stars; before it runs, for the planes
 * of both are never needed at once. The two skies of a field are one where nothing is saturated, and where
 * saturated pixels are to be masked for all kinds. */
static rx_status find_saturated(work *w, rx_error *err)
{
    const rx_restorer *none = rx_restorer_find("NONE");
    rx_probe probe = {0};
    work plain = {
        .options = w->options, .kind = none, .detect = w->detect, .measure = w->measure, .probe = &probe};
    if (kind_for(w, w->detect) == none ||
        (w->detect->plain == w->detect->restored && w->measure->plain == w->measure->restored))
        return RX_OK;
    rx_status status = run_step(&plain, RESTORE, err);
    if (status == RX_OK)
        status = run_step(&plain, DETECT, err);
    if (status == RX_OK)
        status = rx_saturated_choose(w->detect->tile, w->measure->tile, probe.sources, &w->saturated, err);
    if (status == RX_OK)
        status = run_step(&plain, MEASURE, err);
    if (status == RX_OK)
        status = rx_saturated_keep(probe.sources, &w->saturated, err);
    rx_filter_free(&plain.filter);
    rx_probe_free(&probe);
    return status;
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
    double seconds[STEPS] = {0};
    const double started = rx_seconds();
    rx_status status = find_saturated(&w, err);
    seconds[DETECT] = rx_seconds() - started;
    for (int step = 0; step < STEPS && status == RX_OK; step++) {
        const double begun = rx_seconds();
        status = run_step(&w, step, err);
        seconds[step] += rx_seconds() - begun;
    }
    for (int i = 0; status == RX_OK && dst->by != NULL && i < dst->sources->n; i++)
        dst->sources->list[i].fit.restore |= RX_RESTORE_OTHER;
    if (status == RX_OK)
        rx_log_detail(log, "%s[%d]: %s: seconds: restore %.4f, detect %.4f, templates %.4f, measure %.4f",
                      detect->tile->name, detect->tile->hdu, kind->name, seconds[RESTORE], seconds[DETECT],
                      seconds[TEMPLATES], seconds[MEASURE]);
    rx_filter_free(&w.filter);
    rx_saturated_free(&w.saturated);
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
    if (probe->own_noise != NULL)
        rx_background_free(probe->own_noise->measured);
    free(probe->own_noise);
    free(probe->input_noise);
    *probe = (rx_probe){0};
}
