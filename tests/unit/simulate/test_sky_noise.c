/* simulate/sky_noise: realisations have the correlation they were drawn from. */
#include <string.h>

#include "../near.h"
#include "detect/correlation.h"
#include "simulate/sky_noise.h"

enum { W = 400, H = 360, N = W * H, MID = RX_NOISE_REACH };

/* A moving average that is not the same in x and y, nor along the two diagonals. */
static const float KERNEL[9] = {0.1f, 0.3f, 0.2f, 0.5f, 1.0f, 0.3f, 0.0f, 0.6f, 0.4f};

static float sigma[N], pixels[N], others[N];
static unsigned char used[N];

/* Noise whose width grows from left to right, 1 to 3. */
static void grow(void)
{
    for (int i = 0; i < N; i++)
        sigma[i] = 1.0f + 2.0f * (float)(i % W) / W;
}

static void draw(const rx_noise_correlation *noise, uint64_t stream, int nthreads, float *dst)
{
    rx_error err = RX_ERROR_NONE;
    const rx_map map = rx_map_plane(sigma, W);
    if (rx_sky_noise_draw(noise, &map, H, (rx_random_stream){21, stream}, nthreads, dst, &err) != RX_OK)
        fail_msg("%s", err.text);
}

/* What is drawn, measured. */
static rx_noise_correlation measure_drawn(const rx_noise_correlation *noise)
{
    rx_noise_correlation again;
    const rx_image image = {.width = W, .height = H, .pixels = pixels, .noise = rx_map_plane(sigma, W)};
    draw(noise, 0, 2, pixels);
    memset(used, 1, sizeof used);
    assert_int_equal(rx_correlation_measure(&image, used, 2, &again, NULL), RX_OK);
    assert_int_equal(again.origin, RX_NOISE_MEASURED);
    return again;
}

static void realisations(void **state)
{
    rx_noise_correlation noise = rx_noise_of_kernel(KERNEL, 3, 3);
    grow();
    noise.scale = 1.5;
    rx_noise_correlation again = measure_drawn(&noise);
    assert_true(again.correlated);
    assert_near(again.scale, 1.5, 0.015);
    for (int dy = -MID; dy <= MID; dy++)
        for (int dx = -MID; dx <= MID; dx++)
            assert_near(again.at[MID + dy][MID + dx], noise.at[MID + dy][MID + dx], 5.0 * again.error);
    noise = rx_noise_white(RX_NOISE_MEASURED);
    again = measure_drawn(&noise);
    assert_false(again.correlated);
    assert_near(again.scale, 1.0, 0.01);
}

/* Opposite edges do not know each other, nor do the members of a series. */
static void no_wrap_no_repetition(void **state)
{
    const rx_noise_correlation noise = rx_noise_of_kernel(KERNEL, 3, 3);
    double edges = 0.0, members = 0.0, power = 0.0, squares = 0.0;
    for (int i = 0; i < N; i++)
        sigma[i] = 1.0f;
    for (int k = 0; k < 40; k++) {
        draw(&noise, (uint64_t)(2 * k), 1, pixels);
        for (int y = 0; y < H; y++)
            edges += (double)pixels[y * W] * pixels[y * W + W - 1];
    }
    draw(&noise, 1, 1, others);
    for (int i = 0; i < N; i++) {
        members += (double)pixels[i] * others[i];
        power += (double)pixels[i] * pixels[i];
    }
    for (int i = 0; i < RX_NOISE_SIDE * RX_NOISE_SIDE; i++)
        squares +=
            noise.at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE] * noise.at[i / RX_NOISE_SIDE][i % RX_NOISE_SIDE];
    /* the next pixel would have correlation 0.7 */
    assert_near(edges / (40.0 * H), 0.0, 5.0 * sqrt(2.6 / (40.0 * H)));
    assert_near(members / power, 0.0, 5.0 * sqrt(squares / N));
}

/* Correlations that no noise can have: 0.9 to the next pixel in x and none to the one after. The variance
 * stays. */
static void impossible_correlation(void **state)
{
    rx_noise_correlation noise = rx_noise_white(RX_NOISE_MEASURED);
    grow();
    noise.correlated = 1;
    noise.at[MID][MID - 1] = noise.at[MID][MID + 1] = 0.9;
    const rx_noise_correlation again = measure_drawn(&noise);
    assert_near(again.scale, 1.0, 0.008);
    assert_near(again.at[MID + 1][MID], 0.0, 5.0 * again.error);
    /* numpy: P = maximum(1 + 1.8 cos k, 0); mean(P cos k) / mean(P), k = 2 pi arange(10**6) / 10**6 */
    assert_near(again.at[MID][MID + 1], 0.6453, 0.004);
}

static void threads_and_holes(void **state)
{
    rx_noise_correlation noise = rx_noise_of_kernel(KERNEL, 3, 3);
    grow();
    sigma[5] = sigma[W * 7 + 3] = 0.0f;
    for (int correlated = 0; correlated < 2; correlated++) {
        noise.correlated = correlated;
        draw(&noise, 3, 1, pixels);
        assert_true(pixels[5] == 0.0f);
        assert_true(pixels[W * 7 + 3] == 0.0f);
        for (int nthreads = 2; nthreads <= 3; nthreads++) {
            draw(&noise, 3, nthreads, others);
            assert_memory_equal(pixels, others, N * sizeof(float));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(realisations),
        cmocka_unit_test(no_wrap_no_repetition),
        cmocka_unit_test(impossible_correlation),
        cmocka_unit_test(threads_and_holes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
