/* sep_extract() with limits that grow by themselves. */
#include "detect/sep_extract.h"

#include <math.h>
#include <stdbool.h>

#include "detect/noise_planes.h"

/* Status values of sep_extract(), which sep.h does not name (sepcore.h of sep 1.2.1). */
enum { SEP_STATUS_MEMORY = 1, SEP_STATUS_STACK = 2, SEP_STATUS_DEBLEND = 7 };

enum {
    STACK_FLOOR = 300000,         /* sep's default: a smaller stack saves nothing */
    STACK_SPARE = 16,             /* sep gives up with one free pixel left */
    STACK_LIMIT = 2147483647 / 32 /* sep counts the bytes as int, 28 for a pixel */
};

/* sep multiplies levels * limit * children as int, with at most `limit` children. */
static int safe_subobjects(int wanted, int levels)
{
    int safe = (int)sqrt(2147483647.0 / levels) - 32;
    if (safe > 32000) /* sep numbers sub-objects with shorts */
        safe = 32000;
    return wanted < safe ? wanted : safe;
}

static int call_sep(const rx_detect_params *par, const rx_extraction *job, const rx_noise_planes *planes,
                    int levels, sep_catalog **dst)
{
    bool own = planes->noise != NULL; /* in which hidden pixels are settled */
    sep_image image = {.data = own ? planes->pixels : job->pixels,
                       .noise = own ? planes->noise : job->noise,
                       .mask = own ? NULL : job->hidden,
                       .dtype = SEP_TFLOAT,
                       .ndtype = SEP_TFLOAT,
                       .mdtype = SEP_TBYTE,
                       .w = own ? planes->width : job->width,
                       .h = own ? planes->height : job->height,
                       .noiseval = job->noise_value,
                       .noise_type = SEP_NOISE_STDDEV,
                       .gain = job->gain};
    return sep_extract(&image, (float)(job->threshold * job->raised),
                       par->absolute ? SEP_THRESH_ABS : SEP_THRESH_REL, par->min_area, job->kernel->values,
                       job->kernel->width, job->kernel->height,
                       par->matched ? SEP_FILTER_MATCHED : SEP_FILTER_CONV, levels,
                       levels > 1 ? par->deblend_contrast : 1.0, 0, 1.0, dst);
}

/* Room for the pixels above the threshold, for all of the tile at most; false when that is more than
 * allowed. */
static bool fit_stack(const rx_detect_params *par, rx_extraction *job, size_t *stack)
{
    size_t allowed = (size_t)(par->pixstack_max > par->pixstack ? par->pixstack_max : par->pixstack);
    size_t whole = (size_t)job->width * (size_t)job->height + STACK_SPARE;
    size_t floor = par->pixstack > 0 ? (size_t)par->pixstack : STACK_FLOOR;
    size_t needed = (size_t)job->above + STACK_SPARE;
    allowed = allowed < STACK_LIMIT ? allowed : STACK_LIMIT;
    *stack = needed > floor ? needed : floor;
    *stack = *stack < whole ? *stack : whole;
    job->grown += needed > floor;
    if (*stack <= allowed)
        return true;
    *stack = allowed;
    return needed <= allowed;
}

/* The limits of one run and how far they may go. */
typedef struct limits {
    size_t stack;
    bool stack_fits; /* every pixel above the threshold has room */
    int subobjects, subobjects_max, levels;
} limits;

/* Make room after sep gave up with `failed`; false when nothing is left to try. Beyond the limits the
 * threshold rises or the deblending gets coarser, which is flagged. */
