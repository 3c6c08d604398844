/* Doing the units of a campaign: one unit per thread at a time, a journal line for each. */
#include "lab/units.h"

#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"

enum { TELL_EVERY = 10 }; /* per cent, where no progress line can be shown */

int rx_unit_is_mine(const rx_unit_work *work, long unit)
{
    return work->place[unit].group % work->n_shards == work->k - 1;
}

void rx_units_count(const rx_unit_work *work, const rx_unit_values *values, long *missing, long *all)
{
    *missing = *all = 0;
    for (long u = 0; u < work->n; u++) {
        const int mine = rx_unit_is_mine(work, u);
        *all += mine;
        *missing += mine && values[u].v == NULL;
    }
}

/* What the threads share; changed in the critical section only. */
typedef struct crew {
    const rx_unit_work *work;
    rx_journal *journal;
    rx_unit_values *values;
    rx_log *log;
    long todo, done; /* in this run */
    long told;       /* per cent */
    double begun;
    rx_status status;
    rx_error *err;
} crew;

static void tell(crew *c)
{
    if (c->log == NULL)
        return;
    rx_log_progress(c->log, c->work->title, (double)c->done / (double)c->todo);
    const long percent = 100 * c->done / c->todo;
    if (c->log->terminal || percent < c->told + TELL_EVERY)
        return;
    c->told = percent - percent % TELL_EVERY;
    const double used = rx_seconds() - c->begun;
    char left[RX_TIME_LEFT];
    rx_log_info(c->log, "%ld of %ld units, about %s left", c->done, c->todo,
                rx_time_left(used * (double)(c->todo - c->done) / (double)c->done, left));
}

/* Keep what a unit has given, or why it failed. What is done when a signal stops the others is done. */
static void finish(crew *c, long unit, rx_status status, rx_unit_values *values, rx_error *why)
{
    if (status == RX_OK && (c->status == RX_OK || c->status == RX_INTERRUPTED)) {
        status = rx_journal_append(c->journal, unit, values, why);
        if (status == RX_OK) {
            c->values[unit] = *values;
            values->v = NULL;
            c->done++;
            tell(c);
        }
    }
    if (status != RX_OK && c->status == RX_OK) {
#pragma omp atomic write
        c->status = status; /* read by others outside the critical section */
        if (c->err != NULL)
            *c->err = *why;
    }
    free(values->v);
}

static rx_status run_phase(crew *c, long n, const long *units, int nthreads)
{
#pragma omp parallel for schedule(dynamic, 1) num_threads(nthreads)
    for (long i = 0; i < n; i++) {
        rx_status status;
#pragma omp atomic read
        status = c->status;
        if (status != RX_OK)
            continue;
        rx_error why = RX_ERROR_NONE;
        rx_unit_values values = {0};
        status = rx_interrupt_check(&why);
        if (status == RX_OK)
            status = c->work->unit(c->work->state, units[i], c->values, &values, &why);
#pragma omp critical(rx_campaign_unit)
        finish(c, units[i], status, &values, &why);
    }
    return c->status;
}

rx_status rx_units_run(const rx_unit_work *work, int nthreads, rx_journal *journal, rx_unit_values *values,
                       rx_log *log, rx_error *err)
{
    long all;
    crew c = {
        .work = work, .journal = journal, .values = values, .log = log, .begun = rx_seconds(), .err = err};
    rx_units_count(work, values, &c.todo, &all);
    long *units = NULL;
    RX_TRY(RX_MAKE(units, (size_t)c.todo + 1, err));
    rx_status status = RX_OK;
    rx_log_progress_begin(log);
    for (int phase = 0; status == RX_OK && phase < RX_PHASES; phase++) {
        long m = 0;
        for (long u = 0; u < work->n; u++)
            if (work->place[u].phase == phase && values[u].v == NULL && rx_unit_is_mine(work, u))
                units[m++] = u;
        status = run_phase(&c, m, units, nthreads);
    }
    rx_log_progress_end(log);
    free(units);
    if (status == RX_INTERRUPTED)
        return rx_error_set(
            err, RX_INTERRUPTED,
            "interrupted by a signal; what is done is in the journal, %ld of %ld units, and the "
            "same command goes on from there",
            all - c.todo + c.done, all);
    if (status == RX_OK && c.done > 0) {
        const double used = rx_seconds() - c.begun;
        rx_log_info(log, "%ld units in %.1f s on %d threads, %.3g s each", c.done, used, nthreads,
                    used * nthreads / (double)c.done);
    }
    return status;
}
