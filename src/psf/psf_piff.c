/* PSFs of Piff (Jarvis et al. 2021, MNRAS 501, 1282), of its PixelGrid model: values on a grid in the tangent plane,
 * u and v in arcsec, each a polynomial of the position.
 *
 *   PSF(x, y; dx, dy) = grid(J (dx, dy) / scale),  grid[j][i] = sum_k coefficient[j][i][k] basis_k(u, v)
 *
 * by Lanczos interpolation of the order that the file says, 0 outside of the grid, whose origin is its pixel (size / 2,
 * size / 2). The grid holds the pixel response. A Piff file keeps the world coordinates as a Python object; what they
 * say, (u, v) and their derivatives J by (x, y), stands in its list of stars as well: a polynomial of degree 3, or less
 * with few stars, through these is taken.
 *
 * Tables, by EXTNAME: psf (type), psf_stars, psf_model (type, scale, size, interp), psf_interp (type, order, keys),
 * psf_interp_solution. In a file of several chips they are psf_chipnums and psf_<chip>, psf_<chip>_stars .. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "num/lsq.h"
#include "psf/psf_files.h"
#include "psf/resample.h"

enum { WORLD_TERMS = 10 };

/* Pixels: rings in a detector move stars by some 0.02 arcsec, and their derivatives by some 5e-4 arcsec a pixel. */
static const double LOCAL = 40.0;

/* (u, v) as polynomials of ((x - x0) / s, (y - y0) / s), FITS pixels. */
typedef struct world {
    double x0, y0, s, of[2][WORLD_TERMS];
    int n; /* terms */
} world;

typedef struct model {
    const char *file;
    char prefix[40]; /* of EXTNAMEs */
    world world;
    double scale;          /* arcsec of the grid */
    int side, order;       /* of the grid, of Lanczos */
    int nterms, by_pixels; /* of the polynomial; in x and y, not u and v */
    int pu[RX_PSF_MAX_BASIS], pv[RX_PSF_MAX_BASIS];
    double *grid; /* [side][side][nterms] */
    int lacking;  /* values of the grid that sum and centroid determine: 0, 1 or 3 */
    int size;     /* of the stamps */
    double *now;  /* [side][side] */
} model;

/* --- the tables --- */

static rx_status refuse(const model *m, rx_error *err, const char *what, const char *word)
{
    return rx_error_at(
        err, RX_INPUT, m->file, -1, 0,
        "a Piff file with %s '%.40s', of which only PixelGrid with polynomials of the position is "
        "read; write it as images, or for PSFEx's readers",
        what, word);
}

static rx_status read_table(const model *m, const char *name, rx_table **dst, rx_error *err)
{
    char extname[80];
    int hdu;
    snprintf(extname, sizeof extname, "%s%s", m->prefix, name);
    RX_TRY(rx_fits_read_named(m->file, extname, dst, &hdu, err));
    if (*dst != NULL && (*dst)->nrows >= 1)
        return RX_OK;
    rx_table_free(*dst);
    *dst = NULL;
    return rx_error_at(err, RX_INPUT, m->file, -1, 0, "no table %s: not a Piff file, or a damaged one",
                       extname);
}

/* Text of a column's element in the first row, trimmed; 0 without it. */
static int word_of(const rx_table *table, const char *name, long element, char *dst, size_t size)
{
    const int column = rx_table_find(table, name);
    dst[0] = '\0';
    if (column < 0 || table->columns[column].type != RX_CELL_TEXT ||
        element >= rx_column_elements(&table->columns[column]))
        return 0;
    const rx_column *c = &table->columns[column];
    snprintf(dst, size, "%s", (const char *)c->data + element * c->text_width);
    for (size_t n = strlen(dst); n > 0 && dst[n - 1] == ' '; n--)
        dst[n - 1] = '\0';
    return dst[0] != '\0';
}

static double value_of(const rx_table *table, const char *name, long row, long element)
{
    const int column = rx_table_find(table, name);
    return column < 0 || element >= rx_column_elements(&table->columns[column])
               ? NAN
               : rx_column_value(&table->columns[column], row, element);
}

