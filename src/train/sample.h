/* One training image: a patch of a simulated field, blurred and noisy, with its sharp truth.
 *
 * All planes are in units of the noise of the sky of that patch as it is given (train/samples.h). Content
 * depends on (seed, epoch, set, bin, index) alone, never on which rank makes it, when, or how many others there are:
 * that is what makes training repeatable for any number of threads and ranks. */
#ifndef RX_TRAIN_SAMPLE_H
#define RX_TRAIN_SAMPLE_H

#include <stdint.h>

#include "base/error.h"

/* Side of the stamp of K', stars listed at most, turns of a square. */
enum { RX_SAMPLE_KERNEL = 63, RX_SAMPLE_STARS = 64, RX_SAMPLE_TURNS = 8 };

typedef enum rx_sample_set { RX_SET_TRAIN, RX_SET_TEST } rx_sample_set;

/* The validation images are test images of this "epoch", which no training reaches (train/samples.h). */
#define RX_EPOCH_VALIDATION UINT32_MAX

typedef struct rx_sample_id {
    uint32_t epoch, set, bin, index;
} rx_sample_id;

typedef struct rx_sample {
    rx_sample_id id;
    int side;   /* P */
    float fwhm; /* of the PSF as the network is given, pixels (the true one where no error is simulated) */
    float true_fwhm;
    float sigma; /* of the bin's scale */
    /* Stars whose centres are 8 pixels or more from the border pixels, brightest first, for recall and bias:
     * x, y from 0 (pixels of the patch), flux (noise as given), S/N of a matched filter (true noise of the
     * sky) */
    int nstars;
    float star[RX_SAMPLE_STARS][4];
    float *x;       /* [P][P] blurred and noisy */
    float *w;       /* [P][P] Tikhonov copy of x, filtered before the patch was cut from its field */
    float *y;       /* [P][P] truth through the target PSF */
    float *blurred; /* [P][P] truth through the true PSF, without noise */
    float *kernel;  /* [RX_SAMPLE_KERNEL][RX_SAMPLE_KERNEL] relative PSF K' as given (nn/deblur.h) */
} rx_sample;

/* One allocation of rx_sample_bytes(side): header, then planes; a sample travels between ranks as these bytes
 * (same machine type); rx_sample_attach() sets the pointers again after it has arrived. Free it with free(). Errors:
 * RX_SYSTEM. */
rx_status rx_sample_new(int side, rx_sample **dst, rx_error *err);
size_t rx_sample_bytes(int side);
void rx_sample_attach(rx_sample *sample);

/* One of the eight turns and flips of the square (0 = none), of all planes, kernel and star positions. */
rx_status rx_sample_turn(rx_sample *sample, int turn, rx_error *err);

#endif
