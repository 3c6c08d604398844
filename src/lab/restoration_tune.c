/* Tuning: iterations, filter and threshold per bin, in the method's own favour, on scenes that are not in the
 * test. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/restoration.h"
#include "num/convolve.h"

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

/* Below so many sigmas of the input's noise all is set to the sky; 0 = negative values only. The first one is
 * no threshold: the method without `flat`. */
static const double THRESHOLDS[] = {-1.0, 0.0, 0.25, 0.5, 1.0, 2.0};

/* Filters: those of TUNE_FILTER, and last the target PSF itself. */
static long filters(const rx_restoration *state)
{
    return state->config->tune_filter.n + 1;
}

/* Numbers of iterations: none, then those of TUNE_NITER. */
static int niters(const rx_restoration *state)
{
    return state->config->tune_niter.n + 1;
}

long rx_tuning_count(const rx_restoration *state)
{
    return niters(state) * filters(state) * (long)COUNT(THRESHOLDS);
}

void rx_tuning_get(const rx_restoration *state, double fwhm, long candidate, rx_tuning *dst)
{
    const long nt = (long)COUNT(THRESHOLDS), nf = filters(state);
    const long filter = candidate / nt % nf, niter = candidate / nt / nf;
    char width[48];
    dst->niter = niter > 0 ? state->config->tune_niter.v[niter - 1] : 0;
    dst->threshold = THRESHOLDS[candidate % nt];
    if (filter + 1 < nf) {
        dst->filter = state->config->tune_filter.v[filter] * fwhm;
        snprintf(width, sizeof width, "filter %g FWHM", state->config->tune_filter.v[filter]);
    } else {
        dst->filter = state->simulation->sharp_fwhm;
        snprintf(width, sizeof width, "filter %g pixels", dst->filter);
    }
    if (niter > 0)
        snprintf(dst->text, sizeof dst->text, "RL_NITER %d, %s", dst->niter, width);
    else
        snprintf(dst->text, sizeof dst->text, "%s", width);
    if (dst->threshold >= 0) {
        const size_t used = strlen(dst->text);
        snprintf(dst->text + used, sizeof dst->text - used, ", sky below %g sigma", dst->threshold);
    }
}

static int tuned_index(const rx_restoration *state, const rx_restorer *restorer)
{
    int index = 0;
    for (int m = 0; m < state->nmethods && state->method[m].restorer != restorer; m++)
        index += state->method[m].tuned && !state->method[m].flat && !state->method[m].smooth;
    return index;
}

static int is_for(const rx_restoration *state, const rx_method *method, long candidate)
{
    const long nt = (long)COUNT(THRESHOLDS);
    const int plain = candidate / nt / filters(state) == 0, cut = candidate % nt > 0;
    return method->smooth ? plain && !cut : !plain && cut == method->flat;
}

long rx_tuning_choose(const rx_restoration *state, int bin, const rx_method *method, int metric,
                      const rx_unit_values *done)
{
    const long n = rx_tuning_count(state);
    const long first = tuned_index(state, method->restorer) * n;
    long best = -1;
    double highest = 0;
    for (long c = 0; c < n; c++) {
        if (!is_for(state, method, c))
            continue;
        double sum = 0;
        for (long u = 0; u < state->nunits; u++)
            if (state->units[u].bin == bin && state->units[u].tune)
                sum += done[u].v[2 * (first + c) + metric];
        if (best < 0 || sum > highest) {
            best = c;
            highest = sum;
        }
    }
    return best;
}

int rx_tuning_at_end(const rx_restoration *state, long candidate)
{
    const rx_ints *niter = &state->config->tune_niter;
    const rx_reals *filter = &state->config->tune_filter;
    rx_tuning tuning;
    int higher = 0, wider = 0;
    rx_tuning_get(state, 1.0, candidate, &tuning);
    int lower = tuning.niter == 1; /* there is nothing below but 0 */
    for (int i = 0; i < niter->n; i++) {
        lower |= niter->v[i] < tuning.niter;
        higher |= niter->v[i] > tuning.niter;
    }
    if (tuning.niter > 0 && (!lower || !higher))
        return 1;
    if (tuning.threshold >= THRESHOLDS[COUNT(THRESHOLDS) - 1])
        return 1;
    if (candidate / (long)COUNT(THRESHOLDS) % filters(state) == filter->n)
        return 0; /* the target PSF */
    for (int i = 0; i < filter->n; i++)
        wider |= filter->v[i] > tuning.filter;
    return !wider;
}

/* Values below the threshold become sky. */
static void flatten(size_t n, double level, const float *src, float *dst)
{
    for (size_t i = 0; i < n; i++)
        dst[i] = src[i] < level ? 0.0f : src[i];
}

rx_status rx_tuning_apply(const rx_restoration *state, const rx_trial *trial, const rx_tuning *tuning,
                          const float *restored, float *plane, rx_error *err)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    memcpy(plane, restored, n * sizeof *plane);
    rx_status status = rx_gauss_masked(state->side, state->side, tuning->filter, NULL, 1, plane, err);
    if (status == RX_OK && tuning->threshold >= 0)
        flatten(n, tuning->threshold * trial->sigma, plane, plane);
    return status;
}

static rx_status measure(const rx_trial *trial, const float *plane, double *dst, rx_error *err)
{
    dst[0] = rx_reference_psnr(trial->reference, plane);
    return rx_reference_ssim(trial->reference, plane, &dst[1], err);
}

