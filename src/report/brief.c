/* The short table for the terminal. */
#include <math.h>

#include "quality/evaluate.h"
#include "report/escape.h"
#include "report/qa_writers.h"

static const double SENSELESS = 1e4; /* percent */

static void column(rx_text *dst, double value, int width, int digits)
{
    if (isfinite(value))
        rx_text_printf(dst, " %*.*f", width, digits, value);
    else
        rx_text_printf(dst, " %*s", width, "-");
}

/* Nothing that could drive a terminal. */
static void printable(char *dst, size_t size, const char *text)
{
    size_t n = 0;
    for (; text[n] != '\0' && n + 1 < size; n++)
        dst[n] = text[n] >= ' ' && text[n] <= '~' ? text[n] : '?';
    dst[n] = '\0';
}

/* Mean of 100 |F - F0| / F0 over the references that every run has matched, whose number is *n: a deeper list is
 * not judged by sources that the others do not hold. */
static double error_of_common(const rx_report *r, int run, long *n)
{
    double sum = 0.0;
    *n = 0;
    for (long i = 0; i < r->input->truth.n; i++) {
        int common = 1;
        for (int k = 0; k < r->input->nruns && common; k++) {
            const rx_evaluation *e = &r->evaluation[k];
            common = e->truth_role[i] == RX_ROLE_MATCHED && e->partner[i] >= 0 &&
                     isfinite(e->ratio[e->partner[i]]);
        }
        if (common) {
            const rx_evaluation *e = &r->evaluation[run];
            sum += 100.0 * fabs(e->ratio[e->partner[i]] - 1.0);
            ++*n;
        }
    }
    return *n > 0 ? sum / (double)*n : NAN;
}

/* Percent; an error of which the digits mean nothing is not printed. */
static void error_column(rx_text *dst, double percent, int *senseless)
{
    *senseless |= percent > SENSELESS;
    column(dst, percent > SENSELESS ? NAN : percent, 9, 2);
}

void rx_report_brief(rx_text *dst, const rx_report *r, bool legend)
{
    int senseless = 0;
    long ncommon = 0;
    rx_text_printf(dst, "%-12s %8s %8s %7s %9s %6s %9s %9s %9s %6s %8s\n", "run", "detected", "matched",
                   "recall", "precision", "AP", "MagErr/%", "common/%", "bias/mag", "mag50", "seconds");
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_evaluation *e = &r->evaluation[run];
        const rx_estimate *m = rx_report_whole(r, run, RX_METRIC_RECALL);
        char name[32];
        rx_escape_plain(name, sizeof name, e->run->name);
        rx_text_printf(dst, "%-12s %8ld %8ld", name, e->detections, e->matched);
        column(dst, m[RX_METRIC_RECALL].value, 7, 3);
        column(dst, m[RX_METRIC_PRECISION].value, 9, 3);
        column(dst, m[RX_METRIC_AP].value, 6, 3);
        error_column(dst, m[RX_METRIC_MAGERR].value, &senseless);
        error_column(dst, error_of_common(r, run, &ncommon), &senseless);
        column(dst, m[RX_METRIC_BIAS_MAG].value, 9, 3);
        column(dst, m[RX_METRIC_MAG50].value, 6, 2);
        column(dst, e->run->seconds, 8, 1);
        rx_text_add(dst, "\n");
    }
    if (legend)
        rx_text_printf(
            dst,
            "recall: share of the reference found; precision: share of detections in the reference; AP: area "
            "under their curve; mag50: half are found here\n"
            "MagErr: mean |F - F0| / F0 of each own list; common: of the %ld sources that every list has; "
            "bias: median; seconds: with measuring and checks\n",
            ncommon);
    if (senseless)
        rx_text_add(dst, "MagErr above 10,000 %: magnitudes and reference have not the same zero point; give "
                         "MAG_ZEROPOINT, or its header keyword, MAGZERO say, as MAG_ZEROPOINT_KEY\n");
    for (long i = 0; i < r->nresults; i++) {
        const rx_gate_result *g = &r->result[i];
        char text[96], name[32] = "no such run";
        printable(text, sizeof text, g->gate->text);
        if (g->run >= 0)
            rx_escape_plain(name, sizeof name, r->input->runs[g->run].name);
        rx_text_printf(dst, "gate line %ld: %s, %s: %.4g in [%.4g, %.4g], n %ld: %s\n", g->gate->line, text,
                       name, g->estimate.value, g->estimate.low, g->estimate.high, g->estimate.n,
                       rx_verdict_name(g->verdict));
    }
}
