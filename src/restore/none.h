/* The restorer NONE: the tile as it is, its sky taken off. */
#ifndef RX_RESTORE_NONE_H
#define RX_RESTORE_NONE_H

#include "restore/restore.h"

/* pixels - level, masked (bad, without weight, saturated if mask_saturated) = 0; sigma is the background's
 * own plane, lent; psf is a copy of the tile's, NULL when that is not known. Errors: RX_SYSTEM. */
rx_status rx_none_run(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                      const rx_psf *psf, rx_log *log, rx_restored **dst, rx_error *err);

#endif
