/* A string that grows, whole text files, printable text, and the nearest word. */
#ifndef RX_BASE_TEXT_H
#define RX_BASE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "base/error.h"
#include "base/extern.h"

RX_BEGIN_DECLS

typedef struct rx_text {
    char *data; /* always 0-terminated once something was added; NULL before */
    size_t length, capacity;
    bool failed; /* memory ran out: data ends early, check once at the end */
} rx_text;

void rx_text_add(rx_text *dst, const char *text);
void rx_text_add_bytes(rx_text *dst, const char *bytes, size_t length);
void rx_text_printf(rx_text *dst, const char *format, ...) RX_PRINTF(2, 3);
void rx_text_free(rx_text *text);

/* What some editors put before a text in UTF-8. */
#define RX_BYTE_ORDER_MARK "\xef\xbb\xbf"

/* Whole file as a 0-terminated string, at most max_bytes, without a byte order mark; *data to be freed by
 * the caller. Errors: RX_INPUT (missing, a folder, too large, holds NUL bytes). */
rx_status rx_text_read_file(const char *path, size_t max_bytes, char **data, size_t *length, rx_error *err);

/* The text into the file at `path`, which errors call `shown`. Errors: RX_SYSTEM (memory, disk). */
rx_status rx_text_write_file(const rx_text *text, const char *path, const char *shown, rx_error *err);

/* The same piece by piece, for what is larger than memory should be. Close it in any case; `status` is what
 * the pieces have come to, and comes back when it is an error. */
typedef struct rx_text_file {
    const char *shown; /* lent */
    FILE *file;
} rx_text_file;
rx_status rx_text_file_open(rx_text_file *file, const char *path, const char *shown, rx_error *err);
rx_status rx_text_file_add(rx_text_file *file, const rx_text *text, rx_error *err);
rx_status rx_text_file_close(rx_text_file *file, rx_status status, rx_error *err);

/* Ends what is written to a stream; false where it could not be written. A reader that has closed its end of a pipe has
 * read what it wanted (rextract -dd | head): that is no failure. */
bool rx_stream_end(FILE *stream);

/* Appends any text as printable ASCII, which headers of FITS files and catalogues can hold: as in addresses of the web, a
 * byte that is no printable ASCII character, a '%', a blank at either end and an '&' at the end (which means "goes on" in a
 * header) become '%' and two hexadecimal digits. */
void rx_printable_add(rx_text *dst, const char *text);

/* The way back, in place. Returns 0 where a '%' is followed by anything else, or the text would hold a 0
 * byte. */
int rx_printable_read(char *text);

/* The word of `words` (n of them) nearest to `word` by edit distance, case
 * ignored, or NULL when nothing is near: for "did you mean". */
const char *rx_text_nearest(const char *word, const char *const *words, size_t n);

RX_END_DECLS

#endif
