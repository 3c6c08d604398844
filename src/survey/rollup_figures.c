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

/* Of one restorer's images what is drawn: recall or bias. */
typedef struct sky_map {
    const rx_rollup *rollup;
    const rx_rollup_run *run;
    int bias;
    rx_axes axes;
    double widest; /* bias */
} sky_map;

/* The next row from *i on that has a place and a value; false: no more. */
static bool next_value(const sky_map *map, int *i, double *value)
{
    for (; *i < map->rollup->nrows; ++*i) {
        const rx_rollup_row *row = map->rollup->row[*i];
        *value = map->bias ? row->cell.bias : row->cell.recall.value;
        if (row->run == map->run && row->compared && isfinite(row->image->alpha) &&
            isfinite(row->image->delta) && isfinite(*value))
            return true;
    }
    return false;
}

static void put(rx_text *script, sky_map *map, double x, double y, double value)
{
    map->widest = fmax(map->widest, fabs(value));
    rx_plot_value(script, x);
    rx_plot_value(script, y);
    rx_plot_value(script, value);
    rx_text_add(script, "\n");
}

static int cell_of(double at, double low, double high)
{
    return (int)fmax(0, fmin(CELLS - 1, floor(CELLS * (at - low) / (high - low))));
}

static void put_cells(rx_text *script, sky_map *map)
{
    const rx_axes *a = &map->axes;
    double *sum = RX_NEW(double, (size_t)CELLS *CELLS), value;
    long *n = RX_NEW(long, (size_t)CELLS *CELLS);
    script->failed |= sum == NULL || n == NULL;
    for (int i = 0; !script->failed && next_value(map, &i, &value); i++) {
        const rx_extension_facts *e = map->rollup->row[i]->image;
        const int cell = CELLS * cell_of(e->delta, a->y0, a->y1) + cell_of(e->alpha, a->x0, a->x1);
        sum[cell] += value;
        n[cell]++;
    }
    for (int cell = 0; cell < CELLS * CELLS && !script->failed; cell++) {
        const int x = cell % CELLS, y = cell / CELLS;
        if (n[cell] > 0)
            put(script, map, a->x0 + (a->x1 - a->x0) * (x + 0.5) / CELLS,
                a->y0 + (a->y1 - a->y0) * (y + 0.5) / CELLS, sum[cell] / (double)n[cell]);
    }
    free(sum);
    free(n);
}

static void add_map(rx_figures *dst, sky_map *map)
{
    char id[RX_FIGURE_ID], title[64], reading[100] = "A square per image.", range[48] = "[*:*]";
    rx_text *script = &dst->script;
    const rx_axes *a = &map->axes;
    double value;
    int n = 0;
    for (int i = 0; next_value(map, &i, &value); i++)
        n++;
    if (n > MOST_POINTS)
        snprintf(reading, sizeof reading, "A square is the mean of the images in a cell of %.3g x %.3g deg.",
                 (a->x1 - a->x0) / CELLS, (a->y1 - a->y0) / CELLS);
    snprintf(id, sizeof id, "all-sky-%d-%d", map->run->place, map->bias);
    snprintf(title, sizeof title, "%s: %s over the sky", map->run->name, map->bias ? "bias" : "completeness");
    rx_figure_add(dst, id, title, reading, RX_FIGURE_CHART);
    rx_plot_begin(dst, a);
    rx_text_add(script, "$sky << EOD\n");
    if (n > MOST_POINTS)
        put_cells(script, map);
    else
        for (int i = 0; next_value(map, &i, &value); i++)
            put(script, map, map->rollup->row[i]->image->alpha, map->rollup->row[i]->image->delta, value);
    if (map->bias)
        snprintf(range, sizeof range, "[%.4g:%.4g]", -map->widest, map->widest);
    /* east is left; completeness from dark to bright; bias from blue to red with grey, which shows on white,
     * for none */
    rx_text_printf(
        script,
        "nan nan nan\nEOD\nset xrange [%.6g:%.6g]\nset palette defined (%s)\nset cbrange %s\n"
        "set cblabel '%s'\n"
        "plot $sky using 1:2:3 with points pt 5 ps 0.9 palette notitle\nunset cblabel\nset cbrange [*:*]\n",
        a->x1, a->x0,
        map->bias ? "-1 '#2166ac', 0 '#bbbbbb', 1 '#b2182b'"
                  : "0 '#440154', 1 '#31688e', 2 '#35b779', 3 '#fde725'",
        range, map->bias ? "median of m - m0 [mag]" : "recall");
}

