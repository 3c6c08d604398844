/* Figures of a survey: by magnitude, and of the PSFs. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "survey/rollup_report.h"

enum { FEW = 5 };

/* Of a bin what is drawn: 0 recall, 1 precision, 2 bias. */
static rx_estimate drawn(const rx_rollup_cell *cell, int what)
{
    if (what == 2) {
        const double error = cell->pairs > 0 ? 1.2533 * cell->scatter / sqrt((double)cell->pairs) : NAN;
        return (rx_estimate){cell->bias, cell->bias - error, cell->bias + error, cell->pairs};
    }
    return what == 0 ? cell->recall : cell->precision;
}

static void by_magnitude(rx_figures *dst, const rx_rollup *r, int what, const rx_axes *axes)
{
    double *data = RX_NEW(double, 4 * (size_t)RX_TALLY_BINS * (size_t)r->nruns);
    rx_curve *curves = RX_NEW(rx_curve, (size_t)r->nruns);
    for (int i = 0; i < r->nruns && data != NULL && curves != NULL; i++) {
        double *x = data + 4 * (size_t)RX_TALLY_BINS * (size_t)i, *y = x + RX_TALLY_BINS,
               *low = y + RX_TALLY_BINS, *high = low + RX_TALLY_BINS;
        long n = 0;
        for (int b = r->run[i].first; b <= r->run[i].last; b++) {
            const rx_estimate e = drawn(&r->run[i].bin[b], what);
            if (e.n < FEW)
                continue;
            x[n] = 0.5 * (b + RX_TALLY_LOW) + 0.25 + 0.03 * (i - 0.5 * (r->nruns - 1));
            y[n] = e.value;
            low[n] = e.low;
            high[n++] = e.high;
        }
        curves[i] = (rx_curve){.name = r->run[i].name,
                               .kind = RX_CURVE_BARS,
                               .color = rx_method_color(r->run[i].name),
                               .n = n,
                               .x = x,
                               .y = y,
                               .low = low,
                               .high = high};
    }
    if (data == NULL || curves == NULL)
        dst->script.failed = true;
    else
        rx_plot_curves(dst, axes, r->nruns, curves);
    free(curves);
    free(data);
}

/* Correlation of the PSFs' residuals by angle. */
static void rho_figure(rx_figures *dst, const rx_rollup *r)
{
    double x[RX_RHO_BINS], y[2][RX_RHO_BINS], low[2][RX_RHO_BINS], high[2][RX_RHO_BINS];
    double most = 1e-6, first = HUGE_VAL, last = 0.0;
    int n = 0;
    for (int k = 0; k < RX_RHO_BINS; k++) {
        const rx_rho_bin *b = &r->rho[k];
        if (!(b->pairs > 0.0) || !isfinite(b->e_error) || !isfinite(b->t_error))
            continue;
        const double value[2] = {b->e, b->t}, error[2] = {b->e_error, b->t_error};
        first = fmin(first, rx_rho_edge(k));
        last = fmax(last, rx_rho_edge(k + 1));
        x[n] = sqrt(rx_rho_edge(k) * rx_rho_edge(k + 1));
        for (int q = 0; q < 2; q++) {
            y[q][n] = value[q];
            low[q][n] = value[q] - error[q];
            high[q][n] = value[q] + error[q];
            most = fmax(most, 1.1 * fmax(fabs(low[q][n]), fabs(high[q][n])));
        }
        n++;
    }
    if (n == 0)
        return;
    const double zero[2] = {0.0, 0.0}, ends[2] = {first, last};
    const rx_curve curves[] = {{.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = ends, .y = zero},
                               {.name = "rho1 of e",
                                .kind = RX_CURVE_BARS,
                                .color = 0,
                                .n = n,
                                .x = x,
                                .y = y[0],
                                .low = low[0],
                                .high = high[0]},
                               {.name = "of T",
                                .kind = RX_CURVE_BARS,
                                .color = 1,
                                .n = n,
                                .x = x,
                                .y = y[1],
                                .low = low[1],
                                .high = high[1]}};
    const rx_axes axes = {.xlabel = "angle between stars [arcmin]",
                          .ylabel = "mean product of residuals",
                          .x0 = first,
                          .x1 = last,
                          .y0 = -most,
                          .y1 = most,
                          .log_x = true};
    rx_figure_add(dst, "psf-rho", "Correlation of PSF residuals",
                  "Stars - PSF of pairs of reserved stars; bars are 1 sigma.", RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, 3, curves);
}

static void by_magnitudes(rx_figures *dst, const rx_rollup *r, double first, double last, double widest)
{
    rx_axes axes = {.xlabel = "magnitude of the reference",
                    .ylabel = "recall",
                    .x0 = first,
                    .x1 = last,
                    .y0 = 0,
                    .y1 = 1.02};
    rx_figure_add(dst, "all-recall", "Completeness", "All tiles together; bars are 95 % intervals.",
                  RX_FIGURE_CHART);
    by_magnitude(dst, r, 0, &axes);
    axes.xlabel = "measured magnitude";
    axes.ylabel = "precision";
    rx_figure_add(dst, "all-precision", "Purity", "All tiles together; bars are 95 % intervals.",
                  RX_FIGURE_CHART);
    by_magnitude(dst, r, 1, &axes);
    axes.xlabel = "magnitude of the reference";
    axes.ylabel = "median of m - m0 [mag]";
    axes.y0 = -widest;
    axes.y1 = widest;
    rx_figure_add(dst, "all-bias", "Magnitude errors", "Medians over all tiles with their errors.",
                  RX_FIGURE_CHART);
    by_magnitude(dst, r, 2, &axes);
    rx_rollup_sky(dst, r);
}

void rx_rollup_figures(rx_figures *dst, const rx_rollup *r)
{
    double first = HUGE_VAL, last = -HUGE_VAL, widest = 0.02;
    for (int i = 0; i < r->nruns; i++)
        for (int b = r->run[i].first; b <= r->run[i].last; b++) {
            const rx_rollup_cell *cell = &r->run[i].bin[b];
            if (cell->recall.n < FEW && cell->precision.n < FEW)
                continue;
            first = fmin(first, 0.5 * (b + RX_TALLY_LOW));
            last = fmax(last, 0.5 * (b + 1 + RX_TALLY_LOW));
            if (isfinite(cell->bias) && cell->pairs >= FEW)
                widest = fmax(widest, 1.2 * fabs(cell->bias));
        }
    if (last > first)
        by_magnitudes(dst, r, first, last, widest);
    rho_figure(dst, r);
}
