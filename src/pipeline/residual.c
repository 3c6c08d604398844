/* Cells of the residual, and stars on it. */
#include "pipeline/residual.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "fit/lines.h"
#include "num/convolve.h"
#include "num/maximum_filter.h"
#include "num/stats.h"

enum { CELL = 64 };                           /* pixels: the mesh of the sky, which follows what is wider */
static const double BEAMS = 16.0;             /* FWHM: 113 independent places */
static const double ANY_FWHM = 3.0;           /* pixels: where no PSF is known, that of many surveys */
static const double LOW = 0.8, HIGH = 1.3;    /* true errors over those that are stated */
static const double BIAS = 0.02;              /* of fluxes: what the flux check allows, too */
static const double ERRORS = 2.0;             /* of b, and of fluxes by the PSF: 0.95 are within */
static const double FAINT = 20.0;             /* S/N of stars */
static const double POINT = 0.5;              /* probability of a star */
enum { LEAST_STARS = 5 };                     /* for a scatter */
static const double REACH = 1.5;              /* FWHM around a star, where its light is */
static const double DOUBT = 0.1;              /* of light that is not known: fit/structure.h */
static const double ENOUGH = 0.5;             /* of a cell's pixels */
static const double BELOW = 0.3, DARK = 0.02; /* sigmas; share of quarters */
static const double LARGE = 0.5;              /* share of cells: the one in the middle is not explained */

/* A cell with what the filter reaches around it, the pixels of the cell by itself being x[0] <= x < x[1], y[0] <= y < y[1]; or a star. */
typedef struct window {
    int x0, y0, width, height, x[2], y[2];
    float *d, *light, *weight; /* over sigma; weight: 1 over 1 + photons of the light */
    float *t, *wide, *scratch; /* wide: of the pixels above the sky, or light blurred more */
    uint8_t *hidden;
    double *values;
} window;

typedef struct work {
    const rx_residual_input *of;
    double fwhm, noise;      /* of G * u */
    int margin, grow, reach; /* pixels: around a cell, a source that no model has, a star */
    rx_residual *dst;
    double *width; /* [ny][nx] of u */
    double *bias;  /* of sources; NAN: no star */
    double second; /* variance of a second difference of independent pixels of 1 */
    double (*grain)
        [2]; /* of sources: chi2 of second differences where photons of the star rule, and of how many */
} work;

static rx_status open_window(const work *w, window *dst, rx_error *err)
{
    const rx_residual *r = w->dst;
    const int cell = rx_max_int((r->width + r->nx - 1) / r->nx, (r->height + r->ny - 1) / r->ny);
    const size_t side = (size_t)(rx_max_int(cell, 2 * w->reach + 1) + 1 + 2 * w->margin), n = side * side;
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

/* Around the pixels from x[0], y[0] to before x[1], y[1]. */
static void place_window(const work *w, const int x[2], const int y[2], window *v)
{
    const rx_residual *r = w->dst;
    v->x0 = rx_max_int(x[0] - w->margin, 0);
    v->y0 = rx_max_int(y[0] - w->margin, 0);
    v->width = rx_min_int(x[1] + w->margin, r->width) - v->x0;
    v->height = rx_min_int(y[1] + w->margin, r->height) - v->y0;
    for (int i = 0; i < 2; i++) {
        v->x[i] = x[i] - v->x0;
        v->y[i] = y[i] - v->y0;
    }
}

/* n pixels from (x, y) of the window on: what is left of them; in wide the pixels themselves, above the sky; in t 1 where a source hides it. */
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
                     light = seen && of->light != NULL ? fmax((double)of->light[k] / s, 0.0) : 0.0,
                     left = seen && of->residual != NULL ? (double)of->residual[k] / s : height - light,
                     weight = seen ? 1.0 / (1.0 + photon * light / s) : 0.0;
        v->d[to] = (float)left;
        v->light[to] = (float)light;
        v->weight[to] = (float)weight;
        v->wide[to] = (float)height;
        v->hidden[to] = !seen || weight * DOUBT * DOUBT * light * light > 1.0;
        v->t[to] =
            of->light == NULL && of->sources->segments != NULL && of->sources->segments[k] != 0 ? 1.0f : 0.0f;
    }
}

