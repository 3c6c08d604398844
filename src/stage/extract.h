/* One restorer through one tile: restore, detect, measure, tabulate. */
#ifndef RX_STAGE_EXTRACT_H
#define RX_STAGE_EXTRACT_H

#include <stdio.h>

#include "base/error.h"
#include "base/log.h"
#include "check/checks.h"
#include "check/choice.h"
#include "data/restored.h"
#include "data/sources.h"
#include "data/table.h"
#include "io/output.h"
#include "pipeline/domain.h"
#include "pipeline/field.h"
#include "quality/tile_quality.h"
#include "stage/checkimages.h"
#include "stage/options.h"
#include "stage/provenance.h"

/* Files of tables: the catalogue and, beside it, TEMPLATE_COVAR_NAME and what is found at listed positions. */
enum { RX_RUN_CATALOG, RX_RUN_COVARIANCES, RX_RUN_POSITIONS, RX_RUN_FILES };
typedef struct rx_table_file {
    char *name;            /* with the restorer's name when there are several; NULL: not wanted */
    const char *temporary; /* where it is written; NULL: standard output, or no catalogue */
    rx_catalog_type type;
    rx_table **tables; /* [rx_run.ntables], NULL where they are not wanted */
} rx_table_file;

/* What one restorer makes in a run: open files, a table per extension, and the current extension. */
typedef struct rx_run {
    const rx_restorer *kind; /* as asked for */
    rx_table_file file[RX_RUN_FILES];
    rx_checkimages *images;
    int ntables;
    /* current extension, until rx_run_forget() */
    rx_restored *restored;
    rx_sources *sources;
    rx_check_results checks;
    struct rx_tally *tally;     /* for a caller that needs the counts of the report; NULL: none does */
    int tested;                 /* FLAGS_RESTORE was set */
    double invented_per_mpixel; /* sources marked by it, before they were dropped */
    rx_domain domain;           /* place RX_DOMAIN_NONE where no network was asked for */
    const rx_restorer *taken;   /* where AUTO was asked for; else NULL */
    const char *by;             /* as of rx_result: the restorer that did it instead, or NULL */
    char why[240];              /* or why AUTO took what it did */
    char label[48];             /* of log lines: "NET", "NET (done by RL)", "AUTO (done by NET)" */
    rx_fluxcheck flux;
    rx_residual misfit;
    bool is_dark;       /* rx_result_is_dark() */
    double sharp;       /* rx_result_sharp() */
    char outside[400];  /* what the restorer was not made for on this tile, "" nothing */
    double seconds;     /* of all of rx_run_extract() */
    rx_record facts;    /* of the current extension (data/facts.def) */
    char account[2048]; /* settings, what was found of the fluxes and by checks: one line for the report */
} rx_run;

/* Open the outputs of a restorer; `tagged`: several restorers share the names. */
rx_status rx_run_open(rx_run *run, const rx_options *options, const rx_restorer *kind, int tagged,
                      rx_outputs *outputs, rx_error *err);

/* One extension that is extracted. */
typedef struct rx_extraction_input {
    const rx_options *options;
    const rx_field *detect, *measure; /* measure: of dual-image mode, else NULL */
    const rx_checks *checks;          /* NULL: none */
    const rx_record *record;          /* of the run */
    rx_record *products;              /* what it made: digests of the check-images are added */
    rx_result *
        kept; /* where all that was made goes, to be freed by the caller; NULL: what the run does not name is freed */
    rx_record *facts; /* the same of the facts */
} rx_extraction_input;

/* Restore the detection image, find sources on it, measure them on it, on the original or on the measurement image,
 * run the checks, and append to tables and check-images. restored, sources and checks stay until rx_run_forget().
 * Errors: those of pipeline/pipeline.h and check/checks.h; RX_SYSTEM. */
rx_status rx_run_extract(rx_run *run, const rx_extraction_input *in, rx_log *log, rx_error *err);

/* Warnings on the first n runs of a tile: fluxes that are off, in one message, and which restorer did the work instead. */
void rx_runs_warn(const rx_run *runs, int n, const rx_tile *tile, rx_log *log);
void rx_run_forget(rx_run *run);

/* The digests of the rows of its catalogues, to `products` and into the tables' headers. Then, with those of
 * all restorers: write the catalogues and finish the check-images (still under temporary names). */
rx_status rx_run_digest(rx_run *run, rx_record *products, rx_error *err);
rx_status rx_run_close(rx_run *run, const rx_record *record, const rx_record *products, FILE *standard_out,
                       rx_error *err);
void rx_run_free(rx_run *run);

#endif
