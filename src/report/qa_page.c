/* The page of the QA report, from top to bottom, and its lines for the terminal. */
#include "report/qa_page.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "report/qa_tables.h"

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

static const double SUSPICIOUS = 0.5; /* mag: a zero point on another scale */
static const double SENSELESS = 1e4;  /* percent: an error of which the digits mean nothing */
static const double WRONG = 0.01;     /* of a curve of growth */

/* For the terminal alone: seconds are in no file, which are the same from run to run. */
RX_COLUMNS(BRIEF, RX_TEXT("run", ""), {"detections", RX_REPORT_COUNT, 0, "", "", "detected"},
           RX_COUNT("matched", ""), RX_NUMBER("recall", 3, "", ""), RX_NUMBER("precision", 3, "", ""),
           {"ap", RX_REPORT_NUMBER, 3, "", "", "AP"}, {"common", RX_REPORT_NUMBER, 2, "%", "", "MagErr/%"},
           {"magerr", RX_REPORT_NUMBER, 2, "%", "", "own/%"},
           {"bias_mag", RX_REPORT_NUMBER, 3, "mag", "", "bias/mag"}, RX_NUMBER("mag50", 2, "mag", ""),
           RX_NUMBER("seconds", 1, "s", ""));

RX_COLUMNS(BRIEF_GATES, {"line", RX_REPORT_COUNT, 0, "", "", "gate line"}, RX_TEXT("gate", ""),
           RX_TEXT("run", ""), RX_ESTIMATE("measured", -4, "", ""), RX_TEXT("verdict", ""));

typedef struct page {
    const rx_qa_numbers *q;
    rx_report *report;
    rx_qa_tables t;
} page;

/* The gates and, in a sentence, what was found; then whatever makes the numbers mean something else. */
static void add_verdicts(page *p)
{
    const rx_qa_numbers *q = p->q;
    const rx_qa_input *input = q->input;
    const rx_psf *psf = input->psf.psf;
    rx_text words = {0}, precisions = {0};
    long passed = 0;
    for (long i = 0; i < q->nresults; i++)
        passed += q->result[i].verdict == RX_VERDICT_PASS;
    if (q->nresults > 0)
        rx_text_printf(&words, "%ld of %ld gates pass. ", passed, q->nresults);
    if (input->nruns > 0)
        rx_text_printf(&words, "Of %ld references (%s) ", q->evaluation[0].references, input->reference);
    for (int run = 0; run < input->nruns; run++) {
        const char *comma = run > 0 ? ", " : "";
        rx_text_printf(&words, run == 0 ? "%s%s finds %.1f %%" : "%s%s %.1f %%", comma, input->runs[run].name,
                       100 * q->whole[run][RX_METRIC_RECALL].value);
        rx_text_printf(&precisions, "%s%.1f %%", comma, 100 * q->whole[run][RX_METRIC_PRECISION].value);
    }
    if (precisions.data != NULL)
        rx_text_printf(&words, "; of their detections %s are among them.", precisions.data);
    rx_report_verdict(p->report, q->verdict == RX_VERDICT_NONE ? RX_MARK_PALE : rx_verdict_name(q->verdict),
                      q->verdict == RX_VERDICT_NONE ? "Without gates." : rx_verdict_name(q->verdict),
                      words.data != NULL ? words.data : "");
    for (int run = 0; run < input->nruns; run++) {
        const rx_qa_run *r = &input->runs[run];
        char title[96], sentence[400];
        if (r->by != NULL) {
            snprintf(title, sizeof title, "%s: restored by %s instead", r->name, r->by);
            snprintf(sentence, sizeof sentence, "(%s). All numbers of this run are those of %s.", r->why,
                     r->by);
            rx_report_verdict(p->report, RX_MARK_OPEN, title, sentence);
        }
        if (r->by == NULL && r->taken != NULL) {
            snprintf(title, sizeof title, "%s: restored by %s.", r->name, r->taken);
            rx_report_verdict(p->report, RX_MARK_PALE, title, r->why);
        }
        if (r->by == NULL && r->promise != NULL && !r->promise->inside) {
            snprintf(title, sizeof title, "%s: its model promises nothing here.", r->name);
            rx_report_verdict(p->report, RX_MARK_OPEN, title, r->promise->why != NULL ? r->promise->why : "");
        }
        if (r->flux.n > 0 && r->flux.off) {
            snprintf(title, sizeof title, "%s: the flux scale is off.", r->name);
            const int n =
                snprintf(sentence, sizeof sentence,
                         "Restored over original flux of %ld isolated sources: %.4f in a wide aperture",
                         r->flux.n, r->flux.wide);
            snprintf(sentence + n, sizeof sentence - (size_t)n,
                     isfinite(r->flux.automatic) ? ", %.4f by FLUX_AUTO." : ".", r->flux.automatic);
            rx_report_verdict(p->report, RX_MARK_BAD, title, sentence);
        }
    }
    if (psf != NULL && psf->judged != NULL && fabs(psf->quality.growth) > WRONG)
        rx_report_verdict(p->report, RX_MARK_BAD,
                          "The curve of growth of stars differs from that of the PSF by more than 1 %.",
                          "Fluxes of templates may be off by as much.");
    rx_report_brief_of(p->report)->failed |= words.failed || precisions.failed;
    rx_text_free(&words);
    rx_text_free(&precisions);
}

