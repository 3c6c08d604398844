/* Detection: planes for sep, its catalogue as rx_sources, segmentation map and fragments. */
#include "detect/detect.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "detect/clean.h"
#include "detect/filter.h"
#include "detect/groups.h"
#include "detect/sep_extract.h"

/* Everything one run needs, freed together. */
typedef struct workspace {
    size_t n;
    rx_filter kernel;
    float *pixels; /* masked ones 0 */
    uint8_t *hidden;
    float *sigma; /* threshold noise, NULL = one value */
    float *filtered;
    uint8_t *above;   /* filtered value above the threshold */
    rx_groups groups; /* of those */
    int *eater;       /* of each row of the catalogue, -1 none; NULL without CLEAN */
    sep_catalog *catalog;
} workspace;

static void free_workspace(workspace *work)
{
    rx_filter_free(&work->kernel);
    free(work->pixels);
    free(work->hidden);
    free(work->sigma);
    free(work->filtered);
    free(work->above);
    rx_groups_free(&work->groups);
    free(work->eater);
    sep_catalog_free(work->catalog);
}

static rx_status fill_planes(const rx_detect_params *par, const rx_detect_image *image, workspace *work,
                             rx_error *err)
{
    work->n = (size_t)image->width * (size_t)image->height;
    work->pixels = RX_NEW(float, work->n);
    work->hidden = RX_NEW(uint8_t, work->n);
    work->filtered = RX_NEW(float, work->n);
    work->above = RX_NEW(uint8_t, work->n);
    if (work->pixels == NULL || work->hidden == NULL || work->filtered == NULL || work->above == NULL)
        return rx_error_memory(err, work->n * sizeof(float));
    for (size_t i = 0; i < work->n; i++) {
        bool hidden =
            (image->mask != NULL && (image->mask[i] & image->mask_bits) != 0) || !isfinite(image->pixels[i]);
        work->hidden[i] = hidden;
        work->pixels[i] = hidden ? 0.0f : image->pixels[i];
    }
    if (!image->variable_noise && !par->matched)
        return RX_OK;
    work->sigma = RX_NEW(float, work->n);
    if (work->sigma == NULL)
        return rx_error_memory(err, work->n * sizeof(float));
    if (par->matched) { /* sep filters the noise itself */
        for (size_t i = 0; i < work->n; i++)
            work->sigma[i] = work->hidden[i]         ? 1e30f
                             : image->variable_noise ? image->sigma[i]
                                                     : (float)image->global_sigma;
    } else {
        rx_filter_sigma(&work->kernel, image->sigma, work->hidden, image->width, image->height, work->sigma);
    }
    return RX_OK;
}

/* Mark the pixels above the threshold, as sep will find them; returns how many. */
static long mark_above(const rx_detect_params *par, const rx_detect_image *image, workspace *work,
                       double threshold)
{
    long count = 0;
    rx_filter_plane(&work->kernel, work->pixels, image->width, image->height, work->filtered);
    for (size_t i = 0; i < work->n; i++) {
        float sigma = work->sigma != NULL ? work->sigma[i] : (float)image->global_sigma;
        float limit = par->absolute ? (float)threshold : (float)threshold * sigma;
        work->above[i] = work->filtered[i] > limit;
        count += work->above[i];
    }
    return count;
}

static rx_status clean_catalog(const rx_detect_params *par, workspace *work, double threshold, rx_error *err)
{
    rx_clean_image image = {.pixels = work->pixels, .filtered = work->filtered, .threshold = threshold};
    if (!par->absolute)
        image.sigma = work->sigma;
    return rx_clean(work->catalog, &image, par->min_area, par->max_area, par->clean_param, &work->eater, err);
}

/* A singular ellipse (rank-deficient moments survive sep's own cure when pixels are negative)
 * becomes a circle of the same area. */
