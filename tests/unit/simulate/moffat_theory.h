/* The Moffat profile written the textbook way, and integrals of it by brute force: what the simulator's
 * numbers are held against. */
#ifndef TESTS_MOFFAT_THEORY_H
#define TESTS_MOFFAT_THEORY_H

#include <math.h>

typedef struct theory {
    double fwhm, beta, ratio, angle; /* fwhm: geometric mean of the axes */
} theory;

static inline double theory_alpha(const theory *t)
{
    return t->fwhm / (2.0 * sqrt(pow(2.0, 1.0 / t->beta) - 1.0));
}

/* Flux 1 over the plane. */
static inline double theory_value(const theory *t, double x, double y)
{
    double u = x * cos(t->angle) + y * sin(t->angle), v = -x * sin(t->angle) + y * cos(t->angle);
    double alpha = theory_alpha(t), r2 = u * u * t->ratio + v * v / t->ratio;
    return (t->beta - 1.0) / (M_PI * alpha * alpha) * pow(1.0 + r2 / (alpha * alpha), -t->beta);
}

/* Over the rectangle of that centre and size, by Simpson's rule on 2 steps x 2 steps intervals. */
static inline double theory_box(const theory *t, double x, double y, double size, int steps)
{
    const int n = 2 * steps;
    double sum = 0.0;
    for (int j = 0; j <= n; j++)
        for (int i = 0; i <= n; i++) {
            double wx = i == 0 || i == n ? 1.0
                        : i % 2          ? 4.0
                                         : 2.0,
                   wy = j == 0 || j == n ? 1.0
                        : j % 2          ? 4.0
                                         : 2.0;
            sum +=
                wx * wy * theory_value(t, x + ((double)i / n - 0.5) * size, y + ((double)j / n - 0.5) * size);
        }
    return sum * size * size / (9.0 * n * n);
}

/* Round: share of the flux within r. */
static inline double theory_within(const theory *t, double r)
{
    double alpha = theory_alpha(t);
    return 1.0 - pow(1.0 + r * r / (alpha * alpha), 1.0 - t->beta);
}

#endif
