/* Magnitude at which completeness falls to a given share.
 *
 * Scanned from the faint end: the faintest bin that reaches the share; linear interpolation between its
 * centre and that of the next fainter bin. Bins of fewer than RX_COMPLETENESS_MIN references are skipped, so
 * that one lucky match at the faint end decides nothing.
 */
#ifndef RX_VALIDATE_COMPLETENESS_H
#define RX_VALIDATE_COMPLETENESS_H

#include "base/error.h"
#include "validate/binomial.h"

enum { RX_COMPLETENESS_MIN = 5, RX_MAX_BINS = 60 };

/* edge[n + 1] rising; bin i holds edge[i] <= m < edge[i + 1]. */
typedef struct rx_bins {
    int n;
    double edge[RX_MAX_BINS + 1];
} rx_bins;

/* Bin of a magnitude, -1 outside or NAN. */
int rx_bins_index(const rx_bins *bins, double mag);

/* found[i] of total[i] in each bin. *beyond: 0 crossed inside the range; +1 the faintest bin still reaches
 * the share, the value is its faint edge and a lower limit; -1 no bin reaches it, the value is the bright
 * edge of the first bin and an upper limit. NAN when no bin holds enough references. */
double rx_completeness_mag(const rx_bins *bins, const double *found, const double *total, double share,
                           int *beyond);

/* The same from references, with a bootstrap interval; a limit makes that side infinite. */
rx_status rx_completeness(const rx_bins *bins, long n, const double *mag, const unsigned char *found,
                          double share, double level, unsigned long seed, rx_estimate *dst, rx_error *err);

#endif
