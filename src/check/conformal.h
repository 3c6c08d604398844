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

enum { RX_CONFORMAL_LEVELS = 2 }; /* 0.6827, as one sigma of a normal distribution, and 0.95 */
enum { RX_CONFORMAL_GROUPS = 8 }; /* at most of isolated ones, of blended ones */

/* An injected object that was found. */
typedef struct rx_conformal_case {
    double snr, blend; /* as measured: flux over error, correlation with a neighbour's flux */
    double score;      /* |flux - truth| / error */
    double weight;
} rx_conformal_case;

typedef struct rx_conformal_group {
    double below; /* S/N */
    double factor[RX_CONFORMAL_LEVELS];
} rx_conformal_group;

/* {0}: nothing was injected. */
typedef struct rx_conformal {
    long n;    /* cases behind it */
    int split; /* are blended ones by themselves? */
    struct {
        int n;
        rx_conformal_group groups[RX_CONFORMAL_GROUPS];
    } places[2]; /* isolated or all; blended */
} rx_conformal;

/* Cases with a number that is not finite are left out; the rest are put into another order. */
void rx_conformal_fit(rx_conformal_case *cases, long n, rx_conformal *dst);

/* factor[]: what the error of a source is to be multiplied by, NAN where the group is too small to say, or nothing so
 * bright was injected. */
void rx_conformal_at(const rx_conformal *conformal, double snr, double blend,
                     double factor[RX_CONFORMAL_LEVELS]);

#endif
