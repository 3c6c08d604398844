/* Everything that the photometry report says, as numbers.
 *
 * A set holds stars of one magnitude, on tiles of their own. For one restorer and one set, above a score s:
 *   recall(s)    = stars found with a score >= s / all stars
 *   precision(s) = stars found with a score >= s / (those + false detections with a score >= s)
 * where false detections are the ones on the set's own tiles that are no object, injected or known. Precision
 * therefore depends on how many stars a tile was given, the same number for every restorer.
 *
 * Equal precision: for each restorer and field the lowest score at which precision over all sets together is
 * at least P; completeness there is compared. A restorer whose whole list has precision above P is not helped
 * by this: its list ends early (`whole_list`).
 */
#ifndef RX_LAB_PHOTOMETRY_NUMBERS_H
#define RX_LAB_PHOTOMETRY_NUMBERS_H

#include <stdint.h>

#include "base/error.h"
#include "lab/findings.h"
#include "lab/photometry.h"
#include "quality/hypothesis.h"
#include "quality/pr.h"

/* Stars of one magnitude on a kind of field. */
typedef struct rx_photometry_set {
    double mag, snr; /* snr in a matched filter on this field, background-limited */
    long ntiles, nstars;
    double mpixels;
    const rx_lab_table *star, *wrong;
} rx_photometry_set;

rx_photometry_set rx_photometry_set_of(const rx_lab *lab, int field, int set);

/* Columns of star i through a run. */
static inline const double *rx_star_of(const rx_photometry_set *set, int run, long i)
{
    return rx_lab_each(set->star, i, run);
}

/* One restorer on one set: value, 95 % interval and how many stars are behind it. */
typedef struct rx_photometry_cell {
    rx_estimate recall, precision, ap;
    rx_estimate complete[RX_PRECISIONS_MAX]; /* at equal precision */
    rx_estimate magerr;                      /* mean of 100 |F - F0| / F0, stars found (the paper's) */
    rx_estimate magerr_clean;                /* the same without blends (FLAGS) */
    rx_estimate crowded;                     /* share of the stars found that are flagged as blended */
    rx_estimate bias_percent, scatter_percent;
    rx_estimate bias_mag, scatter_mag;
    rx_estimate pull_median, pull_width;
    rx_pr pr;
} rx_photometry_cell;

/* One quantity of a cell. */
typedef enum rx_cell_quantity {
    RX_CELL_RECALL,
    RX_CELL_PRECISION,
    RX_CELL_AP,
    RX_CELL_MAGERR,
    RX_CELL_MAGERR_CLEAN,
    RX_CELL_CROWDED,
    RX_CELL_BIAS_PERCENT,
    RX_CELL_SCATTER_PERCENT,
    RX_CELL_BIAS_MAG,
    RX_CELL_SCATTER_MAG,
    RX_CELL_PULL_MEDIAN,
    RX_CELL_PULL_WIDTH,
    RX_CELL_QUANTITIES
} rx_cell_quantity;

const rx_estimate *rx_cell_get(const rx_photometry_cell *cell, rx_cell_quantity quantity);

/* A threshold of one restorer on one field, for one precision. */
typedef struct rx_photometry_cut {
    double score;          /* +infinity: the precision is never reached */
    rx_estimate precision; /* over all sets, as it came out */
    rx_estimate recall;    /* over all sets */
    int whole_list;        /* the list ends before precision falls so low: completeness is a lower limit */
    rx_estimate mag50, mag90;
} rx_photometry_cut;

/* One restorer on one field. */
typedef struct rx_photometry_whole {
    rx_estimate recall, precision; /* over all sets, whole lists */
    rx_estimate mag50, mag90;      /* whole lists */
    rx_estimate false_per_mpixel;  /* n: false detections */
    rx_photometry_cut cut[RX_PRECISIONS_MAX];
} rx_photometry_whole;

/* Two restorers on the stars of one set; differences are first - second. */
typedef struct rx_found_duel {
    long only_first, only_second;
    double p, holm; /* McNemar's exact test; Holm over the sets of the field */
    int winner;     /* +1 the first finds more, -1 the second (holm < 0.05), 0 undecided */
} rx_found_duel;

typedef struct rx_photometry_duel {
    rx_found_duel found;                       /* whole lists */
    rx_found_duel complete[RX_PRECISIONS_MAX]; /* at equal precision */
    rx_test paired, wilcoxon;                  /* 100 |F - F0| / F0 of the stars that both found */
    double holm, holm_wilcoxon;
    int winner; /* +1 the first has the smaller errors (holm < 0.05), -1 the second, 0 undecided */
} rx_photometry_duel;

typedef struct rx_run_pair {
    int first, second;
} rx_run_pair;

enum { RX_RUN_PAIRS_MAX = RX_METHODS_MAX * (RX_METHODS_MAX - 1) / 2 };

typedef struct rx_photometry_numbers {
    const rx_lab *lab;
    int none, net; /* runs of these names, -1 none */
    int npairs;
    rx_run_pair pair[RX_RUN_PAIRS_MAX]; /* the later run against each earlier one */
    int nprecisions;
    double precision[RX_PRECISIONS_MAX];
    rx_photometry_cell *cell;   /* [nfields][nsets][nruns] */
    rx_photometry_whole *whole; /* [nfields][nruns] */
    rx_photometry_duel *duel;   /* [nfields][nsets][npairs] */
} rx_photometry_numbers;

/* Borrows the sets. Without precisions in them: 0.95 and 0.99. */
rx_status rx_photometry_numbers_make(const rx_lab *lab, uint64_t seed, rx_photometry_numbers *dst,
                                     rx_error *err);
void rx_photometry_numbers_free(rx_photometry_numbers *numbers); /* content only */

const rx_photometry_cell *rx_photometry_cell_of(const rx_photometry_numbers *numbers, int field, int set,
                                                int run);
const rx_photometry_whole *rx_photometry_whole_of(const rx_photometry_numbers *numbers, int field, int run);
const rx_photometry_duel *rx_photometry_duel_of(const rx_photometry_numbers *numbers, int field, int set,
                                                int pair);

/* Figures of the fields: "field0-...", precision-recall curves "curve0-..." */
void rx_photometry_figures(rx_figures *dst, const rx_photometry_numbers *numbers);

/* One verdict for each claim that it is asked about. rx_claim_verdicts_free(). */
void rx_photometry_verdicts(const rx_photometry_numbers *numbers, rx_claim_verdicts *verdicts);

/* Plain sentences about one pair on one field: where the first finds more or fewer stars, with smaller or
 * larger errors. */
void rx_photometry_pair_words(rx_text *dst, const rx_photometry_numbers *numbers, int field, int pair);

/* What photometry_numbers.c and photometry_duels.c share. */
rx_status rx_photometry_duels_make(rx_photometry_numbers *numbers, int field, rx_error *err);

rx_status rx_photometry_report(const rx_lab *lab, const rx_lab_output *output, rx_error *err);

#endif
