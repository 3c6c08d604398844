/* Correlation of PSF residuals. */
#include "quality/rho.h"

#include <math.h>
#include <string.h>

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

void rx_rho_all(int n, const rx_rho *const *images, rx_rho_bin dst[RX_RHO_BINS])
{
    const double unit = RX_RHO_UNIT * RX_RHO_UNIT, most = rx_rho_edge(RX_RHO_BINS) / 60.0;
    sums all[RX_RHO_BINS];
    memset(all, 0, sizeof all);
    for (int i = 0; i < n; i++) {
        const rx_rho *a = images[i];
        for (int k = 0; k < RX_RHO_BINS; k++)
            add(&all[k], (double)a->pairs[k], (double)a->tt[k], (double)a->ee[k]);
        for (int j = 0; j < i; j++) {
            const rx_rho *b = images[j];
            if (fabs(a->delta - b->delta) >= most)
                continue;
            const double apart = angle(a->alpha, a->delta, b->alpha, b->delta);
            const int k = apart > a->reach + b->reach ? bin_of(60.0 * apart) : -1;
            if (k >= 0)
                add(&all[k], (double)a->n * (double)b->n, (double)a->t * (double)b->t,
                    (double)a->e1 * (double)b->e1 + (double)a->e2 * (double)b->e2);
        }
    }
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
}
