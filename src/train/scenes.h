/* Training images made by the simulator's library, in memory.
 *
 * A field of FIELD_SIDE pixels, and RX_SCENES_FRAME more around it, holds (side/P)^2 places for patches.
 * It is rendered once, sharp and blurred, with its own PSF: FWHM uniform in the bin's range, beta,
 * ellipticity and angle. What a real tile comes with is fresh for every patch:
 *
 *   sigma  uniform in the bin's range; it sets the scale: the brightness of the field (nn/noise_level.h) is
 *          255/sigma noise units. No light at all: only noise.
 *   x      (v + sqrt(1 + q v) n + sky) / r: v the blurred light in true noise units, n normal, q photon
 *          noise, sky normal of rms sky_error, r noise as given over true, ln r normal; the other planes
 *          are divided by r too.
 *   w, K'  from the PSF as given, with an error of its FWHM, ln(given / true) normal. w is filtered on a
 *          window that holds RX_SCENES_FRAME pixels of the field's light around the patch: it is right to
 *          the patch's border, to about 1e-3 of the brightest pixels nearby.
 *
 * Errors are cut at 3 sigma. K' * y is the blurred plane to 2 % of the brightest pixel at FWHM 2, 0.5 % at
 * 2.5, 0.1 % from 3 on (what nn/deblur.h says of K').
 *
 * Kinds of fields: 40 % stars (with a tenth of the galaxies), 25 % galaxies (with a tenth of the stars),
 * 35 % both in full. Counts are those of the SIM. keywords times density^u, u uniform in -1..1 for stars,
 * galaxies and templates each; the slope of the stars' counts is the keyword's +- 0.1, the share in clumps
 * uniform between 0 and the keyword's. Distances of pairs follow the FWHM of the field.
 *
 * PSFs with a halo: 2 to 15 % of the light (uniform) in a second, round Moffat of 2 to 6 times the FWHM (log-uniform, at
 * most 16 pixels) and beta 3 to 5, as scattering, a turbulent atmosphere or charge diffusion leave it.
 *
 * Nebulae: 1 to 3 Gaussians of half-light radius 12..80 pixels (log-uniform), ratio 0.3..1, their centres
 * 0.01..3 times (log-uniform) the brightness, which is then found again. Bright stars: 30 % of the fields have
 * 1 to 3 of them, peaks of 2..RX_NOISE_LEVEL_PEAK times (log-uniform) that brightness, which stays as it is: rare ones
 * of a tile that is larger than the field.
 *
 * What surveys deliver comes on top in shares of the samples, each thing by itself, but for the two kinds of
 * correlated noise, which exclude each other; with shares of 0 all is as if these did not exist.
 *
 *   noise    Smoothed: by a Gaussian. Resampled: in equal parts by a linear, cubic (Keys 1981) or Lanczos-3
 *            interpolation at a shift of 0..1 pixel in x and y, or as drizzle of many dithered frames leaves
 *            it: drops of 0.5..2 pixels of the image on its pixels. n is scaled so that the filter matched to
 *            the true PSF has the noise that white n of rms 1 would have: noise units are those of the
 *            effective noise, and the pixels of smoothed noise are quieter than 1. The PSF stays as it is:
 *            that of the resampled image.
 *   uneven   n times g: a gradient of ln g, up to 0.5 from the centre of a patch to its border, in any
 *            direction, and up to two edges of exposures, straight in any direction, where ln g steps by
 *            0.15..0.7. What is given is as smooth as restore/network_data.h makes it (s: a Gaussian of 32
 *            pixels over ln g): all planes are divided by s as well.
 *   sky      A constant within +-sky_offset, in x alone.
 *   waves    1 to 3 sine waves of 16 FWHM..1024 pixels, amplitudes 0.05..1 noise units (log-uniform).
 *   dark     1 to 3 Gaussian holes, sigmas from 3 FWHM to 60 pixels, 0.3..10 noise units deep (log-uniform).
 *            Waves and holes are in x and in what is true of it alike: light that the data have, above or
 *            below the sky.
 *   defects  Cosmic rays (simulate/cosmic_rays.h), 3 in a patch on average, a noise unit being 5..100
 *            electrons, and up to two bad columns or parts of them, 1..30 noise units above or below
 *            (log-uniform). In x alone.
 *   psf      On top of psf_error: errors of 3 % in FWHM, 0.03 in b/a, 5 % in beta (rms); of every other PSF that
 *            has a halo, nothing is known of the halo.
 *
 * Which field and which of its places a sample comes from follows from its id alone: samples whose indices
 * share index / places come from one field, and the same index in successive epochs that share epoch / uses
 * from one field too, turned otherwise each time. In the first of these epochs patches are cut on a grid, in
 * the others anywhere. So a field serves places * uses images. */
