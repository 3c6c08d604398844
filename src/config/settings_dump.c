/* The keyword table as text for people: a configuration file, and the names for -h. */
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
        for (size_t i = 0; key->words[i] != NULL; i++)
            rx_text_printf(&help, "%s%s",
                           i == 0                      ? ""
                           : key->words[i + 1] != NULL ? ", "
                                                       : " or ",
                           key->words[i]);
        rx_text_add(&help, "]");
    } else if (key->kind == RX_KIND_BOOL || key->kind == RX_KIND_BOOLS) {
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
