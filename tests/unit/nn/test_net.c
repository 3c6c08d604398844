/* A network as data: what is refused, how parameters lie, first values, reach and cost; and the shapes of PSF-NET. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "nn/psfnet.h"
#include "reference.h"

static rx_node input(int channels)
{
    return (rx_node){.op = RX_OP_INPUT, .src = -1, .add = -1, .channels = channels};
}

static rx_node conv(int src, int channels, int kernel, int stride)
{
    return (rx_node){
        .op = RX_OP_CONV, .src = src, .add = -1, .channels = channels, .kernel = kernel, .stride = stride};
}

static rx_node other(rx_op op, int src, int channels, int kernel)
{
    return (rx_node){.op = op, .src = src, .add = -1, .channels = channels, .kernel = kernel, .stride = 2};
}

static rx_node plus(rx_node n, int add, int relu)
{
    n.add = add;
    n.relu = relu;
    return n;
}

static void refuse(const rx_node *nodes, int n, const char *text)
{
    rx_error err = RX_ERROR_NONE;
    rx_net *net = NULL;
    assert_int_equal(rx_net_new(nodes, n, -1, &net, &err), RX_INPUT);
    assert_null(net);
    if (strstr(err.text, text) == NULL)
        fail_msg("'%s' does not say '%s'", err.text, text);
}

static void test_refused(void **state)
{
    rx_node in = input(4);
    refuse((rx_node[]){in}, 1, "2 to 64");
    refuse((rx_node[]){conv(0, 1, 3, 1), in}, 2, "node 0 (CONV)");
    refuse((rx_node[]){in, in}, 2, "only the first");
    refuse((rx_node[]){input(0), conv(0, 1, 3, 1)}, 2, "channels must be");
    refuse((rx_node[]){plus(in, -1, 1), conv(0, 1, 3, 1)}, 2, "cannot be cut");
    refuse((rx_node[]){in, conv(1, 1, 3, 1)}, 2, "node 1 (CONV) of the network: it must take");
    refuse((rx_node[]){in, plus(conv(0, 4, 3, 1), 1, 0)}, 2, "earlier nodes");
    refuse((rx_node[]){in, plus(conv(0, 5, 3, 1), 0, 0)}, 2, "node to add");
    refuse((rx_node[]){in, plus(conv(0, 4, 3, 2), 0, 0)}, 2, "node to add");
    refuse((rx_node[]){in, plus(conv(0, 4, 3, 1), -1, 2)}, 2, "relu");
    refuse((rx_node[]){in, conv(0, 4, 4, 1)}, 2, "odd");
    refuse((rx_node[]){in, conv(0, 4, 3, 3)}, 2, "stride must be 1 or 2");
    refuse((rx_node[]){in, conv(0, 1025, 3, 1)}, 2, "channels must be");
    refuse((rx_node[]){in, conv(0, 4, 3, 2), other(RX_OP_TRANSPOSED, 1, 4, 3)}, 3, "even");
    refuse((rx_node[]){in, other(RX_OP_TRANSPOSED, 0, 4, 4)}, 2, "resolution");
    refuse((rx_node[]){in, conv(0, 4, 3, 2), other(RX_OP_UP2, 1, 3, 0)}, 3, "those of its source");
    refuse((rx_node[]){in, conv(0, 4, 3, 2), other(RX_OP_UPCONV, 1, 3, 5)}, 3, "kernel must be 3");
    refuse((rx_node[]){in, conv(0, 4, 3, 2), other(RX_OP_UPCONV, 1, 300, 3)}, 3, "1 to 256");
    refuse((rx_node[]){in, conv(0, 4, 3, 2), other(RX_OP_SHUFFLE, 1, 4, 0)}, 3, "a quarter");
    refuse((rx_node[]){in, other(RX_OP_UNSHUFFLE, 0, 4, 0)}, 2, "four times");
    refuse((rx_node[]){in, conv(0, 4, 3, 1), conv(0, 4, 3, 1)}, 3,
           "node 1 (CONV) of the network: no other node uses it");
    rx_node wild = conv(0, 4, 3, 1);
    wild.op = (rx_op)99;
    refuse((rx_node[]){in, wild}, 2, "no such operation");
    rx_node deep[11] = {in};
    for (int i = 1; i < 11; i++)
        deep[i] = conv(i - 1, 4, 1, 2);
    refuse(deep, 11, "node 9");
}

static rx_net *make(const rx_node *nodes, int n)
{
    rx_error err = RX_ERROR_NONE;
    rx_net *net = NULL;
    if (rx_net_new(nodes, n, -1, &net, &err))
        fail_msg("%s", err.text);
    return net;
}

static void test_layout(void **state)
{
    rx_node nodes[] = {input(3),
                       other(RX_OP_UNSHUFFLE, 0, 12, 0),
                       conv(1, 5, 3, 1),
                       conv(2, 6, 3, 2),
                       other(RX_OP_TRANSPOSED, 3, 5, 4),
                       plus(conv(4, 5, 1, 1), 2, 1),
                       other(RX_OP_UPCONV, 5, 2, 3)};
    nodes[0].add = nodes[0].src = 5; /* of no meaning */
    rx_net *net = make(nodes, 7);
    assert_int_equal(net->node[0].src, -1);
    assert_int_equal(net->node[0].add, -1);
    assert_int_equal(net->node[0].weight, -1);
    assert_int_equal(net->node[1].weight, -1);
    assert_int_equal(net->node[1].bias, -1);
    assert_int_equal(net->node[2].weight, 0);
    assert_int_equal(net->node[2].nweights, 12 * 5 * 9);
    assert_int_equal(net->node[2].bias, 540);
    assert_int_equal(net->node[3].weight, 545);
    assert_int_equal(net->node[4].nweights, 6 * 5 * 16);
    assert_int_equal(net->nparams, 545 + (270 + 6) + (480 + 5) + (25 + 5) + (90 + 2));
    assert_int_equal(rx_net_levels(net), 2);
    const int levels[] = {0, 1, 1, 2, 1, 1, 0};
    for (int i = 0; i < 7; i++)
        assert_int_equal(net->node[i].level, levels[i]);
    /* By hand: the first at half, the second at quarter resolution, the transposed (four 3x3 kernels) where
     * its source is, the 1x1 at half, the folded head (four 3x3 kernels) at half. */
    double macs = 540 / 4. + 270 / 16. + 4 * 6 * 5 * 9 / 16. + 25 / 4. + 4 * 90 / 4.;
    assert_true(fabs(rx_net_macs(net) - macs) < 1e-9);
    for (long i = 0; i < net->nparams; i++)
        assert_true(net->params[i] == 0);
    rx_net_free(net);
    rx_net_free(NULL);
    net = make((rx_node[]){input(3), conv(0, 5, 3, 1)}, 2);
    assert_near(rx_net_macs(net), 3 * 5 * 9, 1e-12);
    rx_net_free(net);
    for (int op = RX_OP_INPUT; op <= RX_OP_UPCONV; op++)
        assert_int_equal(rx_op_find(rx_op_name((rx_op)op)), op);
    assert_int_equal(rx_op_find("CONVOLUTION"), -1);
}

