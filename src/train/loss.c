/* Squared errors of pixels and of light, their weights, and the focal frequency loss by a real transform of the window. */
#include "train/loss.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "nn/front.h"
#include "num/convolve.h"
#include "num/fft.h"
#include "num/maximum_filter.h"

enum {
    RADIUS = 8, /* of the Gaussian: rx_gauss_radius(FWHM) */
    REACH = 3   /* of the neighbourhood */
};
/* sigma 1.5 pixels: a single pixel's noise does not set weights, a faint star of any seeing does */
static const double FWHM = 1.5 * RX_FWHM_SIGMA;

/* dst[k] += factor * src[k]. */
static void add_line(const float *restrict src, float factor, int n, float *restrict dst)
{
#pragma omp simd
    for (int k = 0; k < n; k++)
        dst[k] += factor * src[k];
}

/* dst = Gauss * src, nothing being outside the patch, or normalised inside it by share[side], which is overwritten (NULL: not);
 * other[side^2] is scratch. Whole lines are added at a time, which is what makes it quick. */
static void smooth(const float *src, int side, float *other, float *share, float *dst)
{
    const size_t n = (size_t)side;
    float gauss[2 * RADIUS + 1];
    rx_gauss_weights(FWHM, RADIUS, gauss);
    for (int x = 0; share != NULL && x < side; x++) { /* sum of the weights that lie inside a line */
        share[x] = 0;
        for (int i = -RADIUS; i <= RADIUS; i++)
            share[x] += x + i >= 0 && x + i < side ? gauss[i + RADIUS] : 0;
    }
    for (size_t y = 0; y < n; y++) {
        float *line = other + y * n;
        memset(line, 0, n * sizeof *line);
        for (int i = -RADIUS; i <= RADIUS; i++) {
            const int from = i < 0 ? -i : 0, length = side - abs(i);
            if (length > 0)
                add_line(src + y * n + (size_t)(from + i), gauss[i + RADIUS], length, line + from);
        }
        for (size_t x = 0; share != NULL && x < n; x++)
            line[x] /= share[x];
    }
    for (int y = 0; y < side; y++) {
        float *line = dst + (size_t)y * n;
        const int first = y < RADIUS ? -y : -RADIUS, last = y + RADIUS >= side ? side - 1 - y : RADIUS;
        memset(line, 0, n * sizeof *line);
        for (int i = first; i <= last; i++)
            add_line(other + (size_t)(y + i) * n, gauss[i + RADIUS], side, line);
        for (size_t x = 0; share != NULL && x < n; x++)
            line[x] /= share[y];
    }
}

void rx_loss_weights(const float *input, int side, double floor, float *work, float *weight)
{
    const size_t pixels = (size_t)side * (size_t)side;
    const float square = (float)(floor * floor);
    float *other = work + pixels;
    for (size_t k = 0; k < pixels; k++)
        work[k] = input[k] > 0 ? input[k] : 0;
    smooth(work, side, other, weight, work);
    rx_maximum_filter(work, side, side, REACH, 1, other, weight);
    for (size_t k = 0; k < pixels; k++)
        weight[k] = square / (square + weight[k] * weight[k]);
}

void rx_loss_pixels(const rx_loss *loss, const float *out, const float *truth, double scale, double *value,
                    float *gradient)
{
    const int side = loss->side, margin = loss->margin, inner = side - 2 * margin;
    const int stretched = loss->kind == RX_LOSS_STRETCHED, linear = loss->kind == RX_LOSS_LINEAR;
    const double unit = scale / ((double)inner * inner);
    double sum = 0;
    for (int y = margin; y < side - margin; y++)
        for (int x = margin; x < side - margin; x++) {
            const size_t k = (size_t)y * (size_t)side + (size_t)x;
            const float w = linear ? loss->weight[k] : 1;
            const float d = stretched ? rx_stretch(out[k]) - rx_stretch(truth[k]) : out[k] - truth[k];
            sum += (double)w * d * d;
            if (gradient != NULL)
                gradient[k] += (float)(2 * unit * w * d * (stretched ? rx_stretch_slope(out[k]) : 1));
        }
    *value += unit * sum;
}

void rx_loss_light(const rx_loss *loss, const float *out, const float *truth, double scale, float *work,
                   double *value, float *gradient)
{
    const int side = loss->side, margin = loss->margin, inner = side - 2 * margin;
    const size_t pixels = (size_t)side * (size_t)side;
    const double unit = scale / ((double)inner * inner);
    float *light = work, *other = work + pixels;
    double sum = 0;
    memset(light, 0, pixels * sizeof *light);
    for (int y = margin; y < side - margin; y++)
        for (int x = margin; x < side - margin; x++) {
            const size_t k = (size_t)y * (size_t)side + (size_t)x;
            light[k] = out[k] - truth[k];
        }
    smooth(light, side, other, NULL, light);
    for (int y = 0; y < side; y++)
        for (int x = 0; x < side; x++) {
            const size_t k = (size_t)y * (size_t)side + (size_t)x;
            const int inside = y >= margin && y < side - margin && x >= margin && x < side - margin;
            const float w = !inside ? 0 : loss->kind == RX_LOSS_LINEAR ? loss->weight[k] : 1;
            sum += (double)w * light[k] * light[k];
            light[k] *= w;
        }
    *value += unit * sum;
    if (gradient == NULL)
        return;
    smooth(light, side, other, NULL, light); /* S is its own transpose */
    for (int y = margin; y < side - margin; y++)
        for (int x = margin; x < side - margin; x++) {
            const size_t k = (size_t)y * (size_t)side + (size_t)x;
            gradient[k] += (float)(2 * unit * light[k]);
        }
}

