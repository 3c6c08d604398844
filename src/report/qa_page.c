/* The page of the QA report: its tables, which its files hold, the page from top to bottom, and its lines for the
 * terminal. */
#include "report/qa_page.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "data/flags.h"
#include "data/sources.h"
#include "report/formats.h"
#include "report/report.h"

static const double SUSPICIOUS = 0.5; /* mag: a zero point on another scale */
static const double SENSELESS = 1e4;  /* percent: an error of which the digits mean nothing */
static const double WRONG = 0.01;     /* of a curve of growth */

/* --- the columns --- */

/* Every metric over all magnitudes comes behind these. */
RX_COLUMNS(
    RUNS, RX_TEXT("run", "restorer", ""), RX_TEXT("done_by", "restorer that did it", "done by"),
    RX_TEXT("why", "why that one"), RX_TEXT("settings", ""), RX_TEXT("psf", "of the restoration", "PSF"),
    RX_NUMBER("noise_law_scale", 3, "",
              "c: noise of an aperture of A pixels is c sigma A^power, sigma that of a pixel",
              "noise, scale"),
    RX_NUMBER(
        "noise_law_power", 3, "",
        "0.5: independent pixels; what is restored is correlated, its errors grow faster with the aperture",
        "noise, power"),
    RX_TEXT("pull_from", "whether pulls are of fluxes or magnitudes", "pulls of"),
    RX_LINK("matches", "every source, matched, missed or false"),
    RX_LINK("curve", "precision against recall"), RX_LINK("regions", "missed and false ones, for DS9"),
    RX_COUNT("references", "that count"),
    RX_COUNT("references_ignored", "outside the tile, masked or without a magnitude", "references ignored"),
    RX_COUNT("detections", "that count"),
    RX_COUNT("detections_ignored", "outside, masked or on such a reference", "detections ignored"),
    RX_COUNT("matched", "one to one, nearest pairs first"),
    RX_NUMBER("chance_matches", 1, "", "matches if positions were unrelated: mean of 8 shifted lists",
              "matched by chance"),
    RX_COUNT("common", "references that every run has matched"),
    RX_NUMBER("common_magerr", 2, "%", "magerr of these alone"),
    RX_NUMBER("spurious", 0, "", "detections marked by FLAGS_RESTORE, P_REAL below 0.5"),
    RX_NUMBER("spurious_matched", 0, "", "of these matched all the same", "matched all the same"),
    RX_NUMBER("spurious_per_mpixel", 1, "1/Mpix", "marked, those included that were dropped", "spurious"),
    RX_NUMBER("precision_without", 3, "", "precision of the list without them", "precision without"),
    RX_NUMBER("blank_realisations", 0, "", "of the tile's noise (BLANK_CHECK)", "realisations"),
    RX_NUMBER("blank_mpixels", 3, "Mpix", "searched in them", "searched"),
    RX_ESTIMATE("false_per_mpixel", 3, "1/Mpix", "false detections on the tile's noise", "false detections"),
    RX_NUMBER("threshold_raised", 3, "", "DETECT_THRESH was multiplied by this for them", "threshold raised"),
    RX_NUMBER("false_per_mpixel_as_asked", 3, "1/Mpix", "false detections without that", "at DETECT_THRESH"),
    RX_ESTIMATE("no_noise_peak", 3, "", "share of the tile's own detections that is no noise peak",
                "no noise peak"),
    RX_NUMBER("flux_sources", 0, "", "isolated sources of FLAGS 0 and S/N above 30", "sources"),
    RX_NUMBER("flux_aperture_pixels", 2, "pix", "diameter of one wide aperture", "aperture"),
    RX_MEASURED("flux_aperture", 4, "", "restored over original flux in this aperture", "flux ratio"),
    RX_MEASURED("flux_auto", 4, "", "restored FLUX_AUTO over the original flux in it", "FLUX_AUTO"),
    RX_MARKED("flux_scale_is", "right or off", "flux scale"));
RX_COLUMNS(BINS, RX_TEXT("run", "restorer"),
           RX_NUMBER("mag_low", -4, "mag", "bin, inclusive; nan in both: all magnitudes", "from"),
           RX_NUMBER("mag_high", -4, "mag", "bin, exclusive", "to"));
enum { STEM = 48, NRUNS = RX_LENGTH(RUNS), NBINS = RX_LENGTH(BINS) }; /* beside those of the metrics */

