/* nn/layers against the definitions in its header, and each transpose against what it transposes. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "base/random.h"
#include "nn/layers.h"

enum { H = 5, W = 7, MOST = 4096 };

static rx_plane plane(int height, int width, int channels, float *data)
{
    return (rx_plane){
        .data = data, .real = RX_REAL_F32, .height = height, .width = width, .channels = channels};
}

static void fill(float *values, size_t n, uint64_t stream)
{
    for (size_t i = 0; i < n; i++)
        values[i] = (float)rx_random_normal(4, stream, i);
}

/* Weight of the lower row in the upper one, bilinear, the border repeated: rows lie at the centres of their
 * pixels. */
static double weight(int upper, int lower, int height)
{
    const double at = (upper + 0.5) / 2 - 0.5;
    double sum = 0;
    for (int i = -2; i < height + 2; i++) {
        const int held = i < 0 ? 0 : i >= height ? height - 1 : i;
        sum += held == lower ? fmax(0, 1 - fabs(at - i)) : 0;
    }
    return sum;
}

static void up2_is_bilinear(void **state)
{
    (void)state;
    static float src[MOST], add[MOST], dst[MOST], row[MOST];
    for (int k = 0; k < 12; k++) {
        const int channels = 1 + k % 3, more = k / 6, relu = k % 2;
        rx_plane a = plane(H + 2 * more, W, channels, src), b = plane(2 * H, 2 * W, channels, dst);
        const rx_plane c = plane(2 * H, 2 * W, channels, add);
        fill(src, rx_plane_size(&a), 1);
        fill(add, rx_plane_size(&c), 2);
        rx_layer_up2(&a, &b, k % 4 < 2 ? &c : NULL, relu, row);
        for (int i = 0; i < (int)rx_plane_size(&b); i++) {
            const int x = i / channels % (2 * W), y = i / channels / (2 * W);
            double sum = k % 4 < 2 ? add[i] : 0;
            for (int v = 0; v < a.height; v++)
                for (int u = 0; u < W; u++)
                    sum += weight(y + 2 * more, v, a.height) * weight(x, u, W) *
                           src[(v * W + u) * channels + i % channels];
            assert_near(dst[i], relu ? fmax(sum, 0) : sum, 1e-6);
        }
    }
}

static void up2_back_is_its_transpose(void **state)
{
    (void)state;
    static float dsrc[MOST], ddst[MOST], row[MOST];
    for (int channels = 1; channels < 4; channels++) {
        rx_plane a = plane(H, W, channels, dsrc);
        const rx_plane b = plane(2 * H, 2 * W, channels, ddst);
        fill(ddst, rx_plane_size(&b), 3);
        fill(dsrc, rx_plane_size(&a), 4); /* is set, not added to */
        rx_layer_up2_back(&b, &a, row);
        for (int i = 0; i < (int)rx_plane_size(&a); i++) {
            const int x = i / channels % W, y = i / channels / W;
            double sum = 0;
            for (int v = 0; v < 2 * H; v++)
                for (int u = 0; u < 2 * W; u++)
                    sum +=
                        weight(v, y, H) * weight(u, x, W) * ddst[(v * 2 * W + u) * channels + i % channels];
            assert_near(dsrc[i], sum, 2e-6);
        }
    }
}

static void shuffles(void **state)
{
    (void)state;
    static float fine[MOST], coarse[MOST], again[MOST];
    for (int channels = 1; channels < 5; channels++) {
        const rx_plane a = plane(2 * H, 2 * W, channels, fine);
        rx_plane b = plane(H, W, 4 * channels, coarse), c = plane(2 * H, 2 * W, channels, again);
        fill(fine, rx_plane_size(&a), 5);
        rx_layer_unshuffle(&a, &b);
        for (int i = 0; i < (int)rx_plane_size(&b); i++) {
            const int at = i / (4 * channels), group = i / channels % 4;
            const int x = 2 * (at % W) + group % 2, y = 2 * (at / W) + group / 2;
            assert_near(coarse[i], fine[(y * 2 * W + x) * channels + i % channels], 0);
        }
        rx_layer_shuffle(&b, &c);
        assert_memory_equal(again, fine, rx_plane_bytes(&a));
    }
}

