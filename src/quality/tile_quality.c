/* Quality of a tile without a reference. */
#include "quality/tile_quality.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/random.h"
#include "num/stats.h"

/* What makes a remark; docs/qa.md has them in words. */
static const double ELONGATED = 0.15, SPREAD = 0.2, WIDER = 0.03, WIDTH_LOW = 0.9, WIDTH_HIGH = 1.15,
                    MASKED = 0.1, SATURATED = 0.01, SLOPE = 3.0, TAIL = 20, GROWTH = 0.01, SCATTER = 0.06;

static size_t cells_of(const rx_tile_cells *cells)
{
    return (size_t)cells->nx * (size_t)cells->ny;
}

/* While pixels come by: sums of the cells, and behind them the counts. */
static rx_status begin(const rx_image *image, rx_tile_cells *dst, rx_error *err)
{
    const int longer = image->width > image->height ? image->width : image->height;
    dst->side = longer / RX_TILE_CELLS > 15 ? (longer + RX_TILE_CELLS - 1) / RX_TILE_CELLS : 16;
    dst->nx = (image->width + dst->side - 1) / dst->side;
    dst->ny = (image->height + dst->side - 1) / dst->side;
    return RX_MAKE(dst->value, 2 * cells_of(dst), err);
}

static void count(rx_tile_cells *c, int x, int y, double value)
{
    double *sum = c->value + (size_t)(y / c->side) * (size_t)c->nx + (size_t)(x / c->side);
    *sum += value;
    sum[cells_of(c)]++;
}

/* Sums become means; of cells with less than a tenth of their pixels nothing is said. */
static void finish(rx_tile_cells *c)
{
    const double *n = c->value + cells_of(c);
    for (size_t k = 0; k < cells_of(c); k++)
        c->value[k] = n[k] > 0.1 * c->side * c->side ? c->value[k] / n[k] : NAN;
}

/* Quantiles of the cells that say something. */
static rx_status quantiles(const rx_tile_cells *cells, int n, const double *q, double *dst, rx_error *err)
{
    const size_t all = cells_of(cells);
    double *copy;
    size_t m = 0;
    RX_TRY(RX_MAKE(copy, all + 1, err));
    for (size_t k = 0; k < all; k++)
        if (isfinite(cells->value[k]))
            copy[m++] = cells->value[k];
    for (int i = 0; i < n; i++)
        dst[i] = m > 0 ? rx_quantile(copy, m, q[i]) : NAN;
    free(copy);
    return RX_OK;
}

/* --- shapes --- */

typedef struct moments {
    double xx, yy, xy;
} moments;

/* One pass around (*x, *y), which moves to the centroid; 0: no light there. */
static int weigh(const float *pixels, int width, int height, double *x, double *y, double s2, moments *m)
{
    const int reach = (int)ceil(4 * sqrt(s2)), cx = (int)lround(*x), cy = (int)lround(*y);
    double sum = 0, mx = 0, my = 0;
    *m = (moments){0};
    if (cx - reach < 0 || cy - reach < 0 || cx + reach >= width || cy + reach >= height)
        return 0;
    for (int j = cy - reach; j <= cy + reach; j++)
        for (int i = cx - reach; i <= cx + reach; i++) {
            const double u = i - *x, v = j - *y;
            const double p =
                (double)pixels[(size_t)j * (size_t)width + (size_t)i] * exp(-0.5 * (u * u + v * v) / s2);
            sum += p;
            mx += p * u;
            my += p * v;
            m->xx += p * u * u;
            m->yy += p * v * v;
            m->xy += p * u * v;
        }
    if (!(sum > 0))
        return 0;
    mx /= sum;
    my /= sum;
    *m = (moments){m->xx / sum - mx * mx, m->yy / sum - my * my, m->xy / sum - mx * my};
    *x += 2 * mx; /* half of the way is the weight's */
    *y += 2 * my;
    return fabs(mx) < reach && fabs(my) < reach;
}

