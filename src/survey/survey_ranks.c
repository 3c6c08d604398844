/* Dynamic scheduling of a list of tiles over MPI ranks. */
#include "survey/survey.h"

#include "base/interrupt.h"
#include "par/ranks.h"

enum { NO_TILE = -1 };

/* What a process sends when it is ready for a tile: how the one before has ended. */
typedef struct ready {
    int tile; /* NO_TILE the first time */
    rx_outcome outcome;
    rx_error why;
} ready;

/* Rank 0: answers each that is ready with a tile; one that gets none waits until all shall end, as a rank
 * that has ended means trouble to those who still work. */
static rx_status hand_out(rx_survey_list *s, rx_error *err)
{
    const int workers = rx_par_processes() - 1, none = NO_TILE;
    int next = 0, interrupted = 0;
    rx_status status = RX_OK;
    for (int waiting = 0; waiting < workers && status == RX_OK;) {
        ready report;
        int from;
        RX_TRY(rx_par_receive(RX_ANY_RANK, &report, sizeof report, &from, err));
        if (report.tile != NO_TILE && report.outcome.status == RX_INTERRUPTED)
            interrupted = 1;
        else if (report.tile != NO_TILE)
            status = rx_survey_add(s, report.tile, report.outcome, &report.why, err);
        interrupted |= rx_interrupt_pending();
        if (interrupted || next == s->tiles->n) {
            waiting++;
            continue;
        }
        rx_log_info(s->log, "tile %d of %d: %s, by process %d", next + 1, s->tiles->n,
                    rx_tiles_image(s->tiles, next), from);
        if (status == RX_OK)
            status = rx_par_send(from, &next, sizeof next, err);
        next++;
    }
    for (int rank = 1; rank <= workers && status == RX_OK; rank++)
        status = rx_par_send(rank, &none, sizeof none, err);
    return status == RX_OK && interrupted ? RX_INTERRUPTED : status; /* which rx_survey_close() explains */
}

/* The other ranks. */
static rx_status work(const rx_survey_list *s, rx_error *err)
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
        if (status != RX_OK || tile == NO_TILE)
            return status;
        report = (ready){.tile = tile, .why = RX_ERROR_NONE};
        report.outcome = rx_survey_tile(s, tile, &report.why);
    }
}

rx_status rx_survey_run_ranks(const rx_settings *common, const char *path, FILE *standard_out, rx_log *log,
                              rx_error *err)
{
    rx_survey_list s = {.common = common, .standard_out = standard_out, .log = log};
    rx_status status = rx_survey_open(&s, path, err);
    if (rx_par_rank() == 0)
        return rx_survey_close(&s, status == RX_OK ? hand_out(&s, err) : status, err);
    if (status == RX_OK) {
        status = work(&s, err);
    } else {
        status = RX_OK;
        if (err != NULL)
            *err = RX_ERROR_NONE; /* rank 0 finds the same, and says it once for all */
    }
    rx_survey_free(&s);
    return status;
}
