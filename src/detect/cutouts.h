/* Groups cut out of the filtered image and packed into a small one: sky costs nothing then, and parts of the
 * tile can be deblended at the same time. */
#ifndef RX_DETECT_CUTOUTS_H
#define RX_DETECT_CUTOUTS_H

#include "base/error.h"
#include "detect/filter.h"
#include "detect/groups.h"

/* Where the corner (xmin, ymin) of a group is. */
typedef struct rx_cutout {
    int group, x, y;
} rx_cutout;

typedef struct rx_cutouts {
    int width, height;
    float *pixels; /* [height][width]: 0 but for the groups' pixels, or (unfiltered) their boxes */
    int ring;      /* pixels around a group that are its own */
    float *noise; /* NULL where the image has one threshold. Of a group's pixels theirs; around them such that
                     the threshold is the lowest of the group (more by rounding): sep reads the threshold from
                     which it deblends there, as SExtractor takes it */
    int n;
    rx_cutout *list; /* [n] shelf by shelf, from left to right */
    int *shelf;      /* [height] first of the shelf at that row */
} rx_cutouts;

/* The image before the filter, for sep to filter it itself: of blends it looks at both, and shares the pixels
 * between the parts out by what the unfiltered ones say of their shapes. */
typedef struct rx_unfiltered {
    const float *pixels; /* [height][width], hidden ones 0 */
    const rx_filter *kernel;
    double threshold;  /* sigmas */
    float noise_value; /* of a pixel where no plane says it */
} rx_unfiltered;

/* Pack n groups; each has a pixel of sky around it, but one alone that touches the tile's border. With
 * `unfiltered` (else NULL) the pixels are those, and all that lies around that the filter asks for; noise
 * then keeps everything but the groups below the threshold. Free with rx_cutouts_free(), also after an error.
 * Errors: RX_SYSTEM. */
rx_status rx_cutouts_make(const rx_threshold *image, const rx_groups *groups, const rx_unfiltered *unfiltered,
                          const int *wanted, int n, rx_cutouts *dst, rx_error *err);
void rx_cutouts_free(rx_cutouts *cutouts);

/* The cutout that pixel (x, y) of the packed image is in. */
const rx_cutout *rx_cutouts_at(const rx_cutouts *cutouts, int x, int y);

/* Pixels that a group takes in a packed image. */
long rx_cutout_area(const rx_group *group);

#endif
