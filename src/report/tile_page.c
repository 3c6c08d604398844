/* The page of a tile, from top to bottom. */
#include "report/tile_page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/flags.h"
#include "io/wcs.h"
#include "num/stats.h"
#include "report/figure.h"

/* Arcsec a pixel at the centre, by the world coordinates; without them PIXEL_SCALE, of which the default, 1, says nothing: NAN. */
static double scale_of(const rx_image *image)
{
    if (image->wcs != NULL)
        return rx_wcs_pixel_scale(image->wcs, 0.5 * (image->width - 1), 0.5 * (image->height - 1));
    return image->pixel_scale > 0 && image->pixel_scale != 1 ? image->pixel_scale : NAN;
}

/* --- figures --- */

enum { PANEL = 72, GAP = 2, LEAST_HALF = 14, MOST_HALF = 128, LOCUS_DOTS = 600, FEW_DOTS = 60 };
static const double PULL_MOST = 3;

/* From 1 to 99 % of the values, with some extent. */
static void reach(const double *values, size_t n, double *low, double *high)
{
    double *copy = RX_NEW(double, n + 1);
    size_t m = 0;
    for (size_t k = 0; k < n && copy != NULL; k++)
        if (isfinite(values[k]))
            copy[m++] = values[k];
    *low = m > 0 ? rx_quantile(copy, m, 0.01) : 0;
    *high = m > 0 ? rx_quantile(copy, m, 0.99) : 1;
    if (!(*high > *low)) {
        *high += 0.005 * fabs(*high) + 1e-12;
        *low -= 0.005 * fabs(*low) + 1e-12;
    }
    free(copy);
}

/* Pixels of the tile, from 1. */
static rx_axes axes_of(double width, double height)
{
    return (rx_axes){
        "X_IMAGE [pixels]", "Y_IMAGE [pixels]", 0.5, width + 0.5, 0.5, height + 0.5, false, false};
}

typedef struct map {
    const char *id, *title, *reading, *label;
    double most; /* what is above is shown as this */
} map;

/* Means of cells in colour. */
static void draw_map(rx_figures *dst, const rx_tile_quality *q, const rx_tile_cells *cells, const map *of)
{
    const rx_image *image = &q->about->image;
    const int times = cells->nx > 1 && cells->ny > 1 ? 1 : 2; /* gnuplot draws no image of a single row */
    const int nx = times * cells->nx, ny = times * cells->ny;
    const double side = (double)cells->side / times;
    const rx_axes axes =
        axes_of(fmax(image->width, cells->nx * cells->side), fmax(image->height, cells->ny * cells->side));
    double low, high, *values = RX_NEW(double, (size_t)nx *(size_t)ny);
    dst->script.failed |= values == NULL;
    reach(cells->value, (size_t)cells->nx * (size_t)cells->ny, &low, &high);
    if (high > of->most) {
        high = of->most;
        low = fmin(low, 0.5 * high);
    }
    for (int k = 0; k < nx * ny && values != NULL; k++) {
        const double value = cells->value[k / nx / times * cells->nx + k % nx / times];
        values[k] = value > of->most ? of->most : value;
    }
    rx_figure_add(dst, of->id, of->title, of->reading, RX_FIGURE_CHART);
    rx_plot_coloured_begin(
        dst, &axes, &(rx_coloured){RX_PLOT_VIRIDIS, of->label, low, high, values ? ny : 0, nx, values});
    rx_text_printf(&dst->script,
                   "$data matrix using (($1+0.5)*%g+0.5):(($2+0.5)*%g+0.5):3 with image notitle", side, side);
    rx_plot_coloured_end(dst);
    free(values);
}

