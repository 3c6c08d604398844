/* Rendering and the fit of one source against sums written out as their headers define them. */
#include "../near.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "psf/moffat.h"
#include "psf/psf.h"
#include "template/fit.h"

static const double PI = 3.14159265358979323846;
enum { STAMP = 25 };

/* A Gaussian whose basis k has the width sigma[k]. */
static rx_psf *gauss(const double *sigma, int nbasis)
{
    rx_psf *psf = rx_psf_new(nbasis > 1 ? RX_PSF_PSFEX : RX_PSF_GAUSS, STAMP, nbasis);
    assert_non_null(psf);
    for (int k = 0; k < nbasis * STAMP * STAMP; k++) {
        const double s2 = sigma[k / STAMP / STAMP] * sigma[k / STAMP / STAMP];
        const int i = k % STAMP - STAMP / 2, j = k / STAMP % STAMP - STAMP / 2;
        psf->basis[k] = (float)(exp(-0.5 * (i * i + j * j) / s2) / (2 * PI * s2));
    }
    return psf;
}

/* Pixel (x, y) of a plane: the sum over all frequencies of the profile's transform, or of its derivative
 * `what`, times the Gaussian's. */
static double direct(int n, const rx_spergel *profile, double sigma, double x, double y, int what)
{
    rx_spergel_form form;
    double sum = 0;
    if (profile != NULL)
        rx_spergel_set(profile, &form);
    for (int v = -n / 2 + 1; v < n / 2; v++)
        for (int u = -n / 2 + 1; u < n / 2; u++) {
            const double kx = (double)u / n, ky = (double)v / n;
            double gradient[4], value = 1;
            if (profile != NULL)
                value = rx_spergel_at(&form, kx, ky, gradient);
            sum += (what == 0 ? value : gradient[what - 1]) *
                   exp(-2 * PI * PI * sigma * sigma * (kx * kx + ky * ky)) * cos(2 * PI * (kx * x + ky * y));
        }
    return sum / n / n;
}

static void test_rendering(void **state)
{
    (void)state;
    static const double sigma = 2, dx = 0.3, dy = -0.4;
    const rx_spergel shape = {3, 0.2, -0.3, 0.5, NULL};
    rx_psf *psf = gauss(&sigma, 1);
    rx_template_otf *renderer = NULL;
    rx_template_domain *size = NULL;
    assert_int_equal(rx_template_otf_new(psf, NULL, &renderer, NULL), RX_OK);
    assert_int_equal(rx_template_otf_side(renderer, 5, 0, 0), 40); /* 25 + 4 + 2 * 5 = 39 */
    assert_int_equal(rx_template_otf_side(renderer, 5.1, 0, 0), 44);
    assert_int_equal(rx_template_otf_side(renderer, 13, 0, 0), 56);
    assert_int_equal(
        rx_template_otf_at(renderer, rx_template_otf_side(renderer, 13, 0, 0), 0, 0, &size, NULL), RX_OK);
    const int n = size->n;
    const size_t stride = (size_t)rx_fft_stride_real(size->fft);
    for (int point = 0; point < 2; point++) {
        rx_template_domain_render(size, point ? NULL : &shape, dx, dy, NULL, point ? 1 : 5);
        for (int what = 0; what < (point ? 1 : 5); what++)
            for (int k = 0; k < n * n; k += 37) {
                const int i = k % n, j = k / n;
                const double value =
                    direct(n, point ? NULL : &shape, sigma, i - n / 2 - dx, j - n / 2 - dy, what);
                assert_near(size->plane[what][(size_t)j * stride + (size_t)i], value, 2e-7);
            }
    }
    /* some rows only, of a point columns, too: the same there */
    float *all = RX_NEW(float, (size_t)n *stride);
    assert_non_null(all);
    memcpy(all, size->plane[0], (size_t)n * stride * sizeof *all);
    size->first = 20;
    size->last = 31;
    for (size_t k = 0; k < (size_t)n * stride; k++)
        size->plane[0][k] = 7;
    rx_template_domain_render(size, NULL, dx, dy, NULL, 1);
    for (int j = 20; j < 31; j++)
        for (int i = 20; i < 31; i++)
            assert_near(size->plane[0][(size_t)j * stride + (size_t)i], all[(size_t)j * stride + (size_t)i],
                        1e-8);
    free(all);
    rx_template_otf_free(renderer);
    rx_psf_free(psf);
}

/* An exponential disk holds half of its light within 1.67835 scale lengths; gradients against differences. */
static void test_spergel(void **state)
{
    (void)state;
    const rx_spergel p = {2.5, 0.2, -0.1, 0.3, NULL};
    rx_spergel_form form;
    double slope, gradient[4];
    assert_near(rx_spergel_half_light(0.5, &slope), 1.67834699, 1e-4);
    const double numeric =
        (log(rx_spergel_half_light(1.501, NULL)) - log(rx_spergel_half_light(1.499, NULL))) /
        (log(2.501) - log(2.499));
    rx_spergel_half_light(1.5, &slope);
    assert_near(slope, numeric, 1e-6);
    rx_spergel_set(&p, &form);
    assert_near(rx_spergel_at(&form, 0, 0, NULL), 1, 1e-15);
    rx_spergel_at(&form, 0.11, -0.07, gradient);
    for (int k = 0; k < 4; k++) {
        double at[2];
        for (int side = 0; side < 2; side++) {
            const double step = side ? 1e-5 : -1e-5;
            rx_spergel q = p;
            q.radius *= k == 0 ? exp(step) : 1;
            q.g1 += k == 1 ? step : 0;
            q.g2 += k == 2 ? step : 0;
            q.nu = k == 3 ? expm1(log1p(q.nu) + step) : q.nu;
            rx_spergel_set(&q, &form);
            at[side] = rx_spergel_at(&form, 0.11, -0.07, NULL);
        }
        assert_near(gradient[k], (at[1] - at[0]) / 2e-5, 1e-8);
    }
    /* an exponential of scale h has the transform (1 + (2 pi h k)^2)^-3/2 */
    const rx_spergel disk = {1.67834699 * 2, 0, 0, 0.5, NULL};
    rx_spergel_set(&disk, &form);
    const double u = 2 * 3.14159265358979323846 * 2 * 0.1;
    assert_near(rx_spergel_at(&form, 0.06, 0.08, NULL), pow(1 + u * u, -1.5), 1e-4);
}

