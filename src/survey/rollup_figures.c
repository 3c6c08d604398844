/* Figures of a survey: over the sky, by magnitude, and of the PSFs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "report/figure.h"
#include "survey/rollup.h"

enum { FEW = 5 };

/* --- over the sky --- */

/* More points than MOST_POINTS make a figure that a browser is slow to show, and hide each other: then they
 * are averaged in cells. */
enum { MOST_POINTS = 1500, CELLS = 38 };

typedef struct point {
    double x, y, value;
} point;

static int is_placed(const rx_rollup_row *row)
{
    return row->compared && isfinite(row->alpha) && isfinite(row->delta);
}

static rx_axes frame(const rx_rollup *r)
{
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
    for (int i = 0; i < r->nrows; i++) {
        const double at[] = {r->row[i].alpha, r->row[i].delta};
        for (int k = 0; k < 2 && isfinite(at[0]) && isfinite(at[1]); k++) {
            low[k] = fmin(low[k], at[k]);
            high[k] = fmax(high[k], at[k]);
        }
    }
    const double margin = 0.05 * fmax(high[0] - low[0], high[1] - low[1]) + 0.02;
    return (rx_axes){.xlabel = "ALPHA_J2000 [deg]",
                     .ylabel = "DELTA_J2000 [deg]",
                     .x0 = low[0] - margin,
                     .x1 = high[0] + margin,
                     .y0 = low[1] - margin,
                     .y1 = high[1] + margin};
}

static int cell_of(double at, double low, double high)
{
    return (int)fmax(0, fmin(CELLS - 1, floor(CELLS * (at - low) / (high - low))));
}

/* In place; returns how many points are left, each the mean of a cell. */
static int average(int n, point *points, const rx_axes *axes)
{
    static const int ncells = CELLS * CELLS;
    double *sum = RX_NEW(double, (size_t)ncells);
    int *count = RX_NEW(int, (size_t)ncells), left = 0;
    for (int i = 0; i < n && sum != NULL && count != NULL; i++) {
        const int cell =
            CELLS * cell_of(points[i].y, axes->y0, axes->y1) + cell_of(points[i].x, axes->x0, axes->x1);
        sum[cell] += points[i].value;
        count[cell]++;
    }
    for (int cell = 0; cell < ncells && sum != NULL && count != NULL; cell++)
        if (count[cell] > 0)
            points[left++] =
                (point){.x = axes->x0 + (axes->x1 - axes->x0) * (cell % CELLS + 0.5) / CELLS,
                        .y = axes->y0 + (axes->y1 - axes->y0) * (cell - cell % CELLS + 0.5 * CELLS) / ncells,
                        .value = sum[cell] / count[cell]};
    free(count);
    free(sum);
    return left;
}

/* Images of a run that have a value; bias: that, else recall. */
static int collect(const rx_rollup *r, int run, int bias, point *dst)
{
    int n = 0;
    for (int i = 0; i < r->nrows; i++) {
        const rx_rollup_row *row = &r->row[i];
        const double value = bias ? row->cell.bias : row->cell.recall.value;
        if (row->run == run && is_placed(row) && isfinite(value))
            dst[n++] = (point){.x = row->alpha, .y = row->delta, .value = value};
    }
    return n;
}

static void draw(rx_figures *dst, int bias, int n, const point *points, const rx_axes *axes)
{
    char range[48] = "[*:*]";
    double widest = 0.01;
    rx_text *script = &dst->script;
    rx_plot_begin(dst, axes);
    rx_text_add(script, "$sky << EOD\n");
    for (int i = 0; i < n; i++) {
        widest = fmax(widest, fabs(points[i].value));
        rx_plot_value(script, points[i].x);
        rx_plot_value(script, points[i].y);
        rx_plot_value(script, points[i].value);
        rx_text_add(script, "\n");
    }
    if (bias)
        snprintf(range, sizeof range, "[%.4g:%.4g]", -widest, widest);
    /* east is left; completeness from dark to bright; bias from blue to red with grey, which shows on white,
     * for none */
    rx_text_printf(
        script,
        "nan nan nan\nEOD\nset xrange [%.6g:%.6g]\nset palette defined (%s)\nset cbrange %s\n"
        "set cblabel '%s'\n"
        "plot $sky using 1:2:3 with points pt 5 ps 0.9 palette notitle\nunset cblabel\nset cbrange [*:*]\n",
        axes->x1, axes->x0,
        bias ? "-1 '#2166ac', 0 '#bbbbbb', 1 '#b2182b'"
             : "0 '#440154', 1 '#31688e', 2 '#35b779', 3 '#fde725'",
        range, bias ? "median of m - m0 [mag]" : "recall");
}

static void add_figure(rx_figures *dst, const rx_rollup *r, int run, int bias, point *room)
{
    const rx_axes axes = frame(r);
    char id[RX_FIGURE_ID], title[64], reading[100] = "A square per image.";
    const int all = collect(r, run, bias, room);
    const int n = all > MOST_POINTS ? average(all, room, &axes) : all;
    if (n < all)
        snprintf(reading, sizeof reading, "A square is the mean of the images in a cell of %.3g x %.3g deg.",
                 (axes.x1 - axes.x0) / CELLS, (axes.y1 - axes.y0) / CELLS);
    snprintf(id, sizeof id, "all-sky-%d-%d", run, bias);
    snprintf(title, sizeof title, "%s: %s over the sky", r->run[run].name, bias ? "bias" : "completeness");
    rx_figure_add(dst, id, title, reading, RX_FIGURE_CHART);
    draw(dst, bias, n, room, &axes);
    dst->script.failed |= n == 0 && all > 0;
}

static void sky(rx_figures *dst, const rx_rollup *r)
{
    int placed = 0;
    for (int i = 0; i < r->nrows; i++)
        placed += is_placed(&r->row[i]);
    point *room = RX_NEW(point, (size_t)placed);
    dst->script.failed |= room == NULL;
    for (int i = 0; i < r->nruns && placed > 0 && room != NULL; i++)
        for (int bias = 0; bias < 2; bias++)
            add_figure(dst, r, i, bias, room);
    free(room);
}

/* --- by magnitude, and by angle --- */

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
    sky(dst, r);
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
