/* Provenance of the outputs. */
#include "stage/provenance.h"

#include <gnu/libc-version.h>
#include <string.h>
#include <sys/stat.h>

#include "base/text.h"
#include "detect/sep_extract.h"
#include "io/fits_read.h"
#include "io/wcs.h"
#include "nn/direct.h"
#include "num/fft.h"
#include "num/lsq.h"

static void add_processor(rx_text *dst)
{
#if defined(__x86_64__) || defined(__i386__)
    rx_text_add(dst, "x86");
#define ADD(name) rx_text_add(dst, __builtin_cpu_supports(name) ? " " name : "")
    ADD("sse4.2");
    ADD("avx");
    ADD("avx2");
    ADD("fma");
    ADD("avx512f");
    ADD("avx512dq");
    ADD("avx512bw");
    ADD("avx512vl");
    ADD("avx512vnni");
    ADD("avx512bf16");
#undef ADD
#elif defined(__aarch64__)
    rx_text_add(dst, "aarch64");
#else
    rx_text_add(dst, "another processor");
#endif
}

/* One line: the processor's instruction sets that kernels are chosen by, compiler, and versions of the libraries that compute
 * or read. Nothing that names the machine. */
static void describe_machine(rx_text *dst)
{
    char fits[32];
    rx_fits_library(fits, sizeof fits);
    add_processor(dst);
#ifdef __VERSION__
    rx_text_add(dst, "; compiler " __VERSION__);
#endif
    rx_text_printf(dst, "; libc %s, %s, network on %s, sep %s, GSL %s, wcslib %s, cfitsio %s",
                   gnu_get_libc_version(), rx_fft_library(), rx_direct_name(), rx_sep_library(),
                   rx_lsq_library(), rx_wcs_library(), fits);
}

/* Visiting the keywords. */
typedef struct keywords {
    rx_record *record;
    const rx_config *config;
    rx_text set; /* names of those that were set */
} keywords;

static void add_keyword(void *user, const char *name, const char *value, const char *help)
{
    static const char *const apart[] = {"NTHREADS", "VERBOSE_TYPE", "PLAN", "PLAN_DENSITY"};
    keywords *k = user;
    for (size_t i = 0; i < sizeof apart / sizeof apart[0]; i++)
        if (strcmp(name, apart[i]) == 0)
            return;
    rx_record_add(k->record, name, help, "%s", value);
    if (rx_settings_states(&k->config->settings, name))
        rx_text_printf(&k->set, "%s%s", k->set.length > 0 ? " " : "", name);
}

void rx_record_run(rx_record *record, const rx_config *config, const char *images)
{
    rx_text machine = {0};
    keywords k = {.record = record, .config = config};
    describe_machine(&machine);
    rx_text_add(&k.set, "");
    rx_record_add(record, "PROGRAM", "made by", "rextract");
    rx_record_add(record, "RXVERS", "version of rextract", "%s", RX_VERSION);
    rx_record_add(record, "RXINPUT", "input image", "%s", images);
    rx_record_add(record, "RECORD", "rextract -c repeats the run from this line to END", "%s",
                  RX_RECORD_VERSION);
    rx_record_add(record, "VERSION", "of rextract", "%s", RX_VERSION);
    rx_record_add(record, "MACHINE", "class of machines that gives the same bits", "%s",
                  machine.data != NULL ? machine.data : "");
    rx_record_add(record, "IMAGE", "image, or two", "%s", images);
    if (!rx_settings_visit(&config->settings, true, add_keyword, &k) || k.set.failed || machine.failed)
        record->failed = true;
    rx_record_add(record, "SET", "keywords that were set; the others are defaults", "%s",
                  k.set.data != NULL ? k.set.data : "");
    rx_text_free(&k.set);
    rx_text_free(&machine);
}

/* The digest of the file behind a name of that keyword: what stands in brackets is cut off where no file has
 * that name, a bare name of NET_MODEL may be one of the installed data. *there 0: there is none; "-" where it is no
 * regular file. Errors: RX_INPUT (cannot be read), RX_SYSTEM. */
