/* Normal equations of a group. */
#include "template/joint.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/normal.h"
#include "template/correlated.h"
#include "template/patch.h"

enum { MANY = 16 }; /* unknowns that are worth several threads */

static const double LEAST = 0.01; /* variance under correlated noise over that of independent pixels */

/* One unknown: a flux, or the flux times a shift in x or y; the background is the last, without a column. */
typedef struct column {
    const rx_footprint *footprint;
    int member, what;     /* 0 flux, 1 x, 2 y */
    double before;        /* what the model holds of it */
    double power;         /* of a flux, sum w T^2 */
    double centre, prior; /* of its prior: and its precision, */
    double precision;     /* by which it counts among weights that take the noise for smaller than it is */
} column;

typedef struct equations {
    size_t n, nflux, ncolumns; /* unknowns; columns of fluxes come first */
    column *columns;
    rx_footprint *slopes; /* [2 members] dT/dx, dT/dy; values owned */
    size_t nslopes;
    double *room; /* owned, holds the next four */
    double *a, *b, *x, *covariance;
    int *bounded, *held; /* the first one owned, it holds both */
    double open, prior;  /* of the background: sum of the weights, and the precision of its prior */
    double *noise;       /* owned; [n][n] B, then [n] its diagonal; NULL where A is it */
} equations;

static void clear(equations *e)
{
    for (size_t i = 0; i < e->nslopes; i++)
        free(e->slopes[i].values);
    free(e->slopes);
    free(e->columns);
    free(e->room);
    free(e->noise);
    free(e->bounded);
}

static rx_status open_equations(size_t n, equations *e, rx_error *err)
{
    e->n = n;
    e->room = RX_NEW(double, 2 * n * (n + 1));
    e->bounded = RX_NEW(int, 2 * n);
    if (e->room == NULL || e->bounded == NULL)
        return rx_error_memory(err, 2 * n * n * sizeof(double));
    e->a = e->room;
    e->covariance = e->a + n * n;
    e->b = e->covariance + n * n;
    e->x = e->b + n;
    e->held = e->bounded + n;
    return RX_OK;
}

/* dst [n] = half of after - before; NULL: nothing. */
RX_SIMD static void half_difference(const float *after, const float *before, size_t n, float *restrict dst)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        dst[i] = 0.5f * ((after != NULL ? after[i] : 0) - (before != NULL ? before[i] : 0));
}

/* Central differences of the template, along x or y; nothing outside. */
static rx_status slope_of(const rx_footprint *f, int along_y, rx_footprint *dst, rx_error *err)
{
    const size_t w = (size_t)f->width, h = (size_t)f->height;
    *dst = *f;
    dst->values = RX_NEW(float, w *h);
    if (dst->values == NULL)
        return rx_error_memory(err, w * h * sizeof(float));
    for (size_t y = 0; y < h; y++) {
        const float *row = f->values + y * w;
        float *slope = dst->values + y * w;
        if (along_y) {
            half_difference(y + 1 < h ? row + w : NULL, y > 0 ? row - w : NULL, w, slope);
            continue;
        }
        half_difference(w > 1 ? row + 1 : NULL, NULL, 1, slope);
        if (w > 2)
            half_difference(row + 2, row, w - 2, slope + 1);
        half_difference(NULL, w > 1 ? row + w - 2 : NULL, 1, slope + w - 1);
    }
    return RX_OK;
}

/* sum w T and sum w T (data - model) over a footprint: products in float, sums in double. */
RX_SIMD static void project(const rx_footprint *f, const rx_fit_image *image, double *weight, double *value)
{
    double sum_w = 0, sum_v = 0;
    for (int j = 0; j < f->height; j++) {
        const size_t row = rx_fit_image_row(image, f->y0 + j) + (size_t)f->x0;
        const float *t = f->values + (size_t)j * (size_t)f->width;
        const float *w = image->weight + row, *data = image->data + row, *model = image->model + row;
#pragma omp simd reduction(+ : sum_w, sum_v)
        for (int i = 0; i < f->width; i++) {
            const float wt = w[i] * t[i];
            sum_w += wt;
            sum_v += wt * (data[i] - model[i]);
        }
    }
    *weight = sum_w;
    *value = sum_v;
}

