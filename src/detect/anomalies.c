/* Medians of rows, columns and boxes. */
#include "detect/anomalies.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/stats.h"

enum {
    BOX = RX_ANOMALIES_BOX,
    PIECE = 64,
    SAMPLE = 128,    /* pixels of a row or column */
    GROUP = 4,       /* boxes that touch */
    REACH = 16,      /* boxes, of what falls off from a bright one */
    LEAST_LINES = 20 /* rows or columns with a scatter */
};

static const double MEDIAN_ERROR = 1.2533;      /* of a median over that of a mean */
static const double ENOUGH = 0.25;              /* of the pixels of a row, column or box */
static const double FAINT = 8.0;                /* sigmas of the brightest pixel */
static const double LIGHT = 0.3, ERRORS = 5.0;  /* sigmas of a pixel; errors of the median */
static const float CLIP = 1.5F;                 /* sigmas */
static const double CLIPPED = 0.87;             /* change of a mean clipped there with one of the median */
static const double FALL = 1.5;                 /* power of the distance */
static const double SHARPER = 1.2, SHARP = 6.0; /* times R, and errors */
static const double LEAST_FWHM = 2.5; /* pixels: below, R depends on where in its pixel a star stands */
static const double STRIPED = 0.2, LARGE = 0.02; /* sigmas; share of boxes */

static const int steps[RX_ANOMALIES_STEPS][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};

/* What is measured, and room for it. */
typedef struct work {
    const rx_image *image;
    int nx, ny;
    double limit;             /* of the median of a lit box */
    double *rows, *columns;   /* medians; NAN of too few pixels */
    double *median, *highest; /* [ny][nx] of boxes */
} work;

/* z of n pixels from (x, y) on, RX_MAP_PIECE at most; NAN where there is none. */
RX_SIMD static void read_piece(const rx_image *image, int x, int y, int n, float *restrict z)
{
    float level_room[RX_MAP_PIECE] = {0}, sigma_room[RX_MAP_PIECE];
    const rx_map sky = rx_image_sky(image);
    const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
    const float *pixels = image->pixels + at, *sigma = rx_map_row(&image->noise, y, x, n, sigma_room);
    const float *level = rx_map_given(&sky) ? rx_map_row(&sky, y, x, n, level_room) : level_room;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float value = pixels[i] - level[i];
        z[i] = sigma[i] > 0.0f && fabsf(value) < INFINITY ? value / sigma[i] : NAN;
    }
    for (int i = 0; i < n && image->mask != NULL; i++)
        if (rx_image_hides(image, at + (size_t)i))
            z[i] = NAN;
}

/* Of long rows and columns pieces suffice, evenly spread: is pixel i of n one of them, and how many are? */
static bool is_sampled(int i, int n)
{
    return i / PIECE % rx_max_int(n / SAMPLE, 1) == 0;
}

static int sampled(int n)
{
    int count = 0;
    for (int i = 0; i < n; i++)
        count += is_sampled(i, n);
    return count;
}

/* Median of the n values that are known, of n possible ones; in the order of `values` no more. */
static double median_of(double *values, size_t n, int possible)
{
    return (double)n >= ENOUGH * possible ? rx_median(values, n) : NAN;
}

static void measure_row(const work *w, int y, double *values)
{
    const int width = w->image->width;
    size_t n = 0;
    for (int x = 0; x < width; x += PIECE) {
        float z[PIECE];
        const int count = rx_min_int(PIECE, width - x);
        if (!is_sampled(x, width))
            continue;
        read_piece(w->image, x, y, count, z);
        for (int i = 0; i < count; i++)
            if (!isnan(z[i]))
                values[n++] = (double)z[i];
    }
    w->rows[y] = median_of(values, n, sampled(width));
}

