/* CLEAN: detections that the wings of a brighter neighbour explain are merged into it. */
#ifndef RX_DETECT_CLEAN_H
#define RX_DETECT_CLEAN_H

#include "base/error.h"
#include "detect/detections.h"
#include "detect/groups.h"
#include "detect/params.h"

/* What cleaning looks at besides the detections. */
typedef struct rx_clean_image {
    const float *pixels; /* [height][width], masked ones 0 */
    const rx_groups *groups;
    const rx_threshold *threshold; /* that groups are above; read where it is relative */
} rx_clean_image;

/* eater[i] = index of the source that ate i, or -1 (to be freed). Of the params: min_area, max_area, clean_param
 * and nthreads.
 *
 * Sources of more than max_area pixels (0: any) take no part. A source's wing is a Moffat profile of exponent
 * clean_param fitted to its area and flux; it eats a fainter one whose min_area-th brightest pixel
 * does not rise above that wing. Sources are taken one after the other as SExtractor does, with the same
 * merged fluxes; sep's own cleaning compares pairs only and does not say which was merged into which. */
rx_status rx_clean(const rx_detect_params *par, const rx_detections *found, const rx_clean_image *image,
                   int **eater, rx_error *err);

#endif
