/* Do pixels pile up at the top of a tile, or are the cores of its brightest sources hollow? */
#include "detect/saturation.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

enum { SAMPLE = 20000, REACH = 2, LEAST_HOLLOW = 3 };
static const double FLAT = 0.05, PILE = 0.2, ABOVE = 0.1, HALF = 0.5, CHANCE = 1e-3;
static const double BRIGHT = 20.0; /* sigmas of the sky: FLAT of that is one sigma, below tops are noise */

static rx_status measure_sky(const rx_image *image, const uint8_t *mask, double sky[2], rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height, step = n / SAMPLE + 1;
    double *values;
    size_t count = 0;
    RX_TRY(RX_MAKE(values, n / step + 1, err));
    for (size_t k = 0; k < n; k += step)
        if (mask[k] == 0)
            values[count++] = (double)image->pixels[k];
    sky[1] = rx_sigma_mad(values, count, &sky[0]);
    free(values);
    return RX_OK;
}

/* The highest value that all of 3 x 3 pixels reach; `least` where there is none above it. */
static float top_of(const rx_image *image, const uint8_t *mask, float least)
{
    const size_t width = (size_t)image->width;
    float top = least;
    for (int y = 1; y < image->height - 1; y++)
        for (int x = 1; x < image->width - 1; x++) {
            const size_t middle = (size_t)y * width + (size_t)x;
            float lowest = image->pixels[middle];
            for (int i = 0; i < 9 && lowest > top; i++) {
                const size_t k = middle + (size_t)(i / 3) * width + (size_t)(i % 3) - width - 1;
                lowest = mask[k] != 0 ? least : fminf(lowest, image->pixels[k]);
            }
            top = fmaxf(top, lowest);
        }
    return top;
}

/* Small stars are full in a few pixels only: is the highest value that of so many that no falling distribution makes it?
 * A twentieth of the height has, at 100 sigmas, at least five steps of a number that is no coarser than the noise, so
 * that the topmost of these has a sixth of the pixels: of 5 by chance less than one tile in a thousand. */
static bool is_pile(const rx_image *image, const uint8_t *mask, const double sky[2], double *level)
{
    enum { LEAST_PILE = 5 };
    static const double HIGH = 100.0; /* sigmas */
    const size_t n = (size_t)image->width * (size_t)image->height;
    float highest = -HUGE_VALF;
    size_t equal = 0, near = 0;
    for (size_t k = 0; k < n; k++)
        if (mask[k] == 0)
            highest = fmaxf(highest, image->pixels[k]);
    const double height = (double)highest - sky[0];
    for (size_t k = 0; k < n; k++) {
        equal += mask[k] == 0 && image->pixels[k] == highest;
        near += mask[k] == 0 && image->pixels[k] < highest &&
                (double)image->pixels[k] >= sky[0] + (1.0 - FLAT) * height;
    }
    if (!(height > HIGH * sky[1]) || equal < LEAST_PILE || equal <= 2 * near)
        return false;
    *level = (double)highest;
    return true;
}

/* The highest of 5 x 5 pixels around it. */
typedef struct top {
    float value;
    int hollow;
} top;

static int higher_first(const void *a, const void *b)
{
    const float left = ((const top *)a)->value, right = ((const top *)b)->value;
    return (left < right) - (left > right);
}

/* Is pixel k, its neighbours one and the other of which are `step` away, in a hole between bright ones? */
static int is_hollow(const rx_image *image, const uint8_t *mask, size_t k, size_t step,
                     const double limits[2])
{
    const float beside = fminf(image->pixels[k - step], image->pixels[k + step]);
    return (mask[k] | mask[k - step] | mask[k + step]) == 0 && (double)beside > limits[1] &&
           (double)image->pixels[k] - limits[0] < HALF * ((double)beside - limits[0]);
}

/* 1: (x, y) is a top, all four of whose neighbours are above limits[1], too, as a cosmic ray's are not; -1: a hollow one. limits: the
 * sky and what is bright. */
