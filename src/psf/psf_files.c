/* PSFs from files. PSF_TYPE FILE: an image. PSF_TYPE PSFEX: the models that PSFEx writes (.psf).
 *
 *   PSF(x, y) = sum_i m_i(X, Y) mask_i,  X = (x - POLZERO) / POLSCAL with FITS coordinates (1-based)
 *   m_i: 1, X, X^2, .. X^d, Y, X Y, .. X^(d-1) Y, .. Y^d   (SExtractor's order of a group of two)
 *
 * mask_i are sampled in steps of PSF_SAMP tile pixels but already hold the tile pixel's own
 * smoothing, so they are interpolated (Lanczos-4, as PSFEx and SExtractor do), not integrated.
 *
 * PSFEx does not keep the sum of the model constant across the field; ours must sum to 1 everywhere.
 * PSF(x, y) / sum(x, y) is no polynomial, so it is projected by least squares onto the monomials of two
 * degrees more over the tile. The projection reproduces the constant 1 exactly, which makes basis 0 sum
 * to 1 and the others to 0; the shape changes by less than 2e-4 of the peak (DECam models, degree 2 to 6).
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "data/table.h"
#include "io/fits_read.h"
#include "num/lsq.h"
#include "psf/psf.h"
#include "psf/resample.h"

/* The file's name without its folder: outputs hold no paths. */
static const char *base_name(const char *file)
{
    const char *slash = strrchr(file, '/');
    return slash != NULL ? slash + 1 : file;
}

/* fwhm, ellipticity at the tile's centre from the stamp there; error names the file. */
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

/* Side that is left of a square stamp of odd side `from` when `size` (0 = all) is asked for. */
static int cut_size(int from, int size)
{
    return size > 0 && size < from ? size : from;
}

/* --- an image --- */

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
    int odd = cut_size(longer % 2 == 0 ? longer + 1 : longer, asked);
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

rx_status rx_psf_image(const rx_psf_params *par, int width, int height, rx_log *log, rx_psf **dst,
                       rx_error *err)
{
    const char *file = par->file;
    rx_psf_raster stamp = {.pixels = NULL};
    float *pixels = NULL;
    int side;
    rx_psf *psf = NULL;
    *dst = NULL;
    rx_status status = rx_fits_read_image(file, &pixels, &stamp.width, &stamp.height, err);
    if (status == RX_OK)
        status = choose_side(file, &stamp, par->size, width, height, &side, err);
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
        status = describe(psf, file, width, height, err);
    if (status != RX_OK)
        goto exit;
    warn_off_centre(file, psf, log);
    snprintf(psf->description, sizeof psf->description,
             "image %.60s, %d x %d px, FWHM %.3f px, ellipticity %.3f", base_name(file), stamp.width,
             stamp.height, psf->fwhm, psf->ellipticity);
    *dst = psf;
    psf = NULL;
exit:
    rx_psf_free(psf);
    free(pixels);
    return status;
}

/* --- PSFEx --- */

enum { MAX_DEGREE = 6, MORE = 2, GRID = 2 * (MAX_DEGREE + MORE) + 3, POINTS = GRID * GRID };

typedef struct model {
    const char *file;
    int width, height, nterms; /* of PSF_MASK */
    int degree[2];             /* highest power in x and y; both together at most the larger */
    int first;                 /* axis (0 x, 1 y) whose power varies fastest from term to term */
    double zero[2], scale[2];  /* x, y */
    double sampling;           /* tile pixels per model pixel */
    float *mask;               /* [nterms][height][width] */
} model;

/* A number from the header or, in merged tables, from the column of that name; 0 when absent. */
static int find_number(const rx_table *table, const char *key, double *value)
{
    if (table->cards != NULL && rx_cards_number(table->cards, table->ncards, key, value))
        return 1;
    int column = rx_table_find(table, key);
    if (column < 0 || table->columns[column].type == RX_CELL_TEXT)
        return 0;
    *value = rx_column_value(&table->columns[column], 0, 0);
    return 1;
}

