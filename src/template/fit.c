/* Levenberg-Marquardt for one source. The matrices are of 3 or 7 rows and live on the stack: there are tens
 * of thousands of sources. */
#include "template/fit.h"

#include <math.h>
#include <string.h>

#include "base/simd.h"
#include "num/normal.h"

enum { CHUNK = 256, LANES = 16 }; /* pixels that are summed up together, in steps of LANES */

rx_spergel rx_fit_profile(const rx_fit *fit)
{
    const double nu = fit->sersic != NULL ? exp(fit->p[RX_FIT_NU]) : expm1(fit->p[RX_FIT_NU]);
    return (rx_spergel){exp(fit->p[RX_FIT_RADIUS]), fit->p[RX_FIT_G1], fit->p[RX_FIT_G2], nu, fit->sersic};
}

static void render(const rx_fit *fit, rx_template_domain *size, int gradient)
{
    const rx_spergel profile = rx_fit_profile(fit);
    const int extended = fit->n == RX_FIT_ALL;
    rx_template_domain_render(size, extended ? &profile : NULL, fit->p[RX_FIT_X], fit->p[RX_FIT_Y], NULL,
                              extended && gradient ? 5 : 1);
}

/* x [n] = a^-1 b, a [n][n] overwritten; 0 when it is not definite. */
static int solve(int n, double *a, const double *b, double *x)
{
    memcpy(x, b, (size_t)n * sizeof *x);
    if (!rx_cholesky(a, n, n))
        return 0;
    rx_cholesky_solve(a, n, n, x);
    return 1;
}

double rx_fit_variance(const rx_fit *fit, int j)
{
    double a[RX_FIT_ALL * RX_FIT_ALL], b[RX_FIT_ALL] = {0}, x[RX_FIT_ALL];
    memcpy(a, fit->a, sizeof a);
    b[j] = 1.0;
    return solve(fit->n, a, b, x) ? x[j] : HUGE_VAL;
}

double rx_fit_log_determinant(const rx_fit *fit)
{
    double a[RX_FIT_ALL * RX_FIT_ALL], b[RX_FIT_ALL] = {0}, x[RX_FIT_ALL], sum = 0;
    memcpy(a, fit->a, sizeof a);
    if (!solve(fit->n, a, b, x))
        return HUGE_VAL;
    for (int j = 0; j < fit->n; j++)
        sum += 2 * log(a[j * fit->n + j]);
    return sum;
}

/* Flux of the linear fit of plane 0; *power = its inverse variance. */
static double linear_flux(const rx_template_domain *size, const rx_patch *patch, double *power)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    double td = 0, tt = 0;
    for (size_t j = 0; j < side; j++) {
        const float *t = size->plane[0] + (j + (size_t)patch->corner) * stride + patch->corner;
        const double *data = patch->data + j * side, *weight = patch->weight + j * side;
#pragma omp simd reduction(+ : td, tt)
        for (size_t i = 0; i < side; i++) {
            td += weight[i] * t[i] * data[i];
            tt += weight[i] * t[i] * t[i];
        }
    }
    *power = tt;
    return tt > 0 ? td / tt : 0;
}

static inline double prior_part(const rx_fit *fit)
{
    double sum = 0;
    for (int j = 0; j < fit->n; j++)
        if (fit->width[j] > 0) {
            const double off = (fit->p[j] - fit->prior[j]) / fit->width[j];
            sum += off * off;
        }
    return sum;
}

RX_SIMD static double chi2_of(const rx_fit *fit, const rx_template_domain *size, const rx_patch *patch)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    const double flux = fit->p[RX_FIT_FLUX];
    double sum = 0;
    for (size_t j = 0; j < side; j++) {
        const float *t = size->plane[0] + (j + (size_t)patch->corner) * stride + patch->corner;
        const double *data = patch->data + j * side, *weight = patch->weight + j * side;
#pragma omp simd reduction(+ : sum)
        for (size_t i = 0; i < side; i++) {
            const double r = data[i] - flux * t[i];
            sum += weight[i] * r * r;
        }
    }
    return sum + prior_part(fit);
}

