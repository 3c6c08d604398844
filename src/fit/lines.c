/* Sources along lines. */
#include "fit/lines.h"

#include <math.h>
#include <stdlib.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/stats.h"

enum {
    ANGLES = 120, /* at the far end half a FWHM from one to the next, the width of a point in lambda 1.4 */
    PLACES = 17,  /* along a direction to one side */
    STRIP = 64    /* rows of lambda at a time */
};

static const double NEAREST = 3, BETWEEN = 1.5; /* FWHM: the first place, from one to the next */
static const double TENTH = 1.28; /* sigmas from the lowest tenth of a normal distribution to its mean */
static const double EVEN =
    0.7; /* of the quarter's level, that of the tenth: the same on a line, far lower in a crowd */
static const double STANDS_OUT =
    5.4; /* sigmas, which one of 120 directions of 1,000 sources passes with a probability of 0.004 */

/* Pixels from a source. */
typedef struct place {
    int x, y;
} place;

typedef struct work {
    const rx_image *image;
    double fwhm;         /* pixels */
    int reach;           /* pixels */
    float *filter;       /* [2 reach + 1] a Gaussian; [2 reach + 1] its squares */
    double power;        /* sum of these */
    double noise;        /* of lambda, where pixels are independent 1 */
    float *lambda;       /* [height][width] NAN: not known */
    place (*to)[PLACES]; /* [2 ANGLES] along directions of a full turn, the nearest first */
} work;

/* dst[n] = sum_k filter[k] src[k next ...] */
RX_SIMD static void smooth(const float *src, size_t next, const float *filter, int taps, int n,
                           float *restrict dst)
{
    for (int i = 0; i < n; i++)
        dst[i] = 0;
    for (int k = 0; k < taps; k++)
        for (int i = 0; i < n; i++)
            dst[i] += filter[k] * src[(size_t)k * next + (size_t)i];
}

/* One row of z and of what is known of it, both smoothed along it. row[2][width + 2 reach]: 0 outside the tile. */
static void smooth_row(const work *w, int y, float *row, float *z, float *known)
{
    const int width = w->image->width, r = w->reach, taps = 2 * r + 1, all = width + 2 * r;
    for (int x = 0; x < width; x += RX_MAP_PIECE)
        rx_image_sigmas(w->image, x, y, rx_min_int(width - x, RX_MAP_PIECE), row + r + x);
    for (int x = 0; x < all; x++) {
        const int is_known = x >= r && x < r + width && row[x] == row[x];
        row[all + x] = is_known ? 1.0f : 0.0f;
        row[x] = is_known ? row[x] : 0.0f;
    }
    smooth(row, 1, w->filter, taps, width, z);
    smooth(row + all, 1, w->filter + taps, taps, width, known);
}

/* Rows of lambda from `first` on. room[(STRIP + 2 reach) 2 width + 2 (width + 2 reach) + 2 width] */
static void fill_strip(const work *w, int first, float *room)
{
    const int width = w->image->width, height = w->image->height, r = w->reach, taps = 2 * r + 1;
    const int rows = rx_min_int(STRIP, height - first), all = rows + 2 * r;
    const size_t plane = (size_t)all * (size_t)width;
    float *const known = room + plane, *const row = known + plane, *const of = row + 2 * (width + 2 * r);
    for (int k = 0; k < all; k++) {
        const int y = first - r + k;
        float *z = room + (size_t)k * (size_t)width, *share = known + (size_t)k * (size_t)width;
        if (y >= 0 && y < height)
            smooth_row(w, y, row, z, share);
        else
            for (int x = 0; x < width; x++)
                z[x] = share[x] = 0;
    }
    for (int k = 0; k < rows; k++) {
        float *dst = w->lambda + (size_t)(first + k) * (size_t)width;
        smooth(room + (size_t)k * (size_t)width, (size_t)width, w->filter, taps, width, dst);
        smooth(known + (size_t)k * (size_t)width, (size_t)width, w->filter + taps, taps, width, of);
        for (int x = 0; x < width; x++)
            dst[x] = (double)of[x] > 0.5 * w->power * w->power
                         ? (float)((double)dst[x] / (sqrt((double)of[x]) * w->noise))
                         : NAN;
    }
}

