/* A run once more. */
#include "survey/replay.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/input.h"
#include "base/memory.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "io/claim.h"
#include "io/fits_digest.h"
#include "io/fits_read.h"
#include "stage/machine.h"
#include "stage/provenance.h"
#include "stage/stage.h"

/* The records of all parts of a file, each with a pair DATA behind it: the digest of the rows or pixels there now. */
typedef struct reading {
    const char *path;
    rx_record record;
    int part; /* where the record of the current one begins */
    bool open, complete, changed;
    rx_hash sum;
} reading;

/* Of several records in one header (that of the tile goes on in check-images) the last one counts, and none that has no
 * end. */
static void drop_part(reading *r)
{
    for (; r->record.n > r->part; r->record.n--)
        for (int k = 0; k < 3; k++)
            free(r->record.pairs[r->record.n - 1][k]);
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
        if (strncmp(value, RX_RECORD_VERSION, 2) != 0)
            return rx_error_at(
                err, RX_INPUT, r->path, -1, 0,
                "its record is of another kind, '%.40s'; repeat it with the version that wrote it", value);
        drop_part(r);
        r->open = true;
        r->complete = false;
        rx_hash_begin(&r->sum);
    }
    if (!r->open)
        return RX_OK;
    if (strcmp(name, "END") == 0) {
        rx_hash_text(&r->sum, digest);
        r->changed |= strcmp(digest, value) != 0;
        r->open = false;
        r->complete = true;
        return RX_OK;
    }
    rx_record_digest_line(&r->sum, name, value);
    char *own = rx_strdup(value);
    if (own == NULL)
        return rx_error_memory(err, 0);
    const int printable = rx_printable_read(own);
    if (printable)
        rx_record_add(&r->record, name, "", "%s", own);
    free(own);
    return printable ? RX_OK
                     : rx_error_at(err, RX_INPUT, r->path, -1, 0,
                                   "its record cannot be read: '%.60s' has a %% without two digits after it",
                                   value);
}

static rx_status end_part(reading *r, const char *digest, rx_error *err)
{
    if (r->complete)
        rx_record_add(&r->record, "DATA", "", "%s", digest);
    else
        drop_part(r);
    r->part = r->record.n;
    r->open = r->complete = false;
    return r->record.failed ? rx_error_memory(err, 0) : RX_OK;
}

static rx_status read_fits(reading *r, rx_error *err)
{
    int n = 0;
    char version[72] = "", digest[RX_HASH_TEXT] = "";
    RX_TRY(rx_fits_hdus(r->path, &n, err));
    for (int hdu = 0; hdu < n; hdu++) {
        char *cards = NULL;
        long ncards = 0;
        RX_TRY(rx_fits_read_header(r->path, hdu, &cards, &ncards, err));
        if (version[0] == '\0')
            rx_cards_text(cards, ncards, "RXVERS", version, sizeof version);
        rx_status status = rx_cards_history(cards, ncards, take_line, r, err);
        free(cards);
        RX_TRY(status);
        if (r->complete)
            RX_TRY(rx_fits_digest_hdu(r->path, hdu, digest, err));
        RX_TRY(end_part(r, digest, err));
    }
    if (r->record.n == 0 && version[0] != '\0')
        return rx_error_at(
            err, RX_INPUT, r->path, -1, 0,
            "was written by Rextract %.20s without a record of the run; nothing can be repeated", version);
    return RX_OK;
}

static rx_status read_text(reading *r, rx_error *err)
{
    char *text = NULL, *rest, *line, digest[RX_HASH_TEXT];
    rx_hash rows;
    RX_TRY(rx_text_read_file(r->path, 1 << 30, &text, NULL, err));
    rx_status status = RX_OK;
    rx_hash_begin(&rows);
    for (rest = text; status == RX_OK && (line = strsep(&rest, "\n")) != NULL;)
        if (strncmp(line, "# ", 2) == 0)
            status = take_line(r, line + 2, err);
        else if (line[0] != '#')
            rx_hash_add(&rows, line, strlen(line) + 1);
    rx_hash_text(&rows, digest);
    free(text);
    return status == RX_OK ? end_part(r, digest, err) : status;
}

/* The value of the nth pair of that name, from 0; NULL: there are fewer. */
static const char *nth(const reading *r, const char *name, int n)
{
    for (int i = 0; i < r->record.n; i++)
        if (strcmp(r->record.pairs[i][0], name) == 0 && n-- == 0)
            return r->record.pairs[i][1];
    return NULL;
}

static const char *value_of(const reading *r, const char *name)
{
    return nth(r, name, 0);
}

static rx_status read_record(reading *r, rx_error *err)
{
    static const char *const needed[] = {"VERSION", "MACHINE", "IMAGE", "SET", "OUTPUT", "READ", "MADE"};
    char head[6] = "";
    FILE *file = rx_input_open(r->path);
    const bool fits = file != NULL && fread(head, 1, sizeof head, file) == sizeof head &&
                      memcmp(head, "SIMPLE", sizeof head) == 0;
    if (file != NULL)
        fclose(file);
    RX_TRY(fits ? read_fits(r, err) : read_text(r, err));
    if (r->record.n == 0)
        return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                           "holds no record of a run of rextract; give a FITS catalogue, a check-image or an "
                           "ASCII_HEAD catalogue that it wrote");
    for (size_t i = 0; i < sizeof needed / sizeof needed[0]; i++)
        if (value_of(r, needed[i]) == NULL)
            return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                               "its record lacks the line %s; it was changed after it was written",
                               needed[i]);
    return RX_OK;
}

