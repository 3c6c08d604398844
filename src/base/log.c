/* Messages and the progress line. */
#include "base/log.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/memory.h"

enum {
    SHOW_AFTER_SECONDS = 2,
    MOST_COLUMNS = 160, /* of a line at NORMAL */
    MOST_LINES = 10     /* of a tile at NORMAL */
};

static double read_clock(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double rx_seconds(void)
{
    return read_clock(CLOCK_MONOTONIC);
}

rx_lap rx_lap_now(void)
{
    return (rx_lap){rx_seconds(), read_clock(CLOCK_PROCESS_CPUTIME_ID)};
}

void rx_lap_add(rx_lap *last, rx_lap *part)
{
    const rx_lap now = rx_lap_now();
    if (part != NULL) {
        part->wall += now.wall - last->wall;
        part->cpu += now.cpu - last->cpu;
    }
    *last = now;
}

void rx_log_init(rx_log *log, const char *program, FILE *stream, rx_verbosity level)
{
    *log = (rx_log){.stream = stream, .program = program, .level = level};
    log->terminal = isatty(fileno(stream)) == 1;
}

void rx_log_calls(rx_log *log, rx_verbosity level,
                  void (*message)(void *user, rx_log_kind kind, const char *text),
                  void (*progress)(void *user, const char *what, double done), void *user)
{
    *log = (rx_log){.level = level, .message = message, .progress = progress, .user = user};
}

/* A message in as many lines as it takes; their number. To no stream it is only counted. */
static int fold(const rx_log *log, FILE *stream, const char *kind, const char *line)
{
    /* At FULL all of it is in one line. */
    const char *rest = line, *indent = "";
    int lines = 1;
    const size_t lead = strlen(log->program) + 2;
    while (log->level == RX_NORMAL && lead + strlen(kind) + strlen(indent) + strlen(rest) > MOST_COLUMNS) {
        const size_t room = MOST_COLUMNS - lead - strlen(kind) - strlen(indent);
        size_t cut = room;
        while (cut > 0 && rest[cut] != ' ')
            cut--;
        if (cut == 0) /* a name without blanks stays whole */
            cut = room + strcspn(rest + room, " ");
        if (stream != NULL)
            fprintf(stream, "%s: %s%s%.*s\n", log->program, kind, indent, (int)cut, rest);
        rest += cut + strspn(rest + cut, " ");
        kind = "", indent = "    ";
        if (*rest == '\0')
            return lines;
        lines++;
    }
    if (stream != NULL)
        fprintf(stream, "%s: %s%s%s\n", log->program, kind, indent, rest);
    return lines;
}

static void print(rx_log *log, const char *kind, const char *line)
{
    if (log->line_open) {
        fputs("\r\033[K", log->stream);
        log->line_open = false;
    }
    log->lines += fold(log, log->stream, kind, line);
}

/* rank: of information, "0" or "1", or NULL of what does not wait. */
static void say(rx_log *log, const char *rank, rx_log_kind kind, const char *format, va_list args)
{
    const bool kept = kind == RX_LOG_WARNING && log->warnings != NULL;
    if (log->stream == NULL && log->message == NULL && !kept)
        return;
    char fitting[2048], *line = fitting, *longer = NULL;
    va_list again;
    va_copy(again, args);
    const int length = vsnprintf(fitting, sizeof fitting, format, args);
    if (length >= (int)sizeof fitting && (longer = RX_NEW(char, (size_t)length + 1)) != NULL) {
        vsnprintf(longer, (size_t)length + 1, format, again);
        line = longer;
    }
    va_end(again);
    rx_text_tame(line);
    if (kept)
        rx_text_add_bytes(log->warnings, line, strlen(line) + 1);
    const bool quiet = log->level == RX_QUIET;
    if (log->message != NULL && !quiet)
        log->message(log->user, kind, line);
    if (log->message != NULL || log->stream == NULL || quiet) {
        free(longer);
        return;
    }
    if (rank != NULL && rx_log_is_short(log)) {
        rx_text_add(&log->waiting, rank);
        rx_text_add_bytes(&log->waiting, line, strlen(line) + 1);
    }
    if (rank == NULL || !rx_log_is_short(log) || log->waiting.failed)
        print(log, kind == RX_LOG_WARNING ? "warning: " : "", line);
    free(longer);
}

#define SAY(LEVEL, RANK, KIND)                                                                               \
    do {                                                                                                     \
        va_list args;                                                                                        \
        if (log == NULL || log->level < (LEVEL))                                                             \
            return;                                                                                          \
        va_start(args, format);                                                                              \
        say(log, RANK, KIND, format, args);                                                                  \
        va_end(args);                                                                                        \
    } while (0)

void rx_log_info(rx_log *log, const char *format, ...)
{
    SAY(RX_NORMAL, "1", RX_LOG_INFO);
}

void rx_log_hint(rx_log *log, const char *format, ...)
{
    SAY(RX_NORMAL, "0", RX_LOG_INFO);
}

void rx_log_detail(rx_log *log, const char *format, ...)
{
    SAY(RX_FULL, NULL, RX_LOG_DETAIL);
}

void rx_log_warning(rx_log *log, const char *format, ...)
{
    SAY(log->warnings != NULL ? RX_QUIET : RX_NORMAL, NULL, RX_LOG_WARNING);
}

bool rx_log_is_short(const rx_log *log)
{
    return log != NULL && log->message == NULL && log->in_tile && log->level == RX_NORMAL;
}

void rx_log_tile_begin(rx_log *log)
{
    if (log != NULL)
        log->in_tile = true;
}

/* One message of the tile that waits. */
typedef struct waiting {
    char *line; /* NULL: left out, or within the one before */
    bool hint;
    int lines;
} waiting;

/* What the messages take now. */
static int count_lines(const rx_log *log, waiting *of, int n)
{
    int lines = 0;
    for (int i = 0; i < n; i++) {
        of[i].lines = of[i].line != NULL ? fold(log, NULL, "", of[i].line) : 0;
        lines += of[i].lines;
    }
    return lines;
}

/* "tile.fits[0]: ", which messages of one image begin with. */
static size_t image_length(const char *line)
{
    const char *end = strstr(line, "]: ");
    return end != NULL ? (size_t)(end - line) + 3 : 0;
}

/* Neighbours of one image become one message, where it would not be too long for the lines that are left; the line of
 * the second moves to the left within the text of all. What may be left out first stays by itself. */
static void join(waiting *of, int n, int room)
{
    waiting *before = NULL;
    for (int i = 0; i < n; i++) {
        const size_t length = image_length(of[i].line);
        if (before == NULL || length == 0 || strncmp(before->line, of[i].line, length) != 0 ||
            before->hint != of[i].hint ||
            strlen(before->line) + strlen(of[i].line) > (size_t)(room * MOST_COLUMNS)) {
            before = &of[i];
            continue;
        }
        char *to = before->line + strlen(before->line);
        memcpy(to, "; ", 2);
        memmove(to + 2, of[i].line + length, strlen(of[i].line + length) + 1);
        of[i].line = NULL;
    }
}

/* Hints first, then the first messages, until `room` lines hold the others. The number of lines that are left out. */
static int leave_out(waiting *of, int n, int lines, int room)
{
    int gone = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < n && lines - gone > room; i++)
            if (of[i].line != NULL && (of[i].hint || pass == 1)) {
                of[i].line = NULL;
                gone += of[i].lines;
            }
    return gone;
}

