/* Normal equations of a group. */
#include "template/joint.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/normal.h"
#include "template/patch.h"

/* The equations: unknowns 0 .. n - 1 are members with data, the last is the background when there is one. */
typedef struct equations {
    size_t n;
    int background; /* 1: the last unknown */
    int *member;    /* [n] which member an unknown is */
    double *a, *b, *x, *covariance;
    int *bounded, *held;
} equations;

static void clear(equations *e)
{
    free(e->member);
    free(e->a);
    free(e->b);
    free(e->x);
    free(e->covariance);
    free(e->bounded);
    free(e->held);
}

static rx_status open_equations(size_t n, equations *e, rx_error *err)
{
    *e = (equations){.member = RX_NEW(int, n),
                     .a = rx_alloc(n * n, sizeof(double)),
                     .b = RX_NEW(double, n),
                     .x = RX_NEW(double, n),
                     .covariance = rx_alloc(n * n, sizeof(double)),
                     .bounded = RX_NEW(int, n),
                     .held = RX_NEW(int, n)};
    if (e->member != NULL && e->a != NULL && e->b != NULL && e->x != NULL && e->covariance != NULL &&
        e->bounded != NULL && e->held != NULL)
        return RX_OK;
    clear(e);
    return rx_error_memory(err, 2 * n * n * sizeof(double));
}

/* sum w T and sum w T (data - model) over a footprint. */
static void project(const rx_footprint *f, const rx_canvas *canvas, double *weight, double *value)
{
    *weight = *value = 0;
    for (int j = 0; j < f->height; j++) {
        const size_t row = (size_t)(f->y0 + j) * (size_t)canvas->width + (size_t)f->x0;
        const float *t = f->values + (size_t)j * (size_t)f->width;
        for (int i = 0; i < f->width; i++) {
            const double wt = (double)canvas->weight[row + (size_t)i] * t[i];
            *weight += wt;
            *value += wt * ((double)canvas->data[row + (size_t)i] - canvas->model[row + (size_t)i]);
        }
    }
}

/* Over the union of the footprints: sum w, sum w (data - model), pixels with weight. */
static rx_status sum_union(int n, const rx_joint_member *m, const rx_canvas *canvas, double sums[3],
                           rx_error *err)
{
    int x0 = canvas->width, y0 = canvas->height, x1 = 0, y1 = 0;
    for (int i = 0; i < n; i++) {
        const rx_footprint *f = m[i].footprint;
        if (f->width == 0)
            continue;
        x0 = f->x0 < x0 ? f->x0 : x0;
        y0 = f->y0 < y0 ? f->y0 : y0;
        x1 = f->x0 + f->width > x1 ? f->x0 + f->width : x1;
        y1 = f->y0 + f->height > y1 ? f->y0 + f->height : y1;
    }
    sums[0] = sums[1] = sums[2] = 0;
    if (x1 <= x0 || y1 <= y0)
        return RX_OK;
    const size_t side = (size_t)(x1 - x0);
    uint8_t *seen = RX_NEW(uint8_t, side * (size_t)(y1 - y0));
    if (seen == NULL)
        return rx_error_memory(err, side * (size_t)(y1 - y0));
    for (int i = 0; i < n; i++) {
        const rx_footprint *f = m[i].footprint;
        for (int y = f->y0; y < f->y0 + f->height; y++)
            for (int x = f->x0; x < f->x0 + f->width; x++) {
                uint8_t *s = &seen[(size_t)(y - y0) * side + (size_t)(x - x0)];
                const size_t k = (size_t)y * (size_t)canvas->width + (size_t)x;
                const double w = *s ? 0 : canvas->weight[k];
                *s = 1;
                if (!(w > 0))
                    continue;
                sums[0] += w;
                sums[1] += w * ((double)canvas->data[k] - canvas->model[k]);
                sums[2] += 1;
            }
    }
    free(seen);
    return RX_OK;
}