#ifndef RX_TRAIN_SCENES_H
#define RX_TRAIN_SCENES_H

#include "base/log.h"
#include "config/config_fields.h"
#include "nn/deblur.h"
#include "nn/front.h"
#include "nn/model.h"
#include "train/sample.h"
#include "train/selection.h"

enum { RX_SCENES_FRAME = RX_TIKHONOV_REACH };

/* Shares of the samples, 0 .. 1. */
typedef struct rx_scenes_survey {
    double smoothed, resampled; /* together at most 1 */
    double smoothed_fwhm[2];    /* pixels, uniform */
    double uneven, offsets, waves, dark, defects, psf;
    double sky_offset; /* noise units */
} rx_scenes_survey;

typedef struct rx_scenes_params {
    int side;           /* P, a multiple of 4 */
    int field_side;     /* pixels, a multiple of P */
    int uses;           /* samples made from one rendered patch, each with other noise and turn, >= 1 */
    double beta[2];     /* Moffat exponent, uniform; the paper's 4.765 = both ends */
    double ellipticity; /* of the PSF, uniform 0 .. this */
    double density;     /* counts are multiplied by density^u, u uniform in -1 .. 1; 1 = as given */
    double nebulae;     /* share of fields with smooth nebulae on top */
    double photon[2];   /* q: photon noise per noise unit of flux, log-uniform (uniform when from 0) */
    double halos;       /* share of fields whose PSF has a halo */
    double sky_error;   /* rms of a constant left in x, noise units */
    double noise_error; /* rms of ln(noise as given / true) */
    double psf_error;   /* rms of ln(FWHM as given / true) */
    rx_scenes_survey survey;
    uint64_t seed;
    rx_front front; /* target PSF, Tikhonov */
} rx_scenes_params;

typedef struct rx_scenes rx_scenes; /* keeps fields that later epochs need */

/* `config`: SIM. keywords for the population (its size, noise and PSF keywords have no effect here). It is
 * not kept. Errors: RX_USAGE parameters out of range, or a PSF that does not fit a patch and its frame; those
 * of reading templates; RX_SYSTEM. */
rx_status rx_scenes_new(const rx_scenes_params *par, const rx_selection *grid,
                        const rx_simulate_config *config, int nthreads, rx_log *log, rx_scenes **dst,
                        rx_error *err);
void rx_scenes_free(rx_scenes *scenes); /* NULL is fine */

/* samples[n] of one epoch become new ones, ids[n]; after an error some of them are there. Threads share the fields:
 * those of one field stand one after the other (sorted by set, bin and index). Fields that serve another epoch are kept
 * up to RX_SCENES_MEMORY bytes, those of epochs that are over go.
 * Errors: RX_USAGE for a bin, an index or a set that is not there; RX_SYSTEM, RX_INTERRUPTED. */
#define RX_SCENES_MEMORY ((size_t)1 << 29)
rx_status rx_scenes_make(rx_scenes *scenes, const rx_sample_id *ids, long n, rx_sample **samples,
                         rx_error *err);
int rx_scenes_side(const rx_scenes *scenes); /* of a sample, pixels */

/* Number of the field that a sample comes from: the same for all samples of one field, otherwise different with near
 * certainty. */
uint64_t rx_scenes_field(const rx_scenes_params *par, rx_sample_id id);
/* Which of so many ranks makes a sample: those of one field, the same one. */
int rx_scenes_owner(const rx_scenes *scenes, rx_sample_id id, int ranks);

/* The largest noise factor (data/noise_correlation.h) that samples with these shares have: of the matched filter of the widest PSF, a
 * Gaussian, under the widest smoothing and the worst resampling; 1 of white noise. */
double rx_scenes_factor(const rx_scenes_survey *par, double fwhm);

#endif
