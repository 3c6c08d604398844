/* Noise of sums of pixels. */
#include "data/noise_correlation.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "base/least.h"

enum { REACH = RX_NOISE_REACH, SIDE = RX_NOISE_SIDE, FAR = 4 };

static const double LEAST = 0.1; /* of a factor: a measured correlation may be none that noise can have */

static const double VISIBLE = 0.3; /* of the PSF's own correlation at FAR, to be distinguished from noise */
static const double MOST = 0.9;    /* of the variance that faint light can be */
static const double SENSE = 0.7;   /* resampling lowers the noise of no sum by more */
static const double LITTLE = 0.03; /* what is left of noise that is none */

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
    for (int y = rx_most(0, -dy); y < rx_least(height, height - dy); y++)
        for (int x = rx_most(0, -dx); x < rx_least(width, width - dx); x++)
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
        noise.quadrant[i] = rx_noise_factor_wide(&noise);
    return noise;
}

double rx_noise_without_light(rx_noise_correlation *noise, const float *psf, int width, int height)
{
    double light[SIDE][SIDE], cross = 0.0, square = 0.0, near = 0.0;
    const double power = overlap(psf, width, height, 0, 0);
    if (!noise->correlated || noise->origin != RX_NOISE_MEASURED || !(power > 0.0) ||
        overlap(psf, width, height, FAR, 0) < VISIBLE * power ||
        overlap(psf, width, height, 0, FAR) < VISIBLE * power)
        return 0.0;
    for (int dy = -REACH; dy <= REACH; dy++)
        for (int dx = -REACH; dx <= REACH; dx++) {
            const double l = light[dy + REACH][dx + REACH] = overlap(psf, width, height, dx, dy) / power;
            near += abs(dx) <= RX_NOISE_NEAR && abs(dy) <= RX_NOISE_NEAR ? l : 0.0;
            if (dx * dx + dy * dy < FAR * FAR)
                continue;
            cross += l * noise->at[dy + REACH][dx + REACH];
            square += l * l;
        }
    const double share = fmin(cross / square, MOST);
    if (!(share > 0.0))
        return 0.0;
    double largest = 0.0;
    rx_noise_correlation rest = *noise;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double *at = &rest.at[i / SIDE][i % SIDE];
        if (i == SIDE * SIDE / 2)
            continue;
        *at = (*at - share * light[i / SIDE][i % SIDE]) / (1.0 - share);
        if (fabs(*at) < 3.0 * noise->error)
            *at = 0.0;
        largest = fmax(largest, fabs(*at));
    }
    if (rx_noise_factor_wide(&rest) < SENSE) /* it was not light */
        return 0.0;
    *noise = rest;
    for (int q = 0; q < RX_NOISE_QUADRANTS;
         q++) { /* a quadrant's own share may be half as much, or half more */
        const double was = noise->quadrant[q],
                     error = hypot(2.0 * was * noise->quadrant_error[q], 0.5 * share * near);
        noise->quadrant[q] = sqrt(fmax((was * was - share * near) / (1.0 - share), LEAST * LEAST));
        noise->quadrant_error[q] = error / (1.0 - share) / (2.0 * noise->quadrant[q]);
    }
    if (largest < LITTLE) {
        const rx_noise_correlation measured = *noise;
        *noise = rx_noise_white(RX_NOISE_MEASURED);
        noise->error = measured.error;
        noise->pixels = measured.pixels;
        noise->scale = measured.scale;
        memcpy(noise->quadrant, measured.quadrant, sizeof noise->quadrant);
        memcpy(noise->quadrant_error, measured.quadrant_error, sizeof noise->quadrant_error);
    }
    noise->scale *= sqrt(1.0 - share);
    return share;
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

int rx_noise_uneven(const rx_noise_correlation *noise)
{
    const double *f = noise->quadrant, *e = noise->quadrant_error;
    for (int a = 0; a < RX_NOISE_QUADRANTS; a++)
        for (int b = 0; b < RX_NOISE_QUADRANTS; b++)
            if (f[a] - f[b] > fmax(SIGNIFICANT * hypot(e[a], e[b]), DIFFERENT * f[b])) /* not of NAN */
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
