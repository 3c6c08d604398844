/* Reading what an output says of its run. */
#include "survey/replay_record.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/input.h"
#include "base/memory.h"
#include "base/printable.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "io/fits_digest.h"
#include "io/fits_read.h"
#include "stage/provenance.h"

enum { MAX_TEXT_BYTES = 1 << 30 };

/* A record while it is read; the lines of one HDU may hold several, the last of which is its own. */
typedef struct reading {
    const char *path;
    rx_replay_record *record;
    int first;          /* line where the current record begins */
    int open, complete; /* between RECORD and END; one was closed */
    int intact;
    rx_hash sum;
} reading;

static void forget_lines(rx_replay_record *record, int from)
{
    for (int i = from; i < record->n; i++) {
        free(record->lines[i].name);
        free(record->lines[i].value);
    }
    record->n = from < record->n ? from : record->n;
}

/* `printable` is copied and read back. */
static rx_status add_line(reading *r, const char *name, size_t length, const char *printable, rx_error *err)
{
    rx_replay_record *record = r->record;
    RX_TRY(RX_GROW(record->lines, (size_t)record->n + 1, err));
    rx_replay_line *line = &record->lines[record->n++];
    *line = (rx_replay_line){.name = strndup(name, length), .value = rx_strdup(printable)};
    if (line->name == NULL || line->value == NULL)
        return rx_error_memory(err, strlen(printable));
    if (strcmp(line->name, "END") != 0)
        rx_record_digest_line(&r->sum, line->name, printable);
    else
        r->open = 0;
    if (!rx_printable_read(line->value))
        return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                           "its record cannot be read: '%.60s' has a %% without two digits after it",
                           printable);
    return RX_OK;
}

/* "NAME = value" from a header; what stands outside of RECORD and END is none of ours. */
static rx_status take_line(void *user, const char *line, rx_error *err)
{
    reading *r = user;
    char digest[RX_HASH_TEXT];
    const size_t length = strcspn(line, " ");
    if (length == 0 || strncmp(line + length, " =", 2) != 0)
        return RX_OK;
    const char *value = line + length + 2;
    value += *value == ' ';
    if (length == 6 && strncmp(line, "RECORD", 6) == 0) {
        forget_lines(r->record, r->first);
        r->open = 1;
        r->complete = 0;
        rx_hash_begin(&r->sum);
        if (strncmp(value, "1,", 2) != 0)
            return rx_error_at(
                err, RX_INPUT, r->path, -1, 0,
                "its record is of another kind, '%.40s'; repeat it with the version that wrote it", value);
    }
    if (!r->open)
        return RX_OK;
    rx_status status = add_line(r, line, length, value, err);
    if (status == RX_OK && !r->open) {
        r->complete = 1;
        rx_hash_text(&r->sum, digest);
        r->intact = strcmp(digest, value) == 0;
    }
    return status;
}

static rx_status add_part(rx_replay_record *record, const char *digest, rx_error *err)
{
    RX_TRY(RX_GROW(record->digests, (size_t)record->nparts + 1, err));
    snprintf(record->digests[record->nparts++], RX_HASH_TEXT, "%s", digest);
    return RX_OK;
}

/* --- FITS --- */

/* What the record of a further HDU has beyond that of the first: lines MADE, and READ of the PSF of that image. */
static void keep_further(rx_replay_record *record, int from)
{
    int kept = from;
    for (int i = from; i < record->n; i++) {
        const char *name = record->lines[i].name;
        int known = strcmp(name, "MADE") != 0 && strcmp(name, "READ") != 0;
        for (int k = 0; k < kept && !known; k++)
            known = strcmp(record->lines[k].name, name) == 0 &&
                    strcmp(record->lines[k].value, record->lines[i].value) == 0;
        if (known) {
            free(record->lines[i].name);
            free(record->lines[i].value);
        } else {
            record->lines[kept++] = record->lines[i];
        }
    }
    record->n = kept;
}

static rx_status read_hdu(reading *r, int hdu, char version[72], rx_error *err)
{
    char *cards = NULL, digest[RX_HASH_TEXT];
    long ncards = 0;
    RX_TRY(rx_fits_read_header(r->path, hdu, &cards, &ncards, err));
    r->first = r->record->n;
    r->open = r->complete = 0;
    if (version[0] == '\0')
        rx_cards_text(cards, ncards, "RXVERS", version, 72);
    rx_status status = rx_cards_history(cards, ncards, take_line, r, err);
    free(cards);
    if (status != RX_OK || !r->complete) {
        forget_lines(r->record, r->first);
        return status;
    }
    r->record->intact &= r->intact;
    if (r->first > 0)
        keep_further(r->record, r->first);
    status = rx_fits_digest_hdu(r->path, hdu, digest, err);
    return status == RX_OK ? add_part(r->record, digest, err) : status;
}

