/* Which exposure a tile is of, as its header says. */
#ifndef RX_IO_EXPOSURE_H
#define RX_IO_EXPOSURE_H

#include "data/tile.h"

typedef struct rx_exposure {
    char filter[40]; /* FILTER, BAND or FILTNAM; "" not known */
    double mjd;      /* days, of its begin: MJD-OBS, MJD, else DATE-OBS; NAN not known */
} rx_exposure;

void rx_exposure_of(const rx_tile *tile, rx_exposure *dst);

#endif
