#include "psf/moffat.h"

#include <math.h>
#include <stddef.h>

/* Gauss-Legendre nodes (positive half, from the outside in; the middle one of odd orders last) and
 * weights on [-1, 1]: Abramowitz and Stegun 1964, table 25.4. */
static const struct {
    int order;
    double hwhm
        [2]; /* smallest half width (pixels) for which one cell is integrated to 1e-6 and 1e-4 of the peak */
    double node[4], weight[4];
} rules[] = {
    {2, {9.5, 3.0}, {0.5773502691896257}, {1.0}},
    {3, {2.8, 1.3}, {0.7745966692414834, 0.0}, {0.5555555555555556, 0.8888888888888888}},
    {4, {1.5, 0.84}, {0.8611363115940526, 0.3399810435848563}, {0.3478548451374538, 0.6521451548625461}},
    {5,
     {0.95, 0.6},
     {0.9061798459386640, 0.5384693101056831, 0.0},
     {0.2369268850561891, 0.4786286704993665, 0.5688888888888889}},
    {8,
     {0.45, 0.34},
     {0.9602898564975363, 0.7966664774136267, 0.5255324099163290, 0.1834346424956498},
     {0.1012285362903763, 0.2223810344533745, 0.3137066458778873, 0.3626837833783620}},
};
enum { RULES = (int)(sizeof rules / sizeof *rules), MAX_NODES = 8 };

/* How one pixel is integrated: cut into cells^2, each by order^2 nodes. */
typedef struct quadrature {
    int order, cells;
    double position[MAX_NODES], weight[MAX_NODES]; /* along one axis of the first cell, pixel width 1 */
} quadrature;

/* The cheapest rule. What counts is the smallest distance over which the profile changes: its half width,
 * and off the centre the distance from it. */
static void choose_rule(const rx_moffat *m, double dx, double dy, quadrature *q)
{
    double away = fmax(fmax(fabs(dx), fabs(dy)) - 0.5, 0.0);
    double scale = sqrt(m->narrow * m->narrow + 0.25 * away * away);
    int r = 0;
    while (r < RULES - 1 && scale < rules[r].hwhm[m->rough])
        r++;
    const double least = rules[r].hwhm[m->rough];
    q->cells = scale < least ? (int)ceil(fmin(least / scale, 16.0)) : 1;
    q->order = rules[r].order;
    for (int i = 0; i < q->order; i++) {
        int mirrored = i >= (q->order + 1) / 2, j = mirrored ? q->order - 1 - i : i;
        q->position[i] = (mirrored ? 0.5 : -0.5) * rules[r].node[j] / q->cells;
        q->weight[i] = 0.5 * rules[r].weight[j] / q->cells;
    }
}

void rx_moffat_set(rx_moffat *m, const double shape[RX_MOFFAT_SHAPE])
{
    double width = fmin(fmax(shape[0], -10.0), 20.0);
    double e1 = shape[1], e2 = shape[2], eta = hypot(e1, e2);
    if (eta > 5.0) { /* a fit gone astray: keep the numbers finite */
        e1 *= 5.0 / eta;
        e2 *= 5.0 / eta;
        eta = 5.0;
    }
    m->hwhm = exp(width);
    m->e1 = e1;
    m->e2 = e2;
    m->u = fmax(RX_MOFFAT_U_MAX / (1.0 + exp(-shape[3])), RX_MOFFAT_U_MIN);
    m->beta = 1.0 / m->u;
    m->k = expm1(m->u * M_LN2);
    /* S = sinh(eta)/eta and D = (cosh(eta) - S)/eta^2 are even and smooth: dS/de_i = D e_i */
    double c = cosh(eta), s = eta > 1e-4 ? sinh(eta) / eta : 1.0 + eta * eta / 6.0;
    double d = eta > 1e-2 ? (c - s) / (eta * eta) : 1.0 / 3.0 + eta * eta / 30.0;
    double g = 1.0 / (m->hwhm * m->hwhm);
    m->xx = g * (c - s * e1);
    m->yy = g * (c + s * e1);
    m->xy = -g * s * e2;
    for (int i = 0; i < 2; i++) {
        double e = i == 0 ? e1 : e2;
        m->gradient_e[i][0] = g * (s * e - d * e * e1 - (i == 0 ? s : 0.0));
        m->gradient_e[i][1] = g * (s * e + d * e * e1 + (i == 0 ? s : 0.0));
        m->gradient_e[i][2] = -g * (d * e * e2 + (i == 1 ? s : 0.0));
    }
    m->narrow = m->hwhm * exp(-0.5 * eta);
    m->rough = 0;
}

