/* Writing PSFs for the readers of PSFEx's. */
#ifndef RX_PSF_PSF_PSFEX_H
#define RX_PSF_PSF_PSFEX_H

#include "base/error.h"
#include "base/text.h"
#include "data/psf.h"
#include "data/table.h"

/* The PSF as a table as PSFEx writes it (extension PSF_DATA), to be freed by rx_table_free(), with the further cards of
 * its header appended to `cards` (which says in `failed` when memory ran out). psf NULL: not known, one pixel that is no
 * number. A PSF narrower than 3 pixels is written in steps of half a pixel, between the pixels by the sinc function.
 * Errors: RX_INPUT (degree above 8), RX_SYSTEM. */
rx_status rx_psf_psfex_table(const rx_psf *psf, rx_table **dst, rx_text *cards, rx_error *err);

#endif
