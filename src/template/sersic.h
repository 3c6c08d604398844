/* Sersic's (1963, Bol. AAA 6, 41) profiles I(r) ~ exp(-b (r / R)^(1/n)), R the half-light radius of all light to infinity, as Fourier
 * transforms: their Hankel transform by Mellin's,
 *
 *   S(q) = 1 / (2 pi Gamma(2n)) int dt Gamma(n z) 2^(1 - z) Gamma(1 - z/2) / Gamma(z/2) q^(z - 2),   z = 1 + i t,   q = 2 pi k R b^-n
 *
 * whose integrand falls as exp(-pi n |t| / 2), so that equidistant steps give it to rounding. Tabulated over ln(2 pi k R) and ln n. */
#ifndef RX_TEMPLATE_SERSIC_H
#define RX_TEMPLATE_SERSIC_H

#include "base/error.h"

#define RX_SERSIC_LOW 0.3
#define RX_SERSIC_HIGH 8.0

/* Nodes over ln(2 pi k R), cubic between them to 3e-6: -8 to 7; below, S is 1 to 2e-5 for any n. */
enum { RX_SERSIC_NODES = 240 };
#define RX_SERSIC_FIRST (-8.0)
#define RX_SERSIC_SPACING 0.0625

typedef struct rx_sersic_table rx_sersic_table;

/* Free with free(). Errors: RX_SYSTEM. */
rx_status rx_sersic_table_new(rx_sersic_table **dst, rx_error *err);

/* One index: S, its slope from node to node, and the same of d S / d ln n. */
typedef struct rx_sersic_line {
    float node[4][RX_SERSIC_NODES];
} rx_sersic_line;
void rx_sersic_set_index(const rx_sersic_table *table, double n, rx_sersic_line *line);

#endif
