/* Noise against the distributions that it claims to follow. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "simulate/noise.h"

/* --- normal deviates --- */

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Number i: radius and angle from its words, in double precision. */
static void test_normals_are_box_muller(void **state)
{
    enum { N = 40000 };
    float *z = malloc(sizeof *z * N);
    rx_noise_normals(9, 8, 0, N, z);
    for (uint64_t i = 0; i < N; i++) {
        uint32_t w[4];
        rx_random_block(9, 8, i / 4, w);
        const uint32_t *pair = w + i % 4 / 2 * 2;
        double r = sqrt(-2.0 * log((pair[0] + 0.5) / 4294967296.0)),
               angle = 2.0 * M_PI * (pair[1] / 4294967296.0);
        double want = r * (i % 2 ? sin(angle) : cos(angle));
        /* near u = 1 the radius is what single precision leaves of 1 - u */
        assert_true(fabs((double)z[i] - want) < (r > 0.05 ? 1e-5 : 5e-3));
    }
    free(z);
}

static void test_normal_moments(void **state)
{
    const long n = 1 << 22;
    float *z = malloc(sizeof *z * (size_t)n);
    double m1 = 0.0, m2 = 0.0, m3 = 0.0, m4 = 0.0, next = 0.0, second = 0.0, row = 0.0, squares = 0.0;
    rx_noise_normals(1, 2, 0, n, z);
    for (long i = 0; i < n; i++) {
        double v = (double)z[i];
        m1 += v, m2 += v * v, m3 += v * v * v, m4 += v * v * v * v;
        if (i >= 1024) {
            next += v * (double)z[i - 1], second += v * (double)z[i - 2], row += v * (double)z[i - 1024];
            squares += (v * v - 1.0) * ((double)z[i - 1] * (double)z[i - 1] - 1.0);
        }
    }
    double root =
        sqrt((double)n); /* widths: 1, sqrt 2, sqrt 15, sqrt 96, and 1 for products; 2 for squares */
    assert_true(fabs(m1) < 4.5 * root);
    assert_true(fabs(m2 - n) < 4.5 * root * sqrt(2.0));
    assert_true(fabs(m3) < 4.5 * root * sqrt(15.0));
    assert_true(fabs(m4 - 3.0 * n) < 4.5 * root * sqrt(96.0));
    assert_true(fabs(next) < 4.5 * root);
    assert_true(fabs(second) < 4.5 * root);
    assert_true(fabs(row) < 4.5 * root);
    assert_true(fabs(squares) < 4.5 * root * 2.0);
    /* Kolmogorov and Smirnov: sqrt(n) D < 2 but once in 3000 */
    qsort(z, (size_t)n, sizeof *z, by_value);
    double distance = 0.0;
    for (long i = 0; i < n; i++) {
        double p = 0.5 * erfc(-(double)z[i] * M_SQRT1_2);
        distance = fmax(distance, fmax(fabs(p - (double)i / n), fabs(p - (i + 1.0) / n)));
    }
    assert_true(distance * root < 2.0);
    /* tails: beyond 4 and beyond 4.9, 266 and 4 of 4 million */
    long beyond = 0;
    for (long i = 0; i < n; i++)
        beyond += fabsf(z[i]) > 4.0f;
    assert_true(fabs(beyond - n * erfc(4.0 * M_SQRT1_2)) < 5.0 * sqrt(n * erfc(4.0 * M_SQRT1_2)));
    assert_true(fabsf(z[0]) > 4.5f);
    assert_true(fabsf(z[n - 1]) > 4.5f);
    assert_true(fabsf(z[0]) < 6.8f);
    assert_true(fabsf(z[n - 1]) < 6.8f);
    free(z);
}

