/* What surveys deliver besides light and white noise: correlated and uneven noise, edges, waves, holes, defects, PSFs that
 * are given wrong. Each thing by itself in a share of the images, but for the two kinds of correlated noise, which exclude
 * each other; n is the noise, g and s factors, x the image as it is delivered.
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
 *   defects  Cosmic rays (simulate/noise.h), 3 in a patch on average, a noise unit being 5..100
 *            electrons, and up to two bad columns or parts of them, 1..30 noise units above or below
 *            (log-uniform). In x alone.
 *   psf      On top of psf_error: errors of 3 % in FWHM, 0.03 in b/a, 5 % in beta (rms); of every other PSF that
 *            has a halo, nothing is known of the halo. */
#ifndef RX_SIMULATE_SURVEY_SKY_H
#define RX_SIMULATE_SURVEY_SKY_H

#include "base/error.h"
#include "base/random.h"
#include "data/noise_correlation.h"

/* Shares of the samples, 0 .. 1. */
typedef struct rx_survey_params {
    double smoothed, resampled; /* together at most 1 */
    double smoothed_fwhm[2];    /* pixels, uniform */
    double uneven, offsets, waves, dark, defects, psf;
    double sky_offset; /* noise units */
} rx_survey_params;

/* rms of the errors of given PSFs: ln FWHM, b/a, ln beta; cut at 3 of them */
#define RX_SURVEY_FWHM 0.03
#define RX_SURVEY_RATIO 0.03
#define RX_SURVEY_BETA 0.05
/* largest drop of drizzle, pixels of the image */
#define RX_SURVEY_DROP 2.0

/* What one sample comes with: of what does not, 0. */
enum { RX_SURVEY_MOST = 3 };
typedef struct rx_survey {
    rx_noise_correlation correlation;
    int window, side; /* pixels: of its planes, and of the patch in their middle */
    int uneven, nedges, nwaves, nholes, defects;
    double slope[2], centre; /* of ln g, per pixel, 0 in the centre */
    struct {
        double a, b, c, step;
    } edge[RX_SURVEY_MOST]; /* a x + b y + c, pixels beyond the edge */
    struct {
        double u, v, phase, height;
    } wave[RX_SURVEY_MOST];
    struct {
        double x, y, xx, yy, xy, depth;
    } hole[RX_SURVEY_MOST];        /* exponent: xx dx^2 ... */
    double sky, fwhm, ratio, beta; /* offset; what the PSF as given is wrong by: factors, minor axis added */
    int no_halo;                   /* its halo is not in the PSF as given */
    rx_random_stream key;
} rx_survey;

void rx_survey_draw(const rx_survey_params *par, rx_random_stream key, int window, int side, double fwhm,
                    rx_survey *dst);
/* At pixel (x, y) of the window: ln g, ln s, and waves and holes. */
double rx_survey_noise(const rx_survey *survey, double x, double y);
double rx_survey_scale(const rx_survey *survey, double x, double y);
double rx_survey_light(const rx_survey *survey, double x, double y);
/* pixels [window][window] += cosmic rays and bad columns. */
void rx_survey_defects(const rx_survey *survey, float *pixels);

/* The largest noise factor (data/noise_correlation.h) that samples with these shares have: of the matched filter of the widest PSF, a
 * Gaussian, under the widest smoothing and the worst resampling; 1 of white noise. */
rx_status rx_survey_factor(const rx_survey_params *par, double fwhm, double *factor, rx_error *err);

#endif
