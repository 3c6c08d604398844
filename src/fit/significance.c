/* The significance of proposed sources: sparse least squares of all their fluxes. */
#include "fit/significance.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "fit/structure.h"
#include "num/normal.h"
#include "psf/resample.h"

enum {
    LANCZOS = 4,      /* order, of moving the PSF by parts of a pixel */
    NEIGHBOURS = 40,  /* of a local solution for errors: the matrix stays on the stack */
    MOST_STEPS = 200, /* of conjugate gradients: a limit of time */
    ROUNDS = 2        /* of the sky's structure: what was taken for sources hides some in the first */
};
static const double CUT = 0.05;       /* sigma of a pixel: what lies beyond a stamp is fainter */
static const double TOLERANCE = 1e-8; /* of the residual of A F = b, relative */
static const double COUPLED =
    0.1; /* A_jk / sqrt(A_jj A_kk): below it a neighbour adds under 1 % to a variance */
static const double SHARED = 0.3; /* the same: of two that compete for the same light */

/* A proposal's PSF on the pixels around it. */
typedef struct stamp {
    int x0, y0, side; /* first pixel; side 0: off the image */
    float *values;    /* [side][side] */
} stamp;

/* What a proposal may be besides a point: a Gaussian wider than the PSF, on whole pixels. */
enum { SIZES = 3 };
static const double WIDEST =
    12.0; /* FWHM, pixels: a fifth of the mesh of the sky, which holds what is wider */

typedef struct size {
    int half;
    float *values; /* [side][side], side = 2 half + 1 */
    double
        noise; /* of wide sums of correlated pixels; w holds that of the PSF besides, so that a size is harder to reach there */
} size;

/* Row j of the matrix: its other elements. */
typedef struct element {
    int column;
    float value;
} element;

typedef struct row {
    double diagonal, right; /* A_jj, b_j */
    double photons;         /* of others: what they add to the variance of b_j */
    double noise;           /* of its size */
    int shape;              /* that it is fitted as: 0 the PSF, k > 0 size k - 1 */
    double structure;       /* S^2 of the sky there (structure.h) */
    element *others;
    int n;
} row;

typedef struct equations {
    const rx_image *image;
    int nthreads, n;
    rx_proposal *list;
    stamp *stamps;
    row *rows;
    int *order, *rank; /* proposals by y; where each stands in that order */
    int reach;         /* half side of the largest stamp */
    size sizes[SIZES]; /* the first nsizes of them */
    int nsizes;
    float *data, *weight; /* [height][width] above the sky; w */
    double *work;         /* [4][n] of the solver */
} equations;

static void free_equations(equations *eq)
{
    for (int j = 0; j < eq->n; j++) {
        if (eq->stamps != NULL)
            free(eq->stamps[j].values);
        if (eq->rows != NULL)
            free(eq->rows[j].others);
    }
    for (int k = 0; k < eq->nsizes; k++)
        free(eq->sizes[k].values);
    free(eq->stamps);
    free(eq->rows);
    free(eq->order);
    free(eq->rank);
    free(eq->data);
    free(eq->weight);
    free(eq->work);
}

/* --- stamps --- */

/* The PSF as it is sampled at the tile's centre, its largest value at each whole distance from the middle. */
static rx_status profile_of(const rx_psf *psf, const rx_image *image, double **dst, rx_error *err)
{
    const int half = psf->size / 2;
    float *values = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    *dst = RX_NEW(double, (size_t)half + 1);
    if (values == NULL || *dst == NULL) {
        free(values);
        return rx_error_memory(err, 0);
    }
    rx_psf_at(psf, 0.5 * image->width, 0.5 * image->height, values);
    for (int y = 0; y < psf->size; y++)
        for (int x = 0; x < psf->size; x++) {
            const int r = (int)hypot(x - half, y - half);
            if (r <= half)
                (*dst)[r] = fmax((*dst)[r], (double)values[y * psf->size + x]);
        }
    free(values);
    return RX_OK;
}

/* The stamp of that half side around the proposal: the sampled PSF, moved by Lanczos interpolation, whose weights are
 * the same for all pixels. fine: room for the samples. */
