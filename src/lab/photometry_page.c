/* The report of a photometry campaign. */
#include <math.h>
#include <stdio.h>

#include "lab/kinds.h"
#include "lab/photometry_numbers.h"
#include "quality/bootstrap.h"
#include "report/page.h"

static const rx_quantity QUANTITIES[RX_CELL_QUANTITIES] = {
    [RX_CELL_RECALL] = {"recall", "", "share of the stars found, whole list", 3, 0},
    [RX_CELL_PRECISION] = {"precision", "",
                           "stars found / (stars found + false detections on the same tiles)", 3, 0},
    [RX_CELL_AP] = {"ap", "", "average precision: area under the steps of the precision-recall curve", 3, 0},
    [RX_CELL_MAGERR] = {"magerr", "%", "mean of 100 |F - F0| / F0 over the stars found (the paper's MagErr)",
                        2},
    [RX_CELL_MAGERR_CLEAN] = {"magerr_clean", "%", "the same without stars flagged as blended", 2, 0},
    [RX_CELL_CROWDED] = {"blended", "", "share of the stars found that FLAGS calls blended or crowded", 3, 0},
    [RX_CELL_BIAS_PERCENT] = {"bias_percent", "%", "median of 100 (F - F0) / F0", 2, 0},
    [RX_CELL_SCATTER_PERCENT] = {"scatter_percent", "%", "sigma_MAD of 100 (F - F0) / F0", 2, 0},
    [RX_CELL_BIAS_MAG] = {"bias_mag", "mag", "median of m - m0", 3, 0},
    [RX_CELL_SCATTER_MAG] = {"scatter_mag", "mag", "sigma_MAD of m - m0", 3, 0},
    [RX_CELL_PULL_MEDIAN] = {"pull_median", "", "median of (F - F0) / error, 0 when unbiased", 2, 0},
    [RX_CELL_PULL_WIDTH] = {"pull_width", "", "sigma_MAD of (F - F0) / error, 1 when errors are true", 2, 0},
};

const rx_estimate *rx_cell_get(const rx_photometry_cell *cell, rx_cell_quantity quantity)
{
    const rx_estimate *const all[RX_CELL_QUANTITIES] = {
        [RX_CELL_RECALL] = &cell->recall,
        [RX_CELL_PRECISION] = &cell->precision,
        [RX_CELL_AP] = &cell->ap,
        [RX_CELL_MAGERR] = &cell->magerr,
        [RX_CELL_MAGERR_CLEAN] = &cell->magerr_clean,
        [RX_CELL_CROWDED] = &cell->crowded,
        [RX_CELL_BIAS_PERCENT] = &cell->bias_percent,
        [RX_CELL_SCATTER_PERCENT] = &cell->scatter_percent,
        [RX_CELL_BIAS_MAG] = &cell->bias_mag,
        [RX_CELL_SCATTER_MAG] = &cell->scatter_mag,
        [RX_CELL_PULL_MEDIAN] = &cell->pull_median,
        [RX_CELL_PULL_WIDTH] = &cell->pull_width,
    };
    return all[quantity];
}

static const rx_report_column RUNS[] = {{.name = "name"}, {.name = "settings"}};

static const rx_report_column SETS[] = {
    {.name = "scene", .help = "field"},
    {.name = "condition", .help = "magnitude of the stars"},
    {"mag", RX_REPORT_NUMBER, 2, "mag", "of the stars", NULL},
    {"snr", RX_REPORT_NUMBER, 1, "", "in a matched filter on the background", NULL},
    {"tiles", RX_REPORT_COUNT, 0, "", "", NULL},
    {"stars", RX_REPORT_COUNT, 0, "", "", NULL},
    {"mpixels", RX_REPORT_NUMBER, 3, "", "", NULL},
    {.name = "about", .help = "the field"},
};

