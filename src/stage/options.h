/* From keywords to one plain params struct per stage: the only reader of config/. */
#ifndef RX_STAGE_OPTIONS_H
#define RX_STAGE_OPTIONS_H

#include "base/error.h"
#include "base/log.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "config/config.h"
#include "config/kernel.h"
#include "detect/background.h"
#include "detect/detect.h"
#include "io/tile.h"
#include "measure/measure.h"
#include "psf/psf.h"
#include "restore/restore.h"
#include "stage/reference.h"
#include "template/template.h"
#include "validate/qa.h"

enum { RX_MAX_RUNS = 16 };

/* What thresholds on restored pixels are sigmas of. AUTO: INPUT where the restorer brings such a map. */
typedef enum rx_detect_noise {
    RX_DETECT_NOISE_AUTO,
    RX_DETECT_NOISE_MEASURED,
    RX_DETECT_NOISE_INPUT
} rx_detect_noise;

/* Template photometry: what is fitted, and what is done with sources that were made up. */
typedef struct rx_template_options {
    int wanted; /* a column, check-image, QA_MAG, INVENTED_TYPE DROP or TEMPLATE_COVAR_NAME asks for it */
    int wanted_by_lists; /* source lists depend on it, also those of checks: QA_MAG, DROP */
    rx_tphot_params par;
    int passes;              /* TEMPLATE_PASSES */
    double threshold;        /* TEMPLATE_THRESH: S/N on the residual of a source to be added */
    double invented;         /* INVENTED_SNR */
    double evidence;         /* INVENTED_EVIDENCE */
    int drop;                /* INVENTED_TYPE DROP */
    const char *covariances; /* TEMPLATE_COVAR_NAME, "" = none */
} rx_template_options;

typedef struct rx_options {
    rx_tile_params tile[2];             /* of the detection and of the measurement image */
    rx_background_params background[2]; /* of the same two */
    rx_psf_params psf;                  /* its file: psf_files */
    const char *psf_files[2];           /* PSF_NAME of the detection and of the measurement image */
    double seeing_arcsec;               /* SEEING_FWHM */
    bool seeing_stated;                 /* the default is no statement about a tile */
    double stated_scale; /* PIXEL_SCALE, arcsec; 0 when nobody set it: SExtractor's default of 1 is no fact */
    rx_restore_params restore;
    const char *model_name; /* NET_MODEL as given */
    int model_set;          /* by a file or the command line */
    rx_model *model;        /* owned, also restore.model; NULL when NET is not among the restorers */
    int nrestorers;
    const rx_restorer *restorers[RX_MAX_RUNS];
    rx_detect_params detect;
    rx_detect_noise detect_noise; /* DETECT_NOISE, of restored images */
    int filter_restored;          /* FILTER_RESTORED */
    rx_template_options templates;
    rx_measure_params measure;
    int saturated_in_none; /* MASK_SATURATED Y: RESTORE_TYPE NONE masks saturated pixels too */
    int measure_original;  /* MEASURE_ON ORIGINAL */
    int calibrate_none, calibrate_restored; /* ERROR_CALIBRATION */
    int error_apertures;
    uint64_t seed;
    int flag_types[RX_MAX_FLAGMAPS];
    rx_catalog_type catalog_type;
    const char *catalog_name;
    rx_column_list *columns; /* owned */
    int nchecks;
    int keep_filtered; /* the filtered image is wanted after detection: CHECKIMAGE_TYPE FILTERED */
    const char *check_types[RX_LIST], *check_names[RX_LIST];
    rx_assoc_params assoc;
    rx_assoc *assoc_list;          /* owned, NULL without ASSOC_NAME */
    rx_reference_params reference; /* name NULL: no report */
    rx_qa_params qa;
    rx_gates *gates;             /* owned, also qa.gates; NULL without QA_GATES */
    int self_check, blank_check; /* SELF_CHECK; BLANK_CHECK, realisations */
    long self_check_count;       /* SELF_CHECK_COUNT */
    double self_check_density;   /* SELF_CHECK_DENSITY, per Mpixel */
    double self_check_mag[2];    /* SELF_CHECK_MAG; from >= to: around the tile's limit */
    double self_check_galaxies;  /* SELF_CHECK_GALAXIES, share */
    int self_check_away;         /* SELF_CHECK_PLACE AWAY */
    const char *self_check_name; /* SELF_CHECK_NAME, "" = no report */
    int qa_figures;              /* QA_FIGURES */
    const char *qa_name;
    double match_radius;
    int match_arcsec;
    int quality_flux;    /* which flux is QA_MAG: see rx_quality_flux */
    rx_kernel *kernel;   /* owned */
    double plan_density; /* PLAN_DENSITY, sources per Mpixel */
    int nthreads;
} rx_options;

typedef enum rx_quality_flux {
    RX_QUALITY_AUTO,
    RX_QUALITY_APER,
    RX_QUALITY_ISO,
    RX_QUALITY_ISOCOR,
    RX_QUALITY_PETRO,
    RX_QUALITY_WIN,
    RX_QUALITY_TEMPLATE
} rx_quality_flux;

/* Reads the files that keywords name (.param, .conv, gates, ASSOC list): all of them before any work. */
rx_status rx_options_from_config(const rx_config *config, rx_log *log, rx_options **dst, rx_error *err);
void rx_options_free(rx_options *options);

/* Read the network's model (NET_MODEL) unless that has been done: for campaigns, which choose restorers
 * themselves; rx_options_from_config() has done it where RESTORE_TYPE has NET. Where it is looked for:
 * rx_input_model() (stage/inputs.h). A model whose training has not ended is taken with a warning where
 * NET_MODEL was set. Errors: RX_INPUT (such a model where it was not), RX_SYSTEM. */
rx_status rx_options_need_model(rx_options *options, rx_log *log, rx_error *err);

#endif
