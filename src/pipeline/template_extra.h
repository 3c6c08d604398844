/* Sources that show only in the residual of the templates. */
#ifndef RX_PIPELINE_TEMPLATE_EXTRA_H
#define RX_PIPELINE_TEMPLATE_EXTRA_H

#include "base/error.h"
#include "base/log.h"
#include "data/psf.h"
#include "data/sources.h"
#include "data/tile.h"
#include "detect/detect.h"
#include "template/template.h"

typedef struct rx_template_extra {
    const rx_detect_params *detect; /* deblending and limits are these */
    double threshold;               /* S/N in a filter that matches the PSF */
    double crowd_threshold;         /* the same in a crowd */
    double crowd_error;             /* of the models' light there, that counts as noise */
    const rx_psf *psf;
    double unit;         /* ADU, of pixels and level (data/unit.h) */
    const float *pixels; /* [h][w] of the tile */
    const uint8_t *mask; /* [h][w] RX_MASK_* bits, of the tile */
    rx_map level;
    const rx_sources *sources; /* the list, with its segments */
    int nthreads;
    rx_log *log;
    /* owned; free with rx_template_extra_clear() */
    rx_sources *found; /* in the order of the positions given, without maps; NULL: not asked */
    struct rx_template_pixel *pixels_found; /* [npixels_found] of their segments */
    size_t npixels_found;
} rx_template_extra;

/* An rx_tphot_more(); user is the rx_template_extra. Only what models of others hide is looked for: what stands alone
 * was there to be seen, and the detection threshold has decided on it. A tenth of the brightest model light within a
 * FWHM counts as noise, for models are not exact; the filter ignores what is smooth, like the halo of a bright star
 * beyond what its PSF holds; nothing within half a FWHM of the border is taken, nor in a source with saturated
 * pixels. In a crowd all that is significant is looked for, at crowd_threshold where that is lower, with crowd_error
 * of that light as noise. What is found in later looks follows what was found before. Errors: RX_SYSTEM, RX_USAGE. */
rx_status rx_template_extra_find(void *user, const rx_tphot_search *look, double (**dst)[2], int *n,
                                 rx_error *err);

/* Append what was found, as far as tphot still holds it, to the list that the templates were made of: numbers and
 * segments go on, pixels without an owner become theirs. Errors: RX_SYSTEM; the list is as before then. */
rx_status rx_template_extra_append(const rx_template_extra *extra, const rx_tphot *tphot, rx_sources *sources,
                                   rx_error *err);

/* Frees what it owns, not the struct. */
void rx_template_extra_clear(rx_template_extra *extra);

#endif
