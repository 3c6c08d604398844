/* The page of a survey, and its figures. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "survey/rollup_report.h"
#include "validate/escape.h"
#include "validate/page.h"

enum { ROWS_SHOWN = 200, FEW = 5 };

/* --- figures --- */

/* Of a bin what is drawn: 0 recall, 1 precision, 2 bias. */
static rx_estimate drawn(const rx_rollup_cell *cell, int what)
{
    if (what == 2) {
        const double error = cell->pairs > 0 ? 1.2533 * cell->scatter / sqrt((double)cell->pairs) : NAN;
        return (rx_estimate){cell->bias, cell->bias - error, cell->bias + error, cell->pairs};
    }
    return what == 0 ? cell->recall : cell->precision;
}

static void by_magnitude(rx_figures *dst, const rx_rollup *r, int what, const rx_axes *axes)
{
    double *data = RX_NEW(double, 4 * (size_t)RX_TALLY_BINS * (size_t)r->nruns);
    rx_curve *curves = RX_NEW(rx_curve, (size_t)r->nruns);
    for (int i = 0; i < r->nruns && data != NULL && curves != NULL; i++) {
        double *x = data + 4 * (size_t)RX_TALLY_BINS * (size_t)i, *y = x + RX_TALLY_BINS,
               *low = y + RX_TALLY_BINS, *high = low + RX_TALLY_BINS;
        long n = 0;
        for (int b = r->run[i].first; b <= r->run[i].last; b++) {
            const rx_estimate e = drawn(&r->run[i].bin[b], what);
            if (e.n < FEW)
                continue;
            x[n] = 0.5 * (b + RX_TALLY_LOW) + 0.25 + 0.03 * (i - 0.5 * (r->nruns - 1));
            y[n] = e.value;
            low[n] = e.low;
            high[n++] = e.high;
        }
        curves[i] = (rx_curve){.name = r->run[i].name,
                               .kind = RX_CURVE_BARS,
                               .color = rx_method_color(r->run[i].name),
                               .n = n,
                               .x = x,
                               .y = y,
                               .low = low,
                               .high = high};
    }
    if (data == NULL || curves == NULL)
        dst->script.failed = true;
    else
        rx_plot_curves(dst, axes, r->nruns, curves);
    free(curves);
    free(data);
}

/* Correlation of the PSFs' residuals by angle. */
static void rho_figure(rx_figures *dst, const rx_rollup *r)
{
    double x[RX_RHO_BINS], y[2][RX_RHO_BINS], low[2][RX_RHO_BINS], high[2][RX_RHO_BINS];
    double most = 1e-6, first = HUGE_VAL, last = 0.0;
    int n = 0;
    for (int k = 0; k < RX_RHO_BINS; k++) {
        const rx_rho_bin *b = &r->rho[k];
        if (!(b->pairs > 0.0) || !isfinite(b->e_error) || !isfinite(b->t_error))
            continue;
        const double value[2] = {b->e, b->t}, error[2] = {b->e_error, b->t_error};
        first = fmin(first, rx_rho_edge(k));
        last = fmax(last, rx_rho_edge(k + 1));
        x[n] = sqrt(rx_rho_edge(k) * rx_rho_edge(k + 1));
        for (int q = 0; q < 2; q++) {
            y[q][n] = value[q];
            low[q][n] = value[q] - error[q];
            high[q][n] = value[q] + error[q];
            most = fmax(most, 1.1 * fmax(fabs(low[q][n]), fabs(high[q][n])));
        }
        n++;
    }
    if (n == 0)
        return;
    const double zero[2] = {0.0, 0.0}, ends[2] = {first, last};
    const rx_curve curves[] = {{.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = ends, .y = zero},
                               {.name = "rho1, of e",
                                .kind = RX_CURVE_BARS,
                                .color = 0,
                                .n = n,
                                .x = x,
                                .y = y[0],
                                .low = low[0],
                                .high = high[0]},
                               {.name = "of T",
                                .kind = RX_CURVE_BARS,
                                .color = 1,
                                .n = n,
                                .x = x,
                                .y = y[1],
                                .low = low[1],
                                .high = high[1]}};
    const rx_axes axes = {.xlabel = "angle between stars [arcmin]",
                          .ylabel = "mean product of residuals",
                          .x0 = first,
                          .x1 = last,
                          .y0 = -most,
                          .y1 = most,
                          .log_x = true};
    rx_figure_add(dst, "psf-rho", "Correlation of PSF residuals",
                  "Stars - PSF of pairs of reserved stars; bars are 1 sigma.", RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, 3, curves);
}