/* What the model holds of the members goes back into the data: b = sum w T (d - M) + A F_before. */
static rx_status fill(const rx_joint_params *par, const rx_canvas *canvas, int n, rx_joint_member *m,
                      equations *e, double *weight, rx_error *err)
{
    for (int i = 0; i < n; i++) {
        const double power = rx_footprint_product(m[i].footprint, m[i].footprint, canvas);
        m[i].flags = power > 0 && isfinite(power) ? 0 : RX_TPHOT_NO_DATA;
        if (m[i].flags == 0)
            e->member[e->n++] = i;
    }
    const size_t nflux = e->n, columns = e->n + (par->background_sigma > 0 && e->n > 0 ? 1 : 0);
    e->background = columns > nflux;
    e->n = columns;
    for (size_t i = 0; i < nflux; i++) {
        project(m[e->member[i]].footprint, canvas, &weight[i], &e->b[i]);
        e->bounded[i] = par->non_negative;
        for (size_t j = 0; j <= i; j++)
            e->a[i * columns + j] = e->a[j * columns + i] =
                rx_footprint_product(m[e->member[i]].footprint, m[e->member[j]].footprint, canvas);
    }
    for (size_t i = 0; i < nflux; i++)
        for (size_t j = 0; j < nflux; j++)
            e->b[i] += e->a[i * columns + j] * m[e->member[j]].before;
    if (!e->background)
        return RX_OK;
    double sums[3];
    rx_status status = sum_union(n, m, canvas, sums, err);
    /* members with data have pixels with weight: sums[0] > 0 */
    const double prior = sums[0] / (sums[2] * par->background_sigma * par->background_sigma);
    e->a[nflux * columns + nflux] = sums[0] + prior;
    e->b[nflux] = sums[1];
    for (size_t i = 0; i < nflux; i++) {
        e->a[i * columns + nflux] = e->a[nflux * columns + i] = weight[i];
        e->b[nflux] += weight[i] * m[e->member[i]].before;
    }
    return status;
}

static void store(const equations *e, int singular, rx_joint_member *m, int n, double *background,
                  double *covariance)
{
    const size_t nflux = e->n - (size_t)e->background;
    *background = e->background ? e->x[nflux] : 0;
    for (size_t k = 0; covariance != NULL && k < (size_t)n * (size_t)n; k++)
        covariance[k] = 0;
    for (size_t i = 0; i < nflux; i++) {
        rx_joint_member *one = &m[e->member[i]];
        one->flux = e->x[i];
        one->variance = e->covariance[i * e->n + i];
        one->flags |= (e->held[i] ? RX_TPHOT_BOUND : 0) | (singular ? RX_TPHOT_SINGULAR : 0);
        /* of a flux held at 0: what its template alone would have */
        if (e->held[i])
            one->variance = 1 / e->a[i * e->n + i];
        for (size_t j = 0; j < nflux; j++) {
            const double c = e->covariance[i * e->n + j];
            const double norm = e->covariance[i * e->n + i] * e->covariance[j * e->n + j];
            if (j != i && norm > 0)
                one->blend = fmax(one->blend, fabs(c) / sqrt(norm));
            if (covariance != NULL)
                covariance[(size_t)e->member[i] * (size_t)n + (size_t)e->member[j]] = c;
        }
    }
}

rx_status rx_joint_fit(const rx_joint_params *par, const rx_canvas *canvas, int n, rx_joint_member *members,
                       double *background, double *covariance, rx_error *err)
{
    equations e;
    int singular = 0;
    rx_status status = open_equations((size_t)n + 1, &e, err);
    if (status != RX_OK)
        return status;
    double *weight = RX_NEW(double, n);
    if (weight == NULL)
        status = rx_error_memory(err, (size_t)n * sizeof(double));
    for (int i = 0; i < n; i++) {
        members[i].flux = members[i].variance = NAN;
        members[i].blend = 0;
    }
    *background = 0;
    if (status == RX_OK)
        status = fill(par, canvas, n, members, &e, weight, err);
    if (status == RX_OK && e.n > 0) {
        status = par->non_negative ? rx_normal_nonnegative(e.a, e.b, e.bounded, e.n, e.x, e.covariance,
                                                           e.held, &singular, err)
                                   : rx_normal_solve(e.a, e.b, e.n, e.x, e.covariance, &singular, err);
    }
    if (status == RX_OK)
        store(&e, singular, members, n, background, covariance);
    free(weight);
    clear(&e);
    return status;
}
