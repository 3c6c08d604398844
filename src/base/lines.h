/* The lines of a text file, one after the other: a file of any size takes the room of its longest line. */
#ifndef RX_BASE_LINES_H
#define RX_BASE_LINES_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "base/error.h"

typedef struct rx_lines {
    const char *path;  /* lent */
    long number;       /* of the line that was given last, from 1 */
    int64_t at;        /* byte of the file where it begins */
    int64_t following; /* and where the next one does */
    FILE *file;
    char *room;
    size_t begin, end, capacity; /* of what is read and not given yet */
    bool over;                   /* nothing more to read */
} rx_lines;

/* From byte `from` on, the line there counts as number 1. Errors: RX_INPUT (missing, a folder). Close it in
 * either case. */
rx_status rx_lines_open(rx_lines *lines, const char *path, int64_t from, rx_error *err);

/* *line without its end (and the first one of a file without a byte order mark), to be changed at will, there
 * until the next one is asked for; NULL after the last.
 * Errors: RX_INPUT (NUL bytes, a line of more than 16 MiB, a disk that fails), RX_SYSTEM. */
rx_status rx_lines_next(rx_lines *lines, char **line, rx_error *err);

void rx_lines_close(rx_lines *lines);

#endif
