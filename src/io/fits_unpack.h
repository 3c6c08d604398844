/* Files packed with gzip, in memory. For the files of io/ alone. */
#ifndef RX_IO_FITS_UNPACK_H
#define RX_IO_FITS_UNPACK_H

#include <stddef.h>

#include "base/error.h"

/* *memory (the caller's to free) = the *size bytes of the file that its headers tell of; what a gzip file
 * unpacks to beyond them, which may be gigabytes out of kilobytes, is left where it is. `extra` further bytes
 * of memory are there. Errors: RX_INPUT (cannot be opened, cut off, damaged), RX_SYSTEM. */
rx_status rx_fits_unpack(const char *path, size_t extra, void **memory, size_t *size, rx_error *err);

#endif
