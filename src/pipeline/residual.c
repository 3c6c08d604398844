/* Cells of the residual. */
#include "pipeline/residual.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/convolve.h"
#include "num/maximum_filter.h"
#include "num/stats.h"

enum { CELL = 64 }; /* pixels: the mesh of the sky, which follows what is wider */
static const double BEAMS =
    16.0; /* FWHM: 113 independent places, so that chance makes a width of 1.3 in 1 of 1000 */
static const double ANY_FWHM = 3.0;                 /* pixels: where no PSF is known, that of many surveys */
static const double QUARTILE = 0.6745;              /* median of |t| of a normal distribution */
static const double PULL = 1.3;                     /* errors that are 0.77 of the true ones */
static const double BIAS = 0.03, BIAS_ERROR = 0.01; /* of fluxes by the PSF; of more error nothing is said */
static const double LIGHT_ERROR =
    0.02; /* of light: so that a star of 1000 sigma does not outweigh twenty of 50 */
static const double
    HIT = 5.0,
    SHARE = 0.2; /* sigmas, and share of the light, beyond which d is of no PSF but a cosmic ray */
static const double ALONG =
    2.0; /* mean square of sums over rows over that of columns, or the other way round: clouds, hollows, rings have 1.15 at most, edges 3 */
static const double ENOUGH = 0.5; /* of a cell's pixels */
static const double
    FAINT = 3.0,
    WIDE =
        5.0; /* sigmas of a segment's mean; FWHM^2 of its area: a star of such a mean has 2.6 above 1 sigma; at 3 FWHM 8 is called wrong */
static const double LARGE =
    0.1; /* share of cells: 0 to 0.06 on good skies, 0.13 and more on bad ones (validation/alarms.py) */
static const double BELOW = 0.3, DARK = 0.02; /* sigmas; share of quarters */

/* A cell with what the filter reaches around it, the pixels of the cell by itself being x[0] <= x < x[1], y[0] <= y < y[1]. */
typedef struct window {
    int x0, y0, width, height, x[2], y[2];
    float *d, *light, *weight; /* over sigma; weight: 1 over 1 + photons of the light */
    float *t, *wide, *scratch;
    uint8_t *hidden; /* 1: not seen, 2: of a source, or near one */
    double *values;
} window;

/* What is found of one cell. */
typedef struct found {
    rx_misfit kind;
    double along[2]; /* mean squares of sums of rows and of columns, per pixel */
    int quarters;    /* with pixels enough to be dark */
} found;

typedef struct work {
    const rx_residual_input *of;
    double fwhm, factor,
        noise; /* factor: of the noise of G * u over that of independent pixels, which is noise / factor */
    int margin, grow;
    rx_residual *dst;
    found *found;        /* [ny][nx] */
    unsigned char *wide; /* of segments: wide and faint */
} work;

static rx_status open_window(const work *w, window *dst, rx_error *err)
{
    const rx_residual *r = w->dst;
    const size_t side = (size_t)(rx_max_int(r->width / r->nx, r->height / r->ny) + 1 + 2 * w->margin),
                 n = side * side;
    *dst = (window){0};
    RX_TRY(RX_MAKE(dst->d, 6 * n, err));
    dst->light = dst->d + n;
    dst->weight = dst->d + 2 * n;
    dst->t = dst->d + 3 * n;
    dst->wide = dst->d + 4 * n;
    dst->scratch = dst->d + 5 * n;
    RX_TRY(RX_MAKE(dst->hidden, n, err));
    return RX_MAKE(dst->values, n, err);
}

/* Around cell k. */
static void place_window(const work *w, int k, window *v)
{
    const rx_residual *r = w->dst;
    const long cx = k % r->nx, cy = k / r->nx;
    const int x[2] = {(int)(cx * r->width / r->nx), (int)((cx + 1) * r->width / r->nx)},
              y[2] = {(int)(cy * r->height / r->ny), (int)((cy + 1) * r->height / r->ny)};
    v->x0 = rx_max_int(x[0] - w->margin, 0);
    v->y0 = rx_max_int(y[0] - w->margin, 0);
    v->width = rx_min_int(x[1] + w->margin, r->width) - v->x0;
    v->height = rx_min_int(y[1] + w->margin, r->height) - v->y0;
    for (int i = 0; i < 2; i++) {
        v->x[i] = x[i] - v->x0;
        v->y[i] = y[i] - v->y0;
    }
}

