/* The record of the run that wrote an output (data/record.h, stage/provenance.h), read back. */
#ifndef RX_IO_RECORD_READ_H
#define RX_IO_RECORD_READ_H

#include "base/error.h"
#include "data/record.h"

/* The records of all parts of the file at `path`, one after the other, where it is FITS, a VOTable (whose record is not read)
 * or a text with a line "# RECORD = "; in a pair CHANGED each what was done to a part since. *found false: it is none of
 * these. Errors: RX_INPUT (no record, one of another kind, a line is missing), RX_SYSTEM. Free *dst in any case. */
rx_status rx_record_read(const char *path, rx_record *dst, bool *found, rx_error *err);

#endif
