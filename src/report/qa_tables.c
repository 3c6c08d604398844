/* The tables of the QA report: their columns, and their rows. */
#include "report/qa_tables.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "data/flags.h"
#include "data/sources.h"
#include "report/formats.h"

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

/* --- the columns --- */

/* Every metric over all magnitudes comes behind these. */
RX_COLUMNS(
    RUNS, {.name = "run", .help = "restorer", .heading = ""},
    {.name = "done_by", .help = "restorer that did it", .heading = "done by"}, RX_TEXT("why", "why that one"),
    RX_TEXT("settings", ""), {.name = "psf", .help = "of the restoration", .heading = "PSF"},
    {"noise_law_scale", RX_REPORT_NUMBER, 3, "",
     "c: noise of an aperture of A pixels is c sigma A^power, sigma that of a pixel", "noise, scale"},
    {"noise_law_power", RX_REPORT_NUMBER, 3, "",
     "0.5: independent pixels; what is restored is correlated, its errors grow faster with the aperture",
     "noise, power"},
    {.name = "pull_from", .help = "whether pulls are of fluxes or magnitudes", .heading = "pulls of"},
    {.name = "matches", .kind = RX_REPORT_FILE, .help = "every source, matched, missed or false"},
    {.name = "curve", .kind = RX_REPORT_FILE, .help = "precision against recall"},
    {.name = "regions", .kind = RX_REPORT_FILE, .help = "missed and false ones, for DS9"},
    RX_COUNT("references", "that count"),
    {"references_ignored", RX_REPORT_COUNT, 0, "", "outside the tile, masked or without a magnitude",
     "references ignored"},
    RX_COUNT("detections", "that count"),
    {"detections_ignored", RX_REPORT_COUNT, 0, "", "outside, masked or on such a reference",
     "detections ignored"},
    RX_COUNT("matched", "one to one, nearest pairs first"),
    {"chance_matches", RX_REPORT_NUMBER, 1, "",
     "matches if positions were unrelated: mean of 8 shifted lists", "matched by chance"},
    RX_COUNT("common", "references that every run has matched"),
    RX_NUMBER("common_magerr", 2, "%", "magerr of these alone"),
    RX_NUMBER("spurious", 0, "", "detections marked by FLAGS_RESTORE, P_REAL below 0.5"),
    {"spurious_matched", RX_REPORT_NUMBER, 0, "", "of these matched all the same", "matched all the same"},
    {"spurious_per_mpixel", RX_REPORT_NUMBER, 1, "1/Mpix", "marked, those included that were dropped",
     "spurious"},
    {"precision_without", RX_REPORT_NUMBER, 3, "", "precision of the list without them", "precision without"},
    {"blank_realisations", RX_REPORT_NUMBER, 0, "", "of the tile's noise (BLANK_CHECK)", "realisations"},
    {"blank_mpixels", RX_REPORT_NUMBER, 3, "Mpix", "searched in them", "searched"},
    {"false_per_mpixel", RX_REPORT_ESTIMATE, 3, "1/Mpix", "false detections on the tile's noise",
     "false detections"},
    {"threshold_raised", RX_REPORT_NUMBER, 3, "", "DETECT_THRESH was multiplied by this for them",
     "threshold raised"},
    {"false_per_mpixel_as_asked", RX_REPORT_NUMBER, 3, "1/Mpix", "false detections without that",
     "at DETECT_THRESH"},
    {"no_noise_peak", RX_REPORT_ESTIMATE, 3, "", "share of the tile's own detections that is no noise peak",
     "no noise peak"},
    {"flux_sources", RX_REPORT_NUMBER, 0, "", "isolated sources of FLAGS 0 and S/N above 30", "sources"},
    {"flux_aperture_pixels", RX_REPORT_NUMBER, 2, "pix", "diameter of one wide aperture", "aperture"},
    {"flux_aperture", RX_REPORT_MEASURED, 4, "", "restored over original flux in this aperture",
     "flux ratio"},
    {"flux_auto", RX_REPORT_MEASURED, 4, "", "restored FLUX_AUTO over the original flux in it", "FLUX_AUTO"},
    {.name = "flux_scale_is", .kind = RX_REPORT_VERDICT, .help = "right or off", .heading = "flux scale"});
RX_COLUMNS(BINS, RX_TEXT("run", "restorer"),
           {"mag_low", RX_REPORT_NUMBER, -4, "mag", "bin, inclusive; nan in both: all magnitudes", "from"},
           {"mag_high", RX_REPORT_NUMBER, -4, "mag", "bin, exclusive", "to"});
