/* What the sky does that is neither source nor noise: cirrus, steps between amplifiers, halos of galaxies, a level that is off.
 *
 *   d - M = structure + noise,   z = T'W(d - M) / sqrt(T'WT)
 *
 * T is a template on whole pixels, z its value at places a third of its width apart; a width, sum T / sqrt(sum T^2), is 1.5 FWHM of a
 * point. Without structure z is 0 +- 1. What structure there is at a place its surroundings show: p, the mean of z from 1.2 to 2.5 widths
 * away, where the source itself does not reach. How well they show it is found in cells of 10 widths, which hold 100 independent z:
 *
 *   a         = sum z p / sum p^2, 0 to 1
 *   1 + S^2   = m^2 of z - a p, m the distance from the median to the quantile 0.16, at least 1
 *   share     = 1 / (1 + exp(-gain)),   gain = n / 2 (v + u^2 - 1 - ln v) - ln n
 *
 * v the same m^2 of z itself, u its median, n the independent places; share is the probability that there is structure, by Schwarz's
 * criterion (1978, Ann. Stat. 6, 461) for its two numbers. Sources that no model has raise the upper half of the z of a cell and hardly
 * median and lower half; in a and p the z are cut at 3 m. A flux of T is then too high by share a p, with a variance of share S^2
 * besides that of the noise, both in units of the noise. Between cells share a and share S^2 are linear. */
#ifndef RX_FIT_STRUCTURE_H
#define RX_FIT_STRUCTURE_H

#include "base/error.h"
#include "data/psf.h"
#include "fit/sky_mesh.h"

/* FWHM: holds 0.996 of the sum of P^2 of a Moffat of beta 2.5, 1 - (1 + r^2 / alpha^2)^-4. */
#define RX_PSF_RADIUS 1.5

typedef struct rx_structure {
    rx_sky_mesh level;    /* share a p, ADU, on the mesh of the places */
    rx_sky_mesh variance; /* share S^2, over the variance that noise gives a flux of T */
} rx_structure;

/* What it is measured on. */
typedef struct rx_structure_view {
    int width, height, nthreads;
    const float *rest, *weight; /* [height][width] d - M, ADU; 1 / sigma^2, 0 where a pixel is not used */
    const float *values;        /* [2 half + 1]^2, T */
    int half;
    double noise; /* of z by noise alone: 1, or what correlated pixels make it */
} rx_structure_view;

/* W of a pixel of that weight where the models have so much light: they are known to a tenth of it, before positions and shapes
 * are refined, and what is left of them is no structure of the sky; where that tenth is more than the noise, nothing is. */
static inline float rx_structure_weight(float weight, float model)
{
    const float doubt = 0.01f * weight * model * model;
    return doubt > 1.0f ? 0.0f : weight / (1.0f + doubt);
}

/* The middle of the PSF in the image's centre becomes T: view->values, to be freed by the caller, and half. width and height are given.
 * Errors: RX_SYSTEM. */
rx_status rx_structure_point(const rx_psf *psf, rx_structure_view *view, float **values, rx_error *err);

/* Free the contents with rx_structure_clear(). Errors: RX_SYSTEM. */
rx_status rx_structure_measure(const rx_structure_view *view, rx_structure *dst, rx_error *err);
void rx_structure_clear(rx_structure *structure);

#endif
