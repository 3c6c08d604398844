/* Template photometry: where the sources are and what they look like comes from the restored image, how
 * bright they are from untouched pixels, whose noise is known. The idea of TFIT (Laidler et al. 2007, PASP
 * 119, 1325) and T-PHOT (Merlin et al. 2015, A&A 582, A15), with the restored tile as its own high-resolution
 * image.
 *
 *   d(p) = level-subtracted pixel = sum_i F_i T_i(p) + b_group + noise
 *   w(p) = 1 / (sigma(p)^2 + M(p) / gain + (psf_error M(p))^2)
 *   M(p) = sum_i F_i T_i >= 0 of the round before (photons of the model, not of the data: those would bias)
 *   F, b minimise sum_p w (d - M - b)^2 + (b / (background_sigma sigma))^2 group by group
 *
 * A template T_i has the sum 1 over the plane and is one of
 *   POINT    the tile's PSF at the fitted position
 *   PROFILE  an elliptical Spergel (2010, ApJS 191, 58) profile behind the tile's PSF, whose size,
 *            ellipticity and index are fitted to the pixels, starting from the source's shape on the
 *            restored image
 *   PIXELS   PROFILE plus what the restored pixels of the source's segment and its surroundings have beyond
 *            the profile, blurred by the kernel restored PSF -> tile's PSF; the profile goes on outside
 * chosen by the pixels (chi2 with penalties); where they cannot decide, PROFILE holds a point, too, in
 * proportion to the probabilities. So the outskirts that no segment holds are never cut off.
 *
 * Where the noise of the image is correlated (rx_image.correlation) the weights stay, and errors, S/N, evidence
 * and what decides between shapes are those of that noise (correlated.h); chi2 is that of pixels.
 *
 * Fluxes of extended sources are means over what their shape may be. Flux errors hold the noise of the sky
 * and of photons, the neighbours, the local background and, of extended sources, what the freedom of the
 * profile costs and what Spergel's profiles are found to be wrong by (0.8 %, steep ones up to 5 %: those miss
 * light in their wings, Sersic's n > 2.6 is 5 % too faint). That of the PSF, which all
 * fluxes of a tile share, is added where it is known (rx_psf_flux_error(), over the share of the light that is seen), not to S/N and
 * covariances. In a crowd points lose the light that neighbours too near to be seen add on average, and their errors hold how much
 * that varies (unseen.h); S/N does not. Where more than 10 % of the light is hidden, the error grows by sqrt(chi2). */
#ifndef RX_TEMPLATE_TEMPLATE_H
#define RX_TEMPLATE_TEMPLATE_H

#include "template/tphot.h"

RX_BEGIN_DECLS

/* What the next floor starts from. */
rx_tphot_params rx_tphot_defaults(void);

/* *dst is freed by rx_tphot_free(), NULL after an error. What lies under masks has no influence. The same
 * bytes for any nthreads. Errors: RX_INPUT (shapes do not match, no PSF, PSF not finite), RX_SYSTEM,
 * RX_INTERRUPTED, and what `more` returns. */
rx_status rx_tphot_run(const rx_tphot_params *par, const rx_tphot_input *input, rx_tphot **dst,
                       rx_error *err);
/* Of an image that was given in that unit (data/unit.h): fluxes and planes in ADU. */
void rx_tphot_multiply(rx_tphot *tphot, double unit);

void rx_tphot_free(rx_tphot *tphot); /* NULL is fine */

RX_END_DECLS

#endif
