/* Sources that only show in what the templates leave. */
#include "stage/template_extra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/filter.h"
#include "template/leftover.h"

/* Of the light that the models have around a pixel, so much counts as noise: profiles and PSFs miss by a few
 * per cent, and so do positions; of a bright source that is many sigmas, all over its face and round it. */
static const double MODEL_ERROR = 0.1;
static const double NEAR = 1.0;   /* around: units of the PSF's FWHM */
static const double HIDDEN = 1.0; /* light of models, in sigmas of a pixel, that hides a source */
static const double REACH = 1.5;  /* of the filter, units of the PSF's FWHM */
/* What is so near the border, in FWHM, may be the wing of something beyond it, which no template inside
 * explains. */
static const double BORDER = 0.5;
static const double APART = 0.4; /* FWHM between a source and one that is added, at least */

/* The PSF in the middle of the tile, cut to its core and lowered to a sum of 0 (Stetson 1987, PASP 99, 191),
 * so that light without structure, the halo of a bright star beyond what its PSF holds, is no peak.
 * [*side][*side], the caller's. */
static float *matched_filter(const rx_psf *psf, int width, int height, int *side)
{
    const int whole = psf->size, half = (int)fmin(ceil(REACH * fmax(psf->fwhm, 1.0)) + 1, whole / 2);
    float *stamp = RX_NEW(float, (size_t)whole *(size_t)whole);
    if (stamp == NULL)
        return NULL;
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), stamp);
    *side = 2 * half + 1;
    for (int y = 0; y < *side; y++)
        memmove(stamp + (size_t)y * (size_t)*side,
                stamp + (size_t)(whole / 2 - half + y) * (size_t)whole + (size_t)(whole / 2 - half),
                (size_t)*side * sizeof *stamp);
    const size_t n = (size_t)*side * (size_t)*side;
    double mean = 0;
    for (size_t i = 0; i < n; i++)
        mean += (double)stamp[i] / (double)n;
    for (size_t i = 0; i < n; i++)
        stamp[i] -= (float)mean;
    return stamp;
}

/* What stands alone was there to be seen on the restored image: whether it is a source is for the detection
 * threshold to say. */
static int hidden(const rx_source *s, const rx_leftover *leftover)
{
    const rx_tphot_state *state = leftover->state;
    const size_t peak = (size_t)s->ypeak * (size_t)state->width + (size_t)s->xpeak;
    return rx_leftover_light(leftover, s->xpeak, s->ypeak) > HIDDEN / sqrt(state->weight[peak]);
}

/* Too near a source to be told apart from it: what a template leaves there is its own error, that of a cosmic
 * ray for instance, which is no point. */
static int on_a_source(const rx_source *s, const rx_sources *sources, double fwhm)
{
    const double apart = APART * fwhm;
    for (int i = 0; i < sources->n; i++) {
        const rx_source *other = &sources->list[i];
        if (fabs(s->y - other->y) < apart && hypot(s->x - other->x, s->y - other->y) < apart)
            return 1;
    }
    return 0;
}

static rx_status choose(const rx_template_extra *extra, const rx_leftover *leftover, rx_error *err)
{
    rx_sources *found = extra->found;
    const double fwhm = extra->psf->fwhm, margin = BORDER * fwhm;
    unsigned char *keep = RX_NEW(unsigned char, (size_t)found->n);
    if (keep == NULL)
        return rx_error_memory(err, (size_t)found->n);
#pragma omp parallel for schedule(dynamic, 64) num_threads(extra->nthreads)
    for (int i = 0; i < found->n; i++) {
        const rx_source *s = &found->list[i];
        keep[i] = s->x >= margin && s->y >= margin && s->x <= found->width - 1 - margin &&
                  s->y <= found->height - 1 - margin && hidden(s, leftover) &&
                  !on_a_source(s, extra->sources, fwhm);
    }
    rx_status status = rx_sources_select(found, keep, err);
    free(keep);
    return status;
}

static rx_status positions(const rx_sources *found, double (**dst)[2], int *n, rx_error *err)
{
    double(*at)[2] = rx_alloc((size_t)found->n, sizeof *at);
    if (at == NULL)
        return rx_error_memory(err, (size_t)found->n * sizeof *at);
    for (int i = 0; i < found->n; i++) {
        at[i][0] = found->list[i].x;
        at[i][1] = found->list[i].y;
    }
    *dst = at;
    *n = found->n;
    return RX_OK;
}

