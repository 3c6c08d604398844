/* The rows of keys.def. */
#include "config/keyword.h"

#include <strings.h>

/* clang-format off */
#define NOWORDS NULL
#define WORDLIST(...) ((const char *const[]){__VA_ARGS__, NULL})
static const rx_keyword rows[] = {
#define SECTION(id, title) {.kind = RX_KIND_SECTION, .name = (title), .help = ""},
#define KEY(kind_, NAME, field, initial_, low_, high_, nmin_, nmax_, words_, status_, level_, help_)          \
    {.kind = RX_KIND_##kind_, .name = #NAME, .offset = offsetof(rx_config, field), .initial = (initial_),      \
     .low = (low_), .high = (high_), .nmin = (nmin_), .nmax = (nmax_), .words = words_,                        \
     .status = RX_STATUS_##status_, .level = RX_LEVEL_##level_, .help = (help_)},
#include "config/keys.def"
#undef KEY
#undef SECTION
};
/* clang-format on */

const rx_keyword *rx_keyword_row(int row)
{
    return &rows[row];
}

int rx_keyword_find(const char *name)
{
    for (int row = 0; row < RX_KEY_ROWS; row++)
        if (rows[row].kind != RX_KIND_SECTION && strcasecmp(name, rows[row].name) == 0)
            return row;
    return -1;
}

const char *rx_keyword_nearest(const char *name)
{
    const char *names[RX_KEY_ROWS];
    size_t n = 0;
    for (int row = 0; row < RX_KEY_ROWS; row++)
        if (rows[row].kind != RX_KIND_SECTION)
            names[n++] = rows[row].name;
    return rx_text_nearest(name, names, n);
}
