/* Everything that the restoration report says, as numbers: summaries of each method in each bin and duels
 * between methods on the same scenes. */
#ifndef RX_LAB_RESTORATION_NUMBERS_H
#define RX_LAB_RESTORATION_NUMBERS_H

#include <stdint.h>

#include "base/error.h"
#include "lab/claims.h"
#include "lab/paper.h"
#include "lab/results.h"
#include "quality/hypothesis.h"
#include "report/figure.h"

typedef enum rx_quality { RX_PSNR, RX_SSIM, RX_QUALITIES } rx_quality;

enum { RX_PAIRS_MAX = 2 * RX_METHODS_MAX };

/* a = first, b = second: differences are first - second, positive where the first is better. */
typedef struct rx_method_pair {
    int first, second;
} rx_method_pair;

/* A test that cannot be made (fewer than 2 scenes, or no spread at all) has statistic and p NAN. */
typedef struct rx_quality_duel {
    long n;                /* scenes on which both have a finite value */
    rx_test paired;        /* Student, effect = d_z, difference = mean with its t interval */
    rx_test wilcoxon;      /* signed ranks */
    rx_test two_sample;    /* as the paper: pooled variance, effect = Cohen's d */
    rx_estimate bootstrap; /* of the mean difference */
    double holm;           /* paired p, adjusted for the bins of this quantity */
    double holm_wilcoxon;  /* the same for Wilcoxon's p */
    int winner;            /* +1 the first, -1 the second (holm < 0.05), 0 undecided */
} rx_quality_duel;

typedef struct rx_restoration_numbers {
    const rx_restoration_results *results;
    int blurred, smoothed, rl, flat, net; /* methods of these names (flat: RL_FLAT), -1 none */
    int npairs, chief;                    /* chief: the pair beside the paper's tables, -1 none */
    rx_method_pair pair[RX_PAIRS_MAX];
    rx_five_numbers *box;   /* [nbins][RX_QUALITIES][nmethods] */
    rx_estimate *mean;      /* the same, with its 95 % t interval */
    rx_quality_duel *duel;  /* [nbins][RX_QUALITIES][npairs] */
    rx_five_numbers *level; /* [nbins] noise levels of its scenes (nn/noise_level.h) */
    char *inside;           /* [nbins]: seeing and median noise level are inside the training */
    char *
        fainter; /* [nbins]: that level is above those of all fields of the training, which yet has patches so faint */
} rx_restoration_numbers;

/* Borrows the results. Free with rx_restoration_numbers_free(). */
rx_status rx_restoration_numbers_make(const rx_restoration_results *results, uint64_t seed,
                                      rx_restoration_numbers *dst, rx_error *err);
void rx_restoration_numbers_free(rx_restoration_numbers *numbers); /* content only */

const rx_five_numbers *rx_quality_box(const rx_restoration_numbers *numbers, int bin, rx_quality quality,
                                      int method);
const rx_estimate *rx_quality_mean(const rx_restoration_numbers *numbers, int bin, rx_quality quality,
                                   int method);
const rx_quality_duel *rx_quality_duel_of(const rx_restoration_numbers *numbers, int bin, rx_quality quality,
                                          int pair);
int rx_method_pair_find(const rx_restoration_numbers *numbers, int first, int second); /* -1 none */

/* Choices of tuning, two for each tuned method and bin, and how many of them lie at an end of what was tried.
 */
void rx_tuning_ends(const rx_restoration_results *results, int *ends, int *choices);

double rx_bin_centre(const rx_restoration_bin *bin);
/* Of a larger FWHM, or of more noise than the fields of the training: what the paper calls beyond its range. */
int rx_bin_is_beyond(const rx_restoration_numbers *numbers, int bin);
const char *rx_quality_name(rx_quality quality); /* "PSNR" */
const char *rx_quality_unit(rx_quality quality); /* "dB", "" */

/* One verdict for each claim that it is asked about. rx_claim_verdicts_free(). */
void rx_restoration_verdicts(const rx_restoration_numbers *numbers, rx_claim_verdicts *verdicts);

/* Figures, ids by what is binned: "fwhm-...", "sigma-...", and "example0-..." */
void rx_restoration_figures(rx_figures *dst, const rx_restoration_numbers *numbers);

rx_status rx_restoration_report(const rx_restoration_results *results, const rx_lab_output *output,
                                rx_error *err);

/* Plain sentences: where the first of a pair is better, worse, undecided, for both qualities and kinds. */
void rx_restoration_pair_words(rx_text *dst, const rx_restoration_numbers *numbers, int pair);

#endif