static void read_window(const work *w, const window *v)
{
    for (int y = 0; y < v->height; y++)
        for (int x = 0; x < v->width; x += RX_MAP_PIECE)
            read_pixels(w, v, x, y, rx_min_int(RX_MAP_PIECE, v->width - x));
}

/* Pixels within so many of a source that no model has do not count. */
static void close_sources(const window *v, int grow)
{
    rx_maximum_filter(v->t, v->width, v->height, grow, 1, v->scratch, v->wide);
    for (int i = 0; i < v->width * v->height; i++)
        v->hidden[i] |= v->wide[i] > 0.0f;
}

/* Which quarters of cell k are dark. */
static void look_at_quarters(const work *w, int k, const window *v)
{
    const double quarter = 0.25 * (v->x[1] - v->x[0]) * (v->y[1] - v->y[0]);
    double height[4] = {0}, seen[4] = {0};
    int quarters = 0;
    for (int y = v->y[0]; y < v->y[1]; y++)
        for (int x = v->x[0]; x < v->x[1]; x++) {
            const int at = y * v->width + x,
                      q = (2 * x >= v->x[0] + v->x[1]) + 2 * (2 * y >= v->y[0] + v->y[1]);
            height[q] += (double)v->wide[at];
            seen[q] += v->weight[at] > 0.0f;
        }
    for (int q = 0; q < 4; q++)
        if (seen[q] >= ENOUGH * quarter) {
            quarters++;
            w->dst->cell[k] |= (unsigned char)((height[q] < -BELOW * seen[q]) << (q + 1));
        }
    w->dst->cell[k] |= (unsigned char)(quarters << 5);
}

/* Of t where nothing hides it; NAN: in too few pixels. Noise in steps may be as wide as it should be at one half of its values;
 * it is too narrow there or at two thirds. */
static double width_of(const window *v)
{
    size_t n = 0;
    for (int y = v->y[0]; y < v->y[1]; y++)
        for (int x = v->x[0]; x < v->x[1]; x++)
            if (v->hidden[y * v->width + x] == 0)
                v->values[n++] = fabs((double)v->t[y * v->width + x]);
    if ((double)n < ENOUGH * (v->x[1] - v->x[0]) * (v->y[1] - v->y[0]))
        return NAN;
    const double half = rx_median(v->values, n) * RX_MAD_SIGMA,
                 most = rx_quantile(v->values, n, erf(M_SQRT1_2));
    return most < LOW ? fmin(half, most) : half;
}

static rx_status look_at_cell(const work *w, int k, window *v, rx_error *err)
{
    rx_residual *r = w->dst;
    const long cx = k % r->nx, cy = k / r->nx;
    place_window(w, (const int[2]){(int)(cx * r->width / r->nx), (int)((cx + 1) * r->width / r->nx)},
                 (const int[2]){(int)(cy * r->height / r->ny), (int)((cy + 1) * r->height / r->ny)}, v);
    read_window(w, v);
    look_at_quarters(w, k, v);
    if (w->of->light == NULL)
        close_sources(v, w->grow);
    for (int i = 0; i < v->width * v->height; i++)
        v->t[i] = v->d[i] * sqrtf(v->weight[i]);
    w->width[k] = width_of(v);
    RX_TRY(rx_gauss_masked(v->width, v->height, w->fwhm, v->hidden, 1, v->t, err));
    r->pull[k] = width_of(v) / w->noise;
    return RX_OK;
}

/* Of the window's pixels where light has as many photons as the sky, along x: chi2 of second differences, which hardly see what is
 * wrong with the PSF, and of how many; three of them the fit has taken. */
static void look_at_grain(const work *w, const window *v, double dst[2])
{
    double chi2 = 0.0;
    int n = 0;
    for (int py = v->y[0]; py < v->y[1]; py++)
        for (int px = rx_max_int(v->x[0], 1); px < rx_min_int(v->x[1], v->width - 1); px++) {
            const int k = py * v->width + px;
            const double at = (double)v->weight[k], before = (double)v->weight[k - 1],
                         after = (double)v->weight[k + 1];
            if (!(at > 0.0 && at <= 0.5 && before > 0.0 && after > 0.0))
                continue;
            const double h = (double)v->d[k] - 0.5 * ((double)v->d[k - 1] + (double)v->d[k + 1]);
            chi2 += h * h / (w->second * (4.0 / at + 1.0 / before + 1.0 / after) / 6.0);
            n++;
        }
    dst[0] = n > 3 ? chi2 : 0.0;
    dst[1] = rx_max_int(n - 3, 0);
}

