/* Which folders a run may replace: those that hold what a run wrote there, and nothing else. The marker, a file
 * `.rextract` in the folder, lists its files with their digests. */
#ifndef RX_IO_MARKER_H
#define RX_IO_MARKER_H

#include "base/error.h"

/* The marker of all that lies in `folder`, which errors call `shown`. Errors: RX_SYSTEM, and a signal. */
rx_status rx_marker_write(const char *folder, const char *shown, rx_error *err);

/* RX_OK where the folder is empty, or each file and folder in it is one that its marker lists, unchanged; files that
 * are missing do not matter. Else RX_USAGE, which names the first that is not; links are not followed. */
rx_status rx_marker_check(const char *folder, const char *shown, rx_error *err);

#endif