/* Some columns of the runs, one below the other. */
static void show_runs(page *p, int n, const char *const *columns)
{
    rx_report_show(p->report, p->t.runs,
                   RX_VIEW(.turned = 1, .without_empty = 1, .ncolumns = n, .columns = columns));
}

static void show_summary(page *p)
{
    const char *columns[3 + RX_METRIC_COUNT] = {"run"};
    int n = 1;
    for (int run = 0; run < p->q->input->nruns && n == 1; run++)
        if (rx_qa_done_by(&p->q->input->runs[run]) != p->q->input->runs[run].name)
            columns[n++] = "done_by";
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        if (m == RX_METRIC_MAGERR &&
            p->q->input->nruns > 1) /* lists of other depths differ in magerr for that */
            columns[n++] = "common_magerr";
        if (m != RX_METRIC_FLUX_SCALE || rx_report_knows(p->t.runs, "flux_sources"))
            columns[n++] = rx_metric_get((rx_metric)m)->name;
    }
    rx_report_section(p->report, "summary", "Summary");
    show_runs(p, n, columns);
}

static void add_radius(page *p)
{
    char sentence[120], arcsec[40] = "";
    if (p->q->par->match_radius_arcsec > 0)
        snprintf(arcsec, sizeof arcsec, " (%.4g arcsec)", p->q->par->match_radius_arcsec);
    snprintf(sentence, sizeof sentence, "Matched one to one, nearest pairs first, within %.4g pixels%s.",
             p->q->par->match_radius, arcsec);
    rx_report_sentence(p->report, sentence);
}

static void show_psf(page *p)
{
    if (p->t.psf == NULL)
        return;
    rx_report_section(p->report, "psf", "The PSF");
    rx_report_show(p->report, p->t.psf, RX_VIEW(.turned = 1, .without_empty = 1));
    if (p->t.psf_bins == NULL)
        return;
    rx_report_place(p->report, "psf-");
    if (rx_report_rows(p->t.psf_bins) > 0)
        rx_report_show(p->report, p->t.psf_bins, RX_VIEW(.title = "Reserved stars by magnitude"));
    rx_report_note(p->report,
                   "Reserved stars were never fitted; shapes are under a round Gaussian as wide as the "
                   "PSF. psf_stars.ecsv and psf_growth.ecsv hold what is drawn.");
}

