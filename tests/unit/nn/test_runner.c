/* The runner against the definition: every operation forward and backward, random graphs, errors. Threads: train/test_learner. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "nn/runner.h"
#include "reference.h"

static rx_net *make(const rx_node *nodes, int n, uint64_t seed)
{
    rx_error err = RX_ERROR_NONE;
    rx_net *net = NULL;
    if (rx_net_new(nodes, n, -1, &net, &err))
        fail_msg("%s", err.text);
    rx_net_initialise(net, seed, 1, 1, 1);
    for (int i = 1; i < n; i++)
        for (int c = 0; net->node[i].weight >= 0 && c < net->node[i].channels; c++)
            net->params[net->node[i].bias + c] =
                (float)(0.3 * rx_random_normal(seed, 2, (uint64_t)(c + 99 * i)));
    return net;
}

static rx_runner *runner(const rx_net *net, int height, int width)
{
    rx_error err = RX_ERROR_NONE;
    rx_runner *r = NULL;
    if (rx_runner_new(net, height, width, &r, &err))
        fail_msg("%s", err.text);
    return r;
}

/* The largest difference as a fraction of the largest value (of `least` at least). */
static double difference(const float *got, const double *want, long n, double least)
{
    double most = least, worst = 0;
    for (long i = 0; i < n; i++) {
        double d = fabs((double)got[i] - want[i]);
        most = fmax(most, fabs(want[i]));
        worst = d > worst || isnan(d) ? d : worst;
    }
    return n == 0 ? 0 : worst / most;
}

typedef struct both {
    reference *ref;
    double *params, *dparams;
} both;

static both reference_of(const rx_net *net, int height, int width)
{
    both b = {reference_new(net, height, width), calloc((size_t)net->nparams + 1, sizeof(double)),
              calloc((size_t)net->nparams + 1, sizeof(double))};
    for (long i = 0; i < net->nparams; i++)
        b.params[i] = (double)net->params[i];
    return b;
}

static void both_free(both *b)
{
    reference_free(b->ref);
    free(b->params);
    free(b->dparams);
}

static void random_values(float *values, double *copy, long n, uint64_t stream)
{
    for (long i = 0; i < n; i++) {
        values[i] = (float)rx_random_normal(5, stream, (uint64_t)i);
        copy[i] = (double)values[i];
    }
}

/* A value within rounding of 0 may be cut here and not there; such a pixel would carry a gradient in one of
 * the two only. */
static int near_a_cut(const reference *ref)
{
    for (int i = 1; i < ref->net->nnodes; i++)
        for (long k = 0; ref->net->node[i].relu && k < ref_size(&ref->node[i]); k++)
            if (ref->node[i].value[k] != 0 && fabs(ref->node[i].value[k]) < 1e-6)
                return 1;
    return 0;
}

/* Forward and backward, against the reference. */
static void check(const rx_net *net, int height, int width)
{
    const double tolerance = 2e-5;
    both b = reference_of(net, height, width);
    ref_plane *in = &b.ref->node[0], *out = reference_output(b.ref);
    rx_runner *r = runner(net, height, width);
    float *dparams = calloc((size_t)net->nparams + 1, sizeof *dparams);
    random_values(rx_runner_input(r), in->value, ref_size(in), 6);
    reference_forward(b.ref, b.params);
    rx_runner_forward(r);
    assert_true(difference(rx_runner_output(r), out->value, ref_size(out), 1) < tolerance);
    if (!near_a_cut(b.ref)) {
        random_values(rx_runner_output_gradient(r), out->gradient, ref_size(out), 7);
        reference_backward(b.ref, b.params, b.dparams);
        rx_runner_backward(r, dparams, 1);
        assert_true(difference(rx_runner_input_gradient(r), in->gradient, ref_size(in), 1) < tolerance);
        assert_true(difference(dparams, b.dparams, net->nparams, 1) < tolerance);
    }
    /* What a caller does not ask for changes nothing, and gradients of parameters add up. */
    random_values(rx_runner_output_gradient(r), out->gradient, ref_size(out), 7);
    float *once = calloc((size_t)net->nparams + 1, sizeof *once);
    rx_runner_forward(r);
    rx_runner_backward(r, once, 0);
    random_values(rx_runner_output_gradient(r), out->gradient, ref_size(out), 7);
    for (long i = 0; i < net->nparams; i++)
        b.dparams[i] = 2 * (double)once[i];
    rx_runner_backward(r, once, 0);
    assert_true(difference(once, b.dparams, net->nparams, 1) < 1e-6);
    free(once);
    free(dparams);
    rx_runner_free(r);
    both_free(&b);
}