static void add_sky(rx_figures *dst, const rx_rollup *r)
{
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL};
    bool placed = false;
    for (int i = 0; i < r->nrows; i++) {
        const double at[] = {r->row[i]->image->alpha, r->row[i]->image->delta};
        for (int k = 0; k < 2 && isfinite(at[0]) && isfinite(at[1]); k++) {
            low[k] = fmin(low[k], at[k]);
            high[k] = fmax(high[k], at[k]);
            placed |= r->row[i]->compared;
        }
    }
    const double margin = 0.05 * fmax(high[0] - low[0], high[1] - low[1]) + 0.02;
    for (int i = 0; i < 2 * r->nruns && placed; i++)
        add_map(dst, &(sky_map){.rollup = r,
                                .run = r->run[i / 2],
                                .bias = i % 2,
                                .axes = {.xlabel = "ALPHA_J2000 [deg]",
                                         .ylabel = "DELTA_J2000 [deg]",
                                         .x0 = low[0] - margin,
                                         .x1 = high[0] + margin,
                                         .y0 = low[1] - margin,
                                         .y1 = high[1] + margin},
                                .widest = 0.01});
}

/* --- by magnitude, and by angle --- */

static const struct {
    const char *id, *title, *reading, *xlabel, *ylabel;
} BY_MAGNITUDE[] = {{"all-recall", "Completeness", "All tiles together; bars are 95 % intervals.",
                     "magnitude of the reference", "recall"},
                    {"all-precision", "Purity", "All tiles together; bars are 95 % intervals.",
                     "measured magnitude", "precision"},
                    {"all-bias", "Magnitude errors", "Medians over all tiles with their errors.",
                     "magnitude of the reference", "median of m - m0 [mag]"}};
enum { RECALL, PRECISION, BIAS };

static void add_curves(rx_figures *dst, const rx_rollup *r, int what, rx_axes *axes)
{
    rx_curves c = {0};
    for (int i = 0; i < r->nruns; i++) {
        const rx_rollup_run *run = r->run[i];
        rx_curves_add(&c, RX_CURVE_BARS, rx_method_color(run->name), run->name);
        for (int b = run->first; b <= run->last; b++) {
            const rx_rollup_cell *cell = &run->bin[b];
            const double error =
                cell->pairs > 0 ? RX_MEDIAN_ERROR * cell->scatter / sqrt((double)cell->pairs) : NAN;
            const rx_estimate e =
                what == BIAS ? (rx_estimate){cell->bias, cell->bias - error, cell->bias + error, cell->pairs}
                : what == RECALL ? cell->recall
                                 : cell->precision;
            if (e.n >= FEW)
                rx_curves_put(&c, 0.5 * (b + RX_TALLY_LOW) + 0.25 + 0.03 * (i - 0.5 * (r->nruns - 1)),
                              e.value, e.low, e.high);
        }
    }
    axes->xlabel = BY_MAGNITUDE[what].xlabel;
    axes->ylabel = BY_MAGNITUDE[what].ylabel;
    rx_curves_figure(dst, BY_MAGNITUDE[what].id, BY_MAGNITUDE[what].title, BY_MAGNITUDE[what].reading, axes,
                     &c);
}

/* Correlation of the PSFs' residuals by angle. */
static void add_rho(rx_figures *dst, const rx_rollup *r)
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

void rx_rollup_figures(rx_figures *dst, const rx_rollup *r)
{
    rx_axes axes = {.x0 = HUGE_VAL, .x1 = -HUGE_VAL, .y0 = 0, .y1 = 1.02};
    double widest = 0.02;
    for (int i = 0; i < r->nruns; i++)
        for (int b = r->run[i]->first; b <= r->run[i]->last; b++) {
            const rx_rollup_cell *cell = &r->run[i]->bin[b];
            if (cell->recall.n < FEW && cell->precision.n < FEW)
                continue;
            axes.x0 = fmin(axes.x0, 0.5 * (b + RX_TALLY_LOW));
            axes.x1 = fmax(axes.x1, 0.5 * (b + 1 + RX_TALLY_LOW));
            if (isfinite(cell->bias) && cell->pairs >= FEW)
                widest = fmax(widest, 1.2 * fabs(cell->bias));
        }
    if (axes.x1 > axes.x0) {
        add_curves(dst, r, RECALL, &axes);
        add_curves(dst, r, PRECISION, &axes);
        axes.y0 = -widest;
        axes.y1 = widest;
        add_curves(dst, r, BIAS, &axes);
        add_sky(dst, r);
    }
    add_rho(dst, r);
}
