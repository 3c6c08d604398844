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
    return x < 0 || y < 0 || x >= W || y >= H ? 0 : stretch(f->planes[c][y * W + x]);
}

/* A network of so many planes, the base being the last one. */
static void check(int planes)
{
    const rx_node nodes[] = {
        {.op = RX_OP_INPUT, .src = -1, .add = -1, .channels = planes},
        {.op = RX_OP_CONV, .src = 0, .add = -1, .channels = 1, .kernel = 3, .stride = 1}};
    rx_net *net = NULL;
    rx_psf *psf = sky_psf_varying(4, 0.2, W);
    rx_network_optics *optics = NULL;
    float *plane[RX_SECOND_CHANNELS] = {NULL}, *v = calloc(AREA, sizeof *v);
    assert_int_equal(rx_net_new(nodes, 2, &net, NULL), RX_OK);
    rx_net_initialise(net, 5, 0, 1, 1);
    const float *w = net->params;
    net->params[9 * planes] = 0.7f; /* bias */
    rx_network_forward f = {
        .model = "m", .net = net, .width = W, .height = H, .nthreads = 1, .nplanes = planes, .v = v};
    for (int c = 0; c < planes; c++) {
        if (c == 2)
            continue; /* the FWHM */
        assert_non_null(plane[c] = calloc(AREA, sizeof *plane[c]));
        for (int k = 0; k < AREA; k++)
            plane[c][k] = (float)(5 * rx_random_normal(1, (uint64_t)c, (uint64_t)k));
        f.planes[c] = f.base = plane[c];
    }
    const rx_blocks blocks = rx_network_forward_blocks(&f, 32, 2, 4);
    assert_true(blocks.nx > 1);
    const rx_image image = {.width = W, .height = H, .psf = psf};
    assert_int_equal(rx_network_optics_new(&image, 2, 0, &blocks, 1, &optics, NULL), RX_OK);
    f.optics = optics;
    assert_int_equal(rx_network_forward_run(&f, &blocks, NULL, NULL), RX_OK);
    for (int k = 0; k < AREA; k++) {
        double sum = stretch(f.base[k]) + 0.7;
        for (int i = 0; i < 9 * planes; i++)
            sum += w[i] * input(&f, i / 9, k % W + i % 3 - 1, k / W + i / 3 % 3 - 1);
        assert_near(v[k], copysign(sum * sum + fabs(sum), sum), 1e-4 * (1 + sum * sum));
    }
    rx_network_optics_free(optics);
    rx_psf_free(psf);
    rx_net_free(net);
    for (int c = 0; c < planes; c++)
        free(plane[c]);
    free(v);
}

static void one_convolution(void **state)
{
    (void)state;
    check(rx_front_channels(RX_MODE_BLIND));
    check(rx_front_channels(RX_MODE_INFORMED));
    check(RX_SECOND_CHANNELS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_convolution)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