/* The shape around (x, y) of pixels, a row `width` long; all of them count. */
static rx_tile_ellipse ellipse_of(const float *pixels, int width, int height, double x, double y, double fwhm)
{
    const double s2 = fwhm * fwhm / 5.545177444; /* 8 ln 2 */
    const double x0 = x, y0 = y;
    moments m;
    for (int pass = 0; pass < 4; pass++)
        if (!weigh(pixels, width, height, &x, &y, s2, &m) || hypot(x - x0, y - y0) > fwhm)
            return (rx_tile_ellipse){0};
    const double det = m.xx * m.yy - m.xy * m.xy;
    if (!(det > 0))
        return (rx_tile_ellipse){0};
    const double a = m.yy / det - 1 / s2, b = m.xx / det - 1 / s2, c = -m.xy / det, inverse = a * b - c * c;
    if (!(inverse > 0) || !(a > 0))
        return (rx_tile_ellipse){0};
    const double cxx = b / inverse, cyy = a / inverse, cxy = -c / inverse;
    const double half = 0.5 * (cxx + cyy), spread = hypot(0.5 * (cxx - cyy), cxy);
    return (rx_tile_ellipse){.fwhm = RX_FWHM_SIGMA * pow(cxx * cyy - cxy * cxy, 0.25),
                             .ellipticity = 1 - sqrt(fmax(half - spread, 0) / (half + spread)),
                             .theta = 0.5 * atan2(2 * cxy, cxx - cyy)};
}

/* Radius of half of the light of a stamp about its middle, pixels cut in FINE x FINE. */
static rx_status half_light(const float *stamp, int size, double *dst, rx_error *err)
{
    enum { FINE = 5, RINGS = 20, MOST = 1024 * RINGS };
    double *ring, all = 0, within = 0, radius = NAN;
    RX_TRY(RX_MAKE(ring, MOST, err));
    const double middle = 0.5 * size;
    for (int k = 0; k < size * size; k++)
        for (int j = 0; j < FINE * FINE; j++) {
            const double u = k % size + (j % FINE + 0.5) / FINE - middle,
                         v = (double)(k / size) + ((double)(j / FINE) + 0.5) / FINE - middle;
            ring[(int)fmin(RINGS * hypot(u, v), MOST - 1)] += stamp[k];
            all += stamp[k];
        }
    for (int i = 0; i < MOST && isnan(radius); i++) {
        within += ring[i];
        if (within >= 0.5 * all)
            radius = (i + 0.5) / RINGS;
    }
    free(ring);
    *dst = radius;
    return RX_OK;
}

static rx_tile_ellipse psf_moments(const rx_psf *psf, float *stamp, double x, double y)
{
    rx_psf_at(psf, x, y, stamp);
    return ellipse_of(stamp, psf->size, psf->size, psf->size / 2, psf->size / 2, psf->fwhm);
}

/* Moments hold the pixel and the wings: their widths are scaled so that the PSF's at the centre is its FWHM. */
static rx_tile_ellipse scaled(const rx_tile_quality *q, rx_tile_ellipse shape)
{
    shape.fwhm *= q->moments_to_fwhm;
    return shape;
}

static void shape_grid(rx_tile_quality *q, float *stamp)
{
    const rx_image *image = &q->about->image;
    const rx_psf *psf = image->psf;
    double e1 = 0, e2 = 0;
    const double centre = psf_moments(psf, stamp, 0.5 * (image->width - 1), 0.5 * (image->height - 1)).fwhm;
    q->moments_to_fwhm = centre > 0 ? psf->fwhm / centre : NAN;
    for (int j = 0; j < RX_TILE_GRID; j++)
        for (int i = 0; i < RX_TILE_GRID; i++) {
            rx_tile_point *p = &q->grid[q->ngrid];
            p->x = (i + 0.5) / RX_TILE_GRID * image->width - 0.5;
            p->y = (j + 0.5) / RX_TILE_GRID * image->height - 0.5;
            p->psf = scaled(q, psf_moments(psf, stamp, p->x, p->y));
            if (!(p->psf.fwhm > 0))
                continue;
            q->ngrid++;
            q->fwhm_low = fmin(q->fwhm_low, p->psf.fwhm);
            q->fwhm_high = fmax(q->fwhm_high, p->psf.fwhm);
            e1 += p->psf.ellipticity * cos(2 * p->psf.theta);
            e2 += p->psf.ellipticity * sin(2 * p->psf.theta);
        }
    q->fwhm = q->ngrid > 0 ? psf->fwhm : NAN;
    q->ellipticity = hypot(e1, e2) / q->ngrid;
}

