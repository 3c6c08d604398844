/* RESTORE_TYPE AUTO: which of NONE, RL and NET is to do this tile, by sources injected into its own pixels.
 *
 * Candidates are NONE; RL where the PSF is known; NET where the model was made for the tile besides (pipeline/domain.h)
 * and its noise is not more correlated than resampling explains. Each looks for the same objects (check/selfcheck.h) in
 * the same windows of the tile, of 1024 x 1024 pixels in all at most, 500 objects in all (or SELF_CHECK_COUNT), so that
 * the time does not grow with the tile: that of seven runs of a Mpixel. Each does so at the lowest threshold, DETECT_THRESH or above, that makes no more than NOISE_FALSE_MAX false detections per
 * Mpixel of the tile's noise (rx_blankcheck_guard()).
 *
 *   score = objects found - spurious: new detections that are no injected object
 *
 * A candidate comes before another where its score is higher by more than two errors, the root of the number of objects
 * that one of them alone finds and of the spurious of both. RL must so come before NONE, NET before the better of these;
 * ties are NONE's, then RL's. Out is, whatever it finds, a candidate that fails; whose flux scale is off, or whose image
 * leaves pixels unexplained, in a window as it is; or whose magnitudes (QA_MAG, FLAGS 0, S/N above 10) are further
 * from the truth than those of NONE by more than MOST_BIAS, at 95 %.
 *
 * What is injected has the PSF that was found: whether that is right, no injection can say. */
#ifndef RX_CHECK_CHOICE_H
#define RX_CHECK_CHOICE_H

#include "base/error.h"
#include "base/log.h"
#include "check/params.h"
#include "data/record.h"
#include "pipeline/field.h"
#include "pipeline/params.h"
#include "quality/statistics.h"
#include "restore/restore.h"

enum { RX_CHOICE_CANDIDATES = 3 };

typedef struct rx_choice_candidate {
    const rx_restorer *kind;
    char out[200];             /* why it is not taken whatever it finds; "" it may be */
    int tried;                 /* 0: was out before, these are not known */
    double raised;             /* what DETECT_THRESH was multiplied by, */
    double false_rate;         /* and the false detections per Mpixel there; NAN: the noise is not known */
    long found, spurious;      /* objects; new detections that are none */
    rx_estimate bias, scatter; /* of measured - true mag */
} rx_choice_candidate;

typedef struct rx_choice {
    const rx_restorer *taken; /* NULL: there was nothing to choose */
    char why[240];
    long injected;
    double mpixels; /* of the tile that were tried */
    rx_choice_candidate of[RX_CHOICE_CANDIDATES];
} rx_choice;

/* The same for any number of threads. A candidate that fails is out, and without any the choice is NONE. Errors:
 * RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_choice_make(const rx_pipeline_params *params, const rx_check_params *par, const rx_field *field,
                         rx_log *log, rx_choice *dst, rx_error *err);

/* Header facts RXAU*; nothing where nothing was chosen. */
void rx_choice_facts(const rx_choice *choice, rx_record *facts);

#endif