/* Sections of a table and how to read it: some of its columns, or all; there if something comes before it, or the
 * second one says something of any row. */
enum { COLUMNS_MAX = 9 };
static const struct section {
    const char *id, *title;
    size_t table; /* in rx_qa_tables */
    int turned;
    const char *columns[COLUMNS_MAX], *note;
    void (*before)(page *p); /* what comes before the table */
    void (*after)(page *p);  /* the next section */
} SECTIONS[] = {
    {"gates",
     "Gates",
     offsetof(rx_qa_tables, gates),
     0,
     {"line", "gate", "run", "measured", "level", "verdict"},
     "PASS: the whole interval satisfies the gate. FAIL: the whole interval violates it. "
     "INSUFFICIENT: the interval lies across the limit, more sources are needed to decide; or no "
     "run has the name of the gate.",
     NULL,
     NULL},
    {"counts",
     "What was compared",
     offsetof(rx_qa_tables, runs),
     1,
     {"run", "references", "references_ignored", "detections", "detections_ignored", "matched",
      "chance_matches", "common", "common_magerr"},
     "Where matches by chance are not few against the matches, recall and precision are "
     "flattered; take a smaller radius.",
     add_radius,
     NULL},
    {"noise",
     "Noise or sources",
     offsetof(rx_qa_tables, runs),
     1,
     {"run", "no_noise_peak", "false_per_mpixel", "threshold_raised", "false_per_mpixel_as_asked"},
     "1 &minus; (false detections per Mpixel of this tile's noise, BLANK_CHECK) &times; (Mpixel of the "
     "tile without a mask or a source) / detections, with the interval of the rate. It covers noise on "
     "blank sky only: pieces of bright sources, ghosts, cosmic rays, and noise on top of sources count "
     "as real here. Where large or crowded sources raise the map of the noise, the rate is too high, and "
     "this share too low: then neither is more than a hint.",
     NULL,
     NULL},
    {"spurious",
     "Spurious or real",
     offsetof(rx_qa_tables, runs),
     1,
     {"run", "spurious", "spurious_matched", "spurious_per_mpixel", "precision", "precision_without"},
     "A source is marked when a template of it, fitted to the original pixels together with its "
     "neighbours, says that it is rather not there (P_REAL below 0.5).",
     NULL,
     NULL},
    {"flags",
     "With and without each flag",
     offsetof(rx_qa_tables, flags),
     0,
     {NULL},
     "What leaving out the sources of a flag costs in recall, and gains in precision.",
     NULL,
     NULL},
    {"flux-scale",
     "Flux scale",
     offsetof(rx_qa_tables, runs),
     1,
     {"run", "flux_sources", "flux_aperture_pixels", "flux_aperture", "flux_auto", "flux_scale_is"},
     "Medians with 1 &sigma;. No reference is needed: the tile's own original pixels are the "
     "measure. Off: the ratio in the aperture is more than 1 % and 5 &sigma; from 1, or FLUX_AUTO "
     "so much above it; FLUX_AUTO below it is the light that it leaves out.",
     NULL,
     show_psf},
    {"duel",
     "Restorers on the same references",
     offsetof(rx_qa_tables, comparisons),
     0,
     {NULL},
     "McNemar's exact test on recall: p is the probability of a difference at least as uneven if both "
     "found sources equally well. With several pairs multiply p by their number. A run that detects "
     "more finds more: read it together with precision.",
     NULL,
     NULL},
    {"models",
     "What the model promises here",
     offsetof(rx_qa_tables, models),
     1,
     {NULL},
     "Promised: what the model did on its test images of this seeing and noise. Here: as in the "
     "summary; faint sources lower the recall, galaxies and blends widen the scatter.",
     NULL,
     NULL},
};