static rx_status cut_stamp(const equations *eq, int j, int half, float *fine, rx_error *err)
{
    const rx_psf *psf = eq->image->psf;
    const rx_proposal *p = &eq->list[j];
    stamp *s = &eq->stamps[j];
    const int cx = (int)lround(p->x), cy = (int)lround(p->y), step = rx_psf_fine(psf), n = 2 * half + 1,
              side = rx_psf_fine_side(psf), middle = side / 2 - half * step;
    double wx[2 * RX_LANCZOS_MAX], wy[2 * RX_LANCZOS_MAX];
    const int left = middle + rx_lanczos_weights((cx - p->x) * step, LANCZOS, wx),
              low = middle + rx_lanczos_weights((cy - p->y) * step, LANCZOS, wy);
    free(s->values);
    *s = (stamp){.x0 = cx - half, .y0 = cy - half, .side = n, .values = RX_NEW(float, (size_t)n *(size_t)n)};
    float *across = RX_NEW(float, (size_t)n *(size_t)side); /* moved along x */
    if (s->values == NULL || across == NULL) {
        free(across);
        return rx_error_memory(err, (size_t)n * (size_t)side * sizeof *across);
    }
    rx_psf_fine_at(psf, p->x, p->y, fine);
    for (int y = low > 0 ? low : 0; y < side && y < low + 2 * LANCZOS + (n - 1) * step; y++)
        for (int x = 0; x < n; x++)
            for (int k = 0; k < 2 * LANCZOS; k++) {
                const int u = left + x * step + k;
                if (u >= 0 && u < side)
                    across[y * n + x] += (float)wx[k] * fine[y * side + u];
            }
    for (int y = 0; y < n; y++)
        for (int k = 0; k < 2 * LANCZOS; k++) {
            const int v = low + y * step + k;
            if (v >= 0 && v < side)
                for (int x = 0; x < n; x++)
                    s->values[y * n + x] += (float)wy[k] * across[v * n + x];
        }
    free(across);
    return RX_OK;
}

/* The part of a stamp that lies on the image, its pixels from the stamp's first one. */
typedef struct part {
    int left, right, low, high; /* right and high: one beyond */
} part;

static part part_of(const rx_image *image, const stamp *s)
{
    return (part){.left = s->x0 < 0 ? -s->x0 : 0,
                  .right = s->x0 + s->side > image->width ? image->width - s->x0 : s->side,
                  .low = s->y0 < 0 ? -s->y0 : 0,
                  .high = s->y0 + s->side > image->height ? image->height - s->y0 : s->side};
}

/* sum w P P and sum w P d. */
static void weigh(const equations *eq, const stamp *s, row *dst)
{
    const part on = part_of(eq->image, s);
    double square = 0.0, product = 0.0;
    for (int y = on.low; y < on.high; y++) {
        const size_t at = (size_t)(s->y0 + y) * (size_t)eq->image->width;
        const float *values = s->values + (size_t)y * (size_t)s->side, *weight = eq->weight + at + s->x0,
                    *data = eq->data + at + s->x0;
        for (int x = on.left; x < on.right; x++) {
            const double weighted = (double)values[x] * (double)weight[x];
            square += weighted * (double)values[x];
            product += weighted * (double)data[x];
        }
    }
    dst->diagonal = square;
    dst->right = product;
}

/* sum w P_j P_k over the pixels that both stamps hold. */
static double overlap(const equations *eq, const stamp *a, const stamp *b)
{
    const part on = part_of(eq->image, a);
    const int dx = a->x0 - b->x0, dy = a->y0 - b->y0, left = on.left > -dx ? on.left : -dx,
              low = on.low > -dy ? on.low : -dy, right = on.right < b->side - dx ? on.right : b->side - dx,
              high = on.high < b->side - dy ? on.high : b->side - dy;
    double sum = 0.0;
    for (int y = low; y < high; y++) {
        const float *u = a->values + (size_t)y * (size_t)a->side,
                    *v = b->values + (size_t)(y + dy) * (size_t)b->side + dx,
                    *weight = eq->weight + (size_t)(a->y0 + y) * (size_t)eq->image->width + a->x0;
        for (int x = left; x < right; x++)
            sum += (double)weight[x] * (double)u[x] * (double)v[x];
    }
    return sum;
}