static int find_text(const rx_table *table, const char *key, char *text, int size)
{
    if (table->cards != NULL && rx_cards_text(table->cards, table->ncards, key, text, size))
        return 1;
    int column = rx_table_find(table, key);
    if (column < 0 || table->columns[column].type != RX_CELL_TEXT)
        return 0;
    snprintf(text, (size_t)size, "%s", (const char *)table->columns[column].data);
    for (size_t n = strlen(text); n > 0 && text[n - 1] == ' '; n--)
        text[n - 1] = '\0';
    return 1;
}

/* As find_number(), for whole numbers within limits. */
static rx_status need_integer(const model *m, const rx_table *table, const char *key, int low, int high,
                              int *dst, rx_error *err)
{
    double value;
    if (!find_number(table, key, &value))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "no %s: not a PSFEx model; give a .psf file written by psfex", key);
    if (!(value >= low && value <= high) || value != floor(value))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0, "%s = %g of the PSFEx model is not in %d to %d",
                           key, value, low, high);
    *dst = (int)value;
    return RX_OK;
}

static rx_status need_real(const model *m, const rx_table *table, const char *key, double *dst, rx_error *err)
{
    if (!find_number(table, key, dst) || !isfinite(*dst))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "no usable %s: not a PSFEx model; give a .psf file written by psfex", key);
    return RX_OK;
}

/* 0 for an x position, 1 for y, -1 for what is no position. */
static int positional_axis(const char *name)
{
    static const char *const names[] = {"_IMAGE", "WIN_IMAGE", "PSF_IMAGE", "MODEL_IMAGE", "PEAK_IMAGE"};
    int axis = strncasecmp(name, "X", 1) == 0 ? 0 : strncasecmp(name, "Y", 1) == 0 ? 1 : -1;
    for (size_t i = 0; axis >= 0 && i < sizeof names / sizeof *names; i++)
        if (strcasecmp(name + 1, names[i]) == 0)
            return axis;
    return -1;
}

/* One variable of the polynomial: POLNAMEi, POLZEROi, POLSCALi. */
static rx_status read_variable(model *m, const rx_table *table, int i, int degree, rx_error *err)
{
    char key[24], name[72] = "";
    snprintf(key, sizeof key, "POLNAME%d", i);
    find_text(table, key, name, sizeof name);
    int axis = positional_axis(name);
    if (axis < 0 || m->degree[axis] > 0)
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "the PSFEx model varies with '%s', not only with the position; run psfex with "
                           "PSFVAR_KEYS X_IMAGE,Y_IMAGE",
                           name);
    m->degree[axis] = degree;
    if (i == 1)
        m->first = axis;
    snprintf(key, sizeof key, "POLZERO%d", i);
    rx_status status = need_real(m, table, key, &m->zero[axis], err);
    snprintf(key, sizeof key, "POLSCAL%d", i);
    if (status == RX_OK)
        status = need_real(m, table, key, &m->scale[axis], err);
    if (status == RX_OK && m->scale[axis] == 0.0)
        return rx_error_at(err, RX_INPUT, m->file, -1, 0, "%s of the PSFEx model is 0; make the model again",
                           key);
    return status;
}

/* Merged tables, as surveys hand them on, leave out what the rest determines: the number of variables where
 * POLZEROi says it, that of groups where there is one, the axes of the mask where they follow from it. */
static rx_status read_polynomial(model *m, const rx_table *table, rx_error *err)
{
    int naxis = 0, groups = 1, degree;
    double value;
    rx_status status = RX_OK;
    m->scale[0] = m->scale[1] = 1.0;
    if (find_number(table, "POLNAXIS", &value) || !find_number(table, "POLDEG1", &value))
        status = need_integer(m, table, "POLNAXIS", 0, 2, &naxis, err);
    else
        naxis = find_number(table, "POLZERO2", &value) ? 2 : find_number(table, "POLZERO1", &value);
    if (status != RX_OK || naxis == 0)
        return status;
    if (find_number(table, "POLNGRP", &value))
        status = need_integer(m, table, "POLNGRP", 1, 2, &groups, err);
    else if (naxis == 2 && find_number(table, "POLGRP2", &value) && value > 1)
        groups = 2;
    if (status != RX_OK)
        return status;
    if (groups != 1)
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "the PSFEx model has %d polynomial groups; run psfex with PSFVAR_GROUPS 1,1",
                           groups);
    status = need_integer(m, table, "POLDEG1", 0, MAX_DEGREE, &degree, err);
    for (int i = 1; i <= naxis && status == RX_OK && degree > 0; i++)
        status = read_variable(m, table, i, degree, err);
    return status;
}

