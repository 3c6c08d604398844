/* Comparing outputs with inputs. */
#include "config/overwrite.h"

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/memory.h"
#include "base/names.h"
#include "config/config_fields.h"

enum { MAX_INPUTS = 8 * RX_LIST };

typedef struct inputs {
    int n;
    const char *name[MAX_INPUTS];
} inputs;

static void add(inputs *list, const char *name)
{
    if (name != NULL && name[0] != '\0' && list->n < MAX_INPUTS)
        list->name[list->n++] = name;
}

static void add_all(inputs *list, const rx_strings *names)
{
    for (int i = 0; i < names->n; i++)
        add(list, names->v[i]);
}

/* A copy of a cfitsio name without what stands in brackets, unless a file is called just so. */
static char *file_of(const char *name)
{
    struct stat info;
    char *path = rx_strdup(name);
    if (path != NULL && stat(path, &info) != 0)
        path[strcspn(path, "[")] = '\0';
    return path;
}

static bool find_file(const char *name, struct stat *dst, rx_error *err, rx_status *status)
{
    char *path = file_of(name);
    if (path == NULL)
        *status = rx_error_memory(err, strlen(name));
    const bool found = path != NULL && stat(path, dst) == 0;
    free(path);
    return found && S_ISREG(dst->st_mode);
}

/* `key` is the keyword of the output, for the error. */
static rx_status check_file(const inputs *list, const char *key, const char *name, rx_error *err)
{
    struct stat output, input;
    rx_status status = RX_OK;
    if (stat(name, &output) != 0 || !S_ISREG(output.st_mode))
        return RX_OK;
    for (int i = 0; i < list->n && status == RX_OK; i++)
        if (find_file(list->name[i], &input, err, &status) && input.st_dev == output.st_dev &&
            input.st_ino == output.st_ino)
            return rx_error_set(err, RX_USAGE, "%s %s is also read, as %s; give the output another name", key,
                                name, list->name[i]);
    return status;
}

static bool is_folder(const char *path, const struct stat *folder)
{
    struct stat info;
    return stat(path, &info) == 0 && info.st_dev == folder->st_dev && info.st_ino == folder->st_ino;
}

/* Does the file lie in that folder, or in one below it? It need not exist. */
static bool lies_in(const char *name, const struct stat *folder, rx_error *err, rx_status *status)
{
    char *path = file_of(name), *slash;
    char *real = path != NULL ? rx_name_real(path) : NULL;
    bool found = false;
    if (real == NULL)
        *status = rx_error_memory(err, strlen(name));
    while (!found && real != NULL && (slash = strrchr(real, '/')) != NULL) {
        *slash = '\0';
        found = is_folder(real[0] != '\0' ? real : "/", folder);
    }
    free(real);
    free(path);
    return found;
}

/* A folder of ours is replaced with all that it holds: no file of the run may lie in it, neither an input nor
 * an output. */
static rx_status check_folder(const inputs *list, const char *key, const char *name, rx_error *err)
{
    struct stat folder;
    rx_status status = RX_OK;
    if (name[0] == '\0' || stat(name, &folder) != 0 || !S_ISDIR(folder.st_mode))
        return RX_OK;
    for (int i = 0; i < list->n && status == RX_OK; i++)
        if (lies_in(list->name[i], &folder, err, &status))
            return rx_error_set(
                err, RX_USAGE,
                "%s lies in the folder %s, which is replaced as a whole (%s); keep it elsewhere",
                list->name[i], name, key);
    return status;
}

/* Files that other keywords name, where they are used. */
static void add_stage(inputs *list, const rx_config *config)
{
    bool maps = false;
    for (int i = 0; i < config->weight_type.n; i++)
        maps |= strncmp(config->weight_type.v[i], "MAP_", 4) == 0;
    if (maps)
        add_all(list, &config->weight_image);
    if (strcmp(config->psf_type, "FILE") == 0 || strcmp(config->psf_type, "PSFEX") == 0)
        add_all(list, &config->psf_name);
    add(list, config->psf_stars_name);
    for (int i = 0; i < config->restore_type.n; i++)
        if (strcmp(config->restore_type.v[i], "NET") == 0 || strcmp(config->restore_type.v[i], "AUTO") == 0)
            add(list, config->net_model);
    add_all(list, &config->flag_image);
    add(list, config->settings.file);
    add(list, config->parameters_name);
    add(list, config->filter_name);
    add(list, config->starnnw_name);
    add(list, config->assoc_name);
    add(list, config->reference_name);
    add(list, config->qa_gates);
}

static bool makes_report(const rx_config *config)
{
    return config->reference_name[0] != '\0' || strcmp(config->qa_type, "TILE") == 0;
}

