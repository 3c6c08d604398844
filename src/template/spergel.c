/* Spergel profiles in Fourier space. */
#include "template/spergel.h"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "base/simd.h"

double rx_spergel_half_light(double nu, double *slope)
{
    static const double p[8] = {0.2288561167,   0.7540844887,   -0.1163544469,    0.03985938715,
                                -0.01231771899, 0.003532367094, -0.0008353176496, 0.000105305456};
    const double x = log1p(nu);
    double value = 0, derivative = 0;
    for (int i = 7; i >= 0; i--) {
        derivative = derivative * x + value;
        value = value * x + p[i];
    }
    if (slope != NULL)
        *slope = derivative;
    return exp(value);
}

void rx_spergel_set(const rx_spergel *profile, rx_spergel_form *form)
{
    const double pi2 = 6.283185307179586;
    form->sersic = profile->sersic != NULL;
    if (form->sersic)
        rx_sersic_set_index(profile->sersic, profile->nu, &form->line);
    const double scale =
        pi2 * profile->radius / (form->sersic ? 1 : rx_spergel_half_light(profile->nu, &form->slope));
    const double g1 = profile->g1, g2 = profile->g2, gg = g1 * g1 + g2 * g2;
    const double s2 = scale * scale, norm = s2 / (1 - gg);
    /* A^T A (1 - g^2) = [[(1 + g1)^2 + g2^2, 2 g2], [2 g2, (1 - g1)^2 + g2^2]] */
    const double xx = 1 + gg + 2 * g1, yy = 1 + gg - 2 * g1, xy = 2 * g2;
    form->uxx = norm * xx;
    form->uyy = norm * yy;
    form->uxy = norm * xy;
    const double d1 = 2 * g1 / (1 - gg), d2 = 2 * g2 / (1 - gg); /* d ln norm */
    form->g1xx = norm * (xx * d1 + 2 * g1 + 2);
    form->g1yy = norm * (yy * d1 + 2 * g1 - 2);
    form->g1xy = norm * xy * d1;
    form->g2xx = norm * (xx * d2 + 2 * g2);
    form->g2yy = norm * (yy * d2 + 2 * g2);
    form->g2xy = norm * (xy * d2 + 2);
    form->power = 1 + profile->nu;
}

double rx_spergel_at(const rx_spergel_form *form, double kx, double ky, double gradient[4])
{
    const double u = form->uxx * kx * kx + form->uyy * ky * ky + 2 * form->uxy * kx * ky;
    const double ln = log1p(u), value = exp(-form->power * ln);
    if (gradient != NULL) {
        const double du = -form->power * value / (1 + u);
        gradient[0] = 2 * u * du;
        gradient[1] = du * (form->g1xx * kx * kx + form->g1yy * ky * ky + 2 * form->g1xy * kx * ky);
        gradient[2] = du * (form->g2xx * kx * kx + form->g2yy * ky * ky + 2 * form->g2xy * kx * ky);
        gradient[3] = -ln * value * form->power - gradient[0] * form->slope;
    }
    return value;
}

/* ln a for a >= 1, to 2e-7: a = 2^e m, ln m = 2 artanh((m - 1) / (m + 1)) as a series, m in sqrt(1/2) ..
 * sqrt(2). Without branches, so that compilers take many at once. */
static inline float ln_of(float a)
{
    int32_t bits;
    float m;
    memcpy(&bits, &a, sizeof bits);
    const int32_t e = (bits - 0x3f3504f3) >> 23; /* 0x3f3504f3: sqrt(1/2) */
    bits -= e * (1 << 23);
    memcpy(&m, &bits, sizeof m);
    const float s = (m - 1.0f) / (m + 1.0f), q = s * s;
    const float series = 2.0f + q * (2.0f / 3 + q * (2.0f / 5 + q * (2.0f / 7 + q * (2.0f / 9))));
    return (float)e * 0.69314718f + s * series;
}

/* exp x for x <= 0, relative error 1e-7 (1 - x): 2^k of the whole part, Taylor's series of the rest; never
 * below 2^-126. */
static inline float exp_of(float x)
{
    const float t = x * 1.44269504f;
    const int32_t k = (int32_t)(t - 0.5f);
    const float y = (t - (float)k) * 0.69314718f;
    const float series =
        1 + y * (1 + y * (1.0f / 2 + y * (1.0f / 6 + y * (1.0f / 24 + y * (1.0f / 120 + y * (1.0f / 720))))));
    const int32_t bits = (k > -126 ? k + 127 : 1) * (1 << 23);
    float scale;
    memcpy(&scale, &bits, sizeof scale);
    return scale * series;
}

/* a + b i + c i^2 for the quadratic form (xx, yy, xy) at (kx, i step). */
static void along(double xx, double yy, double xy, double kx, double step, float poly[3])
{
    poly[0] = (float)(xx * kx * kx);
    poly[1] = (float)(2 * xy * step * kx);
    poly[2] = (float)(yy * step * step);
}

