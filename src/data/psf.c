/* PSFs as plain data: making, copying, evaluating, freeing. */
#include "data/psf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

rx_psf *rx_psf_new(rx_psf_type type, int size, int nbasis)
{
    rx_psf *psf = RX_NEW(rx_psf, 1);
    if (psf == NULL)
        return NULL;
    psf->type = type;
    psf->size = size;
    psf->nbasis = nbasis;
    psf->xs = psf->ys = 1.0;
    psf->basis = rx_alloc((size_t)nbasis * (size_t)size, (size_t)size * sizeof(float));
    if (psf->basis == NULL) {
        free(psf);
        return NULL;
    }
    return psf;
}

int rx_psf_sample(rx_psf *psf, int fine)
{
    const size_t side = (size_t)fine * (size_t)(psf->size - 1) + 1;
    psf->fine = fine;
    psf->samples = rx_alloc((size_t)psf->nbasis * side, side * sizeof(float));
    return psf->samples != NULL;
}

void rx_psf_pick(rx_psf *psf)
{
    const size_t size = (size_t)psf->size, side = (size_t)rx_psf_fine_side(psf), fine = (size_t)psf->fine;
    for (size_t b = 0; b < (size_t)psf->nbasis; b++)
        for (size_t j = 0; j < size; j++)
            for (size_t i = 0; i < size; i++)
                psf->basis[(b * size + j) * size + i] = psf->samples[(b * side + fine * j) * side + fine * i];
}

rx_psf *rx_psf_copy(const rx_psf *psf)
{
    rx_psf *copy = rx_psf_new(psf->type, psf->size, psf->nbasis);
    if (copy == NULL)
        return NULL;
    float *basis = copy->basis;
    *copy = *psf;
    copy->basis = basis;
    copy->samples = NULL;
    copy->stars = NULL;
    copy->tested = NULL;
    if (psf->samples != NULL && !rx_psf_sample(copy, psf->fine)) {
        rx_psf_free(copy);
        return NULL;
    }
    if (psf->samples != NULL)
        memcpy(copy->samples, psf->samples,
               (size_t)psf->nbasis * (size_t)rx_psf_fine_side(psf) * (size_t)rx_psf_fine_side(psf) *
                   sizeof(float));
    memcpy(basis, psf->basis, sizeof(float) * (size_t)psf->nbasis * (size_t)psf->size * (size_t)psf->size);
    if (psf->stars != NULL && psf->nstars > 0) {
        copy->stars = rx_alloc((size_t)psf->nstars, sizeof *copy->stars);
        if (copy->stars == NULL) {
            rx_psf_free(copy);
            return NULL;
        }
        memcpy(copy->stars, psf->stars, sizeof *copy->stars * (size_t)psf->nstars);
    }
    return copy;
}

static double power(double base, int exponent)
{
    double product = 1.0;
    for (int i = 0; i < exponent; i++)
        product *= base;
    return product;
}

typedef struct {
    double of[RX_PSF_MAX_BASIS];
} coefficients;

static coefficients coefficients_at(const rx_psf *psf, double x, double y)
{
    coefficients c;
    for (int b = 0; b < psf->nbasis; b++)
        c.of[b] = power((x - psf->x0) / psf->xs, psf->px[b]) * power((y - psf->y0) / psf->ys, psf->py[b]);
    return c;
}

static double mixed(const rx_psf *psf, const coefficients *c, const float *images, size_t n, size_t i)
{
    double sum = 0.0;
    for (int b = 0; b < psf->nbasis; b++)
        sum += c->of[b] * (double)images[(size_t)b * n + i];
    return sum;
}

static void mix(const rx_psf *psf, const float *images, size_t n, double x, double y, float *stamp)
{
    const coefficients c = coefficients_at(psf, x, y);
    for (size_t i = 0; i < n; i++)
        stamp[i] = (float)mixed(psf, &c, images, n, i);
}

double rx_psf_noise_area(const rx_psf *psf, double x, double y)
{
    const coefficients c = coefficients_at(psf, x, y);
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    double squares = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double value = mixed(psf, &c, psf->basis, n, i);
        squares += value * value;
    }
    return squares > 0.0 ? 1.0 / squares : 1.0;
}

void rx_psf_at(const rx_psf *psf, double x, double y, float *stamp)
{
    mix(psf, psf->basis, (size_t)psf->size * (size_t)psf->size, x, y, stamp);
}

void rx_psf_fine_at(const rx_psf *psf, double x, double y, float *stamp)
{
    const size_t side = (size_t)rx_psf_fine_side(psf);
    mix(psf, psf->samples != NULL ? psf->samples : psf->basis, side * side, x, y, stamp);
}

static void judged_free(rx_psf_tested *tested)
{
    if (tested == NULL)
        return;
    free(tested->star);
    free(tested->growth);
    free(tested->residual);
    free(tested);
}

void rx_psf_free(rx_psf *psf)
{
    if (psf == NULL)
        return;
    free(psf->basis);
    free(psf->samples);
    free(psf->stars);
    judged_free(psf->tested);
    free(psf);
}

const char *rx_psf_how_name(rx_psf_how how)
{
    static const char *const names[] = {"", "PIXELS", "MOFFAT", "MOFFAT_BETA", "WIDTH", "BESIDE", "STATED"};
    return names[how];
}

double rx_psf_flux_error(const rx_psf *psf, double x, double y)
{
    const double at[2] = {(x - psf->x0) / psf->xs, (y - psf->y0) / psf->ys};
    double share[2];
    int cell[2];
    for (int d = 0; d < 2; d++) {
        const double t = fmin(fmax(0.5 * (at[d] + 1.0), 0.0), 1.0) * (RX_PSF_CELLS - 1);
        cell[d] = t < RX_PSF_CELLS - 2 ? (int)t : RX_PSF_CELLS - 2;
        share[d] = t - cell[d];
    }
    const double(*e)[RX_PSF_CELLS] = &psf->quality.flux_errors[cell[1]];
    return hypot(psf->quality.flux_error,
                 (1.0 - share[1]) * ((1.0 - share[0]) * e[0][cell[0]] + share[0] * e[0][cell[0] + 1]) +
                     share[1] * ((1.0 - share[0]) * e[1][cell[0]] + share[0] * e[1][cell[0] + 1]));
}

double rx_psf_flux_error_mean(const rx_psf *psf)
{
    const rx_psf_quality *q = &psf->quality;
    double square = q->flux_error * q->flux_error;
    for (int i = 0; i < RX_PSF_CELLS * RX_PSF_CELLS; i++)
        square +=
            pow(q->flux_errors[i / RX_PSF_CELLS][i % RX_PSF_CELLS], 2.0) / (RX_PSF_CELLS * RX_PSF_CELLS);
    return sqrt(square);
}
