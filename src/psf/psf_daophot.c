/* The PSFs of DAOPHOT (Stetson 1987, PASP 99, 191) as the psf task of IRAF writes them: a profile in the header, and
 * what the stars have beyond it as tables in steps of half a pixel, which vary with the position (VARORDER):
 *
 *   PSF(dx, dy) = PSFHEIGH * profile(dx, dy) + sum_k term_k(X, Y) table_k(dx, dy),  X = (x - 1) / PSFX - 1
 *   terms: 1; X, Y; (3 X^2 - 1) / 2, X Y, (3 Y^2 - 1) / 2
 *
 * for dx^2 + dy^2 < (radius of the tables)^2. In the middle of pixels the tables need no interpolation. The profile is
 * the mean over a pixel of what follows, by 4 x 4 Gauss-Legendre points, as DAOPHOT's (which takes fewer in the wings);
 * h, k: half widths at half maximum, PAR1 and PAR2; s = (x/h)^2 + (y/k)^2:
 *
 *   gauss      2^-s / (h k)
 *   moffat15   0.5 (1 + 0.5874011 (s + PAR3 x y))^-1.5 / (h k);  moffat25: 1.5, 0.3195079, -2.5
 *   lorentz    1 / (1 + s + PAR3 x y)
 *   penny1     PAR3 2^-(s + PAR4 x y) + (1 - PAR3) / (1 + s);  penny2: s + PAR5 x y in the second
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "psf/psf_files.h"

typedef enum shape { GAUSS, MOFFAT15, MOFFAT25, LORENTZ, PENNY1, PENNY2, SHAPES } shape;

static const struct {
    const char *name;
    int npars;
} shapes[SHAPES] = {{"gauss", 2},   {"moffat15", 3}, {"moffat25", 3},
                    {"lorentz", 3}, {"penny1", 4},   {"penny2", 5}};

typedef struct model {
    const char *file;
    const rx_fits_cube *cube;
    shape shape;
    double par[5], height, psfx, psfy, radius;
    int order, size;
} model;

static double profile_at(const model *m, double x, double y)
{
    const double *p = m->par, s = pow(x / p[0], 2.0) + pow(y / p[1], 2.0), xy = x * y;
    switch (m->shape) {
    case GAUSS:
        return exp2(-s) / (p[0] * p[1]);
    case MOFFAT15:
        return 0.5 * pow(1.0 + 0.5874011 * (s + p[2] * xy), -1.5) / (p[0] * p[1]);
    case MOFFAT25:
        return 1.5 * pow(1.0 + 0.3195079 * (s + p[2] * xy), -2.5) / (p[0] * p[1]);
    case LORENTZ:
        return 1.0 / (1.0 + s + p[2] * xy);
    case PENNY1:
        return p[2] * exp2(-(s + p[3] * xy)) + (1.0 - p[2]) / (1.0 + s);
    case PENNY2:
        return p[2] * exp2(-(s + p[3] * xy)) + (1.0 - p[2]) / (1.0 + s + p[4] * xy);
    case SHAPES:
        break;
    }
    return NAN;
}

static double profile(const model *m, double dx, double dy)
{
    static const double at[4] = {-0.43056816, -0.16999052, 0.16999052, 0.43056816};
    static const double weight[4] = {0.17392742, 0.32607258, 0.32607258, 0.17392742};
    double sum = 0.0;
    for (int j = 0; j < 4; j++)
        for (int i = 0; i < 4; i++)
            sum += weight[i] * weight[j] * profile_at(m, dx + at[i], dy + at[j]);
    return sum;
}

/* The tables have steps of half a pixel. */
static rx_status draw(const void *source, int k, double x, double y, int fine, double *stamp, rx_error *err)
{
    static const int tables[] = {0, 1, 3, 6};
    const model *m = source;
    const double u = x / m->psfx - 1.0, v = y / m->psfy - 1.0; /* x, y from 0 */
    const double terms[6] = {1.0, u, v, 1.5 * u * u - 0.5, u * v, 1.5 * v * v - 0.5};
    const int half = fine * (m->size / 2), side = m->cube->width, step = 2 / fine;
    (void)k;
    (void)err;
    for (int dy = -half; dy <= half; dy++)
        for (int dx = -half; dx <= half; dx++) {
            double value = 0.0;
            if (dx * dx + dy * dy < fine * fine * m->radius * m->radius) {
                value = m->height * profile(m, (double)dx / fine, (double)dy / fine);
                for (int t = 0; t < tables[m->order + 1]; t++)
                    value +=
                        terms[t] *
                        (double)m->cube->pixels[((size_t)t * (size_t)side + (size_t)(side / 2 + step * dy)) *
                                                    (size_t)side +
                                                (size_t)(side / 2 + step * dx)];
            }
            *stamp++ = value;
        }
    return RX_OK;
}

static rx_status need(const model *m, const char *key, double low, double high, double *dst, rx_error *err)
{
    if (!rx_cards_number(m->cube->cards, m->cube->ncards, key, dst))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0, "no %s: not a PSF as IRAF's DAOPHOT writes it",
                           key);
    if (!(*dst >= low && *dst <= high))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0, "%s = %g of the DAOPHOT PSF is not in %g to %g",
                           key, *dst, low, high);
    return RX_OK;
}

