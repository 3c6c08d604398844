/* Numbers that a tile's header or a keyword of the configuration gives, and what the header says about them that a
 * user should know. */
#ifndef RX_IO_HEADER_NUMBERS_H
#define RX_IO_HEADER_NUMBERS_H

#include <stdbool.h>

#include "base/log.h"
#include "base/text.h"
#include "data/tile.h"

typedef struct rx_header {
    const rx_text *cards, *parent; /* of the HDU, and of the primary header */
    const char *name;              /* of the file, and */
    int hdu;                       /* for messages */
    rx_log *log;
} rx_header;

typedef struct rx_header_number {
    const char *keyword;  /* of the configuration, for where no card has the number; its _KEY names the */
    const char *key;      /* card; "" or NONE: none */
    const char *standard; /* the default of that, which need not be in the header */
    const char *unit;     /* that may follow the number (io/cards.h) */
    double otherwise;     /* where no card has it */
} rx_header_number;

/* Card of the HDU, or of the primary header, else one that begins so, else `otherwise`; *found (may be NULL): a
 * card has it. Cards that are no numbers, contradict one another or are named but absent are warned of. */
double rx_header_number_or(const rx_header *header, const rx_header_number *wanted, bool *found);

/* What the header says of zero point and gain where they are not given or contradict the unit of the pixels. */
void rx_header_hints(const rx_header *header, const rx_tile *tile, const char *gain_key, bool gain_found);

/* Which exposure a tile is of. */
typedef struct rx_exposure {
    char filter[40]; /* FILTER, BAND or FILTNAM; "" not known */
    double mjd;      /* days, of its begin: MJD-OBS, MJD, else DATE-OBS; NAN not known */
} rx_exposure;

void rx_exposure_of(const rx_tile *tile, rx_exposure *dst);

#endif
