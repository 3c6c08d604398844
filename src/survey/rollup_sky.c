/* Completeness and bias over the sky. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "survey/rollup_report.h"

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

void rx_rollup_sky(rx_figures *dst, const rx_rollup *r)
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
