/* Cholesky on normal equations, with bounds by an active set. */
#include "num/normal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <gsl/gsl_errno.h>
#include <gsl/gsl_linalg.h>

#include "base/memory.h"

static const double RIDGE = 1e-8; /* of the scaled diagonal */
static const double WEAK = 1e-10; /* smallest pivot of the scaled matrix that counts as definite */

/* scaled = D A D with unit diagonal, scale[i] = D_ii; 0 when that cannot be done. */
static int scale_matrix(const double *a, size_t n, double ridge, double *scale, double *scaled)
{
    for (size_t i = 0; i < n; i++) {
        if (!(a[i * n + i] > 0.0) || !isfinite(a[i * n + i]))
            return 0;
        scale[i] = 1.0 / sqrt(a[i * n + i]);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double value = i == j ? 1.0 + ridge : a[i * n + j] * scale[i] * scale[j];
            if (!isfinite(value))
                return 0;
            scaled[i * n + j] = scaled[j * n + i] = value;
        }
    return 1;
}

/* Factor in place; 0 when not definite. */
static int factor(double *scaled, size_t n)
{
    gsl_matrix_view m = gsl_matrix_view_array(scaled, n, n);
    if (gsl_linalg_cholesky_decomp1(&m.matrix) != GSL_SUCCESS)
        return 0;
    for (size_t i = 0; i < n; i++)
        if (!(scaled[i * n + i] * scaled[i * n + i] > WEAK))
            return 0;
    return 1;
}

rx_status rx_normal_solve(const double *a, const double *b, size_t n, double *x, double *covariance,
                          int *singular, rx_error *err)
{
    rx_status status = RX_OK;
    gsl_set_error_handler_off();
    double *scaled = rx_alloc(n * n, sizeof(double)), *scale = RX_NEW(double, n);
    *singular = 0;
    if (scaled == NULL || scale == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * n * sizeof(double)));
    int fine = scale_matrix(a, n, 0.0, scale, scaled);
    for (size_t i = 0; i < n; i++)
        fine = fine && isfinite(b[i]);
    if (!fine) {
        status =
            rx_error_set(err, RX_INPUT, "normal equations hold a number that is not finite or no weight");
        goto exit;
    }
    if (!factor(scaled, n)) {
        *singular = 1;
        scale_matrix(a, n, RIDGE, scale, scaled);
        factor(scaled, n); /* positive semidefinite plus the ridge: definite but for rounding */
    }
    gsl_matrix_view m = gsl_matrix_view_array(scaled, n, n);
    gsl_vector_view v = gsl_vector_view_array(x, n);
    for (size_t i = 0; i < n; i++)
        x[i] = b[i] * scale[i];
    gsl_linalg_cholesky_svx(&m.matrix, &v.vector);
    for (size_t i = 0; i < n; i++)
        x[i] *= scale[i];
    if (covariance == NULL)
        goto exit;
    gsl_linalg_cholesky_invert(&m.matrix);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            covariance[i * n + j] = scaled[i * n + j] * scale[i] * scale[j];
exit:
    free(scaled);
    free(scale);
    return status;
}

/* What one bounded problem works on: the equations of the free unknowns are packed into a, b. */
typedef struct active_set {
    double *a, *b, *x, *covariance;
    size_t *free_index;
    size_t nfree;
} active_set;

static void pack(const double *a, const double *b, size_t n, const int *at_bound, active_set *s)
{
    s->nfree = 0;
    for (size_t i = 0; i < n; i++)
        if (!at_bound[i])
            s->free_index[s->nfree++] = i;
    for (size_t i = 0; i < s->nfree; i++) {
        s->b[i] = b[s->free_index[i]];
        for (size_t j = 0; j < s->nfree; j++)
            s->a[i * s->nfree + j] = a[s->free_index[i] * n + s->free_index[j]];
    }
}

/* Walk from x towards the solution of the free unknowns until the first of them hits 0; that one is held.
 * Returns whether one was. */
