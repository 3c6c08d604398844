/* The report of a survey: its tables, the page, and what continuous integration shows. */
#include "survey/rollup.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "report/formats.h"

enum { ROWS_SHOWN = 200 };

static const char ERROR[] = "1 sigma", NO_RECORD[] = "no record: it was not run, or was killed";

/* What every table of a run ends with. */
#define CELL                                                                                                 \
    RX_ESTIMATE("recall", 3, "", "share of references found"),                                               \
        RX_ESTIMATE("precision", 3, "", "share of detections that are references"),                          \
        RX_COUNT("pairs", "matches with both magnitudes"),                                                   \
        RX_NUMBER("bias_mag", 4, "mag", "median of m - m0", "bias"),                                         \
        RX_NUMBER("scatter_mag", 4, "mag", "sigma_MAD of m - m0", "scatter")

RX_COLUMNS(RUNS, RX_TEXT("run", NULL, "restorer"), RX_COUNT("images", ""),
           RX_COUNT("done_by_another", "images that another restorer did", "by another restorer"),
           RX_COUNT("outside", "images that it was not made for", "not made for"),
           RX_COUNT("flux_scale_off", "images with a wrong flux scale", "flux scale off"),
           RX_COUNT("threshold_raised", "images whose DETECT_THRESH was raised", "threshold raised"),
           RX_COUNT("not_explained", "images that the restored one does not explain", "not explained"),
           RX_COUNT("sources", "in the catalogues"), CELL);

RX_COLUMNS(BINS, RX_TEXT("run", "restorer"), RX_NUMBER("mag_low", 1, "mag", "from"),
           RX_NUMBER("mag_high", 1, "mag", "below"), CELL);

RX_COLUMNS(OUTLIERS, RX_TEXT("tile", "name"), RX_NUMBER("hdu", 0, "", "its HDU", "HDU"),
           RX_NUMBER("off", 1, "", "robust sigmas from the others in what is worst", "sigmas"),
           RX_TEXT("why", ""), RX_TEXT("image", "file"), RX_LINK("page", "of the tile (QA_TYPE TILE)"));

RX_COLUMNS(NOT_FINE, RX_TEXT("tile", "name"), RX_TEXT("image", "file"),
           RX_NUMBER("exit_status", 0, "", "none: without a record", "exit status"),
           RX_TEXT("error", NULL, "why"));

RX_COLUMNS(PSFS, RX_TEXT("tile", "name"), RX_COUNT("hdu", "its HDU", "HDU"),
           RX_TEXT("how", "how its PSF came about (RXPSFHOW)", "PSF"),
           RX_COUNT("stars", "that it was fitted to"),
           RX_COUNT("reserved", "stars that were not fitted, for what follows"),
           RX_NUMBER("flux_error", 4, "", "relative error of fluxes from the PSF", "error of fluxes"),
           RX_NUMBER("growth", 4, "", "curve of growth, largest stars - PSF"),
           RX_NUMBER("residual", 4, "", "stacked stars - PSF, largest, share of the peak"),
           RX_NUMBER("dt", 4, "", "mean (T - T of PSF) / T"), RX_NUMBER("dt_error", 4, "", ERROR),
           RX_NUMBER("de1", 4, "", "mean e1 - e1 of PSF, along the tile's pixels"),
           RX_NUMBER("de1_error", 4, "", ERROR), RX_NUMBER("de2", 4, "", "mean e2 - e2 of PSF"),
           RX_NUMBER("de2_error", 4, "", ERROR));

RX_COLUMNS(RHO, RX_NUMBER("arcmin_low", 2, "arcmin", "between two stars, from"),
           RX_NUMBER("arcmin_high", 2, "arcmin", "below"), RX_NUMBER("pairs", 0, "", "of reserved stars"),
           RX_NUMBER("rho1", 6, "", "mean of Re(de conj(de))"), RX_NUMBER("rho1_error", 6, "", ERROR),
           RX_NUMBER("rho_t", 6, "", "mean of the product of both dT/T"),
           RX_NUMBER("rho_t_error", 6, "", ERROR));

