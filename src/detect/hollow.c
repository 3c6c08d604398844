/* Basins in the light, each filled from its lowest neighbour on until all around it is twice as high. */
#include "detect/hollow.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"

/* A wider hole would be a mesh of the sky (BACK_SIZE 64). */
enum { MOST = 64 * 64, AROUND = 8 };
static const double BRIGHT = 20.0, HALF = 0.5, SURE = 3.0; /* sigmas of the sky; of the height; sigmas */
static const int to[AROUND][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}};

enum {
    WAITS = 1,
    INSIDE = 2,
    OPEN = 4, /* what is not higher leads from here to a wide sky, or to what is masked */
    HOLLOW = 8
};

typedef struct basin {
    const rx_image *image;
    uint8_t *mask, *state;            /* [height][width] */
    size_t *waiting;                  /* a heap, the lowest first */
    size_t *inside;                   /* [MOST] */
    size_t n, nwaiting, room, widest; /* widest: pixels of the largest hollow core */
    size_t low;                       /* of those inside: before any was as high as what is around a hole */
    double sky, sigma;                /* where it begins */
} basin;

static void swap(size_t *a, size_t *b)
{
    const size_t old = *a;
    *a = *b;
    *b = old;
}

static rx_status push(basin *b, size_t at, rx_error *err)
{
    const float *pixels = b->image->pixels;
    if (b->nwaiting == b->room) {
        RX_TRY(RX_GROW(b->waiting, 2 * b->room + MOST, err));
        b->room = 2 * b->room + MOST;
    }
    size_t i = b->nwaiting++;
    b->waiting[i] = at;
    b->state[at] |= WAITS;
    for (; i > 0 && pixels[b->waiting[i]] < pixels[b->waiting[(i - 1) / 2]]; i = (i - 1) / 2)
        swap(&b->waiting[i], &b->waiting[(i - 1) / 2]);
    return RX_OK;
}

static size_t pop(basin *b)
{
    const float *pixels = b->image->pixels;
    const size_t lowest = b->waiting[0];
    b->waiting[0] = b->waiting[--b->nwaiting];
    for (size_t i = 0, child; (child = 2 * i + 1) < b->nwaiting; i = child) {
        if (child + 1 < b->nwaiting && pixels[b->waiting[child + 1]] < pixels[b->waiting[child]])
            child++;
        if (!(pixels[b->waiting[child]] < pixels[b->waiting[i]]))
            break;
        swap(&b->waiting[i], &b->waiting[child]);
    }
    return lowest;
}

/* Saturated pixels hold light, all others that are masked nothing. */
static bool is_seen(const basin *b, int x, int y)
{
    return x >= 0 && y >= 0 && x < b->image->width && y < b->image->height &&
           (b->mask[(size_t)y * (size_t)b->image->width + (size_t)x] & ~RX_MASK_SATURATED) == 0;
}

/* The lowest pixel that is reached downhill. */
static size_t descend(const basin *b, size_t at)
{
    const size_t width = (size_t)b->image->width;
    for (size_t from = at + 1; from != at;) {
        const int x = (int)(at % width), y = (int)(at / width);
        from = at;
        for (int i = 0; i < AROUND; i++) {
            const int u = x + to[i][0], v = y + to[i][1];
            const size_t beside = (size_t)v * width + (size_t)u;
            if (is_seen(b, u, v) && b->image->pixels[beside] < b->image->pixels[at])
                at = beside;
        }
    }
    return at;
}

/* *closed: all around it is twice as high, and bright. */
static rx_status fill(basin *b, size_t start, bool *closed, rx_error *err)
{
    const size_t width = (size_t)b->image->width;
    double highest = HALF * BRIGHT * b->sigma;
    *closed = false;
    b->n = b->low = b->nwaiting = 0;
    RX_TRY(push(b, start, err));
    for (bool open = false; !open && !*closed;) {
        const size_t at = pop(b);
        const int x = (int)(at % width), y = (int)(at / width);
        open = (b->state[at] & OPEN) != 0 || b->n + 1 == MOST;
        b->state[at] |= INSIDE;
        b->inside[b->n++] = at;
        highest = fmax(highest, (double)b->image->pixels[at] - b->sky);
        if (highest <= BRIGHT * b->sigma)
            b->low = b->n;
        for (int i = 0; i < AROUND && !open; i++) {
            const int u = x + to[i][0], v = y + to[i][1];
            const size_t beside = (size_t)v * width + (size_t)u;
            open = !is_seen(b, u, v);
            if (!open && (b->state[beside] & WAITS) == 0)
                RX_TRY(push(b, beside, err));
        }
        *closed = !open && HALF * ((double)b->image->pixels[b->waiting[0]] - b->sky) > highest;
    }
    return RX_OK;
}

