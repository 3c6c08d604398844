/* Sources that only show in what the templates leave. */
#include "pipeline/template_extra.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/filter.h"
#include "template/template_residual.h"

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
/* In a crowd everything stands in the light of others: models are fitted again until they are better, and what does not hold
 * then goes again. */
static const double CROWD_APART = 0.2;

/* The residual is detected on in bands of about BAND pixels that begin at multiples of STEP rows, with AROUND
 * rows more at either end: what reaches farther than that into the next band is cut there. */
enum { BAND = 1 << 23, STEP = 64, AROUND = 128 };

/* Where a source is. */
typedef struct place {
    double y, x;
} place;

/* What one call looks for and where. */
typedef struct search {
    rx_template_extra *extra;
    const rx_tphot_search *look;
    rx_template_residual leftover;
    double norm; /* of the filter: S/N in it is that times its peak's over the noise of a pixel */
    double peak; /* of a source of S/N 1, in units of the noise of a pixel */
    double threshold;
    int ntaken;
    place *taken;             /* [ntaken] by y */
    unsigned char *saturated; /* [extra->sources->n] by segment - 1: holds saturated pixels */
} search;

/* A pixel of an added source. */
typedef struct rx_template_pixel {
    size_t at;
    int32_t segment;
} rx_template_pixel;

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

static int by_y(const void *one, const void *other)
{
    const place *a = one, *b = other;
    return (a->y > b->y) - (a->y < b->y);
}

static rx_status sort_taken(search *of, rx_error *err)
{
    const rx_tphot_search *look = of->look;
    const size_t n = (size_t)look->n + (size_t)look->nseconds;
    RX_TRY(RX_MAKE(of->taken, n, err));
    for (int i = 0; i < look->n; i++)
        of->taken[of->ntaken++] = (place){look->at[i][1], look->at[i][0]};
    for (int i = 0; i < look->nseconds; i++)
        of->taken[of->ntaken++] = (place){look->seconds[i][1], look->seconds[i][0]};
    qsort(of->taken, n, sizeof *of->taken, by_y);
    return RX_OK;
}

/* Too near a source to be resolved from it: what a template leaves there is its own error, that of a cosmic
 * ray for instance, which is no point. */
static int on_a_source(const search *of, const rx_source *s, double apart)
{
    int first = 0, end = of->ntaken;
    while (first < end) {
        const int middle = first + (end - first) / 2;
        if (of->taken[middle].y > s->y - apart)
            end = middle;
        else
            first = middle + 1;
    }
    for (int i = first; i < of->ntaken && of->taken[i].y < s->y + apart; i++)
        if (hypot(s->x - of->taken[i].x, s->y - of->taken[i].y) < apart)
            return 1;
    return 0;
}

/* Around a core that is cut off no template fits: its errors would stand as a ring of sources. */
static rx_status mark_saturated(const rx_template_extra *extra, unsigned char **dst, rx_error *err)
{
    const rx_sources *sources = extra->sources;
    const size_t npixels = (size_t)sources->width * (size_t)sources->height;
    unsigned char *saturated;
    RX_TRY(RX_MAKE(saturated, (size_t)sources->n, err));
    for (size_t i = 0; i < npixels; i++)
        if ((extra->mask[i] & RX_MASK_CUT) != 0 && sources->segments[i] > 0)
            saturated[sources->segments[i] - 1] = 1;
    *dst = saturated;
    return RX_OK;
}

/* Is it such an error, in the segment of a star that is cut off? In a crowd that holds others, too, and what is brighter than the
 * models there is one of them. */
static int is_of_a_saturated_star(const search *of, const rx_source *s,
                                  const rx_template_residual_pixel *spot)
{
    const rx_sources *sources = of->extra->sources;
    const int32_t segment = sources->segments[(size_t)s->ypeak * (size_t)sources->width + (size_t)s->xpeak];
    const double height = s->detection_snr / of->norm * of->peak * spot->sigma;
    return segment > 0 && of->saturated[segment - 1] &&
           !(rx_crowding_at(of->look->crowd, s->xpeak, s->ypeak) && height > spot->light);
}