/* A star on its own pixels, above the sky; rejected where it touches what is hidden. */
static void add_star(rx_tile_quality *q, float *stamp, float *room, double x, double y)
{
    const rx_image *image = &q->about->image;
    const rx_psf *psf = image->psf;
    const rx_map sky = rx_image_sky(image);
    const int reach = (int)ceil(4 * psf->fwhm / RX_FWHM_SIGMA) + 2, side = 2 * reach + 1;
    const int x0 = (int)lround(x) - reach, y0 = (int)lround(y) - reach;
    if (q->nstars == RX_TILE_STARS || x0 < 0 || y0 < 0 || x0 + side > image->width ||
        y0 + side > image->height)
        return;
    const int32_t *segments = q->about->runs[0].sources->segments;
    const int32_t own = segments[(size_t)(y0 + reach) * (size_t)image->width + (size_t)(x0 + reach)];
    for (int j = 0; j < side; j++)
        for (int i = 0; i < side; i++) {
            const size_t k = (size_t)(y0 + j) * (size_t)image->width + (size_t)(x0 + i);
            const int near = hypot(i - reach, j - reach) < psf->fwhm;
            if (near && image->mask != NULL && (image->mask[k] & (image->hide | RX_MASK_SATURATED)) != 0)
                return;
            const int32_t segment = segments[k];
            room[j * side + i] = rx_image_hides(image, k) || (segment != 0 && segment != own)
                                     ? NAN
                                     : image->pixels[k] - rx_map_at(&sky, x0 + i, y0 + j);
        }
    for (int k = 0; k < side * side; k++) /* what is a neighbour's, or hidden: as on the other side */
        if (isnan(room[k]))
            room[k] = isnan(room[side * side - 1 - k]) ? 0 : room[side * side - 1 - k];
    rx_tile_point *p = &q->star[q->nstars];
    *p = (rx_tile_point){.x = x,
                         .y = y,
                         .shape = scaled(q, ellipse_of(room, side, side, x - x0, y - y0, psf->fwhm)),
                         .psf = scaled(q, psf_moments(psf, stamp, x, y))};
    q->nstars += p->shape.fwhm > 0 && p->psf.fwhm > 0;
}

/* The stars that made the PSF, or where it is from elsewhere those sources that are as small as it. */
static rx_status measure_stars(rx_tile_quality *q, float *stamp, float *room, rx_error *err)
{
    const rx_psf *psf = q->about->image.psf;
    const rx_tile_restored *run = &q->about->runs[0];
    double *wider, median = NAN;
    size_t n = 0;
    for (int i = 0; i < psf->nstars && psf->stars != NULL; i++)
        add_star(q, stamp, room, psf->stars[i][0], psf->stars[i][1]);
    q->chosen = q->nstars == 0;
    const double small =
        run->plain || run->restored->psf == NULL ? q->half_light : 0.45 * run->restored->psf->fwhm;
    for (int i = 0; i < run->sources->n && q->chosen; i++) {
        const rx_source *s = &run->sources->list[i];
        if (s->flags == 0 && s->flux_auto > 30 * s->fluxerr_auto &&
            fabs(s->flux_radius[0] / small - 1) < 0.15)
            add_star(q, stamp, room, s->x, s->y);
    }
    RX_TRY(RX_MAKE(wider, (size_t)q->nstars + 1, err));
    for (int i = 0; i < q->nstars; i++)
        wider[n++] = q->star[i].shape.fwhm / q->star[i].psf.fwhm - 1;
    q->wider_scatter = n > 1 ? rx_sigma_mad(wider, n, &median) : NAN;
    q->wider_error = RX_MEDIAN_ERROR * q->wider_scatter / sqrt((double)n);
    q->wider = median;
    q->wider_n = (double)n;
    free(wider);
    return RX_OK;
}