static rx_status read_profile(model *m, rx_error *err)
{
    char word[72] = "", key[16];
    const double most = 1e30;
    double npars;
    rx_cards_text(m->cube->cards, m->cube->ncards, "FUNCTION", word, sizeof word);
    for (m->shape = GAUSS; m->shape < SHAPES && strcasecmp(word, shapes[m->shape].name) != 0;)
        m->shape++;
    if (m->shape == SHAPES)
        return rx_error_at(
            err, RX_INPUT, m->file, -1, 0,
            "FUNCTION '%.40s' of the DAOPHOT PSF is none of gauss, moffat15, moffat25, lorentz, "
            "penny1 and penny2",
            word);
    RX_TRY(need(m, "NPARS", shapes[m->shape].npars, 6, &npars, err));
    for (int i = 0; i < shapes[m->shape].npars; i++) {
        snprintf(key, sizeof key, "PAR%d", i + 1);
        RX_TRY(need(m, key, i < 2 ? 0.05 : -most, i < 2 ? 1000.0 : most, &m->par[i], err));
    }
    for (int i = m->shape == PENNY1 || m->shape == PENNY2 ? 3 : 2; i < shapes[m->shape].npars; i++)
        if (!(fabs(m->par[i]) * m->par[0] * m->par[1] < 2.0))
            return rx_error_at(
                err, RX_INPUT, m->file, -1, 0,
                "PAR%d = %g of the DAOPHOT PSF opens the ellipse of PAR1 = %g and PAR2 = %g; make it "
                "again",
                i + 1, m->par[i], m->par[0], m->par[1]);
    RX_TRY(need(m, "PSFHEIGH", 1e-30, most, &m->height, err));
    RX_TRY(need(m, "PSFX", 1e-3, most, &m->psfx, err));
    RX_TRY(need(m, "PSFY", 1e-3, most, &m->psfy, err));
    return RX_OK;
}

/* The tables must be as many as VARORDER asks for, of an odd side; the radius is theirs, or PSFRAD without any. */
static rx_status read_tables(model *m, rx_error *err)
{
    static const int tables[] = {0, 1, 3, 6};
    const rx_fits_cube *cube = m->cube;
    char expanded[8] = "";
    double order, scale = 1.0;
    RX_TRY(need(m, "VARORDER", -1, 2, &order, err));
    m->order = (int)order;
    rx_cards_text(cube->cards, cube->ncards, "FEXPAND", expanded, sizeof expanded);
    if (expanded[0] == 'T')
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "the DAOPHOT PSF was made with fexpand, which is not read; make it without");
    if (m->order < 0) {
        rx_cards_number(cube->cards, cube->ncards, "SCALE", &scale);
        RX_TRY(need(m, "PSFRAD", 0.0, 1e30, &m->radius, err));
        m->radius /= scale;
    } else {
        if (cube->planes != tables[m->order + 1] || cube->width != cube->height || cube->width % 2 == 0)
            return rx_error_at(
                err, RX_INPUT, m->file, -1, 0,
                "%d tables of %d x %d in a DAOPHOT PSF of VARORDER %d, which has %d, square and odd",
                cube->planes, cube->width, cube->height, m->order, tables[m->order + 1]);
        m->radius = 0.5 * (0.5 * (cube->width - 1) - 1.0);
        for (size_t i = 0; i < (size_t)cube->planes * (size_t)cube->width * (size_t)cube->width; i++)
            if (!isfinite(cube->pixels[i]))
                return rx_error_at(
                    err, RX_INPUT, m->file, -1, 0,
                    "the tables of the DAOPHOT PSF hold values that are not numbers; make it again");
    }
    if (!(m->radius >= 1.0 && m->radius <= RX_PSF_LARGEST / 2))
        return rx_error_at(
            err, RX_INPUT, m->file, -1, 0,
            "a radius of %g pixels of the DAOPHOT PSF cannot be right; make it with another psfrad",
            m->radius);
    m->size = 2 * (int)m->radius + 1;
    return RX_OK;
}

rx_status rx_psf_daophot(const rx_psf_params *par, const rx_fits_cube *cube, int width, int height,
                         rx_log *log, rx_psf **dst, rx_error *err)
{
    model m = {.file = par->file, .cube = cube};
    int degree;
    double misfit;
    *dst = NULL;
    RX_TRY(read_tables(&m, err));
    RX_TRY(read_profile(&m, err));
    m.size = rx_psf_cut_size(m.size, par->size);
    RX_TRY(rx_psf_check_size(par->file, m.size, m.size, width, height, err));
    const int vary = m.order > 0 ? m.order : -1;
    const rx_psf_source src = {.file = par->file,
                               .what = "DAOPHOT model",
                               .type = RX_PSF_FILE,
                               .size = m.size,
                               .draw = draw,
                               .finest = 2,
                               .model = &m,
                               .degree = {vary, vary}};
    RX_TRY(rx_psf_project(&src, width, height, dst, &degree, &misfit, err));
    rx_psf_warn_misfit(&src, misfit, log);
    if (m.order > 0) /* PSFX and PSFY are the middle of the image that it was made from */
        rx_psf_warn_beyond(
            par->file, src.what,
            fmax(rx_psf_beyond(1.0, 2.0 * m.psfx, width), rx_psf_beyond(1.0, 2.0 * m.psfy, height)), log);
    snprintf((*dst)->description, sizeof(*dst)->description,
             "DAOPHOT model %.60s, %s, VARORDER %d, FWHM %.3f px, ellipticity %.3f",
             rx_psf_base_name(par->file), shapes[m.shape].name, m.order, (*dst)->fwhm, (*dst)->ellipticity);
    return RX_OK;
}
