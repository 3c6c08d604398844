/* Hits and lines among sources. */
#include "fit/artefacts.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "psf/resample.h"

enum {
    PLACES = 3,    /* of the PSF on the tile, along each axis */
    PIXELS = 3,    /* of a hit */
    NEIGHBOURS = 4, MOST = NEIGHBOURS + 2,
    ANGLES = 48,   /* half a FWHM apart where a line ends */
    DIRECTIONS = 8, /* of tracks */
    ALONG = 8,     /* places on either side, */
    BINS = 128,    /* of c */
    ORDER = 3,     /* of Lanczos interpolation */
    ROUNDS = 20    /* of EM: shares change by less than a hundredth */
};

static const double STEP = 0.15; /* FWHM, between places of a star: a parabola is good to a hundredth pixel there */
static const double FIRST = 2.5, NEXT = 1.25, BESIDE = 3; /* FWHM: of places on a line */
static const double LEAST_WRONG = 0.02;               /* of the PSF, share of its peak */
static const double BIN = 0.125, LOWEST = -8;       /* sigmas of c */
static const int heights[] = {8, 12, 16, 24, 32, 48}; /* bins */

/* The PSF at one of its places, moved within the brightest pixel's surroundings. */
typedef struct shapes {
    int reach, half, across; /* pixels; places along an axis */
    double step;             /* pixels, between these */
    float *values;           /* [PLACES^2][across^2][(2 half + 1)^2] */
    int side, fine;
    float *samples; /* [PLACES^2][side][side], fine of them a pixel */
} shapes;

typedef struct work {
    const rx_image *image;
    int nthreads;
    double fwhm; /* pixels, at least 2 */
    shapes stars;
    const rx_artefact *list;
    int *order, *first_in_row; /* of list by rows */
    float *matched;       /* [height][width], m; NAN where half of it is hidden */
    double spread[BINS]; /* f */
} work;

static size_t area(const shapes *s)
{
    return (size_t)(2 * s->half + 1) * (size_t)(2 * s->half + 1);
}

static size_t count(const shapes *s)
{
    return (size_t)s->across * (size_t)s->across;
}

/* Weights of samples for the pixels -half .. half of something moved by `shift` pixels: the first sample of each is *first, and fine
 * further from one to the next. */
static void weights_of(const shapes *s, double shift, double weights[2 * RX_LANCZOS_MAX], int *first)
{
    *first = rx_lanczos_weights(s->side / 2 - s->fine * (s->half + shift), ORDER, weights);
}

/* The PSF of a place, moved by (dx, dy), on the pixels of the patch. */
static void sample(const shapes *s, int place, double dx, double dy, float *dst)
{
    const float *samples = s->samples + (size_t)place * (size_t)s->side * (size_t)s->side;
    double across[2 * RX_LANCZOS_MAX], up[2 * RX_LANCZOS_MAX];
    int x0, y0;
    weights_of(s, dx, across, &x0);
    weights_of(s, dy, up, &y0);
    for (int v = 0; v <= 2 * s->half; v++)
        for (int u = 0; u <= 2 * s->half; u++) {
            double sum = 0;
            for (int j = 0; j < 2 * ORDER; j++) {
                const int y = y0 + s->fine * v + j;
                double row = 0;
                for (int i = 0; i < 2 * ORDER && y >= 0 && y < s->side; i++) {
                    const int x = x0 + s->fine * u + i;
                    if (x >= 0 && x < s->side)
                        row += across[i] * (double)samples[y * s->side + x];
                }
                sum += up[j] * row;
            }
            *dst++ = (float)sum;
        }
}

static rx_status make_shapes(const rx_image *image, shapes *s, rx_error *err)
{
    const rx_psf *psf = image->psf;
    s->side = rx_psf_fine_side(psf);
    s->fine = rx_psf_fine(psf);
    s->reach = rx_max_int(1, (int)lround(psf->fwhm / 2));
    s->half = 2 * s->reach + 1;
    s->step = STEP * fmax(psf->fwhm, 2);
    s->across = 2 * (int)ceil(s->reach / s->step) + 1;
    const size_t samples = (size_t)s->side * (size_t)s->side;
    RX_TRY(RX_MAKE(s->samples, PLACES * PLACES * samples, err));
    RX_TRY(RX_MAKE(s->values, PLACES * PLACES * count(s) * area(s), err));
    for (int place = 0; place < PLACES * PLACES; place++) {
        rx_psf_fine_at(psf, (place % PLACES + 0.5) / PLACES * image->width,
                       ((double)(place / PLACES) + 0.5) / PLACES * image->height, s->samples + (size_t)place * samples);
        for (int k = 0; k < s->across * s->across; k++)
            sample(s, place, s->step * (k % s->across - s->across / 2), s->step * ((double)(k / s->across) - s->across / 2),
                   s->values + ((size_t)place * count(s) + (size_t)k) * area(s));
    }
    return RX_OK;
}

