/* Rendering and the fit of one source against sums written out as their headers define them. */
#include "../near.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <gsl/gsl_linalg.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "psf/psf.h"
#include "template/fit.h"
#include "template/spergel.h"
#include "template/template_otf.h"

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

/* Of wings that reach 75 pixels a source needs the part that is above its noise: in a smaller domain, the same values. */
static void test_part_of_a_psf(void **state)
{
    (void)state;
    rx_psf *psf = NULL;
    rx_template_otf *lens = NULL;
    rx_template_domain *size = NULL;
    assert_int_equal(rx_psf_moffat(4, 2.5, 1, 0, 151, &psf, NULL), RX_OK);
    assert_int_equal(rx_template_otf_new(psf, NULL, &lens, NULL), RX_OK);
    const int whole = rx_template_otf_side(lens, 0, 0), side = rx_template_otf_side(lens, 0, 2e-5);
    assert_int_equal(whole, 160);
    assert_in_range(side, 40, 60);
    assert_int_equal(rx_template_otf_side(lens, 0, 1), 32); /* nothing above 1e-3 of the peak is left out */
    assert_int_equal(rx_template_otf_side(lens, 0, 1e-12), whole);
    float *values[2] = {RX_NEW(float, 31 * 31), RX_NEW(float, 31 * 31)};
    assert_non_null(values[0]);
    assert_non_null(values[1]);
    for (int i = 0; i < 2; i++) {
        const int n = i == 0 ? whole : side;
        assert_int_equal(rx_template_otf_at(lens, n, 0, 0, &size, NULL), RX_OK);
        rx_template_domain_render(size, NULL, 0.3, -0.4, NULL, 1);
        for (int k = 0; k < 31 * 31; k++)
            values[i][k] =
                size->plane[0][(n / 2 - 15 + k / 31) * rx_fft_stride_real(size->fft) + n / 2 - 15 + k % 31];
    }
    for (int k = 0; k < 31 * 31; k++)
        assert_near(values[1][k], values[0][k], 1e-5);
    free(values[0]);
    free(values[1]);
    rx_template_otf_free(lens);
    rx_psf_free(psf);
}

static void test_rendering(void **state)
{
    (void)state;
    static const double sigma = 2, dx = 0.3, dy = -0.4;
    const rx_spergel shape = {3, 0.2, -0.3, 0.5};
    rx_psf *psf = gauss(&sigma, 1);
    rx_template_otf *lens = NULL;
    rx_template_domain *size = NULL;
    assert_int_equal(rx_template_otf_new(psf, NULL, &lens, NULL), RX_OK);
    assert_int_equal(rx_template_otf_side(lens, 5, 0), 40); /* 25 + 4 + 2 * 5 = 39 */
    assert_int_equal(rx_template_otf_side(lens, 5.1, 0), 44);
    assert_int_equal(rx_template_otf_side(lens, 13, 0), 56);
    assert_int_equal(rx_template_otf_at(lens, rx_template_otf_side(lens, 13, 0), 0, 0, &size, NULL), RX_OK);
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
    rx_template_otf_free(lens);
    rx_psf_free(psf);
}

/* PSFs that change along x and y: on a whole pixel each is its stamp at the place, and the kernel takes one to
 * the other. */