void rx_moffat_shape(double fwhm, double beta, double ratio, double angle, double shape[RX_MOFFAT_SHAPE])
{
    double u = fmin(fmax(1.0 / beta, RX_MOFFAT_U_MIN), 0.999 * RX_MOFFAT_U_MAX), eta = -log(ratio);
    shape[0] = log(0.5 * fwhm);
    shape[1] = eta * cos(2.0 * angle);
    shape[2] = eta * sin(2.0 * angle);
    shape[3] = -log(RX_MOFFAT_U_MAX / u - 1.0);
}

/* One node: value of the profile, and gradient += weight * its derivatives. */
static double node_value(const rx_moffat *m, double x, double y, double weight, double *gradient)
{
    double q = m->xx * x * x + m->yy * y * y + 2.0 * m->xy * x * y;
    double t = 1.0 + m->k * q, log_t = log1p(m->k * q), f = exp(-m->beta * log_t);
    if (gradient == NULL)
        return f;
    double by_q = -weight * f * m->beta * m->k / t;
    gradient[0] += by_q * 2.0 * (m->xx * x + m->xy * y);
    gradient[1] += by_q * 2.0 * (m->yy * y + m->xy * x);
    gradient[2] += by_q * -2.0 * q;
    for (int i = 0; i < 2; i++)
        gradient[3 + i] += by_q * (m->gradient_e[i][0] * x * x + m->gradient_e[i][1] * y * y +
                                   2.0 * m->gradient_e[i][2] * x * y);
    if (m->u > RX_MOFFAT_U_MIN) {
        double by_u = m->beta * (m->beta * log_t - M_LN2 * (1.0 + m->k) * q / t);
        gradient[5] += weight * f * by_u * m->u * (1.0 - m->u / RX_MOFFAT_U_MAX);
    }
    return f;
}

double rx_moffat_pixel(const rx_moffat *m, double dx, double dy, double gradient[2 + RX_MOFFAT_SHAPE])
{
    quadrature q;
    double sum = 0.0;
    choose_rule(m, dx, dy, &q);
    for (int i = 0; gradient != NULL && i < 2 + RX_MOFFAT_SHAPE; i++)
        gradient[i] = 0.0;
    for (int cy = 0; cy < q.cells; cy++)
        for (int j = 0; j < q.order; j++) {
            double y = dy + (cy + 0.5) / q.cells - 0.5 + q.position[j];
            for (int cx = 0; cx < q.cells; cx++)
                for (int i = 0; i < q.order; i++) {
                    double x = dx + (cx + 0.5) / q.cells - 0.5 + q.position[i], w = q.weight[i] * q.weight[j];
                    sum += w * node_value(m, x, y, w, gradient);
                }
        }
    return sum;
}

/* Outside radius r the flux share is (1 + k r^2)^(1 - beta) (r in half widths). */
double rx_moffat_radius_flux(double beta, double share)
{
    return sqrt(expm1(-log(share) / (beta - 1.0)) / expm1(M_LN2 / beta));
}

double rx_moffat_radius_level(double beta, double level)
{
    return sqrt(expm1(-log(level) / beta) / expm1(M_LN2 / beta));
}