/* Pixels of a patch, or means of its rows in some direction, with what fits them: [n] each. */
typedef struct cells {
    int n; /* the brightest one is the middle */
    float *z, *weight, *fits[MOST]; /* fits: the star, a level, neighbours */
    int nfits;
} cells;

RX_SIMD static double product(const float *restrict weight, const float *restrict a, const float *restrict b, int n)
{
    float sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int i = 0; i < n; i++)
        sum += weight[i] * a[i] * b[i];
    return (double)sum;
}

/* chi2 that the fits from `first` on take of z, least squares by Cholesky; what is next to a sum of those before is left out. */
static double taken(const cells *c, int first)
{
    double factor[MOST][MOST], along[MOST], all = 0;
    int n = 0;
    for (int k = c->nfits - 1; k >= first; k--) { /* the star last */
        const float *fit = c->fits[k];
        double own = product(c->weight, fit, fit, c->n), light = product(c->weight, fit, c->z, c->n);
        const double alone = own;
        for (int j = 0; j < n; j++) {
            factor[n][j] = product(c->weight, fit, c->fits[c->nfits - 1 - j], c->n);
            for (int i = 0; i < j; i++)
                factor[n][j] -= factor[n][i] * factor[j][i];
            factor[n][j] /= factor[j][j];
            own -= factor[n][j] * factor[n][j];
            light -= factor[n][j] * along[j];
        }
        const int is_left_out = !(own > 1e-4 * alone);
        factor[n][n] = is_left_out ? 1 : sqrt(own);
        along[n] = is_left_out ? 0 : light / factor[n][n];
        if (is_left_out)
            for (int j = 0; j < n; j++)
                factor[n][j] = 0;
        if (k == 0 && along[n] < 0)
            along[n] = 0;
        all += along[n] * along[n];
        n++;
    }
    return all;
}

/* The largest of ln L(hit) - ln L(star) where one to three cells, the middle and the brightest of its neighbours, may have any
 * value. The weights of these are 0 afterwards. */
static double hit_odds(cells *c, const int *beside, int nbeside)
{
    const int middle = c->n / 2;
    double best = -HUGE_VAL, kept = 0; /* kept: chi2 that the hit's cells take */
    if (!(c->weight[middle] > 0) || !(c->z[middle] > 0))
        return -HUGE_VAL;
    const double star = taken(c, 0), height = (double)c->z[middle] * sqrt((double)c->weight[middle]),
                 other = log((double)nbeside) + fmax(log(height / sqrt(2 * M_PI)), 0);
    for (int k = 0, at = middle; k < PIXELS && at >= 0; k++) {
        kept += (double)(c->weight[at] * c->z[at] * c->z[at]);
        c->weight[at] = 0;
        best = fmax(best, (kept + taken(c, 1) - star) / 2 - k * other);
        at = -1;
        for (int i = 0; i < nbeside; i++)
            if (c->z[middle + beside[i]] > 0 && c->weight[middle + beside[i]] > 0 && (at < 0 || c->z[middle + beside[i]] > c->z[at]))
                at = middle + beside[i];
    }
    return best;
}

/* The means of the pixels of a patch along a direction. dst: `side` cells. */
static void collapse(const cells *c, int side, double angle, cells *dst)
{
    const int half = side / 2;
    const double dx = -sin(angle), dy = cos(angle);
    dst->n = side;
    dst->nfits = c->nfits;
    memset(dst->weight, 0, (size_t)side * sizeof *dst->weight);
    memset(dst->z, 0, (size_t)side * sizeof *dst->z);
    for (int k = 0; k < c->nfits; k++)
        memset(dst->fits[k], 0, (size_t)side * sizeof *dst->fits[k]);
    for (int i = 0; i < c->n; i++) {
        const int row = half + (int)lround(dx * (i % side - half) + dy * ((double)(i / side) - half));
        if (row < 0 || row >= side)
            continue;
        dst->weight[row] += c->weight[i];
        dst->z[row] += c->weight[i] * c->z[i];
        for (int k = 0; k < c->nfits; k++)
            dst->fits[k][row] += c->weight[i] * c->fits[k][i];
    }
    for (int i = 0; i < side; i++) {
        const float scale = dst->weight[i] > 0 ? 1 / dst->weight[i] : 0;
        dst->z[i] *= scale;
        for (int k = 0; k < c->nfits; k++)
            dst->fits[k][i] *= scale;
    }
}