enum { STEM = RX_QA_STEM, NRUNS = RX_QA_RUN_COLUMNS, NBINS = RX_QA_BIN_COLUMNS };
_Static_assert(COUNT(RUNS) == NRUNS && COUNT(BINS) == NBINS, "rx_qa_tables has room for them");

RX_COLUMNS(
    MODELS, {.name = "run", .help = "restorer", .heading = ""}, RX_TEXT("model", "name"),
    RX_TEXT("digest", "of its file"),
    RX_TEXT("outside", "what this tile has that its training had not: then nothing is promised"),
    RX_TEXT("training", "whether it has ended"), {"fwhm", RX_REPORT_NUMBER, 2, "pix", "of the tile", "FWHM"},
    {"fwhm_low", RX_REPORT_NUMBER, -4, "pix", "bin of the model, from", "FWHM from"},
    {"fwhm_high", RX_REPORT_NUMBER, -4, "pix", "to", "FWHM to"},
    RX_NUMBER("noise", 2, "", "of the tile: 255 noise / value that 0.1 % of the pixels exceed"),
    {"noise_low", RX_REPORT_NUMBER, -4, "", "bin of the model, from", "noise from"},
    {"noise_high", RX_REPORT_NUMBER, -4, "", "to", "noise to"},
    RX_NUMBER("recall", 3, "", "promised: of test stars of S/N above 5"),
    {"recall_here", RX_REPORT_ESTIMATE, 3, "", "all references, of all magnitudes and kinds", "recall here"},
    {"bias_percent", RX_REPORT_NUMBER, 2, "%", "promised: fluxes of test stars of S/N above 12", "flux bias"},
    {"bias_percent_here", RX_REPORT_ESTIMATE, 2, "%", "of all matches", "flux bias here"},
    {"scatter_percent", RX_REPORT_NUMBER, 2, "%", "promised: fluxes of test stars of S/N above 12",
     "flux scatter"},
    {"scatter_percent_here", RX_REPORT_ESTIMATE, 2, "%", "of all matches", "flux scatter here"},
    {"loss", RX_REPORT_NUMBER, 4, "", "mean over test images of this seeing and noise", "test loss"});

RX_COLUMNS(FLAGS, RX_TEXT("run", "restorer"), RX_TEXT("column", ""), RX_COUNT("bit", ""),
           RX_TEXT("name", "of the bit"), RX_TEXT("meaning", "what the bit says"),
           RX_COUNT("detections", "that count and have it"), RX_COUNT("matched", "of these"),
           RX_ESTIMATE("recall", 3, "", "of all detections"),
           {"recall_without", RX_REPORT_ESTIMATE, 3, "", "if those that have it are left out",
            "recall without"},
           RX_ESTIMATE("precision", 3, "", "of all detections"),
           {"precision_without", RX_REPORT_ESTIMATE, 3, "", "if those that have it are left out",
            "precision without"});

RX_COLUMNS(METRICS, RX_TEXT("metric", ""), RX_TEXT("unit", ""), RX_TEXT("meaning", ""));

RX_COLUMNS(GATES, RX_COUNT("line", "of the gates file"), RX_TEXT("gate", ""), RX_TEXT("run", ""),
           RX_TEXT("metric", ""), RX_NUMBER("mag_low", -4, "mag", "none: all magnitudes"),
           RX_NUMBER("mag_high", -4, "mag", ""), RX_TEXT("operator", ""), RX_NUMBER("limit", -4, "", ""),
           RX_NUMBER("limit_high", -4, "", ""), RX_NUMBER("level", -4, "", "of the interval"),
           RX_ESTIMATE("measured", -4, "", ""), {.name = "verdict", .kind = RX_REPORT_VERDICT});

RX_COLUMNS(COMPARISONS, RX_TEXT("first", ""), RX_TEXT("second", ""),
           {"found_by_first_only", RX_REPORT_COUNT, 0, "", "references", "found by the first only"},
           {"found_by_second_only", RX_REPORT_COUNT, 0, "", "references", "found by the second only"},
           {"mcnemar_p", RX_REPORT_P, 0, "", "two-sided, McNemar's exact test", "p"});

