/* Everything that the report of a detection campaign says, as numbers.
 *
 * A method's cut for a precision P: the lowest score at which precision over STARS and GALAXIES of the
 * condition together is at least P (no such scenes: the whole list). RL at its best: for ap and the recalls
 * of STARS and GALAXIES and for PAIRS the one of its settings with the highest value, each for itself, chosen
 * on the very tiles of the test, in RL's favour; for everything else the setting of the highest ap over both
 * scenes of the condition together. */
#ifndef RX_LAB_DETECTION_NUMBERS_H
#define RX_LAB_DETECTION_NUMBERS_H

#include "lab/detection.h"
#include "lab/findings.h"
#include "quality/binomial.h"

/* How many quantities there are for a scene, and number q of them. */
int rx_quantity_count(const rx_lab *lab, rx_scene_id scene);
void rx_quantity_get(const rx_lab *lab, rx_scene_id scene, int q, rx_quantity *dst);

typedef struct rx_detection_cell {
    rx_estimate value[RX_QUANTITIES_MAX];
    char chosen[RX_QUANTITIES_MAX][RX_METHOD_NAME]; /* RL at its best: the setting */
} rx_detection_cell;

/* McNemar: objects found by only one of two, each at its own cut for the first precision on that scene. */
typedef struct rx_detection_duel {
    long only_first, only_second;
    double p;
} rx_detection_duel;

typedef struct rx_detection_numbers {
    const rx_lab *lab;
    int best;                /* number of the column "RL" at its best; -1 without RL */
    int ncolumns;            /* nruns, and one more with RL */
    rx_detection_cell *cell; /* [nconditions][nscenes][ncolumns] */
    int net, matched, none;  /* columns, -1 none */
    int nrivals, rival[4];   /* columns that `hero` is compared with */
    int hero;                /* NET, else RL at its best; -1 none */
    rx_detection_duel *duel; /* [nconditions][nscenes][4], STARS and GALAXIES */
} rx_detection_numbers;

rx_status rx_detection_numbers_make(const rx_lab *lab, uint64_t seed, rx_detection_numbers *dst,
                                    rx_error *err);
void rx_detection_numbers_free(rx_detection_numbers *numbers); /* content only */

const rx_detection_cell *rx_detection_cell_of(const rx_detection_numbers *numbers, int condition, int scene,
                                              int column);
const rx_detection_duel *rx_detection_duel_of(const rx_detection_numbers *numbers, int condition, int scene,
                                              int rival);
/* "NONE", "RL" (at its best), "RL 20 0.5" ... */
const char *rx_detection_column_name(const rx_detection_numbers *numbers, int column);

/* One verdict for each claim that it is asked about. rx_claim_verdicts_free(). */
void rx_detection_verdicts(const rx_detection_numbers *numbers, rx_claim_verdicts *verdicts);

#endif
