/* Optics of any kind: sampling, Gaussians, Moffats, PSFs on pixels and back. */
#include "simulate/optics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "psf/moffat.h"

/* What is left of the spectrum beyond the sampling; of what is left beyond the band in which stars on the
 * grid are exact, more can be borne: there they are only damped. */
#define BEYOND_SAMPLING 5e-5
#define BEYOND_GRID 1e-4

/* Strength of the spectrum at f cycles/pixel, pixel response not included, 1 at f = 0. */
typedef double spectrum_shape(const void *shape, double f);

enum { GRID_LEAST = 3 }; /* galaxies have structure that pixels as cells would not resolve */

/* Zeroed, one constant term of factor 1. */
static rx_status new_optics(int oversampling, int size, int nbasis, rx_optics **dst, rx_error *err)
{
    rx_optics *optics;
    *dst = NULL;
    RX_TRY(RX_MAKE(optics, 1, err));
    *optics = (rx_optics){.oversampling = oversampling,
                          .grid = GRID_LEAST,
                          .size = size,
                          .nbasis = nbasis,
                          .nterms = 1,
                          .xs = 1.0,
                          .ys = 1.0};
    optics->terms[0].factor = 1.0;
    const rx_status status = RX_MAKE(optics->basis, (size_t)nbasis * (size_t)size * (size_t)size, err);
    if (status == RX_OK)
        *dst = optics;
    else
        free(optics);
    return status;
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
static int least_cells(spectrum_shape *spectrum, const void *shape, double share, double limit)
{
    static const int odd[] = {1, 3, 5, 7, 9};
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++) {
        double f = share * odd[i];
        if (spectrum(shape, f) * fmin(1.0, 1.0 / (M_PI * f)) < limit)
            return odd[i];
    }
    return 15;
}

static int optics_sampling(spectrum_shape *spectrum, const void *shape)
{
    return least_cells(spectrum, shape, 0.5, BEYOND_SAMPLING);
}

