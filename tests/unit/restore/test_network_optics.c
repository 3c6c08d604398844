/* The optics of NET: blocks against one transform of the whole, and against restore/blur.h. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>
#include <string.h>

#include "../near.h"
#include "nn/rl_step.h"
#include "num/convolve.h"
#include "restore/blur.h"
#include "restore/network_optics.h"
#include "sky.h"

enum { WIDTH = 190, HEIGHT = 150, AREA = WIDTH * HEIGHT };

typedef struct bench {
    rx_psf *psf;
    rx_blocks blocks;
    rx_network_optics *optics;
    float x[AREA], f[AREA], made[AREA];
    uint8_t mask[AREA];
} bench;

static bench *bench_new(double fwhm, double change)
{
    bench *b = calloc(1, sizeof *b);
    rx_error err = RX_ERROR_NONE;
    b->psf = change > 0 ? sky_psf_varying(fwhm, change, WIDTH) : rx_stamp_gauss(fwhm);
    b->blocks = rx_blocks_make(WIDTH, HEIGHT, 64, 64, 4, 0, 0);
    if (rx_network_optics_new(b->psf, 2, 0.02, WIDTH, HEIGHT, &b->blocks, 1, &b->optics, &err) != RX_OK)
        fail_msg("%s", err.text);
    for (int k = 0; k < AREA; k++) {
        const double u = rx_random_uniform(1, 0, (uint64_t)k);
        b->f[k] = u > 0.995 ? (float)(1e3 * (u - 0.99)) : u < 0.1 ? -(float)(30 * u) : 0;
        b->x[k] = (float)(5 * rx_random_normal(1, 1, (uint64_t)k)) + b->f[k];
        b->mask[k] = rx_random_uniform(1, 2, (uint64_t)k) < 0.02 || k % WIDTH / 12 == 5;
    }
    return b;
}

static void bench_free(bench *b)
{
    rx_network_optics_free(b->optics);
    rx_psf_free(b->psf);
    free(b);
}

/* One domain for the whole tile with so much sky around that nothing wraps. */
static rx_fft *whole(int margin)
{
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(rx_fft_good_size(WIDTH + 2 * margin), rx_fft_good_size(HEIGHT + 2 * margin),
                                1, &fft, NULL),
                     RX_OK);
    return fft;
}

static void put(const rx_fft *fft, int margin, const float *plane, float *dst)
{
    rx_blocks_read(plane, WIDTH, HEIGHT, -margin, -margin, rx_fft_width(fft), rx_fft_height(fft),
                   rx_fft_stride_real(fft), dst);
}

static float at(const rx_fft *fft, int margin, const float *plane, int k)
{
    return plane[(size_t)(k / WIDTH + margin) * (size_t)rx_fft_stride_real(fft) +
                 (size_t)(k % WIDTH + margin)];
}

static void tikhonov_is_that_of_the_whole(void **state)
{
    enum { MARGIN = 100 };
    static const double widths[] = {2.5, 4, 7};
    (void)state;
    for (int i = 0; i < 3; i++) {
        bench *b = bench_new(widths[i], 0);
        rx_fft *fft = whole(MARGIN);
        float *plane = rx_fft_real(fft), *work = rx_fft_real(fft), *spectrum = rx_fft_complex(fft),
              *half = rx_fft_complex(fft);
        put(fft, MARGIN, b->x, plane);
        assert_int_equal(rx_deblur_tikhonov(fft, b->psf->basis, b->psf->size, 2, 0.02, work, spectrum, NULL),
                         RX_OK);
        rx_convolve(fft, spectrum, plane, half, plane);
        assert_int_equal(rx_network_optics_tikhonov(b->optics, b->x, b->made, NULL, 0, 0, NULL), RX_OK);
        for (int k = 0; k < AREA; k++)
            assert_near(b->made[k], at(fft, MARGIN, plane, k), 2e-3);
        free(plane);
        free(work);
        free(spectrum);
        free(half);
        rx_fft_free(fft);
        bench_free(b);
    }
}

