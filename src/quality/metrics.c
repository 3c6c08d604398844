/* Measuring the metrics over a range of magnitudes. */
#include "quality/metrics.h"
#include "quality/statistics.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/psf.h"
#include "num/special.h"

#define RX_METRIC_ROW(id, name, unit, digits, whole, help) {name, unit, help, digits, whole},
static const rx_metric_row rows[RX_METRIC_COUNT] = {RX_METRICS(RX_METRIC_ROW)};
#undef RX_METRIC_ROW

const rx_metric_row *rx_metric_get(rx_metric metric)
{
    return &rows[metric];
}

/* What is measured where, handed down. */
typedef struct range {
    const rx_evaluation *e;
    rx_mag_range mags;
    double level;
    rx_resampling by;
    rx_metric only;
    double *scratch; /* [run.n] */
} range;

static int wanted(const range *r, rx_metric metric)
{
    return r->only == RX_METRIC_COUNT || r->only == metric;
}

static int inside(const range *r, double mag)
{
    return r->mags.whole || (mag >= r->mags.low && mag < r->mags.high);
}

static void measure_shares(const range *r, rx_estimate *out)
{
    const rx_evaluation *e = r->e;
    long found = 0, references = 0, right = 0, detections = 0;
    for (long i = 0; i < e->input->truth.n; i++) {
        if (e->truth_role[i] == RX_ROLE_IGNORED || !inside(r, e->truth_mag[i]))
            continue;
        references++;
        found += e->truth_role[i] == RX_ROLE_MATCHED;
    }
    for (long j = 0; j < e->run->list.n; j++) {
        if (e->run_role[j] == RX_ROLE_IGNORED || !inside(r, e->run_mag[j]))
            continue;
        detections++;
        right += e->run_role[j] == RX_ROLE_MATCHED;
    }
    out[RX_METRIC_RECALL] = rx_binomial_interval(found, references, r->level);
    out[RX_METRIC_PRECISION] = rx_binomial_interval(right, detections, r->level);
}

/* Finite values of a column, of matches in the range of reference magnitude, into the scratch. */
static long gather(const range *r, const double *column, double scale, double shift)
{
    const rx_evaluation *e = r->e;
    long n = 0;
    for (long j = 0; j < e->run->list.n; j++)
        if (e->run_role[j] == RX_ROLE_MATCHED && inside(r, e->truth_mag[e->origin[j]]) && isfinite(column[j]))
            r->scratch[n++] = scale * (column[j] + shift);
    return n;
}

static void measure_robust(const range *r, rx_estimate *out)
{
    const rx_evaluation *e = r->e;
    const double arcsec = e->input->pixel_scale > 0 ? e->input->pixel_scale : NAN;
    const struct {
        const double *column;
        double scale, shift;
        rx_metric median, sigma;
    } todo[] = {
        {e->dmag, 1, 0, RX_METRIC_BIAS_MAG, RX_METRIC_SCATTER_MAG},
        {e->ratio, 100, -1, RX_METRIC_BIAS_PERCENT, RX_METRIC_SCATTER_PERCENT},
        {e->dx, 1, 0, RX_METRIC_DX, RX_METRIC_SCATTER_X},
        {e->dy, 1, 0, RX_METRIC_DY, RX_METRIC_SCATTER_Y},
        {e->dx, arcsec, 0, RX_METRIC_DX_ARCSEC, RX_METRIC_SCATTER_X_ARCSEC},
        {e->dy, arcsec, 0, RX_METRIC_DY_ARCSEC, RX_METRIC_SCATTER_Y_ARCSEC},
        {e->pull, 1, 0, RX_METRIC_PULL_MEDIAN, RX_METRIC_PULL_WIDTH},
    };
    for (size_t k = 0; k < sizeof todo / sizeof *todo; k++) {
        if (!wanted(r, todo[k].median) && !wanted(r, todo[k].sigma))
            continue;
        long n = isnan(todo[k].scale) ? 0 : gather(r, todo[k].column, todo[k].scale, todo[k].shift);
        rx_robust_estimates(r->scratch, n, r->level, &out[todo[k].median], &out[todo[k].sigma]);
    }
}

