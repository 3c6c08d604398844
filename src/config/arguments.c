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
    rx_text records; /* the names of all files of records, lines */
} found;

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

/* A word that is no option. */
static rx_status take_plain(const rx_keytable *table, const char *word, found *words, rx_error *err)
{
    switch (table->plain) {
    case RX_PLAIN_IMAGES:
        return take_image(word, words, err);
    case RX_PLAIN_FILE:
        if (words->plain != NULL)
            return rx_error_set(err, RX_USAGE,
                                "'%.200s' is one configuration file too many, after '%.200s'; give one", word,
                                words->plain);
        words->plain = word;
        return RX_OK;
    case RX_PLAIN_RECORDS:
        if (word[word[0] == '@'] == '\0')
            return rx_error_set(err, RX_USAGE, "the name of the records is empty; give FILE or @LIST");
        rx_text_printf(&words->records, "%s%s", words->nimages++ > 0 ? "\n" : "", word);
        return words->records.failed ? rx_error_memory(err, 0) : RX_OK;
    case RX_PLAIN_NONE:
        break;
    }
    return rx_error_set(err, RX_USAGE, "'%.200s' is no option; give -c FILE or -KEYWORD VALUE, or see %s -h",
                        word, table->program);
}

/* Options that are no keywords, by what comes of them. */
typedef struct option {
    const char *word;
    rx_action action;
    bool takes; /* a word behind it */
    bool any_case;
    bool images; /* only of the program that takes images */
} option;

static const option *option_of(const rx_keytable *table, const char *word)
{
    static const option options[] = {
        {"-h", RX_ACTION_HELP, false, false, false},
        {"-help", RX_ACTION_HELP, false, false, false},
        {"--help", RX_ACTION_HELP, false, false, false},
        {"-v", RX_ACTION_VERSION, false, false, false},
        {"-version", RX_ACTION_VERSION, false, false, false},
        {"--version", RX_ACTION_VERSION, false, false, false},
        {"-d", RX_ACTION_DUMP, false, false, false},
        {"-dd", RX_ACTION_DUMP_ALL, false, false, false},
        {"-dp", RX_ACTION_DUMP_COLUMNS, false, false, true},
        {"-c", RX_ACTION_RUN, true, false, false},
        {"-FLAGS", RX_ACTION_FLAGS, false, true, true},
        {"-INFO", RX_ACTION_INFO, true, true, false},
    };
    for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
        const option *o = &options[i];
        if ((o->any_case ? strcasecmp(word, o->word) : strcmp(word, o->word)) == 0 &&
            (!o->images || table->plain == RX_PLAIN_IMAGES) &&
            (o->action != RX_ACTION_INFO || table->describes))
            return o;
    }
    return NULL;
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
static rx_status check_keyword(const rx_keytable *table, const char *word, rx_error *err)
{
    char name[80];
    rx_named found;
    const size_t length = strcspn(word + 1, "=");
    snprintf(name, sizeof name, "%.*s", (int)length, word + 1);
    RX_TRY(rx_keyword_look_up(table, name, (rx_place){0}, &found, err));
    if (word[1 + length] == '=')
        return rx_error_set(err, RX_USAGE, "%.200s: keyword and value are two words; give -%s %.200s", word,
                            name, word + 2 + length);
    return RX_OK;
}

/* The word that begins with '-' at argv[*a], which moves on to its value. */
static rx_status take_option(const rx_keytable *table, int argc, char *const *argv, int *a, rx_action *action,
                             found *words, rx_error *err)
{
    const char *word = argv[*a];
    const option *o = option_of(table, word);
    if (o == NULL && is_bare(table, argc, argv, *a))
        return RX_OK;
    if (o == NULL)
        RX_TRY(check_keyword(table, word, err));
    const bool takes = o == NULL || o->takes;
    if (takes && *a + 1 == argc)
        return rx_error_set(err, RX_USAGE, "%.80s has no value; give one after it, or see %s -h", word,
                            table->program);
    if (takes)
        ++*a;
    if (o != NULL && o->action == RX_ACTION_RUN)
        words->file = argv[*a];
    else if (o != NULL)
        *action = o->action;
    if (*action == RX_ACTION_INFO)
        words->image[0] = argv[*a];
    else if (*action == RX_ACTION_FLAGS)
        words->image[0] = argv[*a + 1]; /* NULL behind the last word */
    return RX_OK;
}

static rx_status check_named(const rx_keytable *table, int n, rx_error *err)
{
    const bool images = table->plain == RX_PLAIN_IMAGES;
    return (images || table->plain == RX_PLAIN_RECORDS) && n == 0
               ? rx_error_set(err, RX_USAGE, "no %s named; see %s -h", images ? "image is" : "records are",
                              table->program)
               : RX_OK;
}

