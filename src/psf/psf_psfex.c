/* The models that PSFEx writes (.psf).
 *
 *   PSF(x, y) = sum_i m_i(X, Y) mask_i,  X = (x - POLZERO) / POLSCAL with FITS coordinates (1-based)
 *   POLSCAL is the whole range of the stars, so that X is within +-0.5
 *   m_i: 1, X, X^2, .. X^d, Y, X Y, .. X^(d-1) Y, .. Y^d   (SExtractor's order of a group of two)
 *
 * mask_i are sampled in steps of PSF_SAMP tile pixels but already hold the tile pixel's own
 * smoothing, so they are interpolated (Lanczos-4, as PSFEx and SExtractor do), not integrated.
 *
 * PSFEx does not keep the sum of the model constant across the field; ours must sum to 1 everywhere.
 * PSF(x, y) / sum(x, y) is no polynomial, so it is projected by least squares onto as many degrees as it needs
 * (DECam models: the shape changes by less than 2e-4 of the peak).
 */
#include "psf/psf_psfex.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "io/fits_write.h"
#include "psf/psf_files.h"
#include "psf/resample.h"

typedef struct model {
    const char *file;
    int width, height, nterms; /* of PSF_MASK */
    int degree[2];             /* highest power in x and y; both together at most the larger */
    int first;                 /* axis (0 x, 1 y) whose power varies fastest from term to term */
    double zero[2], scale[2];  /* x, y */
    double sampling;           /* tile pixels per model pixel */
    double flux_error;         /* RXPSFERR, 0: not stated */
    float *mask;               /* [nterms][height][width] */
    int size;                  /* of the stamps */
    int fine, side;            /* samples a pixel, 1, 2 or 4, and their stamps' side */
    double *images;            /* [nterms][side][side]: the mask on these */
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
    status = need_integer(m, table, "POLDEG1", 0, RX_PSF_MAX_DEGREE, &degree, err);
    for (int i = 1; i <= naxis && status == RX_OK && degree > 0; i++)
        status = read_variable(m, table, i, degree, err);
    return status;
}

static int model_degree(const model *m)
{
    return m->degree[0] > m->degree[1] ? m->degree[0] : m->degree[1];
}