static const rx_report_column CUTS[] = {
    {.name = "scene", .help = "field"},
    {.name = "run", .help = "restorer"},
    {"precision_from", RX_REPORT_NUMBER, 2, "", "at least this precision; nan: the whole list", NULL},
    {"score", RX_REPORT_NUMBER, 2, "", "lowest score; inf: the precision is never reached", NULL},
    {"whole_list", RX_REPORT_COUNT, 0, "",
     "1: the list ends above this precision, completeness is a lower limit", NULL},
    {"precision", RX_REPORT_ESTIMATE, 4, "", "over all sets of the field", NULL},
    {"recall", RX_REPORT_ESTIMATE, 3, "", "over all sets of the field", NULL},
    {"mag50", RX_REPORT_ESTIMATE, 2, "mag", "magnitude of 50 % completeness", NULL},
    {"mag90", RX_REPORT_ESTIMATE, 2, "mag", "magnitude of 90 % completeness", NULL},
    {"false_per_mpixel", RX_REPORT_ESTIMATE, 2, "", "whole list", NULL},
};

static const rx_report_column CURVES[] = {
    {.name = "scene", .help = "field"},
    {.name = "condition", .help = "magnitude of the stars"},
    {.name = "run", .help = "restorer"},
    {"score", RX_REPORT_NUMBER, 2, "", "S/N of the detection", NULL},
    {"recall", RX_REPORT_NUMBER, 4, "", "of the stars with this score or a higher one", NULL},
    {"precision", RX_REPORT_NUMBER, 4, "", "the same", NULL},
};

#define LENGTH(table) ((int)(sizeof(table) / sizeof *(table)))

enum { CURVE_POINTS = 200 };

typedef struct page {
    const rx_photometry_numbers *m;
    rx_findings f;
    rx_report_table *sets, *cuts, *curves;
} page;

/* Magnitudes against restorers. precision: completeness at that one instead of the quantity, -1: not. */
static void add_quantity(page *g, int f, const rx_quantity *quantity, int q, int precision, int brief)
{
    const rx_lab *lab = g->m->lab;
    const long from = rx_report_rows(g->f.cells);
    char mag[32];
    for (int k = 0; k < lab->nscenes; k++)
        for (int run = 0; run < g->m->lab->nruns; run++) {
            const rx_photometry_cell *cell = rx_photometry_cell_of(g->m, f, k, run);
            snprintf(mag, sizeof mag, "%g", lab->scene[k].mag);
            rx_findings_cell(
                &g->f, &(rx_finding){lab->sky[f].name, mag, g->m->lab->run[run].name, NULL}, quantity,
                precision < 0 ? rx_cell_get(cell, (rx_cell_quantity)q) : &cell->complete[precision]);
        }
    rx_findings_show(&g->f, from, quantity, brief);
}

static const char *winner_name(const rx_photometry_numbers *m, int pair, int winner)
{
    return winner == 0 ? NULL : m->lab->run[winner > 0 ? m->pair[pair].first : m->pair[pair].second].name;
}

