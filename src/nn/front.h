/* What stands around the network: the planes it is given, and what its output means.
 *
 * Unit: the noise of the sky, x = (pixel - background) / sigma. Stretch (keeps signs, linear near 0, square
 * root far away): s(v) = sign(v) (sqrt(|v| + 1/4) - 1/2), s^-1(u) = sign(u) (u^2 + |u|).
 *
 *   BLIND     channels  s(x)                       base b = s(x)
 *   INFORMED  channels  s(x), s(w), (FWHM - 5)/3   base b = s(w),  w = Tikhonov(x), nn/deblur.h
 *   PSF net   channels  s(y), (FWHM - 5)/3         base b = s(y),  y = the sharp plane
 *
 *   SECOND    channels  s(x), s(w), (FWHM - 5)/3, s(f), s(x - K' max(f, 0))    base b = s(f)
 *             f = what the network before it and its steps made; what is left of the data beside it
 *
 *   output v = s^-1(b + net(channels)); flux stays linear. INFORMED with rl_steps: then nn/rl_step.h, after each stage.
 *
 * What is shown, and what a model's recall and bias are measured on: that through rx_front_shown(), which no
 * loss sees; the restored image has the sky that it does not explain besides (restore/network_sky.h).
 *
 * FWHM is that of the tile's PSF in pixels, a plane where it varies. */
#ifndef RX_NN_FRONT_H
#define RX_NN_FRONT_H

#include <math.h>

#include "base/extern.h"

RX_BEGIN_DECLS

typedef enum rx_mode { RX_MODE_BLIND, RX_MODE_INFORMED } rx_mode;

enum { RX_FRONT_STEPS = 4 };

typedef struct rx_front {
    rx_mode mode;
    double target_fwhm; /* Gaussian of that FWHM, integrated over the pixel: PSF of the output, pixels [2] */
    double tikhonov;    /* epsilon of nn/deblur.h [0.02] */
    int rl_steps;       /* Richardson-Lucy steps after each network, at most RX_FRONT_STEPS [2]; 0 BLIND */
    double pedestal;    /* of nn/rl_step.h, noise sigmas [1] */
} rx_front;

enum { RX_PSF_CHANNELS = 2, RX_SECOND_CHANNELS = 5 };
static inline int rx_front_channels(rx_mode mode)
{
    return mode == RX_MODE_INFORMED ? 3 : 1;
}

static inline float rx_stretch(float v)
{
    return copysignf(sqrtf(fabsf(v) + 0.25f) - 0.5f, v);
}
static inline float rx_unstretch(float u)
{
    return copysignf(u * u + fabsf(u), u);
}
/* d rx_stretch / dv and d rx_unstretch / du */
static inline float rx_stretch_slope(float v)
{
    return 0.5f / sqrtf(fabsf(v) + 0.25f);
}
static inline float rx_unstretch_slope(float u)
{
    return 2 * fabsf(u) + 1;
}
static inline float rx_front_fwhm(double fwhm)
{
    return (float)((fwhm - 5) / 3);
}

/* Light is not negative, so what is far below the sky (beside bright stars) is surely wrong and cut. Waves of up to a
 * tenth of the noise, above and below alike or the mean would rise and every aperture with it, are what the network
 * leaves of an empty sky: 0. From a fifth on all is as it is, smooth between them (half of that gains half as much SSIM,
 * twice that no more). Faint light that goes with them is low in frequency and comes back as such. */
static inline float rx_front_shown(float f)
{
    const float v = f > -0.5f ? f : -0.5f, seen = (fabsf(v) - 0.1f) / 0.1f;
    const float above = seen > 0 ? seen : 0, t = above < 1 ? above : 1;
    return v * (t * t * (3 - 2 * t));
}

RX_END_DECLS

#endif
