/* Stars: points between the cells of a grid. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "simulate/render_parts.h"

/* Kaiser's window (Kaiser 1974): shape for a ripple of 1e-5, half width in cells; the band that is left flat
 * ends at 1/2 - sqrt(shape^2 + pi^2) / (4 pi HALF) or a little beyond. */
#define SHAPE 10.06
enum { HALF = RX_STAR_TAPS / 2, STEPS = 1024 }; /* linear between 1024 points per cell: 4e-7 */

struct rx_star_kernel {
    double value[HALF * STEPS + 2]; /* at distance i / STEPS cells */
};

/* Modified Bessel function of order 0 by its power series. */
static double bessel_i0(double x)
{
    double term = 1.0, sum = 1.0, quarter = 0.25 * x * x;
    for (int k = 1; term > 1e-17 * sum; k++) {
        term *= quarter / ((double)k * k);
        sum += term;
    }
    return sum;
}

rx_star_kernel *rx_star_kernel_new(void)
{
    rx_star_kernel *kernel = RX_NEW(rx_star_kernel, 1);
    if (kernel == NULL)
        return NULL;
    kernel->value[0] = 1.0;
    for (int i = 1; i < HALF * STEPS; i++) {
        double t = (double)i / STEPS, s = t / HALF;
        kernel->value[i] =
            sin(M_PI * t) / (M_PI * t) * bessel_i0(SHAPE * sqrt(1.0 - s * s)) / bessel_i0(SHAPE);
    }
    return kernel;
}

/* Weights of the cells from the first one on, which is returned; their sum is 1. */
static double weights(const rx_star_kernel *kernel, double u, double weight[RX_STAR_TAPS])
{
    double first = floor(u) - (HALF - 1), sum = 0.0;
    for (int k = 0; k < RX_STAR_TAPS; k++) {
        double at = fabs(u - (first + k)) * STEPS;
        int i = at < HALF * STEPS ? (int)at : HALF * STEPS;
        weight[k] = kernel->value[i] + (at - i) * (kernel->value[i + 1] - kernel->value[i]);
        sum += weight[k];
    }
    for (int k = 0; k < RX_STAR_TAPS; k++)
        weight[k] /= sum;
    return first;
}

void rx_star_draw(const rx_star_kernel *kernel, double u, double v, double flux, long column, long row,
                  rx_fine_grid *grid)
{
    if (!(u > column - HALF - 1.0 && u < column + grid->width + HALF + 1.0 && v > row - HALF - 1.0 &&
          v < row + grid->height + HALF + 1.0))
        return;
    double wx[RX_STAR_TAPS], wy[RX_STAR_TAPS];
    long i0 = (long)weights(kernel, u, wx) - column, j0 = (long)weights(kernel, v, wy) - row;
    int from = i0 < 0 ? (int)-i0 : 0;
    int to = i0 + RX_STAR_TAPS > grid->width ? (int)(grid->width - i0) : RX_STAR_TAPS;
    for (int l = 0; l < RX_STAR_TAPS; l++) {
        long j = j0 + l;
        if (j < 0 || j >= grid->height)
            continue;
        float *cells = grid->cells + (size_t)j * grid->stride;
        for (int k = from; k < to; k++)
            cells[i0 + k] += (float)(flux * wy[l] * wx[k]);
    }
}
