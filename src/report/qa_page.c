/* report.html: one self-contained page without scripts. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "quality/bootstrap.h"
#include "report/escape.h"
#include "report/page.h"
#include "report/qa_writers.h"

static int digits_of(rx_metric metric)
{
    const char *unit = rx_metric_get(metric)->unit;
    if (metric >= RX_METRIC_FLUX_SCALE && metric <= RX_METRIC_PSF_GROWTH)
        return 4;
    if (strcmp(unit, "%") == 0 || metric == RX_METRIC_PULL_MEDIAN || metric == RX_METRIC_PULL_WIDTH ||
        metric == RX_METRIC_MAG50 || metric == RX_METRIC_MAG90)
        return 2;
    return 3;
}

static void estimate_cell(rx_text *dst, const rx_estimate *e, rx_metric metric)
{
    rx_page_cell_estimate(dst, e, digits_of(metric));
}

static void run_headings(rx_text *dst, const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++) {
        char name[64];
        const rx_qa_run *q = &r->input->runs[run];
        snprintf(name, sizeof name, q->by != NULL ? "%s (by %s)" : "%s", q->name, q->by);
        rx_page_head(dst, RX_RIGHT, name);
    }
    rx_page_row_end(dst);
}

/* Columns that hold another restorer's work. */
static void write_fallbacks(rx_text *dst, const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_run *q = &r->input->runs[run];
        if (q->by == NULL)
            continue;
        rx_text_add(dst, "<p><b class=\"v " RX_MARK_OPEN "\">");
        rx_escape_html(dst, q->name);
        rx_text_add(dst, ": done by ");
        rx_escape_html(dst, q->by);
        rx_text_add(dst, "</b>: ");
        rx_escape_html(dst, q->why);
        rx_text_add(dst, ". All numbers of this run are those of ");
        rx_escape_html(dst, q->by);
        rx_text_add(dst, ".</p>\n");
    }
}

static bool has_fluxes(const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].flux.n > 0)
            return true;
    return false;
}

static void ratio_row(rx_text *dst, const rx_report *r, const char *name, size_t value, size_t error)
{
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, name);
    for (int run = 0; run < r->input->nruns; run++) {
        const char *flux = (const char *)&r->input->runs[run].flux;
        const double ratio = *(const double *)(flux + value), sigma = *(const double *)(flux + error);
        if (r->input->runs[run].flux.n > 0 && isfinite(ratio))
            rx_text_printf(dst, "<td>%.4f &plusmn; %.4f</td>", ratio, sigma);
        else
            rx_page_cell_text(dst, NULL);
    }
    rx_page_row_end(dst);
}

static bool has_real(const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].real.n > 0)
            return true;
    return false;
}

/* What noise alone would make. */
static void write_real(rx_text *dst, const rx_report *r)
{
    if (!has_real(r))
        return;
    rx_page_section(dst, "noise", "Noise or sources");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "of the tile's own detections");
    run_headings(dst, r);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "share that is no noise peak");
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].real.n > 0)
            rx_page_cell_estimate(dst, &r->input->runs[run].real, 3);
        else
            rx_page_cell_text(dst, NULL);
    rx_page_row_end(dst);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "false detections per Mpixel of its noise");
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].blank.n > 0)
            rx_page_cell_estimate(dst, &r->input->runs[run].blank.rate, 3);
        else
            rx_page_cell_text(dst, NULL);
    rx_page_row_end(dst);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "factor that raised DETECT_THRESH for it");
    for (int run = 0; run < r->input->nruns; run++)
        rx_page_cell_number(dst, r->input->runs[run].blank.n > 0 ? r->input->runs[run].blank.raised : NAN, 3);
    rx_page_row_end(dst);
    rx_page_table_end(dst);
    rx_page_note(
        dst,
        "1 &minus; (false detections per Mpixel of this tile's noise, BLANK_CHECK) &times; (Mpixel of the "
        "tile without a mask or a source) / detections, with the interval of the rate. It covers noise on "
        "blank sky only: pieces of bright sources, ghosts, cosmic rays, and noise on top of sources count "
        "as real here. Where large or crowded sources raise the map of the noise, the rate is too high, and "
        "this share too low: then neither is more than a hint.");
}

