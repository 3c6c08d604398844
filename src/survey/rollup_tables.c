/* The roll-up for programs: JSON, ECSV, JUnit. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "survey/rollup_report.h"
#include "validate/ecsv.h"
#include "validate/escape.h"
#include "validate/json.h"

static const char *verdict_name(const rx_rollup_row *row)
{
    return rx_verdict_name(row->verdict);
}

static const char *done_by(const rx_rollup *r, const rx_rollup_row *row)
{
    return row->by[0] != '\0' ? row->by : r->run[row->run].name;
}

static const char *flux_word(const rx_rollup_row *row)
{
    return row->flux.n == 0 ? "" : rx_fluxcheck_is_off(&row->flux) ? "off" : "right";
}

static void json_cell(rx_json *j, const rx_rollup_cell *cell)
{
    rx_json_estimate(j, "recall", &cell->recall);
    rx_json_estimate(j, "precision", &cell->precision);
    rx_json_count(j, "pairs", (uint64_t)cell->pairs);
    rx_json_number(j, "bias_mag", cell->bias);
    rx_json_number(j, "scatter_mag", cell->scatter);
}

static void json_run(rx_json *j, const rx_rollup_run *run)
{
    rx_json_object(j, NULL, false);
    rx_json_string(j, "name", run->name);
    rx_json_count(j, "images", (uint64_t)run->tiles);
    rx_json_count(j, "done_by_another", (uint64_t)run->by_others);
    rx_json_count(j, "outside", (uint64_t)run->outside);
    rx_json_count(j, "flux_scale_off", (uint64_t)run->flux_off);
    rx_json_count(j, "threshold_raised", (uint64_t)run->raised);
    rx_json_count(j, "not_explained", (uint64_t)run->unexplained);
    rx_json_count(j, "sources", (uint64_t)run->sources);
    json_cell(j, &run->whole);
    rx_json_array(j, "bins", false);
    for (int b = run->first; b <= run->last; b++) {
        rx_json_object(j, NULL, true);
        rx_json_number(j, "mag_low", 0.5 * (b + RX_TALLY_LOW));
        rx_json_number(j, "mag_high", 0.5 * (b + 1 + RX_TALLY_LOW));
        json_cell(j, &run->bin[b]);
        rx_json_end(j);
    }
    rx_json_end(j);
    rx_json_end(j);
}

static void json_row(rx_json *j, const rx_rollup *r, const rx_rollup_row *row)
{
    rx_json_object(j, NULL, true);
    rx_json_string(j, "tile", row->tile->name);
    rx_json_string(j, "image", row->tile->image);
    rx_json_number(j, "hdu", row->hdu);
    rx_json_string(j, "run", r->run[row->run].name);
    rx_json_string(j, "done_by", done_by(r, row));
    rx_json_string(j, "why", row->why);
    rx_json_string(j, "outside", row->outside);
    rx_json_number(j, "flux_scale", row->flux.n > 0 ? row->flux.wide : NAN);
    rx_json_number(j, "flux_scale_error", row->flux.n > 0 ? row->flux.wide_error : NAN);
    rx_json_string(j, "flux_scale_is", flux_word(row));
    rx_json_number(j, "false_per_mpixel", row->guard.known ? row->guard.false_per_mpixel : NAN);
    rx_json_number(j, "threshold_raised", row->guard.known ? row->guard.raised : NAN);
    rx_json_number(j, "not_explained", row->guard.known ? row->guard.unexplained : NAN);
    rx_json_number(j, "off", row->off);
    rx_json_string(j, "worst_in", row->what);
    rx_json_string(j, "verdict", verdict_name(row));
    rx_json_number(j, "alpha_j2000", row->alpha);
    rx_json_number(j, "delta_j2000", row->delta);
    rx_json_number(j, "fwhm", row->fwhm);
    rx_json_number(j, "sky", row->sky);
    rx_json_number(j, "noise", row->noise);
    rx_json_count(j, "sources", (uint64_t)row->sources);
    if (row->compared)
        json_cell(j, &row->cell);
    rx_json_end(j);
}

static void json_psfs(rx_json *j, const rx_rollup *r)
{
    rx_json_count(j, "psf_not_from_stars", (uint64_t)r->lower);
    rx_json_array(j, "psfs", false);
    for (int i = 0; i < r->npsfs; i++) {
        const rx_psf_account *p = &r->psf[i].psf;
        rx_json_object(j, NULL, true);
        rx_json_string(j, "tile", r->psf[i].tile->name);
        rx_json_number(j, "hdu", r->psf[i].hdu);
        rx_json_string(j, "how", p->how);
        rx_json_string(j, "library", p->library[0] != '\0' ? p->library : NULL);
        rx_json_count(j, "stars", (uint64_t)p->stars);
        rx_json_count(j, "reserved", (uint64_t)p->reserved);
        rx_json_number(j, "flux_error", p->flux_error);
        rx_json_number(j, "growth", p->growth);
        rx_json_number(j, "residual", p->residual);
        rx_json_number(j, "dt", p->reserved > 0 ? p->off[0] : NAN);
        rx_json_number(j, "de1", p->reserved > 0 ? p->off[1] : NAN);
        rx_json_number(j, "de2", p->reserved > 0 ? p->off[2] : NAN);
        rx_json_end(j);
    }
    rx_json_end(j);
    rx_json_array(j, "psf_rho", false);
    for (int k = 0; k < RX_RHO_BINS; k++) {
        rx_json_object(j, NULL, true);
        rx_json_number(j, "arcmin_low", rx_rho_edge(k));
        rx_json_number(j, "arcmin_high", rx_rho_edge(k + 1));
        rx_json_number(j, "pairs", r->rho[k].pairs);
        rx_json_number(j, "rho1", r->rho[k].e);
        rx_json_number(j, "rho1_error", r->rho[k].e_error);
        rx_json_number(j, "rho_t", r->rho[k].t);
        rx_json_number(j, "rho_t_error", r->rho[k].t_error);
        rx_json_end(j);
    }
    rx_json_end(j);
}

void rx_rollup_json(rx_text *dst, const rx_rollup *r)
{
    rx_json j = rx_json_on(dst);
    rx_json_object(&j, NULL, false);
    rx_json_string(&j, "format", "rextract survey 1");
    rx_json_number(&j, "mag_low", r->mag_low < r->mag_high ? r->mag_low : NAN);
    rx_json_number(&j, "mag_high", r->mag_low < r->mag_high ? r->mag_high : NAN);
    rx_json_count(&j, "tiles", (uint64_t)(r->ntiles + r->nmissing));
    rx_json_count(&j, "fine", (uint64_t)r->fine);
    rx_json_count(&j, "failed", (uint64_t)r->failed);
    rx_json_count(&j, "without_record", (uint64_t)r->nmissing);
    rx_json_count(&j, "gate_failed", (uint64_t)r->gates);
    rx_json_count(&j, "gate_undecided", (uint64_t)r->undecided);
    rx_json_array(&j, "runs", false);
    for (int i = 0; i < r->nruns; i++)
        json_run(&j, &r->run[i]);
    rx_json_end(&j);
    json_psfs(&j, r);
    rx_json_array(&j, "not_fine", false);
    for (int i = 0; i < r->ntiles; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        if (tile->status == RX_OK)
            continue;
        rx_json_object(&j, NULL, true);
        rx_json_string(&j, "tile", tile->name);
        rx_json_string(&j, "image", tile->image);
        rx_json_number(&j, "exit_status", tile->status);
        rx_json_string(&j, "error", tile->what);
        rx_json_end(&j);
    }
    rx_json_end(&j);
    rx_json_array(&j, "missing", false);
    for (int i = 0; i < r->nmissing; i++)
        rx_json_string(&j, NULL, rx_tiles_image(r->tiles, r->missing[i]));
    rx_json_end(&j);
    rx_json_array(&j, "images", false);
    for (int i = 0; i < r->nrows; i++)
        json_row(&j, r, &r->row[i]);
    rx_json_end(&j);
    rx_json_end(&j);
}

static void cell_columns(rx_ecsv *t)
{
    rx_ecsv_estimate_columns(t, "recall", "", "share of references found");
    rx_ecsv_estimate_columns(t, "precision", "", "share of detections that are references");
    rx_ecsv_column(t, "pairs", RX_ECSV_LONG, "", "matches with both magnitudes");
    rx_ecsv_column(t, "bias_mag", RX_ECSV_FLOAT, "mag", "median of m - m0");
    rx_ecsv_column(t, "scatter_mag", RX_ECSV_FLOAT, "mag", "sigma_MAD of m - m0");
}

static void cell_values(rx_ecsv *t, const rx_rollup_cell *cell)
{
    rx_ecsv_estimate(t, &cell->recall);
    rx_ecsv_estimate(t, &cell->precision);
    rx_ecsv_count(t, cell->pairs);
    rx_ecsv_number(t, cell->bias);
    rx_ecsv_number(t, cell->scatter);
}

void rx_rollup_tiles(rx_text *dst, const rx_rollup *r)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_column(&t, "tile", RX_ECSV_TEXT, "", "name");
    rx_ecsv_column(&t, "image", RX_ECSV_TEXT, "", "file");
    rx_ecsv_column(&t, "hdu", RX_ECSV_INT, "", "its HDU");
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "done_by", RX_ECSV_TEXT, "", "restorer that did it");
    rx_ecsv_column(&t, "why", RX_ECSV_TEXT, "", "why another one did it");
    rx_ecsv_column(&t, "outside", RX_ECSV_TEXT, "", "what of it the restorer was not made for");
    rx_ecsv_column(&t, "flux_scale", RX_ECSV_FLOAT, "", "restored over untouched flux of isolated sources");
    rx_ecsv_column(&t, "flux_scale_error", RX_ECSV_FLOAT, "", "1 sigma");
    rx_ecsv_column(&t, "flux_scale_is", RX_ECSV_TEXT, "", "right or off, by that and by FLUX_AUTO");
    rx_ecsv_column(&t, "false_per_mpixel", RX_ECSV_FLOAT, "", "false detections on the tile's noise");
    rx_ecsv_column(&t, "threshold_raised", RX_ECSV_FLOAT, "",
                   "DETECT_THRESH was multiplied by this for them");
    rx_ecsv_column(&t, "not_explained", RX_ECSV_FLOAT, "",
                   "share of cells that the restored image does not explain");
    rx_ecsv_column(&t, "off", RX_ECSV_FLOAT, "", "errors that it lies off the survey in what is worst");
    rx_ecsv_column(&t, "worst_in", RX_ECSV_TEXT, "", "what that is");
    rx_ecsv_column(&t, "verdict", RX_ECSV_TEXT, "", "of the gates");
    rx_ecsv_column(&t, "alpha_j2000", RX_ECSV_FLOAT, "deg", "of the centre");
    rx_ecsv_column(&t, "delta_j2000", RX_ECSV_FLOAT, "deg", "of the centre");
    rx_ecsv_column(&t, "fwhm", RX_ECSV_FLOAT, "pix", "of the PSF");
    rx_ecsv_column(&t, "sky", RX_ECSV_FLOAT, "adu", "level");
    rx_ecsv_column(&t, "noise", RX_ECSV_FLOAT, "adu", "of a pixel");
    rx_ecsv_column(&t, "sources", RX_ECSV_LONG, "", "in the catalogue");
    cell_columns(&t);
    rx_ecsv_columns_end(&t);
    for (int i = 0; i < r->nrows; i++) {
        const rx_rollup_row *row = &r->row[i];
        rx_ecsv_text(&t, row->tile->name);
        rx_ecsv_text(&t, row->tile->image);
        rx_ecsv_count(&t, row->hdu);
        rx_ecsv_text(&t, r->run[row->run].name);
        rx_ecsv_text(&t, done_by(r, row));
        rx_ecsv_text(&t, row->why != NULL ? row->why : "");
        rx_ecsv_text(&t, row->outside != NULL ? row->outside : "");
        rx_ecsv_number(&t, row->flux.n > 0 ? row->flux.wide : NAN);
        rx_ecsv_number(&t, row->flux.n > 0 ? row->flux.wide_error : NAN);
        rx_ecsv_text(&t, flux_word(row));
        rx_ecsv_number(&t, row->guard.known ? row->guard.false_per_mpixel : NAN);
        rx_ecsv_number(&t, row->guard.known ? row->guard.raised : NAN);
        rx_ecsv_number(&t, row->guard.known ? row->guard.unexplained : NAN);
        rx_ecsv_number(&t, row->off);
        rx_ecsv_text(&t, row->what);
        rx_ecsv_text(&t, verdict_name(row));
        rx_ecsv_number(&t, row->alpha);
        rx_ecsv_number(&t, row->delta);
        rx_ecsv_number(&t, row->fwhm);
        rx_ecsv_number(&t, row->sky);
        rx_ecsv_number(&t, row->noise);
        rx_ecsv_count(&t, row->sources);
        cell_values(&t, &row->cell);
        rx_ecsv_row_end(&t);
    }
}

void rx_rollup_bins(rx_text *dst, const rx_rollup *r)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "mag_low", RX_ECSV_FLOAT, "mag", "from");
    rx_ecsv_column(&t, "mag_high", RX_ECSV_FLOAT, "mag", "below");
    cell_columns(&t);
    rx_ecsv_columns_end(&t);
    for (int i = 0; i < r->nruns; i++)
        for (int b = r->run[i].first; b <= r->run[i].last; b++) {
            rx_ecsv_text(&t, r->run[i].name);
            rx_ecsv_number(&t, 0.5 * (b + RX_TALLY_LOW));
            rx_ecsv_number(&t, 0.5 * (b + 1 + RX_TALLY_LOW));
            cell_values(&t, &r->run[i].bin[b]);
            rx_ecsv_row_end(&t);
        }
}

void rx_rollup_psfs(rx_text *dst, const rx_rollup *r)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_column(&t, "tile", RX_ECSV_TEXT, "", "name");
    rx_ecsv_column(&t, "hdu", RX_ECSV_INT, "", "its HDU");
    rx_ecsv_column(&t, "how", RX_ECSV_TEXT, "", "how its PSF came about (RXPSFHOW)");
    rx_ecsv_column(&t, "library", RX_ECSV_TEXT, "", "file of PSF_LIBRARY");
    rx_ecsv_column(&t, "stars", RX_ECSV_INT, "", "that it was fitted to");
    rx_ecsv_column(&t, "reserved", RX_ECSV_INT, "", "stars that were not fitted, for what follows");
    rx_ecsv_column(&t, "flux_error", RX_ECSV_FLOAT, "", "relative error of fluxes from the PSF");
    rx_ecsv_column(&t, "growth", RX_ECSV_FLOAT, "", "curve of growth, largest stars - PSF");
    rx_ecsv_column(&t, "residual", RX_ECSV_FLOAT, "", "stacked stars - PSF, largest, share of the peak");
    rx_ecsv_column(&t, "dt", RX_ECSV_FLOAT, "", "mean (T - T of PSF) / T");
    rx_ecsv_column(&t, "dt_error", RX_ECSV_FLOAT, "", "1 sigma");
    rx_ecsv_column(&t, "de1", RX_ECSV_FLOAT, "", "mean e1 - e1 of PSF, along the tile's pixels");
    rx_ecsv_column(&t, "de1_error", RX_ECSV_FLOAT, "", "1 sigma");
    rx_ecsv_column(&t, "de2", RX_ECSV_FLOAT, "", "mean e2 - e2 of PSF");
    rx_ecsv_column(&t, "de2_error", RX_ECSV_FLOAT, "", "1 sigma");
    rx_ecsv_columns_end(&t);
    for (int i = 0; i < r->npsfs; i++) {
        const rx_psf_account *p = &r->psf[i].psf;
        rx_ecsv_text(&t, r->psf[i].tile->name);
        rx_ecsv_count(&t, r->psf[i].hdu);
        rx_ecsv_text(&t, p->how);
        rx_ecsv_text(&t, p->library);
        rx_ecsv_count(&t, p->stars);
        rx_ecsv_count(&t, p->reserved);
        rx_ecsv_number(&t, p->flux_error);
        rx_ecsv_number(&t, p->growth);
        rx_ecsv_number(&t, p->residual);
        for (int k = 0; k < 3; k++) {
            rx_ecsv_number(&t, p->reserved > 0 ? p->off[k] : NAN);
            rx_ecsv_number(&t, p->reserved > 0 ? p->error[k] : NAN);
        }
        rx_ecsv_row_end(&t);
    }
}

void rx_rollup_rho(rx_text *dst, const rx_rollup *r)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_column(&t, "arcmin_low", RX_ECSV_FLOAT, "arcmin", "between two stars, from");
    rx_ecsv_column(&t, "arcmin_high", RX_ECSV_FLOAT, "arcmin", "below");
    rx_ecsv_column(&t, "pairs", RX_ECSV_FLOAT, "", "of reserved stars");
    rx_ecsv_column(&t, "rho1", RX_ECSV_FLOAT, "", "mean of Re(de conj(de))");
    rx_ecsv_column(&t, "rho1_error", RX_ECSV_FLOAT, "", "1 sigma");
    rx_ecsv_column(&t, "rho_t", RX_ECSV_FLOAT, "", "mean of the product of both dT/T");
    rx_ecsv_column(&t, "rho_t_error", RX_ECSV_FLOAT, "", "1 sigma");
    rx_ecsv_columns_end(&t);
    for (int k = 0; k < RX_RHO_BINS; k++) {
        const double values[] = {rx_rho_edge(k),    rx_rho_edge(k + 1), r->rho[k].pairs,  r->rho[k].e,
                                 r->rho[k].e_error, r->rho[k].t,        r->rho[k].t_error};
        for (size_t i = 0; i < sizeof values / sizeof *values; i++)
            rx_ecsv_number(&t, values[i]);
        rx_ecsv_row_end(&t);
    }
}

/* kind: element of what is wrong, or NULL; notes: lines to read all the same, or NULL. */
static void junit_case(rx_text *dst, const char *image, const char *kind, const char *what, const char *notes)
{
    rx_text_add(dst, "  <testcase classname=\"rextract\" name=\"");
    rx_escape_html(dst, image);
    if (kind == NULL && notes == NULL) {
        rx_text_add(dst, "\"/>\n");
        return;
    }
    rx_text_add(dst, "\">");
    if (kind != NULL) {
        rx_text_printf(dst, "<%s message=\"", kind);
        rx_escape_html(dst, what);
        rx_text_add(dst, "\"/>");
    }
    if (notes != NULL) {
        rx_text_add(dst, "<system-out>");
        rx_escape_html(dst, notes);
        rx_text_add(dst, "</system-out>");
    }
    rx_text_add(dst, "</testcase>\n");
}