/* The same stars through two restorers: which finds more, whose errors are smaller. */
static void add_pair(page *g, int f, int pair)
{
    static const char *const columns[] = {"condition",  "quantity", "test", "only_first", "only_second",
                                          "difference", "p",        "holm", "winner"};
    const rx_photometry_numbers *m = g->m;
    const rx_lab *lab = m->lab;
    const rx_estimate none = {NAN, NAN, NAN, 0};
    const long from = rx_report_rows(g->f.contests);
    char mag[32], quantity[48], title[128];
    for (int which = -1; which < m->nprecisions; which++)
        for (int k = 0; k < lab->nscenes; k++) {
            const rx_photometry_duel *d = rx_photometry_duel_of(m, f, k, pair);
            const rx_found_duel *found = which < 0 ? &d->found : &d->complete[which];
            snprintf(mag, sizeof mag, "%g", lab->scene[k].mag);
            snprintf(quantity, sizeof quantity, "found at precision %g",
                     which < 0 ? NAN : m->precision[which]);
            rx_findings_contest(&g->f, &(rx_contest){.scene = lab->sky[f].name,
                                                     .condition = mag,
                                                     .quantity = which < 0 ? "found" : quantity,
                                                     .first = m->lab->run[m->pair[pair].first].name,
                                                     .second = m->lab->run[m->pair[pair].second].name,
                                                     .test = "McNemar",
                                                     .statistic = NAN,
                                                     .dof = NAN,
                                                     .p = found->p,
                                                     .ln_p = log(found->p),
                                                     .effect = NAN,
                                                     .holm = found->holm,
                                                     .ntests = lab->nscenes,
                                                     .winner = winner_name(m, pair, found->winner),
                                                     .difference = none,
                                                     .only_first = (double)found->only_first,
                                                     .only_second = (double)found->only_second});
        }
    for (int k = 0; k < lab->nscenes; k++) {
        const rx_photometry_duel *d = rx_photometry_duel_of(m, f, k, pair);
        const rx_test *tests[] = {&d->paired, &d->wilcoxon};
        snprintf(mag, sizeof mag, "%g", lab->scene[k].mag);
        for (int i = 0; i < 2; i++)
            rx_findings_contest(&g->f, &(rx_contest){.scene = lab->sky[f].name,
                                                     .condition = mag,
                                                     .quantity = "100 |F - F0| / F0",
                                                     .first = m->lab->run[m->pair[pair].first].name,
                                                     .second = m->lab->run[m->pair[pair].second].name,
                                                     .test = i ? "Wilcoxon" : "paired t",
                                                     .statistic = tests[i]->statistic,
                                                     .dof = tests[i]->dof,
                                                     .p = tests[i]->p,
                                                     .ln_p = tests[i]->ln_p,
                                                     .effect = tests[i]->effect,
                                                     .holm = i ? d->holm_wilcoxon : d->holm,
                                                     .ntests = lab->nscenes,
                                                     .winner = i ? NULL : winner_name(m, pair, d->winner),
                                                     .difference = i ? none : d->paired.difference,
                                                     .only_first = NAN,
                                                     .only_second = NAN});
    }
    snprintf(title, sizeof title, "%.40s against %.40s, on the same stars",
             m->lab->run[m->pair[pair].first].name, m->lab->run[m->pair[pair].second].name);
    rx_report_fold(g->f.report, title);
    rx_findings_show_contests(&g->f, from, NULL, LENGTH(columns), columns);
    rx_report_unfold(g->f.report);
}

static void add_cuts(page *g, int f)
{
    const rx_photometry_numbers *m = g->m;
    const long from = rx_report_rows(g->cuts);
    const rx_estimate none = {NAN, NAN, NAN, 0};
    rx_text *brief = rx_report_brief_of(g->f.report);
    rx_text_printf(brief, "%s\n", m->lab->sky[f].name);
    for (int p = -1; p < m->nprecisions; p++)
        for (int run = 0; run < m->lab->nruns; run++) {
            const rx_photometry_whole *w = rx_photometry_whole_of(m, f, run);
            const rx_photometry_cut *c = p < 0 ? NULL : &w->cut[p];
            const rx_estimate recall = c == NULL ? w->recall : c->recall;
            rx_report_row(g->cuts, (rx_cell[]){rx_cell_words(m->lab->sky[f].name),
                                               rx_cell_words(m->lab->run[run].name),
                                               rx_cell_number(p < 0 ? NAN : m->precision[p]),
                                               rx_cell_number(c == NULL ? -INFINITY : c->score),
                                               rx_cell_number(c == NULL || c->whole_list),
                                               rx_cell_estimate(c == NULL ? w->precision : c->precision),
                                               rx_cell_estimate(recall),
                                               rx_cell_estimate(c == NULL ? w->mag50 : c->mag50),
                                               rx_cell_estimate(c == NULL ? w->mag90 : c->mag90),
                                               rx_cell_estimate(c == NULL ? w->false_per_mpixel : none)});
            rx_text_printf(brief, "%-14s %s %-5.3g recall %.3f precision %.3f\n", m->lab->run[run].name,
                           p < 0 ? "whole list  " : "at precision", p < 0 ? 0.0 : m->precision[p],
                           recall.value, c == NULL ? w->precision.value : c->precision.value);
        }
    rx_report_show(
        g->f.report, g->cuts,
        &(rx_report_view){.from = from,
                          .to = rx_report_rows(g->cuts),
                          .title = "Over all magnitudes: depth, and thresholds of equal precision",
                          .note = "The threshold is the lowest score (S/N of the detection) at which stars "
                                  "found / (stars found + false detections), all magnitudes together, is "
                                  "at least the precision named. A depth with an infinite end is a limit."});
}

