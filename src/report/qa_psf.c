/* The PSF in the QA report: what stars that it was not fitted to say of it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "data/psf.h"
#include "num/stats.h"
#include "report/ecsv.h"
#include "report/json.h"
#include "report/page.h"
#include "report/qa_writers.h"

enum { PICTURE_SIDE = 300, LEAST = 5, MOST_BINS = 12 };
static const char *const NAMES[] = {"dT/T", "de1", "de2"};
static const double WRONG = 0.01; /* of a curve of growth */

static double mag_of(const rx_report *r, const rx_psf_star *star)
{
    return star->flux > 0.0 ? r->input->psf.zeropoint - 2.5 * log10(star->flux) : NAN;
}

/* Means of bins of magnitude: of stars within `width` mag. */
typedef struct bin {
    double mag, mean[3], error[3];
    long n;
} bin;

/* Stars [n] in at most MOST_BINS ranges of magnitude, of a whole number of half magnitudes; returns how many ranges. */
static int by_magnitude(const rx_report *r, bin dst[MOST_BINS])
{
    const rx_psf_judged *judged = r->input->psf.psf->judged;
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (int i = 0; i < judged->nstars; i++) {
        low = fmin(low, mag_of(r, &judged->star[i]));
        high = fmax(high, mag_of(r, &judged->star[i]));
    }
    const double width = 0.5 * fmax(ceil(2.0 * (high - floor(low) + 1e-9) / MOST_BINS), 1.0);
    int bins = 0;
    for (int b = 0; b < MOST_BINS; b++) {
        bin *to = &dst[bins];
        double square[3] = {0};
        *to = (bin){.mag = floor(low) + (b + 0.5) * width};
        for (int i = 0; i < judged->nstars; i++)
            if (fabs(mag_of(r, &judged->star[i]) - to->mag - 1e-9) < 0.5 * width) {
                to->n++;
                for (int k = 0; k < 3; k++) {
                    to->mean[k] += judged->star[i].off[k];
                    square[k] += judged->star[i].off[k] * judged->star[i].off[k];
                }
            }
        for (int k = 0; k < 3 && to->n > 0; k++) {
            to->mean[k] /= (double)to->n;
            to->error[k] = to->n > 1 ? sqrt(fmax(square[k] / (double)to->n - to->mean[k] * to->mean[k], 0.0) /
                                            (double)(to->n - 1))
                                     : NAN;
        }
        bins += to->n > 0;
    }
    return bins;
}

/* Half of a range that holds most of the residuals. */
static double range_of(const rx_psf_judged *judged, int what)
{
    double *values = RX_NEW(double, (size_t)judged->nstars + 1), range = 0.01;
    for (int i = 0; i < judged->nstars && values != NULL; i++)
        values[i] = fabs(judged->star[i].off[what]);
    if (values != NULL && judged->nstars > 0)
        range = fmax(1.3 * rx_quantile(values, (size_t)judged->nstars, 0.95), 1e-4);
    free(values);
    return range;
}

static void magnitude_figure(rx_figures *dst, const rx_report *r, int what)
{
    const rx_psf_judged *judged = r->input->psf.psf->judged;
    const size_t n = (size_t)judged->nstars;
    double *x = RX_NEW(double, 2 * n + 1), *y = x + n, at[MOST_BINS], mean[MOST_BINS], low[MOST_BINS],
           high[MOST_BINS];
    bin bins[MOST_BINS];
    char id[16];
    if (x == NULL) {
        dst->script.failed = true;
        return;
    }
    double first = HUGE_VAL, last = -HUGE_VAL;
    for (size_t i = 0; i < n; i++) {
        x[i] = mag_of(r, &judged->star[i]);
        y[i] = judged->star[i].off[what];
        first = fmin(first, x[i]);
        last = fmax(last, x[i]);
    }
    const int nbins = by_magnitude(r, bins);
    int shown = 0;
    for (int b = 0; b < nbins; b++)
        if (bins[b].n >= LEAST) {
            at[shown] = bins[b].mag;
            mean[shown] = bins[b].mean[what];
            low[shown] = bins[b].mean[what] - bins[b].error[what];
            high[shown++] = bins[b].mean[what] + bins[b].error[what];
        }
    const double range = range_of(judged, what), ends[2] = {first - 0.3, last + 0.3}, zero[2] = {0.0, 0.0};
    const rx_curve curves[] = {
        {.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = ends, .y = zero},
        {.name = "stars", .kind = RX_CURVE_POINTS, .color = 0, .n = (long)n, .x = x, .y = y},
        {.name = "means",
         .kind = RX_CURVE_BARS,
         .color = 1,
         .n = shown,
         .x = at,
         .y = mean,
         .low = low,
         .high = high}};
    const rx_axes axes = {.xlabel = "magnitude",
                          .ylabel = NAMES[what],
                          .x0 = ends[0],
                          .x1 = ends[1],
                          .y0 = -range,
                          .y1 = range};
    snprintf(id, sizeof id, "psf-mag%d", what);
    rx_figure_add(
        dst, id, NAMES[what],
        what == 0
            ? "Reserved stars - PSF in size, against magnitude; means of 5 stars and more. A slope is a "
              "detector whose stars grow with brightness, or a sky that is wrong."
            : "The same of the ellipse.",
        RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, 3, curves);
    free(x);
}