/* Are the fluxes of restored pixels those of the tile? */
static void write_fluxes(rx_text *dst, const rx_report *r)
{
    if (!has_fluxes(r))
        return;
    rx_page_section(dst, "flux-scale", "Flux scale");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "restored over untouched flux");
    run_headings(dst, r);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "isolated sources of FLAGS 0 and S/N above 30");
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].flux.n > 0)
            rx_page_cell_count(dst, r->input->runs[run].flux.n);
        else
            rx_page_cell_text(dst, NULL);
    rx_page_row_end(dst);
    ratio_row(dst, r, "the same wide aperture", offsetof(rx_qa_flux, wide), offsetof(rx_qa_flux, wide_error));
    ratio_row(dst, r, "FLUX_AUTO over that aperture untouched", offsetof(rx_qa_flux, automatic),
              offsetof(rx_qa_flux, automatic_error));
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "flux scale");
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_flux *flux = &r->input->runs[run].flux;
        if (flux->n == 0)
            rx_page_cell_text(dst, NULL);
        else
            rx_page_cell_verdict(dst, flux->off ? RX_MARK_BAD : RX_MARK_GOOD, flux->off ? "off" : "right");
    }
    rx_page_row_end(dst);
    rx_page_table_end(dst);
    rx_page_note(
        dst, "Medians with 1 &sigma;. No reference is needed: the tile's own untouched pixels are the "
             "measure. Off: the aperture's ratio is more than 1 % and 5 &sigma; from 1, or FLUX_AUTO so much "
             "above it; FLUX_AUTO below it is the light that it leaves out.");
}

static void write_summary(rx_text *dst, const rx_report *r)
{
    rx_page_section(dst, "summary", "Summary");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "all magnitudes");
    rx_page_head(dst, RX_LEFT, "");
    run_headings(dst, r);
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        int arcsec = strcmp(row->unit, "arcsec") == 0;
        if ((arcsec && !(r->input->pixel_scale > 0)) || (m == RX_METRIC_FLUX_SCALE && !has_fluxes(r)) ||
            (m >= RX_METRIC_PSF_DT && m <= RX_METRIC_PSF_GROWTH &&
             rx_report_whole(r, 0, (rx_metric)m)->n == 0))
            continue;
        rx_text_printf(dst, "<tr><td class=\"t\"><b>%s</b>", row->name);
        rx_page_unit(dst, row->unit);
        rx_text_add(dst, "</td>");
        rx_page_cell_text(dst, m == RX_METRIC_PRECISION && r->input->precision_is != NULL
                                   ? r->input->precision_is
                                   : row->help);
        for (int run = 0; run < r->input->nruns; run++)
            estimate_cell(dst, rx_report_whole(r, run, (rx_metric)m), (rx_metric)m);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void count_row(rx_text *dst, const rx_report *r, const char *name,
                      double (*count)(const rx_evaluation *))
{
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, name);
    for (int run = 0; run < r->input->nruns; run++) {
        double v = count(&r->evaluation[run]);
        rx_page_cell_number(dst, v, v == floor(v) ? 0 : 1);
    }
    rx_page_row_end(dst);
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

static double n_made_up(const rx_evaluation *e)
{
    return e->run->tested ? (double)e->made_up : NAN;
}

static double n_made_up_matched(const rx_evaluation *e)
{
    return e->run->tested ? (double)e->made_up_matched : NAN;
}

static bool was_tested(const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].tested)
            return true;
    return false;
}

