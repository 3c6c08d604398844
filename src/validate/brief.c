/* The short table for the terminal. */
#include <math.h>

#include "validate/escape.h"
#include "validate/qa_writers.h"

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

void rx_report_brief(rx_text *dst, const rx_report *r)
{
    rx_text_printf(dst, "%-12s %9s %8s %8s %9s %9s %9s %9s %7s %9s\n", "run", "detected", "matched", "recall",
                   "precision", "AP", "MagErr/%", "bias/mag", "mag50", "seconds");
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_evaluation *e = &r->evaluation[run];
        const rx_estimate *m = rx_report_whole(r, run, RX_METRIC_RECALL);
        char name[32];
        rx_escape_plain(name, sizeof name, e->run->name);
        rx_text_printf(dst, "%-12s %9ld %8ld", name, e->detections, e->matched);
        column(dst, m[RX_METRIC_RECALL].value, 8, 3);
        column(dst, m[RX_METRIC_PRECISION].value, 9, 3);
        column(dst, m[RX_METRIC_AP].value, 9, 3);
        column(dst, m[RX_METRIC_MAGERR].value, 9, 2);
        column(dst, m[RX_METRIC_BIAS_MAG].value, 9, 3);
        column(dst, m[RX_METRIC_MAG50].value, 7, 2);
        column(dst, e->run->seconds, 9, 1);
        rx_text_add(dst, "\n");
    }
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
