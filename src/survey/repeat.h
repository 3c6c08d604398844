/* Repeatability: what two measurements of one source say of the errors of both, without any truth.
 *
 * Of pairs of visits, d the difference of magnitudes with the visits' zero points taken off:
 *
 *   PA1 = 1.4826 MAD(d) / sqrt 2     the scatter of one measurement
 *   PF1 = share of |d| / sqrt 2 > PA2
 *
 * PA1, PA2, PF1 and AM1 are those of the LSST Science Requirements Document (Ivezic & the LSST Science Collaboration, LPM-17),
 * where PA1 is the rms about the mean of many visits, and PF1 the share of measurements farther from that than PA2: of two
 * visits |d| / sqrt 2 is what has the scatter of one measurement. Of k visits all k (k - 1) / 2 pairs count; these hold each
 * measurement k - 1 times, so that intervals are widened by sqrt(k / 2). */
#ifndef RX_SURVEY_REPEAT_H
#define RX_SURVEY_REPEAT_H

#include "base/error.h"
#include "quality/binomial.h"

enum { RX_REPEAT_FEW = 10, RX_REPEAT_STARS = 1500 };

/* A source of two visits. */
typedef struct rx_repeat_pair {
    double dm;     /* second - first, mag, zero point taken off */
    double error;  /* of dm as claimed, mag */
    double pull;   /* (F1 - F2) / its claimed error: of fluxes, as errors of magnitudes are not symmetric */
    double snr;    /* mean flux over the rms of both errors */
    double x, y;   /* of the first visit, arcsec on the tangent plane, east and north */
    double dx, dy; /* second - first, arcsec, offset taken off */
    int star;      /* a point source in both visits, or not in both */
} rx_repeat_pair;

/* From magnitudes and their errors; 0 where one of them is no number or the error is not positive. */
int rx_repeat_photometry(const double mag[2], const double error[2], double zero_point, rx_repeat_pair *dst);

/* Which pairs. */
typedef struct rx_repeat_cut {
    double snr_low, snr_high;
    int star;       /* 1: point sources, 0: others, -1: all */
    double outlier; /* PA2, mag */
    int visits;
} rx_repeat_cut;

/* Of one measurement, but for the pulls. 95 % intervals: Clopper-Pearson of shares, of order statistics else. Of fewer than
 * RX_REPEAT_FEW pairs scatter and medians are NAN. */
typedef struct rx_repeat_numbers {
    long n;
    rx_estimate scatter;           /* PA1, mag */
    double rms;                    /* the same from the mean of d^2, which outliers rule; mag */
    double claimed;                /* median of the claimed errors, mag */
    rx_estimate outliers;          /* PF1 */
    rx_estimate pull, pull_median; /* 1 and 0 where errors are true */
    rx_estimate axis[2];           /* east, north: 1.4826 MAD / sqrt 2; arcsec */
    long separations;              /* of stars 4 to 6 arcmin apart, the brightest RX_REPEAT_STARS at most */
    double separation;             /* AM1: 1.4826 MAD / sqrt 2 of their change from visit to visit, arcsec */
} rx_repeat_numbers;

/* Errors: RX_SYSTEM. */
rx_status rx_repeat_measure(const rx_repeat_cut *cut, long n, const rx_repeat_pair *pairs,
                            rx_repeat_numbers *dst, rx_error *err);

/* AM1 alone, as it takes pairs of pairs: into `separations` and `separation`. Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_repeat_separations(const rx_repeat_cut *cut, long n, const rx_repeat_pair *pairs,
                                rx_repeat_numbers *dst, rx_error *err);

#endif
