/* A string that grows, whole text files, printable text, and the nearest word. */
#include "base/text.h"

#include <ctype.h>
#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/input.h"
#include "base/interrupt.h"
#include "base/memory.h"

static bool reserve(rx_text *dst, size_t more)
{
    if (dst->failed)
        return false;
    size_t need = dst->length + more + 1;
    if (need <= dst->capacity)
        return true;
    size_t capacity = dst->capacity > 0 ? dst->capacity : 256;
    while (capacity < need)
        capacity *= 2;
    char *data = rx_regrow(dst->data, capacity, 1);
    if (data == NULL) {
        dst->failed = true;
        return false;
    }
    dst->data = data;
    dst->capacity = capacity;
    return true;
}

void rx_text_add_bytes(rx_text *dst, const char *bytes, size_t length)
{
    if (!reserve(dst, length))
        return;
    memcpy(dst->data + dst->length, bytes, length);
    dst->length += length;
    dst->data[dst->length] = '\0';
}

void rx_text_add(rx_text *dst, const char *text)
{
    rx_text_add_bytes(dst, text, strlen(text));
}

/* Into the room there is, and once more where that was too little. */
void rx_text_printf(rx_text *dst, const char *format, ...)
{
    va_list args;
    if (dst->failed)
        return;
    const size_t room = dst->capacity - dst->length;
    va_start(args, format);
    int n = vsnprintf(room > 0 ? dst->data + dst->length : NULL, room, format, args);
    va_end(args);
    if (n >= 0 && (size_t)n < room) {
        dst->length += (size_t)n;
        return;
    }
    if (room > 0)
        dst->data[dst->length] = '\0';
    if (n < 0 || !reserve(dst, (size_t)n))
        return;
    va_start(args, format);
    vsnprintf(dst->data + dst->length, (size_t)n + 1, format, args);
    va_end(args);
    dst->length += (size_t)n;
}

bool rx_stream_end(FILE *stream)
{
    struct pollfd pipe = {.fd = fileno(stream)};
    if (fflush(stream) == 0 && !ferror(stream))
        return true;
    return poll(&pipe, 1, 0) == 1 && (pipe.revents & POLLERR) != 0; /* on a pipe: no one reads */
}

void rx_text_free(rx_text *text)
{
    free(text->data);
    *text = (rx_text){0};
}

rx_status rx_text_read_file(const char *path, size_t max_bytes, char **data, size_t *length, rx_error *err)
{
    rx_status status = RX_OK;
    char *content = NULL;
    FILE *file = rx_input_open(path);
    *data = NULL;
    if (file == NULL && errno == EISDIR)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "is a folder, a text file was expected");
    if (file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    size_t size = 0, capacity = 4096;
    content = malloc(capacity + 1);
    while (content != NULL) {
        size += fread(content + size, 1, capacity - size, file);
        if (size < capacity)
            break;
        if (size > max_bytes)
            break;
        capacity *= 2;
        char *more = rx_regrow(content, capacity + 1, 1);
        if (more == NULL)
            free(content);
        content = more;
    }
    if (content == NULL)
        RX_TRY_EXIT(rx_error_memory(err, capacity));
    if (ferror(file) && errno == EINTR)
        RX_TRY_EXIT(rx_interrupt_check(err));
    if (ferror(file))
        RX_TRY_EXIT(rx_error_file(err, path, "cannot be read"));
    if (size > max_bytes)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0,
                                "is larger than %zu bytes, which no such text file should be", max_bytes));
    if (memchr(content, '\0', size) != NULL)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0, "holds binary data, a text file was expected"));
    content[size] = '\0';
    if (strncmp(content, RX_BYTE_ORDER_MARK, 3) == 0) {
        size -= 3;
        memmove(content, content + 3, size + 1);
    }
    *data = content;
    if (length != NULL)
        *length = size;
    content = NULL;
exit:
    free(content);
    fclose(file);
    return status;
}