/* What waits, in `room` lines at most; but the last message, the result, always has its line. */
static void print_waiting(rx_log *log, int room)
{
    const int most = room > 2 ? room - 1 : 1; /* and one for what is left out */
    const size_t length = log->waiting.length;
    int n = 0, gone = 0;
    for (size_t i = 0; i < length; i++)
        n += log->waiting.data[i] == '\0';
    waiting *of = n > 0 ? RX_NEW(waiting, (size_t)n) : NULL;
    char *line = log->waiting.data;
    for (int i = 0; i < n; i++, line += strlen(line) + 1) {
        if (of == NULL) /* no memory: all of it */
            print(log, "", line + 1);
        else
            of[i] = (waiting){.line = line + 1, .hint = *line == '0'};
    }
    if (of == NULL)
        return;
    if (count_lines(log, of, n) > room)
        join(of, n, most);
    const int lines = count_lines(log, of, n);
    if (lines > room)
        gone = leave_out(of, n, lines, most);
    for (int i = 0; i < n; i++)
        if (of[i].line != NULL)
            print(log, "", of[i].line);
    char note[96];
    snprintf(note, sizeof note, "%d more line%s of information with VERBOSE_TYPE FULL", gone,
             gone > 1 ? "s" : "");
    if (gone > 0 && room > 1)
        print(log, "", note);
    free(of);
}