/* b of source i, NAN where it is no star that serves, and its grain. */
static rx_status look_at_star(const work *w, int i, window *v, rx_error *err)
{
    const rx_source_template *fit = &w->of->sources->list[i].fit;
    const int x = (int)lround(fit->x), y = (int)lround(fit->y), r = w->reach;
    double de = 0.0, ee = 0.0, el = 0.0, ll = 0.0;
    w->bias[i] = NAN;
    if (!(fit->star > POINT && fit->snr > FAINT) || fit->flags != 0 || x < r || y < r ||
        x >= w->dst->width - r || y >= w->dst->height - r)
        return RX_OK;
    place_window(w, (const int[2]){x - r, x + r + 1}, (const int[2]){y - r, y + r + 1}, v);
    read_window(w, v);
    look_at_grain(w, v, w->grain[i]);
    memcpy(v->wide, v->light, (size_t)(v->width * v->height) * sizeof *v->wide);
    RX_TRY(rx_gauss_masked(v->width, v->height, 0.5 * w->fwhm, NULL, 1, v->wide, err));
    for (int py = v->y[0]; py < v->y[1]; py++)
        for (int px = v->x[0]; px < v->x[1]; px++) {
            const int k = py * v->width + px;
            const double weight = (double)v->weight[k], d = (double)v->d[k], l = (double)v->light[k],
                         e = (double)v->wide[k] - l;
            de += weight * d * e;
            ee += weight * e * e;
            el += weight * e * l;
            ll += weight * l * l;
        }
    const double own = ll > 0.0 ? ee - el * el / ll : 0.0; /* of e, at right angles to l */
    if (own > 0.0)
        w->bias[i] = de / own * el / ll;
    return RX_OK;
}

/* The noise of G * u, of independent pixels of 1 and of the tile's correlation. */
static rx_status measure_filter(work *w, rx_error *err)
{
    const float second[3] = {-0.5f, 1.0f, -0.5f};
    const double factor = rx_noise_factor(w->of->image->correlation, second, 3, 1);
    w->second = 1.5 * factor * factor;
    w->grow = w->of->light == NULL ? (int)ceil(w->fwhm) : 0;
    w->margin = rx_gauss_radius(w->fwhm) + w->grow;
    return rx_lines_noise(w->of->image->correlation, w->fwhm, &w->noise, err);
}

/* The median of those of n values that are known, NAN without any; how many, in the front of room. */
static double middle_of(const double *values, int n, double *room, int *known)
{
    *known = 0;
    for (int i = 0; i < n; i++)
        if (!isnan(values[i]))
            room[(*known)++] = values[i];
    return rx_median(room, (size_t)*known);
}

static bool is_wrong(double width, double low)
{
    return width > HIGH || width < low;
}

/* LOW of t: of 4 pi s^2 pixels, which G makes one place of, each fitted source has taken three freedoms. */
static double least_width(const work *w)
{
    const double s = w->fwhm / RX_FWHM_SIGMA,
                 places = w->dst->width * (double)w->dst->height / (4.0 * M_PI * s * s);
    return w->bias == NULL ? LOW : LOW * sqrt(fmax(1.0 - 3.0 * w->of->sources->n / places, 0.0));
}