/* Which detections the untouched pixels do not want, and what the list is worth without them. */
static void write_made_up(rx_text *dst, const rx_report *r)
{
    if (!was_tested(r))
        return;
    rx_page_section(dst, "made-up", "Invented or real");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "marked by FLAGS_RESTORE");
    run_headings(dst, r);
    count_row(dst, r, "detections that count", n_made_up);
    count_row(dst, r, "of these matched all the same", n_made_up_matched);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "marked, per Mpixel (dropped ones included)");
    for (int run = 0; run < r->input->nruns; run++)
        rx_page_cell_number(dst, r->input->runs[run].made_up_per_mpixel, 1);
    rx_page_row_end(dst);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "precision of the list");
    for (int run = 0; run < r->input->nruns; run++)
        estimate_cell(dst, rx_report_whole(r, run, RX_METRIC_PRECISION), RX_METRIC_PRECISION);
    rx_page_row_end(dst);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "precision without them");
    for (int run = 0; run < r->input->nruns; run++)
        rx_page_cell_number(dst, rx_evaluation_precision_without(&r->evaluation[run]), 3);
    rx_page_row_end(dst);
    rx_page_table_end(dst);
    rx_page_note(dst,
                 "A source is marked when a template of it, fitted to the untouched pixels together with its "
                 "neighbours, says that it is rather not there (P_REAL below 0.5).");
}

static void write_counts(rx_text *dst, const rx_report *r)
{
    rx_page_section(dst, "counts", "What was compared");
    rx_text_printf(dst, "<p>Matched one to one, nearest pairs first, within %.4g pixels",
                   r->par->match_radius);
    if (r->par->match_radius_arcsec > 0)
        rx_text_printf(dst, " (%.4g arcsec)", r->par->match_radius_arcsec);
    rx_text_add(dst, ".</p>\n");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "sources");
    run_headings(dst, r);
    count_row(dst, r, "references that count", n_references);
    count_row(dst, r, "references outside the tile, masked or without a magnitude", n_references_ignored);
    count_row(dst, r, "detections that count", n_detections);
    count_row(dst, r, "detections outside, masked or on such a reference", n_detections_ignored);
    count_row(dst, r, "matched", n_matched);
    count_row(dst, r, "matches expected by chance (crowding)", n_chance);
    rx_page_table_end(dst);
    rx_page_note(dst,
                 "The last row matches lists that were shifted against each other, mean of 8 shifts: so many "
                 "references would find a partner even if positions were unrelated. When it is not small "
                 "against the matches, recall and precision are flattered; take a smaller radius.");
}

static void gate_row(rx_text *dst, const rx_report *r, const rx_gate_result *g)
{
    rx_page_row(dst, NULL);
    rx_page_cell_count(dst, g->gate->line);
    rx_page_cell_text(dst, g->gate->text);
    rx_page_cell_text(dst, g->run >= 0 ? r->input->runs[g->run].name : "no such run");
    estimate_cell(dst, &g->estimate, g->gate->metric);
    rx_text_printf(dst, "<td>%g</td>", g->gate->level);
    rx_page_cell_verdict(dst, rx_verdict_name(g->verdict), rx_verdict_name(g->verdict));
    rx_page_row_end(dst);
}

static void write_gates(rx_text *dst, const rx_report *r)
{
    if (r->nresults == 0)
        return;
    rx_page_section(dst, "gates", "Gates");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_RIGHT, "line");
    rx_page_head(dst, RX_LEFT, "gate");
    rx_page_head(dst, RX_LEFT, "run");
    rx_page_head(dst, RX_RIGHT, "measured");
    rx_page_head(dst, RX_RIGHT, "level");
    rx_page_head(dst, RX_LEFT, "verdict");
    rx_page_row_end(dst);
    for (long i = 0; i < r->nresults; i++)
        gate_row(dst, r, &r->result[i]);
    rx_page_table_end(dst);
    rx_page_note(dst, "PASS: the whole interval satisfies the gate. FAIL: the whole interval violates it. "
                      "INSUFFICIENT: the interval lies across the limit, more sources are needed to decide.");
}

static bool has_pictures(const rx_figures *figures)
{
    return figures->note[0] == '\0' && figures->n > 0 &&
           figures->figure[figures->n - 1].kind == RX_FIGURE_PICTURE;
}