/* The brightest pixel around, *x and *y; 0: none is above the sky, or one is saturated. */
static float brightest_near(const work *w, int *x, int *y)
{
    const rx_image *image = w->image;
    const int reach = w->stars.reach, x0 = *x, y0 = *y;
    float most = 0;
    for (int v = rx_max_int(y0 - reach, 0); v <= rx_min_int(y0 + reach, image->height - 1); v++) {
        float row[RX_MAP_PIECE];
        const int left = rx_max_int(x0 - reach, 0), n = rx_min_int(rx_min_int(x0 + reach, image->width - 1) - left + 1, RX_MAP_PIECE);
        rx_image_in_sigmas(image, left, v, n, row);
        for (int i = 0; i < n; i++) {
            if (image->mask != NULL && (image->mask[(size_t)v * (size_t)image->width + (size_t)(left + i)] & RX_MASK_SATURATED))
                return 0;
            if (row[i] > most) {
                most = row[i];
                *x = left + i;
                *y = v;
            }
        }
    }
    return most;
}

/* Where between its neighbours, -0.5 to 0.5, a parabola has its top; `place` of n along that axis. */
static double top_between(const double *gain, int place, int n, int next)
{
    if (place == 0 || place == n - 1)
        return 0;
    const double bend = gain[-next] + gain[next] - 2 * gain[0];
    return bend < 0 ? fmin(fmax(0.5 * (gain[-next] - gain[next]) / bend, -0.5), 0.5) : 0;
}

/* The brightest neighbours as the patch around (x, y) sees them become fits. */
static void add_neighbours(const work *w, const rx_artefact *source, int place, int x, int y, cells *c)
{
    const shapes *s = &w->stars;
    const double far = s->half + w->fwhm;
    const rx_artefact *chosen[NEIGHBOURS];
    double seen[NEIGHBOURS];
    int n = 0;
    for (int row = rx_max_int(y - (int)far, 0); row <= rx_min_int(y + (int)far, w->image->height - 1); row++)
        for (int k = w->first_in_row[row]; k < w->first_in_row[row + 1]; k++) {
            const rx_artefact *other = &w->list[w->order[k]];
            const double distance = hypot(other->x - x, other->y - y);
            float z = 0;
            if (other == source || distance > far || (other->x == source->x && other->y == source->y) || distance < 1)
                continue;
            rx_image_in_sigmas(w->image, other->x, other->y, 1, &z);
            const double light = (double)z * exp(-distance * distance / (w->fwhm * w->fwhm));
            if (!(light > 0))
                continue;
            int at = n < NEIGHBOURS ? n++ : NEIGHBOURS;
            for (; at > 0 && seen[at - 1] < light; at--)
                if (at < NEIGHBOURS) {
                    seen[at] = seen[at - 1];
                    chosen[at] = chosen[at - 1];
                }
            if (at < NEIGHBOURS) {
                seen[at] = light;
                chosen[at] = other;
            }
        }
    for (int k = 0; k < n; k++)
        sample(s, place, chosen[k]->at[0] - x, chosen[k]->at[1] - y, c->fits[c->nfits++]);
}