typedef struct sample {
    long n;
    const double *values;
} sample;

static double resampled_mean(const void *data, const uint32_t *counts)
{
    const sample *in = data;
    double sum = 0;
    for (long i = 0; i < in->n; i++)
        sum += counts[i] * in->values[i];
    return sum / (double)in->n;
}

/* Mean of 100 |F/F0 - 1|, F multiplied by `factor`. */
static rx_status measure_magerr(const range *r, double factor, rx_estimate *dst, rx_error *err)
{
    long n = isfinite(factor) ? gather(r, r->e->ratio, factor, 0) : 0;
    double sum = 0;
    *dst = (rx_estimate){NAN, 0, INFINITY, n};
    if (n == 0)
        return RX_OK;
    for (long i = 0; i < n; i++) {
        r->scratch[i] = 100 * fabs(r->scratch[i] - 1);
        sum += r->scratch[i];
    }
    dst->value = sum / (double)n;
    if (n < RX_BOOTSTRAP_FEWEST)
        return RX_OK;
    return rx_bootstrap_interval((rx_resampling){r->by.seed, r->by.nthreads, 3}, n, resampled_mean,
                                 &(sample){n, r->scratch}, r->level, dst, err);
}

/* --- completeness ---
 *
 * Completeness is taken to fall with magnitude: the falling curve that is nearest to the references found and
 * missed (isotonic regression by pooling adjacent violators, Ayer et al. 1955, Ann. Math. Statist. 26, 641),
 * counted in 36 narrow bins of the range whatever the bins of tables and figures; linear interpolation
 * between the two bins where it crosses the share. So neither one lucky match at the faint end nor wide bins
 * decide: interpolation in bins of 0.25 to 1 mag puts the magnitude of 90 % by 0.05 to 0.7 mag too
 * bright where the curve is as steep as that of point sources. */

/* Fine bins that the references are counted in: narrow against the fall of a completeness curve, which linear
 * interpolation between wide ones would move. */
enum { FINE = 36, LEAST_REFERENCES = 5 };

typedef struct fine_counts {
    double low, width;                          /* of the range, and of a fine bin */
    double mag[FINE], found[FINE], total[FINE]; /* sums */
} fine_counts;

static void count_reference(fine_counts *c, int i, double mag, int found, double times)
{
    c->mag[i] += times * mag;
    c->total[i] += times;
    c->found[i] += found ? times : 0.0;
}

/* The falling curve nearest to the shares, in place: where one rises, it and its neighbours take their mean. */
static void make_fall(int n, double *share, const double *weight)
{
    double value[FINE], sum[FINE];
    int length[FINE], pools = 0;
    for (int i = 0; i < n; i++) {
        value[pools] = share[i];
        sum[pools] = weight[i];
        length[pools++] = 1;
        for (; pools > 1 && value[pools - 2] < value[pools - 1]; pools--) {
            double both = sum[pools - 2] + sum[pools - 1];
            value[pools - 2] = (value[pools - 2] * sum[pools - 2] + value[pools - 1] * sum[pools - 1]) / both;
            sum[pools - 2] = both;
            length[pools - 2] += length[pools - 1];
        }
    }
    for (int p = 0, i = 0; p < pools; p++)
        for (int k = 0; k < length[p]; k++)
            share[i++] = value[p];
}

/* beyond: 0 the curve crosses `wanted`; +1 it is above it to the end, which is returned; -1 below from the
 * beginning. NAN with fewer than LEAST_REFERENCES references. */