static rx_status open_work(const rx_image *image, int threads, work *w, rx_error *err)
{
    w->image = image;
    w->fwhm = fmax(image->psf->fwhm, 1);
    w->reach = (int)ceil(1.5 * w->fwhm);
    const int taps = 2 * w->reach + 1;
    const size_t width = (size_t)image->width, height = (size_t)image->height;
    const size_t each = ((size_t)(STRIP + 2 * w->reach) + 2) * 2 * width + 4 * (size_t)w->reach;
    float *room = NULL, *profile = NULL;
    rx_status status = RX_OK;
    RX_TRY_EXIT(RX_MAKE(w->filter, 2 * (size_t)taps, err));
    RX_TRY_EXIT(RX_MAKE(w->lambda, width * height, err));
    RX_TRY_EXIT(RX_MAKE(w->to, 2 * (size_t)ANGLES, err));
    RX_TRY_EXIT(RX_MAKE(profile, (size_t)taps * (size_t)taps, err));
    RX_TRY_EXIT(RX_MAKE(room, each * (size_t)threads, err));
    for (int i = 0; i < taps; i++) {
        w->filter[i] = (float)exp(-0.5 * pow((i - w->reach) * RX_FWHM_SIGMA / w->fwhm, 2));
        w->filter[taps + i] = w->filter[i] * w->filter[i];
        w->power += (double)w->filter[taps + i];
    }
    for (int a = 0; a < 2 * ANGLES; a++)
        for (int k = 0; k < PLACES; k++) {
            const double at = (NEAREST + k * BETWEEN) * w->fwhm;
            w->to[a][k] = (place){(int)floor(at * cos(M_PI * a / ANGLES) + 0.5),
                                  (int)floor(at * sin(M_PI * a / ANGLES) + 0.5)};
        }
    for (int i = 0; i < taps * taps; i++)
        profile[i] = w->filter[i % taps] * w->filter[i / taps];
    w->noise = rx_noise_factor(image->correlation, profile, taps, taps);
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++)
        for (int y = t * STRIP; y < image->height; y += threads * STRIP)
            fill_strip(w, y, room + each * (size_t)t);
exit:
    free(profile);
    free(room);
    return status;
}

static double lambda_at(const work *w, int x, int y)
{
    return x < 0 || y < 0 || x >= w->image->width || y >= w->image->height
               ? NAN
               : (double)w->lambda[(size_t)y * (size_t)w->image->width + (size_t)x];
}

typedef struct level {
    double height; /* sigmas; NAN: too little is known */
    int even;
} level;

/* Of n places, as stars among them leave it. */
static level level_of(double *values, size_t n)
{
    if (n < PLACES / 2)
        return (level){NAN, 0};
    const double height = rx_quantile(values, n, 0.25) + 1 / RX_MAD_SIGMA;
    return (level){height, rx_quantile(values, n, 0.1) + TENTH > EVEN * height};
}

static level lower(level a, level b)
{
    return (level){fmin(a.height, b.height), a.even && b.even};
}

/* What is known in that direction from (x, y), the nearest first; how many. */
static size_t look_along(const work *w, int x, int y, int direction, double values[PLACES])
{
    size_t n = 0;
    for (int k = 0; k < PLACES; k++) {
        const place *to = &w->to[direction][k];
        const double value = lambda_at(w, x + to->x, y + to->y);
        if (value == value)
            values[n++] = value;
    }
    return n;
}

/* The lower level of two sides, or where the tile ends to one side, of two halves of the other one. */
static level level_along(const work *w, int x, int y, int direction)
{
    double one[PLACES], other[PLACES];
    const size_t n = look_along(w, x, y, direction, one), m = look_along(w, x, y, direction + ANGLES, other);
    if (n >= PLACES / 2 && m >= PLACES / 2)
        return lower(level_of(one, n), level_of(other, m));
    double *const known = n > m ? one : other;
    const size_t half = (n > m ? n : m) / 2;
    return half >= PLACES / 2 ? lower(level_of(known, half), level_of(known + half, half)) : (level){NAN, 0};
}

