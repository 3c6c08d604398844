/* restore/blur against the defining sum, its adjoint, and its freedom from seams. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "restore/blur.h"
#include "sky.h"

enum { W = 37, H = 26 };

/* A PSF of six terms, degree 2 in x and y, of size 7, with a few negative values. */
static rx_psf *quadratic(void)
{
    static const int px[6] = {0, 1, 0, 2, 1, 0}, py[6] = {0, 0, 1, 0, 1, 2};
    rx_psf *psf = calloc(1, sizeof *psf);
    psf->size = 7;
    psf->nbasis = 6;
    psf->basis = calloc(6 * 49, sizeof(float));
    for (int i = 0; i < 6; i++) {
        psf->px[i] = px[i];
        psf->py[i] = py[i];
        for (int k = 0; k < 49; k++)
            psf->basis[i * 49 + k] =
                (float)((i == 0 ? pixel_gauss(k % 7 - 3, 2.5) * pixel_gauss(k / 7 - 3, 2.5) : 0) +
                        0.003 * rx_random_normal(3, (uint64_t)i, (uint64_t)k));
    }
    psf->x0 = 18;
    psf->y0 = 12.5;
    psf->xs = 18;
    psf->ys = 12.5;
    return psf;
}

static float value(uint64_t stream, int k)
{
    return (float)(1 + rx_random_normal(11, stream, (uint64_t)k));
}

