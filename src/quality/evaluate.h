/* One run against the reference: what is matched, missed, false or out of the count, and the differences of
 * every matched pair.
 *
 * Counted references lie inside the tile, not under the mask, and have a magnitude (one without, saturated in
 * the reference image say, is real but belongs to no bin). References that do not count are matched in a
 * second pass with what is left: a detection that belongs to one is neither right nor wrong (IGNORED), nor is
 * an unmatched detection whose own pixel is masked or outside.
 */
#ifndef RX_QUALITY_EVALUATE_H
#define RX_QUALITY_EVALUATE_H

#include "base/arena.h"
#include "base/error.h"
#include "quality/pr.h"
#include "quality/qa.h"

enum { RX_MAX_BINS = 60 };

/* edge[n + 1] rising; bin i holds edge[i] <= m < edge[i + 1]. */
typedef struct rx_bins {
    int n;
    double edge[RX_MAX_BINS + 1];
} rx_bins;

typedef enum rx_role { RX_ROLE_UNMATCHED, RX_ROLE_MATCHED, RX_ROLE_IGNORED } rx_role;

typedef struct rx_evaluation {
    const rx_qa_input *input;
    const rx_qa_run *run;
    rx_bins bins;
    long *partner;                        /* [truth.n] index in the run or -1 */
    long *origin;                         /* [run.n] index in the reference or -1 */
    unsigned char *truth_role, *run_role; /* rx_role */
    unsigned char *bright;                /* [run.n] match used for `offset`: error <= 0.05 mag, FLAGS < 4 */
    double *truth_mag, *run_mag;          /* NAN where unknown */
    /* per detection, NAN unless MATCHED and known */
    double *dx, *dy; /* run - reference, pixels */
    double *dmag;    /* run - reference, mag */
    double *ratio;   /* F/F0, F0 from the reference magnitude */
    double *pull;    /* (F - F0)/error, or in magnitudes where fluxes are unknown */
    int pull_in_flux;
    long references, references_ignored;
    long detections, detections_ignored;
    long matched;
    long made_up, made_up_matched; /* of the detections that count: marked, and matched all the same */
    double chance;                 /* matches expected if positions were unrelated: mean over shifted lists */
    rx_estimate offset;            /* zero point: median dmag of bright matches */
    rx_pr pr;
    double level;    /* of the intervals above */
    rx_arena memory; /* of the arrays above but for `partner`, which may be taken over */
} rx_evaluation;

/* Bins from the parameters or, low >= high, from the counted references (whole magnitudes). At most
 * RX_MAX_BINS; bins from the data widen to fit. RX_USAGE when the parameters ask for more. */
rx_status rx_evaluate_bins(const rx_qa_params *par, const rx_qa_input *input, rx_bins *bins, rx_error *err);

rx_status rx_evaluate(const rx_qa_params *par, const rx_qa_input *input, int run, const rx_bins *bins,
                      double level, rx_evaluation *dst, rx_error *err);
void rx_evaluation_free(rx_evaluation *evaluation); /* content only */

/* Precision of the detections that count and are not marked as spurious; NAN without any. */
double rx_evaluation_precision_without(const rx_evaluation *evaluation);

#endif
