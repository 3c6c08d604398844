/* Pixels that hold no data though no map says so: a coadd filled with zeros beyond its frames, a chip's frame, -9999.
 *
 * 32 pixels in a row or a column with one value, 0 or the lowest of the tile, and all of that value that touch them. Noise of
 * half a step of the numbers, or more, makes hardly one. Left alone are
 *   - numbers so coarse that the sky itself has that value: 0.35 of the pixels outside such runs, or more, have it, too;
 *   - models without noise, whose light fades into it: beside it pixels differ from the next in their row by less than a fifth of
 *     what they do on the whole (medians);
 *   - points on nothing, as single photons: more than half of the other pixels are beside it.
 */
#ifndef RX_DETECT_NO_DATA_H
#define RX_DETECT_NO_DATA_H

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"

RX_BEGIN_DECLS

/* mask, [height][width], of the same image, gets RX_MASK_BAD there; *found: pixels that got it. Where all are alike all get it.
 * The same for any nthreads. Errors: RX_SYSTEM, and mask is as it was. */
rx_status rx_no_data_hide(const rx_image *image, int nthreads, uint8_t *mask, size_t *found, rx_error *err);

RX_END_DECLS

#endif
