/* simulate/sky_noise: noise of known correlation gives it back, realisations have it too. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "io/fits_read.h"
#include "simulate/sky_noise.h"

enum { W = 400, H = 360, K = 3, N = W * H, LAGS = RX_NOISE_LAGS };

/* A moving average that is not the same in x and y, nor along the two diagonals. */
static const double KERNEL[K][K] = {{0.1, 0.3, 0.2}, {0.5, 1.0, 0.3}, {0.0, 0.6, 0.4}};

/* Correlation of white noise after that filter: sum_u K(u) K(u + d) / sum K^2. */
static double exact(int dx, int dy)
{
    double sum = 0.0, power = 0.0;
    for (int y = 0; y < K; y++)
        for (int x = 0; x < K; x++) {
            power += KERNEL[y][x] * KERNEL[y][x];
            if (y + dy >= 0 && y + dy < K && x + dx >= 0 && x + dx < K)
                sum += KERNEL[y][x] * KERNEL[y + dy][x + dx];
        }
    return sum / power;
}

typedef struct sky {
    float pixels[N], sigma[N];
    unsigned char used[N];
} sky;

/* Filtered noise whose width grows from left to right, 1 to 3, on a level of half a sigma that the
 * subtraction left; the lower left quarter is a bright source, every 50th pixel is masked. */
static sky *make_sky(int filtered)
{
    sky *dst = RX_NEW(sky, 1);
    assert_non_null(dst);
    double power = 0.0;
    for (int k = 0; k < K * K; k++)
        power += KERNEL[k / K][k % K] * KERNEL[k / K][k % K];
    for (int i = 0; i < N; i++) {
        int x = i % W, y = i / W;
        double value = 0.0;
        for (int k = 0; k < K * K && filtered; k++)
            value += KERNEL[k / K][k % K] / sqrt(power) *
                     rx_random_normal(11, 0, (uint64_t)((y + k / K) * (W + K) + x + k % K));
        if (!filtered)
            value = rx_random_normal(11, 0, (uint64_t)i);
        dst->sigma[i] = 1.0f + 2.0f * (float)x / W;
        dst->pixels[i] = dst->sigma[i] * (float)(value + 0.5);
        dst->used[i] = !(x < W / 2 && y < H / 2) && i % 50 != 0;
        if (!dst->used[i])
            dst->pixels[i] = i % 50 == 0 ? NAN : 1e4f;
    }
    return dst;
}

static rx_sky_noise measure(const sky *src)
{
    const rx_map sigma = rx_map_plane(src->sigma, W);
    rx_sky_noise noise;
    rx_error err = RX_ERROR_NONE;
    if (rx_sky_noise_measure(W, H, src->pixels, &sigma, src->used, &noise, &err) != RX_OK)
        fail_msg("%s", err.text);
    return noise;
}

/* Every lag within 5 errors of what it should be. */
static void near(const rx_sky_noise *noise, double (*expected)(int dx, int dy), double tolerance)
{
    for (int dy = 0; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++)
            assert_near(noise->correlation[dy][dx + LAGS], expected(dx, dy), tolerance);
}

static double white(int dx, int dy)
{
    return dx == 0 && dy == 0 ? 1.0 : 0.0;
}

static void known_filter(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    rx_sky_noise noise = measure(src);
    assert_true(noise.correlated);
    /* 0.74 of the pixels, less 0.006 % beyond 4 sigma */
    assert_in_range(noise.pixels, (int)(0.73 * N), (int)(0.75 * N));
    double sum = 0.0;
    for (int dy = -2; dy <= 2; dy++)
        for (int dx = -2; dx <= 2; dx++)
            sum += exact(dx, dy) * exact(dx, dy);
    assert_near(noise.error, sqrt(sum / (double)noise.pixels), 0.05 * noise.error);
    near(&noise, exact, 5.0 * noise.error);
    assert_near(noise.correlation[0][LAGS], 1.0, 1e-12);
    assert_near(noise.scale, 1.0, 0.01);
    free(src);
}

static void independent_pixels(void **state)
{
    (void)state;
    sky *src = make_sky(0);
    rx_sky_noise noise = measure(src);
    assert_false(noise.correlated);
    near(&noise, white, 5.0 * noise.error);
    assert_near(noise.error, 1.0 / sqrt((double)noise.pixels), 0.01 * noise.error);
    /* what the noise was said to be is not what it is */
    for (int i = 0; i < N; i++)
        src->sigma[i] *= 0.25f;
    assert_near(measure(src).scale, 4.0, 0.03);
    free(src);
}

/* Sources that nobody found and cosmic rays: one pixel in 500 at 8 to 50 sigma. */
static void outliers(void **state)
{
    (void)state;
    sky *src = make_sky(0);
    for (int i = 0; i < N - 1; i += 500) {
        double bright = 8.0 + 42.0 * rx_random_uniform(12, 0, (uint64_t)i);
        src->pixels[i + 7] += (float)bright * src->sigma[i + 7];
        src->pixels[i + 8] += (float)bright * src->sigma[i + 8];
    }
    rx_sky_noise noise = measure(src);
    assert_false(noise.correlated);
    near(&noise, white, 5.0 * noise.error);
    assert_near(noise.scale, 1.0, 0.01);
    free(src);
}

