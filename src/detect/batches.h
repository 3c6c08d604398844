/* Which groups are deblended together: by fixed rules, whatever the number of threads. */
#ifndef RX_DETECT_BATCHES_H
#define RX_DETECT_BATCHES_H

#include "base/error.h"
#include "detect/groups.h"
#include "detect/params.h"

typedef struct rx_batch {
    int first, n; /* in `members` */
    int blended;  /* its groups may be deblended */
    long pixels;  /* of all its groups */
} rx_batch;

typedef struct rx_batches {
    int n;
    rx_batch *list; /* [n] those of blends first: they take longest */
    int *members;   /* indices of groups */
} rx_batches;

/* Groups of par->min_area pixels and more, those that deblending may split by themselves.
 * Free with rx_batches_free(), also after an error. Errors: RX_SYSTEM without memory. */
rx_status rx_batches_make(const rx_detect_params *par, const rx_threshold *image, const rx_groups *groups,
                          rx_batches *dst, rx_error *err);
void rx_batches_free(rx_batches *batches);

#endif
