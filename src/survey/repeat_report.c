/* The report of repeatability: numbers, by S/N and by magnitude. */
#include <math.h>
#include <stdio.h>

#include "report/curves.h"
#include "report/page.h"
#include "report/report.h"
#include "survey/repeat_field.h"

enum { BINS = 13 };
static const double SNR[BINS + 1] = {5, 7, 10, 15, 20, 30, 50, 70, 100, 200, 400, 1000, 3000, INFINITY};
static const double MMAG = 1e3, MAS = 1e3;
static const char *const populations[RX_REPEAT_POPULATIONS] = {"points", "others"};

RX_COLUMNS(REPEAT, RX_TEXT("first", "visit, or all pairs of visits together"), RX_TEXT("second", "visit"),
           RX_COUNT("matched", "sources within MATCH_RADIUS"),
           {"chance", RX_REPORT_COUNT, 0, "", "the same after a shift by 10 radii: matches by chance",
            "by chance"},
           RX_MEASURED("zero_point", 4, "mag", "second - first, taken off"),
           {"offset_east", RX_REPORT_NUMBER, 1, "mas", "second - first, taken off", "offset east"},
           {"offset_north", RX_REPORT_NUMBER, 1, "mas", "", "offset north"},
           RX_COUNT("bright", "pairs of point sources with S/N of REPEAT_SNR or more"),
           {"pa1", RX_REPORT_ESTIMATE, 2, "mmag", "1.4826 MAD of their differences / sqrt 2", "PA1"},
           {"pa1_rms", RX_REPORT_NUMBER, 2, "mmag", "rms of their differences / sqrt 2", "by rms"},
           RX_NUMBER("claimed", 2, "mmag", "median of their claimed errors"),
           {"pf1", RX_REPORT_ESTIMATE, 3, "", "share with |difference| / sqrt 2 above REPEAT_OUTLIER", "PF1"},
           {"east", RX_REPORT_ESTIMATE, 2, "mas", "1.4826 MAD of their positions' differences / sqrt 2",
            NULL},
           {"north", RX_REPORT_ESTIMATE, 2, "mas", "", NULL},
           {"am1", RX_REPORT_NUMBER, 2, "mas", "the same of separations of 4 to 6 arcmin", "AM1"},
           {"separations", RX_REPORT_COUNT, 0, "", "so many", NULL},
           {"pull", RX_REPORT_ESTIMATE, 3, "", "width of pulls of point sources from S/N 5 on", NULL},
           {"found", RX_REPORT_ESTIMATE, 3, "", "share of the sources of one visit that another one has",
            "found again"});

RX_COLUMNS(BY_SNR, RX_TEXT("population", ""), RX_NUMBER("snr_low", 0, "", "S/N from"),
           RX_NUMBER("snr_high", 0, "", "below"), RX_COUNT("pairs", ""),
           RX_ESTIMATE("scatter", 2, "mmag", "1.4826 MAD of differences / sqrt 2"),
           RX_NUMBER("claimed", 2, "mmag", "median of the claimed errors"),
           RX_ESTIMATE("pull", 3, "", "width of pulls"),
           {"pull_median", RX_REPORT_ESTIMATE, 3, "", "median of pulls, second visit fainter: above 0",
            "median pull"},
           RX_ESTIMATE("east", 2, "mas", "of positions"), RX_ESTIMATE("north", 2, "mas", ""));

RX_COLUMNS(BY_MAG, RX_TEXT("population", ""),
           RX_NUMBER("mag_low", 1, "mag", "of the first visit's scale, from"),
           RX_NUMBER("mag_high", 1, "mag", "below"),
           {"found", RX_REPORT_ESTIMATE, 3, "", "share that another visit has", "found again"});

RX_COLUMNS(LIMITS, RX_TEXT("population", ""), RX_COUNT("seen", "sources that another visit sees"),
           {"mag90", RX_REPORT_ESTIMATE, 2, "mag", "90 % are found again", "90 %"},
           {"mag50", RX_REPORT_ESTIMATE, 2, "mag", "50 %", "50 %"});

RX_COLUMNS(VISITS, RX_TEXT("catalogue", ""), RX_COUNT("sources", ""),
           RX_TEXT("footprint", "how it is known what the visit sees"));

static rx_estimate times(rx_estimate e, double by)
{
    return (rx_estimate){by * e.value, by * e.low, by * e.high, e.n};
}

