/* Magnitude at which completeness falls to a given share.
 *
 * Completeness is taken to fall with magnitude: the falling curve that is nearest to the references found and
 * missed (isotonic regression by pooling adjacent violators, Ayer et al. 1955, Ann. Math. Statist. 26, 641),
 * counted in 36 narrow bins of the range whatever the bins of tables and figures; linear interpolation
 * between the two bins where it crosses the share. So neither one lucky match at the faint end nor wide bins
 * decide: interpolation in the usual bins of 0.25 to 1 mag puts the magnitude of 90 % by 0.05 to 0.7 mag too
 * bright where the curve is as steep as that of point sources. Of fewer than RX_COMPLETENESS_MIN references:
 * NAN.
 */
#ifndef RX_QUALITY_COMPLETENESS_H
#define RX_QUALITY_COMPLETENESS_H

#include "base/error.h"
#include "quality/statistics.h"

enum { RX_COMPLETENESS_MIN = 5, RX_MAX_BINS = 60 };

/* edge[n + 1] rising; bin i holds edge[i] <= m < edge[i + 1]. */
typedef struct rx_bins {
    int n;
    double edge[RX_MAX_BINS + 1];
} rx_bins;

/* Bin of a magnitude, -1 outside or NAN. */
int rx_bins_index(const rx_bins *bins, double mag);

/* References with magnitude and whether they were found. */
typedef struct rx_found {
    long n;
    const double *mag;
    const unsigned char *found;
} rx_found;

/* Those outside the range of the bins do not count. Where the curve is above the share to its end, the value is that end and a lower limit (the interval is
 * open there); below from its beginning, an upper limit. Bootstrap interval from RX_BOOTSTRAP_FEWEST
 * references on. Errors: RX_SYSTEM. */
rx_status rx_completeness(const rx_bins *bins, const rx_found *list, double share, double level,
                          rx_resampling by, rx_estimate *dst, rx_error *err);

#endif
