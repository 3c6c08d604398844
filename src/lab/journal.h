/* The journal of a campaign: what was done, a line per unit of work, written as the units finish.
 *
 *   rextract-validate journal 3
 *   = NAME value                            everything that decides the results, a line each
 *   * digest                                base/hash.h, over the lines above: the header is complete
 *   unit n v1 v2 ... vn digest              numbers as text that reads back exactly; 0.1f is a float
 *
 * The digest of a unit's line covers the header's too, so that lines of another campaign are no lines of
 * this one. A line is appended by one write and synced to the disk. What kill -9 or a power failure leave of
 * the last lines is cut off when the journal is opened again. One process at a time may append (flock). */
#ifndef RX_LAB_JOURNAL_H
#define RX_LAB_JOURNAL_H

#include "base/error.h"
#include "base/hash.h"
#include "base/text.h"

/* What one unit of work has measured; v NULL = not done. */
typedef struct rx_unit_values {
    long n;
    double *v; /* owned */
} rx_unit_values;
void rx_unit_values_free(long nunits, rx_unit_values *values); /* with the array */

/* A line of the header; line ends in the value become blanks. */
void rx_journal_fact(rx_text *facts, const char *name, const char *value);

/* Of a line, without the blank and the digest behind it; header: the digest of the header, "" for its own. */
void rx_journal_digest(const char *header, const char *bytes, size_t n, char dst[RX_HASH_TEXT]);

typedef struct rx_journal rx_journal;

/* Open or begin the journal with that header for appending, and read what is in it into values[nunits]: units that are
 * done already must have the same values. dst NULL: only read, nothing is locked, made or changed, and a journal that is
 * not there is an empty one. Errors: RX_USAGE (a file that is no journal, or one of other settings: what differs is said),
 * RX_INPUT (damaged before its end; a unit with other values), RX_SYSTEM (locked by another process,
 * cannot be written, memory). */
rx_status rx_journal_open(const char *path, const rx_text *facts, long nunits, rx_unit_values *values,
                          rx_journal **dst, rx_error *err);

/* Append the values of a unit. Errors: RX_SYSTEM; the journal then ends with the line before. */
rx_status rx_journal_append(rx_journal *journal, long unit, const rx_unit_values *values, rx_error *err);
void rx_journal_close(rx_journal *journal); /* NULL is fine */

#endif