static bool loosen(int failed, rx_extraction *job, limits *limit)
{
    job->grown++;
    if (failed == SEP_STATUS_STACK && !limit->stack_fits) {
        job->flags |= RX_FLAG_EXTRACT_OVER;
        job->raised *= 1.25;
        return true;
    }
    if (failed == SEP_STATUS_STACK) {
        limit->stack = 2 * limit->stack < STACK_LIMIT ? 2 * limit->stack : STACK_LIMIT;
        limit->stack_fits = limit->stack < (size_t)job->width * (size_t)job->height;
        return true;
    }
    bool room = limit->subobjects < limit->subobjects_max &&
                safe_subobjects(limit->subobjects, limit->levels) == limit->subobjects;
    if (failed == SEP_STATUS_DEBLEND && room) {
        int doubled = 2 * limit->subobjects;
        limit->subobjects = doubled < limit->subobjects_max ? doubled : limit->subobjects_max;
        return true;
    }
    if (limit->levels > 1 && (failed == SEP_STATUS_DEBLEND || failed == SEP_STATUS_MEMORY)) {
        job->flags |= RX_FLAG_DEBLEND_OVER;
        limit->levels = failed == SEP_STATUS_MEMORY ? 1 : limit->levels / 2;
        return true;
    }
    return false;
}

static void warn(const rx_detect_params *par, const rx_extraction *job, const limits *limit, rx_log *log)
{
    if ((job->flags & RX_FLAG_EXTRACT_OVER) != 0)
        rx_log_warning(log,
                       "more than %zu pixels above the threshold: threshold raised by %.2f, all sources "
                       "flagged; raise MEMORY_PIXSTACK_MAX or DETECT_THRESH",
                       limit->stack, job->raised);
    if ((job->flags & RX_FLAG_DEBLEND_OVER) != 0)
        rx_log_warning(log,
                       "too many sub-objects: deblended with %d instead of %d levels, all sources flagged",
                       limit->levels, par->deblend_levels);
}

/* Call sep until it succeeds or nothing is left to try; its status. sep's two limits belong to the whole
 * process, so only one extraction at a time may set and use them. */
static int extract_alone(const rx_detect_params *par, rx_extraction *job, const rx_noise_planes *planes,
                         limits *limit, sep_catalog **dst)
{
    int failed = 0;
#pragma omp critical(rx_sep_extract)
    {
        size_t old_stack = sep_get_extract_pixstack();
        int old_subobjects = sep_get_sub_object_limit();
        do {
            sep_set_extract_pixstack(limit->stack);
            sep_set_sub_object_limit(safe_subobjects(limit->subobjects, limit->levels));
            failed = call_sep(par, job, planes, limit->levels, dst);
        } while (failed != 0 && loosen(failed, job, limit));
        sep_set_extract_pixstack(old_stack);
        sep_set_sub_object_limit(old_subobjects);
    }
    return failed;
}

rx_status rx_extract_run(const rx_detect_params *par, rx_extraction *job, rx_log *log, sep_catalog **dst,
                         rx_error *err)
{
    limits limit = {.subobjects = par->subobjects > 0 ? par->subobjects : 1024,
                    .levels = par->deblend_levels > 1 ? par->deblend_levels : 1};
    limit.subobjects_max = par->subobjects_max > limit.subobjects ? par->subobjects_max : limit.subobjects;
    limit.stack_fits = fit_stack(par, job, &limit.stack);
    rx_noise_planes planes = {0};
    rx_status status = RX_OK;
    *dst = NULL;
    job->raised = 1.0;
    if (job->noise != NULL && !par->absolute && !par->matched) /* the matched filter needs the true noise */
        status = rx_noise_planes_make(job->pixels, job->noise, job->width, job->height, job->kernel,
                                      job->threshold, job->groups, &planes, err);
    if (status != RX_OK)
        goto exit;
    int failed = extract_alone(par, job, &planes, &limit, dst);
    if (failed == 0) {
        warn(par, job, &limit, log);
        if (planes.noise != NULL)
            rx_noise_planes_restore(&planes, job->noise, job->threshold * job->raised, *dst);
    } else {
        char text[61] = "";
        sep_get_errmsg(failed, text);
        status = rx_error_set(err, RX_SYSTEM, "detection: %s; raise DETECT_THRESH or cut the tile", text);
    }
exit:
    rx_noise_planes_free(&planes);
    return status;
}