/* Derivatives g of the model by its n parameters on pixels of any rows, one after the other, their weights w and what is
 * left of the data r: room for CHUNK of them, `count` are there. */
typedef struct stretch {
    int n, count;
    float g[RX_FIT_ALL][CHUNK], w[CHUNK], r[CHUNK];
} stretch;

/* What they add to the normal matrix (lower triangle) and the gradient: sums of a stretch are single precision, four at a
 * time lest each addition wait for the one before; the total is double. */
RX_SIMD static void add_stretch(stretch *s, double *a, double *b)
{
    const int n = s->n, rest = s->count % LANES, count = rest > 0 ? s->count - rest + LANES : s->count;
    float wg[CHUNK];
    for (int i = s->count; i < count; i++) {
        s->w[i] = s->r[i] = 0;
        for (int m = 0; m < n; m++)
            s->g[m][i] = 0;
    }
    for (int m = 0; m < n; m++) {
#pragma omp simd
        for (int i = 0; i < count; i++)
            wg[i] = s->w[i] * s->g[m][i];
        for (int l = 0; l <= m + 1; l += 4) {
            const float *by[4];
            float sum0 = 0, sum1 = 0, sum2 = 0, sum3 = 0;
            for (int k = 0; k < 4; k++)
                by[k] = l + k <= m ? s->g[l + k] : s->r;
#pragma omp simd reduction(+ : sum0, sum1, sum2, sum3)
            for (int i = 0; i < count; i++) {
                sum0 += wg[i] * by[0][i];
                sum1 += wg[i] * by[1][i];
                sum2 += wg[i] * by[2][i];
                sum3 += wg[i] * by[3][i];
            }
            const float sums[4] = {sum0, sum1, sum2, sum3};
            for (int k = 0; k < 4 && l + k <= m + 1; k++)
                *(l + k <= m ? &a[m * n + l + k] : &b[m]) += sums[k];
        }
    }
    s->count = 0;
}

/* The model's derivatives on `count` pixels from k on the planes, shifts by central differences of the template. */
RX_SIMD static void slopes(const rx_fit *fit, const rx_template_domain *size, size_t k, const double *data,
                           const double *weight, int count, stretch *s)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft);
    const float *t = size->plane[0] + k, *up = t + stride, *down = t - stride;
    const float flux = (float)fit->p[RX_FIT_FLUX];
    const double bright = fit->p[RX_FIT_FLUX];
    float *value = s->g[RX_FIT_FLUX] + s->count, *gx = s->g[RX_FIT_X] + s->count,
          *gy = s->g[RX_FIT_Y] + s->count, *w = s->w + s->count, *r = s->r + s->count;
#pragma omp simd
    for (int i = 0; i < count; i++) {
        value[i] = t[i];
        gx[i] = -0.5f * flux * (t[i + 1] - t[i - 1]);
        gy[i] = -0.5f * flux * (up[i] - down[i]);
        w[i] = (float)weight[i];
        r[i] = (float)(data[i] - bright * t[i]);
    }
    for (int m = RX_FIT_RADIUS; m < fit->n; m++) {
        const float *slope = size->plane[m - RX_FIT_RADIUS + 1] + k;
        float *g = s->g[m] + s->count;
#pragma omp simd
        for (int i = 0; i < count; i++)
            g[i] = flux * slope[i];
    }
    s->count += count;
}