/* n pixels from (x, y) of the window on: what is left of them, what is seen, and, in t, 1 where a source is; in wide the pixels themselves,
 * above the sky. */
static void read_pixels(const work *w, const window *v, int x, int y, int n)
{
    const rx_residual_input *of = w->of;
    const rx_image *image = of->image;
    const rx_map sky = rx_image_sky(image);
    const double photon = image->gain > 0.0 ? 1.0 / image->gain : 0.0;
    float rooms[2][RX_MAP_PIECE];
    const float *level = rx_map_row(&sky, v->y0 + y, v->x0 + x, n, rooms[0]),
                *sigma = rx_map_row(&image->noise, v->y0 + y, v->x0 + x, n, rooms[1]);
    for (int i = 0; i < n; i++) {
        const size_t k = (size_t)(v->y0 + y) * (size_t)image->width + (size_t)(v->x0 + x + i),
                     to = (size_t)(y * v->width + x + i);
        const bool seen = !rx_image_hides(image, k) && sigma[i] > 0.0f &&
                          (image->mask == NULL || (image->mask[k] & RX_MASK_SATURATED) == 0);
        const double s = seen ? (double)sigma[i] : 1.0,
                     height = seen ? ((double)image->pixels[k] - (double)level[i]) / s : 0.0,
                     light = seen && of->light != NULL ? (double)of->light[k] / s : 0.0;
        const int32_t segment = of->segments != NULL ? of->segments[k] : 0;
        const double left = !seen || w->wide[segment] ? height
                            : of->residual != NULL    ? (double)of->residual[k] / s
                                                      : height - light;
        v->hidden[to] = !seen;
        v->d[to] = (float)left;
        v->light[to] = (float)fmax(light, 0.0);
        v->weight[to] = seen ? (float)(1.0 / (1.0 + fmax(photon * light / s, 0.0))) : 0.0f;
        v->wide[to] = (float)height;
        v->t[to] = segment != 0 && !w->wide[segment] ? 1.0f : 0.0f;
    }
}

/* Which quarters of cell k are dark; how many of its pixels are seen. */
static double look_at_quarters(const work *w, int k, const window *v)
{
    const double quarter = 0.25 * (v->x[1] - v->x[0]) * (v->y[1] - v->y[0]);
    double height[4] = {0}, seen[4] = {0};
    for (int y = v->y[0]; y < v->y[1]; y++)
        for (int x = v->x[0]; x < v->x[1]; x++) {
            const int at = y * v->width + x,
                      q = (2 * x >= v->x[0] + v->x[1]) + 2 * (2 * y >= v->y[0] + v->y[1]);
            height[q] += (double)v->wide[at];
            seen[q] += v->hidden[at] == 0;
        }
    for (int q = 0; q < 4; q++)
        if (seen[q] >= ENOUGH * quarter) {
            w->found[k].quarters++;
            w->dst->cell[k] |= (unsigned char)((height[q] < -BELOW * seen[q]) << (q + 1));
        }
    return seen[0] + seen[1] + seen[2] + seen[3];
}

/* Does the PSF make fluxes wrong by more than is allowed? */
static rx_status test_psf(const work *w, const window *v, bool *dst, rx_error *err)
{
    double de = 0.0, ee = 0.0, el = 0.0, ll = 0.0;
    *dst = false;
    memcpy(v->wide, v->light, (size_t)(v->width * v->height) * sizeof *v->wide);
    RX_TRY(rx_gauss_masked(v->width, v->height, 0.5 * w->fwhm, NULL, 1, v->wide, err));
    for (int y = v->y[0]; y < v->y[1]; y++)
        for (int x = v->x[0]; x < v->x[1]; x++) {
            const int k = y * v->width + x;
            const double d = (double)v->d[k], l = (double)v->light[k], e = (double)v->wide[k] - l,
                         weight =
                             (double)v->weight[k] / (1.0 + (double)v->weight[k] * pow(LIGHT_ERROR * l, 2.0));
            if (fabs(d) > HIT + SHARE * fmax(l, (double)v->wide[k]))
                continue;
            de += weight * d * e;
            ee += weight * e * e;
            el += weight * e * l;
            ll += weight * l * l;
        }
    const double own = ll > 0.0 ? ee - el * el / ll : 0.0; /* of e, at right angles to l */
    if (!(own > 0.0))
        return RX_OK;
    const double bias = fabs(de / own * el / ll), error = w->factor * fabs(el / ll) / sqrt(own);
    *dst = error < BIAS_ERROR && bias > BIAS + 3.0 * error;
    return RX_OK;
}

