/* The numbers of a survey from the records of its tiles.
 *
 * All sums are of whole numbers, over tiles in the order of their names: the same bits for any sharding. */
#ifndef RX_SURVEY_ROLLUP_H
#define RX_SURVEY_ROLLUP_H

#include "config/survey_config.h"
#include "config/tiles.h"
#include "survey/tile_record.h"
#include "validate/binomial.h"

/* What is counted in a range of magnitudes, as shares and errors. Intervals: Clopper-Pearson, 0.95. */
typedef struct rx_rollup_cell {
    rx_estimate recall;    /* by magnitude of the reference */
    rx_estimate precision; /* by measured magnitude */
    long pairs;
    double bias, scatter; /* median and sigma_MAD of m - m0, mag */
} rx_rollup_cell;

/* One image of one tile by one restorer. */
typedef struct rx_rollup_row {
    const rx_tile_record *record;
    const rx_extension_facts *extension;
    const rx_run_facts *run;
    rx_rollup_cell cell; /* MAG_RANGE */
    double off; /* how far it lies from the survey as a whole in what is worst of it: errors of its own, 0 =
                   not worse; NAN without a reference */
    const char *what; /* what that is: "recall", "precision", "bias" */
} rx_rollup_row;

/* One restorer over all tiles. */
typedef struct rx_rollup_run {
    char name[16];
    long tiles, sources; /* images, and what was found on them */
    rx_tally tally;
    rx_rollup_cell whole; /* MAG_RANGE */
    rx_rollup_cell bin[RX_TALLY_BINS];
    int first, last; /* bins that count something; first > last: none */
} rx_rollup_run;

typedef struct rx_rollup {
    const rx_tile_records *records;
    const rx_tiles *tiles; /* all that should have a record, or NULL */
    int nruns, nrows, nmissing;
    rx_rollup_run *run;                 /* [nruns] in the order they come first */
    rx_rollup_row *row;                 /* [nrows] worst first */
    int *missing;                       /* [nmissing] of tiles: without a record */
    int fine, failed, gates, undecided; /* tiles by exit status */
    double mag_low, mag_high;           /* equal: all */
} rx_rollup;

/* records are settled (survey/tile_record.h), lent like tiles. Errors: RX_SYSTEM without memory. */
rx_status rx_rollup_make(const rx_survey_config *config, const rx_tile_records *records,
                         const rx_tiles *tiles, rx_rollup *dst, rx_error *err);
void rx_rollup_free(rx_rollup *rollup); /* content only */

#endif
