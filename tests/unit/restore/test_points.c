/* Isolated points: which peaks are taken, each limit from both sides, and what is measured of them, against the
 * sums of restore/points.h. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "../near.h"
#include "restore/points.h"
#include "sky.h"

enum { W = 130, H = 100, R = 3, ACROSS = 8, DOWN = 6, ALL = ACROSS * DOWN };

/* Centres of the grid, the outer ones as near to the border as they may be. */
static const int columns[ACROSS] = {6, 22, 38, 54, 70, 86, 102, W - 7},
                 lines[DOWN] = {6, 22, 38, 54, 70, H - 7};

typedef struct bench {
    sky s;
    rx_psf *psf;
    rx_prepared *prepared;
    rx_blur *blur;
    rx_rl *rl;
} bench;

static bench bench_new(void)
{
    bench b = {.psf = rx_stamp_gauss(2)};
    sky_new(&b.s, W, H);
    const rx_image image = sky_image(&b.s, NULL);
    assert_int_equal(rx_prepared_new(&b.s.par, &image, &b.prepared, NULL), RX_OK);
    assert_int_equal(rx_blur_new(b.psf, W, H, 1, &b.blur, NULL), RX_OK);
    assert_int_equal(rx_rl_new(&(rx_restore_params){.rl_damping = 0}, b.prepared, b.blur, 1, &b.rl, NULL),
                     RX_OK);
    return b;
}

static void bench_free(bench *b)
{
    rx_rl_free(b->rl);
    rx_blur_free(b->blur);
    rx_prepared_free(b->prepared);
    rx_psf_free(b->psf);
    sky_free(&b->s);
}

static float *object(const bench *b, int x, int y)
{
    return b->rl->object + rx_blur_row(b->blur, y) + (size_t)x;
}

static float *data(const bench *b, int x, int y)
{
    return b->prepared->data + (size_t)y * W + (size_t)x;
}

/* exp(-steep d^2) within two pixels, leaning to the right and up: neighbours' mean over the peak is that of the
 * Gaussian. */
static double shape(int i, int j, double steep)
{
    return abs(i) > 2 || abs(j) > 2 ? 0 : exp(-steep * (i * i + j * j)) * (1 + 0.05 * i + 0.03 * j);
}

static void put(bench *b, int x, int y, double height, double steep)
{
    for (int j = -2; j <= 2; j++)
        for (int i = -2; i <= 2; i++)
            *data(b, x + i, y + j) = *object(b, x + i, y + j) = (float)(1 + height * shape(i, j, steep));
}

static double square(double steep)
{
    double sum = 0, sx = 0, sy = 0, ss = 0;
    for (int j = -R; j <= R; j++)
        for (int i = -R; i <= R; i++) {
            const double v = i * i + j * j <= R * R ? shape(i, j, steep) : 0;
            sum += v;
            sx += v * i;
            sy += v * j;
            ss += v * (i * i + j * j);
        }
    return ss / sum - pow(sx / sum, 2) - pow(sy / sum, 2);
}