/* Every file that was read has the digest that it had; another version or class of machines is only said. */
static rx_status check_inputs(const reading *r, rx_log *log, rx_error *err)
{
    rx_text here = {0};
    const char *version = value_of(r, "VERSION"), *machine = value_of(r, "MACHINE");
    rx_machine_describe(&here);
    if (strcmp(version, RX_VERSION) != 0)
        rx_log_warning(log, "%s was made by rextract %s, this is %s: results may differ", r->path, version,
                       RX_VERSION);
    if (here.data != NULL && strcmp(here.data, machine) != 0) {
        rx_log_warning(log, "%s was made on another class of machines, the last digits may differ", r->path);
        rx_log_detail(log, "made on: %s; here: %s", machine, here.data);
    }
    rx_text_free(&here);
    for (int i = 0; i < r->record.n; i++) {
        const char *value = r->record.pairs[i][1];
        char then[RX_HASH_TEXT], now[RX_HASH_TEXT], key[64];
        int there = 0, used = 0;
        if (strcmp(r->record.pairs[i][0], "READ") != 0)
            continue;
        if (sscanf(value, "%32s %63s%n", then, key, &used) < 2 || value[used] != ' ')
            return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                               "its record cannot be read: READ '%.60s'; it was changed after it was written",
                               value);
        const char *name = value + used + 1;
        RX_TRY(rx_record_digest(key, name, now, &there, err));
        const char *wrong = NULL;
        if (!there)
            wrong = "is not there (%s of the run that wrote %.200s); repeat it in the folder where it ran";
        else if (strcmp(then, "-") == 0)
            wrong = "was no regular file (%s of the run that wrote %.200s); it cannot be repeated";
        else if (strcmp(then, now) != 0)
            wrong = "has changed since it was read (%s of the run that wrote %.200s); give it as it was";
        if (wrong != NULL)
            return rx_error_at(err, RX_INPUT, name, -1, 0, wrong, key, r->path);
    }
    return RX_OK;
}

/* Keywords stand between IMAGE and SET, which names those that were set. */
static rx_status read_config(const reading *r, rx_config **dst, rx_error *err)
{
    rx_error why = rx_error_part(err);
    rx_text set = {0}, one = {0};
    bool keyword = false;
    rx_text_printf(&set, " %s ", value_of(r, "SET"));
    rx_status status = set.failed ? rx_error_memory(&why, 0) : rx_config_new(dst, &why);
    for (int i = 0; i < r->record.n && status == RX_OK; i++) {
        const char *name = r->record.pairs[i][0];
        keyword &= strcmp(name, "SET") != 0;
        one.length = 0;
        rx_text_printf(&one, " %s ", name);
        if (keyword && one.failed)
            status = rx_error_memory(&why, 0);
        else if (keyword)
            status = rx_settings_take(&(*dst)->settings, name, r->record.pairs[i][1],
                                      strstr(set.data, one.data) != NULL ? RX_FROM_COMMAND : RX_FROM_DEFAULT,
                                      &why);
        keyword |= strcmp(name, "IMAGE") == 0;
    }
    rx_text_free(&set);
    rx_text_free(&one);
    if (status == RX_USAGE) /* a header is data */
        return rx_error_at(err, RX_INPUT, r->path, -1, 0, "its record cannot be used: %.300s", why.text);
    if (status != RX_OK)
        rx_error_take(err, &why);
    return status;
}

/* *dst = where the output of that name goes: into the folder, in which there is one file for each. */
static rx_status divert(const char *folder, const char *name, char **dst, rx_error *err)
{
    rx_text path = {0};
    rx_text_printf(&path, "%s/%s", folder, name);
    if (path.failed)
        return rx_error_memory(err, 0);
    char *last = strrchr(path.data, '/');
    for (char *c = path.data + strlen(folder) + 1; c <= last; c++)
        *c = *c == '/' || *c == '.' ? '_' : *c;
    free(*dst);
    *dst = path.data;
    return RX_OK;
}

/* Reports are written, as they may decide what is measured, but without figures. */
static rx_status divert_outputs(rx_config *config, const char *folder, rx_error *err)
{
    char *report = NULL;
    RX_TRY(divert(folder, config->catalog_name, &config->catalog_name, err));
    for (int i = 0; i < config->checkimage_name.n; i++)
        RX_TRY(divert(folder, config->checkimage_name.v[i], &config->checkimage_name.v[i], err));
    if (config->template_covar_name[0] != '\0')
        RX_TRY(divert(folder, config->template_covar_name, &config->template_covar_name, err));
    RX_TRY(divert(folder, ".report", &report, err));
    free(config->qa_name);
    config->qa_name = report;
    config->qa_figures = false;
    config->self_check_name[0] = config->record_name[0] = '\0';
    return RX_OK;
}