/* Normal matrix (lower triangle) and gradient from the planes. */
RX_SIMD static void normal(const rx_fit *fit, const rx_template_domain *size, const rx_patch *patch,
                           double *a, double *b)
{
    const int n = fit->n;
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    stretch s;
    s.n = n;
    s.count = 0;
    memset(a, 0, sizeof(double) * RX_FIT_ALL * RX_FIT_ALL);
    memset(b, 0, sizeof(double) * RX_FIT_ALL);
    for (size_t j = 0; j < side; j++)
        for (size_t i = 0; i < side; i += CHUNK) {
            const int count = side - i < CHUNK ? (int)(side - i) : CHUNK;
            const size_t p = j * side + i;
            if (s.count + count > CHUNK)
                add_stretch(&s, a, b);
            slopes(fit, size, (j + (size_t)patch->corner) * stride + i + (size_t)patch->corner,
                   patch->data + p, patch->weight + p, count, &s);
        }
    add_stretch(&s, a, b);
    for (int m = 0; m < n; m++)
        if (fit->width[m] > 0) {
            const double inverse = 1 / (fit->width[m] * fit->width[m]);
            a[m * n + m] += inverse;
            b[m] -= (fit->p[m] - fit->prior[m]) * inverse;
        }
}

static void limit(rx_fit *fit)
{
    fit->at_limit = 0;
    for (int j = 0; j < fit->n; j++) {
        if (!(fit->low[j] < fit->high[j]))
            continue;
        if (fit->p[j] <= fit->low[j] || fit->p[j] >= fit->high[j])
            fit->at_limit |= 1 << j;
        fit->p[j] = fmin(fmax(fit->p[j], fit->low[j]), fit->high[j]);
    }
    if (fit->n < RX_FIT_ALL)
        return;
    const double g = hypot(fit->p[RX_FIT_G1], fit->p[RX_FIT_G2]);
    if (g > fit->high[RX_FIT_G1]) {
        fit->p[RX_FIT_G1] *= fit->high[RX_FIT_G1] / g;
        fit->p[RX_FIT_G2] *= fit->high[RX_FIT_G1] / g;
        fit->at_limit |= 1 << RX_FIT_G1;
    }
}

/* One damped step; 0 when there is none. */
static int step(rx_fit *fit, const double *a, const double *b, double damping)
{
    double damped[RX_FIT_ALL * RX_FIT_ALL], x[RX_FIT_ALL];
    memcpy(damped, a, sizeof damped);
    for (int j = 0; j < fit->n; j++)
        damped[j * fit->n + j] *= 1 + damping;
    if (!solve(fit->n, damped, b, x))
        return 0;
    for (int j = 0; j < fit->n; j++)
        fit->p[j] += x[j];
    limit(fit);
    return 1;
}

/* What an undamped step would gain in chi2 if it were a parabola; HUGE_VAL when there is none. */
static double promise(const rx_fit *fit, const double *a, const double *b)
{
    double copy[RX_FIT_ALL * RX_FIT_ALL], x[RX_FIT_ALL], sum = 0;
    memcpy(copy, a, sizeof copy);
    if (!solve(fit->n, copy, b, x))
        return HUGE_VAL;
    for (int j = 0; j < fit->n; j++)
        sum += b[j] * x[j];
    return sum;
}

/* Steps until nothing more is to be had; returns whether plane 0 holds the template of fit->p. Derivatives by the shape take four
 * planes more: those of before serve as long as steps gain what they promise, and are made anew before it ends. */
static int descend(rx_fit *fit, rx_template_domain *size, const rx_patch *patch, double *a, double *b)
{
    /* of chi2: a last step of a tenth of a sigma is followed by a far smaller one; one of a thirtieth is not
     * worth a rendering; after one of a third no new derivatives are */
    static const double enough = 0.01, nothing = 0.001, little = 0.1, kept = 0.5;
    double damping = 1e-3;
    int current = 1, old = 0;
    for (int i = 0; i < fit->iterations; i++) {
        const double hope = promise(fit, a, b);
        rx_fit before = *fit;
        double gain = 0;
        if (hope > nothing && step(fit, a, b, damping)) {
            render(fit, size, 0);
            fit->chi2 = chi2_of(fit, size, patch);
            gain = before.chi2 - fit->chi2;
            current = gain >= 0;
            if (!current)
                *fit = before;
            old = old || (current && hope > little && fit->n == RX_FIT_ALL);
        }
        const int last = fabs(gain) < enough;
        if (old && (last || gain < kept * hope)) {
            render(fit, size, 1);
            normal(fit, size, patch, a, b);
            current = 1;
            old = 0;
            continue;
        }
        if (last || !(hope > little) || damping > 1e5)
            break;
        if (current)
            normal(fit, size, patch, a, b);
        damping = current ? fmax(damping * 0.1, 1e-9) : damping * 10;
    }
    if (old) {
        render(fit, size, 1);
        normal(fit, size, patch, a, b);
        current = 1;
    }
    return current;
}

