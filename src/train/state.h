/* Everything that a training goes on from: the same state gives the same training, to the byte. In memory, and in a file, the
 * checkpoint: what comes out has the bytes that it would have had without the interruption.
 *
 *   rextract-train checkpoint 5\n       magic
 *   settings                            text, what decides the training (train/setup.h, RX_SETUP_ALL)
 *   state at the last end of an epoch   sizes, steps, weights, dictionary, history, running mean
 *   whether one follows, and the state within the next epoch, of an interrupted training
 *   digest                              base/hash.h, of all bytes before it
 *
 * Numbers are as this machine has them in memory; random numbers have no state (base/random.h). */
#ifndef RX_TRAIN_STATE_H
#define RX_TRAIN_STATE_H

#include "nn/model.h"
#include "train/learner.h"
#include "train/selection.h"

/* --- what every epoch has shown, from its test images: for the log, the dictionaries, the page, and to see whether anything
 * still improves --- */

/* One bin in one epoch. Ratios are NAN without a star. */
typedef struct rx_epoch_bin {
    double loss;                  /* mean of the identity term of RESTORE over its test images */
    double list;                  /* normalised (Eq. 4): decides the counts of the next epoch */
    double train, test;           /* images of this epoch */
    double recall, bias, scatter; /* train/learner.h */
} rx_epoch_bin;

typedef struct rx_epoch {
    double steps, patches; /* since the beginning of the training */
    double rate;           /* learning rate of the last step */
    double norm;           /* mean norm of the gradient before clipping */
    rx_step_values losses; /* means over the training images */
    double test_loss;      /* mean over the bins of their test loss */
    double input_loss;     /* the same of the images as they are, unrestored: what must be beaten */
    double validation;     /* mean loss of RESTORE over the validation images, the same in every epoch */
    double recall, bias, scatter; /* of the stars of all bins together */
} rx_epoch;

typedef struct rx_history {
    long n;
    int nbins;
    rx_epoch *epoch;   /* [n] */
    rx_epoch_bin *bin; /* [n][nbins] */
} rx_history;

void rx_history_free(rx_history *history); /* content only */
/* Room for n epochs, of which the first ones that were there stay. Errors: RX_SYSTEM. */
rx_status rx_history_resize(rx_history *history, long n, rx_error *err);

/* One epoch more, of the test images[sum of selection->test], bin by bin: of `epoch`, which is given but for its test,
 * test_loss, input_loss, recall, bias and scatter follow, and all of its bins. The selection is then that of the next epoch
 * (Eq. 4). Errors: RX_SYSTEM. */
rx_status rx_history_add(rx_history *history, const rx_test_image *images, rx_selection *selection,
                         rx_epoch epoch, rx_error *err);

/* The bins of an epoch, from 1, as the dictionary of a model. Errors: RX_SYSTEM. */
rx_status rx_history_dictionary(const rx_history *history, const rx_selection *grid, long epoch,
                                rx_model *model, rx_error *err);

/* --- all of it --- */

typedef struct rx_train_state {
    long n; /* parameters of all networks, as rx_model_params() counts them; all four arrays are [n] */
    float *weights;       /* owned, with the other three behind it: */
    float *best;          /* those of the best epoch */
    float *mean, *square; /* moments of Adam */
    size_t bytes;         /* of the four */
    rx_selection selection;
    rx_history history;

    /* From here on all are numbers: */
    long steps;   /* of Adam */
    long epoch;   /* complete ones */
    long at;      /* training images done of the next one */
    long patches; /* of all epochs */

    double best_loss; /* lowest validation loss */
    long best_epoch;  /* the epoch, from 1, whose it is; 0: none yet */

    double slow;  /* the rate is multiplied by this, halved each time the loss diverged */
    long returns; /* how often it did */
    double loss;  /* running mean of the loss */
    long loss_n;  /* batches behind it */
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

/* One step of Adam (Kingma and Ba 2015, arXiv 1412.6980; betas 0.9 and 0.99, epsilon 1e-8) with that gradient[n]. */
void rx_train_state_step(rx_train_state *state, const float *gradient, double rate);

/* The end of an epoch, with its validation loss: are its weights the best so far? Then they are kept. */
void rx_train_state_rank(rx_train_state *state, double validation);

/* weights[n] into the networks of the model. */
void rx_train_weights_load(const float *weights, rx_model *model);

/* `path` is the temporary name of rx_outputs_file(), `shown` the final one. now: NULL, or the state within
 * the epoch. Errors: RX_SYSTEM. */
rx_status rx_checkpoint_write(const char *path, const char *shown, const char *settings,
                              const rx_train_state *kept, const rx_train_state *now, rx_error *err);

/* Into the states, which are of the right networks and grid, as the settings have them. *found 0 when there
 * is no such file; *within 1 when `now` is within an epoch, else it is a copy of `kept`. Errors: RX_USAGE (no
 * checkpoint, or that of other settings: the first keyword that differs is named), RX_INPUT (damaged),
 * RX_SYSTEM; the states are then of no use. */
rx_status rx_checkpoint_read(const char *path, const char *settings, rx_train_state *kept,
                             rx_train_state *now, int *found, int *within, rx_error *err);

#endif