static int optics_grid(spectrum_shape *spectrum, const void *shape)
{
    return (int)fmax(GRID_LEAST, least_cells(spectrum, shape, RX_STAR_BAND, BEYOND_GRID));
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
    int cells = optics_sampling(gauss_spectrum, &sigma), half = cells * (int)ceil(5.5 * sigma + 1.0);
    rx_optics *optics = NULL;
    double *line, total = 0.0;
    RX_TRY(RX_MAKE(line, 2 * (size_t)half + 1, err));
    const rx_status status = new_optics(cells, 2 * half + 1, 1, &optics, err);
    if (status != RX_OK) {
        free(line);
        return status;
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
    optics->grid = optics_grid(gauss_spectrum, &sigma);
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
    rx_optics *optics;
    *dst = NULL;
    RX_TRY(new_optics(1, psf->size, psf->nbasis, &optics, err));
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

/* --- Moffats, constant and varying across the tile --- */

#define MISSING 1e-4       /* flux beyond the stamp */
#define MOST_FWHM 30.0     /* half side of the stamp at most, FWHM */
#define MOST_PIXELS 1000.0 /* and pixels */
#define FOLLOWED 1e-4      /* of the peak: how well the polynomial follows the varying profile */
enum { MOST_DEGREE = 8 };  /* in the square of the distance: 45 terms */

typedef struct moffat {
    double fwhm, beta, ratio, angle, variation; /* rx_moffat_profile */
    double narrowest, widest;                   /* FWHM of the whole tile: minor axis, major axis */
} moffat;

static rx_status check(const moffat *m, rx_error *err)
{
    if (!(m->fwhm >= 0.5 && m->fwhm <= 200.0))
        return rx_error_set(err, RX_USAGE, "a PSF FWHM of %g pixels cannot be used; give PSF_FWHM 0.5 to 200",
                            m->fwhm);
    if (!(m->beta >= 1.2 && m->beta <= 1000.0))
        return rx_error_set(err, RX_USAGE,
                            "a Moffat exponent of %g cannot be used; give PSF_BETA 1.2 to 1000", m->beta);
    if (!(m->ratio >= 0.1 && m->ratio <= 1.0) || !isfinite(m->angle))
        return rx_error_set(err, RX_USAGE, "a PSF axis ratio of %g cannot be used; give PSF_RATIO 0.1 to 1",
                            m->ratio);
    if (!(m->variation >= -0.5 && m->variation <= 2.0))
        return rx_error_set(err, RX_USAGE,
                            "a PSF that varies by %g cannot be used; give PSF_VARIATION -0.5 to 2",
                            m->variation);
    return RX_OK;
}

/* Modulation transfer of the round Moffat of half width `hwhm`, alpha = hwhm / sqrt(2^(1/beta) - 1):
 * 2 (z/2)^nu K_nu(z) / Gamma(nu), z = 2 pi alpha f, nu = beta - 1, its Hankel transform (Trujillo et al.
 * 2001, MNRAS 328, 977), with K_nu(z) = integral of exp(-z cosh t) cosh(nu t), t > 0, by the trapezoidal
 * rule. */
static double moffat_spectrum(const void *shape, double f)
{
    enum { STEPS = 400 };
    const moffat *m = shape;
    int sign;
    double nu = m->beta - 1.0, z = M_PI * m->narrowest / sqrt(expm1(M_LN2 / m->beta)) * f;
    double front = M_LN2 + nu * log(0.5 * z) - lgamma_r(nu, &sign);
    double top = asinh(nu / z), width = 1.0 / sqrt(z * cosh(top));
    double from = fmax(0.0, top - 12.0 * width), step = (top + 12.0 * width - from) / STEPS, sum = 0.0;
    for (int i = 0; i <= STEPS; i++) {
        double t = from + i * step, w = i == 0 ? 0.5 : 1.0;
        sum += w * exp(front + nu * t - z * cosh(t)) * 0.5 * (1.0 + exp(-2.0 * nu * t));
    }
    return fmin(sum * step, 1.0);
}

/* --- the varying profile as a polynomial in s, the square of the distance in units of the corner's --- */

static double fwhm_at(const moffat *m, double s)
{
    return m->fwhm * (1.0 + m->variation * s);
}

/* Coefficients of the polynomials through Chebyshev's points: value(s) = sum_ij s^j inverse[j][i] value_i. */
typedef struct ladder {
    int degree;
    double s[MOST_DEGREE + 1], inverse[MOST_DEGREE + 1][MOST_DEGREE + 1];
} ladder;

static void set_ladder(int degree, ladder *l)
{
    l->degree = degree;
    for (int i = 0; i <= degree; i++)
        l->s[i] = degree == 0 ? 0.0 : 0.5 - 0.5 * cos(M_PI * (i + 0.5) / (degree + 1));
    for (int i = 0; i <= degree; i++) {
        double product[MOST_DEGREE + 2] = {1.0};
        int order = 0;
        for (int k = 0; k <= degree; k++) {
            if (k == i)
                continue;
            double scale = 1.0 / (l->s[i] - l->s[k]);
            order++;
            for (int j = order; j >= 0; j--)
                product[j] = scale * ((j > 0 ? product[j - 1] : 0.0) - l->s[k] * product[j]);
        }
        for (int j = 0; j <= degree; j++)
            l->inverse[j][i] = product[j];
    }
}

static double profile(const moffat *m, double s, double radius)
{
    double f = fwhm_at(m, s), x = 2.0 * radius / f;
    return pow(1.0 + expm1(M_LN2 / m->beta) * x * x, -m->beta) / (f * f);
}

/* Largest error of the polynomial at any place, of the local peak. */
static double ladder_error(const moffat *m, const ladder *l)
{
    double worst = 0.0;
    for (int k = 0; k <= 40; k++)
        for (int r = 0; r <= 60; r++) {
            double s = k / 40.0, radius = 0.03 * r * m->fwhm * (1.0 + fmax(m->variation, 0.0)), sum = 0.0;
            for (int j = l->degree; j >= 0; j--) {
                double coefficient = 0.0;
                for (int i = 0; i <= l->degree; i++)
                    coefficient += l->inverse[j][i] * profile(m, l->s[i], radius);
                sum = sum * s + coefficient;
            }
            worst = fmax(worst, fabs(sum - profile(m, s, radius)) / profile(m, s, 0.0));
        }
    return worst;
}

static rx_status choose_ladder(const moffat *m, ladder *l, rx_error *err)
{
    for (int degree = m->variation == 0.0 ? 0 : 1; degree <= MOST_DEGREE; degree++) {
        set_ladder(degree, l);
        if (degree == 0 || ladder_error(m, l) < FOLLOWED)
            return RX_OK;
    }
    return rx_error_set(err, RX_USAGE,
                        "a PSF that varies by %g is more than a polynomial can follow; give a smaller "
                        "PSF_VARIATION",
                        m->variation);
}

/* --- stamps --- */

/* stamp [size][size] = the profile of that FWHM and flux 1 on cells; what is symmetric is computed once. */
static void fill_stamp(const moffat *m, double fwhm, int cells, int size, double *stamp)
{
    const int half = size / 2, round = m->ratio == 1.0;
    double shape[RX_MOFFAT_SHAPE];
    rx_moffat p;
    rx_moffat_shape(fwhm, m->beta, m->ratio, m->angle, shape);
    rx_moffat_set(&p, shape);
    double scale = p.k * (p.beta - 1.0) / (M_PI * p.hwhm * p.hwhm);
    double *centre = stamp + (size_t)half * (size_t)size + half;
    for (int j = 0; j <= half; j++)
        for (int i = round ? j : -half; i <= half; i++) {
            double value = scale * rx_moffat_pixel(&p, (double)i / cells, (double)j / cells, NULL);
            centre[j * size + i] = centre[-j * size - i] = value;
            if (round) {
                centre[-j * size + i] = centre[j * size - i] = value;
                centre[i * size + j] = centre[-i * size - j] = value;
                centre[-i * size + j] = centre[i * size - j] = value;
            }
        }
}

/* s^j = (X^2 + Y^2)^j by the binomial theorem. */
static void set_terms(int degree, rx_optics *optics)
{
    optics->nterms = 0;
    for (int j = 0; j <= degree; j++) {
        double binomial = 1.0;
        for (int i = 0; i <= j; i++) {
            int t = optics->nterms++;
            optics->terms[t].image = j;
            optics->terms[t].px = 2 * (j - i);
            optics->terms[t].py = 2 * i;
            optics->terms[t].factor = binomial;
            binomial *= (double)(j - i) / (i + 1);
        }
    }
}

static rx_status fill_basis(const moffat *m, const ladder *l, rx_optics *optics, rx_error *err)
{
    const size_t n = (size_t)optics->size * (size_t)optics->size;
    double *images, *stamp, sum = 0.0;
    RX_TRY(RX_MAKE(images, n * (size_t)(optics->nbasis + 1), err));
    stamp = images + n * (size_t)optics->nbasis;
    for (int i = 0; i <= l->degree; i++) {
        fill_stamp(m, fwhm_at(m, l->s[i]), optics->oversampling, optics->size, stamp);
        for (int j = 0; j <= l->degree; j++)
            for (size_t k = 0; k < n; k++)
                images[(size_t)j * n + k] += l->inverse[j][i] * stamp[k];
    }
    for (size_t k = 0; k < n * (size_t)optics->nbasis; k++)
        optics->basis[k] = (float)images[k];
    for (size_t k = 0; k < n; k++)
        sum += images[k];
    optics->missing = 1.0 - sum / ((double)optics->oversampling * optics->oversampling);
    free(images);
    return RX_OK;
}

static void describe(const moffat *m, rx_optics *optics)
{
    size_t size = sizeof optics->description;
    int n = snprintf(optics->description, size, "Moffat FWHM %.3f px, beta %.4g", m->fwhm, m->beta);
    if (m->ratio < 1.0)
        n += snprintf(optics->description + n, size - (size_t)n, ", ellipticity %.3f", 1.0 - m->ratio);
    if (m->variation != 0.0)
        n += snprintf(optics->description + n, size - (size_t)n, ", %+.4g %% in the corners",
                      100.0 * m->variation);
    if (optics->missing > 2.0 * MISSING)
        snprintf(optics->description + n, size - (size_t)n, ", %.2g of the flux beyond its stamp",
                 optics->missing);
}

rx_status rx_optics_moffat(const rx_moffat_profile *profile, int width, int height, rx_optics **dst,
                           rx_error *err)
{
    const double fwhm = profile->fwhm, ratio = profile->ratio, variation = profile->variation;
    moffat m = {fwhm, profile->beta, ratio, profile->angle, variation, 0.0, 0.0};
    rx_optics *optics;
    rx_status status;
    ladder l;
    *dst = NULL;
    RX_TRY(check(&m, err));
    RX_TRY(choose_ladder(&m, &l, err));
    m.narrowest = fmin(fwhm, fwhm_at(&m, 1.0)) * sqrt(ratio);
    m.widest = fmax(fwhm, fwhm_at(&m, 1.0)) / sqrt(ratio);
    const double share = m.widest * 0.5 * rx_moffat_radius_flux(m.beta, MISSING);
    const int half = (int)ceil(fmin(fmax(share, 2.0), fmin(MOST_PIXELS, MOST_FWHM * m.widest)));
    /* as rx_psf_moffat() cuts */
    const double radius = fmin(rx_moffat_radius_flux(m.beta, 1e-3), rx_moffat_radius_level(m.beta, 1e-5));
    const int cut = (int)fmin(fmax(ceil(0.5 * m.widest * radius), 2.0), fmax(127.0, 2.0 * m.widest));
    const int cells = optics_sampling(moffat_spectrum, &m);
    RX_TRY(new_optics(cells, 2 * cells * half + 1, l.degree + 1, &optics, err));
    optics->grid = optics_grid(moffat_spectrum, &m);
    optics->type = RX_PSF_MOFFAT;
    optics->fwhm = fwhm;
    optics->beta = profile->beta;
    optics->ellipticity = 1.0 - ratio;
    optics->pixels = 2 * (cut < half ? cut : half) + 1;
    optics->x0 = variation == 0.0 ? 0.0 : 0.5 * (width - 1);
    optics->y0 = variation == 0.0 ? 0.0 : 0.5 * (height - 1);
    optics->xs = optics->ys = variation == 0.0 ? 1.0 : fmax(0.5 * hypot(width - 1, height - 1), 1.0);
    set_terms(l.degree, optics);
    RX_TRY_EXIT(fill_basis(&m, &l, optics, err));
    describe(&m, optics);
    *dst = optics;
    optics = NULL;
exit:
    rx_optics_free(optics);
    return status;
}
