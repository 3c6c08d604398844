/* PSFs from files: what a file holds, and the polynomial of the tile that its PSF becomes. */
#include "psf/psf_files.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

const char *rx_psf_base_name(const char *file)
{
    const char *slash = strrchr(file, '/');
    return slash != NULL ? slash + 1 : file;
}

int rx_psf_cut_size(int from, int size)
{
    return size > 0 && size < from ? size : from;
}

double rx_psf_beyond(double low, double high, int length)
{
    return high > low ? fmax(fmax(low - 0.5, length + 0.5 - high) / (high - low), 0.0) : 0.0;
}

void rx_psf_warn_beyond(const char *file, const char *what, double beyond, rx_log *log)
{
    if (beyond > 0.5)
        rx_log_warning(
            log, "%s: the tile reaches %.1f times the range of the %s beyond it; was it made from this tile?",
            file, beyond, what);
}

void rx_psf_warn_misfit(const rx_psf_source *src, double misfit, rx_log *log)
{
    if (misfit > 0.01)
        rx_log_warning(
            log,
            "%s: the %s varies more than a polynomial of the tile can follow: it is met to %.1f %% "
            "of the peak only",
            src->file, src->what, 100.0 * misfit);
}

/* --- the polynomial --- */

/* Powers by rising total degree, up to `most`, in the axes that vary. Returns how many. */
static int powers(const int degree[2], int most, int px[RX_PSF_MAX_BASIS], int py[RX_PSF_MAX_BASIS])
{
    int n = 0;
    for (int d = 0; d <= most; d++)
        for (int j = 0; j <= d; j++)
            if (d - j <= degree[0] && j <= degree[1]) {
                px[n] = d - j;
                py[n++] = j;
            }
    return n;
}

/* A fit in progress: columns of the design matrix made orthonormal (Gram-Schmidt, twice), the images that belong to
 * them, and how far each degree is from the stamps. */
typedef struct fit {
    const rx_psf_source *src;
    int fine, side;      /* samples a pixel, of a stamp */
    int n, most, nterms; /* places, degree, terms of it */
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    double (*at)[2];
    double *q;                     /* [nterms][n] */
    double (*r)[RX_PSF_MAX_BASIS]; /* [nterms]: from columns to the orthonormal ones */
    double *images, *stamp;        /* [nterms][side][side], [side][side] */
    double first_sum, predicted[RX_PSF_MAX_DEGREE + 1], misfit[RX_PSF_MAX_DEGREE + 1];
} fit;

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static void orthonormalise(fit *f, const rx_psf *psf)
{
    for (int t = 0; t < f->nterms; t++) {
        double *column = f->q + (size_t)t * (size_t)f->n;
        for (int k = 0; k < f->n; k++)
            column[k] = pow((f->at[k][0] - psf->x0) / psf->xs, f->px[t]) *
                        pow((f->at[k][1] - psf->y0) / psf->ys, f->py[t]);
        const double before = sqrt(dot(column, column, f->n));
        for (int i = 0; i < 2 * t; i++) {
            const double *q = f->q + (size_t)(i % t) * (size_t)f->n, share = dot(q, column, f->n);
            f->r[i % t][t] += share;
            for (int k = 0; k < f->n; k++)
                column[k] -= share * q[k];
        }
        /* a term that the places do not separate from those before it is left out */
        const double norm = sqrt(dot(column, column, f->n)), known = norm > 1e-9 * before;
        f->r[t][t] = known ? norm : 1.0;
        for (int k = 0; k < f->n; k++)
            column[k] = known ? column[k] / norm : 0.0;
    }
}

/* f->stamp = the PSF at place k, sum 1 of whole pixels. */
static rx_status draw(fit *f, int k, rx_error *err)
{
    const int pixels = f->side * f->side;
    double sum = 0.0;
    RX_TRY(f->src->draw(f->src->model, k, f->at[k][0], f->at[k][1], f->fine, f->stamp, err));
    for (int j = 0; j < f->side; j += f->fine)
        for (int i = 0; i < f->side; i += f->fine)
            sum += f->stamp[j * f->side + i];
    if (k == 0)
        f->first_sum = sum;
    if (!(sum > 0.05 * f->first_sum && f->first_sum > 0.0 && isfinite(sum)))
        return rx_error_at(
            err, RX_INPUT, f->src->file, -1, 0,
            "the %s sums to %g at pixel (%.0f,%.0f) of the tile; was it made from this tile, and "
            "from enough stars?",
            f->src->what, sum, f->at[k][0] + 1.0, f->at[k][1] + 1.0);
    for (int i = 0; i < pixels; i++)
        f->stamp[i] /= sum;
    return RX_OK;
}

