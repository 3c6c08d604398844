/* CHECKIMAGE_TYPE RESTORED_RMS: what noise does to a restored image, pixel by pixel.
 *
 * The image that was restored, blurred again, is a sky without noise that is like the one observed. With two realisations of
 * the tile's noise and of its own photons, both restored as the tile was, it says how far two restored images of one sky are
 * apart: half of the square of that is the variance of one, with a single freedom. Pixels that are alike have the same: those with the same light
 * in the image blurred again and in the restored one, both in sigmas of the sky, which tells the core of a star from its ring and from
 * the sky. So
 *
 *   rms = sqrt(v mean of (a - b)^2 / 2v over pixels alike),     v of the observed pixel: sky and photons
 *
 * in steps of a third in asinh 2 z of both, over at least 200 pixels, of the 1024 x 1024 (or all) that hide least. It is the scatter about the mean of many
 * exposures, not the distance of that mean from the truth; what noise makes of sources that were not restored is not in it. */
#ifndef RX_CHECK_RESTORED_NOISE_H
#define RX_CHECK_RESTORED_NOISE_H

#include "pipeline/pipeline.h"

/* dst[height][width], ADU; NAN where the restored image holds nothing. `tile`: with restored->reblurred, or of RESTORE_TYPE NONE,
 * whose noise is that of sky and photons. Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_restored_noise(const rx_pipeline_params *params, const rx_result *tile, float *dst,
                            rx_error *err);

#endif
