/* One-to-one matching of two lists of positions within a radius. */
#ifndef RX_QUALITY_MATCH_H
#define RX_QUALITY_MATCH_H

#include "base/error.h"

/* Positions in pixels; one that is not finite never matches, nor does one whose `use` is 0. */
typedef struct rx_match_list {
    long n;
    const double *x, *y;
    const unsigned char *use; /* NULL = all */
} rx_match_list;

/* All pairs within `radius` (inclusive) are taken nearest first, each source at most once; equal distances
 * go by index in a, then in b. a_to_b[a->n] and b_to_a[b->n] get the index of the partner or -1.
 * Errors: RX_USAGE (radius not positive, or so large that pairs exceed 5e6), RX_SYSTEM (memory). */
rx_status rx_match(const rx_match_list *a, const rx_match_list *b, double radius, long *a_to_b, long *b_to_a,
                   rx_error *err);

#endif
