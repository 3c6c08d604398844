/* The table of flags.def, and a sum of flags in words. */
#include "data/flags.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define FLAG(column, prefix, name, bit, meaning) {#column, #name, meaning, bit},
static const rx_flag flags[] = {
#include "data/flags.def"
};
#undef FLAG

enum { COUNT = sizeof flags / sizeof *flags };

const rx_flag *rx_flags(int *n)
{
    *n = COUNT;
    return flags;
}

static void add_flag(rx_text *dst, const rx_flag *flag)
{
    rx_text_printf(dst, "%6d  %-13s %s\n", flag->bit, flag->name, flag->meaning);
}

static rx_status list_all(rx_text *dst, rx_error *err)
{
    for (int i = 0; i < COUNT; i++) {
        if (i == 0 || strcmp(flags[i].column, flags[i - 1].column) != 0)
            rx_text_printf(dst, "%s%s\n", i > 0 ? "\n" : "", flags[i].column);
        add_flag(dst, &flags[i]);
    }
    return dst->failed ? rx_error_memory(err, dst->capacity) : RX_OK;
}

rx_status rx_flags_decode(const char *what, rx_text *dst, rx_error *err)
{
    if (what == NULL)
        return list_all(dst, err);
    const char *sum = strchr(what, '='), *digits = sum != NULL ? sum + 1 : what;
    const size_t named = sum != NULL ? (size_t)(sum - what) : 0;
    char *end;
    const long value = strtol(digits, &end, 10);
    if (digits[strspn(digits, "0123456789")] != '\0' || end == digits || value > 32767)
        return rx_error_set(err, RX_USAGE,
                            "'%.80s' is no sum of flags; give one as -FLAGS 19 or -FLAGS FLAGS_RESTORE=19",
                            what);
    int shown = 0;
    for (int first = 0, next; first < COUNT; first = next) {
        const char *column = flags[first].column;
        for (next = first; next < COUNT && strcmp(flags[next].column, column) == 0;)
            next++;
        if (sum != NULL && (strlen(column) != named || strncasecmp(column, what, named) != 0))
            continue;
        long left = value;
        rx_text_printf(dst, "%s%s %ld\n", shown++ > 0 ? "\n" : "", column, value);
        for (int i = first; i < next; i++)
            if (value & flags[i].bit) {
                add_flag(dst, &flags[i]);
                left -= flags[i].bit;
            }
        if (value == 0)
            rx_text_add(dst, "     0  nothing to say\n");
        if (left > 0)
            rx_text_printf(dst, "%6ld  no flags of this column\n", left);
    }
    if (shown == 0)
        return rx_error_set(err, RX_USAGE,
                            "'%.*s' is no column of flags; see rextract -FLAGS for all of them", (int)named,
                            what);
    return dst->failed ? rx_error_memory(err, dst->capacity) : RX_OK;
}

void rx_flags_man(const char *column, rx_text *dst)
{
    rx_text_add(dst, ".TS\nl l l.\n");
    for (int i = 0; i < COUNT; i++)
        if (strcmp(flags[i].column, column) == 0)
            rx_text_printf(dst, "%d\t%s\t%s\n", flags[i].bit, flags[i].name, flags[i].meaning);
    rx_text_add(dst, ".TE\n");
}