static void show_section(page *p, const struct section *s)
{
    const rx_report_table *t = *(rx_report_table *const *)((const char *)&p->t + s->table);
    int n = 0;
    while (n < COLUMNS_MAX && s->columns[n] != NULL)
        n++;
    if (s->before != NULL || (n > 0 ? rx_report_knows(t, s->columns[1]) : rx_report_rows(t) > 0)) {
        rx_report_section(p->report, s->id, s->title);
        if (s->before != NULL)
            s->before(p);
        rx_report_show(
            p->report, t,
            RX_VIEW(.turned = s->turned, .without_empty = s->turned, .ncolumns = n, .columns = s->columns));
        rx_report_note(p->report, s->note);
    }
    if (s->after != NULL)
        s->after(p);
}

static void show_bins(page *p)
{
    static const rx_metric shown[] = {
        RX_METRIC_RECALL,      RX_METRIC_PRECISION,      RX_METRIC_BIAS_MAG,
        RX_METRIC_SCATTER_MAG, RX_METRIC_BIAS_PERCENT,   RX_METRIC_SCATTER_PERCENT,
        RX_METRIC_MAGERR,      RX_METRIC_MAGERR_SHIFTED, RX_METRIC_DX,
        RX_METRIC_DY,          RX_METRIC_SCATTER_X,      RX_METRIC_SCATTER_Y,
        RX_METRIC_PULL_MEDIAN, RX_METRIC_PULL_WIDTH};
    rx_report_section(p->report, "bins", "Tables by magnitude");
    rx_report_fold(p->report, "Recall, precision, errors of magnitudes, fluxes and positions");
    for (int i = 0; i < COUNT(shown); i++) {
        const rx_report_column column = p->t.run_column[RX_QA_RUN_COLUMNS + shown[i]];
        rx_report_show(p->report, p->t.bins,
                       RX_VIEW(.from = p->q->input->nruns, .title = column.name, .unit = column.unit,
                               .note = column.help, .rows = {"mag_low", "mag_high"}, .across = {"run"},
                               .value = column.name, .digits = column.digits, .without_empty = 1));
    }
    rx_report_unfold(p->report);
}