static void test_first_values(void **state)
{
    rx_node nodes[] = {input(16),
                       plus(conv(0, 32, 3, 1), -1, 1),
                       conv(1, 32, 3, 2),
                       plus(conv(2, 32, 5, 1), 2, 0),
                       other(RX_OP_TRANSPOSED, 3, 32, 4),
                       conv(4, 8, 3, 1)};
    rx_net *net = make(nodes, 6);
    for (long i = 0; i < net->nparams; i++)
        net->params[i] = 9;
    rx_net_initialise(net, 11, 3, 0.3, 0.1);
    const double sd[] = {
        0, sqrt(2. / 144), sqrt(2. / 288), 0.3 * sqrt(2. / 800), sqrt(2. / 128), 0.1 * sqrt(2. / 288)};
    for (int i = 1; i < 6; i++) {
        const rx_node *n = &net->node[i];
        for (long k = n->weight; k < n->bias; k++) /* the stream's number of that place */
            assert_near(net->params[k], sd[i] * rx_random_normal(11, 3, (uint64_t)k), 1e-6 * sd[i]);
        for (int c = 0; c < n->channels; c++)
            assert_true(net->params[n->bias + c] == 0);
    }
    rx_net_free(net);
}

/* With positive weights and values every path carries gradient, so that the gradient's support by the input,
 * from one block of the coarsest stride, is the receptive field. */
