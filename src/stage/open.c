/* Opening a tile. */
#include "stage/open.h"

#include "base/memory.h"
#include "io/tile.h"

rx_status rx_field_open(const rx_options *options, int what, const rx_image_place *place, rx_log *log,
                        rx_field **dst, rx_error *err)
{
    const int role = (what & RX_FIELD_MEASURED) != 0;
    rx_tile *tile = NULL;
    rx_lap last = rx_lap_now(), read = {0};
    RX_TRY(rx_tile_read(&options->tile[role], place->name, place->hdu, place->extension, log, &tile, err));
    rx_lap_add(&last, &read);
    RX_TRY(rx_field_prepare(&options->pipeline, what, tile, NULL, log, dst, err));
    const rx_field *field = *dst;
    const rx_lap *background = &field->background_lap, *psf = &field->psf_lap;
    rx_log_detail(log, "%s[%d]: seconds: read %.4f, background %.4f, PSF %.4f", field->tile->name,
                  field->tile->hdu, read.wall, background->wall, psf->wall);
    rx_log_detail(log, "%s[%d]: CPU seconds: read %.4f, background %.4f, PSF %.4f", field->tile->name,
                  field->tile->hdu, read.cpu, background->cpu, psf->cpu);
    return RX_OK;
}
