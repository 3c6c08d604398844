/* The unit of a tile's own, for what squares in single precision: images in W/m2/Hz or in erg/s/cm2/A hold 1e-20, and those
 * of a simulation 1e20. It is a power of two, so that nothing is rounded on the way there and back. */
#ifndef RX_DATA_UNIT_H
#define RX_DATA_UNIT_H

#include <stdbool.h>
#include <stddef.h>

#include "base/extern.h"

RX_BEGIN_DECLS

/* The power of two near that noise where it is above 2^30 or below 2^-30; else 1. */
double rx_unit_of(double noise);

/* values[n] in that unit; NULL is fine. */
void rx_unit_divide(float *values, size_t n, double unit);

/* A copy in that unit, to be freed with free(); NULL: no memory. */
float *rx_unit_copy(const float *values, size_t n, double unit);

/* That of the differences between neighbours of a row that differ, their median, which neither the sky nor constants that
 * mark pixels without data enter; 1 where it would be below, for the wings of an image without noise are arbitrarily faint, and
 * where hardly any differ. */
double rx_unit_of_pixels(const float *pixels, int width, int height);

/* A value beyond so many of these units is of no detector: it is bad, as NaN is. */
#define RX_PIXEL_MOST 1e20
float rx_pixel_limit(const float *pixels, int width, int height);

static inline bool rx_pixel_usable(float value, float limit) /* false for NaN */
{
    return value >= -limit && value <= limit;
}

RX_END_DECLS

#endif
