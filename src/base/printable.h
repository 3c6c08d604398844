/* Any text as printable ASCII, and back: what headers of FITS files and catalogues can hold.
 *
 * As in addresses of the web: a byte that is no printable ASCII character, a '%', a blank at either end and
 * an '&' at the end (which means "goes on" in a header) become '%' and two hexadecimal digits. */
#ifndef RX_BASE_PRINTABLE_H
#define RX_BASE_PRINTABLE_H

#include "base/text.h"

void rx_printable_add(rx_text *dst, const char *text);

/* The way back, in place. Returns 0 where a '%' is followed by anything else, or the text would hold a 0
 * byte. */
int rx_printable_read(char *text);

#endif
