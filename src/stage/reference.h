/* The reference catalogue as the QA report wants it: positions in the tile's pixels, magnitudes. */
#ifndef RX_STAGE_REFERENCE_H
#define RX_STAGE_REFERENCE_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "data/table.h"
#include "data/tile.h"
#include "quality/qa.h"

typedef struct rx_reference_params {
    const char *name; /* REFERENCE_NAME */
    int ncolumns;     /* REFERENCE_COLUMNS: x, y, magnitude or flux[, its error]; 0 = known names */
    const char *const *columns;
    const char *band; /* REFERENCE_BAND; "" or NULL: by the tile's filter */
    int ncolour;      /* 0 or 3: REFERENCE_COLOR_TERM, of which [1] and [2] are bands or columns */
    const char *const *colour;
    double colour_term;    /* its [0] */
    double flux_zeropoint; /* magnitude of flux 1, NAN = the tile's zero point */
} rx_reference_params;

/* What was done with the reference: the name that the page shows, with survey, band, colour and epoch. Free .shown in any
 * case. */
typedef struct rx_reference_note {
    rx_text shown;
    long moved; /* positions taken to the tile's epoch by their proper motions */
} rx_reference_note;

/* Rows of `table` (from rx_catalog_read) inside the tile and just outside it; the magnitude is NAN where
 * there is none. Sky coordinates are taken when the tile and the table have them, else pixels. Errors:
 * RX_INPUT naming the column that is missing. Free with rx_qa_list_free(). */
rx_status rx_reference_list(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                            rx_log *log, rx_qa_list *dst, rx_reference_note *note, rx_error *err);

/* Whether it will find columns of positions and magnitudes, before the work that it is read after. */
rx_status rx_reference_check(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                             rx_error *err);

#endif
