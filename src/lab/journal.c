/* The journal of a campaign. */
#include "lab/journal.h"

#include <errno.h>
#include <fcntl.h>
#include <float.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "io/folders.h"

static const char MAGIC[] = "rextract-validate journal 3\n";

struct rx_journal {
    int file;
    char *path;
    off_t size;                /* of what is whole */
    char digest[RX_HASH_TEXT]; /* of the header */
};

void rx_journal_digest(const char *header, const char *bytes, size_t n, char dst[RX_HASH_TEXT])
{
    rx_hash sum;
    rx_hash_begin(&sum);
    rx_hash_add(&sum, header, strlen(header));
    rx_hash_add(&sum, bytes, n);
    rx_hash_text(&sum, dst);
}

void rx_unit_values_free(long nunits, rx_unit_values *values)
{
    for (long u = 0; values != NULL && u < nunits; u++)
        free(values[u].v);
    free(values);
}

/* --- header --- */

void rx_journal_fact(rx_text *facts, const char *name, const char *value)
{
    rx_text_printf(facts, "= %s ", name);
    for (const char *c = value; *c != '\0'; c++)
        rx_text_add_bytes(facts, *c == '\n' || *c == '\r' ? " " : c, 1);
    rx_text_add(facts, "\n");
}

/* Names the setting that differs. */
static rx_status other_settings(const char *path, const char *old, const char *now, rx_error *err)
{
    static const char advice[] =
        "give the old settings, or another JOURNAL_NAME for the new ones, or delete the journal";
    for (const char *line = now; *line == '='; line += strcspn(line, "\n") + 1) {
        const int n = (int)strcspn(line + 2, " \n") + 3; /* "= NAME " */
        const int length = (int)strcspn(line + n, "\n"), shown = length > 80 ? 80 : length;
        const char *was = old;
        while (*was != '\0' && strncmp(was, line, (size_t)n) != 0) {
            was += strcspn(was, "\n");
            was += *was == '\n';
        }
        if (*was == '\0')
            return rx_error_at(err, RX_USAGE, path, -1, 0, "was begun without %.*s, which is now %.*s; %s",
                               n - 3, line + 2, shown, line + n, advice);
        const int before = (int)strcspn(was + n, "\n");
        if (before != length || strncmp(was, line, (size_t)(n + length)) != 0)
            return rx_error_at(err, RX_USAGE, path, -1, 0, "was begun with %.*s %.*s, now it is %.*s; %s",
                               n - 3, line + 2, before > 80 ? 80 : before, was + n, shown, line + n, advice);
    }
    return rx_error_at(err, RX_USAGE, path, -1, 0, "belongs to a campaign of other settings; %s", advice);
}

/* RX_OK with *used = length of the header, or 0 when the file is empty or holds the beginning of a header of ours. */
static rx_status check_header(const char *path, const char *text, size_t length, const rx_text *header,
                              size_t *used, rx_error *err)
{
    *used = 0;
    if (length >= header->length && memcmp(text, header->data, header->length) == 0) {
        *used = header->length;
        return RX_OK;
    }
    if (length < header->length && memcmp(text, header->data, length) == 0)
        return RX_OK;
    const size_t magic = sizeof MAGIC - 1;
    if (length < magic || memcmp(text, MAGIC, magic) != 0)
        return rx_error_at(err, RX_USAGE, path, -1, 0,
                           "is no journal of this version of rextract-validate and is left alone; give "
                           "another JOURNAL_NAME");
    return other_settings(path, text + magic, header->data + magic, err);
}

/* --- lines of units --- */

/* What is read. */
typedef struct reading {
    const char *path;
    const rx_text *header;
    const char *digest; /* of the header */
    long nunits;
    rx_unit_values *values; /* [nunits] */
} reading;

static void add_number(rx_text *dst, double value)
{
    char text[40];
    const int is_float = fabs(value) <= FLT_MAX && (double)(float)value == value;
    snprintf(text, sizeof text, "%.9g", value);
    if (isnan(value))
        strcpy(text, "nan"); /* never "-nan": the sign says nothing */
    else if (strtod(text, NULL) != value && is_float)
        strcat(text, "f"); /* nine digits name a float, not a double */
    else if (strtod(text, NULL) != value)
        snprintf(text, sizeof text, "%.17g", value);
    rx_text_printf(dst, " %s", text);
}

static void make_line(const char *header, long unit, const rx_unit_values *values, rx_text *dst)
{
    rx_text_printf(dst, "%ld %ld", unit, values->n);
    for (long i = 0; i < values->n; i++)
        add_number(dst, values->v[i]);
    if (dst->failed)
        return;
    char digest[RX_HASH_TEXT];
    rx_journal_digest(header, dst->data, dst->length, digest);
    rx_text_printf(dst, " %s\n", digest);
}