/* A PSF that varies has at a node the filter of that place, and half way the mean of its neighbours'. */
static void tikhonov_of_a_varying_psf(void **state)
{
    (void)state;
    bench *b = bench_new(4, 0.3);
    assert_int_equal(rx_network_optics_tikhonov(b->optics, b->x, b->made, NULL, 0, 0, NULL), RX_OK);
    const int nx = b->optics->nx, side = 2 * RX_TIKHONOV_REACH + 1;
    assert_int_equal(nx, 5);
    const float *first = b->optics->filters, *second = first + side * side;
    const double places[] = {0, 0.5 * b->optics->step_x};
    for (int p = 0; p < 2; p++) {
        const int x = (int)places[p], y = 0;
        const double share = x / b->optics->step_x;
        double sum = 0;
        for (int v = -RX_TIKHONOV_REACH; v <= RX_TIKHONOV_REACH; v++)
            for (int u = -RX_TIKHONOV_REACH; u <= RX_TIKHONOV_REACH; u++) {
                const int k = (v + RX_TIKHONOV_REACH) * side + u + RX_TIKHONOV_REACH;
                if (x - u >= 0 && x - u < WIDTH && y - v >= 0 && y - v < HEIGHT)
                    sum += ((1 - share) * first[k] + share * second[k]) * b->x[(y - v) * WIDTH + x - u];
            }
        assert_near(b->made[x], sum, 1e-3);
    }
    float row[WIDTH + 20];
    rx_network_optics_fwhm_row(b->optics, 75, -10, WIDTH + 20, row);
    assert_near(row[0], row[10], 0);
    assert_near(row[10], b->optics->fwhm[0], 1e-4);
    assert_near(row[WIDTH + 9] / row[10], 1.3 / 0.7, 0.07); /* of stamps, with the pixel's own width */
    bench_free(b);
}

static void step_is_the_trained_one(void **state)
{
    enum { MARGIN = 60 };
    (void)state;
    for (int masked = 0; masked < 2; masked++) {
        bench *b = bench_new(4, 0);
        rx_fft *fft = whole(MARGIN);
        rx_rl_step *step = NULL;
        float *f = rx_fft_real(fft), *x = rx_fft_real(fft), *weight = rx_fft_real(fft),
              *out = rx_fft_real(fft);
        float stamp[129 * 129];
        int size = 0;
        assert_int_equal(rx_deblur_relative_size(b->psf->basis, b->psf->size, 2, 129, &size, NULL), RX_OK);
        assert_int_equal(rx_deblur_relative(b->psf->basis, b->psf->size, 2, size, 1, stamp, NULL), RX_OK);
        assert_int_equal(rx_rl_step_new(fft, &step, NULL), RX_OK);
        rx_rl_step_kernel(step, stamp, size);
        if (!masked)
            memset(b->mask, 0, sizeof b->mask);
        put(fft, MARGIN, b->f, f);
        put(fft, MARGIN, b->x, x);
        rx_blocks_good(b->mask, WIDTH, HEIGHT, -MARGIN, -MARGIN, rx_fft_width(fft), rx_fft_height(fft),
                       rx_fft_stride_real(fft), weight);
        rx_rl_step_forward(step, f, x, weight, 1, out);
        assert_int_equal(rx_network_optics_step(b->optics, b->f, b->x, b->mask, 1, b->made, NULL, 0, 0, NULL),
                         RX_OK);
        for (int k = 0; k < AREA; k++)
            assert_near(b->made[k], at(fft, MARGIN, out, k), 1e-3 + 1e-4 * fabsf(b->made[k]));
        free(f);
        free(x);
        free(weight);
        free(out);
        rx_rl_step_free(step);
        rx_fft_free(fft);
        bench_free(b);
    }
}

/* K' f of a sky of stars of the target's width is what the tile's varying PSF makes of points. */
static void reblurred_by_a_varying_psf(void **state)
{
    (void)state;
    bench *b = bench_new(4, 0.2);
    rx_blur *blur = NULL;
    rx_psf *target = rx_stamp_gauss(2);
    float *points = calloc(AREA, sizeof *points), value = 1;
    const int r = target->size / 2;
    memset(b->f, 0, sizeof b->f);
    for (int i = 0; i < 40; i++) {
        const int x = 30 + i * 37 % (WIDTH - 60), y = 30 + i * 23 % (HEIGHT - 60);
        points[y * WIDTH + x] += 1000;
        for (int k = 0; k < target->size * target->size; k++)
            b->f[(y + k / target->size - r) * WIDTH + x + k % target->size - r] += 1000 * target->basis[k];
    }
    assert_int_equal(rx_blur_new(b->psf, WIDTH, HEIGHT, 1, &blur, NULL), RX_OK);
    float *src = rx_blur_sky(blur), *dst = calloc(AREA, sizeof *dst);
    for (int y = 0; y < HEIGHT; y++)
        memcpy(src + rx_blur_row(blur, y), points + y * WIDTH, WIDTH * sizeof *src);
    rx_blur_plane(blur, src, dst);
    const rx_coarse scale = {1, 1, &value};
    float *sigma = calloc(AREA, sizeof *sigma);
    for (int k = 0; k < AREA; k++) {
        sigma[k] = 2;
        b->mask[k] = 0;
        b->x[k] = dst[k] + (k % 2 ? 6 : -6);
    }
    const rx_tile tile = {.width = WIDTH, .height = HEIGHT};
    const rx_background background = {.sigma = sigma};
    double chi2 = 0;
    assert_int_equal(rx_network_optics_reblur(b->optics, b->f, b->x, b->mask, &scale, &tile, &background,
                                              b->made, &chi2, NULL, 0, 0, NULL),
                     RX_OK);
    /* K' has forgotten what the target cannot hold: 0.1 % of the brightest pixel */
    for (int k = 0; k < AREA; k++)
        assert_near(b->made[k], dst[k], 0.25);
    assert_near(chi2, 9, 0.02);
    free(src);
    free(dst);
    free(points);
    free(sigma);
    rx_blur_free(blur);
    rx_psf_free(target);
    bench_free(b);
}

