/* Optics of any kind: sampling, Gaussians, PSFs on pixels and back. */
#include "simulate/optics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "simulate/optics_parts.h"
#include "simulate/render_parts.h"

/* What is left of the spectrum beyond the sampling; of what is left beyond the band in which stars on the
 * grid are exact, more can be borne: there they are only damped. */
#define BEYOND_SAMPLING 5e-5
#define BEYOND_GRID 1e-4

enum { GRID_LEAST = 3 }; /* galaxies have structure that pixels as cells would not resolve */

rx_optics *rx_optics_new(int oversampling, int size, int nbasis)
{
    rx_optics *optics = RX_NEW(rx_optics, 1);
    if (optics == NULL)
        return NULL;
    optics->basis = rx_alloc((size_t)nbasis * (size_t)size, (size_t)size * sizeof(float));
    if (optics->basis == NULL) {
        free(optics);
        return NULL;
    }
    optics->oversampling = oversampling;
    optics->grid = GRID_LEAST;
    optics->size = size;
    optics->nbasis = nbasis;
    optics->nterms = 1;
    optics->terms[0].factor = 1.0;
    optics->xs = optics->ys = 1.0;
    return optics;
}

void rx_optics_free(rx_optics *optics)
{
    if (optics == NULL)
        return;
    free(optics->basis);
    free(optics);
}

/* Least number of cells for which the spectrum beyond share * cells is below the limit: odd ones without
 * prime factors beyond 7, which keep fast transforms fast. The pixel response falls as 1 / (pi f); its zeros
 * are not counted on. */
static int least_cells(rx_spectrum *spectrum, const void *shape, double share, double limit)
{
    static const int odd[] = {1, 3, 5, 7, 9};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        double f = share * odd[i];
        if (spectrum(shape, f) * fmin(1.0, 1.0 / (M_PI * f)) < limit)
            return odd[i];
    }
    return 15;
}

int rx_optics_sampling(rx_spectrum *spectrum, const void *shape)
{
    return least_cells(spectrum, shape, 0.5, BEYOND_SAMPLING);
}

int rx_optics_grid(rx_spectrum *spectrum, const void *shape)
{
    int cells = least_cells(spectrum, shape, RX_STAR_BAND, BEYOND_GRID);
    return cells < GRID_LEAST ? GRID_LEAST : cells;
}

static double gauss_spectrum(const void *shape, double f)
{
    const double *sigma = shape;
    return exp(-2.0 * M_PI * M_PI * *sigma * *sigma * f * f);
}

rx_status rx_optics_gauss(double fwhm, rx_optics **dst, rx_error *err)
{
    *dst = NULL;
    if (!(fwhm >= 0.5 && fwhm <= 200.0))
        return rx_error_set(err, RX_USAGE,
                            "a target FWHM of %g pixels cannot be used; give SHARP_FWHM 1 to 200", fwhm);
    double sigma = fwhm / sqrt(8.0 * M_LN2);
    int cells = rx_optics_sampling(gauss_spectrum, &sigma), half = cells * (int)ceil(5.5 * sigma + 1.0);
    rx_optics *optics = rx_optics_new(cells, 2 * half + 1, 1);
    double *line = RX_NEW(double, 2 * half + 1), total = 0.0;
    if (optics == NULL || line == NULL) {
        rx_optics_free(optics);
        free(line);
        return rx_error_memory(err, 0);
    }
    for (int i = -half; i <= half; i++) {
        double x = fabs((double)i / cells), low = (x - 0.5) * M_SQRT1_2 / sigma,
               high = (x + 0.5) * M_SQRT1_2 / sigma;
        line[i + half] = low > 0.0 ? 0.5 * (erfc(low) - erfc(high)) : 0.5 * (erf(high) - erf(low));
        total += line[i + half] / cells;
    }
    for (int j = 0; j < optics->size; j++)
        for (int i = 0; i < optics->size; i++)
            optics->basis[(size_t)j * (size_t)optics->size + (size_t)i] = (float)(line[i] * line[j]);
    free(line);
    optics->grid = rx_optics_grid(gauss_spectrum, &sigma);
    optics->type = RX_PSF_GAUSS;
    optics->fwhm = fwhm;
    optics->missing = 1.0 - total * total;
    optics->pixels = 2 * (half / cells) + 1;
    snprintf(optics->description, sizeof optics->description, "Gaussian FWHM %.3f px", fwhm);
    *dst = optics;
    return RX_OK;
}