/* Twice the PSF's FWHM, four times, ... */
static rx_status make_sizes(equations *eq, rx_error *err)
{
    const rx_image *image = eq->image;
    const rx_noise_correlation *correlation = image->correlation;
    for (double fwhm = 2.0 * image->psf->fwhm; fwhm <= WIDEST && eq->nsizes < SIZES; fwhm *= 2.0) {
        size *s = &eq->sizes[eq->nsizes];
        const int half = (int)ceil(1.3 * fwhm), side = 2 * half + 1;
        double sum = 0.0;
        RX_TRY(RX_MAKE(s->values, (size_t)(side * side), err));
        eq->nsizes++;
        s->half = half;
        for (int i = 0; i < side * side; i++) {
            const double x = i % side - half, y = i / side - half;
            s->values[i] = (float)exp2(-4.0 * (x * x + y * y) / (fwhm * fwhm));
            sum += (double)s->values[i];
        }
        for (int i = 0; i < side * side; i++)
            s->values[i] /= (float)sum;
        s->noise = correlation != NULL ? fmax(rx_noise_factor_wide(correlation), 1.0) : 1.0;
    }
    return RX_OK;
}

static rx_status cut_size(const equations *eq, int j, const size *of, rx_error *err)
{
    stamp *s = &eq->stamps[j];
    const int side = 2 * of->half + 1;
    free(s->values);
    *s = (stamp){.x0 = (int)lround(eq->list[j].x) - of->half,
                 .y0 = (int)lround(eq->list[j].y) - of->half,
                 .side = side,
                 .values = RX_NEW(float, (size_t)(side * side))};
    if (s->values == NULL)
        return rx_error_memory(err, (size_t)(side * side) * sizeof(float));
    memcpy(s->values, of->values, (size_t)(side * side) * sizeof(float));
    return RX_OK;
}

/* Is it significant by one of the sizes? Its stamp is then that of the most significant one. */
static rx_status try_sizes(const equations *eq, int j, double significant, rx_error *err)
{
    rx_proposal *p = &eq->list[j];
    const size *best = NULL;
    for (int k = 0; k < eq->nsizes; k++) {
        row alone;
        RX_TRY(cut_size(eq, j, &eq->sizes[k], err));
        weigh(eq, &eq->stamps[j], &alone);
        const double lambda =
            alone.diagonal > 0.0 ? alone.right / sqrt(alone.diagonal) / eq->sizes[k].noise : 0.0;
        if (!(lambda > fmax(p->lambda, significant)))
            continue;
        p->lambda = lambda;
        p->flux = alone.right / alone.diagonal;
        best = &eq->sizes[k];
    }
    if (best == NULL)
        return RX_OK;
    p->kept = 1;
    eq->rows[j].noise = best->noise;
    eq->rows[j].shape = 1 + (int)(best - eq->sizes);
    return cut_size(eq, j, best, err);
}

/* Every proposal gets a stamp as wide as its flux, taken alone, asks for. What is not significant alone, as a point or wider, is not
 * beside others either, whose light is above 0, and goes at once. */
static rx_status make_stamps(equations *eq, double significant, rx_error *err)
{
    const rx_psf *psf = eq->image->psf;
    const int half = psf->size / 2, first = (int)ceil(RX_PSF_RADIUS * psf->fwhm),
              least = first < half ? first : half;
    const size_t side = (size_t)rx_psf_fine_side(psf);
    double *profile = NULL;
    rx_status status = profile_of(psf, eq->image, &profile, err);
    int reach = 0;
#pragma omp parallel num_threads(eq->nthreads) reduction(max : reach)
    {
        rx_error local = rx_error_part(NULL);
        float *fine = RX_NEW(float, side *side);
        rx_status mine = fine == NULL ? rx_error_memory(&local, side * side * sizeof *fine) : RX_OK;
#pragma omp for schedule(dynamic, 16)
        for (int j = 0; j < eq->n; j++) {
            if (mine != RX_OK || profile == NULL || (mine = cut_stamp(eq, j, least, fine, &local)) != RX_OK)
                continue;
            row alone;
            weigh(eq, &eq->stamps[j], &alone);
            rx_proposal *p = &eq->list[j];
            p->flux = alone.diagonal > 0.0 ? alone.right / alone.diagonal : 0.0;
            p->lambda = alone.diagonal > 0.0 ? p->flux * sqrt(alone.diagonal) : (double)NAN;
            p->kept = p->sure || !(p->lambda < significant);
            eq->rows[j].noise = 1.0;
            if (!p->kept) {
                mine = try_sizes(eq, j, significant, &local);
                reach = p->kept && eq->stamps[j].side / 2 > reach ? eq->stamps[j].side / 2 : reach;
                continue;
            }
            int wide = least;
            while (wide < half && p->flux * profile[wide] > CUT * eq->image->global_noise)
                wide++;
            if (wide > least)
                mine = cut_stamp(eq, j, wide, fine, &local);
            reach = wide > reach ? wide : reach;
        }
        free(fine);
#pragma omp critical(rx_fit_significance)
        if (mine != RX_OK && status == RX_OK) {
            status = mine;
            rx_error_take(err, &local);
        }
    }
    free(profile);
    eq->reach = reach;
    return status;
}

