/* What is claimed: by the paper (paper.h), and as a goal of this program. One table for all kinds of campaign; a campaign
 * has a judge for each claim that it is asked about. */
#ifndef RX_LAB_CLAIMS_H
#define RX_LAB_CLAIMS_H

#include "base/text.h"

typedef enum rx_claim_id {
    RX_CLAIM_EVERY_BIN,
    RX_CLAIM_ALL_P,
    RX_CLAIM_NOISE,
    RX_CLAIM_INSIDE,
    RX_CLAIM_BEYOND,
    RX_CLAIM_SPEED,
    RX_CLAIM_NO_FAKES,
    RX_CLAIM_RESTORED_BETTER,
    RX_CLAIM_NET_BEST,
    RX_CLAIM_LOW_SNR,
    RX_CLAIM_ACCURACY,
    RX_CLAIM_ABOVE_RL, /* this and the next ones: goals of this program, not of the paper */
    RX_CLAIM_ABOVE_FLAT,
    RX_CLAIM_LISTS,
    RX_CLAIM_PAIRS,
    RX_CLAIM_PLATEAU,
    RX_CLAIM_FLUXES,
    RX_CLAIM_TEMPLATES,
    RX_GOAL_BIAS_ISOLATED, /* this and the next ones: for each restorer, a number within limits */
    RX_GOAL_BIAS_BINS,
    RX_GOAL_BIAS_APART,
    RX_GOAL_BIAS_BLENDED,
    RX_GOAL_PULL,
    RX_GOAL_WIDTH,
    RX_GOAL_BOUND,
    RX_GOAL_MAGERR,
    RX_GOAL_PAIRS,
    RX_CLAIM_COUNT
} rx_claim_id;

typedef struct rx_claim {
    const char *name;  /* short, for files and the terminal */
    const char *place; /* section, figure or table of the paper */
    const char *words; /* what is claimed, in our words */
    const char *test;  /* when it counts as reproduced */
    int each;          /* 1: for each restorer, held where its numbers are within the limits */
    double low, high;
} rx_claim;

const rx_claim *rx_claim_get(rx_claim_id id);

typedef enum rx_claim_state {
    RX_REPRODUCED,
    RX_NOT_REPRODUCED,
    RX_NOT_YET_TESTABLE, /* what it speaks of did not take part */
    RX_NOT_TESTED,       /* by this kind of campaign */
    RX_GOAL_HELD,        /* this and the next ones: of claims for each restorer */
    RX_GOAL_NOT_HELD,
    RX_GOAL_UNDECIDED, /* beyond a limit, but nowhere by more than the error of the number */
    RX_GOAL_NOT_MEASURED,
    RX_CLAIM_STATES
} rx_claim_state;
const char *rx_claim_state_name(rx_claim_state state); /* "reproduced" ... */

typedef struct rx_claim_verdict {
    rx_claim_id claim;
    int run; /* of a claim for each restorer, else -1 */
    rx_claim_state state;
    int held, all; /* numbers that were compared with the limits */
    rx_text said;  /* plain sentences made from the numbers */
} rx_claim_verdict;

enum { RX_VERDICTS_MAX = 72 };

typedef struct rx_claim_verdicts {
    int n;
    rx_claim_verdict list[RX_VERDICTS_MAX];
} rx_claim_verdicts;

struct rx_store;

/* judge NULL: not tested by this kind of campaign. A verdict comes to it as not yet testable, or not measured. */
typedef struct rx_claim_judge {
    rx_claim_id claim;
    void (*judge)(const struct rx_store *store, rx_claim_verdict *verdict);
} rx_claim_judge;

/* A verdict by each judge of the lab's kind, of a claim for each restorer one for each run. rx_claim_verdicts_free(). */
void rx_claims_judge(const struct rx_store *store, rx_claim_verdicts *dst);
void rx_claim_verdicts_free(rx_claim_verdicts *verdicts); /* content only */

#endif
