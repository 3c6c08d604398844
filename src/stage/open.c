/* Opening a tile. */
#include "stage/open.h"

#include "base/memory.h"
#include "io/tile.h"

rx_status rx_field_open(const rx_options *options, int what, const rx_image_place *place, rx_log *log,
                        rx_field **dst, rx_error *err)
{
    const int role = (what & RX_FIELD_MEASURED) != 0;
    rx_tile *tile = NULL;
    const double begun = rx_seconds();
    RX_TRY(rx_tile_read(&options->tile[role], place->name, place->hdu, place->extension, log, &tile, err));
    const double read_seconds = rx_seconds() - begun;
    RX_TRY(rx_field_prepare(&options->pipeline, what, tile, NULL, log, dst, err));
    rx_log_detail(log, "%s[%d]: seconds: read %.4f, background %.4f, PSF %.4f", (*dst)->tile->name,
                  (*dst)->tile->hdu, read_seconds, (*dst)->background_seconds, (*dst)->psf_seconds);
    return RX_OK;
}