static int walk(const active_set *s, const int *bounded, double *x, int *at_bound)
{
    double step = 1.0;
    size_t hit = s->nfree;
    for (size_t i = 0; i < s->nfree; i++) {
        const size_t k = s->free_index[i];
        if ((bounded != NULL && !bounded[k]) || s->x[i] >= 0.0)
            continue;
        const double length = x[k] > 0.0 ? x[k] / (x[k] - s->x[i]) : 0.0;
        if (hit == s->nfree || length < step) {
            step = length;
            hit = i;
        }
    }
    for (size_t i = 0; i < s->nfree; i++)
        x[s->free_index[i]] += step * (s->x[i] - x[s->free_index[i]]);
    if (hit == s->nfree)
        return 0;
    x[s->free_index[hit]] = 0.0;
    at_bound[s->free_index[hit]] = 1;
    return 1;
}

/* The held unknown that would gain most by being let go, n when none would. */
static size_t to_free(const double *a, const double *b, const double *x, size_t n, const int *at_bound)
{
    size_t best = n;
    double most = 0.0;
    for (size_t i = 0; i < n; i++) {
        if (!at_bound[i])
            continue;
        double gradient = b[i], size = fabs(b[i]);
        for (size_t j = 0; j < n; j++) {
            gradient -= a[i * n + j] * x[j];
            size += fabs(a[i * n + j] * x[j]);
        }
        const double gain = gradient / sqrt(a[i * n + i]);
        if (gradient > 1e-12 * size && gain > most) {
            most = gain;
            best = i;
        }
    }
    return best;
}

static void unpack_covariance(const active_set *s, size_t n, double *covariance)
{
    memset(covariance, 0, n * n * sizeof *covariance);
    for (size_t i = 0; i < s->nfree; i++)
        for (size_t j = 0; j < s->nfree; j++)
            covariance[s->free_index[i] * n + s->free_index[j]] = s->covariance[i * s->nfree + j];
}

rx_status rx_normal_nonnegative(const rx_normal_bounded *equations, double *x, double *covariance,
                                int *at_bound, int *singular, rx_error *err)
{
    const double *a = equations->a, *b = equations->b;
    const int *bounded = equations->bounded;
    const size_t n = equations->n;
    rx_status status = RX_OK;
    active_set s = {.a = rx_alloc(n * n, sizeof(double)),
                    .covariance = rx_alloc(n * n, sizeof(double)),
                    .b = RX_NEW(double, n),
                    .x = RX_NEW(double, n),
                    .free_index = RX_NEW(size_t, n)};
    *singular = 0;
    if (s.a == NULL || s.covariance == NULL || s.b == NULL || s.x == NULL || s.free_index == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 2 * n * n * sizeof(double)));
    for (size_t i = 0; i < n; i++) {
        x[i] = 0.0;
        at_bound[i] = bounded == NULL || bounded[i];
    }
    /* each round ends in another set of free unknowns with a lower minimum; the limit is for rounding */
    for (size_t round = 0; round < 3 * n + 1; round++) {
        do {
            pack(a, b, n, at_bound, &s);
            int weak = 0;
            if (s.nfree > 0)
                status = rx_normal_solve(s.a, s.b, s.nfree, s.x, s.covariance, &weak, err);
            if (status != RX_OK)
                goto exit;
            *singular |= weak;
        } while (walk(&s, bounded, x, at_bound));
        const size_t next = to_free(a, b, x, n, at_bound);
        if (next == n)
            break;
        at_bound[next] = 0;
    }
    if (covariance != NULL)
        unpack_covariance(&s, n, covariance);
exit:
    free(s.a);
    free(s.covariance);
    free(s.b);
    free(s.x);
    free(s.free_index);
    return status;
}

int rx_cholesky(double *a, int n, int stride)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = a[i * stride + j];
            for (int k = 0; k < j; k++)
                sum -= a[i * stride + k] * a[j * stride + k];
            if (i == j && !(sum > 0.0))
                return 0;
            a[i * stride + j] = i == j ? sqrt(sum) : sum / a[j * stride + j];
        }
    return 1;
}

void rx_cholesky_solve(const double *factor, int n, int stride, double *b)
{
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < i; k++)
            b[i] -= factor[i * stride + k] * b[k];
        b[i] /= factor[i * stride + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            b[i] -= factor[k * stride + i] * b[k];
        b[i] /= factor[i * stride + i];
    }
}
