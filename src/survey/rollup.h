/* The numbers of a survey from the records of its tiles.
 *
 * All sums are of whole numbers: the same bits for any sharding and order. A tile takes the room of a few
 * rows of a table, whatever its record holds, so that 1e5 of them are little. */
#ifndef RX_SURVEY_ROLLUP_H
#define RX_SURVEY_ROLLUP_H

#include <stdint.h>

#include "base/error.h"
#include "base/hash.h"
#include "base/log.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "config/tiles.h"
#include "quality/statistics.h"
#include "report/figure.h"
#include "report/report.h"
#include "survey/tile_record.h"

/* What is counted in a range of magnitudes, as shares and errors. Intervals: Clopper-Pearson, 0.95. */
typedef struct rx_rollup_cell {
    rx_estimate recall;    /* by magnitude of the reference */
    rx_estimate precision; /* by measured magnitude */
    long pairs;
    double bias, scatter; /* median and sigma_MAD of m - m0, mag */
} rx_rollup_cell;

/* One tile: its record without the tallies, which are in the sums and need too much room to be kept. */
typedef struct rx_rollup_tile {
    char *image, *name, *what; /* as of rx_tile_record; what "" when it is fine */
    int status;
    char digest[RX_HASH_TEXT]; /* of the record as it is printed */
    const char *path;          /* of its file, where it begins at byte `at`; lent */
    int64_t at;
    int place;        /* in the order of the tiles */
    int first, nrows; /* its rows, until they are sorted */
} rx_rollup_tile;

/* One image of one tile by one restorer. */
typedef struct rx_rollup_row {
    const rx_rollup_tile *tile;
    int place; /* among the rows of the tile */
    int run;   /* of the roll-up's */
    int hdu;   /* these as of rx_extension_facts */
    double alpha, delta, fwhm, sky, noise;
    rx_verdict verdict;
    long sources;
    char by[16];    /* restorer that did it instead, "" none */
    char taken[16]; /* that AUTO took, "" none */
    char *why;      /* why; NULL without either */
    char *outside;  /* what the restorer was not made for; NULL: nothing */
    rx_fluxcheck flux;
    rx_run_guard guard;
    double sharp, lit;                         /* as of rx_run_facts */
    int leads;                                 /* first restorer of its image */
    rx_tile_state state;                       /* NAN and -1 where it is not known */
    double psf_growth, psf_residual, psf_size; /* as of rx_psf_account; NAN */
    double card[RX_RECORD_CARDS];              /* of rx_rollup.card; NAN: it has none */
    char *page;                                /* as of rx_extension_facts; NULL */
    int compared;                              /* with a reference */
    rx_rollup_cell cell;                       /* MAG_RANGE */
    double off; /* how far it lies from the survey as a whole in what is worst of it: errors of its own, 0 =
                   not worse; NAN without a reference. Of a flux scale that is off: from 1 */
    const char *what; /* what that is: "recall", "precision", "bias", "flux scale" */
} rx_rollup_row;

/* The PSF of one image of one tile. */
typedef struct rx_rollup_psf {
    const rx_rollup_tile *tile;
    int place, hdu; /* place: among the images of the tile */
    rx_psf_account psf;
} rx_rollup_psf;

/* One restorer over all tiles. */
typedef struct rx_rollup_run {
    char name[16];
    long tiles, sources; /* images, and what was found on them */
    long by_others;      /* images that another restorer did */
    long outside;        /* images that it was not made for, which it did all the same */
    long flux_off;       /* images with a wrong flux scale */
    long unexplained; /* images of which much is not explained by what was restored: rx_residual_is_large() */
    long raised;      /* images whose DETECT_THRESH was raised for false detections */
    rx_tally tally;
    rx_rollup_cell whole; /* MAG_RANGE */
    rx_rollup_cell bin[RX_TALLY_BINS];
    int first, last; /* bins that count something; first > last: none */
} rx_rollup_run;