static void add_curves(page *g, int f)
{
    const rx_lab *lab = g->m->lab;
    char mag[32];
    for (int k = 0; k < lab->nscenes; k++)
        for (int run = 0; run < g->m->lab->nruns; run++) {
            const rx_pr *pr = &rx_photometry_cell_of(g->m, f, k, run)->pr;
            const long skip = pr->n / CURVE_POINTS + 1;
            snprintf(mag, sizeof mag, "%g", lab->scene[k].mag);
            for (long i = 0; i < pr->n; i++)
                if (i % skip == 0 || i + 1 == pr->n)
                    rx_report_row(g->curves, (rx_cell[]){rx_cell_words(lab->sky[f].name), rx_cell_words(mag),
                                                         rx_cell_words(g->m->lab->run[run].name),
                                                         rx_cell_number(pr->point[i].score),
                                                         rx_cell_number(pr->point[i].recall),
                                                         rx_cell_number(pr->point[i].precision)});
        }
}

static void add_field(page *g, int f)
{
    const rx_photometry_numbers *m = g->m;
    const rx_lab *lab = m->lab;
    const long from = rx_report_rows(g->sets);
    rx_text words = {0};
    char name[48];
    snprintf(name, sizeof name, "field%d", f);
    rx_report_section(g->f.report, name, lab->sky[f].name);
    snprintf(name, sizeof name, "field%d-", f);
    rx_report_place(g->f.report, name);
    snprintf(name, sizeof name, "curve%d-", f);
    rx_report_place(g->f.report, name);
    rx_report_sentence(g->f.report, lab->sky[f].about);
    rx_report_fold(g->f.report, "Pairs of restorers in words");
    for (int p = 0; p < m->npairs; p++) {
        const size_t before = words.length;
        rx_photometry_pair_words(&words, m, f, p);
        rx_report_sentence(g->f.report, words.data != NULL ? words.data + before : "");
    }
    rx_report_unfold(g->f.report);
    rx_report_brief_of(g->f.report)->failed |= words.failed;
    rx_text_free(&words);
    add_cuts(g, f);
    for (int k = 0; k < lab->nscenes; k++) {
        const rx_photometry_set own = rx_photometry_set_of(lab, f, k), *set = &own;
        snprintf(name, sizeof name, "%g", set->mag);
        rx_report_row(g->sets,
                      (rx_cell[]){rx_cell_words(lab->sky[f].name), rx_cell_words(name),
                                  rx_cell_number(set->mag), rx_cell_number(set->snr),
                                  rx_cell_number((double)set->ntiles), rx_cell_number((double)set->nstars),
                                  rx_cell_number(set->mpixels), rx_cell_words(lab->sky[f].about)});
    }
    for (int p = 0; p < m->nprecisions; p++) {
        rx_quantity q = {.unit = "", .digits = 3};
        snprintf(q.name, sizeof q.name, "recall_p%g", m->precision[p]);
        snprintf(q.help, sizeof q.help, "share of the stars found at precision %g", m->precision[p]);
        add_quantity(g, f, &q, 0, p, p == 0);
    }
    add_quantity(g, f, &QUANTITIES[RX_CELL_MAGERR], RX_CELL_MAGERR, -1, 1);
    rx_report_fold(g->f.report, "More tables");
    for (int q = 0; q < RX_CELL_QUANTITIES; q++)
        if (q != RX_CELL_MAGERR)
            add_quantity(g, f, &QUANTITIES[q], q, -1, 0);
    rx_report_show(g->f.report, g->sets,
                   &(rx_report_view){.from = from, .to = rx_report_rows(g->sets), .title = "Tiles"});
    rx_report_unfold(g->f.report);
    for (int pair = 0; pair < m->npairs; pair++)
        add_pair(g, f, pair);
    add_curves(g, f);
}