/* One line without its end: RX_OK with the values, RX_INPUT when it is not whole (err untouched), RX_SYSTEM.
 */
static rx_status parse_line(const char *header, char *line, size_t length, long nunits, long *unit,
                            rx_unit_values *dst, rx_error *err)
{
    if (length <= RX_HASH_TEXT || line[length - RX_HASH_TEXT] != ' ' || strlen(line) != length)
        return RX_INPUT;
    const size_t content = length - RX_HASH_TEXT; /* before the blank and the digits */
    char *end, digest[RX_HASH_TEXT];
    rx_journal_digest(header, line, content, digest);
    if (strcmp(digest, line + content + 1) != 0)
        return RX_INPUT;
    line[content] = '\0';
    *unit = strtol(line, &end, 10);
    const long n = strtol(end, &end, 10);
    if (*unit < 0 || *unit >= nunits || n < 0 || (size_t)n > length)
        return RX_INPUT;
    dst->n = n;
    RX_TRY(RX_MAKE(dst->v, (size_t)n + 1, err));
    for (long i = 0; i < n; i++) {
        char *number = end;
        dst->v[i] = strtod(number, &end);
        if (*end == 'f') {
            dst->v[i] = (float)dst->v[i];
            end++;
        }
        if (end == number) {
            free(dst->v);
            return RX_INPUT;
        }
    }
    return RX_OK;
}

/* Put a line's values in place; a unit may be there twice, with the same values. */
static rx_status keep(const reading *r, long number, long unit, rx_unit_values *found, rx_error *err)
{
    if (r->values[unit].v == NULL) {
        r->values[unit] = *found;
        return RX_OK;
    }
    const rx_unit_values *old = &r->values[unit];
    int same = old->n == found->n;
    for (long i = 0; i < found->n && same; i++)
        same = old->v[i] == found->v[i] || (isnan(old->v[i]) && isnan(found->v[i]));
    free(found->v);
    return same
               ? RX_OK
               : rx_error_at(err, RX_INPUT, r->path, -1, number,
                             "has other values for unit %ld than another line or journal; delete one of them",
                             unit);
}

/* All lines from `text` on, line `number` of the file; *whole = bytes up to the end of the last good line. */
static rx_status parse_lines(const reading *r, char *text, long number, size_t *whole, rx_error *err)
{
    const char *begin = text;
    long bad = 0;
    *whole = 0;
    for (char *end; (end = strchr(text, '\n')) != NULL; text = end + 1, number++) {
        *end = '\0';
        long unit = 0;
        rx_unit_values found = {0};
        const rx_status status =
            parse_line(r->digest, text, (size_t)(end - text), r->nunits, &unit, &found, err);
        if (status == RX_SYSTEM)
            return status;
        if (status != RX_OK) {
            bad = bad > 0 ? bad : number;
            continue;
        }
        if (bad > 0) {
            free(found.v);
            return rx_error_at(
                err, RX_INPUT, r->path, -1, bad,
                "is damaged, and whole lines follow; delete this line, its unit is done again");
        }
        RX_TRY(keep(r, number, unit, &found, err));
        *whole = (size_t)(end + 1 - begin);
    }
    return RX_OK;
}

/* --- files --- */

static rx_status cannot(const char *path, const char *what, rx_error *err)
{
    return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be %s: %s", what, strerror(errno));
}

/* The whole file; NUL bytes (blocks that never reached the disk) become '?', which no line holds. */
static rx_status read_all(int file, const char *path, char **text, size_t *length, rx_error *err)
{
    struct stat info;
    if (fstat(file, &info) != 0)
        return cannot(path, "read", err);
    const size_t size = (size_t)info.st_size;
    char *data = NULL;
    RX_TRY(RX_MAKE(data, size + 1, err));
    size_t got = 0;
    for (ssize_t n; got < size; got += (size_t)n)
        if ((n = pread(file, data + got, size - got, (off_t)got)) <= 0) {
            free(data);
            return cannot(path, "read", err);
        }
    for (size_t i = 0; i < size; i++)
        if (data[i] == '\0')
            data[i] = '?';
    *text = data;
    *length = size;
    return RX_OK;
}

