/* One run against the reference. */
#include "quality/evaluate.h"

#include <math.h>
#include <stdlib.h>

#include "base/constants.h"
#include "base/memory.h"
#include "num/stats.h"
#include "quality/match.h"

enum { SHIFTS = 8, FLAG_SATURATED_OR_WORSE = 4 };
static const double UNKNOWN_MAG = 90; /* as faint or fainter: SExtractor's 99 */
static const double BRIGHT_MAG_ERROR = 0.05;

void rx_robust_estimates(double *values, long n, double level, rx_estimate *median, rx_estimate *sigma)
{
    long rank = rx_median_rank(n, level);
    *median = (rx_estimate){NAN, -INFINITY, INFINITY, n};
    *sigma = (rx_estimate){NAN, 0, INFINITY, n};
    if (n == 0)
        return;
    for (int pass = 0; pass < 2; pass++) {
        rx_estimate *dst = pass == 0 ? median : sigma;
        double scale = pass == 0 ? 1 : RX_MAD_SIGMA;
        rx_sort(values, (size_t)n);
        dst->value = scale * 0.5 * (values[(n - 1) / 2] + values[n / 2]);
        if (rank > 0) {
            dst->low = scale * values[rank - 1];
            dst->high = scale * values[n - rank];
        }
        for (long i = 0; i < n && pass == 0; i++)
            values[i] = fabs(values[i] - median->value);
    }
}

static int counts(const rx_qa_input *input, double x, double y)
{
    if (!(x >= -0.5 && x < input->width - 0.5 && y >= -0.5 && y < input->height - 0.5))
        return 0;
    long column = lround(x), row = lround(y);
    column = column < 0 ? 0 : column >= input->width ? input->width - 1 : column;
    row = row < 0 ? 0 : row >= input->height ? input->height - 1 : row;
    return input->mask == NULL || !input->mask[row * input->width + column];
}

static double known_mag(double mag)
{
    return isfinite(mag) && mag < UNKNOWN_MAG ? mag : NAN;
}

rx_status rx_evaluate_bins(const rx_qa_params *par, const rx_qa_input *input, rx_bins *bins, rx_error *err)
{
    double low = par->mag_low, high = par->mag_high, step = par->mag_step > 0 ? par->mag_step : 0.5;
    if (!(low < high)) {
        low = INFINITY;
        high = -INFINITY;
        for (long i = 0; i < input->truth.n; i++) {
            double mag = known_mag(input->truth.mag[i]);
            if (isnan(mag) || !counts(input, input->truth.x[i], input->truth.y[i]))
                continue;
            low = fmin(low, mag);
            high = fmax(high, mag);
        }
        low = low <= high ? floor(low) : 0;
        high = high >= low ? floor(high) + 1 : low + 1;
        if ((high - low) / step > RX_MAX_BINS)
            step = ceil((high - low) / RX_MAX_BINS);
    }
    if (!isfinite(low) || !isfinite(high) || ceil((high - low) / step - 1e-9) > RX_MAX_BINS)
        return rx_error_set(err, RX_USAGE,
                            "magnitude bins %g to %g in steps of %g are more than %d; give a wider step", low,
                            high, step, RX_MAX_BINS);
    bins->n = (int)ceil((high - low) / step - 1e-9);
    for (int i = 0; i <= bins->n; i++)
        bins->edge[i] = i < bins->n ? low + i * step : high;
    return RX_OK;
}

static rx_status allocate(rx_evaluation *dst, rx_error *err)
{
    size_t nt = (size_t)dst->input->truth.n, nr = (size_t)dst->run->list.n;
    dst->partner = RX_NEW(long, nt);
    dst->truth_role = RX_NEW(unsigned char, nt);
    dst->truth_mag = RX_NEW(double, nt);
    dst->origin = RX_NEW(long, nr);
    dst->run_role = RX_NEW(unsigned char, nr);
    dst->bright = RX_NEW(unsigned char, nr);
    double **columns[] = {&dst->run_mag, &dst->dx, &dst->dy, &dst->dmag, &dst->ratio, &dst->pull};
    int complete =
        dst->partner && dst->truth_role && dst->truth_mag && dst->origin && dst->run_role && dst->bright;
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
        *columns[i] = RX_NEW(double, nr);
        complete = complete && *columns[i] != NULL;
    }
    return complete ? RX_OK : rx_error_memory(err, nr * sizeof(double));
}

void rx_evaluation_free(rx_evaluation *e)
{
    free(e->partner);
    free(e->truth_role);
    free(e->truth_mag);
    free(e->origin);
    free(e->run_role);
    free(e->bright);
    free(e->run_mag);
    free(e->dx);
    free(e->dy);
    free(e->dmag);
    free(e->ratio);
    free(e->pull);
    rx_pr_free(&e->pr);
    *e = (rx_evaluation){0};
}