/* Is it one that is looked for: in a crowd all that is significant, elsewhere, in the first look, what models hide? */
static int wanted(const search *of, const rx_source *s, const rx_template_residual_pixel *spot)
{
    const double fwhm = of->extra->psf->fwhm;
    if (rx_crowding_at(of->look->crowd, s->xpeak, s->ypeak))
        return !on_a_source(of, s, CROWD_APART * fwhm);
    return of->look->again == 0 && s->detection_snr >= of->extra->threshold * of->norm &&
           spot->light > HIDDEN / sqrt(spot->weight) && !on_a_source(of, s, APART * fwhm);
}

/* Which of what ends in the rows from .. to - 1 is taken; the threshold for measuring a source is that of its
 * peak before the filter. */
static rx_status choose(const search *of, int from, int to, rx_sources *found, rx_error *err)
{
    const rx_template_residual *leftover = &of->leftover;
    const int width = leftover->image->width, height = leftover->image->height;
    const double margin = BORDER * of->extra->psf->fwhm;
    unsigned char *keep = RX_NEW(unsigned char, (size_t)found->n);
    rx_template_residual_pixel *spots = RX_NEW(rx_template_residual_pixel, (size_t)found->n);
    rx_status status = RX_OK;
    if (keep == NULL || spots == NULL)
        status = rx_error_memory(err, (size_t)found->n * (sizeof *spots + 1));
    for (int i = 0; i < found->n && status == RX_OK; i++)
        spots[i] = (rx_template_residual_pixel){.x = found->list[i].xpeak, .y = found->list[i].ypeak};
    if (status == RX_OK)
        status = rx_template_residual_at(leftover, spots, found->n, err);
    if (status != RX_OK)
        goto exit;
#pragma omp parallel for schedule(dynamic, 64) num_threads(of->extra->nthreads)
    for (int i = 0; i < found->n; i++) {
        rx_source *s = &found->list[i];
        keep[i] = s->ymax >= from && s->ymax < to && s->x >= margin && s->y >= margin &&
                  s->x <= width - 1 - margin && s->y <= height - 1 - margin && wanted(of, s, &spots[i]) &&
                  !is_of_a_saturated_star(of, s, &spots[i]);
        s->analysis_threshold = of->threshold * spots[i].sigma;
    }
    status = rx_sources_select(found, keep, err);
exit:
    free(keep);
    free(spots);
    return status;
}

/* The pixels of what was found as a list, for most of its map, which begins at row `from`, is empty; segments
 * go on from `last`. */
static rx_status list_pixels(const rx_sources *found, int from, int last, rx_template_extra *extra,
                             rx_error *err)
{
    const size_t n = (size_t)found->width * (size_t)found->height;
    const size_t above = (size_t)from * (size_t)found->width;
    size_t count = extra->npixels_found;
    for (size_t i = 0; i < n; i++)
        count += found->segments[i] != 0;
    RX_TRY(RX_GROW(extra->pixels_found, count, err));
    rx_template_pixel *list = extra->pixels_found;
    for (size_t i = 0; i < n; i++)
        if (found->segments[i] != 0)
            list[extra->npixels_found++] = (rx_template_pixel){above + i, last + found->segments[i]};
    return RX_OK;
}

/* What was found in a band whose map begins at row `from` joins the others. */
static rx_status collect(const rx_sources *band, int from, rx_template_extra *extra, rx_error *err)
{
    rx_sources *found = extra->found;
    const size_t all = (size_t)found->n + (size_t)band->n;
    RX_TRY(RX_GROW(found->list, all, err));
    rx_source *list = found->list;
    rx_status status = list_pixels(band, from, found->n, extra, err);
    for (int i = 0; i < band->n && status == RX_OK; i++) {
        list[found->n] = band->list[i];
        list[found->n].number = list[found->n].segment = found->n + 1;
        found->n++;
    }
    return status;
}

