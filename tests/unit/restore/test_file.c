/* Pixels that were restored elsewhere: sky, mask, noise and PSF. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>
#include <string.h>

#include "../near.h"
#include "sky.h"

enum { SIDE = 40, N = SIDE * SIDE, STAR = 20 * SIDE + 20, HIDDEN = 7 * SIDE + 9 };

static float given[N], noise[N];

/* The tile of the test as FILE hands it on: a star of 500 ADU, `sky` in the given pixels, one pixel masked. */
static rx_restored *run(sky *s, float sky_given, int with_noise, double fwhm)
{
    rx_error err = RX_ERROR_NONE;
    rx_restored *restored = NULL;
    sky_new(s, SIDE, SIDE);
    for (int k = 0; k < N; k++) {
        given[k] = sky_given + (float)(k % 3) - 1;
        noise[k] = 0.5f + (float)k / N;
    }
    given[STAR] = sky_given + 500;
    s->tile.mask[HIDDEN] = RX_MASK_BAD;
    given[HIDDEN] = 1e6f;
    s->tile.restored = given;
    s->tile.restored_noise = with_noise ? noise : NULL;
    s->par.file_fwhm = fwhm;
    const rx_image image = sky_image(s, NULL);
    if (rx_restorer_find("FILE")->run(&s->par, &image, NULL, &restored, &err) != RX_OK)
        fail_msg("%s", err.text);
    return restored;
}

/* The sky of the tile is 100: it is taken off pixels that have it, and not of those that do not, also where neither is exact. */
static void sky_is_off_once(void **state)
{
    static const float skies[][2] = {{0, 0}, {100, 0}, {3, 3}, {97, -3}};
    for (size_t i = 0; i < sizeof skies / sizeof *skies; i++) {
        sky s;
        rx_restored *restored = run(&s, skies[i][0], 0, 2);
        assert_near(restored->pixels[STAR], skies[i][1] + 500, 1e-5);
        assert_near(restored->pixels[0], skies[i][1] - 1, 1e-5);
        assert_true(restored->pixels[HIDDEN] == 0);
        assert_int_equal(restored->mask[HIDDEN], RX_MASK_BAD);
        assert_false(rx_map_given(&restored->noise)); /* to be measured */
        rx_restored_free(restored);
        sky_free(&s);
    }
}

static void noise_and_psf_are_those_given(void **state)
{
    sky s;
    float room[SIDE];
    rx_restored *restored = run(&s, 0, 1, 3);
    const float *row = rx_map_row(&restored->noise, 11, 0, SIDE, room);
    for (int x = 0; x < SIDE; x++)
        assert_true(row[x] == noise[11 * SIDE + x]);
    assert_near(restored->psf->fwhm, 3, 1e-6);
    /* 4 ln 2 / pi / FWHM^2 in the middle of a Gaussian, its pixel averaged: 3 % less */
    const int middle = (restored->psf->size / 2) * (restored->psf->size + 1);
    assert_between(restored->psf->basis[middle], 0.94 * 0.8825 / 9, 1.0 * 0.8825 / 9);
    rx_restored_free(restored);
    sky_free(&s);
}

static void without_pixels_it_says_so(void **state)
{
    sky s;
    rx_error err = RX_ERROR_NONE;
    rx_restored *restored = NULL;
    sky_new(&s, SIDE, SIDE);
    s.par.file_fwhm = 2;
    const rx_image image = sky_image(&s, NULL);
    assert_int_equal(rx_restorer_find("FILE")->run(&s.par, &image, NULL, &restored, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "RESTORED_NAME"));
    assert_null(restored);
    sky_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sky_is_off_once),
        cmocka_unit_test(noise_and_psf_are_those_given),
        cmocka_unit_test(without_pixels_it_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