/* Files that a run writes, a name for all restorers. */
static void visit_files(const rx_config *config, rx_file_visitor visit, void *user)
{
    if (strcmp(config->catalog_type, "NONE") != 0)
        visit(user, "CATALOG_NAME", config->catalog_name);
    for (int i = 0; i < config->checkimage_type.n && i < config->checkimage_name.n; i++)
        if (strcmp(config->checkimage_type.v[i], "NONE") != 0)
            visit(user, "CHECKIMAGE_NAME", config->checkimage_name.v[i]);
    if (config->template_covar_name[0] != '\0')
        visit(user, "TEMPLATE_COVAR_NAME", config->template_covar_name);
    if (config->record_name[0] != '\0')
        visit(user, "RECORD_NAME", config->record_name);
    if (config->write_xml)
        visit(user, "XML_NAME", config->xml_name);
}

/* What visits a file under each name it will have: with several restorers there is one of each, but of the
 * record and of XML_NAME. */
typedef struct tagging {
    const rx_words *restorers;
    rx_file_visitor visit;
    void *user;
    rx_status status;
    rx_error *err;
} tagging;

static void visit_tagged(void *user, const char *key, const char *name)
{
    tagging *t = user;
    if (t->restorers->n < 2 || strcmp(key, "RECORD_NAME") == 0 || strcmp(key, "XML_NAME") == 0) {
        t->visit(t->user, key, name);
        return;
    }
    for (int i = 0; i < t->restorers->n && t->status == RX_OK; i++) {
        char *tagged = rx_name_with_tag(name, t->restorers->v[i]);
        if (tagged != NULL)
            t->visit(t->user, key, tagged);
        else
            t->status = rx_error_memory(t->err, strlen(name));
        free(tagged);
    }
}

rx_status rx_overwrite_visit(const rx_config *config, rx_file_visitor visit, void *user, rx_error *err)
{
    tagging t = {.restorers = &config->restore_type, .visit = visit, .user = user, .err = err};
    visit_files(config, visit_tagged, &t);
    if (makes_report(config))
        visit(user, "QA_NAME", config->qa_name);
    if (config->self_check)
        visit(user, "SELF_CHECK_NAME", config->self_check_name);
    return t.status;
}

rx_status rx_overwrite_visit_inputs(const rx_config *config, const char *image, rx_file_visitor visit,
                                    void *user, rx_error *err)
{
    inputs list = {0};
    char *detect = NULL, *measure = NULL;
    rx_status status = RX_OK;
    if (!rx_name_split_images(image, &detect, &measure))
        return rx_error_memory(err, strlen(image));
    add(&list, detect);
    add(&list, measure);
    const int images = list.n;
    add_stage(&list, config);
    for (int i = 0; i < list.n && status == RX_OK; i++) {
        char *path = file_of(list.name[i]);
        if (path != NULL)
            visit(user, i < images ? "IMAGE" : "", path);
        else
            status = rx_error_memory(err, strlen(list.name[i]));
        free(path);
    }
    free(detect);
    free(measure);
    return status;
}

typedef struct file_check {
    inputs *list;
    const char *record; /* real name of the record; NULL: none */
    rx_status status;
    rx_error *err;
} file_check;

/* The record is written apart from the other outputs, which io/output.h keeps from each other. */
static rx_status check_against_record(const file_check *check, const char *key, const char *name)
{
    char *real = check->record != NULL && strcmp(key, "RECORD_NAME") != 0 ? rx_name_real(name) : NULL;
    rx_status status = RX_OK;
    if (real != NULL && strcmp(real, check->record) == 0)
        status = rx_error_set(check->err, RX_USAGE,
                              "RECORD_NAME %s is also %s; give each output its own name", name, key);
    free(real);
    return status;
}

static void check_visited(void *user, const char *key, const char *name)
{
    file_check *check = user;
    if (check->status != RX_OK || strcmp(name, "STDOUT") == 0)
        return;
    if (strcmp(key, "QA_NAME") != 0 && strcmp(key, "SELF_CHECK_NAME") != 0)
        check->status = check_file(check->list, key, name, check->err);
    if (check->status == RX_OK)
        check->status = check_against_record(check, key, name);
}

static void add_visited(void *user, const char *key, const char *name)
{
    (void)key;
    if (strcmp(name, "STDOUT") != 0)
        add(user, name);
}

/* Outputs of the run against files that it reads, and folders that it replaces against all of them. */
static rx_status check_outputs(const rx_config *config, inputs *list, const char *record, rx_error *err)
{
    file_check check = {.list = list, .record = record, .err = err};
    rx_status status = rx_overwrite_visit(config, check_visited, &check, err);
    if (status == RX_OK)
        status = check.status;
    visit_files(config, add_visited, list);
    if (status == RX_OK && makes_report(config))
        status = check_folder(list, "QA_NAME", config->qa_name, err);
    if (status == RX_OK && config->self_check)
        status = check_folder(list, "SELF_CHECK_NAME", config->self_check_name, err);
    return status;
}