RX_SIMD static void sum_box(const rx_footprint *f, const rx_fit_image *image, double sums[3])
{
    double sum = 0, value = 0, count = 0;
    for (int y = f->y0; y < f->y0 + f->height; y++) {
        const size_t row = rx_fit_image_row(image, y) + (size_t)f->x0;
        const float *w = image->weight + row, *data = image->data + row, *model = image->model + row;
#pragma omp simd reduction(+ : sum, value, count)
        for (int i = 0; i < f->width; i++) {
            sum += w[i];
            value += w[i] * ((double)data[i] - model[i]);
            count += w[i] > 0.0f ? 1.0 : 0.0;
        }
    }
    sums[0] = sum;
    sums[1] = value;
    sums[2] = count;
}

/* What holds the footprints. */
static rx_window window_of(const rx_fit_image *image, int n, const rx_joint_member *m)
{
    rx_window w = {image->width, image->height, 0, 0};
    for (int i = 0; i < n; i++) {
        const rx_footprint *f = m[i].footprint;
        if (f->width == 0)
            continue;
        w.x0 = rx_min_int(f->x0, w.x0);
        w.y0 = rx_min_int(f->y0, w.y0);
        w.x1 = rx_max_int(f->x0 + f->width, w.x1);
        w.y1 = rx_max_int(f->y0 + f->height, w.y1);
    }
    return w;
}

/* Over the union of the footprints: sum w, sum w (data - model), pixels with weight. */
static rx_status sum_union(int n, const rx_joint_member *m, const rx_fit_image *image, double sums[3],
                           rx_error *err)
{
    const rx_window w = window_of(image, n, m);
    sums[0] = sums[1] = sums[2] = 0;
    if (n == 1)
        sum_box(m[0].footprint, image, sums);
    if (n == 1 || w.x1 <= w.x0 || w.y1 <= w.y0)
        return RX_OK;
    const size_t side = (size_t)(w.x1 - w.x0), area = side * (size_t)(w.y1 - w.y0);
    uint8_t *seen = RX_NEW(uint8_t, area);
    if (seen == NULL)
        return rx_error_memory(err, area);
    for (int i = 0; i < n; i++) {
        const rx_footprint *f = m[i].footprint;
        for (int y = f->y0; y < f->y0 + f->height; y++)
            for (int x = f->x0; x < f->x0 + f->width; x++) {
                uint8_t *s = &seen[(size_t)(y - w.y0) * side + (size_t)(x - w.x0)];
                const size_t k = rx_fit_image_row(image, y) + (size_t)x;
                const double weight = *s ? 0 : image->weight[k];
                *s = 1;
                if (!(weight > 0))
                    continue;
                sums[0] += weight;
                sums[1] += weight * ((double)image->data[k] - image->model[k]);
                sums[2] += 1;
            }
    }
    free(seen);
    return RX_OK;
}

/* Columns of the fluxes of members with data, then of the shifts of those that may move. */
static rx_status list_columns(const rx_fit_image *image, int n, rx_joint_member *m, equations *e,
                              rx_error *err)
{
    e->columns = RX_NEW(column, 3 * (size_t)n);
    e->slopes = RX_NEW(rx_footprint, 2 * (size_t)n);
    if (e->columns == NULL || e->slopes == NULL)
        return rx_error_memory(err, 3 * (size_t)n * sizeof *e->columns);
    for (int i = 0; i < n; i++) {
        const double power = rx_footprint_product(m[i].footprint, m[i].footprint, image);
        m[i].flags = power > 0 && isfinite(power) ? 0 : RX_TPHOT_NO_DATA;
        if (m[i].flags == 0)
            e->columns[e->nflux++] =
                (column){.footprint = m[i].footprint, .member = i, .before = m[i].before, .power = power};
    }
    e->ncolumns = e->nflux;
    for (size_t k = 0; k < e->nflux; k++) {
        const rx_joint_member *one = &m[e->columns[k].member];
        const double scale = one->before * one->shift_width, grain = one->grain;
        for (int d = 0; d < 2 && scale > 0; d++) {
            rx_footprint *slope = &e->slopes[e->nslopes];
            rx_status status = slope_of(one->footprint, d, slope, err);
            if (status != RX_OK)
                return status;
            e->nslopes++;
            e->columns[e->ncolumns++] = (column){.footprint = slope,
                                                 .member = e->columns[k].member,
                                                 .what = 1 + d,
                                                 .centre = -one->before * one->shift_centre[d],
                                                 .prior = 1 / (scale * scale),
                                                 .precision = grain * grain / (scale * scale)};
        }
    }
    return RX_OK;
}

