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
    PLACES = 3,     /* of the PSF on the tile, along each axis */
    PIXELS = 3,     /* of a hit */
    LEAST_FREE = 8, /* cells by which a reduced chi2 is known to a half */
    MOST = 9,       /* points and a level on a patch */
    ANGLES = 48,    /* half a FWHM apart where a line ends */
    DIRECTIONS = 8, /* of tracks */
    ALONG = 8,      /* places on either side, */
    BINS = 256,     /* of c */
    ORDER = 3,      /* of Lanczos interpolation */
    ROUNDS = 20     /* of EM: shares change by less than a hundredth */
};

static const double STEP =
    0.15; /* FWHM, between places of a star: a parabola is good to a hundredth pixel there */
static const double FIRST = 2.5, NEXT = 1.25, BESIDE = 3; /* FWHM: of places on a line */
static const double LEAST_WRONG = 0.02;                   /* of the PSF, share of its peak */
static const double ROWS =
    1.5; /* FWHM over rows of a track, where it has two or more: thin galaxies are as narrow where it has one */
static const double ELSE = 0.1; /* of the places on a line or none: a star is there, of any height */
static const double BIN = 0.25, LOWEST = -8;                                       /* sigmas of c */
static const int heights[] = {4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 248}; /* bins */

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
    float *matched;      /* [height][width], m; NAN where half of it is hidden */
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
    s->across = 2 * (int)ceil(s->half / s->step) + 1;
    const size_t samples = (size_t)s->side * (size_t)s->side;
    RX_TRY(RX_MAKE(s->samples, PLACES * PLACES * samples, err));
    RX_TRY(RX_MAKE(s->values, PLACES * PLACES * count(s) * area(s), err));
    for (int place = 0; place < PLACES * PLACES; place++) {
        rx_psf_fine_at(psf, (place % PLACES + 0.5) / PLACES * image->width,
                       ((double)(place / PLACES) + 0.5) / PLACES * image->height,
                       s->samples + (size_t)place * samples);
        for (int k = 0; k < s->across * s->across; k++)
            sample(s, place, s->step * (k % s->across - s->across / 2),
                   s->step * ((double)(k / s->across) - s->across / 2),
                   s->values + ((size_t)place * count(s) + (size_t)k) * area(s));
    }
    return RX_OK;
}

/* Pixels of a patch, or means of its rows in some direction, with what fits them: [n] each. */
typedef struct cells {
    int n;                          /* the brightest one is the middle */
    float *z, *weight, *fits[MOST]; /* fits: a level, points */
    int nfits;
    unsigned own; /* bits of those points that are within reach */
} cells;

/* Sums of weight a b and weight b b. */
RX_SIMD static void sums(const float *restrict weight, const float *restrict a, const float *restrict b,
                         int n, double *ab, double *bb)
{
    float one = 0, two = 0;
#pragma omp simd reduction(+ : one, two)
    for (int i = 0; i < n; i++) {
        const float w = weight[i] * b[i];
        one += w * a[i];
        two += w * b[i];
    }
    *ab = (double)one;
    *bb = (double)two;
}

/* What chi2 the fits but those of the bits `without` take of z, least squares with points that are not negative. height: [MOST], theirs. */
static double chi2_taken(const cells *c, unsigned without, double *height)
{
    double normal[MOST][MOST], right[MOST], unused, all;
    for (int k = 0; k < c->nfits; k++) {
        for (int j = 0; j < k; j++) {
            sums(c->weight, c->fits[j], c->fits[k], c->n, &normal[k][j], &unused);
            normal[j][k] = normal[k][j];
        }
        sums(c->weight, c->z, c->fits[k], c->n, &right[k], &normal[k][k]);
    }
    for (;;) {
        double factor[MOST][MOST], along[MOST];
        int in[MOST], n = 0, lowest = 0;
        for (int k = 0; k < c->nfits; k++) {
            height[k] = 0;
            if (without >> k & 1)
                continue;
            double own = normal[k][k], light = right[k];
            for (int j = 0; j < n; j++) {
                factor[n][j] = normal[k][in[j]];
                for (int i = 0; i < j; i++)
                    factor[n][j] -= factor[n][i] * factor[j][i];
                factor[n][j] /= factor[j][j];
                own -= factor[n][j] * factor[n][j];
                light -= factor[n][j] * along[j];
            }
            if (!(own > 1e-3 * normal[k][k])) /* next to a sum of the others */
                continue;
            factor[n][n] = sqrt(own);
            along[n] = light / factor[n][n];
            in[n++] = k;
        }
        all = 0;
        for (int j = n - 1; j >= 0; j--) {
            double value = along[j];
            all += along[j] * along[j];
            for (int i = j + 1; i < n; i++)
                value -= factor[i][j] * height[in[i]];
            height[in[j]] = value / factor[j][j];
            if (in[j] > 0 && height[in[j]] < 0 && (lowest == 0 || height[in[j]] < height[lowest]))
                lowest = in[j];
        }
        if (lowest == 0)
            return all;
        without |= 1u << lowest;
    }
}

