/* sep_extract() on packed groups. */
#include "detect/sep_extract.h"

#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/sources.h"
#include "data/unit.h"
#include "detect/batches.h"
#include "detect/cutouts.h"
#include "detect/libsep.h"

/* Status values of sep_extract(), which sep.h does not name (sepcore.h of sep 1.2.1). */
enum { SEP_STATUS_MEMORY = 1, SEP_STATUS_DEBLEND = 7 };

enum {
    STACK_SPARE = 16,      /* sep gives up with one free pixel left */
    SMALL_STACK = 1 << 12, /* pixels of a batch: sep clears all of its stack at each call */
    USUAL_STACK = 1 << 16
};

/* What one call of sep found. */
typedef struct part {
    int n;
    rx_detection *list;
    int *pixels;
    int failed; /* status of sep; SEP_STATUS_MEMORY of our own memory, too */
} part;

/* The limits of one run and how far they may go. */
typedef struct limits {
    int subobjects, subobjects_max, levels;
} limits;

/* sep multiplies levels * limit * children as int, with at most `limit` children. */
static int safe_subobjects(int wanted, int levels)
{
    int safe = (int)sqrt(2147483647.0 / levels) - 32;
    if (safe > 32000) /* sep numbers sub-objects with shorts */
        safe = 32000;
    return wanted < safe ? wanted : safe;
}

/* Make room after sep gave up with `failed`; false when nothing is left to try. Beyond the limits the
 * deblending gets coarser, which is flagged. */
static bool loosen(int failed, rx_extraction *job, limits *limit)
{
    job->grown++;
    bool room = limit->subobjects < limit->subobjects_max &&
                safe_subobjects(limit->subobjects, limit->levels) == limit->subobjects;
    if (failed == SEP_STATUS_DEBLEND && room) {
        int doubled = 2 * limit->subobjects;
        limit->subobjects = doubled < limit->subobjects_max ? doubled : limit->subobjects_max;
        return true;
    }
    if (limit->levels > 1 && failed == SEP_STATUS_DEBLEND) {
        job->flags |= RX_FLAG_DEBLEND_OVER;
        limit->levels /= 2;
        return true;
    }
    return false;
}

/* Row i of sep's catalogue, its places still those of the image that sep saw. */
static rx_detection detection_of(const sep_catalog *cat, int i, double unit)
{
    return (rx_detection){.npix = cat->npix[i],
                          .xmin = cat->xmin[i],
                          .xmax = cat->xmax[i],
                          .ymin = cat->ymin[i],
                          .ymax = cat->ymax[i],
                          .xpeak = cat->xcpeak[i],
                          .ypeak = cat->ycpeak[i],
                          .x = cat->x[i],
                          .y = cat->y[i],
                          .x2 = cat->x2[i],
                          .y2 = cat->y2[i],
                          .xy = cat->xy[i],
                          .errx2 = cat->errx2[i],
                          .erry2 = cat->erry2[i],
                          .errxy = cat->errxy[i],
                          .threshold = (float)(cat->thresh[i] * unit),
                          .a = cat->a[i],
                          .b = cat->b[i],
                          .theta = cat->theta[i],
                          .cxx = cat->cxx[i],
                          .cyy = cat->cyy[i],
                          .cxy = cat->cxy[i],
                          .filtered_flux = (float)(cat->cflux[i] * unit),
                          .flags = ((cat->flag[i] & SEP_OBJ_MERGED) != 0 ? RX_FLAG_MERGED : 0) |
                                   ((cat->flag[i] & SEP_OBJ_TRUNC) != 0 ? RX_FLAG_TRUNCATED : 0) |
                                   ((cat->flag[i] & SEP_OBJ_DOVERFLOW) != 0 ? RX_FLAG_DEBLEND_OVER : 0),
                          .singular = (cat->flag[i] & SEP_OBJ_SINGU) != 0};
}

static void move(rx_detection *d, int dx, int dy)
{
    d->xmin += dx;
    d->xmax += dx;
    d->xpeak += dx;
    d->x += dx;
    d->ymin += dy;
    d->ymax += dy;
    d->ypeak += dy;
    d->y += dy;
}

