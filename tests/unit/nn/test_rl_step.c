/* nn/rl_step: the step and its gradients against direct sums in double. */
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "nn/rl_step.h"

enum { W = 22, H = 18, PIXELS = W * H, SIZE = 7 };
static const double PEDESTAL = 1;

/* ---- the step by its definition, dense planes ---- */

typedef struct rx_reference {
    double kernel[SIZE * SIZE], f[PIXELS], x[PIXELS], weight[PIXELS];
    int weighted;
} rx_reference;

/* dst(p) = sum_u K(u) src(p - u), or p + u */
static void blur(const double *kernel, const double *src, int sign, double *dst)
{
    for (int p = 0; p < PIXELS; p++) {
        double sum = 0;
        for (int k = 0; k < SIZE * SIZE; k++) {
            const int dx = sign * (k % SIZE - SIZE / 2), dy = sign * (k / SIZE - SIZE / 2);
            sum += kernel[k] * src[(p / W - dy + H) % H * W + (p % W - dx + W) % W];
        }
        dst[p] = sum;
    }
}

static void step_reference(const rx_reference *s, double *out)
{
    double m[PIXELS], c[PIXELS], q[PIXELS], light[PIXELS], sum = 0;
    for (int k = 0; k < SIZE * SIZE; k++)
        sum += s->kernel[k];
    for (int p = 0; p < PIXELS; p++)
        light[p] = fmax(s->f[p], 0);
    blur(s->kernel, light, 1, m);
    for (int p = 0; p < PIXELS; p++) {
        const double weight = s->weighted ? s->weight[p] : 1;
        m[p] = weight * (s->x[p] + PEDESTAL) / fmax(m[p] + PEDESTAL, PEDESTAL / 4);
    }
    blur(s->kernel, m, -1, c);
    blur(s->kernel, s->weight, -1, q);
    for (int p = 0; p < PIXELS; p++) {
        const double share = s->weighted ? q[p] : sum;
        const int made = s->f[p] > 0 && share >= (double)RX_RL_SHARE;
        const double gain = fmin(fmax(c[p] / share, (double)RX_RL_LEAST), (double)RX_RL_MOST);
        out[p] = made ? s->f[p] * gain : s->f[p];
    }
}

static double weighted_sum(const rx_reference *s, const double *dout)
{
    double out[PIXELS], sum = 0;
    step_reference(s, out);
    for (int p = 0; p < PIXELS; p++)
        sum += dout[p] * out[p];
    return sum;
}

/* ---- the same on planes ---- */

typedef struct rx_bench {
    rx_fft *fft;
    rx_rl_kernel kernel;
    rx_rl_step *step;
    float *f, *x, *weight, *out, *dout, *df, *dx;
} rx_bench;

static void bench_new(rx_bench *b, int width, int height)
{
    assert_int_equal(rx_fft_new(width, height, 1, &b->fft, NULL), RX_OK);
    assert_int_equal(rx_rl_step_new(b->fft, &b->kernel, &b->step, NULL), RX_OK);
    float **planes[] = {&b->f, &b->x, &b->weight, &b->out, &b->dout, &b->df, &b->dx};
    for (int i = 0; i < 7; i++)
        assert_non_null(*planes[i] = rx_fft_real(b->fft));
    assert_non_null(b->kernel.spectrum = rx_fft_complex(b->fft));
}

static void bench_free(rx_bench *b)
{
    rx_rl_step_free(b->step);
    free(b->kernel.spectrum);
    rx_fft_free(b->fft);
    float *planes[] = {b->f, b->x, b->weight, b->out, b->dout, b->df, b->dx};
    for (int i = 0; i < 7; i++)
        free(planes[i]);
}

static float *pixel(const rx_bench *b, float *plane, int p)
{
    const int width = rx_fft_width(b->fft);
    return plane + (size_t)(p / width) * (size_t)rx_fft_stride_real(b->fft) + (size_t)(p % width);
}

/* A lopsided kernel with negative lobes, faint and bright pixels, a negative pixel beside a bright one, a
 * model low enough for the limit p/4, a bright pixel in the data that f does not have, and a corner without
 * data. */
static void make_case(rx_reference *s, int weighted)
{
    for (int k = 0; k < SIZE * SIZE; k++) {
        const double x = k % SIZE - 3.4, y = k / SIZE - 2.7;
        s->kernel[k] = (float)(0.12 * exp(-(x * x + 0.7 * y * y + 0.3 * x * y) / 3) - 0.012);
    }
    for (int p = 0; p < PIXELS; p++) {
        s->f[p] = (float)exp(2 * rx_random_normal(3, 1, (uint64_t)p));
        s->x[p] = (float)(3 + 2 * rx_random_normal(3, 2, (uint64_t)p));
        s->weight[p] = p % W < 12 && p / W < 11 ? 0 : (float)rx_random_uniform(3, 3, (uint64_t)p);
        if (p % 3 == 0)
            s->f[p] = (float)(-0.5 * rx_random_uniform(3, 4, (uint64_t)p));
    }
    s->f[10 * W + 8] = 900;
    s->x[10 * W + 8] = 40;
    s->f[10 * W + 9] = -8;
    s->x[13 * W + 17] = 2000;
    s->weighted = weighted;
}