static rx_status digest_file(const char *key, const char *name, char dst[RX_HASH_TEXT], int *there,
                             rx_error *err)
{
    struct stat info;
    rx_text path = {0};
    int regular = 0;
    if (strcmp(key, "NET_MODEL") == 0)
        rx_options_model_path(name, RX_DATA_FOLDER, &path);
    else
        rx_text_add(&path, name);
    if (path.failed)
        return rx_error_memory(err, 0);
    *there = stat(path.data, &info) == 0;
    if (!*there) {
        path.data[strcspn(path.data, "[")] = '\0';
        *there = stat(path.data, &info) == 0;
    }
    rx_status status = *there ? rx_hash_file(path.data, dst, &regular, err) : RX_OK;
    if (!regular)
        strcpy(dst, "-");
    rx_text_free(&path);
    return status;
}

static void add_input(rx_record *record, const char *key, const char *name, const char *digest)
{
    rx_record_add(record, "READ", "digest, keyword and name of a file that was read", "%s %s %s", digest, key,
                  name);
}

typedef struct reading {
    rx_record *record;
    rx_status status;
    rx_error *err;
} reading;

static void take(reading *r, const char *key, const char *name)
{
    char digest[RX_HASH_TEXT];
    int there = 0;
    if (r->status != RX_OK || name == NULL || name[0] == '\0')
        return;
    r->status = digest_file(key, name, digest, &there, r->err);
    if (r->status == RX_OK && there)
        add_input(r->record, key, name, digest);
}

rx_status rx_record_inputs(rx_record *record, const rx_config *config, const rx_options *options,
                           const char *detect, const char *measure, rx_error *err)
{
    const char *const images[2] = {detect, measure};
    reading r = {.record = record, .err = err};
    const int nroles = images[1] != NULL ? 2 : 1;
    const int psf_file =
        options->pipeline.psf.type == RX_PSF_FILE || options->pipeline.psf.type == RX_PSF_PSFEX;
    take(&r, "IMAGE", images[0]);
    take(&r, "IMAGE", images[1]);
    if (options->model != NULL)
        take(&r, "NET_MODEL", options->model_name);
    for (int role = 0; role < nroles; role++) {
        if (psf_file && (role == 0 || options->pipeline.psf_files[1] != options->pipeline.psf_files[0]))
            take(&r, "PSF_NAME", options->pipeline.psf_files[role]);
        if (role == 0 && options->pipeline.psf.type == RX_PSF_AUTO)
            take(&r, "PSF_STARS_NAME", options->pipeline.psf.stars_file);
        if (role == 0 || options->tile[1].weight_name != options->tile[0].weight_name)
            take(&r, "WEIGHT_IMAGE", options->tile[role].weight_name);
    }
    take(&r, "RESTORED_NAME", options->tile[0].restored_name);
    take(&r, "RESTORED_PSF", options->pipeline.restore.file_psf);
    take(&r, "RESTORED_NOISE", options->tile[0].restored_noise_name);
    for (int i = 0; i < options->tile[0].nflags; i++)
        take(&r, "FLAG_IMAGE", options->tile[0].flag_names[i]);
    take(&r, "PARAMETERS_NAME", config->parameters_name);
    if (config->noise_kernel_name[0] != '\0' && strcmp(config->noise_correlation, "FILE") == 0)
        take(&r, "NOISE_KERNEL_NAME", config->noise_kernel_name);
    if (config->filter)
        take(&r, "FILTER_NAME", config->filter_name);
    if (options->star_net != NULL)
        take(&r, "STARNNW_NAME", config->starnnw_name);
    if (options->assoc_list != NULL)
        take(&r, "ASSOC_NAME", config->assoc_name);
    take(&r, "POSITIONS_NAME", config->positions_name);
    take(&r, "REFERENCE_NAME", config->reference_name);
    if (config->reference_name[0] != '\0')
        take(&r, "QA_GATES", config->qa_gates);
    return r.status == RX_OK && record->failed ? rx_error_memory(err, 0) : r.status;
}