/* All filters of one number of iterations, with their thresholds where there are iterations. */
static rx_status tune_niter(const rx_restoration *state, const rx_trial *trial, long first,
                            const float *restored, float *work, double *dst, rx_error *err)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    const long nt = (long)COUNT(THRESHOLDS), nf = filters(state), tried = first > 0 ? nt : 1;
    float *filtered = work, *cut = work + n;
    rx_status status = RX_OK;
    for (long f = 0; status == RX_OK && f < nf; f++) {
        rx_tuning tuning;
        rx_tuning_get(state, trial->fwhm, first + f * nt, &tuning);
        status = rx_tuning_apply(state, trial, &tuning, restored, filtered, err);
        for (long t = 0; status == RX_OK && t < tried; t++) {
            flatten(n, t > 0 ? THRESHOLDS[t] * trial->sigma : -HUGE_VAL, filtered, cut);
            status = measure(trial, cut, &dst[2 * (first + f * nt + t)], err);
        }
    }
    return status;
}

rx_status rx_restoration_tune(const rx_restoration *state, const rx_trial *trial, rx_unit_values *dst,
                              rx_error *err)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    const long count = rx_tuning_count(state), step = count / niters(state);
    rx_status status = RX_OK;
    dst->n = 2 * count * state->ntuned;
    dst->v = RX_NEW(double, (size_t)dst->n + 1);
    float *planes = RX_NEW(float, 3 * n), *restored = planes;
    if (dst->v == NULL || planes == NULL) {
        status = rx_error_memory(err, 3 * n * sizeof(float));
        goto exit;
    }
    double *values = dst->v;
    for (int m = 0; m < state->nmethods; m++) {
        const rx_method *method = &state->method[m];
        if (!method->tuned || method->flat || method->smooth)
            continue;
        for (int i = 0; status == RX_OK && i < niters(state); i++) {
            if (i == 0)
                memcpy(restored, trial->image, n * sizeof *restored);
            else
                status = rx_trial_restore(state, trial, method->restorer, state->config->tune_niter.v[i - 1],
                                          restored, err);
            if (status == RX_OK)
                status = tune_niter(state, trial, i * step, restored, planes + n, values, err);
        }
        values += 2 * count;
    }
exit:
    free(planes);
    return status;
}

/* --- test scenes --- */

/* What a restorer gave for a number of iterations, kept for the next method that asks for the same. */
typedef struct memory {
    const rx_restorer *restorer;
    int niter;
    float *plane;
} memory;

static rx_status picture(const rx_restoration *state, int bin, const rx_trial *trial, const rx_method *method,
                         int metric, const rx_unit_values *done, memory *last, float *plane, rx_error *err)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    rx_tuning tuning = {.niter = 0, .threshold = -1.0};
    if (method->tuned)
        rx_tuning_get(state, trial->fwhm, rx_tuning_choose(state, bin, method, metric, done), &tuning);
    rx_status status = RX_OK;
    if (last->restorer != method->restorer || last->niter != tuning.niter) {
        last->restorer = NULL;
        if (method->smooth)
            memcpy(last->plane, trial->image, n * sizeof *plane);
        else
            status = rx_trial_restore(state, trial, method->restorer, tuning.niter, last->plane, err);
    }
    if (status != RX_OK)
        return status;
    last->restorer = method->restorer;
    last->niter = tuning.niter;
    if (method->tuned)
        return rx_tuning_apply(state, trial, &tuning, last->plane, plane, err);
    memcpy(plane, last->plane, n * sizeof *plane);
    return RX_OK;
}

rx_status rx_restoration_picture(const rx_restoration *state, int bin, const rx_trial *trial,
                                 const rx_method *method, int metric, const rx_unit_values *done,
                                 float *plane, rx_error *err)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    memory last = {.plane = RX_NEW(float, n)};
    rx_status status = last.plane == NULL
                           ? rx_error_memory(err, n * sizeof *plane)
                           : picture(state, bin, trial, method, metric, done, &last, plane, err);
    free(last.plane);
    return status;
}

rx_status rx_restoration_score(const rx_restoration *state, int bin, const rx_trial *trial,
                               const rx_unit_values *done, rx_unit_values *dst, rx_error *err)
{
    const size_t n = (size_t)state->side * (size_t)state->side;
    rx_status status = RX_OK;
    dst->n = 3 + 2 * state->nmethods;
    dst->v = RX_NEW(double, (size_t)dst->n);
    float *planes = RX_NEW(float, 2 * n);
    memory last = {.plane = planes};
    if (dst->v == NULL || planes == NULL) {
        status = rx_error_memory(err, 2 * n * sizeof *planes);
        goto exit;
    }
    dst->v[0] = trial->fwhm;
    dst->v[1] = trial->sigma;
    dst->v[2] = trial->level;
    for (int metric = 0; status == RX_OK && metric < 2; metric++) {
        for (int m = 0; status == RX_OK && m < state->nmethods; m++) {
            double values[2];
            if (metric == 1 && !state->method[m].tuned)
                continue; /* both were measured on the same picture */
            status = picture(state, bin, trial, &state->method[m], metric, done, &last, planes + n, err);
            if (status == RX_OK)
                status = measure(trial, planes + n, values, err);
            if (status != RX_OK)
                break;
            dst->v[3 + 2 * m + metric] = values[metric];
            if (!state->method[m].tuned)
                dst->v[4 + 2 * m] = values[1];
        }
    }
exit:
    free(planes);
    return status;
}
