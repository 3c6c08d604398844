/* Sources on a trail, a column and an edge, and stars beside and on them; all are known. */
#include "../near.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "fit/lines.h"

enum { W = 400, H = 300, N = W * H, STARS = 48, ON = 3, FALSE_ONES = 12, ALL = STARS + ON + FALSE_ONES };

static const double FWHM = 4, SIGMA = 4 / 2.3548;
static float pixels[N], sigma[N];
static uint8_t mask[N];
static rx_source list[ALL], other[ALL];

static void put(int i, int x, int y)
{
    list[i] = (rx_source){.xpeak = x, .ypeak = y};
}

/* The significance of a point on noise of 1 is `height`. */
static void add_star(int x0, int y0, double height)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            pixels[y * W + x] += (float)(height / (sqrt(M_PI) * SIGMA) *
                                         exp(-(pow(x - x0, 2) + pow(y - y0, 2)) / (2 * SIGMA * SIGMA)));
}

static double trail_y(double x)
{
    return 40 + 0.6 * x;
}

/* Noise of 1; a trail of 2.5 across, a column that glows, a last row that does; stars of 6 to 600 everywhere, three of them on the lines;
 * then what a search finds on these. */
static rx_image make(const rx_psf *psf)
{
    for (int i = 0; i < N; i++) {
        const double x = i % W, y = (double)(i / W), beside = (y - trail_y(x)) / sqrt(1 + 0.36);
        sigma[i] = 1;
        mask[i] = 0;
        pixels[i] = (float)(rx_random_normal(4, 1, (uint64_t)i) + 2.5 * exp(-0.5 * pow(beside / SIGMA, 2)) +
                            (i % W == 317 ? 6 : 0) + (i / W == H - 1 ? 8 : 0));
    }
    for (int s = 0; s < STARS; s++) {
        const int x = 20 + 50 * (s % 8), y = 15 + 44 * (s / 8) + 3 * (s % 8);
        put(s, x, y);
        add_star(x, y, 6 * pow(100, s / 48.0));
    }
    for (int k = 0; k < ON; k++) {
        const int x = k == 1 ? 317 : 150 + 20 * k, y = k == 1 ? 77 : k == 0 ? (int)trail_y(x) : H - 2;
        put(STARS + k, x, y);
        add_star(x, y, 25);
    }
    for (int k = 0; k < FALSE_ONES; k++) {
        const int x = k % 3 == 1 ? 317 : 44 + 31 * k;
        put(STARS + ON + k, x, k % 3 == 1 ? 55 + 44 * (k / 3) : k % 3 == 0 ? (int)lround(trail_y(x)) : H - 1);
    }
    return (rx_image){.width = W,
                      .height = H,
                      .pixels = pixels,
                      .mask = mask,
                      .hide = 1,
                      .noise = rx_map_plane(sigma, W),
                      .psf = psf};
}

/* The same by one thread and by five. */
static int find(const rx_image *image)
{
    int found = 0;
    for (int i = 0; i < ALL; i++)
        list[i].fit = (rx_source_template){.restore = RX_RESTORE_ADDED};
    memcpy(other, list, sizeof other);
    rx_sources one = {.n = ALL, .list = list}, five = {.n = ALL, .list = other};
    assert_int_equal(rx_lines_mark(image, 1, &one, NULL), RX_OK);
    assert_int_equal(rx_lines_mark(image, 5, &five, NULL), RX_OK);
    for (int i = 0; i < ALL; i++) {
        assert_true(other[i].fit.artefact == list[i].fit.artefact);
        assert_int_equal(list[i].fit.restore,
                         RX_RESTORE_ADDED | (list[i].fit.artefact > 0.5 ? RX_RESTORE_SHARP : 0));
        found += list[i].fit.artefact > 0.5;
    }
    return found;
}

static rx_psf *new_psf(void)
{
    rx_psf *psf = rx_psf_new(RX_PSF_GAUSS, 25, 1);
    assert_non_null(psf);
    psf->fwhm = FWHM;
    return psf;
}

static void test_lines_among_sources(void **state)
{
    (void)state;
    rx_psf *psf = new_psf();
    rx_image image = make(psf);
    find(&image);
    for (int i = 0; i < ALL; i++) {
        const int expected = i >= STARS + ON;
        if ((list[i].fit.artefact > 0.5) != expected)
            print_message("source %d at (%d, %d): %g\n", i, list[i].xpeak, list[i].ypeak,
                          list[i].fit.artefact);
        assert_int_equal(list[i].fit.artefact > 0.5, expected);
    }
    for (int y = 0; y < H; y++) /* a column that is hidden is no line */
        for (int x = 314; x < 321; x++)
            mask[y * W + x] = 1;
    find(&image);
    for (int k = 1; k < FALSE_ONES; k += 3)
        assert_true(list[STARS + ON + k].fit.artefact < 0.5);
    /* the photons of a line are noise along it */
    memset(mask, 0, sizeof mask);
    image.gain = 1e-3;
    assert_true(find(&image) > FALSE_ONES);
    rx_psf_free(psf);
}

static void test_a_fit_without_neighbours_counts(void **state)
{
    (void)state;
    rx_psf *psf = new_psf();
    rx_image image = make(psf);
    rx_sources one = {.n = ALL, .list = list};
    add_star(320, 160, 400); /* its light is on the column */
    for (int i = 0; i < ALL; i++)
        list[i].fit = (rx_source_template){0};
    put(0, 317, 164);
    assert_int_equal(rx_lines_mark(&image, 1, &one, NULL), RX_OK);
    assert_true(list[0].fit.artefact < 0.5);
    list[0].fit.fluxerr = 1;
    list[0].fit.snr = 8;
    assert_int_equal(rx_lines_mark(&image, 1, &one, NULL), RX_OK);
    assert_true(list[0].fit.artefact > 0.5);
    rx_psf_free(psf);
}

static void test_nothing_is_known(void **state)
{
    (void)state;
    rx_psf *psf = new_psf();
    rx_image image = make(NULL);
    assert_int_equal(find(&image), 0);
    image.psf = psf;
    memset(mask, 1, sizeof mask);
    assert_int_equal(find(&image), 0);
    assert_int_equal(rx_lines_mark(&image, 1, &(rx_sources){.n = 0}, NULL), RX_OK);
    image.width = 3; /* smaller than the filter */
    image.height = 2;
    image.mask = NULL;
    image.noise = rx_map_plane(sigma, 3);
    for (int i = 0; i < ALL; i++)
        put(i, i % 3, i % 2);
    assert_int_equal(find(&image), 0);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_lines_among_sources),
                                       cmocka_unit_test(test_a_fit_without_neighbours_counts),
                                       cmocka_unit_test(test_nothing_is_known)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