/* A whole number of the model's, low to high. */
static rx_status need_integer(const model *m, const char *name, double value, int low, int high, int *dst,
                              rx_error *err)
{
    if (!(value >= low && value <= high) || value != floor(value))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0, "%s = %g of the Piff file is not in %d to %d", name,
                           value, low, high);
    *dst = (int)value;
    return RX_OK;
}

/* --- world coordinates --- */

/* Terms of the polynomial at (x, y), and their derivatives by x and y. */
static void world_terms(const world *w, double x, double y, double terms[3][WORLD_TERMS])
{
    const double a = (x - w->x0) / w->s, b = (y - w->y0) / w->s;
    int t = 0;
    for (int d = 0; t < w->n; d++)
        for (int j = 0; j <= d; j++, t++) {
            const int i = d - j;
            terms[0][t] = pow(a, i) * pow(b, j);
            terms[1][t] = i > 0 ? i * pow(a, i - 1) * pow(b, j) / w->s : 0.0;
            terms[2][t] = j > 0 ? j * pow(a, i) * pow(b, j - 1) / w->s : 0.0;
        }
}

/* what: 0 the value, 1 and 2 its derivatives. */
static double world_value(const world *w, int axis, int what, double terms[3][WORLD_TERMS])
{
    double sum = 0.0;
    for (int t = 0; t < w->n; t++)
        sum += w->of[axis][t] * terms[what][t];
    return sum;
}

/* The polynomials through (u, v) of the stars and, where they are there, the derivatives. */
static rx_status fit_world(model *m, const rx_table *stars, rx_error *err)
{
    static const char *const columns[2][3] = {{"u", "dudx", "dudy"}, {"v", "dvdx", "dvdy"}};
    world *w = &m->world;
    const long n = stars->nrows;
    const int equations = rx_table_find(stars, "dudx") >= 0 ? 3 : 1;
    double low[2] = {HUGE_VAL, HUGE_VAL}, high[2] = {-HUGE_VAL, -HUGE_VAL}, terms[3][WORLD_TERMS];
    for (long k = 0; k < n; k++)
        for (int axis = 0; axis < 2; axis++) {
            const double at = value_of(stars, axis == 0 ? "x" : "y", k, 0);
            low[axis] = fmin(low[axis], at);
            high[axis] = fmax(high[axis], at);
        }
    w->x0 = 0.5 * (low[0] + high[0]);
    w->y0 = 0.5 * (low[1] + high[1]);
    w->s = fmax(1.0, 0.5 * fmax(high[0] - low[0], high[1] - low[1]));
    /* twice as many numbers as terms, but for the plane that one star with its derivatives gives */
    w->n = n * equations >= 20 ? 10 : n * equations >= 12 ? 6 : 3;
    double *a = rx_alloc((size_t)(n * equations), (size_t)w->n * sizeof *a),
           *b = rx_alloc((size_t)(n * equations), sizeof *b), worst = 0.0;
    rx_status status = a == NULL || b == NULL ? rx_error_memory(err, 0) : RX_OK;
    for (int axis = 0; axis < 2 && status == RX_OK; axis++) {
        for (long k = 0; k < n; k++) {
            world_terms(w, value_of(stars, "x", k, 0), value_of(stars, "y", k, 0), terms);
            for (int e = 0; e < equations; e++) {
                const double unit = e > 0 ? LOCAL : 1.0;
                for (int t = 0; t < w->n; t++)
                    a[(k * equations + e) * w->n + t] = terms[e][t] * unit;
                b[k * equations + e] = value_of(stars, columns[axis][e], k, 0) * unit;
            }
        }
        status = rx_lsq_linear(&(rx_lsq_equations){(size_t)(n * equations), (size_t)w->n, a, b, NULL},
                               w->of[axis], NULL, NULL, err);
        for (long k = 0; k < n * equations && status == RX_OK; k++) {
            double sum = 0.0;
            for (int t = 0; t < w->n; t++)
                sum += a[k * w->n + t] * w->of[axis][t];
            worst = k % equations == 0 ? fmax(worst, fabs(b[k] - sum)) : worst;
        }
    }
    free(a);
    free(b);
    if (status == RX_INPUT || (status == RX_OK && !(worst <= m->scale)))
        return rx_error_at(
            err, RX_INPUT, m->file, -1, 0,
            "x, y, u and v of the %ld stars in %s_stars do not say where the sky is on the pixels; "
            "make the Piff file again",
            n, m->prefix);
    return status;
}

