/* Which candidates are stars, and how their size and ellipse vary over the tile: one mixture.
 *
 * A star's stretch a_q (psf_profile.h) is normally distributed about the polynomial t . c_q, t the Legendre terms of its place, with the
 * variance of its pixels and one that stars share; its ln chi2 about a mean. Of galaxies, blends and hits they are anything that can be
 * measured, evenly. Coefficients of degree d are N(0, tau_d^2). Members, coefficients and the variances follow from each other (EM,
 * mean field); the degree is the one of the largest evidence (the lower bound of that), and what other degrees would say, by their
 * evidence, is part of the errors. */
#include "psf/psf_stretch.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/normal.h"
#include "num/stats.h"

enum {
    UNKNOWNS = RX_PSF_STRETCH + 3,
    CHI2 = RX_PSF_STRETCH,
    SAID = RX_PSF_STRETCH + 1,
    ROUNDS = 3,
    STEPS = 16
};
static const double MOST = 0.6; /* of a stretch that can be measured */
static const double SPAN = 7.0; /* of ln chi2 of what is no star: e^7 is what pixels of full wells allow */
/* 1 sigma by which stretches of stars differ beyond their noise and the polynomial: it is tried from the first value down, each a share of
 * the one before. */
static const double APART = 0.3, CLOSER = 0.7;

/* ---- single stars ---- */

typedef struct star {
    double value[SAID], variance[SAID], terms[RX_PSF_TERMS];
    double member; /* probability that it is a star */
    int known, fitted;
} star;

/* Flux, place and stretch of a star by Gauss and Newton's steps, on the pixels within two FWHM. */
static void measure(const rx_psf_job *job, const rx_psf_point *p, star *dst)
{
    const rx_psf_model *model = &job->model;
    const int half = model->half, n = 2 * half + 1, reach = (int)fmin(half, ceil(2.0 * job->fwhm)),
              m = model->m;
    double flux = p->flux, dx = p->x - lround(p->x), dy = p->y - lround(p->y), a[RX_PSF_STRETCH] = {0};
    double normal[UNKNOWNS * UNKNOWNS], b[UNKNOWNS], chi2 = 0.0;
    int count = 0;
    dst->known = 0;
    for (int step = 0; step < 4; step++) {
        memset(normal, 0, sizeof normal);
        memset(b, 0, sizeof b);
        chi2 = count = 0;
        for (int j = -reach; j <= reach; j++)
            for (int i = -reach; i <= reach; i++) {
                const size_t k = (size_t)(j + half) * (size_t)n + (size_t)(i + half);
                if (i * i + j * j > reach * reach || !(p->weight[k] > 0.0F))
                    continue;
                const double w = (double)p->weight[k], x = (i - dx) * m, y = (j - dy) * m;
                double g[UNKNOWNS], by[2 + RX_PSF_STRETCH];
                g[0] = rx_psf_stretched(job->prior, model->side, x, y, a, by);
                for (int u = 1; u < UNKNOWNS; u++)
                    g[u] = flux * by[u - 1] * (u < 3 ? -m : 1);
                const double off = (double)p->data[k] - flux * g[0];
                chi2 += w * off * off;
                count++;
                for (int u = 0; u < UNKNOWNS; u++) {
                    b[u] += w * off * g[u];
                    for (int v = 0; v <= u; v++)
                        normal[u * UNKNOWNS + v] += w * g[u] * g[v];
                }
            }
        if (!rx_cholesky(normal, UNKNOWNS, UNKNOWNS))
            return;
        rx_cholesky_solve(normal, UNKNOWNS, UNKNOWNS, b);
        flux = fmax(flux + b[0], 0.5 * flux);
        dx += fmax(fmin(b[1], 0.3), -0.3);
        dy += fmax(fmin(b[2], 0.3), -0.3);
        for (int q = 0; q < RX_PSF_STRETCH; q++)
            a[q] = fmax(fmin(a[q] + b[3 + q], MOST), -MOST);
    }
    for (int q = 0; q < RX_PSF_STRETCH; q++) {
        double unit[UNKNOWNS] = {0};
        unit[3 + q] = 1.0;
        rx_cholesky_solve(normal, UNKNOWNS, UNKNOWNS, unit);
        dst->value[q] = a[q];
        dst->variance[q] = unit[3 + q];
    }
    dst->value[CHI2] = log(chi2 / fmax(count - UNKNOWNS, 1.0) + 0.1);
    dst->known = fabs(a[0]) < MOST && fabs(a[1]) < MOST && fabs(a[2]) < MOST;
}

