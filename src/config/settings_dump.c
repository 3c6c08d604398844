/* The keyword table as text for people: a configuration file, and the section of the manual page. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "config/keyword.h"

enum { VALUE_COLUMN = 25, COMMENT_COLUMN = 42, WIDTH = 100 };

static void pad(rx_text *dst, size_t from, int column)
{
    size_t used = dst->length - from;
    do
        rx_text_add(dst, " ");
    while (!dst->failed && ++used < (size_t)column);
}

/* Words of `text` as comments from COMMENT_COLUMN on; the first line is begun by the caller. */
static void add_comment(rx_text *dst, size_t line, const char *text)
{
    bool fresh = true;
    if (dst->length - line >= COMMENT_COLUMN) {
        rx_text_add(dst, "\n");
        line = dst->length;
    }
    pad(dst, line, COMMENT_COLUMN);
    rx_text_add(dst, "#");
    while (*text != '\0' && !dst->failed) {
        size_t word = strcspn(text, " ");
        if (!fresh && dst->length - line + 1 + word > WIDTH) {
            rx_text_add(dst, "\n");
            line = dst->length;
            pad(dst, line, COMMENT_COLUMN);
            rx_text_add(dst, "#");
        }
        rx_text_add(dst, " ");
        rx_text_add_bytes(dst, text, word);
        fresh = false;
        text += word + strspn(text + word, " ");
    }
    rx_text_add(dst, "\n");
}

/* "A, B or C" of the legal words. */
static void add_words(rx_text *dst, const char *const *words, const char *dash)
{
    for (size_t i = 0; words[i] != NULL; i++) {
        const char *joint = i == 0 ? "" : words[i + 1] != NULL ? ", " : " or ";
        const char *word = words[i];
        rx_text_printf(dst, "%s%s%s", joint, word[0] == '-' ? dash : "", word + (word[0] == '-'));
    }
}

static void dump_section(rx_text *dst, const char *prefix, const char *title)
{
    size_t line = dst->length + 1;
    rx_text_add(dst, "\n#");
    int left = (WIDTH - 3 - (int)strlen(prefix) - (int)strlen(title)) / 2;
    for (int i = 0; i < left; i++)
        rx_text_add(dst, "-");
    rx_text_printf(dst, " %s%s ", prefix, title);
    while (!dst->failed && dst->length - line < WIDTH)
        rx_text_add(dst, "-");
    rx_text_add(dst, "\n\n");
}

/* What becomes of the file that a keyword names. */
static const char *role(const rx_keyword *key)
{
    return key->role == RX_FILE_READS    ? " [read]"
           : key->role == RX_FILE_WRITES ? " [written]"
           : key->role == RX_FILE_FOLDER ? " [folder that is replaced]"
                                         : "";
}

/* One keyword of the table; settings NULL: with its default. */
static void dump_key(rx_text *dst, const rx_keytable *table, const rx_settings *settings, const char *prefix,
                     int row)
{
    const rx_keyword *key = &table->rows[row];
    rx_text help = {0};
    size_t line = dst->length;
    rx_text_printf(dst, "%s%s", prefix, key->name);
    pad(dst, line, VALUE_COLUMN);
    if (settings != NULL)
        rx_keyword_print(dst, settings, row, true);
    else
        rx_text_add(dst, key->initial);
    rx_text_printf(&help, "%s%s", key->help, role(key));
    if (key->words != NULL) {
        rx_text_add(&help, " [");
        add_words(&help, key->words, "-");
        rx_text_add(&help, "]");
    } else if (key->kind == RX_KIND_BOOL || key->kind == RX_KIND_BOOLS) {
        rx_text_add(&help, " [Y or N]");
    }
    if (key->status == RX_STATUS_IGNORED || key->status == RX_STATUS_INERT)
        rx_text_add(&help, "; no effect here");
    add_comment(dst, line, help.failed ? key->help : help.data);
    rx_text_free(&help);
}

/* The rows of the table, and then those of its parts. */
static void dump_rows(rx_text *dst, const rx_keytable *table, const rx_settings *settings, const char *prefix,
                      bool all)
{
    int section = -1;
    for (int row = 0; row < table->nrows; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->kind == RX_KIND_SECTION) {
            section = row;
        } else if (all || key->level == RX_LEVEL_D) {
            if (section >= 0)
                dump_section(dst, prefix, table->rows[section].name);
            section = -1;
            dump_key(dst, table, settings, prefix, row);
        }
    }
    for (int i = 0; all && i < RX_PARTS && table->part[i].prefix != NULL; i++)
        dump_rows(dst, table->part[i].table(), settings != NULL ? settings->part[i] : NULL,
                  table->part[i].prefix, all);
}

void rx_settings_dump(rx_text *dst, const rx_keytable *table, const rx_settings *settings, bool all)
{
    const char *which = all ? "Default extended" : "Default";
    rx_text_printf(dst, "# %s configuration file for %s\n", settings != NULL ? "The" : which, table->title);
    dump_rows(dst, table, settings, settings != NULL ? settings->prefix : "", all);
}

