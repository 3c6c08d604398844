/* The images of a file, and which of them are maps of others, known by EXTNAME. For io/ alone. */
#ifndef RX_IO_TILE_LIST_H
#define RX_IO_TILE_LIST_H

#include <stdbool.h>

#include "base/log.h"
#include "io/cards.h"
#include "io/fits_file.h"

/* An HDU with its EXTNAME and EXTVER, "" and 0 without; those of a compressed image are its own. */
enum { RX_EXTNAME = RX_CARD - RX_CARD_KEY };
typedef struct rx_image_hdu {
    int hdu;
    char name[RX_EXTNAME];
    int version;
} rx_image_hdu;

typedef struct rx_image_list {
    rx_image_hdu *list;
    int n;
} rx_image_list;

/* The 2-D images that a name selects, or planes of cubes by its section, maps as well; dst->list to be freed. No such image:
 * RX_INPUT; HDUs that are skipped are named in the log. */
rx_status rx_images_of(const rx_fits_name *name, rx_log *log, rx_image_list *dst, rx_error *err);

/* The same with all images of the file. */
rx_status rx_images_of_file(const rx_fits_name *name, rx_log *log, rx_image_list *dst, rx_error *err);

/* Those stay that are no maps of another one, unless all are maps. */
void rx_images_drop_maps(rx_image_list *images);

/* HDUs of the MASK and the VARIANCE of the image at `hdu`, if its EXTNAME is IMAGE and both are there, as Rubin's pipelines
 * and HSC's write; else -1 and -1. Of several images each has the maps before the next one. */
void rx_images_own_maps(const rx_image_list *all, int hdu, int *mask, int *variance);

/* Have both a name, the same, and the same version unless one states none? */
bool rx_images_same(const rx_image_hdu *a, const rx_image_hdu *b);

/* RX_OK when the HDU of that shape is a 2-D image with pixels, or the section gives a plane of it, else the reason. */
rx_status rx_image_check(const char *path, int hdu, const rx_fits_shape *shape,
                         const rx_fits_section *section, rx_error *err);

#endif
