/* A run once more. */
#include "survey/replay.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "config/config_fields.h"
#include "io/claim.h"
#include "stage/inputs.h"
#include "stage/machine.h"
#include "stage/stage.h"
#include "survey/replay_record.h"

/* A name of an output, and where it goes instead. */
typedef struct detour {
    char *name, *path; /* owned */
} detour;

typedef struct replay {
    const char *path;
    rx_log *log;
    rx_replay_record *record, *again; /* of the file, and of the same file made once more */
    rx_config *config;
    char *folder; /* of the outputs, NULL: not made yet */
    int claim;    /* on it */
    int ndetours;
    detour detours[RX_LIST + 2];
    char *repeated; /* path of the file made once more */
    int compared, different;
    rx_text first; /* what differs first, for the error */
} replay;

static const char *file_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash != NULL ? slash + 1 : path;
}

/* Keywords that change no result. */
static const char *const harmless[] = {"NTHREADS", "VERBOSE_TYPE", "NET_BLOCK", "MEMORY_PIXSTACK", NULL};

/* --- the record against this program and these files --- */

static rx_status check_machine(replay *r, rx_error *err)
{
    rx_text here = {0};
    const char *version = rx_replay_record_value(r->record, "VERSION"),
               *machine = rx_replay_record_value(r->record, "MACHINE");
    if (strcmp(version, RX_VERSION) != 0)
        rx_log_warning(r->log, "%s was made by rextract %s, this is %s: results may differ", r->path, version,
                       RX_VERSION);
    rx_machine_describe(&here);
    if (!here.failed && strcmp(here.data, machine) != 0) {
        rx_log_warning(r->log, "%s was made on another class of machines, the last digits may differ",
                       r->path);
        rx_log_detail(r->log, "made on: %s; here: %s", machine, here.data);
    }
    rx_status status = here.failed ? rx_error_memory(err, 0) : RX_OK;
    rx_text_free(&here);
    return status;
}

static rx_status check_input(const replay *r, const char *value, rx_error *err)
{
    rx_replay_item item;
    char digest[RX_HASH_TEXT];
    int there = 0;
    rx_replay_item_read(value, &item);
    RX_TRY(rx_input_digest(item.key, item.name, digest, &there, err));
    if (!there)
        return rx_error_at(
            err, RX_INPUT, item.name, -1, 0,
            "is not there (%s of the run that wrote %.200s); repeat it in the folder where it ran", item.key,
            r->path);
    if (strcmp(item.digest, "-") == 0)
        return rx_error_at(err, RX_INPUT, item.name, -1, 0,
                           "was no regular file (%s of the run that wrote %.200s); it cannot be repeated",
                           item.key, r->path);
    if (strcmp(digest, item.digest) != 0)
        return rx_error_at(
            err, RX_INPUT, item.name, -1, 0,
            "has changed since it was read (%s of the run that wrote %.200s); give it as it was", item.key,
            r->path);
    return RX_OK;
}

static rx_status check_inputs(const replay *r, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < r->record->n && status == RX_OK; i++)
        if (strcmp(r->record->lines[i].name, "READ") == 0)
            status = check_input(r, r->record->lines[i].value, err);
    return status;
}

/* --- outputs elsewhere --- */

static rx_status make_folder(replay *r, rx_error *err)
{
    const char *scratch = getenv("TMPDIR");
    rx_text text = {0};
    rx_text_printf(&text, "%s/rextract-replay.tmp-XXXXXX",
                   scratch != NULL && scratch[0] != '\0' ? scratch : "/tmp");
    if (text.failed)
        return rx_error_memory(err, 0);
    r->claim = rx_claim_folder(text.data);
    if (r->claim < 0) {
        rx_status status = rx_error_at(err, RX_SYSTEM, text.data, -1, 0,
                                       "cannot be made: %s; name a folder by TMPDIR", strerror(errno));
        rx_text_free(&text);
        return status;
    }
    r->folder = text.data;
    return RX_OK;
}

/* *name, a field of the configuration, becomes a name in the folder. */
static rx_status divert(replay *r, char **name, rx_error *err)
{
    rx_text path = {0};
    detour *way = &r->detours[r->ndetours];
    rx_text_printf(&path, "%s/%d", r->folder, r->ndetours);
    char *copy = rx_strdup(path.data);
    if (path.failed || copy == NULL) {
        rx_text_free(&path);
        free(copy);
        return rx_error_memory(err, 0);
    }
    *way = (detour){.name = *name, .path = path.data};
    r->ndetours++;
    *name = copy;
    return RX_OK;
}