/* --- the polynomial of the position --- */

/* Orders and keys of BasisPolynomial: what varies in its arrays fastest is the second key. */
static rx_status read_basis(model *m, const rx_table *interp, const rx_table *solution, int n, rx_error *err)
{
    static const char *const names[2][2] = {{"u", "v"}, {"x", "y"}};
    char key[2][72] = {"u", "v"};
    int order[2], most, second = 1;
    for (int i = 0; i < 2 && rx_table_find(interp, "keys") >= 0; i++)
        word_of(interp, "keys", i, key[i], sizeof key[i]);
    char third[72];
    if (word_of(interp, "keys", 2, third, sizeof third))
        return refuse(m, err, "a third key", third);
    for (m->by_pixels = 0; m->by_pixels < 2; m->by_pixels++) {
        second = strcmp(key[0], names[m->by_pixels][0]) == 0;
        if (strcmp(key[1 - second], names[m->by_pixels][0]) == 0 &&
            strcmp(key[second], names[m->by_pixels][1]) == 0)
            break;
    }
    if (m->by_pixels == 2)
        return refuse(m, err, "keys of the polynomial other than u, v and x, y:", key[0]);
    const int column = rx_table_find(interp, "order");
    const int several = column >= 0 && rx_column_elements(&interp->columns[column]) > 1;
    for (int i = 0; i < 2; i++)
        RX_TRY(need_integer(m, "order", value_of(interp, "order", 0, several ? i : 0), 0, RX_PSF_MAX_DEGREE,
                            &order[i], err));
    most = order[0] > order[1] ? order[0] : order[1];
    if (rx_table_find(interp, "max_order") >= 0)
        RX_TRY(need_integer(m, "max_order", value_of(interp, "max_order", 0, 0), 0, 2 * RX_PSF_MAX_DEGREE,
                            &most, err));
    m->nterms = 0;
    for (int i = 0; i <= order[0]; i++)
        for (int j = 0; j <= order[1]; j++) {
            if (i + j > most)
                continue;
            if (i + j > RX_PSF_MAX_DEGREE || m->nterms == RX_PSF_MAX_BASIS)
                return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                                   "the polynomial of the Piff file is of degree %d, 8 at most can be read",
                                   i + j);
            m->pu[m->nterms] = second ? i : j;
            m->pv[m->nterms++] = second ? j : i;
        }
    const int q = rx_table_find(solution, "q");
    if (q < 0 || rx_column_elements(&solution->columns[q]) != (long)n * m->nterms)
        return rx_error_at(
            err, RX_INPUT, m->file, -1, 0,
            "no %d x %d coefficients q in %s_interp_solution, as size and order ask for: a damaged "
            "Piff file",
            n, m->nterms, m->prefix);
    for (long i = 0; i < (long)n * m->nterms; i++)
        m->grid[i] = rx_column_value(&solution->columns[q], 0, i);
    return RX_OK;
}