RX_COLUMNS(PSF, {.name = "how", .help = "how it came about", .heading = "RXPSFHOW"},
           {"fwhm", RX_REPORT_MEASURED, 3, "pix", "at the centre", "FWHM"},
           RX_NUMBER("stars", 0, "", "that it was fitted to"),
           {"flux_error", RX_REPORT_NUMBER, 4, "", "relative error of fluxes from it", "error of fluxes"},
           RX_NUMBER("reserved", 0, "", "stars that were not fitted, to judge it"),
           {"dt", RX_REPORT_MEASURED, 5, "", "their mean (T - T of PSF) / T, T = <x²> + <y²>", "dT/T"},
           RX_MEASURED("de1", 5, "", "their mean e1 - e1 of PSF, e1 = (<x²> - <y²>) / T"),
           RX_MEASURED("de2", 5, "", "their mean e2 - e2 of PSF, e2 = 2 <xy> / T"),
           RX_NUMBER("residual", 4, "", "stacked stars - PSF, largest, share of the peak"),
           RX_MEASURED("growth", 4, "", "curve of growth, largest stars - PSF"),
           {"growth_radius", RX_REPORT_NUMBER, 1, "pix", "where that is", "at radius"});

RX_COLUMNS(PSF_BINS, {"mag", RX_REPORT_NUMBER, 2, "mag", "middle of the range", "magnitude"},
           RX_COUNT("stars", "reserved ones"),
           {"dt", RX_REPORT_MEASURED, 4, "", "mean (T - T of PSF) / T", "dT/T"},
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

typedef struct builder {
    const rx_qa_numbers *q;
    rx_report *report;
    rx_qa_tables *to;
} builder;

/* --- the rows --- */

/* How a metric is shown; precision may be something else (rx_qa_input.precision_is). */
static rx_report_column column_of(const rx_qa_input *input, rx_metric metric)
{
    const rx_metric_row *row = rx_metric_get(metric);
    const bool renamed = metric == RX_METRIC_PRECISION && input->precision_is != NULL;
    return (rx_report_column){.name = row->name,
                              .kind = RX_REPORT_ESTIMATE,
                              .digits = row->digits,
                              .unit = row->unit,
                              .help = renamed ? input->precision_is : row->help};
}

static rx_cell known(bool is, double value)
{
    return rx_cell_number(is ? value : NAN);
}

static rx_cell known_to(bool is, double value, double error)
{
    return rx_cell_measured(is ? value : NAN, is ? error : NAN);
}

/* name: of its matches, its curve, its regions. */
static void add_run(builder *p, int run, char (*name)[STEM + 16])
{
    const rx_evaluation *e = &p->q->evaluation[run];
    const rx_qa_run *r = e->run;
    const bool checked = r->blank.n > 0, fluxes = r->flux.n > 0;
    const rx_estimate none = {NAN, NAN, NAN, 0};
    rx_cell row[NRUNS + RX_METRIC_COUNT] = {RX_CELL(r->name),
                                            RX_CELL(rx_qa_done_by(r)),
                                            rx_cell_words(r->by != NULL || r->taken != NULL ? r->why : NULL),
                                            RX_CELL(r->settings),
                                            RX_CELL(r->psf),
                                            RX_CELL(r->law_scale),
                                            RX_CELL(r->law_power),
                                            RX_CELL(e->pull_in_flux ? "flux" : "magnitude"),
                                            RX_CELL(name[0]),
                                            RX_CELL(name[1]),
                                            RX_CELL(name[2]),
                                            RX_CELL(e->references),
                                            RX_CELL(e->references_ignored),
                                            RX_CELL(e->detections),
                                            RX_CELL(e->detections_ignored),
                                            RX_CELL(e->matched),
                                            RX_CELL(e->chance),
                                            RX_CELL(p->q->ncommon),
                                            RX_CELL(p->q->common[run]),
                                            known(r->tested, (double)e->made_up),
                                            known(r->tested, (double)e->made_up_matched),
                                            known(r->tested, r->made_up_per_mpixel),
                                            known(r->tested, rx_evaluation_precision_without(e)),
                                            known(checked, r->blank.n),
                                            known(checked, r->blank.mpixels),
                                            RX_CELL(checked ? r->blank.rate : none),
                                            known(checked, r->blank.raised),
                                            known(checked && r->blank.raised > 1.0, r->blank.asked),
                                            RX_CELL(r->real.n > 0 ? r->real : none),
                                            known(fluxes, (double)r->flux.n),
                                            known(fluxes, r->flux.diameter),
                                            known_to(fluxes, r->flux.wide, r->flux.wide_error),
                                            known_to(fluxes, r->flux.automatic, r->flux.automatic_error),
                                            RX_CELL(!fluxes       ? ""
                                                    : r->flux.off ? "off"
                                                                  : "right")};
    for (int m = 0; m < RX_METRIC_COUNT; m++)
        row[NRUNS + m] = rx_cell_estimate(p->q->whole[run][m]);
    rx_report_row(p->to->runs, row);
    if (r->promise == NULL)
        return;
    const rx_qa_promise *promise = r->promise;
    const bool inside = promise->inside;
    const rx_estimate *here = p->q->whole[run];
    rx_report_put(p->to->models, r->name, promise->model, promise->digest, promise->why,
                  promise->unfinished ? "has not ended" : "has ended", promise->fwhm,
                  known(inside, promise->fwhm_bin[0]), known(inside, promise->fwhm_bin[1]), promise->noise,
                  known(inside, promise->noise_bin[0]), known(inside, promise->noise_bin[1]), promise->recall,
                  here[RX_METRIC_RECALL], promise->bias, here[RX_METRIC_BIAS_PERCENT], promise->scatter,
                  here[RX_METRIC_SCATTER_PERCENT], promise->loss);
}

/* A run over all magnitudes (bin -1) or in one bin: what exists for both. */
static void add_bin(builder *p, int run, int bin)
{
    const rx_estimate *found = bin < 0 ? p->q->whole[run] : rx_qa_binned(p->q, run, bin);
    rx_cell row[NBINS + RX_METRIC_COUNT] = {rx_cell_words(p->q->input->runs[run].name),
                                            known(bin >= 0, p->q->bins.edge[bin >= 0 ? bin : 0]),
                                            known(bin >= 0, p->q->bins.edge[bin + 1])};
    int n = NBINS;
    for (int m = 0; m < RX_METRIC_COUNT; m++)
        if (!rx_metric_get((rx_metric)m)->whole)
            row[n++] = rx_cell_estimate(found[m]);
    rx_report_row(p->to->bins, row);
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
static void add_sources(builder *p, int run, const char *stem)
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
static void add_flags(builder *p, int run)
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
        const double level = p->q->level;
        rx_report_put(p->to->flags, e->run->name, flag[f].column, flag[f].bit, flag[f].name, flag[f].meaning,
                      with, matched, rx_binomial_interval(e->matched, e->references, level),
                      rx_binomial_interval(left, e->references, level),
                      rx_binomial_interval(e->matched, e->detections, level),
                      rx_binomial_interval(left, e->detections - with, level));
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

static void add_runs(builder *p)
{
    const rx_qa_input *input = p->q->input;
    char(*stem)[STEM] = p->to->stem = rx_alloc((size_t)input->nruns, sizeof *stem);
    rx_report_column *of_runs = p->to->run_column, *of_bins = p->to->bin_column;
    int nbins = NBINS;
    memcpy(of_runs, RUNS, sizeof RUNS);
    memcpy(of_bins, BINS, sizeof BINS);
    rx_report_table *metrics = RX_REPORT_TABLE(p->report, "metrics", METRICS, RX_REPORT_IN_JSON);
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_report_column column = column_of(input, (rx_metric)m);
        of_runs[NRUNS + m] = column;
        if (!rx_metric_get((rx_metric)m)->whole)
            of_bins[nbins++] = column;
        rx_report_put(metrics, column.name, column.unit, column.help);
    }
    p->to->runs = rx_report_table_add(p->report, "runs", NRUNS + RX_METRIC_COUNT, of_runs, RX_REPORT_IN_JSON);
    p->to->models = RX_REPORT_TABLE(p->report, "models", MODELS, RX_REPORT_IN_JSON);
    p->to->bins = rx_report_table_add(p->report, "bins", nbins, of_bins, RX_REPORT_EVERYWHERE);
    p->to->flags = RX_REPORT_TABLE(p->report, "flags", FLAGS, RX_REPORT_IN_JSON);
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

static void add_gates(builder *p)
{
    const rx_qa_numbers *q = p->q;
    rx_report_table *t = RX_REPORT_TABLE(p->report, "gates", GATES, RX_REPORT_IN_JSON);
    for (long i = 0; i < q->nresults; i++) {
        const rx_gate_result *r = &q->result[i];
        const rx_gate *gate = r->gate;
        rx_report_put(t, gate->line, gate->text, r->run >= 0 ? q->input->runs[r->run].name : NULL,
                      rx_metric_get(gate->metric)->name, known(!gate->whole, gate->low),
                      known(!gate->whole, gate->high), rx_gate_operator_name(gate->op), gate->value,
                      known(gate->op == RX_GATE_IN, gate->value_high), gate->level, r->estimate,
                      rx_verdict_name(r->verdict));
    }
    p->to->gates = t;
}

static void add_comparisons(builder *p)
{
    const rx_qa_numbers *q = p->q;
    rx_report_table *t = RX_REPORT_TABLE(p->report, "comparisons", COMPARISONS, RX_REPORT_IN_JSON);
    for (int i = 0; i < q->ncomparisons; i++) {
        const rx_qa_comparison *c = &q->comparison[i];
        rx_report_put(t, q->input->runs[c->first].name, q->input->runs[c->second].name, c->only_first,
                      c->only_second, rx_cell_p(c->p, log(c->p)));
    }
    p->to->comparisons = t;
}

/* The PSF of the tile, what stars say of it by magnitude, and the stars. */
static void add_psf(builder *p)
{
    const rx_qa_numbers *q = p->q;
    const rx_psf *psf = q->input->psf.psf;
    const rx_psf_quality *quality = &psf->quality;
    const rx_psf_judged *judged = psf->judged;
    const bool is_judged = judged != NULL;
    rx_report_table *t = RX_REPORT_TABLE(p->report, "psf", PSF, RX_REPORT_IN_JSON);
    rx_report_put(
        t, rx_psf_how_name(quality->how),
        known_to(true, psf->fwhm, psf->fwhm_error > 0.0 ? psf->fwhm_error : NAN), psf->nstars,
        known(rx_psf_flux_error_mean(psf) > 0.0, rx_psf_flux_error_mean(psf)),
        known(is_judged, quality->reserved), known_to(is_judged, quality->trace[0], quality->trace[1]),
        known_to(is_judged, quality->shape[0][0], quality->shape[0][1]),
        known_to(is_judged, quality->shape[1][0], quality->shape[1][1]), known(is_judged, quality->residual),
        known_to(is_judged, quality->growth, quality->growth_error),
        known(is_judged, quality->growth_radius));
    p->to->psf = t;
    if (!is_judged)
        return;
    p->to->psf_bins = RX_REPORT_TABLE(p->report, "psf_bins", PSF_BINS, RX_REPORT_IN_JSON);
    for (int b = 0; b < q->npsf_bins; b++) {
        const rx_qa_psf_bin *bin = &q->psf_bin[b];
        rx_report_put(p->to->psf_bins, bin->mag, bin->n, rx_cell_measured(bin->mean[0], bin->error[0]),
                      rx_cell_measured(bin->mean[1], bin->error[1]),
                      rx_cell_measured(bin->mean[2], bin->error[2]));
    }
    rx_report_table *stars = RX_REPORT_TABLE(p->report, "psf_stars", PSF_STARS, RX_REPORT_IN_FILE);
    for (int i = 0; i < judged->nstars; i++) {
        const rx_psf_star *s = &judged->star[i];
        rx_report_put(stars, s->x + 1.0, s->y + 1.0, rx_qa_star_mag(&q->input->psf, s), s->off[0], s->off[1],
                      s->off[2], s->error);
    }
    rx_report_table *growth = RX_REPORT_TABLE(p->report, "psf_growth", PSF_GROWTH, RX_REPORT_IN_FILE);
    for (int i = 0; i < judged->nradii; i++) {
        const rx_psf_growth *g = &judged->growth[i];
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
    rx_report_fact_number(report, "interval_level", q->level);
    rx_report_fact(report, "intervals",
                   "shares: Clopper-Pearson; medians and sigma_MAD: order statistics; means, ap and "
                   "completeness magnitudes: bootstrap; null: not bounded or not known");
    rx_report_fact(report, "seed", seed);
}

void rx_qa_tables_add(rx_report *report, const rx_qa_numbers *numbers, rx_qa_tables *dst)
{
    builder p = {.q = numbers, .report = report, .to = dst};
    *dst = (rx_qa_tables){0};
    add_facts(report, numbers);
    add_runs(&p);
    add_gates(&p);
    add_comparisons(&p);
    if (numbers->input->psf.psf != NULL)
        add_psf(&p);
}
