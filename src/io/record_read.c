/* The record of a run, read back. */
#include "io/record_read.h"

#include <fitsio2.h> /* ffgbyt() */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/input.h"
#include "base/lines.h"
#include "base/text.h"
#include "io/cards.h"
#include "io/fits_file.h"

/* The records of all parts of a file, one after the other. */
typedef struct reading {
    const char *path;
    rx_record *record;
    int part, nparts; /* where the record of the current part begins, and how many are complete */
    bool found, open, complete;
    rx_hash sum;
} reading;

/* Of several records in one header (that of the tile goes on in check-images) the last one counts, and none that has no
 * end. */
static void drop_part(reading *r)
{
    for (; r->record->n > r->part; r->record->n--)
        for (int k = 0; k < 3; k++)
            free(r->record->pairs[r->record->n - 1][k]);
}

/* A line "NAME = value". */
static rx_status take_line(void *user, const char *line, rx_error *err)
{
    reading *r = user;
    char digest[RX_HASH_TEXT], name[64];
    const size_t length = strcspn(line, " ");
    if (length == 0 || length >= sizeof name || strncmp(line + length, " =", 2) != 0)
        return RX_OK;
    snprintf(name, sizeof name, "%.*s", (int)length, line);
    const char *value = line + length + 2; /* blanks at the end of a header's line may be lost */
    value += *value == ' ';
    if (strcmp(name, "RECORD") == 0) {
        drop_part(r);
        r->found = r->open = true;
        r->complete = false;
        rx_hash_begin(&r->sum);
        if (strncmp(value, RX_RECORD_VERSION, 2) != 0)
            return rx_error_at(
                err, RX_INPUT, r->path, -1, 0,
                "its record is of another kind, '%.40s'; repeat it with the version that wrote it", value);
    }
    if (!r->open)
        return RX_OK;
    if (strcmp(name, "END") == 0) {
        rx_hash_text(&r->sum, digest);
        if (strcmp(digest, value) != 0)
            rx_record_add(r->record, "CHANGED", "", "its record was changed after it was written");
        r->open = false;
        r->complete = true;
        return RX_OK;
    }
    rx_record_digest_line(&r->sum, name, value);
    rx_record_add(r->record, name, "", "%s", value);
    if (r->record->failed)
        return rx_error_memory(err, 0);
    return rx_printable_read(r->record->pairs[r->record->n - 1][1])
               ? RX_OK
               : rx_error_at(err, RX_INPUT, r->path, -1, 0,
                             "its record cannot be read: '%.60s' has a %% without two digits after it",
                             value);
}

/* Its rows or pixels have that digest now. */
static rx_status end_part(reading *r, const char *digest, rx_error *err)
{
    if (!r->complete)
        drop_part(r);
    else if (++r->nparts, !rx_record_has(r->record, r->part, "MADE", digest, RX_HASH_TEXT - 1))
        rx_record_add(r->record, "CHANGED", "",
                      "rows or pixels of part %d were changed after they were written", r->nparts);
    r->part = r->record->n;
    r->open = r->complete = false;
    return r->record->failed ? rx_error_memory(err, 0) : RX_OK;
}

/* The digest of the data of the HDU where it is, as the file has them, without the heap. */
static rx_status digest_data(const rx_fits_source *source, char dst[RX_HASH_TEXT], rx_error *err)
{
    unsigned char room[8192];
    rx_fits_shape shape;
    LONGLONG from = 0, left = 1;
    int failed = 0;
    rx_hash sum;
    RX_TRY(rx_fits_shape_of(source, &shape, err));
    if (!shape.is_image || shape.is_compressed) {
        shape = (rx_fits_shape){.naxis = 2, .bitpix = 8};
        fits_read_key(source->file, TLONGLONG, "NAXIS1", &shape.axes[0], NULL, &failed);
        fits_read_key(source->file, TLONGLONG, "NAXIS2", &shape.axes[1], NULL, &failed);
    }
    if (shape.naxis > 0)
        RX_TRY(rx_fits_check_size(source, &shape, err));
    left = shape.naxis > 0 ? abs(shape.bitpix) / 8 : 0;
    for (int i = 0; i < shape.naxis && i < RX_FITS_AXES; i++)
        left *= shape.axes[i];
    fits_get_hduaddrll(source->file, NULL, &from, NULL, &failed);
    rx_hash_begin(&sum);
    if (left > 0)
        ffmbyt(source->file, from, REPORT_EOF, &failed);
    for (LONGLONG some; left > 0 && !failed; left -= some) {
        some = left < (LONGLONG)sizeof room ? left : (LONGLONG)sizeof room;
        ffgbyt(source->file, some, room, &failed);
        rx_hash_add(&sum, room, failed ? 0 : (size_t)some);
    }
    rx_hash_text(&sum, dst);
    return rx_fits_check(source, RX_INPUT, failed, "cannot be read to its end", err);
}

