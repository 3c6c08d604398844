/* MSE, PSNR and SSIM. */
#include "quality/image_metrics.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

enum { RADIUS = 5, WINDOW = 2 * RADIUS + 1 };
static const double WINDOW_SIGMA = 1.5;

static double mean_square(int width, int height, const float *image, const float *reference)
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
        *low = image[i] < *low ? image[i] : *low;
        *high = image[i] > *high ? image[i] : *high;
    }
}

static double psnr(double high, double mse)
{
    if (!(high > 0))
        return NAN;
    return mse > 0 ? 20 * log10(high) - 10 * log10(mse) : mse == 0 ? INFINITY : NAN;
}

/* --- sums over the window, row by row --- */

/* The last WINDOW rows of some planes, smoothed along x, stand in a ring; each new row completes one row of
 * windows. */
typedef struct smoother {
    size_t width, columns, planes;
    double weight[WINDOW];
    double *row;  /* [planes][width], the next row */
    double *ring; /* [WINDOW][planes][columns] */
    double *mean; /* [planes][columns], the sums of the windows that the last row completed */
} smoother;

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

static void smoother_free(smoother *s)
{
    free(s->row);
    free(s->ring);
    free(s->mean);
}

static rx_status smoother_make(int width, int planes, smoother *dst, rx_error *err)
{
    const size_t columns = (size_t)(width - 2 * RADIUS), n = (size_t)planes;
    *dst = (smoother){.width = (size_t)width,
                      .columns = columns,
                      .planes = n,
                      .row = RX_NEW(double, n *(size_t)width),
                      .ring = RX_NEW(double, WINDOW *n *columns),
                      .mean = RX_NEW(double, n *columns)};
    window_weights(dst->weight);
    if (dst->row != NULL && dst->ring != NULL && dst->mean != NULL)
        return RX_OK;
    smoother_free(dst);
    return rx_error_memory(err, (WINDOW + 1) * n * columns * sizeof *dst->ring);
}

/* dst = sum of w[k] from[k], in the order of k; written out so that the loop over x is one of vectors. */
static void weigh(size_t n, const double w[restrict WINDOW], const double *const from[WINDOW],
                  double *restrict dst)
{
    const double *f0 = from[0], *f1 = from[1], *f2 = from[2], *f3 = from[3], *f4 = from[4], *f5 = from[5],
                 *f6 = from[6], *f7 = from[7], *f8 = from[8], *f9 = from[9], *f10 = from[10];
#pragma omp simd
    for (size_t x = 0; x < n; x++)
        dst[x] = w[0] * f0[x] + w[1] * f1[x] + w[2] * f2[x] + w[3] * f3[x] + w[4] * f4[x] + w[5] * f5[x] +
                 w[6] * f6[x] + w[7] * f7[x] + w[8] * f8[x] + w[9] * f9[x] + w[10] * f10[x];
}

/* Row y of the image is in s->row: is a row of windows complete, its sums in s->mean? */
static int smoother_push(smoother *s, int y)
{
    const size_t size = s->planes * s->columns;
    const double *from[WINDOW];
    for (size_t p = 0; p < s->planes; p++) {
        for (size_t k = 0; k < WINDOW; k++)
            from[k] = s->row + p * s->width + k;
        weigh(s->columns, s->weight, from, s->ring + (size_t)(y % WINDOW) * size + p * s->columns);
    }
    if (y < WINDOW - 1)
        return 0;
    for (int k = 0; k < WINDOW; k++)
        from[k] = s->ring + (size_t)((y - WINDOW + 1 + k) % WINDOW) * size;
    weigh(size, s->weight, from, s->mean);
    return 1;
}

/* --- SSIM --- */

struct rx_image_reference {
    int width, height;
    const float *pixels; /* not owned */
    double high, c1, c2;
    double centre; /* taken off all values, so that a high background does not eat the digits of variances */
    double *mean, *variance; /* of the windows, [height - 2 RADIUS][width - 2 RADIUS] */
};

void rx_image_reference_free(rx_image_reference *reference)
{
    if (reference == NULL)
        return;
    free(reference->mean);
    free(reference->variance);
    free(reference);
}

