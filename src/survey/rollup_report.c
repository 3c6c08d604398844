/* The report of a survey: its tables, and the page. */
#include "survey/rollup.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "report/report.h"

enum { ROWS_SHOWN = 200, NCELL = 5 };

static const char ERROR[] = "1 sigma";

/* What every table of a run ends with: put_cell(). */
#define CELL                                                                                                 \
    {"recall", RX_REPORT_ESTIMATE, 3, "", "share of references found", NULL},                                \
        {"precision", RX_REPORT_ESTIMATE, 3, "", "share of detections that are references", NULL},           \
        {"pairs", RX_REPORT_COUNT, 0, "", "matches with both magnitudes", NULL},                             \
        {"bias_mag", RX_REPORT_NUMBER, 4, "mag", "median of m - m0", "bias"},                                \
    {                                                                                                        \
        "scatter_mag", RX_REPORT_NUMBER, 4, "mag", "sigma_MAD of m - m0", "scatter"                          \
    }

RX_COLUMNS(RUNS, {.name = "run", .heading = "restorer"}, RX_COUNT("images", ""),
           {"done_by_another", RX_REPORT_COUNT, 0, "", "images that another restorer did",
            "by another restorer"},
           {"outside", RX_REPORT_COUNT, 0, "", "images that it was not made for", "not made for"},
           {"flux_scale_off", RX_REPORT_COUNT, 0, "", "images with a wrong flux scale", "flux scale off"},
           {"threshold_raised", RX_REPORT_COUNT, 0, "", "images whose DETECT_THRESH was raised",
            "threshold raised"},
           {"not_explained", RX_REPORT_COUNT, 0, "", "images that the restored one does not explain",
            "not explained"},
           RX_COUNT("sources", "in the catalogues"), CELL);

RX_COLUMNS(BINS, RX_TEXT("run", "restorer"), RX_NUMBER("mag_low", 1, "mag", "from"),
           RX_NUMBER("mag_high", 1, "mag", "below"), CELL);

RX_COLUMNS(OUTLIERS, RX_TEXT("tile", "name"), {"hdu", RX_REPORT_NUMBER, 0, "", "its HDU", "HDU"},
           {"off", RX_REPORT_NUMBER, 1, "", "robust sigmas from the others in what is worst", "sigmas"},
           RX_TEXT("why", ""), RX_TEXT("image", "file"),
           {"page", RX_REPORT_FILE, 0, "", "of the tile (QA_TYPE TILE)", NULL});

RX_COLUMNS(NOT_FINE, RX_TEXT("tile", "name"), RX_TEXT("image", "file"),
           {"exit_status", RX_REPORT_NUMBER, 0, "", "none: without a record", "exit status"},
           {.name = "error", .heading = "why"});

RX_COLUMNS(PSFS, RX_TEXT("tile", "name"), {"hdu", RX_REPORT_COUNT, 0, "", "its HDU", "HDU"},
           {.name = "how", .help = "how its PSF came about (RXPSFHOW)", .heading = "PSF"},
           RX_COUNT("stars", "that it was fitted to"),
           RX_COUNT("reserved", "stars that were not fitted, for what follows"),
           {"flux_error", RX_REPORT_NUMBER, 4, "", "relative error of fluxes from the PSF",
            "error of fluxes"},
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

#define COLUMN(name, kind, help, heading)                                                                    \
    {                                                                                                        \
        name, kind, 0, "", help, heading                                                                     \
    }
#define SHOWN(column, cell) column,
#define FACT(function, name, digits, unit, help, heading, ...)                                               \
    {name, RX_REPORT_NUMBER, digits, unit, help, heading},
#define COMPARED(...)
static const rx_report_column TILES[] = {
#include "survey/rollup_facts.def"
    CELL};
#undef SHOWN
#undef FACT

#define COUNT(columns) ((int)(sizeof(columns) / sizeof *(columns)))

static void put_cell(rx_cell dst[NCELL], const rx_rollup_cell *cell)
{
    const rx_cell values[NCELL] = {rx_cell_estimate(cell->recall), rx_cell_estimate(cell->precision),
                                   rx_cell_number((double)cell->pairs), rx_cell_number(cell->bias),
                                   rx_cell_number(cell->scatter)};
    for (int i = 0; i < NCELL; i++)
        dst[i] = values[i];
}

/* Restorers over all tiles, and by magnitude in a table of its own. */
static rx_report_table *add_runs(rx_report *report, const rx_rollup *r)
{
    rx_report_table *runs = RX_REPORT_TABLE(report, "runs", RUNS, RX_REPORT_IN_JSON);
    rx_report_table *bins = RX_REPORT_TABLE(report, "bins", BINS, RX_REPORT_EVERYWHERE);
    for (int i = 0; i < r->nruns; i++) {
        const rx_rollup_run *run = &r->run[i];
        const long counts[] = {run->tiles,  run->by_others,   run->outside, run->flux_off,
                               run->raised, run->unexplained, run->sources};
        rx_cell row[COUNT(RUNS)] = {rx_cell_words(run->name)};
        for (int k = 0; k < COUNT(counts); k++)
            row[1 + k] = rx_cell_number((double)counts[k]);
        put_cell(row + 1 + COUNT(counts), &run->whole);
        rx_report_row(runs, row);
        for (int b = run->first; b <= run->last; b++) {
            rx_cell bin[COUNT(BINS)] = {rx_cell_words(run->name), rx_cell_number(0.5 * (b + RX_TALLY_LOW)),
                                        rx_cell_number(0.5 * (b + 1 + RX_TALLY_LOW))};
            put_cell(bin + 3, &run->bin[b]);
            rx_report_row(bins, bin);
        }
    }
    return runs;
}

/* Tiles that have failed or whose gates have, then those without a record. */
static rx_report_table *add_not_fine(rx_report *report, const rx_rollup *r)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "not_fine", NOT_FINE, RX_REPORT_IN_JSON);
    for (int i = 0; i < r->ntiles; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        if (tile->status != RX_OK)
            rx_report_put(t, tile->name, tile->image, tile->status, tile->what);
    }
    for (int i = 0; i < r->nmissing; i++)
        rx_report_put(t, "", rx_tiles_image(r->tiles, r->missing[i]), NAN,
                      "no record: it was not run, or was killed");
    return t;
}

