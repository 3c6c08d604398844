/* Status codes and the error object.
 *
 * Every function that can fail returns an rx_status and, as its last argument,
 * takes an rx_error owned by the caller (NULL when the text is not wanted).
 * Library code never prints and never exits; only src/programs/ does.
 * A status is also the exit code of the programs (man page, EXIT STATUS).
 */
#ifndef RX_BASE_ERROR_H
#define RX_BASE_ERROR_H

#include <stdbool.h>
#include <stddef.h>

#include "base/extern.h"

RX_BEGIN_DECLS

typedef enum rx_status {
    RX_OK = 0,
    RX_USAGE = 2,             /* command line or configuration files */
    RX_INPUT = 3,             /* data given by the user cannot be used */
    RX_SYSTEM = 4,            /* memory, disk, permissions, missing programs */
    RX_GATE_FAIL = 5,         /* a quality gate is violated */
    RX_GATE_INSUFFICIENT = 6, /* too few sources to decide a quality gate */
    RX_INTERRUPTED = 7,       /* by a signal (base/interrupt.h) or the caller's stop; work is unwound */
    RX_SOME_FAILED = 8,       /* of a list of tiles, not all are done */
    RX_DIFFERENT = 9,         /* a run that was repeated gave something else */
    RX_NOT_RESTORED = 10      /* the tile is not for the restorer asked for, and no other may do it */
} rx_status;

enum { RX_ERROR_WHERE = 1024, RX_ERROR_TEXT = 768 };

typedef struct rx_error {
    rx_status status;
    char where[RX_ERROR_WHERE]; /* file name, "" when no file is concerned */
    int hdu;                    /* HDU number as cfitsio counts in [n] (0 = primary); -1 none */
    long line;                  /* line in a text file, from 1; 0 none */
    char text[RX_ERROR_TEXT];   /* what is wrong, then what to do */
    /* The caller's way to end a call early; set before it, kept by everything below. Long loops ask now and then, in
     * the thread that made the call, and more than once after the first true: the call then unwinds and returns
     * RX_INTERRUPTED. NULL: never. */
    bool (*stop)(void *user);
    void *user; /* what stop is given */
} rx_error;

/* An error object that says nothing and never stops; use it to initialise. */
#ifdef __cplusplus
#define RX_ERROR_NONE (rx_error{RX_OK, "", -1, 0, "", NULL, NULL})
#else
#define RX_ERROR_NONE ((rx_error){.status = RX_OK, .hdu = -1})
#endif

/* One for a part of a call, whose error may be thrown away or replaced: says nothing, and stops as `err` (may be NULL)
 * does. In a parallel region only thread 0 may ask the caller: the others take rx_error_part(NULL). */
rx_error rx_error_part(const rx_error *err);

/* What the part says becomes what err (may be NULL) says, which keeps its own stop; returns part->status. */
rx_status rx_error_take(rx_error *err, const rx_error *part);

/* Fill err (may be NULL) and return status, so that a function can end with
 * `return rx_error_set(err, RX_INPUT, "...")`. Text: one line, no full stop. */
#if defined(__GNUC__)
#define RX_PRINTF(f, a) __attribute__((format(printf, f, a)))
#else
#define RX_PRINTF(f, a)
#endif
rx_status rx_error_set(rx_error *err, rx_status status, const char *format, ...) RX_PRINTF(3, 4);
rx_status rx_error_at(rx_error *err, rx_status status, const char *file, int hdu, long line,
                      const char *format, ...) RX_PRINTF(6, 7);

/* An error that names no file is of this one; returns status. */
rx_status rx_error_where(rx_error *err, rx_status status, const char *file, int hdu, long line);

/* The system refused what was tried with an input file, by errno: "what: reason". RX_INPUT; RX_SYSTEM where it is
 * memory or descriptors that are missing, which another try may have. */
rx_status rx_error_file(rx_error *err, const char *file, const char *what);

/* Out of memory while asking for `bytes` (0 when unknown); returns RX_SYSTEM. */
rx_status rx_error_memory(rx_error *err, size_t bytes);

/* "program: file[hdu]:line: text" in one line into dst, made harmless by
 * rx_text_tame(). */
void rx_error_format(const rx_error *err, const char *program, char *dst, size_t size);

/* Bytes of the UTF-8 character at s; 0 when none stands there (overlong, a surrogate, cut off, the end) or a
 * control character does: C0, DEL and C1, which terminals act on in their two-byte form as well. */
int rx_text_utf8(const char *s);

/* What rx_text_utf8() does not know becomes '?', byte by byte and in place: names and header values from
 * outside must not drive a terminal, nor make two lines of one. */
void rx_text_tame(char *line);

/* What goes wrong in a call is forwarded: returned at once, or, where something must be freed, by the label `exit`
 * with `status` set. */
#define RX_TRY(call)                                                                                         \
    do {                                                                                                     \
        const rx_status rx_tried = (call);                                                                   \
        if (rx_tried != RX_OK)                                                                               \
            return rx_tried;                                                                                 \
    } while (0)
#define RX_TRY_EXIT(call)                                                                                    \
    do {                                                                                                     \
        if ((status = (call)) != RX_OK)                                                                      \
            goto exit;                                                                                       \
    } while (0)

RX_END_DECLS

#endif