/* The library as the run saw it: a folder of links to the models that it looked at, whatever else is there by now. */
static rx_status restore_library(replay *r, rx_error *err)
{
    rx_text folder = {0};
    rx_replay_item item;
    rx_text_printf(&folder, "%s/library", r->folder);
    rx_status status = folder.failed ? rx_error_memory(err, 0) : RX_OK;
    if (status == RX_OK && mkdir(folder.data, 0700) != 0)
        status = rx_error_at(err, RX_SYSTEM, folder.data, -1, 0, "cannot be made: %s", strerror(errno));
    for (int i = 0; i < r->record->n && status == RX_OK; i++) {
        if (strcmp(r->record->lines[i].name, "READ") != 0 ||
            !rx_replay_item_read(r->record->lines[i].value, &item) || strcmp(item.key, "PSF_LIBRARY") != 0)
            continue;
        rx_text path = {0};
        char *real = rx_name_real(item.name);
        rx_text_printf(&path, "%s/%s", folder.data, file_name(item.name));
        if (real == NULL || path.failed)
            status = rx_error_memory(err, 0);
        else if (symlink(real, path.data) != 0)
            status = rx_error_at(err, RX_SYSTEM, path.data, -1, 0, "cannot be made: %s", strerror(errno));
        rx_text_free(&path);
        free(real);
    }
    if (status != RX_OK) {
        rx_text_free(&folder);
        return status;
    }
    free(r->config->psf_library);
    r->config->psf_library = folder.data;
    return RX_OK;
}

static rx_status divert_outputs(replay *r, rx_error *err)
{
    rx_config *config = r->config;
    rx_text report = {0};
    rx_status status = divert(r, &config->catalog_name, err);
    for (int i = 0; i < config->checkimage_name.n && status == RX_OK; i++)
        status = divert(r, &config->checkimage_name.v[i], err);
    if (config->template_covar_name[0] != '\0' && status == RX_OK)
        status = divert(r, &config->template_covar_name, err);
    /* reports are written, as they may decide what is measured, but not compared: no pictures */
    config->qa_figures = false;
    rx_text_printf(&report, "%s/report", r->folder);
    if (status == RX_OK && report.failed)
        status = rx_error_memory(err, 0);
    if (status != RX_OK) {
        rx_text_free(&report);
        return status;
    }
    free(config->qa_name);
    config->qa_name = report.data;
    config->self_check_name[0] = '\0';
    config->record_name[0] = '\0';
    if (strcmp(config->psf_library_type, "WRITE") == 0)
        config->psf_library[0] = '\0';
    return config->psf_library[0] != '\0' ? restore_library(r, err) : RX_OK;
}

/* Is `name` that output with that tag? Then *dst is where it went. */
static rx_status try_tag(const detour *way, const char *name, const char *tag, char **dst, rx_error *err)
{
    char *tagged = rx_name_with_tag(way->name, tag);
    if (tagged == NULL)
        return rx_error_memory(err, 0);
    const int fits = strcmp(tagged, name) == 0;
    free(tagged);
    if (fits && (*dst = rx_name_with_tag(way->path, tag)) == NULL)
        return rx_error_memory(err, 0);
    return RX_OK;
}

/* *dst, to be freed: where the output of that name went, NULL: nowhere. */
static rx_status find_repeated(const replay *r, const char *name, char **dst, rx_error *err)
{
    const rx_words *kinds = &r->config->restore_type;
    rx_status status = RX_OK;
    *dst = NULL;
    for (int i = 0; i < r->ndetours && *dst == NULL && status == RX_OK; i++)
        for (int k = 0; k < kinds->n && *dst == NULL && status == RX_OK; k++)
            status = try_tag(&r->detours[i], name, kinds->n > 1 ? kinds->v[k] : NULL, dst, err);
    return status;
}

/* --- the run --- */

static rx_status run(replay *r, rx_error *err)
{
    rx_error why = rx_error_part(err);
    const char *image = rx_replay_record_value(r->record, "IMAGE");
    rx_status status = rx_stage_run(r->config, image, NULL, r->log, NULL, &why);
    rx_log_progress_end(r->log);
    if (status == RX_GATE_FAIL || status == RX_GATE_INSUFFICIENT)
        return RX_OK; /* all outputs are written */
    rx_error_take(err, &why);
    return status;
}

/* --- comparing --- */

RX_PRINTF(2, 3)
static void differs(replay *r, const char *format, ...)
{
    char text[RX_ERROR_TEXT];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (r->different++ == 0)
        rx_text_add(&r->first, text);
    rx_log_warning(r->log, "%s: %s", r->path, text);
}

/* The file against its own record. */
static void check_itself(replay *r)
{
    const char *name = rx_replay_record_value(r->record, "OUTPUT");
    const char *what = r->record->fits ? "rows or pixels" : "rows";
    if (!r->record->intact)
        differs(r, "its record was changed after it was written");
    for (int part = 1; part <= r->record->nparts; part++) {
        const char *made = rx_replay_record_made(r->record, name, part);
        if (made == NULL)
            differs(r, "part %d is not in its record", part);
        else if (strncmp(made, r->record->digests[part - 1], RX_HASH_TEXT - 1) != 0)
            differs(r, "%s of part %d were changed after they were written", what, part);
    }
}