RX_COLUMNS(MODELS, RX_TEXT("run", "restorer", ""), RX_TEXT("model", "name"), RX_TEXT("digest", "of its file"),
           RX_TEXT("outside", "what this tile has that its training had not: then nothing is promised"),
           RX_TEXT("training", "whether it has ended"), RX_NUMBER("fwhm", 2, "pix", "of the tile", "FWHM"),
           RX_NUMBER("fwhm_low", -4, "pix", "bin of the model, from", "FWHM from"),
           RX_NUMBER("fwhm_high", -4, "pix", "to", "FWHM to"),
           RX_NUMBER("noise", 2, "", "of the tile: 255 noise / value that 0.1 % of the pixels exceed"),
           RX_NUMBER("noise_low", -4, "", "bin of the model, from", "noise from"),
           RX_NUMBER("noise_high", -4, "", "to", "noise to"),
           RX_NUMBER("recall", 3, "", "promised: of test stars of S/N above 5"),
           RX_ESTIMATE("recall_here", 3, "", "all references, of all magnitudes and kinds", "recall here"),
           RX_NUMBER("bias_percent", 2, "%", "promised: fluxes of test stars of S/N above 12", "flux bias"),
           RX_ESTIMATE("bias_percent_here", 2, "%", "of all matches", "flux bias here"),
           RX_NUMBER("scatter_percent", 2, "%", "promised: fluxes of test stars of S/N above 12",
                     "flux scatter"),
           RX_ESTIMATE("scatter_percent_here", 2, "%", "of all matches", "flux scatter here"),
           RX_NUMBER("loss", 4, "", "mean over test images of this seeing and noise", "test loss"));

RX_COLUMNS(FLAGS, RX_TEXT("run", "restorer"), RX_TEXT("column", ""), RX_COUNT("bit", ""),
           RX_TEXT("name", "of the bit"), RX_TEXT("meaning", "what the bit says"),
           RX_COUNT("detections", "that count and have it"), RX_COUNT("matched", "of these"),
           RX_ESTIMATE("recall", 3, "", "of all detections"),
           RX_ESTIMATE("recall_without", 3, "", "if those that have it are left out", "recall without"),
           RX_ESTIMATE("precision", 3, "", "of all detections"),
           RX_ESTIMATE("precision_without", 3, "", "if those that have it are left out",
                       "precision without"));

RX_COLUMNS(METRICS, RX_TEXT("metric", ""), RX_TEXT("unit", ""), RX_TEXT("meaning", ""));

RX_COLUMNS(GATES, RX_COUNT("line", "of the gates file"), RX_TEXT("gate", ""), RX_TEXT("run", ""),
           RX_TEXT("metric", ""), RX_NUMBER("mag_low", -4, "mag", "none: all magnitudes"),
           RX_NUMBER("mag_high", -4, "mag", ""), RX_TEXT("operator", ""), RX_NUMBER("limit", -4, "", ""),
           RX_NUMBER("limit_high", -4, "", ""), RX_NUMBER("level", -4, "", "of the interval"),
           RX_ESTIMATE("measured", -4, "", ""), RX_MARKED("verdict", ""));

RX_COLUMNS(PSF, RX_TEXT("how", "how it came about", "RXPSFHOW"),
           RX_MEASURED("fwhm", 3, "pix", "at the centre", "FWHM"),
           RX_NUMBER("stars", 0, "", "that it was fitted to"),
           RX_NUMBER("flux_error", 4, "", "relative error of fluxes from it", "error of fluxes"),
           RX_NUMBER("reserved", 0, "", "stars that were not fitted, to test it"),
           RX_MEASURED("dt", 5, "", "their mean (T - T of PSF) / T, T = <x²> + <y²>", "dT/T"),
           RX_MEASURED("de1", 5, "", "their mean e1 - e1 of PSF, e1 = (<x²> - <y²>) / T"),
           RX_MEASURED("de2", 5, "", "their mean e2 - e2 of PSF, e2 = 2 <xy> / T"),
           RX_NUMBER("residual", 4, "", "stacked stars - PSF, largest, share of the peak"),
           RX_MEASURED("growth", 4, "", "curve of growth, largest stars - PSF"),
           RX_NUMBER("growth_radius", 1, "pix", "where that is", "at radius"));

RX_COLUMNS(PSF_BINS, RX_NUMBER("mag", 2, "mag", "middle of the range", "magnitude"),
           RX_COUNT("stars", "reserved ones"), RX_MEASURED("dt", 4, "", "mean (T - T of PSF) / T", "dT/T"),
           RX_MEASURED("de1", 4, "", "mean e1 - e1 of PSF"),
           RX_MEASURED("de2", 4, "", "mean e2 - e2 of PSF"));

RX_COLUMNS(PSF_STARS, RX_NUMBER("x", 2, "pix", "reserved star, first pixel is 1"),
           RX_NUMBER("y", 2, "pix", "first pixel is 1"), RX_NUMBER("mag", 3, "mag", "by the PSF"),
           RX_NUMBER("dt", 4, "", "(T - T of PSF) / T"), RX_NUMBER("de1", 4, "", "e1 - e1 of PSF"),
           RX_NUMBER("de2", 4, "", "e2 - e2 of PSF"),
           RX_NUMBER("error", 4, "", "1 sigma of each from the pixels' noise"));

