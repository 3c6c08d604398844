/* One run against the reference. */
#include "quality/evaluate.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "quality/match.h"

enum { SHIFTS = 8, FLAG_SATURATED_OR_WORSE = 4 };
static const double UNKNOWN_MAG = 90; /* as faint or fainter: SExtractor's 99 */
static const double BRIGHT_MAG_ERROR = 0.05;

enum { NUMBERS = 9 };

static void numbers_of(rx_qa_list *list, double **dst[NUMBERS])
{
    double **const columns[NUMBERS] = {&list->x,     &list->y,          &list->alpha,
                                       &list->delta, &list->mag,        &list->mag_error,
                                       &list->flux,  &list->flux_error, &list->score};
    memcpy(dst, columns, sizeof columns);
}

rx_status rx_qa_list_new(rx_qa_list *list, long n, int with_flags, rx_error *err)
{
    const size_t rows = (size_t)n;
    double **columns[NUMBERS];
    bool complete = true;
    *list = (rx_qa_list){.n = n};
    numbers_of(list, columns);
    for (int i = 0; i < NUMBERS - !with_flags; i++)
        complete &= (*columns[i] = RX_NEW(double, rows)) != NULL;
    if (with_flags) {
        complete &= (list->flags = RX_NEW(int, rows)) != NULL;
        complete &= (list->restore = RX_NEW(int, rows)) != NULL;
        complete &= (list->made_up = RX_NEW(unsigned char, rows)) != NULL;
    }
    if (complete)
        return RX_OK;
    rx_qa_list_free(list);
    return rx_error_memory(err, NUMBERS * rows * sizeof(double));
}

void rx_qa_list_free(rx_qa_list *list)
{
    double **columns[NUMBERS];
    numbers_of(list, columns);
    for (int i = 0; i < NUMBERS; i++)
        free(*columns[i]);
    free(list->flags);
    free(list->restore);
    free(list->made_up);
    *list = (rx_qa_list){0};
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
    const size_t nt = (size_t)dst->input->truth.n, nr = (size_t)dst->run->list.n;
    double **const columns[] = {&dst->run_mag, &dst->dx, &dst->dy, &dst->dmag, &dst->ratio, &dst->pull};
    bool complete = true;
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++)
        complete &= (*columns[i] = RX_TAKE(&dst->memory, double, nr)) != NULL;
    dst->truth_mag = RX_TAKE(&dst->memory, double, nt);
    dst->origin = RX_TAKE(&dst->memory, long, nr);
    dst->truth_role = RX_TAKE(&dst->memory, unsigned char, nt);
    dst->run_role = RX_TAKE(&dst->memory, unsigned char, nr);
    dst->bright = RX_TAKE(&dst->memory, unsigned char, nr);
    dst->partner = RX_NEW(long, nt);
    complete = complete && dst->truth_mag && dst->origin && dst->truth_role && dst->run_role && dst->bright;
    return complete && dst->partner ? RX_OK : rx_error_memory(err, nr * sizeof(double));
}

void rx_evaluation_free(rx_evaluation *e)
{
    rx_arena_free(&e->memory);
    free(e->partner);
    rx_pr_free(&e->pr);
    *e = (rx_evaluation){0};
}

/* What matching needs for a while. */
typedef struct matching {
    rx_evaluation *e;
    double radius;
    long *partner, *origin; /* as those of the evaluation, of another pass */
    unsigned char *use_truth, *use_run;
    double *x, *y; /* [run.n] detections that were moved */
} matching;

static rx_status match_moved(const matching *m, const unsigned char *use_run, const double *x,
                             const double *y, rx_error *err)
{
    const rx_qa_list *truth = &m->e->input->truth;
    return rx_match(&(rx_match_list){truth->n, truth->x, truth->y, m->use_truth},
                    &(rx_match_list){m->e->run->list.n, x, y, use_run}, m->radius, m->partner, m->origin,
                    err);
}