static void check_halo(const rx_node *nodes, int n, int expected)
{
    rx_net *net = make(nodes, n);
    int halo = rx_net_halo(net), step = 1 << rx_net_levels(net), size = 2 * halo + 9 * step;
    int from = (halo / step + 4) * step, far = 0;
    reference *ref = reference_new(net, size, size);
    double *params = calloc((size_t)net->nparams + 1, sizeof *params),
           *dparams = calloc((size_t)net->nparams + 1, sizeof *dparams);
    for (long i = 0; i < net->nparams; i++)
        params[i] = 0.01;
    for (long i = 0; i < ref_size(&ref->node[0]); i++)
        ref->node[0].value[i] = 1;
    reference_forward(ref, params);
    ref_plane *out = reference_output(ref);
    int level = net->node[n - 1].level;
    for (int y = from >> level; y < (from + step) >> level; y++)
        for (int x = from >> level; x < (from + step) >> level; x++)
            out->gradient[((long)y * out->width + x) * out->channels] = 1;
    reference_backward(ref, params, dparams);
    for (long i = 0; i < ref_size(&ref->node[0]); i++) {
        if (ref->node[0].gradient[i] == 0)
            continue;
        int x = (int)(i / net->node[0].channels) % size, y = (int)(i / net->node[0].channels) / size;
        int beyond[4] = {from - x, x - (from + step - 1), from - y, y - (from + step - 1)};
        for (int k = 0; k < 4; k++)
            far = beyond[k] > far ? beyond[k] : far;
    }
    assert_int_equal(halo, expected);
    assert_true(far <= halo);
    assert_true(far > halo - step);
    free(params);
    free(dparams);
    reference_free(ref);
    rx_net_free(net);
}

static void test_halo(void **state)
{
    check_halo((rx_node[]){input(1), conv(0, 1, 5, 1)}, 2, 2);
    check_halo((rx_node[]){input(1), conv(0, 2, 3, 1), plus(conv(1, 2, 7, 1), 1, 1)}, 3, 4);
    check_halo((rx_node[]){input(1), conv(0, 2, 3, 2), other(RX_OP_UP2, 1, 2, 0)}, 3, 4);
    check_halo((rx_node[]){input(1), conv(0, 2, 3, 2), other(RX_OP_UPCONV, 1, 1, 3)}, 3, 4);
    check_halo((rx_node[]){input(1), conv(0, 2, 1, 2), other(RX_OP_TRANSPOSED, 1, 1, 4)}, 3, 2);
    check_halo((rx_node[]){input(1), other(RX_OP_UNSHUFFLE, 0, 4, 0), conv(1, 4, 3, 1),
                           other(RX_OP_SHUFFLE, 2, 1, 0)},
               4, 2);
    check_halo((rx_node[]){input(1), other(RX_OP_UNSHUFFLE, 0, 4, 0), conv(1, 2, 3, 1), conv(2, 2, 3, 2),
                           plus(conv(3, 2, 3, 1), 3, 1), conv(4, 2, 1, 1),
                           plus(other(RX_OP_UP2, 5, 2, 0), 2, 1), conv(6, 2, 3, 1),
                           other(RX_OP_UPCONV, 7, 1, 3)},
               9, 16);
    check_halo((rx_node[]){input(1), conv(0, 1, 3, 2), conv(1, 1, 3, 2), conv(2, 1, 3, 1),
                           other(RX_OP_TRANSPOSED, 3, 1, 6), other(RX_OP_TRANSPOSED, 4, 1, 4)},
               6, 16);
    /* what is added may reach farther than the source */
    check_halo((rx_node[]){input(1), conv(0, 1, 9, 1), conv(0, 1, 3, 1), plus(conv(2, 1, 1, 1), 1, 0),
                           conv(3, 1, 7, 1)},
               5, 7);
    rx_net *net = make((rx_node[]){input(1), conv(0, 1, 5, 1), conv(1, 1, 3, 1)}, 3);
    int needed[] = {99, 99, 99};
    rx_net_margins(net, needed);
    assert_int_equal(needed[0], 3);
    assert_int_equal(needed[1], 1);
    assert_int_equal(needed[2], 0);
    rx_net_free(net);
}

/* --- PSF-NET --- */

