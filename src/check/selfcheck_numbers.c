/* Completeness and bias from injected objects and new detections. */
#include "check/selfcheck_numbers.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "measure/view.h"
#include "quality/evaluate.h"
#include "quality/metrics.h"

static const double LEVEL = 0.95;
static const double CLEAR = 1.5; /* S/N 20 is so many magnitudes brighter than the limit at S/N 5 */

rx_status rx_selfcheck_grow(rx_qa_list *list, rx_selfcheck_found **measured, long n, rx_error *err)
{
    double **columns[] = {&list->x,    &list->y,          &list->mag,  &list->mag_error,
                          &list->flux, &list->flux_error, &list->score};
    const size_t used = measured != NULL ? 7 : 6;
    for (size_t i = 0; i < used; i++) {
        double *grown = rx_regrow(*columns[i], (size_t)n, sizeof(double));
        if (grown == NULL)
            return rx_error_memory(err, (size_t)n * sizeof(double));
        *columns[i] = grown;
    }
    if (measured != NULL) {
        int *flags = rx_regrow(list->flags, (size_t)n, sizeof(int));
        if (flags != NULL)
            list->flags = flags;
        rx_selfcheck_found *grown = rx_regrow(*measured, (size_t)n, sizeof *grown);
        if (grown != NULL)
            *measured = grown;
        if (flags == NULL || grown == NULL)
            return rx_error_memory(err, (size_t)n * sizeof *grown);
    }
    list->n = n;
    return RX_OK;
}

void rx_selfcheck_input(const rx_selfcheck_plan *plan, const rx_selfcheck *check, const char *name,
                        rx_qa_input *input, rx_qa_run *run)
{
    *run = (rx_qa_run){.name = name, .list = check->found_list, .law_scale = 1.0, .law_power = 0.5};
    *input = (rx_qa_input){.tile = plan->field->tile->name,
                           .reference = "objects injected into the tile itself",
                           .width = check->width,
                           .height = check->height,
                           .pixel_scale = plan->pixel_scale,
                           .score_name = "peak S/N of the filtered detection image",
                           .truth = check->truth,
                           .nruns = 1,
                           .runs = run};
}

rx_qa_params rx_selfcheck_qa(const rx_selfcheck_plan *plan)
{
    return (rx_qa_params){.match_radius = plan->match_radius,
                          .mag_low = plan->mag_low,
                          .mag_high = plan->mag_high,
                          .mag_step = plan->mag_step,
                          .figures = plan->par->figures,
                          .by = {plan->params.seed, plan->params.nthreads}};
}

/* Does a source of the untouched tile, a masked pixel or the border reach into the wide aperture? */
static int crowded(const rx_selfcheck_plan *plan, double x, double y)
{
    const rx_tile *tile = plan->field->tile;
    const double radius = 0.5 * plan->diameter + 0.5;
    int x0 = (int)floor(x - radius), x1 = (int)ceil(x + radius);
    int y0 = (int)floor(y - radius), y1 = (int)ceil(y + radius);
    if (x0 < 0 || y0 < 0 || x1 >= tile->width || y1 >= tile->height)
        return 1;
    for (int j = y0; j <= y1; j++) {
        for (int i = x0; i <= x1; i++) {
            size_t p = (size_t)j * (size_t)tile->width + (size_t)i;
            if ((plan->segments[p] != 0 || tile->mask[p] != 0) && hypot(i - x, j - y) <= radius)
                return 1;
        }
    }
    return 0;
}

typedef struct deviations {
    long ntotal, nwide;
    double *total; /* QA_MAG of all unflagged ones, mag */
    /* bright isolated ones: wide aperture as measured and less what it would hold without them, mag; that,
     * ADU per pixel */
    double *wide, *gained, *sky;
} deviations;