/* Any part of the row of numbers is that part of it; other seeds and streams are other numbers. */
static void test_normals_are_numbered(void **state)
{
    enum { N = 5000 };
    float all[N], part[N];
    rx_noise_normals(4, 5, 0, N, all);
    const int starts[] = {0, 1, 2, 3, 4, 1023, 1024, 1025, 4999};
    for (int s = 0; s < 9; s++) {
        rx_noise_normals(4, 5, (uint64_t)starts[s], N - starts[s], part);
        assert_memory_equal(part, all + starts[s], sizeof(float) * (size_t)(N - starts[s]));
    }
    for (int other = 0; other < 3; other++) {
        double product = 0.0;
        rx_noise_normals(other == 0 ? 5 : 4,
                         other == 1   ? 6
                         : other == 2 ? (uint64_t)5 + ((uint64_t)1 << 56)
                                      : 5,
                         0, N, part);
        for (int i = 0; i < N; i++)
            product += (double)all[i] * (double)part[i];
        assert_true(fabs(product) < 4.5 * sqrt(N));
    }
}

/* --- Poisson deviates --- */

static void test_poisson(void **state)
{
    const double means[] = {0.1, 1.0, 3.7, 9.99, 10.0, 10.5, 33.3, 100.0, 1234.5, 1e5};
    enum { N = 200000, BINS = 60 };
    for (int m = 0; m < 10; m++) {
        double mean = means[m], sum = 0.0, square = 0.0, chi2 = 0.0, width = sqrt(mean);
        long counts[BINS + 2] = {0};
        /* bins of at least one value, from mean - 4.5 width */
        double step = fmax(1.0, floor(9.0 * width / BINS)), low = fmax(0.0, floor(mean - 4.5 * width));
        for (uint64_t i = 0; i < N; i++) {
            double k = rx_noise_poisson(mean, 3, (uint64_t)m, i);
            assert_true(k >= 0.0);
            assert_true(k == floor(k));
            sum += k - mean, square += (k - mean) * (k - mean);
            double bin = floor((k - low) / step);
            counts[bin < 0.0 ? 0 : bin >= BINS ? BINS + 1 : (int)bin + 1]++;
        }
        assert_true(fabs(sum / N) < 4.5 * width / sqrt(N));
        /* variance of the square: mean + 2 mean^2 */
        assert_true(fabs(square / N - mean) < 4.5 * sqrt((mean + 2.0 * mean * mean) / N));
        int used = 0;
        double rest = 1.0, rest_count = N;
        for (int b = 0; b < BINS; b++) {
            double p = 0.0;
            for (double k = low + b * step; k < low + (b + 1) * step; k++)
                p += exp(k * log(mean) - mean - lgamma(k + 1.0));
            if (p * N < 10.0)
                continue;
            chi2 += pow(counts[b + 1] - p * N, 2) / (p * N);
            used++;
            rest -= p, rest_count -= (double)counts[b + 1];
        }
        if (rest * N > 10.0)
            chi2 += pow(rest_count - rest * N, 2) / (rest * N), used++;
        assert_true(used >= 2);
        assert_true(chi2 < used - 1 + 4.5 * sqrt(2.0 * (used - 1)) + 8.0);
    }
    assert_true(rx_noise_poisson(0.0, 1, 2, 3) == 0.0);
    assert_true(rx_noise_poisson(-5.0, 1, 2, 3) == 0.0);
    assert_true(rx_noise_poisson(NAN, 1, 2, 3) == 0.0);
    assert_true(fabs(rx_noise_poisson(1e14, 1, 2, 3) - 1e14) < 6e7);
    assert_true(rx_noise_poisson(50.0, 1, 2, 3) == rx_noise_poisson(50.0, 1, 2, 3));
}

/* --- exposures --- */

enum { WIDTH = 700, HEIGHT = 500, PIXELS = WIDTH * HEIGHT };

typedef struct exposure {
    float *pixels;
    uint8_t *defects;
} exposure;

static exposure expose(const rx_noise_params *par, float light, int threads)
{
    exposure e = {malloc(sizeof(float) * PIXELS), calloc(PIXELS, 1)};
    for (int i = 0; i < PIXELS; i++)
        e.pixels[i] = light;
    rx_noise_expose(par, WIDTH, HEIGHT, e.pixels, e.defects, threads);
    return e;
}

static void drop(exposure *e)
{
    free(e->pixels);
    free(e->defects);
}

