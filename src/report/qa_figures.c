/* The figures of the QA report. */
#include "report/qa_page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

enum { FEW = 5, PULL_BINS = 48, CIRCLE = 96, PICTURE_SIDE = 300, SHAPES = 3 };
static const double PULL_REACH = 6;

/* One figure of the numbers; -1 for a run: a line to compare with. */
typedef struct drawing {
    const rx_qa_numbers *q;
    rx_curves curves;
} drawing;

static const char *name_of(const drawing *d, int run)
{
    return d->q->input->runs[run].name;
}

static void begin(drawing *d, rx_curve_kind kind, int run, const char *name)
{
    rx_curves_add(&d->curves, kind, run < 0 ? -1 : rx_method_color(name_of(d, run)), name);
}

static void put(drawing *d, double x, double y, double low, double high)
{
    rx_curves_put(&d->curves, x, y, low, high);
}

/* Position of a run's point beside those of the others in its bin. */
static double beside(const rx_qa_numbers *q, int run, int bin)
{
    const double step = q->bins.edge[bin + 1] - q->bins.edge[bin];
    return 0.5 * (q->bins.edge[bin] + q->bins.edge[bin + 1]) +
           step * 0.5 * ((run + 0.5) / q->input->nruns - 0.5);
}

/* One metric of all runs by magnitude: bars of FEW sources or more; of fewer single points, where `few`. */
static void put_bins(drawing *d, rx_metric metric, bool few)
{
    for (int run = 0; run < d->q->input->nruns; run++) {
        begin(d, RX_CURVE_BARS, run, name_of(d, run));
        for (int b = 0; b < d->q->bins.n; b++) {
            const rx_estimate *e = &rx_qa_binned(d->q, run, b)[metric];
            put(d, beside(d->q, run, b), e->n >= FEW ? e->value : NAN, e->low, e->high);
        }
        begin(d, RX_CURVE_POINTS, run, NULL);
        for (int b = 0; b < d->q->bins.n && few; b++) {
            const rx_estimate *e = &rx_qa_binned(d->q, run, b)[metric];
            if (e->n > 0 && e->n < FEW)
                put(d, beside(d->q, run, b), e->value, NAN, NAN);
        }
    }
}

static void draw_recall(drawing *d, rx_axes *axes)
{
    put_bins(d, RX_METRIC_RECALL, true);
    axes->ylabel = "recall";
}

static void draw_precision(drawing *d, rx_axes *axes)
{
    put_bins(d, RX_METRIC_PRECISION, true);
    axes->xlabel = "measured magnitude";
    axes->ylabel = "precision";
}

static void draw_curve(drawing *d, rx_axes *axes)
{
    for (int run = 0; run < d->q->input->nruns; run++) {
        const rx_pr *pr = &d->q->evaluation[run].pr;
        begin(d, RX_CURVE_LINE, run, name_of(d, run));
        for (long k = 0; k < pr->n; k++)
            put(d, pr->point[k].recall, pr->point[k].precision, NAN, NAN);
        begin(d, RX_CURVE_POINTS, run, NULL);
        if (pr->n > 0)
            put(d, pr->point[pr->n - 1].recall, pr->point[pr->n - 1].precision, NAN, NAN);
    }
    *axes = (rx_axes){"recall", "precision", 0, 1.02, 0, 1.02, false, false};
}

/* A dot for each match: one number of it against another, that of its reference where `of_truth`. */
static void put_dots(drawing *d, int run, const double *x, bool of_truth, const double *y)
{
    const rx_evaluation *e = &d->q->evaluation[run];
    begin(d, RX_CURVE_DOTS, run, NULL);
    for (long j = 0; j < e->run->list.n; j++)
        if (e->run_role[j] == RX_ROLE_MATCHED)
            put(d, x[of_truth ? e->origin[j] : j], y[j], NAN, NAN);
}

