/* A tile with its own settings through the stage. */
#include "survey/tile_run.h"

#include "config/config_fields.h"
#include "stage/stage.h"

rx_status rx_tile_run(const rx_tiles *tiles, int i, const rx_settings *common, FILE *standard_out,
                      rx_log *log, rx_error *why)
{
    rx_settings *settings = NULL;
    rx_status status = rx_tiles_settings(tiles, i, common, log, &settings, why);
    if (status == RX_OK)
        status = rx_stage_run((const rx_config *)settings, rx_tiles_image(tiles, i), standard_out, log, why);
    rx_settings_free(settings);
    rx_log_progress_end(log);
    return status;
}
