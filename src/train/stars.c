/* Stars of a restored patch. */
#include "train/stars.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

static const double FOUND_SNR = 5, FLUX_SNR = 12, THRESHOLD = 1.7, RADIUS = 1.5, APERTURE = 2;
static const double MOST_EXTRA = 1.05, LEAST = 0.9;

static int is_peak(const float *image, int side, int x, int y)
{
    const float v = image[y * side + x];
    if (!(v > THRESHOLD))
        return 0;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            const float w = image[(y + dy) * side + x + dx];
            /* of equal neighbours the first one counts */
            if (w > v || (w == v && (dy < 0 || (dy == 0 && dx < 0))))
                return 0;
        }
    return 1;
}

/* The nearest detection that is not taken; takes it. */
static int find(const float *image, int side, const float *star, char *taken)
{
    double nearest = RADIUS * RADIUS;
    long best = -1;
    const int x0 = (int)floor(star[0] - RADIUS), y0 = (int)floor(star[1] - RADIUS), n = (int)(2 * RADIUS) + 3;
    for (int y = y0; y < y0 + n; y++)
        for (int x = x0; x < x0 + n; x++) {
            if (x < 1 || y < 1 || x >= side - 1 || y >= side - 1 || taken[y * side + x])
                continue;
            const double dx = x - star[0], dy = y - star[1], distance = dx * dx + dy * dy;
            if (distance <= nearest && is_peak(image, side, x, y)) {
                best = y * side + x;
                nearest = distance;
            }
        }
    if (best >= 0)
        taken[best] = 1;
    return best >= 0;
}

static double aperture(const float *image, int side, const float *star, double radius)
{
    double sum = 0;
    const int x0 = (int)floor(star[0] - radius), y0 = (int)floor(star[1] - radius);
    const int n = (int)(2 * radius) + 3;
    for (int y = y0 < 0 ? 0 : y0; y < y0 + n && y < side; y++)
        for (int x = x0 < 0 ? 0 : x0; x < x0 + n && x < side; x++) {
            const double dx = x - star[0], dy = y - star[1];
            if (dx * dx + dy * dy <= radius * radius)
                sum += image[y * side + x];
        }
    return sum;
}

/* Are all pixels within `reach` of the star at least `margin` from the border? */
static int inside(const float *star, int side, double margin)
{
    return star[0] >= margin && star[1] >= margin && star[0] <= side - 1 - margin &&
           star[1] <= side - 1 - margin;
}

static int by_snr(const void *a, const void *b)
{
    const float *const *p = a, *const *q = b;
    if ((*p)[3] != (*q)[3])
        return (*p)[3] > (*q)[3] ? -1 : 1;
    return *p < *q ? -1 : *p > *q;
}

rx_status rx_star_check_run(const rx_sample *sample, const float *restored, int margin, double target_fwhm,
                            rx_star_check *dst, rx_error *err)
{
    const int side = sample->side;
    const double radius = APERTURE * target_fwhm;
    const float *order[RX_SAMPLE_STARS];
    char *taken = RX_NEW(char, (size_t)side *(size_t)side);
    *dst = (rx_star_check){0};
    if (taken == NULL)
        return rx_error_memory(err, (size_t)side * (size_t)side);
    for (int i = 0; i < sample->nstars; i++)
        order[i] = sample->star[i];
    qsort(order, (size_t)sample->nstars, sizeof *order, by_snr);
    for (int i = 0; i < sample->nstars; i++) {
        const float *star = order[i];
        if (star[3] > FOUND_SNR && inside(star, side, margin)) {
            dst->stars += 1;
            dst->found += find(restored, side, star, taken);
        }
        if (star[3] > FLUX_SNR && inside(star, side, margin + radius)) {
            const double truth = aperture(sample->y, side, star, radius);
            if (truth < MOST_EXTRA * star[2] && truth > LEAST * star[2])
                dst->error[(int)dst->ratios++] = aperture(restored, side, star, radius) / truth - 1;
        }
    }
    free(taken);
    return RX_OK;
}
