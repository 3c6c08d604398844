/* Running gnuplot: the one place that starts another program. */
#ifndef RX_REPORT_GNUPLOT_H
#define RX_REPORT_GNUPLOT_H

#include <stddef.h>
#include <sys/types.h>

/* Start `program -d script` inside `folder`. No shell; no signal blocked; nothing read, what it prints goes
 * to gnuplot.log in that folder. Returns the process, to be waited for, or 0 and the reason, one line, in
 * note. */
pid_t rx_gnuplot_start(const char *program, const char *folder, const char *script, char *note, size_t size);

/* Wait for its end. Returns 1 when it ended well, else 0 and the reason. One that hangs is killed after 10
 * minutes, or when a signal asks this process to end. */
int rx_gnuplot_wait(pid_t child, const char *program, const char *folder, char *note, size_t size);

#endif