/* Of t where nothing hides it. */
static double width_of(const window *v)
{
    size_t n = 0;
    for (int y = v->y[0]; y < v->y[1]; y++)
        for (int x = v->x[0]; x < v->x[1]; x++)
            if (v->hidden[y * v->width + x] == 0)
                v->values[n++] = fabs((double)v->t[y * v->width + x]);
    return rx_median(v->values, n) / QUARTILE;
}

/* Mean squares of the sums of t over rows and over columns, per pixel. */
static void sum_lines(const window *v, double dst[2])
{
    for (int columns = 0; columns < 2; columns++) {
        const int *line = columns ? v->x : v->y, *along = columns ? v->y : v->x;
        const int step = columns ? v->width : 1, from = columns ? 1 : v->width;
        double square = 0.0;
        for (int i = line[0]; i < line[1]; i++) {
            double sum = 0.0;
            int n = 0;
            for (int j = along[0]; j < along[1]; j++) {
                const int k = i * from + j * step;
                sum += v->hidden[k] == 0 ? (double)v->t[k] : 0.0;
                n += v->hidden[k] == 0;
            }
            square += n > 0 ? sum * sum / n : 0.0;
        }
        dst[columns] = square / (line[1] - line[0]);
    }
}

/* Pixels within so many of a source do not count; below 0 all do. How many are left. */
static double close_sources(const window *v, int grow)
{
    double open = 0.0;
    if (grow >= 0)
        rx_maximum_filter(v->t, v->width, v->height, grow, 1, v->scratch, v->wide);
    for (int i = 0; i < v->width * v->height; i++)
        v->hidden[i] = (v->hidden[i] & 1) | (grow >= 0 && v->wide[i] > 0.0f ? 2 : 0);
    for (int y = v->y[0]; y < v->y[1]; y++)
        for (int x = v->x[0]; x < v->x[1]; x++)
            open += v->hidden[y * v->width + x] == 0;
    return open;
}

static rx_status look_at_cell(const work *w, int k, window *v, rx_error *err)
{
    found *dst = &w->found[k];
    bool wrong = false;
    place_window(w, k, v);
    const double enough = ENOUGH * (v->x[1] - v->x[0]) * (v->y[1] - v->y[0]);
    for (int y = 0; y < v->height; y++)
        for (int x = 0; x < v->width; x += RX_MAP_PIECE)
            read_pixels(w, v, x, y, rx_min_int(RX_MAP_PIECE, v->width - x));
    w->dst->pull[k] = NAN;
    if (look_at_quarters(w, k, v) < enough)
        return RX_OK;
    const bool sky = close_sources(v, w->grow) >= enough && w->of->segments != NULL,
               modelled = w->of->light != NULL;
    if (!sky && close_sources(v, modelled ? -1 : 0) == 0.0)
        return RX_OK;
    if (w->of->residual != NULL)
        RX_TRY(test_psf(w, v, &wrong, err));
    for (int i = 0; i < v->width * v->height; i++)
        v->t[i] = v->d[i] * sqrtf(v->weight[i]);
    const double u = width_of(v);
    if (!sky && !modelled && u > 1.0 / PULL)
        return RX_OK;
    sum_lines(v, dst->along);
    RX_TRY(rx_gauss_masked(v->width, v->height, w->fwhm, v->hidden, 1, v->t, err));
    const double t = w->dst->pull[k] = width_of(v) / w->noise;
    if (u > PULL || (!(modelled && !sky) && fmin(t, u) < 1.0 / PULL))
        dst->kind = RX_MISFIT_NOISE;
    else if (t > PULL)
        dst->kind = sky || w->of->residual == NULL ? RX_MISFIT_SKY : RX_MISFIT_CROWD;
    else if (wrong)
        dst->kind = RX_MISFIT_PSF;
    return RX_OK;
}