enum { LANES = 64 }; /* frequencies at a time */

/* Hermite's cubic from s[k] to s[k + 1], their slopes beside. */
static inline float between(const float *s, const float *slope, int k, float p)
{
    const float q = 1 - p, h = q * q * (1 + 2 * p);
    return h * s[k] + (1 - h) * s[k + 1] + p * q * (q * slope[k] - p * slope[k + 1]);
}

static inline float slope_between(const float *s, const float *slope, int k, float p)
{
    const float q = 1 - p;
    return 6 * p * q * (s[k + 1] - s[k]) + q * (1 - 3 * p) * slope[k] + p * (1 - 3 * q) * slope[k + 1];
}

/* Sersic's profile, u and its derivatives by g1 and g2 as polynomials in i, of at most LANES. Without branches, too: u from the first
 * node (rounded up) to the last, compared as whole numbers, of which what is no number is above all. */
RX_SIMD static void sersic_column(const rx_sersic_line *line, const float *const poly[3], int first, int n,
                                  int count, float *const *dst)
{
    const float u0 = poly[0][0], u1 = poly[0][1], u2 = poly[0][2];
    const float *s = line->node[0], *slope = line->node[1], *by = line->node[2], *by_slope = line->node[3];
    const float scale = (float)(1 / RX_SERSIC_SPACING), start = (float)RX_SERSIC_FIRST;
    const float least = 1.1254e-7f, most = 1.06e6f; /* exp(2 FIRST), and short of the last node */
    float square[LANES], p[LANES], *restrict value = dst[0];
    int32_t k[LANES];
    uint32_t limit;
    memcpy(&limit, &most, sizeof limit);
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float x = (float)(first + i), raw = least + u0 + x * (u1 + x * u2);
        uint32_t bits;
        memcpy(&bits, &raw, sizeof bits);
        bits = bits < limit ? bits : limit;
        memcpy(&square[i], &bits, sizeof bits);
        const float at = (0.5f * ln_of(square[i]) - start) * scale;
        k[i] = (int32_t)at;
        p[i] = at - (float)k[i];
    }
#pragma omp simd
    for (int i = 0; i < n; i++)
        value[i] = between(s, slope, k[i], p[i]);
    if (count == 1)
        return;
    float *restrict radius = dst[1], *restrict g1 = dst[2], *restrict g2 = dst[3], *restrict index = dst[4];
    const float a0 = poly[1][0], a1 = poly[1][1], a2 = poly[1][2];
    const float b0 = poly[2][0], b1 = poly[2][1], b2 = poly[2][2];
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float x = (float)(first + i), ds = scale * slope_between(s, slope, k[i], p[i]);
        const float by_square = 0.5f * ds / square[i];
        radius[i] = ds;
        index[i] = between(by, by_slope, k[i], p[i]);
        g1[i] = by_square * (a0 + x * (a1 + x * a2));
        g2[i] = by_square * (b0 + x * (b1 + x * b2));
    }
}

RX_SIMD void rx_spergel_column(const rx_spergel_form *form, double kx, double step, int first, int n,
                               int count, float *const *dst)
{
    const float power = (float)form->power, slope = (float)form->slope;
    float u[3], a[3], b[3];
    float *restrict value = dst[0];
    along(form->uxx, form->uyy, form->uxy, kx, step, u);
    along(form->g1xx, form->g1yy, form->g1xy, kx, step, a);
    along(form->g2xx, form->g2yy, form->g2xy, kx, step, b);
    if (form->sersic) {
        for (int i = 0; i < n; i += LANES) {
            float *part[5];
            for (int k = 0; k < count; k++)
                part[k] = dst[k] + i;
            sersic_column(&form->line, (const float *[3]){u, a, b}, first + i, n - i < LANES ? n - i : LANES,
                          count, part);
        }
        return;
    }
    if (count == 1) {
#pragma omp simd
        for (int i = 0; i < n; i++) {
            const float x = (float)(first + i);
            value[i] = exp_of(-power * ln_of(1.0f + u[0] + x * (u[1] + x * u[2])));
        }
        return;
    }
    float *restrict radius = dst[1], *restrict g1 = dst[2], *restrict g2 = dst[3], *restrict nu = dst[4];
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float x = (float)(first + i), square = u[0] + x * (u[1] + x * u[2]), ln = ln_of(1.0f + square);
        const float s = exp_of(-power * ln), slope_u = -power * s / (1.0f + square);
        value[i] = s;
        radius[i] = 2.0f * square * slope_u;
        g1[i] = slope_u * (a[0] + x * (a[1] + x * a[2]));
        g2[i] = slope_u * (b[0] + x * (b[1] + x * b[2]));
        nu[i] = -ln * s * power - 2.0f * square * slope_u * slope;
    }
}
