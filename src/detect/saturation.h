/* The level at which a tile saturates, from its pixels, where nothing states it.
 *
 * The top of the tile is the highest value that all of 3 x 3 pixels reach. Above the sky by T there, an image saturates
 * where the pixels pile up at it: more than a fifth of those that reach T / 2 lie within 5 % of T, and hardly any above.
 * Of a source that goes on growing to its centre at most ln(1 / 0.95) / ln 2 = 0.074 of the area within its half maximum lies
 * that near to its peak (a Gaussian; Moffat's and galaxies' have less), 0.13 with pixels that are a tenth of its FWHM;
 * narrower ones have no 3 x 3 pixels within 5 %, so that their peaks stand above T. Of one that is cut off at a level,
 * a fourth at 0.85 of its peak, half at 0.5. 5 %: what flat fields make of one level on the detector.
 * A star of a few pixels shows it by the highest value: many have just that one, hardly any others come near.
 *
 * Where nothing piles up, cores may be hollow, as bleeding, bias and interpolation leave them: a pixel less than half as high as both
 * of its neighbours in its row or its column. No sum of sources is that dark between two of its pixels, if its PSF has a FWHM of 1.42
 * pixels or more (two points two pixels apart, 2 exp2(-4 / FWHM^2) = 1/2). Tops are the highest of 5 x 5 pixels, hollow with
 * such a pixel in these. Of all levels the one that parts them best, hollow above and whole below: with the most hollow less
 * whole tops above it, at least three, and so many that defects which know no brightness, as the share p of the
 * tops below has, lead to it on 1 of 1000 tiles: (p / (1 - p))^number, for the maximum of a random walk, where most
 * tops are below. It lies at the next one below, where that is above half the height of the last one. */
#ifndef RX_DETECT_SATURATION_H
#define RX_DETECT_SATURATION_H

#include "base/error.h"
#include "data/image.h"

/* *level: ADU from which on values are cut off, HUGE_VAL where none are. None where the sky has no noise.
 * Errors: RX_SYSTEM. */
rx_status rx_saturation_find(const rx_image *image, const uint8_t *mask, double *level, rx_error *err);

#endif