static void sums_and_cuts(void **state)
{
    (void)state;
    enum { N = H * W * 3 };
    float a[N], b[N], was[N], row[W * 3];
    fill(b, N, 9);
    for (int k = 0; k < 4; k++) {
        rx_plane p = plane(H, W, 3, a);
        const rx_plane q = plane(H, W, 3, b);
        fill(a, N, 10);
        memcpy(was, a, sizeof was);
        rx_layer_finish(&p, k % 2 ? &q : NULL, k / 2, row);
        for (int i = 0; i < N; i++) {
            const float sum = was[i] + (k % 2 ? b[i] : 0);
            assert_near(a[i], k / 2 ? fmaxf(sum, 0) : sum, 0);
        }
    }
    memcpy(a, was, sizeof a);
    b[3] = 0;
    rx_layer_relu_back(b, a, N);
    for (int i = 0; i < N; i++)
        assert_near(a[i], b[i] > 0 ? was[i] : 0, 0);
    memcpy(a, was, sizeof a);
    rx_layer_add(b, a, N);
    for (int i = 0; i < N; i++)
        assert_near(a[i], was[i] + b[i], 0);
}

/* 8 bits of precision, ties to even, and back. */
static void bfloat16(void **state)
{
    (void)state;
    static const float values[] = {1, 1 + 1 / 256.0f, 1 + 3 / 256.0f, 1.0039f, -2.5f, 3e38f, 0};
    static const float rounded[] = {1, 1, 1 + 4 / 256.0f, 1, -2.5f, 0, 0};
    float src[8], back[8] = {0}, row[8];
    uint16_t half[8] = {0};
    rx_plane a = plane(1, 8, 1, src), b = a, c = plane(1, 8, 1, back);
    b.data = half;
    b.real = RX_REAL_BF16;
    memcpy(src, values, sizeof values);
    src[7] = NAN;
    rx_layer_finish(&b, &a, 0, row);
    rx_layer_finish(&c, &b, 0, row);
    for (int i = 0; i < 7; i++)
        if (i == 5)
            assert_near(back[i] / values[i], 1, 1 / 256.0);
        else
            assert_near(back[i], rounded[i], 0);
    assert_true(isnan(back[7]));
}

/* The folded weight from lower pixel r, s by the header; its transpose sums the same products. */
static void folds(void **state)
{
    (void)state;
    enum { IN = 3, OUT = 2 };
    static const rx_node nodes[] = {{.op = RX_OP_UPCONV, .channels = OUT, .kernel = 3},
                                    {.op = RX_OP_TRANSPOSED, .channels = OUT, .kernel = 2},
                                    {.op = RX_OP_TRANSPOSED, .channels = OUT, .kernel = 4},
                                    {.op = RX_OP_TRANSPOSED, .channels = OUT, .kernel = 6}};
    static float w[MOST], folded[MOST], back[MOST], gradient[MOST], unfolded[MOST];
    for (int m = 0; m < 4; m++) {
        const rx_node *n = &nodes[m];
        const int up = n->op == RX_OP_UPCONV, k = n->kernel, size = up ? 3 : 2 * (k / 4) + 1,
                  middle = size / 2;
        const int all = 4 * OUT * IN * size * size, weights = IN * OUT * k * k;
        assert_int_equal(rx_layer_folded_kernel(n), size);
        fill(w, (size_t)weights, 11);
        fill(gradient, (size_t)all, 12);
        for (int i = 0; i < weights; i++)
            back[i] = unfolded[i] = 0.5f; /* is added to */
        rx_layer_fold(n, IN, w, folded);
        rx_layer_unfold(n, IN, gradient, unfolded);
        for (int f = 0; f < all; f++) {
            const int s = f % size, r = f / size % size, i = f / (size * size) % IN;
            const int o = f / (size * size * IN) % OUT, phase = f / (size * size * IN * OUT);
            double sum = 0;
            for (int e = 0; e < k * k; e++) {
                const int v = e / k, u = e % k;
                /* lower row 20 + r - middle in upper row 40 + d, or in the one that v takes from there */
                const int y = 20 + r - middle, x = 20 + s - middle;
                const double part =
                    up ? weight(40 + phase / 2 + v - 1, y, 99) * weight(40 + phase % 2 + u - 1, x, 99)
                       : 2 * y + v - (k / 2 - 1) == 40 + phase / 2 &&
                             2 * x + u - (k / 2 - 1) == 40 + phase % 2;
                const int at = (up ? o * IN + i : i * OUT + o) * k * k + e;
                sum += part * w[at];
                back[at] += (float)(part * gradient[f]);
            }
            assert_near(folded[f], sum, 1e-6);
        }
        for (int i = 0; i < weights; i++)
            assert_near(unfolded[i], back[i], 2e-5);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(up2_is_bilinear), cmocka_unit_test(up2_back_is_its_transpose),
        cmocka_unit_test(shuffles),        cmocka_unit_test(sums_and_cuts),
        cmocka_unit_test(bfloat16),        cmocka_unit_test(folds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
