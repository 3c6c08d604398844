/* Squared errors of pixels, and their weights. */
#include "train/loss.h"

#include <math.h>

#include "nn/front.h"
#include "num/convolve.h"

enum {
    RADIUS = 8, /* of the Gaussian: rx_gauss_radius(FWHM) */
    REACH = 3   /* of the neighbourhood */
};
/* sigma 1.5 pixels: a single pixel's noise does not set weights, a faint star of any seeing does */
static const double FWHM = 1.5 * 2.3548200450309493;

/* dst = Gauss * max(src, 0) along one row of n pixels that are `step` apart, normalised inside the row. */
static void smooth_line(const float *src, int n, size_t step, const float *gauss, float *dst)
{
    for (int x = 0; x < n; x++) {
        const int first = x < RADIUS ? -x : -RADIUS, last = x + RADIUS >= n ? n - 1 - x : RADIUS;
        float sum = 0, share = 0;
        for (int i = first; i <= last; i++) {
            const float value = src[(size_t)(x + i) * step];
            sum += gauss[i + RADIUS] * (value > 0 ? value : 0);
            share += gauss[i + RADIUS];
        }
        dst[(size_t)x * step] = sum / share;
    }
}

static void largest_line(const float *src, int n, size_t step, float *dst)
{
    for (int x = 0; x < n; x++) {
        const int first = x < REACH ? 0 : x - REACH, last = x + REACH >= n ? n - 1 : x + REACH;
        float most = src[(size_t)first * step];
        for (int i = first + 1; i <= last; i++)
            most = fmaxf(most, src[(size_t)i * step]);
        dst[(size_t)x * step] = most;
    }
}

void rx_loss_weights(const float *input, int side, double floor, float *work, float *weight)
{
    const size_t n = (size_t)side;
    float gauss[2 * RADIUS + 1], *other = work + n * n;
    rx_gauss_weights(FWHM, RADIUS, gauss);
    for (size_t k = 0; k < n; k++)
        smooth_line(input + k * n, side, 1, gauss, work + k * n);
    for (size_t k = 0; k < n; k++)
        smooth_line(work + k, side, n, gauss, other + k);
    for (size_t k = 0; k < n; k++)
        largest_line(other + k * n, side, 1, work + k * n);
    for (size_t k = 0; k < n; k++)
        largest_line(work + k, side, n, weight + k);
    const float square = (float)(floor * floor);
    for (size_t k = 0; k < n * n; k++)
        weight[k] = square / (square + weight[k] * weight[k]);
}

void rx_loss_pixels(rx_loss_kind kind, const float *out, const float *truth, const float *weight, int side,
                    int margin, double scale, double *value, float *gradient)
{
    const int inner = side - 2 * margin;
    const double unit = scale / ((double)inner * inner);
    double sum = 0;
    for (int y = margin; y < side - margin; y++)
        for (int x = margin; x < side - margin; x++) {
            const size_t k = (size_t)y * (size_t)side + (size_t)x;
            const int stretched = kind == RX_LOSS_STRETCHED;
            const float w = kind == RX_LOSS_LINEAR ? weight[k] : 1;
            const float d = stretched ? rx_stretch(out[k]) - rx_stretch(truth[k]) : out[k] - truth[k];
            sum += (double)w * d * d;
            if (gradient != NULL)
                gradient[k] += (float)(2 * unit * w * d * (stretched ? rx_stretch_slope(out[k]) : 1));
        }
    *value += unit * sum;
}