/* ---- the tile ---- */

typedef struct mixture {
    star *list;
    int n, degree, nterms;
    double c[RX_PSF_STRETCH][RX_PSF_TERMS],
        *factor[RX_PSF_STRETCH];    /* factor [nterms][nterms] of the precision of c */
    double tau2[RX_PSF_DEGREE + 1]; /* variance of coefficients by degree */
    double shared[SAID], level,
        share; /* variances, those of stretches alike; mean ln chi2; of candidates that are stars */
    double evidence;
} mixture;

static int degree_of(int term)
{
    return (int)((sqrt(8.0 * term + 1.0) - 1.0) / 2.0);
}

static double polynomial(const double *terms, const double *c, int nterms)
{
    double sum = 0.0;
    for (int k = 0; k < nterms; k++)
        sum += c[k] * terms[k];
    return sum;
}

/* Variance of the polynomial q at a place. */
static double spread(const mixture *m, int q, const double *terms)
{
    double x[RX_PSF_TERMS], sum = 0.0;
    for (int i = 0; i < m->nterms; i++) { /* L x = terms */
        x[i] = terms[i];
        for (int k = 0; k < i; k++)
            x[i] -= m->factor[q][i * m->nterms + k] * x[k];
        x[i] /= m->factor[q][i * m->nterms + i];
        sum += x[i] * x[i];
    }
    return sum;
}

/* Coefficients from the members; 0: they do not follow. */
static int solve(mixture *m)
{
    const int n = m->nterms;
    for (int q = 0; q < RX_PSF_STRETCH; q++) {
        double *a = m->factor[q], *c = m->c[q];
        memset(a, 0, sizeof(double) * (size_t)n * (size_t)n);
        memset(c, 0, sizeof m->c[q]);
        for (int i = 0; i < m->n; i++) {
            const star *s = &m->list[i];
            const double w = s->known && s->fitted ? s->member / (s->variance[q] + m->shared[q]) : 0.0;
            for (int k = 0; k < n && w > 0.0; k++) {
                c[k] += w * s->terms[k] * s->value[q];
                for (int l = 0; l <= k; l++)
                    a[k * n + l] += w * s->terms[k] * s->terms[l];
            }
        }
        for (int k = 0; k < n; k++)
            a[k * n + k] += 1.0 / m->tau2[degree_of(k)];
        if (!rx_cholesky(a, n, n))
            return 0;
        rx_cholesky_solve(a, n, n, c);
    }
    return 1;
}

/* Variances of coefficients by degree; returns what the evidence loses by these: the divergence of the posterior from the prior. */
static double learn_prior(mixture *m)
{
    const int n = m->nterms;
    double loss = 0.0, sum[RX_PSF_DEGREE + 1] = {0.0}, known[RX_PSF_DEGREE + 1] = {0.0};
    for (int q = 0; q < RX_PSF_STRETCH; q++)
        for (int k = 0; k < n; k++) {
            double unit[RX_PSF_TERMS] = {0.0};
            unit[k] = 1.0;
            const int d = degree_of(k);
            const double variance = spread(m, q, unit), square = m->c[q][k] * m->c[q][k];
            sum[d] += square;
            known[d] += 1.0 - variance / m->tau2[d];
            loss += 0.5 * ((square + variance) / m->tau2[d] - 1.0 + log(m->tau2[d])) +
                    log(m->factor[q][k * n + k]);
        }
    for (int d = 1; d <= m->degree; d++) /* MacKay 1992, Neural Computation 4, 415 */
        m->tau2[d] = fmin(fmax(sum[d] / fmax(known[d], 1e-3), 1e-8), 1.0);
    return loss;
}