void rx_fit_run(rx_fit *fit, rx_template_domain *size, const rx_patch *patch)
{
    double a[RX_FIT_ALL * RX_FIT_ALL], b[RX_FIT_ALL], power;
    limit(fit);
    render(fit, size, 1);
    fit->p[RX_FIT_FLUX] = linear_flux(size, patch, &power);
    fit->chi2 = chi2_of(fit, size, patch);
    normal(fit, size, patch, a, b);
    const int rendered = descend(fit, size, patch, a, b);
    memcpy(fit->a, a, sizeof a);
    if (!rendered)
        render(fit, size, 0);
}

enum { PAIR = 6, PAIR_STEPS = 15 }; /* flux, x and y of the one, then of the other */

/* Two points: normal matrix and gradient; returns chi2. */
RX_SIMD static double pair_normal(const double *p, rx_template_domain *size, const rx_patch *patch, double *a,
                                  double *b)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    stretch s;
    double chi2 = 0;
    rx_template_domain_render(size, NULL, p[1], p[2], NULL, 1);
    float *first = size->plane[0];
    size->plane[0] = size->plane[1];
    size->plane[1] = first;
    rx_template_domain_render(size, NULL, p[4], p[5], NULL, 1);
    s.n = PAIR;
    s.count = 0;
    memset(a, 0, sizeof(double) * PAIR * PAIR);
    memset(b, 0, sizeof(double) * PAIR);
    for (size_t j = 0; j < side; j++)
        for (size_t i = 0; i < side; i += CHUNK) {
            const int count = side - i < CHUNK ? (int)(side - i) : CHUNK;
            const size_t k = (j + (size_t)patch->corner) * stride + i + (size_t)patch->corner;
            if (s.count + count > CHUNK)
                add_stretch(&s, a, b);
            float *w = s.w + s.count, *r = s.r + s.count;
#pragma omp simd
            for (int m = 0; m < count; m++) {
                w[m] = (float)patch->weight[j * side + i + (size_t)m];
                r[m] = (float)patch->data[j * side + i + (size_t)m];
            }
            for (int one = 0; one < 2; one++) {
                const float *t = size->plane[1 - one] + k, *up = t + stride, *down = t - stride;
                const float flux = (float)p[3 * one];
                float *g = s.g[3 * one] + s.count, *gx = s.g[3 * one + 1] + s.count,
                      *gy = s.g[3 * one + 2] + s.count;
#pragma omp simd
                for (int m = 0; m < count; m++) {
                    g[m] = t[m];
                    gx[m] = -0.5f * flux * (t[m + 1] - t[m - 1]);
                    gy[m] = -0.5f * flux * (up[m] - down[m]);
                    r[m] -= flux * t[m];
                }
            }
#pragma omp simd reduction(+ : chi2)
            for (int m = 0; m < count; m++)
                chi2 += (double)w[m] * r[m] * r[m];
            s.count += count;
        }
    add_stretch(&s, a, b);
    return chi2;
}

