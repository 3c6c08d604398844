/* What a report says of the campaign that made it, and where it goes. */
#ifndef RX_LAB_RECORD_H
#define RX_LAB_RECORD_H

#include <stdint.h>

#include "base/log.h"
#include "base/text.h"

typedef struct rx_campaign_record {
    const char *title;
    const char *command; /* as a reader can repeat it */
    uint64_t seed;
    int n;
    const char *const (*pairs)[2]; /* every keyword and its value, program version, model checksums */
    int figures;                   /* 0: no gnuplot */
} rx_campaign_record;

/* report.html (self-contained), summary.json, tables (ECSV) and figures go into the existing folder; `shown` is its name
 * in errors. brief (may be NULL) gets a short table for the terminal. No dates and no timings in the files. */
typedef struct rx_lab_output {
    const rx_campaign_record *record;
    const char *folder, *shown;
    rx_log *log;
    rx_text *brief;
} rx_lab_output;

#endif
