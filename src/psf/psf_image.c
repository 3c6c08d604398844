/* PSF_TYPE FILE, and what file PSFs share: resampling and description. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/fits_read.h"
#include "psf/psf.h"
#include "psf/psf_parts.h"

/* Windowed sinc (Lanczos): weights, sum 1, of the 2 order samples from the returned index on around
 * `position`. */
static int lanczos_weights(double position, int order, double weights[2 * RX_LANCZOS_MAX])
{
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

/* One axis: dst[i] = src at centre + (i - size / 2) * step, 0 outside. */
static void resample_line(const double *src, int n, int src_stride, double centre, double step, int order,
                          double *dst, int size, int dst_stride)
{
    for (int i = 0; i < size; i++) {
        double weights[2 * RX_LANCZOS_MAX], sum = 0.0;
        int first = lanczos_weights(centre + (i - size / 2) * step, order, weights);
        for (int k = 0; k < 2 * order; k++)
            if (first + k >= 0 && first + k < n)
                sum += weights[k] * src[(size_t)(first + k) * (size_t)src_stride];
        dst[(size_t)i * (size_t)dst_stride] = sum;
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
        resample_line(values + (size_t)j * (size_t)src->width, src->width, 1, src->centre_x, step, order,
                      rows + (size_t)j * (size_t)size, size, 1);
    for (int i = 0; i < size; i++)
        resample_line(rows + i, src->height, size, src->centre_y, step, order, dst + i, size, size);
exit:
    free(values);
    free(rows);
    return status;
}

const char *rx_psf_base_name(const char *file)
{
    const char *slash = strrchr(file, '/');
    return slash != NULL ? slash + 1 : file;
}

rx_status rx_psf_describe(rx_psf *psf, const char *file, int width, int height, rx_error *err)
{
    float *stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    if (stamp == NULL)
        return rx_error_memory(err, 0);
    rx_error local = RX_ERROR_NONE;
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), stamp);
    rx_status status = rx_psf_shape(stamp, psf->size, &psf->fwhm, &psf->ellipticity, NULL, &local);
    free(stamp);
    if (status != RX_OK)
        return rx_error_at(err, status, file, -1, 0, "%s; is it a PSF?", local.text);
    return RX_OK;
}

rx_status rx_psf_check_size(const char *file, int psf_width, int psf_height, int width, int height,
                            rx_error *err)
{
    if (psf_width > RX_PSF_LARGEST || psf_height > RX_PSF_LARGEST)
        return rx_error_at(err, RX_INPUT, file, -1, 0,
                           "a PSF of %d x %d pixels is larger than %d; give an odd PSF_SIZE", psf_width,
                           psf_height, RX_PSF_LARGEST);
    if (psf_width <= width && psf_height <= height)
        return RX_OK;
    return rx_error_at(
        err, RX_INPUT, file, -1, 0,
        "a PSF of %d x %d pixels is larger than the tile of %d x %d; give a smaller one or an odd PSF_SIZE",
        psf_width, psf_height, width, height);
}

int rx_psf_cut_size(int from, int size)
{
    return size > 0 && size < from ? size : from;
}

/* The image must hold something that can be normalised. */
static rx_status check_pixels(const char *file, const float *pixels, int width, int height, rx_error *err)
{
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)width * (size_t)height; i++) {
        if (!isfinite(pixels[i]))
            return rx_error_at(err, RX_INPUT, file, -1, 0,
                               "pixel (%zu,%zu) of the PSF image is not a number; replace blank pixels by 0",
                               i % (size_t)width + 1, i / (size_t)width + 1);
        sum += (double)pixels[i];
    }
    if (!(sum > 0.0))
        return rx_error_at(err, RX_INPUT, file, -1, 0,
                           "the PSF image sums to %g; give a PSF with positive flux on a background of 0",
                           sum);
    return RX_OK;
}

