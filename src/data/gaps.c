/* Hidden pixels between good ones. */
#include "data/gaps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "data/image.h"

static const double WIDEST = 1.0, WIDEST_HOLE = 1.5; /* FWHM */
static const double WIDEST_CORE = 3.4;               /* FWHM */
enum { MOST = 127 };                                 /* pixels; steps are kept in bytes */

/* A row, a column and both diagonals. */
enum { AXES = 4 };
static const struct {
    int x, y;
    double length;
} axes[AXES] = {{1, 0, 1.0}, {0, 1, 1.0}, {1, 1, 1.4142135623730951}, {-1, 1, 1.4142135623730951}};

typedef struct plane {
    const uint8_t *mask;
    int width, height;
} plane;

/* Steps from a hidden pixel to the first good one; more than `most` without any within these. */
static int steps_to_good(const plane *p, int x, int y, int dx, int dy, int most)
{
    int n = 0;
    do {
        n++;
        x += dx;
        y += dy;
        if (x < 0 || y < 0 || x >= p->width || y >= p->height)
            return most + 1;
    } while (n <= most && p->mask[(size_t)y * (size_t)p->width + (size_t)x] != 0);
    return n;
}

/* How many hidden pixels its run along that axis has, more than `most` where it has no good ends so near. */
static int run_along(const plane *p, int x, int y, int axis, int most, rx_gap *dst)
{
    const int dx = axes[axis].x, dy = axes[axis].y;
    const int after = steps_to_good(p, x, y, dx, dy, most),
              before = after > most ? 1 : steps_to_good(p, x, y, -dx, -dy, most - after + 1);
    dst->axis = (uint8_t)axis;
    dst->before = (uint8_t)before;
    dst->after = (uint8_t)after;
    return before + after - 1;
}

/* Is the pixel in a gap? */
static bool in_gap(const plane *p, int x, int y, double fwhm, double widest, rx_gap *dst)
{
    rx_gap run = *dst;
    const int hole = (int)(WIDEST_HOLE * fwhm);
    if (run_along(p, x, y, 0, hole, &run) <= hole && run_along(p, x, y, 1, hole, &run) <= hole)
        widest = fmax(widest, WIDEST_HOLE * fwhm);
    double shortest = HUGE_VAL;
    for (int i = 0; i < AXES; i++) {
        const int most = (int)(fmin(widest, shortest) / axes[i].length);
        const int n = run_along(p, x, y, i, most, &run);
        const double length = n * axes[i].length;
        if (n > most || !(length < shortest))
            continue;
        shortest = length;
        *dst = run;
    }
    return shortest <= widest;
}

rx_status rx_gaps_find(const uint8_t *mask, int width, int height, double fwhm, int cut, rx_gaps **dst,
                       rx_error *err)
{
    const plane p = {mask, width, height};
    const double star = fmin(fwhm > 0.0 ? fwhm : RX_UNKNOWN_FWHM, MOST / WIDEST_HOLE), widest = WIDEST * star;
    rx_gaps gaps = {.width = width, .fwhm = star};
    size_t room = 0;
    rx_status status = RX_OK;
    *dst = NULL;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const size_t k = (size_t)y * (size_t)width + (size_t)x;
            rx_gap gap = {.at = (int)k, .mask = mask[k]};
            const int full = mask[k] & RX_MASK_CUT;
            if (mask[k] == 0 || (full && !cut) || !in_gap(&p, x, y, star, full ? MOST : widest, &gap))
                continue;
            if (gaps.n == room)
                RX_TRY_EXIT(RX_GROW(gaps.list, room = 2 * room + 256, err));
            gaps.list[gaps.n++] = gap;
        }
    if (gaps.n == 0)
        return RX_OK;
    RX_TRY_EXIT(RX_MAKE(*dst, 1, err));
    **dst = gaps;
    gaps.list = NULL;
exit:
    free(gaps.list);
    return status;
}

/* What a good pixel beside a hole shows, looked at from the hole. */
typedef enum side { DARK, FALLS, OTHER } side;

/* n steps away; whether it falls is seen over the distance `far`. */
static side side_at(const rx_image *image, int x, int y, int dx, int dy, int n, int far)
{
    static const double SURE = 3.0; /* sigmas of the difference of two pixels */
    const int x0 = x + n * dx, y0 = y + n * dy, x1 = x0 + far * dx, y1 = y0 + far * dy;
    if (x0 < 0 || y0 < 0 || x0 >= image->width || y0 >= image->height)
        return DARK;
    const size_t width = (size_t)image->width, near = (size_t)y0 * width + (size_t)x0;
    const rx_map sky = rx_image_sky(image);
    const double sigma = (double)rx_map_at(&image->noise, x0, y0),
                 light = (double)image->pixels[near] - (double)rx_map_at(&sky, x0, y0),
                 photons = image->gain > 0.0 ? fmax(0.0, light) / image->gain : 0.0,
                 limit = SURE * sqrt(2.0 * (sigma * sigma + photons));
    if (light <= limit)
        return DARK;
    if (x1 < 0 || y1 < 0 || x1 >= image->width || y1 >= image->height)
        return OTHER;
    const size_t beyond = (size_t)y1 * width + (size_t)x1;
    return image->mask[beyond] == 0 && (double)(image->pixels[near] - image->pixels[beyond]) > limit ? FALLS
                                                                                                     : OTHER;
}

/* The two ends of a hidden pixel's run along an axis. */
typedef struct ends {
    int width; /* pixels between them; 0: not both fall */
    bool other;
} ends;

