/* From the source list to what is fitted, and back to what is reported of it. */
#ifndef RX_TEMPLATE_FIT_SOURCES_H
#define RX_TEMPLATE_FIT_SOURCES_H

#include "base/error.h"
#include "template/fit_image.h"
#include "template/joint.h"
#include "template/refine.h"

/* First guesses of position, shape and flux from the list and the restored pixels (or the earlier run in
 * input->shapes); sources: one for each of input->sources. */
void rx_fit_sources_start(const rx_tphot_params *par, const rx_tphot_input *input, rx_fit_source *sources);

/* A point at (x, y) that is in no list. */
rx_fit_source rx_fit_source_added(double x, double y, int added);

/* What the pixels say of a source after the last fit of its group. */
void rx_fit_source_result(const rx_fit_image *image, const int32_t *segments, const rx_fit_source *source,
                          const rx_joint_member *member, double background, rx_tphot_source *dst);

#endif