/* Segments that are faint, and wider than stars and most galaxies, are light that detection has cut into sources. */
static rx_status find_wide(work *w, rx_error *err)
{
    const rx_residual_input *of = w->of;
    const rx_image *image = of->image;
    const rx_map sky = rx_image_sky(image);
    const size_t n = (size_t)image->width * (size_t)image->height;
    double *area = NULL, *sum = NULL;
    int32_t last = 0;
    rx_status status = RX_OK;
    for (size_t k = 0; k < n && of->segments != NULL; k++)
        last = of->segments[k] > last ? of->segments[k] : last;
    RX_TRY_EXIT(RX_MAKE(w->wide, (size_t)last + 1, err));
    RX_TRY_EXIT(RX_MAKE(area, (size_t)last + 1, err));
    RX_TRY_EXIT(RX_MAKE(sum, (size_t)last + 1, err));
    for (size_t k = 0; k < n && last > 0; k++) {
        const int32_t segment = of->segments[k];
        const int x = (int)(k % (size_t)image->width), y = (int)(k / (size_t)image->width);
        if (segment == 0)
            continue;
        area[segment]++;
        sum[segment] += rx_image_hides(image, k)
                            ? (double)INFINITY
                            : ((double)image->pixels[k] - (double)rx_map_at(&sky, x, y)) /
                                  (double)rx_map_at(&image->noise, x, y);
    }
    for (int32_t i = 1; i <= last; i++)
        w->wide[i] = sum[i] < FAINT * area[i] && area[i] > WIDE * w->fwhm * w->fwhm;
exit:
    free(area);
    free(sum);
    return status;
}

/* The noise of G * u, of independent pixels of 1 and of the tile's correlation. */
static rx_status measure_filter(work *w, rx_error *err)
{
    const int radius = rx_gauss_radius(w->fwhm), side = 2 * radius + 1;
    float *line, *stamp = NULL;
    double square = 0.0;
    rx_status status = RX_OK;
    RX_TRY(RX_MAKE(line, (size_t)side, err));
    RX_TRY_EXIT(RX_MAKE(stamp, (size_t)side * (size_t)side, err));
    rx_gauss_weights(w->fwhm, radius, line);
    for (int i = 0; i < side * side; i++)
        stamp[i] = line[i % side] * line[i / side];
    for (int i = 0; i < side; i++)
        square += (double)line[i] * (double)line[i];
    w->factor = rx_noise_factor(w->of->image->correlation, stamp, side, side);
    w->noise = w->factor * square;
    w->grow = (int)ceil(w->fwhm);
    w->margin = radius + w->grow;
exit:
    free(line);
    free(stamp);
    return status;
}

static void sum_up(const work *w)
{
    rx_residual *r = w->dst;
    long cells = 0, quarters = 0, dark = 0, of[RX_MISFITS] = {0};
    double sums[2] = {0}, worst = 0.0;
    for (int k = 0; k < r->nx * r->ny; k++) {
        const found *f = &w->found[k];
        const double off = fabs(log(r->pull[k]));
        quarters += f->quarters;
        for (int q = 1; q <= 4; q++)
            dark += r->cell[k] >> q & 1;
        if (isnan(r->pull[k]))
            continue;
        cells++;
        of[f->kind]++;
        r->cell[k] |= f->kind != RX_MISFIT_NONE;
        for (int i = 0; i < 2; i++)
            sums[i] += f->kind == RX_MISFIT_SKY ? f->along[i] : 0.0;
        if (f->kind == RX_MISFIT_NONE || off < worst)
            continue;
        worst = off;
        r->x = (k % r->nx + 0.5) * r->width / r->nx;
        r->y = (k / r->nx + 0.5) * r->height / r->ny;
    }
    r->share = cells > 0 ? (double)(cells - of[RX_MISFIT_NONE]) / (double)cells : NAN;
    r->dark = quarters > 0 ? (double)dark / (double)quarters : NAN;
    if (fmax(sums[0], sums[1]) > ALONG * fmin(sums[0], sums[1])) {
        of[RX_MISFIT_DETECTOR] = of[RX_MISFIT_SKY];
        of[RX_MISFIT_SKY] = 0;
    }
    of[RX_MISFIT_NONE] = 0;
    for (int i = 1; i < RX_MISFITS; i++)
        r->cause = of[i] > of[r->cause] ? (rx_misfit)i : r->cause;
}

