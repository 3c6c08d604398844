/* Hits among sources. */
#include "fit/hits.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "psf/resample.h"

enum {
    PLACES = 3,     /* of a PSF that varies, along each axis */
    LEAST_FREE = 8, /* pixels by which a reduced chi2 is known to a half */
    LARGEST = 16,   /* pixels from the middle of a patch: light that is wider than that is a slope there */
    MOST = 20,      /* sources and a level on a patch, of some six beams */
    TURNS = 64,     /* in which sources or pixels are added */
    WIDE = 3,       /* pixels: of a track that lies between two rows, with what diffuses */
    SIZES = 4,
    ANGLES = 8,
    KINDS = 1 + 2 * ANGLES, /* round, and of two axis ratios */
    OFFSETS = 3,            /* of galaxies, along each axis */
    GALAXIES = SIZES * KINDS * OFFSETS * OFFSETS,
    ORDER = 3,  /* of Lanczos interpolation */
    ROUNDS = 20 /* of EM: the share changes by less than a hundredth */
};

static const double STEP =
    0.15; /* FWHM, between places of a star: a parabola is good to a hundredth pixel there */
static const double FOUND = 5;          /* sigmas: sources of the tile are brighter, DETECT_THRESH */
static const double LEAST_WRONG = 0.02; /* of the PSF, share of its peak */
static const double RADII[SIZES] = {0.35, 0.7, 1.4, 2.8}; /* half-light radii of galaxies, FWHM */
static const double RATIOS[] = {1, 0.5, 0.2};             /* b/a */
static const double APART = 0.3;                          /* FWHM, between places of galaxies */

/* The PSF at one of its places, moved within the brightest pixel's surroundings. */
typedef struct shapes {
    int places;              /* of the PSF on the tile, along each axis */
    int reach, half, across; /* pixels; places along an axis */
    double fwhm;             /* pixels, at least 2 */
    double step;             /* pixels, between these */
    float *values;           /* [places^2][across^2 + GALAXIES][(2 half + 1)^2] */
    int side, fine;
    float *samples; /* [places^2][side][side], fine of them a pixel */
} shapes;

/* The pixels around the brightest one of a source, which is their middle, and what explains them. */
typedef struct patch {
    int n, side, used;     /* pixels, along an axis, known */
    int place;             /* of the PSF */
    double photons, wrong; /* variance a sigma of light; share of light */
    float *z, *weight, *left,
        *fits[MOST]; /* [n] sigmas, 1 / variance, z without the fits: a level, sources */
    double height[MOST];
    unsigned char *free; /* [n] not 0: a pixel of a hit, of any value */
    int nfits, nfree;
    double paid;   /* what they cost, chi2 */
    double *gains; /* [across^2] of points */
} patch;

static size_t area(const shapes *s)
{
    return (size_t)(2 * s->half + 1) * (size_t)(2 * s->half + 1);
}

static size_t count(const shapes *s)
{
    return (size_t)s->across * (size_t)s->across;
}

