/* From the source list to what is fitted, and back to what is told of it. */
#ifndef RX_TEMPLATE_SUBJECTS_H
#define RX_TEMPLATE_SUBJECTS_H

#include "base/error.h"
#include "template/canvas.h"
#include "template/joint.h"
#include "template/refine.h"

/* First guesses of position, shape and flux from the list and the restored pixels (or the earlier run in
 * input->shapes); subjects [sources->n]. */
void rx_subjects_start(const rx_tphot_params *par, const rx_tphot_input *input, rx_subject *subjects);

/* A point at (x, y) that is in no list. */
rx_subject rx_subject_extra(double x, double y, int added);

/* What the pixels say of a subject after the last fit of its group. */
void rx_subject_tell(const rx_canvas *canvas, const int32_t *segments, const rx_subject *subject,
                     const rx_joint_member *member, double background, rx_tphot_source *dst);

#endif
