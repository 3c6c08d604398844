/* PSF-NET's shapes: cost, definition, and that a pixel's value does not depend on the plane around it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "nn/psfnet.h"
#include "nn/runner.h"
#include "reference.h"

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

static rx_net *make(const rx_psfnet_shape *shape, int inputs)
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
    (void)state;
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
                rx_net *net = make(&shape, 3);
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

static void test_refused(void **state)
{
    (void)state;
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
            rx_net_free(make(&most, 1));
        }
}

/* The whole network, also with widths that fill no vector, against the definition. */
static void test_definition(void **state)
{
    (void)state;
    enum { H = 16, W = 20 };
    for (int s = 0; s < STEMS; s++)
        for (int d = 0; d < DECODERS; d++)
            for (int width = 5; width <= 8; width += 3) {
                rx_psfnet_shape shape = shape_of(s, d, width, 2);
                shape.stem_kernel = width == 5 ? 7 : 3;
                rx_net *net = make(&shape, 3);
                reference *ref = reference_new(net, H, W);
                double *params = calloc((size_t)net->nparams, sizeof *params), most = 0, worst = 0;
                rx_runner *r = NULL;
                assert_int_equal(rx_runner_new(net, H, W, &r, NULL), RX_OK);
                for (long i = 0; i < net->nparams; i++)
                    params[i] = (double)net->params[i];
                for (long i = 0; i < H * W * 3L; i++) {
                    rx_runner_input(r)[i] = (float)rx_random_normal(1, 2, (uint64_t)i);
                    ref->node[0].value[i] = (double)rx_runner_input(r)[i];
                }
                reference_forward(ref, params);
                rx_runner_forward(r);
                for (long i = 0; i < H * W * 1L; i++) {
                    double want = reference_output(ref)->value[i];
                    most = fmax(most, fabs(want));
                    worst = fmax(worst, fabs((double)rx_runner_output(r)[i] - want));
                }
                assert_true(most > 0.1);
                assert_true(worst < 1e-5 * most);
                rx_runner_free(r);
                free(params);
                reference_free(ref);
                rx_net_free(net);
            }
}

/* A value outside of the halo does not matter, one inside can: halos are no larger than they must be. */
static void test_reach(void **state)
{
    (void)state;
    for (int s = 0; s < STEMS; s++)
        for (int d = 0; d < DECODERS; d++) {
            rx_psfnet_shape shape = shape_of(s, d, 8, 1);
            rx_net *net = make(&shape, 1);
            int halo = rx_net_halo(net), side = 2 * halo + 8, from = halo + 4;
            for (long i = 0; i < net->nparams; i++)
                net->params[i] = fabsf(net->params[i]) + 0.01F;
            rx_runner *r = NULL;
            float before[16];
            int changed[2] = {0, 0};
            assert_int_equal(rx_runner_new(net, side, side, &r, NULL), RX_OK);
            for (int turn = 0; turn < 3; turn++) {
                for (int i = 0; i < side * side; i++)
                    rx_runner_input(r)[i] = 1;
                for (int y = 0; y < side && turn > 0; y++)
                    for (int x = from - halo - 4; x < from - halo + 4 * (turn - 1); x++)
                        rx_runner_input(r)[y * side + x] = 1000;
                rx_runner_forward(r);
                for (int k = 0; k < 16; k++) {
                    float value = rx_runner_output(r)[(from + k / 4) * side + from + k % 4];
                    if (turn == 0)
                        before[k] = value;
                    else
                        changed[turn - 1] += value != before[k];
                }
            }
            assert_int_equal(changed[0], 0);
            assert_true(changed[1] > 0);
            rx_runner_free(r);
            rx_net_free(net);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cost), cmocka_unit_test(test_refused),
                                       cmocka_unit_test(test_definition), cmocka_unit_test(test_reach)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
