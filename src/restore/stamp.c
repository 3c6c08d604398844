/* PSF stamps: measure, move, make. */
#include "restore/stamp.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/convolve.h"

enum { FINE = 8 }; /* samples per pixel in rx_stamp_fwhm */

void rx_stamp_cubic(double t, double w[4])
{
    w[0] = ((2 - t) * t - 1) * t / 2;
    w[1] = ((3 * t - 5) * t * t + 2) / 2;
    w[2] = ((4 - 3 * t) * t + 1) * t / 2;
    w[3] = (t - 1) * t * t / 2;
}

static double interpolate(const float *stamp, int size, double x, double y)
{
    const int ix = (int)floor(x), iy = (int)floor(y);
    double wx[4], wy[4], sum = 0;
    rx_stamp_cubic(x - ix, wx);
    rx_stamp_cubic(y - iy, wy);
    for (int j = 0; j < 4; j++)
        for (int i = 0; i < 4; i++) {
            int sx = ix + i - 1, sy = iy + j - 1;
            if (sx >= 0 && sy >= 0 && sx < size && sy < size)
                sum += wx[i] * wy[j] * stamp[sy * size + sx];
        }
    return sum;
}

/* Pixels 8-connected with (x, y) where the stamp exceeds `level`, grown by one pixel for the
 * interpolated rim: 1 in inside[size*size]. */
static void flood(const float *stamp, int size, int peak, double level, unsigned char *inside)
{
    inside[peak] = 1;
    for (int changed = 1; changed;) {
        changed = 0;
        for (int k = 0; k < size * size; k++) {
            if (inside[k] || !(stamp[k] > level))
                continue;
            for (int j = -1; j <= 1 && !inside[k]; j++)
                for (int i = -1; i <= 1; i++) {
                    int x = k % size + i, y = k / size + j;
                    if (x >= 0 && y >= 0 && x < size && y < size && inside[y * size + x] == 1) {
                        inside[k] = 1;
                        changed = 1;
                        break;
                    }
                }
        }
    }
    for (int k = 0; k < size * size; k++)
        for (int d = 0; d < 9 && inside[k] == 1; d++) {
            int x = k % size + d % 3 - 1, y = k / size + d / 3 - 1;
            if (x >= 0 && y >= 0 && x < size && y < size && inside[y * size + x] == 0)
                inside[y * size + x] = 2;
        }
}

/* Highest interpolated value within a pixel of the highest sample. */
static double summit(const float *stamp, int size, int peak)
{
    double top = stamp[peak];
    for (int j = -FINE; j <= FINE; j++)
        for (int i = -FINE; i <= FINE; i++)
            top = fmax(top, interpolate(stamp, size, peak % size + (double)i / FINE,
                                        peak / size + (double)j / FINE));
    return top;
}

rx_status rx_stamp_fwhm(const float *stamp, int size, double *fwhm, double *ellipticity, rx_error *err)
{
    *fwhm = NAN;
    if (ellipticity != NULL)
        *ellipticity = 0;
    int peak = 0;
    for (int k = 1; k < size * size; k++)
        if (stamp[k] > stamp[peak])
            peak = k;
    if (!(stamp[peak] > 0))
        return RX_OK;
    const size_t area = (size_t)size * (size_t)size;
    unsigned char *inside = RX_NEW(unsigned char, area);
    if (inside == NULL)
        return rx_error_memory(err, area);
    const double level = summit(stamp, size, peak) / 2;
    flood(stamp, size, peak, level, inside);
    double n = 0, sx = 0, sy = 0, xx = 0, yy = 0, xy = 0;
    for (int k = 0; k < size * size; k++)
        for (int s = 0; inside[k] != 0 && s < FINE * FINE; s++) {
            double x = k % size + (s % FINE + 0.5) / FINE - 0.5, y = k / size + (s / FINE + 0.5) / FINE - 0.5;
            if (!(interpolate(stamp, size, x, y) > level))
                continue;
            n++;
            sx += x;
            sy += y;
            xx += x * x;
            yy += y * y;
            xy += x * y;
        }
    free(inside);
    if (ellipticity != NULL && n > 1) {
        xx = xx / n - sx / n * (sx / n);
        yy = yy / n - sy / n * (sy / n);
        xy = xy / n - sx / n * (sy / n);
        double half = hypot((xx - yy) / 2, xy), mean = (xx + yy) / 2;
        *ellipticity = 1 - sqrt(fmax(mean - half, 0) / (mean + half));
    }
    *fwhm = 2 * sqrt(n / M_PI) / FINE;
    return RX_OK;
}

