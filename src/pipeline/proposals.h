/* Detection where the filter follows the PSF (FILTER_TYPE AUTO): a list of proposals, of which those stay that are
 * significant in the pixels as they were observed (fit/significance.h). */
#ifndef RX_PIPELINE_PROPOSALS_H
#define RX_PIPELINE_PROPOSALS_H

#include "base/error.h"
#include "base/log.h"
#include "data/sources.h"
#include "pipeline/field.h"

/* Whether detection on this field goes that way: asked for, and its PSF is known. */
int rx_proposals_wanted(const rx_pipeline_params *params, const rx_field *field);

/* FILTER_TYPE CONV at the threshold that stands for this significance: where the PSF is not known, or not yet. */
void rx_proposals_without_psf(rx_detect_params *par);

/* The filter and threshold that propose: on pixels as they were observed (`plain`) a Gaussian narrower than the PSF,
 * else, and where no PSF is known, that of `par`. *kernel: of the filter, to be freed; NULL: the filter is params'. Errors: RX_SYSTEM. */
rx_status rx_proposals_params(const rx_field *field, int plain, rx_detect_params *par, float **kernel,
                              rx_error *err);

/* Sources below params->detect.significance go; detection_snr of the others is their lambda. Saturated stars that no
 * restorer touched stay. Errors: RX_SYSTEM. */
rx_status rx_proposals_decide(const rx_pipeline_params *params, const rx_field *field, rx_sources *sources,
                              rx_log *log, rx_error *err);

#endif