RX_COLUMNS(PSF_GROWTH, RX_NUMBER("radius", 1, "pix", "light within"),
           RX_NUMBER("stars", 4, "", "share of a star's"), RX_NUMBER("psf", 4, "", "of the PSF"),
           RX_NUMBER("error", 4, "", "1 sigma of the difference"));

RX_COLUMNS(
    MATCHES,
    RX_TEXT("state", "matched, missed, false, reference_ignored (masked or outside), detection_ignored"),
    RX_COUNT("reference", "row of the reference from 1, 0 none"),
    RX_COUNT("detection", "row of the catalogue from 1, 0 none"),
    RX_NUMBER("x_ref", 2, "pix", "reference, first pixel is 1"),
    RX_NUMBER("y_ref", 2, "pix", "reference, first pixel is 1"),
    RX_NUMBER("x", 2, "pix", "detection, first pixel is 1"),
    RX_NUMBER("y", 2, "pix", "detection, first pixel is 1"),
    RX_NUMBER("ra", 6, "deg", "of the reference where there is one, J2000"),
    RX_NUMBER("dec", 6, "deg", "of the reference where there is one, J2000"),
    RX_NUMBER("mag_ref", 3, "mag", "reference"), RX_NUMBER("mag", 3, "mag", "detection"),
    RX_NUMBER("mag_error", 3, "mag", "detection"), RX_NUMBER("flux", 3, "adu", "detection"),
    RX_NUMBER("flux_error", 3, "adu", "detection"),
    RX_NUMBER("score", 3, "", "ranking of the precision-recall curve"),
    RX_COUNT("flags", "FLAGS of the detection"),
    RX_COUNT("spurious", "1: not significant in the original pixels (FLAGS_RESTORE)"),
    RX_NUMBER("separation", 3, "pix", "of the pair"), RX_NUMBER("dx", 3, "pix", "detection - reference"),
    RX_NUMBER("dy", 3, "pix", "detection - reference"), RX_NUMBER("dmag", 3, "mag", "detection - reference"),
    RX_NUMBER("flux_error_percent", 2, "%", "100 (F - F0) / F0"),
    RX_NUMBER("pull", 2, "", "(F - F0) / error"));

RX_COLUMNS(CURVE, RX_NUMBER("score", 3, "", "threshold, this score and higher"),
           RX_NUMBER("recall", 3, "", "matched / counted references"),
           RX_NUMBER("precision", 3, "", "matched / detections"),
           RX_COUNT("detections", "with this score or a higher one"),
           RX_COUNT("matched", "with this score or a higher one"));

/* For the terminal alone: seconds are in no file, which are the same from run to run. */
RX_COLUMNS(BRIEF, RX_TEXT("run", ""), RX_COUNT("detections", "", "detected"), RX_COUNT("matched", ""),
           RX_NUMBER("recall", 3, "", ""), RX_NUMBER("precision", 3, "", ""),
           RX_NUMBER("ap", 3, "", "", "AP"), RX_NUMBER("common", 2, "%", "", "MagErr/%"),
           RX_NUMBER("magerr", 2, "%", "", "own/%"), RX_NUMBER("bias_mag", 3, "mag", "", "bias/mag"),
           RX_NUMBER("mag50", 2, "mag", ""), RX_NUMBER("seconds", 1, "s", ""));

RX_COLUMNS(BRIEF_GATES, RX_COUNT("line", "", "gate line"), RX_TEXT("gate", ""), RX_TEXT("run", ""),
           RX_ESTIMATE("measured", -4, "", ""), RX_TEXT("verdict", ""));

typedef struct page {
    const rx_qa_numbers *q;
    rx_report *report;
    rx_report_table *runs, *models, *bins, *flags, *gates;
    rx_report_table *psf, *psf_bins; /* NULL: there is no PSF, no star that tests it */
    char (*stem)[STEM];              /* [nruns] of the names of each run's files; NULL without memory */
    rx_report_column run_column[NRUNS + RX_METRIC_COUNT], bin_column[NBINS + RX_METRIC_COUNT];
} page;

/* --- the rows --- */

static rx_cell known(bool is, double value)
{
    return rx_cell_number(is ? value : NAN);
}

static rx_cell known_to(bool is, double value, double error)
{
    return rx_cell_measured(is ? value : NAN, is ? error : NAN);
}

/* The restorer that did it. */
static const char *done_by(const rx_qa_run *run)
{
    return run->by != NULL ? run->by : run->taken != NULL ? run->taken : run->name;
}

