/* Prints the generated sections of the manual pages: `make_man keywords`, `make_man simulate`, `make_man
 * validate`, `make_man train`, `make_man survey` (keywords of these programs), `make_man columns`, `make_man facts`, the name of a
 * column of flags, or `make_man completion`, for the shell. Run by man/check-man.sh, never installed. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "catalog/columns.h"
#include "config/keyword.h"
#include "config/settings.h"
#include "data/facts.h"
#include "data/flags.h"

/* Text that roff takes literally. */
static void add_roff(rx_text *dst, const char *text)
{
    for (; *text != '\0'; text++) {
        if (*text == '-')
            rx_text_add(dst, "\\-");
        else if (*text == '\\')
            rx_text_add(dst, "\\e");
        else
            rx_text_add_bytes(dst, text, 1);
    }
}

/* What values are legal, as sentences. */
static void man_range(rx_text *dst, const rx_keyword *key)
{
    if (key->words != NULL) {
        rx_text_add(dst, "One of ");
        for (size_t i = 0; key->words[i] != NULL; i++)
            rx_text_printf(dst, "%s%s%s",
                           i == 0                      ? ""
                           : key->words[i + 1] != NULL ? ", "
                                                       : " or ",
                           key->words[i][0] == '-' ? "\\" : "", key->words[i]);
        rx_text_add(dst, ".\n");
    } else if (key->high > key->low) {
        rx_text_printf(dst, "From %s%.10g to %.10g.\n", key->low < 0 ? "\\-" : "", fabs(key->low), key->high);
    }
    if (key->nmax > key->nmin && key->nmax > 1)
        rx_text_printf(dst, "A list of %d to %d.\n", key->nmin, key->nmax);
    else if (key->nmax > 1)
        rx_text_printf(dst, "A list of %d.\n", key->nmax);
}

/* The table as roff (man macros). */
static void settings_man(rx_text *dst, const rx_keytable *table)
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

/* The keywords that have an effect, each with its legal words, as a branch of the shell's completion. */
static void completion(rx_text *dst, const rx_keytable *table)
{
    rx_text_printf(dst, "    %s)\n        keys='", table->program);
    for (int row = 0; row < table->nrows; row++) {
        const rx_keyword *key = &table->rows[row];
        if (key->kind == RX_KIND_SECTION || key->status >= RX_STATUS_IGNORED)
            continue;
        rx_text_printf(dst, " %s:", key->name);
        if (key->kind == RX_KIND_BOOL || key->kind == RX_KIND_BOOLS)
            rx_text_add(dst, "Y,N");
        for (size_t i = 0; key->words != NULL && key->words[i] != NULL; i++)
            rx_text_printf(dst, "%s%s", i > 0 ? "," : "", key->words[i]);
    }
    rx_text_add(dst, "' ;;\n");
}

static void columns_man(rx_text *dst)
{
    int n;
    const rx_column_def *defs = rx_column_defs(&n);
    for (int i = 0; i < n; i++) {
        rx_text_printf(dst, ".TP\n.B %s%s\n", defs[i].name,
                       defs[i].naxis == 2   ? "(w,h)"
                       : defs[i].naxis == 1 ? "(n)"
                                            : "");
        add_roff(dst, defs[i].description);
        if (defs[i].unit[0] != '\0') {
            rx_text_add(dst, " [");
            add_roff(dst, defs[i].unit);
            rx_text_add(dst, "]");
        }
        rx_text_add(dst, "\n");
    }
}

int main(int argc, char **argv)
{
    rx_text text = {0};
    if (argc == 2 && strcmp(argv[1], "keywords") == 0)
        settings_man(&text, rx_keytable_rextract());
    else if (argc == 2 && strcmp(argv[1], "simulate") == 0)
        settings_man(&text, rx_keytable_simulate());
    else if (argc == 2 && strcmp(argv[1], "validate") == 0)
        settings_man(&text, rx_keytable_validate());
    else if (argc == 2 && strcmp(argv[1], "train") == 0)
        settings_man(&text, rx_keytable_train());
    else if (argc == 2 && strcmp(argv[1], "survey") == 0)
        settings_man(&text, rx_keytable_survey());
    else if (argc == 2 && strcmp(argv[1], "columns") == 0)
        columns_man(&text);
    else if (argc == 2 && strcmp(argv[1], "facts") == 0)
        rx_facts_man(&text);
    else if (argc == 2 && strcmp(argv[1], "completion") == 0) {
        completion(&text, rx_keytable_rextract());
        completion(&text, rx_keytable_simulate());
        completion(&text, rx_keytable_validate());
        completion(&text, rx_keytable_train());
        completion(&text, rx_keytable_survey());
    } else if (argc == 2 && strncmp(argv[1], "FLAGS", 5) == 0)
        rx_flags_man(argv[1], &text);
    if (text.data == NULL || text.failed || fputs(text.data, stdout) == EOF)
        return 1;
    rx_text_free(&text);
    return 0;
}