static int model_degree(const model *m)
{
    return m->degree[0] > m->degree[1] ? m->degree[0] : m->degree[1];
}

/* Powers of x and y of each term, in SExtractor's order, with `more` degrees in each axis that
 * varies at all. Returns how many. */
static int term_powers(const model *m, int more, int px[RX_PSF_MAX_BASIS], int py[RX_PSF_MAX_BASIS])
{
    int n = 0, fast = m->first, slow = 1 - fast;
    int most = model_degree(m) + more, most_fast = m->degree[fast] > 0 ? most : 0;
    int most_slow = m->degree[slow] > 0 ? most : 0;
    for (int j = 0; j <= most_slow; j++)
        for (int i = 0; i <= most_fast && i + j <= most; i++) {
            px[n] = fast == 0 ? i : j;
            py[n++] = fast == 0 ? j : i;
        }
    return n;
}

/* PSFNAXIS and PSFAXISi, or what PSF_MASK's own dimensions say with the polynomial's number of terms. */
static rx_status read_axes(model *m, const rx_table *table, const rx_column *mask, int nterms, rx_error *err)
{
    int naxis = nterms > 1 ? 3 : 2;
    double value;
    rx_status status = RX_OK;
    m->nterms = naxis == 3 ? nterms : 1;
    if (find_number(table, "PSFNAXIS", &value)) {
        status = need_integer(m, table, "PSFNAXIS", 2, 3, &naxis, err);
        m->nterms = 1;
    }
    if (status == RX_OK && !find_number(table, "PSFAXIS1", &value) && mask != NULL && mask->ndim == 2 &&
        mask->dim[0] <= 4096 && mask->dim[1] % nterms == 0 && mask->dim[1] / nterms <= 4096) {
        m->width = mask->dim[0];
        m->height = mask->dim[1] / nterms;
        m->nterms = nterms;
        return RX_OK;
    }
    if (status == RX_OK)
        status = need_integer(m, table, "PSFAXIS1", 1, 4096, &m->width, err);
    if (status == RX_OK)
        status = need_integer(m, table, "PSFAXIS2", 1, 4096, &m->height, err);
    if (status == RX_OK && naxis == 3 && (find_number(table, "PSFAXIS3", &value) || m->nterms == 1))
        status = need_integer(m, table, "PSFAXIS3", 1, RX_PSF_MAX_BASIS, &m->nterms, err);
    return status;
}

static rx_status read_mask(model *m, const rx_table *table, rx_error *err)
{
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS], column = rx_table_find(table, "PSF_MASK");
    rx_status status =
        read_axes(m, table, column >= 0 ? &table->columns[column] : NULL, term_powers(m, 0, px, py), err);
    if (status != RX_OK)
        return status;
    if (m->nterms != term_powers(m, 0, px, py))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "the PSFEx model has %d images where its polynomial asks for %d; make it again",
                           m->nterms, term_powers(m, 0, px, py));
    long n = (long)m->nterms * m->width * m->height;
    if (column < 0 || table->nrows < 1 || rx_column_elements(&table->columns[column]) != n)
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "no PSF_MASK of %d x %d x %d values: not a PSFEx model, or a damaged one",
                           m->width, m->height, m->nterms);
    m->mask = RX_NEW(float, n);
    if (m->mask == NULL)
        return rx_error_memory(err, sizeof(float) * (size_t)n);
    for (long i = 0; i < n; i++) {
        m->mask[i] = (float)rx_column_value(&table->columns[column], 0, i);
        if (!isfinite(m->mask[i]))
            return rx_error_at(
                err, RX_INPUT, m->file, -1, 0,
                "image %ld of the PSFEx model holds values that are not numbers: psfex found too "
                "few stars; make it again",
                i / ((long)m->width * m->height));
    }
    return RX_OK;
}

