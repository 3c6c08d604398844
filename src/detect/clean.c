/* CLEAN. */
#include "detect/clean.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include <omp.h>

#include "base/memory.h"

static const double REACH = 10.0; /* sums of major axes within which sources may eat each other */

/* A source as cleaning sees it; flux and area grow by what it eats. */
typedef struct wing {
    double flux, area;
    double axis_correction; /* isophotal truncation of A B, at most 1 */
    float weakest;          /* its min_area-th brightest pixel above the threshold */
} wing;

/* Sources come in the order of the scan: a run of them is a band of the tile, and most bands are out of
 * reach. */
enum { BAND = 64 };
enum { NOBODY = -1, LEFT_OUT = -2 };
typedef struct band {
    double low, high; /* y of its sources */
    double largest;   /* major axis */
} band;

/* The min_area-th largest height above the threshold. As in SExtractor, a list of exactly min_area
 * pixels is not sorted, and the first pixel after the first min_area is not looked at. heights: [min_area].
 */
static float weakest_pixel(const rx_detection *list, int i, const rx_clean_image *image, int min_area,
                           float *heights)
{
    int n = 0;
    const rx_threshold *threshold = image->threshold;
    const rx_span *span = NULL;
    if (list[i].npix < min_area || min_area < 1)
        return 0.0f;
    for (int k = 0; k < list[i].npix; k++) {
        const int x = list[i].pixels[k] % threshold->width, y = list[i].pixels[k] / threshold->width;
        if ((span = rx_groups_span(image->groups, list[i].group, span, x, y)) == NULL)
            continue;
        float limit = threshold->relative ? threshold->limit * rx_span_sigma(span, x) : list[i].threshold;
        float height = rx_span_filtered(span, x) - limit;
        if (list[i].npix == min_area)
            return height;
        if (k == min_area || (n == min_area && height <= heights[n - 1]))
            continue;
        int place = n < min_area ? n++ : n - 1; /* the largest so far, in order */
        for (; place > 0 && heights[place - 1] < height; place--)
            heights[place] = heights[place - 1];
        heights[place] = height;
    }
    return n == min_area ? heights[min_area - 1] : 0.0f;
}

static double axis_correction(const rx_detection *list, int i, const rx_clean_image *image)
{
    double half = (list[i].threshold + (double)list[i].peak) / 2.0;
    double ratio = list[i].threshold / half;
    int above_half = 0;
    if (image->threshold->relative || !(ratio > 0.0))
        return 1.0;
    for (int k = 0; k < list[i].npix; k++)
        above_half += image->pixels[list[i].pixels[k]] > half;
    double difference = above_half - list[i].npix_raw;
    double correction = (difference < 0.0 ? difference : -1.0) /
                        (2.0 * M_PI * log(ratio < 1.0 ? ratio : 0.99) * list[i].a * list[i].b);
    return fmin(correction, 1.0);
}

/* Does the wing of `big` at the place of `small` rise above small's weakest pixel? */
static bool swallows(const rx_detection *list, const wing *wings, int big, int small, double beta)
{
    double dx = list[small].x - list[big].x, dy = list[small].y - list[big].y;
    double unit_area = M_PI * list[big].a * list[big].b;
    double amplitude = wings[big].flux / (2.0 * unit_area * wings[big].axis_correction);
    double alpha = (pow(amplitude / list[big].threshold, 1.0 / beta) - 1.0) * unit_area / wings[big].area;
    double fall = 1.0 + alpha * (list[big].cxx * dx * dx + list[big].cyy * dy * dy + list[big].cxy * dx * dy);
    return fall > 1.0 && (fall < 1e10 ? (float)(amplitude * pow(fall, -beta)) : 0.0f) > wings[small].weakest;
}

static bool in_reach(const rx_detection *list, int i, int j)
{
    double dx = list[i].x - list[j].x, dy = list[i].y - list[j].y, reach = list[i].a + list[j].a;
    return dx * dx + dy * dy < reach * reach * REACH * REACH;
}

static bool band_in_reach(const rx_detection *list, const band *b, int i)
{
    double reach = (list[i].a + b->largest) * REACH;
    return !(list[i].y < b->low - reach || list[i].y > b->high + reach);
}

/* Source i joins its band. */
static void extend_bands(const rx_detection *list, int i, band *bands)
{
    band *b = &bands[i / BAND];
    if (i % BAND == 0)
        *b = (band){.low = HUGE_VAL, .high = -HUGE_VAL};
    b->low = fmin(b->low, list[i].y);
    b->high = fmax(b->high, list[i].y);
    b->largest = fmax(b->largest, list[i].a);
}

static void merge(wing *wings, int *eater, int small, int big)
{
    eater[small] = big;
    wings[big].flux += wings[small].flux;
    wings[big].area += wings[small].area;
}

/* Let source i meet those before it: it is eaten by the first that can, or else eats all it can. */
static void admit(const rx_detection *list, wing *wings, const band *bands, int *eater, int i, double beta,
                  int *menu)
{
    int n = 0;
    for (int j = 0; j < i; j++) {
        if (j % BAND == 0 && !band_in_reach(list, &bands[j / BAND], i)) {
            j += BAND - 1;
            continue;
        }
        if (eater[j] != NOBODY || !in_reach(list, i, j))
            continue;
        if (wings[j].flux < wings[i].flux) {
            if (swallows(list, wings, i, j, beta))
                menu[n++] = j;
        } else if (swallows(list, wings, j, i, beta)) {
            merge(wings, eater, i, j);
            return;
        }
    }
    while (n > 0)
        merge(wings, eater, menu[--n], i);
}

rx_status rx_clean(const rx_detect_params *par, const rx_detections *found, const rx_clean_image *image,
                   int **eater, rx_error *err)
{
    const int threads = par->nthreads > 0 ? par->nthreads : 1;
    const size_t least = (size_t)par->min_area + 1;
    const rx_detection *list = found->list;
    size_t n = (size_t)found->n;
    wing *wings = RX_NEW(wing, n);
    band *bands = RX_NEW(band, n / BAND + 1);
    int *menu = RX_NEW(int, n);
    float *heights = RX_NEW(float, least *(size_t)threads);
    *eater = RX_NEW(int, n);
    rx_status status = RX_OK;
    if (wings == NULL || bands == NULL || menu == NULL || heights == NULL || *eater == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof *wings));
#pragma omp parallel for schedule(dynamic, 64) num_threads(threads)
    for (int i = 0; i < found->n; i++) {
        float *own = heights + (size_t)omp_get_thread_num() * least;
        wings[i] = (wing){.flux = list[i].filtered_flux,
                          .area = list[i].npix,
                          .axis_correction = axis_correction(list, i, image),
                          .weakest = weakest_pixel(list, i, image, par->min_area, own)};
    }
    for (int i = 0; i < found->n; i++) {
        (*eater)[i] = NOBODY;
        extend_bands(list, i, bands);
        if (par->max_area > 0 && list[i].npix > par->max_area)
            (*eater)[i] = LEFT_OUT;
        else
            admit(list, wings, bands, *eater, i, par->clean_param, menu);
    }
    for (int i = 0; i < found->n; i++) { /* to the end of the chain */
        while ((*eater)[i] >= 0 && (*eater)[(*eater)[i]] >= 0)
            (*eater)[i] = (*eater)[(*eater)[i]];
        if ((*eater)[i] == LEFT_OUT)
            (*eater)[i] = NOBODY;
    }
exit:
    free(wings);
    free(bands);
    free(menu);
    free(heights);
    if (status != RX_OK) {
        free(*eater);
        *eater = NULL;
    }
    return status;
}