rx_status rx_overwrite_check(const rx_settings *settings, const char *image, rx_error *err)
{
    const rx_config *config = (const rx_config *)settings;
    inputs list = {0};
    char *detect = NULL, *measure = NULL, *record = NULL;
    if (!rx_name_split_images(image, &detect, &measure))
        return rx_error_memory(err, strlen(image));
    add(&list, detect);
    add(&list, measure);
    add_stage(&list, config);
    if (config->record_name[0] != '\0')
        record = rx_name_real(config->record_name);
    rx_status status = check_outputs(config, &list, record, err);
    free(record);
    free(detect);
    free(measure);
    return status;
}

rx_status rx_config_check_read(const rx_config *config, const char *name, rx_error *err)
{
    inputs list = {.n = 1, .name = {name}};
    return check_outputs(config, &list, NULL, err);
}

static void add_simulate(inputs *list, const rx_simulate_config *config)
{
    add(list, config->settings.file);
    add(list, config->inject_image);
    add(list, config->inject_config);
    if (strcmp(config->psf_type, "FILE") == 0 || strcmp(config->psf_type, "PSFEX") == 0)
        add(list, config->psf_name);
    add(list, config->template_name + (config->template_name[0] == '@'));
}

rx_status rx_overwrite_check_simulate(const rx_settings *settings, const char *image, rx_error *err)
{
    const rx_simulate_config *config = (const rx_simulate_config *)settings;
    inputs list = {0};
    add(&list, image);
    add_simulate(&list, config);
    RX_TRY(check_file(&list, "IMAGE_NAME", config->image_name, err));
    RX_TRY(check_file(&list, "SHARP_NAME", config->sharp_name, err));
    RX_TRY(check_file(&list, "TRUTH_NAME", config->truth_name, err));
    return check_file(&list, "FLAG_NAME", config->flag_name, err);
}

rx_status rx_overwrite_check_campaign(const rx_settings *settings, const char *image, rx_error *err)
{
    const rx_campaign_config *config = (const rx_campaign_config *)settings;
    inputs list = {0};
    int k, n;
    rx_text journal = {0};
    add(&list, image);
    add(&list, config->tile_name);
    add_simulate(&list, config->sim);
    add_stage(&list, config->stage);
    RX_TRY(rx_campaign_config_shard(config, &k, &n, err));
    rx_text_add(&journal, config->journal_name);
    if (n > 1)
        rx_text_printf(&journal, ".%d", k);
    rx_status status = journal.failed ? rx_error_memory(err, journal.length)
                                      : check_file(&list, "JOURNAL_NAME", journal.data, err);
    if (status == RX_OK) {
        add(&list, journal.data);
        status = check_folder(&list, "OUTPUT_NAME", config->output_name, err);
    }
    rx_text_free(&journal);
    return status;
}

rx_status rx_overwrite_check_train(const rx_settings *settings, const char *image, rx_error *err)
{
    const rx_train_config *config = (const rx_train_config *)settings;
    inputs list = {0};
    add(&list, image);
    add(&list, config->settings.file);
    add_simulate(&list, config->sim);
    add(&list, config->init_model);
    rx_status status = check_file(&list, "MODEL_NAME", config->model_name, err);
    if (status == RX_OK)
        status = check_file(&list, "CHECKPOINT_NAME", config->checkpoint_name, err);
    add(&list, config->model_name);
    add(&list, config->checkpoint_name);
    if (status == RX_OK)
        status = check_folder(&list, "OUTPUT_NAME", config->output_name, err);
    return status;
}

rx_status rx_overwrite_check_survey(const rx_settings *settings, const char *image, rx_error *err)
{
    const rx_survey_config *config = (const rx_survey_config *)settings;
    inputs list = {0};
    char *names = rx_strdup(image), *rest = NULL;
    if (names == NULL)
        return rx_error_memory(err, strlen(image));
    for (char *name = strtok_r(names, "\n", &rest); name != NULL; name = strtok_r(NULL, "\n", &rest))
        add(&list, name + (name[0] == '@'));
    add(&list, config->settings.file);
    add(&list, config->tiles_name);
    add_all(&list, &config->weight_image);
    rx_status status = check_file(&list, "MERGED_NAME", config->merged_name, err);
    add(&list, config->merged_name);
    if (status == RX_OK)
        status = check_folder(&list, "OUTPUT_NAME", config->output_name, err);
    free(names);
    return status;
}
