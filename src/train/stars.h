/* How well a restored patch shows its stars: a quick detection and plain fluxes, for the dictionary.
 *
 * Recall: of the listed stars of S/N above 5 whose centre is at least `margin` pixels from the border, the
 * share that is found. A detection is a pixel above 1.7 (noise of the input's sky: what the findings on
 * restored pixels give a precision of 0.95) that is larger than its eight neighbours; a star is found when
 * one of them lies within 1.5 pixels, brighter stars choosing first, the nearest one; each detection serves
 * one star.
 *
 * Flux: sums of the pixels within 2 FWHM of the target PSF of stars of S/N above 12, A(restored) / A(truth) -
 * 1; the circle must lie within the margin, and the star must be isolated: the truth in the circle exceeds
 * its own flux by less than 5 % (no more than a tenth falls outside or is missing). Nothing is tuned: noise
 * of the data is part of the scatter, sources that are not in the list part of both sums. */
#ifndef RX_TRAIN_STARS_H
#define RX_TRAIN_STARS_H

#include "base/error.h"
#include "train/sample.h"

typedef struct rx_star_check {
    double stars, found; /* of S/N above 5, and those found */
    double ratios;       /* stars behind error[] */
    double error[RX_SAMPLE_STARS];
} rx_star_check;

/* restored[side][side] of that sample, as it is shown (nn/front.h). Errors: RX_SYSTEM. */
rx_status rx_star_check_run(const rx_sample *sample, const float *restored, int margin, double target_fwhm,
                            rx_star_check *dst, rx_error *err);

#endif