/* name: of its matches, its curve, its regions. */
static void add_run(page *p, int run, char (*name)[STEM + 16])
{
    const rx_evaluation *e = &p->q->evaluation[run];
    const rx_qa_run *r = e->run;
    const bool checked = r->blank.n > 0, fluxes = r->flux.n > 0;
    const rx_estimate none = {NAN, NAN, NAN, 0};
    rx_cell row[NRUNS + RX_METRIC_COUNT];
    memcpy(row,
           RX_ROW(r->name, done_by(r), r->by != NULL || r->taken != NULL ? r->why : NULL, r->settings, r->psf,
                  r->law_scale, r->law_power, e->pull_in_flux ? "flux" : "magnitude", name[0], name[1],
                  name[2], e->references, e->references_ignored, e->detections, e->detections_ignored,
                  e->matched, e->chance, p->q->ncommon, p->q->common[run],
                  known(r->tested, (double)e->made_up), known(r->tested, (double)e->made_up_matched),
                  known(r->tested, r->made_up_per_mpixel),
                  known(r->tested, rx_evaluation_precision_without(e)), known(checked, r->blank.n)),
           RX_ROW_CELLS * sizeof *row);
    memcpy(row + RX_ROW_CELLS,
           RX_ROW(known(checked, r->blank.mpixels), checked ? r->blank.rate : none,
                  known(checked, r->blank.raised), known(checked && r->blank.raised > 1.0, r->blank.asked),
                  r->real.n > 0 ? r->real : none, known(fluxes, (double)r->flux.n),
                  known(fluxes, r->flux.diameter), known_to(fluxes, r->flux.wide, r->flux.wide_error),
                  known_to(fluxes, r->flux.automatic, r->flux.automatic_error),
                  !fluxes       ? ""
                  : r->flux.off ? "off"
                                : "right"),
           (NRUNS - RX_ROW_CELLS) * sizeof *row);
    for (int m = 0; m < RX_METRIC_COUNT; m++)
        row[NRUNS + m] = rx_cell_estimate(p->q->whole[run][m]);
    rx_report_row(p->runs, row);
    if (r->promise == NULL)
        return;
    const rx_qa_promise *promise = r->promise;
    const bool inside = promise->inside;
    const rx_estimate *here = p->q->whole[run];
    rx_report_put(p->models, r->name, promise->model, promise->digest, promise->why,
                  promise->unfinished ? "has not ended" : "has ended", promise->fwhm,
                  known(inside, promise->fwhm_bin[0]), known(inside, promise->fwhm_bin[1]), promise->noise,
                  known(inside, promise->noise_bin[0]), known(inside, promise->noise_bin[1]), promise->recall,
                  here[RX_METRIC_RECALL], promise->bias, here[RX_METRIC_BIAS_PERCENT], promise->scatter,
                  here[RX_METRIC_SCATTER_PERCENT], promise->loss);
}

/* A run over all magnitudes (bin -1) or in one bin: what exists for both. */
static void add_bin(page *p, int run, int bin)
{
    const rx_estimate *found = bin < 0 ? p->q->whole[run] : rx_qa_binned(p->q, run, bin);
    rx_cell row[NBINS + RX_METRIC_COUNT] = {rx_cell_words(p->q->input->runs[run].name),
                                            known(bin >= 0, p->q->bins.edge[bin >= 0 ? bin : 0]),
                                            known(bin >= 0, p->q->bins.edge[bin + 1])};
    int n = NBINS;
    for (int m = 0; m < RX_METRIC_COUNT; m++)
        if (!rx_metric_get((rx_metric)m)->whole)
            row[n++] = rx_cell_estimate(found[m]);
    rx_report_row(p->bins, row);
}

static double at(const double *column, long i)
{
    return i >= 0 && column != NULL ? column[i] : NAN;
}

/* Reference i (-1 none) and detection j (-1 none) as one row. Rows and pixels of files count from 1. */
static void add_match(rx_report_table *t, const rx_evaluation *e, const char *state, long i, long j)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    const bool of_truth = i >= 0 && truth->alpha != NULL && truth->delta != NULL;
    rx_report_put(t, state, (double)i + 1, (double)j + 1, at(truth->x, i) + 1, at(truth->y, i) + 1,
                  at(list->x, j) + 1, at(list->y, j) + 1, of_truth ? truth->alpha[i] : at(list->alpha, j),
                  of_truth ? truth->delta[i] : at(list->delta, j), at(e->truth_mag, i), at(e->run_mag, j),
                  at(list->mag_error, j), at(list->flux, j), at(list->flux_error, j), at(list->score, j),
                  j >= 0 && list->flags != NULL ? list->flags[j] : 0,
                  j >= 0 && list->made_up != NULL ? list->made_up[j] != 0 : 0,
                  hypot(at(e->dx, j), at(e->dy, j)), at(e->dx, j), at(e->dy, j), at(e->dmag, j),
                  100 * (at(e->ratio, j) - 1), at(e->pull, j));
}

