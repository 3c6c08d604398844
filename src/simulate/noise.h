/* Noise of detector and sky. Every pixel's numbers come from (seed, stream, pixel), so nothing depends on threads. */
#ifndef RX_SIMULATE_NOISE_H
#define RX_SIMULATE_NOISE_H

#include <stdint.h>

typedef enum rx_noise_type { RX_NOISE_NONE, RX_NOISE_GAUSS, RX_NOISE_CCD } rx_noise_type;

typedef struct rx_noise_params {
    rx_noise_type type;
    double sky;         /* ADU per pixel, added in every type */
    double sigma;       /* GAUSS: ADU */
    double gain;        /* CCD: e-/ADU (> 0); sky and sources are Poisson */
    double read_noise;  /* CCD: e- */
    double saturation;  /* every type: ADU (> 0), HUGE_VAL = none; values stop there, charge bleeds not */
    double bad_columns; /* CCD: share of columns that are dead: 0 ADU, whatever fell on them */
    double cosmic_rays; /* CCD: hits per Mpixel (see below) */
    uint64_t seed, stream;
} rx_noise_params;

enum { RX_DEFECT_SATURATED = 1, RX_DEFECT_COLUMN = 2, RX_DEFECT_COSMIC = 4 };

/* Of a pixel of sky, ADU. */
double rx_noise_sigma(const rx_noise_params *par);

/* pixels [height][width] in ADU become the exposed image in place; defects (may be NULL) gets RX_DEFECT_
 * bits, those it has are kept (in a dead column only RX_DEFECT_COLUMN remains). CCD: (Poisson((pixel + sky)
 * gain) + read_noise normal + cosmic rays) / gain, then saturation, then dead columns; not rounded to whole
 * ADU; light below zero counts as none. */
void rx_noise_expose(const rx_noise_params *par, int width, int height, float *pixels, uint8_t *defects,
                     int nthreads);

/* dst[n] = normal deviates of width 1, the ones numbered first, first + 1, ... of (seed, stream): Box and
 * Muller (1958) on pairs of 32-bit words, number i from words of block i / 4. Values end at 6.76 (once in
 * 1.4e11), single precision. */
void rx_noise_normals(uint64_t seed, uint64_t stream, uint64_t first, long n, float *dst);

/* Poisson deviate of that mean (exact inversion for small, PTRS of Hormann 1993 for large means; above 1e12 the
 * rounded normal of that width, which cannot be distinguished). 0 for a mean that is not above 0. number < 2^48. */
double rx_noise_poisson(double mean, uint64_t seed, uint64_t stream, uint64_t number);

/* Cosmic rays: charge along short straight tracks.
 *
 * Muons at sea level: zenith angles ~ cos^2, through a level surface hence ~ cos^3 sin. A track crosses a
 * sensitive layer RX_COSMIC_DEPTH pixels deep (thinned CCDs: 15 to 40 um of silicon, pixels of 10 to 20 um)
 * with any azimuth: RX_COSMIC_DEPTH tan(zenith) pixels long on the image, at most RX_COSMIC_LONGEST. A
 * minimum ionising particle frees about 80 electrons per um of silicon (Particle Data Group), 1200 per pixel
 * of 15 um; the sum along the track fluctuates by 1 + 0.15 l, not below 0.3, with l of Moyal's distribution
 * (1955, Phil. Mag. 46, 263), which is -ln z^2 of a normal z. No charge diffuses: what a pixel gets is its
 * share of the track's length. */
#define RX_COSMIC_DEPTH 2.0
#define RX_COSMIC_LONGEST 100.0
#define RX_COSMIC_CHARGE 1200.0 /* electrons per pixel of path */

typedef struct rx_cosmic_ray {
    double x, y, dx, dy; /* from (x, y), pixels, to (x + dx, y + dy) */
    double charge;       /* electrons in all */
} rx_cosmic_ray;

/* Number `number` of (seed, stream); begins anywhere on width x height pixels. */
void rx_cosmic_ray_make(uint64_t seed, uint64_t stream, uint64_t number, int width, int height,
                        rx_cosmic_ray *dst);

/* pixels [height][width] += charge / gain along the track as far as it is inside; defects (may be NULL) get
 * `bit` there. */
void rx_cosmic_ray_add(const rx_cosmic_ray *ray, double gain, int width, int height, float *pixels,
                       uint8_t *defects, uint8_t bit);

#endif
