/* Tiles that stand out among the others, and what goes with time, airmass or another card of the headers. */
#ifndef RX_SURVEY_ROLLUP_QUALITY_H
#define RX_SURVEY_ROLLUP_QUALITY_H

#include "base/error.h"
#include "report/figure.h"
#include "report/report.h"
#include "survey/rollup.h"

/* rollup->outliers. Far: more than 6 robust sigmas (sigma_MAD of the images that one restorer did, not below a floor of each
 * quantity) from the median, with ten images or more. Errors: RX_SYSTEM. */
rx_status rx_rollup_outliers_find(rx_rollup *rollup, rx_error *err);

/* Begin a further note behind those of dst; returns dst. run: "" for what is of the image. */
rx_text *rx_rollup_note(rx_text *dst, const char *before, const char *run);

/* What a row says of itself, whatever the others are: work of another restorer, a flux scale that is off (unless dst has
 * it), what the page of the tile calls wrong. */
void rx_rollup_row_notes(rx_text *dst, const rx_rollup_row *row, const char *before, const char *run);

/* Rank correlation (Spearman) of each quantity with each card that the records hold; a table, and figures "trend-..." of
 * the strongest where it is beyond 4 sigma. Errors: RX_SYSTEM. */
rx_status rx_rollup_trends(const rx_rollup *rollup, rx_report *report, rx_report_table **dst, rx_error *err);

#endif
