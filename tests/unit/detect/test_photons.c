/* Gains against the photon noise of simulated pixels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "detect/photons.h"

enum { W = 240, H = 240, N = W * H, STARS = 60 };

static float pixels[N], smooth[N], levels[N], noises[N];
static uint8_t mask[N];

static const double SKY = 30, GAIN = 2;

/* Moffats (exponent 3) of peaks 30000 / rank ADU on the sky, with photon noise of GAIN and read noise of 4 ADU; divided by `unit`. `resample`:
 * averaged over 2 x 2 pixels. */
static void make_tile(double fwhm, double sky, int resample, double unit, uint64_t seed)
{
    for (int i = 0; i < N; i++)
        smooth[i] = (float)SKY;
    for (int s = 0; s < STARS; s++) {
        const double x0 = W * rx_random_uniform(seed, 2, (uint64_t)s),
                     y0 = H * rx_random_uniform(seed, 3, (uint64_t)s);
        for (int y = (int)fmax(y0 - 6 * fwhm, 0); y < fmin(y0 + 6 * fwhm, H); y++)
            for (int x = (int)fmax(x0 - 6 * fwhm, 0); x < fmin(x0 + 6 * fwhm, W); x++)
                smooth[y * W + x] +=
                    (float)(30000.0 / (1 + s) *
                            pow(1 + (pow(x - x0, 2) + pow(y - y0, 2)) * 1.0397 / (fwhm * fwhm), -3));
    }
    for (int i = 0; i < N; i++)
        smooth[i] += (float)(sqrt((double)smooth[i] / GAIN + 16) * rx_random_normal(seed, 1, (uint64_t)i));
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const int right = y * W + (x + 1) % W, up = (y + 1) % H * W + x,
                      both = (y + 1) % H * W + (x + 1) % W;
            const float mean = 0.25f * (smooth[y * W + x] + smooth[right] + smooth[up] + smooth[both]);
            pixels[y * W + x] = (float)(((double)(resample ? mean : smooth[y * W + x]) - SKY + sky) / unit);
        }
}

static int test(double gain, double sky, int resampled, double unit)
{
    const double sigma = sqrt(SKY / GAIN + 16) * (resampled ? 0.5 : 1.0) / unit;
    for (int i = 0; i < N; i++) {
        levels[i] = (float)(sky / unit);
        noises[i] = (float)sigma;
    }
    rx_noise_correlation correlation = rx_noise_white(RX_NOISE_MEASURED);
    if (resampled) {
        correlation.correlated = 1;
        for (int i = -1; i <= 1; i++)
            for (int j = -1; j <= 1; j++)
                correlation.at[RX_NOISE_REACH + i][RX_NOISE_REACH + j] =
                    1.0f / (float)((1 + i * i) * (1 + j * j));
    }
    const rx_image image = {.width = W,
                            .height = H,
                            .pixels = pixels,
                            .mask = mask,
                            .with_sky = 1,
                            .level = rx_map_plane(levels, W),
                            .noise = rx_map_plane(noises, W),
                            .global_noise = sigma,
                            .gain = gain};
    rx_photon_test found;
    assert_int_equal(rx_photons_test(&image, sky / unit, &correlation, &found, NULL), RX_OK);
    return found.impossible;
}

/* The right gain, and half and four times of it, may be; on any sky, seeing and unit, before and after resampling. */
static void right_gains_may_be(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 4; seed++)
        for (double fwhm = 1.5; fwhm < 9; fwhm *= 1.4)
            for (int resampled = 0; resampled < 2; resampled++)
                for (int k = 0; k < 3; k++) {
                    static const double skies[] = {0, 30, 3000}, units[] = {1, 300, 1e-3};
                    make_tile(fwhm, skies[k], resampled, units[k], seed);
                    for (double off = 0.5; off < 5; off *= 2)
                        assert_int_equal(test(off * GAIN * units[k], skies[k], resampled, units[k]), 0);
                    assert_int_equal(test(0, skies[k], resampled, units[k]), 0);
                }
}

/* A hundredth and less of the right one; on a sky that is there some thousand times of it. */
static void wrong_gains_cannot_be(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed < 4; seed++)
        for (double fwhm = 2; fwhm < 9; fwhm *= 1.4)
            for (int resampled = 0; resampled < 2; resampled++)
                for (int k = 0; k < 2; k++) {
                    static const double skies[] = {0, 300}, units[] = {300, 1};
                    make_tile(fwhm, skies[k], resampled, units[k], seed);
                    for (double off = 1e-2; off > 1e-5; off *= 0.1)
                        assert_int_equal(test(off * GAIN * units[k], skies[k], resampled, units[k]), -1);
                    assert_int_equal(test(1e4 * GAIN * units[k], skies[k], resampled, units[k]),
                                     k == 0 ? 0 : 1);
                }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(right_gains_may_be),
                                       cmocka_unit_test(wrong_gains_cannot_be)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
