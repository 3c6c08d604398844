/* Which detections of a tile are right, which are false, and which are neither.
 *
 * Objects have roles. LISTED ones are to be found. RIVALS are other ones that are at least as bright: they compete with
 * the listed ones, one to one, nearest first, so that an object on top of a brighter one is found only when it is
 * resolved from it. OTHERS take what is then left: one to one, too, or, where objects have a reach, whatever lies
 * within that (of rivals as well) or where `covered` says so. What is left after that is false. */
#ifndef RX_LAB_MATCH_H
#define RX_LAB_MATCH_H

#include "base/error.h"
#include "quality/match.h"

typedef enum rx_truth_role { RX_LISTED, RX_RIVAL, RX_OTHER } rx_truth_role;

/* One object that is really there. Pixels from 0, ADU. */
typedef struct rx_lab_object {
    double x, y, flux;
    double radius; /* half-light, round, before the PSF; 0 of a star */
    double snr;    /* in a matched filter on the bare sky: lab.h */
    double reach;  /* 0: none */
    rx_truth_role role;
} rx_lab_object;

typedef struct rx_lab_objects {
    long n;
    rx_lab_object *list; /* owned */
    int width, height;
    const unsigned char
        *covered; /* [height][width], 1: belongs to what was there before; NULL: no such map */
} rx_lab_objects;

typedef enum rx_match_outcome { RX_IS_NEITHER, RX_IS_RIGHT, RX_IS_FALSE } rx_match_outcome;

typedef struct rx_matches {
    long *found;            /* [objects] the detection of a listed one, else -1 */
    long *taken;            /* [detections] the listed object, else -1 */
    unsigned char *outcome; /* [detections] rx_match_outcome; those that are not in use are neither */
} rx_matches;

rx_status rx_lab_match(const rx_lab_objects *objects, const rx_match_list *detections, double radius,
                       rx_matches *dst, rx_error *err);
void rx_matches_free(rx_matches *matches); /* content only */

#endif