static void test_place(void **state)
{
    (void)state;
    static const double wide[3] = {2.2, 2.6, 3}, narrow[3] = {1.5, 1.7, 2};
    static const double at[3][2] = {{10, 20}, {60, 20}, {60, 90}};
    rx_psf *psf[2] = {gauss(wide, 3), gauss(narrow, 3)};
    rx_template_otf *lens = NULL;
    float stamp[STAMP * STAMP];
    for (int k = 0; k < 2; k++) { /* b0 + x/100 (b1 - b0) + y/100 (b2 - b0) */
        const int cells = STAMP * STAMP;
        for (int i = cells; i < 3 * cells; i++)
            psf[k]->basis[i] -= psf[k]->basis[i % cells];
        psf[k]->px[1] = psf[k]->py[2] = 1;
        psf[k]->xs = psf[k]->ys = 100;
    }
    assert_int_equal(rx_template_otf_new(psf[0], psf[1], &lens, NULL), RX_OK);
    for (int place = 0; place < 3; place++) {
        rx_template_domain *size = NULL;
        assert_int_equal(rx_template_otf_at(lens, 48, at[place][0], at[place][1], &size, NULL), RX_OK);
        const rx_matching *matching = rx_template_domain_matching(size);
        const size_t stride = (size_t)rx_fft_stride_real(size->fft);
        for (int turn = 0; turn < 3; turn++) { /* tile's, restored image's, that blurred */
            rx_template_domain_render(size, NULL, 0, 0, turn == 0 ? NULL : matching, 1);
            if (turn == 2)
                rx_template_domain_blur(size, matching);
            rx_psf_at(psf[turn == 1], at[place][0], at[place][1], stamp);
            for (int k = 0; k < STAMP * STAMP; k++) {
                const int i = 24 + k % STAMP - STAMP / 2, j = 24 + k / STAMP - STAMP / 2;
                assert_near(size->plane[0][(size_t)j * stride + (size_t)i], stamp[k],
                            turn == 2 ? 1e-2 * stamp[STAMP * STAMP / 2] : 1e-7);
            }
        }
    }
    rx_template_otf_free(lens);
    rx_psf_free(psf[0]);
    rx_psf_free(psf[1]);
}

enum { HALF = 45, PIXELS = (2 * HALF + 1) * (2 * HALF + 1) };

typedef struct bench {
    rx_psf *psf;
    rx_template_otf *lens;
    rx_template_domain *size;
    rx_patch patch; /* wider than a stretch of the fit's sums */
} bench;

/* Template of the parameters on the patch. */
static void template_of(const bench *b, int n, const double *p, double *t)
{
    const rx_spergel profile = {exp(p[RX_FIT_RADIUS]), p[RX_FIT_G1], p[RX_FIT_G2], exp(p[RX_FIT_NU]) - 1};
    const size_t stride = (size_t)rx_fft_stride_real(b->size->fft);
    rx_template_domain_render(b->size, n == RX_FIT_ALL ? &profile : NULL, p[RX_FIT_X], p[RX_FIT_Y], NULL, 1);
    for (int k = 0; k < PIXELS; k++)
        t[k] = b->size->plane[0][(size_t)(k / b->patch.side + b->size->n / 2 - HALF) * stride +
                                 (size_t)(k % b->patch.side + b->size->n / 2 - HALF)];
}

/* The source of `truth`, flux and all, with noise of mixed weights. */
static void bench_open(bench *b, const double *truth, double noise)
{
    static const double sigma = 1.7;
    b->psf = gauss(&sigma, 1);
    assert_int_equal(rx_template_otf_new(b->psf, NULL, &b->lens, NULL), RX_OK);
    assert_int_equal(rx_template_otf_at(b->lens, rx_template_otf_side(b->lens, 50, 0), 0, 0, &b->size, NULL),
                     RX_OK);
    b->patch = (rx_patch){.side = 2 * HALF + 1, .corner = b->size->n / 2 - HALF};
    b->patch.data = RX_NEW(double, 2 * PIXELS);
    assert_non_null(b->patch.data);
    b->patch.weight = b->patch.data + PIXELS;
    template_of(b, RX_FIT_ALL, truth, b->patch.data);
    for (int k = 0; k < PIXELS; k++) {
        b->patch.weight[k] = k % 41 == 0 ? 0 : 0.5 + rx_random_uniform(2, 1, (uint64_t)k);
        b->patch.data[k] = truth[RX_FIT_FLUX] * b->patch.data[k] +
                           noise * rx_random_normal(2, 2, (uint64_t)k) / sqrt(b->patch.weight[k] + 0.1);
    }
}

static void bench_close(bench *b)
{
    rx_patch_clear(&b->patch);
    rx_template_otf_free(b->lens);
    rx_psf_free(b->psf);
}

/* Sums of w t^2 and w t d. */
static void project(const bench *b, const double *t, double *tt, double *td)
{
    *tt = *td = 0;
    for (int k = 0; k < PIXELS; k++) {
        *tt += b->patch.weight[k] * t[k] * t[k];
        *td += b->patch.weight[k] * t[k] * b->patch.data[k];
    }
}

