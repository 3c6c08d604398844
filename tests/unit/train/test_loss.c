/* train/loss: weights and terms against their definitions and numpy. Gradients: test_step.c, of whole steps. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "nn/front.h"
#include "train/loss.h"

enum { LARGEST = 32 };

/* The images of the numpy commands below. */
static void waves(int side, float *out, float *truth)
{
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) {
            out[y * side + x] = (float)(8 * sin(0.7 * x + 0.3 * y) + 3 * cos(1.9 * x - 1.1 * y) + 2);
            truth[y * side + x] = (float)(40 * exp(-((x - 8.3) * (x - 8.3) + (y - 6.1) * (y - 6.1)) / 6.0));
        }
}

static void near(const char *what, double expected, double found, double share)
{
    if (!(fabs(expected - found) <= share * fabs(expected)))
        fail_msg("%s: %.9g instead of %.9g", what, found, expected);
}

/* ---- weights ---- */

/* Gauss(1.5 px) integrated over pixels, normalised inside the patch, of max(input, 0) */
static double smooth_at(const float *input, int side, int x0, int y0)
{
    double sum = 0, share = 0;
    for (int y = y0 - 8; y <= y0 + 8; y++)
        for (int x = x0 - 8; x <= x0 + 8; x++) {
            if (x < 0 || y < 0 || x >= side || y >= side)
                continue;
            const double s = 1.5 * sqrt(2.0);
            const double g = (erf((x - x0 + 0.5) / s) - erf((x - x0 - 0.5) / s)) *
                             (erf((y - y0 + 0.5) / s) - erf((y - y0 - 0.5) / s));
            sum += g * fmax(input[y * side + x], 0);
            share += g;
        }
    return sum / share;
}

static void check_weights(float corner)
{
    enum { SIDE = 24 };
    static float input[SIDE * SIDE], weight[SIDE * SIDE], work[2 * SIDE * SIDE];
    static double smooth[SIDE * SIDE];
    for (int k = 0; k < SIDE * SIDE; k++)
        input[k] = (float)rx_random_normal(1, 1, (uint64_t)k);
    for (int k = 0; k < SIDE * SIDE; k++)
        weight[k] = work[k] = 7; /* of no meaning */
    input[5 * SIDE + 20] = 400;
    input[0] = corner;
    input[18 * SIDE + 4] = -1000; /* not light */
    rx_loss_weights(input, SIDE, 10, work, weight);
    for (int k = 0; k < SIDE * SIDE; k++)
        smooth[k] = smooth_at(input, SIDE, k % SIDE, k / SIDE);
    for (int k = 0; k < SIDE * SIDE; k++) {
        double most = 0;
        for (int i = 0; i < SIDE * SIDE; i++)
            if (abs(i % SIDE - k % SIDE) <= 3 && abs(i / SIDE - k / SIDE) <= 3)
                most = fmax(most, smooth[i]);
        near("weight", 100 / (100 + most * most), weight[k], 1e-5);
    }
    assert_true(weight[5 * SIDE + 20] < 0.15f);
    assert_true(weight[18 * SIDE + 4] > 0.98f);
}

static void weights_by_definition(void **state)
{
    check_weights(90);
    check_weights(1e8f); /* shows the outermost weights of the Gaussian */
}

/* ---- squared errors ---- */

typedef struct rx_pixels_case {
    rx_loss_kind kind;
    int side, margin;
    const float *truth, *weight;
} rx_pixels_case;

static double stretch(double v)
{
    return copysign(sqrt(fabs(v) + 0.25) - 0.5, v);
}

static double pixels_term(const double *out, const rx_pixels_case *c)
{
    const int inner = c->side - 2 * c->margin;
    double sum = 0;
    for (int y = c->margin; y < c->side - c->margin; y++)
        for (int x = c->margin; x < c->side - c->margin; x++) {
            const int k = y * c->side + x;
            const double d =
                c->kind == RX_LOSS_STRETCHED ? stretch(out[k]) - stretch(c->truth[k]) : out[k] - c->truth[k];
            sum += (c->kind == RX_LOSS_LINEAR ? c->weight[k] : 1) * d * d;
        }
    return sum / (inner * inner);
}

static void squares_of_pixels(void **state)
{
    enum { SIDE = 16, MARGIN = 3 };
    static float out[SIDE * SIDE], truth[SIDE * SIDE], weight[SIDE * SIDE], gradient[SIDE * SIDE];
    static const char *const name[] = {"linear", "plain", "stretched"};
    waves(SIDE, out, truth);
    for (int k = 0; k < SIDE * SIDE; k++)
        weight[k] = (float)rx_random_uniform(2, 1, (uint64_t)k);
    for (int kind = 0; kind < 3; kind++) {
        const rx_pixels_case c = {(rx_loss_kind)kind, SIDE, MARGIN, truth, weight};
        const rx_loss loss = {c.kind, SIDE, MARGIN, weight};
        double plane[SIDE * SIDE], value = 7, alone = 0;
        for (int k = 0; k < SIDE * SIDE; k++)
            plane[k] = out[k];
        memset(gradient, 0, sizeof gradient);
        rx_loss_pixels(&loss, out, truth, 0.4, &value, gradient);
        near(name[kind], 7 + 0.4 * pixels_term(plane, &c), value, 1e-6);
        rx_loss_pixels(&loss, out, truth, 0.4, &alone, NULL);
        near("without gradient", value - 7, alone, 1e-12);
        const float before = gradient[5 * SIDE + 6];
        rx_loss_pixels(&loss, out, truth, 0.4, &value, gradient);
        near("gradients add up", 2 * before, gradient[5 * SIDE + 6], 1e-6);
    }
}

