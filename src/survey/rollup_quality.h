/* Tiles that stand out among the others, and what goes with time, airmass or another card of the headers. */
#ifndef RX_SURVEY_ROLLUP_QUALITY_H
#define RX_SURVEY_ROLLUP_QUALITY_H

#include "base/error.h"
#include "report/figure.h"
#include "report/report.h"
#include "survey/rollup.h"

/* One image of a tile. `why` names what is off, its value and the survey's: up to three, the furthest first. */
typedef struct rx_rollup_outlier {
    const rx_rollup_row *row; /* NULL: the tile has none */
    const char *name, *image, *page;
    int hdu, rank; /* rank: 2 failed or without a record, 1 a gate that failed, 0 far from the others */
    double off;    /* robust sigmas; 0 of failures */
    char *why;     /* owned */
} rx_rollup_outlier;

typedef struct rx_rollup_outliers {
    int n;
    rx_rollup_outlier *of; /* [n] worst first */
} rx_rollup_outliers;

/* Far: more than 6 robust sigmas (sigma_MAD of the images that one restorer did, not below a floor of each quantity)
 * from the median, with ten images or more. Errors: RX_SYSTEM. */
rx_status rx_rollup_outliers_find(const rx_rollup *rollup, rx_rollup_outliers *dst, rx_error *err);
void rx_rollup_outliers_free(rx_rollup_outliers *outliers); /* content only */

/* Rank correlation (Spearman) of each quantity with each card that the records hold; a table, and figures "trend-..." of
 * the strongest where it is beyond 4 sigma. Errors: RX_SYSTEM. */
rx_status rx_rollup_trends(const rx_rollup *rollup, rx_report *report, rx_report_table **dst, rx_error *err);

#endif
