/* The numbers of a survey from the records of its tiles: rextract-survey's job.
 *
 * All sums are of whole numbers: the same bits for any sharding and order. A tile takes the room of its record without
 * the tallies, which are in the sums, so that 1e5 of them are little. */
#ifndef RX_SURVEY_ROLLUP_H
#define RX_SURVEY_ROLLUP_H

#include <stdint.h>

#include "base/arena.h"
#include "base/constants.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/log.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "config/tiles.h"
#include "quality/statistics.h"
#include "report/report.h"
#include "survey/tile_record.h"

/* What is counted in a range of magnitudes, as shares and errors. Intervals: Clopper-Pearson, 0.95. */
typedef struct rx_rollup_cell {
    rx_estimate recall;    /* by magnitude of the reference */
    rx_estimate precision; /* by measured magnitude */
    long pairs;
    double bias, scatter; /* median and sigma_MAD of m - m0, mag */
} rx_rollup_cell;

/* One restorer over all tiles. */
typedef struct rx_rollup_run {
    const char *name;
    int place; /* in rollup.run, -1: not there yet */
    /* as in the table of runs: all images, those that another did, that it was not made for, ... */
    long images, by_others, outside, flux_off, raised, unexplained, sources;
    rx_tally tally;
    rx_rollup_cell whole; /* MAG_RANGE */
    rx_rollup_cell bin[RX_TALLY_BINS];
    int first, last; /* bins that count something; first > last: none */
    struct rx_rollup_run *next;
} rx_rollup_run;

typedef struct rx_rollup_tile rx_rollup_tile;

/* One image of one tile by one restorer. */
typedef struct rx_rollup_row {
    const rx_rollup_tile *tile;
    const rx_extension_facts *image;
    const rx_run_facts *facts;
    rx_rollup_run *run;
    bool compared;                           /* with a reference */
    rx_rollup_cell cell;                     /* MAG_RANGE */
    const struct rx_rollup_numbers *numbers; /* rollup_quality.c */
    double off; /* how far it lies from the survey as a whole in what is worst of it: errors of its own, 0 =
                   not worse; NAN without a reference. Of a flux scale that is off: from 1 */
    const char *worst; /* what that is: "recall", "precision", "bias", "flux scale" */
} rx_rollup_row;

struct rx_rollup_tile {
    rx_tile_record record;     /* without tallies and facts; of the roll-up's arena */
    char digest[RX_HASH_TEXT]; /* of the record as it is printed */
    const char *path;          /* of its file, where it begins at byte `at` */
    int64_t at;
    int place, nrows;   /* place: in the order of the tiles */
    rx_rollup_row *row; /* [nrows] by image and run */
    rx_rollup_tile *next;
};

/* One image of a tile that stands out. `why` names what is off, its value and the survey's: up to three, the furthest first. */
typedef struct rx_rollup_outlier {
    const char *name, *image, *page; /* page: NULL, none */
    int hdu;                         /* -1: the tile has no image */
    int rank;                        /* 2 failed or without a record, 1 a gate that failed, 0 neither */
    double off;                      /* robust sigmas; 0 of failures */
    char *why;                       /* owned */
} rx_rollup_outlier;

typedef struct rx_rollup {
    const rx_survey_config *config;
    rx_arena arena; /* of all but tallies and reasons */
    int ntiles, nruns, nrows, nimages, nmissing, noutliers;
    rx_rollup_tile **tile;             /* [ntiles] by name and image */
    rx_rollup_run **run;               /* [nruns] in the order they come first */
    rx_rollup_row **row;               /* [nrows] worst first */
    struct rx_rollup_numbers *numbers; /* [nrows] of these */
    int ncards;
    const char *card[RX_RECORD_CARDS]; /* names of those that records hold */
    const rx_tiles *tiles;             /* all that should have a record, or NULL; lent */
    int *missing;                      /* [nmissing] of tiles: without a record */
    int lower; /* images whose PSF is not from several stars of the tile itself, of `nimages` whose PSF is known */
    rx_rho_bin rho[RX_RHO_BINS];
    rx_rollup_outlier *outlier;                /* [noutliers] worst first; owned */
    int fine, apart, failed, gates, undecided; /* tiles by exit status; apart: fine by it, but an outlier */
    void *known;                               /* search tree of tiles */
    rx_rollup_run *runs;                       /* all of them, as they came */
    rx_rollup_tile *tiles_read;                /* the same */
    const char *path;                          /* of the records that are being read */
} rx_rollup;

/* Read the records in the files of `given`, one a line, of which "@FILE" stands for those that it lists; write the
 * merged records and the report. Errors: RX_INPUT (records, survey/tile_record.h; two of one tile that differ; the list),
 * RX_USAGE (TILES_NAME, folders), RX_SYSTEM, RX_INTERRUPTED. Tiles that failed are named in the report and the log, and
 * are no error. */
rx_status rx_rollup_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err);

/* --- what stands out, and what goes with what (rollup_quality.c) --- */

/* rollup->outlier, and the numbers of all rows. Far: more than 6 robust sigmas (sigma_MAD of the images that one restorer
 * did, not below a floor of each quantity) from the median, with ten images or more. Errors: RX_SYSTEM. */
rx_status rx_rollup_outliers(rx_rollup *rollup, rx_error *err);

/* Begin a further note behind those of dst; returns dst. run: "" for what is of the image. */
rx_text *rx_rollup_note(rx_text *dst, const char *before, const char *run);

/* Notes on a row alone, whatever the others are: work of another restorer, a flux scale that is off (unless dst has
 * it), what the page of the tile calls wrong. */
void rx_rollup_row_notes(rx_text *dst, const rx_rollup_row *row, const char *before);

/* Rank correlation (Spearman) of each quantity with each card that the records hold; a table, and figures "trend-..." of
 * the strongest where it is beyond 4 sigma. Errors: RX_SYSTEM. */
rx_status rx_rollup_trends(const rx_rollup *rollup, rx_report *report, rx_report_table **dst, rx_error *err);

/* --- the report (rollup_report.c, rollup_figures.c) --- */

/* Into the existing folder: report.html, summary.json, tables (ECSV) and junit.xml. No dates, no paths but those of the
 * records. */
rx_status rx_rollup_report(const rx_rollup *rollup, const char *folder, rx_log *log, rx_error *err);

/* Completeness, purity and bias by magnitude and over the sky (by images or, where they are many, by cells), and residuals of
 * PSFs by angle. */
void rx_rollup_figures(rx_figures *dst, const rx_rollup *rollup);

#endif