/* Matches between counted references and the detections moved by SHIFTS vectors, round the tile's edges. */
static rx_status chance_matches(const matching *m, rx_error *err)
{
    const rx_qa_list *list = &m->e->run->list;
    const int width = m->e->input->width, height = m->e->input->height;
    const double reach = fmin(fmax(10 * m->radius, 30), 0.3 * fmin(width, height));
    long sum = 0;
    for (int k = 0; k < SHIFTS; k++) {
        const double angle = 2 * acos(-1.0) * (k + 0.5) / SHIFTS;
        for (long j = 0; j < list->n; j++) {
            m->x[j] = fmod(list->x[j] + reach * cos(angle) + width, width);
            m->y[j] = fmod(list->y[j] + reach * sin(angle) + height, height);
        }
        RX_TRY(match_moved(m, NULL, m->x, m->y, err));
        for (long i = 0; i < m->e->input->truth.n; i++)
            sum += m->partner[i] >= 0;
    }
    m->e->chance = (double)sum / SHIFTS;
    return RX_OK;
}

/* Those that count, then with what is left detections that belong to references which do not. */
static rx_status match_all(const matching *m, rx_error *err)
{
    rx_evaluation *e = m->e;
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    for (long i = 0; i < truth->n; i++)
        m->use_truth[i] = counts(e->input, truth->x[i], truth->y[i]) && !isnan(known_mag(truth->mag[i]));
    RX_TRY(match_moved(m, NULL, list->x, list->y, err));
    memcpy(e->partner, m->partner, (size_t)truth->n * sizeof *e->partner);
    memcpy(e->origin, m->origin, (size_t)list->n * sizeof *e->origin);
    RX_TRY(chance_matches(m, err));
    for (long i = 0; i < truth->n; i++) {
        e->truth_role[i] = !m->use_truth[i]     ? RX_ROLE_IGNORED
                           : e->partner[i] >= 0 ? RX_ROLE_MATCHED
                                                : RX_ROLE_UNMATCHED;
        m->use_truth[i] = !m->use_truth[i];
    }
    for (long j = 0; j < list->n; j++)
        m->use_run[j] = e->origin[j] < 0;
    RX_TRY(match_moved(m, m->use_run, list->x, list->y, err));
    for (long j = 0; j < list->n; j++)
        e->run_role[j] = e->origin[j] >= 0                                                ? RX_ROLE_MATCHED
                         : m->origin[j] >= 0 || !counts(e->input, list->x[j], list->y[j]) ? RX_ROLE_IGNORED
                                                                                          : RX_ROLE_UNMATCHED;
    return RX_OK;
}

static rx_status find_roles(rx_evaluation *e, double radius, rx_error *err)
{
    const size_t nt = (size_t)e->input->truth.n, nr = (size_t)e->run->list.n;
    rx_arena memory = {0};
    const matching m = {.e = e,
                        .radius = radius,
                        .partner = RX_TAKE(&memory, long, nt),
                        .origin = RX_TAKE(&memory, long, nr),
                        .use_truth = RX_TAKE(&memory, unsigned char, nt),
                        .use_run = RX_TAKE(&memory, unsigned char, nr),
                        .x = RX_TAKE(&memory, double, nr),
                        .y = RX_TAKE(&memory, double, nr)};
    const bool complete = m.partner && m.origin && m.use_truth && m.use_run && m.x && m.y;
    const rx_status status = complete ? match_all(&m, err) : rx_error_memory(err, 0);
    rx_arena_free(&memory);
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
    double zeropoint = NAN; /* that ties flux and mag of a list together */
    for (long j = 0; j < list->n && list->flux != NULL && isnan(zeropoint); j++)
        if (list->flux[j] > 0 && isfinite(list->flux[j]))
            zeropoint = known_mag(list->mag[j]) + 2.5 * log10(list->flux[j]);
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
    double *values;
    RX_TRY(RX_MAKE(values, (size_t)list->n, err));
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
    long n = 0;
    double *score = NULL;
    unsigned char *matched = NULL;
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(score, (size_t)list->n, err));
    RX_TRY_EXIT(RX_MAKE(matched, (size_t)list->n, err));
    for (long j = 0; j < list->n; j++)
        if (e->run_role[j] != RX_ROLE_IGNORED) {
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
    rx_status status;
    RX_TRY_EXIT(allocate(dst, err));
    RX_TRY_EXIT(find_roles(dst, par->match_radius, err));
    count_roles(dst);
    find_differences(dst);
    RX_TRY_EXIT(find_offset(dst, err));
    status = find_curve(dst, par->by, err);
exit:
    if (status != RX_OK)
        rx_evaluation_free(dst);
    return status;
}
