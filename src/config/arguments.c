/* Reading the command line. */
#include "config/arguments.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "config/config_fields.h"
#include "config/overwrite.h"

static const char default_file[] = "default.sex";

/* What a first pass over the words finds; pointers into argv. */
typedef struct found {
    const char *file;
    const char *image[2];
    int nimages;
} found;

/* Action of a plain option, RX_ACTION_RUN when the word is none. */
static rx_action plain_option(const char *word)
{
    static const struct {
        const char *word;
        rx_action action;
    } options[] = {
        {"-h", RX_ACTION_HELP},          {"--help", RX_ACTION_HELP},       {"-v", RX_ACTION_VERSION},
        {"-d", RX_ACTION_DUMP},          {"--version", RX_ACTION_VERSION}, {"-dd", RX_ACTION_DUMP_ALL},
        {"-dp", RX_ACTION_DUMP_COLUMNS},
    };
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++)
        if (strcmp(word, options[i].word) == 0)
            return options[i].action;
    return RX_ACTION_RUN;
}

/* A comma outside [..] parts two images; cfitsio's sections hold commas of their own. */
static int count_images(const char *word)
{
    int n = 1, depth = 0;
    for (; *word != '\0'; word++) {
        depth += (*word == '[') - (*word == ']');
        n += *word == ',' && depth == 0;
    }
    return n;
}

static rx_status take_image(const char *word, found *words, rx_error *err)
{
    words->nimages += count_images(word);
    if (word[0] == '\0' || word[0] == ',' || word[strlen(word) - 1] == ',')
        return rx_error_set(err, RX_USAGE, "an image name is empty; give IMAGE or DETECT,MEASURE");
    if (words->nimages > 2)
        return rx_error_set(err, RX_USAGE,
                            "'%.200s' is one image too many; give one, or two for detection and measurement",
                            word);
    words->image[words->image[0] != NULL] = word;
    return RX_OK;
}

/* Sort the words; keywords are only known to be followed by something. */
static rx_status scan(int argc, char *const *argv, rx_action *action, found *words, rx_error *err)
{
    rx_status status = RX_OK;
    for (int a = 1; a < argc && status == RX_OK; a++) {
        if (argv[a][0] != '-') {
            status = take_image(argv[a], words, err);
            continue;
        }
        *action = plain_option(argv[a]);
        if (*action != RX_ACTION_RUN)
            return RX_OK;
        if (a + 1 == argc)
            return rx_error_set(err, RX_USAGE, "%.80s has no value; give one after it, or see rextract -h",
                                argv[a]);
        if (strcmp(argv[a++], "-c") == 0)
            words->file = argv[a];
    }
    if (status == RX_OK && words->nimages == 0)
        return rx_error_set(err, RX_USAGE, "no image is named; see rextract -h");
    return status;
}

static rx_status configure(int argc, char *const *argv, const found *words, rx_config *config, rx_log *log,
                           rx_error *err)
{
    rx_status status = RX_OK;
    bool missing = words->file == NULL && access(default_file, F_OK) != 0;
    if (!missing)
        status = rx_config_read(config, words->file != NULL ? words->file : default_file, log, err);
    for (int a = 1; a < argc && status == RX_OK; a++)
        if (argv[a][0] == '-') {
            const char *option = argv[a++];
            if (strcmp(option, "-c") != 0)
                status = rx_config_set(config, option + 1, argv[a], log, err);
        }
    if (status != RX_OK)
        return status;
    if (strcmp(config->verbose_type, "QUIET") == 0)
        log->level = RX_QUIET;
    else
        log->level = strcmp(config->verbose_type, "FULL") == 0 ? RX_FULL : RX_NORMAL;
    if (missing)
        rx_log_warning(log, "%s not found, using internal defaults", default_file);
    return rx_config_check(config, log, err);
}

static char *join_images(const found *words)
{
    rx_text text = {0};
    rx_text_add(&text, words->image[0]);
    if (words->image[1] != NULL)
        rx_text_printf(&text, ",%s", words->image[1]);
    if (text.failed)
        rx_text_free(&text);
    return text.data;
}

rx_status rx_arguments_read(int argc, char *const *argv, rx_log *log, rx_arguments *dst, rx_error *err)
{
    found words = {0};
    *dst = (rx_arguments){.action = argc < 2 ? RX_ACTION_NONE : RX_ACTION_RUN};
    if (dst->action == RX_ACTION_NONE)
        return RX_OK;
    rx_status status = scan(argc, argv, &dst->action, &words, err);
    if (status != RX_OK || dst->action != RX_ACTION_RUN)
        return status;
    dst->image = join_images(&words);
    if (dst->image == NULL)
        return rx_error_memory(err, 0);
    status = rx_config_new(&dst->config, err);
    if (status == RX_OK)
        status = configure(argc, argv, &words, dst->config, log, err);
    if (status == RX_OK)
        status = rx_overwrite_check(dst->config, dst->image, err);
    return status;
}

void rx_arguments_free(rx_arguments *arguments)
{
    free(arguments->image);
    rx_config_free(arguments->config);
    *arguments = (rx_arguments){.action = RX_ACTION_NONE};
}