/* Colour: FWHM; whiskers: as long as the ellipticity, along the major axis. */
static void draw_whiskers(rx_figures *dst, const rx_tile_quality *q, int stars, double low, double high)
{
    const rx_image *image = &q->about->image;
    const rx_tile_point *points = stars ? q->star : q->grid;
    const int n = stars ? q->nstars : q->ngrid;
    /* a whisker of ellipticity 0.1 is one such part of the longer side, a smaller one where many would cover each other */
    const int part = (int)lround(12 * fmax(1, sqrt(n / 100.0)));
    const double length = 10.0 / part * fmax(image->width, image->height);
    const rx_axes axes = axes_of(image->width, image->height);
    const char *size = stars ? "0.9" : "1.6";
    char reading[400];
    double *values = RX_NEW(double, 5 * (size_t)n), *v = values;
    dst->script.failed |= values == NULL;
    snprintf(reading, sizeof reading,
             "%s Colour: FWHM, as in the other map; whiskers: along the major axis, 1 - b/a = 0.1 is as long "
             "as 1/%d of the longer side.",
             !stars      ? "The PSF on a grid."
             : q->chosen ? "Sources as small as the PSF, on their own pixels (no list of stars made the PSF)."
                         : "The stars that made the PSF, on their own pixels.",
             part);
    for (int i = 0; i < n && values != NULL; i++) {
        const rx_tile_ellipse *s = stars ? &points[i].shape : &points[i].psf;
        const double half = 0.5 * length * s->ellipticity;
        *v++ = points[i].x + 1;
        *v++ = points[i].y + 1;
        *v++ = s->fwhm;
        *v++ = half * cos(s->theta);
        *v++ = half * sin(s->theta);
    }
    rx_figure_add(dst, stars ? "star-whiskers" : "tile-whiskers",
                  stars ? "Seeing and ellipticity of stars" : "Seeing and ellipticity of the PSF", reading,
                  RX_FIGURE_CHART);
    rx_plot_coloured_begin(
        dst, &axes, &(rx_coloured){RX_PLOT_VIRIDIS, "FWHM [pixels]", low, high, values ? n : 0, 5, values});
    rx_text_printf(&dst->script,
                   "$data using 1:2:3 with points pt %d ps %s palette notitle, $data using 1:2 with points "
                   "pt %d ps %s lw 0.7 lc rgb '#808080' notitle, $data using ($1-$4):($2-$5):(2*$4):(2*$5) "
                   "with vectors nohead lc rgb '#404040' lw 1.6 notitle",
                   stars ? 7 : 5, size, stars ? 6 : 4, size);
    rx_plot_coloured_end(dst);
    free(values);
}

static void whiskers(rx_figures *dst, const rx_tile_quality *q)
{
    double values[RX_TILE_GRID * RX_TILE_GRID + RX_TILE_STARS], low, high;
    size_t n = 0;
    for (int i = 0; i < q->ngrid; i++)
        values[n++] = q->grid[i].psf.fwhm;
    for (int i = 0; i < q->nstars; i++)
        values[n++] = q->star[i].shape.fwhm;
    reach(values, n, &low, &high);
    if (high - low < 0.02 * low) { /* no colours for nothing */
        low *= 0.99;
        high *= 1.01;
    }
    if (q->ngrid > 0)
        draw_whiskers(dst, q, 0, low, high);
    if (q->nstars > 0)
        draw_whiskers(dst, q, 1, low, high);
}

static void pulls(rx_figures *dst, const rx_tile_quality *q)
{
    rx_curves c = {0};
    rx_curves_add(&c, RX_CURVE_LINE, -1, "unit normal");
    for (double x = -6.1; x < 6.11; x += 0.1)
        rx_curves_put(&c, x, fmax(exp(-0.5 * x * x) / sqrt(2 * M_PI), 1e-9), NAN, NAN);
    rx_curves_add(&c, RX_CURVE_STEPS, 0, "pixels without sources");
    for (int b = 0; b < RX_TILE_PULLS; b++)
        rx_curves_put(&c, -6.1 + 0.2 * (b + 1), fmax(q->pull[b] / (0.2 * q->pulls), 1e-9), NAN, NAN);
    rx_curves_figure(
        dst, "tile-pulls", "Noise of pixels without sources",
        "(pixel - sky) / noise; the outer bins hold all that is further out. A wider histogram: the noise "
        "map is too low; a tail on the right alone is light of sources too faint to be found.",
        &(rx_axes){"(pixel - sky) / noise  [sigma]", "share of pixels per sigma", -6.3, 6.3, 1e-7, 1, false,
                   true},
        &c);
}

