/* What a run missed and which of its detections are false, to be looked at on the image. */
#ifndef RX_REPORT_QA_REGIONS_H
#define RX_REPORT_QA_REGIONS_H

#include "base/error.h"
#include "quality/qa_numbers.h"

/* regions_<stem>.reg, of DS9, into folder (errors say shown): a circle of the matching radius around each missed
 * reference (its magnitude beside it) and each false detection (its number). Errors: RX_SYSTEM. */
rx_status rx_qa_regions(const rx_qa_numbers *numbers, int run, const char *stem, const char *folder,
                        const char *shown, rx_error *err);

#endif