/* Does the record have that file? Models of PSF_LIBRARY are read by links to them, elsewhere. */
static int has_read(const rx_replay_record *record, const rx_replay_item *one)
{
    rx_replay_item item;
    for (int i = 0; i < record->n; i++)
        if (strcmp(record->lines[i].name, "READ") == 0 &&
            rx_replay_item_read(record->lines[i].value, &item) && strcmp(item.digest, one->digest) == 0 &&
            strcmp(item.key, one->key) == 0 &&
            (strcmp(item.key, "PSF_LIBRARY") == 0 ? strcmp(file_name(item.name), file_name(one->name)) == 0
                                                  : strcmp(item.name, one->name) == 0))
            return 1;
    return 0;
}

/* A file that is read now and was not then, or the other way round. */
static void compare_inputs(replay *r)
{
    rx_replay_item item;
    for (int i = 0; i < r->again->n; i++)
        if (strcmp(r->again->lines[i].name, "READ") == 0 &&
            rx_replay_item_read(r->again->lines[i].value, &item) && !has_read(r->record, &item))
            differs(r, "%.200s (%s) is read now, and was not then", item.name, item.key);
    for (int i = 0; i < r->record->n; i++)
        if (strcmp(r->record->lines[i].name, "READ") == 0 &&
            rx_replay_item_read(r->record->lines[i].value, &item) && !has_read(r->again, &item))
            differs(r, "%.200s (%s) was read then, and is not now", item.name, item.key);
}

static rx_status compare_made(replay *r, const rx_replay_item *item, rx_error *err)
{
    char *path = NULL;
    const int part = atoi(item->key);
    RX_TRY(find_repeated(r, item->name, &path, err));
    const char *made = path != NULL ? rx_replay_record_made(r->again, path, part) : NULL;
    r->compared++;
    if (made == NULL)
        differs(r, "%.200s, part %d, was not made again", item->name, part);
    else if (strncmp(made, item->digest, RX_HASH_TEXT - 1) != 0)
        differs(r, "%.200s, part %d, has other rows or pixels; run rextract again and compare the files",
                item->name, part);
    free(path);
    return RX_OK;
}

static rx_status compare(replay *r, rx_error *err)
{
    const char *output = rx_replay_record_value(r->record, "OUTPUT");
    rx_replay_item item;
    rx_status status = find_repeated(r, output, &r->repeated, err);
    if (status == RX_OK && r->repeated == NULL)
        return rx_error_at(err, RX_INPUT, r->path, -1, 0,
                           "its record cannot be used: no keyword of it names the output '%.200s'", output);
    if (status == RX_OK)
        status = rx_replay_record_read(r->repeated, &r->again, err);
    if (status != RX_OK)
        return status;
    compare_inputs(r);
    for (int i = 0; i < r->record->n && status == RX_OK; i++)
        if (strcmp(r->record->lines[i].name, "MADE") == 0 &&
            rx_replay_item_read(r->record->lines[i].value, &item))
            status = compare_made(r, &item, err);
    return status;
}

static rx_status judge(const replay *r, rx_error *err)
{
    if (r->different == 0) {
        rx_log_info(r->log, "%s: repeated; %d of %d digests are the same", r->path, r->compared, r->compared);
        return RX_OK;
    }
    if (r->different == 1)
        return rx_error_at(err, RX_DIFFERENT, r->path, -1, 0, "is not repeated: %s",
                           r->first.failed ? "it differs" : r->first.data);
    return rx_error_at(err, RX_DIFFERENT, r->path, -1, 0, "is not repeated, %d differences; first: %s",
                       r->different, r->first.failed ? "it differs" : r->first.data);
}

static void forget(replay *r)
{
    if (r->folder != NULL)
        rx_claim_remove(r->claim, r->folder);
    for (int i = 0; i < r->ndetours; i++) {
        free(r->detours[i].name);
        free(r->detours[i].path);
    }
    free(r->folder);
    free(r->repeated);
    rx_replay_record_free(r->record);
    rx_replay_record_free(r->again);
    rx_config_free(r->config);
    rx_text_free(&r->first);
}

rx_status rx_replay_run(const rx_settings *extra, const char *path, rx_log *log, rx_error *err)
{
    replay r = {.path = path, .log = log};
    rx_status status;
    RX_TRY_EXIT(rx_replay_record_read(path, &r.record, err));
    RX_TRY_EXIT(check_machine(&r, err));
    RX_TRY_EXIT(check_inputs(&r, err));
    RX_TRY_EXIT(rx_replay_record_config(r.record, r.path, &r.config, err));
    RX_TRY_EXIT(rx_settings_overlay(&r.config->settings, extra, harmless,
                                    "would change what is compared; leave it out", err));
    RX_TRY_EXIT(rx_settings_check(&r.config->settings, err));
    RX_TRY_EXIT(make_folder(&r, err));
    RX_TRY_EXIT(divert_outputs(&r, err));
    check_itself(&r);
    RX_TRY_EXIT(run(&r, err));
    RX_TRY_EXIT(compare(&r, err));
    status = judge(&r, err);
exit:
    forget(&r);
    return status;
}
