/* The account of a list of tiles. */
#include "survey/survey.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"

enum { LINE = RX_ERROR_WHERE + RX_ERROR_TEXT + 128 };

rx_status rx_outcomes_new(int n, rx_outcomes **dst, rx_error *err)
{
    rx_outcomes *outcomes = *dst = RX_NEW(rx_outcomes, 1);
    if (outcomes == NULL || (outcomes->of = RX_NEW(rx_outcome, (size_t)n)) == NULL) {
        free(outcomes);
        *dst = NULL;
        return rx_error_memory(err, (size_t)n * sizeof(rx_outcome));
    }
    outcomes->n = n;
    return RX_OK;
}

void rx_outcomes_free(rx_outcomes *outcomes)
{
    for (int i = 0; outcomes != NULL && i < outcomes->n; i++)
        free(outcomes->of[i].what);
    if (outcomes != NULL)
        free(outcomes->of);
    free(outcomes);
}

static const char *verdict(rx_status status)
{
    switch (status) {
    case RX_OK:
        return "fine";
    case RX_GATE_FAIL:
        return "a quality gate failed";
    case RX_GATE_INSUFFICIENT:
        return "too few sources for a quality gate";
    default:
        return "failed";
    }
}

rx_status rx_outcomes_add(rx_outcomes *outcomes, const rx_tiles *tiles, int i, rx_outcome outcome,
                          const rx_error *why, rx_log *log, rx_error *err)
{
    outcome.done = 1;
    outcomes->of[i] = outcome;
    if (outcome.status == RX_OK)
        return RX_OK;
    char line[LINE];
    rx_error named = *why;
    rx_error_where(&named, outcome.status, rx_tiles_image(tiles, i), named.hdu, named.line);
    rx_error_format(&named, verdict(outcome.status), line, sizeof line);
    rx_log_warning(log, "%s", line);
    outcomes->of[i].what = rx_strdup(line);
    return outcomes->of[i].what != NULL ? RX_OK : rx_error_memory(err, sizeof line);
}

rx_status rx_outcomes_summary(const rx_outcomes *outcomes, const rx_tiles *tiles, double seconds, rx_log *log,
                              rx_error *err)
{
    int fine = 0, gates = 0, undecided = 0, failed = 0, left = 0, others = 0;
    char by_others[64] = "";
    for (int i = 0; i < outcomes->n; i++) {
        const rx_outcome *outcome = &outcomes->of[i];
        left += !outcome->done;
        others += outcome->others > 0;
        fine += outcome->done && outcome->status == RX_OK;
        gates += outcome->done && outcome->status == RX_GATE_FAIL;
        undecided += outcome->done && outcome->status == RX_GATE_INSUFFICIENT;
    }
    failed = outcomes->n - fine - gates - undecided - left;
    if (others > 0)
        snprintf(by_others, sizeof by_others, ", %d by another restorer", others);
    rx_log_info(log,
                "%d tiles in %.1f s: %d fine, %d failed, %d with a quality gate that failed, %d with one "
                "that is undecided, %d not begun%s",
                outcomes->n, seconds, fine, failed, gates, undecided, left, by_others);
    for (int i = 0; i < outcomes->n; i++)
        if (outcomes->of[i].done && outcomes->of[i].status != RX_OK)
            rx_log_info(log, "line %ld, exit status %d after %.1f s: %s", tiles->tile[i].line,
                        (int)outcomes->of[i].status, outcomes->of[i].seconds, outcomes->of[i].what);
    if (failed > 0)
        return rx_error_at(err, RX_SOME_FAILED, tiles->path, -1, 0,
                           "%d of %d tiles failed; the others are done", failed, outcomes->n);
    if (gates > 0)
        return rx_error_at(err, RX_GATE_FAIL, tiles->path, -1, 0, "a quality gate FAILED for %d of %d tiles",
                           gates, outcomes->n);
    if (undecided > 0)
        return rx_error_at(err, RX_GATE_INSUFFICIENT, tiles->path, -1, 0,
                           "too few sources to decide every quality gate of %d of %d tiles", undecided,
                           outcomes->n);
    return RX_OK;
}

rx_status rx_outcomes_interrupted(const rx_outcomes *outcomes, const rx_tiles *tiles, rx_error *err)
{
    int ended = 0;
    for (int i = 0; i < outcomes->n; i++)
        ended += outcomes->of[i].done;
    return rx_error_at(err, RX_INTERRUPTED, tiles->path, -1, 0,
                       "interrupted by a signal; %d of %d tiles had ended before", ended, outcomes->n);
}
