/* PSF-NET: two networks of one architecture, RESTORE (blurred to sharp) and PSF (sharp to blurred).
 *
 *   stem      conv, then conv of stride 2 (or 2x2 pixels to channels, conv, conv of stride 2): 1/4 resolution
 *   trunk     residual blocks: conv ReLU conv + input
 *   decoder   twice: to double size (bilinear, transposed convolution, or sub-pixel), skips added
 *   head      one output plane: the correction, in stretched units, that is added to the base channel
 *
 * nn/front.h says what goes in and what becomes of the output. */
#ifndef RX_NN_PSFNET_H
#define RX_NN_PSFNET_H

#include "nn/net.h"

typedef enum rx_decoder { RX_DECODER_BILINEAR, RX_DECODER_TRANSPOSED, RX_DECODER_SUBPIXEL } rx_decoder;
typedef enum rx_stem { RX_STEM_UNSHUFFLE, RX_STEM_CONV } rx_stem;

typedef struct rx_psfnet_shape {
    rx_stem stem;
    rx_decoder decoder;
    int width;  /* base width w: 2w channels at half, 4w at quarter resolution (CONV stem: w at full) [8] */
    int blocks; /* residual blocks [6, the paper's] */
    int stem_kernel, kernel; /* odd [3, 3] (the paper's code: 7, 3) */
} rx_psfnet_shape;

/* A network for `inputs` planes of input and one of output, parameters zero. Errors: RX_USAGE (a shape that
 * cannot be), RX_SYSTEM. */
rx_status rx_psfnet_new(const rx_psfnet_shape *shape, int inputs, rx_net **dst, rx_error *err);

#endif