static double chi2_of(const bench *b, const rx_fit *fit, const double *p, const double *t)
{
    double sum = 0;
    for (int k = 0; k < PIXELS; k++)
        sum += b->patch.weight[k] * pow(b->patch.data[k] - p[RX_FIT_FLUX] * t[k], 2);
    for (int j = 0; j < fit->n; j++)
        sum += fit->width[j] > 0 ? pow((p[j] - fit->prior[j]) / fit->width[j], 2) : 0;
    return sum;
}

/* Derivative of the model by parameter m. A shift by a whole pixel is what the fit takes for its slope, too. */
static void slope_of(const bench *b, const rx_fit *fit, int m, double *slope)
{
    static double t[PIXELS];
    const double h = m == RX_FIT_X || m == RX_FIT_Y ? 1 : 0.02;
    double p[RX_FIT_ALL];
    memset(slope, 0, PIXELS * sizeof *slope);
    if (m == RX_FIT_FLUX) {
        template_of(b, fit->n, fit->p, slope);
        return;
    }
    for (int step = -2; step <= 2; step++) {
        const double factor = h < 1 ? (double[]){1, -8, 0, 8, -1}[step + 2] / 12 : (step % 2) / 2.0;
        memcpy(p, fit->p, sizeof p);
        p[m] += step * h;
        template_of(b, fit->n, p, t);
        for (int k = 0; k < PIXELS; k++)
            slope[k] += fit->p[RX_FIT_FLUX] * factor / h * t[k];
    }
}

static const double TRUTH[RX_FIT_ALL] = {1e5, 0.2, -0.3, 1.1, 0.15, -0.1, 0.4};

/* A fit near the truth, all parameters with a prior but the flux. */
static rx_fit start(int n)
{
    rx_fit fit = {.n = n};
    for (int j = 0; j < RX_FIT_ALL; j++) {
        fit.p[j] = TRUTH[j] + 0.03 * (j + 1);
        fit.prior[j] = TRUTH[j] + (j % 2 ? 0.1 : -0.1);
        fit.width[j] = j == RX_FIT_FLUX ? 0 : 0.003;
    }
    fit.high[RX_FIT_G1] = 0.8;
    fit.low[RX_FIT_G1] = -0.8;
    return fit;
}

/* Without a step: flux, chi2, normal matrix and what is made of it. */
static void test_normal(void **state)
{
    (void)state;
    static double t[PIXELS], g[RX_FIT_ALL][PIXELS];
    bench b;
    bench_open(&b, TRUTH, 1);
    for (int n = RX_FIT_POINT; n <= RX_FIT_ALL; n += RX_FIT_ALL - RX_FIT_POINT) {
        rx_fit fit = start(n);
        double tt, td;
        rx_fit_run(&fit, b.size, &b.patch);
        const rx_spergel profile = rx_fit_profile(&fit);
        assert_near(log(profile.radius), fit.p[RX_FIT_RADIUS], 1e-12);
        assert_near(profile.g1, fit.p[RX_FIT_G1], 0);
        assert_near(profile.g2, fit.p[RX_FIT_G2], 0);
        assert_near(log(1 + profile.nu), fit.p[RX_FIT_NU], 1e-12);
        template_of(&b, n, fit.p, t);
        project(&b, t, &tt, &td);
        assert_close(fit.p[RX_FIT_FLUX], td / tt, 1e-7);
        assert_close(fit.chi2, chi2_of(&b, &fit, fit.p, t), 1e-6);
        gsl_matrix *a = gsl_matrix_alloc((size_t)n, (size_t)n),
                   *inverse = gsl_matrix_alloc((size_t)n, (size_t)n);
        gsl_permutation *order = gsl_permutation_alloc((size_t)n);
        int sign;
        for (int m = 0; m < n; m++)
            slope_of(&b, &fit, m, g[m]);
        for (int m = 0; m < n; m++)
            for (int l = 0; l < n; l++) {
                double sum = m == l && fit.width[m] > 0 ? 1 / (fit.width[m] * fit.width[m]) : 0;
                for (int k = 0; k < PIXELS; k++)
                    sum += b.patch.weight[k] * g[m][k] * g[l][k];
                gsl_matrix_set(a, (size_t)m, (size_t)l, sum);
            }
        for (int m = 0; m < n; m++)
            for (int l = 0; l <= m; l++)
                assert_near(fit.a[m * n + l], gsl_matrix_get(a, (size_t)m, (size_t)l),
                            1e-4 * sqrt(fit.a[m * n + m] * fit.a[l * n + l]));
        gsl_linalg_LU_decomp(a, order, &sign);
        gsl_linalg_LU_invert(a, order, inverse);
        assert_near(rx_fit_log_determinant(&fit), gsl_linalg_LU_lndet(a), 1e-3);
        for (int m = 0; m < n; m++)
            assert_close(rx_fit_variance(&fit, m), gsl_matrix_get(inverse, (size_t)m, (size_t)m), 3e-4);
        gsl_matrix_free(a);
        gsl_matrix_free(inverse);
        gsl_permutation_free(order);
    }
    bench_close(&b);
}