/* A Gaussian of sigma 1.5 pixels, over the pixel at a distance of i; out to 8 pixels, sum 1. */
static double gauss(int i)
{
    enum { RADIUS = 8 };
    const double unit = 1 / (1.5 * sqrt(2));
    return abs(i) > RADIUS
               ? 0
               : (erf((i + 0.5) * unit) - erf((i - 0.5) * unit)) / (2 * erf((RADIUS + 0.5) * unit));
}

/* The light by its definition, in two dimensions at once. */
static double light_term(const double *out, const rx_pixels_case *c)
{
    const int from = c->margin, to = c->side - c->margin;
    double sum = 0;
    for (int y = from; y < to; y++)
        for (int x = from; x < to; x++) {
            double light = 0;
            for (int v = from; v < to; v++)
                for (int u = from; u < to; u++)
                    light += gauss(u - x) * gauss(v - y) * (out[v * c->side + u] - c->truth[v * c->side + u]);
            sum += (c->kind == RX_LOSS_LINEAR ? c->weight[y * c->side + x] : 1) * light * light;
        }
    return sum / ((to - from) * (to - from));
}

static void squares_of_light(void **state)
{
    enum { SIDE = 26, MARGIN = 3 };
    static float out[SIDE * SIDE], truth[SIDE * SIDE], weight[SIDE * SIDE], gradient[SIDE * SIDE],
        work[2 * SIDE * SIDE];
    static double plane[SIDE * SIDE];
    waves(SIDE, out, truth);
    for (int k = 0; k < SIDE * SIDE; k++) {
        weight[k] = (float)rx_random_uniform(3, 1, (uint64_t)k);
        plane[k] = out[k];
    }
    for (int kind = 0; kind < 2; kind++) {
        const rx_pixels_case c = {(rx_loss_kind)kind, SIDE, MARGIN, truth, weight};
        const rx_loss loss = {c.kind, SIDE, MARGIN, weight};
        double value = 7, alone = 0;
        memset(gradient, 0, sizeof gradient);
        rx_loss_light(&loss, out, truth, 0.4, work, &value, gradient);
        near("light", 7 + 0.4 * light_term(plane, &c), value, 1e-6);
        rx_loss_light(&loss, out, truth, 0.4, work, &alone, NULL);
        near("without gradient", value - 7, alone, 1e-12);
    }
}

/* ---- focal frequency loss ---- */

/* /usr/bin/python3 -c '
import numpy as np
def s(v): return np.sign(v)*(np.sqrt(abs(v)+.25)-.5)
for side, margin in ((20, 3), (15, 3), (16, 0), (9, 4)):
    y, x = np.mgrid[:side, :side]
    a = (8*np.sin(.7*x+.3*y)+3*np.cos(1.9*x-1.1*y)+2).astype(np.float32).astype(float)
    b = (40*np.exp(-((x-8.3)**2+(y-6.1)**2)/6)).astype(np.float32).astype(float)
    c = slice(margin, side-margin)
    D = np.fft.fft2((s(a)-s(b))[c, c], norm="ortho"); w = abs(D)/abs(D).max(); n = (side-2*margin)**2
    g = 2/n*np.fft.ifft2(w*D, norm="ortho").real*.5/np.sqrt(abs(a[c, c])+.25)
    print("{%d, %d, %.9f, %.9f}," % (side, margin, (w*abs(D)**2).mean(), g[-1, 0]))' */
static void frequencies_against_numpy(void **state)
{
    static const struct {
        int side, margin;
        double value, gradient; /* by the first pixel of the window's last row: weights stay as they are */
    } expected[] = {{20, 3, 2.860592070, 0.002100021},
                    {15, 3, 3.222616568, -0.012365562},
                    {16, 0, 2.706944328, -0.001572380},
                    {9, 4, 7.643876860, -1.023330930}};
    static float out[LARGEST * LARGEST], truth[LARGEST * LARGEST];
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        const int side = expected[i].side, margin = expected[i].margin;
        rx_ffl *ffl = NULL;
        double value = 3, alone = 0;
        float gradient[LARGEST * LARGEST] = {0};
        waves(side, out, truth);
        assert_int_equal(rx_ffl_new(side, margin, &ffl, NULL), RX_OK);
        rx_ffl_add(ffl, out, truth, 0.5, &value, gradient);
        rx_ffl_add(ffl, out, truth, 1, &alone, NULL);
        near("frequencies", expected[i].value, (value - 3) / 0.5, 3e-6);
        near("frequencies, without gradient", expected[i].value, alone, 3e-6);
        near("gradient", 0.5 * expected[i].gradient, gradient[(side - margin - 1) * side + margin], 1e-3);
        rx_ffl_free(ffl);
    }
}

static void equal_images(void **state)
{
    enum { SIDE = 12 };
    float out[SIDE * SIDE], truth[SIDE * SIDE], gradient[SIDE * SIDE] = {0};
    rx_ffl *ffl = NULL;
    double value = 0;
    waves(SIDE, out, truth);
    assert_int_equal(rx_ffl_new(SIDE, 2, &ffl, NULL), RX_OK);
    rx_ffl_add(ffl, truth, truth, 1, &value, gradient);
    assert_true(value == 0);
    for (int k = 0; k < SIDE * SIDE; k++)
        assert_true(gradient[k] == 0);
    out[40] = NAN;
    rx_ffl_add(ffl, out, truth, 1, &value, gradient);
    assert_true(isnan(value));
    rx_ffl_free(ffl);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_by_definition), cmocka_unit_test(squares_of_pixels),
        cmocka_unit_test(squares_of_light),      cmocka_unit_test(frequencies_against_numpy),
        cmocka_unit_test(equal_images),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