static const char *const stems[] = {"UNSHUFFLE", "CONV"};
static const char *const decoders[] = {"BILINEAR", "TRANSPOSED", "SUBPIXEL"};
enum { STEMS = 2, DECODERS = 3 };

static rx_psfnet_shape shape_of(int stem, int decoder, int width, int blocks)
{
    return (rx_psfnet_shape){.stem = (rx_stem)stem,
                             .decoder = (rx_decoder)decoder,
                             .width = width,
                             .blocks = blocks,
                             .stem_kernel = 3,
                             .kernel = 3};
}

static rx_net *make_psfnet(const rx_psfnet_shape *shape, int inputs)
{
    rx_error err = RX_ERROR_NONE;
    rx_net *net = NULL;
    if (rx_psfnet_new(shape, inputs, &net, &err))
        fail_msg("%s", err.text);
    rx_net_initialise(net, 8, 1, 0.3, 0.5);
    return net;
}

/* Multiplications per pixel by hand, w = 8 with three planes of input; the decoders' steps to twice the size
 * run as 3x3 kernels of four times the channels. */
static void test_cost(void **state)
{
    /* trunk 12 convolutions 32 to 32 at 1/16 of the pixels, half-resolution residual 2 of 16 to 16 at 1/4 */
    const double trunk = 12 * 9216. / 16, residual = 2 * 2304 / 4.;
    const double stem[] = {12 * 16 * 9 / 4. + 16 * 32 * 9 / 16.,
                           3 * 8 * 9 + 8 * 16 * 9 / 4. + 16 * 32 * 9 / 16.};
    const double end[] = {32 * 16 / 16. + 4 * 16 * 9 / 4., 4 * 32 * 16 * 9 / 16. + 4 * 16 * 9 / 4.,
                          32 * 64 * 9 / 16. + 16 * 4 * 9 / 4.};
    for (int s = 0; s < STEMS; s++)
        for (int d = 0; d < DECODERS; d++)
            for (int width = 8; width <= 16; width *= 2) {
                rx_psfnet_shape shape = shape_of(s, d, width, 6);
                rx_net *net = make_psfnet(&shape, 3);
                double macs = rx_net_macs(net);
                print_message("stem %-9s decoder %-10s width %2d: %6.0f multiplications per pixel, %6ld "
                              "parameters, halo %d\n",
                              stems[s], decoders[d], width, macs, net->nparams, rx_net_halo(net));
                if (width == 8)
                    assert_true(fabs(macs - (trunk + residual + stem[s] + end[d])) < 1e-6);
                assert_int_equal(rx_net_levels(net), 2);
                assert_int_equal(net->node[net->nnodes - 1].level, 0);
                assert_int_equal(net->node[net->nnodes - 1].channels, 1);
                rx_net_free(net);
            }
}

static void test_refused_shapes(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_net *net = NULL;
    struct {
        rx_psfnet_shape shape;
        int inputs;
        const char *text;
    } cases[] = {{shape_of(0, 0, 0, 6), 1, "width 0"}, {shape_of(0, 0, 129, 6), 1, "width 129"},
                 {shape_of(0, 0, 8, -1), 1, "blocks"}, {shape_of(0, 0, 8, 28), 1, "blocks"},
                 {shape_of(0, 0, 8, 6), 0, "0 input"}, {shape_of(0, 0, 8, 6), 1024, "1024 input"},
                 {shape_of(0, 0, 8, 6), 1, "4 and 3"}, {shape_of(0, 0, 8, 6), 1, "3 and 17"}};
    cases[6].shape.stem_kernel = 4;
    cases[7].shape.kernel = 17;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(rx_psfnet_new(&cases[i].shape, cases[i].inputs, &net, &err), RX_USAGE);
        assert_null(net);
        assert_non_null(strstr(err.text, cases[i].text));
    }
    for (int s = 0; s < STEMS; s++)
        for (int d = 0; d < DECODERS; d++) {
            rx_psfnet_shape most = shape_of(s, d, 1, 27);
            rx_net_free(make_psfnet(&most, 1));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_refused), cmocka_unit_test(test_layout), cmocka_unit_test(test_first_values),
        cmocka_unit_test(test_halo),    cmocka_unit_test(test_cost),   cmocka_unit_test(test_refused_shapes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
