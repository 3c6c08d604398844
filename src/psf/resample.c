/* Lanczos interpolation of an image, axis by axis. */
#include "psf/resample.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

int rx_lanczos_weights(double position, int order, double weights[2 * RX_LANCZOS_MAX])
{
    const double least = -1e6, most = 1e6; /* beyond any image, and no number is one */
    position = position > least ? fmin(position, most) : least;
    int first = (int)floor(position) - order + 1;
    double sum = 0.0;
    for (int k = 0; k < 2 * order; k++) {
        double d = M_PI * (position - (first + k));
        if (fabs(d) < 1e-9)
            weights[k] = 1.0;
        else
            weights[k] = fabs(d) < order * M_PI ? order * sin(d) * sin(d / order) / (d * d) : 0.0;
        sum += weights[k];
    }
    for (int k = 0; k < 2 * order; k++)
        weights[k] /= sum;
    return first;
}

/* A row or column: n values, `stride` apart. */
typedef struct line {
    double *values;
    int n, stride;
} line;

/* dst[i] = src at centre + (i - n / 2) * step, 0 outside; over a box the mean of points whose spread is that of the
 * box less that of a source pixel. */
static void resample_line(const line *src, double centre, double step, double box, int order, const line *dst)
{
    const int points = box > 1.0 ? (int)ceil(box) : 1;
    const double apart = points > 1 ? sqrt((box * box - 1.0) / ((double)points * points - 1.0)) : 0.0;
    for (int i = 0; i < dst->n; i++) {
        double sum = 0.0;
        for (int p = 0; p < points; p++) {
            double weights[2 * RX_LANCZOS_MAX];
            int first = rx_lanczos_weights(
                centre + (i - dst->n / 2) * step + (p - 0.5 * (points - 1)) * apart, order, weights);
            for (int k = 0; k < 2 * order; k++)
                if (first + k >= 0 && first + k < src->n)
                    sum += weights[k] * src->values[(size_t)(first + k) * (size_t)src->stride];
        }
        dst->values[(size_t)i * (size_t)dst->stride] = sum / points;
    }
}

rx_status rx_psf_resample(const rx_psf_raster *src, double step, int order, double *dst, int size,
                          rx_error *err)
{
    size_t pixels = (size_t)src->width * (size_t)src->height;
    double *values = RX_NEW(double, pixels), *rows = RX_NEW(double, (size_t)size *(size_t)src->height);
    rx_status status = RX_OK;
    if (values == NULL || rows == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    for (size_t i = 0; i < pixels; i++)
        values[i] = (double)src->pixels[i];
    for (int j = 0; j < src->height; j++)
        resample_line(&(line){values + (size_t)j * (size_t)src->width, src->width, 1}, src->centre_x, step,
                      src->box, order, &(line){rows + (size_t)j * (size_t)size, size, 1});
    for (int i = 0; i < size; i++)
        resample_line(&(line){rows + i, src->height, size}, src->centre_y, step, src->box, order,
                      &(line){dst + i, size, size});
exit:
    free(values);
    free(rows);
    return status;
}
