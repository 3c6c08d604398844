/* sep_extract() with limits that grow by themselves. */
#include "detect/sep_extract.h"

#include <math.h>
#include <stdbool.h>

/* Status values of sep_extract(), which sep.h does not name (sepcore.h of sep 1.2.1). */
enum { SEP_STATUS_MEMORY = 1, SEP_STATUS_STACK = 2, SEP_STATUS_DEBLEND = 7 };

enum {
    STACK_FLOOR = 300000, /* sep's default: a smaller stack saves nothing */
    STACK_SPARE = 16      /* sep gives up with one free pixel left */
};

/* sep multiplies levels * limit * children as int, with at most `limit` children. */
static int safe_subobjects(int wanted, int levels)
{
    int safe = (int)sqrt(2147483647.0 / levels) - 32;
    if (safe > 32000) /* sep numbers sub-objects with shorts */
        safe = 32000;
    return wanted < safe ? wanted : safe;
}

static int call_sep(const rx_detect_params *par, const rx_extraction *job, int levels, sep_catalog **dst)
{
    sep_image image = {.data = job->pixels,
                       .noise = job->noise,
                       .mask = job->hidden,
                       .dtype = SEP_TFLOAT,
                       .ndtype = SEP_TFLOAT,
                       .mdtype = SEP_TBYTE,
                       .w = job->width,
                       .h = job->height,
                       .noiseval = job->noise_value,
                       .noise_type = SEP_NOISE_STDDEV,
                       .gain = job->gain};
    return sep_extract(&image, (float)(job->threshold * job->raised),
                       par->absolute ? SEP_THRESH_ABS : SEP_THRESH_REL, par->min_area, job->kernel->values,
                       job->kernel->width, job->kernel->height,
                       par->matched ? SEP_FILTER_MATCHED : SEP_FILTER_CONV, levels,
                       levels > 1 ? par->deblend_contrast : 1.0, 0, 1.0, dst);
}

/* Room for the pixels above the threshold; false when that is more than allowed. */
static bool fit_stack(const rx_detect_params *par, rx_extraction *job, size_t *stack)
{
    size_t allowed = (size_t)(par->pixstack_max > par->pixstack ? par->pixstack_max : par->pixstack);
    size_t floor = par->pixstack > 0 ? (size_t)par->pixstack : STACK_FLOOR;
    size_t needed = (size_t)job->above + STACK_SPARE;
    *stack = needed > floor ? needed : floor;
    job->grown += needed > floor;
    if (*stack <= allowed)
        return true;
    *stack = allowed;
    return false;
}

rx_status rx_extract_run(const rx_detect_params *par, rx_extraction *job, rx_log *log, sep_catalog **dst,
                         rx_error *err)
{
    size_t old_stack = sep_get_extract_pixstack();
    int old_subobjects = sep_get_sub_object_limit();
    int levels = par->deblend_levels > 1 ? par->deblend_levels : 1;
    int subobjects = par->subobjects > 0 ? par->subobjects : 1024;
    int subobjects_max = par->subobjects_max > subobjects ? par->subobjects_max : subobjects;
    size_t stack;
    rx_status status = RX_OK;
    *dst = NULL;
    job->raised = 1.0;
    bool fits = fit_stack(par, job, &stack);
    sep_set_extract_pixstack(stack);
    for (;;) {
        sep_set_sub_object_limit(safe_subobjects(subobjects, levels));
        int failed = call_sep(par, job, levels, dst);
        if (failed == 0)
            break;
        job->grown++;
        if (failed == SEP_STATUS_STACK && !fits) {
            job->flags |= RX_FLAG_EXTRACT_OVER;
            job->raised *= 1.25;
        } else if (failed == SEP_STATUS_STACK) {
            stack *= 2;
            sep_set_extract_pixstack(stack);
            fits = stack < (size_t)job->width * (size_t)job->height;
        } else if (failed == SEP_STATUS_DEBLEND && subobjects < subobjects_max &&
                   safe_subobjects(subobjects, levels) == subobjects) {
            subobjects = 2 * subobjects < subobjects_max ? 2 * subobjects : subobjects_max;
        } else if (levels > 1 && (failed == SEP_STATUS_DEBLEND || failed == SEP_STATUS_MEMORY)) {
            job->flags |= RX_FLAG_DEBLEND_OVER;
            levels = failed == SEP_STATUS_MEMORY ? 1 : levels / 2;
        } else {
            char text[61] = "";
            sep_get_errmsg(failed, text);
            status = rx_error_set(err, RX_SYSTEM, "detection: %s; raise DETECT_THRESH or cut the tile", text);
            break;
        }
    }
    sep_set_extract_pixstack(old_stack);
    sep_set_sub_object_limit(old_subobjects);
    if (status == RX_OK && (job->flags & RX_FLAG_EXTRACT_OVER) != 0)
        rx_log_warning(log,
                       "more than %zu pixels above the threshold: threshold raised by %.2f, all sources "
                       "flagged; raise MEMORY_PIXSTACK_MAX or DETECT_THRESH",
                       stack, job->raised);
    if (status == RX_OK && (job->flags & RX_FLAG_DEBLEND_OVER) != 0)
        rx_log_warning(log,
                       "too many sub-objects: deblended with %d instead of %d levels, all sources flagged",
                       levels, par->deblend_levels);
    return status;
}
