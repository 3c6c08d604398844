/* A training that begins with the networks of a model file. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>

#include "../near.h"
#include "../scratch.h"
#include "base/random.h"
#include "nn/psfnet.h"
#include "nn/runner.h"
#include "train/first_model.h"

enum { SIDE = 64, EDGE = 16 };

static rx_model *model_of(rx_decoder decoder, int kernel)
{
    const rx_psfnet_shape shape = {
        .decoder = decoder, .width = 4, .blocks = 1, .stem_kernel = 3, .kernel = kernel};
    rx_model *model = rx_model_new();
    assert_non_null(model);
    model->front.mode = RX_MODE_BLIND;
    model->front.rl_steps = 0;
    assert_int_equal(rx_psfnet_new(&shape, 1, &model->restore, NULL), RX_OK);
    return model;
}

static void fill(rx_net *net)
{
    for (long i = 0; i < net->nparams; i++)
        net->params[i] = 0.3f * (float)rx_random_normal(5, 1, (uint64_t)i);
}

/* out[SIDE][SIDE] of the same noise for every network. */
static void run(const rx_net *net, float *out)
{
    rx_runner *r = NULL;
    assert_int_equal(rx_runner_new(net, SIDE, SIDE, &r, NULL), RX_OK);
    for (int k = 0; k < SIDE * SIDE; k++)
        rx_runner_input(r)[k] = (float)rx_random_normal(6, 1, (uint64_t)k);
    rx_runner_forward(r);
    memcpy(out, rx_runner_output(r), sizeof *out * SIDE * SIDE);
    rx_runner_free(r);
}

/* Sub-pixels begin as the interpolation that they take the place of, and a network of the same shape as itself. */
static void begins_with_the_same_function(void **state)
{
    static const rx_decoder decoders[] = {RX_DECODER_SUBPIXEL, RX_DECODER_BILINEAR};
    const char *path = in(state, "first.fits");
    rx_model *first = model_of(RX_DECODER_BILINEAR, 3);
    float want[SIDE * SIDE], got[SIDE * SIDE];
    fill(first->restore);
    run(first->restore, want);
    assert_int_equal(rx_model_write(first, path, path, NULL), RX_OK);
    for (int d = 0; d < 2; d++) {
        rx_model *model = model_of(decoders[d], 3);
        assert_int_equal(rx_first_model(path, model, NULL), RX_OK);
        run(model->restore, got);
        double most = 0;
        for (int y = EDGE; y < SIDE - EDGE; y++)
            for (int x = EDGE; x < SIDE - EDGE; x++) {
                const int k = y * SIDE + x;
                assert_near(got[k], want[k], 1e-4);
                most = fmax(most, fabs((double)want[k]));
            }
        assert_true(most > 0.5);
        rx_model_free(model);
    }
    rx_model_free(first);
}

/* No other change of shape. */
static void other_shapes_are_refused(void **state)
{
    const char *path = in(state, "other.fits");
    static const struct {
        rx_decoder from, to;
        int kernel;
    } cases[] = {{RX_DECODER_SUBPIXEL, RX_DECODER_BILINEAR, 3},
                 {RX_DECODER_BILINEAR, RX_DECODER_TRANSPOSED, 3},
                 {RX_DECODER_TRANSPOSED, RX_DECODER_SUBPIXEL, 3},
                 {RX_DECODER_BILINEAR, RX_DECODER_SUBPIXEL, 5},
                 {RX_DECODER_BILINEAR, RX_DECODER_BILINEAR, 5}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_model *first = model_of(cases[i].from, 3), *model = model_of(cases[i].to, cases[i].kernel);
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(rx_model_write(first, path, path, NULL), RX_OK);
        assert_int_equal(rx_first_model(path, model, &err), RX_USAGE);
        assert_non_null(strstr(err.text, "its network has another shape"));
        rx_model_free(first);
        rx_model_free(model);
        remove(path);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(begins_with_the_same_function),
        cmocka_unit_test(other_shapes_are_refused),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