rx_status rx_record_file(rx_record *record, const char *key, const char *name, rx_error *err)
{
    char digest[RX_HASH_TEXT];
    int there = 0;
    RX_TRY(digest_file(key, name, digest, &there, err));
    if (!there)
        return rx_error_at(err, RX_INPUT, name, -1, 0, "was removed after it was read (%s)", key);
    const size_t used = strlen(digest) + strlen(key) + 2;
    for (int i = 0; i < record->n; i++) {
        const char *value = record->pairs[i][1];
        if (strcmp(record->pairs[i][0], "READ") == 0 && strlen(value) > used &&
            strcmp(value + used, name) == 0 && strncmp(value + strlen(digest) + 1, key, strlen(key)) == 0)
            return RX_OK;
    }
    add_input(record, key, name, digest);
    return record->failed ? rx_error_memory(err, 0) : RX_OK;
}

/* --- a run that repeats another --- */

/* Behind the first blank of a value. */
static const char *behind(const char *value)
{
    value += strcspn(value, " ");
    return value + (*value == ' ');
}

/* Does the record have that pair, but for the name of the file, its third word? */
static bool has_same(const rx_record *record, char *const pair[3])
{
    return rx_record_has(record, 0, pair[0], pair[1], (size_t)(behind(behind(pair[1])) - pair[1]));
}

rx_status rx_repeat_check(const rx_settings *settings, const rx_record *now, rx_log *log, rx_error *err)
{
    const rx_record *then = &settings->repeated;
    if (then->n == 0)
        return RX_OK;
    const char *version = rx_record_find(then, "VERSION"), *machine = rx_record_find(then, "MACHINE"),
               *here = rx_record_find(now, "MACHINE");
    if (strcmp(version, RX_VERSION) != 0)
        rx_log_warning(log, "%s was made by rextract %s, this is %s: results may differ", settings->file,
                       version, RX_VERSION);
    if (strcmp(here, machine) != 0) {
        rx_log_warning(log, "%s was made on another class of machines, the last digits may differ",
                       settings->file);
        rx_log_detail(log, "made on: %s; here: %s", machine, here);
    }
    for (int i = 0; i < now->n; i++) {
        const char *key = behind(now->pairs[i][1]), *name = behind(key);
        if (strcmp(now->pairs[i][0], "READ") == 0 && !has_same(then, now->pairs[i]))
            return rx_error_at(err, RX_INPUT, name, -1, 0,
                               "is not what the run that wrote %.200s read (%.*s); give it as it was",
                               settings->file, (int)(name - key - 1), key);
    }
    return RX_OK;
}

/* Of keywords that the command line gives, those count that have another value; but names of files do not: inputs have
 * digests, and outputs may lie anywhere. */
rx_status rx_repeat_compare(const rx_settings *settings, const rx_record *now, const rx_record *made,
                            rx_log *log, rx_error *err)
{
    const rx_record *then = &settings->repeated;
    rx_status status = RX_OK;
    rx_text found = {0}, given = {0};
    int compared = 0;
    for (int i = 0; i < then->n; i++) {
        const char *name = then->pairs[i][0], *value = then->pairs[i][1], *here = rx_record_find(now, name);
        compared += strcmp(name, "MADE") == 0;
        if (strcmp(name, "CHANGED") == 0)
            rx_text_printf(&found, "; %s", value);
        else if (strcmp(name, "READ") == 0 && !has_same(now, then->pairs[i]))
            rx_text_printf(&found, "; %.200s was read then, and is not now", behind(value));
        else if (strcmp(name, "MADE") == 0 && !has_same(made, then->pairs[i]))
            rx_text_printf(&found, "; part %.200s has other rows or pixels", behind(value));
        else if (rx_settings_was_set(settings, name) == RX_FROM_COMMAND && strstr(name, "_NAME") == NULL &&
                 here != NULL && strcmp(here, value) != 0)
            rx_text_printf(&given, "; %s is %s, and was %s", name, here, value);
    }
    if (found.failed || given.failed)
        status = rx_error_memory(err, 0);
    else if (found.length > 0)
        status = rx_error_at(err, RX_DIFFERENT, settings->file, -1, 0, "is not repeated: %s%s",
                             found.data + 2, given.length > 0 ? given.data : "");
    else if (then->n > 0)
        rx_log_info(log, "%s: repeated; %d of %d digests are the same", settings->file, compared, compared);
    rx_text_free(&found);
    rx_text_free(&given);
    return status;
}