/* The second ones of pairs, which share the pixels of the first, join them: one pixel each. */
static rx_status add_seconds(const rx_tphot_search *look, double threshold, rx_sources *found, rx_error *err)
{
    const size_t all = (size_t)found->n + (size_t)look->nseconds;
    const double square = 1 / 12.0;
    RX_TRY(RX_GROW(found->list, all, err));
    rx_source *list = found->list;
    for (int i = 0; i < look->nseconds; i++) {
        const double x = look->seconds[i][0], y = look->seconds[i][1];
        rx_source *s = &list[found->n++];
        *s = (rx_source){.number = found->n, .segment = found->n, .npix = 1, .isoarea = 1, .x = x, .y = y};
        s->xmin = s->xmax = s->xpeak = (int)fmin(fmax(x + 0.5, 0), found->width - 1);
        s->ymin = s->ymax = s->ypeak = (int)fmin(fmax(y + 0.5, 0), found->height - 1);
        s->x2 = s->y2 = square;
        s->cxx = s->cyy = 1 / square;
        s->a = s->b = sqrt(square);
        s->analysis_threshold =
            threshold * sqrt((double)rx_fit_image_variance(look->image, s->xpeak, s->ypeak));
    }
    return RX_OK;
}

/* Those from `first` on. */
static rx_status positions(const rx_sources *found, int first, double (**dst)[2], int *n, rx_error *err)
{
    double(*at)[2] = rx_alloc((size_t)(found->n - first), sizeof *at);
    if (at == NULL)
        return rx_error_memory(err, (size_t)(found->n - first) * sizeof *at);
    for (int i = first; i < found->n; i++) {
        at[i - first][0] = found->list[i].x;
        at[i - first][1] = found->list[i].y;
    }
    *dst = at;
    *n = found->n - first;
    return RX_OK;
}

/* All of the rows from .. to - 1, on planes that have been filtered already, by all threads: the filter is as
 * large as the PSF. */
static rx_status detect(const search *of, int from, int to, rx_sources **dst, rx_error *err)
{
    const int width = of->leftover.image->width, height = to - from;
    const size_t npixels = (size_t)width * (size_t)height;
    rx_detect_params par = *of->extra->detect;
    float *filtered = RX_NEW(float, npixels), *noise = RX_NEW(float, npixels);
    uint8_t *mask = RX_NEW(uint8_t, npixels);
    rx_status status = RX_OK;
    if (filtered == NULL || noise == NULL || mask == NULL)
        status = rx_error_memory(err, npixels * (2 * sizeof *filtered + 1));
    else
        status = rx_template_residual_filter(&of->leftover, from, to, filtered, noise, mask, err);
    par.threshold = par.analysis_threshold = of->threshold;
    par.absolute = par.analysis_absolute = 0;
    par.min_area = 1;
    par.max_area = 0;
    par.filter = NULL;
    par.filter_width = par.filter_height = 0;
    par.filter_normalise = 1;
    par.clean = par.clean && of->look->crowd->n == 0;
    const rx_image image = {.width = width,
                            .height = height,
                            .pixels = filtered,
                            .mask = mask,
                            .hide = 1,
                            .noise = rx_map_plane(noise, width),
                            .variable_noise = 1,
                            .global_noise = 1.0};
    if (status == RX_OK)
        status = rx_detect_run(&par, &image, &(rx_filtered){.pixels = filtered}, of->extra->log, dst, err);
    free(filtered);
    free(noise);
    free(mask);
    return status;
}

/* What ends in the rows from .. to - 1. */
static rx_status find_in_band(search *of, int from, int to, rx_error *err)
{
    const int height = of->leftover.image->height, top = from > AROUND ? from - AROUND : 0;
    const int end = to + AROUND < height ? to + AROUND : height;
    rx_sources *found = NULL;
    rx_status status = detect(of, top, end, &found, err);
    for (int i = 0; status == RX_OK && i < found->n; i++) {
        rx_source *s = &found->list[i];
        s->y += top;
        s->ymin += top;
        s->ymax += top;
        s->ypeak += top;
    }
    if (status == RX_OK)
        status = choose(of, from, to, found, err);
    if (status == RX_OK)
        status = collect(found, top, of->extra, err);
    rx_sources_free(found);
    return status;
}

static rx_status find_all(search *of, rx_error *err)
{
    rx_template_extra *extra = of->extra;
    const int width = of->leftover.image->width, height = of->leftover.image->height;
    const int rows = (BAND / width / STEP + 1) * STEP;
    rx_status status = RX_OK;
    RX_TRY(sort_taken(of, err));
    RX_TRY(mark_saturated(extra, &of->saturated, err));
    if (extra->found == NULL && (extra->found = RX_NEW(rx_sources, 1)) == NULL)
        return rx_error_memory(err, sizeof *extra->found);
    extra->found->width = width;
    extra->found->height = height;
    for (int y = 0; y < height && status == RX_OK; y += rows)
        status = find_in_band(of, y, y + rows < height ? y + rows : height, err);
    return status;
}