/* room: [ROOM][area]; gains: [across^2]. */
enum { ROOM = 2 * (MOST + 2) };
static double hit_or_star(const work *w, const rx_artefact *source, float *room, double *gains)
{
    const rx_image *image = w->image;
    const shapes *s = &w->stars;
    const size_t n = area(s);
    const int side = 2 * s->half + 1;
    cells c = {.n = (int)n, .z = room, .weight = room + n, .nfits = 2}, row = {.z = room + 2 * n, .weight = room + 3 * n};
    for (int k = 0; k < MOST; k++) {
        c.fits[k] = room + (size_t)(4 + k) * n;
        row.fits[k] = room + (size_t)(4 + MOST + k) * n;
    }
    int x = source->x, y = source->y;
    const double peak = (double)brightest_near(w, &x, &y);
    if (!(peak > 0))
        return -HUGE_VAL;
    for (size_t i = 0; i < n; i++)
        c.z[i] = NAN;
    const int left = rx_max_int(x - s->half, 0), right = rx_min_int(x + s->half, image->width - 1);
    for (int v = rx_max_int(y - s->half, 0); v <= rx_min_int(y + s->half, image->height - 1); v++)
        rx_image_in_sigmas(image, left, v, right - left + 1, c.z + (v - y + s->half) * side + left - x + s->half);
    for (size_t i = 0; i < n; i++) {
        c.weight[i] = c.z[i] == c.z[i] ? 1.0f : 0.0f;
        c.z[i] = c.weight[i] > 0 ? c.z[i] : 0.0f;
        c.fits[1][i] = 1;
    }
    const int place = y * PLACES / image->height * PLACES + x * PLACES / image->width, n_shapes = s->across * s->across;
    float *shape = s->values + (size_t)place * count(s) * n, *own = c.fits[0];
    int star = 0;
    add_neighbours(w, source, place, x, y, &c);
    for (int k = 0; k < n_shapes; k++) {
        c.fits[0] = shape + (size_t)k * n;
        gains[k] = taken(&c, 0);
        star = gains[k] > gains[star] ? k : star;
    }
    c.fits[0] = own;
    const int column = star % s->across, line = star / s->across;
    sample(s, place, s->step * (column - s->across / 2 + top_between(gains + star, column, s->across, 1)),
           s->step * (line - s->across / 2 + top_between(gains + star, line, s->across, s->across)), own);
    /* what a star with that brightest pixel has of photons, and by what the PSF may be wrong */
    const double sigma = (double)rx_map_at(&image->noise, x, y), top = fmax((double)own[n / 2], 1e-9),
                 photons = image->gain > 0 ? peak / (sigma * image->gain) : 0,
                 wrong = peak * fmax(image->psf->quality.residual, LEAST_WRONG);
    for (size_t i = 0; i < n; i++) {
        const double share = fmax((double)own[i], 0) / top;
        c.weight[i] /= (float)(1 + photons * share + wrong * wrong * share * share);
    }
    const int around[] = {-1, 1, -side, side, -side - 1, -side + 1, side - 1, side + 1};
    const double across = 2 * s->reach + 1;
    double best = -HUGE_VAL;
    for (int k = 0; k < DIRECTIONS; k++) {
        collapse(&c, side, M_PI * k / DIRECTIONS, &row);
        best = fmax(best, hit_odds(&row, around, 2) - log(across * DIRECTIONS));
    }
    return fmax(best, hit_odds(&c, around, 8) - 2 * log(across));
}

/* dst += a row of pixels, behind a Gaussian: values, and their squared noise. */
static void blur_row(const float *kernel, int half, const float *src, int n, int squared, float *dst)
{
    for (int i = 0; i < n; i++)
        dst[i] = 0;
    for (int k = -half; k <= half; k++) {
        const float value = squared ? kernel[k + half] * kernel[k + half] : kernel[k + half];
        const int first = rx_max_int(0, -k), last = rx_min_int(n, n - k);
#pragma omp simd
        for (int i = first; i < last; i++)
            dst[i] += value * src[i + k];
    }
}