static rx_status read_fits(reading *r, rx_error *err)
{
    int n = 0;
    char version[72] = "";
    rx_status status = rx_fits_hdus(r->path, &n, err);
    for (int hdu = 0; hdu < n && status == RX_OK; hdu++)
        status = read_hdu(r, hdu, version, err);
    if (status == RX_OK && r->record->n == 0 && version[0] != '\0')
        return rx_error_at(
            err, RX_INPUT, r->path, -1, 0,
            "was written by Rextract %.20s without a record of the run; nothing can be repeated", version);
    return status;
}

/* --- text --- */

static rx_status take_ascii(reading *r, const char *line, rx_hash *rows, rx_error *err)
{
    if (line[0] == '#')
        return line[1] == ' ' ? take_line(r, line + 2, err) : RX_OK;
    rx_hash_add(rows, line, strlen(line));
    rx_hash_add(rows, "\n", 1);
    return RX_OK;
}

/* &amp; &lt; &gt; &quot;, as they are written, in place. */
static void read_entities(char *text)
{
    static const char *const entity[] = {"&amp;", "&lt;", "&gt;", "&quot;"};
    char *to = text;
    for (const char *from = text; *from != '\0';) {
        size_t k = 0, n = 1;
        while (k < 4 && strncmp(from, entity[k], strlen(entity[k])) != 0)
            k++;
        if (k < 4)
            n = strlen(entity[k]);
        *to++ = k < 4 ? "&<>\""[k] : *from;
        from += n;
    }
    *to = '\0';
}

/* Length of a PARAM's name without the number of READ2, MADE3, which are READ and MADE elsewhere. */
static size_t without_number(const char *name, size_t length)
{
    const size_t plain = 4;
    const bool numbered = strncmp(name, "READ", plain) == 0 || strncmp(name, "MADE", plain) == 0;
    return numbered && strspn(name + plain, "0123456789") == length - plain ? plain : length;
}

/* Of a VOTable that no one has laid out anew: PARAMs and rows stand in lines of their own. */
static rx_status take_votable(reading *r, char *line, rx_hash *rows, int *in_table, rx_error *err)
{
    static const char param[] = "  <PARAM name=\"",
                      middle[] = "\" datatype=\"char\" arraysize=\"*\" value=\"";
    if (strcmp(line, "  <DATA><TABLEDATA>") == 0) {
        *in_table = 1;
        rx_hash_begin(rows);
        return RX_OK;
    }
    if (strcmp(line, "  </TABLEDATA></DATA>") == 0 && *in_table) {
        char digest[RX_HASH_TEXT];
        *in_table = 0;
        rx_hash_text(rows, digest);
        return add_part(r->record, digest, err);
    }
    if (*in_table) {
        rx_hash_add(rows, line, strlen(line));
        rx_hash_add(rows, "\n", 1);
        return RX_OK;
    }
    char *value =
        strncmp(line, param, sizeof param - 1) == 0 ? strstr(line + sizeof param - 1, middle) : NULL;
    if (value == NULL)
        return RX_OK;
    rx_text text = {0};
    const char *name = line + sizeof param - 1;
    rx_text_add_bytes(&text, name, without_number(name, (size_t)(value - name)));
    value += sizeof middle - 1;
    value[strcspn(value, "\"")] = '\0';
    read_entities(value);
    rx_text_printf(&text, " = %s", value);
    rx_status status = text.failed ? rx_error_memory(err, 0) : take_line(r, text.data, err);
    rx_text_free(&text);
    return status;
}

static rx_status read_text(reading *r, rx_error *err)
{
    char *text = NULL, digest[RX_HASH_TEXT];
    int in_table = 0;
    rx_hash rows;
    rx_status status = rx_text_read_file(r->path, MAX_TEXT_BYTES, &text, NULL, err);
    rx_hash_begin(&rows);
    const bool votable = text != NULL && strncmp(text, "<?xml", 5) == 0;
    for (char *line = text; status == RX_OK && line != NULL && *line != '\0';) {
        char *end = strchr(line, '\n');
        if (end != NULL)
            *end = '\0';
        status = votable ? take_votable(r, line, &rows, &in_table, err) : take_ascii(r, line, &rows, err);
        line = end != NULL ? end + 1 : NULL;
    }
    if (status == RX_OK && !votable) {
        rx_hash_text(&rows, digest);
        status = add_part(r->record, digest, err);
    }
    if (!r->complete)
        forget_lines(r->record, 0);
    r->record->intact = r->intact;
    free(text);
    return status;
}

/* --- all --- */

