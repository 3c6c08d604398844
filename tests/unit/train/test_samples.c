/* Training images: their noise, their scale, what is told of them, and that they follow from their id alone.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "samples_test.h"

enum { P = 64, N = P * P };

/* (x - v) / sqrt(1 + q v) in classes of v: mean 0, width 1, neighbours independent. */
static void test_noise(void **state)
{
    enum { CLASSES = 4, IMAGES = 40 };
    const double limit[CLASSES + 1] = {0.0, 0.1, 2.0, 20.0, 1e9}, photon = 0.05;
    double n[CLASSES] = {0.0}, sum[CLASSES] = {0.0}, square[CLASSES] = {0.0}, neighbours = 0.0, pairs = 0.0;
    samples_test t = samples_test_open(1.0, 15.0);
    t.par.photon[0] = t.par.photon[1] = photon;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(P);
    for (uint32_t i = 0; i < IMAGES; i++) {
        samples_test_sample(scenes, (rx_sample_id){.bin = i % 7, .index = i}, s);
        double last = 0.0;
        for (int k = 0; k < N; k++) {
            double v = (double)s->blurred[k], z = ((double)s->x[k] - v) / sqrt(1.0 + photon * v);
            int c = 0;
            while (v >= limit[c + 1])
                c++;
            n[c] += 1.0;
            sum[c] += z;
            square[c] += z * z;
            neighbours += k % P > 0 ? z * last : 0.0;
            pairs += k % P > 0;
            last = z;
        }
    }
    for (int c = 0; c < CLASSES; c++) {
        assert_true(n[c] > 1000.0);
        assert_true(fabs(sum[c] / n[c]) < 5.0 / sqrt(n[c]));
        assert_true(fabs(square[c] / n[c] - 1.0) < 5.0 * sqrt(2.0 / n[c]));
    }
    assert_true(fabs(neighbours / pairs) < 5.0 / sqrt(pairs));
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

/* A blank sky: its level and its width show the errors of what is told. */
static void test_errors_told(void **state)
{
    enum { IMAGES = 240 };
    double sky = 0.0, noise = 0.0, width = 0.0, least = 9.0;
    samples_test t = samples_test_open(1.0, 15.0);
    t.config->star_count = t.config->galaxy_count = 0.0;
    t.par.sky_error = 0.5;
    t.par.noise_error = 0.2;
    t.par.psf_error = 0.05;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(P);
    for (uint32_t i = 0; i < IMAGES; i++) {
        samples_test_sample(scenes, (rx_sample_id){.bin = i / 40, .index = i % 40}, s);
        double mean = 0.0, square = 0.0;
        for (int k = 0; k < N; k++) {
            assert_true(s->y[k] == 0.0f);
            assert_true(s->blurred[k] == 0.0f);
            mean += (double)s->x[k] / N;
            square += (double)s->x[k] * (double)s->x[k] / N;
        }
        double told = log(square - mean * mean) / -2.0, fwhm = log((double)s->fwhm / (double)s->true_fwhm);
        sky += pow(mean * exp(told), 2) / IMAGES;
        noise += told * told / IMAGES;
        width += fwhm * fwhm / IMAGES;
        least = fmin(least, fabs(fwhm));
        assert_int_equal(s->nstars, 0);
    }
    const double tolerance = 4.0 / sqrt(2.0 * IMAGES); /* of an rms */
    assert_true(fabs(sqrt(sky) / 0.5 - 1.0) < tolerance);
    assert_true(fabs(sqrt(noise) / 0.2 - 1.0) < tolerance);
    assert_true(fabs(sqrt(width) / 0.05 - 1.0) < tolerance);
    assert_true(least < 0.005);
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

static double gauss_pixel(double x, double sigma)
{
    return 0.5 * (erf((x + 0.5) * M_SQRT1_2 / sigma) - erf((x - 0.5) * M_SQRT1_2 / sigma));
}

/* Around star k of the list: the sharp plane is a Gaussian integrated over pixels, of the listed place and
 * flux; the blurred one holds the same flux, and the S/N of a matched filter is the root of its sum of
 * squares. Returns 0 when something else is near. */
static int check_star(const rx_sample *s, int k, double target)
{
    enum { R = 18 };
    const double x = (double)s->star[k][0], y = (double)s->star[k][1], flux = (double)s->star[k][2];
    const double sigma = target / sqrt(8.0 * log(2.0));
    const int i0 = (int)lround(x), j0 = (int)lround(y);
    double worst = 0.0, light = 0.0, sharp = 0.0, blurred = 0.0, square = 0.0;
    if (i0 < R || j0 < R || i0 >= P - R || j0 >= P - R)
        return 0;
    for (int j = j0 - R; j <= j0 + R; j++)
        for (int i = i0 - R; i <= i0 + R; i++) {
            double seen = (double)s->y[j * P + i], wide = (double)s->blurred[j * P + i];
            double model = flux * gauss_pixel(i - x, sigma) * gauss_pixel(j - y, sigma);
            worst = fmax(worst, fabs(seen - model));
            light += hypot(i - x, j - y) > 5.0 ? seen : 0.0;
            sharp += seen;
            blurred += wide;
            square += wide * wide;
        }
    if (light > 1e-3 * flux)
        return 0;
    assert_true(worst < 2e-4 * flux);
    assert_true(fabs(sharp / flux - 1.0) < 2e-3);
    assert_true(fabs(blurred / flux - 1.0) < 0.04); /* wings beyond 18 pixels, FWHM to 4.4, beta from 3 */
    assert_true(fabs(sqrt(square) / (double)s->star[k][3] - 1.0) < 3e-3);
    return 1;
}

static void test_stars(void **state)
{
    samples_test t = samples_test_open(1.0, 15.0);
    t.config->star_count = 250.0;
    t.config->star_mag.v[1] = 16.0;
    t.config->galaxy_count = 0.0;
    t.par.front.target_fwhm = 2.2;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *s = samples_test_new(P);
    int checked = 0;
    for (uint32_t i = 0; i < 80; i++) {
        samples_test_sample(scenes, (rx_sample_id){.bin = i % 2, .index = i / 2}, s);
        for (int k = 0; k < s->nstars; k++) {
            assert_true(k == 0 || s->star[k][2] <= s->star[k - 1][2]);
            for (int c = 0; c < 2; c++) {
                assert_true(s->star[k][c] >= 8.0f);
                assert_true(s->star[k][c] <= P - 9.0f);
            }
            checked += check_star(s, k, t.par.front.target_fwhm);
        }
    }
    assert_true(checked > 10);
    free(s);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

/* --- turns --- */

/* A kernel has to be turned as the planes are: blurring, then turning, is turning, then blurring. */
static void test_turned_kernel_blurs_the_same(void **state)
{
    enum { SIDE = 20 };
    for (int turn = 0; turn < 8; turn++) {
        rx_sample *s;
        assert_int_equal(rx_sample_new(SIDE, &s, NULL), RX_OK);
        const int at = 7 * SIDE + 11;
        s->x[at] = 1.0f;
        for (int j = -3; j <= 3; j++)
            for (int i = -3; i <= 3; i++) {
                float value = (float)(1 + (j + 3) * 7 + i + 3);
                s->kernel[(RX_SAMPLE_KERNEL / 2 + j) * RX_SAMPLE_KERNEL + RX_SAMPLE_KERNEL / 2 + i] = value;
                s->y[at + j * SIDE + i] = value; /* the point blurred */
            }
        assert_int_equal(rx_sample_turn(s, turn, NULL), RX_OK);
        for (int y = 0; y < SIDE; y++)
            for (int x = 0; x < SIDE; x++) {
                if (s->x[y * SIDE + x] != 1.0f)
                    continue;
                for (int j = -3; j <= 3; j++)
                    for (int i = -3; i <= 3; i++)
                        assert_true(s->y[(y + j) * SIDE + x + i] ==
                                    s->kernel[(RX_SAMPLE_KERNEL / 2 + j) * RX_SAMPLE_KERNEL +
                                              RX_SAMPLE_KERNEL / 2 + i]);
            }
        free(s);
    }
}

/* --- ids --- */

static void assert_same(const rx_sample *a, const rx_sample *b)
{
    const size_t plane = N * sizeof(float);
    assert_memory_equal(a, b, offsetof(rx_sample, x));
    assert_memory_equal(a->x, b->x, plane);
    assert_memory_equal(a->w, b->w, plane);
    assert_memory_equal(a->y, b->y, plane);
    assert_memory_equal(a->blurred, b->blurred, plane);
    assert_memory_equal(a->kernel, b->kernel, RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL * sizeof(float));
}

static samples_test with_everything(void)
{
    samples_test t = samples_test_open(1.0, 15.0);
    t.par.sky.density = 3.0;
    t.par.sky.nebulae = 0.5;
    t.par.photon[0] = 1e-3;
    t.par.photon[1] = 0.1;
    t.par.sky_error = 0.03;
    t.par.noise_error = 0.05;
    t.par.psf_error = 0.02;
    t.par.survey = (rx_survey_params){.smoothed = 0.4,
                                      .smoothed_fwhm = {0.0, 3.0},
                                      .resampled = 0.4,
                                      .uneven = 0.5,
                                      .offsets = 0.5,
                                      .sky_offset = 0.3,
                                      .waves = 0.5,
                                      .dark = 0.5,
                                      .defects = 0.5,
                                      .psf = 0.0};
    t.config->pair_share = 0.3;
    t.config->clustering = 0.3;
    return t;
}

/* One by one or all of an epoch together, on one thread or three. */
static void test_any_order_any_thread(void **state)
{
    enum { EPOCHS = 3, IMAGES = 12 };
    samples_test t = with_everything();
    rx_sample *alone = samples_test_new(P), *together[IMAGES];
    rx_samples *one = samples_test_make(&t), *three = NULL;
    assert_int_equal(rx_samples_new(&t.par, &t.grid, t.config, 3, NULL, &three, NULL), RX_OK);
    for (uint32_t epoch = 0; epoch < EPOCHS; epoch++) {
        rx_sample_id id[IMAGES];
        for (uint32_t i = 0; i < IMAGES; i++)
            id[i] = (rx_sample_id){.epoch = epoch, .set = i / 6, .bin = i / 2 * 7 % 25, .index = i};
        assert_int_equal(rx_samples_make(three, id, IMAGES, together, NULL), RX_OK);
        for (int i = IMAGES - 1; i >= 0; i--) {
            samples_test_sample(one, id[i], alone);
            assert_same(alone, together[i]);
            free(together[i]);
        }
    }
    free(alone);
    rx_samples_free(one);
    rx_samples_free(three);
    rx_simulate_config_free(t.config);
}

/* Places of one field serve `uses` epochs: the light of the first two is the same where nothing is cut
 * elsewhere (one place per field), turned and with other noise. Then comes another field, in place of it. */
static void test_uses(void **state)
{
    samples_test t = samples_test_open(5.0, 5.0001);
    t.par.field_side = P;
    t.par.uses = 4;
    rx_samples *scenes = samples_test_make(&t);
    rx_sample *first = samples_test_new(P), *s = samples_test_new(P), *turned = samples_test_new(P);
    samples_test_sample(scenes, (rx_sample_id){.bin = 3}, first);
    for (uint32_t epoch = 1; epoch < 5; epoch++) {
        const rx_sample_id id = {.epoch = epoch, .bin = 3};
        int alike = 0;
        samples_test_sample(scenes, id, s);
        assert_memory_not_equal(s->x, first->x, N * sizeof(float));
        for (int turn = 0; turn < 8; turn++) {
            double off = 0.0, most = 0.0;
            memcpy(turned, s, rx_sample_bytes(P));
            rx_sample_attach(turned);
            assert_int_equal(rx_sample_turn(turned, turn, NULL), RX_OK);
            for (int k = 0; k < N; k++) {
                off = fmax(off, fabs((double)(turned->y[k] - first->y[k])));
                most = fmax(most, (double)first->y[k]);
            }
            alike += off < 1e-4 * most; /* sigma differs by 2e-5 */
            assert_true(turn != 0 || off > 1e-4 * most);
        }
        assert_int_equal(alike, epoch < 4 ? 1 : 0);
    }
    free(first);
    free(s);
    free(turned);
    rx_samples_free(scenes);
    rx_simulate_config_free(t.config);
}

static void test_streams_differ(void **state)
{
    samples_test t = samples_test_open(1.0, 15.0), other = t;
    rx_samples *train = samples_test_make(&t);
    other.par.seed++;
    rx_samples *reseeded = samples_test_make(&other);
    rx_sample *s[4];
    for (int i = 0; i < 4; i++)
        s[i] = samples_test_new(P);
    samples_test_sample(train, (rx_sample_id){.index = 1}, s[0]);
    samples_test_sample(train, (rx_sample_id){.set = RX_SET_TEST, .index = 1}, s[1]);
    samples_test_sample(reseeded, (rx_sample_id){.index = 1}, s[2]);
    samples_test_sample(train, (rx_sample_id){.index = 2}, s[3]); /* the same field, another place */
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++) {
            double product = 0.0;
            for (int k = 0; k < N; k++)
                product += (double)(s[i]->x[k] - s[i]->blurred[k]) * (double)(s[j]->x[k] - s[j]->blurred[k]);
            assert_true(fabs(product) < 5.0 * sqrt(N)); /* of noise that is independent */
            assert_memory_not_equal(s[i]->y, s[j]->y, N * sizeof(float));
        }
    assert_true(s[0]->true_fwhm != s[1]->true_fwhm);
    assert_true(s[0]->true_fwhm != s[2]->true_fwhm);
    assert_true(s[0]->true_fwhm == s[3]->true_fwhm);
    for (int i = 0; i < 4; i++)
        free(s[i]);
    rx_samples_free(train);
    rx_samples_free(reseeded);
    rx_simulate_config_free(t.config);
}

static void test_usage(void **state)
{
    samples_test good = samples_test_open(1.0, 15.0), wide = good;
    rx_samples *scenes = NULL;
    rx_error err = RX_ERROR_NONE;
    wide.par.psf_error = 0.9; /* a PSF of FWHM 8 exp(2.7) pixels fits no patch */
    assert_int_equal(rx_samples_new(&wide.par, &wide.grid, wide.config, 1, NULL, &scenes, &err), RX_USAGE);
    assert_null(scenes);
    assert_non_null(strstr(err.text, "does not fit a patch"));
    scenes = samples_test_make(&good);
    rx_sample *s = NULL;
    const rx_sample_id wrong[] = {{.bin = 25}, {.index = 40}, {.set = 2}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_int_equal(rx_samples_make(scenes, &wrong[i], 1, &s, NULL), RX_USAGE);
    rx_samples_free(scenes);
    rx_simulate_config_free(good.config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {

        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_errors_told),
        cmocka_unit_test(test_stars),
        cmocka_unit_test(test_turned_kernel_blurs_the_same),
        cmocka_unit_test(test_any_order_any_thread),
        cmocka_unit_test(test_uses),
        cmocka_unit_test(test_streams_differ),
        cmocka_unit_test(test_usage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