/* psfex writes a table for each image of a multi-extension catalogue; a file with one serves every image. */
static rx_status read_table(const char *file, int extension, rx_table **dst, rx_error *err)
{
    if (extension > 1 && rx_fits_read_table(file, extension - 1, dst, NULL) == RX_OK)
        return RX_OK;
    return rx_fits_read_table(file, 0, dst, err);
}

static rx_status read_model(const char *file, int extension, model *m, rx_error *err)
{
    rx_table *table = NULL;
    *m = (model){.file = file, .sampling = 1.0};
    rx_status status = read_table(file, extension, &table, err);
    if (status == RX_OK && table->nrows != 1)
        status = rx_error_at(err, RX_INPUT, file, -1, 0,
                             "a table of %ld rows where a PSFEx model has one; pick the row of this tile",
                             table->nrows);
    if (status == RX_OK)
        status = read_polynomial(m, table, err);
    if (status == RX_OK)
        status = read_mask(m, table, err);
    if (status == RX_OK)
        status = need_real(m, table, "PSF_SAMP", &m->sampling, err);
    if (status == RX_OK && !(m->sampling >= 0.02 && m->sampling <= 50.0))
        status = rx_error_at(err, RX_INPUT, file, -1, 0, "PSF_SAMP = %g of the PSFEx model cannot be right",
                             m->sampling);
    rx_table_free(table);
    return status;
}

static double term(double x, double y, int px, int py)
{
    double value = 1.0;
    for (int i = 0; i < px; i++)
        value *= x;
    for (int i = 0; i < py; i++)
        value *= y;
    return value;
}

/* PSF / sum at POINTS Chebyshev points of the tile: monomials in the tile's own coordinates (-1..1) into
 * `ours` [POINTS][nbasis], the model's coefficients divided by the sum into `theirs` [nterms][POINTS]. */
static rx_status sample_tile(const model *m, const rx_psf *psf, const double *sums, double *ours,
                             double *theirs, rx_error *err)
{
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    term_powers(m, 0, px, py);
    for (int p = 0; p < POINTS; p++) {
        double u = cos(M_PI * (p % GRID + 0.5) / GRID), v = cos(M_PI * (p / GRID + 0.5) / GRID), total = 0.0;
        double x = (psf->x0 + u * psf->xs + 1.0 - m->zero[0]) / m->scale[0];
        double y = (psf->y0 + v * psf->ys + 1.0 - m->zero[1]) / m->scale[1];
        for (int i = 0; i < psf->nbasis; i++)
            ours[p * psf->nbasis + i] = term(u, v, psf->px[i], psf->py[i]);
        for (int t = 0; t < m->nterms; t++)
            total += (theirs[t * POINTS + p] = term(x, y, px[t], py[t])) * sums[t];
        if (!(total > 0.05 * sums[0]) || !(sums[0] > 0.0))
            return rx_error_at(
                err, RX_INPUT, m->file, -1, 0,
                "the PSFEx model sums to %g at pixel (%.0f,%.0f) of the tile; was it made from this "
                "tile, and from enough stars?",
                total, psf->x0 + u * psf->xs + 1.0, psf->y0 + v * psf->ys + 1.0);
        for (int t = 0; t < m->nterms; t++)
            theirs[t * POINTS + p] /= total;
    }
    return RX_OK;
}

