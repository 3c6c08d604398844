/* The verdict on a claim, of a run where it is one for each. */
#ifndef TESTS_UNIT_LAB_VERDICT_H
#define TESTS_UNIT_LAB_VERDICT_H

#include "lab/claims.h"

static inline const rx_claim_verdict *verdict_of(const rx_claim_verdicts *verdicts, rx_claim_id claim,
                                                 int run)
{
    for (int i = 0; i < verdicts->n; i++)
        if (verdicts->list[i].claim == claim && (verdicts->list[i].run == run || verdicts->list[i].run < 0))
            return &verdicts->list[i];
    fail_msg("no verdict on %s", rx_claim_get(claim)->name);
    return NULL;
}

#endif
