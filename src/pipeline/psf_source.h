/* The PSF of a field: of its stars, or as params and what is stated say. */
#ifndef RX_PIPELINE_PSF_SOURCE_H
#define RX_PIPELINE_PSF_SOURCE_H

#include "base/error.h"
#include "pipeline/field.h"

/* What is known of PSFs besides pixels. Errors: RX_INPUT, RX_SYSTEM. */
typedef struct rx_psf_hints {
    /* Gives sources a number_assoc where they are among the stars of PSF_STARS_NAME. */
    rx_status (*mark_stars)(const rx_pipeline_params *params, const rx_image *image, rx_log *log,
                            rx_sources *sources, rx_error *err);
    /* Stars gave no field->psf, or few gave one, as `why` says: what is stated takes its place, or where there is neither
     * the field is `unrestorable`. */
    rx_status (*stated)(const rx_pipeline_params *params, const rx_error *why, rx_field *field, rx_log *log,
                        rx_error *err);
} rx_psf_hints;

/* field->psf, as params say, on its sky and noise; where stars give none and nothing is stated it stays NULL, and the field
 * is `unrestorable`. role: 1 for the keywords of the measurement image. Errors: RX_INPUT, RX_SYSTEM. */
rx_status rx_field_psf(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                       rx_error *err);

/* The PSF of a tile that needs none, where noise seems to be correlated farther than resampling leaves it, as the light of
 * faint sources is; *dst NULL where it is not, or is not known. Errors: RX_SYSTEM. */
rx_status rx_field_psf_of_light(const rx_pipeline_params *params, int role, const rx_field *field,
                                rx_psf **dst, rx_error *err);

#endif