#define SHOWN(column, cell) column,
#define FACT(name, digits, unit, help, heading, ...) RX_NUMBER(name, digits, unit, help, heading),
#define COMPARED(...)
static const rx_report_column TILES[] = {
#include "survey/rollup_facts.def"
    CELL};
#undef SHOWN
#undef FACT

#define VALUES(cell) (cell).recall, (cell).precision, (cell).pairs, (cell).bias, (cell).scatter

/* --- tables --- */

/* Restorers over all tiles, and by magnitude in a table of its own. */
static rx_report_table *add_runs(rx_report *report, const rx_rollup *r)
{
    rx_report_table *runs = RX_REPORT_TABLE(report, "runs", RUNS, RX_REPORT_IN_JSON);
    rx_report_table *bins = RX_REPORT_TABLE(report, "bins", BINS, RX_REPORT_EVERYWHERE);
    for (int i = 0; i < r->nruns; i++) {
        const rx_rollup_run *run = r->run[i];
        rx_report_put(runs, run->name, run->images, run->by_others, run->outside, run->flux_off, run->raised,
                      run->unexplained, run->sources, VALUES(run->whole));
        for (int b = run->first; b <= run->last; b++)
            rx_report_put(bins, run->name, 0.5 * (b + RX_TALLY_LOW), 0.5 * (b + 1 + RX_TALLY_LOW),
                          VALUES(run->bin[b]));
    }
    return runs;
}

/* Tiles that have failed or whose gates have, then those without a record. */
static rx_report_table *add_not_fine(rx_report *report, const rx_rollup *r)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "not_fine", NOT_FINE, RX_REPORT_IN_JSON);
    for (int i = 0; i < r->ntiles; i++) {
        const rx_tile_record *record = &r->tile[i]->record;
        if (record->status != RX_OK)
            rx_report_put(t, record->name, record->image, record->status, record->what);
    }
    for (int i = 0; i < r->nmissing; i++)
        rx_report_put(t, "", rx_tiles_image(r->tiles, r->missing[i]), NAN, NO_RECORD);
    return t;
}

static void put_psf(rx_report_table *t, const char *tile, const rx_extension_facts *e)
{
    const rx_psf_account *p = &e->psf;
    double off[3], error[3];
    for (int k = 0; k < 3; k++) {
        off[k] = p->reserved > 0 ? p->off[k] : NAN;
        error[k] = p->reserved > 0 ? p->error[k] : NAN;
    }
    rx_report_put(t, tile, e->hdu, p->how, p->stars, p->reserved, p->flux_error > 0 ? p->flux_error : NAN,
                  p->growth, p->residual, off[0], error[0], off[1], error[1], off[2], error[2]);
}

/* First those that are not from several stars of their own. */
static rx_report_table *add_psfs(rx_report *report, const rx_rollup *r)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "psfs", PSFS, RX_REPORT_EVERYWHERE);
    rx_report_table *rho = RX_REPORT_TABLE(report, "psf_rho", RHO, RX_REPORT_EVERYWHERE);
    for (int lower = 1; lower >= 0; lower--)
        for (int i = 0; i < r->ntiles; i++)
            for (int k = 0; k < r->tile[i]->record.facts.n; k++) {
                const rx_extension_facts *e = &r->tile[i]->record.facts.extension[k];
                if (e->psf.how[0] != '\0' && rx_psf_account_is_lower(&e->psf) == lower)
                    put_psf(t, r->tile[i]->record.name, e);
            }
    for (int k = 0; k < RX_RHO_BINS; k++)
        rx_report_put(rho, rx_rho_edge(k), rx_rho_edge(k + 1), r->rho[k].pairs, r->rho[k].e,
                      r->rho[k].e_error, r->rho[k].t, r->rho[k].t_error);
    return t;
}