/* Polynomial: a row for each coefficient; Mean: for each value. */
static rx_status read_rows(model *m, const rx_table *solution, int mean, int n, rx_error *err)
{
    m->nterms = 1;
    for (long row = 0; row < solution->nrows; row++) {
        const double param = mean ? (double)row : value_of(solution, "PARAM", row, 0);
        const double pu = mean ? 0.0 : value_of(solution, "U_EXPONENT", row, 0);
        const double pv = mean ? 0.0 : value_of(solution, "V_EXPONENT", row, 0);
        int t = 0;
        if (!(param >= 0 && param < n && pu >= 0 && pv >= 0 && pu + pv <= RX_PSF_MAX_DEGREE))
            return rx_error_at(
                err, RX_INPUT, m->file, -1, 0,
                "row %ld of %s_interp_solution, value %g with powers %g and %g: not of a grid of %d "
                "values with a polynomial of degree 8 at most",
                row + 1, m->prefix, param, pu, pv, n);
        while (t < m->nterms && (m->pu[t] != (int)pu || m->pv[t] != (int)pv))
            t++;
        if (t == m->nterms) /* fewer than RX_PSF_MAX_BASIS by their degree */
            m->nterms++;
        m->pu[t] = (int)pu;
        m->pv[t] = (int)pv;
        m->grid[(long)param * RX_PSF_MAX_BASIS + t] = value_of(solution, mean ? "mean" : "COEFF", row, 0);
    }
    for (int i = 0; i < n; i++) /* rows of the terms that there are */
        memmove(m->grid + (size_t)i * (size_t)m->nterms, m->grid + (size_t)i * RX_PSF_MAX_BASIS,
                (size_t)m->nterms * sizeof *m->grid);
    return RX_OK;
}

static rx_status read_polynomial(model *m, const rx_table *interp, const rx_table *solution, rx_error *err)
{
    char type[72], poly[72];
    word_of(interp, "type", 0, type, sizeof type);
    const int basis = strcmp(type, "BasisPolynomial") == 0, mean = strcmp(type, "Mean") == 0;
    if (!basis && !mean && strcmp(type, "Polynomial") != 0)
        return refuse(m, err, "the interpolation", type);
    if (!basis && word_of(interp, "poly_type", 0, poly, sizeof poly) && strcmp(poly, "poly") != 0)
        return refuse(m, err, "polynomials of the type", poly);
    /* before Piff 1.0 the files left out what sum 1 and centroid 0 determine */
    int n = m->side * m->side;
    const int q = basis ? rx_table_find(solution, "q") : -1;
    double params = basis && q >= 0 && solution->columns[q].ndim == 2 ? solution->columns[q].dim[1] : n;
    if (!basis && !rx_cards_number(solution->cards, solution->ncards, "NPARAM", &params))
        params = mean ? (double)solution->nrows : n;
    m->lacking = params == n - 1 || params == n - 3 ? n - (int)params : 0;
    n -= m->lacking;
    m->grid = rx_alloc((size_t)(m->side * m->side), RX_PSF_MAX_BASIS * sizeof *m->grid);
    m->now = RX_NEW(double, (size_t)(m->side * m->side));
    if (m->grid == NULL || m->now == NULL)
        return rx_error_memory(err, 0);
    RX_TRY(basis ? read_basis(m, interp, solution, n, err) : read_rows(m, solution, mean, n, err));
    for (long i = 0; i < (long)n * m->nterms; i++)
        if (!isfinite(m->grid[i]))
            return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                               "value %ld of the Piff file's grid is not a number; make it again",
                               i / m->nterms + 1);
    return RX_OK;
}

/* --- the grid --- */

static rx_status read_grid(model *m, const rx_table *table, rx_error *err)
{
    char type[72], interp[160];
    word_of(table, "type", 0, type, sizeof type);
    if (strcmp(type, "PixelGrid") != 0)
        return refuse(m, err, "the model", type);
    RX_TRY(need_integer(m, "size", value_of(table, "size", 0, 0), 3, 511, &m->side, err));
    m->scale = value_of(table, "scale", 0, 0);
    if (!(m->scale > 1e-4 && m->scale < 1e4))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0, "scale = %g of the Piff file cannot be right",
                           m->scale);
    m->order = 3; /* of files that do not say */
    if (!word_of(table, "interp", 0, interp, sizeof interp))
        return RX_OK;
    const char *lanczos = strstr(interp, "Lanczos(");
    m->order = lanczos != NULL ? atoi(lanczos + strlen("Lanczos(")) : 0;
    return m->order >= 1 && m->order <= RX_LANCZOS_MAX ? RX_OK : refuse(m, err, "the interpolant", interp);
}