/* The threshold for measuring a source is that of its peak before the filter. */
static void set_analysis_threshold(const rx_leftover *leftover, double threshold, rx_sources *found)
{
    for (int i = 0; i < found->n; i++) {
        rx_source *s = &found->list[i];
        s->analysis_threshold = threshold * rx_leftover_sigma(leftover, s->xpeak, s->ypeak);
    }
}

/* On planes that have been filtered already, by all threads: the filter is as large as the PSF. */
static rx_status detect(rx_template_extra *extra, const rx_leftover *leftover, double threshold,
                        rx_error *err)
{
    const int width = leftover->state->width, height = leftover->state->height;
    const size_t npixels = (size_t)width * (size_t)height;
    rx_detect_params par = *extra->detect;
    float *filtered = RX_NEW(float, npixels), *noise = RX_NEW(float, npixels);
    uint8_t *mask = RX_NEW(uint8_t, npixels);
    rx_status status = RX_OK;
    if (filtered == NULL || noise == NULL || mask == NULL)
        status = rx_error_memory(err, npixels * (2 * sizeof *filtered + 1));
    else
        status = rx_leftover_filter(leftover, filtered, noise, mask, err);
    par.threshold = par.analysis_threshold = threshold;
    par.absolute = par.analysis_absolute = 0;
    par.min_area = 1;
    par.max_area = 0;
    par.filter = NULL;
    par.filter_width = par.filter_height = 0;
    par.filter_normalise = 1;
    par.matched = 0;
    const rx_detect_image image = {.width = width,
                                   .height = height,
                                   .pixels = filtered,
                                   .sigma = noise,
                                   .mask = mask,
                                   .mask_bits = 1,
                                   .variable_noise = 1,
                                   .global_sigma = 1.0};
    if (status == RX_OK)
        status = rx_detect_run(&par, &image, extra->log, &extra->found, err);
    free(filtered);
    free(noise);
    free(mask);
    return status;
}

rx_status rx_template_extra_find(void *user, const rx_tphot_state *state, double (**dst)[2], int *n,
                                 rx_error *err)
{
    rx_template_extra *extra = user;
    int side = 0;
    float *stamp = matched_filter(extra->psf, state->width, state->height, &side);
    if (stamp == NULL)
        return rx_error_memory(err, 0);
    const double threshold = extra->threshold * rx_filter_norm(stamp, side * side);
    rx_filter filter = {0};
    rx_status status = rx_filter_new(stamp, side, side, &filter, err);
    free(stamp);
    if (status != RX_OK)
        return status;
    const rx_leftover leftover = {.state = state,
                                  .pixels = extra->pixels,
                                  .level = extra->level,
                                  .reach = (int)ceil(NEAR * fmax(extra->psf->fwhm, 1.0)),
                                  .model_error = MODEL_ERROR,
                                  .filter = filter.values,
                                  .side = side,
                                  .nthreads = extra->nthreads};
    status = detect(extra, &leftover, threshold, err);
    if (status == RX_OK)
        status = choose(extra, &leftover, err);
    if (status == RX_OK) {
        set_analysis_threshold(&leftover, threshold, extra->found);
        status = positions(extra->found, dst, n, err);
    }
    rx_filter_free(&filter);
    return status;
}

/* Pixels of `from` that are nobody's become those of the added sources. */
static void paint_segments(const rx_sources *from, int first, int nthreads, rx_sources *sources)
{
    const size_t n = (size_t)sources->width * (size_t)sources->height;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (size_t i = 0; i < n; i++)
        if (from->segments[i] != 0 && sources->segments[i] == 0)
            sources->segments[i] = first + from->segments[i];
}

rx_status rx_template_extra_append(const rx_template_extra *extra, rx_sources *sources, rx_error *err)
{
    const rx_sources *found = extra->found;
    if (found == NULL || found->n == 0)
        return RX_OK;
    const size_t all = (size_t)sources->n + (size_t)found->n;
    rx_source *list = rx_regrow(sources->list, all, sizeof *list);
    if (list == NULL)
        return rx_error_memory(err, all * sizeof *list);
    int32_t last = 0;
    for (int i = 0; i < sources->n; i++)
        last = list[i].segment > last ? list[i].segment : last;
    sources->list = list;
    paint_segments(found, last, extra->nthreads, sources);
    for (int i = 0; i < found->n; i++) {
        rx_source *s = &list[sources->n + i];
        *s = found->list[i];
        s->number = sources->n + i + 1;
        s->segment += last;
        s->flags |= RX_FLAG_MERGED;
        s->detection_snr = 0.0;
    }
    sources->n = (int)all;
    return RX_OK;
}
