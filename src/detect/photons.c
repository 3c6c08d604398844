/* Photon noise that a gain claims, beside that of the pixels. */
#include "detect/photons.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/stats.h"

static const double MIDDLE = 0.67449;                  /* median of |normal deviate| */
static const double QUIET = 0.5, QUIET_CHANCE = 0.264; /* times MIDDLE, and the chance of less */
static const double BRIGHT = 5.0, CLAIMED = 3.0, CHANCE = 1e-6;
static const double LEVEL = 30.0,
                    PHOTONS = 100.0; /* of a sky that is in the pixels, sigmas; of their variance */

/* Of the 3 x 3 pixels around one. */
typedef struct spot {
    double light; /* mean above the sky, in sigmas */
    double cross; /* cross difference, in sigmas of white noise */
    double sigma; /* ADU; 0: some are hidden, or have one value */
} spot;

static spot look(const rx_image *image, const rx_map *level, int x, int y)
{
    static const double weight[3] = {1, -2, 1};
    double sum = 0, cross = 0;
    for (int i = 0; i < 9; i++) {
        const size_t k = (size_t)(y + i / 3 - 1) * (size_t)image->width + (size_t)(x + i % 3 - 1);
        if (rx_image_hides(image, k))
            return (spot){0};
        sum += (double)image->pixels[k];
        cross += weight[i / 3] * weight[i % 3] * (double)image->pixels[k];
    }
    const double sigma = (double)rx_map_at(&image->noise, x, y);
    if (!(sigma > 0) || cross == 0)
        return (spot){0};
    return (spot){(sum / 9 - (double)rx_map_at(level, x, y)) / sigma, cross / (6 * sigma), sigma};
}

static double chernoff(double k, double n)
{
    const double share = k / n;
    return n * (share * log(share / QUIET_CHANCE) +
                (share < 1 ? (1 - share) * log((1 - share) / (1 - QUIET_CHANCE)) : 0));
}

rx_status rx_photons_test(const rx_image *image, double level, const rx_noise_correlation *noise,
                          rx_photon_test *dst, rx_error *err)
{
    enum { STEP = 3, OCTAVES = 16 }; /* spots that share no pixel; of light */
    const rx_map sky = rx_image_sky(image);
    const double wide = noise->origin == RX_NOISE_WHITE || noise->origin == RX_NOISE_UNKNOWN
                            ? RX_NOISE_RESAMPLED
                            : fmax(rx_noise_factor_wide(noise), 1.0);
    const double least = BRIGHT * wide / 3; /* sigmas of a pixel: BRIGHT of the mean of nine */
    const double electrons = image->gain * image->global_noise;
    double *scatter;
    long bright[OCTAVES] = {0}, quiet[OCTAVES] = {0};
    size_t n = 0;
    *dst = (rx_photon_test){.ratio = electrons * image->global_noise / level};
    if (!(image->gain > 0) || isinf(image->gain))
        return RX_OK;
    if (level > LEVEL * image->global_noise && dst->ratio > PHOTONS)
        dst->impossible = 1;
    RX_TRY(RX_MAKE(scatter, ((size_t)image->width / STEP + 1) * ((size_t)image->height / STEP + 1), err));
    for (int y = 1; y < image->height - 1; y += STEP)
        for (int x = 1; x < image->width - 1; x += STEP) {
            const spot s = look(image, &sky, x, y);
            if (s.sigma > 0 && fabs(s.light) < 1)
                scatter[n++] = fabs(s.cross);
        }
    const double of_sky = rx_median(scatter, n) / MIDDLE;
    free(scatter);
    for (int y = 1; y < image->height - 1; y += STEP)
        for (int x = 1; x < image->width - 1; x += STEP) {
            const spot s = look(image, &sky, x, y);
            const double claimed = s.light / (image->gain * s.sigma * wide * wide);
            if (!(s.sigma > 0) || !(s.light > least) || !(claimed >= CLAIMED))
                continue;
            const int octave = rx_min_int((int)log2(s.light / least), OCTAVES - 1);
            bright[octave]++;
            quiet[octave] += fabs(s.cross) < QUIET * MIDDLE * of_sky * sqrt(1 + claimed);
        }
    for (int i = 0; i < OCTAVES && dst->impossible >= 0; i++) {
        dst->n += bright[i];
        dst->quiet += quiet[i];
        if (2 * dst->quiet > dst->n && chernoff((double)dst->quiet, (double)dst->n) > -log(CHANCE))
            dst->impossible = -1;
    }
    return RX_OK;
}