/* First those that are not from several stars of their own. */
static rx_report_table *add_psfs(rx_report *report, const rx_rollup *r)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "psfs", PSFS, RX_REPORT_EVERYWHERE);
    rx_report_table *rho = RX_REPORT_TABLE(report, "psf_rho", RHO, RX_REPORT_EVERYWHERE);
    for (int lower = 1; lower >= 0; lower--)
        for (int i = 0; i < r->npsfs; i++) {
            const rx_psf_account *p = &r->psf[i].psf;
            if (rx_psf_account_is_lower(p) != lower)
                continue;
            const double numbers[] = {p->stars, p->reserved, p->flux_error > 0 ? p->flux_error : NAN,
                                      p->growth, p->residual};
            rx_cell row[COUNT(PSFS)] = {rx_cell_words(r->psf[i].tile->name), rx_cell_number(r->psf[i].hdu),
                                        rx_cell_words(p->how)};
            for (int k = 0; k < COUNT(numbers); k++)
                row[3 + k] = rx_cell_number(numbers[k]);
            for (int k = 0; k < 3; k++) {
                row[3 + COUNT(numbers) + 2 * k] = rx_cell_number(p->reserved > 0 ? p->off[k] : NAN);
                row[4 + COUNT(numbers) + 2 * k] = rx_cell_number(p->reserved > 0 ? p->error[k] : NAN);
            }
            rx_report_row(t, row);
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
    if (page == NULL || access(page, R_OK) != 0)
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
#define FACT(function, name, digits, unit, help, heading, title, suffix, image, log, floor, error, value)    \
    rx_cell_number(value),
    for (int i = 0; i < all->nrows; i++) {
        const rx_rollup_row *r = &all->row[i];
        const char *run = all->run[r->run].name;
        rx_cell cells[COUNT(TILES)] = {
#include "survey/rollup_facts.def"
        };
        put_cell(cells + COUNT(TILES) - NCELL, &r->cell);
        rx_report_row(t, cells);
    }
    return t;
}

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
    char word[64], sentence[240];
    rx_report_fact(report, "format", "rextract survey 2");
    if (r->mag_low < r->mag_high) {
        rx_report_fact_number(report, "mag_low", r->mag_low);
        rx_report_fact_number(report, "mag_high", r->mag_high);
    } else {
        rx_report_fact(report, "mag_low", NULL);
        rx_report_fact(report, "mag_high", NULL);
    }
    for (int i = 0; i < COUNT(counts); i++)
        rx_report_fact_number(report, counts[i].name, counts[i].n);
    snprintf(word, sizeof word, "%d of %d tiles are fine:", r->fine, r->ntiles + r->nmissing);
    snprintf(
        sentence, sizeof sentence,
        "%d failed, %d without a record, %d with a quality gate that failed, %d with one that is undecided, "
        "%d others stand out.",
        r->failed, r->nmissing, r->gates, r->undecided, r->apart);
    rx_report_verdict(report,
                      r->failed + r->nmissing + r->gates > 0 ? RX_MARK_BAD
                      : r->undecided + r->apart > 0          ? RX_MARK_OPEN
                                                             : RX_MARK_GOOD,
                      word, sentence);
}

static const rx_report_table *add_outliers(rx_report *report, const rx_rollup *r, const char *shown)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "outliers", OUTLIERS, RX_REPORT_EVERYWHERE);
    char link[2 * PATH_MAX];
    for (int i = 0; i < r->noutliers; i++) {
        const rx_rollup_outlier *o = &r->outlier[i];
        rx_report_row(t, (rx_cell[]){rx_cell_words(o->name), rx_cell_number(o->row != NULL ? o->hdu : NAN),
                                     rx_cell_number(o->off > 0 ? o->off : NAN), rx_cell_words(o->why),
                                     rx_cell_words(o->image),
                                     rx_cell_words(link_to(o->page, shown, link, sizeof link))});
    }
    return t;
}

