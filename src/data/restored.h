/* What a restorer hands on: the image, its noise and the PSF it now has. */
#ifndef RX_DATA_RESTORED_H
#define RX_DATA_RESTORED_H

#include <stdint.h>

#include "base/extern.h"
#include "data/map.h"
#include "data/psf.h"
#include "data/tile.h"

RX_BEGIN_DECLS

typedef struct rx_restored {
    const char *name; /* "NONE", "RL", ... static */
    int width, height;
    float *pixels; /* background-subtracted, ADU; masked pixels hold 0 */
    uint8_t *mask; /* RX_MASK_ bits of the image that the restorer honoured; 0 in gaps but for NONE */
    struct rx_gaps
        *gaps;        /* narrow gaps among masked pixels (data/gaps.h), which hold the restorer's estimate of
                             the light there, but for NONE; owned, NULL without any */
    float *support;   /* share (0..1), PSF-weighted, of the pixels a value was made from that are masked or
                         beyond the border; NULL unless asked for (keep_support) and for NONE */
    float *reblurred; /* what `blur` makes of the restored sky (before RL_DENOISE), ADU above the sky, to be
                         compared with input - level; NULL unless asked for (keep_reblurred) and for NONE */
    rx_map noise;     /* of a pixel, for detection, ADU: the input's (NONE), or what noise_maker makes of the
                         input and `mask`; the input's owners must live as long; none: measure it on pixels */
    rx_map_maker *noise_maker; /* owned; NULL where there is none */
    rx_psf *psf;               /* of the restored image */
    rx_psf *blur;              /* PSF that was used (estimated by RL_BLIND), NULL for NONE */
    int iterations;            /* done; 0 where it has no meaning */
    double chi2;               /* reduced chi2 of reblurred - input over good pixels; NAN for NONE */
    double seam; /* VERIFY_SEAMS: largest difference to a restoration in other blocks, sigmas; else NAN */
    double seconds;
    char settings[256]; /* "RL_NITER 18, RL_DENOISE 2.4 pixels, ..." for headers and report */
} rx_restored;

/* Zeroed planes of pixels and mask, the rest empty, chi2 NAN; NULL without memory. */
rx_restored *rx_restored_new(const char *name, int width, int height);

/* The same without pixels, which the caller makes when other planes are gone. */
rx_restored *rx_restored_bare(const char *name, int width, int height);

void rx_restored_free(rx_restored *restored);

RX_END_DECLS

#endif
