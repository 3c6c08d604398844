/* The report of a detection campaign. */
#include "lab/detection_numbers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/findings.h"
#include "lab/kinds.h"

enum { OPEN = 2 }; /* quantities of a scene that the page shows at once, and the terminal */

/* 0: a single setting of RL, which the page leaves out. */
static int is_shown(const rx_detection_numbers *m, int column)
{
    return column >= m->lab->nruns || !m->lab->run[column].tuned;
}

static const char READING[] =
    "Every number is followed by its 95 % interval and by how many objects (or counts) are behind it. Shares "
    "have Clopper-Pearson intervals, counts Poisson ones, ap and flux ratios bootstrap intervals; objects of "
    "one tile share its noise, which the intervals do not know. PLATEAU: the interval holds all tiles. "
    "<b>MATCHED</b> is the unrestored image with a Gaussian of the PSF's width as its detection filter, NONE "
    "the same with FILTER_NAME. <b>RL</b> is Richardson-Lucy at its best: for ap, the recalls and PAIRS the "
    "setting of the highest value, each for itself and chosen on the tiles of the test, which is in its "
    "favour; for everything else the setting of the highest ap over STARS and GALAXIES together. Which one "
    "it "
    "is, and the settings one by one, are in cells.ecsv. <b>Thresholds</b>: recall at a precision is at the "
    "lowest score with that precision on the scene itself; PAIRS, BLANK and RINGS use the thresholds of "
    "STARS "
    "and GALAXIES together.";

/* Cells of one quantity: conditions against runs. */
static void add_quantity(rx_findings *f, const rx_detection_numbers *m, int s, int q)
{
    const rx_lab *r = m->lab;
    const long from = rx_report_rows(f->cells);
    rx_quantity quantity;
    rx_quantity_get(r, r->scene[s].id, q, &quantity);
    for (int tuned = 0; tuned < 2; tuned++) { /* settings of RL come last: the page leaves them out */
        for (int c = 0; c < r->nconditions; c++)
            for (int k = 0; k < m->ncolumns; k++) {
                char name[96];
                if (is_shown(m, k) == tuned)
                    continue;
                rx_lab_condition_name(r, c, name, sizeof name);
                const rx_detection_cell *cell = rx_detection_cell_of(m, c, s, k);
                rx_findings_cell(f,
                                 &(rx_finding){rx_scene_name(r->scene[s].id), name,
                                               rx_detection_column_name(m, k), cell->chosen[q]},
                                 &quantity, &cell->value[q]);
            }
        if (!tuned)
            rx_findings_show(f, from, &quantity, q < OPEN);
    }
}

/* Objects that only one of two has found. */
static void add_contests(rx_findings *f, const rx_detection_numbers *m, int s)
{
    static const char *const columns[] = {"condition", "first", "second", "only_first", "only_second", "p"};
    const rx_lab *r = m->lab;
    const long from = rx_report_rows(f->contests);
    char title[96];
    for (int c = 0; c < r->nconditions; c++)
        for (int k = 0; k < m->nrivals && r->nprecisions > 0; k++) {
            const rx_detection_duel *d = rx_detection_duel_of(m, c, s, k);
            rx_lab_condition_name(r, c, title, sizeof title);
            rx_findings_contest(f, &(rx_contest){.scene = rx_scene_name(r->scene[s].id),
                                                 .condition = title,
                                                 .quantity = "found at the first precision",
                                                 .first = rx_detection_column_name(m, m->hero),
                                                 .second = rx_detection_column_name(m, m->rival[k]),
                                                 .test = "McNemar",
                                                 .statistic = NAN,
                                                 .dof = NAN,
                                                 .p = d->p,
                                                 .ln_p = log(d->p),
                                                 .effect = NAN,
                                                 .holm = NAN,
                                                 .difference = {NAN, NAN, NAN, 0},
                                                 .only_first = (double)d->only_first,
                                                 .only_second = (double)d->only_second});
        }
    snprintf(title, sizeof title, "Objects found at precision %g by only one of two",
             r->nprecisions > 0 ? r->precision[0] : NAN);
    rx_findings_show_contests(f, from, title, 6, columns);
}