/* What the pixels before the filter say, the lowest threshold among them, and whether they end at a border.
 */
static void look_at_pixels(const rx_extraction *job, bool fenced, rx_detection *d)
{
    const rx_threshold *image = &job->image;
    const rx_span *span = NULL;
    double flux = 0.0;
    float peak = -HUGE_VALF, lowest = HUGE_VALF;
    for (int k = 0; k < d->npix; k++) {
        const int at = d->pixels[k];
        const float value = job->pixels[at];
        float own = image->limit;
        flux += value;
        peak = value > peak ? value : peak;
        if (image->relative) {
            const int x = at % image->width, y = at / image->width;
            if ((span = rx_groups_span(job->groups, d->group, span, x, y)) == NULL)
                continue;
            own *= rx_span_sigma(span, x);
        }
        lowest = own < lowest ? own : lowest;
        d->npix_raw += value > own;
    }
    d->flux = (float)flux;
    d->peak = peak;
    if (image->relative || fenced)
        d->threshold = lowest;
    const bool high = d->xmax == image->width - 1 || d->ymax == image->height - 1;
    const bool whole =
        (d->flags & RX_FLAG_MERGED) == 0; /* of blends sep flags what is cut at its own level */
    if ((whole && (high || d->xmin == 0 || d->ymin == 0)) || (high && image->relative))
        d->flags |= RX_FLAG_TRUNCATED;
}

/* sep's catalogue on the tile. */
static bool take(const rx_extraction *job, const rx_cutouts *cutouts, const sep_catalog *cat, part *dst)
{
    size_t npixels = 0, used = 0;
    for (int i = 0; i < cat->nobj; i++)
        npixels += (size_t)cat->npix[i];
    dst->list = RX_NEW(rx_detection, (size_t)cat->nobj);
    dst->pixels = RX_NEW(int, npixels);
    if (dst->list == NULL || dst->pixels == NULL)
        return false;
    dst->n = cat->nobj;
    for (int i = 0; i < cat->nobj; i++) {
        rx_detection *d = &dst->list[i];
        *d = detection_of(cat, i, rx_unit_of(job->noise_value));
        const rx_cutout *cut = rx_cutouts_at(cutouts, d->xmin, d->ymin);
        const int dx = job->groups->list[cut->group].xmin - cut->x;
        const int dy = job->groups->list[cut->group].ymin - cut->y;
        d->group = cut->group;
        move(d, dx, dy);
        for (int k = 0; k < d->npix; k++) {
            const int at = cat->pix[i][k];
            dst->pixels[used + (size_t)k] =
                (at / cutouts->width + dy) * job->image.width + at % cutouts->width + dx;
        }
        d->pixels = dst->pixels + used;
        used += (size_t)d->npix;
        look_at_pixels(job, cutouts->ring > 1, d);
    }
    return true;
}

/* One call of sep. */
static void extract(const rx_detect_params *par, const rx_extraction *job, const rx_cutouts *cutouts,
                    int levels, part *dst)
{
    const bool filters = cutouts->ring > 1;
    const double unit = rx_unit_of(job->noise_value); /* sep squares pixels and noise in single precision */
    const size_t n = (size_t)cutouts->width * (size_t)cutouts->height;
    sep_catalog *cat = NULL;
    if (unit != 1.0) {
        rx_unit_divide(cutouts->pixels, n, unit);
        rx_unit_divide(cutouts->noise, n, unit);
    }
    sep_image image = {.data = cutouts->pixels,
                       .noise = cutouts->noise,
                       .dtype = SEP_TFLOAT,
                       .ndtype = SEP_TFLOAT,
                       .w = cutouts->width,
                       .h = cutouts->height,
                       .noiseval = job->noise_value / unit,
                       .noise_type = SEP_NOISE_STDDEV,
                       .gain = job->gain * unit};
    dst->failed =
        sep_extract(&image, (float)(job->threshold / (par->absolute ? unit : 1.0)),
                    par->absolute ? SEP_THRESH_ABS : SEP_THRESH_REL, par->min_area,
                    filters ? job->kernel->values : NULL, job->kernel->width, job->kernel->height,
                    SEP_FILTER_CONV, levels, levels > 1 ? par->deblend_contrast : 1.0, 0, 1.0, &cat);
    if (dst->failed == 0 && !take(job, cutouts, cat, dst))
        dst->failed = SEP_STATUS_MEMORY;
    sep_catalog_free(cat);
}