rx_status rx_optics_psf(const rx_psf *psf, rx_optics **dst, rx_error *err)
{
    size_t n = (size_t)psf->nbasis * (size_t)psf->size * (size_t)psf->size;
    rx_optics *optics = rx_optics_new(1, psf->size, psf->nbasis);
    *dst = NULL;
    if (optics == NULL)
        return rx_error_memory(err, n * sizeof(float));
    memcpy(optics->basis, psf->basis, n * sizeof(float));
    optics->nterms = psf->nbasis;
    for (int t = 0; t < psf->nbasis; t++) {
        optics->terms[t].image = t;
        optics->terms[t].px = psf->px[t];
        optics->terms[t].py = psf->py[t];
        optics->terms[t].factor = 1.0;
    }
    optics->x0 = psf->x0;
    optics->y0 = psf->y0;
    optics->xs = psf->xs;
    optics->ys = psf->ys;
    optics->type = psf->type;
    optics->fwhm = psf->fwhm;
    optics->beta = psf->beta;
    optics->ellipticity = psf->ellipticity;
    optics->pixels = psf->size;
    memcpy(optics->description, psf->description, sizeof optics->description);
    *dst = optics;
    return RX_OK;
}

/* Which image of psf holds the term X^px Y^py; a new one when none does. Constant ones come first. */
static int find_image(rx_psf *psf, int px, int py)
{
    for (int b = 0; b < psf->nbasis; b++)
        if (psf->px[b] == px && psf->py[b] == py)
            return b;
    psf->px[psf->nbasis] = px;
    psf->py[psf->nbasis] = py;
    return psf->nbasis++;
}

/* image += factor * the cells in the middle of pixels. */
static void add_sampled(const rx_optics *optics, int t, int size, double *image)
{
    const int cells = optics->oversampling;
    const float *basis = optics->basis + (size_t)optics->terms[t].image * (size_t)optics->size * optics->size;
    for (int j = 0; j < size; j++)
        for (int i = 0; i < size; i++) {
            int y = optics->size / 2 + cells * (j - size / 2), x = optics->size / 2 + cells * (i - size / 2);
            image[(size_t)j * size + i] +=
                optics->terms[t].factor * (double)basis[(size_t)y * optics->size + x];
        }
}

/* Basis 0 to sum 1, the others to sum 0: PSF / sum(PSF) to first order in how much the sum varies, which is
 * by part of `missing` only. */
static void store_normalised(const double *images, rx_psf *psf)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    double first = 0.0;
    for (size_t i = 0; i < n; i++)
        first += images[i];
    for (int b = psf->nbasis - 1; b >= 0; b--) {
        double sum = 0.0;
        for (size_t i = 0; i < n && b > 0; i++)
            sum += images[(size_t)b * n + i];
        for (size_t i = 0; i < n; i++)
            psf->basis[(size_t)b * n + i] =
                (float)((images[(size_t)b * n + i] - sum / first * images[i]) / first);
    }
}

rx_status rx_optics_on_pixels(const rx_optics *optics, rx_psf **dst, rx_error *err)
{
    const size_t n = (size_t)optics->pixels * (size_t)optics->pixels;
    rx_psf *psf = rx_psf_new(optics->type, optics->pixels, optics->nterms);
    double *images = rx_alloc((size_t)optics->nterms * n, sizeof(double));
    *dst = NULL;
    if (psf == NULL || images == NULL) {
        rx_psf_free(psf);
        free(images);
        return rx_error_memory(err, (size_t)optics->nterms * n * sizeof(double));
    }
    psf->nbasis = 1; /* exponents 0, 0 */
    for (int t = 0; t < optics->nterms; t++)
        add_sampled(optics, t, psf->size,
                    images + n * (size_t)find_image(psf, optics->terms[t].px, optics->terms[t].py));
    store_normalised(images, psf);
    free(images);
    psf->x0 = optics->x0;
    psf->y0 = optics->y0;
    psf->xs = optics->xs;
    psf->ys = optics->ys;
    psf->fwhm = optics->fwhm;
    psf->beta = optics->beta;
    psf->ellipticity = optics->ellipticity;
    memcpy(psf->description, optics->description, sizeof psf->description);
    *dst = psf;
    return RX_OK;
}
