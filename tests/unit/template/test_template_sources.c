/* First guesses, what is told of a source and what is learnt from all, against formulas written out. */
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
#include "num/lsq.h"
#include "template/fit_sources.h"
#include "template/prior.h"
#include "template/refine.h"

enum { W = 120, H = 110 };

/* A resolved source, one that is not, and one found on untouched pixels. */
static void test_guess(void **state)
{
    (void)state;
    static uint8_t hidden[W * H];
    field f;
    rx_fit_source s[3];
    field_open(&f, W, H, 5, 1, 3);
    field_restore_none(&f);
    f.restored->psf->fwhm = 3;
    for (int i = 0; i < 3;
         i++) { /* second moments 9 and 4 above those of the restored PSF, 3 and 2 of the other */
        const double blur = pow((i == 2 ? 5 : 3) / sqrt(8 * log(2)), 2);
        field_list(&f, 30.2 + 30 * i, 40.7, 5, i == 1 ? 1 : sqrt(9 + blur), i == 1 ? 1 : sqrt(4 + blur), 0.7);
    }
    f.sources->list[2].untouched = 1;
    for (int k = 0; k < W * H; k++) {
        f.restored->pixels[k] = (float)rx_random_uniform(1, 1, (uint64_t)k);
        f.restored->mask[k] = k % 7 == 0;
        hidden[k] = k % 5 == 0 ? 2 : 1;
    }
    rx_tphot_params par = rx_tphot_defaults();
    rx_tphot_input input = field_input(&f);
    input.shape_mask = hidden;
    input.shape_bits = 2;
    rx_fit_sources_start(&par, &input, s);
    for (int i = 0; i < 3; i++) {
        double flux = 0;
        for (int k = 0; k < W * H; k++)
            flux += f.sources->segments[k] == i + 1 && k % 7 != 0 && k % 5 != 0
                        ? (double)f.restored->pixels[k]
                        : 0;
        assert_close(s[i].flux, flux, 1e-6);
        assert_near(s[i].x, 30.2 + 30 * i, 1e-12);
        assert_near(s[i].y, 40.7, 1e-12);
        assert_near(s[i].x0, s[i].x, 0);
        assert_near(s[i].y0, s[i].y, 0);
        assert_near(s[i].star + s[i].lift + s[i].shape_error, 3, 0);
        assert_near(s[i].point, i == 1, 0);
        assert_int_equal(s[i].kind, i == 1 ? RX_TPHOT_POINT : RX_TPHOT_PROFILE);
        assert_near(s[i].guess, i == 1 ? 0 : 1.3 * sqrt(2 * log(2)) * sqrt(6), 1e-9);
        assert_near(s[i].profile.radius, s[i].guess, 0);
        assert_near(s[i].profile.g1, i == 1 ? 0 : 0.2 * cos(1.4), 1e-9); /* q = 2/3 */
        assert_near(s[i].profile.g2, i == 1 ? 0 : 0.2 * sin(1.4), 1e-9);
        assert_near(s[i].profile.nu, 0.5, 0);
    }
    const rx_fit_source extra = rx_fit_source_added(3.25, 7.5, 4);
    assert_near(extra.x, 3.25, 0);
    assert_near(extra.y, 7.5, 0);
    assert_near(extra.x0, 3.25, 0);
    assert_near(extra.y0, 7.5, 0);
    assert_int_equal(extra.flags, RX_TPHOT_EXTRA);
    /* shapes that are given stay, in the form of the profile */
    rx_tphot_source given[3] = {{.kind = RX_TPHOT_PROFILE,
                                 .x = 31,
                                 .y = 42,
                                 .radius = 2.5,
                                 .ratio = 0.5,
                                 .angle = 0.4,
                                 .index = 1.2,
                                 .star = 0.25,
                                 .point = 0.125,
                                 .shape_error = 1.5,
                                 .lift = 1.1,
                                 .chi2_gain = 77}};
    given[1] = (rx_tphot_source){.kind = RX_TPHOT_POINT, .x = 61, .y = 43, .ratio = 1, .index = 0.75};
    const rx_tphot shapes = {.n = 3, .nlisted = 3, .list = given};
    input.shapes = &shapes;
    rx_fit_sources_start(&par, &input, s);
    assert_int_equal(s[1].kind, RX_TPHOT_POINT);
    assert_near(s[1].profile.radius, 0, 0);
    assert_near(s[1].profile.nu, 0.75, 0);
    const double want[] = {31, 42, 31, 42, 2.5, cos(0.8) / 3, sin(0.8) / 3, 1.2, 0.25, 0.125, 1.5, 1.1, 77};
    const double got[] = {s->x,           s->y,          s->x0,         s->y0,   s->profile.radius,
                          s->profile.g1,  s->profile.g2, s->profile.nu, s->star, s->point,
                          s->shape_error, s->lift,       s->chi2_gain};
    for (size_t k = 0; k < sizeof want / sizeof *want; k++)
        assert_near(got[k], want[k], 1e-12);
    field_close(&f);
}

