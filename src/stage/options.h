/* From keywords to one plain params struct per stage. */
#ifndef RX_STAGE_OPTIONS_H
#define RX_STAGE_OPTIONS_H

#include "base/error.h"
#include "base/log.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "check/params.h"
#include "config/config_fields.h"
#include "config/idle.h"
#include "config/kernel.h"
#include "io/tile.h"
#include "measure/starclass.h"
#include "pipeline/params.h"
#include "quality/qa.h"
#include "stage/reference.h"

typedef struct rx_options {
    rx_pipeline_params pipeline;
    rx_check_params check;
    rx_tile_params tile[2]; /* of the detection and of the measurement image */
    const char *model_name; /* NET_MODEL as given */
    int model_set;          /* by a file or the command line */
    rx_model *model;        /* owned, also pipeline.restore.model; NULL when NET is not among the restorers */
    int nrestorers;
    const rx_restorer *restorers[RX_MAX_RUNS];
    rx_catalog_type catalog_type;
    const char *catalog_name;
    const char *covariance_name; /* TEMPLATE_COVAR_NAME, "" = none */
    rx_column_list *columns;     /* owned */
    int columns_built_in;        /* no file names them */
    int nchecks;
    const char *check_types[RX_LIST], *check_names[RX_LIST];
    int write_psf, restored_rms; /* PSF, RESTORED_RMS are among them */
    rx_assoc_params assoc;
    rx_assoc *assoc_list; /* owned, NULL without ASSOC_NAME */
    rx_table *positions;  /* owned, NULL without POSITIONS_NAME */
    const char *positions_name;
    rx_reference_params reference; /* name NULL: no report */
    rx_qa_params qa;
    rx_starclass *star_net;      /* owned, also pipeline.measure.star_net; NULL without CLASS_STAR */
    rx_gates *gates;             /* owned, also qa.gates; NULL without QA_GATES */
    const char *self_check_name; /* SELF_CHECK_NAME, "" = no report */
    const char *qa_name;
    int tile_page;           /* QA_TYPE TILE */
    int all_facts;           /* HEADER_FACTS ALL */
    rx_kernel *kernel;       /* owned */
    rx_kernel *noise_kernel; /* of NOISE_CORRELATION FILE, owned */
    double plan_density;     /* PLAN_DENSITY, sources per Mpixel */
} rx_options;

/* Reads the files that keywords name (.param, .conv, .nnw, gates, ASSOC list): all of them before any work. */
rx_status rx_options_from_config(const rx_config *config, rx_log *log, rx_options **dst, rx_error *err);

/* The same with these columns instead of those of PARAMETERS_NAME; the list belongs to the options from then on, and is freed
 * when this fails. */
rx_status rx_options_with_columns(const rx_config *config, rx_column_list *columns, rx_log *log,
                                  rx_options **dst, rx_error *err);
void rx_options_free(rx_options *options);

/* The columns that PARAMETERS_NAME asks for; free with rx_columns_free(). */
rx_status rx_options_columns(const rx_config *config, rx_log *log, rx_column_list **dst, rx_error *err);

/* For the keywords that are given in vain where the catalogue has these columns; NULL: where it has any. */
rx_idle rx_options_idle(const rx_column_list *columns);

/* Where the model of that name lies. A name with a slash is a path. One without is that of an installed model
 * where there is one, else of a file in the current folder, so that what a training leaves there is not taken
 * for the installed model by default; a NET_MODEL that was set and is here has got its ./ from the configuration. `installed`: the folder of installed data, RX_DATA_FOLDER. */
void rx_options_model_path(const char *name, const char *installed, rx_text *dst);

#endif
