/* Lines of a file. */
#include "base/lines.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "base/input.h"
#include "base/interrupt.h"
#include "base/memory.h"
#include "base/text.h"

enum { BLOCK = 1 << 16, LONGEST_LINE = 1 << 24 };

rx_status rx_lines_open(rx_lines *lines, const char *path, int64_t from, rx_error *err)
{
    *lines = (rx_lines){.path = path, .following = from};
    lines->file = rx_input_open(path);
    if (lines->file == NULL && errno == EISDIR)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "is a folder, a text file was expected");
    if (lines->file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    if (from > 0 && fseeko(lines->file, (off_t)from, SEEK_SET) != 0)
        return rx_error_file(err, path, "cannot be read");
    return RX_OK;
}

/* A block more, behind what is not given yet. */
static rx_status read_more(rx_lines *lines, rx_error *err)
{
    const size_t left = lines->end - lines->begin;
    if (left > LONGEST_LINE)
        return rx_error_at(err, RX_INPUT, lines->path, -1, lines->number + 1,
                           "is longer than a line of text should be");
    if (left > 0)
        memmove(lines->room, lines->room + lines->begin, left);
    lines->begin = 0;
    lines->end = left;
    if (lines->capacity < left + BLOCK) {
        const size_t capacity = 2 * left + BLOCK;
        char *room = rx_regrow(lines->room, capacity + 1, 1);
        if (room == NULL)
            return rx_error_memory(err, capacity);
        lines->room = room;
        lines->capacity = capacity;
    }
    const size_t n = fread(lines->room + left, 1, BLOCK, lines->file);
    if (ferror(lines->file) && errno == EINTR)
        RX_TRY(rx_interrupt_check(err));
    if (ferror(lines->file))
        return rx_error_file(err, lines->path, "cannot be read");
    if (memchr(lines->room + left, '\0', n) != NULL)
        return rx_error_at(err, RX_INPUT, lines->path, -1, 0, "holds binary data, a text file was expected");
    lines->end += n;
    lines->over = n < BLOCK;
    return RX_OK;
}

rx_status rx_lines_next(rx_lines *lines, char **line, rx_error *err)
{
    char *end = NULL;
    size_t known = 0; /* how much of it holds no end of a line */
    *line = NULL;
    for (;;) {
        const size_t left = lines->end - lines->begin;
        end = left > known ? memchr(lines->room + lines->begin + known, '\n', left - known) : NULL;
        if (end != NULL || lines->over)
            break;
        known = left;
        rx_status status = read_more(lines, err);
        if (status != RX_OK)
            return status;
    }
    if (end == NULL && lines->begin == lines->end)
        return RX_OK;
    *line = lines->room + lines->begin;
    const size_t length = end != NULL ? (size_t)(end - *line) : lines->end - lines->begin;
    (*line)[length] = '\0';
    lines->number++;
    lines->at = lines->following;
    lines->following += (int64_t)length + 1;
    lines->begin += length + (end != NULL);
    if (lines->at == 0 && strncmp(*line, RX_BYTE_ORDER_MARK, 3) == 0)
        *line += 3;
    return RX_OK;
}

void rx_lines_close(rx_lines *lines)
{
    if (lines->file != NULL)
        fclose(lines->file);
    free(lines->room);
    *lines = (rx_lines){0};
}
