/* Saturated stars beside a restored image.
 *
 * Where a detector is full, and where charge has bled, pixels do not hold the convolution of anything: what a
 * restorer makes of the wings round such a hole is a ring of pieces. So what RESTORE_TYPE NONE finds to be a
 * source with saturated pixels stays as it was observed: its segment is hidden from the detection on the
 * restored image, the source as it was found and measured on the untouched image joins the list, and the
 * restored image shows the untouched pixels there. What else is found in touch with such a segment and holds
 * the peak of no other source of NONE's is a piece of the star's wings: no source, and untouched pixels, too.
 * So neighbours that NONE separates from the star are restored and measured as everywhere; of companions that only
 * a restorer would separate from the star there are no more than NONE has. */
#ifndef RX_PIPELINE_SATURATED_H
#define RX_PIPELINE_SATURATED_H

#include <stddef.h>

#include "base/error.h"
#include "data/image.h"
#include "data/restored.h"
#include "data/sources.h"

/* A pixel that stays as it was observed. */
typedef struct rx_saturated_pixel {
    size_t at;
    int32_t source;   /* of the list, from 0; -1: of the wings */
    uint8_t fragment; /* RX_FRAGMENT_ */
} rx_saturated_pixel;

typedef struct rx_saturated_peak {
    int x, y;
} rx_saturated_peak;

/* All 0: none. */
typedef struct rx_saturated {
    int n;
    rx_source *list; /* as on the untouched image */
    size_t npixels;
    rx_saturated_pixel *pixels;
    int npeaks;
    rx_saturated_peak *peaks; /* of the untouched image's other sources */
} rx_saturated;

/* Of the sources found on the untouched detection image those with a pixel that is saturated there or on the
 * measurement image stay in sources->list; the map of segments still knows the others. Their pixels go to dst.
 * Errors: RX_SYSTEM. */
rx_status rx_saturated_choose(const rx_image *detect, const rx_image *measure, rx_sources *sources,
                              rx_saturated *dst, rx_error *err);

/* The list, after it was measured; lent, not taken. Errors: RX_SYSTEM. */
rx_status rx_saturated_keep(const rx_sources *sources, rx_saturated *dst, rx_error *err);

/* Before the detection on a restored image: their pixels become masked as RX_MASK_UNTOUCHED. */
void rx_saturated_hide(const rx_saturated *saturated, rx_restored *restored);

/* After it: pieces of wings leave the list. Errors: RX_SYSTEM. */
rx_status rx_saturated_absorb(rx_saturated *saturated, rx_sources *sources, rx_error *err);

/* Then: the pixels are those of the tile above the sky, but for those that stay masked, as the bits `masked` say;
 * nothing is said of how a restored image would
 * explain the saturated ones of them (reblurred: not a number). */
void rx_saturated_show(const rx_saturated *saturated, const rx_image *input, const rx_background *sky,
                       int masked, rx_restored *restored);

/* They join the end of a list that was made while they were hidden. Errors: RX_SYSTEM. */
rx_status rx_saturated_append(const rx_saturated *saturated, rx_sources *sources, rx_error *err);

/* Those of them that are still in the list (rx_source.untouched) get their measurements again. */
void rx_saturated_restate(const rx_saturated *saturated, rx_sources *sources);

void rx_saturated_free(rx_saturated *saturated); /* the contents */

#endif
