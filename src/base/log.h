/* What the user reads while we work: messages and a progress line on stderr.
 *
 * The only place of the library that writes to a terminal. A NULL log is silent. At NORMAL what is longer than 160
 * characters goes on in further lines.
 */
#ifndef RX_BASE_LOG_H
#define RX_BASE_LOG_H

#include <stdbool.h>
#include <stdio.h>

#include "base/error.h"

typedef enum rx_verbosity { RX_QUIET = 0, RX_NORMAL = 1, RX_FULL = 2 } rx_verbosity;

typedef struct rx_log {
    FILE *stream;
    const char *program;
    rx_verbosity level;
    bool terminal;       /* progress lines only on a terminal */
    double begun, shown; /* monotonic seconds: current progress line */
    bool line_open;
} rx_log;

void rx_log_init(rx_log *log, const char *program, FILE *stream, rx_verbosity level);
void rx_log_info(rx_log *log, const char *format, ...) RX_PRINTF(2, 3);    /* NORMAL and FULL */
void rx_log_detail(rx_log *log, const char *format, ...) RX_PRINTF(2, 3);  /* FULL only */
void rx_log_warning(rx_log *log, const char *format, ...) RX_PRINTF(2, 3); /* not when QUIET */

/* Progress of a long job: begin, then update with the done share (0..1) as often
 * as wanted, then end. Shown with an ETA on a terminal after two seconds. Not
 * from inside a parallel region. */
void rx_log_progress_begin(rx_log *log);
void rx_log_progress(rx_log *log, const char *what, double done);
void rx_log_progress_end(rx_log *log);

double rx_seconds(void); /* monotonic clock */

#endif