static const rx_node no_node = {.src = 0, .add = -1};

static rx_node node(rx_op op, int src, int channels, int kernel, int stride)
{
    rx_node n = no_node;
    n.op = op;
    n.src = op == RX_OP_INPUT ? -1 : src;
    n.channels = channels;
    n.kernel = kernel;
    n.stride = stride;
    return n;
}

static void check_nodes(const rx_node *nodes, int n, int height, int width)
{
    rx_net *net = make(nodes, n, (uint64_t)(n + 7 * height));
    check(net, height, width);
    rx_net_free(net);
}

static const int channels[] = {1, 3, 12, 16, 32};
enum { CHANNELS = sizeof channels / sizeof channels[0] };

static void test_conv(void **state)
{
    for (int a = 0; a < CHANNELS; a++)
        for (int b = 0; b < CHANNELS; b++)
            for (int k = 1; k <= 7; k += 2)
                for (int stride = 1; stride <= 2; stride++) {
                    rx_node nodes[] = {node(RX_OP_INPUT, 0, channels[a], 0, 0),
                                       node(RX_OP_CONV, 0, channels[b], k, stride)};
                    nodes[1].relu = (a + b) % 2;
                    check_nodes(nodes, 2, 10, 12);
                }
}

static void test_transposed(void **state)
{
    for (int a = 0; a < CHANNELS; a++)
        for (int b = 0; b < CHANNELS; b++)
            for (int k = 2; k <= 6; k += 2) {
                rx_node nodes[] = {node(RX_OP_INPUT, 0, 3, 0, 0), node(RX_OP_CONV, 0, channels[b], 1, 1),
                                   node(RX_OP_CONV, 0, channels[a], 1, 2),
                                   node(RX_OP_TRANSPOSED, 2, channels[b], k, 2)};
                nodes[3].relu = k == 4;
                nodes[3].add = 1;
                check_nodes(nodes, 4, 8, 12);
            }
}

static void test_upconv(void **state)
{
    for (int a = 0; a < CHANNELS; a++)
        for (int b = 0; b < CHANNELS; b++)
            for (int relu = 0; relu < 2; relu++) {
                rx_node nodes[] = {node(RX_OP_INPUT, 0, 3, 0, 0), node(RX_OP_CONV, 0, channels[b], 1, 1),
                                   node(RX_OP_CONV, 0, channels[a], 3, 2),
                                   node(RX_OP_UPCONV, 2, channels[b], 3, 1)};
                nodes[3].relu = relu;
                nodes[3].add = 1;
                check_nodes(nodes, 4, 8, 6);
                check_nodes(nodes, 4, 2, 2);
            }
}

/* Which way round kernels lie, by hand: a single pixel spreads into the mirrored kernel of a convolution and
 * into the kernel itself of a transposed one. */
static void test_orientation(void **state)
{
    rx_node nodes[] = {node(RX_OP_INPUT, 0, 1, 0, 0), node(RX_OP_CONV, 0, 1, 3, 1)};
    rx_net *net = make(nodes, 2, 1);
    for (int k = 0; k < 9; k++)
        net->params[k] = (float)(k + 1);
    net->params[9] = 0.5F;
    rx_runner *r = runner(net, 5, 5);
    rx_runner_input(r)[2 * 5 + 2] = 1;
    rx_runner_forward(r);
    for (int v = 0; v < 3; v++)
        for (int u = 0; u < 3; u++)
            assert_true(rx_runner_output(r)[(3 - v) * 5 + 3 - u] == (float)(3 * v + u + 1) + 0.5F);
    assert_true(rx_runner_output(r)[0] == 0.5F);
    rx_runner_free(r);
    rx_net_free(net);

    rx_node up[] = {nodes[0], node(RX_OP_CONV, 0, 1, 1, 2), node(RX_OP_TRANSPOSED, 1, 1, 4, 2)};
    net = make(up, 3, 1);
    net->params[0] = 1;
    net->params[1] = 0;
    for (int k = 0; k < 16; k++)
        net->params[2 + k] = (float)(k + 1);
    net->params[18] = 0;
    r = runner(net, 8, 8);
    rx_runner_input(r)[2 * 8 + 4] = 1; /* (1, 2) at half resolution: 4x4 pixels from (1, 3) on */
    rx_runner_forward(r);
    for (int k = 0; k < 16; k++)
        assert_true(rx_runner_output(r)[(1 + k / 4) * 8 + 3 + k % 4] == (float)(k + 1));
    assert_true(rx_runner_output(r)[0] == 0);
    rx_runner_free(r);
    rx_net_free(net);
}

