/* The figures of the QA report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"
#include "report/qa_writers.h"

enum { FEW = 5, MAX_DOTS = 1500, MAX_STEPS = 2000, PULL_BINS = 48, PICTURE_SIDE = 300 };
static const double PULL_REACH = 6;

/* One figure: its words and the function that writes its plot commands. */
typedef struct plan {
    const char *id, *title, *reading;
    void (*write)(rx_figures *figures, const rx_report *report);
} plan;

static double middle(const rx_report *r, int bin)
{
    return 0.5 * (r->bins.edge[bin] + r->bins.edge[bin + 1]);
}

/* Position of a run's point beside those of the others in its bin. */
static double beside(const rx_report *r, int run, int bin)
{
    double step = r->bins.edge[bin + 1] - r->bins.edge[bin];
    int n = r->input->nruns;
    return middle(r, bin) + step * 0.5 * ((run + 0.5) / n - 0.5);
}

static void begin(rx_figures *dst, const char *xlabel, const char *ylabel, double x0, double x1, double y0,
                  double y1)
{
    rx_plot_begin(dst, &(rx_axes){xlabel, ylabel, x0, x1, y0, y1, false, false});
}

static void magnitude_axis(rx_figures *dst, const rx_report *r, const char *xlabel, const char *ylabel,
                           double y0, double y1)
{
    begin(dst, xlabel, ylabel, r->bins.edge[0], r->bins.edge[r->bins.n], y0, y1);
}

/* A plot element that is never seen: keeps the command whole when no run has data. */
static void plot_begin(rx_text *dst)
{
    rx_text_add(dst, "plot NaN notitle");
}

static void title_of(rx_text *dst, const rx_report *r, int run)
{
    rx_plot_title(dst, r->input->runs[run].name);
}

/* x, value and ends of a row, cut where the plot ends anyway; no bar for an interval that is not bounded. */
static void estimate_row(rx_text *dst, double x, const rx_estimate *e, double low, double high)
{
    rx_plot_value(dst, x);
    rx_plot_interval(dst, e->value, e->low, e->high, low, high);
    rx_text_add(dst, "\n");
}

/* $<name><run>: x, value, low, high of one metric per bin of FEW sources or more. */
static void bin_blocks(rx_text *dst, const rx_report *r, const char *name, rx_metric metric, double low,
                       double high)
{
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_printf(dst, "$%s%d << EOD\n", name, run);
        for (int b = 0; b < r->bins.n; b++) {
            const rx_estimate *e = rx_report_bin(r, run, b, metric);
            estimate_row(dst, beside(r, run, b), e->n >= FEW ? e : &(rx_estimate){NAN, NAN, NAN, 0}, low,
                         high);
        }
        rx_text_add(dst, "EOD\n");
    }
}

/* $few<name><run>: the same for shares of fewer sources: shown pale, and not joined by lines. */
static void few_blocks(rx_text *dst, const rx_report *r, const char *name, rx_metric metric)
{
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_printf(dst, "$few%s%d << EOD\n", name, run);
        for (int b = 0; b < r->bins.n; b++) {
            const rx_estimate *e = rx_report_bin(r, run, b, metric);
            if (e->n == 0 || e->n >= FEW)
                continue;
            estimate_row(dst, beside(r, run, b), e, 0, 1);
        }
        rx_text_add(dst, "EOD\n");
    }
}

static void add_bars(rx_text *dst, const rx_report *r, const char *name)
{
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_printf(dst, ", $%s%d using 1:2:3:4 with yerrorlines ls %d", name, run, run % 7 + 1);
        title_of(dst, r, run);
    }
    rx_text_add(dst, "\n");
}

static void bars_with_lines(rx_text *dst, const rx_report *r, const char *name)
{
    plot_begin(dst);
    add_bars(dst, r, name);
}

static void plot_shares(rx_figures *figures, const rx_report *r, const char *name, rx_metric metric,
                        const char *xlabel)
{
    rx_text *dst = &figures->script;
    bin_blocks(dst, r, name, metric, 0, 1);
    few_blocks(dst, r, name, metric);
    magnitude_axis(figures, r, xlabel, name, 0, 1.02);
    plot_begin(dst);
    for (int run = 0; run < r->input->nruns; run++)
        rx_text_printf(dst,
                       ", $few%s%d using 1:2:3:4 with yerrorbars ls %d lw 0.8 ps 0.4 lc rgb color(%d, 180) "
                       "notitle",
                       name, run, run % 7 + 1, run % 7 + 1);
    add_bars(dst, r, name);
}

