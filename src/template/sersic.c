/* Sersic's profiles in Fourier space. */
#include "template/sersic.h"

#include <math.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/special.h"

static const double INDEX_SPACING = 0.1; /* of ln n */
/* Six neighbours in ln n, of which two and three are beyond the ends. */
enum { INDICES = 38, AROUND = 6, BEFORE = 2 };
static const double STEP = 0.06; /* of t: q S is repeated at ln q +- 105, where it is nothing */
static const double LAST = 28.0; /* -ln of the integrand where it ends */

struct rx_sersic_table {
    double value[INDICES][RX_SERSIC_NODES][2]; /* S and d S / d ln k */
};

static double index_of(int i)
{
    return RX_SERSIC_LOW * exp(INDEX_SPACING * (i - BEFORE));
}

/* One index at all nodes: terms of t and -t are conjugate, and each node's phase is turned on from the one before. */
static void fill(double n, double (*dst)[2])
{
    const double b = rx_gamma_p_inverse(2 * n, 0.5), turn = n * log(b);
    memset(dst, 0, sizeof *dst * RX_SERSIC_NODES);
    for (int j = 0; j * STEP * M_PI_2 * n < LAST; j++) {
        const double t = j * STEP;
        double ln[3], phase[3];
        rx_gamma_log_complex(n, n * t, &ln[0], &phase[0]);
        rx_gamma_log_complex(0.5, -0.5 * t, &ln[1], &phase[1]); /* 1 - z/2 and z/2 are conjugate */
        (void)ln[1];
        const double size = (j > 0 ? 2 : 1) * STEP / (2 * M_PI) * exp(ln[0] - rx_gamma_log(2 * n));
        double angle = phase[0] + 2 * phase[1] - t * M_LN2 + t * (RX_SERSIC_FIRST - turn), re = cos(angle),
               im = sin(angle);
        const double c = cos(t * RX_SERSIC_SPACING), s = sin(t * RX_SERSIC_SPACING);
        for (int k = 0; k < RX_SERSIC_NODES; k++) {
            dst[k][0] += size * re;
            dst[k][1] += size * (-re - t * im); /* z - 2 = -1 + i t */
            const double next = c * re - s * im;
            im = s * re + c * im;
            re = next;
        }
    }
    for (int k = 0; k < RX_SERSIC_NODES; k++)
        for (int i = 0; i < 2; i++)
            dst[k][i] *= exp(turn - RX_SERSIC_FIRST - k * RX_SERSIC_SPACING);
}

rx_status rx_sersic_table_new(rx_sersic_table **dst, rx_error *err)
{
    RX_TRY(RX_MAKE(*dst, 1, err));
    for (int i = 0; i < INDICES; i++)
        fill(index_of(i), (*dst)->value[i]);
    return RX_OK;
}

/* Lagrange's polynomials through the six indices around n, and their derivatives. */
void rx_sersic_set_index(const rx_sersic_table *table, double n, rx_sersic_line *line)
{
    const double at = log(fmin(fmax(n, RX_SERSIC_LOW), RX_SERSIC_HIGH) / RX_SERSIC_LOW) / INDEX_SPACING;
    const int first = rx_min_int((int)at, INDICES - AROUND);
    const double x = at + BEFORE - first;
    double weight[AROUND], slope[AROUND];
    for (int i = 0; i < AROUND; i++) {
        weight[i] = 1;
        slope[i] = 0;
        for (int k = 0; k < AROUND; k++)
            if (k != i) {
                slope[i] = (slope[i] * (x - k) + weight[i]) / (i - k);
                weight[i] *= (x - k) / (i - k);
            }
    }
    for (int j = 0; j < RX_SERSIC_NODES; j++) {
        double sum[4] = {0};
        for (int i = 0; i < AROUND; i++)
            for (int d = 0; d < 2; d++) {
                sum[d] += weight[i] * table->value[first + i][j][d];
                sum[2 + d] += slope[i] / INDEX_SPACING * table->value[first + i][j][d];
            }
        for (int d = 0; d < 4; d++)
            line->node[d][j] = (float)(d % 2 == 0 ? sum[d] : sum[d] * RX_SERSIC_SPACING);
    }
}