/* The largest of ln L(hit and points beyond reach) - ln L(points) where one to three cells, the middle and the brightest of its
 * neighbours, may have any value. The weights of these are 0 afterwards. */
static double hit_odds(cells *c, const int *beside, int nbeside, int pixels)
{
    const int middle = c->n / 2;
    double best = -HUGE_VAL, kept = 0, height[MOST]; /* kept: chi2 that the hit's cells take */
    if (!(c->weight[middle] > 0) || !(c->z[middle] > 0))
        return best;
    double all = 0;
    int free_cells = -c->nfits;
    for (int i = 0; i < c->n; i++) {
        all += (double)(c->weight[i] * c->z[i] * c->z[i]);
        free_cells += c->weight[i] > 0;
    }
    const double points = chi2_taken(c, 0, height),
                 size = (double)c->z[middle] * sqrt((double)c->weight[middle]),
                 other = log((double)nbeside) + fmax(log(size / sqrt(2 * M_PI)), 0);
    for (int k = 0, at = middle; k < pixels && at >= 0; k++) {
        kept += (double)(c->weight[at] * c->z[at] * c->z[at]);
        c->weight[at] = 0;
        const double with = kept + chi2_taken(c, c->own, height),
                     reduced = free_cells - k > LEAST_FREE ? (all - with) / (free_cells - k - 1) : 1;
        best = fmax(best, (with - points) / (2 * fmax(reduced, 1)) - k * other);
        at = -1;
        for (int i = 0; i < nbeside; i++)
            if (c->z[middle + beside[i]] > 0 && c->weight[middle + beside[i]] > 0 &&
                (at < 0 || c->z[middle + beside[i]] > c->z[at]))
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
    dst->own = c->own;
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
        const int left = rx_max_int(x0 - reach, 0),
                  n = rx_min_int(rx_min_int(x0 + reach, image->width - 1) - left + 1, RX_MAP_PIECE);
        rx_image_in_sigmas(image, left, v, n, row);
        for (int i = 0; i < n; i++) {
            if (image->mask != NULL &&
                (image->mask[(size_t)v * (size_t)image->width + (size_t)(left + i)] & RX_MASK_SATURATED))
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

/* Points are added one by one where what is left has most of one, until that is no more than noise. room: [2][n]. */
static void fit_points(const shapes *s, int place, double photons, double wrong, cells *c, float *room,
                       double *gains)
{
    const size_t n = (size_t)c->n, shapes_n = count(s);
    float *left = room, *model = room + n, *seen = c->weight;
    const float *shape = s->values + (size_t)place * shapes_n * n;
    const double least = 2 * log((double)shapes_n) +
                         6; /* chi2 of a peak of noise in so many places; three numbers, by Akaike */
    for (;;) {
        double height[MOST], most = 0;
        int best = 0;
        chi2_taken(c, 0, height);
        for (size_t i = 0; i < n; i++)
            model[i] = 0;
        for (int k = 1; k < c->nfits; k++)
            for (size_t i = 0; i < n; i++)
                model[i] += (float)height[k] * c->fits[k][i];
        for (size_t i = 0; i < n; i++) {
            const double light = fmax((double)model[i], 0);
            left[i] = c->z[i] - model[i] - (float)height[0];
            if (seen[i] > 0)
                c->weight[i] = (float)(1 / (1 + photons * light + wrong * wrong * light * light));
        }
        if (c->nfits == MOST)
            return;
        for (size_t k = 0; k < shapes_n; k++) {
            double light, power;
            sums(c->weight, left, shape + k * n, c->n, &light, &power);
            gains[k] = light > 0 && power > 0 ? light * light / power : 0;
            if (gains[k] > most) {
                most = gains[k];
                best = (int)k;
            }
        }
        if (!(most > (c->own == 0 ? 0 : least)))
            return;
        const int column = best % s->across, line = best / s->across;
        const double dx =
                         s->step * (column - s->across / 2 + top_between(gains + best, column, s->across, 1)),
                     dy = s->step *
                          (line - s->across / 2 + top_between(gains + best, line, s->across, s->across));
        if (hypot(dx, dy) < s->reach + 0.5)
            c->own |= 1u << c->nfits;
        sample(s, place, dx, dy, c->fits[c->nfits++]);
    }
}

/* room: [ROOM][area]; gains: [across^2]. */
enum { ROOM = 2 * (MOST + 2) + 2 };
static double hit_or_star(const work *w, const rx_artefact *source, float *room, double *gains)
{
    const rx_image *image = w->image;
    const shapes *s = &w->stars;
    const size_t n = area(s);
    const int side = 2 * s->half + 1;
    cells c = {.n = (int)n, .z = room, .weight = room + n, .nfits = 1},
          row = {.z = room + 2 * n, .weight = room + 3 * n};
    const int rows = rx_min_int(rx_max_int((int)(w->fwhm / ROWS), 1), PIXELS);
    double best = -HUGE_VAL;
    for (int k = 0; k < MOST; k++) {
        c.fits[k] = room + (size_t)(4 + k) * n;
        row.fits[k] = room + (size_t)(4 + MOST + k) * n;
    }
    int x = source->x, y = source->y;
    if (image->psf->quality.sharper > 0 || !(brightest_near(w, &x, &y) > 0))
        return best;
    for (size_t i = 0; i < n; i++)
        c.z[i] = NAN;
    const int left = rx_max_int(x - s->half, 0), right = rx_min_int(x + s->half, image->width - 1);
    for (int v = rx_max_int(y - s->half, 0); v <= rx_min_int(y + s->half, image->height - 1); v++)
        rx_image_in_sigmas(image, left, v, right - left + 1,
                           c.z + (v - y + s->half) * side + left - x + s->half);
    for (size_t i = 0; i < n; i++) {
        c.weight[i] = c.z[i] == c.z[i] ? 1.0f : 0.0f;
        c.z[i] = c.weight[i] > 0 ? c.z[i] : 0.0f;
        c.fits[0][i] = 1;
    }
    const double sigma = (double)rx_map_at(&image->noise, x, y);
    fit_points(s, y * PLACES / image->height * PLACES + x * PLACES / image->width,
               image->gain > 0 ? 1 / (sigma * image->gain) : 0,
               fmax(fmax(image->psf->quality.residual, rx_psf_flux_error(image->psf, x, y)), LEAST_WRONG), &c,
               room + (size_t)(4 + 2 * MOST) * n, gains);
    const int around[] = {-1, 1, -side, side, -side - 1, -side + 1, side - 1, side + 1};
    const double across = 2 * s->reach + 1;
    for (int k = 0; k < DIRECTIONS && w->fwhm >= 2 * ROWS; k++) {
        collapse(&c, side, M_PI * k / DIRECTIONS, &row);
        best = fmax(best, hit_odds(&row, around, 2, rows) - log(across * DIRECTIONS));
    }
    return fmax(best, hit_odds(&c, around, 8, PIXELS) - 2 * log(across));
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
    const int width = image->width, height = image->height, half = (int)ceil(1.3 * w->fwhm),
              threads = rx_max_int(w->nthreads, 1);
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
    const float one = matched_at(w, x - beside * dy, y + beside * dx),
                other = matched_at(w, x + beside * dy, y - beside * dx);
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

/* ln(mean f(c - b) / f(c)) of a bin, b from one height to the next; of the highest bin all that is above. */
static double line_odds(const work *w, int bin, int height)
{
    double with = 0;
    for (int shift = heights[height]; shift < heights[height + 1]; shift++) {
        if (bin == 0 || (bin < BINS - 1 && bin > shift))
            with += w->spread[rx_max_int(bin - shift, 0)];
        else if (bin < BINS - 1) /* somewhere below the lowest bin */
            with += w->spread[0] / BINS;
        for (int k = BINS - 1 - shift; bin == BINS - 1 && k < BINS; k++)
            with += w->spread[k];
    }
    with /= heights[height + 1] - heights[height];
    return log(((1 - ELSE) * with + ELSE / BINS) / ((1 - ELSE) * w->spread[bin] + ELSE / BINS));
}

static int by_value(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

enum { HEIGHTS = sizeof heights / sizeof *heights - 1 };

/* ln L(line) - ln L(none) of the best line; source->off_line for it. odds: [BINS][HEIGHTS]. */
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
        source->off_line = own > 0 ? fmin(fmax(1 - level / own, 0), 1) : 1;
    }
    return best - log((double)ANGLES * HEIGHTS);
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
    work w = {.image = image, .nthreads = nthreads};
    const int threads = rx_max_int(nthreads, 1);
    double(*odds)[HEIGHTS] = NULL, *of = NULL, *gains = NULL;
    float *room = NULL;
    rx_status status = RX_OK;
    for (int i = 0; i < n; i++) {
        list[i].hit = list[i].line = 0;
        list[i].off_line = 1;
    }
    if (n == 0 || image->psf == NULL || !(image->psf->fwhm > 0))
        return RX_OK;
    w.fwhm = fmax(image->psf->fwhm, 2);
    RX_TRY_EXIT(make_shapes(image, &w.stars, err));
    RX_TRY_EXIT(match(&w, err));
    RX_TRY_EXIT(RX_MAKE(odds, BINS, err));
    measure_spread(&w);
    for (int k = 0; k < BINS; k++)
        for (int h = 0; h < HEIGHTS; h++)
            odds[k][h] = line_odds(&w, k, h);
    RX_TRY_EXIT(RX_MAKE(of, 2 * (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(room, ROOM * area(&w.stars) * (size_t)threads, err));
    RX_TRY_EXIT(RX_MAKE(gains, count(&w.stars) * (size_t)threads, err));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++)
        for (int i = t; i < n; i += threads) {
            of[i] = hit_or_star(&w, &list[i], room + ROOM * area(&w.stars) * (size_t)t,
                                gains + count(&w.stars) * (size_t)t);
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
    free(odds);
    free(w.matched);
    free(of);
    free(room);
    return status;
}