static int clamped(int i, int n)
{
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

/* sum over sky pixels near tile pixel (x, y): PSF_sky(pixel - sky) f(sky) */
static double direct(const rx_blur *blur, const rx_psf *psf, const float *sky, int x, int y)
{
    float stamp[49];
    double sum = 0;
    for (int j = y - 3; j <= y + 3; j++)
        for (int i = x - 3; i <= x + 3; i++) {
            rx_psf_at(psf, clamped(i, W), clamped(j, H), stamp);
            sum += (double)stamp[(y - j + 3) * 7 + (x - i + 3)] *
                   sky[rx_blur_row(blur, j) - 3 + (size_t)(i + 3)];
        }
    return sum;
}

static void fill(uint64_t stream, size_t n, float *plane)
{
    for (size_t k = 0; k < n; k++)
        plane[k] = value(stream, (int)k);
}

static double dot(size_t n, const float *a, const float *b)
{
    double sum = 0;
    for (size_t k = 0; k < n; k++)
        sum += (double)a[k] * b[k];
    return sum;
}

static void check_operator(const rx_psf *psf, int varies)
{
    rx_blur *blur = NULL;
    assert_int_equal(rx_blur_new(psf, W, H, 2, &blur, NULL), RX_OK);
    assert_int_equal(blur->kernel.varies, varies);
    float *f = rx_blur_sky(blur), *ktr = rx_blur_sky(blur);
    float kf[W * H], r[W * H];
    fill(0, rx_blur_sky_size(blur), f);
    fill(1, W * H, r);
    rx_blur_plane(blur, f, kf);
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            assert_near(kf[y * W + x], direct(blur, psf, f, x, y), 3e-5);
    rx_blur_adjoint_plane(blur, r, ktr);
    const double left = dot(W * H, kf, r), right = dot(rx_blur_sky_size(blur), f, ktr);
    assert_near(left, right, 1e-5 * fabs(left));
    free(f);
    free(ktr);
    rx_blur_free(blur);
}

static void varying_is_exact(void **state)
{
    rx_psf *psf = quadratic();
    check_operator(psf, 1);
    rx_psf_free(psf);
}

static void constant_is_exact(void **state)
{
    rx_psf *psf = quadratic();
    psf->nbasis = 1;
    check_operator(psf, 0);
    /* terms that do not count are left out */
    psf->nbasis = 3;
    for (int k = 49; k < 3 * 49; k++)
        psf->basis[k] *= 1e-7f;
    check_operator(psf, 0);
    rx_psf_free(psf);
}

/* Points all along a row: each is blurred by the PSF of its own place, between one pixel
 * and the next nothing jumps (blocks of one PSF each would). */
static void no_seams(void **state)
{
    enum { LONG = 200 };
    rx_psf *psf = sky_psf_varying(3, 0.3, LONG);
    const int size = psf->size, r = size / 2;
    float *stamp = calloc((size_t)size * (size_t)size, sizeof(float));
    rx_blur *blur = NULL;
    assert_int_equal(rx_blur_new(psf, LONG, 40, 1, &blur, NULL), RX_OK);
    assert_true(blur->tile_x.n > 1);
    float *f = rx_blur_sky(blur), *kf = calloc(LONG * 40, sizeof *kf);
    float last = 0, before = 0;
    for (int x = 0; x < LONG; x++) {
        f[rx_blur_row(blur, 20) + (size_t)x] = 1;
        rx_blur_plane(blur, f, kf);
        f[rx_blur_row(blur, 20) + (size_t)x] = 0;
        rx_psf_at(psf, x, 20, stamp);
        for (int i = 0; i < size; i++)
            if (x + i - r >= 0 && x + i - r < LONG)
                assert_near(kf[20 * LONG + x + i - r], stamp[r * size + i], 1e-6);
        const float peak = kf[20 * LONG + x];
        if (x > 1) /* the PSF is linear in x, so is its peak: steps would show in the second difference */
            assert_true(fabsf(peak - 2 * last + before) < 1e-5f * peak);
        before = last;
        last = peak;
    }
    free(stamp);
    free(f);
    free(kf);
    rx_blur_free(blur);
    rx_psf_free(psf);
}

/* A constant PSF in many blocks, against the defining sum: borders, corners and seams alike. */
static void blocks_are_exact(void **state)
{
    enum { WIDE = 1300, HIGH = 300 };
    rx_psf *psf = quadratic();
    rx_blur *blur = NULL;
    psf->nbasis = 1;
    assert_int_equal(rx_blur_new(psf, WIDE, HIGH, 2, &blur, NULL), RX_OK);
    assert_true(blur->tile_x.n > 2);
    float *f = rx_blur_sky(blur), *kf = calloc(WIDE * HIGH, sizeof *kf);
    fill(2, rx_blur_sky_size(blur), f);
    rx_blur_plane(blur, f, kf);
    for (int y = 0; y < HIGH; y += y < HIGH - 13 ? 13 : 1)
        for (int x = 0; x < WIDE; x++) {
            double sum = 0;
            for (int k = 0; k < 49; k++)
                sum +=
                    (double)psf->basis[k] * f[rx_blur_row(blur, y - k / 7 + 3) - 3 + (size_t)(x + 6 - k % 7)];
            assert_near(kf[y * WIDE + x], sum, 3e-5);
        }
    free(f);
    free(kf);
    rx_blur_free(blur);
    rx_psf_free(psf);
}

/* One block and many, constant and varying: the same bytes from 1 to 5 threads. */
static void check_threads(const rx_psf *psf, int width, int height)
{
    float *first[2] = {NULL, NULL};
    for (int n = 1; n <= 5; n += n < 3 ? 1 : 2) {
        rx_blur *blur = NULL;
        assert_int_equal(rx_blur_new(psf, width, height, n, &blur, NULL), RX_OK);
        const size_t tile = (size_t)width * (size_t)height, sky = rx_blur_sky_size(blur);
        float *f = rx_blur_sky(blur), *kf = calloc(tile, sizeof *kf), *ktr = rx_blur_sky(blur);
        fill(0, sky, f);
        rx_blur_plane(blur, f, kf);
        rx_blur_adjoint_plane(blur, kf, ktr);
        free(f);
        if (n == 1) {
            first[0] = kf;
            first[1] = ktr;
        } else {
            assert_memory_equal(kf, first[0], tile * sizeof(float));
            assert_memory_equal(ktr, first[1], sky * sizeof(float));
            free(kf);
            free(ktr);
        }
        rx_blur_free(blur);
    }
    free(first[0]);
    free(first[1]);
}

static void threads(void **state)
{
    rx_psf *psf = quadratic();
    for (psf->nbasis = 6; psf->nbasis > 0; psf->nbasis -= 5) {
        check_threads(psf, W, H);
        check_threads(psf, 700, 650);
    }
    rx_psf_free(psf);
}

static void refuse(const rx_psf *psf, int width, int height, const char *text)
{
    rx_blur *blur = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_blur_new(psf, width, height, 1, &blur, &err), RX_INPUT);
    assert_null(blur);
    assert_non_null(strstr(err.text, text));
}

static void refuses(void **state)
{
    rx_psf *psf = quadratic();
    refuse(NULL, W, H, "no PSF");
    refuse(psf, 6, H, "larger than the tile");
    refuse(psf, W, 6, "larger than the tile");
    psf->basis[60] = NAN;
    refuse(psf, W, H, "not finite");
    psf->basis[60] = 0;
    memset(psf->basis, 0, 49 * sizeof(float));
    refuse(psf, W, H, "no flux");
    psf->basis[24] = 1;
    psf->size = 6;
    refuse(psf, W, H, "odd");
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(varying_is_exact), cmocka_unit_test(constant_is_exact), cmocka_unit_test(no_seams),
        cmocka_unit_test(blocks_are_exact), cmocka_unit_test(threads),           cmocka_unit_test(refuses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
