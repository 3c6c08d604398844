/* The common kinds of plots: curves, boxes, grey-scale pictures, numbers in colour. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "report/figure.h"
#include "report/formats.h"

enum { MAX_POINTS = 2000, LONG_LABELS = 72 };

static int style_of(int color)
{
    return (color % RX_PALETTE + RX_PALETTE) % RX_PALETTE + 1;
}

/* " title 'name'", " notitle" without one */
static void plot_title(rx_text *script, const char *name)
{
    char plain[64];
    rx_escape_plain(plain, sizeof plain, name);
    if (plain[0] != '\0')
        rx_text_printf(script, " title '%s'", plain);
    else
        rx_text_add(script, " notitle");
}

/* --- curves --- */

void rx_curves_add(rx_curves *c, rx_curve_kind kind, int color, const char *name)
{
    if (RX_GROW(c->curve, (size_t)c->n + 1, NULL) != RX_OK) {
        c->failed = true;
        return;
    }
    rx_curve *curve = &c->curve[c->n++];
    *curve = (rx_curve){.name = name, .kind = kind, .color = color};
    for (int k = 0; k + 1 < c->n && name != NULL; k++)
        curve->dashed |= color >= 0 && c->curve[k].color == color && c->curve[k].name != NULL;
}

void rx_curves_put(rx_curves *c, double x, double y, double low, double high)
{
    rx_curve *last = c->n > 0 ? &c->curve[c->n - 1] : NULL;
    if (c->failed || last == NULL)
        return;
    if (last->n == last->room) {
        const long room = last->room > 0 ? 2 * last->room : 32;
        if (RX_GROW(last->point, (size_t)room, NULL) != RX_OK) {
            c->failed = true;
            return;
        }
        last->room = room;
    }
    memcpy(last->point[last->n++], (const double[]){x, y, low, high}, sizeof *last->point);
    c->points += last->color >= 0 && isfinite(y);
}

void rx_curves_reference(rx_curves *c, double x0, double y0, double x1, double y1)
{
    rx_curves_add(c, RX_CURVE_LINE, -1, NULL);
    rx_curves_put(c, x0, y0, NAN, NAN);
    rx_curves_put(c, x1, y1, NAN, NAN);
}

/* $d<k>: x, y and, where the kind has them, low and high: cut to the plot, both the value when one is not finite. */
static void curve_block(rx_text *dst, const rx_axes *axes, const rx_curve *c, int k)
{
    bool many = c->kind == RX_CURVE_LINE || c->kind == RX_CURVE_STEPS || c->kind == RX_CURVE_DOTS;
    long skip = many ? (c->n - 1) / MAX_POINTS + 1 : 1;
    rx_text_printf(dst, "$d%d << EOD\n", k);
    for (long i = 0; i < c->n; i++) {
        const double *v = c->point[i];
        const bool bounded = isfinite(v[2]) && isfinite(v[3]);
        if (i % skip != 0 && i + 1 != c->n)
            continue;
        rx_plot_value(dst, v[0]);
        rx_plot_value(dst, v[1]);
        if (c->kind == RX_CURVE_BARS || c->kind == RX_CURVE_BAND) {
            rx_plot_value(dst, bounded ? fmax(v[2], axes->y0) : v[1]);
            rx_plot_value(dst, bounded ? fmin(v[3], axes->y1) : v[1]);
        }
        rx_text_add(dst, "\n");
    }
    rx_text_add(dst, "EOD\n");
}

static void curve_command(rx_text *dst, const rx_curve *c, int k)
{
    static const char *const with[] = {"lines",  "linespoints", "yerrorlines", "linespoints",
                                       "fsteps", "points",      "points"};
    int style = style_of(c->color);
    if (c->kind == RX_CURVE_BAND)
        rx_text_printf(dst, ", $d%d using 1:3:4 with filledcurves lc rgb color(%d, 200) notitle", k, style);
    rx_text_printf(dst, ", $d%d using %s with %s", k, c->kind == RX_CURVE_BARS ? "1:2:3:4" : "1:2",
                   with[c->kind]);
    if (c->color < 0)
        rx_text_add(dst, " lc rgb '#808080' lw 1.4 dt 2");
    else if (c->kind == RX_CURVE_DOTS) /* so pale that the key has a sample of its own */
        rx_text_printf(dst,
                       " ls %d lc rgb color(%d, 150) pt 7 ps 0.25 notitle, NaN with points ls %d pt 7 ps 0.4",
                       style, style, style);
    else
        rx_text_printf(dst, " ls %d%s", style, c->dashed ? " dt 2" : "");
    plot_title(dst, c->name);
}