static void cure_ellipse(rx_source *s)
{
    bool sound = isfinite(s->a) && isfinite(s->b) && isfinite(s->theta) && s->b > 0.0 && s->a >= s->b &&
                 s->cxx > 0.0 && s->cyy > 0.0 && 4.0 * s->cxx * s->cyy > s->cxy * s->cxy;
    if (sound)
        return;
    double radius2 = fmax(s->npix, 1) / (4.0 * 3.14159265358979323846);
    s->x2 = s->y2 = radius2;
    s->xy = 0.0;
    s->a = s->b = sqrt(radius2);
    s->theta = 0.0;
    s->cxx = s->cyy = 1.0 / radius2;
    s->cxy = 0.0;
    s->flags_measure |= RX_FLAGM_SINGULAR;
}

static int source_flags(short flag)
{
    int flags = 0;
    if ((flag & SEP_OBJ_MERGED) != 0)
        flags |= RX_FLAG_MERGED;
    if ((flag & SEP_OBJ_TRUNC) != 0)
        flags |= RX_FLAG_TRUNCATED;
    if ((flag & SEP_OBJ_DOVERFLOW) != 0)
        flags |= RX_FLAG_DEBLEND_OVER;
    return flags;
}

/* Row i of sep's catalogue. */
static void convert_source(const rx_detect_params *par, const rx_detect_image *image, const sep_catalog *cat,
                           int i, const rx_filter *kernel, rx_source *s)
{
    *s = (rx_source){.xmin = cat->xmin[i],
                     .xmax = cat->xmax[i],
                     .ymin = cat->ymin[i],
                     .ymax = cat->ymax[i],
                     .xpeak = cat->xcpeak[i],
                     .ypeak = cat->ycpeak[i],
                     .npix = cat->npix[i],
                     .isoarea = cat->tnpix[i],
                     .x = cat->x[i],
                     .y = cat->y[i],
                     .x2 = cat->x2[i],
                     .y2 = cat->y2[i],
                     .xy = cat->xy[i],
                     .errx2 = cat->errx2[i],
                     .erry2 = cat->erry2[i],
                     .errxy = cat->errxy[i],
                     .a = cat->a[i],
                     .b = cat->b[i],
                     .theta = cat->theta[i],
                     .cxx = cat->cxx[i],
                     .cyy = cat->cyy[i],
                     .cxy = cat->cxy[i],
                     .peak = cat->peak[i],
                     .flux_iso = cat->flux[i],
                     .flags = source_flags(cat->flag[i])};
    s->threshold = cat->thresh[i] * (par->filter_normalise ? 1.0 : kernel->sum);
    s->analysis_threshold = par->analysis_threshold;
    if (!par->analysis_absolute) {
        double sigma = image->global_sigma;
        if (image->variable_noise)
            sigma = image->sigma[(size_t)s->ypeak * (size_t)image->width + (size_t)s->xpeak];
        s->analysis_threshold *= sigma;
    }
    if ((cat->flag[i] & SEP_OBJ_SINGU) != 0)
        s->flags_measure |= RX_FLAGM_SINGULAR;
    if (!isfinite(s->x) || !isfinite(s->y)) {
        s->x = s->xpeak;
        s->y = s->ypeak;
        s->flags_measure |= RX_FLAGM_SINGULAR;
    }
    cure_ellipse(s);
}

/* Fragments: pixels above the threshold in a group of fewer than min_area. */
static void mark_fragments(const workspace *work, int min_area, uint8_t *fragments)
{
    for (size_t i = 0; i < work->n; i++) {
        int32_t label = work->groups.label[i];
        if (label > 0 && work->groups.list[label - 1].size < min_area)
            fragments[i] = RX_FRAGMENT_SMALL;
    }
}

static void paint_segment(const sep_catalog *cat, int row, int32_t segment, int fragment, rx_sources *dst)
{
    for (int k = 0; k < cat->npix[row]; k++) {
        dst->segments[cat->pix[row][k]] = segment;
        dst->fragments[cat->pix[row][k]] = (uint8_t)fragment;
    }
}

/* Add row `i`, eaten by `s`, to it. */
static void merge_source(const sep_catalog *cat, int i, rx_source *s, rx_sources *dst)
{
    s->npix += cat->npix[i];
    s->flux_iso += cat->flux[i];
    s->flags |= source_flags(cat->flag[i]) & ~RX_FLAG_MERGED;
    s->xmin = cat->xmin[i] < s->xmin ? cat->xmin[i] : s->xmin;
    s->xmax = cat->xmax[i] > s->xmax ? cat->xmax[i] : s->xmax;
    s->ymin = cat->ymin[i] < s->ymin ? cat->ymin[i] : s->ymin;
    s->ymax = cat->ymax[i] > s->ymax ? cat->ymax[i] : s->ymax;
    paint_segment(cat, i, s->segment, RX_FRAGMENT_EATEN, dst);
}

