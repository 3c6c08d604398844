/* Connected groups of the pixels above the threshold, before anything is deblended. */
#ifndef RX_DETECT_GROUPS_H
#define RX_DETECT_GROUPS_H

#include <stdbool.h>

#include "base/error.h"

/* The filtered image and what its pixels are compared with. */
typedef struct rx_threshold {
    int width, height;
    const float *filtered; /* [height][width]; of no use once there are groups, which have their own values */
    float limit;
    const struct rx_threshold_noise *noise; /* NULL: everywhere the same */
    int relative; /* the threshold of a pixel is limit * the filtered noise; 0: limit, noise is handed on */
} rx_threshold;

/* Neighbouring pixels of one row, x0 <= x < x1. */
typedef struct rx_span {
    int y, x0, x1;
    int group;           /* index in the list */
    const float *values; /* [x1 - x0] of the filtered image; where noise varies as many of the filtered noise
                            behind them, and behind these of the noise of pixels */
} rx_span;

typedef struct rx_group {
    int size;                   /* pixels */
    int xmin, xmax, ymin, ymax; /* inclusive */
    int end;                    /* x1 of its last span */
    float lowest;               /* the lowest threshold among its pixels, ADU of the normalised kernel */
    long first;                 /* of its spans, which stand together row by row */
    int nspans;
} rx_group;

typedef struct rx_groups {
    long above; /* pixels in all */
    int n;
    rx_group *list; /* [n] in the order in which a scan completes them: by the end of their last span */
    long nspans;
    rx_span *spans; /* [nspans] */
    int nblocks;
    float **blocks; /* owners of the spans' values */
} rx_groups;

/* 8-connected groups of the pixels above their threshold. Spans are found in strips of rows by `nthreads` and
 * joined in their order. Free with rx_groups_free(), also after an error. Errors: RX_SYSTEM without memory.
 */
rx_status rx_groups_find(const rx_threshold *threshold, int nthreads, rx_groups *dst, rx_error *err);
void rx_groups_free(rx_groups *groups);

/* The span of a group that pixel (x, y) is in; NULL if it is in none, as where rounding has put the pixel into
 * a detection, but not into the group. `last` is tried first: that of the pixel before, or NULL. */
const rx_span *rx_groups_span(const rx_groups *groups, int group, const rx_span *last, int x, int y);

/* Of pixel x of a span. Noise only where it varies. */
static inline float rx_span_filtered(const rx_span *span, int x)
{
    return span->values[x - span->x0];
}

static inline float rx_span_sigma(const rx_span *span, int x)
{
    return span->values[span->x1 - span->x0 + x - span->x0];
}

static inline float rx_span_noise(const rx_span *span, int x)
{
    return span->values[2 * (span->x1 - span->x0) + x - span->x0];
}

#endif