/* The page of a tile as the folder of this report sees it, into `dst`; NULL where there is none. */
static const char *link_to(const char *page, const char *folder, char *dst, size_t size)
{
    char real[PATH_MAX];
    size_t used = 0;
    if (page == NULL || page[0] == '\0' || access(page, R_OK) != 0)
        return NULL;
    if (page[0] == '/' || folder[0] == '/' || strstr(folder, "..") != NULL) {
        snprintf(dst, size, "%s", realpath(page, real) != NULL ? real : page);
        return dst;
    }
    for (const char *at = folder; *at != '\0' && used + 4 < size;) {
        const size_t length = strcspn(at, "/");
        if (length > 0 && !(length == 1 && at[0] == '.'))
            used += (size_t)snprintf(dst + used, size - used, "../");
        at += length + (at[length] == '/');
    }
    snprintf(dst + used, size - used, "%s", page);
    return dst;
}

static rx_report_table *add_tiles(rx_report *report, const rx_rollup *all, const char *shown)
{
    char link[2 * PATH_MAX];
    rx_report_table *t = RX_REPORT_TABLE(report, "tiles", TILES, RX_REPORT_EVERYWHERE);
#define SHOWN(column, cell) cell,
#define FACT(name, digits, unit, help, heading, title, suffix, image, log, floor, error, value)              \
    rx_cell_number(value),
    for (int i = 0; i < all->nrows; i++) {
        const rx_rollup_row *r = all->row[i];
        const rx_extension_facts *e = r->image;
        const rx_run_facts *f = r->facts;
        const rx_cell cells[RX_LENGTH(TILES)] = {
#include "survey/rollup_facts.def"
            RX_CELL(r->cell.recall), RX_CELL(r->cell.precision), RX_CELL(r->cell.pairs),
            RX_CELL(r->cell.bias), RX_CELL(r->cell.scatter)};
        rx_report_row(t, cells);
    }
    return t;
}

static rx_report_table *add_outliers(rx_report *report, const rx_rollup *r, const char *shown)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "outliers", OUTLIERS, RX_REPORT_EVERYWHERE);
    char link[2 * PATH_MAX];
    for (int i = 0; i < r->noutliers; i++) {
        const rx_rollup_outlier *o = &r->outlier[i];
        rx_report_put(t, o->name, o->hdu < 0 ? NAN : o->hdu, o->off > 0 ? o->off : NAN, (const char *)o->why,
                      o->image, link_to(o->page, shown, link, sizeof link));
    }
    return t;
}

/* --- the page --- */

static void add_facts(rx_report *report, const rx_rollup *r)
{
    const struct {
        const char *name;
        int n;
    } counts[] = {{"all_tiles", r->ntiles + r->nmissing},
                  {"fine", r->fine},
                  {"failed", r->failed},
                  {"without_record", r->nmissing},
                  {"gate_failed", r->gates},
                  {"gate_undecided", r->undecided},
                  {"stand_out", r->apart},
                  {"psf_not_from_stars", r->lower}};
    const double *range = r->config->mag_range.v;
    char word[64], sentence[240];
    rx_report_fact(report, "format", "rextract survey 2");
    for (int i = 0; i < 2; i++)
        if (range[0] < range[1])
            rx_report_fact_number(report, i ? "mag_high" : "mag_low", range[i]);
        else
            rx_report_fact(report, i ? "mag_high" : "mag_low", NULL);
    for (int i = 0; i < RX_LENGTH(counts); i++)
        rx_report_fact_number(report, counts[i].name, counts[i].n);
    snprintf(word, sizeof word, "%d of %d tiles are fine:", r->fine, r->ntiles + r->nmissing);
    snprintf(sentence, sizeof sentence,
             "%d failed, %d without a record, %d with a quality gate that failed, %d with one that is "
             "undecided, %d others stand out.",
             r->failed, r->nmissing, r->gates, r->undecided, r->apart);
    rx_report_verdict(report,
                      r->failed + r->nmissing + r->gates > 0 ? RX_MARK_BAD
                      : r->undecided + r->apart > 0          ? RX_MARK_OPEN
                                                             : RX_MARK_GOOD,
                      word, sentence);
}

