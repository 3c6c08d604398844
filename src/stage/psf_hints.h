/* What is stated of a tile's PSF: by a list of stars, a file beside the image, its header, keywords. */
#ifndef RX_STAGE_PSF_HINTS_H
#define RX_STAGE_PSF_HINTS_H

#include "pipeline/psf_source.h"

/* What is read for it is added to field->inputs. */
extern const rx_psf_hints rx_stage_psf_hints;

#endif
