/* The error object: filling and formatting; lines from outside. */
#include "base/error.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static rx_status fill(rx_error *err, rx_status status, const char *file, int hdu, long line,
                      const char *format, va_list args)
{
    if (err != NULL) {
        err->status = status;
        snprintf(err->where, sizeof err->where, "%s", file != NULL ? file : "");
        err->hdu = hdu;
        err->line = line;
        vsnprintf(err->text, sizeof err->text, format, args);
    }
    return status;
}

rx_status rx_error_set(rx_error *err, rx_status status, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fill(err, status, NULL, -1, 0, format, args);
    va_end(args);
    return status;
}

rx_status rx_error_at(rx_error *err, rx_status status, const char *file, int hdu, long line,
                      const char *format, ...)
{
    va_list args;
    va_start(args, format);
    fill(err, status, file, hdu, line, format, args);
    va_end(args);
    return status;
}

rx_status rx_error_where(rx_error *err, rx_status status, const char *file, int hdu, long line)
{
    if (status != RX_OK && err != NULL && err->where[0] == '\0') {
        snprintf(err->where, sizeof err->where, "%s", file);
        err->hdu = hdu;
        err->line = line;
    }
    return status;
}

rx_error rx_error_part(const rx_error *err)
{
    rx_error part = RX_ERROR_NONE;
    if (err != NULL) {
        part.stop = err->stop;
        part.user = err->user;
    }
    return part;
}

rx_status rx_error_take(rx_error *err, const rx_error *part)
{
    if (err != NULL) {
        bool (*const stop)(void *) = err->stop;
        void *const user = err->user;
        *err = *part;
        err->stop = stop;
        err->user = user;
    }
    return part->status;
}

rx_status rx_error_file(rx_error *err, const char *file, const char *what)
{
    const bool missing = errno == ENOMEM || errno == EMFILE || errno == ENFILE;
    return rx_error_at(err, missing ? RX_SYSTEM : RX_INPUT, file, -1, 0, "%s: %s", what, strerror(errno));
}

rx_status rx_error_memory(rx_error *err, size_t bytes)
{
    if (bytes == 0)
        return rx_error_set(err, RX_SYSTEM, "out of memory; free memory or cut the tile");
    return rx_error_set(err, RX_SYSTEM, "out of memory asking for %zu bytes; free memory or cut the tile",
                        bytes);
}

void rx_error_format(const rx_error *err, const char *program, char *dst, size_t size)
{
    char hdu[24] = "", line[32] = "";
    if (size == 0)
        return;
    if (err->where[0] != '\0' && err->hdu >= 0)
        snprintf(hdu, sizeof hdu, "[%d]", err->hdu);
    if (err->where[0] != '\0' && err->line > 0)
        snprintf(line, sizeof line, ":%ld", err->line);
    if (err->where[0] != '\0')
        snprintf(dst, size, "%s: %s%s%s: %s", program, err->where, hdu, line, err->text);
    else
        snprintf(dst, size, "%s: %s", program, err->text);
    rx_text_tame(dst);
}

int rx_text_utf8(const char *text)
{
    const unsigned char *s = (const unsigned char *)text;
    if (s[0] < 0x80)
        return s[0] >= 0x20 && s[0] != 0x7f;
    int n = s[0] >= 0xc2 && s[0] <= 0xdf   ? 2
            : s[0] >= 0xe0 && s[0] <= 0xef ? 3
            : s[0] >= 0xf0 && s[0] <= 0xf4 ? 4
                                           : 0;
    for (int i = 1; i < n; i++)
        if ((s[i] & 0xc0) != 0x80)
            return 0;
    bool overlong = (s[0] == 0xe0 && s[1] < 0xa0) || (s[0] == 0xf0 && s[1] < 0x90);
    bool outside = (s[0] == 0xed && s[1] > 0x9f) || (s[0] == 0xf4 && s[1] > 0x8f);
    bool control = s[0] == 0xc2 && s[1] < 0xa0;
    return overlong || outside || control ? 0 : n;
}

void rx_text_tame(char *line)
{
    for (char *c = line; *c != '\0';) {
        const int n = rx_text_utf8(c);
        if (n == 0)
            *c = '?';
        c += n > 0 ? n : 1;
    }
}
