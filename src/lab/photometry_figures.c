/* Figures of the photometry report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/photometry_numbers.h"
#include "report/figure.h"

/* FIGURE_FIELDS: the first ones; the page of a long list of conditions stays readable. */
enum { CURVES = 6, POINTS_MAX = 250, FEW = 5, FIELDS_WITH_CURVES = 2, FIGURE_FIELDS = 12 };

/* One figure over the magnitudes of a field. */
typedef struct plan {
    const char *id, *title, *reading;
    rx_cell_quantity quantity;
    int precision; /* >= 0: completeness at this one, instead of the quantity */
} plan;

typedef struct curves {
    rx_curve curve[RX_METHODS_MAX + 1];
    double *data; /* x, y, low, high per run */
    double zero[2], ends[2];
} curves;

/* Bias with its scatter as a band, everything else with its interval. */
static void fill(curves *c, const rx_photometry_numbers *m, int f, int run, const plan *p)
{
    size_t n = (size_t)m->lab->nscenes;
    double *x = c->data + 4 * n * (size_t)run, *y = x + n, *low = y + n, *high = low + n;
    double step = n > 1 ? m->lab->scene[1].mag - m->lab->scene[0].mag : 1;
    int band = p->precision < 0 && p->quantity == RX_CELL_BIAS_MAG;
    for (int k = 0; k < m->lab->nscenes; k++) {
        const rx_photometry_cell *cell = rx_photometry_cell_of(m, f, k, run);
        rx_estimate e = p->precision >= 0 ? cell->complete[p->precision] : *rx_cell_get(cell, p->quantity);
        if (e.n < FEW)
            e = (rx_estimate){NAN, NAN, NAN, 0};
        x[k] = m->lab->scene[k].mag + (band ? 0 : 0.06 * step * (run - 0.5 * (m->lab->nruns - 1)));
        y[k] = e.value;
        low[k] = band ? e.value - cell->scatter_mag.value : e.low;
        high[k] = band ? e.value + cell->scatter_mag.value : e.high;
    }
    c->curve[run] = (rx_curve){.name = m->lab->run[run].name,
                               .kind = band ? RX_CURVE_BAND : RX_CURVE_BARS,
                               .color = rx_method_color(m->lab->run[run].name),
                               .dashed = strchr(m->lab->run[run].name, ' ') != NULL,
                               .n = m->lab->nscenes};
    c->curve[run].x = x;
    c->curve[run].y = y;
    c->curve[run].low = low;
    c->curve[run].high = high;
}

/* Ranges from the values; shares stand between 0 and 1. */
static void range(const curves *c, int nruns, const plan *p, rx_axes *axes)
{
    int positive = p->precision < 0 && p->quantity == RX_CELL_MAGERR;
    if (!positive && (p->precision >= 0 || p->quantity != RX_CELL_BIAS_MAG)) {
        axes->y0 = 0;
        axes->y1 = 1.02;
        return;
    }
    double low = INFINITY, high = -INFINITY;
    for (int run = 0; run < nruns; run++)
        for (long i = 0; i < c->curve[run].n; i++) {
            const double v[] = {c->curve[run].y[i], c->curve[run].low[i], c->curve[run].high[i]};
            for (int k = 0; k < 3; k++)
                if (isfinite(v[k]) && (!positive || v[k] > 0)) {
                    low = fmin(low, v[k]);
                    high = fmax(high, v[k]);
                }
        }
    axes->log_y = positive;
    axes->y0 = low <= high ? (positive ? 0.7 * low : fmax(low, -2)) : (positive ? 0.1 : -0.1);
    axes->y1 = low <= high ? (positive ? 1.4 * high : fmin(high, 2)) : (positive ? 100 : 0.1);
    if (!(axes->y1 > axes->y0))
        axes->y1 = axes->y0 + 0.1;
}

static void over_magnitudes(rx_figures *dst, const rx_photometry_numbers *m, int f, const plan *p)
{
    int nruns = m->lab->nruns;
    char id[RX_FIGURE_ID];
    curves *c = RX_NEW(curves, 1);
    if (c != NULL)
        c->data = RX_NEW(double, 4 * (size_t)(m->lab->nscenes + 1) * (size_t)nruns);
    if (c == NULL || c->data == NULL) {
        dst->script.failed = true;
        free(c);
        return;
    }
    for (int run = 0; run < nruns; run++)
        fill(c, m, f, run, p);
    double step = m->lab->nscenes > 1 ? m->lab->scene[1].mag - m->lab->scene[0].mag : 1;
    rx_axes axes = {.xlabel = "magnitude", .ylabel = p->title};
    axes.x0 = c->ends[0] = m->lab->scene[0].mag - 0.5 * step;
    axes.x1 = c->ends[1] = m->lab->scene[m->lab->nscenes - 1].mag + 0.5 * step;
    range(c, nruns, p, &axes);
    int n = nruns;
    if (p->precision < 0 && p->quantity == RX_CELL_BIAS_MAG)
        c->curve[n++] = (rx_curve){.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = c->ends, .y = c->zero};
    snprintf(id, sizeof id, "field%d-%s", f, p->id);
    rx_figure_add(dst, id, p->title, p->reading, false);
    rx_plot_curves(dst, &axes, n, c->curve);
    free(c->data);
    free(c);
}