static void draw_error(drawing *d, rx_axes *axes)
{
    double reach = 0, farthest = 0; /* all medians and most scatters fit, without any all dots */
    for (int run = 0; run < d->q->input->nruns; run++)
        put_dots(d, run, d->q->evaluation[run].truth_mag, true, d->q->evaluation[run].dmag);
    rx_curves_reference(&d->curves, axes->x0, 0, axes->x1, 0);
    for (int run = 0; run < d->q->input->nruns; run++) {
        begin(d, RX_CURVE_BAND, run, name_of(d, run));
        for (int b = 0; b < d->q->bins.n; b++) {
            const rx_estimate *e = rx_qa_binned(d->q, run, b);
            const double bias = e[RX_METRIC_BIAS_MAG].value, scatter = e[RX_METRIC_SCATTER_MAG].value;
            if (e[RX_METRIC_BIAS_MAG].n < FEW)
                continue;
            put(d, beside(d->q, run, b), bias, bias - scatter, bias + scatter);
            reach = fmax(reach, 1.2 * (fabs(bias) + scatter));
        }
    }
    axes->ylabel = "m - m0  [mag]";
    for (int k = 0; k < d->q->input->nruns && !d->curves.failed; k++)
        for (long i = 0; i < d->curves.curve[k].n; i++)
            farthest = fmax(farthest, fabs(d->curves.curve[k].point[i][1]));
    axes->y1 = fmin(fmax(reach > 0 ? reach : 1.2 * farthest, 0.1), 2);
    axes->y0 = -axes->y1;
}

static void draw_magerr(drawing *d, rx_axes *axes)
{
    double low = 10, high = 0;
    put_bins(d, RX_METRIC_MAGERR, false);
    for (int k = 0; k < d->curves.n; k++)
        for (long i = 0; i < d->curves.curve[k].n; i++) {
            const double value = d->curves.curve[k].point[i][1];
            low = value > 0 ? fmin(low, value) : low;
            high = fmax(high, value);
        }
    axes->ylabel = "MagErr  [%]";
    axes->y0 = fmax(0.5 * low, 0.01);
    axes->y1 = fmax(3 * high, 10 * axes->y0);
    axes->log_y = true;
}

static void draw_offsets(drawing *d, rx_axes *axes)
{
    const double radius = d->q->par->match_radius, reach = 1.05 * radius;
    begin(d, RX_CURVE_LINE, -1, "match radius");
    for (int i = 0; i <= CIRCLE; i++)
        put(d, radius * cos(2 * M_PI * i / CIRCLE), radius * sin(2 * M_PI * i / CIRCLE), NAN, NAN);
    for (int run = 0; run < d->q->input->nruns; run++)
        put_dots(d, run, d->q->evaluation[run].dx, false, d->q->evaluation[run].dy);
    for (int run = 0; run < d->q->input->nruns; run++) {
        begin(d, RX_CURVE_POINTS, run, name_of(d, run));
        put(d, d->q->whole[run][RX_METRIC_DX].value, d->q->whole[run][RX_METRIC_DY].value, NAN, NAN);
    }
    *axes = (rx_axes){"x - x0  [pixels]", "y - y0  [pixels]", -reach, reach, -reach, reach, false, false};
}

static void draw_pulls(drawing *d, rx_axes *axes)
{
    const double width = 2 * PULL_REACH / PULL_BINS;
    double highest = 0.45;
    begin(d, RX_CURVE_LINE, -1, "unit normal");
    for (int i = -2 * PULL_BINS; i <= 2 * PULL_BINS; i++) {
        const double x = PULL_REACH * i / (2 * PULL_BINS);
        put(d, x, exp(-0.5 * x * x) / sqrt(2 * M_PI), NAN, NAN);
    }
    for (int run = 0; run < d->q->input->nruns; run++) {
        const rx_evaluation *e = &d->q->evaluation[run];
        long bin[PULL_BINS] = {0}, n = 0;
        for (long j = 0; j < e->run->list.n; j++) {
            const double k = floor((e->pull[j] + PULL_REACH) / width);
            n += isfinite(e->pull[j]);
            if (k >= 0 && k < PULL_BINS)
                bin[(int)k]++;
        }
        begin(d, RX_CURVE_STEPS, run, name_of(d, run));
        for (int k = -1; k < PULL_BINS && n > 0; k++) { /* a step ends at its point */
            const double density = k < 0 ? 0 : (double)bin[k] / ((double)n * width);
            highest = fmax(highest, 1.05 * density);
            put(d, -PULL_REACH + (k + 1) * width, density, NAN, NAN);
        }
    }
    *axes =
        (rx_axes){"pull = (F - F0) / error", "density", -PULL_REACH, PULL_REACH, 0, highest, false, false};
}

