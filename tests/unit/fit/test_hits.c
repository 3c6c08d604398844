/* Hits among stars, blends and a thin galaxy, all of which are known. */
#include "../near.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/min_max.h"
#include "base/random.h"
#include "fit/hits.h"

enum { W = 400, H = 320, N = W * H, STARS = 60, STAMP = 25, HITS = 6, REAL = STARS + 2, ALL = REAL + HITS };

static const double WIDTHS[] = {0.6, 0.9, 1.7}; /* pixels, sigma of the PSF */
static float pixels[N], sigma[N], level[N];
static uint8_t mask[N];
static rx_source list[ALL], other[ALL];
static const int hit[HITS][2] = {{200, 200}, {340, 44}, {0, 120}, {130, 300}, {390, 180}, {30, 20}};

static void add_light(double x0, double y0, double light, double width)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] += (float)(light / (2 * M_PI * width * width) *
                                         exp(-(pow(x - x0, 2) + pow(y - y0, 2)) / (2 * width * width)));
}

static rx_psf *gaussian(double width)
{
    enum { FINE = 4, SIDE = FINE * (STAMP - 1) + 1 };
    rx_psf *psf = rx_psf_new(RX_PSF_GAUSS, STAMP, 1);
    assert_non_null(psf);
    assert_int_equal(rx_psf_sample(psf, FINE), 1);
    for (int i = 0; i < SIDE * SIDE; i++)
        psf->samples[i] = (float)(exp(-(pow(i % SIDE - SIDE / 2, 2) + pow(i / SIDE - SIDE / 2, 2)) /
                                      (2 * width * width * FINE * FINE)) /
                                  (2 * M_PI * width * width));
    rx_psf_pick(psf);
    psf->fwhm = 2.3548 * width;
    return psf;
}

static void put(int i, int x, int y)
{
    list[i] = (rx_source){.xpeak = x, .ypeak = y};
}

/* Noise of 2 on a sky of 10, stars of 5 to 500 sigma anywhere in their pixels, a third of them blends; two galaxies with a seventh of
 * their length; then hits of one to three pixels and a track. */
static rx_image make(double width, const rx_psf *psf)
{
    for (int i = 0; i < N; i++) {
        sigma[i] = 2.0f;
        level[i] = 10.0f;
        mask[i] = 0;
        pixels[i] = 10.0f + 2.0f * (float)rx_random_normal(4, 1, (uint64_t)i);
    }
    for (int s = 0; s < STARS; s++) {
        const double x = 20 + 26 * (s % 12), y = 20 + 26.0 * (double)(s / 12),
                     light = 14 * width * pow(100, s / 60.0),
                     part = rx_random_uniform(5, 2, (uint64_t)s) - 0.5;
        put(s, (int)x, (int)y);
        add_light(x + part, y - part, 5 * light, width);
        if (s % 3 == 0 && width > WIDTHS[0]) /* at FWHM 1.4 a bright blend may have as many pixels as a hit */
            add_light(x + part + 1.5 * width, y - part + width, 3 * light, width);
    }
    for (int g = 0; g < 2; g++) {
        put(STARS + g, 60 + 120 * g, 240);
        for (int k = -40; k <= 40; k++)
            add_light(60 + 120 * g + 0.1 * k * width, 240 + 0.05 * g * k * width,
                      30 * width * exp(-abs(k) / 15.0), width);
    }
    for (int k = 0; k < HITS; k++) {
        put(REAL + k, hit[k][0], hit[k][1]);
        for (int i = 0; i < (k == 1 ? 9 : k % 3 + 1); i++)
            pixels[rx_min_int(hit[k][1] - (k == 1 ? 4 - i : 0), H - 1) * W + hit[k][0] +
                   (k == 1 ? 2 * (i - 4) / 3 : i)] += 100.0f;
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

static int marked(int i)
{
    return (list[i].fit.restore & RX_RESTORE_SHARP) != 0;
}

/* How many are marked, the same by one thread and by five. */
static int find(const rx_image *image)
{
    int found = 0;
    for (int i = 0; i < ALL; i++)
        list[i].fit = (rx_source_template){.restore = RX_RESTORE_ADDED};
    memcpy(other, list, sizeof other);
    rx_sources one = {.n = ALL, .list = list}, five = {.n = ALL, .list = other};
    assert_int_equal(rx_hits_mark(image, 1, 0, &one, NULL), RX_OK);
    assert_int_equal(rx_hits_mark(image, 5, 0, &five, NULL), RX_OK);
    for (int i = 0; i < ALL; i++) {
        assert_int_equal(other[i].fit.restore, list[i].fit.restore);
        assert_int_equal(list[i].fit.restore & ~RX_RESTORE_SHARP, RX_RESTORE_ADDED);
        found += marked(i);
    }
    return found;
}

static void test_hits_among_sources(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof WIDTHS / sizeof *WIDTHS; k++) {
        rx_psf *psf = gaussian(WIDTHS[k]);
        rx_image image = make(WIDTHS[k], psf);
        find(&image);
        for (int i = 0; i < ALL; i++) {
            if (marked(i) != (i >= REAL))
                print_message("width %g, source %d at (%d, %d)\n", WIDTHS[k], i, list[i].xpeak,
                              list[i].ypeak);
            assert_int_equal(marked(i), i >= REAL);
        }
        mask[hit[0][1] * W + hit[0][0] - 1] = 1; /* a hidden neighbour says nothing, the others do */
        assert_int_equal(find(&image), HITS);
        mask[hit[0][1] * W + hit[0][0] + 1] = RX_MASK_SATURATED; /* charge runs over */
        assert_int_equal(find(&image), HITS - 1);
        assert_int_equal(marked(REAL), 0);
        rx_psf_free(psf);
    }
}

static void test_nothing_is_known(void **state)
{
    (void)state;
    rx_psf *psf = gaussian(WIDTHS[1]);
    rx_image image = make(WIDTHS[1], NULL); /* no PSF */
    assert_int_equal(find(&image), 0);
    image.psf = psf;
    psf->quality.sharper = 1;
    assert_int_equal(find(&image), 0);
    psf->quality.sharper = 0;
    memset(mask, 1, sizeof mask);
    assert_int_equal(find(&image), 0);
    assert_int_equal(rx_hits_mark(&image, 1, 0, &(rx_sources){.n = 0}, NULL), RX_OK);
    image.width = 3; /* smaller than a PSF */
    image.height = 2;
    image.mask = NULL;
    image.level = rx_map_plane(level, 3);
    image.noise = rx_map_plane(sigma, 3);
    for (int i = 0; i < ALL; i++)
        put(i, i % 3, i % 2);
    find(&image);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_hits_among_sources),
                                       cmocka_unit_test(test_nothing_is_known)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
