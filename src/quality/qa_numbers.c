/* The numbers of the QA report. */
#include "quality/qa_numbers.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <strings.h>

#include "base/interrupt.h"
#include "quality/tally.h"

static rx_status measure_run(rx_qa_numbers *q, int run, rx_error *err)
{
    const rx_resampling by = q->par->by;
    rx_evaluation *e = &q->evaluation[run];
    RX_TRY(rx_interrupt_check(err));
    RX_TRY(rx_evaluate(q->par, q->input, run, &q->bins, RX_LEVEL, e, err));
    if (q->input->runs[run].tally != NULL)
        RX_TRY(rx_tally_evaluation(q->input->runs[run].tally, e, err));
    RX_TRY(
        rx_metrics_measure(e, (rx_mag_range){.whole = 1}, RX_LEVEL, by, RX_METRIC_COUNT, q->whole[run], err));
    for (int b = 0; b < q->bins.n; b++)
        RX_TRY(rx_metrics_measure(e, (rx_mag_range){0, q->bins.edge[b], q->bins.edge[b + 1]}, RX_LEVEL, by,
                                  RX_METRIC_COUNT, q->binned[run * q->bins.n + b], err));
    return RX_OK;
}

/* A deeper list is not tested by sources that the others do not hold. */
static void compare_errors(rx_qa_numbers *q)
{
    const int n = q->input->nruns;
    for (long i = 0; i < q->input->truth.n; i++) {
        bool common = true;
        for (int run = 0; run < n && common; run++) {
            const rx_evaluation *e = &q->evaluation[run];
            common = e->truth_role[i] == RX_ROLE_MATCHED && e->partner[i] >= 0 &&
                     isfinite(e->ratio[e->partner[i]]);
        }
        for (int run = 0; run < n && common; run++) {
            const rx_evaluation *e = &q->evaluation[run];
            q->common[run] += 100.0 * fabs(e->ratio[e->partner[i]] - 1.0);
        }
        q->ncommon += common;
    }
    for (int run = 0; run < n; run++)
        q->common[run] = q->ncommon > 0 ? q->common[run] / (double)q->ncommon : NAN;
}

static rx_status check_gate(rx_qa_numbers *q, const rx_gate *gate, rx_error *err)
{
    rx_estimate estimates[RX_METRIC_COUNT];
    const long before = q->nresults;
    for (int run = 0; run < q->input->nruns; run++) {
        if (strcmp(gate->run, "*") != 0 && strcasecmp(gate->run, q->input->runs[run].name) != 0)
            continue;
        RX_TRY(rx_metrics_measure(&q->evaluation[run], (rx_mag_range){gate->whole, gate->low, gate->high},
                                  gate->level, q->par->by, gate->metric, estimates, err));
        rx_gate_result *result = &q->result[q->nresults++];
        *result = (rx_gate_result){.gate = gate, .run = run, .estimate = estimates[gate->metric]};
        result->verdict = rx_gate_judge(gate, &result->estimate);
    }
    if (q->nresults == before)
        q->result[q->nresults++] = (rx_gate_result){
            .gate = gate, .run = -1, .estimate = {NAN, NAN, NAN, 0}, .verdict = RX_VERDICT_INSUFFICIENT};
    return RX_OK;
}

double rx_qa_star_mag(const rx_qa_psf *psf, const rx_psf_star *star)
{
    return star->flux > 0.0 ? psf->zeropoint - 2.5 * log10(star->flux) : NAN;
}

/* Empty ranges are left out; returns how many are left. */
static int psf_bins(const rx_qa_psf *psf, rx_qa_psf_bin dst[RX_QA_PSF_BINS])
{
    const rx_psf_tested *tested = psf->psf->tested;
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (int i = 0; i < tested->nstars; i++) {
        low = fmin(low, floor(rx_qa_star_mag(psf, &tested->star[i])));
        high = fmax(high, rx_qa_star_mag(psf, &tested->star[i]));
    }
    const double width = 0.5 * fmax(floor(2.0 * (high - low) / RX_QA_PSF_BINS) + 1.0, 1.0);
    for (int b = 0; b < RX_QA_PSF_BINS; b++)
        dst[b] = (rx_qa_psf_bin){.mag = low + (b + 0.5) * width};
    for (int i = 0; i < tested->nstars; i++) {
        const rx_psf_star *star = &tested->star[i];
        const double mag = rx_qa_star_mag(psf, star);
        rx_qa_psf_bin *to = &dst[isnan(mag) ? 0 : (int)((mag - low) / width)];
        to->n += !isnan(mag);
        for (int k = 0; k < 3 && !isnan(mag); k++) {
            to->mean[k] += star->off[k];
            to->error[k] += star->off[k] * star->off[k];
        }
    }
    int n = 0;
    for (int b = 0; b < RX_QA_PSF_BINS; b++) {
        rx_qa_psf_bin bin = dst[b];
        const double stars = (double)bin.n;
        for (int k = 0; k < 3; k++) {
            bin.mean[k] /= stars;
            bin.error[k] =
                bin.n > 1 ? sqrt(fmax(bin.error[k] / stars - bin.mean[k] * bin.mean[k], 0.0) / (stars - 1.0))
                          : NAN;
        }
        if (bin.n > 0)
            dst[n++] = bin;
    }
    return n;
}

rx_status rx_qa_numbers_make(const rx_qa_params *par, const rx_qa_input *input, rx_qa_numbers *dst,
                             rx_error *err)
{
    const size_t runs = (size_t)input->nruns;
    const long gates = par->gates != NULL ? par->gates->n : 0;
    *dst = (rx_qa_numbers){.par = par, .input = input};
    RX_TRY(rx_evaluate_bins(par, input, &dst->bins, err));
    dst->evaluation = RX_TAKE(&dst->memory, rx_evaluation, runs);
    dst->whole = rx_arena_take(&dst->memory, runs, sizeof *dst->whole);
    dst->binned = rx_arena_take(&dst->memory, runs * (size_t)dst->bins.n, sizeof *dst->binned);
    dst->common = RX_TAKE(&dst->memory, double, runs);
    dst->result = RX_TAKE(&dst->memory, rx_gate_result, (size_t)gates * (runs + 1));
    if (!dst->evaluation || !dst->whole || !dst->binned || !dst->common || !dst->result)
        return rx_error_memory(err, 0);
    for (int run = 0; run < input->nruns; run++)
        RX_TRY(measure_run(dst, run, err));
    compare_errors(dst);
    if (input->psf.psf != NULL && input->psf.psf->tested != NULL)
        dst->npsf_bins = psf_bins(&input->psf, dst->psf_bin);
    for (long i = 0; i < gates; i++)
        RX_TRY(check_gate(dst, &par->gates->gate[i], err));
    for (long i = 0; i < dst->nresults; i++)
        dst->verdict = rx_verdict_worse(dst->verdict, dst->result[i].verdict);
    return RX_OK;
}

void rx_qa_numbers_free(rx_qa_numbers *q)
{
    for (int i = 0; q->evaluation != NULL && i < q->input->nruns; i++)
        rx_evaluation_free(&q->evaluation[i]);
    rx_arena_free(&q->memory);
    *q = (rx_qa_numbers){0};
}