static void write_pictures(rx_text *dst, const rx_figures *figures)
{
    if (!has_pictures(figures))
        return;
    rx_page_section(dst, "pictures", "Pictures");
    rx_page_figures(dst, figures, "picture");
    rx_page_note(dst,
                 "The middle of the tile, the same sky and grey scale for all: asinh(p / 2&sigma;), "
                 "&sigma; of the first "
                 "picture, black at &minus;2&sigma;, white where 99.8 % of the first picture is darker.");
}

static void write_figures(rx_text *dst, const rx_figures *figures)
{
    rx_page_section(dst, "figures", "Figures");
    rx_page_figures(dst, figures, "plot-");
}

static void bin_table(rx_text *dst, const rx_report *r, rx_metric metric)
{
    const rx_metric_row *row = rx_metric_get(metric);
    rx_page_heading(dst, row->name, row->unit);
    rx_text_add(dst, "<p class=\"r\">");
    rx_escape_html(dst, row->help);
    rx_text_add(dst, "</p>\n");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_RIGHT, metric == RX_METRIC_PRECISION ? "measured mag" : "reference mag");
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
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void write_tables(rx_text *dst, const rx_report *r)
{
    static const rx_metric shown[] = {
        RX_METRIC_RECALL,      RX_METRIC_PRECISION,      RX_METRIC_BIAS_MAG,
        RX_METRIC_SCATTER_MAG, RX_METRIC_BIAS_PERCENT,   RX_METRIC_SCATTER_PERCENT,
        RX_METRIC_MAGERR,      RX_METRIC_MAGERR_SHIFTED, RX_METRIC_DX,
        RX_METRIC_DY,          RX_METRIC_SCATTER_X,      RX_METRIC_SCATTER_Y,
        RX_METRIC_PULL_MEDIAN, RX_METRIC_PULL_WIDTH};
    rx_page_section(dst, "bins", "Tables by magnitude");
    for (size_t i = 0; i < sizeof shown / sizeof *shown; i++)
        bin_table(dst, r, shown[i]);
}

static void write_comparisons(rx_text *dst, const rx_report *r)
{
    if (r->ncomparisons == 0)
        return;
    rx_page_section(dst, "duel", "Restorers on the same references");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "first");
    rx_page_head(dst, RX_LEFT, "second");
    rx_page_head(dst, RX_RIGHT, "found by the first only");
    rx_page_head(dst, RX_RIGHT, "found by the second only");
    rx_page_head(dst, RX_RIGHT, "p");
    rx_page_row_end(dst);
    for (int i = 0; i < r->ncomparisons; i++) {
        const rx_comparison *c = &r->comparison[i];
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, r->input->runs[c->first].name);
        rx_page_cell_text(dst, r->input->runs[c->second].name);
        rx_page_cell_count(dst, c->only_first);
        rx_page_cell_count(dst, c->only_second);
        rx_page_cell_p(dst, c->p, log(c->p));
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    rx_page_note(
        dst,
        "McNemar's exact test on recall: p is the probability of a difference at least as uneven if both "
        "found sources equally well. With several pairs multiply p by their number. A run that detects "
        "more finds more: read it together with precision.");
}

static void promise_row(rx_text *dst, const rx_report *r, const char *name, int digits, size_t offset,
                        int metric)
{
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, name);
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_promise *p = r->input->runs[run].promise;
        if (p == NULL)
            continue;
        rx_page_cell_number(dst, *(const double *)((const char *)p + offset), digits);
        if (metric >= 0)
            estimate_cell(dst, rx_report_whole(r, run, (rx_metric)metric), (rx_metric)metric);
        else
            rx_page_cell_text(dst, NULL);
    }
    rx_page_row_end(dst);
}

/* Seeing or noise: the model's bin and the tile. */
static void domain_row(rx_text *dst, const rx_report *r, const char *name, size_t bin, size_t value)
{
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, name);
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_promise *p = r->input->runs[run].promise;
        if (p == NULL)
            continue;
        const double *limits = (const double *)((const char *)p + bin);
        if (p->inside)
            rx_text_printf(dst, "<td>%.4g &ndash; %.4g</td>", limits[0], limits[1]);
        else
            rx_page_cell_text(dst, NULL); /* the sentence above says which of both is out */
        rx_page_cell_number(dst, *(const double *)((const char *)p + value), 2);
    }
    rx_page_row_end(dst);
}

