/* Everything that a training goes on from: the same state gives the same training, to the byte. */
#ifndef RX_TRAIN_STATE_H
#define RX_TRAIN_STATE_H

#include "nn/model.h"
#include "train/adam.h"
#include "train/history.h"

typedef struct rx_train_state {
    float *params[RX_MODEL_NETS]; /* [adam[k]->n], owned */
    rx_adam *adam[RX_MODEL_NETS]; /* owned; NULL: the model has no such network */

    long epoch;   /* complete ones */
    long at;      /* training images done of the next one */
    long patches; /* of all epochs */
    rx_selection selection;
    rx_history history;

    double best;                       /* lowest validation loss */
    long best_epoch;                   /* the epoch, from 1, whose it is; 0: none yet */
    float *best_params[RX_MODEL_NETS]; /* [adam[k]->n] its weights, owned */

    double slow;  /* the rate is multiplied by this, halved each time the loss diverged */
    long returns; /* how often it did */
    double usual; /* running mean of the loss */
    long usual_n; /* batches behind it */
    long high;    /* batches in a row far above it */

    /* sums of the epoch that is not complete */
    rx_step_values sum;
    double norm, rate;
    long batches;
} rx_train_state;

/* Weights are those of the model; the selection holds the first counts. Errors: RX_SYSTEM. */
rx_status rx_train_state_new(const rx_model *model, const rx_selection *selection, rx_train_state **dst,
                             rx_error *err);
void rx_train_state_free(rx_train_state *state); /* NULL is fine */
/* Both of the same networks and bins. Errors: RX_SYSTEM, dst is then of no use. */
rx_status rx_train_state_copy(const rx_train_state *src, rx_train_state *dst, rx_error *err);

/* The end of an epoch, with its validation loss: are its weights the best so far? Then they are kept. */
void rx_train_state_rank(rx_train_state *state, double validation);

/* Weights into the networks of the model: those of now, those of the best epoch. */
void rx_train_state_load(const rx_train_state *state, rx_model *model);
void rx_train_state_load_best(const rx_train_state *state, rx_model *model);

#endif
