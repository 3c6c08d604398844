/* What this machine convolves at most: the measure that a network's speed is compared with. */
#ifndef RX_NN_PEAK_H
#define RX_NN_PEAK_H

#include "base/error.h"
#include "nn/plane.h"

/* *flops: additions and multiplications per second of one thread, the fastest of as many runs as fit into 50
 * ms of a 3x3 convolution (nn/direct.h, by the definition) of 64 to 64 channels on 56 x 56 pixels, whose planes
 * stay in the cache. Errors: RX_SYSTEM. */
rx_status rx_peak_measure(rx_real real, double *flops, rx_error *err);

#endif
