/* Reading .conv files. */
#include "config/kernel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lines.h"
#include "base/memory.h"

/* The line "CONV NORM" or "CONV NONORM"; CONV alone means NORM, as for SExtractor. */
static rx_status read_head(const char *path, long number, char *line, bool *normalise, rx_error *err)
{
    char *rest = NULL;
    const char *word = strtok_r(line, " \t\r", &rest);
    if (word == NULL || strcmp(word, "CONV") != 0)
        return rx_error_at(err, RX_USAGE, path, -1, number,
                           "is no filter: the first line must be CONV NORM or CONV NONORM");
    word = strtok_r(NULL, " \t\r", &rest);
    *normalise = word == NULL || word[0] == '#' || strcmp(word, "NORM") == 0;
    if (!*normalise && strcmp(word, "NONORM") != 0)
        return rx_error_at(err, RX_USAGE, path, -1, number, "CONV %.40s: give NORM or NONORM", word);
    return RX_OK;
}

/* One row of numbers appended to the kernel; blank and comment lines add nothing. */
static rx_status read_row(const char *path, long number, char *line, rx_kernel *kernel, rx_error *err)
{
    char *rest = NULL;
    int n = 0;
    size_t used = (size_t)kernel->width * (size_t)kernel->height;
    for (char *word = strtok_r(line, " \t\r", &rest); word != NULL && word[0] != '#';
         word = strtok_r(NULL, " \t\r", &rest)) {
        char *end = NULL;
        double value = strtod(word, &end);
        if (end == word || *end != '\0' || !isfinite((float)value))
            return rx_error_at(err, RX_USAGE, path, -1, number, "'%.40s' is not a number", word);
        if (n == RX_KERNEL_SIDE || (n == 0 && kernel->height == RX_KERNEL_SIDE))
            return rx_error_at(err, RX_USAGE, path, -1, number,
                               "the filter is too large, give at most %d rows and columns", RX_KERNEL_SIDE);
        RX_TRY(RX_GROW(kernel->values, used + (size_t)n + 1, err));
        kernel->values[used + (size_t)n++] = (float)value;
    }
    if (n == 0)
        return RX_OK;
    if (kernel->height > 0 && n != kernel->width)
        return rx_error_at(err, RX_USAGE, path, -1, number,
                           "this row has %d numbers, those before %d; give rows of one length", n,
                           kernel->width);
    kernel->width = n;
    kernel->height++;
    return RX_OK;
}

rx_status rx_kernel_read(const char *path, rx_kernel **dst, rx_error *err)
{
    rx_lines lines = {0};
    char none[] = "", *line = none;
    rx_kernel *kernel;
    RX_TRY(RX_MAKE(kernel, 1, err));
    rx_status status = rx_lines_open(&lines, path, 0, err);
    if (status == RX_OK)
        status = rx_lines_next(&lines, &line, err);
    if (status == RX_OK)
        status = read_head(path, 1, line != NULL ? line : none, &kernel->normalise, err);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL)
        status = read_row(path, lines.number, line, kernel, err);
    rx_lines_close(&lines);
    const int n = kernel->width * kernel->height;
    int zeros = 0;
    while (zeros < n && kernel->values[zeros] == 0.0f)
        zeros++;
    if (status == RX_OK && zeros == n)
        status = rx_error_at(err, RX_USAGE, path, -1, 0,
                             n == 0 ? "the filter holds no numbers" : "the filter is zero everywhere");
    if (status == RX_OK)
        *dst = kernel;
    else
        rx_kernel_free(kernel);
    if (status == RX_INPUT && err != NULL)
        err->status = RX_USAGE;
    return status == RX_INPUT ? RX_USAGE : status; /* a filter belongs to the configuration */
}

const float rx_kernel_built_in[9] = {1, 2, 1, 2, 4, 2, 1, 2, 1};

void rx_kernel_free(rx_kernel *kernel)
{
    if (kernel == NULL)
        return;
    free(kernel->values);
    free(kernel);
}
