/* CLEAN. */
#include "detect/clean.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"

static const double PI = 3.14159265358979323846;
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

static int compare_descending(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x < y) - (x > y);
}

/* The min_area-th largest height above the threshold. As in SExtractor, a list of exactly min_area
 * pixels is not sorted, and the first pixel after the first min_area is not looked at. */
static float weakest_pixel(const sep_catalog *cat, int i, const rx_clean_image *image, int min_area,
                           float *heights)
{
    int n = 0;
    if (cat->npix[i] < min_area)
        return 0.0f;
    for (int k = 0; k < cat->npix[i]; k++) {
        int at = cat->pix[i][k];
        float limit = image->sigma != NULL ? (float)image->threshold * image->sigma[at] : cat->thresh[i];
        if (k != min_area)
            heights[n++] = image->filtered[at] - limit;
    }
    if (cat->npix[i] == min_area)
        return heights[0];
    qsort(heights, (size_t)n, sizeof *heights, compare_descending);
    return heights[min_area - 1];
}

static double axis_correction(const sep_catalog *cat, int i, const rx_clean_image *image)
{
    double half = (cat->thresh[i] + (double)cat->peak[i]) / 2.0;
    double ratio = cat->thresh[i] / half;
    int above_half = 0;
    if (image->sigma != NULL || !(ratio > 0.0))
        return 1.0;
    for (int k = 0; k < cat->npix[i]; k++)
        above_half += image->pixels[cat->pix[i][k]] > half;
    double difference = above_half - cat->tnpix[i];
    double correction = (difference < 0.0 ? difference : -1.0) /
                        (2.0 * PI * log(ratio < 1.0 ? ratio : 0.99) * cat->a[i] * cat->b[i]);
    return fmin(correction, 1.0);
}

/* Does the wing of `big` at the place of `small` rise above small's weakest pixel? */
static bool swallows(const sep_catalog *cat, const wing *wings, int big, int small, double beta)
{
    double dx = cat->x[small] - cat->x[big], dy = cat->y[small] - cat->y[big];
    double unit_area = PI * cat->a[big] * cat->b[big];
    double amplitude = wings[big].flux / (2.0 * unit_area * wings[big].axis_correction);
    double alpha = (pow(amplitude / cat->thresh[big], 1.0 / beta) - 1.0) * unit_area / wings[big].area;
    double fall = 1.0 + alpha * (cat->cxx[big] * dx * dx + cat->cyy[big] * dy * dy + cat->cxy[big] * dx * dy);
    return fall > 1.0 && (fall < 1e10 ? (float)(amplitude * pow(fall, -beta)) : 0.0f) > wings[small].weakest;
}

static bool in_reach(const sep_catalog *cat, int i, int j)
{
    double dx = cat->x[i] - cat->x[j], dy = cat->y[i] - cat->y[j], reach = cat->a[i] + cat->a[j];
    return dx * dx + dy * dy < reach * reach * REACH * REACH;
}

static bool band_in_reach(const sep_catalog *cat, const band *b, int i)
{
    double reach = (cat->a[i] + b->largest) * REACH;
    return !(cat->y[i] < b->low - reach || cat->y[i] > b->high + reach);
}

/* Source i joins its band. */
static void extend_bands(const sep_catalog *cat, int i, band *bands)
{
    band *b = &bands[i / BAND];
    if (i % BAND == 0)
        *b = (band){.low = HUGE_VAL, .high = -HUGE_VAL};
    b->low = fmin(b->low, cat->y[i]);
    b->high = fmax(b->high, cat->y[i]);
    b->largest = fmax(b->largest, cat->a[i]);
}

static void merge(wing *wings, int *eater, int small, int big)
{
    eater[small] = big;
    wings[big].flux += wings[small].flux;
    wings[big].area += wings[small].area;
}

/* Let source i meet those before it: it is eaten by the first that can, or else eats all it can. */
static void admit(const sep_catalog *cat, wing *wings, const band *bands, int *eater, int i, double beta,
                  int *menu)
{
    int n = 0;
    for (int j = 0; j < i; j++) {
        if (j % BAND == 0 && !band_in_reach(cat, &bands[j / BAND], i)) {
            j += BAND - 1;
            continue;
        }
        if (eater[j] != NOBODY || !in_reach(cat, i, j))
            continue;
        if (wings[j].flux < wings[i].flux) {
            if (swallows(cat, wings, i, j, beta))
                menu[n++] = j;
        } else if (swallows(cat, wings, j, i, beta)) {
            merge(wings, eater, i, j);
            return;
        }
    }
    while (n > 0)
        merge(wings, eater, menu[--n], i);
}

rx_status rx_clean(const sep_catalog *cat, const rx_clean_image *image, int min_area, int max_area,
                   double beta, int **eater, rx_error *err)
{
    size_t n = (size_t)cat->nobj;
    int largest = 1;
    for (int i = 0; i < cat->nobj; i++)
        largest = cat->npix[i] > largest ? cat->npix[i] : largest;
    wing *wings = RX_NEW(wing, n);
    band *bands = RX_NEW(band, n / BAND + 1);
    int *menu = RX_NEW(int, n);
    float *heights = RX_NEW(float, (size_t)largest);
    *eater = RX_NEW(int, n);
    rx_status status = RX_OK;
    if (wings == NULL || bands == NULL || menu == NULL || heights == NULL || *eater == NULL) {
        status = rx_error_memory(err, n * sizeof *wings);
        goto exit;
    }
    for (int i = 0; i < cat->nobj; i++) {
        wings[i] = (wing){.flux = cat->cflux[i],
                          .area = cat->npix[i],
                          .axis_correction = axis_correction(cat, i, image),
                          .weakest = weakest_pixel(cat, i, image, min_area, heights)};
        (*eater)[i] = NOBODY;
        extend_bands(cat, i, bands);
        if (max_area > 0 && cat->npix[i] > max_area)
            (*eater)[i] = LEFT_OUT;
        else
            admit(cat, wings, bands, *eater, i, beta, menu);
    }
    for (int i = 0; i < cat->nobj; i++) { /* to the end of the chain */
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
