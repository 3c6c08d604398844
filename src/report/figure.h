/* Figures of a report: a gnuplot script with all data inside, run once; the SVG that comes out is made fit to
 * stand in a page beside others. One palette of 7 colours, the same for the same method in all figures.
 *
 *   rx_figures f; rx_figures_begin(&f);
 *   rx_figure_add(&f, "recall", "Recall", "how to read it", RX_FIGURE_CHART);   then one rx_plot_...(&f, ...)
 *   rx_figures_start(&f, NULL, folder, shown, err);
 *   rx_figures_finish(&f, err);                        f.figure[i].svg, or f.note says why there are none
 *   rx_figures_free(&f);
 */
#ifndef RX_REPORT_FIGURE_H
#define RX_REPORT_FIGURE_H

#include <stdbool.h>
#include <sys/types.h>

#include "base/error.h"
#include "base/text.h"
#include "quality/statistics.h"

enum { RX_FIGURES_MAX = 128, RX_FIGURE_ID = 40, RX_PALETTE = 7 };

typedef enum rx_figure_kind {
    RX_FIGURE_CHART,   /* two fit side by side */
    RX_FIGURE_PICTURE, /* grey-scale pixels, small */
    RX_FIGURE_WIDE     /* a chart as wide as the page */
} rx_figure_kind;

typedef struct rx_figure {
    char id[RX_FIGURE_ID]; /* letters, digits, - and _; unique in the page */
    rx_figure_kind kind;
    char *title, *reading; /* plain text, owned; reading may be "" */
    char *svg;             /* owned; NULL until drawn or where it could not be made */
} rx_figure;

typedef struct rx_figures {
    int n;
    rx_figure figure[RX_FIGURES_MAX];
    rx_text script; /* for gnuplot; writers of special figures add their own commands */
    char note[256]; /* why there are none, "" when all is well */
    char *work;     /* owned: gnuplot's folder while it works, else NULL */
    pid_t gnuplot;  /* 0: none at work */
    const char *program;
} rx_figures;

void rx_figures_begin(rx_figures *dst);
void rx_figures_free(rx_figures *figures); /* content only; waits for a gnuplot that was started */

/* Colour of a method, the same in all figures. The paper's where it has one: blurred and NONE blue, RL red,
 * NET green, by the first word. A name that is not known has the last colour of the palette. */
int rx_method_color(const char *name);

/* Announce the figure that the next rx_plot_... call draws; id is made fit for a file name. Beyond
 * RX_FIGURES_MAX, or without memory, script.failed is set and rx_figures_start fails. */
void rx_figure_add(rx_figures *dst, const char *id, const char *title, const char *reading,
                   rx_figure_kind kind);

/* Run gnuplot (`program` NULL or "" = "gnuplot") in a temporary folder made inside `folder` (`shown` in
 * errors) and removed again; between the two there is time for other work while gnuplot draws. Without gnuplot
 * dst->note says so and the status is RX_OK. Errors: RX_SYSTEM. */
rx_status rx_figures_start(rx_figures *dst, const char *program, const char *folder, const char *shown,
                           rx_error *err);
rx_status rx_figures_finish(rx_figures *dst, rx_error *err);

/* Ranges are always given, so that empty data cannot stop gnuplot, and may fall. One that gnuplot would
 * refuse (no extent, not finite, not positive on a logarithmic axis) is mended. */
typedef struct rx_axes {
    const char *xlabel, *ylabel;
    double x0, x1, y0, y1;
    bool log_x, log_y;
} rx_axes;

typedef enum rx_curve_kind {
    RX_CURVE_LINE,   /* a line */
    RX_CURVE_JOINED, /* points joined by a line */
    RX_CURVE_BARS,   /* the same with error bars low..high; no bar where an end is not finite */
    RX_CURVE_BAND,   /* joined points over a pale band low..high */
    RX_CURVE_STEPS,  /* vertical, then horizontal: the area below is sum (x_n - x_n-1) y_n, as average
                        precision */
    RX_CURVE_POINTS, /* points alone */
    RX_CURVE_DOTS    /* many pale dots */
} rx_curve_kind;

