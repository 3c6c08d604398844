/* Splines: evaluation at any place of the pixel grid, and the adjoint. */
#include "psf/psf_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"

rx_status rx_psf_model_new(int m, int half, int reach, int width, int height, rx_psf_model *dst,
                           rx_error *err)
{
    *dst = (rx_psf_model){.m = m, .half = half, .nterms = 1};
    dst->middle = m * half + (m + 1) / 2 + 2;
    dst->side = 2 * dst->middle + 1;
    dst->x0 = 0.5 * (width - 1);
    dst->y0 = 0.5 * (height - 1);
    dst->xs = fmax(dst->x0, 1.0);
    dst->ys = fmax(dst->y0, 1.0);
    dst->nwing = (int)(reach / RX_PSF_WING_STEP) + 2;
    dst->c = RX_NEW(float, RX_PSF_TERMS *(size_t)dst->side *(size_t)dst->side);
    dst->wing = RX_NEW(float, (size_t)dst->nwing);
    if (dst->c != NULL && dst->wing != NULL)
        return RX_OK;
    rx_psf_model_free(dst);
    return rx_error_memory(err, 0);
}

void rx_psf_model_free(rx_psf_model *model)
{
    free(model->c);
    free(model->wing);
    *model = (rx_psf_model){.m = 0};
}

/* Lower degrees come first. */
int rx_psf_model_powers(int degree, int px[RX_PSF_TERMS], int py[RX_PSF_TERMS])
{
    int n = 0;
    for (int d = 0; d <= degree; d++)
        for (int j = 0; j <= d; j++) {
            px[n] = d - j;
            py[n++] = j;
        }
    return n;
}

static void legendre(double t, double value[RX_PSF_DEGREE + 1])
{
    value[0] = 1.0;
    value[1] = t;
    for (int i = 2; i <= RX_PSF_DEGREE; i++)
        value[i] = ((2 * i - 1) * t * value[i - 1] - (i - 1) * value[i - 2]) / i;
}

void rx_psf_model_terms(const rx_psf_model *model, double x, double y, double terms[RX_PSF_TERMS])
{
    int px[RX_PSF_TERMS], py[RX_PSF_TERMS];
    double in_x[RX_PSF_DEGREE + 1], in_y[RX_PSF_DEGREE + 1];
    legendre(fmax(fmin((x - model->x0) / model->xs, 1.0), -1.0), in_x);
    legendre(fmax(fmin((y - model->y0) / model->ys, 1.0), -1.0), in_y);
    rx_psf_model_powers(model->degree, px, py);
    for (int k = 0; k < model->nterms; k++)
        terms[k] = in_x[px[k]] * in_y[py[k]];
}

RX_SIMD void rx_psf_model_mix(const rx_psf_model *model, const float *planes,
                              const double terms[RX_PSF_TERMS], int nterms, float *dst)
{
    const size_t n = (size_t)model->side * (size_t)model->side;
    memcpy(dst, planes, n * sizeof *dst);
    for (int k = 1; k < nterms; k++) {
        const float factor = (float)terms[k], *plane = planes + (size_t)k * n;
#pragma omp simd
        for (size_t i = 0; i < n; i++)
            dst[i] += factor * plane[i];
    }
}

/* Where the taps of a stamp's first pixel begin, their weights and the derivatives of these by the shift. */
typedef struct taps {
    int first;
    float weight[4], slope[4];
} taps;

static taps taps_of(const rx_psf_model *model, double shift, int half)
{
    const double at = (-half - shift) * model->m + model->middle, below = floor(at), t = at - below,
                 s = 1.0 - t;
    const float scale = (float)-model->m;
    return (taps){.first = (int)below - 1,
                  .weight = {(float)(s * s * s / 6.0), (float)((4.0 - 3.0 * t * t * (2.0 - t)) / 6.0),
                             (float)((4.0 - 3.0 * s * s * (2.0 - s)) / 6.0), (float)(t * t * t / 6.0)},
                  .slope = {scale * (float)(-0.5 * s * s), scale * (float)(t * (1.5 * t - 2.0)),
                            scale * (float)(-s * (1.5 * s - 2.0)), scale * (float)(0.5 * t * t)}};
}