/* Data and priors that pull with 100 sigmas and more: at the end both pull alike. */
static void test_balance(void **state)
{
    (void)state;
    static double t[PIXELS], slope[PIXELS];
    bench b;
    bench_open(&b, TRUTH, 0);
    rx_fit fit = start(RX_FIT_ALL);
    fit.iterations = 40;
    for (int j = 0; j < RX_FIT_ALL; j++) {
        fit.prior[j] = TRUTH[j] + (j > RX_FIT_Y ? 0.1 : 0);
        fit.width[j] = j == RX_FIT_FLUX ? 0 : 3e-4;
    }
    rx_fit_run(&fit, b.size, &b.patch);
    template_of(&b, fit.n, fit.p, t);
    assert_close(fit.chi2, chi2_of(&b, &fit, fit.p, t), 1e-6);
    for (int m = 0; m < RX_FIT_ALL; m++) {
        double data = 0;
        slope_of(&b, &fit, m, slope);
        for (int k = 0; k < PIXELS; k++)
            data += b.patch.weight[k] * slope[k] * (b.patch.data[k] - fit.p[RX_FIT_FLUX] * t[k]);
        const double prior = m == RX_FIT_FLUX ? 0 : (fit.p[m] - fit.prior[m]) / fit.width[m] / fit.width[m];
        print_message("%d: %g of %g sigmas\n", m, (data - prior) / sqrt(fit.a[m * fit.n + m]),
                      prior / sqrt(fit.a[m * fit.n + m]));
        assert_near((data - prior) / sqrt(fit.a[m * fit.n + m]), 0, 0.005);
    }
    bench_close(&b);
}

/* Without priors, and at limits. */
static void test_ends(void **state)
{
    (void)state;
    bench b;
    bench_open(&b, TRUTH, 0);
    rx_fit fit = start(RX_FIT_ALL);
    fit.iterations = 40;
    memset(fit.width, 0, sizeof fit.width);
    rx_fit free_fit = fit;
    rx_fit_run(&free_fit, b.size, &b.patch);
    for (int j = 0; j < RX_FIT_ALL; j++)
        assert_near(free_fit.p[j], TRUTH[j], 1e-4 * fmax(1, TRUTH[j]));
    assert_int_equal(free_fit.at_limit, 0);
    for (int high = 0; high < 2; high++) {
        rx_fit held = fit;
        held.low[RX_FIT_RADIUS] = high ? -1 : 1.3;
        held.high[RX_FIT_RADIUS] = high ? 0.9 : 2;
        rx_fit_run(&held, b.size, &b.patch);
        assert_near(held.p[RX_FIT_RADIUS], high ? 0.9 : 1.3, 0);
        assert_int_equal(held.at_limit, 1 << RX_FIT_RADIUS);
    }
    fit.iterations = 0;
    fit.p[RX_FIT_G1] = 0.6;
    fit.p[RX_FIT_G2] = -0.8;
    rx_fit_run(&fit, b.size, &b.patch);
    assert_near(fit.p[RX_FIT_G1], 0.6 * 0.8, 1e-12);
    assert_near(fit.p[RX_FIT_G2], -0.8 * 0.8, 1e-12);
    assert_int_equal(fit.at_limit, 1 << RX_FIT_G1);
    bench_close(&b);
}