/* The files of one run: matches_<stem>.ecsv, pr_<stem>.ecsv. */
static void add_sources(page *p, int run, const char *stem)
{
    static const char *const states[] = {"missed", "matched", "reference_ignored"};
    const rx_evaluation *e = &p->q->evaluation[run];
    char name[3][STEM + 16];
    snprintf(name[0], sizeof name[0], "matches_%s", stem);
    snprintf(name[1], sizeof name[1], "pr_%s", stem);
    rx_report_table *matches = RX_REPORT_TABLE(p->report, name[0], MATCHES, RX_REPORT_IN_FILE);
    rx_report_table *curve = RX_REPORT_TABLE(p->report, name[1], CURVE, RX_REPORT_IN_FILE);
    rx_report_table_fact(matches, "run", e->run->name);
    rx_report_table_fact(curve, "run", e->run->name);
    for (long i = 0; i < e->input->truth.n; i++)
        add_match(matches, e, states[e->truth_role[i]], i, e->partner[i]);
    for (long j = 0; j < e->run->list.n; j++)
        if (e->run_role[j] != RX_ROLE_MATCHED)
            add_match(matches, e, e->run_role[j] == RX_ROLE_IGNORED ? "detection_ignored" : "false", -1, j);
    for (long k = 0; k < e->pr.n; k++) {
        const rx_pr_point *point = &e->pr.point[k];
        rx_report_put(curve, point->score, point->recall, point->precision, point->detections,
                      point->matched);
    }
    strcat(name[0], ".ecsv");
    strcat(name[1], ".ecsv");
    snprintf(name[2], sizeof name[2], "regions_%s.reg", stem);
    add_run(p, run, name);
}

/* What each flag costs or saves: recall and precision of all detections and of those without it. */
static void add_flags(page *p, int run)
{
    const rx_evaluation *e = &p->q->evaluation[run];
    const rx_qa_list *list = &e->run->list;
    int n;
    const rx_flag *flag = rx_flags(&n);
    for (int f = 0; f < n; f++) {
        const bool restores = strcmp(flag[f].column, "FLAGS_RESTORE") == 0;
        const int *flags = restores                               ? list->restore
                           : strcmp(flag[f].column, "FLAGS") == 0 ? list->flags
                                                                  : NULL;
        long with = 0, matched = 0;
        if (restores && flag[f].bit == RX_RESTORE_UNTESTED && !e->run->tested)
            continue;
        for (long j = 0; j < list->n && flags != NULL; j++)
            if ((flags[j] & flag[f].bit) && e->run_role[j] != RX_ROLE_IGNORED) {
                with++;
                matched += e->run_role[j] == RX_ROLE_MATCHED;
            }
        if (with == 0)
            continue;
        const long left = e->matched - matched;
        rx_report_put(p->flags, e->run->name, flag[f].column, flag[f].bit, flag[f].name, flag[f].meaning,
                      with, matched, rx_binomial_interval(e->matched, e->references, RX_LEVEL),
                      rx_binomial_interval(left, e->references, RX_LEVEL),
                      rx_binomial_interval(e->matched, e->detections, RX_LEVEL),
                      rx_binomial_interval(left, e->detections - with, RX_LEVEL));
    }
}

/* File-name stems that differ also where the file system ignores case. */
static void name_stems(const rx_qa_input *input, char (*stem)[STEM])
{
    for (int run = 0; run < input->nruns; run++) {
        rx_escape_stem(stem[run], STEM - 16, input->runs[run].name);
        const size_t length = strlen(stem[run]);
        for (int i = 0, k = 2; i < run; i++)
            if (strcasecmp(stem[i], stem[run]) == 0) {
                snprintf(stem[run] + length, STEM - length, "-%d", k++);
                i = -1; /* the new name against all */
            }
    }
}

static void add_runs(page *p)
{
    const rx_qa_input *input = p->q->input;
    char(*stem)[STEM] = p->stem = rx_alloc((size_t)input->nruns, sizeof *stem);
    rx_report_column *of_runs = p->run_column, *of_bins = p->bin_column;
    int nbins = NBINS;
    memcpy(of_runs, RUNS, sizeof RUNS);
    memcpy(of_bins, BINS, sizeof BINS);
    rx_report_table *metrics = RX_REPORT_TABLE(p->report, "metrics", METRICS, RX_REPORT_IN_JSON);
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        const bool renamed = m == RX_METRIC_PRECISION && input->precision_is != NULL;
        const char *help = renamed ? input->precision_is : row->help;
        of_runs[NRUNS + m] =
            (rx_report_column){row->name, RX_REPORT_ESTIMATE, row->digits, row->unit, help, NULL};
        if (!row->whole)
            of_bins[nbins++] = of_runs[NRUNS + m];
        rx_report_put(metrics, row->name, row->unit, help);
    }
    p->runs = rx_report_table_add(p->report, "runs", NRUNS + RX_METRIC_COUNT, of_runs, RX_REPORT_IN_JSON);
    p->models = RX_REPORT_TABLE(p->report, "models", MODELS, RX_REPORT_IN_JSON);
    p->bins = rx_report_table_add(p->report, "bins", nbins, of_bins, RX_REPORT_EVERYWHERE);
    p->flags = RX_REPORT_TABLE(p->report, "flags", FLAGS, RX_REPORT_IN_JSON);
    if (stem == NULL) {
        rx_report_brief_of(p->report)->failed = true;
        return;
    }
    name_stems(input, stem);
    for (int run = 0; run < input->nruns; run++) {
        add_sources(p, run, stem[run]);
        add_flags(p, run);
        add_bin(p, run, -1);
    }
    for (int run = 0; run < input->nruns; run++)
        for (int b = 0; b < p->q->bins.n; b++)
            add_bin(p, run, b);
}