/* --- weights --- */

static void set_weights(const equations *eq)
{
    const rx_image *image = eq->image;
#pragma omp parallel for schedule(static) num_threads(eq->nthreads)
    for (int y = 0; y < image->height; y++)
        for (int x = 0, n; x < image->width; x += n) {
            float room[RX_MAP_PIECE];
            n = rx_map_piece(x, image->width);
            const float *noise = rx_map_row(&image->noise, y, x, n, room);
            const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
            for (int i = 0; i < n; i++)
                eq->weight[at + (size_t)i] = rx_image_hides(image, at + (size_t)i) || !(noise[i] > 0.0f)
                                                 ? 0.0f
                                                 : 1.0f / (noise[i] * noise[i]);
        }
}

/* dst += scale * light of those that are kept. */
static void add_model(const equations *eq, float scale, float *dst)
{
    const size_t width = (size_t)eq->image->width;
    for (int j = 0; j < eq->n; j++) {
        const stamp *s = &eq->stamps[j];
        const part on = part_of(eq->image, s);
        const float flux = eq->list[j].kept ? scale * (float)eq->list[j].flux : 0.0f;
        for (int y = on.low; y < on.high && flux != 0.0f; y++)
            for (int x = on.left; x < on.right; x++)
                dst[(size_t)(s->y0 + y) * width + (size_t)(s->x0 + x)] += flux * s->values[y * s->side + x];
    }
}

/* sum w^2 P_j^2 (M - F_j P_j) / gain of every row: the photons of others. */
static rx_status weigh_photons(const equations *eq, rx_error *err)
{
    const rx_image *image = eq->image;
    const size_t width = (size_t)image->width, n = width * (size_t)image->height;
    float *model = NULL;
    if (!(image->gain > 0.0))
        return RX_OK;
    RX_TRY(RX_MAKE(model, n, err));
    add_model(eq, 1.0f, model);
#pragma omp parallel for schedule(dynamic, 16) num_threads(eq->nthreads)
    for (int j = 0; j < eq->n; j++) {
        const stamp *s = &eq->stamps[j];
        const part on = part_of(image, s);
        double sum = 0.0;
        for (int y = on.low; y < on.high; y++)
            for (int x = on.left; x < on.right; x++) {
                const size_t at = (size_t)(s->y0 + y) * width + (size_t)(s->x0 + x);
                const double value = (double)s->values[y * s->side + x],
                             weighted = value * (double)eq->weight[at];
                sum += weighted * weighted * fmax((double)model[at] - eq->list[j].flux * value, 0.0);
            }
        eq->rows[j].photons = sum / image->gain;
    }
    free(model);
    return RX_OK;
}

/* --- structure of the sky --- */

/* Of every shape that a proposal may be, in what those that are kept leave of the data. [0] is that of the PSF. */
static rx_status measure_structure(const equations *eq, rx_structure found[SIZES + 1], rx_error *err)
{
    const rx_image *image = eq->image;
    const size_t n = (size_t)image->width * (size_t)image->height;
    float *rest = RX_NEW(float, n), *weight = RX_NEW(float, n), *psf = NULL;
    rx_structure_view view = {
        .width = image->width, .height = image->height, .nthreads = eq->nthreads, .noise = 1.0};
    rx_status status = RX_OK;
    if (rest == NULL || weight == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof *rest));
    memcpy(rest, eq->data, n * sizeof *rest);
    add_model(eq, -1.0f, rest);