static int below(uint64_t seed, uint64_t counter, int n)
{
    return (int)(rx_random_uniform(seed, 77, counter) * n);
}

/* Random graphs: planes that are used several times, far later, added to their own source's result: what
 * shares memory must not be needed any more. */
static int random_graph(uint64_t seed, rx_node *nodes)
{
    int n = 1, level[RX_NET_NODES] = {0};
    nodes[0] = node(RX_OP_INPUT, 0, 4, 0, 0);
    for (uint64_t at = 0; n < 14; at += 8) {
        int src = below(seed, at, n), kind = below(seed, at + 1, 7), c = nodes[src].channels;
        rx_node next = node(RX_OP_CONV, src, 4 << below(seed, at + 2, 2), 3, 1);
        level[n] = level[src];
        if (kind == 0 && level[src] < 2) {
            next.stride = 2;
            level[n]++;
        } else if (kind == 1 && level[src] < 2 && c <= 4) {
            next = node(RX_OP_UNSHUFFLE, src, 4 * c, 0, 0);
            level[n]++;
        } else if (kind >= 2 && kind <= 5 && level[src] > 0) {
            const rx_op ops[] = {RX_OP_UP2, RX_OP_TRANSPOSED, RX_OP_UPCONV, RX_OP_SHUFFLE};
            next = node(ops[kind - 2], src, kind == 2 ? c : 4, kind == 3 ? 4 : 3, 2);
            if (kind == 5)
                next.channels = c / 4;
            level[n]--;
        }
        for (int k = n - 1; k >= 0 && next.add < 0; k--)
            if (level[k] == level[n] && nodes[k].channels == next.channels && below(seed, at + 3, 3) > 0)
                next.add = k;
        next.relu = below(seed, at + 4, 2);
        nodes[n++] = next;
    }
    /* Dead ends are not allowed: bring all of them to one level and sum them up. */
    for (int i = 0; i < 14; i++) {
        int used = i == 13;
        for (int k = i + 1; k < n; k++)
            used |= nodes[k].src == i || nodes[k].add == i;
        if (used)
            continue;
        int end = i;
        for (int l = level[i]; l > 0; l--) {
            nodes[n] = node(RX_OP_UPCONV, end, 2, 3, 1);
            end = n++;
        }
        nodes[n++] = node(RX_OP_CONV, end, 2, 1, 1);
    }
    int sum = 13;
    for (int l = level[13]; l > 0; l--) {
        nodes[n] = node(RX_OP_UPCONV, sum, 2, 3, 1);
        sum = n++;
    }
    nodes[n] = node(RX_OP_CONV, sum, 2, 1, 1);
    sum = n++;
    for (int i = 14; i < n - 1; i++) {
        int used = 0;
        for (int k = i + 1; k < n; k++)
            used |= nodes[k].src == i || nodes[k].add == i;
        if (!used) {
            nodes[n] = node(RX_OP_CONV, sum, 2, 1, 1);
            nodes[n].add = i;
            sum = n++;
        }
    }
    return n;
}

static void test_random_graphs(void **state)
{
    int most = 0;
    for (uint64_t seed = 0; seed < 60; seed++) {
        rx_node nodes[RX_NET_NODES];
        int n = random_graph(seed, nodes);
        assert_true(n < RX_NET_NODES);
        most = n > most ? n : most;
        check_nodes(nodes, n, 8, 12);
    }
    assert_true(most > 20);
}

static void test_refused(void **state)
{
    rx_node nodes[] = {node(RX_OP_INPUT, 0, 3, 0, 0), node(RX_OP_CONV, 0, 8, 3, 2),
                       node(RX_OP_CONV, 1, 8, 3, 2)};
    rx_net *net = make(nodes, 3, 1);
    const int sizes[][2] = {{0, 8}, {8, 0}, {-4, 8}, {6, 8}, {8, 10}, {1 << 24, 8}, {8, 1 << 24}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        rx_error err = RX_ERROR_NONE;
        rx_runner *r = NULL;
        assert_int_equal(rx_runner_new(net, sizes[i][0], sizes[i][1], &r, &err), RX_INPUT);
        assert_null(r);
        assert_non_null(strstr(err.text, "multiples of 4"));
    }
    rx_runner_free(NULL);
    rx_net_free(net);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_conv),          cmocka_unit_test(test_transposed),

        cmocka_unit_test(test_upconv),        cmocka_unit_test(test_orientation),
        cmocka_unit_test(test_random_graphs),

        cmocka_unit_test(test_refused),

    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