/* --- sky and noise --- */

double rx_tile_mag(const rx_image *image, double flux)
{
    return flux > 0 ? image->zeropoint - 2.5 * log10(flux) : NAN;
}

double rx_tile_depth(const rx_image *image)
{
    if (image->psf == NULL || image->psf->fwhm <= 0)
        return NAN;
    const double factor =
        rx_noise_factor(image->correlation, image->psf->basis, image->psf->size, image->psf->size);
    const double area = rx_psf_noise_area(image->psf, 0.5 * (image->width - 1), 0.5 * (image->height - 1));
    return rx_tile_mag(image, 5 * image->global_noise * factor * sqrt(area));
}

static double quartile_of(const double *pull, double all, double q)
{
    double sum = 0;
    for (int b = 0; b < RX_TILE_PULLS; b++) {
        if (sum + pull[b] >= q * all && pull[b] > 0)
            return -6.1 + 0.2 * (b + (q * all - sum) / pull[b]);
        sum += pull[b];
    }
    return NAN;
}

static rx_status measure_pixels(rx_tile_quality *q, rx_error *err)
{
    const rx_image *image = &q->about->image;
    const int32_t *segments = q->about->runs[0].sources->segments;
    const rx_map sky = image->level, noise = image->noise;
    double hidden = 0, saturated = 0;
    RX_TRY(begin(image, &q->sky, err));
    RX_TRY(begin(image, &q->noise, err));
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x += RX_MAP_PIECE) {
            const int n = rx_map_piece(x, image->width);
            float room[2][RX_MAP_PIECE];
            const float *level = rx_map_row(&sky, y, x, n, room[0]),
                        *sigma = rx_map_row(&noise, y, x, n, room[1]);
            for (int i = 0; i < n; i++) {
                const size_t k = (size_t)y * (size_t)image->width + (size_t)(x + i);
                saturated += image->mask != NULL && (image->mask[k] & RX_MASK_SATURATED) != 0;
                if (rx_image_hides(image, k) || !(sigma[i] > 0)) {
                    hidden++;
                    continue;
                }
                count(&q->sky, x + i, y, level[i]);
                count(&q->noise, x + i, y, sigma[i]);
                if (segments[k] != 0)
                    continue;
                const double d =
                    ((double)image->pixels[k] - (image->with_sky ? (double)level[i] : 0)) / (double)sigma[i];
                const double b = floor((d + 6.1) / 0.2);
                q->pulls++;
                q->below += d < -5;
                q->above += d > 5;
                q->pull[b < 0 ? 0 : b >= RX_TILE_PULLS ? RX_TILE_PULLS - 1 : (int)b]++;
            }
        }
    finish(&q->sky);
    finish(&q->noise);
    const double all = (double)image->width * image->height;
    q->masked = hidden / all;
    q->saturated = saturated / all;
    q->width = (quartile_of(q->pull, q->pulls, 0.75) - quartile_of(q->pull, q->pulls, 0.25)) / 1.34898;
    double sky_at[3];
    RX_TRY(quantiles(&q->sky, 3, (const double[]){0.05, 0.5, 0.95}, sky_at, err));
    RX_TRY(quantiles(&q->noise, 1, (const double[]){0.5}, &q->noise_median, err));
    q->sky_median = sky_at[1];
    q->sky_range = sky_at[2] - sky_at[0];
    return RX_OK;
}

/* --- remarks --- */

RX_PRINTF(4, 5)
static void remark(rx_tile_quality *q, const char *key, int bad, const char *format, ...)
{
    if (q->nremarks == RX_TILE_REMARKS)
        return;
    rx_tile_remark *r = &q->remark[q->nremarks++];
    va_list list;
    va_start(list, format);
    *r = (rx_tile_remark){.key = key, .bad = bad};
    vsnprintf(r->sentence, sizeof r->sentence, format, list);
    va_end(list);
}

