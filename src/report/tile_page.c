/* The page of a tile, from top to bottom. */
#include "report/tile_page.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/flags.h"
#include "io/wcs.h"

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

RX_COLUMNS(NUMBERS, RX_TEXT("quantity", NULL), RX_NUMBER("value", -4, "", ""), RX_TEXT("unit", NULL),
           {.name = "what", .heading = "what it is"});

RX_COLUMNS(RUNS, {.name = "run", .heading = "restorer"},
           {.name = "taken", .help = "restorer that AUTO took", .heading = "took"},
           RX_TEXT("why", "why that one"), RX_COUNT("sources", "in the catalogue"),
           RX_NUMBER("per_mpixel", 0, "", "sources per Mpixel that is used"),
           RX_NUMBER("clean", 1, "%", "share with FLAGS 0"),
           RX_NUMBER("turnover", 2, "mag", "MAG_AUTO where counts are highest"),
           RX_MEASURED("slope", 2, "dex/mag", "of counts, up to 0.5 mag before"),
           RX_MEASURED("flux_scale", 4, "", "restored over original flux of isolated sources"),
           RX_NUMBER("chi2", 2, "", "median of residual chi2 over cells"),
           RX_TEXT("chi2_of", "what was taken off the pixels for it"),
           RX_ESTIMATE("false_per_mpixel", 1, "",
                       "false detections on noise (BLANK_CHECK), with its interval at 95 %"));

RX_COLUMNS(FLAGS, {.name = "run", .heading = "restorer"}, RX_TEXT("column", NULL),
           RX_COUNT("bit", "value in the column"), RX_TEXT("meaning", NULL),
           RX_COUNT("sources", "that have it"), RX_NUMBER("share", 1, "%", "of all sources"));

RX_COLUMNS(REMARKS, RX_TEXT("key", NULL),
           {"mark", RX_REPORT_VERDICT, 0, "", "FAIL: numbers are wrong; INSUFFICIENT: look at it", NULL},
           RX_TEXT("sentence", NULL));

RX_COLUMNS(STARS, RX_NUMBER("x", 2, "pix", "X_IMAGE"), RX_NUMBER("y", 2, "pix", "Y_IMAGE"),
           RX_NUMBER("fwhm", 3, "pix", "of the star's pixels"),
           RX_NUMBER("ellipticity", 3, "", "1 - b/a of the star"),
           RX_NUMBER("theta", 1, "deg", "major axis from x"),
           RX_NUMBER("psf_fwhm", 3, "pix", "of the PSF there"),
           RX_NUMBER("psf_ellipticity", 3, "", "1 - b/a of the PSF"),
           RX_NUMBER("psf_theta", 1, "deg", "its major axis from x"));

static void add_verdict(rx_report *report, const rx_tile_quality *q)
{
    char word[80], numbers[320];
    int bad = 0, used = 0;
    rx_report_table *t = RX_REPORT_TABLE(report, "remarks", REMARKS, RX_REPORT_IN_JSON);
    for (int i = 0; i < q->nremarks; i++)
        bad += q->remark[i].bad;
    if (q->nremarks == 0)
        snprintf(word, sizeof word, "Nothing stands out.");
    else
        snprintf(word, sizeof word, "%d wrong, %d to look at.", bad, q->nremarks - bad);
    for (int i = 0; i < q->about->nruns; i++)
        used +=
            snprintf(numbers + used, sizeof numbers - (size_t)used, "%s%s %d",
                     i > 0 ? ", " : "Sources: ", q->about->runs[i].about->name, q->about->runs[i].sources->n);
    if (isfinite(q->fwhm))
        used += snprintf(numbers + used, sizeof numbers - (size_t)used,
                         "; FWHM %.2f pixels, 1 - b/a %.3f; S/N 5 at %.2f mag", q->fwhm, q->ellipticity,
                         q->depth);
    snprintf(numbers + used, sizeof numbers - (size_t)used, "; sky %.4g, noise %.4g ADU.", q->sky_median,
             q->noise_median);
    rx_report_verdict(report,
                      bad > 0           ? RX_MARK_BAD
                      : q->nremarks > 0 ? RX_MARK_OPEN
                                        : RX_MARK_GOOD,
                      word, numbers);
    for (int wrong = 1; wrong >= 0; wrong--)
        for (int i = 0; i < q->nremarks; i++) {
            const char *mark = wrong ? RX_MARK_BAD : RX_MARK_OPEN;
            if ((q->remark[i].bad != 0) != wrong)
                continue;
            rx_report_put(t, q->remark[i].key, mark, q->remark[i].sentence);
            rx_report_verdict(report, mark, wrong ? "Wrong:" : "Look:", q->remark[i].sentence);
        }
}