static double crossing(const fine_counts *c, double wanted, int *beyond)
{
    double mag[FINE], share[FINE], weight[FINE], all = 0.0;
    int bin[FINE], n = 0, last = -1;
    *beyond = 0;
    for (int i = 0; i < FINE; i++) {
        if (!(c->total[i] > 0.0))
            continue;
        bin[n] = i;
        mag[n] = c->mag[i] / c->total[i];
        share[n] = c->found[i] / c->total[i];
        weight[n++] = c->total[i];
        all += c->total[i];
    }
    if (all < LEAST_REFERENCES)
        return NAN;
    make_fall(n, share, weight);
    while (last + 1 < n && share[last + 1] >= wanted)
        last++;
    *beyond = last < 0 ? -1 : last == n - 1 ? 1 : 0;
    if (last < 0)
        return c->low + bin[0] * c->width;
    if (last == n - 1)
        return c->low + (bin[last] + 1) * c->width;
    return mag[last] + (share[last] - wanted) / (share[last] - share[last + 1]) * (mag[last + 1] - mag[last]);
}

/* Replicates that are only "at least" or "at most" are moved by this many magnitudes, so that they sort to
 * their end and are known there. */
static const double LIMIT = 1e6;

/* A limit can bound the interval only on the side it speaks of. */
static void open_ends(rx_estimate *dst)
{
    if (dst->low > 0.5 * LIMIT)
        dst->low -= LIMIT;
    else if (dst->low < -0.5 * LIMIT)
        dst->low = -INFINITY;
    if (dst->high < -0.5 * LIMIT)
        dst->high += LIMIT;
    else if (dst->high > 0.5 * LIMIT)
        dst->high = INFINITY;
}

/* Counted references inside the range of the bins, in catalogue order. */
typedef struct reference_data {
    double low, width, share;
    long n;
    double *mag;
    unsigned char *bin, *found; /* bin: the fine one, which a thousand replicates ask for */
} reference_data;

static double resampled_mag(const void *data, const uint32_t *drawn)
{
    const reference_data *in = data;
    fine_counts c = {.low = in->low, .width = in->width};
    int beyond;
    for (long i = 0; i < in->n; i++)
        if (drawn[i] > 0)
            count_reference(&c, in->bin[i], in->mag[i], in->found[i], drawn[i]);
    double value = crossing(&c, in->share, &beyond);
    return isnan(value) ? in->low - LIMIT : value + beyond * LIMIT;
}

/* The magnitude at which completeness falls to a share. Where the curve is above the share to its end, the value is that
 * end and a lower limit (the interval is open there); below from its beginning, an upper limit. */
static rx_status measure_depth(const range *r, double share, rx_estimate *dst, rx_error *err)
{
    const rx_evaluation *e = r->e;
    const size_t n = (size_t)e->input->truth.n;
    const double low = e->bins.edge[0], high = e->bins.edge[e->bins.n];
    rx_arena memory = {0};
    rx_status status = RX_OK;
    reference_data in = {.low = low, .width = (high - low) / FINE, .share = share};
    fine_counts c = {.low = low, .width = in.width};
    int beyond;
    in.mag = RX_TAKE(&memory, double, n);
    in.bin = RX_TAKE(&memory, unsigned char, n);
    in.found = RX_TAKE(&memory, unsigned char, n);
    if (in.mag == NULL || in.bin == NULL || in.found == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof *in.mag));
    for (long i = 0; i < e->input->truth.n; i++) {
        const double mag = e->truth_mag[i];
        if (e->truth_role[i] == RX_ROLE_IGNORED || !(mag >= low && mag < high))
            continue;
        in.mag[in.n] = mag;
        in.bin[in.n] = (unsigned char)fmin((mag - low) / in.width, FINE - 1);
        in.found[in.n] = e->truth_role[i] == RX_ROLE_MATCHED;
        count_reference(&c, in.bin[in.n], mag, in.found[in.n], 1.0);
        in.n++;
    }
    dst->n = in.n;
    dst->value = crossing(&c, share, &beyond);
    if (isnan(dst->value) || in.n < RX_BOOTSTRAP_FEWEST)
        goto exit;
    status = rx_bootstrap_interval((rx_resampling){r->by.seed, r->by.nthreads, 2}, in.n, resampled_mag, &in,
                                   r->level, dst, err);
    if (status == RX_OK)
        open_ends(dst);