typedef struct rx_curve {
    const char *name; /* of the key, made plain; NULL or "" = not in the key */
    rx_curve_kind kind;
    int color;   /* 0.. (modulo RX_PALETTE); -1 = grey and dotted: a reference line */
    bool dashed; /* so that two curves of one method differ */
    long n, room;
    double (*point)[4]; /* x, y, low, high; one that is not finite leaves a gap */
} rx_curve;

/* Curves in one frame as they grow, point by point, drawn in this order. Lines, steps and dots of more than 2000
 * points are thinned.
 *
 *   rx_curves c = {0};
 *   rx_curves_add(&c, RX_CURVE_BARS, rx_method_color(name), name);
 *   rx_curves_put(&c, x, y, low, high);                            any number
 *   rx_curves_figure(figures, "recall", "Recall", "how to read it", &axes, &c); */
typedef struct rx_curves {
    int n;
    rx_curve *curve;
    long points; /* with a value, of all curves that are not grey */
    bool equal;  /* both axes to one scale */
    bool failed; /* memory ran out */
} rx_curves;

/* Where a curve with a name has that colour already, the new one is dashed. */
void rx_curves_add(rx_curves *curves, rx_curve_kind kind, int color, const char *name);
void rx_curves_put(rx_curves *curves, double x, double y, double low, double high);
void rx_curves_reference(rx_curves *curves, double x0, double y0, double x1, double y1); /* a grey line */

/* A chart of them, if there is a point to show; the curves are freed. axes->y0 == y1: from the points and their bars. */
void rx_curves_figure(rx_figures *dst, const char *id, const char *title, const char *reading,
                      const rx_axes *axes, rx_curves *curves);

/* Box plots: groups along x (names made plain), in each group one box per method, boxes[group * nmethods +
 * method] (n = 0: left out). Box = quartiles, bar = median, ring = mean, whiskers = box.low, box.high. Of axes
 * the labels count. */
typedef struct rx_boxes {
    int ngroups, nmethods;
    const char *const *groups, *const *methods;
    const int *colors;
    const rx_five_numbers *boxes;
} rx_boxes;
void rx_plot_boxes(rx_figures *dst, const rx_axes *axes, const rx_boxes *boxes);

/* Grey-scale picture of pixels[height][width] (first row at the bottom): black at `low`, white at `high`;
 * soft > 0: grey = asinh(p / soft), 0: linear. Not finite = black. `side` = width on the page in pixels. */
typedef struct rx_grey_image {
    int width, height, side;
    const float *pixels;
    double low, high, soft;
} rx_grey_image;
void rx_plot_picture(rx_figures *dst, const rx_grey_image *picture);

/* For figures that are none of these: output file, labels and ranges of the figure announced last, and values
 * (NaN where not finite), to be written into dst->script. Line style k + 1 and color(k + 1, transparency) are those
 * of method k; a logarithmic axis stays until unset. */
void rx_plot_begin(rx_figures *dst, const rx_axes *axes);
void rx_plot_value(rx_text *script, double value);

/* Numbers in colour, undistorted, with a colour bar: the caller writes "$data using ..." for gnuplot's plot, then
 * comes rx_plot_coloured_end(). */
#define RX_PLOT_VIRIDIS "(0 '#440154', 1 '#31688e', 2 '#35b779', 3 '#fde725')"
typedef struct rx_coloured {
    const char *palette, *label; /* gnuplot's; a constant without quotes */
    double low, high;
    int rows, columns;
    const double *values; /* [rows][columns] */
} rx_coloured;
void rx_plot_coloured_begin(rx_figures *dst, const rx_axes *axes, const rx_coloured *what);
void rx_plot_coloured_end(rx_figures *dst);

#endif
