/* Figures of a tile's page. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/stats.h"
#include "report/figure.h"
#include "report/tile_page.h"

enum { PANEL = 72, GAP = 2, LEAST_HALF = 14, MOST_HALF = 128, LOCUS_DOTS = 600, FEW_DOTS = 60, HOVER = 150 };
static const double CHI2_MOST = 5;

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
    return (rx_axes){.xlabel = "X_IMAGE [pixels]",
                     .ylabel = "Y_IMAGE [pixels]",
                     .x0 = 0.5,
                     .x1 = width + 0.5,
                     .y0 = 0.5,
                     .y1 = height + 0.5};
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
    char reading[400], hover[320];
    double *values = RX_NEW(double, 5 * (size_t)n), *v = values;
    dst->script.failed |= values == NULL;
    snprintf(hover, sizeof hover,
             ", $data using 1:2:(sprintf('x %%.0f, y %%.0f: FWHM %%.3g pixels, 1 - b/a %%.3f, major axis "
             "%%.0f deg from x', $1, $2, $3, sqrt($4*$4+$5*$5)*%.9g, 180/pi*atan2($5, $4 + 1e-30))) "
             "with labels hypertext point pt 7 ps 0.9 notitle",
             2 / length); /* gnuplot has no atan2(0, 0) */
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
    rx_text_printf(
        &dst->script,
        "$data using 1:2:3 with points pt %d ps %s palette notitle, $data using 1:2 with points "
        "pt %d ps %s lw 0.7 lc rgb '#808080' notitle, $data using ($1-$4):($2-$5):(2*$4):(2*$5) with "
        "vectors nohead lc rgb '#404040' lw 1.6 notitle%s",
        stars ? 7 : 5, size, stars ? 6 : 4, size, n <= HOVER ? hover : "");
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
    rx_curves_figure(dst, "tile-pulls", "Noise of pixels without sources",
                     "(pixel - sky) / noise; the outer bins hold all that is further out. A wider histogram: "
                     "the noise map is too low; "
                     "a tail on the right alone is light of sources too faint to be found.",
                     &(rx_axes){.xlabel = "(pixel - sky) / noise  [sigma]",
                                .ylabel = "share of pixels per sigma",
                                .x0 = -6.3,
                                .x1 = 6.3,
                                .y0 = 1e-7,
                                .y1 = 1,
                                .log_y = true},
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
                  "around the middle, "
                  "fringes and stripes a pattern.",
                  RX_FIGURE_CHART);
    const rx_axes axes = {.xlabel = "dx [pixels]",
                          .ylabel = "dy [pixels]",
                          .x0 = -RX_NOISE_REACH - 0.5,
                          .x1 = RX_NOISE_REACH + 0.5,
                          .y0 = -RX_NOISE_REACH - 0.5,
                          .y1 = RX_NOISE_REACH + 0.5};
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
    char id[RX_FIGURE_ID], title[80];
    double *radii = RX_NEW(double, (size_t)sources->n + 1), *mags = RX_NEW(double, (size_t)sources->n + 1),
           r0, r1, m0, m1;
    rx_curves c = {0};
    for (int i = 0; i < sources->n && radii != NULL && mags != NULL; i++) {
        const rx_source *s = &sources->list[i];
        mags[i] = rx_tile_mag(image, s->flux_auto);
        radii[i] = isfinite(mags[i]) && s->flux_radius[0] > 0 ? s->flux_radius[0] : NAN;
    }
    if (radii == NULL || mags == NULL) {
        dst->script.failed = true;
        free(radii);
        free(mags);
        return;
    }
    const int step = 1 + sources->n / LOCUS_DOTS;
    rx_curves_add(&c, sources->n < FEW_DOTS ? RX_CURVE_POINTS : RX_CURVE_DOTS,
                  rx_method_color(of->about->name),
                  step > 1 ? "some of all" : "all"); /* dots are too pale for a few */
    for (int i = 0; i < sources->n; i += step)
        rx_curves_put(&c, radii[i], mags[i], NAN, NAN);
    for (int kind = 0; kind < 2; kind++) {
        rx_curves_add(&c, RX_CURVE_POINTS, kind == 0 ? 6 : 5, kind == 0 ? "made the PSF" : "saturated");
        for (int i = 0; i < sources->n; i++)
            if (kind == 0 ? made_psf(image->psf, &sources->list[i])
                          : (sources->list[i].flags & RX_FLAG_SATURATED) != 0)
                rx_curves_put(&c, radii[i], mags[i], NAN, NAN);
    }
    reach(radii, (size_t)sources->n, &r0, &r1);
    for (int i = 0; i < sources->n; i++)
        mags[i] = isfinite(radii[i]) ? mags[i] : NAN;
    m0 = INFINITY;
    m1 = -INFINITY;
    for (int i = 0; i < sources->n; i++)
        if (isfinite(mags[i])) {
            m0 = fmin(m0, mags[i]);
            m1 = fmax(m1, mags[i]);
        }
    if (of->plain && isfinite(q->half_light)) {
        rx_curves_add(&c, RX_CURVE_LINE, -1, "half-light radius of the PSF");
        rx_curves_put(&c, q->half_light, m0 - 0.5, NAN, NAN);
        rx_curves_put(&c, q->half_light, m1 + 0.5, NAN, NAN);
    }
    snprintf(id, sizeof id, "star-locus-%d", run);
    snprintf(title, sizeof title, "%s: star locus", of->about->name);
    rx_curves_figure(dst, id, title,
                     "Stars stand in a narrow band whatever their magnitude; galaxies lie to the right of "
                     "it, hot pixels and cosmic "
                     "rays to the left, saturated stars bend to the right at the top.",
                     &(rx_axes){.xlabel = "FLUX_RADIUS [pixels]",
                                .ylabel = "MAG_AUTO [mag]",
                                .x0 = 0,
                                .x1 = 1.15 * r1,
                                .y0 = m1 + 0.3,
                                .y1 = m0 - 0.3},
                     &c);
    free(radii);
    free(mags);
}

