/* What was found out while the world coordinates of a header were read. */
#ifndef RX_IO_WCS_NOTES_H
#define RX_IO_WCS_NOTES_H

#include "base/extern.h"
#include "base/text.h"

RX_BEGIN_DECLS

typedef struct rx_wcs_notes {
    rx_text
        warnings; /* contradictions, and how they were resolved; why a header that means the sky gives none */
    rx_text details; /* what was ignored or repaired */
    rx_text why;     /* there are no world coordinates, celestial or linear ones */
} rx_wcs_notes;

void rx_wcs_notes_free(rx_wcs_notes *notes);

RX_END_DECLS

#endif
