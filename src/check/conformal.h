/* MAGERR_INJECTED: errors of template fluxes that hold whatever their distribution is, from objects injected into the
 * tile.
 *
 * Split conformal prediction (Vovk, Gammerman & Shafer 2005, Algorithmic Learning in a Random World) with normalised
 * scores |flux - truth| / error of the injected objects that were found, in groups of like S/N and like blending: the
 * error at level c is the least score q, times the error, such that scores up to q hold c of all weight, that of the
 * new source, of the group's mean, among it: with equal weights score number ceil((n + 1) c) of n. Injected objects
 * are evenly spread in magnitude and those of the sky are not: each weighs 1 / true flux (counts as 1 / flux;
 * Tibshirani, Barber, Candes & Ramdas 2019, NeurIPS 32). */
#ifndef RX_CHECK_CONFORMAL_H
#define RX_CHECK_CONFORMAL_H

#include "base/error.h"

enum { RX_CONFORMAL_LEVELS = 2 }; /* 0.6827, as one sigma of a normal distribution, and 0.95 */

/* An injected object that was found. */
typedef struct rx_conformal_case {
    double snr, blend; /* as measured: flux over error, correlation with a neighbour's flux */
    double score;      /* |flux - truth| / error */
    double weight;
} rx_conformal_case;

typedef struct rx_conformal rx_conformal;

/* Cases with a number that is not finite are left out. *dst is freed with rx_conformal_free(). Errors: RX_SYSTEM. */
rx_status rx_conformal_new(const rx_conformal_case *cases, long n, rx_conformal **dst, rx_error *err);
void rx_conformal_free(rx_conformal *conformal); /* NULL is fine */

/* factor[]: what the error of a source is to be multiplied by, NAN where the group is too small to say, or nothing so
 * bright was injected. conformal NULL: NAN. */
void rx_conformal_at(const rx_conformal *conformal, double snr, double blend,
                     double factor[RX_CONFORMAL_LEVELS]);

long rx_conformal_cases(const rx_conformal *conformal); /* behind it */
int rx_conformal_groups(const rx_conformal *conformal);

#endif