void rx_rollup_figures(rx_figures *dst, const rx_rollup *r)
{
    double first = HUGE_VAL, last = -HUGE_VAL, widest = 0.02;
    for (int i = 0; i < r->nruns; i++)
        for (int b = r->run[i].first; b <= r->run[i].last; b++) {
            const rx_rollup_cell *cell = &r->run[i].bin[b];
            if (cell->recall.n < FEW && cell->precision.n < FEW)
                continue;
            first = fmin(first, 0.5 * (b + RX_TALLY_LOW));
            last = fmax(last, 0.5 * (b + 1 + RX_TALLY_LOW));
            if (isfinite(cell->bias) && cell->pairs >= FEW)
                widest = fmax(widest, 1.2 * fabs(cell->bias));
        }
    rx_figures_begin(dst);
    rho_figure(dst, r);
    if (!(last > first))
        return;
    rx_axes axes = {.xlabel = "magnitude of the reference",
                    .ylabel = "recall",
                    .x0 = first,
                    .x1 = last,
                    .y0 = 0,
                    .y1 = 1.02};
    rx_figure_add(dst, "all-recall", "Completeness", "All tiles together; bars are 95 % intervals.",
                  RX_FIGURE_CHART);
    by_magnitude(dst, r, 0, &axes);
    axes.xlabel = "measured magnitude";
    axes.ylabel = "precision";
    rx_figure_add(dst, "all-precision", "Purity", "All tiles together; bars are 95 % intervals.",
                  RX_FIGURE_CHART);
    by_magnitude(dst, r, 1, &axes);
    axes.xlabel = "magnitude of the reference";
    axes.ylabel = "median of m - m0 [mag]";
    axes.y0 = -widest;
    axes.y1 = widest;
    rx_figure_add(dst, "all-bias", "Magnitude errors", "Medians over all tiles with their errors.",
                  RX_FIGURE_CHART);
    by_magnitude(dst, r, 2, &axes);
    rx_rollup_sky(dst, r);
}

/* --- the page --- */

static void cell_heads(rx_text *dst)
{
    rx_page_head(dst, RX_RIGHT, "recall");
    rx_page_head(dst, RX_RIGHT, "precision");
    rx_page_head(dst, RX_RIGHT, "bias [mag]");
    rx_page_head(dst, RX_RIGHT, "scatter [mag]");
    rx_page_head(dst, RX_RIGHT, "pairs");
}

static void cells(rx_text *dst, const rx_rollup_cell *cell)
{
    rx_page_cell_estimate(dst, &cell->recall, 3);
    rx_page_cell_estimate(dst, &cell->precision, 3);
    rx_page_cell_number(dst, cell->pairs > 0 ? cell->bias : NAN, 4);
    rx_page_cell_number(dst, cell->pairs > 0 ? cell->scatter : NAN, 4);
    rx_page_cell_count(dst, cell->pairs);
}

static void overview(rx_text *dst, const rx_rollup *r)
{
    rx_page_section(dst, "overview", "Overview");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_RIGHT, "tiles");
    rx_page_head(dst, RX_RIGHT, "fine");
    rx_page_head(dst, RX_RIGHT, "failed");
    rx_page_head(dst, RX_RIGHT, "without a record");
    rx_page_head(dst, RX_RIGHT, "a gate failed");
    rx_page_head(dst, RX_RIGHT, "a gate undecided");
    rx_page_row_end(dst);
    rx_page_row(dst, NULL);
    rx_page_cell_count(dst, r->ntiles + r->nmissing);
    rx_page_cell_count(dst, r->fine);
    rx_page_cell_count(dst, r->failed);
    rx_page_cell_count(dst, r->nmissing);
    rx_page_cell_count(dst, r->gates);
    rx_page_cell_count(dst, r->undecided);
    rx_page_row_end(dst);
    rx_page_table_end(dst);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "restorer");
    rx_page_head(dst, RX_RIGHT, "images");
    rx_page_head(dst, RX_RIGHT, "by another restorer");
    rx_page_head(dst, RX_RIGHT, "not made for");
    rx_page_head(dst, RX_RIGHT, "flux scale off");
    rx_page_head(dst, RX_RIGHT, "threshold raised");
    rx_page_head(dst, RX_RIGHT, "not explained");
    rx_page_head(dst, RX_RIGHT, "sources");
    cell_heads(dst);
    rx_page_row_end(dst);
    for (int i = 0; i < r->nruns; i++) {
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, r->run[i].name);
        rx_page_cell_count(dst, r->run[i].tiles);
        rx_page_cell_count(dst, r->run[i].by_others);
        rx_page_cell_count(dst, r->run[i].outside);
        rx_page_cell_count(dst, r->run[i].flux_off);
        rx_page_cell_count(dst, r->run[i].raised);
        rx_page_cell_count(dst, r->run[i].unexplained);
        rx_page_cell_count(dst, r->run[i].sources);
        cells(dst, &r->run[i].whole);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    if (r->mag_low < r->mag_high) {
        rx_text note = {0};
        rx_text_printf(&note, "Recall, precision and errors of magnitudes %g to %g (MAG_RANGE).", r->mag_low,
                       r->mag_high);
        dst->failed |= note.failed;
        rx_page_note(dst, note.data);
        rx_text_free(&note);
    }
}

