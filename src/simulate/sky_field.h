/* A field as skies differ from one to the next: what is in it, and the PSF it is seen through, as images.
 *
 * PSF: FWHM uniform in a range; exponent, ellipticity and angle uniform. With a halo: 2 to 15 % of the light (uniform) in
 * a second, round Moffat of 2 to 6 times the FWHM (log-uniform, at most 16 pixels) and beta 3 to 5, as scattering, a
 * turbulent atmosphere or charge diffusion leave it.
 *
 * Kinds of fields: 40 % stars (with a tenth of the galaxies), 25 % galaxies (with a tenth of the stars),
 * 35 % both in full. Counts are those of the simulation times density^u, u uniform in -1..1 for stars,
 * galaxies and templates each; the slope of the stars' counts is the simulation's +- 0.1, the share in clumps
 * uniform between 0 and the simulation's. Distances of pairs follow the FWHM of the field.
 *
 * Nebulae: 1 to 3 Gaussians of half-light radius 12..80 pixels (log-uniform), ratio 0.3..1, their centres
 * 0.01..3 times (log-uniform) the brightness, which is then found again. Bright stars: 30 % of the fields have
 * 1 to 3 of them, peaks of 2..RX_NOISE_LEVEL_PEAK times (log-uniform) that brightness, which stays as it is: rare ones
 * of a tile that is larger than the field. */
#ifndef RX_SIMULATE_SKY_FIELD_H
#define RX_SIMULATE_SKY_FIELD_H

#include "base/random.h"
#include "data/psf.h"
#include "simulate/simulation.h"

/* How fields differ. */
typedef struct rx_sky_variety {
    double beta[2];     /* Moffat exponent, uniform; the paper's 4.765 = both ends */
    double ellipticity; /* of the PSF, uniform 0 .. this */
    double density;     /* counts are multiplied by density^u, u uniform in -1 .. 1; 1 = as given */
    double nebulae;     /* share of fields with smooth nebulae on top */
    double halos;       /* share of fields whose PSF has a halo */
} rx_sky_variety;

/* One rendered field. */
typedef struct rx_sky_field {
    int side;
    double fwhm, beta, ratio, angle;
    double halo, halo_fwhm, halo_beta; /* share of the light in a second, round Moffat; 0: none */
    double peak;                       /* highest pixel of the PSF centred on it */
    double norm;                       /* sqrt of the sum of the squared PSF */
    double level; /* brightness (nn/noise_level.h) in units of flux: 255/sigma of the noise; 0: no light */
    float *sharp, *blurred; /* [side][side], not negative */
    long nstars;
    double (*stars)[3]; /* x, y, flux; brightest first */
} rx_sky_field;

/* Field `from` of that FWHM. The simulation is one for the field's side, a PSF of 1 pixel and the sharp image's target:
 * its counts are then per pixel, its lengths in FWHM. Content of *dst is freed by rx_sky_field_clear(). Errors: RX_USAGE
 * (a PSF out of range), RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_sky_field_make(const rx_simulation *simulation, const rx_sky_variety *variety,
                            const double fwhm[2], rx_random_stream from, rx_sky_field *dst, rx_error *err);
void rx_sky_field_clear(rx_sky_field *field);

/* The PSF of these numbers of a field (only its fwhm .. halo_beta are read) as a stamp of sum 1. */
rx_status rx_sky_field_psf(const rx_sky_field *field, rx_psf **dst, rx_error *err);
/* Largest halo that fields have: share, and FWHM in pixels; smallest beta. */
#define RX_SKY_HALO 0.15
#define RX_SKY_HALO_FWHM 16.0
#define RX_SKY_HALO_BETA 3.0

#endif
