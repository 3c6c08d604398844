/* Names of files, one by one or in lists. */
#include "survey/file_names.h"

#include <stdlib.h>
#include <string.h>

#include "base/lines.h"
#include "base/memory.h"

static rx_status add_name(rx_file_names *files, const char *name, rx_error *err)
{
    char **grown = rx_regrow(files->of, (size_t)files->n + 1, sizeof *grown), *own = rx_strdup(name);
    if (grown != NULL)
        files->of = grown;
    if (grown == NULL || own == NULL) {
        free(own);
        return rx_error_memory(err, 0);
    }
    files->of[files->n++] = own;
    return RX_OK;
}

static rx_status read_list(rx_file_names *files, const char *path, rx_error *err)
{
    rx_lines lines;
    char *line = NULL;
    rx_status status = rx_lines_open(&lines, path, 0, err);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL) {
        line[strcspn(line, "\r")] = '\0';
        if (line[0] != '#' && line[strspn(line, " \t")] != '\0')
            status = add_name(files, line, err);
    }
    rx_lines_close(&lines);
    return status;
}

rx_status rx_file_names_read(const char *given, rx_file_names *dst, rx_error *err)
{
    rx_status status = RX_OK;
    *dst = (rx_file_names){0};
    for (const char *at = given; *at != '\0' && status == RX_OK;) {
        const size_t length = strcspn(at, "\n");
        char *one = strndup(at, length);
        status = one == NULL     ? rx_error_memory(err, length)
                 : one[0] == '@' ? read_list(dst, one + 1, err)
                                 : add_name(dst, one, err);
        free(one);
        at += length + (at[length] == '\n');
    }
    return status;
}

void rx_file_names_free(rx_file_names *names)
{
    for (int i = 0; i < names->n; i++)
        free(names->of[i]);
    free(names->of);
    *names = (rx_file_names){0};
}
