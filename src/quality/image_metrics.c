/* MSE, PSNR and SSIM. */
#include "quality/image_metrics.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

enum { RADIUS = 5, WINDOW = 2 * RADIUS + 1 };
static const double WINDOW_SIGMA = 1.5;
static const double OBJECT_LIGHT =
    0.9; /* of the reference: its brightest pixels with so much are the object */
static const double K_PAPER[] = {0.001, 0.001}, K_WANG[] = {0.01, 0.03}; /* K1, K2 */

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

/* --- SSIM --- */

struct rx_image_reference {
    int width, height;
    const float *pixels; /* not owned */
    double high, range;
    float object;  /* the faintest pixel of the object */
    double centre; /* taken off all values, so that a high background does not eat the digits of variances */
    double weight[WINDOW];
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

/* dst[x] = sum of w[k] f[x + k stride], in the order of k; written out so that the loop over x is one of vectors. */
static void weigh(size_t n, const double w[restrict WINDOW], const double *f, size_t stride,
                  double *restrict dst)
{
    const double *f1 = f + stride, *f2 = f1 + stride, *f3 = f2 + stride, *f4 = f3 + stride, *f5 = f4 + stride,
                 *f6 = f5 + stride, *f7 = f6 + stride, *f8 = f7 + stride, *f9 = f8 + stride,
                 *f10 = f9 + stride;
#pragma omp simd
    for (size_t x = 0; x < n; x++)
        dst[x] = w[0] * f[x] + w[1] * f1[x] + w[2] * f2[x] + w[3] * f3[x] + w[4] * f4[x] + w[5] * f5[x] +
                 w[6] * f6[x] + w[7] * f7[x] + w[8] * f8[x] + w[9] * f9[x] + w[10] * f10[x];
}

static size_t columns_of(const rx_image_reference *r)
{
    return (size_t)(r->width - 2 * RADIUS);
}

static size_t windows_of(const rx_image_reference *r)
{
    return columns_of(r) * (size_t)(r->height - 2 * RADIUS);
}

/* Means over each window of a, or of the products of a and b, the centre taken off; room: [width + height columns]. */
static void take_means(const rx_image_reference *r, const float *a, const float *b, double *room, double *dst)
{
    const size_t width = (size_t)r->width, columns = columns_of(r);
    double *rows = room + width;
    for (size_t y = 0; y < (size_t)r->height; y++) {
        for (size_t x = 0; x < width; x++)
            room[x] = ((double)a[y * width + x] - r->centre) *
                      (b != NULL ? (double)b[y * width + x] - r->centre : 1);
        weigh(columns, r->weight, room, 1, rows + y * columns);
    }
    for (size_t k = 0; k < windows_of(r); k += columns)
        weigh(columns, r->weight, rows + k, columns, dst + k);
}

static double *new_room(const rx_image_reference *r, size_t planes)
{
    return RX_NEW(double, (size_t)r->width + (size_t)r->height * columns_of(r) + planes * windows_of(r));
}

/* The value down to which the brightest of n pixels hold OBJECT_LIGHT of their sum. */
static rx_status find_object(size_t n, const float *pixels, float *dst, rx_error *err)
{
    double *sorted, all = 0, light;
    RX_TRY(RX_MAKE(sorted, n, err));
    for (size_t i = 0; i < n; i++)
        all += sorted[i] = (double)pixels[i];
    rx_sort(sorted, n);
    size_t last = n - 1;
    for (light = sorted[last]; last > 0 && light < OBJECT_LIGHT * all; light += sorted[last])
        last--;
    *dst = (float)sorted[last];
    free(sorted);
    return RX_OK;
}

rx_status rx_image_reference_new(int width, int height, const float *pixels, rx_image_reference **dst,
                                 rx_error *err)
{
    double low = INFINITY, high = -INFINITY, sum = 0;
    *dst = NULL;
    if (width < WINDOW || height < WINDOW)
        return rx_error_set(err, RX_USAGE, "SSIM needs images of %d x %d pixels or more, not %d x %d", WINDOW,
                            WINDOW, width, height);
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        low = pixels[i] < low ? pixels[i] : low;
        high = pixels[i] > high ? pixels[i] : high;
    }
    const double range = high - low;
    if (!(range > 0) || !isfinite(range))
        return rx_error_set(err, RX_INPUT,
                            "SSIM needs a reference with contrast, its values go from %g to %g", low, high);
    float object = 0;
    RX_TRY(find_object((size_t)width * (size_t)height, pixels, &object, err));
    rx_image_reference *r;
    RX_TRY(RX_MAKE(r, 1, err));
    *r = (rx_image_reference){.width = width,
                              .height = height,
                              .pixels = pixels,
                              .high = high,
                              .range = range,
                              .object = object,
                              .centre = 0.5 * (low + high)};
    double *room = new_room(r, 0);
    rx_status status = RX_OK;
    if (room == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(RX_MAKE(r->mean, windows_of(r), err));
    RX_TRY_EXIT(RX_MAKE(r->variance, windows_of(r), err));
    for (int i = 0; i < WINDOW; i++) {
        const double u = (i - RADIUS) / WINDOW_SIGMA;
        r->weight[i] = exp(-0.5 * u * u);
        sum += r->weight[i];
    }
    for (int i = 0; i < WINDOW; i++)
        r->weight[i] /= sum;
    take_means(r, pixels, NULL, room, r->mean);
    take_means(r, pixels, pixels, room, r->variance);
    for (size_t i = 0; i < windows_of(r); i++)
        r->variance[i] -= r->mean[i] * r->mean[i];
    *dst = r;
    r = NULL;
exit:
    free(room);
    rx_image_reference_free(r);
    return status;
}

double rx_reference_psnr(const rx_image_reference *reference, const float *image)
{
    const double mse = mean_square(reference->width, reference->height, image, reference->pixels);
    if (!(reference->high > 0))
        return NAN;
    return mse > 0 ? 20 * log10(reference->high) - 10 * log10(mse) : mse == 0 ? INFINITY : NAN;
}

/* Moments of one window of image and reference, the centre taken off the means. */
typedef struct window {
    double image, reference, image_variance, reference_variance, covariance;
} window;

static double similarity(const rx_image_reference *r, const double k[2], const window *w)
{
    const double c1 = k[0] * r->range * k[0] * r->range, c2 = k[1] * r->range * k[1] * r->range,
                 ma = w->image + r->centre, mb = w->reference + r->centre;
    return (2 * ma * mb + c1) * (2 * w->covariance + c2) /
           ((ma * ma + mb * mb + c1) * (w->image_variance + w->reference_variance + c2));
}

rx_status rx_reference_ssim(const rx_image_reference *r, const float *image, double dst[RX_SSIM_KINDS],
                            rx_error *err)
{
    const size_t columns = columns_of(r), windows = windows_of(r);
    double total[RX_SSIM_KINDS] = {0}, *room = new_room(r, 3);
    size_t inside = 0;
    for (int k = 0; k < RX_SSIM_KINDS; k++)
        dst[k] = NAN;
    if (room == NULL)
        return rx_error_memory(err, 3 * windows * sizeof *room);
    double *mean = room + r->width + (size_t)r->height * columns, *square = mean + windows,
           *product = square + windows;
    take_means(r, image, NULL, room, mean);
    take_means(r, image, image, room, square);
    take_means(r, image, r->pixels, room, product);
    for (size_t first = 0, y = RADIUS; first < windows; first += columns, y++) {
        double sum[RX_SSIM_KINDS] = {0}; /* sums of rows keep the rounding of large images small */
        for (size_t i = first; i < first + columns; i++) {
            const double ua = mean[i], ub = r->mean[i];
            const window w = {ua, ub, square[i] - ua * ua, r->variance[i], product[i] - ua * ub};
            const double paper = similarity(r, K_PAPER, &w);
            sum[RX_SSIM_PAPER] += paper;
            sum[RX_SSIM_WANG] += similarity(r, K_WANG, &w);
            if (r->pixels[y * (size_t)r->width + RADIUS + i - first] >= r->object) {
                sum[RX_SSIM_OBJECT] += paper;
                inside++;
            }
        }
        for (int k = 0; k < RX_SSIM_KINDS; k++)
            total[k] += sum[k];
    }
    for (int k = 0; k < RX_SSIM_KINDS; k++)
        dst[k] = total[k] / (double)(k == RX_SSIM_OBJECT ? inside : windows);
    free(room);
    return RX_OK;
}