/* Basis images of the normalised model from those of the file (`images`, [nterms][size][size]). */
static rx_status normalise(const model *m, const double *images, rx_psf *psf, rx_error *err)
{
    size_t pixels = (size_t)psf->size * (size_t)psf->size;
    double sums[RX_PSF_MAX_BASIS] = {0.0}, *mixing = RX_NEW(double, m->nterms * psf->nbasis);
    double *ours = RX_NEW(double, POINTS * psf->nbasis), *theirs = RX_NEW(double, POINTS * m->nterms);
    rx_status status = RX_OK;
    if (mixing == NULL || ours == NULL || theirs == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    for (int t = 0; t < m->nterms; t++)
        for (size_t i = 0; i < pixels; i++)
            sums[t] += images[(size_t)t * pixels + i];
    status = sample_tile(m, psf, sums, ours, theirs, err);
    for (int t = 0; t < m->nterms && status == RX_OK; t++)
        status = rx_lsq_linear(ours, theirs + t * POINTS, NULL, POINTS, (size_t)psf->nbasis,
                               mixing + t * psf->nbasis, NULL, NULL, err);
    for (int b = 0; b < psf->nbasis && status == RX_OK; b++)
        for (size_t i = 0; i < pixels; i++) {
            double value = 0.0;
            for (int t = 0; t < m->nterms; t++)
                value += mixing[t * psf->nbasis + b] * images[(size_t)t * pixels + i];
            psf->basis[(size_t)b * pixels + i] = (float)value;
        }
exit:
    free(mixing);
    free(ours);
    free(theirs);
    return status;
}

/* How far the tile reaches out of the range that the model's stars covered, in units of that range. */
static double extrapolation(const model *m, int width, int height)
{
    double worst = 0.0, edge[2] = {width, height};
    for (int axis = 0; axis < 2; axis++)
        for (int side = 0; side < 2 && m->degree[axis] > 0; side++)
            worst = fmax(worst, fabs((side * edge[axis] + 0.5 - m->zero[axis]) / m->scale[axis]) - 0.5);
    return worst;
}

/* Each image of the model on the tile's pixels, [nterms][size][size]. */
static rx_status resample_model(const model *m, int size, double *images, rx_error *err)
{
    rx_status status = RX_OK;
    for (int t = 0; t < m->nterms && status == RX_OK; t++) {
        /* PSFEx puts the centre on pixel size / 2 (from 0), for even sizes too */
        rx_psf_raster stamp = {.pixels = m->mask + (size_t)t * (size_t)m->width * (size_t)m->height,
                               .width = m->width,
                               .height = m->height,
                               .centre_x = m->width / 2,
                               .centre_y = m->height / 2};
        status = rx_psf_resample(&stamp, 1.0 / m->sampling, 4,
                                 images + (size_t)t * (size_t)size * (size_t)size, size, err);
    }
    return status;
}

static rx_status build(const model *m, int size, int width, int height, rx_psf **dst, rx_error *err)
{
    rx_status status;
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    rx_psf *psf = rx_psf_new(RX_PSF_PSFEX, size, term_powers(m, MORE, px, py));
    double *images = rx_alloc((size_t)m->nterms, (size_t)size * (size_t)size * sizeof(double));
    if (psf == NULL || images == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    term_powers(m, MORE, psf->px, psf->py);
    psf->x0 = 0.5 * (width - 1);
    psf->y0 = 0.5 * (height - 1);
    psf->xs = 0.5 * width;
    psf->ys = 0.5 * height;
    status = resample_model(m, size, images, err);
    if (status == RX_OK)
        status = normalise(m, images, psf, err);
    if (status == RX_OK)
        status = describe(psf, m->file, width, height, err);
    if (status == RX_OK) {
        *dst = psf;
        psf = NULL;
    }
exit:
    rx_psf_free(psf);
    free(images);
    return status;
}

rx_status rx_psf_psfex(const rx_psf_params *par, int width, int height, rx_log *log, rx_psf **dst,
                       rx_error *err)
{
    model m;
    int size = 0;
    *dst = NULL;
    rx_status status = read_model(par->file, par->extension, &m, err);
    if (status == RX_OK) {
        int smaller = m.width < m.height ? m.width : m.height;
        size = cut_size(2 * (int)floor(smaller / 2 * m.sampling + 1e-6) + 1, par->size);
        status = rx_psf_check_size(par->file, size, size, width, height, err);
    }
    if (status == RX_OK)
        status = build(&m, size, width, height, dst, err);
    if (status == RX_OK) {
        double beyond = extrapolation(&m, width, height);
        if (beyond > 0.5)
            rx_log_warning(
                log,
                "%s: the tile reaches %.1f times the PSFEx model's range beyond its stars; was it made "
                "from this tile?",
                par->file, beyond);
        snprintf((*dst)->description, sizeof(*dst)->description,
                 "PSFEx model %.60s, degree %d, FWHM %.3f px, ellipticity %.3f", base_name(par->file),
                 model_degree(&m), (*dst)->fwhm, (*dst)->ellipticity);
    }
    free(m.mask);
    return status;
}