/* What is left of stamp k after each degree, there and as predicted from the other places. */
static void compare(fit *f, int k)
{
    const int pixels = f->side * f->side;
    double peak = 0.0, leverage = 0.0;
    for (int i = 0; i < pixels; i++)
        peak = fmax(peak, f->stamp[i]);
    for (int t = 0; t < f->nterms; t++) {
        const double q = f->q[(size_t)t * (size_t)f->n + (size_t)k],
                     *image = f->images + (size_t)t * (size_t)pixels;
        leverage += q * q;
        for (int i = 0; i < pixels; i++)
            f->stamp[i] -= q * image[i];
        const int degree = f->px[t] + f->py[t];
        if (t + 1 < f->nterms && f->px[t + 1] + f->py[t + 1] == degree)
            continue;
        double worst = 0.0;
        for (int i = 0; i < pixels; i++)
            worst = fmax(worst, fabs(f->stamp[i]));
        f->misfit[degree] = fmax(f->misfit[degree], worst / peak);
        f->predicted[degree] += dot(f->stamp, f->stamp, pixels) / fmax(pow(1.0 - leverage, 2.0), 1e-12);
    }
}

/* Chebyshev points of the tile, or the source's own places. */
static rx_status find_places(fit *f, const rx_psf *psf, rx_error *err)
{
    const rx_psf_source *src = f->src;
    const int nx = src->degree[0] >= 0 ? f->most + 3 : 1, ny = src->degree[1] >= 0 ? f->most + 3 : 1;
    f->n = src->n > 0 ? src->n : nx * ny;
    f->at = rx_alloc((size_t)f->n, sizeof *f->at);
    if (f->at == NULL)
        return rx_error_memory(err, 0);
    for (int k = 0; k < f->n; k++) {
        const double u = cos(M_PI * (k % nx + 0.5) / nx), v = cos(M_PI * (k / nx + 0.5) / ny);
        f->at[k][0] = src->n > 0 ? src->at[k][0] : psf->x0 + u * psf->xs;
        f->at[k][1] = src->n > 0 ? src->at[k][1] : psf->y0 + v * psf->ys;
    }
    return RX_OK;
}

/* fwhm and ellipticity at the tile's centre. */
static rx_status describe(rx_psf *psf, const char *file, int width, int height, rx_error *err)
{
    float *stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    if (stamp == NULL)
        return rx_error_memory(err, 0);
    rx_error local = rx_error_part(err);
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), stamp);
    rx_status status = rx_psf_shape(stamp, psf->size, &psf->fwhm, &psf->ellipticity, NULL, &local);
    free(stamp);
    if (status != RX_OK)
        return rx_error_at(err, status, file, -1, 0, "%s; is it a PSF?", local.text);
    return RX_OK;
}

/* For a tile of that size. */
static rx_status project(const rx_psf_source *src, int fine, const int size[2], rx_psf **dst, int *degree,
                         double *misfit, rx_error *err)
{
    const int width = size[0], height = size[1];
    fit f = {.src = src, .fine = fine, .side = fine * (src->size - 1) + 1};
    int varies[2], least = 0;
    rx_psf *psf = NULL;
    for (int axis = 0; axis < 2; axis++) {
        varies[axis] = src->n > 0 || src->degree[axis] >= 0 ? RX_PSF_MAX_DEGREE : 0;
        least = src->degree[axis] > least ? src->degree[axis] : least;
        f.most = src->n == 0 && varies[axis] > 0 ? RX_PSF_MAX_DEGREE : f.most;
    }
    while (f.most < RX_PSF_MAX_DEGREE && powers(varies, f.most + 1, f.px, f.py) < src->n)
        f.most++;
    f.nterms = powers(varies, f.most, f.px, f.py);
    const size_t pixels = (size_t)f.side * (size_t)f.side;
    rx_status status = RX_OK;
    psf = rx_psf_new(src->type, src->size, f.nterms);
    f.images = rx_alloc((size_t)f.nterms, pixels * sizeof(double));
    f.stamp = RX_NEW(double, pixels);
    f.r = rx_alloc((size_t)f.nterms, sizeof *f.r);
    if (psf == NULL || f.images == NULL || f.stamp == NULL || f.r == NULL ||
        (fine > 1 && !rx_psf_sample(psf, fine))) {
        status = rx_error_memory(err, pixels * (size_t)f.nterms * sizeof(double));
        goto exit;
    }
    psf->x0 = 0.5 * (width - 1);
    psf->y0 = 0.5 * (height - 1);
    psf->xs = 0.5 * width;
    psf->ys = 0.5 * height;
    status = find_places(&f, psf, err);
    if (status == RX_OK && (f.q = rx_alloc((size_t)f.nterms * (size_t)f.n, sizeof(double))) == NULL)
        status = rx_error_memory(err, 0);
    if (status != RX_OK)
        goto exit;
    orthonormalise(&f, psf);
    for (int k = 0; k < f.n && status == RX_OK; k++) {
        status = draw(&f, k, err);
        for (int t = 0; t < f.nterms && status == RX_OK; t++)
            for (size_t i = 0; i < pixels; i++)
                f.images[(size_t)t * pixels + i] += f.q[(size_t)t * (size_t)f.n + (size_t)k] * f.stamp[i];
    }
    for (int k = 0; k < f.n && status == RX_OK; k++) {
        status = draw(&f, k, err);
        if (status == RX_OK)
            compare(&f, k);
    }
    if (status != RX_OK)
        goto exit;
    int best = f.most;
    for (int d = f.most - 1; d >= (src->n > 0 ? 0 : least); d--)
        if (src->n > 0 ? f.predicted[d] <= f.predicted[best] : f.misfit[d] < 1e-4)
            best = d;
    psf->nbasis = powers(varies, best, psf->px, psf->py);
    for (int t = psf->nbasis - 1; t >= 0; t--) /* from orthonormal columns to powers */
        for (size_t i = 0; i < pixels; i++) {
            double value = f.images[(size_t)t * pixels + i];
            for (int s = t + 1; s < psf->nbasis; s++)
                value -= f.r[t][s] * f.images[(size_t)s * pixels + i];
            f.images[(size_t)t * pixels + i] = value /= f.r[t][t];
            (fine > 1 ? psf->samples : psf->basis)[(size_t)t * pixels + i] = (float)value;
        }
    if (fine > 1)
        rx_psf_pick(psf);
    status = describe(psf, src->file, width, height, err);
    *degree = best;
    *misfit = f.misfit[best];
exit:
    free(f.at);
    free(f.q);
    free(f.r);
    free(f.images);
    free(f.stamp);
    if (status != RX_OK) {
        rx_psf_free(psf);
        psf = NULL;
    }
    *dst = psf;
    return status;
}

