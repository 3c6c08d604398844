#include "psf/moffat_fit.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/lsq.h"
#include "psf/psf.h"

/* Order of the parameters in a fit; the sky comes last so that it can be left out. */
enum { PEAK, CENTRE_X, CENTRE_Y, SHAPE, SKY = SHAPE + RX_MOFFAT_SHAPE, WITH_SKY };

rx_status rx_moffat_pixels_new(int capacity, rx_moffat_pixels *dst, rx_error *err)
{
    double *block = rx_alloc((size_t)capacity, 4 * sizeof(double));
    *dst = (rx_moffat_pixels){.x = block};
    if (block == NULL)
        return rx_error_memory(err, (size_t)capacity * 4 * sizeof(double));
    dst->y = block + capacity;
    dst->value = block + 2 * (size_t)capacity;
    dst->sigma = block + 3 * (size_t)capacity;
    return RX_OK;
}

void rx_moffat_pixels_free(rx_moffat_pixels *pixels)
{
    free(pixels->x);
    *pixels = (rx_moffat_pixels){.n = 0};
}

typedef struct fit_task {
    const rx_moffat_pixels *pixels;
    int nparameters, rough;
    double fixed_sky;
} fit_task;

static int fit_model(void *user, const double *p, double *residuals, double *jacobian)
{
    const fit_task *task = user;
    const rx_moffat_pixels *px = task->pixels;
    double sky = task->nparameters == WITH_SKY ? p[SKY] : task->fixed_sky;
    rx_moffat profile;
    for (int i = 0; i < task->nparameters; i++)
        if (!isfinite(p[i]))
            return 1;
    rx_moffat_set(&profile, p + SHAPE);
    profile.rough = task->rough;
    for (int i = 0; i < px->n; i++) {
        double g[2 + RX_MOFFAT_SHAPE], weight = 1.0 / px->sigma[i];
        double f = rx_moffat_pixel(&profile, px->x[i] - p[CENTRE_X], px->y[i] - p[CENTRE_Y], g);
        residuals[i] = (sky + p[PEAK] * f - px->value[i]) * weight;
        double *row = jacobian + (size_t)i * (size_t)task->nparameters;
        row[PEAK] = f * weight;
        row[CENTRE_X] = -p[PEAK] * g[0] * weight;
        row[CENTRE_Y] = -p[PEAK] * g[1] * weight;
        for (int k = 0; k < RX_MOFFAT_SHAPE; k++)
            row[SHAPE + k] = p[PEAK] * g[2 + k] * weight;
        if (task->nparameters == WITH_SKY)
            row[SKY] = weight;
    }
    return 0;
}

rx_status rx_moffat_fit_run(const rx_moffat_pixels *pixels, int free_sky, rx_moffat_fit *fit, rx_error *err)
{
    fit_task task = {.pixels = pixels,
                     .nparameters = free_sky ? WITH_SKY : SKY,
                     .rough = fit->rough,
                     .fixed_sky = fit->sky};
    double p[WITH_SKY] = {fit->peak, fit->x, fit->y};
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++)
        p[SHAPE + k] = fit->shape[k];
    p[SKY] = fit->sky;
    fit->converged = 0;
    if (pixels->n < task.nparameters)
        return RX_OK;
    rx_lsq_problem problem = {.nresiduals = (size_t)pixels->n,
                              .nparameters = (size_t)task.nparameters,
                              .model = fit_model,
                              .user = &task,
                              .max_iterations = 60,
                              .tolerance = 1e-6};
    rx_lsq_result result;
    rx_error local = rx_error_part(err);
    rx_status status = rx_lsq_fit(&problem, p, NULL, &result, &local);
    if (status == RX_INPUT)
        return RX_OK;
    if (status != RX_OK) {
        rx_error_take(err, &local);
        return status;
    }
    fit->peak = p[PEAK];
    fit->x = p[CENTRE_X];
    fit->y = p[CENTRE_Y];
    for (int k = 0; k < RX_MOFFAT_SHAPE; k++)
        fit->shape[k] = p[SHAPE + k];
    if (free_sky)
        fit->sky = p[SKY];
    fit->chi2 = result.chi2;
    fit->converged = result.converged && p[PEAK] > 0.0;
    return RX_OK;
}

double rx_moffat_fit_value(const rx_moffat_fit *fit, const rx_moffat *profile, double x, double y)
{
    return fit->sky + fit->peak * rx_moffat_pixel(profile, x - fit->x, y - fit->y, NULL);
}

double rx_moffat_fit_fwhm(const rx_moffat_fit *fit)
{
    return 2.0 * exp(fit->shape[0]);
}

double rx_moffat_fit_ellipticity(const rx_moffat_fit *fit)
{
    return 1.0 - exp(-hypot(fit->shape[1], fit->shape[2]));
}

/* Pixels within `radius` of the stamp's middle, at most `reach` away along each axis, all with the same
 * weight: the core decides. */
static void stamp_pixels(const float *stamp, int size, int reach, double radius, double sigma,
                         rx_moffat_pixels *dst)
{
    int half = size / 2;
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++) {
            if (hypot(i, j) > radius)
                continue;
            dst->x[dst->n] = i;
            dst->y[dst->n] = j;
            dst->value[dst->n] = (double)stamp[(size_t)(j + half) * (size_t)size + (size_t)(i + half)];
            dst->sigma[dst->n++] = sigma;
        }
}

rx_status rx_psf_shape(const float *stamp, int size, double *fwhm, double *ellipticity, double *beta,
                       rx_error *err)
{
    size_t n = (size_t)size * (size_t)size, above = 0, at = 0;
    for (size_t i = 1; i < n; i++)
        at = stamp[i] > stamp[at] ? i : at;
    for (size_t i = 0; i < n; i++)
        above += stamp[i] > 0.5F * stamp[at];
    double peak = (double)stamp[at], guess = 2.0 * sqrt((double)above / M_PI);
    double radius = 4.0 * guess; /* 4.5 pixels at least, for the peak is above its half */
    int reach = (int)fmin(ceil(radius), size / 2);
    rx_moffat_pixels pixels;
    rx_status status = rx_moffat_pixels_new((2 * reach + 1) * (2 * reach + 1), &pixels, err);
    if (status != RX_OK)
        return status;
    stamp_pixels(stamp, size, reach, radius, 0.01 * peak, &pixels);
    rx_moffat_fit fit = {.peak = peak,
                         .x = (double)(at % (size_t)size) - size / 2,
                         .y = (double)(at / (size_t)size) - size / 2};
    rx_moffat_shape(guess, 4.0, 1.0, 0.0, fit.shape);
    if (peak > 0.0)
        status = rx_moffat_fit_run(&pixels, 0, &fit, err);
    rx_moffat_pixels_free(&pixels);
    if (status != RX_OK)
        return status;
    if (!fit.converged)
        return rx_error_set(err, RX_INPUT, "the PSF image has no core that a profile could be fitted to");
    rx_moffat profile;
    rx_moffat_set(&profile, fit.shape);
    *fwhm = rx_moffat_fit_fwhm(&fit);
    *ellipticity = rx_moffat_fit_ellipticity(&fit);
    if (beta != NULL)
        *beta = profile.beta;
    return RX_OK;
}