static void add_gates(page *p)
{
    const rx_qa_numbers *q = p->q;
    p->gates = RX_REPORT_TABLE(p->report, "gates", GATES, RX_REPORT_IN_JSON);
    for (long i = 0; i < q->nresults; i++) {
        const rx_gate_result *r = &q->result[i];
        const rx_gate *gate = r->gate;
        rx_report_put(p->gates, gate->line, gate->text, r->run >= 0 ? q->input->runs[r->run].name : NULL,
                      rx_metric_get(gate->metric)->name, known(!gate->whole, gate->low),
                      known(!gate->whole, gate->high), gate->op_name, gate->value,
                      known(gate->op == RX_GATE_IN, gate->value_high), gate->level, r->estimate,
                      rx_verdict_name(r->verdict));
    }
}

/* The PSF of the tile, what stars say of it by magnitude, and the stars. */
static void add_psf(page *p)
{
    const rx_qa_numbers *q = p->q;
    const rx_psf *psf = q->input->psf.psf;
    const rx_psf_quality *quality = &psf->quality;
    const rx_psf_tested *tested = psf->tested;
    const bool is_tested = tested != NULL;
    p->psf = RX_REPORT_TABLE(p->report, "psf", PSF, RX_REPORT_IN_JSON);
    rx_report_put(
        p->psf, rx_psf_how_name(quality->how),
        known_to(true, psf->fwhm, psf->fwhm_error > 0.0 ? psf->fwhm_error : NAN), psf->nstars,
        known(rx_psf_flux_error_mean(psf) > 0.0, rx_psf_flux_error_mean(psf)),
        known(is_tested, quality->reserved), known_to(is_tested, quality->trace[0], quality->trace[1]),
        known_to(is_tested, quality->shape[0][0], quality->shape[0][1]),
        known_to(is_tested, quality->shape[1][0], quality->shape[1][1]), known(is_tested, quality->residual),
        known_to(is_tested, quality->growth, quality->growth_error),
        known(is_tested, quality->growth_radius));
    if (!is_tested)
        return;
    p->psf_bins = RX_REPORT_TABLE(p->report, "psf_bins", PSF_BINS, RX_REPORT_IN_JSON);
    for (int b = 0; b < q->npsf_bins; b++) {
        const rx_qa_psf_bin *bin = &q->psf_bin[b];
        rx_report_put(p->psf_bins, bin->mag, bin->n, rx_cell_measured(bin->mean[0], bin->error[0]),
                      rx_cell_measured(bin->mean[1], bin->error[1]),
                      rx_cell_measured(bin->mean[2], bin->error[2]));
    }
    rx_report_table *stars = RX_REPORT_TABLE(p->report, "psf_stars", PSF_STARS, RX_REPORT_IN_FILE);
    for (int i = 0; i < tested->nstars; i++) {
        const rx_psf_star *s = &tested->star[i];
        rx_report_put(stars, s->x + 1.0, s->y + 1.0, rx_qa_star_mag(&q->input->psf, s), s->off[0], s->off[1],
                      s->off[2], s->error);
    }
    rx_report_table *growth = RX_REPORT_TABLE(p->report, "psf_growth", PSF_GROWTH, RX_REPORT_IN_FILE);
    for (int i = 0; i < tested->nradii; i++) {
        const rx_psf_growth *g = &tested->growth[i];
        rx_report_put(growth, g->radius, g->stars, g->psf, g->error);
    }
}

static void fact_above_0(rx_report *report, const char *name, double value)
{
    if (value > 0)
        rx_report_fact_number(report, name, value);
    else
        rx_report_fact(report, name, NULL);
}