/* One figure: its words and what draws it into axes of reference magnitude and a share, which it may change. */
static const struct {
    const char *id, *title, *reading;
    void (*draw)(drawing *d, rx_axes *axes);
    bool equal; /* both axes have one scale */
} FIGURES[] = {
    {"plot-recall", "Recall (completeness)",
     "Share of the references of each magnitude that were found; bars are 95 % intervals, single points bins "
     "of fewer than 5. Where the falling curve nearest to the references crosses one half is mag50.",
     draw_recall, false},
    {"plot-precision", "Precision (purity)",
     "Share of the detections of each measured magnitude that are references. Where the reference list ends, "
     "real faint sources count as false: what is seen there is a lower bound.",
     draw_precision, false},
    {"plot-curve", "Precision against recall",
     "Each curve begins with the surest detections and admits the others by falling score; the point is the "
     "whole catalogue. Further up and to the right is better.",
     draw_curve, false},
    {"plot-error", "Magnitude error",
     "Dots are matched sources, lines the median of m - m0 per bin of 5 or more, bands one robust sigma "
     "(sigma_MAD) either side. A line away from zero is a bias; faint sources found only when noise lifts "
     "them pull the line down (Eddington bias).",
     draw_error, false},
    {"plot-magerr", "MagErr",
     "Mean of 100 |F - F0| / F0 over matched sources, bins of 5 or more, bars (20 or more) are 95 % "
     "bootstrap intervals. It mixes bias and scatter; one bad blend can dominate a bin.",
     draw_magerr, false},
    {"plot-offsets", "Position offsets",
     "Detection minus reference for matched sources, large symbols are medians. A cloud off the centre is an "
     "astrometric shift; a cloud that fills the circle means chance matches or a radius too small.",
     draw_offsets, true},
    {"plot-pulls", "Pulls",
     "Flux error over its stated error. True errors follow the dotted curve; a wider histogram means that "
     "errors are too small, a shifted one that fluxes are biased.",
     draw_pulls, false},
};

/* --- the PSF --- */

/* That most residuals of stars do not exceed: of size, or of both parts of the ellipse. */
static double reach_of(const rx_psf_tested *tested, bool ellipse)
{
    double *values = RX_NEW(double, 2 * (size_t)tested->nstars + 1), reach = 0.01;
    size_t n = 0;
    for (int i = 0; i < tested->nstars && values != NULL; i++) {
        values[n++] = fabs(tested->star[i].off[ellipse ? 1 : 0]);
        if (ellipse)
            values[n++] = fabs(tested->star[i].off[2]);
    }
    if (n > 0)
        reach = fmax(1.3 * rx_quantile(values, n, 0.95), 1e-4);
    free(values);
    return reach;
}

