/* report.html: one self-contained page without scripts. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "validate/bootstrap.h"
#include "validate/escape.h"
#include "validate/qa_writers.h"

static const char STYLE[] =
    "body{font:15px/1.5 system-ui,sans-serif;color:#222;background:#fff;max-width:1100px;margin:0 "
    "auto;padding:1em 1.5em}h1{font-size:1.6em;margin:.3em 0}h2{font-size:1.25em;margin:2em 0 "
    ".5em;border-bottom:1px solid #ddd}nav "
    "a{margin-right:1em}a{color:#0b5394}table{border-collapse:collapse;margin:.7em "
    "0;font-size:.92em}th,td{padding:.25em .7em;text-align:right;border-bottom:1px solid "
    "#e6e6e6;white-space:nowrap}th{background:#f6f6f6}td.t,th.t{text-align:left;white-space:normal}td "
    "small{color:#777}p.r{color:#555;font-size:.92em;margin:.2em 0 "
    "1em;max-width:64em}.f{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0;flex:0 1 "
    "520px}figure.p{flex:0 1 300px}figure svg{width:100%;height:auto}figcaption "
    "b{display:block}figcaption{color:#555;font-size:.9em}.PASS{color:#1b7a2b}.FAIL{color:#b3261e}."
    "INSUFFICIENT{color:#9a6700}b.v{font-size:1.2em}.w{overflow-x:auto}";

static void heading(rx_text *dst, const char *id, const char *title)
{
    rx_text_printf(dst, "<h2 id=\"%s\">%s</h2>\n", id, title);
}

static void paragraph(rx_text *dst, const char *text)
{
    rx_text_printf(dst, "<p class=\"r\">%s</p>\n", text);
}

static void text_cell(rx_text *dst, const char *text)
{
    rx_text_add(dst, "<td class=\"t\">");
    if (text != NULL && text[0] != '\0')
        rx_escape_html(dst, text);
    else
        rx_text_add(dst, "&ndash;");
    rx_text_add(dst, "</td>");
}

static int digits_of(rx_metric metric)
{
    const char *unit = rx_metric_get(metric)->unit;
    if (strcmp(unit, "%") == 0 || metric == RX_METRIC_PULL_MEDIAN || metric == RX_METRIC_PULL_WIDTH ||
        metric == RX_METRIC_MAG50 || metric == RX_METRIC_MAG90)
        return 2;
    return 3;
}

static void number(rx_text *dst, double value, int digits)
{
    if (isnan(value))
        rx_text_add(dst, "&ndash;");
    else if (isinf(value))
        rx_text_add(dst, value > 0 ? "&infin;" : "&minus;&infin;");
    else if (fabs(value) >= 1e6)
        rx_text_printf(dst, "%.3g", value);
    else if (fabs(value) < 0.5 * pow(10, -digits))
        rx_text_printf(dst, "%.*f", digits, 0.0);
    else
        rx_text_printf(dst, "%.*f", digits, value);
}

static void interval_text(rx_text *dst, const rx_estimate *e, int digits)
{
    number(dst, e->value, digits);
    rx_text_add(dst, " <small>[");
    number(dst, e->low, digits);
    rx_text_add(dst, ", ");
    number(dst, e->high, digits);
    rx_text_printf(dst, "] n=%ld</small>", e->n);
}

static void estimate_cell(rx_text *dst, const rx_estimate *e, rx_metric metric)
{
    rx_text_add(dst, "<td>");
    if (e->n == 0)
        rx_text_add(dst, "&ndash;");
    else
        interval_text(dst, e, digits_of(metric));
    rx_text_add(dst, "</td>");
}

static void run_headings(rx_text *dst, const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_add(dst, "<th>");
        rx_escape_html(dst, r->input->runs[run].name);
        rx_text_add(dst, "</th>");
    }
    rx_text_add(dst, "</tr>\n");
}

static void write_summary(rx_text *dst, const rx_report *r)
{
    heading(dst, "summary", "Summary");
    rx_text_add(dst, "<div class=\"w\"><table><tr><th class=\"t\">all magnitudes</th><th class=\"t\"></th>");
    run_headings(dst, r);
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        int arcsec = strcmp(row->unit, "arcsec") == 0;
        if (arcsec && !(r->input->pixel_scale > 0))
            continue;
        rx_text_printf(dst, "<tr><td class=\"t\"><b>%s</b>%s%s%s</td><td class=\"t\">", row->name,
                       row->unit[0] != '\0' ? " [" : "", row->unit, row->unit[0] != '\0' ? "]" : "");
        rx_escape_html(dst, row->help);
        rx_text_add(dst, "</td>");
        for (int run = 0; run < r->input->nruns; run++)
            estimate_cell(dst, rx_report_whole(r, run, (rx_metric)m), (rx_metric)m);
        rx_text_add(dst, "</tr>\n");
    }
    rx_text_add(dst, "</table></div>\n");
}

static void count_row(rx_text *dst, const rx_report *r, const char *name,
                      double (*count)(const rx_evaluation *))
{
    rx_text_printf(dst, "<tr><td class=\"t\">%s</td>", name);
    for (int run = 0; run < r->input->nruns; run++) {
        double v = count(&r->evaluation[run]);
        rx_text_printf(dst, v == floor(v) ? "<td>%.0f</td>" : "<td>%.1f</td>", v);
    }
    rx_text_add(dst, "</tr>\n");
}

static double n_references(const rx_evaluation *e)
{
    return (double)e->references;
}

static double n_references_ignored(const rx_evaluation *e)
{
    return (double)e->references_ignored;
}

static double n_detections(const rx_evaluation *e)
{
    return (double)e->detections;
}

static double n_detections_ignored(const rx_evaluation *e)
{
    return (double)e->detections_ignored;
}

static double n_matched(const rx_evaluation *e)
{
    return (double)e->matched;
}

static double n_chance(const rx_evaluation *e)
{
    return e->chance;
}

static void write_counts(rx_text *dst, const rx_report *r)
{
    heading(dst, "counts", "What was compared");
    rx_text_printf(dst, "<p>Matched one to one, nearest pairs first, within %.4g pixels",
                   r->par->match_radius);
    if (r->par->match_radius_arcsec > 0)
        rx_text_printf(dst, " (%.4g arcsec)", r->par->match_radius_arcsec);
    rx_text_add(dst, ".</p>\n<table><tr><th class=\"t\">sources</th>");
    run_headings(dst, r);
    count_row(dst, r, "references that count", n_references);
    count_row(dst, r, "references outside the tile, masked or without a magnitude", n_references_ignored);
    count_row(dst, r, "detections that count", n_detections);
    count_row(dst, r, "detections outside, masked or on such a reference", n_detections_ignored);
    count_row(dst, r, "matched", n_matched);
    count_row(dst, r, "matches expected by chance (crowding)", n_chance);
    rx_text_add(dst, "</table>\n");
    paragraph(dst,
              "The last row matches lists that were shifted against each other, mean of 8 shifts: so many "
              "references would find a partner even if positions were unrelated. When it is not small "
              "against the matches, recall and precision are flattered; take a smaller radius.");
}

static void gate_row(rx_text *dst, const rx_report *r, const rx_gate_result *g)
{
    rx_text_printf(dst, "<tr><td>%ld</td>", g->gate->line);
    text_cell(dst, g->gate->text);
    text_cell(dst, g->run >= 0 ? r->input->runs[g->run].name : "no such run");
    estimate_cell(dst, &g->estimate, g->gate->metric);
    rx_text_printf(dst, "<td>%g</td><td class=\"t %s\"><b>%s</b></td></tr>\n", g->gate->level,
                   rx_verdict_name(g->verdict), rx_verdict_name(g->verdict));
}

static void write_gates(rx_text *dst, const rx_report *r)
{
    if (r->nresults == 0)
        return;
    heading(dst, "gates", "Gates");
    rx_text_add(dst,
                "<table><tr><th>line</th><th class=\"t\">gate</th><th "
                "class=\"t\">run</th><th>measured</th><th>level</th><th class=\"t\">verdict</th></tr>\n");
    for (long i = 0; i < r->nresults; i++)
        gate_row(dst, r, &r->result[i]);
    rx_text_add(dst, "</table>\n");
    paragraph(dst, "PASS: the whole interval satisfies the gate. FAIL: the whole interval violates it. "
                   "INSUFFICIENT: the interval lies across the limit, more sources are needed to decide.");
}

static void write_pictures(rx_text *dst, const rx_report *r, const rx_figures *figures)
{
    if (figures->npictures == 0)
        return;
    heading(dst, "pictures", "Pictures");
    rx_text_add(dst, "<div class=\"f\">\n");
    for (int k = 0; k < figures->npictures; k++) {
        if (figures->picture[k] == NULL)
            continue;
        rx_text_printf(dst, "<figure class=\"p\">%s<figcaption>", figures->picture[k]);
        rx_escape_html(dst, r->input->pictures[k].title);
        rx_text_add(dst, "</figcaption></figure>\n");
    }
    rx_text_add(dst, "</div>\n");
    paragraph(dst, "The middle of the tile, the same sky and grey scale for all: asinh(p / 2&sigma;), "
                   "&sigma; of the first "
                   "picture, black at &minus;2&sigma;, white where 99.8 % of the first picture is darker.");
}

static void write_figures(rx_text *dst, const rx_figures *figures)
{
    heading(dst, "figures", "Figures");
    if (figures->note[0] != '\0') {
        rx_text_add(dst, "<p><b>No figures:</b> ");
        rx_escape_html(dst, figures->note);
        rx_text_add(dst, ". The tables below are complete.</p>\n");
        return;
    }
    rx_text_add(dst, "<div class=\"f\">\n");
    for (int i = 0; i < figures->n; i++) {
        const rx_figure *f = &figures->figure[i];
        rx_text_printf(dst, "<figure>%s<figcaption><b>%s</b>%s</figcaption></figure>\n",
                       f->svg != NULL ? f->svg : "<p>not drawn</p>", f->title, f->reading);
    }
    rx_text_add(dst, "</div>\n");
}

static void bin_table(rx_text *dst, const rx_report *r, rx_metric metric)
{
    const rx_metric_row *row = rx_metric_get(metric);
    rx_text_printf(dst, "<h3>%s%s%s%s</h3>\n<p class=\"r\">", row->name, row->unit[0] != '\0' ? " [" : "",
                   row->unit, row->unit[0] != '\0' ? "]" : "");
    rx_escape_html(dst, row->help);
    rx_text_printf(dst, "</p>\n<div class=\"w\"><table><tr><th>%s</th>",
                   metric == RX_METRIC_PRECISION ? "measured mag" : "reference mag");
    run_headings(dst, r);
    for (int b = 0; b < r->bins.n; b++) {
        long n = 0;
        for (int run = 0; run < r->input->nruns; run++)
            n += rx_report_bin(r, run, b, metric)->n;
        if (n == 0)
            continue;
        rx_text_printf(dst, "<tr><td>%g &ndash; %g</td>", r->bins.edge[b], r->bins.edge[b + 1]);
        for (int run = 0; run < r->input->nruns; run++)
            estimate_cell(dst, rx_report_bin(r, run, b, metric), metric);
        rx_text_add(dst, "</tr>\n");
    }
    rx_text_add(dst, "</table></div>\n");
}

static void write_tables(rx_text *dst, const rx_report *r)
{
    static const rx_metric shown[] = {
        RX_METRIC_RECALL,      RX_METRIC_PRECISION,      RX_METRIC_BIAS_MAG,
        RX_METRIC_SCATTER_MAG, RX_METRIC_BIAS_PERCENT,   RX_METRIC_SCATTER_PERCENT,
        RX_METRIC_MAGERR,      RX_METRIC_MAGERR_SHIFTED, RX_METRIC_DX,
        RX_METRIC_DY,          RX_METRIC_SCATTER_X,      RX_METRIC_SCATTER_Y,
        RX_METRIC_PULL_MEDIAN, RX_METRIC_PULL_WIDTH};
    heading(dst, "bins", "Tables by magnitude");
    for (size_t i = 0; i < sizeof shown / sizeof *shown; i++)
        bin_table(dst, r, shown[i]);
}

static void write_comparisons(rx_text *dst, const rx_report *r)
{
    if (r->ncomparisons == 0)
        return;
    heading(dst, "duel", "Restorers on the same references");
    rx_text_add(dst, "<table><tr><th class=\"t\">first</th><th class=\"t\">second</th><th>found by the first "
                     "only</th><th>found by the second only</th><th>p</th></tr>\n");
    for (int i = 0; i < r->ncomparisons; i++) {
        const rx_comparison *c = &r->comparison[i];
        rx_text_add(dst, "<tr>");
        text_cell(dst, r->input->runs[c->first].name);
        text_cell(dst, r->input->runs[c->second].name);
        rx_text_printf(dst, "<td>%ld</td><td>%ld</td><td>%.3g</td></tr>\n", c->only_first, c->only_second,
                       c->p);
    }
    rx_text_add(dst, "</table>\n");
    paragraph(
        dst,
        "McNemar's exact test on recall: p is the probability of a difference at least as uneven if both "
        "found sources equally well. With several pairs multiply p by their number. A run that detects "
        "more finds more: read it together with precision.");
}

static void write_reading(rx_text *dst, const rx_report *r)
{
    heading(dst, "reading", "How to read this");
    rx_text_printf(
        dst,
        "<p>Every number is followed by its %g %% interval and the number of sources behind it. Shares "
        "have Clopper-Pearson intervals, medians and sigma_MAD (1.4826 times the median absolute "
        "deviation) intervals from order statistics, MagErr, ap and the completeness magnitudes bootstrap "
        "intervals (%d draws, none for fewer than %d sources). An infinite end: too few sources, or the "
        "limit lies beyond the reference. Means, such as MagErr, follow single gross mismatches (a blend, a "
        "saturated reference); medians and sigma_MAD do not.</p>\n",
        100 * r->level, RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_text_add(dst, "<p><b>Recall</b> is counted by reference magnitude, <b>precision</b> by measured "
                     "magnitude, all else by reference magnitude. Precision against a catalogue that is "
                     "not deeper than the tile is a <b>lower bound</b>: a real source that the reference "
                     "lacks counts as a false detection. Judge it at magnitudes where the reference is "
                     "complete.</p>\n<p><b>Fluxes</b> are compared on the scale of the catalogue's zero "
                     "point: F0 follows from the reference magnitude. Nothing is corrected silently: "
                     "every table and figure uses the magnitudes as they are, only <b>magerr_shifted</b> "
                     "takes out <b>zp_offset</b>, the median difference of bright (error up to 0.05 "
                     "mag), unsaturated matches. An offset there is a matter of calibration or aperture, "
                     "not of restoration.</p>\n<p><b>mag50</b> and <b>mag90</b> are scanned from the "
                     "faint end over bins of 5 references or more, with linear interpolation between bin "
                     "centres; a value with an infinite end is a limit.</p>\n<p><b>Precision against "
                     "recall</b> ranks detections by ");
    rx_escape_html(dst, r->input->score_name != NULL ? r->input->score_name : "score");
    rx_text_add(
        dst, ", or by magnitude where a run has no such score; ap = &Sigma; (R<sub>n</sub> &minus; "
             "R<sub>n&minus;1</sub>) P<sub>n</sub>, without interpolation.</p>\n<p>Every source, matched, "
             "missed or false, is listed in matches_*.ecsv beside this page; all numbers are in summary.json "
             "and bins.ecsv.</p>\n");
}

static void write_runs(rx_text *dst, const rx_report *r)
{
    heading(dst, "restorers", "Restorers");
    rx_text_add(dst, "<table><tr><th class=\"t\">run</th><th class=\"t\">settings</th><th "
                     "class=\"t\">PSF</th><th class=\"t\">noise of an aperture of area A</th><th "
                     "class=\"t\">files</th></tr>\n");
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_run *q = &r->input->runs[run];
        rx_text_add(dst, "<tr>");
        text_cell(dst, q->name);
        text_cell(dst, q->settings);
        text_cell(dst, q->psf);
        rx_text_printf(dst,
                       "<td class=\"t\">%.3g &sigma; A<sup>%.3g</sup></td><td class=\"t\"><a "
                       "href=\"matches_%s.ecsv\">matches</a> <a href=\"pr_%s.ecsv\">curve</a></td></tr>\n",
                       q->law_scale, q->law_power, r->stem[run], r->stem[run]);
    }
    rx_text_add(dst, "</table>\n");
    paragraph(
        dst,
        "&sigma; is the noise of a pixel, A the area in pixels: 1 &sigma; A<sup>0.5</sup> are independent "
        "pixels; what is restored is correlated, its errors grow faster with the aperture. Measured with "
        "empty apertures where errors are calibrated.");
}

static void write_record(rx_text *dst, const rx_report *r)
{
    if (r->input->nrecord == 0)
        return;
    heading(dst, "record", "What made this report");
    rx_text_add(dst, "<details><summary>configuration and inputs</summary><table>\n");
    for (int i = 0; i < r->input->nrecord; i++) {
        rx_text_add(dst, "<tr>");
        text_cell(dst, r->input->record[i][0]);
        text_cell(dst, r->input->record[i][1]);
        rx_text_add(dst, "</tr>\n");
    }
    rx_text_add(dst, "</table></details>\n");
}

static void write_contents(rx_text *dst, const rx_report *r, const rx_figures *figures)
{
    rx_text_add(dst, "<nav><a href=\"#summary\">Summary</a>");
    rx_text_add(dst, r->nresults > 0 ? "<a href=\"#gates\">Gates</a>" : "");
    rx_text_add(dst, "<a href=\"#counts\">What was compared</a>");
    rx_text_add(dst, figures->npictures > 0 ? "<a href=\"#pictures\">Pictures</a>" : "");
    rx_text_add(dst, "<a href=\"#figures\">Figures</a><a href=\"#bins\">Tables</a>");
    rx_text_add(dst, r->ncomparisons > 0 ? "<a href=\"#duel\">Comparison</a>" : "");
    rx_text_add(dst, "<a href=\"#reading\">How to read</a><a href=\"#restorers\">Restorers</a>");
    rx_text_add(dst, r->input->nrecord > 0 ? "<a href=\"#record\">Record</a>" : "");
    rx_text_add(dst, "</nav>\n");
}

void rx_report_html(rx_text *dst, const rx_report *r, const rx_figures *figures)
{
    rx_text_add(dst, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n<meta "
                     "name=\"viewport\" content=\"width=device-width\">\n<title>QA report: ");
    rx_escape_html(dst, r->input->tile);
    rx_text_printf(dst, "</title>\n<style>%s</style></head>\n<body>\n<h1>QA report: ", STYLE);
    rx_escape_html(dst, r->input->tile);
    rx_text_add(dst, "</h1>\n<p>against ");
    rx_escape_html(dst, r->input->reference);
    if (r->verdict != RX_VERDICT_NONE)
        rx_text_printf(dst, " &middot; gates: <b class=\"v %s\">%s</b>", rx_verdict_name(r->verdict),
                       rx_verdict_name(r->verdict));
    rx_text_add(dst, "</p>\n");
    write_contents(dst, r, figures);
    write_summary(dst, r);
    write_gates(dst, r);
    write_counts(dst, r);
    write_pictures(dst, r, figures);
    write_figures(dst, figures);
    write_tables(dst, r);
    write_comparisons(dst, r);
    write_reading(dst, r);
    write_runs(dst, r);
    write_record(dst, r);
    rx_text_add(dst, "</body></html>\n");
}
