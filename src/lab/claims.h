/* Claims (claims.def) and verdicts on them. A campaign has a judge for each claim that it is asked about. */
#ifndef RX_LAB_CLAIMS_H
#define RX_LAB_CLAIMS_H

#include "base/text.h"

#define CLAIM(id, name, place, words, test) id,
#define GOAL(id, name, low, high, words) id,
typedef enum rx_claim_id {
#include "lab/claims.def"
    RX_CLAIM_COUNT
} rx_claim_id;
#undef CLAIM
#undef GOAL

typedef struct rx_claim {
    const char *name, *place, *words, *test; /* place, test: NULL of a goal for each restorer */
    int each;                                /* 1: such a goal */
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
static inline rx_claim_state rx_claim_state_of(int holds)
{
    return holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

typedef struct rx_claim_verdict {
    rx_claim_id claim;
    int run; /* of a claim for each restorer, else -1 */
    rx_claim_state state;
    int held, all; /* numbers that were compared with the limits */
    rx_text said;  /* the numbers behind it */
} rx_claim_verdict;

enum { RX_VERDICTS_MAX = 72 };

typedef struct rx_claim_verdicts {
    int n;
    rx_claim_verdict list[RX_VERDICTS_MAX];
} rx_claim_verdicts;

struct rx_store;

/* Claims first to last (0: the first alone). judge NULL: not tested by this kind of campaign. A verdict comes to it as not
 * yet testable, or not measured; where a column of `needs` is absent, it stays so. */
typedef struct rx_claim_judge {
    rx_claim_id first, last;
    void (*judge)(const struct rx_store *store, rx_claim_verdict *verdict);
    const char *needs[3];
} rx_claim_judge;

/* A verdict by each judge of the lab's kind, of a claim for each restorer one for each run. rx_claim_verdicts_free(). */
void rx_claims_judge(const struct rx_store *store, rx_claim_verdicts *dst);
void rx_claim_verdicts_free(rx_claim_verdicts *verdicts); /* content only */

#endif
