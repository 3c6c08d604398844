/* The QA report: one reference, one catalogue per restorer, numbers, figures, gates. */
#ifndef RX_VALIDATE_QA_H
#define RX_VALIDATE_QA_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"

/* What is compared: plain arrays, made by the stage from tables and source lists. */
typedef struct rx_qa_list {
    long n;
    double *x, *y;         /* 0-based pixels of the tile */
    double *alpha, *delta; /* deg J2000, or NULL without WCS */
    double *mag, *mag_error; /* mag_error may be NULL (reference) */
    double *flux, *flux_error; /* ADU; NULL when unknown */
    double *score;         /* detections: ranking for the P-R curve (peak S/N on the detection image), else NULL */
    int *flags;            /* detections: FLAGS, else NULL */
} rx_qa_list;

typedef struct rx_qa_run { /* one restorer */
    const char *name;      /* "NONE", "RL" */
    rx_qa_list list;
    double seconds;        /* of the restoration */
    const char *settings, *psf; /* one line each, for the page */
    double law_scale, law_power;
} rx_qa_run;

/* Small pictures of the same sky for the page: row-major floats, background subtracted. */
typedef struct rx_qa_picture {
    const char *title;
    int width, height;
    const float *pixels;
    float sigma;
} rx_qa_picture;

typedef struct rx_qa_params {
    double match_radius;   /* pixels */
    double match_radius_arcsec; /* as given, 0 when given in pixels: for the page */
    double mag_low, mag_high, mag_step; /* bins; low >= high = from the data */
    int figures;           /* 0: no gnuplot */
    const char *gates;     /* .qa file or NULL */
    const char *gnuplot;   /* program, "gnuplot" */
    unsigned long seed;    /* bootstrap */
} rx_qa_params;

typedef struct rx_qa_input {
    const char *tile;      /* shown name */
    const char *reference; /* shown name */
    int width, height;
    const unsigned char *mask; /* [h][w] pixels where nothing can be found, or NULL: references there do not count */
    double pixel_scale;    /* arcsec, 0 unknown */
    rx_qa_list truth;
    int nruns;
    rx_qa_run *runs;
    int npictures;
    rx_qa_picture *pictures;
    int nrecord;           /* configuration and provenance: name, value */
    const char *const (*record)[2];
} rx_qa_input;

typedef enum rx_verdict { RX_VERDICT_NONE, RX_VERDICT_PASS, RX_VERDICT_FAIL, RX_VERDICT_INSUFFICIENT } rx_verdict;

/* Write the report into the existing folder: report.html, summary.json, bins.ecsv, matches_<run>.fits...
 * *verdict over all gates; `brief` (may be NULL) gets a short text table of recall, precision, MagErr per
 * run for the terminal. Missing gnuplot: a warning, tables and page still come. */
rx_status rx_qa_report(const rx_qa_params *par, const rx_qa_input *input, const char *folder, rx_log *log,
                       rx_verdict *verdict, rx_text *brief, rx_error *err);

#endif
