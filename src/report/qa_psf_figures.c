/* The PSF in the figures of the QA report: what stars that it was not fitted to say of it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/psf.h"
#include "num/stats.h"
#include "report/figure.h"
#include "report/qa_figures.h"

enum { PICTURE_SIDE = 300, FEW = 5, SHAPES = 3 };
static const char *const NAMES[SHAPES] = {"size", "de1", "de2"};

/* That most residuals of stars do not exceed: of size, or of both parts of the ellipse. */
static double reach_of(const rx_psf_judged *judged, bool ellipse)
{
    double *values = RX_NEW(double, 2 * (size_t)judged->nstars + 1), reach = 0.01;
    size_t n = 0;
    for (int i = 0; i < judged->nstars && values != NULL; i++) {
        values[n++] = fabs(judged->star[i].off[ellipse ? 1 : 0]);
        if (ellipse)
            values[n++] = fabs(judged->star[i].off[2]);
    }
    if (n > 0)
        reach = fmax(1.3 * rx_quantile(values, n, 0.95), 1e-4);
    free(values);
    return reach;
}

/* Residuals against magnitude, of size or of the ellipse: every star, and means of FEW and more. */
static void magnitude_figure(rx_figures *dst, const rx_qa_numbers *q, bool ellipse)
{
    const rx_psf_judged *judged = q->input->psf.psf->judged;
    const double reach = reach_of(judged, ellipse);
    rx_axes axes = {.xlabel = "magnitude",
                    .ylabel = ellipse ? "de1, de2" : "dT/T",
                    .x0 = HUGE_VAL,
                    .x1 = -HUGE_VAL,
                    .y0 = -reach,
                    .y1 = reach};
    rx_curves c = {0};
    for (int k = ellipse ? 1 : 0; k < (ellipse ? SHAPES : 1); k++) {
        const int color = k > 1;
        rx_curves_add(&c, RX_CURVE_POINTS, color, NAMES[k]);
        for (int i = 0; i < judged->nstars; i++) {
            const double mag = rx_qa_star_mag(&q->input->psf, &judged->star[i]);
            rx_curves_put(&c, mag, judged->star[i].off[k], NAN, NAN);
            axes.x0 = fmin(axes.x0, mag - 0.3);
            axes.x1 = fmax(axes.x1, mag + 0.3);
        }
        rx_curves_add(&c, RX_CURVE_BARS, color, NULL);
        for (int b = 0; b < q->npsf_bins; b++) {
            const rx_qa_psf_bin *bin = &q->psf_bin[b];
            if (bin->n >= FEW)
                rx_curves_put(&c, bin->mag + 0.02 * color, bin->mean[k], bin->mean[k] - bin->error[k],
                              bin->mean[k] + bin->error[k]);
        }
    }
    rx_curves_reference(&c, axes.x0, 0, axes.x1, 0);
    rx_curves_figure(
        dst, ellipse ? "psf-mag-ellipse" : "psf-mag-size",
        ellipse ? "Ellipse, stars - PSF, by magnitude" : "Size, stars - PSF, by magnitude",
        ellipse ? "The same of e1 and e2."
                : "Reserved stars, and means of 5 and more with 1 sigma. A slope is a detector whose "
                  "stars grow with brightness, or a sky that is wrong.",
        &axes, &c);
}

/* Residuals over the tile: the colour is that of the size, the whisker that of the ellipse: as long as
 * |de| = hypot(de1, de2), along its major axis. */
