/* Stretches of single stars, and the polynomial over the tile that stars which were held out like best. */
#include "psf/psf_stretch.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "num/normal.h"
#include "num/stats.h"

enum { UNKNOWNS = RX_PSF_STRETCH + 3, FOLDS = 8, NEAR = 5 };
static const double MOST = 0.6;        /* of a stretch */
static const double OUTLIER = 3.0;     /* sigmas from which a star's weight falls */
static const double MOST_GAIN = 10.0;  /* chi2 of a star that counts for more as its logarithm only */
static const double MOST_ERROR = 0.05; /* of s, of a star that says how wrong the polynomial is */
static const double FREE = 1.0,        /* 1 sigma of coefficients */
    HELD = 0.1;                        /* of small terms, over the square of their degree */
static const uint64_t SEED = 20, FOLD = 2;

/* ---- single stars ---- */

typedef struct star {
    double value[RX_PSF_STRETCH], variance[RX_PSF_STRETCH], terms[RX_PSF_TERMS];
    int fold, known, fitted, wider;
} star;

/* Flux, place and stretch of a star by Gauss and Newton's steps, on the pixels within two FWHM. */
static void measure(const rx_psf_job *job, const rx_psf_point *p, star *dst)
{
    const rx_psf_model *model = &job->model;
    const int half = model->half, n = 2 * half + 1, reach = (int)fmin(half, ceil(2.0 * job->fwhm)),
              m = model->m;
    double flux = p->flux, dx = p->x - lround(p->x), dy = p->y - lround(p->y), a[RX_PSF_STRETCH] = {0};
    double normal[UNKNOWNS * UNKNOWNS], b[UNKNOWNS];
    dst->known = 0;
    for (int step = 0; step < 4; step++) {
        memset(normal, 0, sizeof normal);
        memset(b, 0, sizeof b);
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
    dst->known = fabs(a[0]) < MOST && fabs(a[1]) < MOST && fabs(a[2]) < MOST;
}

/* ---- the tile ---- */

typedef struct stars_of {
    star *list;
    int n;
    double prior[RX_PSF_TERMS]; /* 1 sigma of coefficients */
    double *weights;            /* [n] of outliers less than 1 */
    double *normal, *first;     /* work [TERMS][TERMS], [TERMS] */
} stars_of;

static double at_star(const star *s, const double *c, int nterms)
{
    double sum = 0.0;
    for (int k = 0; k < nterms; k++)
        sum += c[k] * s->terms[k];
    return sum;
}

/* c [nterms] of the stars outside the fold (-1: of all), which leave their factor in work; 0: they do not say. */
static int fit(const stars_of *s, int q, int nterms, int fold, double *c)
{
    memset(s->normal, 0, sizeof(double) * (size_t)nterms * (size_t)nterms);
    memset(c, 0, sizeof(double) * (size_t)nterms);
    for (int i = 0; i < s->n; i++) {
        const star *t = &s->list[i];
        const double w = t->known && t->fitted && t->fold != fold ? s->weights[i] / t->variance[q] : 0.0;
        for (int k = 0; k < nterms && w > 0.0; k++) {
            c[k] += w * t->terms[k] * t->value[q];
            for (int l = 0; l <= k; l++)
                s->normal[k * nterms + l] += w * t->terms[k] * t->terms[l];
        }
    }
    for (int k = 0; k < nterms; k++)
        s->normal[k * nterms + k] += 1.0 / (s->prior[k] * s->prior[k]);
    if (!rx_cholesky(s->normal, nterms, nterms))
        return 0;
    rx_cholesky_solve(s->normal, nterms, nterms, c);
    return 1;
}

static void set_prior(stars_of *s, int held)
{
    int px[RX_PSF_TERMS], py[RX_PSF_TERMS];
    const int n = rx_psf_model_powers(RX_PSF_DEGREE, px, py);
    for (int k = 0; k < n; k++)
        s->prior[k] = held && k > 0 ? HELD / ((px[k] + py[k]) * (px[k] + py[k])) : FREE;
}

/* Fits all three; stars far off lose weight. */
static int fit_all(const stars_of *s, int nterms, double c[RX_PSF_STRETCH][RX_PSF_TERMS])
{
    for (int i = 0; i < s->n; i++)
        s->weights[i] = 1.0;
    for (int round = 0; round < 4; round++) {
        for (int q = RX_PSF_STRETCH - 1; q >= 0; q--) /* the factor of s stays */
            if (!fit(s, q, nterms, -1, c[q]))
                return 0;
        for (int i = 0; i < s->n && round < 3; i++) {
            double worst = 0.0;
            for (int q = 0; q < RX_PSF_STRETCH; q++)
                worst = fmax(worst, fabs(s->list[i].value[q] - at_star(&s->list[i], c[q], nterms)) /
                                        sqrt(s->list[i].variance[q]));
            s->weights[i] = fmin(1.0, OUTLIER / worst);
        }
    }
    return 1;
}

/* What stars that were held out leave: chi2 [n], those far off compressed. */
static void hold_out(const stars_of *s, int nterms, double c[RX_PSF_STRETCH][RX_PSF_TERMS], double *chi2)
{
    for (int fold = 0; fold < FOLDS; fold++) {
        int known = 1;
        for (int q = 0; q < RX_PSF_STRETCH && known; q++)
            known = fit(s, q, nterms, fold, c[q]);
        for (int i = 0; i < s->n; i++) {
            const star *t = &s->list[i];
            double sum = 0.0;
            for (int q = 0; q < RX_PSF_STRETCH && t->known; q++)
                sum += pow(t->value[q] - at_star(t, c[q], nterms), 2.0) / t->variance[q];
            if (t->fold == fold)
                chi2[i] = known ? sum : HUGE_VAL;
        }
    }
}

static int by_first(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return x[0] != y[0] ? (x[0] > y[0]) - (x[0] < y[0]) : (x[1] > y[1]) - (x[1] < y[1]);
}

/* Errors of s in cells. Where most of the stars around a place, those that do not suit the others among them, differ from
 * the polynomial by more than their noise, that is as wrong as they say. work [3 n]. */
static void weigh(const rx_psf_job *job, const stars_of *s, double (*work)[2], rx_psf_variation *v)
{
    double scatter = 0.0, all = 0.0, *off = work[s->n];
    for (int i = 0; i < s->n; i++)
        if (s->list[i].known && s->list[i].fitted) {
            const double r = s->list[i].value[0] - at_star(&s->list[i], v->c[0], v->nterms);
            scatter += fmin(r * r / s->list[i].variance[0], OUTLIER * OUTLIER);
            all += 1.0;
        }
    scatter = fmax(scatter / fmax(all - v->nterms, 1.0), 1.0);
    for (int cell = 0; cell < RX_PSF_CELLS * RX_PSF_CELLS; cell++) {
        const double at[2] = {2.0 * (cell % RX_PSF_CELLS) / (RX_PSF_CELLS - 1) - 1.0,
                              2.0 * (cell / RX_PSF_CELLS) / (RX_PSF_CELLS - 1) - 1.0};
        double terms[RX_PSF_TERMS], half[RX_PSF_TERMS], variance = 0.0, square = 0.0;
        const double x = job->model.x0 + at[0] * job->model.xs, y = job->model.y0 + at[1] * job->model.ys;
        rx_psf_model model = job->model;
        model.degree = v->degree;
        model.nterms = v->nterms;
        rx_psf_model_terms(&model, x, y, terms);
        memcpy(half, terms, sizeof half);
        rx_cholesky_solve(s->normal, v->nterms, v->nterms, half);
        for (int k = 0; k < v->nterms; k++)
            variance += terms[k] * half[k];
        int n = 0, near;
        for (int i = 0; i < s->n; i++)
            if (s->list[i].known && (!s->list[i].wider || v->with_wider) &&
                s->list[i].variance[0] < MOST_ERROR * MOST_ERROR) {
                work[n][0] = hypot(s->list[i].terms[1] - at[0], s->list[i].terms[2] - at[1]);
                work[n++][1] = i;
            }
        qsort(work, (size_t)n, sizeof *work, by_first);
        for (near = 0; near < n && (near < NEAR || near < n / 30); near++) {
            const star *t = &s->list[(int)work[near][1]];
            off[near] = t->value[0] - at_star(t, v->c[0], v->nterms);
            square += t->variance[0];
        }
        double median = 0.0;
        const double sigma = near > 0 ? rx_sigma_mad(off, (size_t)near, &median) : 0.0,
                     noise = near > 0 ? 1.6 * fmax(sigma * sigma, square / near) / near : 0.0;
        v->error[cell / RX_PSF_CELLS][cell % RX_PSF_CELLS] =
            sqrt(scatter * variance + fmax(median * median - noise, 0.0));
        if (near >= NEAR && median * median > 9.0 * noise && fabs(median) > fabs(v->missed)) {
            v->missed = median;
            v->missed_at[0] = x;
            v->missed_at[1] = y;
        }
    }
}

rx_status rx_psf_vary(rx_psf_job *job, int highest, rx_log *log, rx_error *err)
{
    const int room = job->n + 1;
    stars_of s = {.n = 0};
    rx_psf_variation best = {.nterms = 1}, next = best;
    double *least = RX_NEW(double, 2 * (size_t)room), *chi2 = least + room;
    double(*work)[2] = rx_alloc(2 * (size_t)room, sizeof *work);
    int *stars = RX_NEW(int, room);
    s.list = RX_NEW(star, room);
    s.weights = RX_NEW(double, room);
    s.normal = RX_NEW(double, RX_PSF_TERMS *RX_PSF_TERMS);
    rx_status status = RX_OK;
    if (least == NULL || work == NULL || stars == NULL || s.list == NULL || s.weights == NULL ||
        s.normal == NULL) {
        status = rx_error_memory(err, (size_t)room * sizeof *s.list);
        goto exit;
    }
    rx_psf_model model = job->model;
    model.degree = RX_PSF_DEGREE;
    model.nterms = RX_PSF_TERMS;
    int n = 0, wider = 0, together = 0;
    for (int i = 0; i < job->n; i++) {
        const rx_psf_point *p = &job->points[i];
        if (!p->star || p->reserved || !(p->chi2 < HUGE_VAL))
            continue;
        wider += p->wider;
        together += p->together;
        s.list[s.n].wider = p->wider;
        s.list[s.n].fitted = p->kept && !p->wider;
        n += p->kept && !p->wider;
        stars[s.n++] = i;
    }
#pragma omp parallel for schedule(dynamic, 4) num_threads(job->nthreads)
    for (int i = 0; i < s.n; i++) {
        const rx_psf_point *p = &job->points[stars[i]];
        rx_psf_model_terms(&model, p->x, p->y, s.list[i].terms);
        s.list[i].fold = (int)(FOLDS * rx_random_uniform(SEED, FOLD, (uint64_t)p->source));
        measure(job, p, &s.list[i]);
    }
    int best_held = 0;
    /* at last small terms of the highest degree, which follow a bad corner's few stars, without and with those that are wider than
     * stars elsewhere; where stars are wider together they need not be better by an error */
    for (int trial = 0; trial <= highest + (wider > 0 ? 2 : 1); trial++) {
        const int held = trial > highest, with_wider = trial > highest + 1, degree = held ? highest : trial;
        next = (rx_psf_variation){
            .degree = degree, .nterms = (degree + 1) * (degree + 2) / 2, .with_wider = with_wider};
        set_prior(&s, held);
        for (int i = 0; i < s.n; i++)
            if (s.list[i].wider)
                s.list[i].fitted = with_wider && (!job->variation.with_wider || job->points[stars[i]].kept);
        if ((held && degree == 0) || (with_wider && best.degree == 0) ||
            (!held && degree > best.degree + 2) || n < (held ? 1 : 2) * next.nterms + 2 ||
            !fit_all(&s, next.nterms, next.c))
            continue;
        rx_psf_variation part = next;
        hold_out(&s, next.nterms, part.c, chi2);
        double mean = 0.0, square = 0.0, count = 0.0, others = 0.0;
        for (int i = 0; i < s.n && degree > 0; i++) {
            if (!s.list[i].fitted)
                continue;
            const double gain = MOST_GAIN * (asinh(least[i] / MOST_GAIN) - asinh(chi2[i] / MOST_GAIN));
            mean += gain;
            square += gain * gain;
            others += s.list[i].wider ? 0.0 : gain;
            count += 1.0;
        }
        mean /= fmax(count, 1.0);
        const double error = sqrt(fmax(square / fmax(count, 1.0) - mean * mean, 0.0) / fmax(count, 1.0));
        if (degree > 0)
            rx_log_detail(log,
                          "PSF_TYPE AUTO: degree %d%s%s: stars held out are predicted better by %.3g +- %.2g "
                          "than with %d",
                          degree, held ? ", small terms" : "", with_wider ? ", wider stars" : "", mean, error,
                          best.degree);
        if (degree == 0 ||
            (mean > (held && !with_wider && together > 0 ? 0.0 : error) && (!with_wider || others > 0.0))) {
            best = next;
            best_held = held;
            memcpy(least, chi2, (size_t)s.n * sizeof *least);
        }
    }
    for (int i = 0; i < s.n; i++)
        if (s.list[i].wider) {
            rx_psf_point *p = &job->points[stars[i]];
            s.list[i].fitted = p->kept = best.with_wider && (!job->variation.with_wider || p->kept);
        }
    set_prior(&s, best_held);
    if (fit_all(&s, best.nterms, best.c))
        weigh(job, &s, work, &best);
    job->variation = best;
exit:
    free(least);
    free(work);
    free(stars);
    free(s.list);
    free(s.weights);
    free(s.normal);
    return status;
}