/* w->matched. */
static rx_status match(work *w, rx_error *err)
{
    const rx_image *image = w->image;
    const int width = image->width, height = image->height, half = (int)ceil(1.3 * w->fwhm), threads = rx_max_int(w->nthreads, 1);
    const double sigma = w->fwhm / RX_FWHM_SIGMA;
    const size_t row = (size_t)width, n = row * (size_t)height;
    float *kernel = NULL, *rows = NULL, *noise = NULL, *room = NULL;
    rx_status status = RX_OK;
    double power = 0;
    RX_TRY_EXIT(RX_MAKE(kernel, (size_t)(2 * half + 1), err));
    RX_TRY_EXIT(RX_MAKE(rows, n, err));
    RX_TRY_EXIT(RX_MAKE(noise, n, err));
    RX_TRY_EXIT(RX_MAKE(w->matched, n, err));
    RX_TRY_EXIT(RX_MAKE(room, 4 * row * (size_t)threads, err));
    for (int k = -half; k <= half; k++) {
        kernel[k + half] = (float)exp(-k * k / (2 * sigma * sigma));
        power += (double)(kernel[k + half] * kernel[k + half]);
    }
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++) {
        float *z = room + 4 * row * (size_t)t, *seen = z + row;
        for (int y = t; y < height; y += threads) {
            for (int x = 0; x < width; x += RX_MAP_PIECE)
                rx_image_in_sigmas(image, x, y, rx_map_piece(x, width), z + x);
            for (int x = 0; x < width; x++) {
                seen[x] = z[x] == z[x] ? 1.0f : 0.0f;
                z[x] = seen[x] > 0 ? z[x] : 0.0f;
            }
            blur_row(kernel, half, z, width, 0, rows + (size_t)y * row);
            blur_row(kernel, half, seen, width, 1, noise + (size_t)y * row);
        }
    }
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++) {
        float *sum = room + 4 * row * (size_t)t, *squares = sum + row;
        for (int y = t; y < height; y += threads) {
            for (int x = 0; x < width; x++)
                sum[x] = squares[x] = 0;
            for (int k = rx_max_int(-half, -y); k <= half && y + k < height; k++) {
                const float value = kernel[k + half];
                const float *from = rows + (size_t)(y + k) * row, *of = noise + (size_t)(y + k) * row;
#pragma omp simd
                for (int x = 0; x < width; x++) {
                    sum[x] += value * from[x];
                    squares[x] += value * value * of[x];
                }
            }
            for (int x = 0; x < width; x++)
                w->matched[(size_t)y * row + (size_t)x] =
                    (double)squares[x] > 0.5 * power * power ? sum[x] / sqrtf(squares[x]) : NAN;
        }
    }
exit:
    free(kernel);
    free(rows);
    free(noise);
    free(room);
    return status;
}

static float matched_at(const work *w, double x, double y)
{
    const int i = (int)lround(x), j = (int)lround(y);
    if (i < 0 || j < 0 || i >= w->image->width || j >= w->image->height)
        return NAN;
    return w->matched[(size_t)j * (size_t)w->image->width + (size_t)i];
}

/* Bin of c on a line in that direction; -1: not known. */
static int contrast(const work *w, double x, double y, double dx, double dy, float *own)
{
    const double beside = BESIDE * w->fwhm;
    *own = matched_at(w, x, y);
    const float one = matched_at(w, x - beside * dy, y + beside * dx), other = matched_at(w, x + beside * dy, y - beside * dx);
    const double c = (double)(*own - (one > other ? one : other));
    if (isnan(*own) || isnan(one) || isnan(other))
        return -1;
    return (int)fmin(fmax((c - LOWEST) / BIN, 0), BINS - 1);
}

/* f of the tile, a share in each bin, from every place of a mesh in one of the directions. */
static void measure_spread(work *w)
{
    const int step = rx_max_int(1, (int)w->fwhm);
    double all = 0;
    long next = 0;
    for (int k = 0; k < BINS; k++)
        all += w->spread[k] = 1.0 / BINS;
    for (int y = 0; y < w->image->height; y += step)
        for (int x = 0; x < w->image->width; x += step) {
            float own;
            const double angle = M_PI * (double)(next++ * 7 % ANGLES) / ANGLES;
            const int bin = contrast(w, x, y, cos(angle), sin(angle), &own);
            if (bin >= 0) {
                w->spread[bin]++;
                all++;
            }
        }
    for (int k = 0; k < BINS; k++)
        w->spread[k] /= all;
}