/* Of the unknown i: sum w T (d - M), and the matrix up to its diagonal and for the background. */
static void fill_column(const rx_fit_image *image, const rx_joint_member *m, size_t i, equations *e)
{
    const size_t last = e->ncolumns, size = e->n;
    const column *c = &e->columns[i];
    double weight;
    project(c->footprint, image, &weight, &e->b[i]);
    e->bounded[i] = m[c->member].positive && c->what == 0;
    for (size_t j = 0; j <= i; j++)
        e->a[i * size + j] = e->a[j * size + i] =
            c->what == 0 && j == i ? c->power
                                   : rx_footprint_product(c->footprint, e->columns[j].footprint, image);
    if (size > last)
        e->a[i * size + last] = e->a[last * size + i] = weight;
}

/* What the model holds of the members goes back into the data: b = sum w T (d - M) + A F_before. */
static rx_status fill(const rx_joint_params *par, const rx_fit_image *image, int n, const rx_joint_member *m,
                      equations *e, rx_error *err)
{
    const size_t last = e->ncolumns, size = e->n;
    double sums[3];
    if (par->nthreads > 1 && last >= MANY) {
#pragma omp parallel for schedule(dynamic) num_threads(par->nthreads)
        for (size_t i = 0; i < last; i++)
            fill_column(image, m, last - 1 - i, e); /* long ones first */
    } else {
        for (size_t i = 0; i < last; i++)
            fill_column(image, m, i, e);
    }
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < e->nflux; j++)
            e->b[i] += e->a[i * size + j] * e->columns[j].before;
    for (size_t i = e->nflux; i < last; i++) {
        e->a[i * size + i] += e->columns[i].precision;
        e->b[i] += e->columns[i].precision * e->columns[i].centre;
    }
    if (size == last)
        return RX_OK;
    rx_status status = sum_union(n, m, image, sums, err);
    if (status != RX_OK)
        return status;
    /* members with data have pixels with weight: sums[0] > 0 */
    const double prior = sums[0] / (sums[2] * par->background_sigma * par->background_sigma);
    const double wide = rx_noise_factor_wide(image->correlation);
    e->open = sums[0];
    e->prior = prior;
    e->a[last * size + last] = sums[0] + wide * wide * prior;
    e->b[last] += sums[1];
    return RX_OK;
}

/* Column i of B. */
static rx_status fill_noise(const rx_fit_image *image, const rx_window *all, size_t i, equations *e,
                            rx_error *err)
{
    const size_t last = e->ncolumns, size = e->n;
    const double wide = rx_noise_factor_wide(image->correlation);
    rx_correlated grain;
    RX_TRY(rx_correlated_new(image, e->columns[i].footprint, all, &grain, err));
    for (size_t j = 0; j <= i; j++)
        e->noise[i * size + j] = e->noise[j * size + i] =
            rx_correlated_covariance(&grain, e->columns[j].footprint);
    if (e->columns[i].what != 0)
        e->noise[i * size + i] += e->columns[i].precision * e->columns[i].precision / e->columns[i].prior;
    if (size > last) /* the background is far wider than the noise's reach */
        e->noise[i * size + last] = e->noise[last * size + i] = wide * wide * e->a[i * size + last];
    rx_correlated_clear(&grain);
    return RX_OK;
}

/* dst = a b, all [n][n]. */
RX_SIMD static void multiply(const double *a, const double *b, size_t n, double *dst)
{
    memset(dst, 0, n * n * sizeof *dst);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < n; k++) {
            const double by = a[i * n + k];
#pragma omp simd
            for (size_t j = 0; j < n; j++)
                dst[i * n + j] += by * b[k * n + j];
        }
}

/* covariance = A^-1, zero in rows and columns of what is held, becomes A^-1 B A^-1: B the covariance of b, to
 * which priors contribute by as much as they count. */