/* The first tables lie open, the rest is folded away. */
static void add_scene(rx_findings *f, const rx_detection_numbers *m, int s)
{
    const rx_scene_id scene = m->lab->scene[s].id;
    const int n = rx_quantity_count(m->lab, scene);
    char prefix[32];
    rx_report_section(f->report, rx_scene_name(scene), rx_scene_name(scene));
    snprintf(prefix, sizeof prefix, "%s-", rx_scene_name(scene));
    if (rx_scene_is_list(scene))
        rx_report_place(f->report, prefix);
    rx_report_paragraph(f->report, rx_scene_about(scene));
    for (int q = 0; q < n; q++) {
        if (q == OPEN)
            rx_report_fold(f->report, "More tables");
        add_quantity(f, m, s, q);
    }
    if (rx_scene_is_list(scene))
        add_contests(f, m, s);
    if (n > OPEN)
        rx_report_unfold(f->report);
}

/* ap and recall over the seeing, where restorers are given the truth. */
static void plot(rx_figures *dst, const rx_detection_numbers *m, int s, int q)
{
    const rx_lab *r = m->lab;
    const size_t n = (size_t)r->nconditions;
    rx_quantity quantity;
    rx_curve curves[RX_METHODS_MAX];
    char id[RX_FIGURE_ID];
    int ncurves = 0;
    double low = HUGE_VAL, high = 0;
    rx_quantity_get(r, r->scene[s].id, q, &quantity);
    double *data = RX_NEW(double, 4 * n * RX_METHODS_MAX);
    if (data == NULL) {
        dst->script.failed = true;
        return;
    }
    for (int k = 0; k < m->ncolumns && ncurves < RX_METHODS_MAX; k++) {
        if (!is_shown(m, k))
            continue;
        double *x = data + 4 * n * (size_t)ncurves, *y = x + n, *lows = y + n, *highs = lows + n;
        long points = 0;
        for (int c = 0; c < r->nconditions; c++) {
            const rx_estimate *e = &rx_detection_cell_of(m, c, s, k)->value[q];
            if (!rx_condition_true(&r->sky[c].condition))
                continue;
            x[points] = r->sky[c].fwhm + 0.03 * ncurves;
            low = fmin(low, x[points]);
            high = fmax(high, x[points]);
            y[points] = e->value;
            lows[points] = e->low;
            highs[points++] = e->high;
        }
        curves[ncurves] = (rx_curve){.name = rx_detection_column_name(m, k), .kind = RX_CURVE_BARS};
        curves[ncurves].color = rx_method_color(curves[ncurves].name);
        curves[ncurves].n = points;
        curves[ncurves].x = x;
        curves[ncurves].y = y;
        curves[ncurves].low = lows;
        curves[ncurves++].high = highs;
    }
    const rx_axes axes = {
        "FWHM of the PSF (pixels)", quantity.name, low - 0.5, high + 0.5, 0, 1.02, false, false};
    snprintf(id, sizeof id, "%s-%d", rx_scene_name(r->scene[s].id), q);
    rx_figure_add(dst, id, quantity.name, quantity.help, RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, ncurves, curves);
    free(data);
}

static rx_status report(const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    rx_detection_numbers m = {0};
    rx_claim_verdicts verdicts;
    rx_findings f;
    rx_status status = rx_detection_numbers_make(lab, output->record->seed, &m, err);
    if (status == RX_OK)
        status = rx_findings_begin(&f, "detection", lab->about, 0, output, err);
    if (status != RX_OK)
        goto exit;
    rx_detection_verdicts(&m, &verdicts);
    rx_findings_claims(&f, &verdicts, NULL);
    rx_report_sentence(f.report, lab->about);
    for (int kind = 0; kind < RX_SCENE_IDS; kind++)
        for (int s = 0; s < lab->nscenes; s++) {
            if (lab->scene[s].id != (rx_scene_id)kind)
                continue;
            for (int q = 0; q < OPEN && rx_scene_is_list(lab->scene[s].id); q++)
                plot(rx_report_figures_of(f.report), &m, s, q);
            add_scene(&f, &m, s);
        }
    rx_report_section(f.report, "reading", "How to read this");
    rx_report_paragraph(f.report, READING);
    status = rx_findings_end(&f, err);
exit:
    rx_detection_numbers_free(&m);
    return status;
}

const rx_lab_kind rx_kind_detection = {.name = "DETECTION",
                                       .title = "Detection campaign",
                                       .tag = 0x6465746563,
                                       .ntables = RX_DETECTION_TABLES,
                                       .tables = rx_detection_tables,
                                       .deep = 1,
                                       .open = rx_detection_open,
                                       .unit = rx_detection_unit,
                                       .describe = rx_detection_describe,
                                       .report = report};