static ends ends_of(const rx_image *image, size_t at, int axis, int before, int after, int most, int far)
{
    const int x = (int)(at % (size_t)image->width), y = (int)(at / (size_t)image->width), dx = axes[axis].x,
              dy = axes[axis].y;
    const side ahead = after > most ? DARK : side_at(image, x, y, dx, dy, after, far),
               behind = before > most ? DARK : side_at(image, x, y, -dx, -dy, before, far);
    return (ends){.width = ahead == FALLS && behind == FALLS ? before + after - 1 : 0,
                  .other = ahead == OTHER || behind == OTHER};
}

size_t rx_gaps_mark_cores(const rx_image *image, double fwhm, uint8_t *mask)
{
    const plane p = {mask, image->width, image->height};
    const double star = fmin(fwhm > 0.0 ? fwhm : RX_UNKNOWN_FWHM, MOST / WIDEST_HOLE);
    const int far = (int)ceil(star), widest = rx_min_int((int)(WIDEST_CORE * star), MOST);
    size_t n = 0;
    for (int y = 0; y < p.height; y++)
        for (int x = 0, before = 0, after = 0; x < p.width; x++) {
            const size_t at = (size_t)y * (size_t)p.width + (size_t)x;
            uint8_t *bits = &mask[at];
            rx_gap gap = {0};
            before = *bits != 0 ? before + 1 : 0;
            if (before > 0)
                after = before > 1 ? after - 1 : steps_to_good(&p, x, y, 1, 0, p.width);
            if ((*bits & RX_HIDE_PLAIN) == 0)
                continue;
            const ends row = ends_of(image, at, 0, before, after, MOST, far);
            const int most = row.width > 0 ? MOST : widest,
                      above = row.other ? 0 : steps_to_good(&p, x, y, 0, -1, most);
            if (row.other || (row.width == 0 && above > most)) /* wide masks take no time */
                continue;
            const ends column = ends_of(image, at, 1, above, steps_to_good(&p, x, y, 0, 1, most), most, far);
            const bool both = row.width > 0 && column.width > 0;
            if (column.other || row.width + column.width == 0 ||
                (!both && row.width + column.width > widest) || in_gap(&p, x, y, star, WIDEST * star, &gap))
                continue;
            *bits |= RX_MASK_CORE;
            n++;
        }
    return n;
}

void rx_gaps_free(rx_gaps *gaps)
{
    if (gaps != NULL)
        free(gaps->list);
    free(gaps);
}

static float between(const rx_gap *gap, float before, float after)
{
    const float share = (float)gap->before / (float)(gap->before + gap->after);
    return before + share * (after - before);
}

static int step_of(const rx_gaps *gaps, const rx_gap *gap)
{
    return axes[gap->axis].y * gaps->width + axes[gap->axis].x;
}

void rx_gaps_fill(const rx_gaps *gaps, float *values)
{
    for (size_t i = 0; gaps != NULL && i < gaps->n; i++) {
        const rx_gap *gap = &gaps->list[i];
        const int step = step_of(gaps, gap);
        values[gap->at] =
            between(gap, values[gap->at - gap->before * step], values[gap->at + gap->after * step]);
    }
}

double rx_gap_noise(const rx_gaps *gaps, const rx_gap *gap)
{
    const double w = (gap->before + gap->after - 1) * axes[gap->axis].length / gaps->fwhm;
    return 1.0 / sqrt(erfc(sqrt(2.0 * log(2.0)) * w));
}

void rx_gaps_mark(const rx_gaps *gaps, uint8_t bits, uint8_t *mask)
{
    for (size_t i = 0; gaps != NULL && i < gaps->n; i++)
        mask[gaps->list[i].at] = bits;
}

void rx_gaps_close(const rx_gaps *gaps, uint8_t *mask)
{
    for (size_t i = 0; gaps != NULL && i < gaps->n; i++)
        mask[gaps->list[i].at] = gaps->list[i].mask;
}

/* The first gap at that pixel or behind it. */
static size_t first_from(const rx_gaps *gaps, int at)
{
    size_t low = 0, high = gaps->n;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (gaps->list[middle].at < at)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static void make_filled(const rx_map_maker *maker, int x, int y, int n, int rows, float *dst)
{
    const rx_gaps_map *map = (const rx_gaps_map *)maker;
    const rx_gaps *gaps = map->gaps;
    const int width = gaps->width;
    for (int v = y; v < y + rows; v++, dst += n) {
        const int first = v * width + x;
        const float *from = rx_map_row(&map->of, v, x, n, dst);
        if (from != dst)
            memcpy(dst, from, (size_t)n * sizeof *dst);
        for (size_t i = first_from(gaps, first); i < gaps->n && gaps->list[i].at < first + n; i++) {
            const rx_gap *gap = &gaps->list[i];
            const int step = step_of(gaps, gap), a = gap->at - gap->before * step,
                      b = gap->at + gap->after * step;
            dst[gap->at - first] = between(gap, rx_map_at(&map->of, a % width, a / width),
                                           rx_map_at(&map->of, b % width, b / width));
        }
    }
}

rx_map rx_gaps_filled(rx_gaps_map *room, rx_map of, const rx_gaps *gaps)
{
    if (gaps == NULL)
        return of;
    *room = (rx_gaps_map){.maker.make = make_filled, .of = of, .gaps = gaps};
    return rx_map_made(&room->maker, of.width);
}