static void load(const rx_reference *s, rx_bench *b, const double *dout)
{
    float kernel[SIZE * SIZE];
    for (int k = 0; k < SIZE * SIZE; k++)
        kernel[k] = (float)s->kernel[k];
    rx_rl_kernel_set(b->fft, kernel, SIZE, &b->kernel);
    for (int p = 0; p < PIXELS; p++) {
        *pixel(b, b->f, p) = (float)s->f[p];
        *pixel(b, b->x, p) = (float)s->x[p];
        *pixel(b, b->weight, p) = (float)s->weight[p];
        *pixel(b, b->dout, p) = (float)dout[p];
    }
}

/* Are the branches of the definition all met in this case? */
static void check_case(const rx_reference *s)
{
    double m[PIXELS], q[PIXELS], light[PIXELS];
    int low = 0, blind = 0, most = 0, least = 0;
    for (int p = 0; p < PIXELS; p++)
        light[p] = fmax(s->f[p], 0);
    blur(s->kernel, light, 1, m);
    blur(s->kernel, s->weight, -1, q);
    for (int p = 0; p < PIXELS; p++) {
        low += m[p] < -0.75 * PEDESTAL;
        blind += q[p] < (double)RX_RL_SHARE;
    }
    assert_true(low > 0);
    assert_true(low < PIXELS / 4);
    assert_true(blind > 0);
    assert_true(blind < PIXELS / 2);
    step_reference(s, m);
    for (int p = 0; p < PIXELS; p++) {
        most += s->f[p] > 0 && m[p] == s->f[p] * (double)RX_RL_MOST;
        least += s->f[p] > 0 && m[p] == s->f[p] * (double)RX_RL_LEAST;
    }
    assert_true(least > 0);
    assert_true(least < PIXELS / 4);
    assert_true(most > 0);
    assert_true(most < PIXELS / 4);
}

static void hold(const char *what, int p, double expected, double found, double scale)
{
    if (!(fabs(expected - found) <= 2e-5 * scale + 1e-4 * fabs(expected)))
        fail_msg("%s, pixel %d: %.8g instead of %.8g", what, p, found, expected);
}

/* (L(v + h) - L(v - h)) / 2h, and with 2h: no error of second order left */
static double difference(rx_reference *s, const double *dout, double *v)
{
    const double h = 1e-4, kept = *v;
    double side[4];
    for (int i = 0; i < 4; i++) {
        *v = kept + (i < 2 ? h : 2 * h) * (i % 2 == 0 ? 1 : -1);
        side[i] = weighted_sum(s, dout);
    }
    *v = kept;
    return (4 * (side[0] - side[1]) / (2 * h) - (side[2] - side[3]) / (4 * h)) / 3;
}

static void check_case_of(int weighted)
{
    static rx_reference s;
    static double dout[PIXELS], out[PIXELS];
    rx_bench b;
    bench_new(&b, W, H);
    make_case(&s, weighted);
    check_case(&s);
    for (int p = 0; p < PIXELS; p++)
        dout[p] = (float)rx_random_normal(3, 9, (uint64_t)p);
    load(&s, &b, dout);
    const float *weight = weighted ? b.weight : NULL;
    rx_rl_step_forward(b.step, b.f, b.x, weight, PEDESTAL, b.out);
    rx_rl_step_backward(b.step, b.dout, b.df, b.dx);
    step_reference(&s, out);
    for (int p = 0; p < PIXELS; p++)
        hold("step", p, out[p], *pixel(&b, b.out, p), 10);
    for (int p = 0; p < PIXELS; p += 5) {
        hold("gradient by f", p, difference(&s, dout, &s.f[p]), *pixel(&b, b.df, p), 10);
        hold("gradient by x", p, difference(&s, dout, &s.x[p]), *pixel(&b, b.dx, p), 10);
    }
    const int special[] = {10 * W + 8, 10 * W + 9, 10 * W + 10, 5 * W + 5, 13 * W + 16, 12 * W + 17};
    for (int i = 0; i < 6; i++)
        hold("gradient by f", special[i], difference(&s, dout, &s.f[special[i]]),
             *pixel(&b, b.df, special[i]), 10);
    bench_free(&b);
}

static void step_and_gradients(void **state)
{
    check_case_of(0);
    check_case_of(1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(step_and_gradients)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
