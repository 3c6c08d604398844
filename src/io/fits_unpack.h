/* Files packed with gzip. For the files of io/ alone. */
#ifndef RX_IO_FITS_UNPACK_H
#define RX_IO_FITS_UNPACK_H

#include <stdint.h>

#include "base/error.h"

/* Writes to the empty file `to`, and counts in *size, the bytes that the headers of the packed file tell of;
 * what it unpacks to beyond them, which may be gigabytes out of kilobytes, is left where it is. Errors:
 * RX_INPUT (cannot be opened, cut off, damaged), RX_SYSTEM. */
rx_status rx_fits_unpack(const char *path, int to, int64_t *size, rx_error *err);

/* Could so much memory be had? Files in memory grow past every limit of a process, until the system kills
 * one. RX_SYSTEM: no. */
rx_status rx_fits_ask_memory(int64_t bytes, rx_error *err);

#endif