static void put_couple(rx_report_table *t, const rx_repeat_field *f, const rx_repeat_couple *c)
{
    const rx_repeat_numbers *b = &c->bright;
    const int all = c == &f->all;
    /* of k visits every source counts k (k - 1) times */
    const int visits = all ? f->nvisits : 2;
    rx_estimate found = rx_binomial_interval(lround(2.0 * (double)c->found / visits),
                                             lround(2.0 * (double)c->seen / visits), 0.95);
    found.value = c->seen > 0 ? (double)c->found / (double)c->seen : NAN;
    found.n = c->seen;
    rx_report_put(t, all ? "all" : f->visit[c->first].name, all ? "" : f->visit[c->second].name, c->matched,
                  c->chance, rx_cell_measured(c->zero_point, c->zero_point_error), MAS * c->dx, MAS * c->dy,
                  b->n, times(b->scatter, MMAG), MMAG * b->rms, MMAG * b->claimed, b->outliers,
                  times(b->axis[0], MAS), times(b->axis[1], MAS), MAS * b->separation, b->separations,
                  c->points.pull, found);
}

/* --- by S/N --- */

static rx_status measure_bins(const rx_repeat_field *f, int star, rx_repeat_numbers dst[BINS], rx_error *err)
{
    for (int b = 0; b < BINS; b++) {
        const rx_repeat_cut cut = {SNR[b], SNR[b + 1], star, 1e-3 * f->config->repeat_outlier, f->nvisits};
        RX_TRY(rx_repeat_measure(&cut, f->npairs, f->pair, &dst[b], err));
    }
    return RX_OK;
}

/* What is drawn of a bin; without an interval: the claimed errors. */
typedef enum quantity { SCATTER, CLAIMED, PULL, EAST, NORTH } quantity;

static rx_estimate drawn(const rx_repeat_numbers *n, quantity what)
{
    switch (what) {
    case SCATTER:
        return times(n->scatter, MMAG);
    case CLAIMED:
        return (rx_estimate){MMAG * n->claimed, NAN, NAN, n->n};
    case PULL:
        return n->pull;
    default:
        return times(n->axis[what - EAST], MAS);
    }
}

static void draw_by_snr(rx_figures *dst, rx_repeat_numbers numbers[][BINS])
{
    enum { FIGURES = 3 };
    static const struct {
        int figure, population, color;
        quantity what;
        const char *name;
    } list[] = {{0, 0, 0, SCATTER, "points"},
                {0, 1, 1, SCATTER, "others"},
                {0, 0, 0, CLAIMED, "points claimed"},
                {0, 1, 1, CLAIMED, "others claimed"},
                {1, 0, 0, PULL, "points"},
                {1, 1, 1, PULL, "others"},
                {2, 0, 0, EAST, "east"},
                {2, 0, 1, NORTH, "north"}};
    static const char *const texts[FIGURES][4] = {
        {"repeat-1-scatter", "Scatter of magnitudes", "scatter [mmag]",
         "Of one measurement, with 95 % intervals; dashed: the claimed errors."},
        {"repeat-2-pull", "Scatter over claimed errors", "width of pulls",
         "1: errors are true; above: they are too small."},
        {"repeat-3-positions", "Scatter of positions", "scatter [mas]",
         "Of one measurement of a point source, with 95 % intervals."}};
    rx_curves curves[FIGURES] = {{0}};
    double last = SNR[1];
    for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
        rx_curves *c = &curves[list[i].figure];
        rx_curves_add(c, list[i].what == CLAIMED ? RX_CURVE_LINE : RX_CURVE_BARS, list[i].color,
                      list[i].name);
        for (int b = 0; b < BINS; b++) {
            const rx_repeat_numbers *n = &numbers[list[i].population][b];
            const double x = b + 1 < BINS ? sqrt(SNR[b] * SNR[b + 1]) : 1.5 * SNR[b];
            const rx_estimate e = drawn(n, list[i].what);
            if (n->n < RX_REPEAT_FEW)
                continue;
            rx_curves_put(c, x, e.value, e.low, e.high);
            last = fmax(last, 1.5 * x);
        }
    }
    rx_curves_reference(&curves[1], SNR[0], 1, last, 1);
    for (int k = 0; k < FIGURES; k++)
        rx_curves_figure(dst, texts[k][0], texts[k][1], texts[k][3],
                         &(rx_axes){.xlabel = "S/N of a visit",
                                    .ylabel = texts[k][2],
                                    .x0 = SNR[0],
                                    .x1 = last,
                                    .log_x = true,
                                    .log_y = k != 1},
                         &curves[k]);
}

