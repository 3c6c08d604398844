/* Noise of sums of pixels. */
#include "data/noise_correlation.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "base/min_max.h"

enum { REACH = RX_NOISE_REACH, SIDE = RX_NOISE_SIDE };

static const double LEAST = 0.1; /* of a factor: a measured correlation may be none that noise can have */

static const double FAR = 3.0;   /* pixels: resampling leaves next to nothing at larger lags */
static const double CLEAR = 5.0; /* errors of a share of light */
static const double MOST = 0.85; /* of the variance that faint light can be */
static const double LESS = 0.95; /* of a share that leaves too little */
/* Skewness of pixels that is light's: that of a globular cluster's core is 1.0, of Spitzer's crowd 0.9, of smoothed coadds below 0.1; of
 * noise of one photon a pixel, 1, smoothing by as much as a PSF leaves a quarter. */
static const double SKEWED = 0.5;
static const double LITTLE = 0.03, LITTLE_ERRORS = 4.0; /* what is left of noise that is none */

static const double SIGNIFICANT = 5.0, DIFFERENT = 0.15; /* of quadrants: errors, share */

rx_noise_correlation rx_noise_white(rx_noise_origin origin)
{
    rx_noise_correlation noise = {.origin = origin, .scale = 1.0};
    noise.at[REACH][REACH] = 1.0;
    for (int i = 0; i < RX_NOISE_QUADRANTS; i++)
        noise.quadrant[i] = origin == RX_NOISE_UNKNOWN ? NAN : 1.0;
    return noise;
}

/* sum_i h_i h_(i + d) */
static double overlap(const float *h, int width, int height, int dx, int dy)
{
    double sum = 0.0;
    for (int y = rx_max_int(0, -dy); y < rx_min_int(height, height - dy); y++)
        for (int x = rx_max_int(0, -dx); x < rx_min_int(width, width - dx); x++)
            sum += (double)h[(size_t)y * (size_t)width + (size_t)x] *
                   (double)h[(size_t)(y + dy) * (size_t)width + (size_t)(x + dx)];
    return sum;
}

rx_noise_correlation rx_noise_of_kernel(const float *kernel, int width, int height)
{
    rx_noise_correlation noise = rx_noise_white(RX_NOISE_GIVEN);
    const double power = overlap(kernel, width, height, 0, 0);
    noise.correlated = power > 0.0;
    for (int dy = -REACH; dy <= REACH && noise.correlated; dy++)
        for (int dx = -REACH; dx <= REACH; dx++)
            noise.at[dy + REACH][dx + REACH] = overlap(kernel, width, height, dx, dy) / power;
    for (int i = 0; i < RX_NOISE_QUADRANTS; i++)
        noise.quadrant[i] = pow(rx_noise_factor_wide(&noise), 2.0);
    return noise;
}

/* What is light in measured correlations, share L + floor + (1 - share - floor) of the noise's. */
typedef struct faint_light {
    double share, error, floor;
} faint_light;

/* By least squares at lags of `from` pixels and more, where the noise is taken to have none. */
static faint_light fit_light(const rx_noise_correlation *noise, double (*light)[SIDE], double photons,
                             double from)
{
    double n = 0.0, l = 0.0, ll = 0.0, m = 0.0, lm = 0.0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++) {
            const double one = light[dy + REACH][dx + REACH], at = noise->measured[dy + REACH][dx + REACH];
            /* in its rows and columns the ringing of Lanczos and cubic kernels reaches farther */
            if (dx * dx + dy * dy < from * from || (from > 1.0 && (dx == 0 || dy == 0)))
                continue;
            n++;
            l += one;
            ll += one * one;
            m += at;
            lm += one * at;
        }
    const double power = ll - l * l / n;
    faint_light fit = {.share = (lm - l * m / n) / power, .error = noise->error * sqrt(2.0 / power)};
    fit.floor = (m - fit.share * l) / n;
    if (photons > 0.0 && photons < 1.0 - MOST) /* they are none of it */
        fit.share = fmin(fit.share, 1.0 - photons - fit.floor);
    return fit;
}

/* noise = (measured - light) / what is left of the variance; returns the largest of the nearest 8, in size. */
static double take_off(double (*light)[SIDE], const faint_light *of, rx_noise_correlation *noise)
{
    const double left = 1.0 - of->share - of->floor;
    double largest = 0.0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++) {
            double *at = &noise->at[dy + REACH][dx + REACH];
            const double one = of->share * light[dy + REACH][dx + REACH] + of->floor;
            if (dx == 0 && dy == 0)
                continue;
            *at = (noise->measured[dy + REACH][dx + REACH] - one) / left;
            if (abs(dx) <= 1 && abs(dy) <= 1)
                largest = fmax(largest, fabs(*at));
            if ((abs(dx) > RX_NOISE_NEAR || abs(dy) > RX_NOISE_NEAR) && fabs(*at) < 3.0 * noise->error)
                *at = 0.0;
        }
    return largest;
}

/* A quadrant's own share may be half as much, or half more. */
static void take_off_quadrants(const faint_light *of, double near, rx_noise_correlation *noise)
{
    const double left = 1.0 - of->share - of->floor, lags = (2 * RX_NOISE_NEAR + 1) * (2 * RX_NOISE_NEAR + 1);
    for (int q = 0; q < RX_NOISE_QUADRANTS; q++) {
        noise->quadrant[q] = (noise->quadrant[q] - of->share * near - of->floor * lags) / left;
        noise->quadrant_error[q] = hypot(noise->quadrant_error[q], 0.5 * of->share * near) / left;
    }
}

static int is_light(const faint_light *fit, double most)
{
    return fit->share > CLEAR * fit->error && fit->share + fit->floor <= most + 1e-9;
}