/* --- focal frequency loss --- */

struct rx_ffl {
    int side, margin, inner;
    rx_fft *fft;
    float *plane, *spectrum;
};

rx_status rx_ffl_new(int side, int margin, rx_ffl **dst, rx_error *err)
{
    rx_ffl *ffl;
    rx_status status;
    *dst = NULL;
    RX_TRY(RX_MAKE(ffl, 1, err));
    *ffl = (rx_ffl){.side = side, .margin = margin, .inner = side - 2 * margin};
    RX_TRY_EXIT(rx_fft_new(ffl->inner, ffl->inner, 1, &ffl->fft, err));
    ffl->plane = rx_fft_real(ffl->fft);
    ffl->spectrum = rx_fft_complex(ffl->fft);
    if (ffl->plane == NULL || ffl->spectrum == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)side * (size_t)side * 3 * sizeof(float)));
    *dst = ffl;
    return RX_OK;
exit:
    rx_ffl_free(ffl);
    return status;
}

void rx_ffl_free(rx_ffl *ffl)
{
    if (ffl == NULL)
        return;
    rx_fft_free(ffl->fft);
    free(ffl->plane);
    free(ffl->spectrum);
    free(ffl);
}

/* With Z = inner D, the unnormalised transform: the largest |Z|, and the sum of |Z|^3 over the whole plane:
 * columns u and width - u are complex conjugates of each other, of which the half spectrum holds one. */
static void measure(const rx_ffl *ffl, double *most, double *cubes)
{
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(ffl->fft);
    const int n = ffl->inner;
    double largest = 0, sum = 0;
    for (int u = 0; u <= n / 2; u++)
        for (int v = 0; v < n; v++) {
            const float *z = ffl->spectrum + (size_t)u * stride + 2 * (size_t)v;
            const double square = (double)z[0] * z[0] + (double)z[1] * z[1], size = sqrt(square);
            largest = fmax(largest, size);
            sum += (u == 0 || 2 * u == n ? 1 : 2) * square * size;
        }
    *most = largest;
    *cubes = sum;
}

/* spectrum *= w times `factor` */
static void apply_weights(rx_ffl *ffl, double most, double factor)
{
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(ffl->fft);
    for (int u = 0; u <= ffl->inner / 2; u++)
        for (int v = 0; v < ffl->inner; v++) {
            float *z = ffl->spectrum + (size_t)u * stride + 2 * (size_t)v;
            const double w = sqrt((double)z[0] * z[0] + (double)z[1] * z[1]) / most;
            z[0] = (float)(z[0] * w * factor);
            z[1] = (float)(z[1] * w * factor);
        }
}

void rx_ffl_add(rx_ffl *ffl, const float *out, const float *truth, double scale, double *value,
                float *gradient)
{
    const double pixels = (double)ffl->inner * ffl->inner;
    const size_t stride = (size_t)rx_fft_stride_real(ffl->fft);
    double most, cubes;
    for (int y = 0; y < ffl->inner; y++)
        for (int x = 0; x < ffl->inner; x++) {
            const size_t k = (size_t)(y + ffl->margin) * (size_t)ffl->side + (size_t)(x + ffl->margin);
            ffl->plane[(size_t)y * stride + (size_t)x] = rx_stretch(out[k]) - rx_stretch(truth[k]);
        }
    rx_fft_forward(ffl->fft, ffl->plane, ffl->spectrum);
    measure(ffl, &most, &cubes);
    if (!(most > 0)) { /* equal images: 0, or all frequencies not a number: that is passed on */
        *value += scale * cubes;
        return;
    }
    /* |D|^2 = |Z|^2 / pixels, mean over as many frequencies */
    *value += scale * cubes / most / (pixels * pixels);
    if (gradient == NULL)
        return;
    /* 2/M, and 1/inner for each of D and the inverse */
    apply_weights(ffl, most, scale * 2 / (pixels * pixels));
    rx_fft_inverse(ffl->fft, ffl->spectrum, ffl->plane);
    for (int y = 0; y < ffl->inner; y++)
        for (int x = 0; x < ffl->inner; x++) {
            const size_t k = (size_t)(y + ffl->margin) * (size_t)ffl->side + (size_t)(x + ffl->margin);
            gradient[k] += ffl->plane[(size_t)y * stride + (size_t)x] * rx_stretch_slope(out[k]);
        }
}