static bool has_promises(const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].promise != NULL)
            return true;
    return false;
}

static void promise_sentences(rx_text *dst, const rx_report *r)
{
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_promise *p = r->input->runs[run].promise;
        if (p == NULL)
            continue;
        rx_text_add(dst, "<p>");
        rx_escape_html(dst, r->input->runs[run].name);
        rx_text_add(dst, ": model ");
        rx_escape_html(dst, p->model);
        rx_text_add(dst, ", digest ");
        rx_escape_html(dst, p->digest);
        if (p->unfinished)
            rx_text_add(dst, "; its training has not ended");
        if (!p->inside) {
            rx_text_add(dst, ". It promises nothing here: ");
            rx_escape_html(dst, p->why);
        }
        rx_text_add(dst, ".</p>\n");
    }
}

static void write_promises(rx_text *dst, const rx_report *r)
{
    if (!has_promises(r))
        return;
    rx_page_section(dst, "promise", "What the model promises here");
    promise_sentences(dst, r);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "");
    for (int run = 0; run < r->input->nruns; run++)
        if (r->input->runs[run].promise != NULL) {
            rx_page_head(dst, RX_RIGHT, "promised");
            rx_page_head(dst, RX_RIGHT, "here");
        }
    rx_page_row_end(dst);
    domain_row(dst, r, "FWHM [pixels]", offsetof(rx_qa_promise, fwhm_bin), offsetof(rx_qa_promise, fwhm));
    domain_row(dst, r, "noise", offsetof(rx_qa_promise, noise_bin), offsetof(rx_qa_promise, noise));
    promise_row(dst, r, "recall", 3, offsetof(rx_qa_promise, recall), RX_METRIC_RECALL);
    promise_row(dst, r, "flux bias [%]", 2, offsetof(rx_qa_promise, bias), RX_METRIC_BIAS_PERCENT);
    promise_row(dst, r, "flux scatter [%]", 2, offsetof(rx_qa_promise, scatter), RX_METRIC_SCATTER_PERCENT);
    promise_row(dst, r, "test loss", 4, offsetof(rx_qa_promise, loss), -1);
    rx_page_table_end(dst);
    rx_page_note(
        dst,
        "Promised: what the model did on its test images of this seeing and noise (255 noise over the value "
        "that the brightest 0.1 % of the pixels exceed): recall of stars of S/N above 5, fluxes of stars of "
        "S/N above 12. Here: all references, of all magnitudes and kinds, as in the summary; faint ones "
        "lower the recall, galaxies and blends widen the scatter.");
}

static void write_reading(rx_text *dst, const rx_report *r)
{
    rx_page_section(dst, "reading", "How to read this");
    rx_text_printf(
        dst,
        "<p>Every number is followed by its %g %% interval and the number of sources behind it. Shares "
        "have Clopper-Pearson intervals, medians and sigma_MAD (1.4826 times the median absolute "
        "deviation) intervals from order statistics, MagErr, ap and the completeness magnitudes bootstrap "
        "intervals (%d draws, none for fewer than %d sources). An infinite end: too few sources, or the "
        "limit lies beyond the reference. Means, such as MagErr, follow single gross mismatches (a blend, a "
        "saturated reference); medians and sigma_MAD do not.</p>\n",
        100 * r->level, RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_text_add(
        dst, "<p><b>Recall</b> is counted by reference magnitude, <b>precision</b> by measured "
             "magnitude, all else by reference magnitude. Precision against a catalogue that is "
             "not deeper than the tile is a <b>lower bound</b>: a real source that the reference "
             "lacks counts as a false detection. Judge it at magnitudes where the reference is "
             "complete.</p>\n<p><b>Fluxes</b> are compared on the scale of the catalogue's zero "
             "point: F0 follows from the reference magnitude. Nothing is corrected silently: "
             "every table and figure uses the magnitudes as they are, only <b>magerr_shifted</b> "
             "takes out <b>zp_offset</b>, the median difference of bright (error up to 0.05 "
             "mag), unsaturated matches. An offset there is a matter of calibration or aperture, "
             "not of restoration.</p>\n<p><b>mag50</b> and <b>mag90</b> are read off the "
             "falling curve that is nearest to the single references (isotonic regression), whatever "
             "the bins of the tables; a value with an infinite end is a limit.</p>\n<p><b>Precision against "
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
    rx_page_section(dst, "restorers", "Restorers");
    static const char *const columns[] = {"run", "settings", "PSF", "noise of an aperture of area A",
                                          "files"};
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++)
        rx_page_head(dst, RX_LEFT, columns[i]);
    rx_page_row_end(dst);
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_qa_run *q = &r->input->runs[run];
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, q->name);
        rx_page_cell_text(dst, q->settings);
        rx_page_cell_text(dst, q->psf);
        rx_text_printf(dst,
                       "<td class=\"t\">%.3g &sigma; A<sup>%.3g</sup></td><td class=\"t\"><a "
                       "href=\"matches_%s.ecsv\">matches</a> <a href=\"pr_%s.ecsv\">curve</a></td>",
                       q->law_scale, q->law_power, r->stem[run], r->stem[run]);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    rx_page_note(
        dst,
        "&sigma; is the noise of a pixel, A the area in pixels: 1 &sigma; A<sup>0.5</sup> are independent "
        "pixels; what is restored is correlated, its errors grow faster with the aperture. Measured with "
        "empty apertures where errors are calibrated.");
}