static rx_status correlate(const rx_joint_params *par, const rx_fit_image *image, int n,
                           const rx_joint_member *m, equations *e, rx_error *err)
{
    const size_t last = e->ncolumns, size = e->n;
    const int threads = par->nthreads > 1 && last >= MANY ? par->nthreads : 1;
    const double wide = rx_noise_factor_wide(image->correlation);
    const rx_window all = window_of(image, n, m);
    rx_status failed = RX_OK;
    double *half = RX_NEW(double, size *size);
    e->noise = RX_NEW(double, size *(size + 1));
    if (half == NULL || e->noise == NULL) {
        free(half);
        return rx_error_memory(err, 2 * size * size * sizeof *half);
    }
#pragma omp parallel for schedule(dynamic) num_threads(threads)
    for (size_t i = 0; i < last; i++) {
        rx_error own = {0};
        const rx_status status = fill_noise(image, &all, last - 1 - i, e, &own);
        if (status != RX_OK) {
#pragma omp critical(rx_joint_failure)
            {
                failed = status;
                rx_error_take(err, &own);
            }
        }
    }
    if (size > last)
        e->noise[last * size + last] = wide * wide * e->open + wide * wide * wide * wide * e->prior;
    for (size_t i = 0; i < size; i++)
        e->noise[size * size + i] = e->noise[i * size + i];
    multiply(e->covariance, e->noise, size, half);
    multiply(half, e->covariance, size, e->noise);
    for (size_t i = 0; i < size; i++) /* a measured correlation may be none that noise can have */
        e->noise[i * size + i] = fmax(e->noise[i * size + i], LEAST * e->covariance[i * size + i]);
    memcpy(e->covariance, e->noise, size * size * sizeof *half);
    free(half);
    return failed;
}

/* Largest coefficient of covariance of flux i with another flux. */
static double largest_coefficient(const equations *e, size_t i)
{
    double largest = 0;
    for (size_t j = 0; j < e->nflux; j++) {
        const double norm = e->covariance[i * e->n + i] * e->covariance[j * e->n + j];
        if (j != i && norm > 0)
            largest = fmax(largest, fabs(e->covariance[i * e->n + j]) / sqrt(norm));
    }
    return largest;
}

/* Variance of unknown i if nothing else were free. */
static double variance_alone(const equations *e, size_t i)
{
    const double power = e->a[i * e->n + i];
    return e->noise != NULL ? fmax(e->noise[e->n * e->n + i] / power, LEAST) / power : 1 / power;
}

static void store(const equations *e, int singular, int errors, rx_joint_member *m, int n, double *background,
                  double *covariance)
{
    *background = e->n > e->ncolumns ? e->x[e->ncolumns] : 0;
    for (size_t k = 0; covariance != NULL && k < (size_t)n * (size_t)n; k++)
        covariance[k] = 0;
    for (size_t i = 0; i < e->nflux; i++) {
        rx_joint_member *one = &m[e->columns[i].member];
        one->flux = e->x[i];
        one->flags |= (e->held[i] ? RX_TPHOT_BOUND : 0) | (singular ? RX_TPHOT_SINGULAR : 0);
        if (!errors)
            continue;
        /* of a flux held at 0: what its template alone would have */
        one->variance = e->held[i] ? variance_alone(e, i) : e->covariance[i * e->n + i];
        one->alone = variance_alone(e, i);
        one->blend = largest_coefficient(e, i);
        for (size_t j = 0; covariance != NULL && j < e->nflux; j++)
            covariance[(size_t)e->columns[i].member * (size_t)n + (size_t)e->columns[j].member] =
                e->covariance[i * e->n + j];
    }
    for (size_t i = e->nflux; i < e->ncolumns; i++) {
        rx_joint_member *one = &m[e->columns[i].member];
        one->shift[e->columns[i].what - 1] = -e->x[i] / one->before;
    }
}

rx_status rx_joint_fit(const rx_joint_params *par, const rx_fit_image *image, int n, rx_joint_member *members,
                       double *background, double *covariance, rx_error *err)
{
    equations e = {0};
    int singular = 0, positive = 0;
    for (int i = 0; i < n; i++) {
        positive |= members[i].positive;
        members[i].flux = members[i].variance = members[i].alone = NAN;
        members[i].blend = members[i].shift[0] = members[i].shift[1] = 0;
    }
    *background = 0;
    rx_status status = list_columns(image, n, members, &e, err);
    if (status == RX_OK)
        status = open_equations(e.ncolumns + (par->background_sigma > 0 && e.nflux > 0), &e, err);
    if (status == RX_OK && e.n > 0)
        status = fill(par, image, n, members, &e, err);
    if (status == RX_OK && e.n > 0)
        status = positive
                     ? rx_normal_nonnegative(&(rx_normal_bounded){e.n, e.a, e.b, e.bounded}, e.x,
                                             e.covariance, e.held, &singular, err)
                     : rx_normal_solve(e.a, e.b, e.n, e.x, par->errors ? e.covariance : NULL, &singular, err);
    if (status == RX_OK && e.n > 0 && par->errors && image->correlation != NULL)
        status = correlate(par, image, n, members, &e, err);
    if (status == RX_OK)
        store(&e, singular, par->errors, members, n, background, covariance);
    clear(&e);
    return status;
}
