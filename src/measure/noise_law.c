/* Empty apertures: places from a map of obstacles, widths by MAD, a line in log-log. */
#include "measure/noise.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/random.h"
#include "measure/view.h"
#include "num/stats.h"

static const double RADII[] = {1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0};
enum {
    NRADII = sizeof RADII / sizeof RADII[0],
    MARGIN = 2,        /* pixels between an aperture and the next obstacle */
    TRIES = 30,        /* throws per aperture wanted */
    MIN_APERTURES = 40 /* per radius; a MAD of fewer says little */
};

/* A bit for every pixel, rows[height][words]: is there an obstacle? */
typedef struct obstacles {
    size_t words; /* of a row */
    uint64_t *rows;
} obstacles;

enum { BITS = 64 };

static rx_status mark_obstacles(const rx_view *view, int nthreads, obstacles *dst, rx_error *err)
{
    const int width = view->image->width, height = view->image->height;
    dst->words = ((size_t)width + BITS - 1) / BITS;
    RX_TRY(RX_MAKE(dst->rows, dst->words * (size_t)height, err));
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < height; y++) {
        uint64_t *row = dst->rows + (size_t)y * dst->words;
        for (int x = 0; x < width; x++)
            row[x / BITS] |= (uint64_t)(rx_view_state(view, x, y) != RX_SEEN_GOOD) << (x % BITS);
    }
    return RX_OK;
}

/* Is there one in the pixels x0 <= x < x1 of a row? */
static bool any_between(const uint64_t *row, int x0, int x1)
{
    for (int x = x0; x < x1;) {
        const int first = x % BITS, n = x1 - x < BITS - first ? x1 - x : BITS - first;
        const uint64_t bits = n < BITS ? ((uint64_t)1 << n) - 1 : UINT64_MAX;
        if ((row[x / BITS] >> first & bits) != 0)
            return true;
        x += n;
    }
    return false;
}

static bool is_free(const rx_view *view, const obstacles *sky, double x, double y, double radius)
{
    int reach = (int)ceil(radius) + MARGIN;
    int x0 = (int)floor(x) - reach, x1 = (int)floor(x) + reach + 2;
    int y0 = (int)floor(y) - reach, y1 = (int)floor(y) + reach + 2;
    if (x0 < 0 || y0 < 0 || x1 > view->image->width || y1 > view->image->height)
        return false;
    for (int v = y0; v < y1; v++)
        if (any_between(sky->rows + (size_t)v * sky->words, x0, x1))
            return false;
    return true;
}

/* Sums of free apertures in units of the pixels' mean sigma; returns how many. */
static int throw_apertures(const rx_view *view, const obstacles *sky, int which,
                           const rx_noise_apertures *throws, double *sums, double *area)
{
    const rx_image *image = view->image;
    const int count = throws->count;
    const uint64_t seed = throws->seed;
    int n = 0;
    double total_area = 0.0;
    for (int i = 0; i < count * TRIES && n < count; i++) {
        double x = rx_random_uniform(seed, (uint64_t)which, 2 * (uint64_t)i) * image->width - 0.5;
        double y = rx_random_uniform(seed, (uint64_t)which, 2 * (uint64_t)i + 1) * image->height - 0.5;
        if (!is_free(view, sky, x, y, RADII[which]))
            continue;
        rx_sum sum;
        rx_sum_circle(view, x, y, RADII[which], &sum);
        double sigma = sum.error / sqrt(sum.area); /* rms of the pixels inside */
        if (!(sigma > 0.0))
            continue;
        sums[n++] = sum.flux / sigma;
        total_area += sum.area;
    }
    *area = n > 0 ? total_area / n : 0.0;
    return n;
}

/* Least squares of log ratio = log scale + power log area, power held in 0.5 .. 1: less than 0.5
 * would mean noise that cancels, more than 1 that grows faster than the flux of the sky. */
static void fit_law(rx_noise_law *law)
{
    double n = law->nradii, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0, residual = 0.0;
    for (int i = 0; i < law->nradii; i++) {
        double x = log10(law->area[i]), y = log10(law->ratio[i]);
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
    }
    law->power = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    law->power = fmin(fmax(law->power, 0.5), 1.0);
    double offset = (sy - law->power * sx) / n;
    for (int i = 0; i < law->nradii; i++) {
        double off = log10(law->ratio[i]) - offset - law->power * log10(law->area[i]);
        residual += off * off;
    }
    law->scale = pow(10.0, offset);
    law->scatter = sqrt(residual / n);
}

