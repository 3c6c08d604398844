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
#include "restore/network_optics.h"
#include "sky.h"

enum { WIDTH = 190, HEIGHT = 150, AREA = WIDTH * HEIGHT };

typedef struct bench {
    rx_psf *psf;
    rx_blocks blocks;
    rx_network_optics *optics;
    float x[AREA], f[AREA], made[AREA];
    uint8_t mask[AREA];
    rx_network_input input; /* mask and x */
} bench;

/* As wide at two opposite corners as it is narrow at the others. */
static rx_psf *saddle(double fwhm, double change)
{
    rx_psf *psf = sky_psf_varying(fwhm, change, WIDTH);
    psf->py[1] = 1;
    psf->y0 = psf->ys = (HEIGHT - 1) / 2.0;
    return psf;
}

/* change > 0: along x; < 0: along both. */
static bench *bench_new(double fwhm, double change)
{
    bench *b = calloc(1, sizeof *b);
    rx_error err = RX_ERROR_NONE;
    b->psf = change > 0   ? sky_psf_varying(fwhm, change, WIDTH)
             : change < 0 ? saddle(fwhm, -change)
                          : rx_stamp_gauss(fwhm);
    b->input = (rx_network_input){.mask = b->mask, .x = b->x};
    b->blocks = rx_blocks_make(WIDTH, HEIGHT, 64, 64, 4, 0, 0);
    const rx_image image = {.width = WIDTH, .height = HEIGHT, .psf = b->psf};
    if (rx_network_optics_new(&image, 2, 0.02, &b->blocks, 1, &b->optics, &err) != RX_OK)
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
    const size_t stride = (size_t)rx_fft_stride_real(fft);
    memset(dst, 0, stride * (size_t)rx_fft_height(fft) * sizeof *dst);
    for (int y = 0; y < HEIGHT; y++)
        memcpy(dst + (size_t)(y + margin) * stride + margin, plane + (size_t)y * WIDTH, WIDTH * sizeof *dst);
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
    for (int i = 0; i < 3; i++) {
        bench *b = bench_new(widths[i], 0);
        rx_fft *fft = whole(MARGIN);
        float *plane = rx_fft_real(fft), *work = rx_fft_real(fft), *spectrum = rx_fft_complex(fft),
              *half = rx_fft_complex(fft);
        put(fft, MARGIN, b->x, plane);
        assert_int_equal(
            rx_deblur_tikhonov(fft, b->psf->basis, b->psf->size, &(rx_tikhonov){2, 0.02, 0}, spectrum, NULL),
            RX_OK);
        rx_convolve(fft, spectrum, plane, half, plane);
        assert_int_equal(rx_network_optics_tikhonov(b->optics, b->x, b->made, NULL, NULL), RX_OK);
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

static void step_is_the_trained_one(void **state)
{
    enum { MARGIN = 60 };
    for (int masked = 0; masked < 2; masked++) {
        bench *b = bench_new(4, 0);
        rx_fft *fft = whole(MARGIN);
        rx_rl_step *step = NULL;
        rx_rl_kernel kernel = {.spectrum = rx_fft_complex(fft)};
        float *f = rx_fft_real(fft), *x = rx_fft_real(fft), *weight = rx_fft_real(fft),
              *out = rx_fft_real(fft);
        float stamp[129 * 129];
        int size = 0;
        assert_int_equal(rx_deblur_relative_size(b->psf->basis, b->psf->size, 2, 129, &size, NULL), RX_OK);
        assert_int_equal(rx_deblur_relative(b->psf->basis, b->psf->size, 2, size, 1, stamp, NULL), RX_OK);
        assert_int_equal(rx_rl_step_new(fft, &kernel, &step, NULL), RX_OK);
        rx_rl_kernel_set(fft, stamp, size, &kernel);
        if (!masked)
            memset(b->mask, 0, sizeof b->mask);
        put(fft, MARGIN, b->f, f);
        put(fft, MARGIN, b->x, x);
        rx_blocks_good(b->mask, WIDTH, HEIGHT,
                       &(rx_blocks_window){-MARGIN, -MARGIN, rx_fft_width(fft), rx_fft_height(fft),
                                           rx_fft_stride_real(fft)},
                       weight);
        rx_rl_step_forward(step, f, x, weight, 1, out);
        assert_int_equal(rx_network_optics_step(b->optics, &b->input, 1, b->f, b->made, NULL, NULL), RX_OK);
        for (int k = 0; k < AREA; k++)
            assert_near(b->made[k], at(fft, MARGIN, out, k), 1e-3 + 1e-4 * fabsf(b->made[k]));
        free(f);
        free(x);
        free(weight);
        free(out);
        free(kernel.spectrum);
        rx_rl_step_free(step);
        rx_fft_free(fft);
        bench_free(b);
    }
}

/* The blur K' by restore/blur.h. */
static rx_blur *relative_blur(const rx_psf *psf)
{
    rx_blur *blur = NULL;
    rx_psf *relative = rx_psf_copy(psf);
    free(relative->basis);
    assert_int_equal(rx_otf_relative(psf, 2, WIDTH, HEIGHT, &relative->basis, &relative->size, NULL), RX_OK);
    assert_int_equal(rx_blur_new(relative, WIDTH, HEIGHT, 1, &blur, NULL), RX_OK);
    rx_psf_free(relative);
    return blur;
}

/* dst = K' src, nothing beyond the border */
static void blur_tile(const rx_blur *blur, const float *src, float *dst)
{
    float *sky = rx_blur_sky(blur);
    for (int y = 0; y < HEIGHT; y++)
        memcpy(sky + rx_blur_row(blur, y), src + y * WIDTH, WIDTH * sizeof *sky);
    rx_blur_plane(blur, sky, dst);
    free(sky);
}

static float *adjoint_of(const rx_blur *blur, const float *tile)
{
    float *sky = rx_blur_sky(blur);
    rx_blur_adjoint_plane(blur, tile, sky);
    return sky;
}

/* The formula of nn/rl_step.h, for PSFs that vary too. */
static void step_by_its_formula(void **state)
{
    const double p = 1.5;
    for (int k = 0; k < 6; k++) { /* no pixel masked, one, many */
        bench *b = bench_new(4, k % 2 ? -0.3 : 0);
        const rx_blocks small = rx_blocks_make(WIDTH, HEIGHT, 16, 16, 4, 0, 0);
        if (k < 2) { /* blocks whose surroundings all lie on the tile */
            rx_network_optics_free(b->optics);
            const rx_image image = {.width = WIDTH, .height = HEIGHT, .psf = b->psf};
            assert_int_equal(rx_network_optics_new(&image, 2, 0, &small, 1, &b->optics, NULL), RX_OK);
        }
        rx_blur *blur = relative_blur(b->psf);
        float *m = calloc(AREA, sizeof *m), *r = calloc(AREA, sizeof *r), *w = calloc(AREA, sizeof *w);
        if (k < 4)
            memset(b->mask, 0, sizeof b->mask);
        b->mask[40 * WIDTH] = k > 1;
        for (int i = 0; i < 5; i++) /* light beside it, which tells what the mask takes */
            b->f[(40 + i) * WIDTH + 4 - i] = 20;
        for (int i = 0; i < AREA; i++)
            r[i] = fmaxf(b->f[i], 0);
        blur_tile(blur, r, m);
        for (int i = 0; i < AREA; i++) {
            w[i] = b->mask[i] == 0;
            r[i] = (float)(w[i] * (b->x[i] + p) / fmax(m[i] + p, p / 4));
        }
        float *c = adjoint_of(blur, r), *q = adjoint_of(blur, w);
        float *f = calloc(AREA, sizeof *f);
        memcpy(f, b->f, AREA * sizeof *f);
        assert_int_equal(rx_network_optics_step(b->optics, &b->input, p, b->f, b->made, NULL, NULL), RX_OK);
        for (int i = 0; i < AREA; i++) {
            const size_t at = rx_blur_row(blur, i / WIDTH) + (size_t)(i % WIDTH);
            const double share = q[at], gain = fmin(fmax(c[at] / share, 0.25), 4);
            if (fabs(share - RX_RL_SHARE) > 1e-4)
                assert_near(b->made[i], f[i] > 0 && share > RX_RL_SHARE ? f[i] * gain : f[i],
                            2e-4 * (1 + fabs(b->made[i])));
        }
        free(f);
        free(m);
        free(r);
        free(w);
        free(c);
        free(q);
        rx_blur_free(blur);
        bench_free(b);
    }
}

/* K' f of a sky of stars of the target's width is what the tile's varying PSF makes of points. */
static void reblurred_by_a_varying_psf(void **state)
{
    bench *b = bench_new(4, 0.2);
    rx_blur *blur = NULL;
    rx_psf *target = rx_stamp_gauss(2);
    float *points = calloc(AREA, sizeof *points);
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
    assert_int_equal(rx_network_optics_reblur(b->optics, b->f, b->made, NULL, NULL), RX_OK);
    /* K' has forgotten what the target cannot hold: 0.1 % of the brightest pixel */
    for (int k = 0; k < AREA; k++)
        assert_near(b->made[k], dst[k], 0.25);
    free(src);
    free(dst);
    free(points);
    rx_blur_free(blur);
    rx_psf_free(target);
    bench_free(b);
}

/* A star of which the network has lost a fifth gets it back. */
static void step_returns_lost_flux(void **state)
{
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
    assert_int_equal(rx_network_optics_step(b->optics, &b->input, 1, b->f, b->made, NULL, NULL), RX_OK);
    const double flux = sky_sum(&s, b->made, 90.2, 70.7, 15);
    print_message("0.8 of the flux before the step, %.4f after it\n", flux / 1e5);
    assert_near(flux / 1e5, 1, 5e-3);
    sky_free(&s);
    bench_free(b);
}

static void blocks_cover_the_tile(void **state)
{
    for (int width = 1; width < 300; width += 7)
        for (int side = 8; side < 200; side += 36)
            for (int shift = 0; shift < 500; shift = 2 * shift + 8) {
                const rx_blocks b = rx_blocks_make(width, 5, side, side, 8, shift, 0);
                assert_true(b.width <= side);
                assert_true(b.width % 8 == 0);
                assert_true(b.x <= 0);
                assert_true(b.x > -b.width);
                assert_true((b.x + shift) % b.width == 0);
                assert_true(b.x + b.nx * b.width >= width);
                assert_true(b.x + (b.nx - 1) * b.width < width);
                assert_int_equal(b.ny, 1);
                assert_int_equal(b.height, 8);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tikhonov_is_that_of_the_whole), cmocka_unit_test(step_is_the_trained_one),
        cmocka_unit_test(reblurred_by_a_varying_psf),    cmocka_unit_test(step_returns_lost_flux),
        cmocka_unit_test(blocks_cover_the_tile),         cmocka_unit_test(step_by_its_formula),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