static rx_status take_moments(rx_image_reference *reference, rx_error *err)
{
    const size_t width = (size_t)reference->width, columns = width - 2 * RADIUS;
    smoother s;
    RX_TRY(smoother_make(reference->width, 2, &s, err));
    for (int y = 0; y < reference->height; y++) {
        const float *b = reference->pixels + (size_t)y * width;
        for (size_t x = 0; x < width; x++) {
            double v = b[x] - reference->centre;
            s.row[x] = v;
            s.row[width + x] = v * v;
        }
        if (!smoother_push(&s, y))
            continue;
        const size_t first = (size_t)(y - WINDOW + 1) * columns;
        for (size_t x = 0; x < columns; x++) {
            double mean = s.mean[x];
            reference->mean[first + x] = mean;
            reference->variance[first + x] = s.mean[columns + x] - mean * mean;
        }
    }
    smoother_free(&s);
    return RX_OK;
}

rx_status rx_image_reference_new(int width, int height, const float *pixels, rx_image_reference **dst,
                                 rx_error *err)
{
    static const double k = 0.001; /* the paper's K1 = K2 */
    double low, high;
    *dst = NULL;
    if (width < WINDOW || height < WINDOW)
        return rx_error_set(err, RX_USAGE, "SSIM needs images of %d x %d pixels or more, not %d x %d", WINDOW,
                            WINDOW, width, height);
    range_of(width, height, pixels, &low, &high);
    const double range = high - low;
    if (!(range > 0) || !isfinite(range))
        return rx_error_set(err, RX_INPUT,
                            "SSIM needs a reference with contrast, its values go from %g to %g", low, high);
    const size_t windows = (size_t)(width - 2 * RADIUS) * (size_t)(height - 2 * RADIUS);
    rx_image_reference *reference = RX_NEW(rx_image_reference, 1);
    if (reference == NULL)
        return rx_error_memory(err, sizeof *reference);
    *reference = (rx_image_reference){.width = width,
                                      .height = height,
                                      .pixels = pixels,
                                      .high = high,
                                      .c1 = (k * range) * (k * range),
                                      .c2 = (k * range) * (k * range),
                                      .centre = 0.5 * (low + high),
                                      .mean = RX_NEW(double, windows),
                                      .variance = RX_NEW(double, windows)};
    rx_status status = reference->mean == NULL || reference->variance == NULL
                           ? rx_error_memory(err, 2 * windows * sizeof(double))
                           : take_moments(reference, err);
    if (status == RX_OK)
        *dst = reference;
    else
        rx_image_reference_free(reference);
    return status;
}

/* SSIM of the windows of one row, the first one being window `first`; `mean`: of the image, of its square and
 * of its product with the reference. */
static double row_sum(const rx_image_reference *r, size_t first, size_t n, const double *mean,
                      double *restrict ssim)
{
    const double *image = mean, *square = mean + n, *product = mean + 2 * n;
    const double *reference = r->mean + first, *variance = r->variance + first;
    const double centre = r->centre, c1 = r->c1, c2 = r->c2;
#pragma omp simd
    for (size_t x = 0; x < n; x++) {
        double ua = image[x], ub = reference[x];
        double va = square[x] - ua * ua, vb = variance[x], cov = product[x] - ua * ub;
        double ma = ua + centre, mb = ub + centre;
        ssim[x] = (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
    }
    double sum = 0;
    for (size_t x = 0; x < n; x++)
        sum += ssim[x];
    return sum;
}

double rx_reference_psnr(const rx_image_reference *reference, const float *image)
{
    return psnr(reference->high, mean_square(reference->width, reference->height, image, reference->pixels));
}

rx_status rx_reference_ssim(const rx_image_reference *reference, const float *image, double *dst,
                            rx_error *err)
{
    const size_t width = (size_t)reference->width, columns = width - 2 * RADIUS;
    const double centre = reference->centre;
    double sum = 0;
    smoother s;
    *dst = NAN;
    RX_TRY(smoother_make(reference->width, 3, &s, err));
    for (int y = 0; y < reference->height; y++) {
        const float *a = image + (size_t)y * width, *b = reference->pixels + (size_t)y * width;
        double *plain = s.row, *square = s.row + width, *product = s.row + 2 * width;
#pragma omp simd
        for (size_t x = 0; x < width; x++) {
            double u = a[x] - centre, v = b[x] - centre;
            plain[x] = u;
            square[x] = u * u;
            product[x] = u * v;
        }
        if (smoother_push(&s, y)) /* the ring is done with s.row, which takes the SSIM of the windows */
            sum += row_sum(reference, (size_t)(y - WINDOW + 1) * columns, columns, s.mean, s.row);
    }
    *dst = sum / ((double)columns * (double)(reference->height - 2 * RADIUS));
    smoother_free(&s);
    return RX_OK;
}