static void add_facts(rx_report *report, const rx_qa_numbers *q)
{
    char seed[32];
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)q->par->by.seed);
    rx_report_fact(report, "format", "rextract-qa 2");
    rx_report_fact(report, "tile", q->input->tile);
    rx_report_fact(report, "reference", q->input->reference);
    rx_report_fact(report, "verdict", rx_verdict_name(q->verdict));
    rx_report_fact(report, "gates_file", q->par->gates != NULL ? q->par->gates->path : NULL);
    rx_report_fact_number(report, "width", q->input->width);
    rx_report_fact_number(report, "height", q->input->height);
    fact_above_0(report, "pixel_scale_arcsec", q->input->pixel_scale);
    rx_report_fact_number(report, "match_radius_pixels", q->par->match_radius);
    fact_above_0(report, "match_radius_arcsec", q->par->match_radius_arcsec);
    rx_report_fact(report, "score", q->input->score_name);
    rx_report_fact_number(report, "interval_level", RX_LEVEL);
    rx_report_fact(report, "intervals",
                   "shares: Clopper-Pearson; medians and sigma_MAD: order statistics; means, ap and "
                   "completeness magnitudes: bootstrap; null: not bounded or not known");
    rx_report_fact(report, "seed", seed);
}

/* --- the page --- */

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
    if (psf != NULL && psf->tested != NULL && fabs(psf->quality.growth) > WRONG)
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
    rx_report_show(p->report, p->runs,
                   RX_VIEW(.turned = 1, .without_empty = 1, .ncolumns = n, .columns = columns));
}

static void show_summary(page *p)
{
    const char *columns[3 + RX_METRIC_COUNT] = {"run"};
    int n = 1;
    for (int run = 0; run < p->q->input->nruns && n == 1; run++)
        if (done_by(&p->q->input->runs[run]) != p->q->input->runs[run].name)
            columns[n++] = "done_by";
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        if (m == RX_METRIC_MAGERR &&
            p->q->input->nruns > 1) /* lists of other depths differ in magerr for that */
            columns[n++] = "common_magerr";
        if (m != RX_METRIC_FLUX_SCALE || rx_report_knows(p->runs, "flux_sources"))
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
    if (p->psf == NULL)
        return;
    rx_report_section(p->report, "psf", "The PSF");
    rx_report_show(p->report, p->psf, RX_VIEW(.turned = 1, .without_empty = 1));
    if (p->psf_bins == NULL)
        return;
    rx_report_place(p->report, "psf-");
    if (rx_report_rows(p->psf_bins) > 0)
        rx_report_show(p->report, p->psf_bins, RX_VIEW(.title = "Reserved stars by magnitude"));
    rx_report_note(p->report, "Reserved stars were never fitted; shapes are under a round Gaussian as wide "
                              "as the PSF. psf_stars.ecsv and psf_growth.ecsv hold what is drawn.");
}

/* Sections of a table and how to read it: some of its columns, or all; there if something comes before it, or the
 * second one says something of any row. */
enum { COLUMNS_MAX = 9 };
static const struct section {
    struct {
        const char *id, *title;
        size_t table; /* in page */
        int turned;
        void (*before)(page *p); /* what comes before the table */
        void (*after)(page *p);  /* the next section */
    };
    const char *columns[COLUMNS_MAX], *note;
} SECTIONS[] = {
    {{"gates", "Gates", offsetof(page, gates), 0, NULL, NULL},
     {"line", "gate", "run", "measured", "level", "verdict"},
     "PASS: the whole interval satisfies the gate. FAIL: the whole interval violates it. INSUFFICIENT: the "
     "interval lies across the limit, more sources are needed to decide; or no run has the name of the "
     "gate."},
    {{"counts", "What was compared", offsetof(page, runs), 1, add_radius, NULL},
     {"run", "references", "references_ignored", "detections", "detections_ignored", "matched",
      "chance_matches", "common", "common_magerr"},
     "Where matches by chance are not few against the matches, recall and precision are flattered; take a "
     "smaller radius."},
    {{"noise", "Noise or sources", offsetof(page, runs), 1, NULL, NULL},
     {"run", "no_noise_peak", "false_per_mpixel", "threshold_raised", "false_per_mpixel_as_asked"},
     "1 &minus; (false detections per Mpixel of this tile's noise, BLANK_CHECK) &times; (Mpixel of the tile "
     "without a mask or a source) / detections, with the interval of the rate. It covers noise on blank sky "
     "only: pieces of bright sources, ghosts, cosmic rays, and noise on top of sources count as real here. "
     "Where large or crowded sources raise the map of the noise, the rate is too high, and this share too "
     "low: then neither is more than a hint."},
    {{"spurious", "Spurious or real", offsetof(page, runs), 1, NULL, NULL},
     {"run", "spurious", "spurious_matched", "spurious_per_mpixel", "precision", "precision_without"},
     "A source is marked when a template of it, fitted to the original pixels together with its neighbours, "
     "says that it is rather not there (P_REAL below 0.5)."},
    {{"flags", "With and without each flag", offsetof(page, flags), 0, NULL, NULL},
     {NULL},
     "What leaving out the sources of a flag costs in recall, and gains in precision."},
    {{"flux-scale", "Flux scale", offsetof(page, runs), 1, NULL, show_psf},
     {"run", "flux_sources", "flux_aperture_pixels", "flux_aperture", "flux_auto", "flux_scale_is"},
     "Medians with 1 &sigma;. No reference is needed: the tile's own original pixels are the measure. Off: "
     "the ratio in the aperture is more than 1 % and 5 &sigma; from 1, or FLUX_AUTO so much above it; "
     "FLUX_AUTO below it is the light that it leaves out."},
    {{"models", "What the model promises here", offsetof(page, models), 1, NULL, NULL},
     {NULL},
     "Promised: what the model did on its test images of this seeing and noise. Here: as in the summary; "
     "faint sources lower the recall, galaxies and blends widen the scatter."},
};