/* A PSF whose light is off the centre of its frame moves everything that is restored with it. */
static void warn_off_centre(const char *file, const rx_psf *psf, rx_log *log)
{
    int half = psf->size / 2;
    double sum = 0.0, x = 0.0, y = 0.0, peak = 0.0;
    for (int i = 0; i < psf->size * psf->size; i++)
        peak = fmax(peak, (double)psf->basis[i]);
    for (int j = 0; j < psf->size; j++)
        for (int i = 0; i < psf->size; i++) {
            double v = (double)psf->basis[j * psf->size + i];
            if (v < 0.2 * peak)
                continue;
            sum += v;
            x += v * (i - half);
            y += v * (j - half);
        }
    if (hypot(x, y) > 0.3 * sum)
        rx_log_warning(
            log,
            "%s: the PSF's light is centred (%+.2f, %+.2f) pixels off its frame's centre; restored "
            "positions shift by as much",
            file, x / sum, y / sum);
}

/* Side of the PSF: the frame's, made odd, or what is asked for; RX_INPUT when the tile is smaller. */
static rx_status choose_side(const char *file, const rx_psf_raster *stamp, int asked, int width, int height,
                             int *side, rx_error *err)
{
    int longer = stamp->width > stamp->height ? stamp->width : stamp->height;
    int odd = rx_psf_cut_size(longer % 2 == 0 ? longer + 1 : longer, asked);
    if (odd > longer && (odd > width || odd > height))
        odd = longer - 1; /* half a pixel less on each side instead of more */
    *side = odd;
    if (odd <= width && odd <= height && odd <= RX_PSF_LARGEST)
        return RX_OK;
    return rx_psf_check_size(file, odd < longer ? odd : longer, odd < longer ? odd : longer, width, height,
                             err);
}

/* The stamp on odd pixels, sum 1. */
static rx_status fill_basis(const char *file, const rx_psf_raster *stamp, rx_psf *psf, rx_error *err)
{
    size_t n = (size_t)psf->size * (size_t)psf->size;
    double *values = RX_NEW(double, n), sum = 0.0;
    if (values == NULL)
        return rx_error_memory(err, n * sizeof(double));
    rx_status status = rx_psf_resample(stamp, 1.0, RX_LANCZOS_MAX, values, psf->size, err);
    for (size_t i = 0; i < n; i++)
        sum += values[i];
    if (status == RX_OK && !(sum > 0.0))
        status = rx_error_at(err, RX_INPUT, file, -1, 0,
                             "the middle %d x %d pixels of the PSF image sum to %g; give a larger PSF_SIZE",
                             psf->size, psf->size, sum);
    for (size_t i = 0; i < n && status == RX_OK; i++)
        psf->basis[i] = (float)(values[i] / sum);
    free(values);
    return status;
}

rx_status rx_psf_image(const char *file, int size, int width, int height, rx_log *log, rx_psf **dst,
                       rx_error *err)
{
    rx_psf_raster stamp = {.pixels = NULL};
    float *pixels = NULL;
    int side;
    rx_psf *psf = NULL;
    *dst = NULL;
    rx_status status = rx_fits_read_image(file, &pixels, &stamp.width, &stamp.height, err);
    if (status == RX_OK)
        status = choose_side(file, &stamp, size, width, height, &side, err);
    if (status == RX_OK)
        status = check_pixels(file, pixels, stamp.width, stamp.height, err);
    if (status != RX_OK)
        goto exit;
    psf = rx_psf_new(RX_PSF_FILE, side, 1);
    if (psf == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    stamp.pixels = pixels;
    stamp.centre_x = 0.5 * (stamp.width - 1);
    stamp.centre_y = 0.5 * (stamp.height - 1);
    status = fill_basis(file, &stamp, psf, err);
    if (status == RX_OK)
        status = rx_psf_describe(psf, file, width, height, err);
    if (status != RX_OK)
        goto exit;
    warn_off_centre(file, psf, log);
    snprintf(psf->description, sizeof psf->description,
             "image %.60s, %d x %d px, FWHM %.3f px, ellipticity %.3f", rx_psf_base_name(file), stamp.width,
             stamp.height, psf->fwhm, psf->ellipticity);
    *dst = psf;
    psf = NULL;
exit:
    rx_psf_free(psf);
    free(pixels);
    return status;
}