/* On each of its four sides; through saturated pixels, which are all of one height. */
static bool falls_outwards(const basin *b)
{
    const int width = b->image->width;
    const double gain = b->image->gain;
    for (int side = 0; side < 4; side++) {
        double fall = 0, variance = 0;
        for (size_t i = 0; i < b->n; i++) {
            const int dx = to[side][0], dy = to[side][1];
            int x = (int)(b->inside[i] % (size_t)width) + dx, y = (int)(b->inside[i] / (size_t)width) + dy;
            size_t near = (size_t)y * (size_t)width + (size_t)x;
            if ((b->state[near] & INSIDE) != 0)
                continue;
            while (is_seen(b, x, y) && (b->mask[near] & RX_MASK_SATURATED) != 0) {
                x += dx;
                y += dy;
                near = (size_t)y * (size_t)width + (size_t)x;
            }
            if (!is_seen(b, x, y) || !is_seen(b, x + dx, y + dy))
                continue;
            const size_t far = (size_t)(y + dy) * (size_t)width + (size_t)(x + dx);
            if (((b->state[near] | b->state[far]) & INSIDE) != 0)
                continue;
            const double light = (double)b->image->pixels[near] - b->sky;
            fall += (double)b->image->pixels[near] - (double)b->image->pixels[far];
            variance += 2.0 * (b->sigma * b->sigma + (gain > 0.0 ? fmax(light, 0.0) / gain : 0.0));
        }
        if (!(fall > SURE * sqrt(variance))) /* nor where nothing is seen */
            return false;
    }
    return true;
}

static rx_status look_at(basin *b, int x, int y, rx_error *err)
{
    const size_t start = (size_t)y * (size_t)b->image->width + (size_t)x;
    const rx_map level = rx_image_sky(b->image);
    bool closed;
    b->sky = (double)rx_map_at(&level, x, y);
    b->sigma = (double)rx_map_at(&b->image->noise, x, y);
    const double before = (double)b->image->pixels[start - 1] - b->sky;
    if (!(before > BRIGHT * b->sigma && HALF * before > (double)b->image->pixels[start] - b->sky))
        return RX_OK;
    RX_TRY(fill(b, descend(b, start), &closed, err));
    const bool hollow = closed && falls_outwards(b);
    for (size_t i = 0; i < b->n; i++) {
        uint8_t *state = &b->state[b->inside[i]];
        *state &= OPEN | HOLLOW;
        if (hollow)
            *state |= HOLLOW;
        else if (!closed && i < b->low)
            *state |= OPEN;
    }
    for (size_t i = 0; i < b->nwaiting; i++)
        b->state[b->waiting[i]] &= OPEN | HOLLOW;
    if (hollow && b->n > b->widest)
        b->widest = b->n;
    return RX_OK;
}

rx_status rx_hollow_hide(const rx_image *image, uint8_t *mask, size_t *found, rx_error *err)
{
    const size_t width = (size_t)image->width;
    const float least = (float)(BRIGHT * HALF * image->global_noise); /* few are looked at */
    basin b = {.image = image, .mask = mask};
    rx_status status = RX_OK;
    *found = 0;
    RX_TRY_EXIT(RX_MAKE(b.state, width * (size_t)image->height, err));
    RX_TRY_EXIT(RX_MAKE(b.inside, (size_t)MOST, err));
    for (int y = 1; y < image->height - 1; y++)
        for (int x = 1; x < image->width - 1; x++) {
            const size_t k = (size_t)y * width + (size_t)x;
            if (image->pixels[k - 1] - image->pixels[k] > least && is_seen(&b, x, y) &&
                is_seen(&b, x - 1, y) && b.state[k] == 0)
                RX_TRY_EXIT(look_at(&b, x, y, err));
        }
    for (size_t k = 0; k < width * (size_t)image->height && b.widest > 1; k++)
        if ((b.state[k] & HOLLOW) != 0) {
            mask[k] |= RX_MASK_BAD | RX_MASK_SATURATED;
            ++*found;
        }
exit:
    free(b.state);
    free(b.waiting);
    free(b.inside);
    return status;
}