/* The first `most` rows (0: all), with these columns, which end with NULL; NULL: all of them. */
static void show(rx_report *report, const rx_report_table *t, long most, const char *const *columns)
{
    int n = 0;
    while (columns != NULL && columns[n] != NULL)
        n++;
    if (rx_report_rows(t) > 0)
        rx_report_show(
            report, t,
            RX_VIEW(.to = most, .most = ROWS_SHOWN, .without_empty = 1, .ncolumns = n, .columns = columns));
    else
        rx_report_paragraph(report, "None.");
}

static void show_figures(rx_report *report, const rx_rollup *r)
{
    bool compared = false;
    for (int i = 0; i < r->nrows; i++)
        compared = compared || r->row[i]->compared;
    rx_rollup_figures(rx_report_figures_of(report), r);
    rx_report_section(report, "figures", "Figures");
    if (!compared)
        rx_report_paragraph(report, "No tile was compared with a reference catalogue.");
    if (rx_report_figures_of(report)->n > 0) {
        rx_report_place(report, "all-");
        rx_report_place(report, "psf-");
    }
}

static void show_psfs(rx_report *report, const rx_rollup *r, const rx_report_table *psfs)
{
    static const char *const columns[] = {"tile", "hdu", "how", "flux_error", NULL};
    char sentence[160];
    if (r->nimages == 0)
        return;
    rx_report_section(report, "psfs", "PSFs");
    snprintf(sentence, sizeof sentence,
             "%d of %d images have a PSF that is not from several stars of their own (RXPSFHOW).", r->lower,
             r->nimages);
    rx_report_sentence(report, sentence);
    if (r->lower > 0)
        show(report, psfs, r->lower, columns);
    rx_report_note(
        report,
        "Correlation of residuals: of stars that no PSF was fitted to, between pairs: &rho;<sub>1</sub> = "
        "&lt;Re(&delta;e &delta;e*)&gt;, &rho;<sub>T</sub> the same of &delta;T/T; of pairs in one image, "
        "and of pairs of images that do not overlap. Errors are from image to image. What is not 0 within "
        "them, the PSFs miss alike over that angle. Numbers: psf_rho.ecsv, and of all PSFs: psfs.ecsv.");
}

static rx_status make_page(rx_report *report, const rx_rollup *r, rx_error *err)
{
    static const char *const of_tiles[] = {"tile",      "hdu",     "run",      "done_by",     "why",
                                           "outside",   "verdict", "off",      "worst_in",    "recall",
                                           "precision", "pairs",   "bias_mag", "scatter_mag", "fwhm",
                                           "noise",     "sources", "page",     NULL};
    static const char *const of_outliers[] = {"tile", "hdu", "off", "why", "page", NULL};
    static const char *const of_failures[] = {"image", "exit_status", "error", NULL};
    const char *shown = r->config->output_name;
    const double *range = r->config->mag_range.v;
    char text[120];
    add_facts(report, r);
    rx_report_table *trends = NULL, *outliers = add_outliers(report, r, shown);
    RX_TRY(rx_rollup_trends(r, report, &trends, err));
    rx_report_section(report, "outliers", "Tiles that stand out, worst first");
    show(report, outliers, 0, of_outliers);
    rx_report_note(report,
                   "Tiles that failed, then those with a gate that failed, then by robust sigmas: the "
                   "distance from the median of all images over their sigma_MAD (and over the tile's own "
                   "error, where that is larger). Listed: what a restorer was not made for or did not do, "
                   "fluxes that are off, and whatever is more than 6 from the others.");
    show_figures(report, r);
    if (rx_report_rows(trends) > 0) {
        rx_report_section(report, "trends", "Trends");
        rx_report_place(report, "trend-");
        show(report, trends, 0, NULL);
        rx_report_note(report, "Strongest first; figures where a correlation is clear (beyond 4 sigma). Of "
                               "many pairs some reach 3 by chance.");
    }
    rx_report_section(report, "overview", "Restorers");
    show(report, add_runs(report, r), 0, NULL);
    if (range[0] < range[1]) {
        snprintf(text, sizeof text, "Recall, precision and errors of magnitudes %g to %g (MAG_RANGE).",
                 range[0], range[1]);
        rx_report_note(report, text);
    }
    const rx_report_table *psfs = add_psfs(report, r);
    rx_report_section(report, "failures", "Failures and gates");
    show(report, add_not_fine(report, r), 0, of_failures);
    show_psfs(report, r, psfs);
    rx_report_section(report, "tiles", "Tiles, worst first");
    show(report, add_tiles(report, r, shown), 0, of_tiles);
    rx_report_note(
        report,
        "Tiles whose gates fail come first. off: by how many of its own errors a tile lies below the survey "
        "in recall or precision, or beside it in bias, whichever is worst; differences of seeing and depth "
        "count as well. A flux scale that is off (restored against untouched pixels, more than 1 % and 5 "
        "errors) counts by its errors from 1, with or without a reference.");
    return RX_OK;
}