static void map_figure(rx_figures *dst, const rx_report *r, int what)
{
    const rx_psf_judged *judged = r->input->psf.psf->judged;
    const double range = range_of(judged, what);
    char id[24], title[96];
    snprintf(id, sizeof id, "psf-map%d", what);
    snprintf(title, sizeof title, "%s over the tile", NAMES[what]);
    rx_figure_add(dst, id, title,
                  what == 0 ? "Blue: stars are smaller than the PSF; red: larger. Colours that flock are a "
                              "PSF that varies in another way than the model."
                            : "",
                  RX_FIGURE_CHART);
    rx_plot_begin(dst,
                  &(rx_axes){"X_IMAGE", "Y_IMAGE", 0, r->input->width, 0, r->input->height, false, false});
    rx_text_add(&dst->script, "$stars << EOD\n");
    for (int i = 0; i < judged->nstars; i++) {
        rx_plot_value(&dst->script, judged->star[i].x + 1.0);
        rx_plot_value(&dst->script, judged->star[i].y + 1.0);
        rx_plot_value(&dst->script, judged->star[i].off[what]);
        rx_text_add(&dst->script, "\n");
    }
    rx_text_printf(
        &dst->script,
        "nan nan nan\nEOD\nset palette defined (-1 '#2166ac', 0 '#cccccc', 1 '#b2182b')\nset cbrange "
        "[%.4g:%.4g]\n"
        "set colorbox\nset cblabel '%s'\nplot $stars using 1:2:3 with points pt 7 ps 0.9 palette notitle\n"
        "unset cblabel\nset cbrange [*:*]\nset palette gray\n",
        -range, range, NAMES[what]);
}

static void growth_figure(rx_figures *dst, const rx_report *r)
{
    const rx_psf_judged *judged = r->input->psf.psf->judged;
    const size_t n = (size_t)judged->nradii;
    double *x = RX_NEW(double, 4 * n + 1), *y = x + n, *low = y + n, *high = low + n, most = 2.0 * WRONG,
           last = 1.0;
    if (x == NULL) {
        dst->script.failed = true;
        return;
    }
    for (size_t i = 0; i < n; i++) {
        const rx_psf_growth *g = &judged->growth[i];
        x[i] = last = g->radius;
        y[i] = g->stars - g->psf;
        low[i] = y[i] - g->error;
        high[i] = y[i] + g->error;
        if (g->error < WRONG)
            most = fmax(most, 1.5 * fabs(y[i]));
    }
    const double ends[2] = {0.0, last}, up[2] = {WRONG, WRONG}, down[2] = {-WRONG, -WRONG};
    const rx_curve curves[] = {{.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = ends, .y = up},
                               {.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = ends, .y = down},
                               {.name = "stars - PSF",
                                .kind = RX_CURVE_BAND,
                                .color = 0,
                                .n = (long)n,
                                .x = x,
                                .y = y,
                                .low = low,
                                .high = high}};
    rx_figure_add(dst, "psf-growth", "Curve of growth, stars - PSF",
                  "Light within a radius, shares of a star's, out to 20 FWHM or where the sky's error is 1 "
                  "%. Beyond the dotted lines "
                  "fluxes of templates are wrong by as much.",
                  RX_FIGURE_CHART);
    rx_plot_curves(dst,
                   &(rx_axes){"radius [pixels]", "share of the light", 0, last, -most, most, false, false}, 3,
                   curves);
    free(x);
}