static rx_report_table *add_by_snr(rx_report *report, rx_repeat_numbers numbers[][BINS])
{
    rx_report_table *t = RX_REPORT_TABLE(report, "by_snr", BY_SNR, RX_REPORT_EVERYWHERE);
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++)
        for (int b = 0; b < BINS; b++) {
            const rx_repeat_numbers *n = &numbers[k][b];
            if (n->n >= RX_REPEAT_FEW)
                rx_report_put(t, populations[k], SNR[b], SNR[b + 1], n->n, drawn(n, SCATTER),
                              MMAG * n->claimed, n->pull, n->pull_median, drawn(n, EAST), drawn(n, NORTH));
        }
    return t;
}

/* --- by magnitude --- */

static void add_by_mag(const rx_repeat_field *f, rx_report *report)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "by_mag", BY_MAG, RX_REPORT_EVERYWHERE);
    rx_curves c = {0};
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++) {
        long seen[RX_MAX_BINS] = {0}, found[RX_MAX_BINS] = {0};
        for (long i = 0; i < f->trials[k].n; i++) {
            const int b = rx_bins_index(&f->bins, f->trials[k].mag[i]);
            if (b >= 0) {
                seen[b]++;
                found[b] += f->trials[k].found[i];
            }
        }
        rx_curves_add(&c, RX_CURVE_BARS, k, populations[k]);
        for (int b = 0; b < f->bins.n; b++) {
            if (seen[b] == 0)
                continue;
            rx_estimate e = rx_binomial_interval(lround(2.0 * (double)found[b] / f->nvisits),
                                                 lround(2.0 * (double)seen[b] / f->nvisits), 0.95);
            e.value = (double)found[b] / (double)seen[b];
            e.n = seen[b];
            rx_report_put(t, populations[k], f->bins.edge[b], f->bins.edge[b + 1], e);
            if (seen[b] >= RX_REPEAT_FEW)
                rx_curves_put(&c, 0.5 * (f->bins.edge[b] + f->bins.edge[b + 1]), e.value, e.low, e.high);
        }
    }
    rx_curves_figure(rx_report_figures_of(report), "repeat-4-found", "Found again",
                     "Share of the sources of a visit that another one has; bars are 95 % intervals.",
                     &(rx_axes){.xlabel = "magnitude, on the first visit's scale",
                                .ylabel = "found again",
                                .x0 = f->bins.edge[0],
                                .x1 = f->bins.edge[f->bins.n],
                                .y0 = 0,
                                .y1 = 1.02},
                     &c);
}

/* --- all of it --- */

static void add_facts(rx_report *report, const rx_repeat_field *f, rx_log *log)
{
    const rx_repeat_numbers *b = &f->all.bright;
    const rx_estimate pull = f->all.points.pull;
    const bool open = !isfinite(pull.high) || !isfinite(b->scatter.high);
    char word[80], sentence[400], wide[80] = "", found[60] = "no source is seen twice";
    rx_report_fact(report, "format", "rextract repeat 1");
    rx_report_fact_number(report, "visits", f->nvisits);
    rx_report_fact_number(report, "pairs_of_visits", f->ncouples);
    rx_report_fact(report, "magnitude", f->columns.mag);
    rx_report_fact(report, "magnitude_error", f->columns.error);
    rx_report_fact(report, "position", f->columns.alpha);
    rx_report_fact(report, "point_sources", f->columns.star);
    rx_report_fact_number(report, "match_radius", f->config->match_radius);
    rx_report_fact_number(report, "repeat_snr", f->config->repeat_snr);
    rx_report_fact_number(report, "repeat_star", f->config->repeat_star);
    rx_report_fact_number(report, "repeat_outlier", f->config->repeat_outlier);
    if (isfinite(pull.value))
        snprintf(wide, sizeof wide, "pulls of point sources are %.2f wide (1: errors are true), ",
                 pull.value);
    if (f->all.seen > 0)
        snprintf(found, sizeof found, "%.1f %% of sources are found again",
                 100.0 * (double)f->all.found / (double)f->all.seen);
    if (b->n >= RX_REPEAT_FEW) {
        snprintf(word, sizeof word, "PA1 is %.1f mmag,", MMAG * b->scatter.value);
        snprintf(
            sentence, sizeof sentence,
            "of %ld pairs of point sources with S/N of %g or more, whose claimed errors are %.1f mmag; %s%s.",
            b->n, f->config->repeat_snr, MMAG * b->claimed, wide, found);
    } else {
        snprintf(word, sizeof word, "No PA1:");
        snprintf(sentence, sizeof sentence,
                 "%ld pairs of point sources have S/N of %g or more (REPEAT_SNR), %d are needed; %s%s.", b->n,
                 f->config->repeat_snr, RX_REPEAT_FEW, wide, found);
    }
    rx_report_verdict(report,
                      open                                  ? RX_MARK_OPEN
                      : pull.low <= 1.1 && pull.high >= 0.9 ? RX_MARK_GOOD
                                                            : RX_MARK_BAD,
                      word, sentence);
    rx_log_info(log, "%s %s", word, sentence);
}