static void correlation(rx_figures *dst, const rx_tile_quality *q)
{
    const rx_noise_correlation *noise = q->about->image.correlation;
    double most = 0.05;
    if (noise == NULL || noise->origin == RX_NOISE_WHITE || noise->origin == RX_NOISE_UNKNOWN)
        return;
    const double(*at)[RX_NOISE_SIDE] = noise->origin == RX_NOISE_MEASURED ? noise->measured : noise->at;
    for (int k = 0; k < RX_NOISE_SIDE * RX_NOISE_SIDE; k++)
        if (k != RX_NOISE_REACH * (RX_NOISE_SIDE + 1))
            most = fmax(most, fabs(at[k / RX_NOISE_SIDE][k % RX_NOISE_SIDE]));
    rx_figure_add(dst, "tile-correlation", "Correlation of the noise",
                  "Of pixels so far apart; the middle, which is 1, is cut. Grey: none. Resampling leaves red "
                  "around the middle, fringes and stripes a pattern.",
                  RX_FIGURE_CHART);
    const double end = RX_NOISE_REACH + 0.5;
    const rx_axes axes = {"dx [pixels]", "dy [pixels]", -end, end, -end, end, false, false};
    rx_plot_coloured_begin(dst, &axes,
                           &(rx_coloured){"(-1 '#2166ac', 0 '#dddddd', 1 '#b2182b')", "correlation", -most,
                                          most, RX_NOISE_SIDE, RX_NOISE_SIDE, at[0]});
    rx_text_printf(&dst->script, "$data matrix using ($1-%d):($2-%d):3 with image notitle", RX_NOISE_REACH,
                   RX_NOISE_REACH);
    rx_plot_coloured_end(dst);
}

/* Is there a star of the PSF there? */
static int made_psf(const rx_psf *psf, const rx_source *s)
{
    for (int i = 0; psf != NULL && psf->stars != NULL && i < psf->nstars; i++)
        if (hypot(psf->stars[i][0] - s->x, psf->stars[i][1] - s->y) < 2)
            return 1;
    return 0;
}

/* Did a fallback leave this run nothing that the first one does not show? */
static int is_repeated(const rx_tile_about *about, int run)
{
    return run > 0 && about->runs[run].plain && about->runs[run].about->by != NULL;
}

static void locus(rx_figures *dst, const rx_tile_quality *q, int run)
{
    const rx_image *image = &q->about->image;
    const rx_tile_restored *of = &q->about->runs[run];
    const rx_sources *sources = of->sources;
    const size_t n = (size_t)sources->n;
    char id[RX_FIGURE_ID], title[80];
    double *radii = RX_NEW(double, 2 * n + 1), *mags = radii + n, r0, r1, m0 = INFINITY, m1 = -INFINITY;
    rx_curves c = {0};
    if (radii == NULL) {
        dst->script.failed = true;
        return;
    }
    for (size_t i = 0; i < n; i++) {
        const rx_source *s = &sources->list[i];
        const double mag = rx_tile_mag(image, s->flux_auto);
        const bool known = isfinite(mag) && s->flux_radius[0] > 0;
        radii[i] = known ? s->flux_radius[0] : NAN;
        mags[i] = known ? mag : NAN;
        m0 = known ? fmin(m0, mag) : m0;
        m1 = known ? fmax(m1, mag) : m1;
    }
    const int step = 1 + sources->n / LOCUS_DOTS;
    rx_curves_add(&c, sources->n < FEW_DOTS ? RX_CURVE_POINTS : RX_CURVE_DOTS,
                  rx_method_color(of->about->name),
                  step > 1 ? "some of all" : "all"); /* dots are too pale for a few */
    for (size_t i = 0; i < n; i += (size_t)step)
        rx_curves_put(&c, radii[i], mags[i], NAN, NAN);
    for (int kind = 0; kind < 2; kind++) {
        rx_curves_add(&c, RX_CURVE_POINTS, kind == 0 ? 6 : 5, kind == 0 ? "made the PSF" : "saturated");
        for (size_t i = 0; i < n; i++)
            if (kind == 0 ? made_psf(image->psf, &sources->list[i])
                          : (sources->list[i].flags & RX_FLAG_SATURATED) != 0)
                rx_curves_put(&c, radii[i], mags[i], NAN, NAN);
    }
    reach(radii, n, &r0, &r1);
    if (of->plain && isfinite(q->half_light)) {
        rx_curves_add(&c, RX_CURVE_LINE, -1, "half-light radius of the PSF");
        rx_curves_put(&c, q->half_light, m0 - 0.5, NAN, NAN);
        rx_curves_put(&c, q->half_light, m1 + 0.5, NAN, NAN);
    }
    snprintf(id, sizeof id, "star-locus-%d", run);
    snprintf(title, sizeof title, "%s: star locus", of->about->name);
    rx_curves_figure(
        dst, id, title,
        "Stars stand in a narrow band whatever their magnitude; galaxies lie to the right of it, hot pixels "
        "and cosmic rays to the left, saturated stars bend to the right at the top.",
        &(rx_axes){"FLUX_RADIUS [pixels]", "MAG_AUTO [mag]", 0, 1.15 * r1, m1 + 0.3, m0 - 0.3, false, false},
        &c);
    free(radii);
}