/* What the rows of every tile say beside pass and fail: notes[place of the tile], in the order of its rows. */
static void collect_notes(const rx_rollup *r, rx_text *notes)
{
    for (int i = 0; i < r->nrows; i++) {
        const rx_rollup_row *row = &r->row[i];
        const char *run = r->run[row->run].name;
        rx_text *dst = &notes[row->tile->place];
        if (row->by[0] != '\0')
            rx_text_printf(dst, "HDU %d: %s: done by %s, %s; ", row->hdu, run, row->by, row->why);
        if (row->outside != NULL)
            rx_text_printf(dst, "HDU %d: %s: not made for this tile: %s; ", row->hdu, run, row->outside);
        if (rx_fluxcheck_is_off(&row->flux))
            rx_text_printf(dst, "HDU %d: %s: the flux scale is off: %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f; ",
                           row->hdu, run, row->flux.wide, row->flux.wide_error, row->flux.automatic,
                           row->flux.automatic_error);
        if (row->guard.known && row->guard.raised > 1.0)
            rx_text_printf(dst, "HDU %d: %s: DETECT_THRESH was raised %.3g times for false detections; ",
                           row->hdu, run, row->guard.raised);
        if (row->guard.known && rx_residual_is_large(row->guard.unexplained))
            rx_text_printf(dst, "HDU %d: %s: %.0f %% of the tile are not explained by the restored image; ",
                           row->hdu, run, 100.0 * row->guard.unexplained);
    }
}

void rx_rollup_junit(rx_text *dst, const rx_rollup *r)
{
    rx_text *notes = RX_NEW(rx_text, (size_t)r->ntiles);
    if (notes == NULL) {
        dst->failed = true;
        return;
    }
    collect_notes(r, notes);
    rx_text_printf(
        dst,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"rextract survey\" tests=\"%d\" "
        "failures=\"%d\" errors=\"%d\" skipped=\"%d\">\n",
        r->ntiles + r->nmissing, r->gates, r->failed + r->nmissing, r->undecided);
    for (int i = 0; i < r->ntiles; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        junit_case(dst, tile->image,
                   tile->status == RX_OK                  ? NULL
                   : tile->status == RX_GATE_FAIL         ? "failure"
                   : tile->status == RX_GATE_INSUFFICIENT ? "skipped"
                                                          : "error",
                   tile->what, notes[i].data);
        dst->failed |= notes[i].failed;
        rx_text_free(&notes[i]);
    }
    free(notes);
    for (int i = 0; i < r->nmissing; i++)
        junit_case(dst, rx_tiles_image(r->tiles, r->missing[i]), "error",
                   "no record: it was not run, or was killed", NULL);
    rx_text_add(dst, "</testsuite>\n");
}
