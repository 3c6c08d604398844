/* Hits and a line among stars, all of which are known. */
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
#include "fit/artefacts.h"

enum { W = 400, H = 320, N = W * H, STARS = 20, STAMP = 25, HITS = 6, ALL = STARS + HITS + 2 };

static const double WIDTHS[] = {0.8, 1.4}; /* pixels, sigma of the PSF */
static float pixels[N], sigma[N], level[N];
static uint8_t mask[N];
static const int hit[HITS][2] = {{200, 200}, {302, 44}, {0, 120}, {130, 300}, {390, 180}, {30, 20}};

static void add_light(double x0, double y0, double peak, double width)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] +=
                (float)(peak * exp(-(pow(x - x0, 2) + pow(y - y0, 2)) / (2 * width * width)));
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

static int any(uint64_t k, int below)
{
    return (int)(below * rx_random_uniform(4, 2, k));
}

/* Noise of 2 on a sky of 10, stars of 5 to 1500 sigma anywhere in their pixels, hits of one to three pixels and a track, a line without
 * end and a star on it; list: their brightest pixels. */
static rx_image make(double width, const rx_psf *psf, rx_artefact *list)
{
    for (int i = 0; i < N; i++) {
        sigma[i] = 2.0f;
        level[i] = 10.0f;
        mask[i] = 0;
        pixels[i] = 10.0f + 2.0f * (float)rx_random_normal(4, 1, (uint64_t)i);
    }
    for (uint64_t s = 0; s < STARS; s++) {
        const double x = 20 + any(3 * s, 300), y = 20 + any(3 * s + 1, 180),
                     part = rx_random_uniform(5, 2, s) - 0.5;
        list[s] = (rx_artefact){.x = (int)x, .y = (int)y};
        add_light(x + part, y - part, 10 * pow(300, rx_random_uniform(4, 2, 3 * s + 2)), width);
    }
    for (int k = 0; k < HITS; k++) {
        list[STARS + k] = (rx_artefact){.x = hit[k][0], .y = hit[k][1]};
        for (int i = 0; i < (k == 1 ? 9 : k % 3 + 1); i++)
            pixels[rx_min_int(hit[k][1] - (k == 1 ? 4 - i : 0), H - 1) * W + hit[k][0] +
                   (k == 1 ? 2 * (i - 4) / 3 : i)] += 100.0f;
    }
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] += (float)(8 * exp(-pow((y - 260 - 0.1 * x) / width, 2) / 2));
    list[STARS + HITS] = (rx_artefact){.x = 200, .y = 280};
    list[STARS + HITS + 1] = (rx_artefact){.x = 300, .y = 290};
    add_light(300, 290, 400, width);
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

static void find(const rx_image *image, rx_artefact *list)
{
    rx_artefact many[ALL];
    memcpy(many, list, sizeof many);
    assert_int_equal(rx_artefacts_find(image, 1, ALL, list, NULL), RX_OK);
    assert_int_equal(rx_artefacts_find(image, 5, ALL, many, NULL), RX_OK);
    for (int i = 0; i < ALL; i++) {
        assert_near(many[i].hit, list[i].hit, 0);
        assert_near(many[i].line, list[i].line, 0);
        assert_near(many[i].off_line, list[i].off_line, 0);
    }
}

static void test_hits_and_a_line(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof WIDTHS / sizeof *WIDTHS; k++) {
        rx_artefact list[ALL];
        rx_psf *psf = gaussian(WIDTHS[k]);
        rx_image image = make(WIDTHS[k], psf, list);
        find(&image, list);
        for (int i = 0; i < ALL; i++) {
            const int is_hit = i >= STARS && i < STARS + HITS, is_line = i == STARS + HITS;
            if ((list[i].hit > 0.5) != is_hit || (list[i].line > 0.5 && list[i].off_line < 0.5) != is_line)
                print_message("width %g, source %d at (%d, %d): %g %g %g\n", WIDTHS[k], i, list[i].x,
                              list[i].y, list[i].hit, list[i].line, list[i].off_line);
            if (k > 0 || !is_hit || (i - STARS) % 3 == 0) /* longer ones are not found below FWHM 3 */
                assert_int_equal(list[i].hit > 0.5, is_hit);
            assert_int_equal(list[i].line > 0.5 && list[i].off_line < 0.5, is_line);
        }
        image.gain = 0.005; /* so few photons that one of them is such a hit */
        find(&image, list);
        assert_between(list[STARS].hit, 0, 1);
        image.gain = 0;
        mask[hit[0][1] * W + hit[0][0] - 1] = 1; /* a hidden neighbour says nothing, the others do */
        find(&image, list);
        assert_between(list[STARS].hit, 0.99, 1);
        mask[hit[0][1] * W + hit[0][0] + 1] = RX_MASK_SATURATED; /* charge runs over */
        find(&image, list);
        assert_near(list[STARS].hit, 0, 1e-9);
        rx_psf_free(psf);
    }
}

static void test_nothing_is_known(void **state)
{
    (void)state;
    rx_artefact list[ALL];
    rx_psf *psf = gaussian(WIDTHS[1]);
    rx_image image = make(WIDTHS[1], NULL, list); /* no PSF */
    find(&image, list);
    assert_near(list[STARS].hit, 0, 0);
    assert_near(list[STARS].off_line, 1, 0);
    image.psf = psf;
    memset(mask, 1, sizeof mask);
    find(&image, list);
    assert_near(list[STARS].hit, 0, 1e-9);
    assert_near(list[STARS + HITS].line, 0, 1e-9);
    assert_int_equal(rx_artefacts_find(&image, 1, 0, list, NULL), RX_OK);
    image.width = 3; /* smaller than a PSF */
    image.height = 2;
    image.mask = NULL;
    image.level = rx_map_plane(level, 3);
    image.noise = rx_map_plane(sigma, 3);
    for (int i = 0; i < ALL; i++)
        list[i] = (rx_artefact){.x = i % 3, .y = i % 2};
    find(&image, list);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_hits_and_a_line),
                                       cmocka_unit_test(test_nothing_is_known)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
