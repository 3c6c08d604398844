/* Where a network finds nothing the sky is made flat.
 *
 * On empty sky the output still waves by some hundredths of the noise, upwards more than downwards. These
 * waves are no light, and they are below anything that detection could use. With m the largest value within 3
 * pixels,
 *
 *   v becomes v g(m),   g = 0 for m <= t/2, 1 for m >= t, a smooth cubic between,   t = 0.5 sigma
 *
 * so that a source keeps its tails down to the last digit (a threshold on its own pixels would take the share
 * t / peak of a star's flux), and the result still changes continuously with v. */
#ifndef RX_NN_FLAT_SKY_H
#define RX_NN_FLAT_SKY_H

/* v [height][width] in noise units, in place; scratch [height][width] is overwritten. The same bytes for any
 * nthreads. */
void rx_flat_sky(int width, int height, int nthreads, float *v, float *scratch);

#endif
