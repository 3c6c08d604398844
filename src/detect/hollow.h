/* Saturated stars whose cores a detector or pipeline left at 0 or any other low value.
 *
 * A hollow core is a connected set of pixels, diagonals included, all of which are less than half as high above the sky as each
 * pixel around it, these 20 sigma high or more, as in detect/saturation.h: from one pixel to the next, all around, no light falls so
 * steeply towards the middle of a ring if the PSF has a FWHM of 2 pixels or more (beside the top of a ridge as narrow as the PSF
 * it is exp2(-4 / FWHM^2) = 1/2). To the left, right, top and bottom the light around it falls outwards, by 3 sigma of the sum over
 * that side, as it does not where dead pixels lie on the slope of a source. Single pixels, as a dead one on a peak, are hollow cores
 * only where the image has a wider one. */
#ifndef RX_DETECT_HOLLOW_H
#define RX_DETECT_HOLLOW_H

#include "base/error.h"
#include "data/image.h"

/* RX_MASK_BAD | RX_MASK_SATURATED at the pixels of hollow cores of the image, on its sky. mask: that of the image. *found:
 * how many. Errors: RX_SYSTEM. */
rx_status rx_hollow_hide(const rx_image *image, uint8_t *mask, size_t *found, rx_error *err);

#endif
