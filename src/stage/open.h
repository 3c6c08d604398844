/* From a file to what the pipeline works on. */
#ifndef RX_STAGE_OPEN_H
#define RX_STAGE_OPEN_H

#include "base/error.h"
#include "base/log.h"
#include "pipeline/field.h"
#include "stage/options.h"

/* An image of a file. */
typedef struct rx_image_place {
    const char *name;
    int hdu;       /* as cfitsio counts */
    int extension; /* 1, 2, ... among those that are processed */
} rx_image_place;

/* That image, read with options->tile and made ready (pipeline/field.h); what: RX_FIELD_ bits. With RX_FIELD_PSF its
 * PSF comes from where options->pipeline.psf says. *dst is freed with rx_field_free(). Errors: RX_INPUT, RX_USAGE
 * (PSF_TYPE and what it needs), RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_field_open(const rx_options *options, int what, const rx_image_place *place, rx_log *log,
                        rx_field **dst, rx_error *err);

#endif
