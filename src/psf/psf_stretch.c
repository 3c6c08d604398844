/* Which candidates are stars, and how their size and ellipse vary over the tile: one mixture.
 *
 * A star's stretch a_q (psf_profile.h) is normally distributed about the polynomial t . c_q, t the Legendre terms of its place, with the
 * variance of its pixels and one that stars share; its ln chi2 about a mean, those below it count as at it. A galaxy or a blend is
 * wider by an excess that is normally distributed and above 0, its ellipse and ln chi2 are as a star's with other variances. Of hits
 * and of what is masked in part they are anything that can be measured, evenly. Coefficients of degree d are N(0, tau_d^2). Kinds,
 * coefficients and variances follow from each other (EM, mean field); the degree is the one of the largest evidence (the lower bound
 * of that), and what other degrees would say, by their evidence, is part of the errors, also of those that a user does not allow. */
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
    STEPS = 9
};
static const double MOST = 0.6; /* of a stretch that can be measured */
static const double SPAN = 7.0; /* of ln chi2 of what is no star: e^7 is what pixels of full wells allow */
/* 1 sigma by which stretches of stars differ beyond their noise and the polynomial: it is tried from the first value down, each a share of
 * the one before. */
static const double APART = 0.3, CLOSER = 0.5;
/* Of a galaxy, relative: how much wider it is, and how much that and its ellipse differ (1 sigma), where the tile has none to say it; how
 * many galaxies that counts for: with one, those of a tile may be as alike as stars of a bad corner are, with four, seven stars among 73
 * galaxies of 1.25 to 1.35 times their width are taken for what is no star. */
static const double WIDER = 0.3, GALAXIES = 2.0;

/* ---- single stars ---- */

typedef struct star {
    double value[SAID], variance[SAID], terms[RX_PSF_TERMS];
    double chance[3]; /* of the kinds */
    double varies; /* square of what the polynomials say to vary there, of all three numbers */
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

enum { STAR, GALAXY, OTHER, KINDS, CELLS = RX_PSF_CELLS * RX_PSF_CELLS };

/* One kind of candidates: variances beyond those of pixels and stars, by what is measured, and the means of ln chi2 and of the excess of
 * size. */
typedef struct kind {
    double share, variance[SAID], level, excess;
} kind;

typedef struct mixture {
    star *list;
    int n, degree, nterms;
    double c[RX_PSF_STRETCH][RX_PSF_TERMS],
        *factor[RX_PSF_STRETCH];       /* factor [nterms][nterms] of the precision of c */
    double tau2[2][RX_PSF_DEGREE + 1]; /* variance of coefficients of size and of ellipse by degree */
    kind kinds[KINDS];
    double shared; /* variance of stretches that stars share */
    double missed; /* variance that the polynomial misses, as a share of the square of what it says to vary */
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
            const double w = s->known && s->fitted
                                 ? s->chance[STAR] / (s->variance[q] + m->shared + m->missed * s->varies)
                                 : 0.0;
            for (int k = 0; k < n && w > 0.0; k++) {
                c[k] += w * s->terms[k] * s->value[q];
                for (int l = 0; l <= k; l++)
                    a[k * n + l] += w * s->terms[k] * s->terms[l];
            }
        }
        for (int k = 0; k < n; k++)
            a[k * n + k] += 1.0 / m->tau2[q > 0][degree_of(k)];
        if (!rx_cholesky(a, n, n))
            return 0;
        rx_cholesky_solve(a, n, n, c);
    }
    return 1;
}

/* Square of what the polynomials say to vary at a place. */
static double varies(const mixture *m, const double *terms)
{
    double sum = 0.0;
    for (int q = 0; q < RX_PSF_STRETCH; q++)
        sum += pow(polynomial(terms, m->c[q], m->nterms) - m->c[q][0], 2.0);
    return sum;
}

/* Variances of coefficients by degree; returns what the evidence loses by these: the divergence of the posterior from the prior. */
static double learn_prior(mixture *m)
{
    const int n = m->nterms;
    double loss = 0.0, sum[2][RX_PSF_DEGREE + 1] = {{0.0}}, known[2][RX_PSF_DEGREE + 1] = {{0.0}};
    for (int q = 0; q < RX_PSF_STRETCH; q++)
        for (int k = 0; k < n; k++) {
            double unit[RX_PSF_TERMS] = {0.0};
            unit[k] = 1.0;
            const int d = degree_of(k);
            const double tau2 = m->tau2[q > 0][d], variance = spread(m, q, unit),
                         square = m->c[q][k] * m->c[q][k];
            sum[q > 0][d] += square;
            known[q > 0][d] += 1.0 - variance / tau2;
            loss += 0.5 * ((square + variance) / tau2 - 1.0 + log(tau2)) + log(m->factor[q][k * n + k]);
        }
    for (int of = 0; of < 2; of++)
        for (int d = 1; d <= m->degree; d++) /* MacKay 1992, Neural Computation 4, 415 */
            m->tau2[of][d] = fmin(fmax(sum[of][d] / fmax(known[of][d], 1e-3), 1e-8), 1.0);
    return loss;
}

