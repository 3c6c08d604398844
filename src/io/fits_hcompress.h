/* HCOMPRESS streams that are cut off: cfitsio reads on behind them. For io/ alone. */
#ifndef RX_IO_FITS_HCOMPRESS_H
#define RX_IO_FITS_HCOMPRESS_H

#include <stddef.h>
#include <stdint.h>

#include "base/error.h"

/* Walks through a stream (R. L. White 1992, Proc. NASA Space and Earth Science Data Compression Workshop;
 * FITS 4.0, 10.4.4) as its reader would, without making the pixels. *used: bytes that a reader takes from it,
 * 0 where it is cut off, has other than `pixels` pixels, or is no such stream. RX_SYSTEM without memory. */
rx_status rx_hcompress_walk(const unsigned char *data, size_t length, int64_t pixels, size_t *used,
                            rx_error *err);

#endif