static double largest_near(const work *w, int x, int y)
{
    const int reach = rx_max_int(1, (int)lround(w->fwhm / 2));
    double most = -HUGE_VAL;
    for (int v = -reach; v <= reach; v++)
        for (int u = -reach; u <= reach; u++)
            most = fmax(most, lambda_at(w, x + u, y + v));
    return most;
}

/* Of the noise has so many peaks of t sigmas for a source of that brightness, `density` of them a pixel. */
static double peaks_for_one(const work *w, double t, double density)
{
    const double sigma = w->fwhm / RX_FWHM_SIGMA;
    return t > 1 ? (t * t - 1) * t * exp(-0.5 * t * t) / (pow(2 * M_PI, 1.5) * 2 * sigma * sigma * density)
                 : HUGE_VAL;
}

/* Do as many places in that direction reach that height as do on a line? */
static int reaches(const work *w, int x, int y, int direction, double height)
{
    int lower = 0;
    for (int k = 0; k < PLACES && lower <= PLACES / 4 + 1; k++) {
        const place *to = &w->to[direction][k];
        lower += lambda_at(w, x + to->x, y + to->y) < height - 1 / RX_MAD_SIGMA;
    }
    return lower <= PLACES / 4 + 1;
}

/* Is there a direction in which a line of that height is possible? Most sources have none, and that is soon known. */
static int is_possible(const work *w, int x, int y, double height)
{
    for (int a = 0; a < ANGLES; a++)
        if (reaches(w, x, y, a, height) && reaches(w, x, y, a + ANGLES, height))
            return 1;
    return 0;
}

/* Probability that it is on a line. */
static double on_line(const work *w, double density, const rx_source *source)
{
    const rx_image *image = w->image;
    const int x = source->xpeak, y = source->ypeak;
    /* sky photons of a line's light, which is wider than the PSF, at a height of 1 */
    const double photons =
        image->gain > 0
            ? w->noise * RX_FWHM_SIGMA /
                  (2 * sqrt(M_PI) * w->fwhm * image->gain * (double)rx_map_at(&image->noise, x, y))
            : 0;
    double along[ANGLES], median, own = largest_near(w, x, y);
    level line = {-HUGE_VAL, 0};
    size_t n = 0;
    if (source->fit.fluxerr > 0) /* without the light of its neighbours */
        own = fmin(own, source->fit.snr);
    if (!is_possible(w, x, y, own - STANDS_OUT * sqrt(1 + photons * fmax(own, 0))))
        return 0;
    for (int a = 0; a < ANGLES; a++) {
        const level one = level_along(w, x, y, a);
        if (isnan(one.height))
            continue;
        along[n++] = one.height;
        line = one.height > line.height ? one : line;
    }
    if (n < ANGLES / 4 || !line.even)
        return 0;
    const double scatter = rx_sigma_mad(along, n, &median);
    if (!(line.height > median + STANDS_OUT * scatter))
        return 0;
    return 1 / (1 + 1 / peaks_for_one(w, (own - line.height) / sqrt(1 + photons * line.height), density));
}

rx_status rx_lines_mark(const rx_image *image, int nthreads, rx_sources *sources, rx_error *err)
{
    const int threads = rx_max_int(nthreads, 1);
    const double density = sources->n / ((double)image->width * image->height);
    work w = {0};
    rx_status status = RX_OK;
    if (sources->n == 0 || image->psf == NULL || !(image->psf->fwhm > 0))
        return RX_OK;
    RX_TRY_EXIT(open_work(image, threads, &w, err));
#pragma omp parallel for schedule(dynamic, 16) num_threads(threads)
    for (int i = 0; i < sources->n; i++)
        rx_source_doubt(&sources->list[i], on_line(&w, density, &sources->list[i]));
exit:
    free(w.filter);
    free(w.lambda);
    free(w.to);
    return status;
}
