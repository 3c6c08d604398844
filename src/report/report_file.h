/* A file of a report. */
#ifndef RX_REPORT_REPORT_FILE_H
#define RX_REPORT_REPORT_FILE_H

#include "base/error.h"
#include "base/text.h"

/* text into folder/name (errors say shown/name); the text is freed in any case, ready for the next file.
 * Errors: RX_SYSTEM (memory, disk). */
rx_status rx_report_file(const char *folder, const char *shown, const char *name, rx_text *text,
                         rx_error *err);

#endif