double rx_tile_scale(const rx_image *image)
{
    if (image->wcs != NULL)
        return rx_wcs_pixel_scale(image->wcs, 0.5 * (image->width - 1), 0.5 * (image->height - 1));
    return image->pixel_scale > 0 && image->pixel_scale != 1 ? image->pixel_scale : NAN;
}

static void add_numbers(rx_report *report, const rx_tile_quality *q)
{
    const rx_image *image = &q->about->image;
    const double scale = rx_tile_scale(image);
    const rx_noise_correlation *noise = image->correlation;
    const double(*neighbours)[RX_NOISE_SIDE] = noise != NULL && noise->origin == RX_NOISE_MEASURED
                                                   ? noise->measured
                                               : noise != NULL ? noise->at
                                                               : NULL;
    const int measured = noise != NULL && noise->origin != RX_NOISE_UNKNOWN;
    const struct {
        const char *name;
        double value;
        const char *unit, *what;
    } rows[] = {
        {"width", image->width, "pixels", "of the tile"},
        {"height", image->height, "pixels", "of the tile"},
        {"pixel_scale", scale, "arcsec/pixel",
         image->wcs != NULL ? "at the centre, by the world coordinates" : "PIXEL_SCALE"},
        {"masked", 100 * q->masked, "%", "pixels that are not used"},
        {"saturated", 100 * q->saturated, "%", "pixels that are saturated"},
        {"psf_fwhm", q->fwhm, "pixels",
         "of the PSF at the centre, as in the log; elsewhere scaled by second moments under a Gaussian as "
         "wide"},
        {"psf_fwhm_arcsec", q->fwhm * scale, "arcsec", "the same"},
        {"psf_fwhm_range", q->ngrid > 0 ? q->fwhm_high - q->fwhm_low : NAN, "pixels",
         "largest less smallest over the tile"},
        {"psf_ellipticity", q->ellipticity, "1 - b/a", "of the PSF, mean over the tile as a vector"},
        {"psf_stars", image->psf != NULL ? image->psf->nstars : NAN, "stars", "that made the PSF"},
        {"stars_wider", 100 * q->wider, "%", "FWHM of stars over that of the PSF, less 1, median"},
        {"stars_wider_error", 100 * q->wider_error, "%", "1 sigma of it"},
        {"psf_flux_error",
         image->psf != NULL && image->psf->quality.how != RX_PSF_BY_NOTHING
             ? 100 * rx_psf_flux_error_mean(image->psf)
             : NAN,
         "%", "of fluxes of point sources, from the PSF (RXPSFERR)"},
        {"psf_half_light", q->half_light, "pixels", "half-light radius of the PSF at the centre"},
        {"sky", q->sky_median, "ADU", "median level"},
        {"sky_range", q->sky_range, "ADU", "5 to 95 % of cells"},
        {"noise", q->noise_median, "ADU", "of a pixel, median"},
        {"noise_width", q->width, "",
         "scatter of (pixel - sky) / noise without sources, from quartiles; 1 where the noise map is right"},
        {"noise_below", 1e6 * q->below / q->pulls, "per Mpixel", "pixels more than 5 sigma below the sky"},
        {"noise_above", 1e6 * q->above / q->pulls, "per Mpixel",
         "pixels without source more than 5 sigma above the sky"},
        {"noise_neighbours", measured ? neighbours[RX_NOISE_REACH][RX_NOISE_REACH + 1] : NAN, "",
         "correlation of neighbours in x"},
        {"noise_neighbours_y", measured ? neighbours[RX_NOISE_REACH + 1][RX_NOISE_REACH] : NAN, "",
         "correlation of neighbours in y"},
        {"noise_factor", measured ? q->noise_factor : NAN, "",
         "noise of wide sums over that of independent pixels"},
        {"depth", q->depth, "mag",
         "point source of S/N 5 under the PSF, in the sky's noise, on the scale of MAG_ZEROPOINT"},
        {"zeropoint", image->zeropoint, "mag", "MAG_ZEROPOINT"},
        {"gain", image->gain > 0 ? image->gain : NAN, "e-/ADU", "none: errors have no photons of sources"},
    };
    rx_report_table *t = RX_REPORT_TABLE(report, "numbers", NUMBERS, RX_REPORT_IN_JSON);
    for (int i = 0; i < COUNT(rows); i++)
        if (isfinite(rows[i].value))
            rx_report_put(t, rows[i].name, rows[i].value, rows[i].unit, rows[i].what);
    rx_report_section(report, "numbers", "Numbers");
    rx_report_show(report, t, &(rx_report_view){0});
}