/* Are bright sources smaller than all the stars that made the PSF? Then those are no stars. */
static void check_locus(rx_tile_quality *q)
{
    static const double BRIGHT = 50, SMALLER = 0.85;
    const rx_psf *psf = q->about->image.psf;
    const rx_tile_restored *run = &q->about->runs[0];
    const double seen = run->plain ? 1 : NAN; /* sizes on a restored image are others */
    double smallest = INFINITY;
    int bright = 0, smaller = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < run->sources->n; i++) {
            const rx_source *s = &run->sources->list[i];
            const double radius = seen * s->flux_radius[0];
            if (s->flags != 0 || !(radius > 0) || !(s->flux_auto > BRIGHT * s->fluxerr_auto))
                continue;
            if (pass == 0)
                for (int k = 0; k < psf->nstars && psf->stars != NULL; k++)
                    smallest = hypot(psf->stars[k][0] - s->x, psf->stars[k][1] - s->y) < 2
                                   ? fmin(smallest, radius)
                                   : smallest;
            bright += pass;
            smaller += pass && radius < SMALLER * smallest;
        }
    if (isfinite(smallest) && smaller > 5 && smaller > psf->nstars)
        remark(q, "locus", 1,
               "%d of %d clean sources above S/N 50 are smaller than all of the %d that made the PSF: these "
               "are no stars, or those no sources; give PSF_STARS_NAME.",
               smaller, bright, psf->nstars);
}

static void check_psf(rx_tile_quality *q)
{
    const rx_psf *psf = q->about->image.psf;
    if (psf == NULL) {
        remark(q, "psf", 1, "No PSF is known: nothing is restored, and no flux of a point source is exact.");
        return;
    }
    const rx_psf_how how = psf->quality.how;
    if (how != RX_PSF_BY_NOTHING && how != RX_PSF_BY_PIXELS && how != RX_PSF_BY_MOFFAT)
        remark(q, "psf", 0,
               "The PSF is not from several stars of the tile itself, but %s (RXPSFHOW): give PSF_TYPE PSFEX "
               "or FILE.",
               rx_psf_how_name(how));
    check_locus(q);
    if (fabs(psf->quality.growth) > GROWTH)
        remark(q, "growth", 1,
               "The curve of growth of stars differs from that of the PSF by %.1f %%: template fluxes may be "
               "off by as much.",
               100 * psf->quality.growth);
    if (q->ellipticity > ELONGATED)
        remark(q, "ellipticity", 0, "The PSF is elongated, 1 - b/a = %.2f on average: tracking, wind, focus?",
               q->ellipticity);
    if (q->fwhm_high - q->fwhm_low > SPREAD * q->fwhm)
        remark(q, "seeing", 0,
               "The PSF's FWHM goes from %.2f to %.2f pixels over the tile: tilt, field curvature?",
               q->fwhm_low, q->fwhm_high);
    if (q->wider_n >= 5 && fabs(q->wider) > WIDER && fabs(q->wider) > 3 * q->wider_error)
        remark(q, "width", 0,
               "Stars are %.1f +- %.1f %% %s than the PSF (%.0f stars): is it that of another exposure?",
               100 * fabs(q->wider), 100 * q->wider_error, q->wider > 0 ? "wider" : "narrower", q->wider_n);
    if (q->wider_n >= 10 && q->wider_scatter > SCATTER)
        remark(q, "scatter", 0,
               "FWHM of stars scatters by %.0f %% about that of the PSF (%.0f stars): does it vary over the "
               "tile, are they stars?",
               100 * q->wider_scatter, q->wider_n);
}