size_t rx_psf_model_work(const rx_psf_model *model)
{
    return 2 * (size_t)model->side * (size_t)(2 * model->half + 1);
}

RX_SIMD void rx_psf_model_stamp(const rx_psf_model *model, const float *nodes, double dx, double dy, int half,
                                const rx_psf_stamp *dst)
{
    float *stamp = dst->value, *gx = dst->gx, *gy = dst->gy, *work = dst->work;
    const int m = model->m, n = 2 * half + 1, rows = m * (n - 1) + 4;
    const taps x = taps_of(model, dx, half), y = taps_of(model, dy, half);
    float *slopes = work + (size_t)rows * (size_t)n;
    for (int j = 0; j < rows; j++) {
        const float *line = nodes + (size_t)(y.first + j) * (size_t)model->side + x.first;
        float *value = work + (size_t)j * (size_t)n, *slope = slopes + (size_t)j * (size_t)n;
        for (int i = 0; i < n; i++, line += m) {
            value[i] =
                x.weight[0] * line[0] + x.weight[1] * line[1] + x.weight[2] * line[2] + x.weight[3] * line[3];
            if (gx != NULL)
                slope[i] =
                    x.slope[0] * line[0] + x.slope[1] * line[1] + x.slope[2] * line[2] + x.slope[3] * line[3];
        }
    }
    for (int j = 0; j < n; j++) {
        const float *v = work + (size_t)(m * j) * (size_t)n, *s = slopes + (size_t)(m * j) * (size_t)n;
        float *to = stamp + (size_t)j * (size_t)n;
#pragma omp simd
        for (int i = 0; i < n; i++)
            to[i] = y.weight[0] * v[i] + y.weight[1] * v[i + n] + y.weight[2] * v[i + 2 * n] +
                    y.weight[3] * v[i + 3 * n];
        if (gx == NULL)
            continue;
        float *to_x = gx + (size_t)j * (size_t)n, *to_y = gy + (size_t)j * (size_t)n;
#pragma omp simd
        for (int i = 0; i < n; i++) {
            to_x[i] = y.weight[0] * s[i] + y.weight[1] * s[i + n] + y.weight[2] * s[i + 2 * n] +
                      y.weight[3] * s[i + 3 * n];
            to_y[i] = y.slope[0] * v[i] + y.slope[1] * v[i + n] + y.slope[2] * v[i + 2 * n] +
                      y.slope[3] * v[i + 3 * n];
        }
    }
}

float rx_psf_model_wing(const rx_psf_model *model, double r)
{
    const double at = r / RX_PSF_WING_STEP;
    const int i = (int)at;
    if (i + 1 >= model->nwing)
        return 0.0F;
    return model->wing[i] + (float)(at - i) * (model->wing[i + 1] - model->wing[i]);
}

/* Unser, Aldroubi and Eden 1993, IEEE Trans. Signal Processing 41, 834; what lies outside is 0. */
static void filter_line(double *v, int n, int stride)
{
    const double z = sqrt(3.0) - 2.0;
    for (int i = 1; i < n; i++)
        v[i * stride] += z * v[(i - 1) * stride];
    v[(n - 1) * stride] *= -z / (1.0 - z * z);
    for (int i = n - 2; i >= 0; i--)
        v[i * stride] = z * (v[(i + 1) * stride] - v[i * stride]);
    for (int i = 0; i < n; i++)
        v[i * stride] *= 6.0;
}

void rx_psf_model_interpolate(const rx_psf_model *model, double *nodes)
{
    for (int j = 0; j < model->side; j++)
        filter_line(nodes + (size_t)j * (size_t)model->side, model->side, 1);
    for (int i = 0; i < model->side; i++)
        filter_line(nodes + i, model->side, model->side);
}
