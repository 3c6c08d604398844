/* Crowds: which cells are, what is measured anew there, and two points against a profile. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "psf/psf.h"
#include "template/crowd.h"
#include "template/fit.h"
#include "template/residual_sky.h"
#include "template/unseen.h"

enum { W = 512, H = 320, LEFT = 192 };

/* Light of 3 sigma on every eighth pixel of the columns below LEFT, and on all from `from` on. */
static void shade(rx_fit_image *canvas, float *values, int from)
{
    rx_layer *layer = rx_alloc(1, sizeof *layer);
    assert_non_null(layer);
    for (int k = 0; k < W * H; k++)
        values[k] = (k % W < LEFT && k % 8 == 0) || k % W >= from ? 3.0f : 0.0f;
    *layer = (rx_layer){{0, 0, W, H, values, 1}, 1};
    rx_fit_image_set(canvas, layer, 1);
}

/* Sources every 20 pixels to the left, FWHM 4: one in 25 areas; one galaxy to the right. */
static void test_cells(void **state)
{
    (void)state;
    field f;
    rx_fit_image canvas;
    static float values[W * H];
    static rx_crowd_source sources[W * H];
    int n = 0;
    field_open(&f, W, H, 4, 1, 1);
    field_restore_none(&f);
    const rx_tphot_input input = field_input(&f);
    for (int y = 10; y < H; y += 20)
        for (int x = 10; x < LEFT; x += 20)
            sources[n++] = (rx_crowd_source){.x = x, .y = y, .star = -1};
    sources[n++] = (rx_crowd_source){.x = 450, .y = 150, .star = -1};
    for (int rows = 40; rows <= H; rows += H - 40) {
        rx_crowding crowd;
        rx_fit_image_open(&input, (size_t)W * (size_t)rows, 2, &canvas);
        shade(&canvas, values, 384);
        assert_int_equal(rx_crowding_find(&canvas, sources, n, 4, RX_CROWDING_AUTO, &crowd, NULL), RX_OK);
        /* cells of the left, and those beside them, around which there are half as many sources and half the light */
        for (int y = 0; y < H; y += 32)
            for (int x = 0; x < W; x += 32)
                assert_int_equal(rx_crowding_at(&crowd, x, y), x < LEFT);
        /* sources that a fit has taken over the border */
        assert_int_equal(rx_crowding_at(&crowd, -70, H + 200), 1);
        assert_int_equal(rx_crowding_at(&crowd, W + 100, -70), 0);
        assert_int_equal(crowd.n, 3 * 5);
        assert_int_equal(crowd.seen, 8 * 5);
        rx_crowding_clear(&crowd);
        assert_int_equal(rx_crowding_at(&crowd, 0, 0), 0);
        assert_int_equal(rx_crowding_find(&canvas, sources, n, 4, RX_CROWDING_NO, &crowd, NULL), RX_OK);
        assert_int_equal(crowd.n, 0);
        rx_crowding_clear(&crowd);
        assert_int_equal(rx_crowding_find(&canvas, sources, 0, 4, RX_CROWDING_YES, &crowd, NULL), RX_OK);
        assert_int_equal(crowd.n, 8 * 5);
        assert_near(rx_crowding_pair_odds(&crowd, 100, 100), 4, 0);
        rx_crowding_clear(&crowd);
        rx_fit_image_clear(&canvas);
    }
    /* nothing is seen from column 256 on: cells beside that still have visible ones around them, those farther off count no more */
    for (int k = 0; k < W * H; k++)
        f.mask[k] = k % W >= 256 ? RX_MASK_BAD : 0;
    rx_crowding crowd;
    rx_fit_image_open(&input, (size_t)W * (size_t)H, 2, &canvas);
    shade(&canvas, values, 384);
    assert_int_equal(rx_crowding_find(&canvas, sources, n, 4, RX_CROWDING_AUTO, &crowd, NULL), RX_OK);
    assert_int_equal(crowd.seen, 5 * 5);
    rx_crowding_clear(&crowd);
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

/* Points to the left, profiles to the right, each with a tenth of the others: the cells of the profiles are no crowd. */
static void test_extended(void **state)
{
    (void)state;
    static rx_crowd_source sources[(W / 20 + 1) * (H / 20 + 1)];
    uint8_t cells[8 * 5];
    rx_crowding crowd = {.width = W, .height = H, .nx = 8, .ny = 5, .cells = cells, .n = 8 * 5};
    int n = 0;
    memset(cells, 1, sizeof cells);
    for (int y = 10; y < H; y += 20)
        for (int x = 10; x < W; x += 20, n++) {
            const int extended = (x >= W / 2) != (n % 10 == 0);
            sources[n] = (rx_crowd_source){.x = x, .y = y, .star = !extended};
            sources[n].light[extended] = 100;
            sources[n].light[!extended] = -5;
        }
    assert_int_equal(rx_crowding_spare(sources, n, &crowd, NULL), RX_OK);
    for (int y = 0; y < H; y += 64)
        for (int x = 0; x < W;
             x += 64) /* the cell right of the middle still has a third of the left's light around it */
            assert_int_equal(rx_crowding_at(&crowd, x, y), x <= W / 2);
    assert_int_equal(crowd.n, 5 * 5);
}

/* Odds that what looks extended is two stars, FWHM 4, a source every `step` pixels, of those that are clear every second or none
 * extended. */
static double odds_of(int step, int extended, int clear)
{
    static rx_crowd_source sources[W * H / 64];
    rx_crowding crowd;
    rx_fit_image canvas;
    field f;
    int n = 0;
    field_open(&f, W, H, 4, 1, 1);
    field_restore_none(&f);
    const rx_tphot_input input = field_input(&f);
    rx_fit_image_open(&input, (size_t)W * H, 2, &canvas);
    for (int y = step / 2; y < H; y += step)
        for (int x = step / 2; x < W; x += step, n++)
            sources[n] = (rx_crowd_source){.x = x, .y = y, .star = clear ? !(extended && n % 2 == 1) : -1};
    assert_int_equal(rx_crowding_find(&canvas, sources, n, 4, RX_CROWDING_AUTO, &crowd, NULL), RX_OK);
    const double odds = rx_crowding_pair_odds(&crowd, W / 2, H / 2);
    rx_crowding_clear(&crowd);
    rx_fit_image_clear(&canvas);
    field_close(&f);
    return odds;
}

/* Where half is extended, and no more than a ninth of the stars have another one within 6 pixels, most are galaxies: 4 sources in each
 * of nine cells, half of them points, and five points more. Where sources are too close to say how many they are all may be stars. */
static void test_pair_odds(void **state)
{
    (void)state;
    const double seen = M_PI * 36 / (32 * 32), points = 18, others = 18, start = 5;
    double x = seen;
    for (int i = 0; i < 100; i++)
        x = seen * exp(x);
    const double chance = exp(x) - 1, left = (others - 4 * chance * points) / (points + start);
    assert_near(chance, 0.1334, 1e-4);
    assert_near(odds_of(32, 1, 1), 2 * log(chance / left), 1e-9);
    assert_near(odds_of(32, 0, 1), 4, 0);
    assert_near(odds_of(32, 1, 0), 4, 0);
    assert_near(odds_of(12, 1, 1), 4, 0);
}

/* Noise that is given as half again of what it is, on a sky 2 too high, is put right where it is crowded, and only there. */
static void test_sky_and_noise(void **state)
{
    (void)state;
    field f;
    rx_fit_image canvas;
    uint8_t cells[8 * 5] = {0};
    const rx_crowding crowd = {.width = W, .height = H, .nx = 8, .ny = 5, .cells = cells, .n = 20};
    const rx_residual_sky where = {.crowd = &crowd, .cell = 64};
    double mean = 0;
    for (int k = 0; k < 8 * 5; k++)
        cells[k] = k % 8 < 4;
    field_open(&f, W, H, 4, 1, 1);
    field_noise(&f, 5);
    for (int k = 0; k < W * H; k++) {
        f.pixels[k] += 2;
        f.sigma[k] = 1.5f;
    }
    field_restore_none(&f);
    const rx_tphot_input input = field_input(&f);
    rx_fit_image_open(&input, (size_t)W * H, 2, &canvas);
    assert_int_equal(rx_residual_sky_subtract(&canvas, &where, &mean, NULL), RX_OK);
    for (int turn = 0; turn < 2; turn++) { /* once is enough */
        assert_int_equal(rx_residual_sky_rescale(&canvas, &where, NULL), RX_OK);
        assert_int_equal(rx_fit_image_load_rows(&canvas, 0, H, NULL), RX_OK);
        for (int y = 0; y < H; y++) {
            const size_t row = rx_fit_image_row(&canvas, y);
            for (int x = 0; x < 224; x++)
                assert_near(canvas.sigma[row + (size_t)x], 1, 0.08);
            for (int x = 288; x < W; x++)
                assert_near(canvas.sigma[row + (size_t)x], 1.5, 0);
            assert_near(canvas.data[row + 300], f.pixels[y * W + 300], 0);
            assert_near(canvas.data[row + 100], (double)f.pixels[y * W + 100] - 2, 0.05);
        }
    }
    assert_near(mean, 1, 0.01);
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

enum { HALF = 16, SIDE = 2 * HALF + 1 };

/* Chi2 of the best point, profile and pair of what `paint` lays into the planes of a lens, with noise 1. */
static void best_of(const double stars[2][3], double disk, double chi2[3])
{
    rx_psf *psf = NULL;
    rx_template_otf *lens = NULL;
    rx_template_domain *size = NULL;
    double block[2 * SIDE * SIDE];
    assert_int_equal(rx_psf_moffat(4, 4.765, 1, 0, 41, &psf, NULL), RX_OK);
    assert_int_equal(rx_template_otf_new(psf, NULL, &lens, NULL), RX_OK);
    assert_int_equal(rx_template_otf_at(lens, rx_template_otf_side(lens, 15, 0), 0, 0, &size, NULL), RX_OK);
    const rx_patch patch = {
        .side = SIDE, .corner = size->n / 2 - HALF, .data = block, .weight = block + SIDE * SIDE};
    const size_t stride = (size_t)rx_fft_stride_real(size->fft);
    for (int k = 0; k < SIDE * SIDE; k++) {
        block[k] = rx_random_normal(3, 1, (uint64_t)k);
        patch.weight[k] = 1;
    }
    const rx_spergel shape = {3, 0.3, 0.1, 0.5};
    for (int i = 0; i < 3; i++) {
        rx_template_domain_render(size, i == 2 ? &shape : NULL, i < 2 ? stars[i][0] : 0.3,
                                  i < 2 ? stars[i][1] : -0.2, NULL, 1);
        for (int k = 0; k < SIDE * SIDE; k++)
            block[k] += (i < 2 ? stars[i][2] : disk) *
                        (double)size->plane[0][(size_t)(k / SIDE + patch.corner) * stride +
                                               (size_t)(k % SIDE + patch.corner)];
    }
    rx_fit point = {.n = RX_FIT_POINT, .iterations = 12};
    rx_fit_run(&point, size, &patch);
    chi2[0] = point.chi2;
    rx_fit profile = {
        .n = RX_FIT_ALL,
        .iterations = 40,
        .p = {[RX_FIT_RADIUS] = 0.7, [RX_FIT_NU] = 0.4},
        .low = {[RX_FIT_RADIUS] = -2, [RX_FIT_G1] = -0.8, [RX_FIT_G2] = -0.8, [RX_FIT_NU] = -1.6},
        .high = {[RX_FIT_RADIUS] = 2, [RX_FIT_G1] = 0.8, [RX_FIT_G2] = 0.8, [RX_FIT_NU] = 2.3}};
    rx_fit_run(&profile, size, &patch);
    chi2[1] = profile.chi2;
    chi2[2] = rx_fit_pair(&point, (double[2]){1, 0.4}, 6, -HUGE_VAL, size, &patch, NULL);
    rx_template_otf_free(lens);
    rx_psf_free(psf);
}

/* Of two stars the pair, of a disk the profile has the chi2 of the noise, and the other much more; of one star neither is
 * better than the point by more than its freedom. */
static void test_pair(void **state)
{
    (void)state;
    static const double two[2][3] = {{1.2, 0.4, 4000}, {-1.4, -0.3, 3000}}, none[2][3] = {{0}};
    static const double one[2][3] = {{0.3, -0.2, 5000}};
    const double pixels = SIDE * SIDE, spread = 4 * sqrt(2 * pixels);
    double chi2[3];
    best_of(two, 0, chi2);
    assert_near(chi2[2], pixels - 6, spread);
    assert_true(chi2[0] > chi2[2] + 1000);
    assert_true(chi2[1] > chi2[2] + 30);
    best_of(none, 8000, chi2);
    assert_near(chi2[1], pixels - 7, spread);
    assert_true(chi2[0] > chi2[1] + 1000);
    assert_true(chi2[2] > chi2[1] + 100);
    best_of(one, 0, chi2);
    assert_near(chi2[0], pixels - 3, spread);
    assert_true(chi2[2] > chi2[0] - 15 || isinf(chi2[2]));
}

static const double faint[][2] = {{40, 40},   {200, 60}, {60, 170}, {210, 200},
                                  {120, 110}, {30, 220}, {230, 120}};
enum { FAINT = sizeof faint / sizeof *faint };
static const double nothing[2] = {128.3, 20.6};

/* One star each look, and a place where nothing is, until that is said to be known. */
static rx_status show_one(void *user, const rx_tphot_search *look, double (**dst)[2], int *n, rx_error *err)
{
    int *calls = user, known = 0; /* looks; those with `nothing` */
    (void)err;
    for (int i = 0; i < look->n; i++)
        known = known || hypot(look->at[i][0] - nothing[0], look->at[i][1] - nothing[1]) < 3;
    *dst = rx_alloc(2, sizeof **dst);
    assert_non_null(*dst);
    *n = 0;
    if (calls[0] < FAINT)
        memcpy((*dst)[(*n)++], faint[calls[0]], sizeof nothing);
    if (!known)
        memcpy((*dst)[(*n)++], nothing, sizeof nothing);
    calls[0]++;
    calls[1] += !known;
    return RX_OK;
}

/* What did not hold in the first passes is not offered for ever; stars that come one after the other, each fitted with what is
 * near, have their fluxes in the end. */
static void test_passes(void **state)
{
    (void)state;
    field f;
    int calls[2] = {0};
    rx_tphot_params par = rx_tphot_defaults();
    rx_tphot *t = NULL;
    field_open(&f, 256, 256, 4, 1, 1);
    field_noise(&f, 3);
    field_star(&f, 100, 180, 2000);
    for (int i = 0; i < FAINT; i++)
        field_star(&f, faint[i][0], faint[i][1], 500);
    field_list(&f, 100, 180, 6, 1.7, 1.7, 0);
    field_restore_none(&f);
    rx_tphot_input input = field_input(&f);
    input.more = show_one;
    input.user = calls;
    par.passes = 12;
    par.crowding = RX_CROWDING_YES;
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_int_equal(calls[1], 4);
    assert_int_equal(calls[0], FAINT + 1);
    assert_int_equal(t->passes, FAINT + 1);
    assert_int_equal(t->n, FAINT + 1);
    assert_near(t->list[0].flux, 2000, 4 * t->list[0].fluxerr);
    for (int i = 1; i < t->n; i++)
        assert_near(t->list[i].flux, 500, 4 * t->list[i].fluxerr);
    rx_tphot_free(t);
    field_close(&f);
}

/* Only what fits have split. */
static rx_status show_seconds(void *user, const rx_tphot_search *look, double (**dst)[2], int *n,
                              rx_error *err)
{
    int *calls = user;
    (void)err;
    *n = look->nseconds;
    *dst = rx_alloc((size_t)*n, sizeof **dst);
    assert_non_null(*dst);
    memcpy(*dst, look->seconds, (size_t)*n * sizeof **dst);
    calls[0]++;
    return RX_OK;
}

/* Where it is not crowded: a pair 0.8 FWHM apart is two points, a star, a galaxy and a pair too near to be split are what they
 * were, the latter marked by its class; with CROWDING N all are, and so is a tile without pairs, to the byte. */
static void test_clear_pair(void **state)
{
    (void)state;
    rx_tphot_source before[3];
    for (int turn = 0; turn < 4; turn++) { /* no pair; one, as AUTO, without, and as NO has it */
        field f;
        int calls = 0;
        rx_tphot_params par = rx_tphot_defaults();
        rx_tphot *t = NULL;
        field_open(&f, 256, 256, 4, 1, 4);
        field_noise(&f, 3);
        field_star(&f, 60, 60, 2000);
        field_disk(&f, 190, 60, 6000, 3, 0.7, 30);
        field_star(&f, 60, 190, 2000);
        field_star(&f, 60.4, 190.8, 1500);
        if (turn > 1) {
            field_star(&f, 190, 190, 2000);
            field_star(&f, 192.6, 191.8, 1400);
        }
        field_list(&f, 60, 60, 6, 1.7, 1.7, 0);
        field_list(&f, 190, 60, 9, 3, 2.4, 30);
        field_list(&f, 60, 190.4, 6, 1.8, 1.7, 0);
        if (turn > 1)
            field_list(&f, 191.1, 190.7, 8, 2.2, 1.8, 35);
        field_restore_none(&f);
        rx_tphot_input input = field_input(&f);
        input.more = show_seconds;
        input.user = &calls;
        par.crowding = turn == 1 || turn == 3 ? RX_CROWDING_NO : RX_CROWDING_AUTO;
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        assert_int_equal(calls, 1);
        assert_int_equal(t->n, turn == 0 || turn == 1 ? 3 : turn == 2 ? 5 : 4);
        assert_int_equal(t->list[1].kind, RX_TPHOT_PROFILE);
        if (turn == 0)
            memcpy(before, t->list, sizeof before);
        if (turn == 1)
            for (int i = 0; i < 3; i++)
                assert_memory_equal(&t->list[i].flux, &before[i].flux, sizeof before[i].flux);
        if (turn == 2) {
            assert_near(t->list[3].flux, 2000, 4 * t->list[3].fluxerr);
            assert_near(t->list[4].flux, 1400, 4 * t->list[4].fluxerr);
            assert_near(t->list[4].x, 192.6, 0.3);
            assert_near(t->list[4].y, 191.8, 0.3);
        }
        if (turn == 3)
            assert_int_equal(t->list[3].kind, RX_TPHOT_PROFILE);
        rx_tphot_free(t);
        field_close(&f);
    }
}

static int falling(const void *one, const void *other)
{
    const float a = *(const float *)one, b = *(const float *)other;
    return a < b ? 1 : a > b ? -1 : 0;
}

/* Noise is not less than that of rounding, nor than two millionths of what the brightest thousandth of pairs of pixels has, whatever
 * the noise map says; a few hot pixels say nothing. Without noise fluxes are right all the same, with whole numbers nothing is found beside what is there. */
static void test_least_noise(void **state)
{
    (void)state;
    for (int rounded = 0; rounded < 2; rounded++) {
        field f;
        rx_fit_image canvas;
        rx_tphot *t = NULL;
        rx_tphot_params par = rx_tphot_defaults();
        field_open(&f, 128, 128, 4, 0.05, 2);
        field_star(&f, 50, 60, 20000);
        field_star(&f, 57, 63, 9000);
        for (int k = 0; k < 128 * 128; k++) {
            f.sigma[k] = 1e-9f;
            f.pixels[k] = rounded ? roundf(f.pixels[k]) : f.pixels[k];
        }
        for (int i = 0; i < 3; i++)
            f.pixels[20 * 128 + 20 + i] = 1e12f;
        field_list(&f, 50, 60, 4, 1.7, 1.7, 0);
        field_list(&f, 57, 63, 4, 1.7, 1.7, 0);
        field_restore_none(&f);
        const rx_tphot_input input = field_input(&f);
        rx_fit_image_open(&input, 128 * 128, 2, &canvas);
        static float pair[128 * 127];
        for (int k = 0; k < 128 * 127; k++) {
            const float *both = &f.pixels[k / 127 * 128 + k % 127];
            pair[k] = fminf(both[0], both[1]);
        }
        qsort(pair, 128 * 127, sizeof *pair, falling);
        const double bright = (double)pair[16], floor = rounded ? sqrt(1 / 12.0) : (double)canvas.floor;
        assert_near(canvas.brightest, pair[0], 1e6);
        assert_near(canvas.floor, floor, 1e-4 * floor);
        if (!rounded)
            assert_near(canvas.floor, 1.8e-6 * bright, 0.22e-6 * bright);
        assert_near(sqrt((double)rx_fit_image_variance(&canvas, 100, 100)), (double)canvas.floor, 1e-6);
        rx_fit_image_clear(&canvas);
        for (int i = 0; i < 3; i++)
            f.mask[20 * 128 + 20 + i] = RX_MASK_BAD;
        par.crowding = RX_CROWDING_YES;
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        assert_near(t->list[0].flux, 20000, rounded ? 60 : 40);
        assert_near(t->list[1].flux, 9000, rounded ? 60 : 40);
        assert_near(t->least, floor, 1e-3);
        rx_tphot_free(t);
        field_close(&f);
    }
}

enum { STARS = 16000, SKY = 1024 };

static int ascending(const void *one, const void *other)
{
    const double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

/* Median, and the median distance from it in units of a Gaussian's sigma. */
static void middle_of(double *v, int n, double *median, double *width)
{
    qsort(v, (size_t)n, sizeof *v, ascending);
    *median = v[n / 2];
    for (int i = 0; i < n; i++)
        v[i] = fabs(v[i] - *median);
    qsort(v, (size_t)n, sizeof *v, ascending);
    *width = 1.4826 * v[n / 2];
}

/* So many stars of S/N 5 and more, of which those nearer than 0.8 FWHM to a brighter one are lost in it. Of those of S/N 20 to 100 that
 * remain: median of flux / true - 1 and width of the pulls, [0] as they are and [1] with what is unseen allowed for. */
static void measure_unseen(int stars, double median[2], double pull[2])
{
    const double fwhm = 4, error = 100;
    static double x[STARS], y[STARS], flux[STARS], lifted[STARS], pulls[2][STARS], off[2][STARS];
    static rx_tphot_source list[STARS];
    static int of[STARS];
    uint8_t cells[16 * 16];
    const rx_crowding crowd = {.width = SKY, .height = SKY, .nx = 16, .ny = 16, .cells = cells, .n = 256};
    double none, excess;
    int n = 0, m = 0;
    memset(cells, 1, sizeof cells);
    for (int i = 0; i < stars; i++) {
        x[i] = SKY * rx_random_uniform(5, 1, (uint64_t)i);
        y[i] = SKY * rx_random_uniform(5, 2, (uint64_t)i);
        flux[i] = lifted[i] = 5 * error * pow(1 - 0.997 * rx_random_uniform(5, 3, (uint64_t)i), -1 / 0.9);
    }
    for (int i = 0; i < stars; i++) {
        int lost = 0;
        lifted[i] += error * rx_random_normal(5, 4, (uint64_t)i);
        for (int j = 0; j < stars; j++) {
            const double r = hypot(x[i] - x[j], y[i] - y[j]) / fwhm;
            lost = lost || (r < 0.8 && flux[j] > flux[i]);
            lifted[i] += r < 0.8 && flux[j] < flux[i] ? flux[j] * exp(-2 * log(2) * r * r) : 0;
        }
        of[n] = i;
        list[n] = (rx_tphot_source){.kind = RX_TPHOT_POINT,
                                    .x = x[i],
                                    .y = y[i],
                                    .flux = lifted[i],
                                    .fluxerr = error,
                                    .snr = lifted[i] / error,
                                    .crowded = 1};
        n += !lost;
    }
    assert_int_equal(rx_unseen_allow(&crowd, fwhm, list, n, &excess, NULL), RX_OK);
    assert_between(excess, 0.1, 3);
    for (int k = 0; k < n; k++) {
        const double true_flux = flux[of[k]], before = lifted[of[k]];
        assert_near(list[k].flux + list[k].unseen, before, 1e-6 * before);
        if (true_flux < 20 * error || true_flux > 100 * error)
            continue;
        off[0][m] = before / true_flux - 1;
        off[1][m] = list[k].flux / true_flux - 1;
        pulls[0][m] = (before - true_flux) / error;
        pulls[1][m++] = (list[k].flux - true_flux) / list[k].fluxerr;
    }
    for (int j = 0; j < 2; j++) {
        middle_of(off[j], m, &median[j], &none);
        middle_of(pulls[j], m, &none, &pull[j]);
    }
}

/* Errors hold at any density; stars far apart keep theirs. */
static void test_unseen(void **state)
{
    (void)state;
    static rx_tphot_source list[100];
    uint8_t cells[16 * 16];
    const rx_crowding crowd = {.width = SKY, .height = SKY, .nx = 16, .ny = 16, .cells = cells, .n = 256};
    const double error = 100;
    double median[2], pull[2], excess;
    memset(cells, 1, sizeof cells);
    for (int stars = 4000; stars <= STARS; stars *= 2) {
        measure_unseen(stars, median, pull);
        assert_true(pull[0] > 1.1);
        assert_near(pull[1], 1, 0.12);
        assert_near(median[1], 0, 0.009);
    }
    assert_true(median[0] > 0.015);
    for (int k = 0; k < 100; k++)
        list[k] = (rx_tphot_source){.x = 50 + k % 10 * 90,
                                    .y = 50 + k / 10 * 90,
                                    .flux = 1000,
                                    .fluxerr = error,
                                    .snr = 10,
                                    .crowded = 1};
    assert_int_equal(rx_unseen_allow(&crowd, 4, list, 100, &excess, NULL), RX_OK);
    assert_near(excess, 0, 0);
    assert_near(list[50].flux, 1000, 0);
    assert_near(list[50].fluxerr, error, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cells),       cmocka_unit_test(test_extended),
        cmocka_unit_test(test_pair_odds),   cmocka_unit_test(test_sky_and_noise),
        cmocka_unit_test(test_pair),        cmocka_unit_test(test_passes),
        cmocka_unit_test(test_least_noise), cmocka_unit_test(test_unseen),
        cmocka_unit_test(test_clear_pair)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