static void counts(rx_figures *dst, const rx_tile_quality *q)
{
    static const double GALAXIES =
        0.4; /* per mag: Metcalfe et al. 2001, MNRAS 323, 795, B to I at 20 to 25 mag */
    const rx_image *image = &q->about->image;
    const double side = rx_tile_scale(image) / 3600.0,
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
    rx_curves_figure(
        dst, "tile-counts", "Counts",
        "Bars: square roots of the counts. The line has the slope of galaxies (0.4 dex per mag), through the "
        "counts 1.5 mag "
        "before they turn over; stars of the Galaxy are flatter at the bright end. Where counts fall the "
        "tile is not complete.",
        &(rx_axes){.xlabel = "MAG_AUTO [mag]",
                   .ylabel = side > 0 ? "sources per mag and deg^2" : "sources per mag and Mpixel",
                   .x0 = low,
                   .x1 = high,
                   .y0 = 0.5 / area,
                   .y1 = 3 * most,
                   .log_y = true},
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
    rx_plot_picture(dst, &(rx_grey_image){.width = width,
                                          .height = side,
                                          .side = 150 * panels,
                                          .pixels = pixels,
                                          .low = -2 * sigma,
                                          .high = high,
                                          .soft = 2 * sigma});
exit:
    free(copy);
    free(pixels);
}

void rx_tile_figures(rx_figures *dst, const rx_tile_quality *q)
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
        if (about->runs[i].chi2.cells.nx == 0 || is_repeated(about, i))
            continue;
        snprintf(id, sizeof id, "tile-chi2-%d", i);
        snprintf(title, sizeof title, "%s: residual chi2", about->runs[i].about->name);
        snprintf(reading, sizeof reading,
                 "Mean square of (pixels - %s) / noise, 1 where all is explained. Bright where a PSF, a sky "
                 "or a noise map is wrong, and at bright stars; 5 and above is one colour.",
                 about->runs[i].chi2.of);
        draw_map(dst, q, &about->runs[i].chi2.cells,
                 &(map){id, title, reading, "chi2 of a pixel", CHI2_MOST});
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