/* ln(f(c - b) / f(c)) of a bin; of the highest one all that is above. */
static double line_odds(const work *w, int bin, int height)
{
    double with = 0;
    if (bin < BINS - 1)
        return log(bin >= height ? w->spread[bin - height] / w->spread[bin] : w->spread[0] / w->spread[bin]);
    for (int k = BINS - 1 - height; k < BINS; k++)
        with += w->spread[k];
    return log(with / w->spread[bin]);
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

enum { HEIGHTS = sizeof heights / sizeof *heights };

/* ln L(line) - ln L(none) of the best line; source->above for it. odds: [BINS][HEIGHTS]. */
static double line_or_none(const work *w, const double (*odds)[HEIGHTS], rx_artefact *source)
{
    double best = -HUGE_VAL;
    for (int a = 0; a < ANGLES; a++) {
        const double dx = cos(M_PI * a / ANGLES), dy = sin(M_PI * a / ANGLES);
        double sum[HEIGHTS] = {0}, most = -HUGE_VAL;
        float on[2 * ALONG];
        int known = 0;
        for (int k = 0; k < 2 * ALONG; k++) {
            const double t = (k % 2 ? -1 : 1) * w->fwhm * (FIRST + NEXT * (k / 2));
            const int bin = contrast(w, source->x + t * dx, source->y + t * dy, dx, dy, &on[known]);
            if (bin < 0)
                continue;
            known++;
            for (int h = 0; h < HEIGHTS; h++)
                sum[h] += odds[bin][h];
        }
        for (int h = 0; h < HEIGHTS; h++)
            most = fmax(most, sum[h]);
        if (known < ALONG || most <= best)
            continue;
        qsort(on, (size_t)known, sizeof *on, by_value);
        const double level = (double)on[known / 2], own = (double)matched_at(w, source->x, source->y);
        best = most;
        source->above = own > 0 ? fmin(fmax(1 - level / own, 0), 1) : 1;
    }
    return best - log((double)ANGLES * HEIGHTS);
}

static rx_status sort_rows(work *w, int n, rx_error *err)
{
    const int height = w->image->height;
    RX_TRY(RX_MAKE(w->order, (size_t)n, err));
    RX_TRY(RX_MAKE(w->first_in_row, (size_t)height + 2, err));
    int *first = w->first_in_row;
    for (int i = 0; i < n; i++)
        first[w->list[i].y + 2]++;
    for (int y = 0; y < height; y++)
        first[y + 2] += first[y + 1];
    for (int i = 0; i < n; i++)
        w->order[first[w->list[i].y + 1]++] = i;
    return RX_OK;
}

/* odds[n] become probabilities. */
static void share_out(double *odds, int n)
{
    double share = 1.0 / (n + 2);
    for (int round = 0; round < ROUNDS; round++) {
        double sum = 1;
        for (int i = 0; i < n; i++)
            sum += 1 / (1 + exp(-odds[i]) * (1 - share) / share);
        share = sum / (n + 2);
    }
    for (int i = 0; i < n; i++)
        odds[i] = 1 / (1 + exp(-odds[i]) * (1 - share) / share);
}

rx_status rx_artefacts_find(const rx_image *image, int nthreads, int n, rx_artefact *list, rx_error *err)
{
    work w = {.image = image, .nthreads = nthreads, .list = list};
    const int threads = rx_max_int(nthreads, 1);
    double odds[BINS][HEIGHTS], *of = NULL, *gains = NULL;
    float *room = NULL;
    rx_status status = RX_OK;
    for (int i = 0; i < n; i++) {
        list[i].hit = list[i].line = 0;
        list[i].above = 1;
    }
    if (n == 0 || image->psf == NULL || !(image->psf->fwhm > 0))
        return RX_OK;
    w.fwhm = fmax(image->psf->fwhm, 2);
    RX_TRY_EXIT(make_shapes(image, &w.stars, err));
    RX_TRY_EXIT(match(&w, err));
    RX_TRY_EXIT(sort_rows(&w, n, err));
    measure_spread(&w);
    for (int k = 0; k < BINS; k++)
        for (int h = 0; h < HEIGHTS; h++)
            odds[k][h] = line_odds(&w, k, heights[h]);
    RX_TRY_EXIT(RX_MAKE(of, 2 * (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(room, ROOM * area(&w.stars) * (size_t)threads, err));
    RX_TRY_EXIT(RX_MAKE(gains, count(&w.stars) * (size_t)threads, err));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++)
        for (int i = t; i < n; i += threads) {
            of[i] = hit_or_star(&w, &list[i], room + ROOM * area(&w.stars) * (size_t)t, gains + count(&w.stars) * (size_t)t);
            of[n + i] = line_or_none(&w, (const double(*)[HEIGHTS])odds, &list[i]);
        }
    share_out(of, n);
    share_out(of + n, n);
    for (int i = 0; i < n; i++) {
        list[i].hit = of[i];
        list[i].line = of[n + i];
    }
exit:
    free(w.stars.values);
    free(w.stars.samples);
    free(gains);
    free(w.order);
    free(w.first_in_row);
    free(w.matched);
    free(of);
    free(room);
    return status;
}
