/* The correlation of a tile's noise, from pixels without sources.
 *
 * z = (pixel - level) / sigma, in 64 to 144 cells of 64 x 64 pixels, fewer where they do not fit, spread evenly
 * over the image. Unused are hidden pixels, those of `used` where a caller knows the sources, else
 * what stands out of the cell (3.5 robust widths after a filter of 3 x 3) with 5 pixels around it, 10 where it is
 * bright; and what is beyond 4 widths. Each cell with enough left gives the mean products of pixels a lag apart over
 * its mean square; the median over the cells is taken, so that galaxies, trails and bad columns in some of them
 * decide nothing. What all lags at the reach have in common (the mean that a sky mesh takes off, sources too faint
 * to be seen) is no correlation of noise and is taken off, unless it is beyond 0.3. Lags within 3 errors of 0 become
 * 0, and noise is uncorrelated where none of the nearest 8 pixels exceeds 4 errors and 0.02, nor the sum over 3
 * pixels each way 5 errors and 0.15. */
#ifndef RX_DETECT_CORRELATION_H
#define RX_DETECT_CORRELATION_H

#include "base/error.h"
#include "data/image.h"
#include "data/noise_correlation.h"

/* used: [height][width], 0 = a source, or NULL. Too little free sky: RX_NOISE_UNKNOWN, RX_OK. The same bytes for any
 * nthreads. Errors: RX_SYSTEM. */
rx_status rx_correlation_measure(const rx_image *image, const unsigned char *used, int nthreads,
                                 rx_noise_correlation *dst, rx_error *err);

#endif
