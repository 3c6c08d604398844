/* What the quality of a tile's catalogues is measured from: one reference, one catalogue per restorer, gates.
 * The numbers are those of quality/qa_numbers.h, their page is report/qa_page.h.
 *
 * Conventions (as Rubin's analysis tools): completeness (recall) in bins of reference magnitude, purity
 * (precision) in bins of measured magnitude, medians and sigma_MAD per bin of reference magnitude.
 * Every number comes with an interval (metrics.h).
 */
#ifndef RX_QUALITY_QA_H
#define RX_QUALITY_QA_H

#include "base/error.h"
#include "base/log.h"
#include "quality/statistics.h"

/* What is compared: plain arrays, made by the stage from tables and source lists. Positions or magnitudes
 * that are unknown are NAN; magnitudes of 90 and fainter count as unknown (SExtractor writes 99). A reference
 * without a magnitude does not count, nor does a detection of it. */
typedef struct rx_qa_list {
    long n;
    double *x, *y;             /* 0-based pixels of the tile */
    double *alpha, *delta;     /* deg J2000, or NULL without WCS */
    double *mag, *mag_error;   /* mag_error may be NULL */
    double *flux, *flux_error; /* ADU, on the scale of mag; NULL when unknown */
    double *score; /* detections: ranking for the P-R curve, high = sure, else NULL: brightest first */
    int *flags;    /* detections: FLAGS, else NULL */
    int *restore;  /* detections: FLAGS_RESTORE, else NULL */
    unsigned char *made_up; /* detections: 1 = untouched pixels do not want it (FLAGS_RESTORE), else NULL */
} rx_qa_list;

/* Allocate the arrays of a list of n rows, all of them or (reference) without score and flags. */
rx_status rx_qa_list_new(rx_qa_list *list, long n, int with_flags, rx_error *err);
void rx_qa_list_free(rx_qa_list *list);

/* What a restorer's model promises for this tile, from its tests; NAN where it does not say. */
typedef struct rx_qa_promise {
    const char *model, *digest;
    const char *why; /* nothing is promised: what is out of the model's training */
    int unfinished;  /* the training of the model has not ended */
    int inside;
    double fwhm, noise;               /* of the tile: pixels; on the scale of the model */
    double fwhm_bin[2], noise_bin[2]; /* the model's bin, from and to; inside only */
    double loss;                      /* mean test loss */
    double recall;                    /* test stars of S/N above 5 */
    double bias, scatter;             /* %, fluxes of test stars of S/N above 12 */
} rx_qa_promise;

/* Restored over untouched flux of the same isolated sources; n = 0: not measured. */
typedef struct rx_qa_flux {
    long n;
    double diameter; /* of the wide aperture, pixels */
    double wide, wide_error;
    double automatic, automatic_error; /* FLUX_AUTO restored over the wide aperture untouched; NAN: none */
    int off;                           /* beyond what errors explain */
} rx_qa_flux;

struct rx_tally; /* quality/tally.h */

typedef struct rx_qa_blank { /* BLANK_CHECK */
    int n;                   /* realisations of the noise, 0: it was not run */
    double mpixels;          /* searched */
    rx_estimate rate;        /* false detections per Mpixel */
    double raised, asked;    /* factor by which it raised DETECT_THRESH, and the rate without */
} rx_qa_blank;

typedef struct rx_qa_run { /* one restorer */
    const char *name;      /* "NONE", "RL" */
    rx_qa_list list;
    /* of its whole way, checks included; in `brief` only, files stay the same from run to run */
    double seconds;
    const char *settings, *psf; /* one line each, for the page; may be NULL */
    const char *by, *why;       /* the restorer that did it instead, and why; NULL: `name` itself */
    const char *taken; /* that AUTO took, why it did (but for `by`, which comes first); NULL: not AUTO */
    rx_qa_flux flux;
    rx_qa_blank blank;
    /* of the tile's own detections the share that is no noise peak (BLANK_CHECK); n = 0: not known */
    rx_estimate real;
    const rx_qa_promise *promise; /* NULL: no model is behind this run */
    int tested;                   /* list.made_up says something */
    double made_up_per_mpixel;    /* marked ones, those included that were dropped from the list */
    struct rx_tally *tally;       /* filled with what is counted, unless NULL */
    double law_scale, law_power;  /* noise law of the flux errors, 1 and 0.5 = independent pixels */
} rx_qa_run;

/* Small pictures of the same sky for the page: row-major floats, background subtracted. All are shown
 * with the stretch of the first one. */
typedef struct rx_qa_picture {
    const char *title;
    int width, height;
    const float *pixels;
    float sigma;
} rx_qa_picture;

/* What stars that were not fitted say of the PSF of the tile (data/psf.h), and of which image it is. */
typedef struct rx_qa_psf {
    const struct rx_psf *psf; /* NULL: none, or nothing was measured of it */
    double zeropoint;         /* mag of 1 ADU */
} rx_qa_psf;

/* A .qa file, see config/default.qa for its grammar. */
typedef struct rx_gates rx_gates;

typedef struct rx_qa_params {
    double match_radius;                /* pixels */
    double match_radius_arcsec;         /* as given, 0 when given in pixels: for the page */
    double mag_low, mag_high, mag_step; /* bins; low >= high = from the reference; step <= 0 = 0.5 */
    int figures;                        /* 0: no gnuplot */
    const rx_gates *gates;              /* or NULL */
    const char *gnuplot;                /* program, NULL = "gnuplot" */
    rx_log *log;                        /* or NULL */
    rx_resampling by;                   /* bootstrap */
} rx_qa_params;

typedef struct rx_qa_input {
    const char *tile;      /* shown name */
    const char *reference; /* shown name */
    int width, height;
    const unsigned char
        *mask; /* [h][w], not 0: nothing can be found there, references there do not count; or NULL */
    double pixel_scale;       /* arcsec, 0 unknown */
    const char *precision_is; /* what precision is here, where it is something else; or NULL */
    rx_qa_psf psf;
    const char *score_name; /* what rx_qa_list.score is ("SNR_WIN"); NULL = "score" */
    rx_qa_list truth;
    int nruns;
    rx_qa_run *runs;
    int npictures;
    rx_qa_picture *pictures;
    int nrecord; /* configuration and provenance: name, value */
    const char *const (*record)[2];
} rx_qa_input;

typedef enum rx_verdict {
    RX_VERDICT_NONE,
    RX_VERDICT_PASS,
    RX_VERDICT_FAIL,
    RX_VERDICT_INSUFFICIENT
} rx_verdict;

/* Read a gates file; early, before any work. Malformed: RX_USAGE with file and line. Free with _free. */
rx_status rx_gates_read(const char *path, rx_gates **dst, rx_error *err);
void rx_gates_free(rx_gates *gates);

const char *rx_verdict_name(rx_verdict verdict); /* "PASS" ..., "NONE" without gates */

/* The worse of two: FAIL, then INSUFFICIENT, PASS, NONE. */
rx_verdict rx_verdict_worse(rx_verdict a, rx_verdict b);

#endif