static void sum_up(const work *w, double *room)
{
    rx_residual *r = w->dst;
    const int n = r->nx * r->ny;
    const double low = least_width(w);
    long wrong = 0, quarters = 0, dark = 0;
    int cells, stars;
    for (int k = 0; k < n; k++) {
        quarters += r->cell[k] >> 5;
        for (int q = 1; q <= 4; q++)
            dark += r->cell[k] >> q & 1;
        r->cell[k] |= is_wrong(r->pull[k], low) || is_wrong(w->width[k], LOW);
        wrong += r->cell[k] & 1;
    }
    r->dark = quarters > 0 ? (double)dark / (double)quarters : NAN;
    const double u = middle_of(w->width, n, room, &cells), t = middle_of(r->pull, n, room, &cells),
                 b = middle_of(w->bias, w->bias != NULL ? w->of->sources->n : 0, room, &stars),
                 error = stars >= LEAST_STARS ? 1.2533 * rx_sigma_mad(room, (size_t)stars, NULL) / sqrt(stars)
                                              : HUGE_VAL;
    double chi2 = 0.0, count = 0.0;
    for (int i = 0; w->bias != NULL && i < w->of->sources->n; i++) {
        chi2 += w->grain[i][0];
        count += w->grain[i][1];
    }
    /* neighbouring differences have pixels in common: chi2 scatters by 4, not 2, for each */
    const double grain = count > 0.0 ? chi2 / count : NAN;
    r->share = cells > 0 ? (double)wrong / cells : NAN;
    const struct {
        rx_misfit cause;
        bool wrong;
        double by;
    } all[] = {{RX_MISFIT_NOISE, is_wrong(u, LOW), u},
               {RX_MISFIT_NOISE, t < low, t},
               {RX_MISFIT_NOISE, grain * (1.0 + ERRORS * sqrt(4.0 / count)) < LOW * LOW, sqrt(grain)},
               {RX_MISFIT_PSF, fabs(b) > BIAS + ERRORS * error, b},
               {RX_MISFIT_PSF, ERRORS * w->of->psf_error > BIAS, w->of->psf_error},
               {RX_MISFIT_SKY, t > HIGH, t}};
    for (size_t i = 0; i < sizeof all / sizeof *all && r->cause == RX_MISFIT_NONE; i++)
        if (all[i].wrong) {
            r->cause = all[i].cause;
            r->by = all[i].by;
        }
}

rx_status rx_residual_measure(const rx_residual_input *input, rx_residual *dst, rx_error *err)
{
    const rx_image *image = input->image;
    work w = {.of = input, .fwhm = input->fwhm > 0.0 ? input->fwhm : ANY_FWHM, .dst = dst};
    const int side = rx_max_int(CELL, (int)ceil(BEAMS * w.fwhm)),
              stars = input->residual != NULL && input->fwhm > 0.0 ? input->sources->n : 0;
    double *room = NULL;
    rx_status status = RX_OK;
    *dst = (rx_residual){.nx = rx_max_int(image->width / side, 1),
                         .ny = rx_max_int(image->height / side, 1),
                         .width = image->width,
                         .height = image->height,
                         .share = NAN,
                         .dark = NAN};
    const int n = dst->nx * dst->ny;
    w.reach = (int)ceil(REACH * w.fwhm);
    RX_TRY_EXIT(RX_MAKE(dst->cell, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(dst->pull, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(w.width, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(room, (size_t)rx_max_int(n, stars), err));
    if (stars > 0) {
        RX_TRY_EXIT(RX_MAKE(w.bias, (size_t)stars, err));
        RX_TRY_EXIT(RX_MAKE(w.grain, (size_t)stars, err));
    }
    RX_TRY_EXIT(measure_filter(&w, err));
#pragma omp parallel num_threads(rx_max_int(input->nthreads, 1))
    {
        rx_error local = rx_error_part(NULL);
        window v;
        rx_status mine = open_window(&w, &v, &local);
#pragma omp for schedule(dynamic)
        for (int k = 0; k < n + stars; k++)
            if (mine == RX_OK)
                mine = k < n ? look_at_cell(&w, k, &v, &local) : look_at_star(&w, k - n, &v, &local);
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
        sum_up(&w, room);
exit:
    free(w.width);
    free(w.bias);
    free(w.grain);
    free(room);
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

static const char *const misfits[RX_MISFITS][3] = {
    [RX_MISFIT_NONE] = {"NONE", "", ""},
    [RX_MISFIT_NOISE] = {"NOISE", "pixels scatter by other than its noise, times",
                         "are values rounded or cut off, is a map or GAIN wrong?"},
    [RX_MISFIT_PSF] = {"PSF", "its PSF may put fluxes off by a share of", "RXPSFERR holds it"},
    [RX_MISFIT_SKY] = {"SKY",
                       "light that is no source's, and that the sky's mesh does not follow, makes fluxes at "
                       "empty places scatter by more than the noise, times",
                       "are faint sources pieces of it?"}};

const char *rx_misfit_name(rx_misfit cause)
{
    return misfits[cause][0];
}

const char *rx_misfit_text(rx_misfit cause)
{
    return misfits[cause][1];
}

const char *rx_misfit_remedy(rx_misfit cause)
{
    return misfits[cause][2];
}