/* The PSF of a place, moved by (dx, dy), on the pixels of the patch. */
static void sample(const shapes *s, int place, double dx, double dy, float *dst)
{
    const float *samples = s->samples + (size_t)place * (size_t)s->side * (size_t)s->side;
    double across[2 * RX_LANCZOS_MAX], up[2 * RX_LANCZOS_MAX];
    const int x0 = rx_lanczos_weights(s->side / 2 - s->fine * (s->half + dx), ORDER, across),
              y0 = rx_lanczos_weights(s->side / 2 - s->fine * (s->half + dy), ORDER, up);
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

static size_t all_count(const shapes *s)
{
    return count(s) + GALAXIES;
}

static const float *shapes_at(const shapes *s, int place)
{
    return s->values + (size_t)place * all_count(s) * area(s);
}

/* Where that place is, pixels from the middle. */
static void place_of(const shapes *s, size_t k, double *dx, double *dy)
{
    *dx = s->step * ((int)k % s->across - s->across / 2);
    *dy = s->step * ((double)((int)k / s->across) - s->across / 2);
}

RX_SIMD static void add(float *restrict dst, float times, const float *restrict values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        dst[i] += times * values[i];
}

/* Exponential profiles behind the PSF, as sums of points: what follows the points of a place. */
static void make_galaxies(const shapes *s)
{
    const size_t n = area(s), all = all_count(s) * n;
    for (int g = 0; g < GALAXIES; g++) {
        const int offset = g % (OFFSETS * OFFSETS), kind = g / (OFFSETS * OFFSETS) % KINDS;
        const double radius = RADII[g / (OFFSETS * OFFSETS * KINDS)] * s->fwhm,
                     ratio = RATIOS[(kind + ANGLES - 1) / ANGLES], c = cos(M_PI * kind / ANGLES),
                     d = sin(M_PI * kind / ANGLES), x0 = APART * s->fwhm * (offset % OFFSETS - OFFSETS / 2),
                     y0 = APART * s->fwhm * ((double)(offset / OFFSETS) - OFFSETS / 2);
        float *const first = s->values + (count(s) + (size_t)g) * n;
        double sum = 0;
        for (size_t k = 0; k < count(s); k++) {
            double dx, dy;
            place_of(s, k, &dx, &dy);
            dx -= x0;
            dy -= y0;
            const double along = dx * c + dy * d, beside = (dy * c - dx * d) / ratio,
                         light = exp(-1.678 * sqrt(along * along + beside * beside) / radius);
            sum += light;
            for (int place = 0; place < s->places * s->places; place++)
                add(first + (size_t)place * all, (float)light, s->values + (size_t)place * all + k * n, n);
        }
        for (int place = 0; place < s->places * s->places; place++)
            for (size_t i = 0; i < n; i++)
                first[(size_t)place * all + i] /= (float)sum;
    }
}

static rx_status make_shapes(const rx_image *image, shapes *s, rx_error *err)
{
    const rx_psf *psf = image->psf;
    s->fwhm = fmax(psf->fwhm, 2);
    s->side = rx_psf_fine_side(psf);
    s->fine = rx_psf_fine(psf);
    s->reach = rx_max_int(1, (int)lround(s->fwhm / 2));
    s->half = rx_min_int(2 * s->reach + 1, LARGEST);
    s->step = STEP * s->fwhm;
    s->across = 2 * (int)ceil(s->half / s->step) + 1;
    const size_t samples = (size_t)s->side * (size_t)s->side;
    s->places = psf->nbasis > 1 ? PLACES : 1;
    const int places = s->places * s->places;
    RX_TRY(RX_MAKE(s->samples, (size_t)places * samples, err));
    RX_TRY(RX_MAKE(s->values, (size_t)places * all_count(s) * area(s), err));
    for (int place = 0; place < places; place++) {
        rx_psf_fine_at(psf, (place % s->places + 0.5) / s->places * image->width,
                       ((double)(place / s->places) + 0.5) / s->places * image->height,
                       s->samples + (size_t)place * samples);
        for (size_t k = 0; k < count(s); k++) {
            double dx, dy;
            place_of(s, k, &dx, &dy);
            sample(s, place, dx, dy, s->values + ((size_t)place * all_count(s) + k) * area(s));
        }
    }
    make_galaxies(s);
    return RX_OK;
}

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

/* Heights by least squares, those of points not negative; points without any are let go. */
static void solve(patch *p)
{
    double normal[MOST][MOST], right[MOST], unused;
    bool without[MOST] = {false};
    for (int k = 0; k < p->nfits; k++) {
        for (int j = 0; j < k; j++) {
            sums(p->weight, p->fits[j], p->fits[k], p->n, &normal[k][j], &unused);
            normal[j][k] = normal[k][j];
        }
        sums(p->weight, p->z, p->fits[k], p->n, &right[k], &normal[k][k]);
    }
    for (int lowest = -1; lowest != 0;) {
        double factor[MOST][MOST], along[MOST];
        int in[MOST], n = 0;
        for (int k = 0; k < p->nfits; k++) {
            p->height[k] = 0;
            if (without[k])
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
        lowest = 0;
        for (int j = n - 1; j >= 0; j--) {
            double value = along[j];
            for (int i = j + 1; i < n; i++)
                value -= factor[i][j] * p->height[in[i]];
            p->height[in[j]] = value / factor[j][j];
            if (in[j] > 0 && p->height[in[j]] < 0 && (lowest == 0 || p->height[in[j]] < p->height[lowest]))
                lowest = in[j];
        }
        without[lowest] = true;
    }
    int kept = 1;
    for (int k = 1; k < p->nfits; k++)
        if (p->height[k] > 0) {
            float *const spare = p->fits[kept];
            p->fits[kept] = p->fits[k];
            p->fits[k] = spare;
            p->height[kept++] = p->height[k];
        }
    p->nfits = kept;
}

/* left = z less the fits, its chi2. follow: the weights become those of the light. */
RX_SIMD static double subtract(patch *p, bool follow)
{
    double chi2 = 0;
    memcpy(p->left, p->z, (size_t)p->n * sizeof *p->left);
    for (int k = 1; k < p->nfits; k++) {
        const float height = (float)p->height[k];
        for (int i = 0; i < p->n; i++)
            p->left[i] -= height * p->fits[k][i];
    }
    for (int i = 0; i < p->n; i++) {
        const double light = fmax((double)(p->z[i] - p->left[i]), 0);
        if (follow && p->weight[i] > 0)
            p->weight[i] = (float)(1 / (1 + p->photons * light + p->wrong * p->wrong * light * light));
        p->left[i] -= (float)p->height[0];
        chi2 += (double)(p->weight[i] * p->left[i] * p->left[i]);
    }
    return chi2;
}

/* Where between its neighbours, -0.5 to 0.5, a parabola has its top; `place` of n along that axis. */
static double top_between(const double *gain, int place, int n, int next)
{
    if (place == 0 || place == n - 1)
        return 0;
    const double bend = gain[-next] + gain[next] - 2 * gain[0];
    return bend < 0 ? fmin(fmax(0.5 * (gain[-next] - gain[next]) / bend, -0.5), 0.5) : 0;
}

typedef enum scene { LIGHT, HIT, BOTH } scene;

/* Gain in chi2 of one more source, shape k, at its best height. */
static double gain_of(const shapes *s, const patch *p, size_t k)
{
    double light, power;
    sums(p->weight, p->left, shapes_at(s, p->place) + k * area(s), p->n, &light, &power);
    return light > 0 && power > 0 ? light * light / power : 0;
}

/* The best place for one more source among those that are `step` places apart, up to `far` of them from place `from`. HIT has none
 * within a FWHM of the middle, where that of BOTH is. */
static double best_place(const shapes *s, patch *p, scene kind, int from, int far, int step, int *best)
{
    const int x0 = from % s->across, y0 = from / s->across;
    double most = 0;
    for (int y = y0 - far; y <= y0 + far; y += step)
        for (int x = x0 - far; x <= x0 + far; x += step) {
            const size_t k = (size_t)(y * s->across + x);
            double dx, dy;
            if (x < 0 || y < 0 || x >= s->across || y >= s->across)
                continue;
            place_of(s, k, &dx, &dy);
            if (kind != LIGHT && (hypot(dx, dy) < s->fwhm) != (kind == BOTH))
                continue;
            p->gains[k] = gain_of(s, p, k);
            if (p->gains[k] > most) {
                most = p->gains[k];
                *best = (int)k;
            }
        }
    return most;
}

/* The best source to add, its gain in chi2. The first one of LIGHT may be a galaxy. Places two steps apart are enough to see where a
 * point is worth most; those around it say where between. */
static double best_source(const shapes *s, patch *p, scene kind, int *best)
{
    const int middle = (int)count(s) / 2;
    double most;
    memset(p->gains, 0, count(s) * sizeof *p->gains);
    if (best_place(s, p, kind, middle, s->across / 2 / 2 * 2, 2, best) <= 0)
        *best = middle;
    most = best_place(s, p, kind, *best, 2, 1, best);
    for (size_t k = count(s); kind == LIGHT && p->nfits == 1 && k < all_count(s); k++) {
        const double gain = gain_of(s, p, k);
        if (gain > most) {
            most = gain;
            *best = (int)k;
        }
    }
    return most;
}

static void add_source(const shapes *s, patch *p, int best)
{
    float *dst = p->fits[p->nfits++];
    double dx, dy;
    if (best >= (int)count(s)) {
        memcpy(dst, shapes_at(s, p->place) + (size_t)best * area(s), area(s) * sizeof *dst);
        return;
    }
    place_of(s, (size_t)best, &dx, &dy);
    dx += s->step * top_between(p->gains + best, best % s->across, s->across, 1);
    dy += s->step * top_between(p->gains + best, best / s->across, s->across, s->across);
    sample(s, p->place, dx, dy, dst);
}

static void set_free(patch *p, int at)
{
    p->free[at] = 1;
    p->weight[at] = 0;
    p->nfree++;
}

/* What is added costs, chi2: a source; a pixel beside one of a hit, one elsewhere; range: of the logarithm of their heights. */
typedef struct costs {
    double source, beside, lone, range;
} costs;

static bool is_beside(const patch *p, int x, int y)
{
    for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, p->side - 1); v++)
        for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, p->side - 1); u++)
            if (p->free[v * p->side + u])
                return true;
    return false;
}

