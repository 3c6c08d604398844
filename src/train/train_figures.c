/* Curves and heat maps. */
#include "train/train_figures.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"

enum { MOST_CURVES = 5, MAPS = 4 };

/* A number of every epoch, or of every bin. */
typedef struct number {
    const char *name;
    size_t offset; /* in rx_epoch, rx_epoch_bin */
    double factor;
} number;

static double value_of(const rx_epoch *epoch, const number *which)
{
    return which->factor * *(const double *)((const char *)epoch + which->offset);
}

static void widen(rx_axes *axes, double v)
{
    if (!isfinite(v) || (axes->log_y && v <= 0))
        return;
    axes->y0 = fmin(axes->y0, v);
    axes->y1 = fmax(axes->y1, v);
}

/* Several numbers against the epoch; one that is 0 in all of them is left out. */
typedef struct chart {
    const char *id, *title, *reading, *ylabel;
    bool log_y;
    number numbers[MOST_CURVES];
} chart;

static void draw_chart(rx_figures *dst, const rx_history *h, const chart *what)
{
    rx_axes axes = {.ylabel = what->ylabel, .log_y = what->log_y};
    const number *numbers = what->numbers;
    int n = 0;
    while (n < MOST_CURVES && numbers[n].name != NULL)
        n++;
    rx_curve curve[MOST_CURVES] = {{0}};
    const size_t length = (size_t)h->n;
    int drawn = 0;
    double *data = RX_NEW(double, length *(size_t)(n + 1));
    if (data == NULL) {
        dst->script.failed = true;
        return;
    }
    axes.xlabel = "epoch";
    axes.x0 = 0;
    axes.x1 = (double)h->n;
    axes.y0 = INFINITY;
    axes.y1 = -INFINITY;
    for (size_t e = 0; e < length; e++)
        data[e] = (double)e + 1;
    for (int k = 0; k < n; k++) {
        double *y = data + (size_t)(k + 1) * length, most = 0;
        for (size_t e = 0; e < length; e++) {
            y[e] = value_of(&h->epoch[e], &numbers[k]);
            most = isfinite(y[e]) ? fmax(most, fabs(y[e])) : most;
        }
        if (most <= 0)
            continue;
        for (size_t e = 0; e < length; e++)
            widen(&axes, y[e]);
        curve[drawn++] = (rx_curve){.name = numbers[k].name,
                                    .kind = length < 30 ? RX_CURVE_JOINED : RX_CURVE_LINE,
                                    .color = k,
                                    .n = h->n,
                                    .x = data,
                                    .y = y};
    }
    const double margin = axes.log_y ? 0 : 0.05 * (axes.y1 - axes.y0);
    axes.y0 = axes.log_y ? 0.8 * axes.y0 : axes.y0 - margin;
    axes.y1 = axes.log_y ? 1.25 * axes.y1 : axes.y1 + margin;
    if (drawn > 0) {
        rx_figure_add(dst, what->id, what->title, what->reading, RX_FIGURE_CHART);
        rx_plot_curves(dst, &axes, drawn, curve);
    }
    free(data);
}

#define NUMBER(name, field, factor)                                                                          \
    {                                                                                                        \
        name, offsetof(rx_epoch, field), factor                                                              \
    }

static const chart CHARTS[] = {
    {"curve-loss",
     "Loss",
     "Means of an epoch. Training: weighted sum of all terms. Test: RESTORE(blurred) against sharp, mean "
     "over the "
     "bins; unrestored: the blurred test images themselves against sharp. Validation: as test, on the same "
     "images in "
     "every epoch; the lowest is the model.",
     "loss",
     true,
     {NUMBER("training", losses.total, 1), NUMBER("test", test_loss, 1),
      NUMBER("test unrestored", input_loss, 1), NUMBER("validation", validation, 1)}},
    {"curve-terms",
     "Terms of the loss",
     "Without their weights, training images.",
     "term",
     true,
     {NUMBER("RESTORE", losses.idt_restore, 1), NUMBER("PSF", losses.idt_psf, 1),
      NUMBER("RESTORE of PSF", losses.rec_restore, 1), NUMBER("PSF of RESTORE", losses.rec_psf, 1),
      NUMBER("FFL", losses.ffl, 1)}},
    {"curve-recall",
     "Stars found",
     "Share of the test stars of S/N above 5 with a peak above 1.7 sky sigmas within 1.5 pixels.",
     "recall",
     false,
     {NUMBER("recall", recall, 1)}},
    {"curve-flux",
     "Fluxes of stars",
     "Isolated test stars of S/N above 12: sum within 2 FWHM of the target PSF against the truth's.",
     "error of the flux (%)",
     false,
     {NUMBER("median error", bias, 100), NUMBER("scatter", scatter, 100)}},
    {"curve-rate",
     "Learning rate",
     "Of the last step of the epoch.",
     "rate",
     false,
     {NUMBER("learning rate", rate, 1)}},
    {"curve-gradient",
     "Gradient",
     "Mean norm before clipping.",
     "norm",
     true,
     {NUMBER("norm of the gradient", norm, 1)}},
};