/* Residuals against magnitude, of size or of the ellipse: every star, and means of FEW and more. */
static void magnitude_figure(rx_figures *dst, const rx_qa_numbers *q, bool ellipse)
{
    const rx_psf_tested *tested = q->input->psf.psf->tested;
    const double reach = reach_of(tested, ellipse);
    rx_axes axes = {"magnitude", ellipse ? "de1, de2" : "dT/T", HUGE_VAL, -HUGE_VAL, -reach, reach, false,
                    false};
    static const char *const names[SHAPES] = {"size", "de1", "de2"};
    rx_curves c = {0};
    for (int k = ellipse ? 1 : 0; k < (ellipse ? SHAPES : 1); k++) {
        const int color = k > 1;
        rx_curves_add(&c, RX_CURVE_POINTS, color, names[k]);
        for (int i = 0; i < tested->nstars; i++) {
            const double mag = rx_qa_star_mag(&q->input->psf, &tested->star[i]);
            rx_curves_put(&c, mag, tested->star[i].off[k], NAN, NAN);
            axes.x0 = fmin(axes.x0, mag - 0.3);
            axes.x1 = fmax(axes.x1, mag + 0.3);
        }
        rx_curves_add(&c, RX_CURVE_BARS, color, NULL);
        for (int b = 0; b < q->npsf_bins; b++) {
            const rx_qa_psf_bin *bin = &q->psf_bin[b];
            if (bin->n >= FEW)
                rx_curves_put(&c, bin->mag + 0.02 * color, bin->mean[k], bin->mean[k] - bin->error[k],
                              bin->mean[k] + bin->error[k]);
        }
    }
    rx_curves_reference(&c, axes.x0, 0, axes.x1, 0);
    rx_curves_figure(dst, ellipse ? "psf-mag-ellipse" : "psf-mag-size",
                     ellipse ? "Ellipse, stars - PSF, by magnitude" : "Size, stars - PSF, by magnitude",
                     ellipse ? "The same of e1 and e2."
                             : "Reserved stars, and means of 5 and more with 1 sigma. A slope is a detector "
                               "whose stars grow with brightness, or a sky that is wrong.",
                     &axes, &c);
}

/* Residuals over the tile: the colour is that of the size, the whisker that of the ellipse: as long as
 * |de| = hypot(de1, de2), along its major axis. */
static void map_figure(rx_figures *dst, const rx_qa_numbers *q)
{
    const rx_psf_tested *tested = q->input->psf.psf->tested;
    const double size = reach_of(tested, false), ellipse = reach_of(tested, true);
    const double side = fmax(q->input->width, q->input->height), length = 0.1 * side / ellipse;
    char reading[320];
    snprintf(reading, sizeof reading,
             "Colour: blue stars are smaller than the PSF, red ones larger. Whiskers: residual ellipses "
             "along their major axis; one of %.2g is as long as 10 %% of the tile's longer side. Colours or "
             "whiskers that flock are a PSF that varies in another way than the model.",
             ellipse);
    double *values = RX_NEW(double, 5 * (size_t)tested->nstars), *v = values;
    dst->script.failed |= values == NULL;
    for (int i = 0; i < tested->nstars && values != NULL; i++) {
        const rx_psf_star *s = &tested->star[i];
        const double half = 0.5 * length * hypot(s->off[1], s->off[2]),
                     angle = 0.5 * atan2(s->off[2], s->off[1]);
        *v++ = s->x + 1.0;
        *v++ = s->y + 1.0;
        *v++ = s->off[0];
        *v++ = half * cos(angle);
        *v++ = half * sin(angle);
    }
    rx_figure_add(dst, "psf-map", "Stars - PSF over the tile", reading, RX_FIGURE_CHART);
    rx_plot_coloured_begin(
        dst, &(rx_axes){"X_IMAGE", "Y_IMAGE", 0, q->input->width, 0, q->input->height, false, false},
        &(rx_coloured){"(-1 '#2166ac', 0 '#cccccc', 1 '#b2182b')", "dT/T", -size, size,
                       values ? tested->nstars : 0, 5, values});
    rx_text_add(&dst->script,
                "$data using ($1-$4):($2-$5):(2*$4):(2*$5) with vectors nohead lc rgb '#404040' lw 1.6 "
                "notitle, $data using 1:2:3 with points pt 7 ps 0.9 palette notitle, $data using 1:2 with "
                "points pt 6 ps 0.9 lw 0.7 lc rgb '#808080' notitle");
    rx_plot_coloured_end(dst);
    free(values);
}