/* Powers of x and y of each term, in SExtractor's order. Returns how many. */
static int term_powers(const model *m, int px[RX_PSF_MAX_BASIS], int py[RX_PSF_MAX_BASIS])
{
    int n = 0, fast = m->first, slow = 1 - fast, most = model_degree(m);
    for (int j = 0; j <= m->degree[slow]; j++)
        for (int i = 0; i <= m->degree[fast] && i + j <= most; i++) {
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
        read_axes(m, table, column >= 0 ? &table->columns[column] : NULL, term_powers(m, px, py), err);
    if (status != RX_OK)
        return status;
    if (m->nterms != term_powers(m, px, py))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "the PSFEx model has %d images where its polynomial asks for %d; make it again",
                           m->nterms, term_powers(m, px, py));
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
    char text[80];
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
    if (status == RX_OK && table->cards != NULL && /* of a model that PSF_TYPE AUTO made */
        rx_cards_text(table->cards, table->ncards, "RXPSFERR", text, sizeof text) &&
        !(rx_cards_number(table->cards, table->ncards, "RXPSFERR", &m->flux_error) && m->flux_error >= 0.0 &&
          m->flux_error <= 1.0))
        status = rx_error_at(err, RX_INPUT, file, -1, 0,
                             "RXPSFERR = %s is not in 0 to 1; make this model again", text);
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

static rx_status draw(const void *source, int k, double x, double y, int fine, double *stamp, rx_error *err)
{
    const model *m = source;
    const int side = fine * (m->size - 1) + 1, step = m->fine / fine;
    const size_t pixels = (size_t)m->side * (size_t)m->side;
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    (void)k;
    (void)err;
    term_powers(m, px, py);
    memset(stamp, 0, (size_t)side * (size_t)side * sizeof *stamp);
    for (int t = 0; t < m->nterms; t++) {
        const double *image = m->images + (size_t)t * pixels;
        const double factor =
            term((x + 1.0 - m->zero[0]) / m->scale[0], (y + 1.0 - m->zero[1]) / m->scale[1], px[t], py[t]);
        for (int j = 0; j < side; j++)
            for (int i = 0; i < side; i++)
                stamp[j * side + i] += factor * image[step * j * m->side + step * i];
    }
    return RX_OK;
}

static rx_status resample_model(model *m, rx_error *err)
{
    m->fine = m->sampling > 0.5 + 1e-6 ? 1 : m->sampling > 0.25 + 1e-6 ? 2 : 4;
    m->side = m->fine * (m->size - 1) + 1;
    const size_t pixels = (size_t)m->side * (size_t)m->side;
    rx_status status = RX_OK;
    m->images = rx_alloc((size_t)m->nterms, pixels * sizeof(double));
    if (m->images == NULL)
        return rx_error_memory(err, (size_t)m->nterms * pixels * sizeof(double));
    for (int t = 0; t < m->nterms && status == RX_OK; t++) {
        /* PSFEx puts the centre on pixel size / 2 (from 0), for even sizes too */
        const rx_psf_raster stamp = {.pixels = m->mask + (size_t)t * (size_t)m->width * (size_t)m->height,
                                     .width = m->width,
                                     .height = m->height,
                                     .centre_x = m->width / 2,
                                     .centre_y = m->height / 2};
        status = rx_psf_resample(&stamp, 1.0 / m->sampling / m->fine, 4, m->images + (size_t)t * pixels,
                                 m->side, err);
    }
    return status;
}

rx_status rx_psf_psfex(const rx_psf_params *par, int width, int height, rx_log *log, rx_psf **dst,
                       rx_error *err)
{
    model m;
    int degree;
    double misfit;
    *dst = NULL;
    rx_status status = read_model(par->file, par->extension, &m, err);
    if (status == RX_OK) {
        int smaller = m.width < m.height ? m.width : m.height;
        m.size = rx_psf_cut_size(2 * (int)floor(smaller / 2 * m.sampling + 1e-6) + 1, par->size);
        status = rx_psf_check_size(par->file, m.size, m.size, width, height, err);
    }
    if (status == RX_OK)
        status = resample_model(&m, err);
    const rx_psf_source src = {
        .file = par->file,
        .what = "PSFEx model",
        .type = RX_PSF_PSFEX,
        .size = m.size,
        .draw = draw,
        .finest = m.fine,
        .model = &m,
        .degree = {m.degree[0] > 0 ? m.degree[0] : -1, m.degree[1] > 0 ? m.degree[1] : -1}};
    if (status == RX_OK)
        status = rx_psf_project(&src, width, height, dst, &degree, &misfit, err);
    if (status == RX_OK) {
        double beyond = 0.0;
        for (int axis = 0; axis < 2; axis++)
            if (m.degree[axis] > 0)
                beyond = fmax(beyond, rx_psf_beyond(m.zero[axis] - 0.5 * fabs(m.scale[axis]),
                                                    m.zero[axis] + 0.5 * fabs(m.scale[axis]),
                                                    axis == 0 ? width : height));
        rx_psf_warn_beyond(par->file, src.what, beyond, log);
        rx_psf_warn_misfit(&src, misfit, log);
        (*dst)->quality.flux_error = m.flux_error;
        snprintf((*dst)->description, sizeof(*dst)->description,
                 "PSFEx model %.60s, degree %d, FWHM %.3f px, ellipticity %.3f", rx_psf_base_name(par->file),
                 model_degree(&m), (*dst)->fwhm, (*dst)->ellipticity);
    }
    free(m.mask);
    free(m.images);
    return status;
}

/* --- writing --- */

/* Image of psf for X^px Y^py, with samples where there are, NULL when it has none. */
static const float *image_of(const rx_psf *psf, int px, int py)
{
    for (int b = 0; b < psf->nbasis; b++)
        if (psf->px[b] == px && psf->py[b] == py)
            return psf->samples != NULL ? psf->samples + (size_t)b * (size_t)rx_psf_fine_side(psf) *
                                                             (size_t)rx_psf_fine_side(psf)
                                        : psf->basis + (size_t)b * (size_t)psf->size * (size_t)psf->size;
    return NULL;
}

/* A row or column of n values in halves of a step, 2 n - 1, by Lanczos interpolation: the values themselves stay. */
static void halve(const double *src, int n, int stride, double *dst, int to)
{
    double weights[2 * RX_LANCZOS_MAX];
    rx_lanczos_weights(0.5, RX_LANCZOS_MAX, weights);
    for (int i = 0; i < 2 * n - 1; i++) {
        double value = i % 2 == 0 ? src[(size_t)(i / 2) * (size_t)stride] : 0.0;
        for (int k = 0; k < 2 * RX_LANCZOS_MAX && i % 2 != 0; k++) {
            const int at = i / 2 + 1 - RX_LANCZOS_MAX + k;
            value += at >= 0 && at < n ? weights[k] * src[(size_t)at * (size_t)stride] : 0.0;
        }
        dst[(size_t)i * (size_t)to] = value;
    }
}

/* values [size][size] become [side][side], side = 2 size - 1; they and rows have room for these. */
static void halve_pixels(double *values, double *rows, int size)
{
    const int side = 2 * size - 1;
    for (int j = 0; j < size; j++)
        halve(values + (size_t)j * (size_t)size, size, 1, rows + (size_t)j * (size_t)side, 1);
    for (int i = 0; i < side; i++)
        halve(rows + i, size, side, values + i, side);
}

/* Readers interpolate by Lanczos-4, which the pixels of the tile are too wide for where the PSF is narrow. */
static const double NARROW = 3.0;

rx_status rx_psf_psfex_table(const rx_psf *psf, rx_table **dst, rx_text *cards, rx_error *err)
{
    static const float none = NAN; /* psfex, too, writes this where it found no PSF */
    const rx_psf unknown = {.size = 1, .nbasis = 1, .xs = 1.0, .ys = 1.0};
    model m = {.first = 0};
    int px[RX_PSF_MAX_BASIS], py[RX_PSF_MAX_BASIS];
    const rx_psf *p = psf != NULL ? psf : &unknown;
    for (int b = 0; b < p->nbasis; b++)
        m.degree[0] = m.degree[1] = p->px[b] + p->py[b] > m.degree[0] ? p->px[b] + p->py[b] : m.degree[0];
    if (m.degree[0] > RX_PSF_MAX_DEGREE)
        return rx_error_set(err, RX_INPUT, "a PSF of degree %d cannot be written for PSFEx's readers, %d can",
                            m.degree[0], RX_PSF_MAX_DEGREE);
    const int n = term_powers(&m, px, py);
    const int known = psf != NULL ? rx_psf_fine(psf) : 1; /* steps a pixel */
    const int steps = known == 1 && psf != NULL && psf->fwhm < NARROW ? 2 : known;
    const int side = steps * (p->size - 1) + 1;
    const size_t pixels = (size_t)side * (size_t)side;
    rx_table *table = rx_table_new(1);
    float *mask = rx_alloc((size_t)n, pixels * sizeof(float));
    double *values = RX_NEW(double, 2 * pixels);
    if (table != NULL) {
        free(table->name);
        table->name = rx_strdup("PSF_DATA");
    }
    if (table == NULL || table->name == NULL || mask == NULL || values == NULL) {
        free(mask);
        free(values);
        rx_table_free(table);
        return rx_error_memory(err, (size_t)n * pixels * sizeof(float));
    }
    for (int t = 0; t < n; t++) {
        const float *image = psf != NULL ? image_of(p, px[t], py[t]) : &none;
        const int own = known * (p->size - 1) + 1;
        for (int i = 0; i < own * own && image != NULL; i++)
            values[i] = (double)image[i];
        if (image != NULL && steps > known)
            halve_pixels(values, values + pixels, p->size);
        for (size_t i = 0; i < pixels && image != NULL; i++)
            mask[(size_t)t * pixels + i] = (float)ldexp(values[i], px[t] + py[t]); /* of (2 X)^px (2 Y)^py */
    }
    free(values);
    table->nrows = 1;
    table->columns[0] = (rx_column){.name = "PSF_MASK",
                                    .type = RX_CELL_FLOAT,
                                    .ndim = 1,
                                    .dim = {(int)(pixels * (size_t)n)},
                                    .data = mask};
    char text[72];
    snprintf(text, sizeof text, "(%d,%d,%d)", side, side, n);
    rx_card_text(cards, "TDIM1", text, "x, y, term");
    rx_card_integer(cards, "LOADED", p->nstars, "stars given; 0: not measured here");
    rx_card_integer(cards, "ACCEPTED", p->nstars, "stars used");
    rx_card_number(cards, "CHI2", 0.0, "not measured here");
    rx_card_integer(cards, "POLNAXIS", 2, "variables of the polynomial");
    rx_card_integer(cards, "POLGRP1", 1, "group of the first");
    rx_card_text(cards, "POLNAME1", "X_IMAGE", "first variable");
    rx_card_number(cards, "POLZERO1", p->x0 + 1.0, "X_IMAGE of its origin");
    rx_card_number(cards, "POLSCAL1", 2.0 * p->xs, "range of X_IMAGE, its unit");
    rx_card_integer(cards, "POLGRP2", 1, "group of the second");
    rx_card_text(cards, "POLNAME2", "Y_IMAGE", "second variable");
    rx_card_number(cards, "POLZERO2", p->y0 + 1.0, "Y_IMAGE of its origin");
    rx_card_number(cards, "POLSCAL2", 2.0 * p->ys, "range of Y_IMAGE, its unit");
    rx_card_integer(cards, "POLNGRP", 1, "groups");
    rx_card_integer(cards, "POLDEG1", m.degree[0], "degree of the polynomial");
    rx_card_number(cards, "PSF_FWHM", p->fwhm, "FWHM at the centre of the image (pixels)");
    rx_card_number(cards, "PSF_SAMP", 1.0 / steps, "sampling step (pixels of the image)");
    rx_card_integer(cards, "PSFNAXIS", 3, "axes of PSF_MASK");
    rx_card_integer(cards, "PSFAXIS1", side, "");
    rx_card_integer(cards, "PSFAXIS2", side, "");
    rx_card_integer(cards, "PSFAXIS3", n, "terms");
    *dst = table;
    return RX_OK;
}
