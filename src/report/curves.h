/* The curves of one figure as they grow, point by point; each owns its numbers.
 *
 *   rx_curves c = {0};
 *   rx_curves_add(&c, RX_CURVE_BARS, rx_method_color(name), name);
 *   rx_curves_put(&c, x, y, low, high);                            any number
 *   rx_curves_figure(figures, "recall", "Recall", "how to read it", &axes, &c);
 */
#ifndef RX_REPORT_CURVES_H
#define RX_REPORT_CURVES_H

#include "report/figure.h"

typedef struct rx_curves {
    int n;
    rx_curve *curve;
    long room, points; /* of the last curve; points with a value, of all that are not grey */
    bool equal;        /* both axes to one scale */
    bool failed;       /* memory ran out */
} rx_curves;

/* Where a curve with a name has that colour already, the new one is dashed. */
void rx_curves_add(rx_curves *curves, rx_curve_kind kind, int color, const char *name);
void rx_curves_put(rx_curves *curves, double x, double y, double low, double high);
void rx_curves_reference(rx_curves *curves, double x0, double y0, double x1, double y1); /* a grey line */

/* A chart of them, if there is a point to show; the curves are freed. axes->y0 == y1: from the points and their bars. */
void rx_curves_figure(rx_figures *dst, const char *id, const char *title, const char *reading,
                      const rx_axes *axes, rx_curves *curves);

#endif
