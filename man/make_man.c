/* Prints the generated sections of the manual pages: `make_man keywords` or `make_man columns`. Run by
 * man/check-man.sh, never installed. */
#include <stdio.h>
#include <string.h>

#include "catalog/catalog.h"
#include "config/config.h"

int main(int argc, char **argv)
{
    rx_text text = {0};
    if (argc == 2 && strcmp(argv[1], "keywords") == 0)
        rx_config_man(&text);
    else if (argc == 2 && strcmp(argv[1], "columns") == 0)
        rx_columns_man(&text);
    if (text.data == NULL || text.failed || fputs(text.data, stdout) == EOF)
        return 1;
    rx_text_free(&text);
    return 0;
}
