/* Claims, and the verdicts on them. */
#include "lab/claims.h"

#include <stddef.h>

#include "lab/store.h"

#define CLAIM(id, name, place, words, test) [id] = {name, place, words, test, 0, 0, 0},
#define GOAL(id, name, low, high, words) [id] = {name, NULL, words, NULL, 1, low, high},
static const rx_claim CLAIMS[RX_CLAIM_COUNT] = {
#include "lab/claims.def"
};

const rx_claim *rx_claim_get(rx_claim_id id)
{
    return &CLAIMS[id];
}

const char *rx_claim_state_name(rx_claim_state state)
{
    static const char *const names[RX_CLAIM_STATES] = {
        "reproduced", "not reproduced", "not yet testable", "not tested here",
        "held",       "not held",       "undecided",        "not measured"};
    return names[state];
}

void rx_claims_judge(const rx_store *store, rx_claim_verdicts *dst)
{
    const rx_lab_results *results = store->lab->kind->results;
    dst->n = 0;
    for (int j = 0; j < results->njudges; j++) {
        const rx_claim_judge *judge = &results->judges[j];
        for (rx_claim_id claim = judge->first; claim == judge->first || claim <= judge->last; claim++)
            for (int run = 0; run < (CLAIMS[claim].each ? store->lab->nruns : 1) && dst->n < RX_VERDICTS_MAX;
                 run++) {
                rx_claim_verdict *v = &dst->list[dst->n++];
                *v = (rx_claim_verdict){.claim = claim,
                                        .run = CLAIMS[claim].each ? run : -1,
                                        .state = judge->judge == NULL ? RX_NOT_TESTED
                                                 : CLAIMS[claim].each ? RX_GOAL_NOT_MEASURED
                                                                      : RX_NOT_YET_TESTABLE};
                for (int i = 0; i < 3 && judge->needs[i] != NULL; i++)
                    if (rx_store_column(store, judge->needs[i]) < 0)
                        rx_text_printf(&v->said, "%s did not take part. ", judge->needs[i]);
                if (judge->judge != NULL && v->said.length == 0)
                    judge->judge(store, v);
            }
    }
}

void rx_claim_verdicts_free(rx_claim_verdicts *verdicts)
{
    for (int i = 0; i < verdicts->n; i++)
        rx_text_free(&verdicts->list[i].said);
    verdicts->n = 0;
}
