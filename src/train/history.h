/* What every epoch of a training has shown: for the log, the dictionaries, the page, and to judge whether
 * anything still improves. */
#ifndef RX_TRAIN_HISTORY_H
#define RX_TRAIN_HISTORY_H

#include "train/selection.h"
#include "train/step.h"

/* One bin in one epoch. Ratios are NAN without a star. */
typedef struct rx_epoch_bin {
    double loss;                  /* mean of the identity term of RESTORE over its test images */
    double list;                  /* normalised (Eq. 4): decides the counts of the next epoch */
    double train, test;           /* images of this epoch */
    double recall, bias, scatter; /* train/stars.h */
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
    long n, capacity;
    int nbins;
    rx_epoch *epoch;   /* [n] */
    rx_epoch_bin *bin; /* [n][nbins] */
} rx_history;

void rx_history_free(rx_history *history); /* content only */
/* Appends a copy of the epoch and its bins[nbins]. Errors: RX_SYSTEM. */
rx_status rx_history_add(rx_history *history, const rx_epoch *epoch, const rx_epoch_bin *bins, rx_error *err);
rx_status rx_history_copy(const rx_history *src, rx_history *dst, rx_error *err); /* dst's content is freed */

#endif
