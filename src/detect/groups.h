/* Connected groups of the pixels above the threshold, before anything is deblended. */
#ifndef RX_DETECT_GROUPS_H
#define RX_DETECT_GROUPS_H

#include <stdint.h>

#include "base/error.h"

typedef struct rx_group {
    long size;    /* pixels */
    float lowest; /* the lowest threshold among its pixels, ADU of the normalised kernel */
} rx_group;

typedef struct rx_groups {
    int n;
    int32_t *label; /* [height][width]: 0, or 1 + index in list */
    rx_group *list; /* [n] */
} rx_groups;

/* 8-connected groups of the pixels with above != 0. The threshold of a pixel is threshold * sigma of it;
 * sigma NULL: threshold itself. Free with rx_groups_free(), also after an error. */
rx_status rx_groups_find(const uint8_t *above, const float *sigma, double threshold, int width, int height,
                         rx_groups *dst, rx_error *err);
void rx_groups_free(rx_groups *groups);

#endif