/* ln of the normal distribution, but for what all kinds have. */
static double ln_normal(double square, double variance)
{
    return -0.5 * (square / variance + log(2.0 * M_PI * variance));
}

/* What a kind says of a candidate that is off the polynomial by those: ln of its density, times its share. noise: variances without the
 * kind's; variance: of the polynomial. off: squares of what is off, of the size of a galaxy from the mean of its excess. */
static double ln_density(const kind *k, const star *s, const double away[RX_PSF_STRETCH],
                         const double noise[RX_PSF_STRETCH], const double variance[RX_PSF_STRETCH],
                         double off[SAID])
{
    double sum = log(k->share);
    for (int q = 0; q < RX_PSF_STRETCH; q++) {
        const double excess = q == 0 ? k->excess : 0.0, v = k->variance[q], all = noise[q] + v,
                     d = away[q] - excess;
        off[q] = d * d + variance[q];
        sum += ln_normal(off[q], all);
        if (excess > 0.0) { /* above 0: as expected, and as the noise leaves it */
            const double mean = excess + d * v / all, error = sqrt(2.0 * v * noise[q] / all);
            sum += log((erfc(-mean / error) + 1e-30) / erfc(-excess / sqrt(2.0 * v)));
        }
    }
    const double above = fmax(s->value[CHI2] - k->level, 0.0);
    off[CHI2] = above * above;
    return sum + ln_normal(off[CHI2], k->variance[CHI2]);
}

/* Kinds of the candidates, and what each kind shares; the evidence. */
static void learn_kinds(mixture *m)
{
    kind next[KINDS] = {{.share = 0.0}};
    m->evidence = -learn_prior(m) - m->degree; /* each degree is e times rarer than the one below */
    double all = 0.0, missed[2] = {0.0};
    for (int i = 0; i < m->n; i++) {
        star *s = &m->list[i];
        double off[KINDS][SAID] = {{0.0}}, ln[KINDS], most, together = 0.0, away[RX_PSF_STRETCH],
               variance[RX_PSF_STRETCH], noise[RX_PSF_STRETCH];
        memset(s->chance, 0, sizeof s->chance);
        if (!s->known)
            continue;
        s->varies = varies(m, s->terms);
        for (int q = 0; q < RX_PSF_STRETCH; q++) {
            away[q] = s->value[q] - polynomial(s->terms, m->c[q], m->nterms);
            variance[q] = spread(m, q, s->terms);
            noise[q] = s->variance[q] + m->shared + m->missed * s->varies;
        }
        most = ln[OTHER] = log(m->kinds[OTHER].share) - RX_PSF_STRETCH * log(2.0 * MOST) - log(SPAN);
        for (int k = 0; k < OTHER; k++) {
            ln[k] = ln_density(&m->kinds[k], s, away, noise, variance, off[k]);
            most = fmax(most, ln[k]);
        }
        for (int k = 0; k < KINDS; k++)
            together += exp(ln[k] - most);
        for (int k = 0; k < KINDS; k++)
            s->chance[k] = exp(ln[k] - most) / together;
        if (!s->fitted)
            continue;
        m->evidence += most + log(together);
        all += 1.0;
        for (int q = 0; q < RX_PSF_STRETCH; q++) {
            const double w = s->chance[STAR] * s->varies / (noise[q] * noise[q]);
            missed[0] += w * (off[STAR][q] - s->variance[q] - m->shared);
            missed[1] += w * s->varies;
        }
        for (int k = 0; k < KINDS; k++) {
            const double p = s->chance[k];
            next[k].share += p;
            next[k].level += p * s->value[CHI2];
            next[k].excess += p * away[0];
            for (int q = 0; q < SAID; q++) /* what the pixels do not explain */
                next[k].variance[q] += p * (q < RX_PSF_STRETCH ? off[k][q] - noise[q] : 2.0 * off[k][q]);
        }
    }
    m->missed = fmax(missed[0] / (missed[1] + 1e-30), 0.0);
    for (int k = 0; k < KINDS; k++) {
        kind *of = &m->kinds[k];
        const double sum = next[k].share;
        of->share = (sum + 1.0) / (all + KINDS);
        if (k == OTHER)
            break;
        /* one more, of ln chi2 0 +- 0.3 */
        of->level = next[k].level / (sum + 1.0);
        of->variance[CHI2] = (next[k].variance[CHI2] + 0.1) / (sum + 1.0);
        if (k == GALAXY) {
            const double all_of = sum + GALAXIES, wide = GALAXIES * WIDER * WIDER;
            of->excess = fmax((next[k].excess + GALAXIES * WIDER) / all_of, 0.0);
            of->variance[0] = fmax((next[k].variance[0] + wide) / all_of, 1e-4);
            of->variance[1] = of->variance[2] =
                fmax((0.5 * (next[k].variance[1] + next[k].variance[2]) + wide) / all_of, 1e-4);
        }
    }
}