static void mean_and_variance(const float *pixels, double *mean, double *variance)
{
    double sum = 0.0, square = 0.0;
    for (int i = 0; i < PIXELS; i++)
        sum += (double)pixels[i];
    *mean = sum / PIXELS;
    for (int i = 0; i < PIXELS; i++)
        square += ((double)pixels[i] - *mean) * ((double)pixels[i] - *mean);
    *variance = square / PIXELS;
}

/* Variance: photons (sky + light) / gain, and the read noise. */
static void test_ccd_exposure(void **state)
{
    const double cases[][3] = {{2.0, 5.0, 300.0}, {0.5, 0.0, 20.0}, {10.0, 3.0, 0.2}};
    for (int c = 0; c < 3; c++) {
        rx_noise_params par = {.type = RX_NOISE_CCD,
                               .sky = cases[c][2],
                               .gain = cases[c][0],
                               .read_noise = cases[c][1],
                               .saturation = HUGE_VAL,
                               .seed = 7,
                               .stream = 3};
        exposure e = expose(&par, 0.5f, 2);
        double mean, variance, light = cases[c][2] + 0.5;
        double wanted = light / par.gain + pow(par.read_noise / par.gain, 2);
        mean_and_variance(e.pixels, &mean, &variance);
        assert_true(fabs(mean - light) < 4.5 * sqrt(wanted / PIXELS));
        assert_true(fabs(variance / wanted - 1.0) < 4.5 * sqrt(2.2 / PIXELS));
        drop(&e);
    }
}

static void test_saturation(void **state)
{
    rx_noise_params par = {
        .type = RX_NOISE_GAUSS, .sky = 100.0, .sigma = 10.0, .saturation = 110.0, .seed = 2};
    exposure e = expose(&par, 0.0f, 1);
    long full = 0;
    for (int i = 0; i < PIXELS; i++) {
        assert_true(e.pixels[i] <= 110.0f);
        assert_int_equal(e.defects[i], e.pixels[i] == 110.0f ? RX_DEFECT_SATURATED : 0);
        full += e.defects[i] != 0;
    }
    double wanted = 0.158655 * PIXELS; /* beyond one sigma */
    assert_true(fabs(full - wanted) < 4.5 * sqrt(wanted));
    drop(&e);
}

static void test_dead_columns(void **state)
{
    rx_noise_params par = {.type = RX_NOISE_CCD,
                           .sky = 100.0,
                           .gain = 1.0,
                           .saturation = HUGE_VAL,
                           .bad_columns = 0.05,
                           .seed = 2};
    exposure e = expose(&par, 0.0f, 2);
    int dead = 0;
    for (int x = 0; x < WIDTH; x++) {
        dead += e.defects[x] == RX_DEFECT_COLUMN;
        for (int y = 0; y < HEIGHT; y++) {
            assert_int_equal(e.defects[y * WIDTH + x], e.defects[x]);
            assert_true((e.pixels[y * WIDTH + x] == 0.0f) == (e.defects[x] == RX_DEFECT_COLUMN));
        }
    }
    assert_true(fabs(dead - 0.05 * WIDTH) < 4.5 * sqrt(0.05 * WIDTH));
    drop(&e);
}

/* A dark exposure: what is there is cosmic rays. */
static void test_cosmic_rays(void **state)
{
    const double gain = 2.0, rate = 500.0;
    rx_noise_params par = {
        .type = RX_NOISE_CCD, .gain = gain, .saturation = HUGE_VAL, .cosmic_rays = rate, .seed = 4};
    exposure e = expose(&par, 0.0f, 2);
    double charge = 0.0;
    long hit = 0;
    for (int i = 0; i < PIXELS; i++) {
        assert_int_equal(e.defects[i], e.pixels[i] > 0.0f ? RX_DEFECT_COSMIC : 0);
        charge += (double)e.pixels[i] * gain;
        hit += e.defects[i] != 0;
    }
    /* the mean of 1 + 0.15 l is 1.19; the mean path is 4/3 of the depth, 2 pixels of 1200 electrons */
    double hits = rate * PIXELS * 1e-6, wanted = hits * 1.19 * 1200.0 * 2.0 * 4.0 / 3.0;
    assert_true(fabs(charge / wanted - 1.0) < 4.0 * 1.2 / sqrt(hits));
    assert_true(hit > hits);
    assert_true(hit < 6.0 * hits);
    drop(&e);
}

