/* Reading the command line. */
#include "config/arguments.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "base/text.h"
#include "config/keyword.h"
#include "config/overwrite.h"

/* What a first pass over the words finds; pointers into argv. */
typedef struct found {
    const char *file;  /* of -c, the last one */
    const char *plain; /* as a word of its own, for programs that take it so */
    const char *image[2];
    int nimages;
    rx_text records;    /* the names of all files of records, lines */
    const char *replay; /* of -REPLAY */
} found;

/* Action of a plain option, RX_ACTION_RUN when the word is none. */
static rx_action plain_option(const rx_keytable *table, const char *word)
{
    static const struct {
        const char *word;
        rx_action action;
    } options[] = {
        {"-h", RX_ACTION_HELP},    {"-help", RX_ACTION_HELP},       {"--help", RX_ACTION_HELP},
        {"-v", RX_ACTION_VERSION}, {"-version", RX_ACTION_VERSION}, {"--version", RX_ACTION_VERSION},
        {"-d", RX_ACTION_DUMP},    {"-dd", RX_ACTION_DUMP_ALL},     {"-dp", RX_ACTION_DUMP_COLUMNS},
    };
    for (size_t i = 0; i < sizeof options / sizeof options[0]; i++)
        if (strcmp(word, options[i].word) == 0 &&
            (options[i].action != RX_ACTION_DUMP_COLUMNS || table->plain == RX_PLAIN_IMAGES))
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
    words->nimages += word[0] == '@' ? 2 : count_images(word);
    if (word[0] == '\0' || word[0] == ',' || word[strlen(word) - 1] == ',')
        return rx_error_set(err, RX_USAGE, "an image name is empty; give IMAGE or DETECT,MEASURE");
    if (word[0] == '@' && word[1] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of the list is empty; give @FILE");
    if (words->nimages > 2)
        return rx_error_set(err, RX_USAGE,
                            "'%.200s' is one image too many; give one, two for detection and measurement, or "
                            "the names in a file, one a line, as @FILE (ls *.fits >tiles.list; rextract "
                            "@tiles.list)",
                            word);
    words->image[words->image[0] != NULL] = word;
    return RX_OK;
}

static rx_status take_file(const char *word, found *words, rx_error *err)
{
    if (words->plain != NULL)
        return rx_error_set(err, RX_USAGE,
                            "'%.200s' is one configuration file too many, after '%.200s'; give one", word,
                            words->plain);
    words->plain = word;
    return RX_OK;
}

static rx_status take_records(const char *word, found *words, rx_error *err)
{
    if (word[word[0] == '@'] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of the records is empty; give FILE or @LIST");
    rx_text_printf(&words->records, "%s%s", words->nimages > 0 ? "\n" : "", word);
    words->nimages++;
    return words->records.failed ? rx_error_memory(err, 0) : RX_OK;
}

static rx_status take_plain(const rx_keytable *table, const char *word, found *words, rx_error *err)
{
    switch (table->plain) {
    case RX_PLAIN_IMAGES:
        return take_image(word, words, err);
    case RX_PLAIN_FILE:
        return take_file(word, words, err);
    case RX_PLAIN_RECORDS:
        return take_records(word, words, err);
    case RX_PLAIN_NONE:
        break;
    }
    return rx_error_set(err, RX_USAGE, "'%.200s' is no option; give -c FILE or -KEYWORD VALUE, or see %s -h",
                        word, table->program);
}

/* The only word, and no file of that name: what other programs call their help. */
static bool asks_for_help(int argc, char *const *argv)
{
    return argc == 2 && strcasecmp(argv[1], "help") == 0 && access(argv[1], F_OK) != 0;
}

static bool is_flags(const rx_keytable *table, const char *option)
{
    return table->plain == RX_PLAIN_IMAGES && strcasecmp(option, "-FLAGS") == 0;
}

static bool is_replay(const rx_keytable *table, const char *option)
{
    return table->plain == RX_PLAIN_IMAGES && strcasecmp(option, "-REPLAY") == 0;
}

/* The image and the configuration are those of the run that is repeated. */
static rx_status check_replay(found *words, rx_error *err)
{
    if (words->replay[0] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of the output to repeat is empty; give -REPLAY FILE");
    if (words->image[0] != NULL || words->file != NULL)
        return rx_error_set(err, RX_USAGE,
                            "-REPLAY takes image and configuration from %.200s; leave out '%.200s'",
                            words->replay, words->image[0] != NULL ? words->image[0] : words->file);
    words->image[0] = words->replay;
    return RX_OK;
}

/* -PLAN alone is -PLAN Y. */
static bool is_bare(const rx_keytable *table, int argc, char *const *argv, int a)
{
    static const char *const answers[] = {"Y", "YES", "N", "NO"};
    if (table->plain != RX_PLAIN_IMAGES || strcasecmp(argv[a], "-PLAN") != 0)
        return false;
    for (size_t i = 0; a + 1 < argc && i < sizeof answers / sizeof answers[0]; i++)
        if (strcasecmp(argv[a + 1], answers[i]) == 0)
            return false;
    return true;
}

/* A word that begins with '-' and is no keyword is said to be none before its value is missed. */
static rx_status check_option(const rx_keytable *table, const char *option, rx_error *err)
{
    char name[80];
    const size_t length = strcspn(option + 1, "=");
    if (strcmp(option, "-c") == 0 || is_flags(table, option) || is_replay(table, option) ||
        (table->describes && strcasecmp(option, "-INFO") == 0))
        return RX_OK;
    snprintf(name, sizeof name, "%.*s", (int)length, option + 1);
    RX_TRY(rx_keyword_known(table, name, (rx_place){0}, err));
    if (option[1 + length] == '=')
        return rx_error_set(err, RX_USAGE, "%.200s: keyword and value are two words; give -%s %.200s", option,
                            name, option + 2 + length);
    return RX_OK;
}

/* Sort the words; keywords are only known to be followed by something. */
static rx_status scan(const rx_keytable *table, int argc, char *const *argv, rx_action *action, found *words,
                      rx_error *err)
{
    rx_status status = RX_OK;
    if (asks_for_help(argc, argv)) {
        *action = RX_ACTION_HELP;
        return RX_OK;
    }
    for (int a = 1; a < argc && status == RX_OK; a++) {
        if (argv[a][0] != '-') {
            status = take_plain(table, argv[a], words, err);
            continue;
        }
        *action = plain_option(table, argv[a]);
        if (*action != RX_ACTION_RUN)
            return RX_OK;
        if (is_bare(table, argc, argv, a))
            continue;
        const bool flags = is_flags(table, argv[a]);
        RX_TRY(check_option(table, argv[a], err));
        if (a + 1 == argc && !flags)
            return rx_error_set(err, RX_USAGE, "%.80s has no value; give one after it, or see %s -h", argv[a],
                                table->program);
        const char *option = argv[a++];
        if (flags || (table->describes && strcasecmp(option, "-INFO") == 0)) {
            *action = flags ? RX_ACTION_FLAGS : RX_ACTION_INFO;
            words->image[0] = argv[a];
            return RX_OK;
        }
        if (is_replay(table, option))
            words->replay = argv[a];
        if (strcmp(option, "-c") == 0)
            words->file = argv[a];
    }
    if (status == RX_OK && words->replay != NULL) {
        *action = RX_ACTION_REPLAY;
        return check_replay(words, err);
    }
    if (status == RX_OK && words->plain != NULL && words->file != NULL)
        status = take_file(words->file, words, err);
    if (words->plain != NULL)
        words->file = words->plain;
    if (status == RX_OK && words->file != NULL && words->file[0] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of the configuration file is empty; give one");
    const bool needed = table->plain == RX_PLAIN_IMAGES || table->plain == RX_PLAIN_RECORDS;
    if (status == RX_OK && needed && words->nimages == 0)
        return rx_error_set(err, RX_USAGE, "no %s named; see %s -h",
                            table->plain == RX_PLAIN_IMAGES ? "image is" : "records are", table->program);
    return status;
}

/* log->level as VERBOSE_TYPE has it. */
static void set_level(const rx_settings *settings, rx_log *log)
{
    int row = rx_keyword_find(settings->table, "VERBOSE_TYPE");
    const char *word = *(const char *const *)((const char *)settings + settings->table->rows[row].offset);
    if (strcmp(word, "QUIET") == 0)
        log->level = RX_QUIET;
    else
        log->level = strcmp(word, "FULL") == 0 ? RX_FULL : RX_NORMAL;
}

static rx_status configure(int argc, char *const *argv, const found *words, rx_settings *settings,
                           rx_log *log, rx_error *err)
{
    rx_status status = RX_OK;
    const char *usual = words->replay == NULL ? settings->table->default_file : NULL;
    bool missing = words->file == NULL && usual != NULL && access(usual, F_OK) != 0;
    const char *file = words->file != NULL || missing ? words->file : usual;
    if (file != NULL)
        status = rx_settings_read(settings, file, log, err);
    for (int a = 1; a < argc && status == RX_OK; a++)
        if (is_bare(settings->table, argc, argv, a))
            status = rx_settings_set(settings, argv[a] + 1, "Y", log, err);
        else if (argv[a][0] == '-') {
            const char *option = argv[a++];
            if (strcmp(option, "-c") != 0 && !is_replay(settings->table, option))
                status = rx_settings_set(settings, option + 1, argv[a], log, err);
        }
    if (status != RX_OK)
        return status;
    set_level(settings, log);
    if (missing)
        rx_log_warning(log, "%s not found, using internal defaults", usual);
    return rx_settings_complete(settings, log, err);
}

/* What is known once the image is: the names of outputs, and that none of them is an input. */
static rx_status settle(rx_settings *settings, const char *image, rx_error *err)
{
    rx_status status = RX_OK;
    if (image != NULL && settings->table->plain == RX_PLAIN_IMAGES) {
        char *name = rx_name_stem(image);
        status = name != NULL ? rx_settings_name_tile(settings, name, err) : rx_error_memory(err, 0);
        free(name);
    }
    return status == RX_OK ? rx_overwrite_check(settings, image, err) : status;
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

rx_status rx_arguments_read(const rx_keytable *table, int argc, char *const *argv, rx_log *log,
                            rx_arguments *dst, rx_error *err)
{
    found words = {0};
    *dst = (rx_arguments){.action = argc < 2 ? RX_ACTION_NONE : RX_ACTION_RUN};
    if (dst->action == RX_ACTION_NONE)
        return RX_OK;
    rx_status status = scan(table, argc, argv, &dst->action, &words, err);
    const bool runs = dst->action == RX_ACTION_RUN, replays = dst->action == RX_ACTION_REPLAY;
    const bool takes = dst->action == RX_ACTION_INFO || dst->action == RX_ACTION_FLAGS;
    if (status != RX_OK || (!runs && !replays && !takes)) {
        rx_text_free(&words.records);
        return status;
    }
    if (words.records.length > 0)
        dst->image = words.records.data; /* given on */
    else if (words.image[0] != NULL && (dst->image = join_images(&words)) == NULL)
        return rx_error_memory(err, 0);
    if (!runs && !replays)
        return RX_OK;
    status = rx_settings_new(table, &dst->settings, err);
    if (status == RX_OK)
        status = configure(argc, argv, &words, dst->settings, log, err);
    if (status == RX_OK && runs && (table->plain != RX_PLAIN_IMAGES || dst->image[0] != '@'))
        status = settle(dst->settings, dst->image, err);
    return status;
}

void rx_arguments_free(rx_arguments *arguments)
{
    free(arguments->image);
    rx_settings_free(arguments->settings);
    *arguments = (rx_arguments){.action = RX_ACTION_NONE};
}
