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
static long filters(const rx_lab *lab)
{
    return lab->config->tune_filter.n + 1;
}

/* Numbers of iterations: none, then those of TUNE_NITER. */
static int niters(const rx_lab *lab)
{
    return lab->config->tune_niter.n + 1;
}

long rx_tuning_count(const rx_lab *lab)
{
    return niters(lab) * filters(lab) * (long)COUNT(THRESHOLDS);
}

void rx_tuning_get(const rx_lab *lab, double fwhm, long candidate, rx_tuning *dst)
{
    const long nt = (long)COUNT(THRESHOLDS), nf = filters(lab);
    const long filter = candidate / nt % nf, niter = candidate / nt / nf;
    char width[48];
    dst->niter = niter > 0 ? lab->config->tune_niter.v[niter - 1] : 0;
    dst->threshold = THRESHOLDS[candidate % nt];
    if (filter + 1 < nf) {
        dst->filter = lab->config->tune_filter.v[filter] * fwhm;
        snprintf(width, sizeof width, "filter %g FWHM", lab->config->tune_filter.v[filter]);
    } else {
        dst->filter = lab->sky[0].simulation->sharp_fwhm;
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

static int tuned_index(const rx_lab *lab, const rx_restorer *restorer)
{
    int index = 0;
    for (int m = 0; m < lab->nruns && lab->run[m].restorer != restorer; m++)
        index += lab->run[m].tuned && !lab->run[m].flat && !lab->run[m].smooth;
    return index;
}

static int is_for(const rx_lab *lab, const rx_lab_run *method, long candidate)
{
    const long nt = (long)COUNT(THRESHOLDS);
    const int plain = candidate / nt / filters(lab) == 0, cut = candidate % nt > 0;
    return method->smooth ? plain && !cut : !plain && cut == method->flat;
}

long rx_tuning_choose(const rx_lab *lab, int bin, const rx_lab_run *method, int metric,
                      const rx_unit_values *done)
{
    const long n = rx_tuning_count(lab);
    const long first = tuned_index(lab, method->restorer) * n;
    long best = -1;
    double highest = 0;
    for (long c = 0; c < n; c++) {
        if (!is_for(lab, method, c))
            continue;
        double sum = 0;
        for (long u = 0; u < lab->nunits; u++)
            if (lab->unit[u].condition == bin && lab->scene[lab->unit[u].scene].id == RX_SCENE_TUNING)
                sum += rx_lab_values(
                    lab, &done[u], RX_RESTORATION_TUNING)[RX_RESTORATION_TUNING_WIDTH * (first + c) + metric];
        if (best < 0 || sum > highest) {
            best = c;
            highest = sum;
        }
    }
    return best;
}

int rx_tuning_at_end(const rx_lab *lab, long candidate)
{
    const rx_ints *niter = &lab->config->tune_niter;
    const rx_reals *filter = &lab->config->tune_filter;
    rx_tuning tuning;
    int higher = 0, wider = 0;
    rx_tuning_get(lab, 1.0, candidate, &tuning);
    int lower = tuning.niter == 1; /* there is nothing below but 0 */
    for (int i = 0; i < niter->n; i++) {
        lower |= niter->v[i] < tuning.niter;
        higher |= niter->v[i] > tuning.niter;
    }
    if (tuning.niter > 0 && (!lower || !higher))
        return 1;
    if (tuning.threshold >= THRESHOLDS[COUNT(THRESHOLDS) - 1])
        return 1;
    if (candidate / (long)COUNT(THRESHOLDS) % filters(lab) == filter->n)
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

rx_status rx_tuning_apply(const rx_lab *lab, const rx_trial *trial, const rx_tuning *tuning,
                          const float *restored, float *plane, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    memcpy(plane, restored, n * sizeof *plane);
    rx_status status = rx_gauss_masked(lab->config->scene_side, lab->config->scene_side, tuning->filter, NULL,
                                       1, plane, err);
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
static rx_status tune_niter(const rx_lab *lab, const rx_trial *trial, long first, const float *restored,
                            float *work, double *dst, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    const long nt = (long)COUNT(THRESHOLDS), nf = filters(lab), tried = first > 0 ? nt : 1;
    float *filtered = work, *cut = work + n;
    rx_status status = RX_OK;
    for (long f = 0; status == RX_OK && f < nf; f++) {
        rx_tuning tuning;
        rx_tuning_get(lab, trial->fwhm, first + f * nt, &tuning);
        status = rx_tuning_apply(lab, trial, &tuning, restored, filtered, err);
        for (long t = 0; status == RX_OK && t < tried; t++) {
            flatten(n, t > 0 ? THRESHOLDS[t] * trial->sigma : -HUGE_VAL, filtered, cut);
            status = measure(trial, cut, &dst[2 * (first + f * nt + t)], err);
        }
    }
    return status;
}

rx_status rx_restoration_tune(const rx_lab *lab, const rx_trial *trial, rx_lab_table *dst, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    const long count = rx_tuning_count(lab), step = count / niters(lab);
    double *values = NULL;
    float *planes = RX_NEW(float, 3 * n), *restored = planes;
    rx_status status = planes == NULL
                           ? rx_error_memory(err, 3 * n * sizeof(float))
                           : rx_lab_rows_add(&dst[RX_RESTORATION_TUNING], count * lab->ntuned, &values, err);
    for (int m = 0; status == RX_OK && m < lab->nruns; m++) {
        const rx_lab_run *method = &lab->run[m];
        if (!method->tuned || method->flat || method->smooth)
            continue;
        for (int i = 0; status == RX_OK && i < niters(lab); i++) {
            if (i == 0)
                memcpy(restored, trial->image, n * sizeof *restored);
            else
                status = rx_trial_restore(lab, trial, method->restorer, lab->config->tune_niter.v[i - 1],
                                          restored, err);
            if (status == RX_OK)
                status = tune_niter(lab, trial, i * step, restored, planes + n, values, err);
        }
        values += RX_RESTORATION_TUNING_WIDTH * count;
    }
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

static rx_status picture(const rx_lab *lab, const rx_picture *what, memory *last, float *plane, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    const rx_lab_run *method = what->method;
    const rx_trial *trial = what->trial;
    rx_tuning tuning = {.niter = 0, .threshold = -1.0};
    if (method->tuned)
        rx_tuning_get(lab, trial->fwhm, rx_tuning_choose(lab, what->bin, method, what->metric, what->done),
                      &tuning);
    rx_status status = RX_OK;
    if (last->restorer != method->restorer || last->niter != tuning.niter) {
        last->restorer = NULL;
        if (method->smooth)
            memcpy(last->plane, trial->image, n * sizeof *plane);
        else
            status = rx_trial_restore(lab, trial, method->restorer, tuning.niter, last->plane, err);
    }
    if (status != RX_OK)
        return status;
    last->restorer = method->restorer;
    last->niter = tuning.niter;
    if (method->tuned)
        return rx_tuning_apply(lab, trial, &tuning, last->plane, plane, err);
    memcpy(plane, last->plane, n * sizeof *plane);
    return RX_OK;
}

rx_status rx_restoration_picture(const rx_lab *lab, const rx_picture *what, float *plane, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    memory last = {.plane = RX_NEW(float, n)};
    rx_status status =
        last.plane == NULL ? rx_error_memory(err, n * sizeof *plane) : picture(lab, what, &last, plane, err);
    free(last.plane);
    return status;
}

rx_status rx_restoration_score(const rx_lab *lab, int bin, const rx_trial *trial, const rx_unit_values *done,
                               rx_lab_table *dst, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    rx_lab_table *scene = &dst[RX_RESTORATION_SCENE];
    double *row = NULL;
    float *planes = RX_NEW(float, 2 * n);
    memory last = {.plane = planes};
    rx_status status =
        planes == NULL ? rx_error_memory(err, 2 * n * sizeof *planes) : rx_lab_rows_add(scene, 1, &row, err);
    if (status == RX_OK) {
        row[RX_SCENE_FWHM] = trial->fwhm;
        row[RX_SCENE_SIGMA] = trial->sigma;
        row[RX_SCENE_LEVEL] = trial->level;
    }
    for (int metric = 0; metric < 2; metric++)
        for (int m = 0; status == RX_OK && m < lab->nruns; m++) {
            double values[2];
            if (metric == 1 && !lab->run[m].tuned)
                continue; /* both were measured on the same picture */
            status =
                picture(lab, &(rx_picture){bin, trial, &lab->run[m], metric, done}, &last, planes + n, err);
            if (status == RX_OK)
                status = measure(trial, planes + n, values, err);
            if (status != RX_OK)
                break;
            rx_lab_each(scene, 0, m)[metric] = values[metric];
            if (!lab->run[m].tuned)
                rx_lab_each(scene, 0, m)[RX_SCORE_SSIM] = values[1];
        }
    free(planes);
    return status;
}