/* Members, and what they share; the evidence. */
static void learn_members(mixture *m)
{
    const double other = -RX_PSF_STRETCH * log(2.0 * MOST) - log(SPAN), loss = learn_prior(m);
    double sum = 0.0, level = 0.0, members = 0.0, all = 0.0;
    m->evidence = -loss - m->degree; /* each degree is e times rarer than the one below */
    for (int i = 0; i < m->n; i++) {
        star *s = &m->list[i];
        double of_star = 0.0, square[SAID];
        s->member = 0.0;
        if (!s->known)
            continue;
        for (int q = 0; q < SAID; q++) {
            const double off =
                             s->value[q] - (q == CHI2 ? m->level : polynomial(s->terms, m->c[q], m->nterms)),
                         variance = s->variance[q] + m->shared[q];
            square[q] = q == CHI2 ? (off > 0.0 ? off * off : 0.0) : off * off + spread(m, q, s->terms);
            of_star -= 0.5 * (square[q] / variance + log(2.0 * M_PI * variance));
        }
        const double a = log(m->share) + of_star, b = log(1.0 - m->share) + other, most = fmax(a, b),
                     together = most + log(exp(a - most) + exp(b - most));
        s->member = exp(a - together);
        if (!s->fitted)
            continue;
        m->evidence += together;
        all += 1.0;
        members += s->member;
        level += s->member * s->value[CHI2];
        sum += s->member * square[CHI2];
    }
    if (!(members > 0.0))
        return;
    m->share = fmin(fmax(members / all, 0.01), 0.99);
    m->level = level / members;
    m->shared[CHI2] = fmax(2.0 * sum / members, 0.01); /* half of the stars are above the mean */
}

enum { CELLS = RX_PSF_CELLS * RX_PSF_CELLS, STATES = (RX_PSF_DEGREE + 1) * STEPS };

/* What was tried: of each degree and each width that stars share. */
typedef struct trials {
    int n;
    double evidence[STATES], most, size[STATES][CELLS], variance[STATES][CELLS]; /* of s in cells */
    double *member;                                                              /* [stars] of the best one */
} trials;

static void keep(const mixture *m, const rx_psf_model *model, trials *t, rx_psf_variation *best)
{
    double terms[RX_PSF_TERMS];
    t->evidence[t->n] = m->evidence;
    for (int cell = 0; cell < CELLS; cell++) {
        rx_psf_model_terms(
            model, model->x0 + (2.0 * (cell % RX_PSF_CELLS) / (RX_PSF_CELLS - 1) - 1.0) * model->xs,
            model->y0 + (2.0 * (cell / RX_PSF_CELLS) / (RX_PSF_CELLS - 1) - 1.0) * model->ys, terms);
        t->size[t->n][cell] = polynomial(terms, m->c[0], m->nterms);
        t->variance[t->n][cell] = spread(m, 0, terms);
    }
    t->n++;
    if (!(m->evidence > t->most))
        return;
    t->most = m->evidence;
    *best = (rx_psf_variation){.degree = m->degree, .nterms = m->nterms, .shared = sqrt(m->shared[0])};
    memcpy(best->c, m->c, sizeof best->c);
    for (int i = 0; i < m->n; i++)
        t->member[i] = m->list[i].member;
}