/* --- JUnit's XML: a test case per tile --- */

/* kind: element of what is wrong, or NULL; notes: lines to read all the same, or NULL. */
static void add_case(rx_text *dst, const char *image, const char *kind, const char *what, const char *notes)
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

static void add_tile_case(rx_text *dst, const rx_rollup_tile *tile)
{
    const int status = tile->record.status;
    rx_text notes = {0};
    for (const rx_rollup_row *row = tile->row; row < tile->row + tile->nrows; row++) {
        char before[40];
        snprintf(before, sizeof before, "HDU %d: ", row->image->hdu);
        rx_rollup_row_notes(&notes, row, before);
        if (row->facts->guard.known && row->facts->guard.raised > 1.0)
            rx_text_printf(rx_rollup_note(&notes, before, row->facts->name),
                           "DETECT_THRESH was raised %.3g times for false detections",
                           row->facts->guard.raised);
    }
    add_case(dst, tile->record.image,
             status == RX_OK                  ? NULL
             : status == RX_GATE_FAIL         ? "failure"
             : status == RX_GATE_INSUFFICIENT ? "skipped"
                                              : "error",
             tile->record.what, notes.data);
    dst->failed |= notes.failed;
    rx_text_free(&notes);
}

static void make_junit(rx_text *dst, const rx_rollup *r)
{
    rx_text_printf(dst,
                   "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"rextract survey\" "
                   "tests=\"%d\" failures=\"%d\" errors=\"%d\" skipped=\"%d\">\n",
                   r->ntiles + r->nmissing, r->gates, r->failed + r->nmissing, r->undecided);
    for (int i = 0; i < r->ntiles; i++)
        add_tile_case(dst, r->tile[i]);
    for (int i = 0; i < r->nmissing; i++)
        add_case(dst, rx_tiles_image(r->tiles, r->missing[i]), "error", NO_RECORD, NULL);
    rx_text_add(dst, "</testsuite>\n");
}

rx_status rx_rollup_report(const rx_rollup *r, const char *folder, rx_log *log, rx_error *err)
{
    const char *shown = r->config->output_name;
    const rx_report_files files = {
        .folder = folder, .shown = shown, .figures = r->config->qa_figures, .log = log};
    rx_text junit = {0};
    rx_report *report = rx_report_new("Survey: ", "all tiles");
    if (report == NULL)
        return rx_error_memory(err, 0);
    rx_status status = make_page(report, r, err);
    if (status == RX_OK)
        status = rx_report_write(report, &files, NULL, err);
    rx_report_free(report);
    if (status != RX_OK)
        return status;
    make_junit(&junit, r);
    return rx_report_file(folder, shown, "junit.xml", &junit, err);
}
