/* Small artificial tiles for the tests of restorers: sky at 100 ADU, noise of 1 ADU. */
#ifndef RX_TESTS_RESTORE_SKY_H
#define RX_TESTS_RESTORE_SKY_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/random.h"
#include "data/image.h"
#include "restore/restore.h"
#include "restore/stamp.h"

typedef struct sky {
    rx_tile tile;
    rx_background background;
    rx_restore_params par;
    int hide;
} sky;

static inline void sky_new(sky *s, int width, int height)
{
    const size_t n = (size_t)width * (size_t)height;
    *s = (sky){0};
    s->tile.width = s->background.width = width;
    s->tile.height = s->background.height = height;
    s->tile.pixels = calloc(n, sizeof(float));
    s->tile.mask = calloc(n, 1);
    s->tile.saturation = HUGE_VAL;
    s->background.level = calloc(n, sizeof(float));
    s->background.sigma = calloc(n, sizeof(float));
    for (size_t k = 0; k < n; k++) {
        s->tile.pixels[k] = s->background.level[k] = 100;
        s->background.sigma[k] = 1;
    }
    s->background.global_level = 100;
    s->background.global_sigma = 1;
    s->par = (rx_restore_params){
        .rl_niter = 30, .rl_pedestal = 5, .keep_reblurred = 1, .keep_support = 1, .nthreads = 1};
    s->hide = RX_HIDE_RESTORED;
}

/* As a restorer takes it; psf: or NULL. */
static inline rx_image sky_image(const sky *s, const rx_psf *psf)
{
    const rx_image tile = rx_tile_image(&s->tile);
    rx_image image = rx_image_on_sky(&tile, &s->background);
    image.hide = s->hide;
    image.psf = psf;
    return image;
}

static inline void sky_free(sky *s)
{
    free(s->tile.pixels);
    free(s->tile.mask);
    free(s->background.level);
    free(s->background.sigma);
}

/* Gaussian noise of that sigma. */
static inline void sky_noise(sky *s, double sigma, uint64_t seed)
{
    for (int k = 0; k < s->tile.width * s->tile.height; k++)
        s->tile.pixels[k] += (float)(sigma * rx_random_normal(seed, 0, (uint64_t)k));
}

/* Integral of a Gaussian of unit flux over the pixel whose centre is d from its own. */
static inline double pixel_gauss(double d, double fwhm)
{
    const double unit = 2.3548200450309493 / (fwhm * sqrt(2.0));
    return (erf((d + 0.5) * unit) - erf((d - 0.5) * unit)) / 2;
}

/* A star seen through a Gaussian PSF, exact also between pixels. */
static inline void sky_star(sky *s, double x, double y, double fwhm, double flux)
{
    for (int j = 0; j < s->tile.height; j++)
        for (int i = 0; i < s->tile.width; i++)
            s->tile.pixels[j * s->tile.width + i] +=
                (float)(flux * pixel_gauss(i - x, fwhm) * pixel_gauss(j - y, fwhm));
}

/* Sum of plane within radius of (x, y). */
static inline double sky_sum(const sky *s, const float *plane, double x, double y, double radius)
{
    double sum = 0;
    for (int j = 0; j < s->tile.height; j++)
        for (int i = 0; i < s->tile.width; i++)
            if (hypot(i - x, j - y) <= radius)
                sum += plane[j * s->tile.width + i];
    return sum;
}

/* FWHM of the star at pixel (x, y). */
static inline double sky_fwhm(const sky *s, const float *plane, int x, int y)
{
    float cut[21 * 21];
    for (int k = 0; k < 21 * 21; k++)
        cut[k] = plane[(y + k / 21 - 10) * s->tile.width + x + k % 21 - 10];
    double fwhm = 0;
    assert_int_equal(rx_stamp_fwhm(cut, 21, &fwhm, NULL, NULL), RX_OK);
    return fwhm;
}

/* Constant Gaussian PSF, or one whose second basis image makes it narrower to the left and
 * wider to the right of a tile of that width. */
static inline rx_psf *sky_psf_varying(double fwhm, double change, int width)
{
    rx_psf *wide = rx_stamp_gauss(fwhm * (1 + change)), *psf = rx_psf_copy(wide);
    const int size = psf->size, n = size * size, r = size / 2;
    free(psf->basis);
    psf->basis = calloc(2 * (size_t)n, sizeof(float));
    double sum[2] = {0, 0};
    for (int pass = 0; pass < 2; pass++)
        for (int k = 0; k < n; k++) {
            double left = pixel_gauss(k % size - r, fwhm * (1 - change)) *
                          pixel_gauss(k / size - r, fwhm * (1 - change));
            double right = wide->basis[k];
            if (pass == 0) {
                sum[0] += left;
                sum[1] += right;
                continue;
            }
            psf->basis[k] = (float)((left / sum[0] + right / sum[1]) / 2);
            psf->basis[n + k] = (float)((right / sum[1] - left / sum[0]) / 2);
        }
    psf->nbasis = 2;
    psf->px[1] = 1;
    psf->x0 = (width - 1) / 2.0;
    psf->xs = (width - 1) / 2.0;
    rx_psf_free(wide);
    return psf;
}

#endif
