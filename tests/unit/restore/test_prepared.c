/* Data, weights and noise of a tile, by the formulas of restore/prepared.h, and what NONE leaves. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "../near.h"
#include "restore/prepared.h"
#include "restore/runs.h"
#include "sky.h"

enum { W = 1100, H = 30, AREA = W * H }; /* rows longer than the pieces they are made in */

/* Sky and noise of each pixel their own; pixels that are masked, not finite, without a sigma, very bright. */
static void make_sky(sky *s)
{
    sky_new(s, W, H);
    for (int k = 0; k < AREA; k++) {
        s->background.level[k] = (float)(90 + k % 13);
        s->background.sigma[k] = (float)(1 + 3 * rx_random_uniform(1, 1, (uint64_t)k));
        s->tile.pixels[k] = s->background.level[k] + (float)(30 * sin(1.3 * k));
        s->tile.mask[k] = k % 211 == 5 ? RX_MASK_BAD : k % 223 == 5 ? RX_MASK_SATURATED : 0;
    }
    s->tile.pixels[0] = NAN;
    s->tile.pixels[AREA - 1] = INFINITY;
    s->background.sigma[W - 1] = -1;
    s->background.sigma[2 * W] = INFINITY;
    s->background.sigma[3 * W + 1] = 1e-7f;
    s->background.level[7] = NAN;
    s->tile.pixels[1024] = 1e12f; /* the first of a piece */
    s->tile.gain = 1.6;
    s->par.rl_pedestal = 4;
}

static int by_size(const void *a, const void *b)
{
    const double *p = a, *q = b;
    return (*p > *q) - (*p < *q);
}

static void by_the_formulas(void **state)
{
    (void)state;
    static double sigmas[AREA];
    static uint8_t mask[AREA];
    float room[W];
    sky s;
    rx_prepared *p = NULL;
    int good = 0, known = 0;
    make_sky(&s);
    for (int k = 0; k < AREA; k++) {
        mask[k] = !isfinite(s.tile.pixels[k] - s.background.level[k]) ? RX_MASK_BAD : s.tile.mask[k];
        good += mask[k] == 0;
        if (mask[k] == 0 && s.background.sigma[k] > 0 && isfinite(s.background.sigma[k]))
            sigmas[known++] = s.background.sigma[k];
    }
    qsort(sigmas, (size_t)known, sizeof *sigmas, by_size);
    const int at = (int)(0.98 * (known - 1));
    const double median = (sigmas[(known - 1) / 2] + sigmas[known / 2]) / 2;
    const double high = sigmas[at] + (0.98 * (known - 1) - at) * (sigmas[at + 1] - sigmas[at]);
    rx_image image = sky_image(&s, NULL);
    assert_int_equal(rx_prepared_new(&s.par, &image, &p, NULL), RX_OK);
    assert_int_equal(p->good, good);
    assert_memory_equal(p->mask, mask, AREA);
    assert_near(p->median, median, 1e-9);
    assert_near(p->pedestal, 4 * high, 1e-9); /* below 3 medians */
    assert_near(p->sigma, median / p->pedestal, 1e-9);
    assert_near(p->photon, 1 / (1.6 * p->pedestal), 1e-9);
    assert_near(p->peak, 1e7, 0);
    for (int k = 0; k < AREA; k++) {
        const float sigma = s.background.sigma[k];
        const double value = ((double)s.tile.pixels[k] - s.background.level[k]) / p->pedestal + 1;
        const double share = sigma > 0 && isfinite(sigma) ? fmax(sigma / median, 1e-3) : 1;
        const int hidden = mask[k] != 0;
        if (k % W == 0)
            rx_prepared_variance(p, k / W, 0, W, room);
        assert_near(p->data[k], hidden ? 0 : fmin(fmax(value, 0), 1e7),
                    hidden ? 0 : 1e-6 * fmin(1 + fabs(value), 1e7));
        assert_near(p->weight[k], hidden ? 0 : fmin(1, 1 / (share * share)), 1e-6);
        const double variance = hidden ? 1 : pow(share * median / p->pedestal, 2);
        assert_near(room[k % W], variance, 1e-6 * variance);
    }
    rx_prepared_free(p);
    s.hide = RX_HIDE_PLAIN;
    s.par.rl_pedestal = 0.5; /* at least 1 */
    for (int k = 0; k < AREA / 10; k++)
        s.background.sigma[k] = 1000; /* high: 3 medians at most */
    image = sky_image(&s, NULL);
    assert_int_equal(rx_prepared_new(&s.par, &image, &p, NULL), RX_OK);
    assert_near(p->pedestal, 3 * p->median, 1e-9);
    for (int k = 1; k < AREA - 1; k++)
        assert_int_equal(p->mask[k], mask[k] & RX_MASK_BAD);
    rx_prepared_free(p);
    sky_free(&s);
}

/* Where nothing has a sigma, a thousandth of the largest difference from the sky is taken for one. */
static void without_noise(void **state)
{
    (void)state;
    sky s;
    rx_prepared *p = NULL;
    sky_new(&s, 40, 20);
    for (int k = 0; k < 800; k++)
        s.background.sigma[k] = 0;
    s.tile.pixels[0] = 100 - 900;
    s.tile.pixels[799] = 100 + 500;
    const rx_image image = sky_image(&s, NULL);
    assert_int_equal(rx_prepared_new(&s.par, &image, &p, NULL), RX_OK);
    assert_near(p->median, 0.9, 1e-12);
    assert_near(p->pedestal, 5 * 0.9, 1e-12);
    assert_near(p->peak, 1 + 500 / 4.5, 1e-4);
    assert_near(p->photon, 0, 0);
    rx_prepared_free(p);
    for (int k = 0; k < 800; k++)
        s.tile.pixels[k] = 100;
    assert_int_equal(rx_prepared_new(&s.par, &image, &p, NULL), RX_OK);
    assert_near(p->pedestal, 5, 1e-12);
    rx_prepared_free(p);
    sky_free(&s);
}

/* NONE: the tile less its sky, 0 under the mask. */
static void none_subtracts_the_sky(void **state)
{
    (void)state;
    sky s;
    rx_restored *r = NULL;
    make_sky(&s);
    const rx_image image = sky_image(&s, NULL);
    assert_int_equal(rx_none_run(&s.par, &image, NULL, &r, NULL), RX_OK);
    assert_ptr_equal(r->noise.sky, &s.background);
    assert_between(r->seconds, 0, 100);
    for (int k = 0; k < AREA; k++) {
        const int bits = isfinite(s.tile.pixels[k] - s.background.level[k]) ? s.tile.mask[k] : RX_MASK_BAD;
        assert_int_equal(r->mask[k], bits);
        assert_near(r->pixels[k], bits != 0 ? 0 : s.tile.pixels[k] - s.background.level[k], 0);
    }
    rx_restored_free(r);
    sky_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(by_the_formulas), cmocka_unit_test(without_noise),
                                       cmocka_unit_test(none_subtracts_the_sky)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