static void counts(rx_figures *dst, const rx_tile_quality *q)
{
    static const double GALAXIES =
        0.4; /* per mag: Metcalfe et al. 2001, MNRAS 323, 795, B to I at 20 to 25 mag */
    const rx_image *image = &q->about->image;
    const double side = scale_of(image) / 3600.0,
                 pixels = (double)image->width * image->height * (1 - q->masked);
    const double area = side > 0 ? pixels * side * side : 1e-6 * pixels;
    double low = INFINITY, high = -INFINITY, most = 1, at = NAN, here = NAN;
    rx_curves c = {0};
    for (int i = 0; i < q->about->nruns; i++) {
        if (is_repeated(q->about, i))
            continue;
        const rx_tile_counts n = rx_tile_count(image, q->about->runs[i].sources);
        rx_curves_add(&c, RX_CURVE_BARS, rx_method_color(q->about->runs[i].about->name),
                      q->about->runs[i].about->name);
        for (int b = 0; b < n.n; b++) {
            const double mag = n.low + 0.5 * b + 0.25, per = 2 / area;
            if (n.count[b] == 0)
                continue;
            low = fmin(low, mag - 0.25);
            high = fmax(high, mag + 0.25);
            most = fmax(most, n.count[b] * per);
            rx_curves_put(&c, mag, n.count[b] * per, fmax(n.count[b] - sqrt(n.count[b]), 0.3) * per,
                          (n.count[b] + sqrt(n.count[b])) * per);
            if (i == 0 && fabs(mag - n.peak + 1.5) < 0.1) { /* well before they turn over */
                at = mag;
                here = n.count[b] * per;
            }
        }
    }
    if (isfinite(at)) {
        rx_curves_add(&c, RX_CURVE_LINE, -1, "0.4 dex per mag");
        for (int end = 0; end < 2; end++)
            rx_curves_put(&c, end ? high : low, here * pow(10, GALAXIES * ((end ? high : low) - at)), NAN,
                          NAN);
    }
    rx_curves_figure(dst, "tile-counts", "Counts",
                     "Bars: square roots of the counts. The line has the slope of galaxies (0.4 dex per "
                     "mag), through the counts 1.5 mag before they turn over; stars of the Galaxy are "
                     "flatter at the bright end. Where counts fall the tile is not complete.",
                     &(rx_axes){"MAG_AUTO [mag]",
                                side > 0 ? "sources per mag and deg^2" : "sources per mag and Mpixel", low,
                                high, 0.5 / area, 3 * most, false, true},
                     &c);
}