rx_status rx_repeat_report(const rx_repeat_field *f, const char *folder, rx_log *log, rx_error *err)
{
    static const char *const of_couples[] = {"first",       "second",       "matched", "zero_point",
                                             "offset_east", "offset_north", "bright",  "pa1",
                                             "pf1",         "pull",         "found"};
    static const char *const of_bins[] = {"population", "snr_low", "snr_high",   "scatter",
                                          "claimed",    "pull",    "pull_median"};
    rx_repeat_numbers numbers[RX_REPEAT_POPULATIONS][BINS];
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++)
        RX_TRY(measure_bins(f, !k, numbers[k], err));
    rx_report *report = rx_report_new("Repeatability: ", "visits of one field");
    if (report == NULL)
        return rx_error_memory(err, 0);
    add_facts(report, f, log);
    rx_report_table *t = RX_REPORT_TABLE(report, "repeat", REPEAT, RX_REPORT_EVERYWHERE);
    put_couple(t, f, &f->all);
    for (int i = 0; i < f->ncouples; i++)
        put_couple(t, f, &f->couple[i]);
    rx_report_table *by_snr = add_by_snr(report, numbers);
    draw_by_snr(rx_report_figures_of(report), numbers);
    add_by_mag(f, report);
    rx_report_table *limits = RX_REPORT_TABLE(report, "limits", LIMITS, RX_REPORT_EVERYWHERE);
    for (int k = 0; k < RX_REPEAT_POPULATIONS; k++)
        if (f->trials[k].n > 0)
            rx_report_put(limits, populations[k], f->trials[k].n, f->mag90[k], f->mag50[k]);
    rx_report_table *visits = RX_REPORT_TABLE(report, "visits", VISITS, RX_REPORT_EVERYWHERE);
    for (int i = 0; i < f->nvisits; i++) {
        const rx_visit_frame *frame = &f->visit[i].frame[0];
        rx_report_put(visits, f->visit[i].name, f->visit[i].n,
                      frame->weight != NULL ? "weight map"
                      : frame->wcs != NULL  ? "size and world coordinates of its image"
                                            : "hull of its sources");
    }
    rx_report_section(report, "figures", "Figures");
    rx_report_place(report, "repeat-");
    rx_report_section(report, "repeat", "All pairs of visits");
    rx_report_show(report, t, RX_VIEW(.to = 1, .turned = 1, .without_empty = 1));
    rx_report_note(
        report,
        "PA1, PF1 and AM1 after the LSST Science Requirements Document (LPM-17): PA1 = 1.4826 MAD(d) / "
        "&radic;2, d the difference of two magnitudes of a point source, zero points taken off; PF1 "
        "the share of |d| / &radic;2 above REPEAT_OUTLIER (PA2); AM1 the change of separations of 4 to 6 "
        "arcmin. FLAGS are 0 in both visits. Of more than two visits all pairs count, and 95 % "
        "intervals are wider by &radic;(visits / 2).");
    rx_report_section(report, "visits", "Visit by visit");
    rx_report_show(report, visits, RX_VIEW(0));
    rx_report_show(report, t,
                   RX_VIEW(.from = 1, .most = 200, .without_empty = 1,
                           .ncolumns = sizeof of_couples / sizeof *of_couples, .columns = of_couples));
    rx_report_section(report, "errors", "By S/N");
    rx_report_show(
        report, by_snr,
        RX_VIEW(.without_empty = 1, .ncolumns = sizeof of_bins / sizeof *of_bins, .columns = of_bins));
    rx_report_note(
        report,
        "Of one measurement, in ranges with ten pairs or more. A pull is the difference of both fluxes over "
        "its claimed error: 1 wide where errors are true. Errors that both visits share (of a PSF that is "
        "too "
        "wide in both, of sky under a galaxy) do not show in repeats, so that errors that hold them "
        "have pulls below 1. Positions: by_snr.ecsv.");
    rx_report_section(report, "completeness", "Completeness from repeats");
    rx_report_show(report, limits, RX_VIEW(0));
    rx_report_note(
        report, "Sources of a visit that lie in another one's image, not at its edge and at a pixel with "
                "weight (WEIGHT_IMAGE), have a magnitude and are neither saturated nor cut (FLAGS below 4). "
                "A false source is never found again, so that these are lower bounds of completeness.");
    const rx_status status = rx_report_write(
        report,
        &(rx_report_files){
            .folder = folder, .shown = f->config->output_name, .figures = f->config->qa_figures, .log = log},
        NULL, err);
    rx_report_free(report);
    return status;
}
