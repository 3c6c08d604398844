/* Prints the generated sections of the manual pages: `make_man keywords`, `make_man simulate`, `make_man
 * validate`, `make_man train`, `make_man survey` (keywords of these programs), `make_man columns`, `make_man facts`, the name of a
 * column of flags, or `make_man completion`, for the shell. Run by man/check-man.sh, never installed. */
#include <stdio.h>
#include <string.h>

#include "catalog/catalog.h"
#include "config/config_fields.h"
#include "data/facts.h"
#include "data/flags.h"

int main(int argc, char **argv)
{
    rx_text text = {0};
    if (argc == 2 && strcmp(argv[1], "keywords") == 0)
        rx_settings_man(&text, rx_keytable_rextract());
    else if (argc == 2 && strcmp(argv[1], "simulate") == 0)
        rx_settings_man(&text, rx_keytable_simulate());
    else if (argc == 2 && strcmp(argv[1], "validate") == 0)
        rx_settings_man(&text, rx_keytable_validate());
    else if (argc == 2 && strcmp(argv[1], "train") == 0)
        rx_settings_man(&text, rx_keytable_train());
    else if (argc == 2 && strcmp(argv[1], "survey") == 0)
        rx_settings_man(&text, rx_keytable_survey());
    else if (argc == 2 && strcmp(argv[1], "columns") == 0)
        rx_columns_man(&text);
    else if (argc == 2 && strcmp(argv[1], "facts") == 0)
        rx_facts_man(&text);
    else if (argc == 2 && strcmp(argv[1], "completion") == 0) {
        rx_settings_completion(&text, rx_keytable_rextract());
        rx_settings_completion(&text, rx_keytable_simulate());
        rx_settings_completion(&text, rx_keytable_validate());
        rx_settings_completion(&text, rx_keytable_train());
        rx_settings_completion(&text, rx_keytable_survey());
    } else if (argc == 2 && strncmp(argv[1], "FLAGS", 5) == 0)
        rx_flags_man(argv[1], &text);
    if (text.data == NULL || text.failed || fputs(text.data, stdout) == EOF)
        return 1;
    rx_text_free(&text);
    return 0;
}