double rx_fit_pair(const rx_fit *fit, const double off[2], double room, double enough,
                   rx_template_domain *size, const rx_patch *patch, double pair[2][3])
{
    const double x0 = fit->p[RX_FIT_X], y0 = fit->p[RX_FIT_Y], half = 0.5 * fit->p[RX_FIT_FLUX];
    double best[PAIR] = {half, x0 + off[0], y0 + off[1], half, x0 - off[0], y0 - off[1]}, p[PAIR], step[PAIR];
    double a[PAIR * PAIR], b[PAIR], trial[PAIR * PAIR], slope[PAIR], damping = 0.1;
    double chi2 = pair_normal(best, size, patch, a, b);
    for (int i = 0; i < PAIR_STEPS && damping < 1e4; i++) {
        if (chi2 < enough && best[0] > 0 && best[3] > 0)
            break;
        memcpy(trial, a, sizeof a);
        for (int j = 0; j < PAIR; j++)
            trial[j * PAIR + j] *= 1 + damping;
        if (!solve(PAIR, trial, b, step))
            return HUGE_VAL;
        for (int j = 0; j < PAIR; j++)
            p[j] = best[j] + step[j];
        for (int j = 1; j < PAIR; j += 3) {
            p[j] = fmin(fmax(p[j], x0 - room), x0 + room);
            p[j + 1] = fmin(fmax(p[j + 1], y0 - room), y0 + room);
        }
        const double now = pair_normal(p, size, patch, trial, slope), gain = chi2 - now;
        if (!(gain >= 0)) {
            damping *= 10;
            continue;
        }
        memcpy(best, p, sizeof p);
        memcpy(a, trial, sizeof a);
        memcpy(b, slope, sizeof b);
        chi2 = now;
        damping *= 0.1;
        if (gain < 0.05)
            break;
    }
    if (pair != NULL)
        memcpy(pair, best, sizeof best);
    return best[0] > 0 && best[3] > 0 ? chi2 : HUGE_VAL;
}

/* Of chi2 that a node may be better than the Gaussian says: more is a fit that has not come to its end, or a
 * model far from the data, and no shape of a posterior. */
static const double MOST_GAIN = 4.0;

/* The fit moved by `by` along its shape's direction: flux, weight over the Gaussian's there; -1: no such
 * thing. */
static double node(const rx_fit *fit, const double *direction, double by, rx_template_domain *size,
                   const rx_patch *patch, double *flux)
{
    rx_fit moved = *fit;
    double power = 0;
    for (int j = RX_FIT_X; j < fit->n; j++)
        moved.p[j] += by * direction[j];
    limit(&moved);
    if (by != 0)
        render(&moved, size, 0);
    *flux = moved.p[RX_FIT_FLUX] = linear_flux(size, patch, &power);
    const double gain = fit->chi2 + by * by - chi2_of(&moved, size, patch);
    return power > 0 && gain < MOST_GAIN ? exp(0.5 * gain) / sqrt(power) : -1;
}

rx_fit_mean rx_fit_average(const rx_fit *fit, rx_template_domain *size, const rx_patch *patch)
{
    static const double nodes[3] = {0, 1.7320508075688772, -1.7320508075688772};
    static const double shares[3] = {2.0 / 3, 1.0 / 6, 1.0 / 6};
    double a[RX_FIT_ALL * RX_FIT_ALL], b[RX_FIT_ALL] = {1}, column[RX_FIT_ALL], flux[3], w[3];
    rx_fit_mean mean = {fit->p[RX_FIT_FLUX], HUGE_VAL, 0};
    memcpy(a, fit->a, sizeof a);
    if (!solve(fit->n, a, b, column))
        return mean;
    const double own = 1 / fit->a[0], shape = column[0] - own;
    mean.variance = column[0];
    if (!(shape > 0))
        return mean;
    for (int j = 0; j < fit->n; j++)
        column[j] /= sqrt(shape);
    double sum = 0, first = 0, second = 0;
    for (int k = 0; k < 3; k++) {
        w[k] = shares[k] * node(fit, column, nodes[k], size, patch, &flux[k]);
        if (!(w[k] >= 0))
            return mean;
        sum += w[k];
        first += w[k] * flux[k];
    }
    if (!(w[0] > 0))
        return mean;
    mean.flux = first / sum;
    for (int k = 0; k < 3; k++)
        second += w[k] * (flux[k] - mean.flux) * (flux[k] - mean.flux);
    mean.variance = own + second / sum;
    mean.evidence = 2 * log(sum * shares[0] / w[0]);
    return mean;
}
