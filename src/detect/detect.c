/* Detection: filter, groups above the threshold, sep on these, the result as rx_sources. */
#include "detect/detect.h"

#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "detect/clean.h"
#include "detect/filter.h"
#include "detect/groups.h"
#include "detect/sep_extract.h"
#include "detect/threshold_noise.h"

enum { USUAL_PIXELS = 300000 };  /* above the threshold: SExtractor's first limit */
enum { LARGE_PLANE = 32 << 20 }; /* bytes, from which on what is freed is worth giving back */

/* Everything one run needs, freed together. */
typedef struct workspace {
    size_t n;
    rx_filter kernel;
    const float *pixels, *filtered; /* masked ones 0; before and after the filter */
    float *own_pixels, *own_filtered;
    float **spare; /* the caller's filtered image, to be freed early; or NULL */
    rx_groups groups;
    int *eater; /* of each detection, -1 none; NULL without CLEAN */
    rx_detections found;
} workspace;

static void free_workspace(workspace *work)
{
    rx_filter_free(&work->kernel);
    free(work->own_pixels);
    free(work->own_filtered);
    rx_groups_free(&work->groups);
    free(work->eater);
    rx_detections_free(&work->found);
}

static bool is_hidden(const rx_image *image, size_t i)
{
    return rx_image_hides(image, i) || !isfinite(image->pixels[i]);
}

/* The filtered image, unless the caller has it. */
static rx_status filter_pixels(const rx_detect_params *par, const rx_image *image,
                               const rx_filtered *filtered, workspace *work, rx_error *err)
{
    work->pixels = image->pixels;
    if (filtered != NULL) {
        work->filtered = filtered->pixels;
        work->spare = filtered->spare;
        return RX_OK;
    }
    work->pixels = work->own_pixels = RX_NEW(float, work->n);
    if (work->own_pixels == NULL)
        return rx_error_memory(err, work->n * sizeof(float));
    for (size_t i = 0; i < work->n; i++)
        work->own_pixels[i] = is_hidden(image, i) ? 0.0f : image->pixels[i];
    work->filtered = work->pixels;
    if (work->kernel.values == NULL)
        return RX_OK;
    work->filtered = work->own_filtered = RX_NEW(float, work->n);
    if (work->own_filtered == NULL)
        return rx_error_memory(err, work->n * sizeof(float));
    rx_filter_plane(&work->kernel, work->pixels, image->width, image->height, par->nthreads,
                    work->own_filtered);
    return RX_OK;
}

/* Pixels above the threshold are in the groups: what else was filtered is done with. */
static void drop_filtered(workspace *work, rx_extraction *job)
{
    job->image.filtered = NULL;
    free(work->own_filtered);
    work->own_filtered = NULL;
    if (work->spare != NULL) {
        free(*work->spare);
        *work->spare = NULL;
    }
}

/* Groups above the threshold; while there are more pixels in them than may be, the threshold rises, which is
 * flagged. */
static rx_status find_groups(const rx_detect_params *par, workspace *work, rx_extraction *job, rx_log *log,
                             rx_error *err)
{
    const long floor = par->pixstack > 0 ? par->pixstack : USUAL_PIXELS;
    const long allowed = par->pixstack_max > par->pixstack ? par->pixstack_max : par->pixstack;
    const double wanted = job->threshold;
    double raised = 1.0;
    for (;;) {
        job->threshold = wanted * raised;
        job->image.limit = (float)job->threshold;
        if (!par->absolute && !job->image.relative)
            job->image.limit *= (float)job->noise_value;
        rx_status status = rx_groups_find(&job->image, par->nthreads, &work->groups, err);
        if (status != RX_OK)
            return status;
        job->grown += work->groups.above > floor;
        if (work->groups.above <= allowed)
            break;
        rx_groups_free(&work->groups);
        job->flags |= RX_FLAG_EXTRACT_OVER;
        raised *= 1.25;
    }
    if ((job->flags & RX_FLAG_EXTRACT_OVER) != 0)
        rx_log_warning(log,
                       "more than %ld pixels above the threshold: threshold raised by %.2f, all sources "
                       "flagged; raise DETECT_THRESH",
                       allowed, raised);
    return RX_OK;
}