/* The pixel with most light that nothing explains: its gain in chi2 beyond what it costs, *cost. */
static double best_pixel(const shapes *s, const patch *p, scene kind, const costs *costs, int *best,
                         double *cost)
{
    const int half = p->side / 2;
    double most = 0;
    for (int i = 0; i < p->n; i++) {
        const int x = i % p->side, y = i / p->side;
        const double chi = p->left[i] > 0 ? sqrt((double)p->weight[i]) * (double)p->left[i] : 0,
                     height = 2 * fmax(log(chi * costs->range / sqrt(2 * M_PI)), 0);
        if (chi * chi - height - costs->beside <= most ||
            (kind == LIGHT && abs(x - half) <= s->reach + 1 && abs(y - half) <= s->reach + 1))
            continue;
        const double own = height + (is_beside(p, x, y) ? costs->beside : costs->lone);
        if (chi * chi - own <= most)
            continue;
        most = chi * chi - own;
        *cost = own;
        *best = i;
    }
    return most;
}

/* Adds what the scene calls for; its chi2 with what that costs. */
static double explain(const shapes *s, patch *p, scene kind, const costs *costs)
{
    double chi2 = 0;
    for (int turn = 0; turn < TURNS; turn++) {
        int place = 0, pixel = 0;
        double of_pixel = 0, pixels = 0, sources = 0;
        solve(p);
        chi2 = subtract(p, kind == LIGHT);
        const double of_source = kind == LIGHT && p->nfits == 1 ? 0 : costs->source;
        if (p->nfree < WIDE * p->side && (kind == HIT || p->nfits > 1))
            pixels = best_pixel(s, p, kind, costs, &pixel, &of_pixel);
        if (p->nfits < MOST && (kind == LIGHT || pixels <= 0))
            sources = best_source(s, p, kind, &place) - of_source;
        if (fmax(pixels, sources) <= 0)
            break;
        if (pixels > sources)
            set_free(p, pixel);
        else
            add_source(s, p, place);
        p->paid += pixels > sources ? of_pixel : of_source;
    }
    return chi2 + p->paid;
}

