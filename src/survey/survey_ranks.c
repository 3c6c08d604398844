/* Tiles to whoever is ready. */
#include "survey/survey.h"

#include "base/interrupt.h"
#include "config/config_fields.h"
#include "config/tiles.h"
#include "par/ranks.h"
#include "stage/plan.h"

enum { NO_TILE = -1 };

/* What a process sends when it is ready for a tile: how the one before has ended. */
typedef struct ready {
    int tile; /* NO_TILE the first time */
    rx_status status;
    int others; /* images that another restorer did */
    double seconds;
    rx_error why;
} ready;

typedef struct account {
    const rx_tiles *tiles;
    rx_outcomes *outcomes;
    rx_log *log;
} account;

static rx_status take_ready(const account *a, const ready *report, int *interrupted, rx_error *err)
{
    if (report->tile != NO_TILE && report->status == RX_INTERRUPTED)
        *interrupted = 1;
    else if (report->tile != NO_TILE)
        return rx_outcomes_add(
            a->outcomes, a->tiles, report->tile,
            (rx_outcome){.status = report->status, .others = report->others, .seconds = report->seconds},
            &report->why, a->log, err);
    return RX_OK;
}

/* Rank 0: answers each that is ready with a tile; one that gets none waits until all shall end, as a rank
 * that is gone means trouble to those who still work. */
static rx_status hand_out(const account *a, rx_error *err)
{
    const int workers = rx_par_processes() - 1, none = NO_TILE;
    int next = 0, waiting = 0, interrupted = 0;
    rx_status status = RX_OK;
    while (waiting < workers && status == RX_OK) {
        ready report;
        int from;
        status = rx_par_receive(RX_ANY_RANK, &report, sizeof report, &from, err);
        if (status != RX_OK)
            break;
        status = take_ready(a, &report, &interrupted, err);
        interrupted |= rx_interrupt_pending();
        if (interrupted || next == a->tiles->n) {
            waiting++;
            continue;
        }
        rx_log_info(a->log, "tile %d of %d: %s, by process %d", next + 1, a->tiles->n,
                    rx_tiles_image(a->tiles, next), from);
        if (status == RX_OK)
            status = rx_par_send(from, &next, sizeof next, err);
        next++;
    }
    for (int rank = 1; rank <= workers && status == RX_OK; rank++)
        status = rx_par_send(rank, &none, sizeof none, err);
    return status == RX_INTERRUPTED || (status == RX_OK && interrupted)
               ? rx_outcomes_interrupted(a->outcomes, a->tiles, err)
               : status;
}

/* The other ranks. */
static rx_status work(const rx_tiles *tiles, const rx_settings *common, FILE *standard_out, rx_log *log,
                      rx_error *err)
{
    ready report = {.tile = NO_TILE, .why = RX_ERROR_NONE};
    for (;;) {
        int tile;
        rx_status status = rx_par_send(0, &report, sizeof report, err);
        if (status == RX_OK)
            status = rx_par_receive(0, &tile, sizeof tile, NULL, err);
        if (status != RX_OK && rx_interrupt_pending()) {
            if (err != NULL)
                *err = RX_ERROR_NONE; /* rank 0 has heard the same signal, and says so once for all */
            return RX_OK;
        }
        if (status != RX_OK)
            return status;
        report = (ready){.tile = tile, .why = RX_ERROR_NONE};
        if (report.tile == NO_TILE)
            return RX_OK;
        const double begun = rx_seconds();
        report.status =
            rx_tile_run_listed(tiles, report.tile, common, standard_out, log, &report.others, &report.why);
        report.seconds = rx_seconds() - begun;
    }
}

static rx_status one_thread(const rx_settings *common, rx_settings **dst, rx_log *log, rx_error *err)
{
    RX_TRY(rx_settings_copy(common, dst, err));
    if (((const rx_config *)common)->nthreads == 0)
        RX_TRY(rx_settings_set(*dst, "NTHREADS", "1", log, err));
    return RX_OK;
}

rx_status rx_survey_run_ranks(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                              rx_error *err)
{
    const double begun = rx_seconds();
    rx_tiles *tiles = NULL;
    rx_settings *own = NULL;
    account a = {.log = log};
    const int first = rx_par_rank() == 0;
    rx_status status = rx_tiles_read(path, &tiles, err);
    if (status == RX_OK)
        status = rx_tile_check(common, tiles, log, err);
    if (status != RX_OK && !first) {
        if (err != NULL)
            *err = RX_ERROR_NONE; /* rank 0 finds the same, and says it once for all */
        rx_tiles_free(tiles);
        return RX_OK;
    }
    if (status == RX_OK)
        status = one_thread(common, &own, log, err);
    if (status == RX_OK && first)
        status = rx_outcomes_new(tiles->n, &a.outcomes, err);
    if (status != RX_OK)
        goto exit;
    a.tiles = tiles;
    status = first ? hand_out(&a, err) : work(tiles, own, standard_out, log, err);
    if (first) {
        const rx_status whole =
            rx_outcomes_summary(a.outcomes, tiles, rx_seconds() - begun, log, status == RX_OK ? err : NULL);
        status = status == RX_OK ? whole : status;
    }
exit:
    rx_outcomes_free(a.outcomes);
    rx_settings_free(own);
    rx_tiles_free(tiles);
    return status;
}

rx_status rx_survey_plan_ranks(const rx_settings *common, const char *image, FILE *standard_out, rx_log *log,
                               rx_error *err)
{
    rx_settings *own = NULL;
    if (rx_par_rank() > 0)
        return RX_OK;
    rx_status status = one_thread(common, &own, log, err);
    if (status == RX_OK)
        status = rx_plan_run(own, image, standard_out, log, err);
    rx_settings_free(own);
    return status;
}