/* Sort the words, up to one that asks for something else than a run; keywords are only known to be followed by something. */
static rx_status scan(const rx_keytable *table, int argc, char *const *argv, rx_action *action, found *words,
                      rx_error *err)
{
    if (argc == 2 && strcasecmp(argv[1], "help") == 0 && access(argv[1], F_OK) != 0)
        *action = RX_ACTION_HELP; /* what other programs call it */
    for (int a = 1; a < argc && *action == RX_ACTION_RUN; a++)
        RX_TRY(argv[a][0] == '-' ? take_option(table, argc, argv, &a, action, words, err)
                                 : take_plain(table, argv[a], words, err));
    if (*action != RX_ACTION_RUN)
        return RX_OK;
    if (words->plain != NULL && words->file != NULL)
        RX_TRY(take_plain(table, words->file, words, err));
    if (words->plain != NULL)
        words->file = words->plain;
    if (words->file != NULL && words->file[0] == '\0')
        return rx_error_set(err, RX_USAGE, "the name of the configuration file is empty; give one");
    return words->file == NULL || table->plain != RX_PLAIN_IMAGES ? check_named(table, words->nimages, err)
                                                                  : RX_OK;
}

static rx_status configure(int argc, char *const *argv, const found *words, rx_settings *settings,
                           rx_log *log, rx_error *err)
{
    const rx_keytable *table = settings->table;
    const char *by_default = table->default_file;
    const bool missing = words->file == NULL && by_default != NULL && access(by_default, F_OK) != 0;
    const char *file = words->file != NULL || missing ? words->file : by_default;
    if (file != NULL)
        RX_TRY(rx_settings_read(settings, file, log, err));
    for (int a = 1; a < argc; a++) {
        const option *o = argv[a][0] == '-' ? option_of(table, argv[a]) : NULL;
        if (argv[a][0] != '-')
            continue;
        if (o == NULL && is_bare(table, argc, argv, a))
            RX_TRY(rx_settings_set(settings, argv[a] + 1, "Y", log, err));
        else if (o == NULL)
            RX_TRY(rx_settings_set(settings, argv[a] + 1, argv[a + 1], log, err));
        a += o != NULL || !is_bare(table, argc, argv, a);
    }
    const int row = rx_keyword_find(table, "VERBOSE_TYPE");
    const char *verbose = *(const char *const *)((const char *)settings + table->rows[row].offset);
    log->level = strcmp(verbose, "QUIET") == 0  ? RX_QUIET
                 : strcmp(verbose, "FULL") == 0 ? RX_FULL
                                                : RX_NORMAL;
    if (missing)
        rx_log_warning(log, "%s not found, using internal defaults", by_default);
    return rx_settings_complete(settings, log, err);
}

/* Without an image it is that of the run that is repeated. */
static rx_status take_repeated(const rx_settings *settings, char **image, rx_error *err)
{
    if (settings->repeated.n == 0)
        return check_named(settings->table, *image != NULL, err);
    if (*image == NULL && (*image = rx_strdup(rx_record_find(&settings->repeated, "IMAGE"))) == NULL)
        return rx_error_memory(err, 0);
    return (*image)[0] == '@' ? rx_error_at(err, RX_USAGE, settings->file, -1, 0,
                                            "is of one tile, which %.200s is not; give its image", *image)
                              : RX_OK;
}

/* What is known once the image is: the names of outputs, and that none of them is an input. */
static rx_status settle(rx_settings *settings, const char *image, rx_error *err)
{
    if (image != NULL && settings->table->plain == RX_PLAIN_IMAGES) {
        char *name = rx_name_stem(image);
        const rx_status status =
            name != NULL ? rx_settings_name_tile(settings, name, err) : rx_error_memory(err, 0);
        free(name);
        RX_TRY(status);
    }
    return rx_overwrite_check(settings, image, err);
}

rx_status rx_arguments_read(const rx_keytable *table, int argc, char *const *argv, rx_log *log,
                            rx_arguments *dst, rx_error *err)
{
    found words = {0};
    *dst = (rx_arguments){.action = argc < 2 ? RX_ACTION_NONE : RX_ACTION_RUN};
    if (dst->action == RX_ACTION_NONE)
        return RX_OK;
    rx_status status = scan(table, argc, argv, &dst->action, &words, err);
    for (int i = 0; i < 2 && words.image[i] != NULL; i++)
        rx_text_printf(&words.records, "%s%s", i > 0 ? "," : "", words.image[i]);
    dst->image = words.records.data; /* given on */
    if (status == RX_OK && words.records.failed)
        status = rx_error_memory(err, 0);
    if (status != RX_OK || dst->action != RX_ACTION_RUN)
        return status;
    RX_TRY(rx_settings_new(table, &dst->settings, err));
    RX_TRY(configure(argc, argv, &words, dst->settings, log, err));
    RX_TRY(take_repeated(dst->settings, &dst->image, err));
    return table->plain != RX_PLAIN_IMAGES || dst->image[0] != '@' ? settle(dst->settings, dst->image, err)
                                                                   : RX_OK;
}

void rx_arguments_free(rx_arguments *arguments)
{
    free(arguments->image);
    rx_settings_free(arguments->settings);
    *arguments = (rx_arguments){.action = RX_ACTION_NONE};
}