/* What a table of the page leaves out, and where it is. */
static void say_rest(rx_text *dst, int shown, int all, const char *where)
{
    rx_text note = {0};
    if (shown == all)
        return;
    rx_text_printf(&note, "%d of %d rows. %s", shown, all, where);
    dst->failed |= note.failed;
    if (!note.failed)
        rx_page_note(dst, note.data);
    rx_text_free(&note);
}

static void failures(rx_text *dst, const rx_rollup *r)
{
    rx_page_section(dst, "failures", "Tiles that are not fine");
    if (r->fine == r->ntiles && r->nmissing == 0) {
        rx_page_paragraph(dst, "None.");
        return;
    }
    const int all = r->ntiles - r->fine + r->nmissing;
    int shown = 0;
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "image");
    rx_page_head(dst, RX_RIGHT, "exit status");
    rx_page_head(dst, RX_LEFT, "why");
    rx_page_row_end(dst);
    for (int i = 0; i < r->ntiles && shown < ROWS_SHOWN; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        if (tile->status == RX_OK)
            continue;
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, tile->image);
        rx_page_cell_count(dst, tile->status);
        rx_page_cell_text(dst, tile->what);
        rx_page_row_end(dst);
        shown++;
    }
    for (int i = 0; i < r->nmissing && shown < ROWS_SHOWN; i++, shown++) {
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, rx_tiles_image(r->tiles, r->missing[i]));
        rx_page_cell_text(dst, "");
        rx_page_cell_text(dst, "no record: it was not run, or was killed");
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    say_rest(dst, shown, all, "All are in junit.xml, and in summary.json as not_fine and missing.");
}

/* Images whose PSF is not from several stars of their own, and residuals over the survey. */
static void psfs(rx_text *dst, const rx_rollup *r, const rx_figures *figures)
{
    int shown = 0;
    rx_text line = {0};
    if (r->npsfs == 0)
        return;
    rx_page_section(dst, "psfs", "PSFs");
    rx_text_printf(&line,
                   "%d of %d images have a PSF that is not from several stars of their own (RXPSFHOW).",
                   r->lower, r->npsfs);
    dst->failed |= line.failed;
    rx_page_paragraph(dst, line.data);
    rx_text_free(&line);
    if (r->lower > 0) {
        rx_page_table_begin(dst);
        rx_page_row(dst, NULL);
        rx_page_head(dst, RX_LEFT, "tile");
        rx_page_head(dst, RX_RIGHT, "HDU");
        rx_page_head(dst, RX_LEFT, "PSF");
        rx_page_head(dst, RX_LEFT, "of PSF_LIBRARY");
        rx_page_head(dst, RX_RIGHT, "error of fluxes");
        rx_page_row_end(dst);
        for (int i = 0; i < r->npsfs && shown < ROWS_SHOWN; i++) {
            const rx_psf_account *p = &r->psf[i].psf;
            if (!rx_psf_account_is_lower(p))
                continue;
            rx_page_row(dst, NULL);
            rx_page_cell_text(dst, r->psf[i].tile->name);
            rx_page_cell_count(dst, r->psf[i].hdu);
            rx_page_cell_text(dst, p->how);
            rx_page_cell_text(dst, p->library);
            rx_page_cell_number(dst, p->flux_error > 0.0 ? p->flux_error : NAN, 4);
            rx_page_row_end(dst);
            shown++;
        }
        rx_page_table_end(dst);
        say_rest(dst, shown, r->lower, "All are in psfs.ecsv.");
    }
    if (figures->note[0] == '\0')
        rx_page_figures(dst, figures, "psf-");
    rx_page_note(
        dst,
        "Residuals of stars that no PSF was fitted to, correlated between pairs: &rho;<sub>1</sub> = "
        "&lt;Re(&delta;e &delta;e*)&gt;, &rho;<sub>T</sub> the same of &delta;T/T; of pairs in "
        "one image, and of pairs of images that do not overlap. Errors are from image to image. What is not "
        "0 within them, the PSFs miss alike over that angle. Numbers: psf_rho.ecsv.");
}

