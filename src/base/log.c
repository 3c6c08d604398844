/* Messages and the progress line. */
#include "base/log.h"

#include <stdarg.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/text.h"

enum { SHOW_AFTER_SECONDS = 2, MOST_COLUMNS = 160 /* of a line at NORMAL */ };

double rx_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void rx_log_init(rx_log *log, const char *program, FILE *stream, rx_verbosity level)
{
    *log = (rx_log){.stream = stream, .program = program, .level = level};
    log->terminal = isatty(fileno(stream)) == 1;
}

static void say(rx_log *log, const char *kind, const char *format, va_list args)
{
    char line[2048];
    vsnprintf(line, sizeof line, format, args);
    rx_text_tame(line);
    if (log->line_open) {
        fputs("\r\033[K", log->stream);
        log->line_open = false;
    }
    /* Who wants all of it in one line asks for FULL. */
    const char *rest = line, *indent = "";
    const size_t lead = strlen(log->program) + 2;
    while (log->level == RX_NORMAL && lead + strlen(kind) + strlen(indent) + strlen(rest) > MOST_COLUMNS) {
        const size_t room = MOST_COLUMNS - lead - strlen(kind) - strlen(indent);
        size_t cut = room;
        while (cut > 0 && rest[cut] != ' ')
            cut--;
        if (cut == 0) /* a name without blanks stays whole */
            cut = room + strcspn(rest + room, " ");
        fprintf(log->stream, "%s: %s%s%.*s\n", log->program, kind, indent, (int)cut, rest);
        rest += cut + strspn(rest + cut, " ");
        kind = "", indent = "    ";
        if (*rest == '\0')
            return;
    }
    fprintf(log->stream, "%s: %s%s%s\n", log->program, kind, indent, rest);
}

void rx_log_info(rx_log *log, const char *format, ...)
{
    if (log == NULL || log->level < RX_NORMAL)
        return;
    va_list args;
    va_start(args, format);
    say(log, "", format, args);
    va_end(args);
}

void rx_log_detail(rx_log *log, const char *format, ...)
{
    if (log == NULL || log->level < RX_FULL)
        return;
    va_list args;
    va_start(args, format);
    say(log, "", format, args);
    va_end(args);
}

void rx_log_warning(rx_log *log, const char *format, ...)
{
    if (log == NULL || log->level < RX_NORMAL)
        return;
    va_list args;
    va_start(args, format);
    say(log, "warning: ", format, args);
    va_end(args);
}

void rx_log_progress_begin(rx_log *log)
{
    if (log != NULL)
        log->begun = log->shown = rx_seconds();
}

void rx_log_progress(rx_log *log, const char *what, double done)
{
    if (log == NULL || !log->terminal || log->level < RX_NORMAL)
        return;
    double now = rx_seconds();
    if (now - log->begun < SHOW_AFTER_SECONDS || now - log->shown < 0.2)
        return;
    double left = done > 0.0 ? (now - log->begun) * (1.0 - done) / done : 0.0;
    fprintf(log->stream, "\r\033[K%s: %s %3.0f %%, %.0f s left", log->program, what, 100.0 * done, left);
    fflush(log->stream);
    log->shown = now;
    log->line_open = true;
}

void rx_log_progress_end(rx_log *log)
{
    if (log != NULL && log->line_open) {
        fputs("\r\033[K", log->stream);
        fflush(log->stream);
        log->line_open = false;
    }
}