/* support = 1 - K^T good, as Richardson-Lucy has it */
static void support_is_that_of_blur(void **state)
{
    (void)state;
    for (int varying = 0; varying < 2; varying++) {
        bench *b = bench_new(4, varying ? 0.2 : 0);
        rx_blur *blur = NULL;
        assert_int_equal(rx_blur_new(b->psf, WIDTH, HEIGHT, 1, &blur, NULL), RX_OK);
        float *src = calloc(AREA, sizeof *src), *dst = rx_blur_sky(blur);
        for (int k = 0; k < AREA; k++)
            src[k] = b->mask[k] == 0 ? 1 : 0;
        rx_blur_adjoint_plane(blur, src, dst);
        assert_int_equal(rx_network_optics_support(b->optics, b->mask, b->made, NULL, 0, 0, NULL), RX_OK);
        for (int k = 0; k < AREA; k++)
            assert_near(b->made[k], 1 - dst[rx_blur_row(blur, k / WIDTH) + (size_t)(k % WIDTH)], 2e-5);
        free(src);
        free(dst);
        rx_blur_free(blur);
        bench_free(b);
    }
}

/* A star of which the network has lost a fifth gets it back. */
static void step_returns_lost_flux(void **state)
{
    (void)state;
    sky s;
    bench *b = bench_new(4, 0);
    sky_new(&s, WIDTH, HEIGHT);
    memset(b->mask, 0, sizeof b->mask);
    sky_star(&s, 90.2, 70.7, sqrt(4 * 4), 1e5);
    for (int k = 0; k < AREA; k++)
        b->x[k] = s.tile.pixels[k] - 100;
    sky_free(&s);
    sky_new(&s, WIDTH, HEIGHT);
    sky_star(&s, 90.2, 70.7, 2, 0.8e5);
    for (int k = 0; k < AREA; k++)
        b->f[k] = s.tile.pixels[k] - 100;
    assert_int_equal(rx_network_optics_step(b->optics, b->f, b->x, b->mask, 1, b->made, NULL, 0, 0, NULL),
                     RX_OK);
    const double flux = sky_sum(&s, b->made, 90.2, 70.7, 15);
    print_message("0.8 of the flux before the step, %.4f after it\n", flux / 1e5);
    assert_near(flux / 1e5, 1, 5e-3);
    sky_free(&s);
    bench_free(b);
}

static void blocks_cover_the_tile(void **state)
{
    (void)state;
    for (int width = 1; width < 300; width += 7)
        for (int side = 8; side < 200; side += 36)
            for (int shift = 0; shift < 500; shift = 2 * shift + 8) {
                const rx_blocks b = rx_blocks_make(width, 5, side, side, 8, shift, 0);
                assert_true(b.width <= side && b.width % 8 == 0);
                assert_true(b.x <= 0 && b.x > -b.width && (b.x + shift) % b.width == 0);
                assert_true(b.x + b.nx * b.width >= width && b.x + (b.nx - 1) * b.width < width);
                assert_int_equal(b.ny, 1);
                assert_int_equal(b.height, 8);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tikhonov_is_that_of_the_whole), cmocka_unit_test(tikhonov_of_a_varying_psf),
        cmocka_unit_test(step_is_the_trained_one),       cmocka_unit_test(reblurred_by_a_varying_psf),
        cmocka_unit_test(support_is_that_of_blur),       cmocka_unit_test(step_returns_lost_flux),
        cmocka_unit_test(blocks_cover_the_tile),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
