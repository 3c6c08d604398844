/* Focal frequency loss by a real transform of the window. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "nn/front.h"
#include "num/fft.h"
#include "train/loss.h"

struct rx_ffl {
    int side, margin, inner;
    rx_fft *fft;
    float *plane, *spectrum;
};

rx_status rx_ffl_new(int side, int margin, rx_ffl **dst, rx_error *err)
{
    *dst = NULL;
    if (margin < 0 || side - 2 * margin < 1)
        return rx_error_set(err, RX_USAGE,
                            "a margin of %d pixels leaves nothing of images of %d pixels; give a smaller one",
                            margin, side);
    rx_ffl *ffl = RX_NEW(rx_ffl, 1);
    if (ffl == NULL)
        return rx_error_memory(err, sizeof *ffl);
    ffl->side = side;
    ffl->margin = margin;
    ffl->inner = side - 2 * margin;
    rx_status status = rx_fft_new(ffl->inner, ffl->inner, 1, &ffl->fft, err);
    if (status == RX_OK) {
        ffl->plane = rx_fft_real(ffl->fft);
        ffl->spectrum = rx_fft_complex(ffl->fft);
        if (ffl->plane == NULL || ffl->spectrum == NULL)
            status = rx_error_memory(err, (size_t)side * (size_t)side * 3 * sizeof(float));
    }
    if (status != RX_OK) {
        rx_ffl_free(ffl);
        return status;
    }
    *dst = ffl;
    return RX_OK;
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

static void load(rx_ffl *ffl, const float *out, const float *truth)
{
    const size_t stride = (size_t)rx_fft_stride_real(ffl->fft);
    for (int y = 0; y < ffl->inner; y++) {
        const size_t row = (size_t)(y + ffl->margin) * (size_t)ffl->side + (size_t)ffl->margin;
        for (int x = 0; x < ffl->inner; x++)
            ffl->plane[(size_t)y * stride + (size_t)x] =
                rx_stretch(out[row + (size_t)x]) - rx_stretch(truth[row + (size_t)x]);
    }
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
    double most, cubes;
    load(ffl, out, truth);
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
            gradient[k] += ffl->plane[(size_t)y * (size_t)rx_fft_stride_real(ffl->fft) + (size_t)x] *
                           rx_stretch_slope(out[k]);
        }
}
