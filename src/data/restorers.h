/* Every restorer, once:
 *
 *   RESTORER(NAME, function, traits, cost, help)
 *
 * NAME      word of RESTORE_TYPE
 * function  what does it, an rx_status function(...) of restore/ as restore/runs.h declares them all
 * traits    what it is: RX_TRAIT_... of restore/restore.h
 * cost      row of the memory that -PLAN reckons with (stage/plan.c); NET only for the network and for AUTO, which
 *           is none itself but takes one for each tile (check/choice.h)
 * help      one line
 *
 * The restorers of restore/restore.c, the words of RESTORE_TYPE (config/keys.def, config/campaign.def) and what
 * -PLAN says of each come from these rows.
 */
#ifndef RX_DATA_RESTORERS_H
#define RX_DATA_RESTORERS_H

/* clang-format off */
#define RX_NETWORK_TRAITS RX_TRAIT_PSF | RX_TRAIT_WHITE | RX_TRAIT_INVENTS | RX_TRAIT_TRAINED
#define RX_RESTORERS(RESTORER)                                                                              \
    RESTORER(NONE,     rx_none_run,     RX_TRAIT_PLAIN,    NONE,     "the tile as it is, background subtracted")      \
    RESTORER(RL,       rx_rl_run,       RX_TRAIT_PSF,      RL,       "Richardson-Lucy with the given PSF")            \
    RESTORER(RL_BLIND, rx_rl_blind_run, RX_TRAIT_PSF,      RL_BLIND, "Richardson-Lucy that improves the PSF as well") \
    RESTORER(NET,      rx_network_run,  RX_NETWORK_TRAITS, NET,      "a trained network")                             \
    RESTORER(FILE,     rx_file_run,     0,                 RL,       "pixels that were restored elsewhere")            \
    RESTORER(AUTO,     rx_auto_run,     RX_TRAIT_PSF,      NET,      "NET, else RL, else NONE: the first that the tile's model accepts")

/* How many there are, and their names as the words of a keyword, NULL behind them. */
#define RX_RESTORER_ONE(...) + 1
#define RX_RESTORER_COUNT (0 RX_RESTORERS(RX_RESTORER_ONE))
#define RX_RESTORER_WORD(name, ...) #name,
#define RX_RESTORER_WORDS RX_RESTORERS(RX_RESTORER_WORD) NULL
/* clang-format on */

#endif
