/* The smallest network that is one: PSF-NET of width 4, all parameters 0, so that it adds nothing to its base. */
#ifndef TESTS_UNIT_SMALL_NET_H
#define TESTS_UNIT_SMALL_NET_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nn/psfnet.h"

static inline rx_net *small_net(int inputs, int blocks)
{
    const rx_psfnet_shape shape = {.stem = RX_STEM_UNSHUFFLE,
                                   .decoder = RX_DECODER_BILINEAR,
                                   .width = 4,
                                   .blocks = blocks,
                                   .stem_kernel = 3,
                                   .kernel = 3};
    rx_net *net = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_psfnet_new(&shape, inputs, &net, &err) != RX_OK)
        fail_msg("%s", err.text);
    return net;
}

#endif
