/* The PSF of a crowd. */
#ifndef RX_PIPELINE_CROWD_PSF_H
#define RX_PIPELINE_CROWD_PSF_H

#include "pipeline/field.h"

/* PSF_TYPE AUTO subtracts what is detected around its stars; in a crowd the light of what is not detected remains in
 * their wings. Where the templates of RESTORE_TYPE NONE, fitted with the field's PSF in a few passes, show that half
 * of the tile or more is crowded, the PSF is measured once more, on pixels less the models of all but the brightest
 * stars, with sky and noise measured anew: *dst, which the caller frees. role: RX_FIELD_MEASURED or RX_FIELD_DETECTED,
 * whose keywords the sky has. Which stars are flattened, the field's own sources have said. *by: the relative change
 * of fluxes, negative where the PSF got wider. A PSF that is too wide hides the very neighbours that widen it: call
 * again until fluxes stay. Only rx_psf_squares() is looked at, so that the cost does not grow with the tile. *dst
 * NULL: the field is no crowd, CROWDING is N, no templates are asked for, or what remains gives no PSF by pixels.
 * Errors: those of rx_field_extract(). */
rx_status rx_psf_between(const rx_pipeline_params *params, int role, const rx_field *field, rx_log *log,
                         rx_psf **dst, double *by, rx_error *err);

/* *mask: the image's, with all hidden but every *step-th square of 64 FWHM in a row, which leaves some 8 to 12, spread evenly; to be
 * freed. NULL where *step is 1. Errors: RX_SYSTEM. */
rx_status rx_psf_squares(const rx_image *image, double fwhm, uint8_t **mask, int *step, rx_error *err);

#endif