/* What is told of a subject with a footprint of 9 x 7 pixels, some of them hidden. */
static void test_told(void **state)
{
    (void)state;
    field f;
    rx_fit_image canvas;
    field_open(&f, W, H, 3, 1, 1);
    field_list(&f, 50, 60, 2, 1, 1, 0);
    float values[63];
    for (int k = 0; k < 63; k++)
        values[k] = (float)(0.005 + 0.09 * rx_random_uniform(6, 1, (uint64_t)k) * (k % 3 == 0));
    float most = 0;
    for (int k = 0; k < 63; k++)
        most = fmaxf(most, values[k]);
    values[5] = 0.10005f * most; /* bright, hardly */
    for (int k = 0; k < W * H; k++) {
        f.pixels[k] = (float)(20 * rx_random_normal(6, 2, (uint64_t)k));
        f.sigma[k] = (float)(1 + rx_random_uniform(6, 3, (uint64_t)k));
        f.mask[k] = k % 5 == 0;
    }
    f.sources->segments[58 * W + 47] = 9; /* a neighbour's */
    const rx_tphot_input input = field_input(&f);
    rx_fit_image_open(&input, (size_t)W * H, 1, &canvas);
    assert_int_equal(rx_fit_image_load_rows(&canvas, 0, H, NULL), RX_OK);
    rx_fit_source s = {
        .kind = RX_TPHOT_PIXELS,
        .x = 50.3,
        .y = 60.2,
        .profile = {2.5, 0.2 * cos(1.4), 0.2 * sin(1.4), 1.2},
        .flux = 300,
        .lift = 1.25,
        .star = 0.1,
        .point = 0.3,
        .chi2_gain = 55,
        .shape_error = 1.5,
        .presence = 44,
        .position_gain = 1.6,
        .segment = 1,
        .flags = RX_TPHOT_BOUND,
        .footprint = {.x0 = 46, .y0 = 57, .width = 9, .height = 7, .values = values, .inside = 0.75}};
    const rx_joint_member m = {.variance = 400, .alone = 225};
    for (int turn = 0; turn < 3; turn++) { /* with a profile; a point; a flux below what its climb may be */
        rx_tphot_source t = {0};
        double chi2 = 0, masked = 0, peak = 0;
        int n = 0;
        s.kind = turn == 1 ? RX_TPHOT_POINT : RX_TPHOT_PIXELS;
        s.flux = turn == 2 ? 20 : 300;
        rx_fit_source_result(&canvas, f.sources->segments, &s, &m, 0.7, &t);
        for (int k = 0; k < 63; k++)
            peak = fmax(peak, values[k]);
        for (int k = 0; k < 63; k++) {
            const int p = (57 + k / 9) * W + 46 + k % 9, owner = f.sources->segments[p];
            masked += f.mask[p] ? (double)values[k] : 0;
            if (f.mask[p] || (owner != 1 && (owner != 0 || values[k] < 0.1 * peak)))
                continue;
            chi2 += pow((f.pixels[p] - 0.7) / f.sigma[p], 2);
            n++;
        }
        const double climb = turn == 2 ? 0.5 * 15 : 0.5 * 1.6 * 225 / 300; /* at most half of the error */
        const double want[] = {50.3,
                               60.2,
                               1.25 * (s.flux - climb),
                               30,
                               1.25 * (s.flux - climb) / 30,
                               0.1,
                               0.3,
                               55,
                               turn == 1 ? 0 : 2.5,
                               2.0 / 3,
                               0.7,
                               1.2,
                               1.5,
                               1.25,
                               44,
                               0.75,
                               0.7,
                               masked,
                               chi2 / (n - (turn == 1 ? 3 : 7))};
        const double got[] = {t.x,         t.y,      t.flux,       t.fluxerr, t.snr,   t.star,        t.point,
                              t.chi2_gain, t.radius, t.ratio,      t.angle,   t.index, t.shape_error, t.lift,
                              t.evidence,  t.inside, t.background, t.masked,  t.chi2};
        for (size_t k = 0; k < sizeof want / sizeof *want; k++)
            assert_near(got[k], want[k], 1e-6 * fabs(want[k]));
        assert_int_equal(t.npixels, n);
        assert_int_equal(t.kind, s.kind);
        assert_int_equal(t.flags, RX_TPHOT_BOUND | RX_TPHOT_BORDER | (masked > 0.1 ? RX_TPHOT_MASKED : 0));
    }
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

/* What has been learnt is where another step leads to: laws by least squares over what each source is under
 * the law, with the start as five sources more. */
static void test_learnt(void **state)
{
    (void)state;
    enum { N = 300, ROWS = N + 2 };
    static rx_prior_sample cases[N];
    static double a[ROWS * 2], b[ROWS], w[ROWS], rest[N];
    for (uint64_t i = 0; i < N; i++) {
        const double flux = 100 * pow(8, rx_random_uniform(3, 1, i)), u = log(flux / 224);
        cases[i] =
            (rx_prior_sample){.flux = flux, .snr = flux / 5, .evidence = 8 * rx_random_normal(3, 6, i)};
        cases[i].radius = (rx_likelihood){0.7 + 0.4 * u + 0.5 * rx_random_normal(3, 2, i), 1 / 0.04};
        cases[i].nu = (rx_likelihood){0.2 + 0.6 * rx_random_normal(3, 3, i), i % 9 == 0 ? 0 : 1 / 0.04};
    }
    const rx_tile_prior begin = rx_tile_prior_start(4);
    assert_near(begin.star_odds, 1, 0);
    assert_near(begin.radius.mean, log(0.6 * 4), 1e-12);
    assert_near(begin.radius.width, 1, 0);
    assert_near(begin.nu.mean, log(1.5), 1e-12);
    assert_near(begin.nu.width, 0.5, 0);
    rx_tile_prior usual = begin;
    rx_tile_prior_fit(cases, N, 0.7, 4, &usual);
    assert_near(rx_prior_scaling_mean(&usual, &usual.radius, 150),
                usual.radius.mean + usual.radius.slope * (log(150) - usual.pivot), 1e-12);
    double sum = 0, clear = 0, points = 1, others = 1;
    for (int of_nu = 0; of_nu < 2; of_nu++) {
        const rx_prior_scaling *law = of_nu ? &usual.nu : &usual.radius,
                               *start = of_nu ? &begin.nu : &begin.radius;
        const double width = law->width / (of_nu ? 1 : 1.4); /* used 1.4 times as wide */
        double x[2], c[4], total = 5, square = 5 * start->width * start->width;
        memset(a, 0, sizeof a);
        for (int i = 0; i < N; i++) {
            const rx_likelihood *word = of_nu ? &cases[i].nu : &cases[i].radius;
            const int used = cases[i].snr > 15 && cases[i].snr < 150 && word->precision > 0;
            const double odds = usual.star_odds * exp(0.5 * 0.7 - 0.5 * cases[i].evidence),
                         u = log(cases[i].flux) - usual.pivot;
            const double precision = word->precision + 1 / width / width;
            if (of_nu == 0 && used) {
                sum += log(cases[i].flux);
                clear++;
                points += odds / (1 + odds);
                others += 1 / (1 + odds);
            }
            a[2 * i] = 1;
            a[2 * i + 1] = of_nu ? 0 : u;
            b[i] = (word->precision * word->mean + (law->mean + law->slope * u) / width / width) / precision;
            w[i] = used ? 1 / (1 + odds) : 0;
            rest[i] = 1 / precision;
        }
        a[2 * N] = a[2 * N + 3] = 1;
        b[N] = start->mean;
        b[N + 1] = 0;
        w[N] = 5;
        w[N + 1] = pow(start->width / 0.3, 2);
        assert_int_equal(rx_lsq_linear(&(rx_lsq_equations){ROWS, 2, a, b, w}, x, c, NULL, NULL), RX_OK);
        assert_near(law->mean, x[0], 1e-6);
        assert_near(law->slope, x[1], 1e-6);
        for (int i = 0; i < N; i++) {
            total += w[i];
            square += w[i] * (rest[i] + pow(b[i] - x[0] - x[1] * a[2 * i + 1], 2));
        }
        assert_near(width, sqrt(square / total), 1e-6);
    }
    assert_near(usual.pivot, sum / clear, 1e-12);
    assert_near(usual.star_odds, points / others, 1e-6);
    assert_true(usual.star_odds > 0.3);
    assert_near(rx_point_probability(3, 1), 1 / (1 + exp(1)), 1e-12);
    assert_near(rx_point_probability(-200, 0), 1 / (1 + exp(-40)), 1e-15);
    const rx_likelihood word = rx_likelihood_of(1.5, 0.1, 0.3, 0.7);
    assert_near(word.precision, 10 - 1 / 0.49, 1e-12);
    assert_near(word.mean, (15 - 0.3 / 0.49) / (10 - 1 / 0.49), 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_guess), cmocka_unit_test(test_told),
                                       cmocka_unit_test(test_learnt)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
