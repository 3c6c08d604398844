/* Check-images: what CHECKIMAGE_TYPE asks for, one file each, one HDU per extension. */
#ifndef RX_STAGE_CHECKIMAGES_H
#define RX_STAGE_CHECKIMAGES_H

#include "base/error.h"
#include "base/text.h"
#include "io/output.h"
#include "pipeline/pipeline.h"

typedef struct rx_checkimages rx_checkimages; /* the open files of one restorer */

/* What the images are made from; all of one extension. */
typedef struct rx_checkimage_data {
    const rx_result *result;
    const float *rms;            /* [height][width] for RESTORED_RMS; NULL where it was not asked for */
    int mesh_width, mesh_height; /* BACK_SIZE, for the MINIBACK types */
    const rx_record *facts;      /* of this extension */
    const rx_record *record;     /* of the run */
    rx_record *products;         /* of the run: the images are added */
    rx_log *log;
} rx_checkimage_data;

/* Open a file for each of n types under outputs; names get `tag` before their extension when it is
 * not NULL. Types are of those that are offered. Errors: RX_USAGE (names), RX_SYSTEM. */
rx_status rx_checkimages_open(int n, const char *const *types, const char *const *names, const char *tag,
                              rx_outputs *outputs, rx_checkimages **dst, rx_error *err);

/* Is a CHECKIMAGE_TYPE one that is made here? */
int rx_checkimage_offered(const char *type);

/* Append one HDU to every file. Errors: RX_SYSTEM (memory, disk). */
rx_status rx_checkimages_write(rx_checkimages *images, const rx_checkimage_data *data, rx_error *err);

/* Close the files and free; rx_checkimages_free() alone abandons them. */
rx_status rx_checkimages_close(rx_checkimages *images, rx_error *err);
void rx_checkimages_free(rx_checkimages *images);

#endif
