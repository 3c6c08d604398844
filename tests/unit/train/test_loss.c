/* train/loss: weights and terms against their definitions and numpy, gradients by finite differences. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "nn/front.h"
#include "train/loss.h"

enum { LARGEST = 32 };
static const double PI = 3.14159265358979323846;

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
    (void)state;
    check_weights(90);
    check_weights(1e8f); /* shows the outermost weights of the Gaussian */
}

/* ---- squared errors ---- */

/* value of a term, by the definition, in double */
typedef double term(const double *out, const void *user);

typedef struct rx_pixels_case {
    rx_loss_kind kind;
    int side, margin;
    const float *truth, *weight;
} rx_pixels_case;

static double stretch(double v)
{
    return copysign(sqrt(fabs(v) + 0.25) - 0.5, v);
}

static double pixels_term(const double *out, const void *user)
{
    const rx_pixels_case *c = user;
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

/* The gradient, times scale, at every fifth pixel and of all beyond the margin: 0. */
static void check_gradient(const char *what, term *value, const void *user, const float *out, int side,
                           int margin, double scale, const float *gradient)
{
    static double plane[LARGEST * LARGEST];
    int checked = 0;
    double largest = 0;
    for (int k = 0; k < side * side; k++) {
        plane[k] = out[k];
        largest = fmax(largest, fabs(gradient[k]));
    }
    assert_true(largest > 0);
    for (int k = 0; k < side * side; k++) {
        const int x = k % side, y = k / side;
        if (x < margin || y < margin || x >= side - margin || y >= side - margin) {
            assert_true(gradient[k] == 0);
            continue;
        }
        if (k % 5 != 0)
            continue;
        const double h = 1e-5, kept = plane[k];
        plane[k] = kept + h;
        const double above = value(plane, user);
        plane[k] = kept - h;
        const double expected = scale * (above - value(plane, user)) / (2 * h);
        plane[k] = kept;
        checked++;
        if (!(fabs(expected - gradient[k]) <= 2e-5 * largest))
            fail_msg("%s, pixel (%d, %d): gradient %.8g, finite differences %.8g", what, x, y, gradient[k],
                     expected);
    }
    assert_true(checked > 10);
}

static void squares_of_pixels(void **state)
{
    (void)state;
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
        check_gradient(name[kind], pixels_term, &c, out, SIDE, MARGIN, 0.4, gradient);
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
static double light_term(const double *out, const void *user)
{
    const rx_pixels_case *c = user;
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
    (void)state;
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
        check_gradient("light", light_term, &c, out, SIDE, MARGIN, 0.4, gradient);
        rx_loss_light(&loss, out, truth, 0.4, work, &alone, NULL);
        near("without gradient", value - 7, alone, 1e-12);
    }
}

/* A star put a third of a pixel aside: the pixels say much, the light says little. One of a fifth too much: the other way round. */
static void light_is_not_place(void **state)
{
    (void)state;
    enum { SIDE = 32 };
    static float truth[SIDE * SIDE], aside[SIDE * SIDE], brighter[SIDE * SIDE], work[2 * SIDE * SIDE];
    const rx_loss loss = {RX_LOSS_PLAIN, SIDE, 0, NULL};
    double pixels[2] = {0, 0}, light[2] = {0, 0};
    for (int k = 0; k < SIDE * SIDE; k++) {
        const double x = k % SIDE - 16.2, y = k / SIDE - 15.9;
        truth[k] = (float)(100 * exp(-(x * x + y * y) / 1.5));
        aside[k] = (float)(100 * exp(-((x - 0.33) * (x - 0.33) + y * y) / 1.5));
        brighter[k] = 1.2F * truth[k];
    }
    rx_loss_pixels(&loss, aside, truth, 1, &pixels[0], NULL);
    rx_loss_pixels(&loss, brighter, truth, 1, &pixels[1], NULL);
    rx_loss_light(&loss, aside, truth, 1, work, &light[0], NULL);
    rx_loss_light(&loss, brighter, truth, 1, work, &light[1], NULL);
    assert_true(pixels[0] > pixels[1]);
    assert_true(light[0] < 0.5 * light[1]);
}

/* ---- focal frequency loss ---- */

/* /usr/bin/python3 -c '
import numpy as np
def s(v): return np.sign(v)*(np.sqrt(abs(v)+.25)-.5)
for side, margin in ((20, 3), (15, 3), (16, 0), (9, 4)):
    y, x = np.mgrid[:side, :side]
    a = (8*np.sin(.7*x+.3*y)+3*np.cos(1.9*x-1.1*y)+2).astype(np.float32).astype(float)
    b = (40*np.exp(-((x-8.3)**2+(y-6.1)**2)/6)).astype(np.float32).astype(float)
    D = abs(np.fft.fft2((s(a)-s(b))[margin:side-margin, margin:side-margin], norm="ortho"))
    print("{%d, %d, %.9f}," % (side, margin, (np.clip(D/D.max(), 0, 1)*D**2).mean()))' */
static void frequencies_against_numpy(void **state)
{
    (void)state;
    static const struct {
        int side, margin;
        double value;
    } expected[] = {{20, 3, 2.860592070}, {15, 3, 3.222616568}, {16, 0, 2.706944328}, {9, 4, 7.643876860}};
    static float out[LARGEST * LARGEST], truth[LARGEST * LARGEST];
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        rx_ffl *ffl = NULL;
        double value = 3, alone = 0;
        float gradient[LARGEST * LARGEST] = {0};
        waves(expected[i].side, out, truth);
        assert_int_equal(rx_ffl_new(expected[i].side, expected[i].margin, &ffl, NULL), RX_OK);
        rx_ffl_add(ffl, out, truth, 0.5, &value, gradient);
        rx_ffl_add(ffl, out, truth, 1, &alone, NULL);
        near("frequencies", expected[i].value, (value - 3) / 0.5, 3e-6);
        near("frequencies, without gradient", expected[i].value, alone, 3e-6);
        rx_ffl_free(ffl);
    }
}

