/* Text that survives headers. */
#include "base/printable.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>

void rx_printable_add(rx_text *dst, const char *text)
{
    for (const char *c = text; *c != '\0'; c++) {
        const int at_end = c[1] == '\0', edge = c == text || at_end;
        const int plain =
            *c >= ' ' && *c <= '~' && *c != '%' && !(*c == ' ' && edge) && !(*c == '&' && at_end);
        if (plain)
            rx_text_add_bytes(dst, c, 1);
        else
            rx_text_printf(dst, "%%%02X", (unsigned)(unsigned char)*c);
    }
    rx_text_add(dst, ""); /* never NULL */
}

int rx_printable_read(char *text)
{
    char *to = text;
    for (const char *from = text; *from != '\0'; from++) {
        if (*from != '%') {
            *to++ = *from;
            continue;
        }
        if (!isxdigit((unsigned char)from[1]) || !isxdigit((unsigned char)from[2]))
            return 0;
        const char digits[] = {from[1], from[2], '\0'};
        *to = (char)strtol(digits, NULL, 16);
        if (*to++ == '\0')
            return 0;
        from += 2;
    }
    *to = '\0';
    return 1;
}
