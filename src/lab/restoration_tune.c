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

/* The candidates of SMOOTHED, RL and RL_FLAT. NET_FLAT's follow: the network's image with every threshold. */
static long without_network(const rx_lab *lab)
{
    return (lab->config->tune_niter.n + 1) * filters(lab) * (long)COUNT(THRESHOLDS);
}

static const rx_restorer *network_of(const rx_lab *lab)
{
    for (int m = 0; m < lab->nruns; m++)
        if (lab->run[m].network)
            return lab->run[m].restorer;
    return NULL;
}

long rx_tuning_count(const rx_lab *lab)
{
    return without_network(lab) + (network_of(lab) != NULL ? (long)COUNT(THRESHOLDS) : 0);
}

void rx_tuning_get(const rx_lab *lab, double fwhm, long candidate, rx_tuning *dst)
{
    const long nt = (long)COUNT(THRESHOLDS), nf = filters(lab);
    const long filter = candidate / nt % nf, niter = candidate / nt / nf;
    char width[48];
    *dst = (rx_tuning){.threshold = THRESHOLDS[candidate % nt]};
    if (candidate >= without_network(lab)) {
        snprintf(dst->text, sizeof dst->text, "sky below %g sigma", dst->threshold);
        return;
    }
    dst->niter = niter > 0 ? lab->config->tune_niter.v[niter - 1] : 0;
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

long rx_tuning_choose(const rx_lab *lab, int bin, const rx_lab_run *method, int metric,
                      const rx_unit_values *done)
{
    const long nt = (long)COUNT(THRESHOLDS), n = rx_tuning_count(lab);
    long best = -1;
    double highest = 0;
    for (long c = 0; c < n; c++) {
        const int plain = c<nt * filters(lab), cut = c % nt> 0;
        double sum = 0;
        if ((c >= without_network(lab)) != method->network ||
            (method->smooth ? !plain || cut : plain || cut != method->flat))
            continue;
        for (long u = 0; u < lab->nunits; u++)
            if (lab->unit[u].condition == bin && lab->scene[lab->unit[u].scene].id == RX_SCENE_TUNING)
                sum += rx_lab_values(
                    lab, &done[u],
                    RX_RESTORATION_TUNING)[RX_RESTORATION_TUNING_WIDTH * c + RX_TUNING_PSNR + metric];
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

rx_status rx_tuning_apply(const rx_lab *lab, const rx_trial *trial, const rx_tuning *tuning,
                          const float *restored, float *plane, rx_error *err)
{
    const int side = lab->config->scene_side;
    const size_t n = (size_t)side * (size_t)side;
    memcpy(plane, restored, n * sizeof *plane);
    RX_TRY(rx_gauss_masked(side, side, tuning->filter, NULL, 1, plane, err));
    for (size_t i = 0; i < n && tuning->threshold >= 0; i++)
        plane[i] = plane[i] < tuning->threshold * trial->sigma ? 0.0f : plane[i];
    return RX_OK;
}

static rx_status measure(const rx_trial *trial, const float *plane, double *dst, rx_error *err)
{
    dst[0] = rx_reference_psnr(trial->reference, plane);
    return rx_reference_ssim(trial->reference, plane, &dst[1], err);
}

/* Every candidate: filters of one number of iterations, with their thresholds where there are iterations. */
rx_status rx_restoration_tune(const rx_lab *lab, const rx_trial *trial, rx_lab_table *dst, rx_error *err)
{
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    const long nt = (long)COUNT(THRESHOLDS), nf = filters(lab);
    double *values = NULL;
    float *planes = RX_NEW(float, 3 * n);
    rx_status status = planes == NULL
                           ? rx_error_memory(err, 3 * n * sizeof(float))
                           : rx_lab_rows_add(&dst[RX_RESTORATION_TUNING], rx_tuning_count(lab), &values, err);
    for (long c = 0; status == RX_OK && c < rx_tuning_count(lab); c++) {
        float *restored = planes, *filtered = planes + n, *cut = planes + 2 * n;
        rx_tuning tuning;
        rx_tuning_get(lab, trial->fwhm, c, &tuning);
        double *row = &values[RX_RESTORATION_TUNING_WIDTH * c];
        row[RX_TUNING_NITER] = tuning.niter;
        row[RX_TUNING_FILTER] = tuning.filter;
        row[RX_TUNING_THRESHOLD] = tuning.threshold;
        row[RX_TUNING_PSNR] = row[RX_TUNING_SSIM] = NAN;
        if (c < nt * nf && c % nt > 0)
            continue;
        if (c == 0)
            memcpy(restored, trial->image, n * sizeof *restored);
        else if (c == without_network(lab))
            status = rx_trial_restore(lab, trial, network_of(lab), 0, restored, err);
        else if (c % (nt * nf) == 0)
            status = rx_trial_restore(lab, trial, rx_restorer_find("RL"), tuning.niter, restored, err);
        if (status == RX_OK && c % nt == 0) /* no threshold: the others follow on the same pixels */
            status = rx_tuning_apply(lab, trial, &tuning, restored, filtered, err);
        for (size_t k = 0; k < n && status == RX_OK; k++)
            cut[k] =
                tuning.threshold >= 0 && filtered[k] < tuning.threshold * trial->sigma ? 0.0f : filtered[k];
        if (status == RX_OK)
            status = measure(trial, cut, &row[RX_TUNING_PSNR], err);
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