static rx_status read_hdu(reading *r, const rx_fits_source *source, char version[72], rx_error *err)
{
    char *cards = NULL, digest[RX_HASH_TEXT] = "";
    size_t ncards = 0;
    RX_TRY(rx_fits_read_cards(source, &cards, &ncards, err));
    if (version[0] == '\0')
        rx_cards_text(cards, (long)ncards, "RXVERS", version, 72);
    const rx_status status = rx_cards_history(cards, (long)ncards, take_line, r, err);
    free(cards);
    RX_TRY(status);
    if (r->complete)
        RX_TRY(digest_data(source, digest, err));
    return end_part(r, digest, err);
}

static rx_status read_fits(reading *r, rx_error *err)
{
    rx_fits_source source = {0};
    int n = 0;
    char version[72] = "";
    rx_status status;
    RX_TRY_EXIT(rx_fits_open(r->path, &source, err));
    RX_TRY_EXIT(rx_fits_count(&source, &n, NULL, err));
    for (int hdu = 0; hdu < n; hdu++) {
        RX_TRY_EXIT(rx_fits_goto(&source, hdu, err));
        RX_TRY_EXIT(read_hdu(r, &source, version, err));
    }
    if (r->record->n == 0 && version[0] != '\0')
        status = rx_error_at(
            err, RX_INPUT, r->path, -1, 0,
            "was written by Rextract %.20s without a record of the run; nothing can be repeated", version);
exit:
    rx_fits_done(&source);
    return status;
}

/* Without a record it may be anything, and its other reader says what is wrong with it. */
static rx_status read_text(reading *r, rx_error *err)
{
    rx_lines lines;
    char *line = NULL, digest[RX_HASH_TEXT];
    rx_hash rows;
    rx_error why = rx_error_part(err);
    rx_hash_begin(&rows);
    rx_status status = rx_lines_open(&lines, r->path, 0, &why);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, &why)) == RX_OK && line != NULL)
        if (strncmp(line, "# ", 2) == 0)
            status = take_line(r, line + 2, &why);
        else if (line[0] != '#') {
            rx_hash_add(&rows, line, strlen(line));
            rx_hash_add(&rows, "\n", 1);
        }
    rx_lines_close(&lines);
    rx_hash_text(&rows, digest);
    if (status == RX_OK || !r->found)
        return end_part(r, digest, err);
    rx_error_take(err, &why);
    return status;
}

static rx_status read_all(reading *r, rx_error *err)
{
    static const char *const needed[] = {"VERSION", "MACHINE", "IMAGE", "SET", "OUTPUT", "READ", "MADE"};
    char head[6] = "";
    FILE *file = rx_input_open(r->path);
    const size_t n = file != NULL ? fread(head, 1, sizeof head, file) : 0;
    if (file != NULL)
        fclose(file);
    const bool fits = n == sizeof head && memcmp(head, "SIMPLE", n) == 0;
    r->found = fits || (n == sizeof head && memcmp(head, "<?xml ", n) == 0);
    RX_TRY(fits ? read_fits(r, err) : read_text(r, err));
    if (r->found && r->record->n == 0)
        return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                           "holds no record of a run of rextract; give a FITS catalogue, a check-image or an "
                           "ASCII_HEAD catalogue that it wrote");
    for (size_t i = 0; r->found && i < sizeof needed / sizeof needed[0]; i++)
        if (rx_record_find(r->record, needed[i]) == NULL)
            return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                               "its record lacks the line %s; it was changed after it was written",
                               needed[i]);
    return RX_OK;
}

rx_status rx_record_read(const char *path, rx_record *dst, bool *found, rx_error *err)
{
    reading r = {.path = path, .record = dst};
    struct stat info;
    /* a pipe can be read once */
    const rx_status status = stat(path, &info) == 0 && S_ISREG(info.st_mode) ? read_all(&r, err) : RX_OK;
    *found = r.found;
    return status;
}
