/* PSF_LIBRARY: the PSFs of other tiles of a survey, for a tile whose stars do not give its own. */
#ifndef RX_PSF_PSF_LIBRARY_H
#define RX_PSF_PSF_LIBRARY_H

#include "base/log.h"
#include "data/record.h"
#include "data/tile.h"
#include "psf/psf.h"

/* Which exposure a PSF is of. */
typedef struct rx_psf_origin {
    char ccd[80], filter[40]; /* as the header names them; "" not known */
    double mjd;               /* days, of the begin of the exposure; NAN not known */
    double alpha, delta;      /* of the centre, deg J2000; NAN not known */
    int width, height;        /* of the tile */
} rx_psf_origin;

/* CCD: INSTRUME, and the first of CCDNUM, DETECTOR, CCDNAME, CHIPID, CAMCOL, EXTNAME; filter: FILTER, BAND, FILTNAM;
 * time: MJD-OBS, MJD, else DATE-OBS. */
void rx_psf_origin_of(const rx_tile *tile, rx_psf_origin *dst);

/* Cards of a model in the library: RXLCCD, RXLFILT, RXLMJD, RXLRA, RXLDEC, RXLNX, RXLNY. */
void rx_psf_origin_facts(const rx_psf_origin *origin, rx_record *facts);

/* Is the PSF good enough for other tiles: pixels, of so many stars or more, nothing of it warned of? */
enum { RX_PSF_LIBRARY_STARS = 20 };
int rx_psf_library_takes(const rx_psf *psf);

/* The model of the same CCD and filter that is nearest in time and place, in units of the limits; of two as near the one
 * whose file name comes first. A CCD or filter that only one of the two states is another; where neither states it the
 * model is taken with a warning, and its description says so. Of time and place what either does not state does not
 * count, but one of them both must state. *dst NULL: the library has none. The files of all models that were looked at are added to `read` (may be
 * NULL) as PSF_LIBRARY. Its flux_error and fwhm_error hold, in
 * quadrature, how much the next nearest models differ from it. Errors: RX_USAGE (the folder cannot be read), RX_SYSTEM. */
rx_status rx_psf_library_find(const rx_psf_library *library, const rx_psf_origin *tile, rx_log *log,
                              rx_record *read, rx_psf **dst, rx_error *err);

#endif
