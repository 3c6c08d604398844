/* What writing and reading a model file share. Private to nn/model*.c. */
#ifndef RX_NN_MODEL_PARTS_H
#define RX_NN_MODEL_PARTS_H

#include "nn/model.h"

enum { RX_MODEL_VERSION = 1 };

/* Columns of the tables, in order. */
#define RX_MODEL_NODE_COLUMNS                                                                                \
    {                                                                                                        \
        "OP", "SRC", "ADD", "RELU", "CHANNELS", "KERNEL", "STRIDE"                                           \
    }
enum { RX_MODEL_NNODE_COLUMNS = 7, RX_MODEL_OP_WIDTH = 17 };

#define RX_MODEL_BIN_COLUMNS                                                                                 \
    {                                                                                                        \
        "FWHM_LOW", "FWHM_HIGH", "SIGMA_LOW", "SIGMA_HIGH", "LOSS", "LIST", "RECALL", "BIAS", "SCATTER",     \
            "IMAGES"                                                                                         \
    }
enum { RX_MODEL_NBIN_COLUMNS = 10 };

/* Why the numbers before the networks make no sense (into text), or NULL when they do: front parameters,
 * channels of the networks' ends. */
const char *rx_model_fault(const rx_model *model, char *text, size_t size);

#endif
