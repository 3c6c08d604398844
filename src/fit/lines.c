/* Sources along lines. */
#include "fit/lines.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "num/convolve.h"
#include "num/stats.h"

enum {
    ANGLES = 120, /* at the far end half a FWHM from one to the next, the width of a point in lambda 1.4 */
    PLACES = 17   /* along a direction to one side */
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
    double noise;        /* of a place of lambda, sigmas of a pixel */
    float *lambda;       /* [height][width] times noise */
    uint8_t *hidden;     /* [height][width] */
    place (*to)[PLACES]; /* [2 ANGLES] along directions of a full turn, the nearest first */
} work;

rx_status rx_lines_noise(const rx_noise_correlation *correlation, double fwhm, double *dst, rx_error *err)
{
    const int radius = rx_gauss_radius(fwhm), side = 2 * radius + 1;
    float *line = NULL, *profile = NULL;
    double square = 0;
    rx_status status = RX_OK;
    RX_TRY_EXIT(RX_MAKE(line, (size_t)side, err));
    RX_TRY_EXIT(RX_MAKE(profile, (size_t)side * (size_t)side, err));
    rx_gauss_weights(fwhm, radius, line);
    for (int i = 0; i < side; i++)
        square += (double)line[i] * (double)line[i];
    for (int i = 0; i < side * side; i++)
        profile[i] = line[i % side] * line[i / side];
    *dst = square * rx_noise_factor(correlation, profile, side, side);
exit:
    free(line);
    free(profile);
    return status;
}

static rx_status open_work(const rx_image *image, int threads, work *w, rx_error *err)
{
    const int width = image->width, height = image->height;
    const size_t n = (size_t)width * (size_t)height;
    w->image = image;
    w->fwhm = fmax(image->psf->fwhm, 1);
    RX_TRY(RX_MAKE(w->lambda, n, err));
    RX_TRY(RX_MAKE(w->hidden, n, err));
    RX_TRY(RX_MAKE(w->to, 2 * (size_t)ANGLES, err));
    RX_TRY(rx_lines_noise(image->correlation, w->fwhm, &w->noise, err));
    for (int a = 0; a < 2 * ANGLES; a++)
        for (int k = 0; k < PLACES; k++) {
            const double at = (NEAREST + k * BETWEEN) * w->fwhm;
            w->to[a][k] = (place){(int)floor(at * cos(M_PI * a / ANGLES) + 0.5),
                                  (int)floor(at * sin(M_PI * a / ANGLES) + 0.5)};
        }
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            const size_t at = (size_t)y * (size_t)width + (size_t)x;
            const int piece = rx_min_int(width - x, RX_MAP_PIECE);
            rx_image_sigmas(image, x, y, piece, w->lambda + at);
            for (int i = 0; i < piece; i++)
                w->hidden[at + (size_t)i] = w->lambda[at + (size_t)i] != w->lambda[at + (size_t)i];
        }
    return rx_gauss_masked(width, height, w->fwhm, w->hidden, threads, w->lambda, err);
}

static double lambda_at(const work *w, int x, int y)
{
    const size_t k = (size_t)y * (size_t)w->image->width + (size_t)x;
    return x < 0 || y < 0 || x >= w->image->width || y >= w->image->height || w->hidden[k]
               ? NAN
               : (double)w->lambda[k] / w->noise;
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
    /* of a line's light, sky photons, at a height of 1 */
    const double photons =
        image->gain > 0 ? w->noise / (image->gain * (double)rx_map_at(&image->noise, x, y)) : 0;
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
    free(w.lambda);
    free(w.hidden);
    free(w.to);
    return status;
}