static rx_status find_deviations(const rx_selfcheck_plan *plan, const rx_selfcheck *check,
                                 const rx_evaluation *e, deviations *dst, rx_error *err)
{
    const double area = acos(-1.0) * 0.25 * plan->diameter * plan->diameter;
    const rx_qa_list *list = &check->found_list, *truth = &check->truth;
    const size_t side = check->psf != NULL ? (size_t)check->psf->size : 0;
    float *stamp;
    RX_TRY(RX_MAKE(stamp, side * side, err));
    for (long j = 0; j < list->n; j++) {
        long i = e->origin[j];
        if (i < 0 || list->flags[j] != 0)
            continue;
        if (isfinite(e->dmag[j]))
            dst->total[dst->ntotal++] = e->dmag[j];
        double x = fmod(truth->x[i] + 1.0, check->pitch) - 1.0, y = truth->y[i];
        const double wide = check->measured[j].wide, empty = check->measured[j].empty;
        double light = check->measured[j].light;
        if (truth->mag[i] > plan->limit - CLEAR || !(wide > 0.0) || !(wide > empty) || crowded(plan, x, y))
            continue;
        if (check->psf != NULL && check->is_galaxy[i])
            continue; /* how much of it the aperture holds is not known */
        if (check->psf != NULL)
            light = truth->flux[i] * rx_selfcheck_enclosed(check->psf, x, y, plan->diameter, stamp);
        if (!(light > 0.0))
            continue;
        dst->wide[dst->nwide] = -2.5 * log10(wide / light);
        dst->gained[dst->nwide] = -2.5 * log10((wide - empty) / light);
        dst->sky[dst->nwide++] = empty / area;
    }
    free(stamp);
    return RX_OK;
}

static rx_status biases(const rx_selfcheck_plan *plan, const rx_evaluation *e, rx_selfcheck *check,
                        rx_error *err)
{
    size_t n = (size_t)check->found_list.n;
    rx_estimate unused;
    double *values;
    RX_TRY(RX_MAKE(values, 4 * n, err));
    deviations found = {.total = values, .wide = values + n, .gained = values + 2 * n, .sky = values + 3 * n};
    rx_status status = find_deviations(plan, check, e, &found, err);
    rx_robust_estimates(found.total, found.ntotal, LEVEL, &check->bias, &check->scatter);
    rx_robust_estimates(found.wide, found.nwide, LEVEL, &check->wide_bias, &unused);
    rx_robust_estimates(found.gained, found.nwide, LEVEL, &check->aperture_bias, &unused);
    rx_robust_estimates(found.sky, found.nwide, LEVEL, &check->sky, &unused);
    free(values);
    return status;
}

/* MAGERR_INJECTED: of those that were found, whatever their FLAGS. */
static rx_status find_errors(const rx_evaluation *e, rx_selfcheck *check, rx_error *err)
{
    const rx_qa_list *list = &check->found_list, *truth = &check->truth;
    long n = 0;
    rx_conformal_case *cases;
    RX_TRY(RX_MAKE(cases, (size_t)list->n, err));
    for (long j = 0; j < list->n; j++) {
        const rx_selfcheck_found *m = &check->measured[j];
        const long i = e->origin[j];
        if (i >= 0)
            cases[n++] = (rx_conformal_case){.snr = m->flux / m->fluxerr,
                                             .blend = m->blend,
                                             .score = fabs(m->flux - truth->flux[i]) / m->fluxerr,
                                             .weight = 1.0 / truth->flux[i]};
    }
    const rx_status status = rx_conformal_new(cases, n, &check->errors, err);
    free(cases);
    return status;
}

static rx_status measure_one(const rx_evaluation *e, rx_metric metric, rx_resampling by, rx_estimate *dst,
                             rx_error *err)
{
    rx_estimate all[RX_METRIC_COUNT];
    rx_status status = rx_metrics_measure(e, (rx_mag_range){.whole = 1}, LEVEL, by, metric, all, err);
    if (status == RX_OK)
        *dst = all[metric];
    return status;
}

rx_status rx_selfcheck_measure(const rx_selfcheck_plan *plan, rx_selfcheck *check, rx_error *err)
{
    rx_qa_input input;
    rx_qa_run run;
    rx_bins bins;
    rx_evaluation e = {0};
    rx_qa_params par = rx_selfcheck_qa(plan);
    rx_selfcheck_input(plan, check, "self check", &input, &run);
    rx_status status = RX_OK;
    RX_TRY(rx_evaluate_bins(&par, &input, &bins, err));
    RX_TRY(rx_evaluate(&par, &input, 0, &bins, LEVEL, &e, err));
    check->injected = e.references;
    check->found = e.matched;
    RX_TRY_EXIT(measure_one(&e, RX_METRIC_MAG50, par.by, &check->mag50, err));
    RX_TRY_EXIT(measure_one(&e, RX_METRIC_MAG90, par.by, &check->mag90, err));
    RX_TRY_EXIT(measure_one(&e, RX_METRIC_PRECISION, par.by, &check->injected_share, err));
    RX_TRY_EXIT(biases(plan, &e, check, err));
    if (plan->params.templates.wanted)
        RX_TRY_EXIT(find_errors(&e, check, err));
    check->partner = e.partner;
    e.partner = NULL;
exit:
    rx_evaluation_free(&e);
    return status;
}