static void show_reading(page *p)
{
    char html[800];
    rx_text score = {0};
    rx_report_section(p->report, "reading", "How to read this");
    snprintf(
        html, sizeof html,
        "Every number is followed by its %g %% interval and the number of sources behind it. Shares have "
        "Clopper-Pearson intervals, medians and sigma_MAD (1.4826 times the median absolute deviation) "
        "intervals from order statistics, MagErr, ap and the completeness magnitudes bootstrap intervals "
        "(%d draws, none for fewer than %d sources). An infinite end: too few sources, or the limit lies "
        "beyond the reference. Means, such as MagErr, follow single gross mismatches; medians and sigma_MAD "
        "do not.",
        100 * p->q->level, RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_report_paragraph(p->report, html);
    rx_report_paragraph(
        p->report,
        "<b>Recall</b> is counted by reference magnitude, <b>precision</b> by measured magnitude, all else "
        "by "
        "reference magnitude. Precision against a catalogue that is not deeper than the tile is a <b>lower "
        "bound</b>: a real source that the reference lacks counts as a false detection. <b>Fluxes</b> are "
        "compared on the scale of the catalogue's zero point; only <b>magerr_shifted</b> takes out "
        "<b>zp_offset</b>, the median difference of bright (error up to 0.05 mag), unsaturated matches. "
        "<b>mag50</b> and <b>mag90</b> are read off the falling curve that is nearest to the single "
        "references "
        "(isotonic regression); a value with an infinite end is a limit.");
    rx_text_printf(&score,
                   "Precision against recall ranks detections by %s, or by magnitude where a run has no "
                   "such score; ap is the area under its steps, without interpolation.",
                   p->q->input->score_name != NULL ? p->q->input->score_name : "score");
    rx_report_sentence(p->report, score.data);
    rx_report_brief_of(p->report)->failed |= score.failed;
    rx_text_free(&score);
}

/* Gates, where room is short only those that do not pass; then the runs. */
static void add_brief(page *p, bool whole)
{
    const rx_qa_numbers *q = p->q;
    rx_report_table *gates = RX_REPORT_TABLE(p->report, "gates", BRIEF_GATES, 0);
    rx_report_table *t = RX_REPORT_TABLE(p->report, "runs", BRIEF, 0);
    rx_text *brief = rx_report_brief_of(p->report);
    for (long i = 0; i < q->nresults; i++) {
        const rx_gate_result *r = &q->result[i];
        if (whole || r->verdict != RX_VERDICT_PASS)
            rx_report_put(gates, r->gate->line, r->gate->text,
                          r->run >= 0 ? q->input->runs[r->run].name : "no such run", r->estimate,
                          rx_verdict_name(r->verdict));
    }
    if (rx_report_rows(gates) > 0)
        rx_report_show_brief(p->report, gates, RX_VIEW(.intervals = 1));
    bool senseless = false;
    for (int run = 0; run < q->input->nruns; run++) {
        const rx_evaluation *e = &q->evaluation[run];
        const rx_estimate *m = q->whole[run];
        const double own = m[RX_METRIC_MAGERR].value, common = q->common[run];
        senseless = senseless || own > SENSELESS || common > SENSELESS;
        rx_report_put(t, e->run->name, e->detections, e->matched, m[RX_METRIC_RECALL].value,
                      m[RX_METRIC_PRECISION].value, m[RX_METRIC_AP].value, common > SENSELESS ? NAN : common,
                      own > SENSELESS ? NAN : own, m[RX_METRIC_BIAS_MAG].value, m[RX_METRIC_MAG50].value,
                      e->run->seconds);
    }
    rx_report_show_brief(p->report, t, RX_VIEW(.from = 0));
    if (whole)
        rx_text_printf(
            brief,
            "recall: share of the reference found; precision: share of detections in the reference; AP: area "
            "under their curve; mag50: half are found here\n"
            "MagErr: mean |F - F0| / F0 of the %ld sources that every list has; own: of all that the list "
            "has, "
            "the deeper the larger; bias: median; seconds: with measuring and checks\n",
            q->ncommon);
    if (senseless)
        rx_text_add(
            brief,
            "MagErr above 10,000 %: magnitudes and reference differ in zero point; give MAG_ZEROPOINT, or "
            "MAG_ZEROPOINT_KEY, the name of the header's card, such as MAGZERO\n");
}

/* What a user should see at once. */
static void warn(const rx_qa_numbers *q, rx_log *log)
{
    for (int run = 0; run < q->input->nruns; run++) {
        const double offset = q->evaluation[run].offset.value;
        if (isfinite(offset) && fabs(offset) > SUSPICIOUS)
            rx_log_warning(
                log, "%s: bright matches differ by %+.2f mag from the reference; is MAG_ZEROPOINT right?",
                q->input->runs[run].name, offset);
    }
    for (long i = 0; i < q->nresults; i++)
        if (q->result[i].run < 0)
            rx_log_warning(log, "%s, line %ld: no run is named %s", q->par->gates->path,
                           q->result[i].gate->line, q->result[i].gate->run);
}

static rx_status write_page(page *p, const rx_report_files *files, rx_text *brief, rx_error *err)
{
    static const char *const settings[] = {
        "run",       "settings", "psf",   "noise_law_scale", "noise_law_power",
        "pull_from", "matches",  "curve", "regions"};
    const rx_qa_input *input = p->q->input;
    rx_report *report = p->report;
    rx_qa_tables_add(report, p->q, &p->t);
    add_verdicts(p);
    add_brief(p, !rx_log_is_short(files->log));
    if (files->figures)
        rx_qa_figures(rx_report_figures_of(report), p->q);
    rx_report_section(report, "figures", "Figures");
    rx_report_place(report, "picture");
    rx_report_place(report, "plot-");
    if (input->npictures > 0 && files->figures)
        rx_report_note(report,
                       "Pictures: the middle of the tile, one grey scale for all: asinh(p / 2&sigma;), "
                       "&sigma; of the first picture, black at &minus;2&sigma;, white where 99.8 % of it is "
                       "darker.");
    show_summary(p);
    for (int i = 0; i < COUNT(SECTIONS); i++)
        show_section(p, &SECTIONS[i]);
    show_bins(p);
    show_reading(p);
    rx_report_section(report, "restorers", "Restorers");
    show_runs(p, COUNT(settings), settings);
    if (input->nrecord > 0) {
        rx_report_section(report, "record", "What made this report");
        rx_report_record(report, input->nrecord, input->record);
    }
    return rx_report_write(report, files, brief, err);
}

/* On the sky where the place there is known, else in pixels from 1. */
static void add_circle(rx_text *dst, const rx_qa_numbers *q, const rx_qa_list *list, long i)
{
    const double radius = q->par->match_radius, scale = q->input->pixel_scale;
    if (scale > 0 && list->alpha != NULL && isfinite(list->alpha[i]))
        rx_text_printf(dst, "icrs;circle(%.7f,%.7f,%.3f\")", list->alpha[i], list->delta[i], radius * scale);
    else
        rx_text_printf(dst, "image;circle(%.3f,%.3f,%.3f)", list->x[i] + 1, list->y[i] + 1, radius);
}

/* What a run missed and which of its detections are false, for DS9: a circle of the matching radius around each missed
 * reference (its magnitude beside it) and each false detection (its number). */
static rx_status write_regions(const rx_qa_numbers *numbers, int run, const char *stem,
                               const rx_report_files *files, rx_error *err)
{
    const rx_evaluation *e = &numbers->evaluation[run];
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    rx_text text = {0};
    char name[RX_QA_STEM + 16];
    rx_text_add(&text, "# Region file format: DS9 version 4.1\n"
                       "# cyan: missed, magnitude of the reference; red: false, row of the catalogue\n");
    for (long i = 0; i < truth->n; i++)
        if (e->truth_role[i] == RX_ROLE_UNMATCHED) {
            add_circle(&text, numbers, truth, i);
            rx_text_printf(&text, " # color=cyan text={%.2f} tag={missed}\n", truth->mag[i]);
        }
    for (long j = 0; j < list->n; j++)
        if (e->run_role[j] == RX_ROLE_UNMATCHED) {
            add_circle(&text, numbers, list, j);
            rx_text_printf(&text, " # color=red text={%ld} tag={false}\n", j + 1);
        }
    snprintf(name, sizeof name, "regions_%s.reg", stem);
    return rx_report_file(files->folder, files->shown, name, &text, err);
}

rx_status rx_qa_report(const rx_qa_params *par, const rx_qa_input *input, const char *folder,
                       const char *shown, rx_verdict *verdict, rx_text *brief, rx_error *err)
{
    const rx_report_files files = {
        .folder = folder, .shown = shown, .figures = par->figures, .gnuplot = par->gnuplot, .log = par->log};
    rx_qa_numbers numbers;
    page p = {.q = &numbers, .report = rx_report_new("QA report: ", input->tile)};
    rx_status status = rx_qa_numbers_make(par, input, &numbers, err);
    if (status == RX_OK && p.report == NULL)
        status = rx_error_memory(err, 0);
    if (status == RX_OK) {
        warn(&numbers, par->log);
        status = write_page(&p, &files, brief, err);
    }
    for (int run = 0; run < input->nruns && status == RX_OK; run++)
        status = write_regions(&numbers, run, p.t.stem[run], &files, err);
    if (status == RX_OK && verdict != NULL)
        *verdict = numbers.verdict;
    free(p.t.stem);
    rx_report_free(p.report);
    rx_qa_numbers_free(&numbers);
    return status;
}