/* A source on the original pixels and on each restored image, means of `step` pixels, beside each other. */
static void cut_out(rx_figures *dst, const rx_tile_quality *q, const rx_tile_cut *cut, int number)
{
    static const char *const kinds[] = {"bright", "blended", "random"};
    const rx_tile_about *about = q->about;
    const rx_image *image = &about->image;
    const rx_source *s = &about->runs[about->nruns - 1].sources->list[cut->source];
    const rx_map sky = rx_image_sky(image);
    const int extent = s->xmax - s->xmin > s->ymax - s->ymin ? s->xmax - s->xmin : s->ymax - s->ymin;
    const int half = extent < LEAST_HALF ? LEAST_HALF : extent > MOST_HALF ? MOST_HALF : extent;
    const int step = (2 * half + PANEL - 1) / PANEL, side = 2 * half / step;
    char id[24], title[160], reading[120] = "original";
    int panels = 1;
    for (int i = 0; i < about->nruns; i++)
        if (!about->runs[i].plain) {
            panels++;
            snprintf(reading + strlen(reading), sizeof reading - strlen(reading), " | %s",
                     about->runs[i].about->name);
        }
    const int width = panels * side + (panels - 1) * GAP;
    const double sigma = q->noise_median > 0 ? q->noise_median : 1;
    float *pixels = RX_NEW(float, (size_t)width *(size_t)side);
    double *copy = RX_NEW(double, (size_t)side *(size_t)side);
    if (pixels == NULL || copy == NULL) {
        dst->script.failed = true;
        goto exit;
    }
    for (int k = 0; k < width * side; k++)
        pixels[k] = INFINITY; /* gaps */
    for (int panel = 0, run = -1; panel < panels; panel++) {
        while (panel > 0 && about->runs[++run].plain)
            ;
        for (int k = 0; k < side * side; k++) {
            double sum = 0;
            for (int j = 0; j < step * step; j++) {
                const int x = (int)lround(s->x) - half + k % side * step + j % step;
                const int y = (int)lround(s->y) - half + k / side * step + j / step;
                if (x < 0 || y < 0 || x >= image->width || y >= image->height)
                    continue;
                const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
                if (panel > 0)
                    sum += (double)about->runs[run].restored->pixels[at];
                else if (!rx_image_hides(image, at))
                    sum += (double)image->pixels[at] - (double)rx_map_at(&sky, x, y);
            }
            const double mean = sum / (step * step);
            pixels[k / side * width + panel * (side + GAP) + k % side] = (float)mean;
            if (panel == 0)
                copy[k] = mean;
        }
    }
    const double high = fmax(rx_quantile(copy, (size_t)side * (size_t)side, 0.995), 10 * sigma);
    for (int k = 0; k < width * side; k++)
        pixels[k] = isinf(pixels[k]) ? (float)high : pixels[k];
    snprintf(id, sizeof id, "cut-%02d", number);
    snprintf(title, sizeof title,
             "%s, NUMBER %d at (%.0f, %.0f), MAG_AUTO %.2f mag, FLAGS %d, %d pixels wide", kinds[cut->kind],
             s->number, s->x + 1, s->y + 1, rx_tile_mag(image, s->flux_auto), s->flags, side * step);
    rx_figure_add(dst, id, title, reading, RX_FIGURE_PICTURE);
    rx_plot_picture(dst, &(rx_grey_image){width, side, 150 * panels, pixels, -2 * sigma, high, 2 * sigma});
exit:
    free(copy);
    free(pixels);
}

/* Ids tile-..., star-..., cut-... */
static void add_figures(rx_figures *dst, const rx_tile_quality *q)
{
    rx_tile_cut cuts[RX_TILE_CUTS];
    const rx_tile_about *about = q->about;
    whiskers(dst, q);
    draw_map(dst, q, &q->sky,
             &(map){"tile-sky", "Sky", "What is taken off the pixels.", "sky [ADU]", INFINITY});
    draw_map(dst, q, &q->noise,
             &(map){"tile-noise", "Noise",
                    "Of a pixel; how deep the tile is goes with it: twice the noise, 0.75 mag less.",
                    "noise [ADU]", INFINITY});
    for (int i = 0; i < about->nruns; i++) {
        char id[RX_FIGURE_ID], title[80], reading[240];
        const rx_tile_restored *run = &about->runs[i];
        if (run->pull.nx == 0)
            continue;
        snprintf(id, sizeof id, "tile-model-%d", i);
        snprintf(title, sizeof title, "%s: what the model leaves", run->about->name);
        snprintf(reading, sizeof reading,
                 "Width of fluxes of point sources fitted to empty places, in their errors: 1 where the "
                 "noise is all there is. %.0f %% of the cells are not explained; %g and above is one colour.",
                 100 * run->unexplained, PULL_MOST);
        draw_map(dst, q, &run->pull, &(map){id, title, reading, "width [errors]", PULL_MOST});
    }
    pulls(dst, q);
    correlation(dst, q);
    for (int i = 0; i < about->nruns; i++)
        if (!is_repeated(about, i))
            locus(dst, q, i);
    counts(dst, q);
    const rx_tile_restored *last = &about->runs[about->nruns - 1];
    const int n = rx_tile_cuts(last->sources, about->seed, cuts);
    if (n < 0)
        dst->script.failed = true;
    for (int i = 0; i < n; i++)
        cut_out(dst, q, &cuts[i], i);
}