/* Leave the axes as other figures expect them. */
static void plot_end(rx_text *dst, const rx_axes *axes)
{
    rx_text_printf(dst, "\n%s", axes->log_x || axes->log_y ? "unset logscale\n" : "");
}

/* From the values, with a margin. */
static void set_range(const rx_curves *c, rx_axes *axes)
{
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < c->n; k++)
        for (long i = 0; i < c->curve[k].n; i++)
            for (int part = 1; part < 4; part++) {
                const double v = c->curve[k].point[i][part];
                low = isfinite(v) && (v > 0 || !axes->log_y) ? fmin(low, v) : low;
                high = isfinite(v) ? fmax(high, v) : high;
            }
    const double margin = 0.05 * (high - low) + 1e-3;
    axes->y0 = axes->log_y ? 0.7 * low : low - margin;
    axes->y1 = axes->log_y ? 1.4 * high : high + margin;
}

void rx_curves_figure(rx_figures *dst, const char *id, const char *title, const char *reading,
                      const rx_axes *axes, rx_curves *c)
{
    rx_text *script = &dst->script;
    rx_axes ranged = *axes;
    script->failed = script->failed || c->failed;
    if (c->points > 0 && !c->failed) {
        rx_figure_add(dst, id, title, reading, RX_FIGURE_CHART);
        rx_text_add(script, c->equal ? "set size ratio -1\n" : "");
        if (axes->y0 == axes->y1)
            set_range(c, &ranged);
        for (int k = 0; k < c->n; k++)
            curve_block(script, &ranged, &c->curve[k], k);
        rx_plot_begin(dst, &ranged);
        rx_text_add(script, "plot NaN notitle"); /* never seen: keeps the command whole without curves */
        for (int k = 0; k < c->n; k++)
            curve_command(script, &c->curve[k], k);
        plot_end(script, &ranged);
        rx_text_add(script, c->equal ? "set size noratio\n" : "");
    }
    for (int k = 0; k < c->n; k++)
        free(c->curve[k].point);
    free(c->curve);
    *c = (rx_curves){0};
}

/* --- boxes --- */

/* Names of the groups in place of numbers; slanted when they would not fit. */
static void group_tics(rx_text *dst, int ngroups, const char *const *groups)
{
    char plain[64];
    size_t letters = 0;
    for (int g = 0; g < ngroups; g++)
        letters += strlen(groups[g]) + 1;
    rx_text_printf(dst, "set grid noxtics\nset xtics %s (", letters > LONG_LABELS ? "rotate by -40" : "");
    for (int g = 0; g < ngroups; g++) {
        rx_escape_plain(plain, sizeof plain, groups[g]);
        rx_text_printf(dst, "%s'%s' %d", g > 0 ? ", " : "", plain, g);
    }
    rx_text_add(dst, ")\n");
}

/* $d<method>: x, low, q1, median, q3, high, mean, width. */
static void box_block(rx_text *dst, int ngroups, int nmethods, int method, const rx_five_numbers *boxes)
{
    rx_text_printf(dst, "$d%d << EOD\n", method);
    for (int g = 0; g < ngroups; g++) {
        const rx_five_numbers *b = &boxes[(size_t)g * (size_t)nmethods + (size_t)method];
        if (b->n == 0)
            continue;
        const double x = g + 0.8 * ((method + 0.5) / nmethods - 0.5), width = 0.8 * 0.75 / nmethods;
        const double row[] = {x, b->low, b->q1, b->median, b->q3, b->high, b->mean, width};
        for (size_t i = 0; i < sizeof row / sizeof *row; i++)
            rx_plot_value(dst, row[i]);
        rx_text_add(dst, "\n");
    }
    rx_text_add(dst, "EOD\n");
}