/* A singular ellipse (rank-deficient moments survive sep's own cure when pixels are negative)
 * becomes a circle of the same area. */
static void cure_ellipse(rx_source *s)
{
    bool sound = isfinite(s->a) && isfinite(s->b) && isfinite(s->theta) && s->b > 0.0 && s->a >= s->b &&
                 s->cxx > 0.0 && s->cyy > 0.0 && 4.0 * s->cxx * s->cyy > s->cxy * s->cxy;
    if (sound)
        return;
    double radius2 = fmax(s->npix, 1) / (4.0 * M_PI);
    s->x2 = s->y2 = radius2;
    s->xy = 0.0;
    s->a = s->b = sqrt(radius2);
    s->theta = 0.0;
    s->cxx = s->cyy = 1.0 / radius2;
    s->cxy = 0.0;
    s->flags_measure |= RX_FLAGM_SINGULAR;
}

/* Noise of the pixel at the peak. */
static double peak_noise(const rx_image *image, const workspace *work, const rx_detection *d)
{
    if (!image->variable_noise)
        return image->global_noise;
    const rx_span *span = rx_groups_span(&work->groups, d->group, NULL, d->xpeak, d->ypeak);
    return (double)(span != NULL ? rx_span_noise(span, d->xpeak)
                                 : rx_map_at(&image->noise, d->xpeak, d->ypeak));
}

static void convert_source(const rx_detect_params *par, const rx_detection *d, const rx_filter *kernel,
                           double noise, rx_source *s)
{
    *s = (rx_source){.xmin = d->xmin,
                     .xmax = d->xmax,
                     .ymin = d->ymin,
                     .ymax = d->ymax,
                     .xpeak = d->xpeak,
                     .ypeak = d->ypeak,
                     .npix = d->npix,
                     .isoarea = d->npix_raw,
                     .x = d->x,
                     .y = d->y,
                     .x2 = d->x2,
                     .y2 = d->y2,
                     .xy = d->xy,
                     .errx2 = d->errx2,
                     .erry2 = d->erry2,
                     .errxy = d->errxy,
                     .a = d->a,
                     .b = d->b,
                     .theta = d->theta,
                     .cxx = d->cxx,
                     .cyy = d->cyy,
                     .cxy = d->cxy,
                     .peak = d->peak,
                     .flux_iso = d->flux,
                     .flags = d->flags};
    s->threshold = d->threshold * (par->filter_normalise ? 1.0 : kernel->sum);
    s->analysis_threshold = par->analysis_threshold;
    if (!par->analysis_absolute)
        s->analysis_threshold *= noise;
    if (d->singular)
        s->flags_measure |= RX_FLAGM_SINGULAR;
    if (!isfinite(s->x) || !isfinite(s->y)) {
        s->x = s->xpeak;
        s->y = s->ypeak;
        s->flags_measure |= RX_FLAGM_SINGULAR;
    }
    cure_ellipse(s);
}

/* Highest S/N of the filtered pixels of a detection, whose places come in runs along rows. */
static double highest_snr(const rx_image *image, const workspace *work, double norm, const rx_detection *d)
{
    const rx_span *span = NULL;
    double highest = 0.0;
    for (int k = 0, n; k < d->npix; k += n) {
        const int at = d->pixels[k], x = at % image->width, y = at / image->width;
        float room[RX_MAP_PIECE];
        n = 1;
        if ((span = rx_groups_span(&work->groups, d->group, span, x, y)) == NULL)
            continue;
        while (k + n < d->npix && d->pixels[k + n] == at + n && x + n < span->x1 && n < RX_MAP_PIECE)
            n++;
        const float *filtered = span->values + (x - span->x0);
        const float *noise = image->variable_noise ? filtered + (ptrdiff_t)2 * (span->x1 - span->x0)
                                                   : rx_map_row(&image->noise, y, x, n, room);
        for (int i = 0; i < n; i++) {
            const double snr = (double)filtered[i] / (norm * (double)noise[i]);
            highest = snr > highest ? snr : highest;
        }
    }
    return highest;
}