/* Does sep filter this blend itself? Not with absolute thresholds, which know no noise to keep others out by,
 * and not at the right and the upper border, where sep would read noise beyond it: such a blend stands alone
 * in its batch, and has its shapes from the filtered pixels. */
static bool asks_for_filter(const rx_detect_params *par, const rx_extraction *job, int group)
{
    const rx_group *g = &job->groups->list[group];
    const bool high = g->xmax == job->image.width - 1 || g->ymax == job->image.height - 1;
    return !par->absolute && job->kernel->width * job->kernel->height > 1 && (job->image.relative || !high);
}

static void extract_batch(const rx_detect_params *par, const rx_extraction *job, const rx_batches *batches,
                          int which, int levels, part *dst)
{
    const rx_batch *batch = &batches->list[which];
    rx_cutouts cutouts = {0};
    const rx_unfiltered unfiltered = {job->pixels, job->kernel, job->threshold, (float)job->noise_value};
    const bool filters = batch->blended && asks_for_filter(par, job, batches->members[batch->first]);
    *dst = (part){0};
    if (rx_cutouts_make(&job->image, job->groups, filters ? &unfiltered : NULL,
                        batches->members + batch->first, batch->n, &cutouts, NULL) == RX_OK)
        extract(par, job, &cutouts, batch->blended ? levels : 1, dst);
    else
        dst->failed = SEP_STATUS_MEMORY;
    rx_cutouts_free(&cutouts);
}

static void free_parts(part *parts, int n)
{
    for (int i = 0; i < n; i++) {
        free(parts[i].list);
        free(parts[i].pixels);
        parts[i] = (part){0};
    }
}

/* Batches with more than `above` pixels, `limit` at most: all that are at work at a time have the same stack.
 */
static void extract_size(const rx_detect_params *par, const rx_extraction *job, const rx_batches *batches,
                         int levels, long above, long limit, part *parts)
{
    long stack = 0;
    for (int i = 0; i < batches->n; i++) {
        const long pixels = batches->list[i].pixels;
        stack = pixels > stack && pixels <= limit ? pixels : stack;
    }
    if (stack <= above)
        return;
    sep_set_extract_pixstack((size_t)stack + STACK_SPARE);
#pragma omp parallel for schedule(dynamic, 1) num_threads(par->nthreads > 0 ? par->nthreads : 1)
    for (int i = 0; i < batches->n; i++)
        if (batches->list[i].pixels > above && batches->list[i].pixels <= limit)
            extract_batch(par, job, batches, i, levels, &parts[i]);
}

/* All batches; the status of the first that failed. */
static int extract_batches(const rx_detect_params *par, const rx_extraction *job, const rx_batches *batches,
                           int levels, part *parts)
{
    int failed = 0;
    extract_size(par, job, batches, levels, USUAL_STACK, LONG_MAX, parts);
    extract_size(par, job, batches, levels, SMALL_STACK, USUAL_STACK, parts);
    extract_size(par, job, batches, levels, 0, SMALL_STACK, parts);
    for (int i = 0; i < batches->n && failed == 0; i++)
        failed = parts[i].failed;
    if (failed != 0)
        free_parts(parts, batches->n);
    return failed;
}

/* Call sep until it succeeds or nothing is left to try; its status. sep's two limits belong to the whole
 * process, so only one extraction at a time may set and use them. */