/* values: [PIECE][height]. */
static void measure_columns(const work *w, int x0, double *values)
{
    const int height = w->image->height, across = rx_min_int(PIECE, w->image->width - x0);
    size_t count[PIECE] = {0};
    for (int y = 0; y < height; y++) {
        float z[PIECE];
        if (!is_sampled(y, height))
            continue;
        read_piece(w->image, x0, y, across, z);
        for (int i = 0; i < across; i++)
            if (!isnan(z[i]))
                values[(size_t)i * (size_t)height + count[i]++] = (double)z[i];
    }
    for (int i = 0; i < across; i++)
        w->columns[x0 + i] = median_of(values + (size_t)i * (size_t)height, count[i], sampled(height));
}

/* Sums of the values that are known, clipped, and their numbers, [BOX] of each box. */
RX_SIMD static void add_to_boxes(const float *restrict z, int n, float *restrict sum, float *restrict known)
{
    for (int i = 0; i < n; i += BOX) {
        float all = 0.0f, count = 0.0f;
        const int end = rx_min_int(i + BOX, n);
#pragma omp simd reduction(+ : all, count)
        for (int k = i; k < end; k++) {
            const int is = z[k] == z[k];
            const float low = z[k] < CLIP ? z[k] : CLIP;
            all += !is ? 0.0f : low > -CLIP ? low : -CLIP;
            count += is ? 1.0f : 0.0f;
        }
        sum[i / BOX] += all;
        known[i / BOX] += count;
    }
}

static void measure_box(const work *w, int bx, int by)
{
    const rx_image *image = w->image;
    const int x0 = bx * BOX, y0 = by * BOX, across = rx_min_int(BOX, image->width - x0);
    const size_t at = (size_t)by * (size_t)w->nx + (size_t)bx;
    double values[BOX * BOX], highest = -HUGE_VAL;
    size_t n = 0;
    for (int y = y0; y < rx_min_int(y0 + BOX, image->height); y++) {
        float z[BOX];
        read_piece(image, x0, y, across, z);
        for (int i = 0; i < across; i++)
            if (!isnan(z[i])) {
                highest = fmax(highest, (double)z[i]);
                values[n++] = (double)z[i];
            }
    }
    w->median[at] = median_of(values, n, BOX * BOX);
    w->highest[at] = highest;
}

/* Boxes whose every second row has a clipped mean below half of the limit's are dark: it does for their median. */
static void measure_boxes(const work *w, int by)
{
    enum { ACROSS = RX_MAP_PIECE / BOX };
    const rx_image *image = w->image;
    for (int x = 0; x < image->width; x += RX_MAP_PIECE) {
        float sum[ACROSS] = {0}, known[ACROSS] = {0}, z[RX_MAP_PIECE];
        const int n = rx_min_int(RX_MAP_PIECE, image->width - x);
        for (int y = by * BOX; y < rx_min_int((by + 1) * BOX, image->height); y += 2) {
            read_piece(image, x, y, n, z);
            add_to_boxes(z, n, sum, known);
        }
        for (int i = 0; i * BOX < n; i++) {
            const double mean = (double)sum[i] / (double)known[i];
            if ((double)known[i] >= ENOUGH * BOX * BOX / 2 && mean < 0.5 * CLIPPED * w->limit)
                w->median[(size_t)by * (size_t)w->nx + (size_t)(x / BOX + i)] = mean;
            else
                measure_box(w, x / BOX + i, by);
        }
    }
}

/* rms of offsets beyond the noise of medians of so many pixels. medians is written over. */
static double offsets(double *medians, int n, int pixels, double wide)
{
    size_t known = 0;
    for (int i = 1; i < n; i++)
        if (isfinite(medians[i]) && isfinite(medians[i - 1]))
            medians[known++] = medians[i - 1] - medians[i];
    if (known < LEAST_LINES)
        return NAN;
    const double step = rx_sigma_mad(medians, known, NULL), noise = MEDIAN_ERROR * wide;
    return sqrt(fmax(0.5 * step * step - noise * noise / pixels, 0.0));
}

/* Does the light of a box fall off to it from a brighter one? */
static bool falls_off(const work *w, int bx, int by)
{
    const double own = w->median[(size_t)by * (size_t)w->nx + (size_t)bx];
    for (int v = rx_max_int(by - REACH, 0); v <= rx_min_int(by + REACH, w->ny - 1); v++)
        for (int u = rx_max_int(bx - REACH, 0); u <= rx_min_int(bx + REACH, w->nx - 1); u++) {
            const double other = w->median[(size_t)v * (size_t)w->nx + (size_t)u];
            if (other > 2.0 * own && other >= own * pow(1.0 + hypot(u - bx, v - by), FALL))
                return true;
        }
    return false;
}

