/* A network that runs down a block: the values of the forward pass of training, within rounding, and the same bits in
 * any block. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "nn/direct.h"
#include "nn/psfnet.h"
#include "nn/runner.h"
#include "nn/stream.h"

enum { STEMS = 2, DECODERS = 3, SIDE = 352 };

/* A square of input, and what a runner and a stream make of it. */
typedef struct field {
    const rx_net *net;
    rx_precision precision;
    int halo, x, y, width; /* of the block at work */
    float *in, *want, *got;
} field;

static rx_net *make(int stem, int decoder, int width, int stem_kernel, int kernel)
{
    const rx_psfnet_shape shape = {.stem = (rx_stem)stem,
                                   .decoder = (rx_decoder)decoder,
                                   .width = width,
                                   .blocks = 2,
                                   .stem_kernel = stem_kernel,
                                   .kernel = kernel};
    rx_net *net = NULL;
    assert_int_equal(rx_psfnet_new(&shape, 2, &net, NULL), RX_OK);
    rx_net_initialise(net, 8, 1, 0.3, 0.5);
    for (long k = 0; k < net->nparams; k++)
        if (net->params[k] == 0)
            net->params[k] = 0.01F; /* biases: what lies beyond the border of a plane is not 0 by itself */
    return net;
}

static field field_new(const rx_net *net, rx_precision precision)
{
    const size_t n = SIDE * (size_t)SIDE;
    rx_runner *r = NULL;
    field f = {.net = net,
               .precision = precision,
               .halo = rx_net_halo(net),
               .in = malloc(2 * n * sizeof(float)),
               .want = malloc(n * sizeof(float)),
               .got = malloc(n * sizeof(float))};
    for (size_t i = 0; i < 2 * n; i++)
        f.in[i] = (float)rx_random_normal(6, 6, i);
    assert_int_equal(rx_runner_new(net, SIDE, SIDE, &r, NULL), RX_OK);
    memcpy(rx_runner_input(r), f.in, 2 * n * sizeof(float));
    rx_runner_forward(r);
    memcpy(f.want, rx_runner_output(r), n * sizeof(float));
    rx_runner_free(r);
    return f;
}

static void field_free(field *f)
{
    free(f->in);
    free(f->want);
    free(f->got);
}

static void give(void *user, int y, int n, float *rows)
{
    const field *f = user;
    const int width = f->width + 2 * f->halo;
    for (int v = 0; v < n; v++) {
        const int at = f->y + y + v;
        assert_true(y + v >= -f->halo);
        assert_true(f->x >= f->halo);
        assert_true(f->x + f->width + f->halo <= SIDE);
        if (at < SIDE)
            memcpy(rows + 2L * v * width, f->in + 2L * (at * SIDE + f->x - f->halo),
                   2 * (size_t)width * sizeof(float));
    }
}

static void take(void *user, int y, int n, const float *rows)
{
    const field *f = user;
    for (int v = 0; v < n; v++)
        memcpy(f->got + (long)(f->y + y + v) * SIDE + f->x,
               rows + (long)v * (f->width + 2 * f->halo) + f->halo, (size_t)f->width * sizeof(float));
}

/* One block of the field into f->got. */
static void run(field *f, int x, int y, int width, int height)
{
    rx_stream *s = NULL;
    const rx_stream_ends ends = {.user = f, .give = give, .take = take};
    f->x = x;
    f->y = y;
    f->width = width;
    assert_true(y >= f->halo);
    assert_true(y + height + f->halo <= SIDE);
    assert_int_equal(rx_stream_new(f->net, width, f->precision, &s, NULL), RX_OK);
    /* the second time rows of the first are still there */
    for (int turn = 0; turn < 2; turn++)
        assert_int_equal(rx_stream_run(s, height, &ends, NULL), RX_OK);
    rx_stream_free(s);
}

static double largest(const float *a, const float *b, int x, int y, int width, int height)
{
    double most = 0;
    for (int v = y; v < y + height; v++)
        for (int u = x; u < x + width; u++)
            most = fmax(most, fabs((double)a[v * SIDE + u] - (b != NULL ? (double)b[v * SIDE + u] : 0)));
    return most;
}

/* One large block against the runner, smaller ones against the large one. */
static void check(const rx_net *net, rx_precision precision, double tolerance)
{
    enum { SIZES = 5 };
    static const int sizes[SIZES][4] = {
        {0, 0, 8, 8}, {8, 16, 24, 104}, {16, 8, 100, 4}, {40, 24, 4, 92}, {0, 48, 36, 60}};
    field f = field_new(net, precision);
    const int from = (f.halo + 7) / 8 * 8, side = (SIDE - from - f.halo) / 8 * 8;
    assert_true(side >= 120);
    run(&f, from, from, side, side);
    const double size = largest(f.want, NULL, from, from, side, side);
    const double worst = largest(f.want, f.got, from, from, side, side);
    if (!(size > 0.1 && worst <= tolerance * size))
        fail_msg("largest %g, difference %g", size, worst);
    float *whole = f.got;
    f.got = malloc(SIDE * (size_t)SIDE * sizeof(float));
    for (int k = 0; k < SIZES; k++) {
        const int x = from + sizes[k][0], y = from + sizes[k][1], w = sizes[k][2], h = sizes[k][3];
        run(&f, x, y, w, h);
        assert_true(largest(whole, f.got, x, y, w, h) == 0);
    }
    free(whole);
    field_free(&f);
}

