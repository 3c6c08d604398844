/* Correlation of PSF residuals. */
#include "quality/rho.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"

static const double FIRST = 0.25; /* arcmin; each bin is twice as wide as the one before */

double rx_rho_edge(int k)
{
    return FIRST * pow(2.0, k);
}

static int bin_of(double arcmin)
{
    return arcmin >= FIRST && arcmin < rx_rho_edge(RX_RHO_BINS) ? (int)floor(log2(arcmin / FIRST)) : -1;
}

/* deg, by haversines. */
static double angle(double alpha1, double delta1, double alpha2, double delta2)
{
    const double deg = M_PI / 180.0, a = sin(0.5 * deg * (alpha2 - alpha1)),
                 d = sin(0.5 * deg * (delta2 - delta1));
    return 2.0 / deg * asin(fmin(1.0, sqrt(d * d + cos(deg * delta1) * cos(deg * delta2) * a * a)));
}

int rx_rho_units(double residual)
{
    return (int)lround(fmin(fmax(residual, -0.5), 0.5) / RX_RHO_UNIT);
}

void rx_rho_of(int n, const rx_rho_star *stars, rx_rho *dst)
{
    *dst = (rx_rho){.n = n, .alpha = dst->alpha, .delta = dst->delta};
    for (int i = 0; i < n; i++) {
        const rx_rho_star *a = &stars[i];
        dst->t += a->t;
        dst->e1 += a->e1;
        dst->e2 += a->e2;
        dst->reach = fmax(dst->reach, angle(a->alpha, a->delta, dst->alpha, dst->delta));
        for (int j = 0; j < i; j++) {
            const rx_rho_star *b = &stars[j];
            const int k = bin_of(60.0 * angle(a->alpha, a->delta, b->alpha, b->delta));
            if (k < 0)
                continue;
            dst->pairs[k]++;
            dst->tt[k] += (long)a->t * b->t;
            dst->ee[k] += (long)a->e1 * b->e1 + (long)a->e2 * b->e2;
        }
    }
}

/* Sums over images, or pairs of images, of counts n and of products p: 0 n, 1 nn, 2 p, 3 pp, 4 pn; p of T and of e. */
typedef struct sums {
    long images;
    double n, nn, p[2], pp[2], pn[2];
} sums;

static void add(sums *dst, double n, double tt, double ee)
{
    const double p[2] = {tt, ee};
    if (n == 0.0)
        return;
    dst->images++;
    dst->n += n;
    dst->nn += n * n;
    for (int q = 0; q < 2; q++) {
        dst->p[q] += p[q];
        dst->pp[q] += p[q] * p[q];
        dst->pn[q] += p[q] * n;
    }
}

/* An image with the direction of its centre. */
typedef struct placed {
    const rx_rho *image;
    double at[3];
} placed;

/* By declination; of one centre by all that is summed. */
static int by_delta(const void *left, const void *right)
{
    const rx_rho *a = ((const placed *)left)->image, *b = ((const placed *)right)->image;
    if (a->delta != b->delta)
        return a->delta > b->delta ? 1 : -1;
    if (a->alpha != b->alpha)
        return a->alpha > b->alpha ? 1 : -1;
    return memcmp(a, b, sizeof *a);
}

rx_status rx_rho_all(int n, const rx_rho *const *images, rx_rho_bin dst[RX_RHO_BINS], rx_error *err)
{
    const double unit = RX_RHO_UNIT * RX_RHO_UNIT, most = rx_rho_edge(RX_RHO_BINS) / 60.0, deg = M_PI / 180.0;
    const double farthest = cos(deg * most) - 1e-12; /* of directions, beyond the last bin */
    sums all[RX_RHO_BINS];
    rx_status status = RX_OK;
    placed *sorted;
    RX_TRY(RX_MAKE(sorted, (size_t)n, err));
    for (int i = 0; i < n; i++) {
        const double alpha = deg * images[i]->alpha, delta = deg * images[i]->delta;
        sorted[i] = (placed){images[i], {cos(delta) * cos(alpha), cos(delta) * sin(alpha), sin(delta)}};
    }
    qsort(sorted, (size_t)n, sizeof *sorted, by_delta);
    memset(all, 0, sizeof all);
    for (int i = 0; i < n && status == RX_OK; i++) {
        const rx_rho *a = sorted[i].image;
        for (int k = 0; k < RX_RHO_BINS; k++)
            add(&all[k], (double)a->pairs[k], (double)a->tt[k], (double)a->ee[k]);
        for (int j = i - 1; j >= 0 && a->delta - sorted[j].image->delta < most; j--) {
            const rx_rho *b = sorted[j].image;
            const double *u = sorted[i].at, *v = sorted[j].at;
            if (u[0] * v[0] + u[1] * v[1] + u[2] * v[2] < farthest)
                continue;
            const double apart = angle(a->alpha, a->delta, b->alpha, b->delta);
            const int k = apart > a->reach + b->reach ? bin_of(60.0 * apart) : -1;
            if (k >= 0)
                add(&all[k], (double)a->n * (double)b->n, (double)a->t * (double)b->t,
                    (double)a->e1 * (double)b->e1 + (double)a->e2 * (double)b->e2);
        }
        status = rx_interrupt_check(err);
    }
    free(sorted);
    for (int k = 0; k < RX_RHO_BINS; k++) {
        const sums *s = &all[k];
        double mean[2], error[2];
        for (int q = 0; q < 2; q++) { /* the error of a ratio of sums: Cochran, Sampling Techniques, 2.11 */
            mean[q] = s->n > 0.0 ? s->p[q] / s->n : NAN;
            const double square = s->pp[q] - 2.0 * mean[q] * s->pn[q] + mean[q] * mean[q] * s->nn;
            error[q] = s->images > 1
                           ? sqrt(fmax(square, 0.0) * (double)s->images / (double)(s->images - 1)) / s->n
                           : NAN;
        }
        dst[k] = (rx_rho_bin){s->n, mean[0] * unit, error[0] * unit, mean[1] * unit, error[1] * unit};
    }
    return status;
}