/* Charge is where the track is: in sum, in its centre of gravity, and in no other pixel. */
static void test_one_track(void **state)
{
    const double tracks[][4] = {{10.2, 11.4, 7.3, 4.1},   {10.0, 10.0, 0.0, 0.0}, {20.6, 5.3, -9.9, 0.0},
                                {15.5, 20.5, -3.0, -8.0}, {8.3, 8.4, 0.1, 12.5},  {5.0, 5.0, 10.0, 10.0}};
    for (int t = 0; t < 6; t++) {
        float pixels[40 * 30] = {0.0f};
        uint8_t defects[40 * 30] = {0};
        rx_cosmic_ray ray = {tracks[t][0], tracks[t][1], tracks[t][2], tracks[t][3], 900.0};
        rx_cosmic_ray_add(&ray, 3.0, 40, 30, pixels, defects, 8);
        double sum = 0.0, length = hypot(ray.dx, ray.dy), x = 0.0, y = 0.0;
        for (int i = 0; i < 40 * 30; i++) {
            double u = i % 40 - ray.x, v = i / 40 - ray.y;
            sum += (double)pixels[i], x += (double)pixels[i] * u, y += (double)pixels[i] * v;
            if (pixels[i] > 0.0f) {
                assert_int_equal(defects[i], 8);
                assert_true(length == 0.0 || fabs(u * ray.dy - v * ray.dx) / length < 0.7072);
            }
        }
        assert_true(fabs(sum - 300.0) < 1e-3);
        assert_true(fabs(x / sum - 0.5 * ray.dx) < 0.5);
        assert_true(fabs(y / sum - 0.5 * ray.dy) < 0.5);
    }
    /* runs out of the image */
    float row[5] = {0.0f};
    rx_cosmic_ray out = {3.0, 0.0, 4.0, 0.0, 400.0};
    rx_cosmic_ray_add(&out, 1.0, 5, 1, row, NULL, 0);
    assert_true(fabsf(row[3] - 50.0f) < 1e-3f);
    assert_true(fabsf(row[4] - 100.0f) < 1e-3f);
    assert_true(row[2] == 0.0f);
}

/* Lengths and angles of many: P(length > l) = 1 / (1 + (l / depth)^2)^2. */
static void test_track_distribution(void **state)
{
    enum { N = 20000 };
    const double lengths[] = {0.5, 1.0, 2.0, 5.0, 20.0};
    long longer[5] = {0};
    double cosine = 0.0, sine = 0.0;
    for (uint64_t k = 0; k < N; k++) {
        rx_cosmic_ray ray;
        rx_cosmic_ray_make(1, 2, k, 100, 50, &ray);
        double length = hypot(ray.dx, ray.dy);
        assert_true(ray.x >= -0.5);
        assert_true(ray.x < 99.5);
        assert_true(ray.y >= -0.5);
        assert_true(ray.y < 49.5);
        assert_true(ray.charge > 0.0);
        assert_true(length <= RX_COSMIC_LONGEST * (1.0 + 1e-12));
        cosine += ray.dx / length, sine += ray.dy / length;
        for (int l = 0; l < 5; l++)
            longer[l] += length > lengths[l];
    }
    assert_true(fabs(cosine) < 4.5 * sqrt(0.5 * N));
    assert_true(fabs(sine) < 4.5 * sqrt(0.5 * N));
    for (int l = 0; l < 5; l++) {
        double p = pow(1.0 + pow(lengths[l] / RX_COSMIC_DEPTH, 2), -2);
        assert_true(fabs(longer[l] - p * N) < 4.5 * sqrt(p * (1.0 - p) * N) + 1.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_normals_are_box_muller),
        cmocka_unit_test(test_normal_moments),
        cmocka_unit_test(test_normals_are_numbered),
        cmocka_unit_test(test_poisson),
        cmocka_unit_test(test_ccd_exposure),

        cmocka_unit_test(test_saturation),
        cmocka_unit_test(test_dead_columns),
        cmocka_unit_test(test_cosmic_rays),
        cmocka_unit_test(test_one_track),
        cmocka_unit_test(test_track_distribution),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