/* One degree, from the largest width that stars may share down: a bad corner is one of stars at first. */
static void try_degree(mixture *m, int degree, const rx_psf_model *model, trials *t, rx_psf_variation *best)
{
    m->degree = degree;
    m->nterms = (degree + 1) * (degree + 2) / 2;
    m->level = 0.0;
    m->share = 0.9;
    m->shared[CHI2] = 1.0;
    for (int i = 0; i < m->n; i++)
        m->list[i].member = 1.0;
    for (int step = 0; step < STEPS; step++) {
        for (int q = 0; q < RX_PSF_STRETCH; q++)
            m->shared[q] = pow(APART * pow(CLOSER, step), 2.0);
        for (int d = 0; d <= degree; d++)
            m->tau2[d] = d == 0 ? 1.0 : APART * APART / (d * d);
        for (int round = 0; round < ROUNDS; round++) {
            if (!solve(m))
                return;
            learn_members(m);
        }
        keep(m, model, t, best);
    }
}

rx_status rx_psf_vary(rx_psf_job *job, int highest, rx_log *log, rx_error *err)
{
    rx_psf_variation best = {.nterms = 1};
    rx_psf_model model = job->model;
    mixture m = {.n = 0};
    trials *t = RX_NEW(trials, 1);
    int *stars = RX_NEW(int, (size_t)job->n + 1), n = 0;
    star *list = m.list = RX_NEW(star, (size_t)job->n + 1);
    double *room = RX_NEW(double, RX_PSF_STRETCH *RX_PSF_TERMS *RX_PSF_TERMS + (size_t)job->n);
    rx_status status = RX_OK;
    if (t == NULL || stars == NULL || list == NULL || room == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)job->n * sizeof *list));
    for (int q = 0; q < RX_PSF_STRETCH; q++)
        m.factor[q] = room + (size_t)q * RX_PSF_TERMS * RX_PSF_TERMS;
    t->member = room + (size_t)RX_PSF_STRETCH * RX_PSF_TERMS * RX_PSF_TERMS;
    t->most = -HUGE_VAL;
    model.degree = RX_PSF_DEGREE;
    model.nterms = RX_PSF_TERMS;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].star)
            stars[m.n++] = i;
#pragma omp parallel for schedule(dynamic, 4) num_threads(job->nthreads)
    for (int i = 0; i < m.n; i++) {
        const rx_psf_point *p = &job->points[stars[i]];
        rx_psf_model_terms(&model, p->x, p->y, list[i].terms);
        list[i].fitted = !p->reserved;
        if (p->chi2 < HUGE_VAL)
            measure(job, p, &list[i]);
    }
    for (int i = 0; i < m.n; i++)
        n += list[i].known && list[i].fitted;
    for (int d = 0; d <= highest && (d + 1) * (d + 2) / 2 <= n; d++) {
        const int before = t->n;
        double most = -HUGE_VAL;
        try_degree(&m, d, &model, t, &best);
        for (int k = before; k < t->n; k++)
            most = fmax(most, t->evidence[k]);
        rx_log_detail(log, "PSF_TYPE AUTO: degree %d: ln evidence %.1f", d, most);
    }
    n = 0;
    for (int i = 0; i < m.n; i++) {
        rx_psf_point *p = &job->points[stars[i]];
        p->member = t->member[i];
        p->kept = list[i].known && p->member > 0.5;
        n += p->kept;
    }
    rx_log_detail(log, "PSF_TYPE AUTO: degree %d, %d of %d candidates are stars, which differ by %.4f",
                  best.degree, n, m.n, best.shared);
    for (int cell = 0; cell < CELLS && t->n > 0; cell++) {
        double sum = 0.0, square = 0.0, at = 0.0;
        for (int k = 0; k < t->n; k++)
            at = t->evidence[k] == t->most ? t->size[k][cell] : at;
        for (int k = 0; k < t->n; k++) {
            const double chance = exp(t->evidence[k] - t->most), off = t->size[k][cell] - at;
            sum += chance;
            square += chance * (t->variance[k][cell] + off * off);
        }
        best.error[cell / RX_PSF_CELLS][cell % RX_PSF_CELLS] = sqrt(square / sum);
    }
    job->variation = best;
exit:
    free(t);
    free(stars);
    free(list);
    free(room);
    return status;
}
