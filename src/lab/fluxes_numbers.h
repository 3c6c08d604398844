/* Everything that the report of a campaign of fluxes says, as numbers.
 *
 * A cell holds objects of a kind, in a company, of a bin of true S/N, and one flux of one restorer, with
 * r = F / F0, F0 the true flux:
 *
 *   bias     -2.5 log10(median r), mag
 *   scatter  2.5 / ln 10 sigma_MAD(r), mag
 *   bound    isolated stars: sigma_MAD((r - 1) / b), b the error of a matched filter over F0
 *   pull     median of (F - F0) / error, the one that the flux gives itself
 *   width    sigma_MAD of the pulls
 *   magerr   mean of 100 |F - F0| / F0
 *
 * sigma_MAD = 1.4826 median |v - median|. Intervals are at 95 % for normal samples, 1.96 times
 *
 *   median     1.2533 sigma / sqrt(n)
 *   sigma_MAD  1.1664 sigma / sqrt(n)
 *   mean       s / sqrt(n)
 *
 * (Rousseeuw and Croux 1993, J. Am. Stat. Assoc. 88, 1273: efficiencies of 64 and 37 %). Objects of one tile
 * share its background, which they do not know. */
#ifndef RX_LAB_FLUXES_NUMBERS_H
#define RX_LAB_FLUXES_NUMBERS_H

#include "lab/claims.h"
#include "lab/fluxes.h"
#include "quality/binomial.h"

/* Bins of true S/N; those from RX_SNR_SINGLE on hold several others. */
enum { RX_SNR_SINGLE = 6, RX_SNR_5_100 = 6, RX_SNR_ABOVE_10 = 7, RX_SNR_BINS = 8 };
typedef struct rx_snr_bin {
    const char *name;
    double low, high;
} rx_snr_bin;
const rx_snr_bin *rx_snr_bin_get(int bin);

/* Company as numbers know it; APART: blended, and told apart: it and the partner were
 * found, each nearer than half the separation. */
typedef enum rx_crowd {
    RX_CROWD_ISOLATED,
    RX_CROWD_BLENDED,
    RX_CROWD_APART,
    RX_CROWD_NEITHER,
    RX_CROWDS
} rx_crowd;
const char *rx_crowd_name(rx_crowd crowd);

/* ALL: found (APART: told apart) by this restorer. DETECTED: without sources that only the residual of the
 * templates showed, of which AUTO and apertures know nothing. COMMON: DETECTED by every restorer. All fluxes
 * of a restorer are of the same objects. */
typedef enum rx_fluxes_sample {
    RX_SAMPLE_ALL,
    RX_SAMPLE_DETECTED,
    RX_SAMPLE_COMMON,
    RX_SAMPLES
} rx_fluxes_sample;
const char *rx_fluxes_sample_name(int sample);

typedef struct rx_fluxes_cell {
    rx_estimate bias, scatter, bound, pull, width, magerr;
} rx_fluxes_cell;

/* Where a cell is. */
typedef struct rx_fluxes_place {
    int condition, scene;
    rx_fluxes_sample sample;
    int galaxy;
    rx_crowd crowd;
    int bin, run;
    rx_flux_kind flux;
} rx_fluxes_place;

/* Pairs by separation; differences of magnitudes of the pairs of which both are found (each nearer than half
 * the separation), second member less first, measured less true. A flux below a thousandth of the true one
 * counts as that. Samples as above, ALL and DETECTED. */
enum { RX_PAIR_BINS = 5, RX_PAIR_SAMPLES = RX_SAMPLE_DETECTED + 1 };
extern const double RX_PAIR_EDGE[RX_PAIR_BINS + 1]; /* FWHM */
typedef struct rx_pair_cell {
    rx_estimate ratio, scatter; /* median and sigma_MAD of the difference */
    rx_estimate size;           /* median of its absolute value */
    rx_estimate total;          /* median error of the magnitude of both together */
} rx_pair_cell;

/* Invented sources of one restorer; 0 as detected, 1 without those that are marked as spurious. */
typedef struct rx_invented_cell {
    long right[2], wrong[2], added;
    rx_estimate per_mpixel[2], precision[2];
    rx_estimate flagged_weak, flagged_strong; /* share of the true ones marked: S/N 5 to 7, above 7 */
    rx_estimate pieces[2];                    /* SHREDS: mean per galaxy that was found, itself among them */
} rx_invented_cell;

typedef struct rx_fluxes_numbers {
    const rx_lab *lab;
    rx_fluxes_cell *cell;
    rx_pair_cell *pair; /* [nconditions][nscenes][RX_PAIR_SAMPLES][RX_PAIR_BINS][nruns][RX_FLUX_KINDS] */
    rx_estimate *both;  /* share of the pairs, [nconditions][nscenes][RX_PAIR_SAMPLES][RX_PAIR_BINS][nruns] */
    rx_invented_cell *invented; /* [nconditions][nscenes][nruns] */
} rx_fluxes_numbers;

rx_status rx_fluxes_numbers_make(const rx_lab *lab, rx_fluxes_numbers *dst, rx_error *err);
void rx_fluxes_numbers_free(rx_fluxes_numbers *numbers); /* content only */

const rx_fluxes_cell *rx_fluxes_cell_of(const rx_fluxes_numbers *numbers, const rx_fluxes_place *place);
typedef struct rx_pair_place {
    int condition, scene;
    rx_fluxes_sample sample; /* ALL, DETECTED */
    int bin, run;
} rx_pair_place;
const rx_pair_cell *rx_pair_cell_of(const rx_fluxes_numbers *numbers, const rx_pair_place *place,
                                    rx_flux_kind flux);
const rx_estimate *rx_pair_share(const rx_fluxes_numbers *numbers, const rx_pair_place *place);
const rx_invented_cell *rx_invented_of(const rx_fluxes_numbers *numbers, int condition, int scene, int run);

/* Of every goal for every restorer: in FIELD, PAIRS and INJECTED, where restorers are given the truth. */
void rx_fluxes_verdicts(const rx_fluxes_numbers *numbers, rx_claim_verdicts *verdicts);

#endif
