/* Which hidden pixels are gaps, and what stands in them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "../near.h"
#include "data/gaps.h"

enum { W = 60, H = 50 };

static void hide(uint8_t *mask, int x0, int y0, int width, int height, uint8_t bits)
{
    for (int y = y0; y < y0 + height; y++)
        for (int x = x0; x < x0 + width; x++)
            mask[y * W + x] = bits;
}

static size_t count(const uint8_t *mask, double fwhm, int saturated)
{
    rx_gaps *gaps = NULL;
    assert_int_equal(rx_gaps_find(mask, W, H, fwhm, saturated, &gaps, NULL), RX_OK);
    const size_t n = gaps != NULL ? gaps->n : 0;
    rx_gaps_free(gaps);
    return n;
}

/* Rows and columns up to the FWHM, holes up to 1.5 of it; of what reaches the border corners at the most. */
static void test_widths(void **state)
{
    static const struct {
        int x, y, width, height;
        double fwhm;
        size_t gaps;
    } cases[] = {{0, 20, W, 1, 3.5, W},   {0, 20, W, 3, 3.5, 3 * W}, {0, 20, W, 4, 3.5, 0},
                 {0, 20, W, 4, 4, 4 * W}, {30, 0, 2, H, 3.5, 2 * H}, {30, 0, 4, H, 3.5, 0},
                 {20, 20, 5, 5, 3.5, 25}, {20, 20, 5, 5, 0, 25},     {0, 0, W, 2, 3.5, 0},
                 {0, 10, 2, 20, 3.5, 2},  {20, 20, 1, 1, 1, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t mask[W * H] = {0};
        assert_int_equal(count(mask, cases[i].fwhm, 0), 0);
        hide(mask, cases[i].x, cases[i].y, cases[i].width, cases[i].height, RX_MASK_BAD);
        if (count(mask, cases[i].fwhm, 0) != cases[i].gaps)
            fail_msg("case %zu: %zu pixels in gaps", i, count(mask, cases[i].fwhm, 0));
    }
}

static void test_trails_and_wide_masks(void **state)
{
    uint8_t mask[W * H] = {0};
    for (int i = 5; i < 45; i++)
        mask[i * W + i] = mask[i * W + i + 1] = RX_MASK_WEIGHT;
    assert_int_equal(count(mask, 3.5, 0), 80);
    memset(mask, 0, sizeof mask);
    hide(mask, 10, 10, 20, 20, RX_MASK_SATURATED);
    assert_int_equal(count(mask, 3.5, 0), 0);
    assert_int_equal(count(mask, 3.5, 1), 400);
    hide(mask, 10, 10, 20, 20, RX_MASK_WEIGHT);
    assert_in_range(count(mask, 3.5, 1), 4, 12); /* at its corners */
}

/* On the straight line of the shortest way across; the mask opens and closes. */
static void test_filling(void **state)
{
    uint8_t mask[W * H] = {0}, before[W * H];
    float plane[W * H], noise[W * H];
    rx_gaps *gaps = NULL;
    rx_gaps_map room;
    hide(mask, 0, 20, W, 3, RX_MASK_BAD);
    hide(mask, 30, 40, 1, 1, RX_MASK_WEIGHT);
    memcpy(before, mask, sizeof mask);
    for (int k = 0; k < W * H; k++) {
        plane[k] = mask[k] != 0 ? NAN : (float)(2 * (k / W) + (k / W == 40 ? k % W : 0));
        noise[k] = mask[k] != 0 ? 0.0f : (float)(k / W);
    }
    assert_int_equal(rx_gaps_find(mask, W, H, 3.5, 0, &gaps, NULL), RX_OK);
    rx_gaps_fill(gaps, plane);
    const rx_map map = rx_gaps_filled(&room, rx_map_plane(noise, W), gaps);
    for (int x = 0; x < W; x++)
        for (int y = 20; y < 23; y++) {
            assert_near(plane[y * W + x], 2 * y, 1e-5);
            assert_near(rx_map_at(&map, x, y), y, 1e-5);
        }
    assert_near(plane[40 * W + 30], 2 * 40 + 30, 1e-5);
    assert_near(rx_map_at(&map, 30, 40), 40, 1e-5);
    assert_near(rx_map_at(&map, 31, 40), 40, 1e-5);
    /* rows of three: of a star there 1 - erf(sqrt(2 ln 2) 3 / 3.5) of the squared signal to noise is left */
    assert_near(rx_gap_noise(gaps, gaps->list), 1 / sqrt(1 - 0.84654), 2e-3);
    rx_gaps_mark(gaps, 0, mask);
    assert_int_equal(mask[21 * W] + mask[40 * W + 30], 0);
    rx_gaps_close(gaps, mask);
    assert_memory_equal(mask, before, sizeof mask);
    rx_gaps_free(gaps);
    rx_gaps_fill(NULL, plane);
    rx_gaps_mark(NULL, 0, mask);
    rx_gaps_close(NULL, mask);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_widths),
                                       cmocka_unit_test(test_trails_and_wide_masks),
                                       cmocka_unit_test(test_filling)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