static void check_noise(rx_tile_quality *q)
{
    const rx_noise_correlation *noise = q->about->image.correlation;
    if (q->width < WIDTH_LOW || q->width > WIDTH_HIGH)
        remark(q, "noise", 1,
               "Pixels without sources scatter by %.2f times what the noise map says: errors and thresholds "
               "are off by as much.",
               q->width);
    if (noise != NULL && rx_noise_is_structure(noise))
        remark(q, "structure", 1,
               "Noise of sums is %.1f times that of independent pixels, more than resampling explains: "
               "fringes, light that fills the tile?",
               q->noise_factor);
    if (noise != NULL && rx_noise_uneven(noise))
        remark(q, "uneven", 0, "The correlation of the noise differs from quadrant to quadrant.");
    const double mpixels = 1e-6 * q->pulls;
    if (q->below > TAIL * mpixels && q->below >= 5)
        remark(q, "holes", 0,
               "%.0f pixels (%.0f per Mpixel of sky) lie more than 5 sigma below the sky: dead pixels, "
               "holes, a dark frame?",
               q->below, q->below / mpixels);
    if (q->sky_range > SLOPE * q->noise_median)
        remark(q, "sky", 0,
               "The sky varies by %.3g ADU over the tile (5 to 95 %% of it), %.1f times the noise: flat "
               "field, moon, nebula?",
               q->sky_range, q->sky_range / q->noise_median);
    if (q->masked > MASKED)
        remark(q, "masked", 0, "%.0f %% of the pixels are not used.", 100 * q->masked);
    if (q->saturated > SATURATED)
        remark(q, "saturated", 0, "%.1f %% of the pixels are saturated: is SATUR_LEVEL right?",
               100 * q->saturated);
}

static void check_run(rx_tile_quality *q, const rx_tile_restored *run)
{
    const rx_qa_run *about = run->about;
    if (run->sources->n == 0)
        remark(q, "sources", 1, "%s finds no source.", about->name);
    int marked = 0;
    for (int i = 0; i < run->sources->n; i++)
        marked += rx_source_is_spurious(&run->sources->list[i]);
    if (rx_spurious_are_many(marked, run->sources->n))
        remark(q, "spurious", 1,
               "%s: %d of %d sources are marked as spurious (P_REAL below 0.5): are noise, PSF and GAIN "
               "those of these pixels?",
               about->name, marked, run->sources->n);
    if (about->by != NULL)
        remark(q, "fallback", 0, "%s was done by %s instead: %s.", about->name, about->by, about->why);
    char automatic[64] = "";
    if (isfinite(about->flux.automatic))
        snprintf(automatic, sizeof automatic, ", %.3f +- %.3f by FLUX_AUTO", about->flux.automatic,
                 about->flux.automatic_error);
    if (about->flux.n > 0 && about->flux.off)
        remark(q, "flux", 1,
               "%s: the flux scale is off, restored over original %.4f +- %.4f%s (%ld isolated sources).",
               about->name, about->flux.wide, about->flux.wide_error, automatic, about->flux.n);
    if (run->misfit != NULL)
        remark(q, "model", 1, "%s: %s %.2g.", about->name, run->misfit, run->by);
    if (run->outside[0] != '\0' && (run == q->about->runs || strcmp(run->outside, run[-1].outside) != 0))
        remark(q, "outside", 0, "%s was not made for this tile: %s.", about->name, run->outside);
}

rx_status rx_tile_quality_make(const rx_tile_about *about, rx_tile_quality **dst, rx_error *err)
{
    const rx_psf *psf = about->image.psf;
    float *stamp = NULL, *room = NULL;
    rx_tile_quality *q;
    rx_status status;
    RX_TRY(RX_MAKE(q, 1, err));
    q->about = about;
    q->fwhm = q->ellipticity = q->wider = q->wider_error = q->half_light = NAN;
    q->fwhm_low = INFINITY;
    q->fwhm_high = -INFINITY;
    q->depth = rx_tile_depth(&about->image);
    q->noise_factor = rx_noise_factor_wide(about->image.correlation);
    RX_TRY_EXIT(measure_pixels(q, err));
    if (psf != NULL) {
        const size_t reach = (size_t)ceil(4 * psf->fwhm / RX_FWHM_SIGMA) + 2;
        RX_TRY_EXIT(RX_MAKE(stamp, (size_t)psf->size * (size_t)psf->size, err));
        RX_TRY_EXIT(RX_MAKE(room, (2 * reach + 1) * (2 * reach + 1), err));
        rx_psf_at(psf, 0.5 * about->image.width, 0.5 * about->image.height, stamp);
        RX_TRY_EXIT(half_light(stamp, psf->size, &q->half_light, err));
        shape_grid(q, stamp);
        RX_TRY_EXIT(measure_stars(q, stamp, room, err));
    }
    check_psf(q);
    check_noise(q);
    for (int i = 0; i < about->nruns; i++)
        check_run(q, &about->runs[i]);
    *dst = q;
    q = NULL;
exit:
    free(room);
    free(stamp);
    rx_tile_quality_free(q);
    return status;
}