enum { FAINT_LIGHT = 1, SEEN, LIT }; /* of rx_anomalies.lit */

/* Groups of boxes that touch; small ones are galaxies of low surface brightness, and noise. queue: [ny nx]. */
static void join_light(const work *w, int *queue, unsigned char *lit)
{
    for (int k = 0; k < w->nx * w->ny; k++) {
        int n = 0;
        if (lit[k] != FAINT_LIGHT)
            continue;
        queue[n++] = k;
        lit[k] = SEEN;
        for (int i = 0; i < n; i++) {
            const int x = queue[i] % w->nx, y = queue[i] / w->nx;
            for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, w->ny - 1); v++)
                for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, w->nx - 1); u++)
                    if (lit[v * w->nx + u] == FAINT_LIGHT) {
                        lit[v * w->nx + u] = SEEN;
                        queue[n++] = v * w->nx + u;
                    }
        }
        for (int i = 0; i < n; i++)
            lit[queue[i]] = n >= GROUP ? LIT : 0;
    }
}

static rx_status find_light(const work *w, int nthreads, rx_anomalies *dst, rx_error *err)
{
    const int n = w->nx * w->ny;
    long boxes = 0, lit = 0;
    int *queue;
    RX_TRY(RX_MAKE(queue, (size_t)n, err));
#pragma omp parallel for schedule(dynamic) num_threads(nthreads)
    for (int k = 0; k < n; k++)
        if (w->median[k] > w->limit && w->highest[k] < FAINT && !falls_off(w, k % w->nx, k / w->nx))
            dst->lit[k] = FAINT_LIGHT;
    join_light(w, queue, dst->lit);
    for (int k = 0; k < n; k++) {
        boxes += isfinite(w->median[k]);
        lit += dst->lit[k] == LIT;
    }
    dst->light = boxes > 0 ? (double)lit / (double)boxes : NAN;
    free(queue);
    return RX_OK;
}

/* R of the PSF at nine places of the tile. */
static rx_status measure_ratios(const rx_image *image, rx_anomalies *dst, rx_error *err)
{
    const rx_psf *psf = image->psf;
    if (psf == NULL || psf->size < 3 || !(psf->fwhm >= LEAST_FWHM))
        return RX_OK;
    float *stamp;
    RX_TRY(RX_MAKE(stamp, (size_t)psf->size * (size_t)psf->size, err));
    for (int place = 0; place < 9; place++) {
        rx_psf_at(psf, 0.5 * (place % 3) * (image->width - 1), 0.5 * (place / 3) * (image->height - 1),
                  stamp);
        const float *centre = stamp + (psf->size / 2) * (psf->size + 1);
        for (int s = 0; s < RX_ANOMALIES_STEPS; s++) {
            const int step = steps[s][1] * psf->size + steps[s][0];
            const double beside = 0.5 * ((double)centre[step] + (double)centre[-step]);
            /* without light beside it any pixel may stand alone */
            dst->ratio[s] = fmax(dst->ratio[s], beside > 0.0 ? (double)centre[0] / beside : HUGE_VAL);
        }
    }
    free(stamp);
    return RX_OK;
}