/* For each READ of one that the other has not. */
static void compare_inputs(const reading *one, const reading *other, const char *what, rx_text *dst)
{
    const char *value, *same;
    for (int n = 0; (value = nth(one, "READ", n)) != NULL; n++) {
        for (int k = 0; (same = nth(other, "READ", k)) != NULL && strcmp(same, value) != 0; k++)
            ;
        if (same == NULL)
            rx_text_printf(dst, "%.200s %s\n", value + RX_HASH_TEXT, what);
    }
}

/* Digests of what was made stand in one order. What the file itself holds counts where these are the same. */
static rx_status compare(const reading *then, const reading *now, rx_log *log, rx_error *err)
{
    rx_text found = {0}, all = {0}; /* differences, a line each */
    const char *value, *made;
    char *rest = NULL;
    int n;
    if (then->changed)
        rx_text_add(&found, "its record was changed after it was written\n");
    compare_inputs(now, then, "is read now, and was not then", &found);
    compare_inputs(then, now, "was read then, and is not now", &found);
    for (n = 0; (value = nth(then, "MADE", n)) != NULL; n++)
        if ((made = nth(now, "MADE", n)) == NULL || strncmp(made, value, RX_HASH_TEXT) != 0)
            rx_text_printf(&found, "part %.200s has other rows or pixels\n", value + RX_HASH_TEXT);
    const int compared = n, same = found.length == 0;
    for (n = 0; same && (value = nth(then, "DATA", n)) != NULL; n++)
        if ((made = nth(now, "DATA", n)) == NULL || strcmp(made, value) != 0)
            rx_text_printf(&found, "rows or pixels of part %d were changed after they were written\n", n + 1);
    for (char *line = found.length > 0 ? strtok_r(found.data, "\n", &rest) : NULL; line != NULL;
         line = strtok_r(NULL, "\n", &rest)) {
        rx_log_warning(log, "%s", line);
        rx_text_printf(&all, "%s%s", all.length > 0 ? "; " : "", line);
    }
    rx_status status = found.failed || all.failed ? rx_error_memory(err, 0) : RX_OK;
    if (status == RX_OK && found.length == 0)
        rx_log_info(log, "%s: repeated; %d of %d digests are the same", then->path, compared, compared);
    else if (status == RX_OK)
        status = rx_error_at(err, RX_DIFFERENT, then->path, -1, 0, "is not repeated: %s", all.data);
    rx_text_free(&found);
    rx_text_free(&all);
    return status;
}

rx_status rx_replay_run(const rx_settings *extra, const char *path, rx_log *log, rx_error *err)
{
    static const char *const harmless[] = {"NTHREADS", "VERBOSE_TYPE", "NET_BLOCK", "MEMORY_PIXSTACK", NULL};
    const char *scratch = getenv("TMPDIR");
    reading then = {.path = path}, now = {0};
    rx_config *config = NULL;
    rx_text folder = {0};
    char *again = NULL;
    int claim = -1;
    rx_status status;
    rx_text_printf(&folder, "%s/rextract-replay.tmp-XXXXXX",
                   scratch != NULL && scratch[0] != '\0' ? scratch : "/tmp");
    if (folder.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(read_record(&then, err));
    RX_TRY_EXIT(check_inputs(&then, log, err));
    RX_TRY_EXIT(read_config(&then, &config, err));
    RX_TRY_EXIT(rx_settings_overlay(&config->settings, extra, harmless,
                                    "would change what is compared; leave it out", err));
    RX_TRY_EXIT(rx_settings_check(&config->settings, err));
    claim = rx_claim_folder(folder.data);
    if (claim < 0)
        RX_TRY_EXIT(rx_error_at(err, RX_SYSTEM, folder.data, -1, 0,
                                "cannot be made: %s; name a folder by TMPDIR", strerror(errno)));
    RX_TRY_EXIT(divert_outputs(config, folder.data, err));
    rx_error why = rx_error_part(err);
    status = rx_stage_run(config, value_of(&then, "IMAGE"), NULL, log, NULL, &why);
    rx_log_progress_end(log);
    if (status != RX_OK && status != RX_GATE_FAIL &&
        status != RX_GATE_INSUFFICIENT) { /* of gates all is written */
        rx_error_take(err, &why);
        goto exit;
    }
    RX_TRY_EXIT(divert(folder.data, value_of(&then, "OUTPUT"), &again, err));
    now.path = again;
    if (access(again, F_OK) != 0)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0,
                                "its record cannot be used: no keyword of it names the output '%.200s'",
                                value_of(&then, "OUTPUT")));
    RX_TRY_EXIT(read_record(&now, err));
    status = compare(&then, &now, log, err);
exit:
    if (claim >= 0)
        rx_claim_remove(claim, folder.data);
    rx_record_free(&then.record);
    rx_record_free(&now.record);
    rx_text_free(&folder);
    rx_config_free(config);
    free(again);
    return status;
}