/* One image of a tile that stands out. `why` names what is off, its value and the survey's: up to three, the furthest first. */
typedef struct rx_rollup_outlier {
    const rx_rollup_row *row; /* NULL: the tile has none */
    const char *name, *image, *page;
    int hdu, rank; /* rank: 2 failed or without a record, 1 a gate that failed, 0 neither */
    double off;    /* robust sigmas; 0 of failures */
    char *why;     /* owned */
} rx_rollup_outlier;

typedef struct rx_rollup {
    int ntiles, nruns, nrows, nmissing;
    rx_rollup_tile **tile; /* [ntiles] by name and image */
    int ncards;            /* of the headers, the first that records hold */
    char card[RX_RECORD_CARDS][RX_CARD_NAME];
    rx_rollup_run *run;       /* [nruns] in the order they come first */
    rx_rollup_row *row;       /* [nrows] worst first */
    int npsfs, psfs_capacity; /* of images whose PSF is said to have come about somehow */
    rx_rollup_psf *psf;       /* [npsfs] by tile and image */
    int lower;                /* of these not from several stars of the tile itself */
    rx_rho_bin rho[RX_RHO_BINS];
    const rx_tiles *tiles; /* all that should have a record, or NULL; lent */
    int *missing;          /* [nmissing] of tiles: without a record */
    int noutliers;
    rx_rollup_outlier *outlier;                /* [noutliers] worst first */
    int fine, apart, failed, gates, undecided; /* tiles by exit status; apart: fine by it, but an outlier */
    double mag_low, mag_high;                  /* equal: all */
    void *known;                               /* search tree of tile */
    int tiles_capacity, rows_capacity;
} rx_rollup;

void rx_rollup_begin(const rx_survey_config *config, rx_rollup *dst);

/* Add a record, which begins at byte `at` of the file `path` (lent); one that is there already does not count
 * again. Errors: RX_INPUT for another one of the same tile that differs; RX_SYSTEM without memory. */
rx_status rx_rollup_add(rx_rollup *rollup, const rx_tile_record *record, const char *path, int64_t at,
                        rx_error *err);

/* All are added: sort, compare, find what stands out. tiles: NULL where there is no list. Errors: RX_SYSTEM without memory. */
rx_status rx_rollup_end(rx_rollup *rollup, const rx_tiles *tiles, rx_error *err);

void rx_rollup_free(rx_rollup *rollup); /* content only */

/* --- what stands out, and what goes with what (rollup_quality.c) --- */

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

/* --- the report (rollup_report.c, _figures.c, _junit.c) --- */

/* Into the existing folder (`shown` in errors): report.html, summary.json, tiles.ecsv, bins.ecsv,
 * psfs.ecsv, psf_rho.ecsv and junit.xml. No dates, no paths but those of the records. figures 0: no gnuplot. */
rx_status rx_rollup_report(const rx_rollup *rollup, int figures, const char *folder, const char *shown,
                           rx_log *log, rx_error *err);

/* JUnit's XML: a test case per tile; failure: a gate that fails, error: a tile that failed or has no record,
 * skipped: a gate that cannot be decided. */
void rx_rollup_junit(rx_text *dst, const rx_rollup *rollup);

/* Completeness, purity and bias by magnitude and over the sky (by images or, where they are many, by cells), and residuals of
 * PSFs by angle. */
void rx_rollup_figures(rx_figures *dst, const rx_rollup *rollup);

/* --- all of it (rollup_run.c): rextract-survey's job --- */

/* Read the records in the files of `given`, one a line, of which "@FILE" stands for those that it lists; write the
 * merged records and the report. Errors: RX_INPUT (records, survey/tile_record.h; the list), RX_USAGE
 * (TILES_NAME, folders), RX_SYSTEM, RX_INTERRUPTED. Tiles that failed are named in the report and the log, and
 * are no error. */
rx_status rx_rollup_files(const rx_survey_config *config, const char *given, rx_log *log, rx_error *err);

#endif