static void add_runs(rx_report *report, const rx_tile_quality *q)
{
    const rx_image *image = &q->about->image;
    rx_report_table *t = RX_REPORT_TABLE(report, "runs", RUNS, RX_REPORT_IN_JSON);
    for (int i = 0; i < q->about->nruns; i++) {
        const rx_tile_restored *run = &q->about->runs[i];
        const rx_tile_counts counts = rx_tile_count(image, run->sources);
        const double used = 1e-6 * image->width * image->height * (1 - q->masked);
        long clean = 0;
        for (int k = 0; k < run->sources->n; k++)
            clean += run->sources->list[k].flags == 0;
        rx_report_put(
            t, run->about->name, run->about->taken, run->about->taken != NULL ? run->about->why : NULL,
            run->sources->n, run->sources->n / used,
            run->sources->n > 0 ? 100.0 * (double)clean / run->sources->n : NAN, counts.peak,
            rx_cell_measured(counts.slope, counts.slope_error),
            rx_cell_measured(run->about->flux.n > 0 ? run->about->flux.wide : NAN,
                             run->about->flux.wide_error),
            rx_tile_chi2_middle(q->about, i), run->chi2.of,
            rx_cell_estimate(run->about->blank.n > 0 ? run->about->blank.rate
                                                     : (rx_estimate){.value = NAN, .low = NAN, .high = NAN}));
    }
    rx_report_section(report, "runs", "Restorers");
    rx_report_show(report, t, &(rx_report_view){.turned = 1, .without_empty = 1});
}

static int value_of(const rx_source *s, const char *column)
{
#define IS(name) (strcmp(column, name) == 0)
    return IS("FLAGS")            ? s->flags
           : IS("FLAGS_WEIGHT")   ? s->flags_weight
           : IS("FLAGS_WIN")      ? s->flags_win
           : IS("FLAGS_MEASURE")  ? s->flags_measure
           : IS("FLAGS_TEMPLATE") ? s->fit.flags
           : IS("FLAGS_RESTORE")  ? s->fit.restore
                                  : 0;
#undef IS
}