static bool is_judged(const rx_report *r)
{
    const rx_psf *psf = r->input->psf.psf;
    return psf != NULL && psf->judged != NULL;
}

void rx_report_psf_figures(rx_figures *dst, const rx_report *r)
{
    if (!is_judged(r))
        return;
    const rx_psf_judged *judged = r->input->psf.psf->judged;
    for (int k = 0; k < 3 && judged->nstars > 0; k++)
        magnitude_figure(dst, r, k);
    for (int k = 0; k < 3 && judged->nstars > 0; k++)
        map_figure(dst, r, k);
    if (judged->nradii > 0)
        growth_figure(dst, r);
    rx_figure_add(dst, "psf-residual", "Stacked stars - PSF",
                  "Grey is 0, black -2 %, white 2 % of the PSF's peak.", RX_FIGURE_PICTURE);
    rx_plot_picture(dst, judged->side, judged->side, judged->residual, -0.02, 0.02, 0.0, PICTURE_SIDE);
}

static void row(rx_text *dst, const char *what, double value, double error, int digits)
{
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, what);
    if (isfinite(error))
        rx_text_printf(dst, "<td>%.*f &plusmn; %.*f</td>", digits, value, digits, error);
    else
        rx_page_cell_number(dst, value, digits);
    rx_page_row_end(dst);
}

void rx_report_psf_page(rx_text *dst, const rx_report *r, const rx_figures *figures)
{
    const rx_psf *psf = r->input->psf.psf;
    if (psf == NULL)
        return;
    const rx_psf_quality *q = &psf->quality;
    rx_page_section(dst, "psf", "The PSF");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, "how it came about (RXPSFHOW)");
    rx_page_cell_text(dst, q->how);
    rx_page_row_end(dst);
    row(dst, "FWHM at the centre, pixels", psf->fwhm, psf->fwhm_error > 0.0 ? psf->fwhm_error : NAN, 3);
    if (psf->nstars > 0)
        row(dst, "stars that it was fitted to", psf->nstars, NAN, 0);
    if (rx_psf_flux_error_mean(psf) > 0.0)
        row(dst, "relative error of fluxes from it", rx_psf_flux_error_mean(psf), NAN, 4);
    if (is_judged(r)) {
        row(dst, "stars reserved to judge it", q->reserved, NAN, 0);
        row(dst, "their mean (T - T of PSF) / T", q->trace[0], q->trace[1], 5);
        row(dst, "their mean e1 - e1 of PSF", q->shape[0][0], q->shape[0][1], 5);
        row(dst, "their mean e2 - e2 of PSF", q->shape[1][0], q->shape[1][1], 5);
        row(dst, "stacked, largest difference, share of the peak", q->residual, NAN, 4);
        row(dst, "curve of growth, largest stars - PSF", q->growth, q->growth_error, 4);
        row(dst, "at this radius, pixels", q->growth_radius, NAN, 1);
    }
    rx_page_table_end(dst);
    if (is_judged(r) && fabs(q->growth) > WRONG)
        rx_page_paragraph(dst, "<b class=\"v " RX_MARK_BAD
                               "\">The curve of growth of stars differs from that of the PSF by more "
                               "than 1 %</b>: fluxes of templates may be off by as much.");
    if (is_judged(r) && psf->judged->nstars > 0) {
        bin bins[MOST_BINS];
        const int n = by_magnitude(r, bins);
        rx_page_table_begin(dst);
        rx_page_row(dst, NULL);
        rx_page_head(dst, RX_RIGHT, "magnitude");
        rx_page_head(dst, RX_RIGHT, "stars");
        for (int k = 0; k < 3; k++)
            rx_page_head(dst, RX_RIGHT, NAMES[k]);
        rx_page_row_end(dst);
        for (int b = 0; b < n; b++) {
            rx_page_row(dst, NULL);
            rx_page_cell_number(dst, bins[b].mag, 2);
            rx_page_cell_count(dst, bins[b].n);
            for (int k = 0; k < 3; k++)
                if (isfinite(bins[b].error[k]))
                    rx_text_printf(dst, "<td>%.4f &plusmn; %.4f</td>", bins[b].mean[k], bins[b].error[k]);
                else
                    rx_page_cell_number(dst, bins[b].mean[k], 4);
            rx_page_row_end(dst);
        }
        rx_page_table_end(dst);
    }
    rx_page_note(dst, "T = &lt;x&sup2;&gt; + &lt;y&sup2;&gt;, e1 = (&lt;x&sup2;&gt; &minus; &lt;y&sup2;&gt;) "
                      "/ T, e2 = 2 &lt;xy&gt; / T under a round Gaussian as "
                      "wide as the PSF. Reserved stars were never fitted. psf_stars.ecsv and psf_growth.ecsv "
                      "hold what is drawn.");
    if (is_judged(r) && figures->note[0] == '\0')
        rx_page_figures(dst, figures, "psf-");
}

