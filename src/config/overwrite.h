/* No output takes the place of an input. Private to config/. */
#ifndef RX_CONFIG_OVERWRITE_H
#define RX_CONFIG_OVERWRITE_H

#include "config/config.h"

/* RX_USAGE when a file that `config` has written is one that it has read, or one of the images in `image`
 * ("tile.fits" or "detect.fits,measure.fits"; what stands in brackets does not count). Files are compared,
 * not names. */
rx_status rx_overwrite_check(const rx_config *config, const char *image, rx_error *err);

#endif