rx_status rx_psf_project(const rx_psf_source *src, int width, int height, rx_psf **dst, int *degree,
                         double *misfit, rx_error *err)
{
    const int size[2] = {width, height};
    RX_TRY(project(src, 1, size, dst, degree, misfit, err));
    const int asked = rx_psf_narrow_samples((*dst)->fwhm), fine = asked < src->finest ? asked : src->finest;
    if (fine < 2)
        return RX_OK;
    rx_psf_free(*dst);
    return project(src, fine, size, dst, degree, misfit, err);
}

/* --- what a file holds --- */

static rx_status refuse_model(const char *file, const char *whose, rx_error *err)
{
    return rx_error_at(err, RX_INPUT, file, -1, 0,
                       "is a model of %s; give the file that python3 -m rextract.psf_models MODEL OUT.fits "
                       "makes of it",
                       whose);
}

/* A profile of DAOPHOT's alone is a header without an image, which is read as no cube. */
static bool is_daophot(const rx_fits_cube *cube, const char *file)
{
    char *cards = NULL, word[80];
    long n = 0;
    if (cube == NULL && rx_fits_read_header(file, 0, &cards, &n, NULL) != RX_OK)
        return false;
    const char *all = cube != NULL ? cube->cards : cards;
    const long count = cube != NULL ? cube->ncards : n;
    const bool found = rx_cards_text(all, count, "FUNCTION", word, sizeof word) &&
                       rx_cards_text(all, count, "VARORDER", word, sizeof word);
    free(cards);
    return found;
}

rx_status rx_psf_file(const rx_psf_params *par, int width, int height, rx_log *log, rx_psf **dst,
                      rx_error *err)
{
    rx_table *table = NULL;
    rx_fits_cube cube = {0};
    int hdu = -1;
    *dst = NULL;
    const int piff = rx_fits_read_named(par->file, "psf", &table, &hdu, NULL) == RX_OK && table != NULL &&
                     rx_table_find(table, "type") >= 0;
    rx_table_free(table);
    if (piff)
        return refuse_model(par->file, "Piff", err);
    table = NULL;
    const int psfex =
        rx_fits_read_table(par->file, 0, &table, NULL) == RX_OK && rx_table_find(table, "PSF_MASK") >= 0;
    rx_table_free(table);
    if (psfex) {
        if (par->sampling > 0.0 || par->integrate != RX_PSF_INTEGRATE_AUTO)
            rx_log_warning(
                log, "%s: PSF_SAMPLING and PSF_INTEGRATE are for images, and are not used for this file",
                par->file);
        return rx_psf_psfex(par, width, height, log, dst, err);
    }
    rx_error why = rx_error_part(err);
    rx_status status = rx_fits_read_cube(par->file, &cube, &why);
    if (is_daophot(status == RX_OK ? &cube : NULL, par->file))
        status = refuse_model(par->file, "DAOPHOT", err);
    else if (status != RX_OK)
        rx_error_take(err, &why);
    else if (cube.planes == 0)
        status = rx_error_at(err, RX_INPUT, par->file, -1, 0, "holds no image; is it a PSF?");
    else
        status = rx_psf_images(par, &cube, width, height, log, dst, err);
    rx_fits_cube_free(&cube);
    return status;
}
