/* RESTORE_TYPE AUTO: NET, else RL, else NONE; the first that the tile's own model accepts. What they find is decided by the pixels as they
 * were observed (FILTER_TYPE AUTO), so that the one that separates most also finds most (validation/results/auto). */
#ifndef RX_CHECK_CHOICE_H
#define RX_CHECK_CHOICE_H

#include "base/error.h"
#include "pipeline/pipeline.h"

enum { RX_CHOICE_CANDIDATES = 3 };

/* *kind: candidate i. why: "", or why it is not tried on this field: PSF or noise are not known, the model was not made for the
 * tile, or the PSF is narrower than what is restored. Errors: RX_SYSTEM. */
rx_status rx_choice_before(const rx_pipeline_params *params, const rx_field *field, int i,
                           const rx_restorer **kind, char why[200], rx_error *err);

/* why: "", or why what it made of the tile is not taken: its fluxes are not those of the pixels, or what it restored,
 * blurred again, does not explain them. */
void rx_choice_after(const rx_result *result, char why[200]);

#endif