#pragma omp parallel for schedule(static) num_threads(eq->nthreads)
    for (size_t k = 0; k < n; k++)
        weight[k] = rx_structure_weight(eq->weight[k], eq->data[k] - rest[k]);
    view.rest = rest;
    view.weight = weight;
    RX_TRY_EXIT(rx_structure_point(image->psf, &view, &psf, err));
    bool asked[SIZES + 1] = {true}; /* most skies have no source of most sizes */
    for (int j = 0; j < eq->n; j++)
        asked[eq->rows[j].shape] |= eq->list[j].kept;
    for (int k = 0; k <= eq->nsizes; k++) {
        if (!asked[k])
            continue;
        if (k > 0) {
            view.values = eq->sizes[k - 1].values;
            view.half = eq->sizes[k - 1].half;
            view.noise = eq->sizes[k - 1].noise;
        }
        RX_TRY_EXIT(rx_structure_measure(&view, &found[k], err));
    }
exit:
    free(rest);
    free(weight);
    free(psf);
    return status;
}

static int inside(double at, int size)
{
    return (int)fmin(fmax(at + 0.5, 0.0), size - 1.0);
}

/* The level is taken off the data, and every row has the structure of its place and its shape. */
static rx_status follow_structure(const equations *eq, rx_error *err)
{
    const rx_image *image = eq->image;
    rx_structure found[SIZES + 1] = {0};
    rx_status status = measure_structure(eq, found, err);
    if (status == RX_OK) {
#pragma omp parallel for schedule(static) num_threads(eq->nthreads)
        for (int y = 0; y < image->height; y++)
            rx_sky_mesh_subtract(&found[0].level, y, 0, image->width,
                                 eq->weight + (size_t)y * (size_t)image->width,
                                 eq->data + (size_t)y * (size_t)image->width);
#pragma omp parallel for schedule(dynamic, 16) num_threads(eq->nthreads)
        for (int j = 0; j < eq->n; j++) {
            row *r = &eq->rows[j];
            if (found[r->shape].variance.nx > 0)
                r->structure = rx_sky_mesh_at(&found[r->shape].variance, inside(eq->list[j].x, image->width),
                                              inside(eq->list[j].y, image->height));
            if (eq->list[j].kept)
                weigh(eq, &eq->stamps[j], r);
        }
    }
    for (int k = 0; k <= SIZES; k++)
        rx_structure_clear(&found[k]);
    return status;
}

/* --- the matrix --- */

typedef struct placed {
    double y;
    int of;
} placed;

static int by_y(const void *a, const void *b)
{
    const placed *p = a, *q = b;
    return p->y < q->y ? -1 : p->y > q->y ? 1 : p->of - q->of;
}

static rx_status sort_by_y(equations *eq, rx_error *err)
{
    placed *all = RX_NEW(placed, (size_t)eq->n);
    if (all == NULL)
        return rx_error_memory(err, (size_t)eq->n * sizeof *all);
    for (int j = 0; j < eq->n; j++)
        all[j] = (placed){eq->list[j].y, j};
    qsort(all, (size_t)eq->n, sizeof *all, by_y);
    for (int k = 0; k < eq->n; k++) {
        eq->order[k] = all[k].of;
        eq->rank[all[k].of] = k;
    }
    free(all);
    return RX_OK;
}

static bool touch(const stamp *a, const stamp *b)
{
    return a->x0 < b->x0 + b->side && b->x0 < a->x0 + a->side && a->y0 < b->y0 + b->side &&
           b->y0 < a->y0 + a->side;
}

static rx_status fill_row(const equations *eq, int j, rx_error *err)
{
    row *r = &eq->rows[j];
    const stamp *own = &eq->stamps[j];
    const double far = own->side / 2 + eq->reach + 1;
    weigh(eq, own, r);
    r->n = 0;
    for (int way = -1; way <= 1; way += 2)
        for (int k = eq->rank[j] + way; k >= 0 && k < eq->n; k += way) {
            const int other = eq->order[k];
            if (fabs(eq->list[other].y - eq->list[j].y) > far)
                break;
            if (!eq->list[other].kept || !touch(own, &eq->stamps[other]))
                continue;
            const double value = overlap(eq, own, &eq->stamps[other]);
            if (value == 0.0)
                continue;
            RX_TRY(RX_GROW(r->others, (size_t)r->n + 1, err));
            r->others[r->n++] = (element){other, (float)value};
        }
    return RX_OK;
}

static rx_status fill_rows(const equations *eq, rx_error *err)
{
    rx_status status = RX_OK;
#pragma omp parallel num_threads(eq->nthreads)
    {
        rx_error local = rx_error_part(NULL);
        rx_status mine = RX_OK;
#pragma omp for schedule(dynamic, 16)
        for (int j = 0; j < eq->n; j++)
            if (mine == RX_OK && eq->list[j].kept)
                mine = fill_row(eq, j, &local);
#pragma omp critical(rx_fit_significance)
        if (mine != RX_OK && status == RX_OK) {
            status = mine;
            rx_error_take(err, &local);
        }
    }
    return status;
}

