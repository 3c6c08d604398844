/* Can a group split when the threshold rises? Most cannot, and need no deblending. */
#ifndef RX_DETECT_DEBLENDABLE_H
#define RX_DETECT_DEBLENDABLE_H

#include <stdint.h>

#include "base/error.h"
#include "detect/groups.h"

/* Memory of one thread, which grows with the groups; zero to begin with. */
typedef struct rx_deblendable {
    size_t room;     /* pixels */
    float *values;   /* a group in its box and a ring of zeros */
    uint64_t *order; /* pixels by value: bits of the value, then the place */
    uint64_t *spare; /* of the sort */
    int *parent;     /* forest of the pixels that are up */
    int *size;       /* of each tree */
    double *sum;     /* values of each tree */
} rx_deblendable;

/* *splits = 1 where there may be a threshold at which two parts stand, each of `min_area` pixels or more and
 * each with more than `contrast` of the group's flux above that threshold (the flux of the group counts from
 * zero); 0 means that multi-threshold deblending (Bertin & Arnouts 1996, section 6) at any levels leaves the
 * group as it is. Parts grow as the threshold falls, in pixels and in flux above it, so it is enough to look
 * at them where they merge. Errors: RX_SYSTEM without memory. */
rx_status rx_deblendable_test(const rx_groups *groups, int group, int min_area, double contrast,
                              rx_deblendable *work, int *splits, rx_error *err);
void rx_deblendable_free(rx_deblendable *work);

#endif