static rx_status check_lines(const reading *r, rx_error *err)
{
    static const char *const needed[] = {"VERSION", "MACHINE", "IMAGE", "SET", "OUTPUT"};
    rx_replay_item item;
    if (r->record->n == 0)
        return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                           "holds no record of a run of rextract; give a FITS catalogue, a check-image, an "
                           "ASCII_HEAD catalogue or a VOTable that it wrote");
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++)
        if (rx_replay_record_value(r->record, needed[i]) == NULL)
            return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                               "its record lacks the line %s; it was changed after it was written",
                               needed[i]);
    for (int i = 0; i < r->record->n; i++) {
        const rx_replay_line *line = &r->record->lines[i];
        const int items = strcmp(line->name, "READ") == 0 || strcmp(line->name, "MADE") == 0;
        if (items && !rx_replay_item_read(line->value, &item))
            return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                               "its record cannot be read: %s '%.60s'; it was changed after it was written",
                               line->name, line->value);
    }
    return RX_OK;
}

rx_status rx_replay_record_read(const char *path, rx_replay_record **dst, rx_error *err)
{
    char head[6] = "";
    rx_replay_record *record = RX_NEW(rx_replay_record, 1);
    *dst = NULL;
    if (record == NULL)
        return rx_error_memory(err, sizeof *record);
    record->intact = 1;
    reading r = {.path = path, .record = record};
    FILE *file = rx_input_open(path);
    const size_t n = file != NULL ? fread(head, 1, sizeof head, file) : 0;
    if (file != NULL)
        fclose(file);
    record->fits = n == sizeof head && memcmp(head, "SIMPLE", sizeof head) == 0;
    rx_status status = record->fits ? read_fits(&r, err) : read_text(&r, err);
    if (status == RX_OK)
        status = check_lines(&r, err);
    if (status == RX_OK)
        *dst = record;
    else
        rx_replay_record_free(record);
    return status;
}

void rx_replay_record_free(rx_replay_record *record)
{
    if (record == NULL)
        return;
    forget_lines(record, 0);
    free(record->lines);
    free(record->digests);
    free(record);
}

const char *rx_replay_record_value(const rx_replay_record *record, const char *name)
{
    for (int i = 0; i < record->n; i++)
        if (strcmp(record->lines[i].name, name) == 0)
            return record->lines[i].value;
    return NULL;
}

int rx_replay_item_read(const char *value, rx_replay_item *dst)
{
    const size_t digest = strcspn(value, " ");
    if (value[digest] == '\0' || digest >= sizeof dst->digest)
        return 0;
    const char *key = value + digest + 1;
    const size_t length = strcspn(key, " ");
    if (key[length] == '\0' || length == 0 || length >= sizeof dst->key)
        return 0;
    snprintf(dst->digest, sizeof dst->digest, "%.*s", (int)digest, value);
    snprintf(dst->key, sizeof dst->key, "%.*s", (int)length, key);
    dst->name = key + length + 1;
    return 1;
}

const char *rx_replay_record_made(const rx_replay_record *record, const char *name, int part)
{
    for (int i = 0; i < record->n; i++) {
        rx_replay_item item;
        if (strcmp(record->lines[i].name, "MADE") == 0 &&
            rx_replay_item_read(record->lines[i].value, &item) && strcmp(item.name, name) == 0 &&
            atoi(item.key) == part)
            return record->lines[i].value;
    }
    return NULL;
}

/* --- the configuration --- */

/* Is the keyword among the blank-separated names? */
static int is_among(const char *names, const char *name)
{
    const size_t n = strlen(name);
    for (const char *at = names; (at = strstr(at, name)) != NULL; at += n)
        if ((at == names || at[-1] == ' ') && (at[n] == ' ' || at[n] == '\0'))
            return 1;
    return 0;
}

static int is_keyword(const char *name)
{
    static const char *const others[] = {"RECORD", "VERSION", "MACHINE", "IMAGE", "SET",
                                         "READ",   "MADE",    "OUTPUT",  "END"};
    for (size_t k = 0; k < sizeof others / sizeof others[0]; k++)
        if (strcmp(name, others[k]) == 0)
            return 0;
    return 1;
}

rx_status rx_replay_record_config(const rx_replay_record *record, const char *path, rx_config **dst,
                                  rx_error *err)
{
    const char *set = rx_replay_record_value(record, "SET");
    rx_error why = rx_error_part(err);
    rx_config *config = NULL;
    rx_status status = rx_config_new(&config, &why);
    *dst = NULL;
    for (int i = 0; i < record->n && status == RX_OK; i++) {
        const rx_replay_line *line = &record->lines[i];
        if (is_keyword(line->name))
            status = rx_settings_take(&config->settings, line->name, line->value,
                                      is_among(set, line->name) ? RX_FROM_COMMAND : RX_FROM_DEFAULT, &why);
    }
    if (status == RX_OK) {
        *dst = config;
        return RX_OK;
    }
    rx_config_free(config);
    if (status == RX_USAGE) /* a header is data */
        return rx_error_at(err, RX_INPUT, path, -1, 0, "its record cannot be used: %.300s", why.text);
    rx_error_take(err, &why);
    return status;
}