static bool takes_part(const equations *eq, int j)
{
    return eq->list[j].kept && eq->rows[j].diagonal > 0.0;
}

/* dst = A x over those that take part. */
static void multiply(const equations *eq, const double *x, double *dst)
{
#pragma omp parallel for schedule(static) num_threads(eq->nthreads)
    for (int j = 0; j < eq->n; j++) {
        const row *r = &eq->rows[j];
        double sum = 0.0;
        if (takes_part(eq, j)) {
            sum = r->diagonal * x[j];
            for (int k = 0; k < r->n; k++)
                if (takes_part(eq, r->others[k].column))
                    sum += (double)r->others[k].value * x[r->others[k].column];
        }
        dst[j] = sum;
    }
}

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int j = 0; j < n; j++)
        sum += a[j] * b[j];
    return sum;
}

/* Conjugate gradients from the fluxes there are, preconditioned by the diagonal. */
static void solve(const equations *eq)
{
    const int n = eq->n;
    double *residual = eq->work, *direction = residual + n, *product = direction + n, *flux = product + n;
    double before = 0.0, scale = 0.0;
    for (int j = 0; j < n; j++)
        flux[j] = takes_part(eq, j) ? eq->list[j].flux : 0.0;
    multiply(eq, flux, product);
    for (int j = 0; j < n; j++) {
        const bool part = takes_part(eq, j);
        residual[j] = part ? eq->rows[j].right - product[j] : 0.0;
        direction[j] = part ? residual[j] / eq->rows[j].diagonal : 0.0;
        before += residual[j] * direction[j];
        scale += part ? eq->rows[j].right * eq->rows[j].right / eq->rows[j].diagonal : 0.0;
    }
    for (int step = 0; step < MOST_STEPS && before > TOLERANCE * TOLERANCE * scale; step++) {
        multiply(eq, direction, product);
        const double curvature = dot(direction, product, n);
        if (!(curvature > 0.0)) /* two at one place */
            break;
        const double length = before / curvature;
        double after = 0.0;
        for (int j = 0; j < n; j++) {
            flux[j] += length * direction[j];
            residual[j] -= length * product[j];
            after += takes_part(eq, j) ? residual[j] * residual[j] / eq->rows[j].diagonal : 0.0;
        }
        for (int j = 0; j < n; j++)
            direction[j] = (takes_part(eq, j) ? residual[j] / eq->rows[j].diagonal : 0.0) +
                           after / before * direction[j];
        before = after;
    }
    for (int j = 0; j < n; j++)
        if (takes_part(eq, j))
            eq->list[j].flux = flux[j];
}

static double coupling(const equations *eq, int j, const element *e)
{
    return fabs((double)e->value) / sqrt(eq->rows[j].diagonal * eq->rows[e->column].diagonal);
}

/* 1 / (A^-1)_jj: what neighbours leave of A_jj, by the Schur complement of those that are coupled to it. */
static double information(const equations *eq, int j)
{
    const row *r = &eq->rows[j];
    const element *near[NEIGHBOURS];
    double matrix[NEIGHBOURS * NEIGHBOURS] = {0}, column[NEIGHBOURS], solved[NEIGHBOURS];
    int n = 0;
    for (int k = 0; k < r->n; k++) {
        const element *e = &r->others[k];
        if (!takes_part(eq, e->column) || coupling(eq, j, e) < COUPLED)
            continue;
        if (n == NEIGHBOURS && coupling(eq, j, near[n - 1]) >= coupling(eq, j, e))
            continue;
        int at = n < NEIGHBOURS ? n++ : n - 1; /* the strongest first, the weakest falls out */
        for (; at > 0 && coupling(eq, j, near[at - 1]) < coupling(eq, j, e); at--)
            near[at] = near[at - 1];
        near[at] = e;
    }
    for (int a = 0; a < n; a++) {
        const row *other = &eq->rows[near[a]->column];
        column[a] = solved[a] = (double)near[a]->value;
        matrix[a * NEIGHBOURS + a] = other->diagonal * (1.0 + 1e-9);
        for (int k = 0; k < other->n; k++)
            for (int b = 0; b < a; b++)
                if (other->others[k].column == near[b]->column)
                    matrix[a * NEIGHBOURS + b] = (double)other->others[k].value;
    }
    if (n == 0 || !rx_cholesky(matrix, n, NEIGHBOURS))
        return r->diagonal;
    rx_cholesky_solve(matrix, n, NEIGHBOURS, solved);
    return fmax(r->diagonal - dot(column, solved, n), 0.0);
}

