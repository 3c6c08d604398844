/* One tile after the other. */
#include "survey/survey.h"

#include "base/interrupt.h"
#include "config/tiles.h"

rx_status rx_survey_run(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                        rx_error *err)
{
    const double begun = rx_seconds();
    rx_tiles *tiles = NULL;
    rx_outcomes *outcomes = NULL;
    rx_status status = rx_tiles_read(path, &tiles, err);
    if (status == RX_OK)
        status = rx_tile_check(common, tiles, log, err);
    if (status == RX_OK)
        status = rx_outcomes_new(tiles->n, &outcomes, err);
    for (int i = 0; status == RX_OK && i < tiles->n; i++) {
        rx_error why = rx_error_part(err);
        const double start = rx_seconds();
        rx_log_info(log, "tile %d of %d: %s", i + 1, tiles->n, rx_tiles_image(tiles, i));
        rx_outcome ended = {0};
        ended.status = rx_tile_run_listed(tiles, i, common, standard_out, log, &ended.others, &why);
        ended.seconds = rx_seconds() - start;
        if (ended.status == RX_INTERRUPTED)
            status = rx_interrupt_check(err);
        else
            status = rx_outcomes_add(outcomes, tiles, i, ended, &why, log, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    if (status == RX_INTERRUPTED)
        status = rx_outcomes_interrupted(outcomes, tiles, err);
    if (outcomes != NULL) {
        const rx_status whole =
            rx_outcomes_summary(outcomes, tiles, rx_seconds() - begun, log, status == RX_OK ? err : NULL);
        status = status == RX_OK ? whole : status;
    }
    rx_outcomes_free(outcomes);
    rx_tiles_free(tiles);
    return status;
}
