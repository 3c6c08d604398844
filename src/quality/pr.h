/* Precision-recall curve and average precision.
 *
 *   AP = sum_n (R_n - R_(n-1)) P_n,   R_0 = 0
 *
 * over thresholds of falling score, without interpolation; detections of equal score enter together.
 * References never detected keep R below 1, so AP counts them against the run.
 */
#ifndef RX_QUALITY_PR_H
#define RX_QUALITY_PR_H

#include "base/error.h"
#include "quality/statistics.h"

typedef struct rx_pr_point {
    double score, recall, precision;
    long detections, matched; /* with this score or a higher one */
} rx_pr_point;

typedef struct rx_pr {
    long n;
    rx_pr_point *point; /* falling score */
    rx_estimate ap;     /* value only, see rx_pr_interval(); NAN without references */
} rx_pr;

/* n detections with score (NAN = ranked last) and whether they are matched; `references` in all. */
rx_status rx_pr_make(long n, const double *score, const unsigned char *matched, long references, rx_pr *dst,
                     rx_error *err);
void rx_pr_free(rx_pr *pr); /* content only */

/* Bootstrap interval of AP over matched pairs, false detections and missed references. */
rx_status rx_pr_interval(const rx_pr *pr, long references, double level, rx_resampling by, rx_estimate *dst,
                         rx_error *err);

#endif