/* A star that its pixels do not sample: with samples between them it is drawn as it is, wherever in a pixel it lies, and
 * what is barely extended as the star; without, parts of a pixel are off by a thirtieth of the peak. */
static void test_narrow_star(void **state)
{
    (void)state;
    rx_psf *psf = NULL;
    double shape[RX_MOFFAT_SHAPE], worst[3] = {0};
    rx_moffat truth;
    assert_int_equal(rx_psf_moffat(1.5, 3.0, 0.9, 0.6, 41, &psf, NULL), RX_OK);
    rx_moffat_shape(1.5, 3.0, 0.9, 0.6, shape);
    rx_moffat_set(&truth, shape);
    assert_int_equal(rx_psf_fine(psf), 2);
    double sum = 0.0;
    for (int i = 0; i < 41 * 41; i++)
        sum += rx_moffat_pixel(&truth, i % 41 - 20, i / 41 - 20, NULL);
    for (int way = 0; way < 3; way++) { /* the star, almost the star, the star without samples */
        rx_template_otf *renderer = NULL;
        if (way == 2) {
            free(psf->samples);
            psf->samples = NULL;
        }
        assert_int_equal(rx_template_otf_new(psf, NULL, &renderer, NULL), RX_OK);
        for (int k = 0; k < 9; k++) {
            const double dx = -0.45 + 0.3 * (k % 3), dy = 0.4 - 0.35 * (k / 3);
            const rx_spergel dot = {0.01, 0.0, 0.0, 0.5, NULL};
            rx_template_domain *size = NULL;
            assert_int_equal(
                rx_template_otf_at(renderer, rx_template_otf_side(renderer, 1.0, 0, 0), 0, 0, &size, NULL),
                RX_OK);
            rx_template_domain_render(size, way == 1 ? &dot : NULL, dx, dy, NULL, 1);
            const int stride = rx_fft_stride_real(size->fft), middle = size->n / 2;
            for (int j = -12; j <= 12; j++)
                for (int i = -12; i <= 12; i++)
                    worst[way] =
                        fmax(worst[way], fabs((double)size->plane[0][(middle + j) * stride + middle + i] -
                                              rx_moffat_pixel(&truth, i - dx, j - dy, NULL) / sum));
        }
        rx_template_otf_free(renderer);
    }
    const double peak = (double)psf->basis[20 * 41 + 20];
    assert_near(worst[0] / peak, 0.0, 5e-4);
    assert_near(worst[1] / peak, 0.0, 5e-4);
    assert_true(worst[2] > 0.03 * peak);
    rx_psf_free(psf);
}

/* A domain for a patch is smaller, and the same on the patch. */
static void test_domain_of_patch(void **state)
{
    (void)state;
    enum { HALF = 14 };
    const rx_spergel shape = {2.5, 0.3, 0.2, 0.5, NULL};
    rx_psf *psf = NULL;
    rx_template_otf *renderer = NULL;
    rx_template_domain *size = NULL;
    float patch[(2 * HALF + 1) * (2 * HALF + 1)];
    double worst = 0.0;
    assert_int_equal(rx_psf_moffat(4.0, 4.765, 1.0, 0.0, 41, &psf, NULL), RX_OK);
    assert_int_equal(rx_template_otf_new(psf, NULL, &renderer, NULL), RX_OK);
    const int sides[2] = {rx_template_otf_side(renderer, 10, 0, 0),
                          rx_template_otf_side(renderer, 10, 0, HALF)};
    assert_int_equal(sides[0], 72);                                  /* 41 + 4 + 2 * 10 = 65 */
    assert_int_equal(sides[1], 56);                                  /* 14 + 10 + 4 + 21 = 49 */
    assert_int_equal(rx_template_otf_side(renderer, 10, 0, 40), 72); /* never larger */
    for (int k = 0; k < 2; k++) {
        assert_int_equal(rx_template_otf_at(renderer, sides[k], 0, 0, &size, NULL), RX_OK);
        rx_template_domain_render(size, &shape, 0.3, -0.4, NULL, 1);
        const int stride = rx_fft_stride_real(size->fft), low = size->n / 2 - HALF;
        for (int i = 0; i < (2 * HALF + 1) * (2 * HALF + 1); i++) {
            const float value =
                size->plane[0][(low + i / (2 * HALF + 1)) * stride + low + i % (2 * HALF + 1)];
            worst = k == 1 ? fmax(worst, fabs((double)(value - patch[i]))) : 0.0;
            patch[i] = value;
        }
    }
    const double peak = (double)patch[HALF * (2 * HALF + 1) + HALF];
    assert_near(worst / peak, 0.0, 1e-5);
    rx_template_otf_free(renderer);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rendering), cmocka_unit_test(test_spergel),
                                       cmocka_unit_test(test_narrow_star),
                                       cmocka_unit_test(test_domain_of_patch)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