/* The flux over its error: of the noise, and of what others shine here, their photons and the PSF's error in them. */
static void set_lambda(const equations *eq)
{
    const double relative = rx_psf_flux_error_mean(eq->image->psf);
#pragma omp parallel for schedule(dynamic, 64) num_threads(eq->nthreads)
    for (int j = 0; j < eq->n; j++) {
        rx_proposal *p = &eq->list[j];
        const row *r = &eq->rows[j];
        double light = 0.0;
        if (!p->kept)
            continue;
        for (int k = 0; k < r->n; k++)
            if (takes_part(eq, r->others[k].column))
                light += (double)r->others[k].value * fmax(eq->list[r->others[k].column].flux, 0.0);
        const double known = information(eq, j);
        p->lambda = r->diagonal > 0.0 ? p->flux * known /
                                            sqrt(known * (1.0 + r->structure) * r->noise * r->noise +
                                                 r->photons + pow(relative * light, 2.0))
                                      : (double)NAN;
        if (known == 0.0 && r->diagonal > 0.0)
            p->lambda = 0.0;
    }
}

/* Is it the weakest of those that it shares light with? Of equals the later one goes. */
static bool is_weakest(const equations *eq, int j)
{
    const row *r = &eq->rows[j];
    for (int k = 0; k < r->n; k++) {
        const int other = r->others[k].column;
        const double theirs = eq->list[other].lambda, ours = eq->list[j].lambda;
        if (takes_part(eq, other) && !eq->list[other].sure && coupling(eq, j, &r->others[k]) >= SHARED &&
            (theirs < ours || (theirs == ours && other > j)))
            return false;
    }
    return true;
}

/* How many go: of each neighbourhood the weakest, where it is below `least`. */
static int drop_weakest(const equations *eq, double least, unsigned char *drop)
{
    int dropped = 0;
#pragma omp parallel for schedule(static) num_threads(eq->nthreads)
    for (int j = 0; j < eq->n; j++)
        drop[j] = takes_part(eq, j) && !eq->list[j].sure && eq->list[j].lambda < least && is_weakest(eq, j);
    for (int j = 0; j < eq->n; j++)
        if (drop[j]) {
            eq->list[j].kept = 0;
            dropped++;
        }
    return dropped;
}

rx_status rx_significance(const rx_image *image, double least, int nthreads, int n, rx_proposal *list,
                          rx_error *err)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    equations eq = {.image = image, .nthreads = nthreads > 0 ? nthreads : 1, .n = n, .list = list};
    unsigned char *drop = NULL;
    rx_status status = RX_OK;
    if (n == 0)
        return RX_OK;
    for (int j = 0; j < n; j++)
        list[j] = (rx_proposal){.x = list[j].x, .y = list[j].y, .sure = list[j].sure};
    RX_TRY_EXIT(RX_MAKE(eq.stamps, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(eq.rows, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(eq.order, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(eq.rank, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(eq.work, 4 * (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(eq.data, pixels, err));
    RX_TRY_EXIT(RX_MAKE(eq.weight, pixels, err));
    RX_TRY_EXIT(RX_MAKE(drop, (size_t)n, err));
    rx_image_above_sky(image, eq.nthreads, eq.data);
    set_weights(&eq);
    RX_TRY_EXIT(make_sizes(&eq, err));
    RX_TRY_EXIT(make_stamps(&eq, least, err));
    RX_TRY_EXIT(sort_by_y(&eq, err));
    RX_TRY_EXIT(fill_rows(&eq, err));
    solve(&eq);
    RX_TRY_EXIT(weigh_photons(&eq, err));
    for (int round = 0; round <= ROUNDS && status == RX_OK; round++) {
        for (set_lambda(&eq); drop_weakest(&eq, least, drop) > 0; set_lambda(&eq))
            solve(&eq);
        if (round == ROUNDS)
            break;
        RX_TRY_EXIT(follow_structure(&eq, err));
        solve(&eq);
    }
exit:
    free(drop);
    free_equations(&eq);
    return status;
}