static rx_status build_sources(const rx_detect_params *par, const rx_detect_image *image,
                               const workspace *work, const rx_extraction *job, rx_sources *dst,
                               rx_error *err)
{
    const sep_catalog *cat = work->catalog;
    rx_status status = RX_OK;
    int *row_of = RX_NEW(int, (size_t)cat->nobj); /* index in dst->list, -1 left out */
    dst->width = image->width;
    dst->height = image->height;
    dst->grown = job->grown;
    dst->law_scale = 1.0;
    dst->law_power = 0.5;
    dst->list = RX_NEW(rx_source, (size_t)cat->nobj);
    dst->segments = RX_NEW(int32_t, work->n);
    dst->fragments = RX_NEW(uint8_t, work->n);
    if (row_of == NULL || dst->list == NULL || dst->segments == NULL || dst->fragments == NULL) {
        status = rx_error_memory(err, work->n * sizeof(int32_t));
        goto exit;
    }
    for (int i = 0; i < cat->nobj; i++) {
        row_of[i] = -1;
        if ((work->eater != NULL && work->eater[i] >= 0) ||
            (par->max_area > 0 && cat->npix[i] > par->max_area))
            continue;
        row_of[i] = dst->n;
        rx_source *s = &dst->list[dst->n++];
        convert_source(par, image, cat, i, &work->kernel, s);
        s->number = s->segment = dst->n;
        s->flags |= job->flags;
        paint_segment(cat, i, s->segment, 0, dst);
    }
    for (int i = 0; work->eater != NULL && i < cat->nobj; i++)
        if (work->eater[i] >= 0 && row_of[work->eater[i]] >= 0)
            merge_source(cat, i, &dst->list[row_of[work->eater[i]]], dst);
    mark_fragments(work, par->min_area, dst->fragments);
exit:
    free(row_of);
    return status;
}

rx_status rx_detect_run(const rx_detect_params *par, const rx_detect_image *image, rx_log *log,
                        rx_sources **dst, rx_error *err)
{
    workspace work = {0};
    rx_sources *sources = NULL;
    rx_status status;
    *dst = NULL;
    if (!(par->threshold > 0.0) || !(image->global_sigma > 0.0))
        return rx_error_set(err, RX_USAGE, "DETECT_THRESH must be positive");
    status = rx_filter_new(par->filter, par->filter_width, par->filter_height, &work.kernel, err);
    if (status != RX_OK)
        return status;
    status = fill_planes(par, image, &work, err);
    if (status != RX_OK)
        goto exit;
    rx_extraction job = {.width = image->width,
                         .height = image->height,
                         .pixels = work.pixels,
                         .hidden = work.hidden,
                         .noise = work.sigma,
                         .noise_value = image->global_sigma,
                         .gain = image->gain,
                         .kernel = &work.kernel,
                         .groups = &work.groups,
                         .threshold = par->threshold / (par->filter_normalise ? 1.0 : work.kernel.sum)};
    job.above = mark_above(par, image, &work, job.threshold);
    status = rx_groups_find(work.above, par->absolute ? NULL : work.sigma, job.threshold, image->width,
                            image->height, &work.groups, err);
    if (status != RX_OK)
        goto exit;
    status = rx_extract_run(par, &job, log, &work.catalog, err);
    if (status != RX_OK)
        goto exit;
    if (par->clean)
        status = clean_catalog(par, &work, job.threshold * job.raised, err);
    if (status != RX_OK)
        goto exit;
    sources = RX_NEW(rx_sources, 1);
    status = sources == NULL ? rx_error_memory(err, sizeof *sources)
                             : build_sources(par, image, &work, &job, sources, err);
    if (status != RX_OK)
        goto exit;
    *dst = sources;
    sources = NULL;
exit:
    rx_sources_free(sources);
    free_workspace(&work);
    return status;
}
