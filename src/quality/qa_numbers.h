/* All numbers of a tile's QA report: every run measured over all magnitudes and by magnitude, gates applied, and the errors of all
 * runs on the same references. */
#ifndef RX_QUALITY_QA_NUMBERS_H
#define RX_QUALITY_QA_NUMBERS_H

#include "data/psf.h"
#include "quality/gates.h"
#include "quality/metrics.h"
#include "quality/qa.h"

/* A gate on one run; gates on all runs have several. */
typedef struct rx_gate_result {
    const rx_gate *gate;
    int run; /* -1: the gate names a run that is not there */
    rx_estimate estimate;
    rx_verdict verdict;
} rx_gate_result;

/* Means over stars of one range of magnitude, a whole number of half magnitudes wide: rx_psf_star.off and 1 sigma, NAN of
 * a single star. */
enum { RX_QA_PSF_BINS = 12 };
typedef struct rx_qa_psf_bin {
    double mag, mean[3], error[3]; /* mag: middle of the range */
    long n;
} rx_qa_psf_bin;

typedef struct rx_qa_numbers {
    const rx_qa_params *par;
    const rx_qa_input *input;
    rx_bins bins;
    rx_evaluation *evaluation;              /* [nruns] */
    rx_estimate (*whole)[RX_METRIC_COUNT];  /* [nruns] */
    rx_estimate (*binned)[RX_METRIC_COUNT]; /* [nruns][bins.n] */
    double *common; /* [nruns] mean of 100 |F - F0| / F0 over the references that every run has matched */
    long ncommon;   /* so many */
    long nresults;
    rx_gate_result *result;
    rx_verdict verdict;
    int npsf_bins; /* 0: no star tests the PSF */
    rx_qa_psf_bin psf_bin[RX_QA_PSF_BINS];
    rx_arena memory; /* of the arrays above */
} rx_qa_numbers;

/* par and input must live as long. Free with rx_qa_numbers_free in any case. Errors: RX_USAGE (radius, magnitude
 * bins), RX_SYSTEM (memory), RX_INTERRUPTED. */
rx_status rx_qa_numbers_make(const rx_qa_params *par, const rx_qa_input *input, rx_qa_numbers *dst,
                             rx_error *err);
void rx_qa_numbers_free(rx_qa_numbers *numbers); /* content only */

static inline const rx_estimate *rx_qa_binned(const rx_qa_numbers *numbers, int run, int bin)
{
    return numbers->binned[run * numbers->bins.n + bin];
}

/* Of a star that tests the PSF; NAN without a flux. */
double rx_qa_star_mag(const rx_qa_psf *psf, const rx_psf_star *star);

#endif