void rx_tile_quality_free(rx_tile_quality *q)
{
    if (q == NULL)
        return;
    free(q->sky.value);
    free(q->noise.value);
    free(q);
}

/* --- sources --- */

rx_tile_counts rx_tile_count(const rx_image *image, const rx_sources *sources)
{
    rx_tile_counts c = {.low = INFINITY, .slope = NAN, .slope_error = NAN, .peak = NAN};
    double last = -INFINITY, sw = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    int fullest = 0, used = 0;
    for (int i = 0; i < sources->n; i++) {
        const double mag = rx_tile_mag(image, sources->list[i].flux_auto);
        c.low = isfinite(mag) ? fmin(c.low, 0.5 * floor(2 * mag)) : c.low;
        last = isfinite(mag) ? fmax(last, mag) : last;
    }
    if (!isfinite(c.low))
        return c;
    c.n = (int)fmin(RX_TILE_MAGS, floor(2 * (last - c.low)) + 1);
    for (int i = 0; i < sources->n; i++) {
        const double mag = rx_tile_mag(image, sources->list[i].flux_auto), b = floor(2 * (mag - c.low));
        if (b >= 0 && b < c.n)
            c.count[(int)b]++;
    }
    for (int b = 1; b < c.n; b++)
        fullest = c.count[b] > c.count[fullest] ? b : fullest;
    c.peak = c.low + 0.5 * fullest + 0.25;
    for (int b = 0; b + 2 <= fullest; b++) { /* N +- sqrt(N): log10 N +- 0.434 / sqrt(N) */
        const double w = c.count[b], x = 0.5 * b, y = w > 0 ? log10(w) : 0;
        sw += w;
        sx += w * x;
        sy += w * y;
        sxx += w * x * x;
        sxy += w * x * y;
        used += w > 0;
    }
    const double det = sw * sxx - sx * sx;
    if (used >= 3 && det > 0) {
        c.slope = (sw * sxy - sx * sy) / det;
        c.slope_error = 0.4343 * sqrt(sw / det);
    }
    return c;
}

int rx_tile_cuts(const rx_sources *sources, uint64_t seed, rx_tile_cut dst[RX_TILE_CUTS])
{
    rx_ranked *order = RX_NEW(rx_ranked, (size_t)sources->n + 1);
    int n = 0, left;
    for (int i = 0; i < sources->n && order != NULL; i++)
        order[i] = (rx_ranked){isfinite(sources->list[i].flux_auto) ? sources->list[i].flux_auto : 0, i};
    if (order == NULL)
        return -1;
    rx_rank_falling(order, (size_t)sources->n);
    for (int kind = 0; kind < 2; kind++)
        for (int i = 0, m = 0; i < sources->n && m < RX_TILE_CUTS_EACH; i++)
            if (order[i].index >= 0 &&
                (kind == 0 || (sources->list[order[i].index].flags & RX_FLAG_MERGED))) {
                dst[n++] = (rx_tile_cut){order[i].index, kind};
                order[i].index = -1;
                m++;
            }
    left = 0;
    for (int i = 0; i < sources->n; i++)
        if (order[i].index >= 0)
            order[left++] = order[i];
    for (int m = 0; m < RX_TILE_CUTS_EACH && left > 0; m++) {
        const int i = (int)(rx_random_uniform(seed, 0x71e5, (uint64_t)m) * left);
        dst[n++] = (rx_tile_cut){order[i].index, 2};
        order[i] = order[--left];
    }
    free(order);
    return n;
}