/* One number of every bin as a coloured table over FWHM and noise. */
static void heat_map(rx_figures *dst, const rx_epoch_bin *bins, const rx_selection *grid, const number *what,
                     const char *id, const char *title, const char *reading)
{
    rx_text *script = &dst->script;
    double low = INFINITY, high = -INFINITY;
    const rx_axes axes = {.xlabel = "FWHM (pixels)",
                          .ylabel = "noise sigma (brightest 0.1 % from 255)",
                          .x0 = grid->fwhm[0],
                          .x1 = grid->fwhm[1],
                          .y0 = grid->sigma[0],
                          .y1 = grid->sigma[1]};
    for (int b = 0; b < grid->nbins; b++) {
        const double v = what->factor * *(const double *)((const char *)&bins[b] + what->offset);
        low = isfinite(v) ? fmin(low, v) : low;
        high = isfinite(v) ? fmax(high, v) : high;
    }
    if (!(low <= high) || dst->n >= RX_FIGURES_MAX)
        return;
    rx_figure_add(dst, id, title, reading, RX_FIGURE_CHART);
    rx_plot_begin(dst, &axes);
    rx_text_add(script, "$heat << EOD\n");
    for (int b = 0; b < grid->nbins; b++) {
        double fwhm[2], sigma[2], v = what->factor * *(const double *)((const char *)&bins[b] + what->offset);
        rx_selection_bin(grid, b, fwhm, sigma);
        if (isfinite(v))
            rx_text_printf(script, "%.6g %.6g %.6g %.6g %.6g\n", 0.5 * (fwhm[0] + fwhm[1]),
                           0.5 * (sigma[0] + sigma[1]), 0.5 * (fwhm[1] - fwhm[0]),
                           0.5 * (sigma[1] - sigma[0]), v);
    }
    rx_text_printf(
        script,
        "EOD\nset palette defined (0 '#ffffff', 1 '#56B4E9')\nset colorbox\n"
        "set cbrange [%.6g:%.6g]\n"
        "plot $heat using 1:2:3:4:5 with boxxyerror fillcolor palette fillstyle solid border lc "
        "rgb '#808080' notitle, $heat using 1:2:(sprintf('%%.3g', $5)) with labels tc rgb '#101418' notitle\n"
        "unset colorbox\nset palette gray\nset palette maxcolors 256\n",
        low, high > low ? high : low + 1);
}

/* First, last and two between. */
static int some_epochs(long n, long dst[MAPS])
{
    const long wanted[MAPS] = {0, (n - 1) / 3, 2 * (n - 1) / 3, n - 1};
    int count = 0;
    for (int i = 0; i < MAPS; i++)
        if (count == 0 || wanted[i] > dst[count - 1])
            dst[count++] = wanted[i];
    return count;
}

void rx_train_figures(rx_figures *dst, const rx_history *history, const rx_selection *grid)
{
    long shown[MAPS];
    const rx_epoch_bin *last = history->bin + (history->n - 1) * history->nbins;
    for (size_t i = 0; i < sizeof CHARTS / sizeof *CHARTS; i++)
        draw_chart(dst, history, &CHARTS[i]);
    const int n = some_epochs(history->n, shown);
    for (int i = 0; i < n; i++) {
        char id[RX_FIGURE_ID], title[64];
        snprintf(id, sizeof id, "list-%ld", shown[i] + 1);
        snprintf(title, sizeof title, "Dictionary after epoch %ld", shown[i] + 1);
        heat_map(dst, history->bin + shown[i] * history->nbins, grid,
                 &(number){.offset = offsetof(rx_epoch_bin, list), .factor = 1}, id, title,
                 "Mean test loss, normalised (Eq. 4's list): with active learning the share of a bin's "
                 "images that "
                 "the next epoch trains on.");
    }
    static const struct {
        const char *id;
        number what;
    } maps[] = {
        {"last-loss", {"Test loss", offsetof(rx_epoch_bin, loss), 1}},
        {"last-recall", {"Recall", offsetof(rx_epoch_bin, recall), 1}},
        {"last-bias", {"Median error of fluxes (%)", offsetof(rx_epoch_bin, bias), 100}},
        {"last-scatter", {"Scatter of fluxes (%)", offsetof(rx_epoch_bin, scatter), 100}},
    };
    for (size_t i = 0; i < sizeof maps / sizeof *maps; i++) {
        char title[64];
        snprintf(title, sizeof title, "%s, epoch %ld", maps[i].what.name, history->n);
        heat_map(dst, last, grid, &maps[i].what, maps[i].id, title, "");
    }
}