/* Fragments: pixels above the threshold in a group of fewer than min_area. */
static void mark_fragments(const rx_groups *groups, int min_area, rx_sources *dst)
{
    for (long i = 0; i < groups->nspans; i++) {
        const rx_span *span = &groups->spans[i];
        if (groups->list[span->group].size < min_area)
            memset(dst->fragments + (size_t)span->y * (size_t)dst->width + (size_t)span->x0,
                   RX_FRAGMENT_SMALL, (size_t)(span->x1 - span->x0));
    }
}

static void paint_segment(const rx_detection *d, int32_t segment, int fragment, rx_sources *dst)
{
    for (int k = 0; k < d->npix; k++) {
        dst->segments[d->pixels[k]] = segment;
        if (fragment != 0)
            dst->fragments[d->pixels[k]] = (uint8_t)fragment;
    }
}

/* The maps. row_of: as of build_sources(). */
static void paint_all(const rx_detect_params *par, const workspace *work, const int *row_of, rx_sources *dst)
{
    const rx_detection *list = work->found.list;
    const int n = work->found.n;
#pragma omp parallel for schedule(dynamic, 64) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int i = 0; i < n; i++)
        if (row_of[i] >= 0)
            paint_segment(&list[i], row_of[i] + 1, 0, dst);
    for (int i = 0; work->eater != NULL && i < n; i++)
        if (work->eater[i] >= 0 && row_of[work->eater[i]] >= 0)
            paint_segment(&list[i], row_of[work->eater[i]] + 1, RX_FRAGMENT_EATEN, dst);
    mark_fragments(&work->groups, par->min_area, dst);
}

/* Add a detection, eaten by `s`, to it. */
static void merge_source(const rx_detection *d, double snr, rx_source *s)
{
    s->npix += d->npix;
    s->flux_iso += d->flux;
    s->flags |= d->flags & ~RX_FLAG_MERGED;
    s->detection_snr = fmax(s->detection_snr, snr);
    s->xmin = d->xmin < s->xmin ? d->xmin : s->xmin;
    s->xmax = d->xmax > s->xmax ? d->xmax : s->xmax;
    s->ymin = d->ymin < s->ymin ? d->ymin : s->ymin;
    s->ymax = d->ymax > s->ymax ? d->ymax : s->ymax;
}

/* What the pixels of a detection say of it. */
typedef struct rank {
    double snr, noise; /* noise: at its peak */
} rank;

/* [n] of all that was found. */
static rank *rank_all(const rx_detect_params *par, const rx_image *image, const workspace *work)
{
    const int n = work->found.n;
    const double norm = rx_filter_norm(work->kernel.values, work->kernel.width * work->kernel.height);
    rank *ranks = RX_NEW(rank, (size_t)n);
    if (ranks == NULL)
        return NULL;
#pragma omp parallel for schedule(dynamic, 64) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int i = 0; i < n; i++) {
        const rx_detection *d = &work->found.list[i];
        ranks[i].noise = peak_noise(image, work, d);
        if (rx_map_given(&image->noise))
            ranks[i].snr = highest_snr(image, work, norm, d);
    }
    return ranks;
}

/* Pixels of groups and detections have been looked at: before there are as many bytes of sources. */
static void drop_pixels(workspace *work)
{
    rx_groups_free(&work->groups);
    rx_detections_drop_pixels(&work->found);
    if (work->n * sizeof(float) >= LARGE_PLANE)
        rx_memory_trim();
}

