/* num/convolve against direct sums; Gaussian smoothing around masks. */
#include "../near.h"

#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "num/convolve.h"

enum { W = 24, H = 15, SIZE = 5, G_W = 41, G_H = 37 };

static float noise(uint64_t stream, int k)
{
    return (float)rx_random_normal(7, stream, (uint64_t)k);
}

/* sum_u k(u) src(x -+ u), cyclic */
static double direct(const float *stamp, const float *src, int x, int y, int sign)
{
    double sum = 0;
    for (int j = 0; j < SIZE; j++)
        for (int i = 0; i < SIZE; i++) {
            int sx = (x - sign * (i - SIZE / 2) + W) % W, sy = (y - sign * (j - SIZE / 2) + H) % H;
            sum += (double)stamp[j * SIZE + i] * src[sy * W + sx];
        }
    return sum;
}

static void against_direct_sum(void **state)
{
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(W, H, 2, &fft, NULL), RX_OK);
    const int stride = rx_fft_stride_real(fft);
    float *src = rx_fft_real(fft), *dst = rx_fft_real(fft), *half = rx_fft_complex(fft);
    float *kernel = rx_fft_complex(fft), stamp[SIZE * SIZE], plain[W * H];
    for (int k = 0; k < SIZE * SIZE; k++)
        stamp[k] = noise(1, k);
    for (int k = 0; k < W * H; k++)
        src[k / W * stride + k % W] = plain[k] = noise(2, k);
    rx_convolve_spectrum(fft, stamp, SIZE, kernel);
    rx_convolve(fft, kernel, src, half, dst);
    for (int k = 0; k < W * H; k++)
        assert_near(dst[k / W * stride + k % W], direct(stamp, plain, k % W, k / W, 1), 2e-5);
    rx_correlate(fft, kernel, src, half, dst);
    for (int k = 0; k < W * H; k++)
        assert_near(dst[k / W * stride + k % W], direct(stamp, plain, k % W, k / W, -1), 2e-5);
    free(src);
    free(dst);
    free(half);
    free(kernel);
    rx_fft_free(fft);
}

static void weights(void **state)
{
    static const double fwhm[] = {0.3, 1.0, 2.5, 7.0};
    for (int i = 0; i < 4; i++) {
        float g[64];
        int r = rx_gauss_radius(fwhm[i]);
        assert_in_range(2 * r + 1, 3, 64);
        rx_gauss_weights(fwhm[i], r, g);
        double sum = 0, square = 0;
        for (int k = -r; k <= r; k++) {
            sum += g[k + r];
            square += (double)g[k + r] * k * k;
        }
        double sigma = fwhm[i] / 2.354820045;
        assert_near(sum, 1, 1e-6);
        /* a Gaussian convolved with a pixel: sigma^2 + 1/12 once it is resolved */
        if (fwhm[i] >= 2)
            assert_near(square, sigma * sigma + 1 / 12.0, 1e-3 * square);
    }
}

/* The definition in two dimensions, in double. */
static double normalised(const float *f, const uint8_t *mask, const float *g, int r, int x, int y)
{
    double n = 0, d = 0;
    for (int j = -r; j <= r; j++)
        for (int i = -r; i <= r; i++) {
            int sx = x + i, sy = y + j;
            if (sx < 0 || sy < 0 || sx >= G_W || sy >= G_H || mask[sy * G_W + sx])
                continue;
            double a = (double)g[i + r] * g[j + r];
            n += a * f[sy * G_W + sx];
            d += a;
        }
    return n / d;
}

static void gauss_masked(void **state)
{
    float f[G_W * G_H], a[G_W * G_H], b[G_W * G_H], g[64];
    uint8_t mask[G_W * G_H];
    const int r = rx_gauss_radius(2.0);
    rx_gauss_weights(2.0, r, g);
    for (int k = 0; k < G_W * G_H; k++) {
        f[k] = noise(3, k);
        mask[k] = noise(4, k) > 1 || k % G_W == 12;
        a[k] = b[k] = f[k];
        if (mask[k])
            b[k] = NAN; /* not used, not even by a product with 0 */
    }
    assert_int_equal(rx_gauss_masked(G_W, G_H, 2.0, mask, 1, a, NULL), RX_OK);
    assert_int_equal(rx_gauss_masked(G_W, G_H, 2.0, mask, 3, b, NULL), RX_OK);
    assert_memory_equal(a, b, sizeof a);
    for (int k = 0; k < G_W * G_H; k++)
        assert_near(a[k], mask[k] ? 0 : normalised(f, mask, g, r, k % G_W, k / G_W), 1e-5);
}

/* Tall images go in bands, which neither width shows: rows of a Gaussian along y of what varies along y only.
 */
static void gauss_has_no_bands(void **state)
{
    enum { TALL = 900, WIDE = 5 };
    static const double fwhm[] = {4, 150}; /* radius below and above the height of a band */
    float *image = malloc(TALL * WIDE * sizeof *image), g[700];
    for (int i = 0; i < 2; i++) {
        const int r = rx_gauss_radius(fwhm[i]);
        assert_in_range(2 * r + 1, 3, 700);
        rx_gauss_weights(fwhm[i], r, g);
        for (int k = 0; k < TALL * WIDE; k++)
            image[k] = noise(5, k / WIDE);
        assert_int_equal(rx_gauss_masked(WIDE, TALL, fwhm[i], NULL, 2, image, NULL), RX_OK);
        for (int y = 0; y < TALL; y++) {
            double n = 0, d = 0;
            for (int j = y < r ? -y : -r; j <= r && y + j < TALL; j++) {
                n += (double)g[j + r] * noise(5, y + j);
                d += g[j + r];
            }
            assert_near(image[y * WIDE + 2], n / d, 1e-5);
        }
    }
    free(image);
}

static void gauss_keeps_flux_and_constants(void **state)
{
    float f[G_W * G_H] = {0}, c[G_W * G_H];
    f[18 * G_W + 20] = 1000;
    assert_int_equal(rx_gauss_masked(G_W, G_H, 3.0, NULL, 1, f, NULL), RX_OK);
    double sum = 0;
    for (int k = 0; k < G_W * G_H; k++) {
        sum += f[k];
        c[k] = 5;
    }
    assert_near(sum, 1000, 1e-3);
    assert_int_equal(rx_gauss_masked(G_W, G_H, 9.0, NULL, 1, c, NULL), RX_OK);
    for (int k = 0; k < G_W * G_H; k++)
        assert_near(c[k], 5, 1e-5);
    uint8_t mask[G_W * G_H] = {0};
    mask[3] = 1;
    assert_int_equal(rx_gauss_masked(G_W, G_H, 0, mask, 1, c, NULL), RX_OK);
    assert_near(c[3], 0, 0);
    assert_near(c[4], 5, 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(against_direct_sum), cmocka_unit_test(weights),
                                       cmocka_unit_test(gauss_masked), cmocka_unit_test(gauss_has_no_bands),
                                       cmocka_unit_test(gauss_keeps_flux_and_constants)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