enum { STATES = (RX_PSF_DEGREE + 2) * STEPS };

/* What was tried: of each degree and each width that stars share. */
typedef struct trials {
    int n, highest; /* degree that is allowed */
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
        t->variance[t->n][cell] = spread(m, 0, terms) + m->missed * varies(m, terms);
    }
    t->n++;
    if (!(m->evidence > t->most) || m->degree > t->highest)
        return;
    t->most = m->evidence;
    *best = (rx_psf_variation){.degree = m->degree, .nterms = m->nterms, .shared = sqrt(m->shared)};
    memcpy(best->c, m->c, sizeof best->c);
    for (int i = 0; i < m->n; i++)
        t->member[i] = m->list[i].chance[STAR];
}

/* One degree, from the largest width that stars may share down: a bad corner is one of stars at first. EM finds what is near its start:
 * all candidates are stars, or (sharp) those that galaxies outnumber, and that are narrower than most. */
static void try_degree(mixture *m, int degree, int sharp, const rx_psf_model *model, trials *t, rx_psf_variation *best)
{
    m->degree = degree;
    m->nterms = (degree + 1) * (degree + 2) / 2;
    for (int k = 0; k < KINDS; k++) {
        const double wide = k == GALAXY ? WIDER * WIDER : 0.0;
        m->kinds[k] = (kind){.share = k == STAR ? 0.8 : 0.1,
                             .variance = {wide, wide, wide, 1.0},
                             .excess = k == GALAXY ? WIDER : 0.0};
    }
    double mean = 0.0, all = 0.0;
    for (int i = 0; i < m->n && sharp; i++)
        if (m->list[i].known) {
            mean += m->list[i].value[0];
            all += 1.0;
        }
    for (int i = 0; i < m->n; i++) {
        m->list[i].varies = 0.0;
        m->list[i].chance[STAR] = !sharp || m->list[i].value[0] < mean / all - WIDER / 3.0;
    }
    for (int step = sharp ? 3 : 0; step < STEPS; step++) {
        m->shared = pow(APART * pow(CLOSER, step), 2.0);
        m->missed = APART * APART;
        for (int d = 0; d <= degree; d++)
            m->tau2[0][d] = m->tau2[1][d] = d == 0 ? 1.0 : APART * APART / (d * d);
        for (int round = 0; round < ROUNDS; round++) {
            if (!solve(m))
                return;
            learn_kinds(m);
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
    t->highest = highest;
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
    try_degree(&m, 0, 0, &model, t, &best);
    const double all_are = t->most;
    try_degree(&m, 0, 1, &model, t, &best);
    const int sharp = t->most > all_are;
    for (int d = 1; d <= RX_PSF_DEGREE; d++)
        try_degree(&m, d, sharp, &model, t, &best);
    for (int i = 0; i < m.n; i++) {
        rx_psf_point *p = &job->points[stars[i]];
        p->member = t->member[i];
        p->kept = list[i].known && p->member > 0.5;
        n += p->kept;
    }
    rx_log_detail(log, "PSF_TYPE AUTO: degree %d, %d of %d candidates are stars, which differ by %.4f",
                  best.degree, n, m.n, best.shared);
    for (int cell = 0; cell < CELLS && t->n > 0; cell++) {
        double sum = 0.0, square = 0.0, at = 0.0, most = t->most;
        for (int k = 0; k < t->n; k++) {
            at = t->evidence[k] == t->most ? t->size[k][cell] : at;
            most = fmax(most, t->evidence[k]);
        }
        for (int k = 0; k < t->n; k++) {
            const double chance = exp(t->evidence[k] - most), off = t->size[k][cell] - at;
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