void rx_stamp_centroid(const float *stamp, int size, double fwhm, double *dx, double *dy)
{
    const int centre = size / 2;
    double sum = 0, sx = 0, sy = 0;
    for (int k = 0; k < size * size; k++) {
        double x = k % size - centre, y = k / size - centre;
        double w = exp(-4 * 0.6931471805599453 * (x * x + y * y) / (fwhm * fwhm)) * stamp[k];
        sum += w;
        sx += w * x;
        sy += w * y;
    }
    /* the weight halves the shift of a PSF that is as wide as itself */
    *dx = sum > 0 ? 2 * sx / sum : 0;
    *dy = sum > 0 ? 2 * sy / sum : 0;
}

void rx_stamp_shift(float *stamp, int size, double dx, double dy, float *work)
{
    memcpy(work, stamp, (size_t)size * (size_t)size * sizeof *work);
    for (int k = 0; k < size * size; k++)
        stamp[k] = (float)interpolate(work, size, k % size - dx, k / size - dy);
}

rx_status rx_stamp_psf(rx_psf_type type, const float *stamp, int size, rx_psf **dst, rx_error *err)
{
    const size_t area = (size_t)size * (size_t)size;
    rx_psf *psf = *dst = rx_psf_new(type, size, 1);
    if (psf == NULL)
        return rx_error_memory(err, area * sizeof *stamp);
    memcpy(psf->basis, stamp, area * sizeof *stamp);
    rx_status status = rx_stamp_fwhm(stamp, size, &psf->fwhm, &psf->ellipticity, err);
    if (status != RX_OK) {
        rx_psf_free(psf);
        *dst = NULL;
    }
    return status;
}

rx_psf *rx_stamp_gauss(double fwhm)
{
    const int radius = fwhm > 0 ? rx_gauss_radius(fwhm) : 0, size = 2 * radius + 1;
    rx_psf *psf = rx_psf_new(fwhm > 0 ? RX_PSF_GAUSS : RX_PSF_PIXEL, size, 1);
    float *weights = RX_NEW(float, (size_t)size);
    if (psf == NULL || weights == NULL) {
        rx_psf_free(psf);
        free(weights);
        return NULL;
    }
    weights[0] = 1;
    if (fwhm > 0)
        rx_gauss_weights(fwhm, radius, weights);
    for (int k = 0; k < size * size; k++)
        psf->basis[k] = weights[k / size] * weights[k % size];
    free(weights);
    if (fwhm > 0) {
        psf->fwhm = fwhm;
        snprintf(psf->description, sizeof psf->description, "Gaussian of FWHM %.4g pixels", fwhm);
    } else {
        psf->fwhm = 1;
        snprintf(psf->description, sizeof psf->description, "a single pixel");
    }
    return psf;
}

void rx_stamp_inside(const float *stamp, int size, double *inside)
{
    const int stride = size + 1;
    for (int i = 0; i < stride; i++)
        inside[i] = 0;
    for (int j = 0; j < size; j++) {
        double row = 0;
        inside[(j + 1) * stride] = 0;
        for (int i = 0; i < size; i++) {
            row += stamp[j * size + i];
            inside[(j + 1) * stride + i + 1] = inside[j * stride + i + 1] + row;
        }
    }
}