static void same_bytes_whatever_is_hidden(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    rx_sky_noise first = measure(src);
    for (int i = 0; i < N; i++)
        if (!src->used[i])
            src->pixels[i] = i % 3 == 0 ? INFINITY : (float)i;
    rx_sky_noise second = measure(src);
    assert_memory_equal(&first, &second, offsetof(rx_sky_noise, correlated));
    free(src);
}

static void draw(const rx_sky_noise *noise, const float *sigma, uint64_t stream, int nthreads, float *dst)
{
    rx_error err = RX_ERROR_NONE;
    const rx_map map = rx_map_plane(sigma, W);
    if (rx_sky_noise_draw(noise, W, H, &map, 21, stream, nthreads, dst, &err) != RX_OK)
        fail_msg("%s", err.text);
}

/* What is drawn, measured again, with the sigma it was drawn for. */
static rx_sky_noise measure_again(sky *src, const rx_sky_noise *noise)
{
    draw(noise, src->sigma, 0, 2, src->pixels);
    memset(src->used, 1, sizeof src->used);
    return measure(src);
}

static void realisations(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    rx_sky_noise noise = measure(src);
    noise.scale = 1.5;
    rx_sky_noise again = measure_again(src, &noise);
    assert_true(again.correlated);
    assert_near(again.scale, 1.5, 0.015);
    for (int dy = 0; dy <= LAGS; dy++)
        for (int dx = -LAGS; dx <= LAGS; dx++)
            assert_near(again.correlation[dy][dx + LAGS], noise.correlation[dy][dx + LAGS],
                        5.0 * again.error);
    free(src);
    src = make_sky(0);
    noise = measure(src);
    again = measure_again(src, &noise);
    assert_false(again.correlated);
    near(&again, white, 5.0 * again.error);
    assert_near(again.scale, noise.scale, 0.01);
    free(src);
}

/* Opposite edges do not know each other, nor do the members of a series. */
static void no_wrap_no_repetition(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    rx_sky_noise noise = measure(src);
    float *first = RX_NEW(float, N), *second = RX_NEW(float, N);
    double edges = 0.0, members = 0.0, power = 0.0;
    for (int i = 0; i < N; i++)
        src->sigma[i] = 1.0f;
    for (int k = 0; k < 40; k++) {
        draw(&noise, src->sigma, (uint64_t)(2 * k), 1, first);
        for (int y = 0; y < H; y++)
            edges += (double)first[y * W] * first[y * W + W - 1];
    }
    draw(&noise, src->sigma, 1, 1, second);
    for (int i = 0; i < N; i++) {
        members += (double)first[i] * second[i];
        power += (double)first[i] * first[i];
    }
    /* the next pixel would have correlation 0.7 */
    assert_near(edges / (40.0 * H), 0.0, 5.0 * sqrt(2.6 / (40.0 * H)));
    assert_near(members / power, 0.0, 5.0 * noise.error);
    free(first);
    free(second);
    free(src);
}

/* Correlations that no noise can have: 0.9 to the next pixel in x and none to the one after. The variance
 * stays. */
static void impossible_correlation(void **state)
{
    (void)state;
    sky *src = make_sky(0);
    rx_sky_noise noise = {.scale = 1.0, .correlated = 1};
    noise.correlation[0][LAGS] = 1.0;
    noise.correlation[0][LAGS - 1] = noise.correlation[0][LAGS + 1] = 0.9;
    rx_sky_noise again = measure_again(src, &noise);
    assert_near(again.scale, 1.0, 0.01);
    assert_near(again.correlation[1][LAGS], 0.0, 5.0 * again.error);
    /* numpy: P = maximum(1 + 1.8 cos k, 0); mean(P cos k) / mean(P), k = 2 pi arange(10**6) / 10**6 */
    assert_near(again.correlation[0][LAGS + 1], 0.6453, 0.01);
    free(src);
}

static void threads_and_holes(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    rx_sky_noise noise = measure(src);
    float *one = RX_NEW(float, N), *many = RX_NEW(float, N);
    src->sigma[5] = src->sigma[W * 7 + 3] = 0.0f;
    for (int correlated = 0; correlated < 2; correlated++) {
        noise.correlated = correlated;
        draw(&noise, src->sigma, 3, 1, one);
        assert_true(one[5] == 0.0f && one[W * 7 + 3] == 0.0f);
        for (int nthreads = 2; nthreads <= 3; nthreads++) {
            draw(&noise, src->sigma, 3, nthreads, many);
            assert_memory_equal(one, many, N * sizeof(float));
        }
    }
    free(one);
    free(many);
    free(src);
}