static void growth_figure(rx_figures *dst, const rx_psf_tested *tested)
{
    const double wrong = 0.01, last = tested->growth[tested->nradii - 1].radius;
    double most = 2.0 * wrong;
    rx_curves c = {0};
    for (int side = -1; side <= 1; side += 2)
        rx_curves_reference(&c, 0.0, side * wrong, last, side * wrong);
    rx_curves_add(&c, RX_CURVE_BAND, 0, "stars - PSF");
    for (int i = 0; i < tested->nradii; i++) {
        const rx_psf_growth *g = &tested->growth[i];
        const double off = g->stars - g->psf;
        rx_curves_put(&c, g->radius, off, off - g->error, off + g->error);
        if (g->error < wrong)
            most = fmax(most, 1.5 * fabs(off));
    }
    rx_curves_figure(
        dst, "psf-growth", "Curve of growth, stars - PSF",
        "Light within a radius, shares of a star's, with 1 sigma: out to 20 FWHM, or to where the sky's "
        "error is 10 %. Beyond the dotted lines fluxes of templates are wrong by as much; the largest "
        "difference of the table is from radii with errors below 1 %.",
        &(rx_axes){"radius [pixels]", "share of the light", 0, last, -most, most, false, false}, &c);
}

/* What stars that it was not fitted to say of the PSF. */
static void draw_psf(rx_figures *dst, const rx_qa_numbers *q)
{
    const rx_psf *psf = q->input->psf.psf;
    if (psf == NULL || psf->tested == NULL)
        return;
    if (psf->tested->nstars > 0) {
        magnitude_figure(dst, q, false);
        magnitude_figure(dst, q, true);
        map_figure(dst, q);
    }
    if (psf->tested->nradii > 0)
        growth_figure(dst, psf->tested);
    rx_figure_add(dst, "psf-residual", "Stacked stars - PSF",
                  "grey is 0, black -2 %, white 2 % of the PSF's peak.", RX_FIGURE_PICTURE);
    rx_plot_picture(dst, &(rx_grey_image){psf->tested->side, psf->tested->side, PICTURE_SIDE,
                                          psf->tested->residual, -0.02, 0.02, 0.0});
}

/* --- all --- */

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
static void draw_pictures(rx_figures *dst, const rx_qa_input *input)
{
    const rx_qa_picture *first = input->pictures;
    const double white = input->npictures > 0 ? white_level(first) : 0;
    char id[24];
    for (int k = 0; k < input->npictures && dst->n < RX_FIGURES_MAX; k++) {
        const rx_qa_picture *p = &input->pictures[k];
        if (p->width <= 0 || p->height <= 0)
            continue;
        const double soft = first->sigma > 0 ? 2 * first->sigma : 1;
        snprintf(id, sizeof id, "picture%d", k);
        rx_figure_add(dst, id, p->title, "", RX_FIGURE_PICTURE);
        rx_plot_picture(dst, &(rx_grey_image){p->width, p->height, PICTURE_SIDE, p->pixels, -soft,
                                              fmax(white, soft), soft});
    }
}

void rx_qa_figures(rx_figures *dst, const rx_qa_numbers *q)
{
    for (size_t i = 0; i < sizeof FIGURES / sizeof *FIGURES; i++) {
        drawing d = {.q = q};
        rx_axes axes = {
            "reference magnitude", NULL, q->bins.edge[0], q->bins.edge[q->bins.n], 0, 1.02, false, false};
        d.curves.equal = FIGURES[i].equal;
        FIGURES[i].draw(&d, &axes);
        rx_curves_figure(dst, FIGURES[i].id, FIGURES[i].title, FIGURES[i].reading, &axes, &d.curves);
    }
    draw_psf(dst, q);
    draw_pictures(dst, q->input);
}