void rx_report_psf_json(rx_json *json, const rx_report *r)
{
    const rx_psf *psf = r->input->psf.psf;
    if (psf == NULL)
        return;
    const rx_psf_quality *q = &psf->quality;
    rx_json_object(json, "psf", false);
    rx_json_string(json, "how", q->how);
    rx_json_string(json, "library", q->library[0] != '\0' ? q->library : NULL);
    rx_json_number(json, "fwhm", psf->fwhm);
    rx_json_number(json, "stars", psf->nstars);
    rx_json_number(json, "flux_error", rx_psf_flux_error_mean(psf) > 0.0 ? rx_psf_flux_error_mean(psf) : NAN);
    if (is_judged(r)) {
        rx_json_number(json, "reserved", q->reserved);
        rx_json_number(json, "dt", q->trace[0]);
        rx_json_number(json, "dt_error", q->trace[1]);
        rx_json_number(json, "de1", q->shape[0][0]);
        rx_json_number(json, "de1_error", q->shape[0][1]);
        rx_json_number(json, "de2", q->shape[1][0]);
        rx_json_number(json, "de2_error", q->shape[1][1]);
        rx_json_number(json, "residual", q->residual);
        rx_json_number(json, "growth", q->growth);
        rx_json_number(json, "growth_error", q->growth_error);
        rx_json_number(json, "growth_radius", q->growth_radius);
    }
    rx_json_end(json);
}

void rx_report_psf_stars(rx_text *dst, const rx_report *r)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_meta(&t, "tile", r->input->tile);
    rx_ecsv_column(&t, "x", RX_ECSV_FLOAT, "pix", "reserved star, first pixel is 1");
    rx_ecsv_column(&t, "y", RX_ECSV_FLOAT, "pix", "first pixel is 1");
    rx_ecsv_column(&t, "mag", RX_ECSV_FLOAT, "mag", "by the PSF");
    rx_ecsv_column(&t, "dt", RX_ECSV_FLOAT, "", "(T - T of PSF) / T");
    rx_ecsv_column(&t, "de1", RX_ECSV_FLOAT, "", "e1 - e1 of PSF");
    rx_ecsv_column(&t, "de2", RX_ECSV_FLOAT, "", "e2 - e2 of PSF");
    rx_ecsv_column(&t, "error", RX_ECSV_FLOAT, "", "1 sigma of each from the pixels' noise");
    rx_ecsv_columns_end(&t);
    for (int i = 0; is_judged(r) && i < r->input->psf.psf->judged->nstars; i++) {
        const rx_psf_star *s = &r->input->psf.psf->judged->star[i];
        const double values[] = {s->x + 1.0, s->y + 1.0, mag_of(r, s), s->off[0],
                                 s->off[1],  s->off[2],  s->error};
        for (size_t k = 0; k < sizeof values / sizeof *values; k++)
            rx_ecsv_number(&t, values[k]);
        rx_ecsv_row_end(&t);
    }
}

void rx_report_psf_growth(rx_text *dst, const rx_report *r)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_meta(&t, "tile", r->input->tile);
    rx_ecsv_column(&t, "radius", RX_ECSV_FLOAT, "pix", "light within");
    rx_ecsv_column(&t, "stars", RX_ECSV_FLOAT, "", "share of a star's");
    rx_ecsv_column(&t, "psf", RX_ECSV_FLOAT, "", "of the PSF");
    rx_ecsv_column(&t, "error", RX_ECSV_FLOAT, "", "1 sigma of the difference");
    rx_ecsv_columns_end(&t);
    for (int i = 0; is_judged(r) && i < r->input->psf.psf->judged->nradii; i++) {
        const rx_psf_growth *g = &r->input->psf.psf->judged->growth[i];
        rx_ecsv_number(&t, g->radius);
        rx_ecsv_number(&t, g->stars);
        rx_ecsv_number(&t, g->psf);
        rx_ecsv_number(&t, g->error);
        rx_ecsv_row_end(&t);
    }
}