static void show_section(page *p, const struct section *s)
{
    const rx_report_table *t = *(rx_report_table *const *)((const char *)p + s->table);
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
    for (int i = 0; i < RX_LENGTH(shown); i++) {
        const rx_report_column column = p->run_column[NRUNS + shown[i]];
        rx_report_show(p->report, p->bins,
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
        "intervals from order statistics, MagErr, ap and the completeness magnitudes bootstrap intervals (%d "
        "draws, none for fewer than %d sources). An infinite end: too few sources, or the limit lies beyond "
        "the reference. Means, such as MagErr, follow single gross mismatches; medians and sigma_MAD do not.",
        100 * RX_LEVEL, RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_report_paragraph(p->report, html);
    rx_report_paragraph(
        p->report,
        "<b>Recall</b> is counted by reference magnitude, <b>precision</b> by measured magnitude, all else "
        "by reference magnitude. Precision against a catalogue that is not deeper than the tile is a "
        "<b>lower bound</b>: a real source that the reference lacks counts as a false detection. "
        "<b>Fluxes</b> are compared on the scale of the catalogue's zero point; only <b>magerr_shifted</b> "
        "takes out <b>zp_offset</b>, the median difference of bright (error up to 0.05 mag), unsaturated "
        "matches. <b>mag50</b> and <b>mag90</b> are read off the falling curve that is nearest to the single "
        "references (isotonic regression); a value with an infinite end is a limit.");
    rx_text_printf(&score,
                   "Precision against recall ranks detections by %s, or by magnitude where a run has no such "
                   "score; ap is the area under its steps, without interpolation.",
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
        rx_report_show(p->report, gates, RX_VIEW(.in_brief = RX_BRIEF_ALONE, .intervals = 1));
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
    rx_report_show(p->report, t, RX_VIEW(.in_brief = RX_BRIEF_ALONE));
    if (whole)
        rx_text_printf(brief,
                       "recall: share of the reference found; precision: share of detections in the "
                       "reference; AP: area under their curve; mag50: half are found here\nMagErr: mean |F - "
                       "F0| / F0 of the %ld sources that every list has; own: of all that the list has, the "
                       "deeper the larger; bias: median; seconds: with measuring and checks\n",
                       q->ncommon);
    if (senseless)
        rx_text_add(brief,
                    "MagErr above 10,000 %: magnitudes and reference differ in zero point; give "
                    "MAG_ZEROPOINT, or MAG_ZEROPOINT_KEY, the name of the header's card, such as MAGZERO\n");
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
    add_facts(report, p->q);
    add_runs(p);
    add_gates(p);
    if (input->psf.psf != NULL)
        add_psf(p);
    add_verdicts(p);
    add_brief(p, !rx_log_is_short(files->log));
    if (files->figures)
        rx_qa_figures(rx_report_figures_of(report), p->q);
    rx_report_section(report, "figures", "Figures");
    rx_report_place(report, "picture");
    rx_report_place(report, "plot-");
    if (input->npictures > 0 && files->figures)
        rx_report_note(
            report, "Pictures: the middle of the tile, one grey scale for all: asinh(p / 2&sigma;), &sigma; "
                    "of the first picture, black at &minus;2&sigma;, white where 99.8 % of it is darker.");
    show_summary(p);
    for (int i = 0; i < RX_LENGTH(SECTIONS); i++)
        show_section(p, &SECTIONS[i]);
    show_bins(p);
    show_reading(p);
    rx_report_section(report, "restorers", "Restorers");
    show_runs(p, RX_LENGTH(settings), settings);
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
    char name[STEM + 16];
    rx_text_add(&text, "# Region file format: DS9 version 4.1\n# cyan: missed, magnitude of the reference; "
                       "red: false, row of the catalogue\n");
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
    rx_status status;
    RX_TRY_EXIT(rx_qa_numbers_make(par, input, &numbers, err));
    if (p.report == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    warn(&numbers, par->log);
    RX_TRY_EXIT(write_page(&p, &files, brief, err));
    for (int run = 0; run < input->nruns; run++)
        RX_TRY_EXIT(write_regions(&numbers, run, p.stem[run], &files, err));
    if (verdict != NULL)
        *verdict = numbers.verdict;
exit:
    free(p.stem);
    rx_report_free(p.report);
    rx_qa_numbers_free(&numbers);
    return status;
}
