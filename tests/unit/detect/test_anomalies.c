/* Skies with and without sharp pixels. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "detect/anomalies.h"

enum { W = 400, H = 320, N = W * H, STARS = 60, STAMP = 15 };

static const double WIDTH = 1.4; /* pixels, sigma of the PSF */
static float pixels[N], sigma[N], level[N];
static uint8_t mask[N];
static int star[STARS][2];

static void add_light(double x0, double y0, double peak, double width)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] +=
                (float)(peak * exp(-(pow(x - x0, 2) + pow(y - y0, 2)) / (2 * width * width)));
}

/* Noise of 2 on a sky of 10, and stars of 5 to 1500 sigma anywhere in their pixels. */
static rx_image make(const rx_psf *psf)
{
    for (int i = 0; i < N; i++) {
        sigma[i] = 2.0f;
        level[i] = 10.0f;
        mask[i] = 0;
        pixels[i] = 10.0f + 2.0f * (float)rx_random_normal(4, 1, (uint64_t)i);
    }
    for (int s = 0; s < STARS; s++) {
        const double x = W * rx_random_uniform(4, 2, 3 * (uint64_t)s),
                     y = H * rx_random_uniform(4, 2, 3 * (uint64_t)s + 1);
        star[s][0] = (int)x;
        star[s][1] = (int)y;
        add_light(x, y, 10 * pow(300, rx_random_uniform(4, 2, 3 * (uint64_t)s + 2)), WIDTH);
    }
    return (rx_image){.width = W,
                      .height = H,
                      .pixels = pixels,
                      .mask = mask,
                      .hide = 1,
                      .with_sky = 1,
                      .level = rx_map_plane(level, W),
                      .noise = rx_map_plane(sigma, W),
                      .psf = psf};
}

static rx_psf *gaussian(double width)
{
    rx_psf *psf = rx_psf_new(RX_PSF_GAUSS, STAMP, 1);
    double sum = 0;
    assert_non_null(psf);
    for (int i = 0; i < STAMP * STAMP; i++)
        sum += exp(-(pow(i % STAMP - STAMP / 2, 2) + pow(i / STAMP - STAMP / 2, 2)) / (2 * width * width));
    for (int i = 0; i < STAMP * STAMP; i++)
        psf->basis[i] = (float)(exp(-(pow(i % STAMP - STAMP / 2, 2) + pow(i / STAMP - STAMP / 2, 2)) /
                                    (2 * width * width)) /
                                sum);
    psf->fwhm = 2.3548 * width;
    return psf;
}

static rx_anomalies measure(const rx_image *image)
{
    rx_anomalies a;
    assert_int_equal(rx_anomalies_measure(image, &a, NULL), RX_OK);
    return a;
}

static int count_sharp(const rx_anomalies *anomalies, const rx_image *image)
{
    int n = 0;
    for (int s = 0; s < STARS; s++)
        n += rx_anomalies_sharp_at(anomalies, image, star[s][0], star[s][1]);
    return n;
}

/* Stars, and a galaxy with its outskirts, are no anomaly. */
static void test_an_ordinary_sky(void **state)
{
    (void)state;
    rx_psf *psf = gaussian(WIDTH);
    const rx_image image = make(psf);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] += (float)(2000 / (1 + pow(hypot(x - 120, y - 150) / 4, 2)));
    rx_anomalies a = measure(&image);
    assert_int_equal(count_sharp(&a, &image), 0);
    assert_close(a.ratio[0], exp(0.5 / (WIDTH * WIDTH)), 1e-5);
    assert_close(a.ratio[2], exp(1.0 / (WIDTH * WIDTH)), 1e-5);
    rx_psf_free(psf);
}

static void test_sharp_pixels(void **state)
{
    (void)state;
    rx_psf *psf = gaussian(WIDTH), *narrow = gaussian(0.9);
    rx_image image = make(psf);
    const int hot = 200 * W + 200;
    pixels[hot] += 60.0f;
    for (int i = 0; i < 9; i++) /* a track, one pixel wide */
        pixels[(40 + i) * W + 300 + 2 * i / 3] += 100.0f;
    rx_anomalies a = measure(&image);
    for (int y = -2; y <= 2; y++)
        for (int x = -2; x <= 2; x++)
            assert_int_equal(rx_anomalies_sharp_at(&a, &image, 200 + x, 200 + y), abs(x) < 2 && abs(y) < 2);
    for (int i = 0; i < 9; i++)
        assert_int_equal(rx_anomalies_sharp_at(&a, &image, 300 + 2 * i / 3, 40 + i), 1);
    assert_int_equal(count_sharp(&a, &image), 0);
    image.gain = 0.3; /* so few photons may do it */
    assert_int_equal(rx_anomalies_sharp_at(&a, &image, 200, 200), 0);
    image.gain = 0;
    mask[hot - 1] = 1; /* a hidden neighbour says nothing, the others do */
    assert_int_equal(rx_anomalies_sharp_at(&a, &image, 200, 200), 1);
    mask[hot] = 1;
    assert_int_equal(rx_anomalies_sharp_at(&a, &image, 200, 200), 0);
    pixels[0] += 500.0f; /* the border has no neighbours */
    assert_int_equal(rx_anomalies_sharp_at(&a, &image, 0, 0), 0);
    const rx_image tiny = {
        .width = 3, .height = 2, .pixels = pixels, .noise = rx_map_plane(sigma, 3), .level = {0}};
    assert_int_equal(rx_anomalies_sharp_at(&a, &tiny, 1, 1), 0);
    mask[hot] = mask[hot - 1] = 0;
    for (int i = 0; i < 2; i++) { /* not sampled, not known */
        image.psf = i == 0 ? narrow : NULL;
        a = measure(&image);
        assert_near(a.ratio[0], 0, 0);
        assert_int_equal(rx_anomalies_sharp_at(&a, &image, 200, 200), 0);
    }
    rx_psf_free(psf);
    rx_psf_free(narrow);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_an_ordinary_sky),
        cmocka_unit_test(test_sharp_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