/* Levenshtein distance, case ignored, of words up to 63 characters. */
static size_t edit_distance(const char *a, const char *b)
{
    size_t row[64], na = strlen(a), nb = strlen(b);
    if (na > 63 || nb > 63)
        return SIZE_MAX; /* no keyword is that long */
    for (size_t j = 0; j <= nb; j++)
        row[j] = j;
    for (size_t i = 1; i <= na; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= nb; j++) {
            int same = toupper((unsigned char)a[i - 1]) == toupper((unsigned char)b[j - 1]);
            size_t best = diagonal + (same ? 0 : 1);
            diagonal = row[j];
            if (row[j] + 1 < best)
                best = row[j] + 1;
            if (row[j - 1] + 1 < best)
                best = row[j - 1] + 1;
            row[j] = best;
        }
    }
    return row[nb];
}

const char *rx_text_nearest(const char *word, const char *const *words, size_t n)
{
    const char *best = NULL;
    size_t limit = strlen(word) / 3 + 1;
    for (size_t i = 0; i < n; i++) {
        size_t distance = edit_distance(word, words[i]);
        if (distance <= limit) {
            best = words[i];
            if (distance == 0)
                break;
            limit = distance - 1;
        }
    }
    return best;
}

rx_status rx_text_file_open(rx_text_file *file, const char *path, const char *shown, rx_error *err)
{
    *file = (rx_text_file){.shown = shown, .file = fopen(path, "wb")};
    return file->file != NULL
               ? RX_OK
               : rx_error_at(err, RX_SYSTEM, shown, -1, 0, "cannot be made: %s", strerror(errno));
}

rx_status rx_text_file_add(rx_text_file *file, const rx_text *text, rx_error *err)
{
    if (text->failed || text->data == NULL)
        return rx_error_memory(err, 0);
    return fwrite(text->data, 1, text->length, file->file) == text->length
               ? RX_OK
               : rx_error_at(err, RX_SYSTEM, file->shown, -1, 0, "cannot be written: %s", strerror(errno));
}

rx_status rx_text_file_close(rx_text_file *file, rx_status status, rx_error *err)
{
    if (file->file != NULL && fclose(file->file) != 0 && status == RX_OK)
        status = rx_error_at(err, RX_SYSTEM, file->shown, -1, 0, "cannot be written: %s", strerror(errno));
    file->file = NULL;
    return status;
}

rx_status rx_text_write_file(const rx_text *text, const char *path, const char *shown, rx_error *err)
{
    rx_text_file file = {0};
    rx_status status = text->failed || text->data == NULL ? rx_error_memory(err, 0)
                                                          : rx_text_file_open(&file, path, shown, err);
    if (status == RX_OK)
        status = rx_text_file_add(&file, text, err);
    return rx_text_file_close(&file, status, err);
}

void rx_printable_add(rx_text *dst, const char *text)
{
    for (const char *c = text; *c != '\0'; c++) {
        const int at_end = c[1] == '\0', edge = c == text || at_end;
        const int plain =
            *c >= ' ' && *c <= '~' && *c != '%' && !(*c == ' ' && edge) && !(*c == '&' && at_end);
        if (plain)
            rx_text_add_bytes(dst, c, 1);
        else
            rx_text_printf(dst, "%%%02X", (unsigned)(unsigned char)*c);
    }
    rx_text_add(dst, ""); /* never NULL */
}

int rx_printable_read(char *text)
{
    char *to = text;
    for (const char *from = text; *from != '\0'; from++) {
        if (*from != '%') {
            *to++ = *from;
            continue;
        }
        if (!isxdigit((unsigned char)from[1]) || !isxdigit((unsigned char)from[2]))
            return 0;
        const char digits[] = {from[1], from[2], '\0'};
        *to = (char)strtol(digits, NULL, 16);
        if (*to++ == '\0')
            return 0;
        from += 2;
    }
    *to = '\0';
    return 1;
}