static void show(rx_report *report, const rx_report_table *t, long to, int ncolumns,
                 const char *const *columns)
{
    if (to > 0)
        rx_report_show(report, t,
                       RX_VIEW(.to = to, .most = ROWS_SHOWN, .without_empty = 1, .ncolumns = ncolumns,
                               .columns = columns));
    else
        rx_report_paragraph(report, "None.");
}

static void show_figures(rx_report *report, const rx_rollup *r)
{
    bool compared = false;
    for (int i = 0; i < r->nrows; i++)
        compared = compared || r->row[i].compared;
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
    static const char *const columns[] = {"tile", "hdu", "how", "flux_error"};
    char sentence[160];
    if (r->npsfs == 0)
        return;
    rx_report_section(report, "psfs", "PSFs");
    snprintf(sentence, sizeof sentence,
             "%d of %d images have a PSF that is not from several stars of their own (RXPSFHOW).", r->lower,
             r->npsfs);
    rx_report_sentence(report, sentence);
    if (r->lower > 0)
        show(report, psfs, r->lower, COUNT(columns), columns);
    rx_report_note(
        report,
        "Correlation of residuals: of stars that no PSF was fitted to, between pairs: &rho;<sub>1</sub> = "
        "&lt;Re(&delta;e &delta;e*)&gt;, &rho;<sub>T</sub> the same of &delta;T/T; of pairs in "
        "one image, and of pairs of images that do not overlap. Errors are from image to image. What is not "
        "0 within them, the PSFs miss alike over that angle. Numbers: psf_rho.ecsv, and of all PSFs: "
        "psfs.ecsv.");
}

rx_status rx_rollup_report(const rx_rollup *r, int figures, const char *folder, const char *shown,
                           rx_log *log, rx_error *err)
{
    static const char *const columns[] = {"tile",      "hdu",     "run",      "done_by",     "why",
                                          "outside",   "verdict", "off",      "worst_in",    "recall",
                                          "precision", "pairs",   "bias_mag", "scatter_mag", "fwhm",
                                          "noise",     "sources", "page"};
    static const char *const far[] = {"tile", "hdu", "off", "why", "page"};
    static const char *const why[] = {"image", "exit_status", "error"};
    const rx_report_files files = {.folder = folder, .shown = shown, .figures = figures, .log = log};
    rx_text junit = {0};
    char range[120];
    rx_report *report = rx_report_new("Survey: ", "all tiles");
    if (report == NULL)
        return rx_error_memory(err, 0);
    add_facts(report, r);
    rx_report_table *trends = NULL;
    const rx_report_table *outliers = add_outliers(report, r, shown);
    rx_status status = rx_rollup_trends(r, report, &trends, err);
    if (status != RX_OK) {
        rx_report_free(report);
        return status;
    }
    rx_report_section(report, "outliers", "Tiles that stand out, worst first");
    show(report, outliers, rx_report_rows(outliers), COUNT(far), far);
    rx_report_note(report, "Tiles that failed, then those with a gate that failed, then by robust sigmas: "
                           "the distance from the median of "
                           "all images over their sigma_MAD (and over the tile's own error, where that is "
                           "larger). Listed: what a "
                           "restorer was not made for or did not do, fluxes that are off, and whatever is "
                           "more than 6 from the others.");
    show_figures(report, r);
    if (rx_report_rows(trends) > 0) {
        rx_report_section(report, "trends", "Trends");
        rx_report_place(report, "trend-");
        show(report, trends, rx_report_rows(trends), 0, NULL);
        rx_report_note(report, "Strongest first; figures where a correlation is clear (beyond 4 sigma). Of "
                               "many pairs some reach 3 by "
                               "chance.");
    }
    rx_report_section(report, "overview", "Restorers");
    const rx_report_table *runs = add_runs(report, r);
    show(report, runs, rx_report_rows(runs), 0, NULL);
    if (r->mag_low < r->mag_high) {
        snprintf(range, sizeof range, "Recall, precision and errors of magnitudes %g to %g (MAG_RANGE).",
                 r->mag_low, r->mag_high);
        rx_report_note(report, range);
    }
    const rx_report_table *psfs = add_psfs(report, r), *not_fine = add_not_fine(report, r);
    rx_report_section(report, "failures", "Failures and gates");
    show(report, not_fine, rx_report_rows(not_fine), COUNT(why), why);
    show_psfs(report, r, psfs);
    rx_report_section(report, "tiles", "Tiles, worst first");
    show(report, add_tiles(report, r, shown), r->nrows, COUNT(columns), columns);
    rx_report_note(
        report,
        "Tiles whose gates fail come first. off: by how many of its own errors a tile lies below the "
        "survey in recall or precision, or beside it in bias, whichever is worst; differences of seeing "
        "and depth count as well. A flux scale that is off (restored against untouched pixels, more than "
        "1 % and 5 errors) counts by its errors from 1, with or without a reference.");
    status = rx_report_write(report, &files, NULL, err);
    rx_report_free(report);
    if (status == RX_OK) {
        rx_rollup_junit(&junit, r);
        status = rx_report_file(folder, shown, "junit.xml", &junit, err);
    }
    return status;
}
