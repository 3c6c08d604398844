/* Visits of a field against each other. */
#ifndef RX_SURVEY_REPEAT_FIELD_H
#define RX_SURVEY_REPEAT_FIELD_H

#include "base/log.h"
#include "quality/completeness.h"
#include "survey/file_names.h"
#include "survey/repeat.h"
#include "survey/visit.h"

enum { RX_REPEAT_POPULATIONS = 2 }; /* point sources, others */

/* Two visits that overlap. */
typedef struct rx_repeat_couple {
    int first, second;
    long matched;
    long chance; /* matches with the second one's positions shifted by 10 radii */
    long used;   /* with FLAGS 0 and both magnitudes: pair[from ..] of the field */
    long from;
    double zero_point,
        zero_point_error;     /* second - first, mag; what was taken off; NAN: nothing to see it by */
    double dx, dy;            /* second - first, arcsec, the same */
    long seen, found;         /* sources of one that the other sees, and those it has */
    rx_repeat_numbers bright; /* point sources from REPEAT_SNR on */
    rx_repeat_numbers points; /* all from S/N 5 on */
} rx_repeat_couple;

/* Sources of one visit that another one sees, by their magnitude on the scale of the first visit. */
typedef struct rx_repeat_trials {
    long n;
    double *mag;
    unsigned char *found;
} rx_repeat_trials;

typedef struct rx_repeat_field {
    const rx_survey_config *config;
    rx_visit_columns columns;
    int nvisits, ncouples;
    rx_visit *visit;
    rx_repeat_couple *couple;
    rx_repeat_couple all; /* together; no zero point, offset and first and second */
    long npairs;
    rx_repeat_pair *pair;
    rx_repeat_trials trials[RX_REPEAT_POPULATIONS];
    rx_estimate mag90[RX_REPEAT_POPULATIONS],
        mag50[RX_REPEAT_POPULATIONS]; /* where so many % are found again */
    rx_bins bins;                     /* half a magnitude wide or wider */
} rx_repeat_field;

/* Read and compare. `names` must live as long. Free in any case. Errors: RX_USAGE, RX_INPUT, RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_repeat_field_make(const rx_survey_config *config, const rx_file_names *names, rx_log *log,
                               rx_repeat_field *dst, rx_error *err);
void rx_repeat_field_free(rx_repeat_field *field); /* content only */

/* REPEAT: from the names of catalogues (file_names.h) to the report in OUTPUT_NAME. */
rx_status rx_repeat_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err);

/* The report into the existing folder. Errors: RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_repeat_report(const rx_repeat_field *field, const char *folder, rx_log *log, rx_error *err);

#endif
