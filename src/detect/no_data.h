/* Pixels that hold no data though no map says so: a coadd filled up beyond its frames with zeros, the level of its sky or any
 * other value, several of them, a chip's frame, -9999.
 *
 * 32 pixels in a row or a column with exactly one value, whatever it is, and all of that value that touch them. Where the
 * numbers are so coarse, or so smooth, that noise has such runs, they must be longer: of the pixels with that value elsewhere no
 * more than 0.01 runs of the length are due to chance, given how often two of them go on to four. Left alone are
 *   - values of which the sky is full: 0.35 of the pixels outside runs, or more, have them, too;
 *   - models without noise, whose light fades into them: beside them most pixels differ from the next in their row by less than
 *     a fifth of what they do on the whole (median);
 *   - points on nothing, as single photons: more than half of the other pixels are beside them;
 *   - saturated stars: values above the sky (5 of these medians) into which light rises from most sides of a region, or in
 *     regions that are nowhere 32 pixels wide both ways, as what bleeds, but for those along a border of the tile.
 */
#ifndef RX_DETECT_NO_DATA_H
#define RX_DETECT_NO_DATA_H

#include <stdbool.h>

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"

RX_BEGIN_DECLS

/* keep_sky: values as the sky's (within 5 of these medians of its level) stay, too, as SExtractor has no other way to know.
 * mask, [height][width], of the same image, gets RX_MASK_BAD there; *found: pixels that got it. Where all are alike all get it.
 * The same for any nthreads. Errors: RX_SYSTEM, and mask is as it was. */
rx_status rx_no_data_hide(const rx_image *image, bool keep_sky, int nthreads, uint8_t *mask, size_t *found,
                          rx_error *err);

RX_END_DECLS

#endif
