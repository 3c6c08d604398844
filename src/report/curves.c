/* Curves that grow. */
#include "report/curves.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

void rx_curves_add(rx_curves *c, rx_curve_kind kind, int color, const char *name)
{
    rx_curve *grown = rx_regrow(c->curve, (size_t)c->n + 1, sizeof *grown);
    if (grown == NULL) {
        c->failed = true;
        return;
    }
    c->curve = grown;
    rx_curve *curve = &grown[c->n++];
    *curve = (rx_curve){.name = name, .kind = kind, .color = color};
    for (int k = 0; k + 1 < c->n && name != NULL; k++)
        curve->dashed |= color >= 0 && grown[k].color == color && grown[k].name != NULL;
    c->room = 0;
}

void rx_curves_put(rx_curves *c, double x, double y, double low, double high)
{
    rx_curve *last = c->n > 0 ? &c->curve[c->n - 1] : NULL;
    if (c->failed || last == NULL)
        return;
    const double values[] = {x, y, low, high}, **columns[] = {&last->x, &last->y, &last->low, &last->high};
    const bool full = last->n == c->room;
    c->room = !full ? c->room : c->room > 0 ? 2 * c->room : 32;
    for (int i = 0; i < 4; i++) {
        double *data = (double *)*columns[i];
        if (full)
            data = rx_regrow(data, (size_t)c->room, sizeof *data);
        if (data == NULL) {
            c->failed = true;
            return;
        }
        data[last->n] = values[i];
        *columns[i] = data;
    }
    last->n++;
    c->points += last->color >= 0 && isfinite(y);
}

void rx_curves_reference(rx_curves *c, double x0, double y0, double x1, double y1)
{
    rx_curves_add(c, RX_CURVE_LINE, -1, NULL);
    rx_curves_put(c, x0, y0, NAN, NAN);
    rx_curves_put(c, x1, y1, NAN, NAN);
}

/* From the values, with a margin. */
static void set_range(const rx_curves *c, rx_axes *axes)
{
    double low = INFINITY, high = -INFINITY;
    for (int k = 0; k < c->n; k++)
        for (long i = 0; i < c->curve[k].n; i++)
            for (int end = 0; end < 3; end++) {
                const double v = (end == 0   ? c->curve[k].y
                                  : end == 1 ? c->curve[k].low
                                             : c->curve[k].high)[i];
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
    dst->script.failed = dst->script.failed || c->failed;
    if (c->points > 0 && !c->failed) {
        rx_figure_add(dst, id, title, reading, RX_FIGURE_CHART);
        rx_text_add(&dst->script, c->equal ? "set size ratio -1\n" : "");
        rx_axes ranged = *axes;
        if (axes->y0 == axes->y1)
            set_range(c, &ranged);
        rx_plot_curves(dst, &ranged, c->n, c->curve);
        rx_text_add(&dst->script, c->equal ? "set size noratio\n" : "");
    }
    for (int k = 0; k < c->n; k++) {
        free((double *)c->curve[k].x);
        free((double *)c->curve[k].y);
        free((double *)c->curve[k].low);
        free((double *)c->curve[k].high);
    }
    free(c->curve);
    *c = (rx_curves){0};
}