static void write_recall(rx_figures *figures, const rx_report *r)
{
    plot_shares(figures, r, "recall", RX_METRIC_RECALL, "reference magnitude");
}

static void write_precision(rx_figures *figures, const rx_report *r)
{
    plot_shares(figures, r, "precision", RX_METRIC_PRECISION, "measured magnitude");
}

/* $curve<run>: recall, precision, thinned; $end<run>: the whole catalogue. */
static void curve_blocks(rx_text *dst, const rx_pr *pr, int run)
{
    long skip = pr->n / MAX_STEPS + 1;
    rx_text_printf(dst, "$curve%d << EOD\n", run);
    for (long k = 0; k < pr->n; k++)
        if (k % skip == 0 || k + 1 == pr->n)
            rx_text_printf(dst, "%.6g %.6g\n", pr->point[k].recall, pr->point[k].precision);
    rx_text_printf(dst, "EOD\n$end%d << EOD\n", run);
    if (pr->n > 0)
        rx_text_printf(dst, "%.6g %.6g\n", pr->point[pr->n - 1].recall, pr->point[pr->n - 1].precision);
    rx_text_add(dst, "EOD\n");
}

static void write_curve(rx_figures *figures, const rx_report *r)
{
    rx_text *dst = &figures->script;
    for (int run = 0; run < r->input->nruns; run++)
        curve_blocks(dst, &r->evaluation[run].pr, run);
    begin(figures, "recall", "precision", 0, 1.02, 0, 1.02);
    plot_begin(dst);
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_printf(dst, ", $curve%d using 1:2 with lines ls %d", run, run % 7 + 1);
        title_of(dst, r, run);
        rx_text_printf(dst, ", $end%d using 1:2 with points ls %d ps 0.9 notitle", run, run % 7 + 1);
    }
    rx_text_add(dst, "\n");
}

/* Pairs of two columns over matches, at most MAX_DOTS of them, evenly taken. */
static void dot_block(rx_text *dst, const rx_report *r, const char *name, int run, const double *x,
                      const double *y, int x_of_truth)
{
    const rx_evaluation *e = &r->evaluation[run];
    long skip = e->matched / MAX_DOTS + 1, k = 0;
    rx_text_printf(dst, "$%s%d << EOD\n", name, run);
    for (long j = 0; j < e->run->list.n; j++) {
        if (e->run_role[j] != RX_ROLE_MATCHED || k++ % skip != 0)
            continue;
        rx_plot_value(dst, x[x_of_truth ? e->origin[j] : j]);
        rx_plot_value(dst, y[j]);
        rx_text_add(dst, "\n");
    }
    rx_text_add(dst, "EOD\n");
}

/* Half the height of the magnitude error plot: all medians and most scatters fit. */
static double error_reach(const rx_report *r)
{
    double reach = 0.1;
    for (int run = 0; run < r->input->nruns; run++)
        for (int b = 0; b < r->bins.n; b++) {
            const rx_estimate *bias = rx_report_bin(r, run, b, RX_METRIC_BIAS_MAG);
            const rx_estimate *scatter = rx_report_bin(r, run, b, RX_METRIC_SCATTER_MAG);
            if (bias->n >= FEW)
                reach = fmax(reach, 1.2 * (fabs(bias->value) + scatter->value));
        }
    return fmin(reach, 2);
}

static void write_error(rx_figures *figures, const rx_report *r)
{
    rx_text *dst = &figures->script;
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_evaluation *e = &r->evaluation[run];
        dot_block(dst, r, "edots", run, e->truth_mag, e->dmag, 1);
        rx_text_printf(dst, "$error%d << EOD\n", run);
        for (int b = 0; b < r->bins.n; b++) {
            const rx_estimate *bias = rx_report_bin(r, run, b, RX_METRIC_BIAS_MAG);
            const rx_estimate *scatter = rx_report_bin(r, run, b, RX_METRIC_SCATTER_MAG);
            if (bias->n < FEW)
                continue;
            rx_plot_value(dst, beside(r, run, b));
            rx_plot_value(dst, bias->value);
            rx_plot_value(dst, bias->value - scatter->value);
            rx_plot_value(dst, bias->value + scatter->value);
            rx_text_add(dst, "\n");
        }
        rx_text_add(dst, "EOD\n");
    }
    double reach = error_reach(r);
    magnitude_axis(figures, r, "reference magnitude", "m - m0  [mag]", -reach, reach);
    plot_begin(dst);
    for (int run = 0; run < r->input->nruns; run++)
        rx_text_printf(dst,
                       ", $edots%d using 1:2 with points ls %d lc rgb color(%d, 190) pt 7 ps 0.25 notitle",
                       run, run % 7 + 1, run % 7 + 1);
    for (int run = 0; run < r->input->nruns; run++)
        rx_text_printf(dst, ", $error%d using 1:3:4 with filledcurves lc rgb color(%d, 200) notitle", run,
                       run % 7 + 1);
    rx_text_add(dst, ", 0 with lines lc rgb '#808080' dt 3 notitle");
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_printf(dst, ", $error%d using 1:2 with linespoints ls %d", run, run % 7 + 1);
        title_of(dst, r, run);
    }
    rx_text_add(dst, "\n");
}