static double steep_of(double wanted)
{
    double low = 0.01, high = 5;
    for (int k = 0; k < 60; k++) {
        const double middle = (low + high) / 2;
        if (square(middle) > wanted)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* The mean of the eight neighbours of exp(-d^2 / 2). */
static double bluntness(void)
{
    return (4 * exp(-0.5) + 4 * exp(-1)) / 8;
}

static void check_point(const bench *b, const rx_point *p)
{
    double sum = 0, sx = 0, sy = 0, ss = 0;
    for (int j = -R; j <= R; j++)
        for (int i = -R; i <= R; i++) {
            const double v = i * i + j * j <= R * R ? *object(b, p->x + i, p->y + j) - 1.0 : 0;
            sum += v;
            sx += v * i;
            sy += v * j;
            ss += v * (i * i + j * j);
        }
    assert_near(p->flux, sum, 1e-9 * sum);
    assert_near(p->cx, p->x + sx / sum, 1e-9);
    assert_near(p->cy, p->y + sy / sum, 1e-9);
    assert_near(p->square, ss / sum - pow(sx / sum, 2) - pow(sy / sum, 2), 1e-9);
}

static void each_limit_from_both_sides(void **state)
{
    (void)state;
    const double usual = 0.5;
    bench b = bench_new();
    rx_point points[RX_POINTS_MAX];
    int wanted[ALL], n = 0, count = 0, radius = 0;
    double heights[ALL];
    for (int k = 0; k < ALL; k++) {
        wanted[k] = 1;
        heights[k] = k == 41 ? heights[40] : 50 + k * 7 % ALL; /* two are equal */
        put(&b, columns[k % ACROSS], lines[k / ACROSS], heights[k], usual);
    }
#define AT(k, i, j) columns[(k) % ACROSS] + (i), lines[(k) / ACROSS] + (j)
    const float level = (float)(1 + 10 * b.prepared->sigma);
    *object(&b, AT(9, 6, 0)) = (float)(1 + 0.0999 * heights[9]); /* neighbours */
    *object(&b, AT(11, 6, 0)) = (float)(1 + 0.1001 * heights[11]);
    *object(&b, AT(13, 6, 1)) = 900;
    *object(&b, AT(12, -6, 0)) = (float)(1 + 0.1001 * heights[12]);
    *object(&b, AT(2, 0, -3)) = *object(&b, AT(2, -3, 0)) = 3; /* light on the disk's rim */
    *object(&b, AT(3, 0, 3)) = *object(&b, AT(3, 3, 0)) = 3;
    *object(&b, AT(10, 0, -6)) = (float)(1 + 0.1001 * heights[10]);
    wanted[10] = wanted[11] = wanted[12] = 0;
    b.prepared->mask[(lines[1] + 3) * W + columns[7]] = RX_MASK_BAD;     /* k = 15 */
    b.prepared->mask[(lines[1] - 3) * W + columns[6]] = RX_MASK_BAD;     /* k = 14 */
    b.prepared->mask[(lines[2] + 3) * W + columns[1] + 1] = RX_MASK_BAD; /* k = 17: beyond the disk */
    wanted[14] = wanted[15] = 0;
    *data(&b, AT(21, 0, 0)) = level * 0.9997f; /* heights above the sky */
    *data(&b, AT(23, 0, 0)) = level * 1.0003f;
    put(&b, AT(31, 0, 0), level * 0.9997 - 1, usual);
    put(&b, AT(33, 0, 0), level * 1.0003 - 1, usual);
    *data(&b, AT(31, 0, 0)) = *data(&b, AT(33, 0, 0)) = 2 * level;
    for (int k = 31; k < 34; k += 2) /* as blunt as they were */
        for (int i = 0; i < 9; i++)
            if (i != 4)
                *data(&b, AT(k, i % 3 - 1, i / 3 - 1)) = 2 * level;
    wanted[21] = wanted[31] = 0;
    put(&b, AT(25, 0, 0), heights[25], steep_of(1.2995 * square(usual))); /* widths */
    put(&b, AT(27, 0, 0), heights[27], steep_of(1.3005 * square(usual)));
    wanted[27] = 0;
    *object(&b, AT(29, 2, 2)) = *object(&b, AT(29, 0, 0)) * 1.001f; /* a higher one, which the data lack */
    *object(&b, AT(36, -2, -2)) = *object(&b, AT(36, 0, 0)) * 1.001f;
    wanted[29] = wanted[36] = 0;
#undef AT
    for (int k = 0; k < ALL; k++)
        count += wanted[k];
    assert_int_equal(rx_points_find(b.rl, 2.3, 0.1, points, &n, &radius, NULL), RX_OK);
    assert_int_equal(radius, R);
    assert_int_equal(n, count);
    for (int i = 0; i < n; i++) {
        check_point(&b, &points[i]);
        int at = 0;
        for (int k = 0; k < ALL; k++)
            if (columns[k % ACROSS] == points[i].x && lines[k / ACROSS] == points[i].y) {
                assert_true(wanted[k]);
                at++;
            }
        assert_int_equal(at, 1);
        if (i > 0 && points[i].flux == points[i - 1].flux)
            assert_true(points[i].y * W + points[i].x > points[i - 1].y * W + points[i - 1].x);
        else if (i > 0)
            assert_true(points[i].flux < points[i - 1].flux);
    }
    bench_free(&b);
}

/* Peaks a pixel nearer to the border are none. */
static void not_beside_the_border(void **state)
{
    (void)state;
    static const int places[][2] = {{5, 50}, {W - 6, 50}, {60, 5}, {60, H - 6}};
    rx_point points[RX_POINTS_MAX];
    int n = 0, radius = 0;
    bench b = bench_new();
    for (int k = 0; k < 4; k++)
        put(&b, places[k][0], places[k][1], 50, 0.5);
    assert_int_equal(rx_points_find(b.rl, 3, 0.1, points, &n, &radius, NULL), RX_OK);
    assert_int_equal(n, 0);
    put(&b, 60, 50, 50, 0.5);
    assert_int_equal(rx_points_find(b.rl, 0.5, 0.1, points, &n, &radius, NULL), RX_OK);
    assert_int_equal(radius, 2);
    assert_int_equal(n, 5);
    bench_free(&b);
}

/* Of two equal pixels the first one is the peak. */
static void equal_pixels(void **state)
{
    (void)state;
    static const int next[][2] = {{1, 0}, {0, 1}, {1, 1}, {-1, 1}, {2, 0}, {0, 2}, {2, 2}, {-2, 2}};
    for (int k = 0; k < 8; k++) {
        rx_point points[RX_POINTS_MAX];
        int n = 0, radius = 0;
        bench b = bench_new();
        put(&b, 60, 50, 50, 0.5);
        *object(&b, 60 + next[k][0], 50 + next[k][1]) = *object(&b, 60, 50);
        *data(&b, 60 + next[k][0], 50 + next[k][1]) = *data(&b, 60, 50);
        assert_int_equal(rx_points_find(b.rl, 3, 0.01, points, &n, &radius, NULL), RX_OK);
        assert_int_equal(n, 1);
        assert_int_equal(points[0].x, 60);
        assert_int_equal(points[0].y, 50);
        bench_free(&b);
    }
}

/* A higher pixel within two of it, and a peak is none. */
static void higher_neighbours(void **state)
{
    (void)state;
    for (int k = 0; k < 25; k++) {
        const int i = k % 5 - 2, j = k / 5 - 2;
        rx_point points[RX_POINTS_MAX];
        int n = 0, radius = 0;
        bench b = bench_new();
        put(&b, 60, 50, 50, 0.5);
        *object(&b, 60 + i, 50 + j) = *object(&b, 60, 50) * 1.001f;
        assert_int_equal(rx_points_find(b.rl, 3, 0.01, points, &n, &radius, NULL), RX_OK);
        int found = 0;
        for (int p = 0; p < n; p++)
            found += points[p].x == 60 && points[p].y == 50;
        assert_int_equal(found, k == 12);
        bench_free(&b);
    }
}

/* A cosmic ray is sharper in the data than 0.6 of the PSF. */
static void as_blunt_as_the_psf(void **state)
{
    (void)state;
    float stamp[25];
    rx_point points[RX_POINTS_MAX];
    int n = 0, radius = 0;
    bench b = bench_new();
    for (int k = 0; k < 25; k++)
        stamp[k] = (float)(7 * shape(k % 5 - 2, k / 5 - 2, 0.5));
    assert_near(rx_points_bluntness(stamp, 5), bluntness(), 1e-6);
    stamp[0] = 3;
    assert_near(rx_points_bluntness(stamp, 1), 0, 0);
    put(&b, 60, 50, 50, 0.5);
    assert_int_equal(rx_points_find(b.rl, 3, bluntness() / 0.6 * 0.9997, points, &n, &radius, NULL), RX_OK);
    assert_int_equal(n, 1);
    assert_int_equal(rx_points_find(b.rl, 3, bluntness() / 0.6 * 1.0003, points, &n, &radius, NULL), RX_OK);
    assert_int_equal(n, 0);
    bench_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_limit_from_both_sides),
        cmocka_unit_test(not_beside_the_border),
        cmocka_unit_test(equal_pixels),
        cmocka_unit_test(higher_neighbours),
        cmocka_unit_test(as_blunt_as_the_psf),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
