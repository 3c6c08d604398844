/* Files that are only good as a whole, such as models: nothing missing, nothing changed since they were
 * written. */
#ifndef RX_IO_FITS_VERIFY_H
#define RX_IO_FITS_VERIFY_H

#include "base/error.h"

/* Every HDU has CHECKSUM and DATASUM (FITS 4.0, 4.4.2.7 and appendix J) and both are right, the HDUs fill the
 * file to its last byte, and there are `nhdus` of them (0: as many as there are). From the bytes alone,
 * before cfitsio trusts a header: a single changed byte anywhere is found. Errors: RX_INPUT, with the HDU;
 * RX_SYSTEM. */
rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err);

#endif
