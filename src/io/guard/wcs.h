/* Damage in a header that would make wcslib read beyond its memory is taken out, what writers usually mean is put in.
 * Private to io/. */
#ifndef RX_IO_GUARD_WCS_H
#define RX_IO_GUARD_WCS_H

#include <stdbool.h>
#include <stddef.h>

#include "io/wcs_notes.h"

/* Change cards in place, of which the first RX_WCS_OWN are blank, for cards of our own; what was changed in a way that users
 * should know goes to the notes. false: there are no world coordinates, notes->why says for what reason. */
enum { RX_WCS_NAXIS, RX_WCS_PLATEID, RX_WCS_PV1, RX_WCS_PV2, RX_WCS_OWN };
bool rx_wcs_guard(char *cards, size_t ncards, rx_wcs_notes *notes);

/* How many of the first two axes have a type of the sky. */
int rx_wcs_means_sky(const char *cards, size_t ncards);

/* Append a text, behind "; " where there is one before. */
void rx_wcs_note(rx_text *note, const char *text);

#endif
