/* What every epoch of a training has shown, from its test images: for the log, the dictionaries, the page, and to see
 * whether anything still improves. */
#ifndef RX_TRAIN_HISTORY_H
#define RX_TRAIN_HISTORY_H

#include "train/learner.h"
#include "train/selection.h"

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

#endif
