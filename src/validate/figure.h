/* Figures of a report: a gnuplot script with all data inside, run once; the SVG that comes out is made fit to
 * stand in a page beside others. One palette of 7 colours, the same for the same method in all figures.
 *
 *   rx_figures f; rx_figures_begin(&f);
 *   rx_figure_add(&f, "recall", "Recall", "how to read it", 0);   then one of rx_plot_...(&f, ...)
 *   rx_figures_draw(&f, NULL, folder, shown, err);     f.figure[i].svg, or f.note says why there are none
 *   rx_figures_free(&f);
 */
#ifndef RX_VALIDATE_FIGURE_H
#define RX_VALIDATE_FIGURE_H

#include <stdbool.h>

#include "base/error.h"
#include "base/text.h"
#include "validate/hypothesis.h"

enum { RX_FIGURES_MAX = 128, RX_FIGURE_ID = 32, RX_PALETTE = 7 };

typedef struct rx_figure {
    char id[RX_FIGURE_ID]; /* letters, digits, - and _; unique in the page */
    char *title, *reading; /* plain text, owned; reading may be "" */
    bool picture;          /* a small one: grey-scale pixels */
    char *svg;             /* owned; NULL until drawn or where it could not be made */
} rx_figure;

typedef struct rx_figures {
    int n;
    rx_figure figure[RX_FIGURES_MAX];
    rx_text script; /* for gnuplot; writers of special figures add their own commands */
    char note[256]; /* why there are none, "" when all is well */
} rx_figures;

void rx_figures_begin(rx_figures *dst);
void rx_figures_free(rx_figures *figures); /* content only */

/* Announce the figure that the next rx_plot_... call draws; beyond RX_FIGURES_MAX script.failed is set. */
void rx_figure_add(rx_figures *dst, const char *id, const char *title, const char *reading, bool picture);

/* Run gnuplot (`program` NULL or "" = "gnuplot") in a temporary folder made inside `folder` (`shown` in
 * errors) and removed again. Without gnuplot dst->note says so and the status is RX_OK. */
rx_status rx_figures_draw(rx_figures *dst, const char *program, const char *folder, const char *shown,
                          rx_error *err);

/* Ranges are always given, so that empty data cannot stop gnuplot; labels are made plain. */
typedef struct rx_axes {
    const char *xlabel, *ylabel;
    double x0, x1, y0, y1;
    bool log_x, log_y;
} rx_axes;

typedef enum rx_curve_kind {
    RX_CURVE_LINE,   /* a line */
    RX_CURVE_JOINED, /* points joined by a line */
    RX_CURVE_BARS,   /* the same with error bars low..high; no bar where they are not finite */
    RX_CURVE_BAND,   /* joined points over a pale band low..high */
    RX_CURVE_STEPS,  /* horizontal, then vertical (precision-recall) */
    RX_CURVE_POINTS, /* points alone */
    RX_CURVE_DOTS    /* many pale dots */
} rx_curve_kind;

typedef struct rx_curve {
    const char *name; /* of the key; NULL or "" = not in the key */
    rx_curve_kind kind;
    int color;   /* 0.. (modulo RX_PALETTE); -1 = grey and dashed, for a reference line */
    bool dashed; /* so that two curves of one method differ */
    long n;      /* not finite values leave a gap */
    const double *x, *y, *low, *high; /* low, high for BARS and BAND, else NULL */
} rx_curve;

/* Curves in one frame, drawn in this order. */
void rx_plot_curves(rx_figures *dst, const rx_axes *axes, int n, const rx_curve *curves);

/* Box plots: groups along x, in each group one box per method, boxes[group * nmethods + method] (n = 0: left
 * out). Box = quartiles, bar = median, ring = mean, whiskers = box.low, box.high. axes: xlabel, ylabel, y0,
 * y1 (y0 >= y1: from the data); colours[method], NULL = 0, 1, 2 ... */
void rx_plot_boxes(rx_figures *dst, const rx_axes *axes, int ngroups, const char *const *groups, int nmethods,
                   const char *const *methods, const int *colors, const rx_box *boxes);

/* Grey-scale picture of pixels[height][width] (first row at the bottom): black at `low`, white at `high`;
 * soft > 0: grey = asinh(p / soft), 0: linear. Not finite = black. `side` = width on the page in pixels. */
void rx_plot_picture(rx_figures *dst, int width, int height, const float *pixels, double low, double high,
                     double soft, int side);

/* For figures that are none of these: output file, labels and ranges of the figure announced last, data
 * values (NaN where not finite) and names made harmless, to be written into dst->script. */
void rx_plot_begin(rx_figures *dst, const rx_axes *axes);
void rx_plot_value(rx_text *script, double value);
void rx_plot_title(rx_text *script, const char *name); /* " title 'name'" */

#endif