/* Read an open journal: *whole = bytes that are good, 0 when even the header is to be written. */
static rx_status load(const reading *r, int file, size_t *whole, rx_error *err)
{
    char *text = NULL;
    size_t length = 0, lines = 0;
    long number = 1;
    rx_status status;
    RX_TRY_EXIT(read_all(file, r->path, &text, &length, err));
    RX_TRY_EXIT(check_header(r->path, text, length, r->header, whole, err));
    for (size_t i = 0; i < *whole; i++)
        number += text[i] == '\n';
    if (*whole > 0)
        status = parse_lines(r, text + *whole, number, &lines, err);
    *whole += lines;
exit:
    free(text);
    return status;
}

/* Everything or nothing. */
static rx_status append(rx_journal *journal, const char *text, size_t length, rx_error *err)
{
    size_t done = 0;
    while (done < length) {
        ssize_t n = pwrite(journal->file, text + done, length - done, journal->size + (off_t)done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            break;
        done += (size_t)n;
    }
    if (done < length || fdatasync(journal->file) != 0) {
        rx_status status = cannot(journal->path, "written", err);
        if (ftruncate(journal->file, journal->size) != 0) {
            /* the incomplete line is cut off when the journal is opened again */
        }
        return status;
    }
    journal->size += (off_t)length;
    return RX_OK;
}

/* For appending: locked, and what is not whole cut off. */
static rx_status prepare(rx_journal *journal, const reading *r, rx_error *err)
{
    size_t whole = 0;
    if (flock(journal->file, LOCK_EX | LOCK_NB) != 0)
        return errno != EWOULDBLOCK ? cannot(r->path, "locked", err)
                                    : rx_error_at(err, RX_SYSTEM, r->path, -1, 0,
                                                  "is in use by another rextract-validate; wait for it, or "
                                                  "divide the work with SHARD");
    RX_TRY(load(r, journal->file, &whole, err));
    journal->size = (off_t)whole;
    if (ftruncate(journal->file, journal->size) != 0)
        return cannot(r->path, "written", err);
    return whole > 0 ? RX_OK : append(journal, r->header->data, r->header->length, err);
}

rx_status rx_journal_open(const char *path, const rx_text *facts, long nunits, rx_unit_values *values,
                          rx_journal **dst, rx_error *err)
{
    rx_text header = {0};
    rx_folders made = {0};
    rx_journal *journal = NULL;
    struct stat info;
    size_t whole = 0;
    rx_status status;
    RX_TRY(RX_MAKE(journal, 1, err));
    journal->file = -1;
    journal->path = rx_strdup(path);
    if (journal->path == NULL)
        RX_TRY_EXIT(rx_error_memory(err, strlen(path)));
    rx_text_add(&header, MAGIC);
    rx_text_add(&header, facts->data != NULL ? facts->data : "");
    if (!header.failed)
        rx_journal_digest("", header.data, header.length, journal->digest);
    rx_text_printf(&header, "* %s\n", journal->digest);
    if (facts->failed || header.failed)
        RX_TRY_EXIT(rx_error_memory(err, header.length));
    const reading r = {path, &header, journal->digest, nunits, values};
    if (dst != NULL) {
        RX_TRY_EXIT(rx_name_trusted(path, err));
        RX_TRY_EXIT(rx_folders_make(&made, path, path, err));
    }
    journal->file = open(path, (dst != NULL ? O_RDWR | O_CREAT : O_RDONLY) | O_NONBLOCK | O_CLOEXEC, 0666);
    if (journal->file < 0 && dst == NULL && errno == ENOENT)
        goto exit; /* status is RX_OK */
    if (journal->file < 0)
        RX_TRY_EXIT(cannot(path, "opened", err));
    if (fstat(journal->file, &info) != 0 ||
        !S_ISREG(info.st_mode)) /* a FIFO would wait for what no process writes */
        RX_TRY_EXIT(
            rx_error_at(err, RX_USAGE, path, -1, 0, "is no regular file; give JOURNAL_NAME the name of one"));
    status = dst != NULL ? prepare(journal, &r, err) : load(&r, journal->file, &whole, err);
exit:
    rx_text_free(&header);
    rx_folders_free(&made);
    if (dst != NULL && status == RX_OK)
        *dst = journal;
    else
        rx_journal_close(journal);
    return status;
}

rx_status rx_journal_append(rx_journal *journal, long unit, const rx_unit_values *values, rx_error *err)
{
    rx_text line = {0};
    make_line(journal->digest, unit, values, &line);
    rx_status status =
        line.failed ? rx_error_memory(err, line.length) : append(journal, line.data, line.length, err);
    rx_text_free(&line);
    return status;
}

void rx_journal_close(rx_journal *journal)
{
    if (journal == NULL)
        return;
    if (journal->file >= 0)
        close(journal->file);
    free(journal->path);
    free(journal);
}
