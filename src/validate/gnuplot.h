/* Running gnuplot: the one place that starts another program. */
#ifndef RX_VALIDATE_GNUPLOT_H
#define RX_VALIDATE_GNUPLOT_H

#include <stddef.h>

/* Run `program -d script` inside `folder` and wait. No shell; no signal blocked; nothing read, what it
 * prints goes to gnuplot.log in that folder. Returns 1 when it ended well, else 0 and the reason, one line,
 * in note. */
int rx_gnuplot_run(const char *program, const char *folder, const char *script, char *note, size_t size);

#endif