/* m->now = the grid at a FITS position. */
static void grid_at(const model *m, double x, double y, double terms[3][WORLD_TERMS])
{
    const int side = m->side, middle = side / 2;
    const double u = m->by_pixels ? x : world_value(&m->world, 0, 0, terms);
    const double v = m->by_pixels ? y : world_value(&m->world, 1, 0, terms);
    double factor[RX_PSF_MAX_BASIS], sum = 0.0, along[2] = {0.0, 0.0};
    const double *value = m->grid;
    for (int t = 0; t < m->nterms; t++)
        factor[t] = pow(u, m->pu[t]) * pow(v, m->pv[t]);
    for (int i = 0; i < side * side; i++) {
        const int column = i % side - middle, row = i / side - middle;
        const int left_out = (m->lacking > 0 && column == 0 && row == 0) ||
                             (m->lacking > 1 && column + row == 1 && column * row == 0);
        m->now[i] = 0.0;
        for (int t = 0; t < m->nterms && !left_out; t++)
            m->now[i] += factor[t] * *value++;
        sum += m->now[i];
        along[0] += column * m->now[i];
        along[1] += row * m->now[i];
    }
    if (m->lacking > 1) {
        m->now[middle * side + middle + 1] = -along[0];
        m->now[(middle + 1) * side + middle] = -along[1];
        sum -= along[0] + along[1];
    }
    if (m->lacking > 0)
        m->now[middle * side + middle] = 1.0 / (m->scale * m->scale) - sum;
}

static rx_status draw(const void *source, int k, double x, double y, int fine, double *stamp, rx_error *err)
{
    const model *m = source;
    const int half = fine * (m->size / 2);
    double terms[3][WORLD_TERMS], j[2][2];
    (void)k;
    (void)err;
    world_terms(&m->world, x + 1.0, y + 1.0, terms);
    for (int axis = 0; axis < 2; axis++)
        for (int by = 0; by < 2; by++)
            j[axis][by] = world_value(&m->world, axis, 1 + by, terms) / m->scale / fine;
    grid_at(m, x + 1.0, y + 1.0, terms);
    for (int dy = -half; dy <= half; dy++)
        for (int dx = -half; dx <= half; dx++)
            *stamp++ = rx_psf_interpolate(m->now, m->side, m->side / 2 + j[0][0] * dx + j[0][1] * dy,
                                          m->side / 2 + j[1][0] * dx + j[1][1] * dy, m->order);
    return RX_OK;
}

/* The chip of a file of several: as many are taken in their order as the tile has images before this one. */
static rx_status find_chip(model *m, const rx_table *psf, int extension, rx_error *err)
{
    char type[72];
    rx_table *chips = NULL;
    strcpy(m->prefix, "psf");
    word_of(psf, "type", 0, type, sizeof type);
    if (strcmp(type, "Simple") == 0 || strcmp(type, "SimplePSF") == 0)
        return RX_OK;
    if (strncmp(type, "SingleChip", 10) != 0)
        return refuse(m, err, "a PSF of the type", type);
    RX_TRY(read_table(m, "_chipnums", &chips, err));
    const long row = chips->nrows > 1 && extension > 1 ? extension - 1 : 0;
    const double chip = row < chips->nrows ? value_of(chips, "chipnums", row, 0) : NAN;
    const long n = chips->nrows;
    rx_table_free(chips);
    if (!(fabs(chip) < 1e6) || chip != floor(chip))
        return rx_error_at(err, RX_INPUT, m->file, -1, 0,
                           "a Piff file of %ld chips, image %d of the tile was asked for", n, extension);
    snprintf(m->prefix, sizeof m->prefix, "psf_%.0f", chip);
    rx_table *simple = NULL;
    RX_TRY(read_table(m, "", &simple, err));
    word_of(simple, "type", 0, type, sizeof type);
    rx_table_free(simple);
    return strncmp(type, "Simple", 6) == 0 ? RX_OK : refuse(m, err, "a PSF of the type", type);
}