static int look_at_top(const rx_image *image, const uint8_t *mask, int x, int y, const double limits[2])
{
    const size_t width = (size_t)image->width, middle = (size_t)y * width + (size_t)x;
    const float value = image->pixels[middle], *at = image->pixels + middle;
    int hollow = 0;
    if (mask[middle] != 0 ||
        !((double)fminf(fminf(at[-1], at[1]), fminf(*(at - width), at[width])) > limits[1]))
        return 0;
    for (int v = y - REACH; v <= y + REACH; v++)
        for (int u = x - REACH; u <= x + REACH; u++) {
            const size_t k = (size_t)v * width + (size_t)u;
            if (mask[k] == 0 && (image->pixels[k] > value || (image->pixels[k] == value && k < middle)))
                return 0;
        }
    for (int v = y - REACH; v <= y + REACH; v++)
        for (int u = x - REACH; u <= x + REACH; u++) {
            const size_t k = (size_t)v * width + (size_t)u;
            hollow |= u > 0 && u < image->width - 1 && is_hollow(image, mask, k, 1, limits);
            hollow |= v > 0 && v < image->height - 1 && is_hollow(image, mask, k, width, limits);
        }
    return hollow ? -1 : 1;
}

/* The tops of the image, as far as there is room for them. How many there are. */
static size_t find_tops(const rx_image *image, const uint8_t *mask, const double limits[2], top *dst,
                        size_t room)
{
    size_t n = 0;
    for (int y = REACH; y < image->height - REACH; y++)
        for (int x = REACH; x < image->width - REACH; x++) {
            const float value = image->pixels[(size_t)y * (size_t)image->width + (size_t)x];
            const int is = (double)value > limits[1] ? look_at_top(image, mask, x, y, limits) : 0;
            if (is != 0 && n < room)
                dst[n] = (top){.value = value, .hollow = is < 0};
            n += is != 0;
        }
    return n;
}

static rx_status find_hollow(const rx_image *image, const uint8_t *mask, const double limits[2],
                             double *level, rx_error *err)
{
    size_t n = find_tops(image, mask, limits, NULL, 0);
    size_t last = 0, below = 0;
    int score = 0, best = LEAST_HOLLOW;
    top *tops;
    RX_TRY(RX_MAKE(tops, n + 1, err));
    find_tops(image, mask, limits, tops, n);
    tops[n].value = (float)limits[1];
    qsort(tops, n, sizeof *tops, higher_first);
    for (size_t i = 0; i < n; i++) {
        score += tops[i].hollow ? 1 : -1;
        if (score >= best) { /* of two alike the lower */
            best = score;
            last = i + 1;
        }
    }
    for (size_t i = last; i < n; i++)
        below += tops[i].hollow != 0;
    n -= last;
    if (last > 0 && last < n && pow((double)(below + 1) / (double)(n - below + 1), best) < CHANCE)
        *level = fmax((double)nextafterf(tops[last].value, INFINITY),
                      limits[0] + HALF * ((double)tops[last - 1].value - limits[0]));
    free(tops);
    return RX_OK;
}

rx_status rx_saturation_find(const rx_image *image, const uint8_t *mask, double *level, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    double sky[2], above = 0, flat = 0, half = 0;
    *level = HUGE_VAL;
    RX_TRY(measure_sky(image, mask, sky, err));
    if (!(sky[1] > 0.0))
        return RX_OK;
    if (is_pile(image, mask, sky, level))
        return RX_OK;
    const double limits[2] = {sky[0], sky[0] + BRIGHT * sky[1]};
    const float least = (float)limits[1], highest = top_of(image, mask, least);
    if (!(highest > least))
        return find_hollow(image, mask, limits, level, err);
    const double height = (double)highest - sky[0];
    const float from = (float)(sky[0] + (1.0 - FLAT) * height), to = (float)(sky[0] + (1.0 + FLAT) * height),
                middle = (float)(sky[0] + 0.5 * height);
#pragma omp simd reduction(+ : above, flat, half)
    for (size_t k = 0; k < n; k++) {
        const float value = mask[k] == 0 ? image->pixels[k] : 0.0f;
        above += value > to;
        flat += value >= from;
        half += value > middle;
    }
    flat -= above;
    if (flat > PILE * half && above < ABOVE * flat)
        *level = (double)from;
    return isfinite(*level) ? RX_OK : find_hollow(image, mask, limits, level, err);
}