static void write_magerr(rx_figures *figures, const rx_report *r)
{
    rx_text *dst = &figures->script;
    double low = INFINITY, high = 0;
    for (int run = 0; run < r->input->nruns; run++)
        for (int b = 0; b < r->bins.n; b++) {
            const rx_estimate *e = rx_report_bin(r, run, b, RX_METRIC_MAGERR);
            if (e->n >= FEW && e->value > 0) {
                low = fmin(low, e->value);
                high = fmax(high, e->value);
            }
        }
    low = fmax(0.5 * fmin(low, 10), 0.01);
    high = fmax(3 * high, 10 * low);
    bin_blocks(dst, r, "magerr", RX_METRIC_MAGERR, low, high);
    rx_text_add(dst, "set logscale y\n");
    magnitude_axis(figures, r, "reference magnitude", "MagErr  [%]", low, high);
    bars_with_lines(dst, r, "magerr");
    rx_text_add(dst, "unset logscale y\n");
}

static void write_offsets(rx_figures *figures, const rx_report *r)
{
    rx_text *dst = &figures->script;
    double reach = 1.05 * r->par->match_radius;
    for (int run = 0; run < r->input->nruns; run++)
        dot_block(dst, r, "offset", run, r->evaluation[run].dx, r->evaluation[run].dy, 0);
    begin(figures, "x - x0  [pixels]", "y - y0  [pixels]", -reach, reach, -reach, reach);
    rx_text_printf(dst,
                   "set size ratio -1\nset parametric\nset trange [0:2*pi]\nplot %.6g*cos(t), %.6g*sin(t) "
                   "with lines lc rgb '#808080' dt 2 title 'match radius'",
                   r->par->match_radius, r->par->match_radius);
    for (int run = 0; run < r->input->nruns; run++)
        rx_text_printf(dst, ", $offset%d using 1:2 with points ls %d lc rgb color(%d, 120) ps 0.3 notitle",
                       run, run % 7 + 1, run % 7 + 1);
    for (int run = 0; run < r->input->nruns; run++) {
        /* medians over a white copy of themselves, to stand out from the dots */
        const rx_estimate *e = rx_report_whole(r, run, RX_METRIC_RECALL);
        double x = isfinite(e[RX_METRIC_DX].value) ? e[RX_METRIC_DX].value : 10 * reach;
        double y = isfinite(e[RX_METRIC_DY].value) ? e[RX_METRIC_DY].value : 10 * reach;
        rx_text_printf(
            dst,
            ", '+' every ::0::0 using (%.6g):(%.6g) with points ls %d lc rgb '#ffffff' ps 2 notitle, '+' "
            "every ::0::0 using (%.6g):(%.6g) with points ls %d ps 1.3",
            x, y, run % 7 + 1, x, y, run % 7 + 1);
        title_of(dst, r, run);
    }
    rx_text_add(dst, "\nunset parametric\nset size noratio\n");
}

static void write_pulls(rx_figures *figures, const rx_report *r)
{
    rx_text *dst = &figures->script;
    double width = 2 * PULL_REACH / PULL_BINS, highest = 0.45;
    for (int run = 0; run < r->input->nruns; run++) {
        const rx_evaluation *e = &r->evaluation[run];
        long bin[PULL_BINS] = {0}, n = 0;
        for (long j = 0; j < e->run->list.n; j++) {
            if (!isfinite(e->pull[j]))
                continue;
            n++;
            double k = floor((e->pull[j] + PULL_REACH) / width);
            if (k >= 0 && k < PULL_BINS)
                bin[(int)k]++;
        }
        rx_text_printf(dst, "$pull%d << EOD\n", run);
        for (int k = 0; k < PULL_BINS && n > 0; k++) {
            double density = (double)bin[k] / ((double)n * width);
            highest = fmax(highest, 1.05 * density);
            rx_text_printf(dst, "%.6g %.6g\n", -PULL_REACH + (k + 0.5) * width, density);
        }
        rx_text_add(dst, "EOD\n");
    }
    begin(figures, "pull = (F - F0) / error", "density", -PULL_REACH, PULL_REACH, 0, highest);
    rx_text_add(dst, "plot exp(-x*x/2)/sqrt(2*pi) with lines lc rgb '#808080' dt 2 title 'unit normal'");
    for (int run = 0; run < r->input->nruns; run++) {
        rx_text_printf(dst, ", $pull%d using 1:2 with histeps ls %d", run, run % 7 + 1);
        title_of(dst, r, run);
    }
    rx_text_add(dst, "\n");
}