rx_status rx_anomalies_measure(const rx_image *image, double wide, int nthreads, rx_anomalies *dst,
                               rx_error *err)
{
    const int width = image->width, height = image->height, threads = rx_max_int(nthreads, 1);
    work w = {.image = image,
              .limit = fmax(LIGHT, ERRORS * MEDIAN_ERROR * wide / BOX),
              .nx = (width + BOX - 1) / BOX,
              .ny = (height + BOX - 1) / BOX};
    const size_t boxes = (size_t)w.nx * (size_t)w.ny;
    const size_t room = (size_t)rx_max_int(width, PIECE * height);
    double *values = NULL;
    rx_status status = RX_OK;
    *dst = (rx_anomalies){.nx = w.nx, .ny = w.ny};
    RX_TRY_EXIT(RX_MAKE(dst->lit, boxes, err));
    RX_TRY_EXIT(RX_MAKE(w.rows, (size_t)height, err));
    RX_TRY_EXIT(RX_MAKE(w.columns, (size_t)width, err));
    RX_TRY_EXIT(RX_MAKE(w.median, boxes, err));
    RX_TRY_EXIT(RX_MAKE(w.highest, boxes, err));
    RX_TRY_EXIT(RX_MAKE(values, room * (size_t)threads, err));
    RX_TRY_EXIT(measure_ratios(image, dst, err));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int t = 0; t < threads; t++) {
        for (int y = t; y < height; y += threads)
            measure_row(&w, y, values + room * (size_t)t);
        for (int by = t; by < w.ny; by += threads)
            measure_boxes(&w, by);
        for (int x = t * PIECE; x < width; x += threads * PIECE)
            measure_columns(&w, x, values + room * (size_t)t);
    }
    RX_TRY_EXIT(find_light(&w, threads, dst, err));
    dst->rows = offsets(w.rows, height, sampled(width), wide);
    dst->columns = offsets(w.columns, width, sampled(height), wide);
exit:
    free(w.rows);
    free(w.columns);
    free(w.median);
    free(w.highest);
    free(values);
    if (status != RX_OK)
        rx_anomalies_free(dst);
    return status;
}

void rx_anomalies_free(rx_anomalies *anomalies)
{
    free(anomalies->lit);
    *anomalies = (rx_anomalies){0};
}

/* z of a pixel inside the image, NAN where there is none. */
static double z_at(const rx_image *image, int x, int y, double *sigma)
{
    float z;
    read_piece(image, x, y, 1, &z);
    *sigma = (double)rx_map_at(&image->noise, x, y);
    return (double)z;
}

int rx_anomalies_lit_at(const rx_anomalies *anomalies, const rx_image *image, int x, int y)
{
    double sigma;
    if (anomalies->lit == NULL || z_at(image, x, y, &sigma) > FAINT)
        return 0;
    for (int v = rx_max_int(y / BOX - 1, 0); v <= rx_min_int(y / BOX + 1, anomalies->ny - 1); v++)
        for (int u = rx_max_int(x / BOX - 1, 0); u <= rx_min_int(x / BOX + 1, anomalies->nx - 1); u++)
            if (anomalies->lit[(size_t)v * (size_t)anomalies->nx + (size_t)u])
                return 1;
    return 0;
}

/* That pixel alone. */
static bool is_sharp(const rx_anomalies *anomalies, const rx_image *image, int x, int y)
{
    double sigma;
    const double z = z_at(image, x, y, &sigma);
    if (!(z > SHARP))
        return false;
    const double photons = image->gain > 0.0 ? z / (sigma * image->gain) : 0.0;
    for (int s = 0; s < RX_ANOMALIES_STEPS; s++) {
        const int u = steps[s][0], v = steps[s][1];
        if (x - 1 < 0 || x + 1 >= image->width || y - 1 < 0 || y + 1 >= image->height)
            return false;
        const double most = SHARPER * anomalies->ratio[s];
        double other;
        const double beside = 0.5 * (z_at(image, x - u, y - v, &other) + z_at(image, x + u, y + v, &other));
        if (most > 0.0 && z - most * beside > SHARP * sqrt(1.0 + 0.5 * most * most + photons))
            return true;
    }
    return false;
}

int rx_anomalies_sharp_at(const rx_anomalies *anomalies, const rx_image *image, int x, int y)
{
    for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, image->height - 1); v++)
        for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, image->width - 1); u++)
            if (is_sharp(anomalies, image, u, v))
                return 1;
    return 0;
}

int rx_anomalies_is_striped(const rx_anomalies *anomalies)
{
    return anomalies->rows > STRIPED || anomalies->columns > STRIPED;
}

int rx_anomalies_is_lit(const rx_anomalies *anomalies)
{
    return anomalies->light > LARGE;
}