/* "RL: FWHM 1.50 pixels is below 2", or what the restorer itself was not made for, or nothing. */
static void done_by(rx_text *dst, const rx_rollup_row *row)
{
    rx_text cell = {0};
    if (row->by[0] != '\0')
        rx_text_printf(&cell, "%s: %s", row->by, row->why);
    else if (row->outside != NULL)
        rx_text_printf(&cell, "itself, not made for: %s", row->outside);
    dst->failed |= cell.failed;
    rx_page_cell_text(dst, cell.data);
    rx_text_free(&cell);
}

static void worst_first(rx_text *dst, const rx_rollup *r)
{
    rx_page_section(dst, "tiles", "Tiles, worst first");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "tile");
    rx_page_head(dst, RX_RIGHT, "HDU");
    rx_page_head(dst, RX_LEFT, "restorer");
    rx_page_head(dst, RX_LEFT, "done by");
    rx_page_head(dst, RX_LEFT, "gates");
    rx_page_head(dst, RX_RIGHT, "off");
    rx_page_head(dst, RX_LEFT, "in");
    cell_heads(dst);
    rx_page_head(dst, RX_RIGHT, "FWHM [pix]");
    rx_page_head(dst, RX_RIGHT, "noise [ADU]");
    rx_page_head(dst, RX_RIGHT, "sources");
    rx_page_row_end(dst);
    for (int i = 0; i < r->nrows && i < ROWS_SHOWN; i++) {
        const rx_rollup_row *row = &r->row[i];
        const char *verdict = rx_verdict_name(row->verdict);
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, row->tile->name);
        rx_page_cell_count(dst, row->hdu);
        rx_page_cell_text(dst, r->run[row->run].name);
        done_by(dst, row);
        if (row->verdict == RX_VERDICT_NONE)
            rx_page_cell_text(dst, "");
        else
            rx_page_cell_verdict(dst, verdict, verdict);
        rx_page_cell_number(dst, row->off, 1);
        rx_page_cell_text(dst, row->what);
        cells(dst, &row->cell);
        rx_page_cell_number(dst, row->fwhm, 2);
        rx_page_cell_number(dst, row->noise, 3);
        rx_page_cell_count(dst, row->sources);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    rx_page_note(
        dst,
        "Tiles whose gates fail come first. off: by how many of its own errors a tile lies below the "
        "survey in recall or precision, or beside it in bias, whichever is worst; differences of seeing "
        "and depth count as well. A flux scale that is off (restored against untouched pixels, more than "
        "1 % and 5 errors) counts by its errors from 1, with or without a reference.");
    say_rest(dst, r->nrows < ROWS_SHOWN ? r->nrows : ROWS_SHOWN, r->nrows, "All are in tiles.ecsv.");
}

static int is_compared(const rx_figures *figures)
{
    for (int i = 0; i < figures->n; i++)
        if (strncmp(figures->figure[i].id, "all-", 4) == 0)
            return 1;
    return 0;
}

void rx_rollup_html(rx_text *dst, const rx_rollup *r, const rx_figures *figures)
{
    rx_page_begin(dst, "Survey: ", "all tiles");
    rx_page_links_begin(dst);
    rx_page_link(dst, 1, "overview", "Overview");
    rx_page_link(dst, 1, "failures", "Not fine");
    rx_page_link(dst, r->npsfs > 0, "psfs", "PSFs");
    rx_page_link(dst, 1, "figures", "Figures");
    rx_page_link(dst, 1, "tiles", "Tiles");
    rx_page_links_end(dst);
    overview(dst, r);
    failures(dst, r);
    psfs(dst, r, figures);
    rx_page_section(dst, "figures", "Figures");
    if (!is_compared(figures) && figures->note[0] == '\0')
        rx_page_paragraph(dst, "No tile was compared with a reference catalogue.");
    else
        rx_page_figures(dst, figures, "all-");
    worst_first(dst, r);
    rx_page_end(dst);
}