/* "written: ..." in `room` lines: where the names are too many, their number stands for the last of them. */
static void shorten(const rx_log *log, rx_text *line, int room)
{
    int more = 0;
    rx_text all = {0};
    rx_text_add(&all, line->data);
    while (!all.failed && !line->failed && fold(log, NULL, "", line->data) > room) {
        char *comma = NULL;
        for (char *at = all.data; (at = strstr(at, ", ")) != NULL; at++)
            comma = at;
        if (comma == NULL)
            break;
        *comma = '\0';
        line->length = 0;
        rx_text_printf(line, "%s and %d more", all.data, ++more);
    }
    rx_text_free(&all);
}

/* The lines of the tile that wait, and its last. */
static void finish_tile(rx_log *log, int to_come)
{
    rx_text last = {0};
    int room = MOST_LINES - log->lines - to_come, lines = 0;
    if (log->written)
        rx_text_printf(&last, "written: %s", log->names.length > 0 ? log->names.data : "nothing");
    if (log->written && !last.failed) {
        rx_text_tame(last.data);
        const int others = log->waiting.length == 0 ? 0 : 4;
        if (rx_log_is_short(log))
            shorten(log, &last, room - others > 1 ? room - others : 1);
        lines = fold(log, NULL, "", last.data);
    }
    print_waiting(log, room - lines);
    if (lines > 0)
        print(log, "", last.data);
    rx_text_free(&last);
    rx_text_free(&log->names);
    rx_text_free(&log->waiting);
    log->written = false;
    log->lines = 0;
}

void rx_log_tile_next(rx_log *log)
{
    if (log != NULL && log->in_tile)
        finish_tile(log, 0);
}

void rx_log_tile_end(rx_log *log, int to_come)
{
    if (log == NULL || !log->in_tile)
        return;
    finish_tile(log, to_come);
    log->in_tile = false;
}

void rx_log_written(rx_log *log, const char *names)
{
    if (log == NULL || log->level < RX_NORMAL || (log->stream == NULL && log->message == NULL))
        return;
    if (!log->in_tile || log->message != NULL) {
        rx_log_info(log, "written: %s", names[0] != '\0' ? names : "nothing");
        return;
    }
    log->written = true;
    if (names[0] != '\0')
        rx_text_printf(&log->names, "%s%s", log->names.length > 0 ? ", " : "", names);
}

const char *rx_time_left(double seconds, char dst[RX_TIME_LEFT])
{
    if (seconds >= 3600)
        snprintf(dst, RX_TIME_LEFT, "%.0fh%02.0fm", floor(seconds / 3600), floor(fmod(seconds, 3600) / 60));
    else if (seconds >= 120)
        snprintf(dst, RX_TIME_LEFT, "%.0f min", seconds / 60);
    else
        snprintf(dst, RX_TIME_LEFT, "%.0f s", seconds);
    return dst;
}

/* The line that is overwritten by the next one. */
static void show_line(rx_log *log, const char *what)
{
    fprintf(log->stream, "\r\033[K%s: %s", log->program, what);
    fflush(log->stream);
    log->shown = rx_seconds();
    log->line_open = true;
}

static bool shows_progress(const rx_log *log)
{
    return log != NULL && log->progress == NULL && log->terminal && log->level >= RX_NORMAL;
}

void rx_log_step(rx_log *log, const char *what)
{
    if (shows_progress(log))
        show_line(log, what);
}

void rx_log_progress_begin(rx_log *log)
{
    if (log != NULL)
        log->begun = log->shown = rx_seconds();
}

void rx_log_progress(rx_log *log, const char *what, double done)
{
    if (log != NULL && log->progress != NULL) {
        const double share = log->from + ((log->to > 0.0 ? log->to : 1.0) - log->from) * done;
        log->reached = share > log->reached ? share : log->reached;
        log->progress(log->user, what, log->reached);
    }
    if (!shows_progress(log))
        return;
    double now = rx_seconds();
    if (now - log->begun < SHOW_AFTER_SECONDS || now - log->shown < 0.2)
        return;
    char line[256], left[RX_TIME_LEFT];
    snprintf(line, sizeof line, "%s %3.0f %%, %s left", what, 100.0 * done,
             rx_time_left(done > 0.0 ? (now - log->begun) * (1.0 - done) / done : 0.0, left));
    show_line(log, line);
}

void rx_log_part(rx_log *log, const char *what, double from, double to)
{
    if (from < 1.0)
        rx_log_step(log, what);
    if (log == NULL || log->progress == NULL)
        return;
    log->from = from;
    log->to = to;
    log->reached = from > 0.0 && log->reached > from ? log->reached : from;
    log->progress(log->user, what, log->reached);
}

void rx_log_progress_end(rx_log *log)
{
    if (log != NULL && log->line_open) {
        fputs("\r\033[K", log->stream);
        fflush(log->stream);
        log->line_open = false;
    }
}