/* A section's title, and behind it, in lines of their own column, its keywords that have an effect. */
static void help_section(rx_text *dst, const rx_keytable *table, int section)
{
    enum { COLUMN = 24, END = 80 };
    size_t line = 0;
    for (int row = section + 1; row < table->nrows && table->rows[row].kind != RX_KIND_SECTION; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->status == RX_STATUS_IGNORED || key->status == RX_STATUS_INERT)
            continue;
        if (line == 0) {
            line = dst->length;
            rx_text_printf(dst, "  %s", table->rows[section].name);
        }
        const size_t used = dst->length - line; /* a long title has a line of its own */
        if (used >= COLUMN && (key == &table->rows[section + 1] || used + 1 + strlen(key->name) > END)) {
            rx_text_add(dst, "\n");
            line = dst->length;
        }
        pad(dst, line, COLUMN);
        rx_text_add(dst, key->name);
    }
    if (line != 0)
        rx_text_add(dst, "\n");
}

void rx_settings_help(rx_text *dst, const rx_keytable *table)
{
    rx_text_add(dst, "\nKeywords by task (-dd says what each is for, -d the usual ones):\n\n");
    for (int row = 0; row < table->nrows; row++)
        if (table->rows[row].kind == RX_KIND_SECTION)
            help_section(dst, table, row);
}

/* What values are legal, as sentences. */
static void man_range(rx_text *dst, const rx_keyword *key)
{
    if (key->words != NULL) {
        rx_text_add(dst, "One of ");
        add_words(dst, key->words, "\\-");
        rx_text_add(dst, ".\n");
    } else if (key->high > key->low) {
        rx_text_printf(dst, "From %s%.10g to %.10g.\n", key->low < 0 ? "\\-" : "", fabs(key->low), key->high);
    }
    if (key->nmax > key->nmin && key->nmax > 1)
        rx_text_printf(dst, "A list of %d to %d.\n", key->nmin, key->nmax);
    else if (key->nmax > 1)
        rx_text_printf(dst, "A list of %d.\n", key->nmax);
}

/* Are there keywords of SExtractor's in the table, so that own ones must be marked? */
static bool is_mixed(const rx_keytable *table)
{
    for (int row = 0; row < table->nrows; row++)
        if (table->rows[row].kind != RX_KIND_SECTION && table->rows[row].status != RX_STATUS_OURS)
            return true;
    return false;
}

static const char *man_status(rx_keyword_status status)
{
    switch (status) {
    case RX_STATUS_OURS:
        return "Own keyword.\n";
    case RX_STATUS_IGNORED:
        return "Accepted, without effect here: a warning when it is not at its default.\n";
    case RX_STATUS_INERT:
        return "Accepted, without effect here.\n";
    case RX_STATUS_SEX:
        break;
    }
    return "";
}

static const char *man_kind(rx_kind kind)
{
    switch (kind) {
    case RX_KIND_STRING:
    case RX_KIND_STRINGS:
        return "text";
    case RX_KIND_INT:
    case RX_KIND_INTS:
        return "integer";
    case RX_KIND_REAL:
    case RX_KIND_REALS:
        return "number";
    case RX_KIND_BOOL:
    case RX_KIND_BOOLS:
        return "Y|N";
    default:
        return "word";
    }
}

void rx_settings_man(rx_text *dst, const rx_keytable *table)
{
    const bool mixed = is_mixed(table);
    for (int row = 0; row < table->nrows; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->kind == RX_KIND_SECTION) {
            rx_text_printf(dst, ".SS %s\n", key->name);
            continue;
        }
        rx_text_printf(dst, ".TP\n.BR %s \" \\fI%s\\fP ", key->name, man_kind(key->kind));
        if (key->initial[0] == '\0')
            rx_text_add(dst, "(empty)\"\n");
        else
            rx_text_printf(dst, "(%s)\"\n", key->initial);
        rx_text_add(dst, key->help);
        rx_text_add(dst, ".\n");
        man_range(dst, key);
        if (key->needs != NULL)
            rx_text_printf(dst, "Needs %s.\n", key->needs);
        if (mixed)
            rx_text_add(dst, man_status(key->status));
    }
}

void rx_settings_completion(rx_text *dst, const rx_keytable *table)
{
    rx_text_printf(dst, "    %s)\n        keys='", table->program);
    for (int row = 0; row < table->nrows; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->kind == RX_KIND_SECTION || key->status == RX_STATUS_IGNORED ||
            key->status == RX_STATUS_INERT)
            continue;
        rx_text_printf(dst, " %s:", key->name);
        if (key->kind == RX_KIND_BOOL || key->kind == RX_KIND_BOOLS)
            rx_text_add(dst, "Y,N");
        for (size_t i = 0; key->words != NULL && key->words[i] != NULL; i++)
            rx_text_printf(dst, "%s%s", i > 0 ? "," : "", key->words[i]);
    }
    rx_text_add(dst, "' ;;\n");
}
