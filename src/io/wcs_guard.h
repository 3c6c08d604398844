/* What stands between a header from outside and wcslib, which trusts it: damage that would make it read
 * beyond its memory is taken out, and what writers usually mean is put in. */
#ifndef RX_IO_WCS_GUARD_H
#define RX_IO_WCS_GUARD_H

#include <stddef.h>

/* Change cards in place; what was changed in a way that users should know goes to the note. 0: distortions
 * that nobody here can apply, and there are no world coordinates. */
int rx_wcs_guard(char *cards, size_t ncards, char *note, size_t note_size);

/* Append a text, behind "; " where there is one before. NULL is fine. */
void rx_wcs_note(char *note, size_t size, const char *text);

#endif
