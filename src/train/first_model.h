/* A training that begins where another one ended: INIT_MODEL. */
#ifndef RX_TRAIN_FIRST_MODEL_H
#define RX_TRAIN_FIRST_MODEL_H

#include "nn/model.h"

/* The parameters of the networks in the model file `path` become those of `model`, which keeps all else; a
 * network beside RESTORE that only one of both has stays as it is, but two stages do not become one. Errors:
 * RX_USAGE where mode, target PSF or networks are not the same (says which keyword to change), those of
 * rx_model_read(). */
rx_status rx_first_model(const char *path, rx_model *model, rx_error *err);

#endif