exit:
    rx_arena_free(&memory);
    return status;
}

/* --- all of them --- */

/* By Student's t, from 1 sigma. */
static rx_estimate by_error(const range *r, double value, double error, long n)
{
    const double half = rx_student_quantile(1 - r->level, (double)n - 1.0) * error;
    return (rx_estimate){value, value - half, value + half, n};
}

/* Metrics that exist for everything only; the evaluation holds two of them at its own level. */
static rx_status measure_whole(const range *r, rx_estimate *out, rx_error *err)
{
    const rx_evaluation *e = r->e;
    long n = 0;
    rx_estimate sigma;
    if (wanted(r, RX_METRIC_MAG50))
        RX_TRY(measure_depth(r, 0.5, &out[RX_METRIC_MAG50], err));
    if (wanted(r, RX_METRIC_MAG90))
        RX_TRY(measure_depth(r, 0.9, &out[RX_METRIC_MAG90], err));
    out[RX_METRIC_AP] = e->pr.ap;
    out[RX_METRIC_ZP_OFFSET] = e->offset;
    const rx_qa_flux *flux = &e->run->flux;
    if (flux->n > 1)
        out[RX_METRIC_FLUX_SCALE] = by_error(r, flux->wide, flux->wide_error, flux->n);
    const rx_psf *psf = e->input->psf.psf;
    if (psf != NULL && psf->quality.reserved > 1) {
        const rx_psf_quality *q = &psf->quality;
        out[RX_METRIC_PSF_DT] = by_error(r, q->trace[0], q->trace[1], q->reserved);
        out[RX_METRIC_PSF_DE1] = by_error(r, q->shape[0][0], q->shape[0][1], q->reserved);
        out[RX_METRIC_PSF_DE2] = by_error(r, q->shape[1][0], q->shape[1][1], q->reserved);
        out[RX_METRIC_PSF_GROWTH] = by_error(r, q->growth, q->growth_error, q->reserved);
    }
    if (r->level == e->level)
        return RX_OK;
    for (long j = 0; j < e->run->list.n; j++)
        if (e->bright[j])
            r->scratch[n++] = e->dmag[j];
    rx_robust_estimates(r->scratch, n, r->level, &out[RX_METRIC_ZP_OFFSET], &sigma);
    return wanted(r, RX_METRIC_AP)
               ? rx_pr_interval(&e->pr, e->references, r->level, r->by, &out[RX_METRIC_AP], err)
               : RX_OK;
}

rx_status rx_metrics_measure(const rx_evaluation *evaluation, rx_mag_range mags, double level,
                             rx_resampling by, rx_metric only, rx_estimate *estimate, rx_error *err)
{
    rx_status status;
    range r = {evaluation, mags, level, by, only, NULL};
    RX_TRY(RX_MAKE(r.scratch, (size_t)evaluation->run->list.n, err));
    for (int i = 0; i < RX_METRIC_COUNT; i++)
        estimate[i] = (rx_estimate){NAN, -INFINITY, INFINITY, 0};
    measure_shares(&r, estimate);
    measure_robust(&r, estimate);
    if (wanted(&r, RX_METRIC_MAGERR))
        RX_TRY_EXIT(measure_magerr(&r, 1, &estimate[RX_METRIC_MAGERR], err));
    const double factor = pow(10, 0.4 * evaluation->offset.value);
    if (wanted(&r, RX_METRIC_MAGERR_SHIFTED))
        RX_TRY_EXIT(measure_magerr(&r, factor, &estimate[RX_METRIC_MAGERR_SHIFTED], err));
    if (mags.whole)
        RX_TRY_EXIT(measure_whole(&r, estimate, err));
    for (int i = 0; i < RX_METRIC_COUNT; i++)
        if (!wanted(&r, (rx_metric)i))
            estimate[i] = (rx_estimate){NAN, -INFINITY, INFINITY, 0};
exit:
    free(r.scratch);
    return status;
}
