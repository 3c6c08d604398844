/* Levenberg-Marquardt for one source. The matrices are of 3 or 7 rows and live on the stack: there are tens
 * of thousands of sources. */
#include "template/fit.h"

#include <math.h>
#include <string.h>

rx_spergel rx_fit_profile(const rx_fit *fit)
{
    return (rx_spergel){exp(fit->p[RX_FIT_RADIUS]), fit->p[RX_FIT_G1], fit->p[RX_FIT_G2],
                        expm1(fit->p[RX_FIT_NU])};
}

static void render(const rx_fit *fit, rx_lens_size *size, int gradient)
{
    const rx_spergel profile = rx_fit_profile(fit);
    const int extended = fit->n == RX_FIT_ALL;
    rx_lens_render(size, extended ? &profile : NULL, fit->p[RX_FIT_X], fit->p[RX_FIT_Y], 0,
                   extended && gradient ? 5 : 1);
}

/* x [n] = a^-1 b by Cholesky, a [n][n] overwritten; 0 when not definite. */
static int solve(int n, double *a, const double *b, double *x)
{
    for (int j = 0; j < n; j++) {
        for (int i = j; i < n; i++) {
            double sum = a[i * n + j];
            for (int k = 0; k < j; k++)
                sum -= a[i * n + k] * a[j * n + k];
            if (i == j && !(sum > 0))
                return 0;
            a[i * n + j] = i == j ? sqrt(sum) : sum / a[j * n + j];
        }
    }
    for (int i = 0; i < n; i++) {
        double sum = b[i];
        for (int k = 0; k < i; k++)
            sum -= a[i * n + k] * x[k];
        x[i] = sum / a[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        double sum = x[i];
        for (int k = i + 1; k < n; k++)
            sum -= a[k * n + i] * x[k];
        x[i] = sum / a[i * n + i];
    }
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

/* Flux of the linear fit of plane 0. */
static double linear_flux(const rx_lens_size *size, const rx_patch *patch)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    double td = 0, tt = 0;
    for (size_t j = 0; j < side; j++) {
        const float *t = size->plane[0] + (j + (size_t)patch->corner) * stride + patch->corner;
        for (size_t i = 0; i < side; i++) {
            const double w = patch->weight[j * side + i];
            td += w * t[i] * patch->data[j * side + i];
            tt += w * t[i] * t[i];
        }
    }
    return tt > 0 ? td / tt : 0;
}

static double prior_part(const rx_fit *fit)
{
    double sum = 0;
    for (int j = 0; j < fit->n; j++)
        if (fit->width[j] > 0) {
            const double off = (fit->p[j] - fit->prior[j]) / fit->width[j];
            sum += off * off;
        }
    return sum;
}

static double chi2_of(const rx_fit *fit, const rx_lens_size *size, const rx_patch *patch)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    double sum = 0;
    for (size_t j = 0; j < side; j++) {
        const float *t = size->plane[0] + (j + (size_t)patch->corner) * stride + patch->corner;
        for (size_t i = 0; i < side; i++) {
            const double r = patch->data[j * side + i] - fit->p[RX_FIT_FLUX] * t[i];
            sum += patch->weight[j * side + i] * r * r;
        }
    }
    return sum + prior_part(fit);
}

/* Normal matrix and gradient from the planes; shifts by central differences of the template. */
static void normal(const rx_fit *fit, const rx_lens_size *size, const rx_patch *patch, double *a, double *b)
{
    const int n = fit->n;
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), side = (size_t)patch->side;
    const double flux = fit->p[RX_FIT_FLUX];
    memset(a, 0, sizeof(double) * RX_FIT_ALL * RX_FIT_ALL);
    memset(b, 0, sizeof(double) * RX_FIT_ALL);
    for (size_t j = 0; j < side; j++)
        for (size_t i = 0; i < side; i++) {
            const double w = patch->weight[j * side + i];
            const size_t k = (j + (size_t)patch->corner) * stride + i + (size_t)patch->corner;
            const float *t = size->plane[0] + k;
            if (!(w > 0))
                continue;
            double g[RX_FIT_ALL] = {t[0], -0.5 * flux * (t[1] - t[-1]),
                                    -0.5 * flux * (t[stride] - *(t - stride))};
            for (int m = RX_FIT_RADIUS; m < n; m++)
                g[m] = flux * size->plane[m - RX_FIT_RADIUS + 1][k];
            const double r = patch->data[j * side + i] - flux * t[0];
            for (int m = 0; m < n; m++) {
                b[m] += w * g[m] * r;
                for (int l = 0; l <= m; l++)
                    a[m * n + l] += w * g[m] * g[l];
            }
        }
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

void rx_fit_run(rx_fit *fit, rx_lens_size *size, const rx_patch *patch)
{
    static const double enough =
        0.01; /* of chi2: the last step was a tenth of a sigma, what is left far less */
    double a[RX_FIT_ALL * RX_FIT_ALL], b[RX_FIT_ALL], damping = 1e-3;
    limit(fit);
    render(fit, size, 1);
    fit->p[RX_FIT_FLUX] = linear_flux(size, patch);
    fit->chi2 = chi2_of(fit, size, patch);
    normal(fit, size, patch, a, b);
    for (int i = 0; i < fit->iterations; i++) {
        rx_fit before = *fit;
        if (!step(fit, a, b, damping))
            break;
        render(fit, size, 1);
        fit->chi2 = chi2_of(fit, size, patch);
        if (!(fit->chi2 <= before.chi2)) {
            const int last = before.chi2 + enough > fit->chi2;
            *fit = before;
            damping = damping * 10;
            if (last || damping > 1e6)
                break;
            continue;
        }
        normal(fit, size, patch, a, b);
        damping = fmax(damping * 0.1, 1e-9);
        if (before.chi2 - fit->chi2 < enough)
            break;
    }
    memcpy(fit->a, a, sizeof a);
    render(fit, size, 0);
}
