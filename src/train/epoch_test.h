/* The test at the end of an epoch: from what each test image says to the rows of the dictionary. */
#ifndef RX_TRAIN_EPOCH_TEST_H
#define RX_TRAIN_EPOCH_TEST_H

#include "train/learner.h"

/* images[sum of selection->test], bin by bin. Fills loss, train, test, recall, bias and scatter of
 * bins[nbins], then updates selection (Eq. 4) and fills list, and gives test_loss, input_loss, recall, bias
 * and scatter of the epoch. Errors: RX_SYSTEM. */
rx_status rx_epoch_test(const rx_test_image *images, rx_selection *selection, rx_epoch *epoch,
                        rx_epoch_bin *bins, rx_error *err);

/* The bins of an epoch as the dictionary of a model, whose grid is made. Errors: RX_SYSTEM. */
rx_status rx_epoch_dictionary(const rx_selection *selection, const rx_epoch_bin *bins, rx_model *model,
                              rx_error *err);

#endif