static const plan plans[] = {
    {"plot-recall", "Recall (completeness)",
     "Share of the references of each magnitude that were found; bars are 95 % intervals, pale points bins "
     "of "
     "fewer than 5. Where the falling curve nearest to the references crosses one half is mag50.",
     write_recall},
    {"plot-precision", "Precision (purity)",
     "Share of the detections of each measured magnitude that are references; bars and pale points as "
     "before. Where the reference list ends, real faint sources count as false: what is seen there is a "
     "lower bound.",
     write_precision},
    {"plot-curve", "Precision against recall",
     "Each curve begins with the surest detections and admits the others by falling score; the dot is the "
     "whole catalogue. Further up and to the right is better. Average precision is the area under the "
     "steps.",
     write_curve},
    {"plot-error", "Magnitude error",
     "Dots are matched sources, lines the median of m - m0 per bin of 5 or more, bands one robust sigma "
     "(sigma_MAD) either side. A line away from zero is a bias; faint sources found only when noise lifts "
     "them pull the line down (Eddington bias).",
     write_error},
    {"plot-magerr", "MagErr",
     "Mean of 100 |F - F0| / F0 over matched sources, bins of 5 or more, bars (20 or more) are 95 % "
     "bootstrap intervals. It mixes bias and scatter: read it with the figure before. One bad blend can "
     "dominate a bin.",
     write_magerr},
    {"plot-offsets", "Position offsets",
     "Detection minus reference for matched sources, large symbols are medians. A cloud off the centre is "
     "an astrometric shift; a cloud that fills the circle means chance matches or a radius too small.",
     write_offsets},
    {"plot-pulls", "Pulls",
     "Flux error over its stated error. True errors follow the dashed curve; a wider histogram means that "
     "errors are too small, a shifted one that fluxes are biased.",
     write_pulls},
};
enum { PLANS = sizeof plans / sizeof *plans };

/* White of the stretch: 99.8 % of the first picture's pixels are darker, 20 sigma at least. */
static double white_level(const rx_qa_picture *picture)
{
    size_t n = 0, all = (size_t)picture->width * (size_t)picture->height;
    double *copy = RX_NEW(double, all), white = 20 * picture->sigma;
    for (size_t i = 0; i < all && copy != NULL; i++)
        if (isfinite(picture->pixels[i]))
            copy[n++] = picture->pixels[i];
    if (n > 0)
        white = fmax(white, rx_quantile(copy, n, 0.998));
    free(copy);
    return white;
}

/* grey = asinh(p / (2 sigma)), black at -2 sigma of the first picture. */
static void write_pictures(rx_figures *dst, const rx_report *r)
{
    const rx_qa_picture *first = r->input->pictures;
    double white = r->input->npictures > 0 ? white_level(first) : 0;
    char id[24];
    for (int k = 0; k < r->input->npictures && dst->n < RX_FIGURES_MAX; k++) {
        const rx_qa_picture *p = &r->input->pictures[k];
        if (p->width <= 0 || p->height <= 0)
            continue;
        double soft = first->sigma > 0 ? 2 * first->sigma : 1;
        snprintf(id, sizeof id, "picture%d", k);
        rx_figure_add(dst, id, p->title, "", RX_FIGURE_PICTURE);
        rx_plot_picture(dst, p->width, p->height, p->pixels, -soft, fmax(white, soft), soft, PICTURE_SIDE);
    }
}

rx_status rx_report_figures(const rx_report *r, const char *folder, const char *shown, rx_figures *dst,
                            rx_error *err)
{
    rx_figures_begin(dst);
    for (int i = 0; i < PLANS; i++) {
        rx_figure_add(dst, plans[i].id, plans[i].title, plans[i].reading, RX_FIGURE_CHART);
        plans[i].write(dst, r);
    }
    rx_report_psf_figures(dst, r);
    write_pictures(dst, r);
    return rx_figures_start(dst, r->par->gnuplot, folder, shown, err);
}
