/* Where a network finds nothing the sky is made flat.
 *
 * On empty sky the output still waves by some hundredths of the noise, upwards more than downwards. These
 * waves are no light, and they are below anything that detection could use. With m the largest value within r
 * pixels in x and y,
 *
 *   v becomes v g(m),   g = 0 for m <= t/2, 1 for m >= t, a smooth cubic between,   t = 1.5 sigma
 *   r = 1.25 FWHM of the blurred image, rounded up, 2 to 16
 *
 * so that a source keeps its tails down to the last digit (a threshold on its own pixels would take the share
 * t / peak of a star's flux) and a galaxy its outskirts, and the result still changes continuously with v. A
 * star of S/N 5 has a peak of 3.7 sigma at a FWHM of 2.5 pixels, and more where the seeing is worse. Of the
 * peaks that a network makes of noise alone, 480 per Mpixel exceed 0.5 sigma and 2 exceed 1.5 sigma at 2.5
 * pixels (FWHM 4: 109 and 2). */
#ifndef RX_NN_FLAT_SKY_H
#define RX_NN_FLAT_SKY_H

/* r for that FWHM (pixels). */
int rx_flat_sky_reach(double fwhm);

/* v [height][width] in noise units, in place; scratch [height][width] is overwritten. reach: r, >= 0. The
 * same bytes for any nthreads. */
void rx_flat_sky(int width, int height, int reach, int nthreads, float *v, float *scratch);

#endif
