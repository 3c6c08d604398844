/* The bits of the columns of flags. */
#include "catalog/catalog.h"

const rx_flag *rx_flags(int *n)
{
#define FLAG(column, bit, name, text) {#column, bit, name, text},
    static const rx_flag flags[] = {
#include "catalog/flags.def"
    };
    *n = (int)(sizeof flags / sizeof *flags);
    return flags;
}