/* --- tables --- */

RX_COLUMNS(NUMBERS, RX_TEXT("quantity", NULL), RX_NUMBER("value", -4, "", ""), RX_TEXT("unit", NULL),
           RX_TEXT("what", NULL, "what it is"));

RX_COLUMNS(RUNS, RX_TEXT("run", NULL, "restorer"), RX_TEXT("taken", "restorer that AUTO took", "took"),
           RX_TEXT("why", "why that one"), RX_COUNT("sources", "in the catalogue"),
           RX_NUMBER("per_mpixel", 0, "", "sources per Mpixel that is used"),
           RX_NUMBER("clean", 1, "%", "share with FLAGS 0"),
           RX_NUMBER("turnover", 2, "mag", "MAG_AUTO where counts are highest"),
           RX_MEASURED("slope", 2, "dex/mag", "of counts, up to 0.5 mag before"),
           RX_MEASURED("flux_scale", 4, "", "restored over original flux of isolated sources"),
           RX_NUMBER("not_explained", 1, "%", "share of cells that the model does not explain"),
           RX_ESTIMATE("false_per_mpixel", 1, "",
                       "false detections on noise (BLANK_CHECK), with its interval at 95 %"));

RX_COLUMNS(FLAGS, RX_TEXT("run", NULL, "restorer"), RX_TEXT("column", NULL),
           RX_COUNT("bit", "value in the column"), RX_TEXT("meaning", NULL),
           RX_COUNT("sources", "that have it"), RX_NUMBER("share", 1, "%", "of all sources"));

RX_COLUMNS(REMARKS, RX_TEXT("key", NULL),
           RX_MARKED("mark", "FAIL: numbers are wrong; INSUFFICIENT: look at it"), RX_TEXT("sentence", NULL));

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

static void add_numbers(rx_report *report, const rx_tile_quality *q)
{
    const rx_image *image = &q->about->image;
    const double scale = scale_of(image);
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
    for (int i = 0; i < RX_LENGTH(rows); i++)
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
            100.0 * run->unexplained,
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
    rx_status status;
    own.page = "tile.html";
    own.summary = "tile.json";
    RX_TRY(rx_tile_quality_make(page->about, &q, err));
    rx_report *report = rx_report_new("Tile: ", page->about->name);
    if (report == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    rx_report_fact(report, "format", "rextract tile 1");
    rx_report_fact(report, "tile", page->about->name);
    add_verdict(report, q);
    if (own.figures)
        add_figures(rx_report_figures_of(report), q);
    place(report, "seeing", "Seeing, sky, noise", "tile-");
    place(report, "stars", "Stars", "star-");
    if (place(report, "cuts", "Cut-outs", "cut-"))
        rx_report_note(
            report,
            "Five of the brightest sources, the five brightest blended ones of the others, five by chance "
            "(SEED); original pixels less the sky, and what each restorer makes of them. Grey: asinh(p / "
            "2&sigma;), black at &minus;2&sigma;, white where 99.5 % of the original cut-out is darker.");
    add_numbers(report, q);
    add_runs(report, q);
    add_flags(report, q);
    rx_report_table *stars = RX_REPORT_TABLE(report, "tile_stars", STARS, RX_REPORT_IN_FILE);
    for (const rx_tile_point *p = q->star; p < q->star + q->nstars; p++)
        rx_report_put(stars, p->x + 1, p->y + 1, p->shape.fwhm, p->shape.ellipticity,
                      p->shape.theta * 180 / M_PI, p->psf.fwhm, p->psf.ellipticity,
                      p->psf.theta * 180 / M_PI);
    if (page->nrecord > 0) {
        rx_report_section(report, "record", "What made this page");
        rx_report_record(report, page->nrecord, page->record);
    }
    status = rx_report_write(report, &own, NULL, err);
    *found = (rx_tile_page_facts){0};
    for (int i = 0; i < q->nremarks; i++) {
        found->wrong += q->remark[i].bad;
        found->look += !q->remark[i].bad;
    }
exit:
    rx_report_free(report);
    rx_tile_quality_free(q);
    return status;
}
