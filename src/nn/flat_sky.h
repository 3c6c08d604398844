/* Where a network finds nothing the sky is made flat.
 *
 * On empty sky the output still waves by some hundredths of the noise, upwards more than downwards. These
 * waves are no light, and they are below anything that detection could use. With m the largest value within r
 * pixels in x and y,
 *
 *   v becomes v g(m),   g = 0 for m <= t/2, 1 for m >= t, a smooth cubic between
 *   t = 1 sigma where the FWHM of the blurred image is 2.4 pixels or more, rising to 2 sigma at 1.9 pixels
 *   r = 1.25 FWHM of the blurred image, rounded up, 2 to 16
 *
 * so that a source keeps its tails down to the last digit (a threshold on its own pixels would take the share
 * t / peak of a star's flux) and a galaxy its outskirts, and the result still changes continuously with v. A
 * star of S/N 5 has a peak of 3.7 sigma at a FWHM of 2.5 pixels, and more where the seeing is worse. Of the
 * peaks that the network in the box makes of noise alone (768 x 768 pixels, this step left out), 180 per
 * Mpixel exceed 0.5 sigma and 22 exceed 1 sigma at a FWHM of 2.5 pixels (66 and 19 at 4, 532 and 25 at 2.2;
 * but 9,800 and 1,900 at 1.8, where nothing is blurred). With t = 0.5 sigma half of the sky waves at good
 * seeing; with 1.5 the average precision of faint stars and galaxies at FWHM 2.5 to 4 falls by 0.002 to 0.01.
 */
#ifndef RX_NN_FLAT_SKY_H
#define RX_NN_FLAT_SKY_H

/* r (pixels) and t (noise sigmas) for that FWHM (pixels). */
int rx_flat_sky_reach(double fwhm);
float rx_flat_sky_level(double fwhm);

/* v [height][width] in noise units, in place; scratch [height][width] is overwritten. fwhm: of the blurred
 * image, pixels. The same bytes for any nthreads. */
void rx_flat_sky(int width, int height, double fwhm, int nthreads, float *v, float *scratch);

#endif
