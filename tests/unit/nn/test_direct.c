/* The plain kernel against the definition, each kernel on vectors against the plain one, and the same bits whatever
 * is asked for. With tests/cross/cmocka.h it runs on other processors (tests/aarch64.sh).
 *
 * A vector kernel may differ from the plain one by 5e-7 of the sum of the products' sizes (float sums of up to 1600
 * products; by Winograd's algorithm 1e-6), and by one unit in the last place of a bfloat16, 2^-7, where
 * the value becomes one. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "nn/direct.h"
#include "nn/layers.h"

enum { WIDTH = 67, ROWS = 6 };

static const int LANES[] = {1, 4, 8, 16};
enum { KERNELS = sizeof LANES / sizeof LANES[0] };

typedef struct fixture {
    rx_conv_shape shape;
    int fine, winograd;
    rx_plane x, add, y, before;               /* before: in y's shape, what is there before a run */
    float *weights, *bias, *scratch, *values; /* values: of x */
    double *want,
        *size; /* of each output by definition: the sum, and the sum of the sizes of what is summed */
    rx_direct *direct;
} fixture;

static float value_of(const rx_plane *p, size_t at)
{
    float value;
    if (p->real == RX_REAL_F32)
        return ((const float *)p->data)[at];
    const uint32_t bits = (uint32_t)((const uint16_t *)p->data)[at] << 16;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* dst = src in dst's reals */
static void convert(const rx_plane *src, rx_plane *dst)
{
    float *row = malloc((size_t)(src->width * src->channels) * sizeof *row);
    memset(dst->data, 0, rx_plane_bytes(dst));
    rx_layer_finish(dst, src, 0, row);
    free(row);
}

static rx_plane plane(int height, int width, int channels, rx_real real, uint64_t stream)
{
    rx_plane p = {.real = real, .height = height, .width = width, .channels = channels}, f = p;
    f.real = RX_REAL_F32;
    f.data = malloc(rx_plane_bytes(&f));
    for (size_t i = 0; i < rx_plane_size(&f); i++)
        ((float *)f.data)[i] = (float)(3.5 * rx_random_uniform(3, stream, i) - 1.75);
    p.data = malloc(rx_plane_bytes(&p));
    convert(&f, &p);
    free(f.data);
    return p;
}

/* The numbers themselves, as far as bfloat16 has them. */
static float *numbers(size_t n, rx_real real, uint64_t stream)
{
    rx_plane p = plane(1, (int)n, 1, real, stream), f = p;
    f.real = RX_REAL_F32;
    f.data = malloc(n * sizeof(float));
    convert(&p, &f);
    free(p.data);
    return f.data;
}

/* Place of channel o of the output at column u of row v of the input's size. */
static size_t at_output(const fixture *f, int v, int u, int o)
{
    if (f->fine)
        return (size_t)(2 * v + o / 2) * (size_t)f->y.width + (size_t)(2 * u + o % 2);
    return ((size_t)v * (size_t)f->y.width + (size_t)u) * (size_t)f->shape.out + (size_t)o;
}

static void define(const fixture *f, int v, int u, int o)
{
    const rx_conv_shape *s = &f->shape;
    const float *w = f->weights + (size_t)o * (size_t)(s->in * s->kernel * s->kernel);
    double sum = (double)f->bias[o], size = fabs(sum);
    for (int i = 0; i < s->in; i++)
        for (int k = 0; k < s->kernel; k++)
            for (int l = 0; l < s->kernel; l++) {
                const int row = v * s->stride + k, column = u * s->stride + l - s->before;
                const double product =
                    (double)*w++ * (double)f->values[(row * f->x.width + column) * s->in + i];
                sum += product;
                size += fabs(product);
            }
    const size_t at = at_output(f, v, u, o);
    if (s->sum) {
        const double more = (double)value_of(&f->add, at);
        sum += more;
        size += fabs(more);
    }
    f->want[at] = s->relu && sum < 0 ? 0 : sum;
    f->size[at] = size;
}

static fixture new_fixture(rx_conv_shape s, int fine, int winograd)
{
    fixture f = {.fine = fine, .winograd = winograd};
    s.before = s.after = s.kernel / 2;
    s.width = WIDTH;
    s.height = s.kernel + s.stride * (ROWS - 1);
    f.shape = s;
    f.x = plane(s.height, s.width, s.in, s.x, 1);
    f.y = fine ? plane(2 * ROWS, 2 * WIDTH, 1, s.y, 2) : plane(ROWS, WIDTH / s.stride, s.out, s.y, 2);
    f.add = plane(f.y.height, f.y.width, f.y.channels, s.y, 3);
    f.before = plane(f.y.height, f.y.width, f.y.channels, s.y, 7);
    f.weights = numbers((size_t)(s.out * s.in * s.kernel * s.kernel), s.x, 4);
    f.bias = numbers((size_t)s.out, RX_REAL_F32, 5);
    f.scratch = aligned_alloc(64, rx_direct_scratch() * sizeof(float));
    memset(f.scratch, 0, rx_direct_scratch() * sizeof(float));
    f.values = malloc(rx_plane_size(&f.x) * sizeof *f.values);
    for (size_t i = 0; i < rx_plane_size(&f.x); i++)
        f.values[i] = value_of(&f.x, i);
    f.want = malloc(rx_plane_size(&f.y) * sizeof *f.want);
    f.size = malloc(rx_plane_size(&f.y) * sizeof *f.size);
    for (int v = 0; v < ROWS; v++)
        for (int u = s.kernel / 2; u < WIDTH / s.stride - s.kernel / 2; u++)
            for (int o = 0; o < s.out; o++)
                define(&f, v, u, o);
    return f;
}

static void free_fixture(fixture *f)
{
    free(f->x.data);
    free(f->y.data);
    free(f->add.data);
    free(f->before.data);
    free(f->weights);
    free(f->bias);
    free(f->scratch);
    free(f->values);
    free(f->want);
    free(f->size);
}

static void run(const fixture *f, rx_direct_area area, const rx_plane *y)
{
    rx_direct_run(f->direct, &f->x, f->shape.sum ? &f->add : NULL, y, area, f->scratch);
}

/* Against the plain kernel's values, and these against the definition. */
static void check_values(const fixture *f, rx_direct_area a, const rx_plane *plain)
{
    const int lanes = rx_direct_lanes(f->direct);
    const double part = lanes == 1 ? 6e-8 : f->winograd ? 1e-6 : 5e-7;
    const double rounding = f->shape.y == RX_REAL_BF16 ? 1.0 / 128 : lanes == 1 ? 6e-8 : 0;
    for (int v = a.first; v < a.last; v++)
        for (int u = a.left; u < a.right; u++)
            for (int o = 0; o < f->shape.out; o++) {
                const size_t at = at_output(f, v, u, o);
                const double got = (double)value_of(&f->y, at),
                             want = plain != NULL ? (double)value_of(plain, at) : f->want[at];
                if (!(fabs(got - want) <= part * f->size[at] + rounding * fabs(want)))
                    fail_msg("%d lanes, %d -> %d, kernel %d, stride %d: %.9g, not %.9g", lanes, f->shape.in,
                             f->shape.out, f->shape.kernel, f->shape.stride, got, want);
            }
}

/* Whether the area holds what the whole has, and nothing beside it was written (but by Winograd's algorithm
 * in the other row of a pair). */
static void check_area(const fixture *f, rx_direct_area a, int pairs)
{
    rx_plane y = f->before;
    y.data = malloc(rx_plane_bytes(&y));
    memcpy(y.data, f->before.data, rx_plane_bytes(&y));
    run(f, a, &y);
    const int above = pairs ? a.first / 2 * 2 : a.first, below = pairs ? (a.last + 1) / 2 * 2 : a.last;
    for (int v = 0; v < ROWS; v++)
        for (int u = 0; u < WIDTH / f->shape.stride; u++)
            for (int o = 0; o < f->shape.out; o++) {
                const size_t at = at_output(f, v, u, o);
                if (u >= a.left && u < a.right && v >= a.first && v < a.last)
                    assert_true(value_of(&y, at) == value_of(&f->y, at));
                else if (u < a.left || u >= a.right || v < above || v >= below)
                    assert_true(value_of(&y, at) == value_of(&f->before, at));
            }
    free(y.data);
}

static int runs[KERNELS]; /* shapes that a kernel was tried with */

static void check(rx_conv_shape s, int fine, int winograd)
{
    fixture f = new_fixture(s, fine, winograd);
    s = f.shape;
    const int left = s.kernel / 2, right = WIDTH / s.stride - s.kernel / 2;
    rx_plane plain = {0};
    for (int k = fine ? 1 : 0; k < KERNELS; k++) {
        const rx_direct_options options = {fine, winograd, LANES[k]};
        assert_int_equal(rx_direct_new(&s, options, f.weights, f.bias, &f.direct, NULL), RX_OK);
        if (rx_direct_lanes(f.direct) == LANES[k]) {
            const int pairs = winograd && LANES[k] > 1;
            runs[k]++;
            run(&f, (rx_direct_area){left, right, 0, ROWS}, &f.y);
            check_values(&f, (rx_direct_area){left, right, 0, ROWS}, k > 0 && !fine ? &plain : NULL);
            check_area(&f, (rx_direct_area){left, left + 1, 1, 2}, pairs);
            check_area(&f, (rx_direct_area){left, left + 5, 0, 5}, pairs);
            check_area(&f, (rx_direct_area){left, right - 4, 3, 4}, pairs);
            check_area(&f, (rx_direct_area){left + 2, right, 2, ROWS}, pairs);
            if (k == 0) {
                plain = f.y;
                f.y = plane(plain.height, plain.width, plain.channels, plain.real, 2);
            }
        } else {
            assert_true(rx_direct_lanes(f.direct) < LANES[k]);
        }
        rx_direct_free(f.direct);
    }
    free(plain.data);
    free_fixture(&f);
}

/* 8 bits of precision, ties to even, and back. */
static void bfloat16(void **state)
{
    static const float values[] = {1, 1 + 1 / 256.0f, 1 + 3 / 256.0f, 1.0039f, -2.5f, 3e38f, 0};
    static const float rounded[] = {1, 1, 1 + 4 / 256.0f, 1, -2.5f, 0, 0};
    float src[8], back[8] = {0}, row[8];
    uint16_t half[8] = {0};
    const rx_plane a = {.data = src, .height = 1, .width = 8, .channels = 1};
    rx_plane b = a, c = a;
    b.data = half;
    b.real = RX_REAL_BF16;
    c.data = back;
    memcpy(src, values, sizeof values);
    src[7] = NAN;
    rx_layer_finish(&b, &a, 0, row);
    rx_layer_finish(&c, &b, 0, row);
    for (int i = 0; i < 7; i++)
        if (i == 5)
            assert_true(fabs((double)(back[i] / values[i]) - 1) < 1 / 256.0);
        else
            assert_true(back[i] == rounded[i]);
    assert_true(isnan(back[7]));
}

static const rx_real reals[] = {RX_REAL_F32, RX_REAL_BF16};

/* Each step through the words of a pixel, with one vector of outputs, two and more. */
static void wide(void **state)
{
    static const int words[] = {6, 8, 12, 16, 32, 64}, outs[] = {16, 32, 12, 24};
    for (size_t w = 0; w < sizeof words / sizeof words[0]; w++)
        for (int k = 0; k < 32; k++) {
            const int stride = 1 + (k / 4) % 2;
            rx_conv_shape s = {.out = outs[k % 4],
                               .stride = stride,
                               .kernel = k % 3 == 0   ? 1
                                         : k % 3 == 1 ? 3
                                                      : 5};
            s.x = reals[k / 8 % 2];
            s.y = reals[k / 16 % 2];
            s.in = words[w] / stride * (s.x == RX_REAL_F32 ? 1 : 2);
            s.sum = k % 5 < 2;
            s.relu = k % 7 < 3;
            check(s, 0, 0);
        }
}

static void winograd(void **state)
{
    static const int ins[] = {2, 3, 12, 16, 18, 32, 48, 64}, outs[] = {16, 32, 12, 24};
    for (size_t i = 0; i < sizeof ins / sizeof ins[0]; i++)
        for (int k = 0; k < 8; k++) {
            const rx_conv_shape s = {.in = ins[i],
                                     .out = outs[k % 4],
                                     .kernel = 3,
                                     .stride = 1,
                                     .y = reals[k / 4],
                                     .sum = k % 2,
                                     .relu = k % 3 == 0};
            check(s, 0, 1);
        }
}

static void fine(void **state)
{
    for (int in = 8; in <= 64; in += 8)
        for (int k = 0; k < 4; k++)
            check((rx_conv_shape){.in = in,
                                  .out = 4,
                                  .kernel = k < 2 ? 3 : 5,
                                  .stride = 1,
                                  .x = reals[k % 2],
                                  .relu = in % 16 == 0},
                  1, 0);
}

/* The bits of the plain layer, away from the border. */
static void up2(void **state)
{
    for (int k = 0; k < 8; k++) {
        const rx_real real = reals[k % 2];
        const int channels = k / 2 % 2 == 0 ? 16 : 32, relu = k / 4;
        rx_plane src = plane(ROWS + 2, WIDTH, channels, real, 1);
        rx_plane add = plane(2 * ROWS, 2 * WIDTH, channels, real, 2);
        rx_plane want = plane(2 * ROWS, 2 * WIDTH, channels, real, 3);
        rx_plane got = plane(2 * ROWS, 2 * WIDTH, channels, real, 3);
        float *row = malloc(4 * (size_t)(WIDTH * channels) * sizeof *row);
        const rx_direct_area area = {3, 2 * WIDTH - 4, 1, 2 * ROWS - 1};
        const int can = rx_direct_up2(&src, k < 5 ? &add : NULL, relu, &got, area);
        assert_int_equal(can, real == RX_REAL_F32 || rx_direct_has_bf16());
        rx_layer_up2(&src, &want, k < 5 ? &add : NULL, relu, row);
        for (int y = area.first; can && y < area.last; y++)
            for (int i = area.left * channels; i < area.right * channels; i++) {
                const size_t at = (size_t)(y * 2 * WIDTH * channels + i);
                assert_true(value_of(&got, at) == value_of(&want, at));
            }
        free(src.data);
        free(add.data);
        free(want.data);
        free(got.data);
        free(row);
    }
    const rx_plane odd = {.channels = 6};
    assert_false(rx_direct_up2(&odd, NULL, 0, &odd, (rx_direct_area){0, 0, 0, 0}));
}

/* Any number of inputs and outputs. */
static void odd_shapes(void **state)
{
    for (int k = 0; k < 96; k++) {
        const rx_conv_shape s = {.in = 1 + 2 * (k % 4),
                                 .out = 1 + 3 * (k % 14),
                                 .kernel = 1 + 2 * (k % 3),
                                 .stride = 1 + k / 8 % 2,
                                 .x = reals[k / 4 % 4 == 3],
                                 .y = reals[k % 4 == 3],
                                 .sum = k % 5 < 2,
                                 .relu = k % 7 < 3};
        check(s, 0, k % 2 && s.kernel == 3 && s.stride == 1 && s.x == RX_REAL_F32);
    }
}

/* The gradient by the weights, from a plane with a border, against its definition and the plain kernel's. */
static void gradients(void **state)
{
    for (int k = 0; k < 60; k++) {
        const int kernel = 1 + 2 * (k % 3), stride = 1 + k / 3 % 2, in = 1 + 5 * (k % 7),
                  out = 1 + 3 * (k % 13);
        const rx_conv_shape s = {.in = in, .out = out, .kernel = kernel, .stride = stride};
        const rx_plane x = plane(kernel + stride * (ROWS - 1), kernel + stride * 10, in, RX_REAL_F32, 1);
        const rx_plane dy = plane(ROWS, 11, out, RX_REAL_F32, 2);
        const size_t n = (size_t)(kernel * kernel * in * out);
        float *plain = calloc(n, sizeof *plain), *got = calloc(n, sizeof *got);
        rx_direct_weights(&s, 1, &x, &dy, plain);
        for (size_t w = 0; w < n; w++) {
            const int o = (int)w % out, i = (int)w / out % in, place = (int)w / out / in;
            double sum = 0;
            for (int v = 0; v < ROWS; v++)
                for (int u = 0; u < 11; u++) {
                    const int row = v * stride + place / kernel, column = u * stride + place % kernel;
                    sum += (double)value_of(&x, (size_t)((row * x.width + column) * in + i)) *
                           (double)value_of(&dy, (size_t)((v * 11 + u) * out + o));
                }
            assert_true(fabs(plain[w] - sum) <= 1e-6 * (1 + fabs(sum)));
        }
        for (int l = 0; l <= KERNELS; l++) { /* and without a limit */
            for (size_t w = 0; w < n; w++)
                got[w] = 1; /* what is there is added to */
            rx_direct_weights(&s, l < KERNELS ? LANES[l] : 0, &x, &dy, got);
            for (size_t w = 0; w < n; w++)
                if (!(fabs((double)got[w] - 1 - (double)plain[w]) <= 2e-5))
                    fail_msg("%d -> %d, kernel %d, stride %d, %d lanes: %g, not %g", in, out, kernel, stride,
                             l < KERNELS ? LANES[l] : 0, (double)got[w] - 1, (double)plain[w]);
        }
        free(x.data);
        free(dy.data);
        free(plain);
        free(got);
    }
}

static int lanes_of(rx_conv_shape s)
{
    const float weights[16 * 16 * 9] = {0}, bias[16] = {0};
    rx_direct *direct = NULL;
    assert_int_equal(rx_direct_new(&s, (rx_direct_options){0}, weights, bias, &direct, NULL), RX_OK);
    const int lanes = rx_direct_lanes(direct);
    rx_direct_free(direct);
    return lanes;
}

/* Those of which outputs need the fewest vectors, of two the narrower; each kind that this machine has was tried above. */
static void which_kernel(void **state)
{
    rx_conv_shape s = {.height = 6, .in = 16, .out = 16, .kernel = 3, .stride = 1};
    const int widest = lanes_of(s);
    print_message("this machine: %s; tried with 1, 4, 8, 16 lanes: %d, %d, %d, %d shapes\n", rx_direct_name(),
                  runs[0], runs[1], runs[2], runs[3]);
    for (int k = 0; k < KERNELS; k++)
        assert_int_equal(runs[k] > 40, LANES[k] <= widest);
    s.out = 8;
    assert_int_equal(lanes_of(s), widest < 8 ? widest : 8);
    s.out = 12;
    assert_int_equal(lanes_of(s), widest);
    s.out = 7;
    assert_int_equal(lanes_of(s), widest < 8 ? widest : 8);
    s.out = 3;
    assert_int_equal(lanes_of(s), 4);
    s.x = s.y = RX_REAL_BF16;
    assert_int_equal(lanes_of(s), 1);
    s.x = s.y = RX_REAL_F32;
    s = (rx_conv_shape){.height = 6, .in = 8, .out = 4, .kernel = 3, .stride = 1};
    assert_true(rx_direct_can_fine(&s));
    s.in = 12;
    assert_false(rx_direct_can_fine(&s));
    s.in = 16;
    s.out = 8;
    assert_false(rx_direct_can_fine(&s));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wide),      cmocka_unit_test(winograd),
                                       cmocka_unit_test(fine),      cmocka_unit_test(up2),
                                       cmocka_unit_test(bfloat16),  cmocka_unit_test(odd_shapes),
                                       cmocka_unit_test(gradients), cmocka_unit_test(which_kernel)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
