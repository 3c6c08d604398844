/* Pixels that are sharper than the PSF. */
#include "detect/anomalies.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"

static const double SHARPER = 1.2, SHARP = 6.0; /* times R, and errors */
static const double LEAST_FWHM = 2.5; /* pixels: below, R depends on where in its pixel a star stands */
static const int steps[RX_ANOMALIES_STEPS][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};

/* z of n pixels from (x, y) on, RX_MAP_PIECE at most; NAN where there is none. */
RX_SIMD static void read_piece(const rx_image *image, int x, int y, int n, float *restrict z)
{
    float level_room[RX_MAP_PIECE] = {0}, sigma_room[RX_MAP_PIECE];
    const rx_map sky = rx_image_sky(image);
    const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
    const float *pixels = image->pixels + at, *sigma = rx_map_row(&image->noise, y, x, n, sigma_room);
    const float *level = rx_map_given(&sky) ? rx_map_row(&sky, y, x, n, level_room) : level_room;
    uint8_t bits = 0;
    /* one choice in a loop, or it does not become vectors; inf - inf is none */
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float value = pixels[i] - level[i], known = sigma[i] > 0.0f ? sigma[i] : NAN;
        z[i] = value / known + (value - value);
    }
    if (image->mask == NULL)
        return;
    const uint8_t *mask = image->mask + at;
#pragma omp simd reduction(| : bits)
    for (int i = 0; i < n; i++)
        bits |= mask[i];
    for (int i = 0; (bits & image->hide) != 0 && i < n; i++)
        if (mask[i] & image->hide)
            z[i] = NAN;
}

/* R of the PSF at nine places of the tile. */
rx_status rx_anomalies_measure(const rx_image *image, rx_anomalies *dst, rx_error *err)
{
    const rx_psf *psf = image->psf;
    *dst = (rx_anomalies){0};
    if (psf == NULL || psf->size < 3 || !(psf->fwhm >= LEAST_FWHM))
        return RX_OK;
    float *stamp;
    RX_TRY(RX_MAKE(stamp, (size_t)psf->size * (size_t)psf->size, err));
    for (int place = 0; place < 9; place++) {
        rx_psf_at(psf, 0.5 * (place % 3) * (image->width - 1), 0.5 * (place / 3) * (image->height - 1),
                  stamp);
        const float *centre = stamp + (psf->size / 2) * (psf->size + 1);
        for (int s = 0; s < RX_ANOMALIES_STEPS; s++) {
            const int step = steps[s][1] * psf->size + steps[s][0];
            const double beside = 0.5 * ((double)centre[step] + (double)centre[-step]);
            /* without light beside it any pixel may stand alone */
            dst->ratio[s] = fmax(dst->ratio[s], beside > 0.0 ? (double)centre[0] / beside : HUGE_VAL);
        }
    }
    free(stamp);
    return RX_OK;
}

enum { AROUND = 2, PATCH = 2 * AROUND + 1 }; /* a pixel, those that touch it, and their neighbours */

/* The pixel at *middle alone, which is not at the border. */
static bool is_sharp(const rx_anomalies *anomalies, const float *middle, double photons)
{
    const double z = (double)*middle;
    for (int s = 0; s < RX_ANOMALIES_STEPS; s++) {
        const int step = steps[s][1] * PATCH + steps[s][0];
        const double most = SHARPER * anomalies->ratio[s];
        const double beside = 0.5 * ((double)middle[-step] + (double)middle[step]);
        if (most > 0.0 && z - most * beside > SHARP * sqrt(1.0 + 0.5 * most * most + photons))
            return true;
    }
    return false;
}

int rx_anomalies_sharp_at(const rx_anomalies *anomalies, const rx_image *image, int x, int y)
{
    const int left = rx_max_int(x - AROUND, 0), right = rx_min_int(x + AROUND, image->width - 1),
              low = rx_max_int(y - AROUND, 0), high = rx_min_int(y + AROUND, image->height - 1);
    float z[PATCH][PATCH];
    for (int v = low; v <= high; v++)
        read_piece(image, left, v, right - left + 1, &z[v - low][0]);
    for (int v = rx_max_int(y - 1, low + 1); v <= rx_min_int(y + 1, high - 1); v++)
        for (int u = rx_max_int(x - 1, left + 1); u <= rx_min_int(x + 1, right - 1); u++) {
            const float *middle = &z[v - low][u - left];
            if (!((double)*middle > SHARP))
                continue;
            const double sigma = (double)rx_map_at(&image->noise, u, v);
            if (is_sharp(anomalies, middle,
                         image->gain > 0.0 ? (double)*middle / (sigma * image->gain) : 0.0))
                return 1;
        }
    return 0;
}