static void write_reading(rx_report *report)
{
    char html[2400];
    snprintf(
        html, sizeof html,
        "Stars of one known magnitude at a time are put onto tiles that also hold other objects and noise; "
        "every "
        "restorer restores the same tiles, and the same program detects and measures. A star is found when a "
        "detection lies on it; a false detection is one that is neither one of the stars nor any object "
        "known to be "
        "there. Shares have Clopper-Pearson intervals, medians and sigma_MAD (1.4826 times the median "
        "absolute "
        "deviation) intervals from order statistics, MagErr, ap and the depths bootstrap intervals (%d "
        "draws, none for "
        "fewer than %d stars). Stars of one tile share its noise and its neighbours; the intervals take them "
        "as "
        "independent, and a threshold at equal precision as given. Precision depends on how many stars a "
        "tile holds, "
        "the same for every restorer. <b>Equal precision</b>: a cut at k sigma means different things on raw "
        "and on "
        "restored pixels, so each restorer gets the threshold at which its own precision has the value "
        "named; then "
        "completeness is compared. <b>MagErr</b> is a mean of absolute values: it hides the sign, which "
        "bias_percent "
        "and bias_mag give, and single gross errors weigh in it. It, bias, scatter and pull are of the stars "
        "that a "
        "restorer found: one that finds more has more of the difficult ones; only the contests compare "
        "errors on the "
        "same stars. F0 is the flux that was put in; nothing is calibrated away. On a real tile, whatever is "
        "found "
        "before the stars are added counts neither as right nor as false; false there is what the stars "
        "bring with "
        "them, and all that is found on as many realisations of the tile's own noise without sources.",
        RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_report_paragraph(report, html);
}

rx_status rx_photometry_report(const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    rx_photometry_numbers m = {0};
    rx_claim_verdicts verdicts;
    page g = {.m = &m};
    rx_status status = rx_photometry_numbers_make(lab, output->record->seed, &m, err);
    if (status == RX_OK)
        status = rx_findings_begin(&g.f, "photometry", NULL, 0, output, err);
    if (status != RX_OK)
        goto exit;
    rx_report *report = g.f.report;
    rx_report_fact_numbers(report, "precisions", m.nprecisions, m.precision);
    rx_photometry_verdicts(&m, &verdicts);
    rx_findings_claims(&g.f, &verdicts, NULL);
    rx_report_table *runs = rx_report_table_add(report, "runs", LENGTH(RUNS), RUNS, RX_REPORT_IN_JSON);
    g.sets = rx_report_table_add(report, "sets", LENGTH(SETS), SETS, RX_REPORT_EVERYWHERE);
    g.cuts = rx_report_table_add(report, "cuts", LENGTH(CUTS), CUTS, RX_REPORT_EVERYWHERE);
    g.curves = rx_report_table_add(report, "curves", LENGTH(CURVES), CURVES, RX_REPORT_IN_FILE);
    rx_photometry_figures(rx_report_figures_of(report), &m);
    for (int f = 0; f < lab->nconditions; f++)
        add_field(&g, f);
    rx_report_section(report, "runs", "Restorers");
    for (int run = 0; run < lab->nruns; run++)
        rx_report_row(runs,
                      (rx_cell[]){rx_cell_words(lab->run[run].name), rx_cell_words(lab->run[run].settings)});
    rx_report_show(report, runs, &(rx_report_view){.to = rx_report_rows(runs)});
    rx_report_section(report, "reading", "How to read this");
    write_reading(report);
    status = rx_findings_end(&g.f, err);
exit:
    rx_photometry_numbers_free(&m);
    return status;
}

const rx_lab_kind rx_kind_photometry = {.name = "PHOTOMETRY",
                                        .title = "Photometry campaign",
                                        .tag = 0x70686f746f,
                                        .ntables = RX_PHOTOMETRY_TABLES,
                                        .tables = rx_photometry_tables,
                                        .open = rx_photometry_open,
                                        .prepare = rx_photometry_prepare,
                                        .unit = rx_photometry_unit,
                                        .describe = rx_photometry_describe,
                                        .report = rx_photometry_report};
