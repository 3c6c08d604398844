/* A kind of campaign as the runner sees it: numbered units of work that give numbers, and a report made of
 * the numbers of all units.
 *
 * Units belong to groups (a group is done by one shard) and to phases (units of a phase may use the values of
 * earlier ones of their group). A unit depends on nothing but its number, the settings and those values. */
#ifndef RX_LAB_KIND_H
#define RX_LAB_KIND_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "config/campaign_config.h"
#include "lab/campaign_report.h"
#include "lab/journal.h"

enum { RX_PHASES = 2 };

typedef struct rx_unit_place {
    int group; /* from 0 */
    int phase; /* 0 .. RX_PHASES - 1 */
} rx_unit_place;

typedef struct rx_campaign_kind {
    const char *name;  /* as in CAMPAIGN_TYPE */
    const char *title; /* of the report */
    /* Read what the settings name, on nthreads threads. *state is freed by close(). */
    rx_status (*open)(const rx_campaign_config *config, int nthreads, rx_log *log, void **state,
                      rx_error *err);
    void (*close)(void *state); /* NULL is fine */
    /* What open() has read, digested, for the journal's header. */
    rx_status (*facts)(const void *state, rx_journal_facts *facts, rx_error *err);
    /* The number of units, and where one belongs; place NULL: each a group of its own, so that any number of
     * shards has work. */
    long (*units)(const void *state);
    rx_unit_place (*place)(const void *state, long unit);
    /* Before the first unit: what a report alone does not need; may be NULL. */
    rx_status (*prepare)(void *state, rx_log *log, rx_error *err);
    /* The values of one unit, on one thread; several at the same time. */
    rx_status (*unit)(const void *state, long unit, const rx_unit_values *done, rx_unit_values *dst,
                      rx_error *err);
    /* From the values of all units, as rx_restoration_report() does. */
    rx_status (*report)(const void *state, const rx_unit_values *all, const rx_campaign_record *record,
                        const char *folder, const char *shown, rx_log *log, rx_text *brief, rx_error *err);
} rx_campaign_kind;

extern const rx_campaign_kind rx_kind_restoration, rx_kind_photometry, rx_kind_detection, rx_kind_fluxes;

#endif