double rx_noise_law_factor(const rx_noise_law *law, double area)
{
    if (law->nradii == 0)
        return law->scale == 1.0 && law->power == 0.5 ? 1.0
                                                      : law->scale * pow(fmax(area, 1.0), law->power - 0.5);
    int last = law->nradii - 1, i = 0;
    area = fmin(fmax(area, law->area[0]), law->area[last]);
    while (i < last - 1 && area > law->area[i + 1])
        i++;
    if (last == 0)
        return law->ratio[0] / sqrt(law->area[0]);
    double low = log(law->ratio[i] / sqrt(law->area[i]));
    double high = log(law->ratio[i + 1] / sqrt(law->area[i + 1]));
    double share = log(area / law->area[i]) / log(law->area[i + 1] / law->area[i]);
    return exp(low + share * (high - low));
}

void rx_noise_law_widen(rx_noise_law *law, double area)
{
    const rx_noise_law narrow = *law;
    if (narrow.nradii == 0)
        return;
    for (int i = 0; i < law->nradii; i++) {
        const double wide = narrow.area[i] + area;
        law->ratio[i] = rx_noise_law_factor(&narrow, wide) * sqrt(wide);
    }
    fit_law(law);
}

rx_noise_law rx_noise_law_of(const rx_noise_correlation *noise)
{
    static const double radii[] = {1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0};
    enum { N = sizeof radii / sizeof radii[0], SIDE = 45, RIM = 5, PLACES = 9 };
    static const double far = 1e5; /* pixels that are all middle */
    float disc[SIDE * SIDE];
    rx_noise_law law = {.scale = 1.0, .power = 0.5};
    if (noise == NULL || !noise->correlated)
        return law;
    for (; law.nradii < N; law.nradii++) {
        const int half = (int)ceil(radii[law.nradii]) + 1, side = 2 * half + 1;
        double area = 0.0, variance = 0.0;
        for (int place = 0; place < PLACES; place++) { /* of the centre within a pixel */
            const double x = half + (place % 3 - 1) / 3.0, y = half + (place / 3 - 1) / 3.0;
            double square = 0.0;
            for (int k = 0; k < side * side; k++) {
                const double share = rx_pixel_in_circle((float)(k % side - x), (float)(k / side - y),
                                                        (float)radii[law.nradii], RIM);
                disc[k] = (float)share;
                area += share / PLACES;
                square += share * share / PLACES;
            }
            variance += square * pow(rx_noise_factor(noise, disc, side, side), 2);
        }
        law.area[law.nradii] = area;
        law.ratio[law.nradii] = sqrt(variance);
    }
    fit_law(&law);
    law.area[law.nradii] = far;
    law.ratio[law.nradii++] = rx_noise_factor_wide(noise) * sqrt(far);
    return law;
}

rx_status rx_noise_law_fit(const rx_image *image, const rx_sources *sources, const rx_noise_apertures *throws,
                           rx_noise_law *law, rx_log *log, rx_error *err)
{
    rx_image plain = *image; /* errors of single pixels are wanted, no photon noise, no law */
    plain.gain = 0.0;
    plain.law = NULL;
    /* segment -1 belongs to no source: every source is a neighbour */
    rx_view view = {.image = &plain,
                    .radii = &plain,
                    .sources = sources,
                    .neighbours = RX_NEIGHBOURS_BLANK,
                    .segment = -1};
    rx_status status = RX_OK;
    *law = (rx_noise_law){.scale = 1.0, .power = 0.5};
    obstacles sky = {0};
    double area[NRADII], width[NRADII];
    int n[NRADII];
    const size_t room = throws->count > 0 ? (size_t)throws->count : 1;
    const int nthreads = throws->nthreads > 0 ? throws->nthreads : 1;
    double *sums = RX_NEW(double, NRADII *room);
    RX_TRY_EXIT(sums == NULL ? rx_error_memory(err, 0) : mark_obstacles(&view, nthreads, &sky, err));
    /* wide apertures first, which take longest */
#pragma omp parallel for schedule(dynamic) num_threads(nthreads)
    for (int i = NRADII - 1; i >= 0; i--) {
        n[i] = throw_apertures(&view, &sky, i, throws, sums + room * (size_t)i, &area[i]);
        width[i] = n[i] < MIN_APERTURES ? 0.0 : rx_sigma_mad(sums + room * (size_t)i, (size_t)n[i], NULL);
    }
    for (int i = 0; i < NRADII; i++) {
        if (!(width[i] > 0.0))
            continue;
        law->area[law->nradii] = area[i];
        law->ratio[law->nradii++] = width[i];
        law->apertures += n[i];
    }
    if (law->nradii >= 3) {
        fit_law(law);
    } else {
        law->apertures = law->nradii = 0;
        rx_log_detail(log, "too little free sky for empty apertures: errors are not calibrated");
    }
exit:
    free(sky.rows);
    free(sums);
    return status;
}