void rx_plot_boxes(rx_figures *dst, const rx_axes *axes, const rx_boxes *of)
{
    rx_text *script = &dst->script;
    const int ngroups = of->ngroups, nmethods = of->nmethods;
    double low = INFINITY, high = -INFINITY; /* every whisker and mean */
    for (int i = 0; i < ngroups * nmethods; i++)
        if (of->boxes[i].n > 0) {
            low = fmin(low, fmin(of->boxes[i].low, of->boxes[i].mean));
            high = fmax(high, fmax(of->boxes[i].high, of->boxes[i].mean));
        }
    if (!(low <= high)) {
        low = 0;
        high = 1;
    }
    const double margin = high > low ? 0.05 * (high - low) : fmax(0.05 * fabs(high), 0.5);
    const rx_axes used = {axes->xlabel, axes->ylabel,  -0.55, ngroups - 0.45,
                          low - margin, high + margin, false, false};
    for (int m = 0; m < nmethods; m++)
        box_block(script, ngroups, nmethods, m, of->boxes);
    rx_plot_begin(dst, &used);
    group_tics(script, ngroups, of->groups);
    rx_text_add(script, "plot NaN notitle");
    for (int m = 0; m < nmethods; m++) {
        const int style = style_of(of->colors[m]);
        rx_text_printf(
            script,
            ", $d%d using 1:3:2:6:5:8 with candlesticks whiskerbars 0.5 ls %d lw 1 fs solid 0.35 border", m,
            style);
        plot_title(script, of->methods[m]);
        rx_text_printf(script,
                       ", $d%d using 1:4:4:4:4:8 with candlesticks ls %d lw 2.4 notitle, $d%d using 1:7 with "
                       "points pt 6 ps 0.45 lw 1 lc rgb '#404040' notitle",
                       m, style, m);
    }
    rx_text_add(script, "\nset xtics norotate autofreq\nset grid xtics");
    plot_end(script, &used);
}

/* --- pixels and colours --- */

void rx_plot_picture(rx_figures *dst, const rx_grey_image *of)
{
    rx_text *script = &dst->script;
    const int width = of->width, height = of->height;
    const double low = of->low, high = of->high, soft = of->soft;
    if (dst->n == 0 || width <= 0 || height <= 0)
        return;
    const char *id = dst->figure[dst->n - 1].id;
    double black = soft > 0 ? asinh(low / soft) : low, white = soft > 0 ? asinh(high / soft) : high;
    rx_text_printf(script,
                   "set terminal svg size %d,%d dynamic noenhanced font 'Helvetica,13' background "
                   "'#ffffff'\nset output '%s.svg'\n$picture << EOD\n",
                   of->side, (int)((double)of->side * height / width + 0.5), id);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double v = of->pixels[(size_t)y * (size_t)width + (size_t)x];
            rx_text_printf(script, "%.4g ", !isfinite(v) ? black : soft > 0 ? asinh(v / soft) : v);
        }
        rx_text_add(script, "\n");
    }
    rx_text_printf(script,
                   "EOD\nset cbrange [%.6g:%.6g]\nset xrange [-0.5:%.1f]\nset yrange [-0.5:%.1f]\nplot "
                   "$picture matrix with image notitle\n",
                   black, white > black ? white : black + 1, width - 0.5, height - 0.5);
}

void rx_plot_coloured_begin(rx_figures *dst, const rx_axes *axes, const rx_coloured *what)
{
    rx_text *script = &dst->script;
    rx_plot_begin(dst, axes);
    rx_text_add(script, "$data << EOD\n");
    for (int k = 0; k < what->rows * what->columns; k++) {
        rx_plot_value(script, what->values[k]);
        rx_text_add(script, (k + 1) % what->columns == 0 ? "\n" : "");
    }
    rx_text_printf(script,
                   "EOD\nset palette defined %s\nset cbrange [%.6g:%.6g]\nset colorbox\nset cblabel '%s' "
                   "offset 2\nset rmargin at screen 0.78\nset size ratio -1\nplot ",
                   what->palette, what->low, what->high, what->label);
}

void rx_plot_coloured_end(rx_figures *dst)
{
    rx_text_add(&dst->script,
                "\nset size noratio\nset rmargin -1\nunset cblabel\nset cbrange [*:*]\nset palette gray\n");
}
