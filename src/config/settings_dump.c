/* The keyword table as text for people: a configuration file, and the section of the manual page. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "config/keyword.h"
#include "config/settings.h"

enum { VALUE_COLUMN = 25, COMMENT_COLUMN = 42, WIDTH = 100 };

static void pad(rx_text *dst, size_t from, int column)
{
    size_t used = dst->length - from;
    do
        rx_text_add(dst, " ");
    while (!dst->failed && ++used < (size_t)column);
}

/* Words of `text` as comments from COMMENT_COLUMN on, behind what stands in the line. */
static void add_comment(rx_text *dst, size_t line, const char *text)
{
    bool fresh = dst->length - line >= COMMENT_COLUMN; /* must a new line begin? */
    for (bool first = true; *text != '\0' && !dst->failed; first = false) {
        const size_t word = strcspn(text, " ");
        if (fresh || (!first && dst->length - line + 1 + word > WIDTH)) {
            rx_text_add(dst, "\n");
            line = dst->length;
            fresh = false;
            first = true;
        }
        if (first) {
            pad(dst, line, COMMENT_COLUMN);
            rx_text_add(dst, "#");
        }
        rx_text_add(dst, " ");
        rx_text_add_bytes(dst, text, word);
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

static bool has_effect(const rx_keyword *key)
{
    return key->status == RX_STATUS_SEX || key->status == RX_STATUS_OURS;
}

static bool is_bool(const rx_keyword *key)
{
    return key->kind == RX_KIND_BOOL || key->kind == RX_KIND_BOOLS;
}

/* One keyword of the table; settings NULL: with its default. */
static void dump_key(rx_text *dst, const rx_keytable *table, const rx_settings *settings, const char *prefix,
                     int row)
{
    static const char *const roles[] = {[RX_FILE_NONE] = "",
                                        [RX_FILE_TEXT] = "",
                                        [RX_FILE_READS] = " [read]",
                                        [RX_FILE_WRITES] = " [written]",
                                        [RX_FILE_FOLDER] = " [folder that is replaced]"};
    const rx_keyword *key = &table->rows[row];
    rx_text help = {0};
    size_t line = dst->length;
    rx_text_printf(dst, "%s%s", prefix, key->name);
    pad(dst, line, VALUE_COLUMN);
    if (settings != NULL)
        rx_keyword_print(dst, settings, row, true);
    else
        rx_text_add(dst, key->initial);
    rx_text_printf(&help, "%s%s", key->help, roles[key->role]);
    if (key->words != NULL) {
        rx_text_add(&help, " [");
        add_words(&help, key->words, "-");
        rx_text_add(&help, "]");
    } else if (is_bool(key)) {
        rx_text_add(&help, " [Y or N]");
    }
    if (!has_effect(key))
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
        if (!has_effect(key))
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

void rx_settings_man(rx_text *dst, const rx_keytable *table)
{
    static const char *const kinds[] = {
        [RX_KIND_STRING] = "text",  [RX_KIND_STRINGS] = "text", [RX_KIND_INT] = "integer",
        [RX_KIND_INTS] = "integer", [RX_KIND_REAL] = "number",  [RX_KIND_REALS] = "number",
        [RX_KIND_BOOL] = "Y|N",     [RX_KIND_BOOLS] = "Y|N",    [RX_KIND_WORD] = "word",
        [RX_KIND_WORDS] = "word"};
    static const char *const status[] = {
        [RX_STATUS_SEX] = "",
        [RX_STATUS_OURS] = "Own keyword.\n",
        [RX_STATUS_IGNORED] = "Accepted, without effect here: a warning when it is not at its default.\n",
        [RX_STATUS_INERT] = "Accepted, without effect here.\n"};
    for (int row = 0; row < table->nrows; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->kind == RX_KIND_SECTION) {
            rx_text_printf(dst, ".SS %s\n", key->name);
            continue;
        }
        rx_text_printf(dst, ".TP\n.BR %s \" \\fI%s\\fP (%s)\"\n%s.\n", key->name, kinds[key->kind],
                       key->initial[0] == '\0' ? "empty" : key->initial, key->help);
        man_range(dst, key);
        if (key->needs != NULL)
            rx_text_printf(dst, "Needs %s.\n", key->needs);
        if (table == rx_keytable_rextract()) /* SExtractor's are among its keywords */
            rx_text_add(dst, status[key->status]);
    }
}

void rx_settings_completion(rx_text *dst, const rx_keytable *table)
{
    rx_text_printf(dst, "    %s)\n        keys='", table->program);
    for (int row = 0; row < table->nrows; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->kind == RX_KIND_SECTION || !has_effect(key))
            continue;
        rx_text_printf(dst, " %s:", key->name);
        if (is_bool(key))
            rx_text_add(dst, "Y,N");
        for (size_t i = 0; key->words != NULL && key->words[i] != NULL; i++)
            rx_text_printf(dst, "%s%s", i > 0 ? "," : "", key->words[i]);
    }
    rx_text_add(dst, "' ;;\n");
}