static rx_status build_sources(const rx_detect_params *par, const rx_image *image, workspace *work,
                               const rx_extraction *job, rx_sources *dst, rx_error *err)
{
    const rx_detection *list = work->found.list;
    const int n = work->found.n;
    rx_status status = RX_OK;
    int *row_of = RX_NEW(int, (size_t)n); /* index in dst->list, -1 left out */
    rank *ranks = rank_all(par, image, work);
    dst->width = image->width;
    dst->height = image->height;
    dst->grown = job->grown;
    dst->law_scale = 1.0;
    dst->law_power = 0.5;
    dst->segments = RX_NEW(int32_t, work->n);
    dst->fragments = RX_NEW(uint8_t, work->n);
    if (row_of == NULL || ranks == NULL || dst->segments == NULL || dst->fragments == NULL)
        RX_TRY_EXIT(rx_error_memory(err, work->n * sizeof(int32_t)));
    for (int i = 0; i < n; i++) {
        const bool eaten = work->eater != NULL && work->eater[i] >= 0;
        const bool large = par->max_area > 0 && list[i].npix > par->max_area;
        row_of[i] = eaten || large ? -1 : dst->n++;
    }
    paint_all(par, work, row_of, dst);
    drop_pixels(work);
    dst->list = RX_NEW(rx_source, (size_t)dst->n);
    if (dst->list == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)dst->n * sizeof *dst->list));
#pragma omp parallel for schedule(dynamic, 64) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int i = 0; i < n; i++) {
        if (row_of[i] < 0)
            continue;
        rx_source *s = &dst->list[row_of[i]];
        convert_source(par, &list[i], &work->kernel, ranks[i].noise, s);
        s->number = s->segment = row_of[i] + 1;
        s->flags |= job->flags;
        s->detection_snr = ranks[i].snr;
    }
    for (int i = 0; work->eater != NULL && i < n; i++)
        if (work->eater[i] >= 0 && row_of[work->eater[i]] >= 0)
            merge_source(&list[i], ranks[i].snr, &dst->list[row_of[work->eater[i]]]);
exit:
    free(row_of);
    free(ranks);
    return status;
}

rx_status rx_detect_run(const rx_detect_params *par, const rx_image *image, const rx_filtered *filtered,
                        rx_log *log, rx_sources **dst, rx_error *err)
{
    workspace work = {0};
    rx_sources *sources = NULL;
    rx_status status;
    *dst = NULL;
    if (!(par->threshold > 0.0) || !(image->global_noise > 0.0))
        return rx_error_set(err, RX_USAGE, "DETECT_THRESH must be positive");
    if (image->height > 0 && image->width > INT_MAX / image->height) /* places are counted by int */
        return rx_error_set(err, RX_USAGE, "an image of %d x %d pixels has more than %d; cut it into tiles",
                            image->width, image->height, INT_MAX);
    status = rx_filter_new(par->filter, par->filter_width, par->filter_height, &work.kernel, err);
    if (status != RX_OK)
        return status;
    work.n = (size_t)image->width * (size_t)image->height;
    RX_TRY_EXIT(filter_pixels(par, image, filtered, &work, err));
    const rx_threshold_noise varying = {.width = image->width,
                                        .height = image->height,
                                        .noise = &image->noise,
                                        .pixels = image->pixels,
                                        .mask = image->mask,
                                        .mask_bits = image->hide,
                                        .kernel = &work.kernel};
    rx_extraction job = {.image = {.width = image->width,
                                   .height = image->height,
                                   .filtered = work.filtered,
                                   .noise = image->variable_noise ? &varying : NULL,
                                   .relative = image->variable_noise && !par->absolute},
                         .pixels = work.pixels,
                         .noise_value = image->global_noise,
                         .gain = image->gain,
                         .kernel = &work.kernel,
                         .groups = &work.groups,
                         .threshold = par->threshold / (par->filter_normalise ? 1.0 : work.kernel.sum)};
    RX_TRY_EXIT(find_groups(par, &work, &job, log, err));
    drop_filtered(&work, &job);
    RX_TRY_EXIT(rx_extract_run(par, &job, log, &work.found, err));
    if (par->clean)
        RX_TRY_EXIT(rx_clean(par, &work.found, &(rx_clean_image){work.pixels, &work.groups, &job.image},
                             &work.eater, err));
    sources = RX_NEW(rx_sources, 1);
    RX_TRY_EXIT(sources == NULL ? rx_error_memory(err, sizeof *sources)
                                : build_sources(par, image, &work, &job, sources, err));
    *dst = sources;
    sources = NULL;
exit:
    rx_sources_free(sources);
    free_workspace(&work);
    return status;
}