/* The brightest pixel around, *x and *y; 0: none is above the sky, or one is saturated. */
static float brightest_near(const rx_image *image, int reach, int *x, int *y)
{
    const int x0 = *x, y0 = *y;
    float most = 0;
    for (int v = rx_max_int(y0 - reach, 0); v <= rx_min_int(y0 + reach, image->height - 1); v++) {
        float row[RX_MAP_PIECE];
        const int left = rx_max_int(x0 - reach, 0),
                  n = rx_min_int(rx_min_int(x0 + reach, image->width - 1) - left + 1, RX_MAP_PIECE);
        rx_image_sigmas(image, left, v, n, row);
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

/* The pixels around (x, y), and a level. */
static void cut(const rx_image *image, const shapes *s, int x, int y, patch *p)
{
    const double sigma = (double)rx_map_at(&image->noise, x, y);
    const int left = rx_max_int(x - s->half, 0), right = rx_min_int(x + s->half, image->width - 1);
    p->side = 2 * s->half + 1;
    p->n = p->side * p->side;
    p->place = y * s->places / image->height * s->places + x * s->places / image->width;
    p->photons = image->gain > 0 ? 1 / (sigma * image->gain) : 0;
    p->wrong = fmax(fmax(image->psf->quality.residual, rx_psf_flux_error(image->psf, x, y)), LEAST_WRONG);
    p->nfits = 1;
    p->nfree = p->used = 0;
    p->paid = 0;
    for (int i = 0; i < p->n; i++)
        p->z[i] = NAN;
    for (int v = rx_max_int(y - s->half, 0); v <= rx_min_int(y + s->half, image->height - 1); v++)
        rx_image_sigmas(image, left, v, right - left + 1,
                        p->z + (v - y + s->half) * p->side + left - x + s->half);
    for (int i = 0; i < p->n; i++) {
        const bool known = p->z[i] == p->z[i];
        p->weight[i] = known ? 1.0f : 0.0f;
        p->z[i] = known ? p->z[i] : 0.0f;
        p->fits[0][i] = 1;
        p->free[i] = 0;
        p->used += known;
    }
}

/* Each source once more where the others leave most of it, while pixels are not explained: the first of a blend was placed between
 * both. Returns by how much chi2 fell. */
static double place_again(const shapes *s, patch *p)
{
    double before = subtract(p, true), least = before;
    for (int k = p->nfits - 1; k > 0 && p->nfits > 2 && least > p->used; k--) {
        float *const out = p->fits[1];
        int best = 0;
        for (int i = 0; i < p->n; i++)
            p->left[i] += (float)p->height[1] * out[i];
        memmove(&p->fits[1], &p->fits[2], (size_t)(p->nfits - 2) * sizeof *p->fits);
        p->fits[--p->nfits] = out;
        if (best_source(s, p, LIGHT, &best) > 0)
            add_source(s, p, best);
        solve(p);
        least = fmin(subtract(p, true), least);
    }
    return before - least;
}

/* ln L(hit) - ln(L(light) + L(both)); density: of sources, a pixel. */
static double hit_odds(const rx_image *image, const shapes *s, double density, const rx_source *source,
                       patch *p)
{
    int x = source->xpeak, y = source->ypeak, place = 0;
    const double most = (double)brightest_near(image, s->reach, &x, &y);
    if (!(most > 0))
        return -HUGE_VAL;
    cut(image, s, x, y, p);
    const double pixels = pow(2 * s->reach + 1, 2), height = fmax(log(most / sqrt(2 * M_PI)), 0);
    const costs costs = {.source = 2 * fmax(height - log(density * pixels), 0),
                         .beside = 2 * log(8),
                         .lone = -2 * log(density),
                         .range = fmax(log(most), 1)};
    double light = explain(s, p, LIGHT, &costs);
    light -= place_again(s, p);
    for (int i = 0; i < p->n; i++) /* hits beside it are to be found again */
        if (p->free[i])
            p->weight[i] = (float)(1 / (1 + p->photons * fmax((double)p->z[i], 0)));
    memset(p->free, 0, (size_t)p->n);
    p->nfits = 1;
    p->nfree = 0;
    p->paid = 2 * log(pixels);
    set_free(p, p->n / 2);
    const double hit = explain(s, p, HIT, &costs), gain = best_source(s, p, BOTH, &place),
                 both = hit - gain + pow(fmax(FOUND - sqrt(gain), 0), 2) + costs.source;
    const int known = p->used - p->nfits - p->nfree;
    const double reduced = known > LEAST_FREE ? fmax((hit - p->paid) / known, 1) : 1,
                 of_light = 0.5 * (hit - light) / reduced, of_both = 0.5 * (hit - both) / reduced;
    return -fmax(of_light, of_both) - log1p(exp(-fabs(of_light - of_both)));
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

rx_status rx_hits_mark(const rx_image *image, int nthreads, int first, rx_sources *sources, rx_error *err)
{
    const int threads = rx_max_int(nthreads, 1), n = sources->n - first;
    rx_source *const list = sources->list + first;
    const double density = sources->n / ((double)image->width * image->height);
    shapes s = {0};
    double *odds = NULL, *gains = NULL;
    float *room = NULL;
    unsigned char *freed = NULL;
    rx_status status = RX_OK;
    if (n <= 0 || image->psf == NULL || !(image->psf->fwhm > 0) || image->psf->quality.sharper > 0)
        return RX_OK;
    RX_TRY_EXIT(make_shapes(image, &s, err));
    RX_TRY_EXIT(RX_MAKE(odds, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(room, (MOST + 3) * area(&s) * (size_t)threads, err));
    RX_TRY_EXIT(RX_MAKE(gains, count(&s) * (size_t)threads, err));
    RX_TRY_EXIT(RX_MAKE(freed, area(&s) * (size_t)threads, err));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++) {
        float *own = room + (MOST + 3) * area(&s) * (size_t)t;
        patch p = {.z = own,
                   .weight = own + area(&s),
                   .left = own + 2 * area(&s),
                   .gains = gains + count(&s) * (size_t)t,
                   .free = freed + area(&s) * (size_t)t};
        for (int k = 0; k < MOST; k++)
            p.fits[k] = own + (size_t)(k + 3) * area(&s);
        for (int i = t; i < n; i += threads)
            odds[i] = hit_odds(image, &s, density, &list[i], &p);
    }
    share_out(odds, n);
    for (int i = 0; i < n; i++)
        rx_source_doubt(&list[i], odds[i]);
exit:
    free(s.values);
    free(s.samples);
    free(gains);
    free(odds);
    free(room);
    free(freed);
    return status;
}
