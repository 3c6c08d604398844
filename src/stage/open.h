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

rx_status rx_field_open(const rx_options *options, int what, const rx_image_place *place, rx_log *log,
                        rx_field **dst, rx_error *err);

#endif
