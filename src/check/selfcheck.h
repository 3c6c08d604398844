/* SELF_CHECK: what the stage finds of objects injected into copies of this very tile, with no outside
 * catalogue.
 *
 * Objects of known flux, drawn through the tile's own PSF with the photon noise they bring (correlated as the tile's
 * noise is), are added to a copy; background, restoration, detection and measurement run as they did for the
 * catalogue, with the same PSF. Rounds of few objects at a time leave the tile as crowded as it is.
 *
 * What was there before does not count. A detection after the injection is `old` when it has a counterpart
 * in the un-injected run of the same restorer (one to one, nearest first, within MATCH_RADIUS) and less than
 * half of the light in its footprint was injected; light is that of the tile's own pixels above the sky. All
 * others are new. An injected object is found when a new detection lies within MATCH_RADIUS of it, one to
 * one. So a star injected on top of a brighter one, and not resolved from it, is lost; on top of a fainter
 * one it is found, and the detection gets RX_FLAG_CROWDED. A new detection without an injected object
 * (a neighbour broken up, say) counts against the share of the new ones that was injected. That share is no purity
 * of the tile's catalogue: its own false detections are old, and do not count (check/blankcheck.h). */
#ifndef RX_CHECK_SELFCHECK_H
#define RX_CHECK_SELFCHECK_H

#include "check/selfcheck_plan.h"

/* `before`: that restorer on the untouched tile. The content of *dst is
 * freed by rx_selfcheck_free(), also after an error. */
rx_status rx_selfcheck_run(const rx_selfcheck_plan *plan, const rx_restorer *kind, const rx_result *before,
                           rx_log *log, rx_selfcheck *dst, rx_error *err);
void rx_selfcheck_free(rx_selfcheck *check);

/* The lists as quality/ takes them: truth, one run of that name; nothing is copied. */
void rx_selfcheck_input(const rx_selfcheck_plan *plan, const rx_selfcheck *check, const char *name,
                        rx_qa_input *input, rx_qa_run *run);
rx_qa_params rx_selfcheck_qa(const rx_selfcheck_plan *plan);

#endif