static void add_flags(rx_report *report, const rx_tile_quality *q)
{
    int n = 0;
    const rx_flag *words = rx_flags(&n);
    rx_report_table *t = RX_REPORT_TABLE(report, "flags", FLAGS, RX_REPORT_IN_JSON);
    for (int i = 0; i < q->about->nruns; i++) {
        const rx_sources *sources = q->about->runs[i].sources;
        long fitted = 0, tested = 0;
        for (int k = 0; k < sources->n; k++) {
            fitted += sources->list[k].fit.group > 0;
            tested += (sources->list[k].fit.restore & RX_RESTORE_UNTESTED) == 0;
        }
        for (int w = 0; w < n; w++) {
            const char *column = words[w].column;
            long have = 0;
            if (fitted == 0 && strcmp(column, "FLAGS_TEMPLATE") == 0)
                continue;
            if (tested == 0 && strcmp(column, "FLAGS_RESTORE") == 0 && words[w].bit == RX_RESTORE_UNTESTED)
                continue;
            for (int k = 0; k < sources->n; k++)
                have += (value_of(&sources->list[k], column) & words[w].bit) != 0;
            if (have > 0)
                rx_report_put(t, q->about->runs[i].about->name, column, words[w].bit, words[w].meaning, have,
                              100.0 * (double)have / sources->n);
        }
    }
    rx_report_section(report, "flags", "Flags by kind");
    if (rx_report_rows(t) > 0)
        rx_report_show(report, t, &(rx_report_view){0});
    else
        rx_report_paragraph(report, "No source has any.");
}

static void add_stars(rx_report *report, const rx_tile_quality *q)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "tile_stars", STARS, RX_REPORT_IN_FILE);
    for (int i = 0; i < q->nstars; i++) {
        const rx_tile_point *p = &q->star[i];
        rx_report_put(t, p->x + 1, p->y + 1, p->shape.fwhm, p->shape.ellipticity, p->shape.theta * 180 / M_PI,
                      p->psf.fwhm, p->psf.ellipticity, p->psf.theta * 180 / M_PI);
    }
}

/* A section of the figures whose names begin so; false and nothing where there are none. */
static bool place(rx_report *report, const char *id, const char *title, const char *prefix)
{
    const rx_figures *figures = rx_report_figures_of(report);
    for (int i = 0; i < figures->n; i++)
        if (strncmp(figures->figure[i].id, prefix, strlen(prefix)) == 0) {
            rx_report_section(report, id, title);
            rx_report_place(report, prefix);
            return true;
        }
    return false;
}

rx_status rx_tile_page_write(const rx_tile_page *page, const rx_report_files *files,
                             rx_tile_page_facts *found, rx_error *err)
{
    rx_tile_quality *q = NULL;
    rx_report_files own = *files;
    rx_report *report = NULL;
    own.page = "tile.html";
    own.summary = "tile.json";
    RX_TRY(rx_tile_quality_make(page->about, &q, err));
    report = rx_report_new("Tile: ", page->about->name);
    if (report == NULL) {
        rx_tile_quality_free(q);
        return rx_error_memory(err, 0);
    }
    rx_report_fact(report, "format", "rextract tile 1");
    rx_report_fact(report, "tile", page->about->name);
    add_verdict(report, q);
    if (own.figures)
        rx_tile_figures(rx_report_figures_of(report), q);
    place(report, "seeing", "Seeing, sky, noise", "tile-");
    place(report, "stars", "Stars", "star-");
    if (place(report, "cuts", "Cut-outs", "cut-"))
        rx_report_note(
            report,
            "Five of the brightest sources, the five brightest blended ones of the others, five by chance "
            "(SEED); original "
            "pixels less the sky, and what each restorer makes of them. Grey: asinh(p / 2&sigma;), black at "
            "&minus;2&sigma;, white where 99.5 % of the original cut-out is darker.");
    add_numbers(report, q);
    add_runs(report, q);
    add_flags(report, q);
    add_stars(report, q);
    if (page->nrecord > 0) {
        rx_report_section(report, "record", "What made this page");
        rx_report_record(report, page->nrecord, page->record);
    }
    const rx_status status = rx_report_write(report, &own, NULL, err);
    *found = (rx_tile_page_facts){0};
    for (int i = 0; i < q->nremarks; i++) {
        found->wrong += q->remark[i].bad;
        found->look += !q->remark[i].bad;
    }
    rx_report_free(report);
    rx_tile_quality_free(q);
    return status;
}