/* Second pass: detections that belong to references which do not count. */
static rx_status match_ignored(rx_evaluation *e, double radius, unsigned char *use_truth,
                               unsigned char *use_run, rx_error *err)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    rx_status status = RX_OK;
    long *partner = RX_NEW(long, (size_t)truth->n), *origin = RX_NEW(long, (size_t)list->n);
    if (partner == NULL || origin == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (long i = 0; i < truth->n; i++)
        use_truth[i] = !use_truth[i];
    for (long j = 0; j < list->n; j++)
        use_run[j] = e->origin[j] < 0;
    status = rx_match(&(rx_match_list){truth->n, truth->x, truth->y, use_truth},
                      &(rx_match_list){list->n, list->x, list->y, use_run}, radius, partner, origin, err);
    for (long j = 0; j < list->n && status == RX_OK; j++) {
        int outside = !counts(e->input, list->x[j], list->y[j]);
        if (e->origin[j] < 0 && (origin[j] >= 0 || outside))
            e->run_role[j] = RX_ROLE_IGNORED;
    }
exit:
    free(partner);
    free(origin);
    return status;
}

/* Matches between counted references and the detections moved by SHIFTS vectors, round the tile's edges. */
static rx_status chance_matches(rx_evaluation *e, double radius, const unsigned char *use_truth,
                                rx_error *err)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    double reach = fmin(fmax(10 * radius, 30), 0.3 * fmin(e->input->width, e->input->height));
    rx_status status = RX_OK;
    double *x = RX_NEW(double, (size_t)list->n), *y = RX_NEW(double, (size_t)list->n);
    long *partner = RX_NEW(long, (size_t)truth->n), *origin = RX_NEW(long, (size_t)list->n), sum = 0;
    if (x == NULL || y == NULL || partner == NULL || origin == NULL)
        status = rx_error_memory(err, 0);
    for (int k = 0; k < SHIFTS && status == RX_OK; k++) {
        double angle = 2 * acos(-1.0) * (k + 0.5) / SHIFTS;
        for (long j = 0; j < list->n; j++) {
            x[j] = fmod(list->x[j] + reach * cos(angle) + e->input->width, e->input->width);
            y[j] = fmod(list->y[j] + reach * sin(angle) + e->input->height, e->input->height);
        }
        status = rx_match(&(rx_match_list){truth->n, truth->x, truth->y, use_truth},
                          &(rx_match_list){list->n, x, y, NULL}, radius, partner, origin, err);
        for (long i = 0; i < truth->n && status == RX_OK; i++)
            sum += partner[i] >= 0;
    }
    e->chance = (double)sum / SHIFTS;
    free(x);
    free(y);
    free(partner);
    free(origin);
    return status;
}

static rx_status find_roles(rx_evaluation *e, double radius, rx_error *err)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    rx_status status = RX_OK;
    unsigned char *use_truth = RX_NEW(unsigned char, (size_t)truth->n);
    unsigned char *use_run = RX_NEW(unsigned char, (size_t)list->n);
    if (use_truth == NULL || use_run == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (long i = 0; i < truth->n; i++)
        use_truth[i] = counts(e->input, truth->x[i], truth->y[i]) && !isnan(known_mag(truth->mag[i]));
    status = rx_match(&(rx_match_list){truth->n, truth->x, truth->y, use_truth},
                      &(rx_match_list){list->n, list->x, list->y, NULL}, radius, e->partner, e->origin, err);
    if (status == RX_OK)
        status = chance_matches(e, radius, use_truth, err);
    for (long i = 0; i < truth->n && status == RX_OK; i++)
        e->truth_role[i] = !use_truth[i]        ? RX_ROLE_IGNORED
                           : e->partner[i] >= 0 ? RX_ROLE_MATCHED
                                                : RX_ROLE_UNMATCHED;
    for (long j = 0; j < list->n && status == RX_OK; j++)
        e->run_role[j] = e->origin[j] >= 0 ? RX_ROLE_MATCHED : RX_ROLE_UNMATCHED;
    if (status == RX_OK)
        status = match_ignored(e, radius, use_truth, use_run, err);
exit:
    free(use_truth);
    free(use_run);
    return status;
}

static void count_roles(rx_evaluation *e)
{
    for (long i = 0; i < e->input->truth.n; i++) {
        int ignored = e->truth_role[i] == RX_ROLE_IGNORED;
        e->references += !ignored;
        e->references_ignored += ignored;
        e->matched += e->truth_role[i] == RX_ROLE_MATCHED;
    }
    for (long j = 0; j < e->run->list.n; j++) {
        int ignored = e->run_role[j] == RX_ROLE_IGNORED;
        e->detections += !ignored;
        e->detections_ignored += ignored;
        const int made_up = !ignored && e->run->list.made_up != NULL && e->run->list.made_up[j];
        e->made_up += made_up;
        e->made_up_matched += made_up && e->run_role[j] == RX_ROLE_MATCHED;
    }
}

double rx_evaluation_precision_without(const rx_evaluation *evaluation)
{
    const long kept = evaluation->detections - evaluation->made_up;
    return kept > 0 ? (double)(evaluation->matched - evaluation->made_up_matched) / (double)kept : NAN;
}