typedef struct rx_ffl_case {
    int side, margin;
    const float *truth;
    double weight[LARGEST * LARGEST]; /* w of each frequency, as at the start: the loss holds it constant */
} rx_ffl_case;

/* |D(v, u)|^2 by the sum that defines it */
static void power(const rx_ffl_case *c, const double *out, double *dst)
{
    static double re[LARGEST][LARGEST], im[LARGEST][LARGEST];
    const int n = c->side - 2 * c->margin;
    for (int y = 0; y < n; y++)
        for (int u = 0; u < n; u++) {
            re[y][u] = im[y][u] = 0;
            for (int x = 0; x < n; x++) {
                const int k = (y + c->margin) * c->side + x + c->margin;
                const double d = stretch(out[k]) - stretch(c->truth[k]);
                re[y][u] += d * cos(2 * PI * u * x / n) / n;
                im[y][u] -= d * sin(2 * PI * u * x / n) / n;
            }
        }
    for (int v = 0; v < n; v++)
        for (int u = 0; u < n; u++) {
            double zr = 0, zi = 0;
            for (int y = 0; y < n; y++) {
                const double cosine = cos(2 * PI * v * y / n), sine = -sin(2 * PI * v * y / n);
                zr += re[y][u] * cosine - im[y][u] * sine;
                zi += re[y][u] * sine + im[y][u] * cosine;
            }
            dst[v * n + u] = zr * zr + zi * zi;
        }
}

static double frozen_term(const double *out, const void *user)
{
    static double square[LARGEST * LARGEST];
    const rx_ffl_case *c = user;
    const int n = c->side - 2 * c->margin;
    double sum = 0;
    power(c, out, square);
    for (int k = 0; k < n * n; k++)
        sum += c->weight[k] * square[k];
    return sum / (n * n);
}

/* Finite differences of the loss with w as it is at `out`: that is what "constant for the gradient" means. */
static void check_frequencies(int side, int margin)
{
    static float out[LARGEST * LARGEST], truth[LARGEST * LARGEST], gradient[LARGEST * LARGEST];
    static double plane[LARGEST * LARGEST];
    static rx_ffl_case c;
    rx_ffl *ffl = NULL;
    double value = 0, most = 0;
    const int n = side - 2 * margin;
    waves(side, out, truth);
    c.side = side;
    c.margin = margin;
    c.truth = truth;
    for (int k = 0; k < side * side; k++)
        plane[k] = out[k];
    power(&c, plane, c.weight);
    for (int k = 0; k < n * n; k++)
        most = fmax(most, c.weight[k]);
    for (int k = 0; k < n * n; k++)
        c.weight[k] = sqrt(c.weight[k] / most);
    memset(gradient, 0, sizeof gradient);
    assert_int_equal(rx_ffl_new(side, margin, &ffl, NULL), RX_OK);
    rx_ffl_add(ffl, out, truth, 0.3, &value, gradient);
    near("frequencies", 0.3 * frozen_term(plane, &c), value, 3e-6);
    check_gradient("frequencies", frozen_term, &c, out, side, margin, 0.3, gradient);
    rx_ffl_free(ffl);
}

static void gradient_of_frequencies(void **state)
{
    (void)state;
    check_frequencies(18, 3); /* even: the last column of the half spectrum counts once */
    check_frequencies(17, 4); /* odd: twice */
}

static void equal_images_and_none(void **state)
{
    (void)state;
    enum { SIDE = 12 };
    float out[SIDE * SIDE], truth[SIDE * SIDE], gradient[SIDE * SIDE] = {0};
    rx_ffl *ffl = NULL;
    rx_error err = RX_ERROR_NONE;
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
    assert_int_equal(rx_ffl_new(SIDE, 6, &ffl, &err), RX_USAGE);
    assert_null(ffl);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_by_definition),     cmocka_unit_test(squares_of_pixels),
        cmocka_unit_test(squares_of_light),          cmocka_unit_test(light_is_not_place),
        cmocka_unit_test(frequencies_against_numpy), cmocka_unit_test(gradient_of_frequencies),
        cmocka_unit_test(equal_images_and_none),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