static void nothing_to_measure(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    const rx_map sigma = rx_map_plane(src->sigma, W);
    rx_sky_noise noise;
    rx_error err = RX_ERROR_NONE;
    for (int i = 0; i < N; i++)
        src->used[i] = i % 1000 == 1;
    assert_int_equal(rx_sky_noise_measure(W, H, src->pixels, &sigma, src->used, &noise, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "too few"));
    for (int i = 0; i < N; i++) {
        src->used[i] = 1;
        src->pixels[i] = 7.0f * src->sigma[i];
    }
    assert_int_equal(rx_sky_noise_measure(W, H, src->pixels, &sigma, src->used, &noise, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "no noise"));
    free(src);
}

/* Sky that was not quite flat adds to all lags alike, and is not taken for noise. */
static void uneven_sky(void **state)
{
    (void)state;
    sky *src = make_sky(1);
    for (int i = 0; i < N; i++)
        src->pixels[i] += src->sigma[i] * 0.2f * (float)sin(0.03 * (i % W)) * (float)cos(0.03 * (i / W));
    rx_sky_noise noise = measure(src);
    /* 0.2^2 / 4 = 0.01 of the variance, about the same at all lags up to 4 pixels */
    near(&noise, exact, 5.0 * noise.error);
    assert_near(noise.scale, 1.0, 0.01);
    free(src);
}

/* Cut-outs that were resampled, so that their noise is correlated. Expected: the same by numpy,
 *   z = where(segim == 0, fitim / sigma, nan), nine times cut at 4 widths, c(d) = nanmean(z(p) z(p + d)) /
 * c(0), f = mean of c over the outermost of the lags |dx| <= 4, 0 <= dy <= 4; (c - f) / (1 - f) */
static const struct {
    const char *name;
    double scale, right, up, diagonal, other_diagonal, right2;
} resampled[] = {
    {"pairs/SDSS/G266662", 0.9677, 0.2947, 0.2833, 0.1076, 0.0749, -0.1113},
    {"pairs/KiDS/G265911", 0.9840, 0.2675, 0.2757, 0.0790, 0.0871, -0.1325},
};

static float *read_part(const char *folder, const char *name, const char *part, int *width, int *height)
{
    char path[4096];
    float *pixels = NULL;
    snprintf(path, sizeof path, "%s/%s%s.fits", folder, name, part);
    if (rx_fits_read_image(path, &pixels, width, height, NULL) != RX_OK)
        return NULL;
    return pixels;
}

static void resampled_images(void **state)
{
    (void)state;
    const char *folder = getenv("RX_SHARED_DATA");
    for (size_t k = 0; k < sizeof resampled / sizeof *resampled; k++) {
        int width = 0, height = 0;
        float *pixels = read_part(folder != NULL ? folder : "", resampled[k].name, "fitim", &width, &height);
        if (pixels == NULL) {
            printf("# %s is absent: skipped\n", resampled[k].name);
            skip();
        }
        float *sigma = read_part(folder, resampled[k].name, "sigma", &width, &height);
        float *segments = read_part(folder, resampled[k].name, "segim", &width, &height);
        assert_true(sigma != NULL && segments != NULL);
        const size_t n = (size_t)width * (size_t)height;
        unsigned char *used = RX_NEW(unsigned char, n);
        for (size_t i = 0; i < n; i++)
            used[i] = segments[i] == 0.0f;
        const rx_map map = rx_map_plane(sigma, width);
        rx_sky_noise noise;
        assert_int_equal(rx_sky_noise_measure(width, height, pixels, &map, used, &noise, NULL), RX_OK);
        assert_true(noise.correlated);
        assert_near(noise.scale, resampled[k].scale, 0.002);
        assert_near(noise.correlation[0][LAGS + 1], resampled[k].right, 0.003);
        assert_near(noise.correlation[0][LAGS - 1], resampled[k].right, 0.003);
        assert_near(noise.correlation[1][LAGS], resampled[k].up, 0.003);
        assert_near(noise.correlation[1][LAGS + 1], resampled[k].diagonal, 0.003);
        assert_near(noise.correlation[1][LAGS - 1], resampled[k].other_diagonal, 0.003);
        assert_near(noise.correlation[0][LAGS + 2], resampled[k].right2, 0.003);
        /* and a tile of such noise has the same */
        sky *src = make_sky(0);
        rx_sky_noise again = measure_again(src, &noise);
        assert_near(again.scale, noise.scale, 0.01);
        assert_near(again.correlation[0][LAGS + 1], noise.correlation[0][LAGS + 1], 0.02);
        assert_near(again.correlation[1][LAGS], noise.correlation[1][LAGS], 0.02);
        assert_near(again.correlation[0][LAGS + 2], noise.correlation[0][LAGS + 2], 0.02);
        free(src);
        free(pixels);
        free(sigma);
        free(segments);
        free(used);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_filter),
        cmocka_unit_test(independent_pixels),
        cmocka_unit_test(outliers),
        cmocka_unit_test(same_bytes_whatever_is_hidden),
        cmocka_unit_test(realisations),
        cmocka_unit_test(no_wrap_no_repetition),
        cmocka_unit_test(impossible_correlation),
        cmocka_unit_test(threads_and_holes),
        cmocka_unit_test(nothing_to_measure),
        cmocka_unit_test(uneven_sky),
        cmocka_unit_test(resampled_images),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
