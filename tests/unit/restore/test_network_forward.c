/* What a network on a tile is given and what its output is added to: one convolution, by the definition. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
/* cmocka.h comes after the headers it needs */
#include <cmocka.h>

#include "../near.h"
#include "restore/network_forward.h"
#include "sky.h"

enum { W = 90, H = 61, AREA = W * H };

static double stretch(double v)
{
    return copysign(sqrt(fabs(v) + 0.25) - 0.5, v);
}

/* What plane c of the network's input has: stretched planes with nothing beyond the border, and the FWHM. */
static double input(const rx_network_forward *f, int c, int x, int y)
{
    float fwhm;
    if (c == 2) {
        rx_otf_fwhm_row(&f->optics->grid, y, x, 1, &fwhm);
        return (fwhm - 5.0) / 3;
    }
    return x < 0 || y < 0 || x >= W || y >= H ? 0 : stretch((c == 0 ? f->x : f->base)[y * W + x]);
}

static void check(rx_mode mode)
{
    const int planes = rx_front_channels(mode);
    const rx_node nodes[] = {
        {.op = RX_OP_INPUT, .src = -1, .add = -1, .channels = planes},
        {.op = RX_OP_CONV, .src = 0, .add = -1, .channels = 1, .kernel = 3, .stride = 1}};
    rx_model *model = rx_model_new();
    rx_psf *psf = sky_psf_varying(4, 0.2, W);
    rx_network_optics *optics = NULL;
    float *x = calloc(AREA, sizeof *x), *base = calloc(AREA, sizeof *base), *v = calloc(AREA, sizeof *v);
    assert_int_equal(rx_net_new(nodes, 2, &model->restore, NULL), RX_OK);
    rx_net_initialise(model->restore, 5, 0, 1, 1);
    const float *w = model->restore->params;
    model->restore->params[9 * planes] = 0.7f; /* bias */
    model->front = (rx_front){.mode = mode, .target_fwhm = 2, .tikhonov = 0.02, .pedestal = 1};
    for (int k = 0; k < AREA; k++) {
        x[k] = (float)(5 * rx_random_normal(1, 1, (uint64_t)k));
        base[k] = mode == RX_MODE_INFORMED ? (float)(5 * rx_random_normal(1, 2, (uint64_t)k)) : x[k];
    }
    rx_network_forward f = {
        .model = model, .width = W, .height = H, .nthreads = 1, .x = x, .base = base, .v = v};
    const rx_blocks blocks = rx_network_forward_blocks(&f, 32, 2, 4);
    assert_true(blocks.nx > 1);
    const rx_image image = {.width = W, .height = H, .psf = psf};
    assert_int_equal(rx_network_optics_new(&image, 2, 0, &blocks, 1, &optics, NULL), RX_OK);
    f.optics = optics;
    assert_int_equal(rx_network_forward_run(&f, &blocks, NULL, NULL), RX_OK);
    for (int k = 0; k < AREA; k++) {
        double sum = stretch(base[k]) + 0.7;
        for (int i = 0; i < 9 * planes; i++)
            sum += w[i] * input(&f, i / 9, k % W + i % 3 - 1, k / W + i / 3 % 3 - 1);
        assert_near(v[k], copysign(sum * sum + fabs(sum), sum), 1e-4 * (1 + sum * sum));
    }
    rx_network_optics_free(optics);
    rx_psf_free(psf);
    rx_model_free(model);
    free(x);
    free(base);
    free(v);
}

static void one_convolution(void **state)
{
    (void)state;
    check(RX_MODE_BLIND);
    check(RX_MODE_INFORMED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_convolution)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
