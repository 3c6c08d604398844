/* What the user reads while we work: messages and a progress line on stderr, or functions of the caller.
 *
 * The only place of the library that writes to a terminal, to the stream that it is given. A NULL log is silent. At
 * NORMAL what is longer than 160 characters goes on in further lines, and a tile has ten lines: warnings come at once
 * and always, information waits for the end of the tile and takes the lines that are left. The caller's functions are
 * given each message whole and at once. */
#ifndef RX_BASE_LOG_H
#define RX_BASE_LOG_H

#include <stdbool.h>
#include <stdio.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/text.h"

RX_BEGIN_DECLS

typedef enum rx_verbosity { RX_QUIET = 0, RX_NORMAL = 1, RX_FULL = 2 } rx_verbosity;

typedef enum rx_log_kind { RX_LOG_WARNING, RX_LOG_INFO, RX_LOG_DETAIL } rx_log_kind;

typedef struct rx_log {
    FILE *stream; /* NULL: none */
    const char *program;
    rx_verbosity level;
    bool terminal;       /* progress lines only on a terminal */
    double begun, shown; /* monotonic seconds: current progress line */
    bool line_open;
    bool in_tile;      /* between rx_log_tile_begin() and its end */
    bool written;      /* rx_log_written() was called in it */
    int lines;         /* on the stream since the tile before */
    rx_text waiting;   /* information of the tile: '0' (a hint) or '1', the line, a 0 */
    rx_text names;     /* of what was written */
    rx_text *warnings; /* gets them, each with its 0, even when QUIET; NULL: no one asks */
    /* The caller's, asked by the thread that made the call; NULL: the stream. */
    void (*message)(void *user, rx_log_kind kind, const char *text); /* without a newline */
    void (*progress)(void *user, const char *what, double done); /* 0..1, rising, of rx_log_part()'s whole */
    void *user;
    double from, to, reached; /* of that whole: what progress is a part of; to 0: all of it */
} rx_log;

void rx_log_init(rx_log *log, const char *program, FILE *stream, rx_verbosity level);

/* A log without a stream: messages of that level go to one function, progress to the other; either may be NULL. Owns
 * nothing. */
void rx_log_calls(rx_log *log, rx_verbosity level,
                  void (*message)(void *user, rx_log_kind kind, const char *text),
                  void (*progress)(void *user, const char *what, double done), void *user);

void rx_log_info(rx_log *log, const char *format, ...) RX_PRINTF(2, 3);   /* NORMAL and FULL */
void rx_log_detail(rx_log *log, const char *format, ...) RX_PRINTF(2, 3); /* FULL only */
void rx_log_hint(rx_log *log, const char *format, ...) RX_PRINTF(2, 3); /* info; the first to go in a tile */
void rx_log_warning(rx_log *log, const char *format, ...) RX_PRINTF(2, 3); /* not shown when QUIET */

/* What of a tile is said between the two has, with what was said since the tile before, ten lines at NORMAL. Where
 * warnings and names of files leave too few of them, information on the same image shares lines, and then hints and the
 * first messages are left out, which a line reports if there is room; the last message stays. `to_come`: lines that the
 * caller will add, of an error, say. */
void rx_log_tile_begin(rx_log *log);
void rx_log_tile_next(rx_log *log); /* the next image of the same file, with ten lines of its own */
void rx_log_tile_end(rx_log *log, int to_come);

/* Must it be short: NORMAL, within a tile? */
bool rx_log_is_short(const rx_log *log);

/* Names of files, "a.cat, b.fits" or "". In a tile all come in one message, its last. */
void rx_log_written(rx_log *log, const char *names);

/* Progress of a long job: begin, then update with the done share (0..1) as often
 * as wanted, then end. Shown with an ETA on a terminal after two seconds. Not
 * from inside a parallel region. */
void rx_log_progress_begin(rx_log *log);
void rx_log_progress(rx_log *log, const char *what, double done);
void rx_log_progress_end(rx_log *log);

/* On a terminal: what is done from here on, in the line that what comes next replaces, so that no step is silent. */
void rx_log_step(rx_log *log, const char *what);

/* The next part of a job, a step, goes from .. to of 0..1: what the caller's progress function is given. From 0: a new
 * job. */
void rx_log_part(rx_log *log, const char *what, double from, double to);

double rx_seconds(void); /* monotonic clock */

/* "47 s", "12 min" or "3h05m"; returns dst. */
enum { RX_TIME_LEFT = 32 };
const char *rx_time_left(double seconds, char dst[RX_TIME_LEFT]);

/* Seconds of a part of the work: wall clock, and CPU of all threads. */
typedef struct rx_lap {
    double wall, cpu;
} rx_lap;

rx_lap rx_lap_now(void); /* since some moment */

/* What passed since *last is added to the part, if any; *last becomes now. */
void rx_lap_add(rx_lap *last, rx_lap *part);

RX_END_DECLS

#endif