rx_status rx_template_extra_find(void *user, const rx_tphot_search *look, double (**dst)[2], int *n,
                                 rx_error *err)
{
    rx_template_extra *extra = user;
    rx_fit_image *image = look->image;
    const int before = extra->found != NULL ? extra->found->n : 0;
    int side = 0;
    float *stamp = matched_filter(extra->psf, image->width, image->height, &side);
    if (stamp == NULL)
        return rx_error_memory(err, 0);
    const double norm = rx_filter_norm(stamp, side * side), peak = (double)stamp[side / 2 * side + side / 2];
    const double threshold =
        norm * (look->crowd->n > 0 ? fmin(extra->threshold, extra->crowd_threshold) : extra->threshold);
    const double grain = rx_noise_factor(image->correlation, stamp, side, side);
    rx_filter filter = {0};
    rx_status status = rx_filter_new(stamp, side, side, &filter, err);
    free(stamp);
    if (status != RX_OK)
        return status;
    search of = {.extra = extra,
                 .look = look,
                 .norm = norm,
                 .peak = peak / norm,
                 .leftover = {.image = image,
                              .pixels = extra->pixels,
                              .level = extra->level,
                              .reach = (int)ceil(NEAR * fmax(extra->psf->fwhm, 1.0)),
                              .model_error = MODEL_ERROR,
                              .crowd_error = extra->crowd_error,
                              .crowd = look->crowd,
                              .grain = grain,
                              .filter = filter.values,
                              .side = side,
                              .threshold = threshold,
                              .nthreads = extra->nthreads},
                 .threshold = threshold};
    status = find_all(&of, err);
    if (status == RX_OK)
        status = add_seconds(look, threshold, extra->found, err);
    if (status == RX_OK)
        status = positions(extra->found, before, dst, n, err);
    free(of.taken);
    free(of.saturated);
    rx_filter_free(&filter);
    return status;
}

rx_status rx_template_extra_append(const rx_template_extra *extra, const rx_tphot *tphot, rx_sources *sources,
                                   rx_error *err)
{
    const rx_sources *found = extra->found;
    const int n = tphot->n - tphot->nlisted, listed = sources->n;
    if (found == NULL || n == 0)
        return RX_OK;
    const size_t all = (size_t)listed + (size_t)n;
    rx_source *list = rx_regrow(sources->list, all, sizeof *list);
    int32_t *segments = RX_NEW(int32_t, (size_t)found->n + 1),
            last = 0; /* of each that was found; 0: it did not hold */
    if (list != NULL)
        sources->list = list;
    if (list == NULL || segments == NULL) {
        free(segments);
        return rx_error_memory(err, all * sizeof *list);
    }
    for (int i = 0; i < listed; i++)
        last = list[i].segment > last ? list[i].segment : last;
    for (int i = 0; i < n; i++) {
        const int k = tphot->list[tphot->nlisted + i].added;
        rx_source *s = &list[listed + i];
        *s = found->list[k];
        s->threshold *= extra->unit;
        s->analysis_threshold *= extra->unit;
        s->number = listed + i + 1;
        s->segment = segments[k + 1] = last + 1 + i;
        s->flags |= RX_FLAG_MERGED;
        s->detection_snr = 0.0;
    }
    for (size_t i = 0; i < extra->npixels_found; i++) { /* pixels without an owner */
        const rx_template_pixel *pixel = &extra->pixels_found[i];
        if (sources->segments[pixel->at] == 0)
            sources->segments[pixel->at] = segments[pixel->segment];
    }
    sources->n = (int)all;
    free(segments);
    return RX_OK;
}

void rx_template_extra_clear(rx_template_extra *extra)
{
    rx_sources_free(extra->found);
    free(extra->pixels_found);
    extra->found = NULL;
    extra->pixels_found = NULL;
    extra->npixels_found = 0;
}