/* The zero point that ties flux and mag of a list together, NAN when it has no fluxes. */
static double list_zeropoint(const rx_qa_list *list)
{
    for (long j = 0; j < list->n && list->flux != NULL; j++)
        if (list->flux[j] > 0 && isfinite(list->flux[j]) && !isnan(known_mag(list->mag[j])))
            return list->mag[j] + 2.5 * log10(list->flux[j]);
    return NAN;
}

/* Differences of one matched pair; what cannot be known stays NAN. */
static void difference(rx_evaluation *e, long j, double zeropoint)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    long i = e->origin[j];
    double mag0 = e->truth_mag[i], flux0 = pow(10, -0.4 * (mag0 - zeropoint));
    double error0 = truth->mag_error != NULL && isfinite(truth->mag_error[i]) ? truth->mag_error[i] : 0;
    e->dx[j] = list->x[j] - truth->x[i];
    e->dy[j] = list->y[j] - truth->y[i];
    e->dmag[j] = e->run_mag[j] - mag0;
    e->ratio[j] = isfinite(zeropoint) ? list->flux[j] / flux0 : pow(10, -0.4 * e->dmag[j]);
    if (e->pull_in_flux) {
        double error = hypot(list->flux_error[j], error0 * flux0 * 0.4 * log(10));
        e->pull[j] = error > 0 ? (list->flux[j] - flux0) / error : NAN;
    } else if (list->mag_error != NULL) {
        double error = hypot(list->mag_error[j], error0);
        e->pull[j] = error > 0 ? e->dmag[j] / error : NAN;
    }
}

static void find_differences(rx_evaluation *e)
{
    const rx_qa_list *list = &e->run->list;
    double zeropoint = list_zeropoint(list);
    e->pull_in_flux = isfinite(zeropoint) && list->flux_error != NULL;
    for (long i = 0; i < e->input->truth.n; i++)
        e->truth_mag[i] = known_mag(e->input->truth.mag[i]);
    for (long j = 0; j < list->n; j++) {
        e->run_mag[j] = known_mag(list->mag[j]);
        e->dx[j] = e->dy[j] = e->dmag[j] = e->ratio[j] = e->pull[j] = NAN;
        if (e->run_role[j] == RX_ROLE_MATCHED)
            difference(e, j, zeropoint);
    }
}

/* Median dmag of matches with small errors and no saturation. */
static rx_status find_offset(rx_evaluation *e, rx_error *err)
{
    const rx_qa_list *list = &e->run->list;
    rx_estimate sigma;
    long n = 0;
    double *values = RX_NEW(double, (size_t)list->n);
    if (values == NULL)
        return rx_error_memory(err, (size_t)list->n * sizeof *values);
    for (long j = 0; j < list->n; j++) {
        int clean = list->flags == NULL || list->flags[j] < FLAG_SATURATED_OR_WORSE;
        int bright = list->mag_error == NULL || list->mag_error[j] <= BRIGHT_MAG_ERROR;
        e->bright[j] = isfinite(e->dmag[j]) && clean && bright;
        if (e->bright[j])
            values[n++] = e->dmag[j];
    }
    rx_robust_estimates(values, n, e->level, &e->offset, &sigma);
    free(values);
    return RX_OK;
}

static rx_status find_curve(rx_evaluation *e, rx_resampling by, rx_error *err)
{
    const rx_qa_list *list = &e->run->list;
    rx_status status = RX_OK;
    long n = 0;
    double *score = RX_NEW(double, (size_t)list->n);
    unsigned char *matched = RX_NEW(unsigned char, (size_t)list->n);
    if (score == NULL || matched == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)list->n * sizeof *score));
    for (long j = 0; j < list->n; j++) {
        if (e->run_role[j] == RX_ROLE_IGNORED)
            continue;
        score[n] = list->score != NULL ? list->score[j] : -e->run_mag[j];
        matched[n++] = e->run_role[j] == RX_ROLE_MATCHED;
    }
    RX_TRY_EXIT(rx_pr_make(n, score, matched, e->references, &e->pr, err));
    status = rx_pr_interval(&e->pr, e->references, e->level, by, &e->pr.ap, err);
exit:
    free(score);
    free(matched);
    return status;
}

rx_status rx_evaluate(const rx_qa_params *par, const rx_qa_input *input, int run, const rx_bins *bins,
                      double level, rx_evaluation *dst, rx_error *err)
{
    *dst = (rx_evaluation){.input = input, .run = &input->runs[run], .bins = *bins, .level = level};
    rx_status status = allocate(dst, err);
    if (status == RX_OK)
        status = find_roles(dst, par->match_radius, err);
    if (status == RX_OK) {
        count_roles(dst);
        find_differences(dst);
        status = find_offset(dst, err);
    }
    if (status == RX_OK)
        status = find_curve(dst, par->by, err);
    if (status != RX_OK)
        rx_evaluation_free(dst);
    return status;
}