static void both_precisions(rx_net *net)
{
    check(net, RX_F32, 5e-6);
    if (rx_direct_has_bf16())
        check(net, RX_BF16, 3e-2);
    rx_net_free(net);
}

/* Channels that fill vectors, and such that do not. */
static void values_of_a_runner(void **state)
{
    static const int shapes[][3] = {{8, 3, 3}, {16, 5, 3}, {6, 7, 5}, {5, 3, 3}, {3, 1, 1}};
    for (size_t k = 0; k < sizeof shapes / sizeof shapes[0]; k++)
        for (int s = 0; s < STEMS; s++)
            for (int d = 0; d < DECODERS; d++)
                both_precisions(make(s, d, shapes[k][0], shapes[k][1], shapes[k][2]));
}

/* Operations to twice the size with all that may follow them, which a PSF-NET has not. */
static void other_graphs(void **state)
{
    enum { N = 6 };
    static const rx_op ops[] = {RX_OP_TRANSPOSED, RX_OP_UPCONV, RX_OP_SHUFFLE, RX_OP_UP2};
    for (size_t k = 0; k < 4; k++)
        for (int channels = 3; channels <= 16; channels += 13) {
            const int coarse = ops[k] == RX_OP_SHUFFLE ? 4 * channels : channels;
            const rx_node nodes[N] = {
                {.op = RX_OP_INPUT, .add = -1, .channels = 2},
                {.op = RX_OP_CONV, .add = -1, .relu = 1, .channels = channels, .kernel = 3, .stride = 1},
                {.op = RX_OP_CONV, .src = 1, .add = -1, .channels = coarse, .kernel = 3, .stride = 2},
                {.op = ops[k],
                 .src = 2,
                 .add = 1,
                 .relu = 1,
                 .channels = channels,
                 .kernel = ops[k] == RX_OP_TRANSPOSED ? 4 : 3,
                 .stride = ops[k] == RX_OP_TRANSPOSED ? 2 : 1},
                {.op = RX_OP_CONV, .src = 3, .add = -1, .channels = 7, .kernel = 1, .stride = 1},
                {.op = RX_OP_CONV, .src = 4, .add = -1, .channels = 1, .kernel = 5, .stride = 1}};
            rx_net *net = NULL;
            assert_int_equal(rx_net_new(nodes, N, -1, &net, NULL), RX_OK);
            rx_net_initialise(net, 9, k, 1, 1);
            both_precisions(net);
        }
}

static void what_it_costs(void **state)
{
    rx_net *net = make(0, 0, 8, 3, 3);
    field f = field_new(net, RX_F32);
    rx_stream_cost cost[RX_NET_NODES] = {{0, 0}};
    rx_stream *s = NULL;
    const rx_stream_ends ends = {.user = &f, .give = give, .take = take};
    f.x = f.y = f.halo;
    f.width = 120;
    assert_int_equal(rx_stream_new(net, 120, RX_F32, &s, NULL), RX_OK);
    rx_stream_measure(s, cost);
    assert_int_equal(rx_stream_run(s, 120, &ends, NULL), RX_OK);
    double flops = 0, peak = 0;
    for (int i = 0; i < net->nnodes; i++) {
        assert_true((cost[i].flops > 0) == (net->node[i].weight >= 0));
        assert_true((cost[i].seconds > 0) == (i > 0));
        flops += cost[i].flops;
    }
    const double least = 2 * rx_net_macs(net) * 120 * 120;
    assert_true(flops > least);
    assert_true(flops < 6 * least);
    assert_int_equal(rx_direct_peak(RX_REAL_F32, &peak, NULL), RX_OK);
    assert_between(peak, 1e7, 1e13);
    rx_stream_free(s);
    field_free(&f);
    rx_net_free(net);
}

static void refusals(void **state)
{
    rx_net *net = make(0, 0, 8, 3, 3);
    rx_stream *s = NULL;
    rx_error err = RX_ERROR_NONE;
    static const int widths[] = {0, -4, 2, 30, 1 << 21};
    for (size_t k = 0; k < sizeof widths / sizeof widths[0]; k++) {
        assert_int_equal(rx_stream_new(net, widths[k], RX_F32, &s, &err), RX_INPUT);
        assert_null(s);
        assert_non_null(strstr(err.text, "multiple of 4"));
    }
    if (!rx_direct_has_bf16())
        assert_int_equal(rx_stream_new(net, 8, RX_BF16, &s, &err), RX_USAGE);
    assert_true(rx_stream_bytes(net, 2048, RX_F32) < 40e6);
    rx_net_free(net);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(values_of_a_runner), cmocka_unit_test(other_graphs),
                                       cmocka_unit_test(what_it_costs), cmocka_unit_test(refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
