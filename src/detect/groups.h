/* Connected groups of the pixels above the threshold, before anything is deblended. */
#ifndef RX_DETECT_GROUPS_H
#define RX_DETECT_GROUPS_H

#include <stdint.h>

#include "base/error.h"

/* The filtered image and what its pixels are held against. */
typedef struct rx_threshold {
    int width, height;
    const float *filtered; /* [height][width] */
    const float *sigma;    /* [height][width]: the threshold of a pixel is limit * sigma of it; NULL: limit */
    float limit;
} rx_threshold;

/* Neighbouring pixels of one row, x0 <= x < x1. */
typedef struct rx_span {
    int y, x0, x1;
    int group; /* index in the list */
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
} rx_groups;

/* 8-connected groups of the pixels above their threshold. Spans are found in strips of rows by `nthreads` and
 * joined in their order. Free with rx_groups_free(), also after an error. Errors: RX_SYSTEM without memory.
 */
rx_status rx_groups_find(const rx_threshold *threshold, int nthreads, rx_groups *dst, rx_error *err);
void rx_groups_free(rx_groups *groups);

#endif
