/* MSE, PSNR and SSIM. */
#include "validate/image_metrics.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

enum { RADIUS = 5, WINDOW = 2 * RADIUS + 1, MOMENTS = 5 };
static const double WINDOW_SIGMA = 1.5;

double rx_image_mse(int width, int height, const float *image, const float *reference)
{
    double sum = 0;
    for (int y = 0; y < height; y++) {
        const float *a = image + (size_t)y * (size_t)width, *b = reference + (size_t)y * (size_t)width;
        double row = 0; /* sums of rows keep the rounding of large images small */
        for (int x = 0; x < width; x++) {
            double d = (double)a[x] - (double)b[x];
            row += d * d;
        }
        sum += row;
    }
    return isfinite(sum) ? sum / ((double)width * (double)height) : NAN;
}

static void range_of(int width, int height, const float *image, double *low, double *high)
{
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        *low = fmin(*low, image[i]);
        *high = fmax(*high, image[i]);
    }
}

double rx_image_psnr(int width, int height, const float *image, const float *reference)
{
    double low, high;
    range_of(width, height, reference, &low, &high);
    if (!(high > 0))
        return NAN;
    double mse = rx_image_mse(width, height, image, reference);
    return mse > 0 ? 20 * log10(high) - 10 * log10(mse) : mse == 0 ? INFINITY : NAN;
}

static void window_weights(double weight[WINDOW])
{
    double sum = 0;
    for (int i = 0; i < WINDOW; i++) {
        double u = (i - RADIUS) / WINDOW_SIGMA;
        weight[i] = exp(-0.5 * u * u);
        sum += weight[i];
    }
    for (int i = 0; i < WINDOW; i++)
        weight[i] /= sum;
}

/* Moments of one row, smoothed along it: dst[MOMENTS][columns]. `centre` is taken off first, so that a high
 * background does not eat the digits of the variances. */
static void smooth_row(const double weight[WINDOW], const float *a, const float *b, double centre,
                       int columns, double *work, double *dst)
{
    size_t width = (size_t)columns + WINDOW - 1, n = (size_t)columns;
    for (size_t x = 0; x < width; x++) {
        double u = a[x] - centre, v = b[x] - centre;
        work[x] = u;
        work[width + x] = v;
        work[2 * width + x] = u * u;
        work[3 * width + x] = v * v;
        work[4 * width + x] = u * v;
    }
    for (size_t m = 0; m < MOMENTS; m++)
        for (size_t x = 0; x < n; x++) {
            const double *from = work + m * width + x;
            double sum = 0;
            for (int i = 0; i < WINDOW; i++)
                sum += weight[i] * from[i];
            dst[m * n + x] = sum;
        }
}

/* SSIM of the windows of one row, summed: `mean` are the fully smoothed moments. */
static double row_sum(const double *mean, int columns, double centre, double c1, double c2)
{
    size_t n = (size_t)columns;
    double sum = 0;
    for (size_t x = 0; x < n; x++) {
        double ua = mean[x], ub = mean[n + x];
        double va = mean[2 * n + x] - ua * ua, vb = mean[3 * n + x] - ub * ub,
               cov = mean[4 * n + x] - ua * ub;
        double ma = ua + centre, mb = ub + centre;
        sum += (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
    }
    return sum;
}

/* The last WINDOW rows, smoothed along x, stand in a ring; each new row completes one row of windows. */
static double ssim_sum(int width, int height, const float *image, const float *reference, double centre,
                       double c1, double c2, double *ring, double *work, double *mean)
{
    double weight[WINDOW], sum = 0;
    int columns = width - 2 * RADIUS;
    size_t row = MOMENTS * (size_t)columns;
    window_weights(weight);
    for (int y = 0; y < height; y++) {
        size_t first = (size_t)y * (size_t)width;
        smooth_row(weight, image + first, reference + first, centre, columns, work,
                   ring + (size_t)(y % WINDOW) * row);
        if (y < WINDOW - 1)
            continue;
        for (size_t i = 0; i < row; i++)
            mean[i] = 0;
        for (int k = 0; k < WINDOW; k++) {
            const double *from = ring + (size_t)((y - WINDOW + 1 + k) % WINDOW) * row;
            for (size_t i = 0; i < row; i++)
                mean[i] += weight[k] * from[i];
        }
        sum += row_sum(mean, columns, centre, c1, c2);
    }
    return sum;
}

rx_status rx_image_ssim(int width, int height, const float *image, const float *reference, double k1,
                        double k2, double range, double *dst, rx_error *err)
{
    rx_status status = RX_OK;
    double low, high;
    *dst = NAN;
    if (width < WINDOW || height < WINDOW)
        return rx_error_set(err, RX_USAGE, "SSIM needs images of %d x %d pixels or more, not %d x %d", WINDOW,
                            WINDOW, width, height);
    range_of(width, height, reference, &low, &high);
    if (range == 0)
        range = high - low;
    if (!(range > 0) || !isfinite(range))
        return rx_error_set(err, RX_INPUT,
                            "SSIM needs a reference with contrast, its values go from %g to %g", low, high);
    size_t columns = (size_t)(width - 2 * RADIUS);
    double *ring = RX_NEW(double, WINDOW *MOMENTS *columns), *mean = RX_NEW(double, MOMENTS *columns);
    double *work = RX_NEW(double, MOMENTS *(size_t)width);
    if (ring == NULL || mean == NULL || work == NULL) {
        status = rx_error_memory(err, (WINDOW + 1) * MOMENTS * columns * sizeof *ring);
        goto exit;
    }
    double c1 = (k1 * range) * (k1 * range), c2 = (k2 * range) * (k2 * range);
    double sum = ssim_sum(width, height, image, reference, 0.5 * (low + high), c1, c2, ring, work, mean);
    *dst = sum / ((double)columns * (double)(height - 2 * RADIUS));
exit:
    free(ring);
    free(mean);
    free(work);
    return status;
}