static void map_figure(rx_figures *dst, const rx_qa_numbers *q)
{
    const rx_psf_judged *judged = q->input->psf.psf->judged;
    const double size = reach_of(judged, false), ellipse = reach_of(judged, true);
    const double side = fmax(q->input->width, q->input->height), length = 0.1 * side / ellipse;
    char reading[320];
    snprintf(
        reading, sizeof reading,
        "Colour: blue stars are smaller than the PSF, red ones larger. Whiskers: residual ellipses along "
        "their major axis; one of %.2g is as long as 10 %% of the tile's longer side. Colours or whiskers "
        "that flock are a PSF that varies in another way than the model.",
        ellipse);
    double *values = RX_NEW(double, 5 * (size_t)judged->nstars), *v = values;
    dst->script.failed |= values == NULL;
    for (int i = 0; i < judged->nstars && values != NULL; i++) {
        const rx_psf_star *s = &judged->star[i];
        const double half = 0.5 * length * hypot(s->off[1], s->off[2]),
                     angle = 0.5 * atan2(s->off[2], s->off[1]);
        *v++ = s->x + 1.0;
        *v++ = s->y + 1.0;
        *v++ = s->off[0];
        *v++ = half * cos(angle);
        *v++ = half * sin(angle);
    }
    rx_figure_add(dst, "psf-map", "Stars - PSF over the tile", reading, RX_FIGURE_CHART);
    rx_plot_coloured_begin(
        dst,
        &(rx_axes){.xlabel = "X_IMAGE", .ylabel = "Y_IMAGE", .x1 = q->input->width, .y1 = q->input->height},
        &(rx_coloured){"(-1 '#2166ac', 0 '#cccccc', 1 '#b2182b')", "dT/T", -size, size,
                       values ? judged->nstars : 0, 5, values});
    rx_text_add(&dst->script,
                "$data using ($1-$4):($2-$5):(2*$4):(2*$5) with vectors nohead lc rgb '#404040' lw 1.6 "
                "notitle, $data using 1:2:3 with points pt 7 ps 0.9 palette notitle, $data using 1:2 with "
                "points pt 6 ps 0.9 lw 0.7 lc rgb '#808080' notitle");
    rx_plot_coloured_end(dst);
    free(values);
}

static void growth_figure(rx_figures *dst, const rx_psf_judged *judged)
{
    const double wrong = 0.01, last = judged->growth[judged->nradii - 1].radius;
    double most = 2.0 * wrong;
    rx_curves c = {0};
    for (int side = -1; side <= 1; side += 2) {
        rx_curves_reference(&c, 0.0, side * wrong, last, side * wrong);
    }
    rx_curves_add(&c, RX_CURVE_BAND, 0, "stars - PSF");
    for (int i = 0; i < judged->nradii; i++) {
        const rx_psf_growth *g = &judged->growth[i];
        const double off = g->stars - g->psf;
        rx_curves_put(&c, g->radius, off, off - g->error, off + g->error);
        if (g->error < wrong)
            most = fmax(most, 1.5 * fabs(off));
    }
    rx_curves_figure(
        dst, "psf-growth", "Curve of growth, stars - PSF",
        "Light within a radius, shares of a star's, with 1 sigma: out to 20 FWHM, or to where the "
        "sky's error is 10 %. Beyond the dotted lines fluxes of templates are wrong by as much; the "
        "largest difference of the table is from radii with errors below 1 %.",
        &(rx_axes){
            .xlabel = "radius [pixels]", .ylabel = "share of the light", .x1 = last, .y0 = -most, .y1 = most},
        &c);
}

void rx_qa_psf_figures(rx_figures *dst, const rx_qa_numbers *q)
{
    const rx_psf *psf = q->input->psf.psf;
    if (psf == NULL || psf->judged == NULL)
        return;
    if (psf->judged->nstars > 0) {
        magnitude_figure(dst, q, false);
        magnitude_figure(dst, q, true);
        map_figure(dst, q);
    }
    if (psf->judged->nradii > 0)
        growth_figure(dst, psf->judged);
    rx_figure_add(dst, "psf-residual", "Stacked stars - PSF",
                  "grey is 0, black -2 %, white 2 % of the PSF's peak.", RX_FIGURE_PICTURE);
    rx_plot_picture(dst, &(rx_grey_image){.width = psf->judged->side,
                                          .height = psf->judged->side,
                                          .side = PICTURE_SIDE,
                                          .pixels = psf->judged->residual,
                                          .low = -0.02,
                                          .high = 0.02,
                                          .soft = 0.0});
}