static int extract_alone(const rx_detect_params *par, rx_extraction *job, const rx_batches *batches,
                         limits *limit, part *parts)
{
    int failed = 0;
#pragma omp critical(rx_sep_extract)
    {
        size_t old_stack = sep_get_extract_pixstack();
        int old_subobjects = sep_get_sub_object_limit();
        do {
            sep_set_sub_object_limit(safe_subobjects(limit->subobjects, limit->levels));
            failed = extract_batches(par, job, batches, limit->levels, parts);
        } while (failed != 0 && loosen(failed, job, limit));
        sep_set_extract_pixstack(old_stack);
        sep_set_sub_object_limit(old_subobjects);
    }
    return failed;
}

/* The parts' detections by group; those of one group are together in one part. */
static rx_status join(part *parts, int nparts, int ngroups, rx_detections *dst, rx_error *err)
{
    int *next = RX_NEW(int, (size_t)ngroups + 1);
    for (int i = 0; i < nparts; i++)
        dst->n += parts[i].n;
    dst->list = RX_NEW(rx_detection, (size_t)dst->n);
    dst->blocks = RX_NEW(int *, (size_t)nparts);
    if (next == NULL || dst->list == NULL || dst->blocks == NULL) {
        free(next);
        return rx_error_memory(err, (size_t)dst->n * sizeof *dst->list);
    }
    for (int i = 0; i < nparts; i++)
        for (int k = 0; k < parts[i].n; k++)
            next[parts[i].list[k].group + 1]++;
    for (int g = 0; g < ngroups; g++)
        next[g + 1] += next[g];
    for (int i = 0; i < nparts; i++) {
        for (int k = 0; k < parts[i].n; k++)
            dst->list[next[parts[i].list[k].group]++] = parts[i].list[k];
        dst->blocks[dst->nblocks++] = parts[i].pixels;
        parts[i].pixels = NULL;
    }
    free(next);
    return RX_OK;
}

rx_status rx_extract_run(const rx_detect_params *par, rx_extraction *job, rx_log *log, rx_detections *dst,
                         rx_error *err)
{
    limits limit = {.subobjects = par->subobjects > 0 ? par->subobjects : 1024,
                    .levels = par->deblend_levels > 1 ? par->deblend_levels : 1};
    limit.subobjects_max = par->subobjects_max > limit.subobjects ? par->subobjects_max : limit.subobjects;
    rx_batches batches = {0};
    part *parts = NULL;
    int failed;
    rx_status status = RX_OK;
    *dst = (rx_detections){0};
    RX_TRY_EXIT(rx_batches_make(par, &job->image, job->groups, &batches, err));
    RX_TRY_EXIT(RX_MAKE(parts, (size_t)batches.n, err));
    failed = extract_alone(par, job, &batches, &limit, parts);
    if (failed == SEP_STATUS_MEMORY)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (failed != 0) {
        char text[61] = "";
        sep_get_errmsg(failed, text);
        status = rx_error_set(err, RX_SYSTEM, "detection: %s; raise DETECT_THRESH or cut the tile", text);
        goto exit;
    }
    if ((job->flags & RX_FLAG_DEBLEND_OVER) != 0)
        rx_log_warning(log,
                       "too many sub-objects: deblended with %d instead of %d levels, all sources flagged",
                       limit.levels, par->deblend_levels);
    status = join(parts, batches.n, job->groups->n, dst, err);
exit:
    if (parts != NULL)
        free_parts(parts, batches.n);
    free(parts);
    rx_batches_free(&batches);
    return status;
}

void rx_detections_drop_pixels(rx_detections *detections)
{
    for (int i = 0; i < detections->nblocks; i++)
        free(detections->blocks[i]);
    free(detections->blocks);
    detections->blocks = NULL;
    detections->nblocks = 0;
    for (int i = 0; detections->list != NULL && i < detections->n; i++)
        detections->list[i].pixels = NULL;
}

void rx_detections_free(rx_detections *detections)
{
    rx_detections_drop_pixels(detections);
    free(detections->list);
    *detections = (rx_detections){0};
}

const char *rx_sep_library(void)
{
    return sep_version_string;
}
