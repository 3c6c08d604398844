/* The job of rextract for a program that is not rextract: on arrays, or on files as the command line has it. Keywords,
 * what follows from several of them, the files that they name, warnings, errors and numbers are those of the program. */
#ifndef RX_STAGE_JOB_H
#define RX_STAGE_JOB_H

#include <stdbool.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/record.h"
#include "data/table.h"
#include "io/tile.h"
#include "pipeline/pipeline.h"
#include "psf/psf.h"

RX_BEGIN_DECLS

typedef struct rx_job_setting {
    const char *name, *value; /* of a keyword, as on the command line */
} rx_job_setting;

/* All 0: the defaults of rextract. */
typedef struct rx_job {
    const char *config;             /* configuration file, as after -c; NULL: none */
    const rx_job_setting *settings; /* [nsettings] */
    int nsettings;
    const char *const *columns; /* [ncolumns] as a .param file has them; 0: those of PARAMETERS_NAME */
    int ncolumns;
    bool psf_only; /* end with sky, noise and PSF: no sources */
} rx_job;

/* What rx_job_arrays() works on; the arrays stay the caller's and must live as long as the result. */
typedef struct rx_job_images {
    const rx_tile_arrays *detect; /* is restored and detected on */
    const rx_tile_arrays
        *measure;         /* dual-image mode: what is measured, of the same size; NULL: the same image */
    const rx_psf *psf[2]; /* their PSFs, where they are known, and are copied; NULL: */
    const rx_psf_pixels *image_of_psf[2]; /* images of these; NULL: PSF_TYPE says */
} rx_job_images;

typedef struct rx_job_result {
    struct rx_config *config;   /* the keywords, */
    struct rx_options *options; /* and what they said; points into config */
    rx_field *detect, *measure; /* tile, sky, noise, PSF; measure NULL without dual-image mode */
    rx_result result;   /* restored image, sources and their segments, templates; empty with psf_only */
    rx_table *table;    /* the columns that were asked for; NULL with psf_only */
    rx_table *injected; /* SELF_CHECK: every object that was injected, and what was found of it; else NULL */
    rx_record facts;    /* what headers of catalogues hold: RXREST, RXFWHM ... */
} rx_job_result;

/* One restorer on one image in memory; no file is written. Keywords of outputs (CATALOG_NAME, CHECKIMAGE_TYPE ...) have no
 * effect, maps and reports are refused: weights come as an array. Without job->config no default.sex is read. Errors:
 * RX_USAGE, RX_INPUT, RX_SYSTEM, RX_NOT_RESTORED, RX_INTERRUPTED. Free with rx_job_result_free(); nothing is left after an
 * error. */
rx_status rx_job_arrays(const rx_job *job, const rx_job_images *images, rx_log *log, rx_job_result *dst,
                        rx_error *err);
void rx_job_result_free(rx_job_result *result);

/* rextract IMAGE -c FILE -KEYWORD VALUE ...: all outputs are written; job->columns must be none. log->level becomes that of
 * VERBOSE_TYPE. What only the program does, lists of tiles, RECORD_NAME and PLAN, is refused. Errors: those of the program. */
rx_status rx_job_files(const rx_job *job, const char *image, rx_log *log, rx_error *err);

/* RX_VERSION of the library. */
const char *rx_job_version(void);

RX_END_DECLS

#endif