rx_status rx_residual_measure(const rx_residual_input *input, rx_residual *dst, rx_error *err)
{
    const rx_image *image = input->image;
    work w = {.of = input, .fwhm = input->fwhm > 0.0 ? input->fwhm : ANY_FWHM, .dst = dst};
    const int side = rx_max_int(CELL, (int)ceil(BEAMS * w.fwhm));
    rx_status status = RX_OK;
    *dst = (rx_residual){.nx = rx_max_int(image->width / side, 1),
                         .ny = rx_max_int(image->height / side, 1),
                         .width = image->width,
                         .height = image->height,
                         .share = NAN,
                         .dark = NAN};
    const int n = dst->nx * dst->ny;
    RX_TRY_EXIT(RX_MAKE(dst->cell, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(dst->pull, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(w.found, (size_t)n, err));
    RX_TRY_EXIT(measure_filter(&w, err));
    RX_TRY_EXIT(find_wide(&w, err));
#pragma omp parallel num_threads(rx_max_int(input->nthreads, 1))
    {
        rx_error local = rx_error_part(NULL);
        window v;
        rx_status mine = open_window(&w, &v, &local);
#pragma omp for schedule(dynamic)
        for (int k = 0; k < n; k++)
            if (mine == RX_OK)
                mine = look_at_cell(&w, k, &v, &local);
        free(v.d);
        free(v.hidden);
        free(v.values);
#pragma omp critical(rx_pipeline_residual)
        if (mine != RX_OK && status == RX_OK) {
            status = mine;
            rx_error_take(err, &local);
        }
    }
    if (status == RX_OK)
        sum_up(&w);
exit:
    free(w.found);
    free(w.wide);
    if (status != RX_OK)
        rx_residual_free(dst);
    return status;
}

void rx_residual_free(rx_residual *residual)
{
    free(residual->cell);
    free(residual->pull);
    *residual = (rx_residual){0};
}

/* A pixel's cell, and in *quarter its part of it; NULL beyond the image. */
static const unsigned char *cell_at(const rx_residual *r, double x, double y, int *quarter)
{
    const long px = (long)floor(x + 0.5), py = (long)floor(y + 0.5);
    if (r->cell == NULL || px < 0 || py < 0 || px >= r->width || py >= r->height)
        return NULL;
    /* cell c begins at pixel c width / nx, rounded down */
    const long cx = ((px + 1) * r->nx - 1) / r->width, cy = ((py + 1) * r->ny - 1) / r->height;
    *quarter = (2 * px >= cx * r->width / r->nx + (cx + 1) * r->width / r->nx) +
               2 * (2 * py >= cy * r->height / r->ny + (cy + 1) * r->height / r->ny);
    return &r->cell[cy * r->nx + cx];
}

int rx_residual_at(const rx_residual *residual, double x, double y)
{
    int quarter;
    const unsigned char *cell = cell_at(residual, x, y, &quarter);
    return cell != NULL && (*cell & 1) != 0;
}

int rx_residual_dark_at(const rx_residual *residual, double x, double y)
{
    int quarter;
    const unsigned char *cell = cell_at(residual, x, y, &quarter);
    return cell != NULL && (*cell >> (quarter + 1) & 1) != 0;
}

int rx_residual_is_large(double share)
{
    return share > LARGE;
}

int rx_residual_is_dark(double dark)
{
    return dark > DARK;
}

static const char *const misfits[RX_MISFITS][2] = {
    [RX_MISFIT_NONE] = {"NONE", "nothing"},
    [RX_MISFIT_NOISE] =
        {"NOISE",
         "its noise: rounded or cut-off values, or a map that is wrong; give the tile as it was before, or "
         "its noise (WEIGHT_TYPE MAP_RMS)"},
    [RX_MISFIT_PSF] =
        {"PSF", "its PSF, which is too wide or too narrow; that of the tile's own stars may do"},
    [RX_MISFIT_DETECTOR] =
        {"DETECTOR",
         "its detector: offset rows, columns or amplifiers; subtract each one's overscan or median"},
    [RX_MISFIT_SKY] =
        {"SKY",
         "its sky: filaments, ghosts or hollows that the mesh does not follow; a smaller BACK_SIZE may"},
    [RX_MISFIT_CROWD] = {"CROWD", "its crowd, in which not all sources are resolved"}};

const char *rx_misfit_name(rx_misfit cause)
{
    return misfits[cause][0];
}

const char *rx_misfit_text(rx_misfit cause)
{
    return misfits[cause][1];
}
