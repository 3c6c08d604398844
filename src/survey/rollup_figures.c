/* Figures of a survey: by magnitude, and of the PSFs. */
#include <math.h>

#include "report/curves.h"
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
    static const char *const ids[] = {"all-recall", "all-precision", "all-bias"}, *const titles[] = {
                                                                                      "Completeness",
                                                                                      "Purity",
                                                                                      "Magnitude errors"};
    rx_curves c = {0};
    for (int i = 0; i < r->nruns; i++) {
        rx_curves_add(&c, RX_CURVE_BARS, rx_method_color(r->run[i].name), r->run[i].name);
        for (int b = r->run[i].first; b <= r->run[i].last; b++) {
            const rx_estimate e = drawn(&r->run[i].bin[b], what);
            if (e.n >= FEW)
                rx_curves_put(&c, 0.5 * (b + RX_TALLY_LOW) + 0.25 + 0.03 * (i - 0.5 * (r->nruns - 1)),
                              e.value, e.low, e.high);
        }
    }
    rx_curves_figure(dst, ids[what], titles[what],
                     what == 2 ? "Medians over all tiles with their errors."
                               : "All tiles together; bars are 95 % intervals.",
                     axes, &c);
}

/* Correlation of the PSFs' residuals by angle. */
static void rho_figure(rx_figures *dst, const rx_rollup *r)
{
    rx_axes axes = {.xlabel = "angle between stars [arcmin]",
                    .ylabel = "mean product of residuals",
                    .x0 = HUGE_VAL,
                    .x1 = 0.0,
                    .log_x = true};
    double most = 1e-6;
    rx_curves c = {0};
    for (int size = 0; size < 2; size++) {
        rx_curves_add(&c, RX_CURVE_BARS, size, size ? "of T" : "rho1 of e");
        for (int k = 0; k < RX_RHO_BINS; k++) {
            const rx_rho_bin *b = &r->rho[k];
            const double value = size ? b->t : b->e, error = size ? b->t_error : b->e_error;
            if (!(b->pairs > 0.0) || !isfinite(b->e_error) || !isfinite(b->t_error))
                continue;
            rx_curves_put(&c, sqrt(rx_rho_edge(k) * rx_rho_edge(k + 1)), value, value - error, value + error);
            axes.x0 = fmin(axes.x0, rx_rho_edge(k));
            axes.x1 = fmax(axes.x1, rx_rho_edge(k + 1));
            most = fmax(most, 1.1 * (fabs(value) + error));
        }
    }
    rx_curves_reference(&c, axes.x0, 0, axes.x1, 0);
    axes.y0 = -most;
    axes.y1 = most;
    rx_curves_figure(dst, "psf-rho", "Correlation of PSF residuals",
                     "Stars - PSF of pairs of reserved stars; bars are 1 sigma.", &axes, &c);
}

static void by_magnitudes(rx_figures *dst, const rx_rollup *r, double first, double last, double widest)
{
    rx_axes axes = {.xlabel = "magnitude of the reference",
                    .ylabel = "recall",
                    .x0 = first,
                    .x1 = last,
                    .y0 = 0,
                    .y1 = 1.02};
    by_magnitude(dst, r, 0, &axes);
    axes.xlabel = "measured magnitude";
    axes.ylabel = "precision";
    by_magnitude(dst, r, 1, &axes);
    axes.xlabel = "magnitude of the reference";
    axes.ylabel = "median of m - m0 [mag]";
    axes.y0 = -widest;
    axes.y1 = widest;
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