static void write_record(rx_text *dst, const rx_report *r)
{
    if (r->input->nrecord == 0)
        return;
    rx_page_section(dst, "record", "What made this report");
    rx_page_record(dst, r->input->nrecord, r->input->record);
}

static void write_contents(rx_text *dst, const rx_report *r, const rx_figures *figures)
{
    rx_page_links_begin(dst);
    rx_page_link(dst, true, "summary", "Summary");
    rx_page_link(dst, has_real(r), "noise", "Noise or sources");
    rx_page_link(dst, has_fluxes(r), "flux-scale", "Flux scale");
    rx_page_link(dst, r->input->psf.psf != NULL, "psf", "The PSF");
    rx_page_link(dst, r->nresults > 0, "gates", "Gates");
    rx_page_link(dst, true, "counts", "What was compared");
    rx_page_link(dst, has_pictures(figures), "pictures", "Pictures");
    rx_page_link(dst, true, "figures", "Figures");
    rx_page_link(dst, true, "bins", "Tables");
    rx_page_link(dst, r->ncomparisons > 0, "duel", "Comparison");
    rx_page_link(dst, was_tested(r), "made-up", "Invented or real");
    rx_page_link(dst, has_promises(r), "promise", "The model");
    rx_page_link(dst, true, "reading", "How to read");
    rx_page_link(dst, true, "restorers", "Restorers");
    rx_page_link(dst, r->input->nrecord > 0, "record", "Record");
    rx_page_links_end(dst);
}

void rx_report_html(rx_text *dst, const rx_report *r, const rx_figures *figures)
{
    rx_page_begin(dst, "QA report: ", r->input->tile);
    rx_text_add(dst, "<p>against ");
    rx_escape_html(dst, r->input->reference);
    if (r->verdict != RX_VERDICT_NONE)
        rx_text_printf(dst, " &middot; gates: <b class=\"v %s\">%s</b>", rx_verdict_name(r->verdict),
                       rx_verdict_name(r->verdict));
    rx_text_add(dst, "</p>\n");
    write_contents(dst, r, figures);
    write_fallbacks(dst, r);
    write_summary(dst, r);
    write_real(dst, r);
    write_fluxes(dst, r);
    rx_report_psf_page(dst, r, figures);
    write_gates(dst, r);
    write_counts(dst, r);
    write_pictures(dst, figures);
    write_figures(dst, figures);
    write_tables(dst, r);
    write_comparisons(dst, r);
    write_made_up(dst, r);
    write_promises(dst, r);
    write_reading(dst, r);
    write_runs(dst, r);
    write_record(dst, r);
    rx_page_end(dst);
}