static rx_status read_model(model *m, const rx_table *psf, int extension, rx_error *err)
{
    rx_table *grid = NULL, *stars = NULL, *interp = NULL, *solution = NULL;
    rx_status status = find_chip(m, psf, extension, err);
    if (status == RX_OK)
        status = read_table(m, "_model", &grid, err);
    if (status == RX_OK)
        status = read_grid(m, grid, err);
    if (status == RX_OK)
        status = read_table(m, "_interp", &interp, err);
    if (status == RX_OK)
        status = read_table(m, "_interp_solution", &solution, err);
    if (status == RX_OK)
        status = read_polynomial(m, interp, solution, err);
    if (status == RX_OK)
        status = read_table(m, "_stars", &stars, err);
    if (status == RX_OK)
        status = fit_world(m, stars, err);
    rx_table_free(grid);
    rx_table_free(stars);
    rx_table_free(interp);
    rx_table_free(solution);
    return status;
}

rx_status rx_psf_piff(const rx_psf_params *par, const rx_table *table, int width, int height, rx_log *log,
                      rx_psf **dst, rx_error *err)
{
    model m = {.file = par->file};
    double terms[3][WORLD_TERMS], misfit;
    int degree = 0;
    *dst = NULL;
    rx_status status = read_model(&m, table, par->extension, err);
    if (status != RX_OK)
        goto exit;
    world_terms(&m.world, 0.5 * (width + 1), 0.5 * (height + 1), terms);
    const double pixel = sqrt(fabs(world_value(&m.world, 0, 1, terms) * world_value(&m.world, 1, 2, terms) -
                                   world_value(&m.world, 0, 2, terms) * world_value(&m.world, 1, 1, terms)));
    const double half = 0.5 * (m.side + 1) * m.scale / pixel;
    if (!(half >= 1.0 && half <= RX_PSF_LARGEST / 2)) {
        status =
            rx_error_at(err, RX_INPUT, par->file, -1, 0,
                        "a grid of %d x %g arcsec on pixels of %g arcsec of the tile cannot be right; was it "
                        "made from this tile?",
                        m.side, m.scale, pixel);
        goto exit;
    }
    m.size = rx_psf_cut_size(2 * (int)half + 1, par->size);
    status = rx_psf_check_size(par->file, m.size, m.size, width, height, err);
    if (status != RX_OK)
        goto exit;
    for (int t = 0; t < m.nterms; t++)
        degree = m.pu[t] + m.pv[t] > degree ? m.pu[t] + m.pv[t] : degree;
    const int own = degree;
    const rx_psf_source src = {.file = par->file,
                               .what = "Piff model",
                               .type = RX_PSF_FILE,
                               .size = m.size,
                               .draw = draw,
                               .finest = (int)(pixel / m.scale + 0.1),
                               .model = &m,
                               .degree = {own, own}};
    status = rx_psf_project(&src, width, height, dst, &degree, &misfit, err);
    if (status != RX_OK)
        goto exit;
    rx_psf_warn_misfit(&src, misfit, log);
    rx_psf_warn_beyond(par->file, src.what,
                       fmax(rx_psf_beyond(m.world.x0 - m.world.s, m.world.x0 + m.world.s, width),
                            rx_psf_beyond(m.world.y0 - m.world.s, m.world.y0 + m.world.s, height)),
                       log);
    snprintf((*dst)->description, sizeof(*dst)->description,
             "Piff model %.60s%s%.20s, degree %d, FWHM %.3f px, ellipticity %.3f",
             rx_psf_base_name(par->file), m.prefix[3] != '\0' ? " chip " : "",
             m.prefix[3] != '\0' ? m.prefix + 4 : "", own, (*dst)->fwhm, (*dst)->ellipticity);
exit:
    free(m.grid);
    free(m.now);
    return status;
}