/* Points that a figure needs of a curve of n: first, last and POINTS_MAX between. */
static long thin(const rx_pr *pr, double *x, double *y)
{
    long skip = pr->n / POINTS_MAX + 1, n = 0;
    for (long k = 0; k < pr->n; k++)
        if (k % skip == 0 || k + 1 == pr->n) {
            x[n] = pr->point[k].recall;
            y[n++] = pr->point[k].precision;
        }
    return n;
}

static void curve(rx_figures *dst, const rx_photometry_numbers *m, int f, int set)
{
    const size_t room = POINTS_MAX + 2;
    const rx_photometry_set own = rx_photometry_set_of(m->lab, f, set), *s = &own;
    int nruns = m->lab->nruns;
    char id[RX_FIGURE_ID], title[96];
    rx_curve line[RX_METHODS_MAX];
    rx_axes axes = {"recall", "precision", 0, 1.02, 0, 1.02, false, false};
    double *data = RX_NEW(double, 2 * room * (size_t)nruns);
    if (data == NULL) {
        dst->script.failed = true;
        return;
    }
    for (int run = 0; run < nruns; run++) {
        double *x = data + 2 * room * (size_t)run, *y = x + room;
        long n = thin(&rx_photometry_cell_of(m, f, set, run)->pr, x, y);
        line[run] = (rx_curve){.name = m->lab->run[run].name, .kind = RX_CURVE_LINE, .n = n, .x = x, .y = y};
        line[run].color = rx_method_color(m->lab->run[run].name);
        line[run].dashed = strchr(m->lab->run[run].name, ' ') != NULL;
    }
    snprintf(id, sizeof id, "curve%d-%d", f, set);
    snprintf(title, sizeof title, "Magnitude %g (S/N %.3g)", s->mag, s->snr);
    rx_figure_add(dst, id, title, "", false);
    rx_plot_curves(dst, &axes, nruns, line);
    free(data);
}

/* As the paper's figure six magnitudes, around those where stars begin to be lost. */
static void six_curves(rx_figures *dst, const rx_photometry_numbers *m, int f)
{
    const double nearly_all = 0.95;
    int nsets = m->lab->nscenes, lost = nsets;
    for (int k = nsets - 1; k >= 0; k--)
        for (int run = 0; run < m->lab->nruns; run++)
            if (rx_photometry_cell_of(m, f, k, run)->recall.value < nearly_all)
                lost = k;
    int first = lost - 2 < nsets - CURVES ? lost - 2 : nsets - CURVES;
    first = first > 0 ? first : 0;
    for (int k = first; k < nsets && k < first + CURVES; k++)
        curve(dst, m, f, k);
}

void rx_photometry_figures(rx_figures *dst, const rx_photometry_numbers *m)
{
    static const plan plans[] = {
        {"magerr", "MagErr (%)",
         "Mean of 100 |F - F0| / F0 over the stars found, as the top of the paper's Figure 9, with bootstrap "
         "intervals. It mixes bias and scatter.",
         RX_CELL_MAGERR, -1},
        {"bias", "m - m0 (mag)",
         "Median of m - m0 and, as a band, one sigma_MAD either side. Off zero is a bias; faint stars are "
         "found "
         "when noise lifts them, which makes them too bright.",
         RX_CELL_BIAS_MAG, -1},
        {"recall", "Recall, whole lists", "At the detection settings of the campaign, the same for all.",
         RX_CELL_RECALL, -1},
        {"precision", "Precision, whole lists", "False detections of the tiles count at every magnitude.",
         RX_CELL_PRECISION, -1},
        {"ap", "Average precision", "Area under the steps of the precision-recall curve of each magnitude.",
         RX_CELL_AP, -1},
    };
    for (int f = 0; f < m->lab->nconditions && f < FIGURE_FIELDS; f++) {
        if (m->lab->nscenes == 0)
            continue;
        for (size_t i = 0; i < sizeof plans / sizeof *plans; i++)
            over_magnitudes(dst, m, f, &plans[i]);
        for (int p = 0; p < m->nprecisions; p++) {
            char id[24], title[64];
            snprintf(id, sizeof id, "complete%d", p);
            snprintf(title, sizeof title, "Completeness at precision %g", m->precision[p]);
            over_magnitudes(dst, m, f,
                            &(plan){id, title,
                                    "Each restorer at its own threshold, chosen so that precision over "
                                    "the whole field is equal.",
                                    RX_CELL_RECALL, p});
        }
        if (m->lab->nconditions <= FIELDS_WITH_CURVES)
            six_curves(dst, m, f);
    }
}