int rx_noise_reaches_far(const rx_noise_correlation *noise)
{
    double sum = 0.0;
    int n = 0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++)
            if (dx * dx + dy * dy >= FAR * FAR && dx * dx + dy * dy < 4.0 * FAR * FAR) {
                sum += noise->measured[dy + REACH][dx + REACH];
                n++;
            }
    return sum > CLEAR * sqrt(2.0 * n) * noise->error; /* half of the lags are the others again */
}

/* Faint stars are what most of the noise is: independent of each other, and as much noise as they are until models say what is left. */
static void take_as_stars(rx_noise_correlation *noise)
{
    noise->correlated = 0;
    memset(noise->at, 0, sizeof noise->at);
    noise->at[REACH][REACH] = 1.0;
    for (int i = 0; i < RX_NOISE_QUADRANTS; i++)
        noise->quadrant[i] = 1.0;
}

double rx_noise_without_light(rx_noise_correlation *noise, const float *psf, int width, int height,
                              double photons)
{
    const double most = photons > 0.0 && photons < 1.0 - MOST ? 1.0 - photons : MOST;
    double light[SIDE][SIDE], near = 0.0;
    const double power = overlap(psf, width, height, 0, 0);
    if (!noise->correlated || noise->origin != RX_NOISE_MEASURED || !(power > 0.0))
        return 0.0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++) {
            const double l = light[dy + REACH][dx + REACH] = overlap(psf, width, height, dx, dy) / power;
            near += abs(dx) <= RX_NOISE_NEAR && abs(dy) <= RX_NOISE_NEAR ? l : 0.0;
        }
    rx_noise_correlation rest = *noise;
    faint_light fit = fit_light(noise, light, photons, 1.0);
    bool white = is_light(&fit, most) && fit.share + fit.floor < MOST &&
                 take_off(light, &fit, &rest) < fmax(LITTLE, LITTLE_ERRORS * noise->error);
    if (!white) {
        /* smoothing reaches farther, but fades */
        const faint_light beyond = fit_light(noise, light, photons, FAR + 1.0);
        fit = fit_light(noise, light, photons, FAR);
        fit.share = fmin(fit.share, beyond.share + 2.0 * beyond.error);
        if (fit.share > CLEAR * fit.error && fit.share + fit.floor > MOST &&
            noise->skewness - CLEAR * noise->skewness_error > SKEWED) {
            take_as_stars(noise);
            return fit.share;
        }
        if (!is_light(&fit, most))
            return 0.0;
        /* where nearly all is light, what differs from it is the PSF's error */
        white = fit.share + fit.floor >= MOST;
    }
    if (white) {
        rest.correlated = 0;
        memset(rest.at, 0, sizeof rest.at);
        rest.at[REACH][REACH] = 1.0;
    } else {
        /* resampling lowers the noise of no wide sum: so much was not light */
        for (take_off(light, &fit, &rest); rx_noise_factor_wide(&rest) < 1.0; take_off(light, &fit, &rest)) {
            fit.share *= LESS;
            if (fit.share < CLEAR * fit.error)
                return 0.0;
        }
    }
    *noise = rest;
    take_off_quadrants(&fit, near, noise);
    noise->scale *= sqrt(1.0 - fit.share - fit.floor);
    return fit.share;
}

double rx_noise_factor(const rx_noise_correlation *noise, const float *profile, int width, int height)
{
    if (noise == NULL || !noise->correlated)
        return 1.0;
    const double power = overlap(profile, width, height, 0, 0);
    double sum = power;
    for (int dy = 0; dy <= REACH; dy++) /* one half of the lags: the other is the same again */
        for (int dx = dy == 0 ? 1 : -REACH; dx <= REACH; dx++)
            if (noise->at[dy + REACH][dx + REACH] != 0.0)
                sum += 2.0 * noise->at[dy + REACH][dx + REACH] * overlap(profile, width, height, dx, dy);
    return power > 0.0 ? sqrt(fmax(sum / power, LEAST * LEAST)) : 1.0;
}

double rx_noise_power(const rx_noise_correlation *noise, double u, double v)
{
    double sum = 0.0;
    if (noise == NULL || !noise->correlated)
        return 1.0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++)
            sum += noise->at[dy + REACH][dx + REACH] * cos(2.0 * M_PI * (u * dx + v * dy));
    return fmax(sum, 0.0);
}

double rx_noise_quadrant_factor(const rx_noise_correlation *noise, int q)
{
    return sqrt(isnan(noise->quadrant[q]) ? NAN : fmax(noise->quadrant[q], LEAST * LEAST));
}

int rx_noise_uneven(const rx_noise_correlation *noise)
{
    const double *f = noise->quadrant, *e = noise->quadrant_error,
                 ratio = (1.0 + DIFFERENT) * (1.0 + DIFFERENT);
    for (int a = 0; a < RX_NOISE_QUADRANTS; a++)
        for (int b = 0; b < RX_NOISE_QUADRANTS; b++)
            if (f[a] - f[b] > SIGNIFICANT * hypot(e[a], e[b]) && f[a] > ratio * f[b]) /* not of NAN */
                return 1;
    return 0;
}

double rx_noise_factor_wide(const rx_noise_correlation *noise)
{
    double sum = 0.0;
    if (noise == NULL || !noise->correlated)
        return 1.0;
    for (int i = 0; i < SIDE * SIDE; i++)
        sum += noise->at[i / SIDE][i % SIDE];
    return sqrt(fmax(sum, LEAST * LEAST));
}

int rx_noise_is_structure(const rx_noise_correlation *noise)
{
    return noise->origin == RX_NOISE_MEASURED && rx_noise_factor_wide(noise) > RX_NOISE_RESAMPLED;
}