/* The three nodes of the rule, as fit.h has them. */
static void test_nodes(void **state)
{
    (void)state;
    static double t[PIXELS];
    double truth[RX_FIT_ALL];
    bench b;
    memcpy(truth, TRUTH, sizeof truth);
    truth[RX_FIT_FLUX] = 250;
    bench_open(&b, truth, 1);
    rx_fit fit = start(RX_FIT_ALL);
    fit.iterations = 30;
    memcpy(fit.prior, truth, sizeof truth);
    memcpy(fit.width, (double[]){0, 0.5, 0.5, 0.7, 0.2, 0.2, 0.3}, sizeof fit.width);
    rx_fit_run(&fit, b.size, &b.patch);
    gsl_matrix *a = gsl_matrix_alloc(RX_FIT_ALL, RX_FIT_ALL);
    gsl_vector *unit = gsl_vector_calloc(RX_FIT_ALL), *column = gsl_vector_alloc(RX_FIT_ALL);
    for (size_t m = 0; m < RX_FIT_ALL; m++)
        for (size_t l = 0; l < RX_FIT_ALL; l++)
            gsl_matrix_set(a, m, l, fit.a[(m > l ? m : l) * RX_FIT_ALL + (m > l ? l : m)]);
    gsl_vector_set(unit, 0, 1);
    gsl_linalg_HH_solve(a, unit, column);
    const double own = 1 / fit.a[0], shape = gsl_vector_get(column, 0) - own;
    double w[3], flux[3], sum = 0, first = 0, second = 0;
    for (int k = 0; k < 3; k++) {
        double p[RX_FIT_ALL], tt, td;
        const double by = (k - 1) * sqrt(3);
        memcpy(p, fit.p, sizeof p);
        for (size_t j = 1; j < RX_FIT_ALL; j++)
            p[j] += by * gsl_vector_get(column, j) / sqrt(shape);
        template_of(&b, fit.n, p, t);
        project(&b, t, &tt, &td);
        p[RX_FIT_FLUX] = flux[k] = td / tt;
        w[k] = (k == 1 ? 4 : 1) * exp(-0.5 * (chi2_of(&b, &fit, p, t) - fit.chi2 - by * by)) / sqrt(tt);
        sum += w[k];
        first += w[k] * flux[k];
    }
    for (int k = 0; k < 3; k++)
        second += w[k] * pow(flux[k] - first / sum, 2);
    template_of(&b, fit.n, fit.p, t);
    const rx_fit_mean mean = rx_fit_average(&fit, b.size, &b.patch);
    print_message("flux %g -> %g, variance %g -> %g, evidence %g\n", fit.p[0], mean.flux,
                  gsl_vector_get(column, 0), mean.variance, mean.evidence);
    assert_true(fabs(mean.flux - fit.p[0]) > 1);
    assert_close(mean.flux, first / sum, 1e-6);
    assert_close(mean.variance, own + second / sum, 1e-5);
    assert_near(mean.evidence, 2 * log(sum / w[1] * 2 / 3), 1e-5);
    gsl_matrix_free(a);
    gsl_vector_free(unit);
    gsl_vector_free(column);
    /* far from its end it is left as it is */
    fit.iterations = 0;
    fit.p[RX_FIT_RADIUS] += 1;
    rx_fit_run(&fit, b.size, &b.patch);
    const rx_fit_mean left = rx_fit_average(&fit, b.size, &b.patch);
    assert_near(left.flux, fit.p[RX_FIT_FLUX], 0);
    assert_close(left.variance, rx_fit_variance(&fit, RX_FIT_FLUX), 1e-12);
    assert_near(left.evidence, 0, 0);
    bench_close(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rendering), cmocka_unit_test(test_part_of_a_psf),
                                       cmocka_unit_test(test_place),     cmocka_unit_test(test_normal),
                                       cmocka_unit_test(test_balance),   cmocka_unit_test(test_ends),
                                       cmocka_unit_test(test_nodes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
