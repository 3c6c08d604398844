/* The PSF of a crowd. */
#ifndef RX_PIPELINE_CROWD_PSF_H
#define RX_PIPELINE_CROWD_PSF_H

#include "pipeline/field.h"

/* PSF_TYPE AUTO takes off what is detected around its stars; in a crowd the light of what is not remains in their wings. Where the
 * templates of RESTORE_TYPE NONE, fitted with the field's PSF in a few passes, show that half of the tile or more is crowded, the
 * PSF is measured once more, on pixels without the models of all but the brightest stars, and sky and noise anew: *dst, of the
 * caller. role: RX_FIELD_MEASURED or RX_FIELD_DETECTED, whose keywords the sky has. Which stars are flattened, the field's
 * own sources have said. *by: what that changes fluxes by, relative. A PSF that is too wide hides the very neighbours that widen
 * it, so that this is to be done again until fluxes stay. It is looked at in
 * rx_psf_squares(), so that what this costs does not grow with the tile. NULL: the field is no crowd, CROWDING is N, no templates are asked for, or what remains gives no PSF by pixels. */
rx_status rx_psf_between(const rx_pipeline_params *params, int role, const rx_field *field, rx_log *log,
                         rx_psf **dst, double *by, rx_error *err);

/* *mask: the image's, with all hidden but every *step-th square of 64 FWHM in a row, which leaves some 36, spread evenly; to be
 * freed. NULL where *step is 1. Errors: RX_SYSTEM. */
rx_status rx_psf_squares(const rx_image *image, double fwhm, uint8_t **mask, int *step, rx_error *err);

#endif
